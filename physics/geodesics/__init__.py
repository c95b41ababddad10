# SPDX-License-Identifier: GPL-3.0-or-later
"""From a ray at the camera to the sky, to the horizon, or to the equatorial plane.

Imports `kerr` and `numerics`. Hands on `trace_rays` and `trace_disk`; each ray ends with a `Fate`.
"""
