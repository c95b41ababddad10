# SPDX-License-Identifier: GPL-3.0-or-later
"""What comes from outside, as the plain numbers that formulae take: anything else is refused in one sentence."""

from __future__ import annotations

import math
import operator
from typing import Any

from .errors import BlackHoleError

LONGEST = 40


def number(value: Any, what: str) -> float:
    """Return a single real number as a float, NaN and infinities included.

    Parameters
    ----------
    value : object
        An int, a float, numpy's of either, or anything else that is one real number; not text.
    what : str
        How a message names it, with its article.

    Raises
    ------
    BlackHoleError
        If value is not one real number.
    """
    if isinstance(value, str | bytes | bytearray) or getattr(value, "ndim", 0) != 0:
        raise BlackHoleError(f"{_begin(what)} is {shown(value)}; give it as one number.", code="settings.type")
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError) as error:
        raise BlackHoleError(
            f"{_begin(what)} is {shown(value)}; give it as one number.", code="settings.type"
        ) from error


def finite(value: Any, what: str) -> float:
    """Return a single finite number as a float.

    Parameters
    ----------
    value : object
        See `number`.
    what : str
        How a message names it, with its article.

    Returns
    -------
    float

    Raises
    ------
    BlackHoleError
        If value is not one finite real number.
    """
    result = number(value, what)
    if not math.isfinite(result):
        raise BlackHoleError(f"{_begin(what)} is {result:g}; give it as a finite number.", code="settings.range")
    return result


def three(value: Any, what: str) -> tuple[Any, Any, Any]:
    """Return the three parts of a value.

    Parameters
    ----------
    value : object
        Anything that can be iterated, but not text.
    what : str
        How a message names it, with its article.

    Returns
    -------
    tuple of 3 objects

    Raises
    ------
    BlackHoleError
        If value does not have three parts.
    """
    try:
        parts = [] if isinstance(value, str | bytes | bytearray) else list(value)
    except TypeError:
        parts = []
    if len(parts) != 3:
        raise BlackHoleError(f"{_begin(what)} is {shown(value)}; give it as three of a kind.", code="settings.type")
    return parts[0], parts[1], parts[2]


def vector(value: Any, what: str) -> tuple[float, float, float]:
    """Return three numbers as floats, NaN and infinities included.

    Parameters
    ----------
    value : object
        Anything that can be iterated, but not text.
    what : str
        How a message names it, with its article.

    Returns
    -------
    tuple of float, shape (3,)

    Raises
    ------
    BlackHoleError
        If value is not three real numbers.
    """
    x, y, z = (number(part, what) for part in three(value, what))
    return x, y, z


def switch(value: Any, what: str) -> bool:
    """Return yes or no as a bool.

    Parameters
    ----------
    value : object
        A bool, Python's or numpy's.
    what : str
        How a message names it, with its article.

    Returns
    -------
    bool

    Raises
    ------
    BlackHoleError
        If value is not a bool.
    """
    if type(value).__name__ in ("bool", "bool_"):
        return bool(value)
    raise BlackHoleError(f"{_begin(what)} is {shown(value)}; give it as True or False.", code="settings.type")


def whole(value: Any, what: str) -> int:
    """Return a whole number as an int.

    Parameters
    ----------
    value : object
        An int, Python's or numpy's; 3.0 is not one.
    what : str
        How a message names it, with its article.

    Returns
    -------
    int

    Raises
    ------
    BlackHoleError
        If value is not a whole number.
    """
    try:
        if getattr(value, "ndim", 0) == 0 and type(value) is not bool:
            return operator.index(value)
    except TypeError:
        pass
    raise BlackHoleError(f"{_begin(what)} is {shown(value)}; give it as a whole number.", code="settings.type")


def shown(value: Any) -> str:
    """Return a value as a message shows it, on one line and not too long.

    Parameters
    ----------
    value : object

    Returns
    -------
    str
        At most `LONGEST` characters of its `repr`.
    """
    if isinstance(value, int) and abs(value) > 10**LONGEST:
        return "a huge number"
    text = " ".join(repr(value).split())
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}.."


def _begin(what: str) -> str:
    return what[:1].upper() + what[1:]
