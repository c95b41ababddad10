# SPDX-License-Identifier: GPL-3.0-or-later
"""What happens when Blender renders, loads and saves.

Imports `outputs` and below.
"""
