# SPDX-License-Identifier: GPL-3.0-or-later
"""What follows the scene: the World's small map and the thumbnail (`live_preview`), and the viewport's compositor.

Imports `outputs` and below.
"""
