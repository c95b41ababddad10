# SPDX-License-Identifier: GPL-3.0-or-later
"""Node trees written as expressions: `a * b + c` adds a Multiply and an Add node.

`Float` and `Vector` stand for what a socket will hold when the tree is evaluated. Their operators, the functions in
`arithmetic` and those in `image_nodes` add nodes and return the values of their outputs. Nodes are added in the order
in which Python evaluates an expression, with their operands in the order in which they are written.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Self, TypeAlias

import bpy

if TYPE_CHECKING:
    from typing import overload as overload
else:

    def overload(function: object) -> object:
        """Stand in for typing's, which keeps each function, and with it `bpy`, for ever.

        Blender 4.5 as a Python module hangs when the process ends before `bpy` is released.
        """
        return function


Socket: TypeAlias = bpy.types.NodeSocket
Triple: TypeAlias = tuple[float, float, float]
Number: TypeAlias = "Float | float"
Direction: TypeAlias = "Vector | Triple"
Operand: TypeAlias = "Value | float | Sequence[float]"

_COLUMN_WIDTH = 190.0
_ROW_HEIGHT = 190.0
_NODES_IN_A_COLUMN = 5
_FRAME_GAP = 120.0


class TreeBuilder:
    """Adds nodes to a tree, laid out from left to right, one frame after the other.

    Parameters
    ----------
    tree : bpy.types.NodeTree
        A compositor or shader node tree.
    """

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self.tree = tree
        self._frame: bpy.types.Node | None = None
        self._next_x = 0.0
        self._count_in_frame = 0
        self._places: dict[str, tuple[float, float]] = {}

    @contextmanager
    def frame(self, label: str) -> Iterator[None]:
        """Put the nodes added inside this context into a labeled frame."""
        self._close_columns()
        frame = self.tree.nodes.new("NodeFrame")
        frame.label = label
        self._frame = frame
        try:
            yield
        finally:
            self._close_columns()
            self._frame = None

    def _close_columns(self) -> None:
        columns = -(-self._count_in_frame // _NODES_IN_A_COLUMN)
        if columns:
            self._next_x += columns * _COLUMN_WIDTH + _FRAME_GAP
        self._count_in_frame = 0

    def node(self, kind: str, label: str = "") -> bpy.types.Node:
        """Add a node of the type `kind` at the next free place."""
        node = self.tree.nodes.new(kind)
        node.label = label
        column, row = divmod(self._count_in_frame, _NODES_IN_A_COLUMN)
        if self._frame is not None:
            node.parent = self._frame
        self._places[node.name] = (self._next_x + column * _COLUMN_WIDTH, -row * _ROW_HEIGHT)
        self._count_in_frame += 1
        return node

    def arrange(self) -> None:
        """Put the nodes that were added to their places, all at once: Blender updates a tree after each single one."""
        nodes = self.tree.nodes
        places = [self._places.get(node.name, tuple(node.location)) for node in nodes]
        nodes.foreach_set("location", [number for place in places for number in place])

    def value(self, socket: Socket) -> Float | Vector:
        """Wrap an output socket: a float as `Float`, a vector or a color as `Vector`."""
        return Float(self, socket) if socket.type == "VALUE" else Vector(self, socket)

    def feed(self, target: Socket, operand: Operand) -> None:
        """Link a value to an input socket, or set the input's own value to a constant."""
        if isinstance(operand, Value):
            self.tree.links.new(operand.socket, target)
        else:
            target.default_value = operand

    def math(self, operation: str, *operands: Number) -> Float:
        """Add a Math node."""
        node = self.node("ShaderNodeMath")
        node.operation = operation
        for target, operand in zip(node.inputs, operands, strict=False):
            self.feed(target, operand)
        return Float(self, node.outputs[0])

    def vector_math(self, operation: str, *operands: Operand, scale: Number | None = None) -> bpy.types.Node:
        """Add a Vector Math node; its outputs are "Vector" and "Value"."""
        node = self.node("ShaderNodeVectorMath")
        node.operation = operation
        for target, operand in zip(node.inputs, operands, strict=False):
            self.feed(target, operand)
        if scale is not None:
            self.feed(node.inputs["Scale"], scale)
        return node

    def rotation_rows(self, euler: Vector) -> list[Vector]:
        """Rows of the matrix that rotates about the origin by XYZ Euler angles in radians."""
        rows = []
        for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)):
            node = self.node("ShaderNodeVectorRotate")
            node.rotation_type = "EULER_XYZ"
            node.invert = True
            self.feed(node.inputs["Vector"], axis)
            self.feed(node.inputs["Rotation"], euler)
            rows.append(Vector(self, node.outputs[0]))
        return rows

    def combine(self, x: Number, y: Number, z: Number) -> Vector:
        """Add a Combine XYZ node."""
        node = self.node("ShaderNodeCombineXYZ")
        for target, operand in zip(node.inputs, (x, y, z), strict=True):
            self.feed(target, operand)
        return Vector(self, node.outputs[0])


