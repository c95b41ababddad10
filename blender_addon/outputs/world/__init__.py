# SPDX-License-Identifier: GPL-3.0-or-later
"""Output: World. The World is looked up along bent rays."""
