# SPDX-License-Identifier: GPL-3.0-or-later
"""What tests of several rooms share."""

from collections.abc import Iterator

import pytest

from physics.matter import turbulence


@pytest.fixture(scope="module")
def small_patterns() -> Iterator[None]:
    """Patterns of turbulence in milliseconds instead of a second, where their detail does not matter."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(turbulence, "COLUMNS", 256)
        patch.setattr(turbulence, "ROWS", 64)
        yield
    turbulence._fine.cache_clear()
    turbulence._coarse.cache_clear()
