# SPDX-License-Identifier: GPL-3.0-or-later
"""Functions of numbers and vectors that add Math, Vector Math and Mix nodes."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from .builder import Direction, Float, Number, Operand, TreeBuilder, Value, Vector, overload


def _builder_of(*operands: Operand) -> TreeBuilder:
    return next(operand.builder for operand in operands if isinstance(operand, Value))


def _function(operation: str) -> Callable[[Float], Float]:
    """Return the function of one number that a Math node calculates."""

    def apply(value: Float) -> Float:
        return value.builder.math(operation, value)

    return apply


acos = _function("ARCCOSINE")
cos = _function("COSINE")
exp = _function("EXPONENT")
floor = _function("FLOOR")
fraction = _function("FRACT")
nearest_integer = _function("ROUND")
sin = _function("SINE")
sqrt = _function("SQRT")
tanh = _function("TANH")


def log(value: Float) -> Float:
    """Natural logarithm."""
    return value.builder.math("LOGARITHM", value, math.e)


def atan2(y: Float, x: Float) -> Float:
    """Angle of the point (x, y) from the x axis, -pi to pi."""
    return y.builder.math("ARCTAN2", y, x)


def minimum(one: Number, other: Number) -> Float:
    """The smaller of two numbers; `one` where the other is NaN."""
    return _builder_of(one, other).math("MINIMUM", one, other)


def maximum(one: Number, other: Number) -> Float:
    """The larger of two numbers; `one` where the other is NaN."""
    return _builder_of(one, other).math("MAXIMUM", one, other)


def clamp(value: Float, low: Number, high: Number) -> Float:
    """The value within `low` and `high`; `low` where it is NaN."""
    return minimum(high, maximum(low, value))


@overload
def multiply_add(value: Number, factor: Number, addend: Number) -> Float: ...
@overload
def multiply_add(value: Vector, factor: Number | Direction, addend: Direction) -> Vector: ...
def multiply_add(value: Any, factor: Any, addend: Any) -> Any:
    """`value * factor + addend` in one node; with a vector, component by component."""
    builder = _builder_of(value, factor, addend)
    if isinstance(value, Vector):
        return Vector(builder, builder.vector_math("MULTIPLY_ADD", value, factor, addend).outputs["Vector"])
    return builder.math("MULTIPLY_ADD", value, factor, addend)


@overload
def mix(share: Float, start: Number, end: Number) -> Float: ...
@overload
def mix(share: Float, start: Direction, end: Direction) -> Vector: ...
def mix(share: Float, start: Any, end: Any) -> Any:
    """`start` where the share is 0, `end` where it is 1, in proportion in between; exact at both ends."""
    kind = "Vector" if isinstance(start, Vector | tuple) else "Float"
    builder = share.builder
    node = builder.node("ShaderNodeMix")
    node.data_type = kind.upper()
    node.factor_mode = "UNIFORM"
    node.clamp_factor = True
    # The node has sockets of all of its data types; those of the others stay unused.
    inputs = {socket.identifier: socket for socket in node.inputs}
    for name, operand in zip(("Factor_Float", f"A_{kind}", f"B_{kind}"), (share, start, end), strict=True):
        builder.feed(inputs[name], operand)
    return builder.value(next(socket for socket in node.outputs if socket.identifier == f"Result_{kind}"))


@overload
def where(condition: Float, chosen: Number, otherwise: Number) -> Float: ...
@overload
def where(condition: Float, chosen: Direction, otherwise: Direction) -> Vector: ...
def where(condition: Float, chosen: Any, otherwise: Any) -> Any:
    """`chosen` where the condition is 1, `otherwise` where it is 0, in proportion in between."""
    return mix(condition, otherwise, chosen)


def combine(x: Number, y: Number, z: Number) -> Vector:
    """Vector of three numbers, at least one of them not a constant."""
    return _builder_of(x, y, z).combine(x, y, z)
