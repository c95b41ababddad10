# SPDX-License-Identifier: GPL-3.0-or-later
"""Crossings of the disk's plane to passes: radius, azimuth, redshift, angle and coverage per pixel.

Imports `sampling` and below. Hands on `DiskPainting` and `DiskPass`.
"""
