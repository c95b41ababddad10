# SPDX-License-Identifier: GPL-3.0-or-later
"""The live preview: a small map and a thumbnail that follow the scene.

Imports `outputs` and below.
"""
