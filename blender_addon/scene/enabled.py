# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether collections let an object be seen."""

import bpy


def is_enabled(thing: bpy.types.Object, layer: bpy.types.LayerCollection, setting: str) -> bool:
    """Return whether an object is in a collection of a view layer that is not disabled, nor in one that is.

    Parameters
    ----------
    thing : Object
        The object.
    layer : LayerCollection
        The view layer's.
    setting : str
        ``hide_render`` or ``hide_viewport``. What is only hidden in a viewport, by its eye, is enabled.
    """
    if getattr(layer.collection, setting):
        return False
    here = not layer.exclude and layer.collection.objects.get(thing.name) == thing
    return here or any(is_enabled(thing, child, setting) for child in layer.children)
