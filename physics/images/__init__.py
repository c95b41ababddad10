# SPDX-License-Identifier: GPL-3.0-or-later
"""EXR and PNG files, written whole or not at all.

`exr` and `png` are for all; behind `exr` stands one of two libraries, `openexr_library` or `openimageio_library`, each
the only module that imports it.

Imports `numerics` only.
"""
