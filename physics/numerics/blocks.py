# SPDX-License-Identifier: GPL-3.0-or-later
"""Long arrays in blocks, which bounds the memory that is needed at a time."""

from __future__ import annotations

from collections.abc import Iterator

# Rays traced at a time: up to 1 kB per ray is needed, for methods that take steps. Smaller blocks waste time on the few
# rays of each that need the most work; larger ones do not fit in the cache.
BLOCK_SIZE = 32768


def blocks(count: int) -> Iterator[slice]:
    """Yield slices that cover a number of items in order.

    Parameters
    ----------
    count : int
        >= 0.

    Yields
    ------
    slice
        Of at most `BLOCK_SIZE` items.
    """
    for start in range(0, count, BLOCK_SIZE):
        yield slice(start, min(start + BLOCK_SIZE, count))
