# SPDX-License-Identifier: GPL-3.0-or-later
"""EXR and PNG files, whole or not at all. `exr` is the one module that imports OpenEXR.

Imports `numerics` only.
"""
