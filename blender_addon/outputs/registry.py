# SPDX-License-Identifier: GPL-3.0-or-later
"""The outputs that there are, and which one a scene has. Nobody else asks which it is."""

import bpy

from ..settings import output_choice
from .protocol import Output

_outputs: dict[str, Output] = {}


def add(output: Output) -> None:
    """Offer an output to artists; the first one added is that of new scenes."""
    _outputs[output.identifier] = output
    output_choice.add(output.identifier, output.label, output.description, output.number)


def remove(output: Output) -> None:
    """Offer it no longer."""
    del _outputs[output.identifier]
    output_choice.remove(output.identifier)


def get(identifier: str) -> Output:
    """Return the output of an identifier."""
    return _outputs[identifier]


def default() -> Output:
    """Return the output of new scenes."""
    return next(iter(_outputs.values()))


def of(scene: bpy.types.Scene) -> Output:
    """Return a scene's output; the default one where it names an output that is not there."""
    return _outputs.get(scene.umbra.output) or default()


def every() -> list[Output]:
    """Return all outputs."""
    return list(_outputs.values())
