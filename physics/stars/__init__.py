# SPDX-License-Identifier: GPL-3.0-or-later
"""Stars as points: all images of each star that a hole makes, and a layer of light that they are drawn into.

From a catalog to a layer: `catalog_file` reads stars, `local_sky` tabulates the sky of one place, `search` and
`refinement` find the stars' images in it, `projection` brings them into a camera's picture and `layer` draws them.
Imports `maps`, `light`, `shot`, `geodesics`, `kerr` and `numerics`. Hands on `StarLayer` and `StarBaker`.
"""
