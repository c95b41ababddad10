# SPDX-License-Identifier: GPL-3.0-or-later
"""How the black hole comes into the picture: one protocol, and one package for each output.

Imports `bake`, `nodes` and below. The outputs do not import one another.
"""
