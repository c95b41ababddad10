# SPDX-License-Identifier: GPL-3.0-or-later
"""EXR and PNG files, written whole or not at all. `exr` is the only module that imports OpenEXR.

Imports `numerics` only.
"""
