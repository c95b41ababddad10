# SPDX-License-Identifier: GPL-3.0-or-later
"""The properties that an artist sets and Blender saves.

Imports `core` only. Changes are announced, not acted on.
"""
