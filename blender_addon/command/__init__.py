# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: `blender -c umbra`.

Imports `bake`, `outputs` and below.
"""
