# SPDX-License-Identifier: GPL-3.0-or-later
"""The choices of the setting Output. Outputs add themselves, so that this room need not know them."""

# Blender keeps no copy of these strings, so the list must live as long as the property.
_items: list[tuple[str, str, str, int]] = []


def add(identifier: str, label: str, description: str, number: int) -> None:
    """Offer a choice; Blender saves its number."""
    _items.append((identifier, label, description, number))


def remove(identifier: str) -> None:
    """Offer it no longer."""
    _items[:] = [item for item in _items if item[0] != identifier]


def items(_settings: object, _context: object) -> list[tuple[str, str, str, int]]:
    """Return the choices, as Blender's enum properties ask for them."""
    return _items
