# SPDX-License-Identifier: GPL-3.0-or-later
"""By what a map is known: a hash of its parameters, and whether two sets of parameters give the same map.

The same scene does not give the same last digits everywhere: numpy's linear algebra rounds by processor, and Blender's
matrices are single precision and come from another build's sines. So the hash is of rounded numbers, far above double
precision's noise. Two numbers beside a border between roundings still hash differently, and single precision's noise is
larger; `agree` compares the numbers themselves, and decides.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from typing import Any

# Raised whenever the same parameters would give other pixels, so that maps baked before count as stale: of maps without
# a disk, and of those with one. With version 1, light of negative energy met the disk at wrong azimuths.
BAKE_VERSION, DISK_BAKE_VERSION = 1, 2

# Decimals that are hashed, of what is worked out from matrices: rotations and velocities have noise of 1e-15, positions
# of 1e-15 times the distance, up to 1e-9 M for a camera a million M away.
_DECIMALS = {"camera_position": 9, "velocity": 10, "camera_to_hole": 10, "hole_to_world": 10}

# How far numbers that mean the same may be apart: some three units in the last place of a single-precision number near
# 1, 1.2e-7 each. As an angle it is a 600th of a pixel of a picture 8192 pixels wide seen through a 50 mm lens.
NOISE = 4e-7

# What is set as it is, and never worked out: the accuracy asked for.
_EXACT = frozenset({"tolerance", "interpolation"})


def bake_version(values: Mapping[str, Any]) -> int:
    """Return the version of the maps that are made from these parameters today."""
    return DISK_BAKE_VERSION if values.get("disk") else BAKE_VERSION


def hash_of(values: Mapping[str, Any], version: int | None = None) -> str:
    """Return the hash of a map's parameters.

    Parameters
    ----------
    values : mapping
        Parameters as plain JSON values, from `WarpMapParameters.to_metadata`.
    version : int, optional
        Of what is made from them; today's by default.

    Returns
    -------
    str
        SHA-256, in hexadecimal, of the rounded parameters and of the version of what is made from them.
    """
    rounded = {name: _rounded(value, _DECIMALS.get(name)) for name, value in values.items()}
    return _digest(rounded, bake_version(values) if version is None else version)


def version_of(text: str, values: Mapping[str, Any]) -> int | None:
    """Return the version of the maps that a hash belongs to, or None if it is not a hash of these parameters.

    Parameters
    ----------
    text : str
        From a map's header. Version 0.1.0 hashed all digits of the parameters; its hashes are known too.
    values : mapping
        The header's parameters.
    """
    for version in range(bake_version(values), 0, -1):
        if text in (hash_of(values, version), _digest(values, version)):
            return version
    return None


def agree(made: Mapping[str, Any], wanted: Mapping[str, Any]) -> bool:
    """Return whether two sets of parameters differ by the noise of single-precision arithmetic only.

    Parameters
    ----------
    made, wanted : mapping
        Parameters as plain JSON values, from `WarpMapParameters.to_metadata`.

    Notes
    -----
    Positions may differ by `NOISE` times the distance from the hole; all else by `NOISE`, or `NOISE` times its size if
    that is larger.
    """
    if made.keys() != wanted.keys():
        return False
    place = wanted["camera_position"]
    distance = max(1.0, *(abs(each) for each in place))
    return alike(made["camera_position"], place, distance) and all(
        made[name] == value if name in _EXACT else alike(made[name], value)
        for name, value in wanted.items()
        if name != "camera_position"
    )


def _digest(values: Mapping[str, Any], version: int) -> str:
    text = json.dumps({"bake_version": version, **values}, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _rounded(value: Any, decimals: int | None) -> Any:
    """Round all numbers of nested lists; the sum makes 0 of -0."""
    if decimals is None:
        return value
    if isinstance(value, list):
        return [_rounded(each, decimals) for each in value]
    return round(value, decimals) + 0.0


def alike(made: Any, wanted: Any, scale: float = 1.0) -> bool:
    """Return whether two plain JSON values agree: numbers within the noise of numbers of a size, or of their own, all
    else exactly.

    Parameters
    ----------
    made, wanted : object
        Plain JSON values.
    scale : float
        The size of numbers whose noise is allowed.
    """
    if isinstance(wanted, Mapping):
        return (
            isinstance(made, Mapping)
            and made.keys() == wanted.keys()
            and all(alike(made[key], each) for key, each in wanted.items())
        )
    if isinstance(wanted, list):
        return (
            isinstance(made, list)
            and len(made) == len(wanted)
            and all(alike(one, other, scale) for one, other in zip(made, wanted, strict=True))
        )
    if isinstance(wanted, float) and isinstance(made, (int, float)) and not isinstance(made, bool):
        return abs(made - wanted) <= NOISE * max(scale, abs(wanted))
    return bool(made == wanted) and type(made) is type(wanted)
