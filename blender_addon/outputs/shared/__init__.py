# SPDX-License-Identifier: GPL-3.0-or-later
"""What several outputs need: finding nodes in the compositor, the disk's nodes and its light."""
