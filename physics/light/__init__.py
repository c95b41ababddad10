# SPDX-License-Identifier: GPL-3.0-or-later
"""Colors and brightness: black bodies, redshift, the disk's flux and look, stars and the Milky Way.

Imports `shot` and below. Knows nothing of pixels.
"""
