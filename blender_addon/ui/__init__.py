# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels and operators. Operators report; the work is done elsewhere.

Imports every room below.
"""
