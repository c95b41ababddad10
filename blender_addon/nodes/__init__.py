# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups built by code: from maps to pictures.

`*_group` modules declare the sockets and versions of a group and hand on functions that find, build and repair it;
`*_nodes` modules say what is inside, as expressions of the values in `builder`. Imports `core`. Knows nodes and
sockets, not scenes.
"""
