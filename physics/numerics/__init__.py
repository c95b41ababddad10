# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays, checks of input, errors, the sphere, Runge-Kutta integration and elliptic functions.

Imports no other room.
"""
