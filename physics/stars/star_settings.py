# SPDX-License-Identifier: GPL-3.0-or-later
"""What a layer of stars is made from, and by what it is known."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from ..geodesics.tracer import DEFAULT_METHOD, DEFAULT_TOLERANCE
from ..numerics.checks import finite, number, vector
from ..numerics.errors import BlackHoleError
from ..shot.identity import alike
from ..shot.map_parameters import DEFAULT_INTERPOLATION, WarpMapParameters

LAYER_VERSION = 1
"""Raised whenever the same parameters would give other light."""


@dataclass(frozen=True)
class StarSettings:
    """How stars are drawn.

    Parameters
    ----------
    rotation : tuple of float, shape (3,)
        XYZ Euler angles (radians) of the sky, as in a Mapping node (type Point) of a World's nodes.
    magnitude_limit : float
        The faintest visual magnitude that is drawn; infinity for no limit.
    color_amount, brightness_amount : float
        0 (off) to 1 (physical): how much the redshift changes color and brightness.
    catalog : str
        The name of the catalog, for the file's header.
    catalog_digest : str
        Of the catalog's content, from `catalog_digest`; empty for the built-in one.
    """

    rotation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    magnitude_limit: float = math.inf
    color_amount: float = 1.0
    brightness_amount: float = 1.0
    catalog: str = "XHIP"
    catalog_digest: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "rotation", vector(self.rotation, "the rotation of the sky"))
        if not all(math.isfinite(angle) for angle in self.rotation):
            raise BlackHoleError("The rotation of the sky must be three finite numbers.", code="settings.range")
        if math.isnan(number(self.magnitude_limit, "the magnitude limit")):
            raise BlackHoleError("The magnitude limit is not a number; give one such as 6.5.", code="settings.range")
        for name in ("color_amount", "brightness_amount"):
            if not 0.0 <= finite(getattr(self, name), "an amount of redshift") <= 1.0:
                raise BlackHoleError(
                    f"An amount of redshift is {getattr(self, name):g}; give it a value from 0 to 1.",
                    code="settings.range",
                )

    def to_metadata(self) -> dict[str, Any]:
        """Return all settings as plain JSON values; None stands for no limit of magnitude."""
        values = {**asdict(self), "rotation": list(self.rotation)}
        if math.isinf(self.magnitude_limit):
            values["magnitude_limit"] = None
        return values

    def with_catalog(self, name: str, digest: str) -> StarSettings:
        """Return the settings with the name and the digest of a catalog."""
        return replace(self, catalog=name, catalog_digest=digest)

    @classmethod
    def from_metadata(cls, values: Mapping[str, Any]) -> StarSettings:
        """Return the settings that `to_metadata` was made from."""
        limit = values["magnitude_limit"]
        return cls(**{**values, "magnitude_limit": math.inf if limit is None else limit})


@dataclass(frozen=True)
class StarParameters:
    """What a layer of stars is made from.

    Parameters
    ----------
    view : WarpMapParameters
        From `star_view`.
    settings : StarSettings
    table : path, optional
        The CSV file of the catalog; the built-in catalog by default. The settings have its digest.
    """

    view: WarpMapParameters
    settings: StarSettings
    table: Path | None = None

    @property
    def map_size(self) -> tuple[int, int]:
        """Width and height of the layer in pixels."""
        return self.view.map_size

    @property
    def hash(self) -> str:
        """SHA-256, in hexadecimal, of the view, the settings and the version of what is made from them."""
        return star_hash(self.view.hash, self.settings)

    def agrees_with(self, made: Mapping[str, Any]) -> bool:
        """Return whether the ``stars`` of a layer's metadata are these settings, but for noise and the table's name."""
        return alike(_content(made), _content(self.settings.to_metadata()))


def _content(settings: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in settings.items() if name != "catalog"}


def star_hash(view_hash: str, settings: StarSettings) -> str:
    """Return what a layer is known by: SHA-256 of its view's hash and its settings, in hexadecimal."""
    known = {"version": LAYER_VERSION, "view": view_hash, **_content(settings.to_metadata())}
    return hashlib.sha256(json.dumps(known, sort_keys=True).encode()).hexdigest()


def star_view(parameters: WarpMapParameters) -> WarpMapParameters:
    """Return what of a map's parameters its stars depend on: all but samples, accuracy and disk, which are plain."""
    return replace(
        parameters,
        supersampling=1,
        disk=None,
        tolerance=DEFAULT_TOLERANCE,
        interpolation=DEFAULT_INTERPOLATION,
        method=DEFAULT_METHOD,
    )
