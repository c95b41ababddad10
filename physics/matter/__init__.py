# SPDX-License-Identifier: GPL-3.0-or-later
"""The light of matter around the hole, rendered by numpy: one layer per frame that is laid over the sky.

Imports `maps` and below. Hands on `LightParameters`, `LightLayer`, `LightBaker` and `render_matter`.
"""
