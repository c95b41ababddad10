# SPDX-License-Identifier: GPL-3.0-or-later
"""The sky around the hole, from a scene's World or an image: how it is read, followed, and made a picture of.

Does not import the rest of `scene`. Hands on `environment`, which reads a sky, `panorama`, `sky_frames`, `node_paths`.
"""
