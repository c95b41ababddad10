# SPDX-License-Identifier: GPL-3.0-or-later
"""Map files: their names, baking them, claiming them among processes, listing and cleaning them.

Imports `scene` and below. Does not know what a map is used for.
"""
