# SPDX-License-Identifier: GPL-3.0-or-later
"""Output: Compositor. The sky is bent behind the render by a node group."""
