# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays to maps: warp maps for the compositor, exit maps for a camera's rays, world maps for the World.

Imports `disk_passes`, `sampling` and below. Hands on the maps and `MapBaker`, which shares rays between frames.
"""
