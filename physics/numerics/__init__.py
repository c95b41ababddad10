# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays and blocks, long work, checks of input, errors, angles, the sphere, Runge-Kutta, elliptic functions.

Imports no other room.
"""
