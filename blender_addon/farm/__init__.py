# SPDX-License-Identifier: GPL-3.0-or-later
"""Copies of a file for render farms, job templates, and the script that farms run.

Imports `outputs` and below.
"""
