# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture that a map and a sky make, computed by numpy: what the node groups are checked against.

Imports `light`, `disk_passes` and below.
"""
