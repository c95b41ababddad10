# SPDX-License-Identifier: GPL-3.0-or-later
"""What every room needs: the physics, errors, messages and the state of the session.

Imports `physics` only, through its API.
"""
