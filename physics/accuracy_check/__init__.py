# SPDX-License-Identifier: GPL-3.0-or-later
"""How exact a map in a file is: some of its pixels are traced again by the reference method.

Imports `files` and below. Hands on `check_accuracy`.
"""
