# SPDX-License-Identifier: GPL-3.0-or-later
"""The Kerr spacetime: metric, observers, the constants of motion of a ray, the critical curve, orbiting matter.

Imports `numerics` only. Hands on `Observer` and `Rays`.
"""
