# SPDX-License-Identifier: GPL-3.0-or-later
"""What a lens makes of light: most of it stays where it is, and a small share is spread around it.

A point's image has a core and faint wings that fall off like a power of the distance (Spencer, Shirley, Zimmerman &
Greenberg 1995, *Physically-based glare effects for digital images*, for the eye; lenses are alike). Here the wings are
a sum of Gaussians, each of which conserves light. Spikes, as a diaphragm makes them, are Gaussians along one axis.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Spread:
    """A share of the light, and the Gaussian by which it is spread."""

    share: float
    """0 to 1; the shares of a kind of glare add up to less than 1."""
    across: float
    """Standard deviation along rows, as a share of the picture's height."""
    down: float
    """The same along columns; 0 where a spike lies along the rows."""


OFF, SUBTLE, FILM = 0, 1, 2
"""The kinds of glare; the values of `sky_settings.GLARE`."""


def _round(share: float, width: float) -> Spread:
    return Spread(share, width, width)


def _cross(share: float, width: float) -> tuple[Spread, Spread]:
    """Return spikes to the four sides, which share the light."""
    return Spread(0.5 * share, width, 0.0), Spread(0.5 * share, 0.0, width)


GLARES: dict[int, tuple[Spread, ...]] = {
    OFF: (),
    SUBTLE: (_round(0.030, 0.0025), _round(0.012, 0.012), _round(0.006, 0.06)),
    FILM: (
        _round(0.080, 0.0028),
        _round(0.040, 0.014),
        _round(0.024, 0.075),
        *_cross(0.030, 0.012),
        *_cross(0.020, 0.06),
    ),
}
"""Kind -> how its light is spread, from the narrowest on."""
