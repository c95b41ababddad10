# SPDX-License-Identifier: GPL-3.0-or-later
"""One row of a table of settings: all that is said about a setting, for every place that shows it or asks for it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

from ..numerics.checks import shown


@dataclass(frozen=True)
class Choice:
    """One of the values of a setting that is not a number."""

    value: str | int
    """The value itself."""
    identifier: str
    """The item of Blender's enum."""
    number: int
    """The item's number, which .blend files hold: it never changes."""
    label: str
    description: str


@dataclass(frozen=True)
class Setting:
    """A number within limits, or one of several choices."""

    label: str
    """As Blender shows it."""
    description: str
    """One sentence without its period."""
    default: float | str | int
    low: float = -math.inf
    high: float = math.inf
    soft_low: float | None = None
    """Where Blender's slider begins, if not at `low`."""
    soft_high: float | None = None
    step: float = 0.03
    """By how much a click on Blender's field changes the value."""
    unit: str = ""
    subtype: Literal["NONE", "FACTOR", "COLOR_TEMPERATURE"] = "NONE"
    """Blender's subtype of the property and of the socket."""
    socket: str = ""
    """Name of the node groups' input."""
    option: str = ""
    """Option of ``python -m physics``: of the sky of ``render``, of matter of ``bake``."""
    is_added: bool = False
    """On the command line the value is added to that of the preset, which it replaces otherwise."""
    choices: tuple[Choice, ...] = ()

    @property
    def sentence(self) -> str:
        """The description with the unit, unless it names that itself."""
        return self.description if self.unit in self.description else f"{self.description} ({self.unit})"

    def problem(self, value: Any) -> str | None:
        """Return what is wrong with a value, as the end of a sentence that begins with the setting's name.

        Parameters
        ----------
        value : object
            Of a setting with choices, anything; otherwise a finite number.

        Returns
        -------
        str or None
            None if the value is one of the choices, or within the limits.
        """
        if self.choices:
            allowed = [choice.value for choice in self.choices]
            known = type(value) in (str, int) and value in allowed
            return None if known else f"is {shown(value)}; choose {' or '.join(map(str, allowed))}"
        if self.low <= value <= self.high:
            return None
        unit = f" {self.unit}" if self.unit else ""
        return f"is {value:g}{unit}; give it a value from {self.low:g} to {self.high:g}{unit}"

    def identifier(self, value: str | int) -> str:
        """Return the item of Blender's enum that stands for a choice's value."""
        return next(choice.identifier for choice in self.choices if choice.value == value)
