# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps to and from EXR files, with a header that says what they were made from, and the check of a file.

Imports `maps`, `images` and below. Hands on readers, writers and `check_map`.
"""