class Value:
    """What an output socket will hold.

    Parameters
    ----------
    builder : TreeBuilder
        Of the tree that has the socket.
    socket : bpy.types.NodeSocket
        An output socket.
    """

    __slots__ = ("builder", "socket")

    def __init__(self, builder: TreeBuilder, socket: Socket) -> None:
        self.builder = builder
        self.socket = socket

    def labeled(self, text: str) -> Self:
        """Label the node that the value comes from."""
        self.socket.node.label = text
        return self


class Float(Value):
    """One number per pixel or ray. Constants may be written as Python's numbers."""

    __slots__ = ()

    def __add__(self, other: Number) -> Float:
        return self.builder.math("ADD", self, other)

    def __radd__(self, other: float) -> Float:
        return self.builder.math("ADD", other, self)

    def __sub__(self, other: Number) -> Float:
        return self.builder.math("SUBTRACT", self, other)

    def __rsub__(self, other: float) -> Float:
        return self.builder.math("SUBTRACT", other, self)

    @overload
    def __mul__(self, other: Number) -> Float: ...
    @overload
    def __mul__(self, other: Direction) -> Vector: ...
    def __mul__(self, other: Number | Direction) -> Float | Vector:
        if isinstance(other, Vector | tuple):
            return Vector(self.builder, self.builder.vector_math("SCALE", other, scale=self).outputs["Vector"])
        return self.builder.math("MULTIPLY", self, other)

    def __rmul__(self, other: float) -> Float:
        return self.builder.math("MULTIPLY", other, self)

    def __truediv__(self, other: Number) -> Float:
        return self.builder.math("DIVIDE", self, other)

    def __rtruediv__(self, other: float) -> Float:
        return self.builder.math("DIVIDE", other, self)

    def __pow__(self, other: Number) -> Float:
        return self.builder.math("POWER", self, other)

    def __rpow__(self, other: float) -> Float:
        return self.builder.math("POWER", other, self)

    def __mod__(self, other: Number) -> Float:
        """Remainder with the sign of the divisor, as Python has it."""
        return self.builder.math("FLOORED_MODULO", self, other)

    def __neg__(self) -> Float:
        return self * -1.0

    def __abs__(self) -> Float:
        return self.builder.math("ABSOLUTE", self)

    def less_than(self, other: Number) -> Float:
        """1 where the value is less than `other`, else 0, also for NaN."""
        return self.builder.math("LESS_THAN", self, other)

    def greater_than(self, other: Number) -> Float:
        """1 where the value is greater than `other`, else 0, also for NaN."""
        return self.builder.math("GREATER_THAN", self, other)

    def near(self, other: Number, tolerance: float) -> Float:
        """1 where the value differs from `other` by `tolerance` at most, else 0, also for NaN."""
        return self.builder.math("COMPARE", self, other, tolerance)


class Vector(Value):
    """Three numbers per pixel or ray: a vector, or a color whose alpha arithmetic leaves out."""

    __slots__ = ()

    def _apply(self, operation: str, *others: Operand, scale: Number | None = None) -> Vector:
        return Vector(self.builder, self.builder.vector_math(operation, self, *others, scale=scale).outputs["Vector"])

    def __add__(self, other: Direction) -> Vector:
        return self._apply("ADD", other)

    def __sub__(self, other: Direction) -> Vector:
        return self._apply("SUBTRACT", other)

    def __mul__(self, other: Number | Direction) -> Vector:
        """Scale by a number, or multiply component by component."""
        if isinstance(other, Float | float | int):
            return self._apply("SCALE", scale=other)
        return self._apply("MULTIPLY", other)

    def __truediv__(self, other: Direction) -> Vector:
        """Divide component by component."""
        return self._apply("DIVIDE", other)

    def at_least(self, other: Direction) -> Vector:
        """The larger of each two components."""
        return self._apply("MAXIMUM", other)

    def at_most(self, other: Direction) -> Vector:
        """The smaller of each two components."""
        return self._apply("MINIMUM", other)

    def cross(self, other: Direction) -> Vector:
        """Cross product."""
        return self._apply("CROSS_PRODUCT", other)

    def dot(self, other: Direction) -> Float:
        """Dot product."""
        return Float(self.builder, self.builder.vector_math("DOT_PRODUCT", self, other).outputs["Value"])

    def length(self) -> Float:
        """Euclidean length."""
        return Float(self.builder, self.builder.vector_math("LENGTH", self).outputs["Value"])

    def normalized(self) -> Vector:
        """The vector of length 1 in the same direction."""
        return self._apply("NORMALIZE")

    def turned(self, rows: Sequence[Vector]) -> tuple[Float, Float, Float]:
        """Components of the vector multiplied by a matrix, by its rows."""
        x, y, z = (self.dot(row) for row in rows)
        return x, y, z

    def separate(self) -> tuple[Float, Float, Float]:
        """Add a Separate XYZ node and return the components."""
        node = self.builder.node("ShaderNodeSeparateXYZ")
        self.builder.feed(node.inputs[0], self)
        x, y, z = (Float(self.builder, socket) for socket in node.outputs)
        return x, y, z
