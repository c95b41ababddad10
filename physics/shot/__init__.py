# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything that one map depends on, as plain numbers, and the hash by which a map is known.

Imports `geodesics` and below. Hands on `WarpMapParameters` with its camera and its disk.
"""
