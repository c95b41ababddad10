# SPDX-License-Identifier: GPL-3.0-or-later
"""Output: Cycles Lens. The camera's own rays are bent by its shader."""
