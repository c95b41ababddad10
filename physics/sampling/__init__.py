# SPDX-License-Identifier: GPL-3.0-or-later
"""Pixels to rays: which rays a picture needs, and where rays between them may be interpolated.

Imports `shot` and below. Hands on `View`, `Tiles` and the search for the shadow's edge.
"""
