# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups, built by code and stamped with a version.

Imports `core`. Knows nodes and sockets, not scenes.
"""
