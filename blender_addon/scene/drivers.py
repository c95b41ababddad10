# SPDX-License-Identifier: GPL-3.0-or-later
"""Drivers that Blender cannot evaluate.

It sets their properties to 0 and goes on: the picture would be another one without a word. A driver that fails is
marked; one whose result is not finite is not, so its arithmetic is done here once more.
"""

import ast
import math
import operator
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import bpy

from ..core.errors import SceneError
from .placement import with_causes

# What an expression may use besides its variables and what scripts have registered for drivers.
_BUILTINS: dict[str, Callable[..., Any]] = {each.__name__: each for each in (abs, float, int, max, min, pow, round)}
_UNARY: dict[type[ast.unaryop], Callable[[Any], Any]] = {ast.UAdd: operator.pos, ast.USub: operator.neg}
_BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
}


def check(
    owner: bpy.types.ID | None,
    frame: int,
    depsgraph: bpy.types.Depsgraph | None = None,
    prefixes: Iterable[str] = ("",),
) -> None:
    """Refuse a datablock with a driver that fails, or whose result is not a finite number.

    Parameters
    ----------
    owner : ID, optional
        The (original) datablock.
    frame : int
        The frame at which the scene stands.
    depsgraph : Depsgraph, optional
        What has evaluated the drivers: failures in a render are noted there alone.
    prefixes : iterable of str
        What the data paths of the properties begin with that count.

    Raises
    ------
    SceneError
        The sentence names datablock and property.
    """
    animation = None if owner is None else owner.animation_data
    if owner is None or animation is None:
        return
    beginnings = tuple(prefixes)
    evaluated = None if depsgraph is None else owner.evaluated_get(depsgraph).animation_data
    for curve in animation.drivers if evaluated is None else evaluated.drivers:
        if curve.mute or not curve.data_path.startswith(beginnings):
            continue
        if curve.driver.is_valid and curve.is_valid and _is_finite(curve.driver, frame):
            continue
        expression = f" ({curve.driver.expression})" if curve.driver.type == "SCRIPTED" else ""
        raise SceneError(
            f'The driver of {_property(owner, curve)} of {type(owner).__name__.lower()} "{owner.name}" cannot be '
            f"evaluated{expression}, so that Blender takes 0: mend it in the Drivers Editor, allow its script to run, "
            "or delete it.",
            code="settings.driver",
        )


def check_objects(objects: Iterable[bpy.types.Object], frame: int, depsgraph: bpy.types.Depsgraph) -> None:
    """Refuse broken drivers of objects, of their cameras, and of the objects that place them; see `check`."""
    for each in with_causes(objects):
        check(each, frame, depsgraph)
        if isinstance(each.data, bpy.types.Camera):
            check(each.data, frame, depsgraph)


def _property(owner: bpy.types.ID, curve: bpy.types.FCurve) -> str:
    """A property as a sentence names it: its label where it has one, and its path."""
    parent, _, name = curve.data_path.rpartition(".")
    path = curve.data_path
    try:
        holder = owner.path_resolve(parent) if parent else owner
        found = holder.bl_rna.properties.get(name)
    except (ValueError, AttributeError):
        found = None
    if found is not None and getattr(found, "is_array", False):
        path += f"[{curve.array_index}]"
    return path if found is None else f"{found.name} ({path})"


# --- results that are not finite ------------------------------------------------------------------


def _is_finite(driver: bpy.types.Driver, frame: int) -> bool:
    """Whether a driver's result is a finite number, or cannot be known here."""
    values = {each.name: _value(each) for each in driver.variables}
    known = {name: value for name, value in values.items() if value is not None}
    if not all(math.isfinite(value) for value in known.values()):
        return False
    if driver.type != "SCRIPTED":
        return True
    # Not from bpy.app.driver_namespace: once it was asked for, Blender 4.5 as a Python module does not end.
    names = {**_BUILTINS, **vars(math), "frame": float(frame), **known}
    for unknown in values.keys() - known.keys():
        names.pop(unknown, None)
    try:
        return math.isfinite(_evaluated(ast.parse(driver.expression.strip(), mode="eval").body, names))
    except (ArithmeticError, ValueError):
        return False
    except Exception:  # noqa: BLE001  an expression of another kind
        return True


def _evaluated(node: ast.expr, names: Mapping[str, Any]) -> Any:
    """The value of an expression of numbers, names and calls; any other raises."""
    match node:
        case ast.Constant(value=value):
            return value
        case ast.Name(id=name):
            return names[name]
        case ast.UnaryOp(op=sign, operand=operand):
            return _UNARY[type(sign)](_evaluated(operand, names))
        case ast.BinOp(left=left, op=sign, right=right):
            return _BINARY[type(sign)](_evaluated(left, names), _evaluated(right, names))
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            return names[name](*(_evaluated(each, names) for each in arguments))
    raise TypeError(node)


def _value(variable: bpy.types.DriverVariable) -> float | None:
    """A variable's value, None where it is not that of a single property."""
    target = variable.targets[0]
    if variable.type != "SINGLE_PROP" or target.id is None:
        return None
    try:
        return float(target.id.path_resolve(target.data_path))
    except (ValueError, TypeError):
        return None
