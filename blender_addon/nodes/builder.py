# SPDX-License-Identifier: GPL-3.0-or-later
"""Writing nodes down as expressions, with the differences between Blender 4.5 and 5.x hidden here.

In 5.x most settings of compositor nodes became input sockets. Whatever depends on this is in this file; the
code that builds the node group reads the same for both.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TypeAlias

import bpy

SETTINGS_ARE_SOCKETS = bpy.app.version >= (5, 0, 0)
"""From 5.0 on, settings of compositor nodes are menu sockets; before, they were properties of the node."""

Socket: TypeAlias = bpy.types.NodeSocket
Value: TypeAlias = "Socket | float | Sequence[float]"

_COLUMN_WIDTH = 190.0
_ROW_HEIGHT = 190.0
_NODES_IN_A_COLUMN = 5
_FRAME_GAP = 120.0


class TreeBuilder:
    """Adds nodes to a compositor tree; every method takes sockets or plain values and returns output sockets.

    Parameters
    ----------
    tree : bpy.types.NodeTree
        A compositor node tree. Nodes are laid out from left to right, one frame after the other.
    """

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self.tree = tree
        self._frame: bpy.types.Node | None = None
        self._next_x = 0.0
        self._count_in_frame = 0

    @contextmanager
    def frame(self, label: str) -> Iterator[None]:
        """Put the nodes made inside this context into a labeled frame."""
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
        """Add a node of the given type at the next free place."""
        node = self.tree.nodes.new(kind)
        node.label = label
        column, row = divmod(self._count_in_frame, _NODES_IN_A_COLUMN)
        if self._frame is not None:
            node.parent = self._frame
        node.location = (self._next_x + column * _COLUMN_WIDTH, -row * _ROW_HEIGHT)
        self._count_in_frame += 1
        return node

    def feed(self, target: Socket, value: Value) -> None:
        """Link a socket to an input, or set the input's own value."""
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, target)
        else:
            target.default_value = value

    # Arithmetic
    # ------------------------------------------------------------------------------------------------

    def math(self, operation: str, *values: Value, label: str = "") -> Socket:
        """Math node: one float for each pixel."""
        node = self.node("ShaderNodeMath", label)
        node.operation = operation
        for target, value in zip(node.inputs, values, strict=False):
            self.feed(target, value)
        return node.outputs[0]

    def vector_math(self, operation: str, *values: Value, label: str = "") -> Socket:
        """Vector Math node with a vector as its result."""
        return self._vector_node(operation, values, label).outputs["Vector"]

    def _vector_node(self, operation: str, values: Sequence[Value], label: str) -> bpy.types.Node:
        node = self.node("ShaderNodeVectorMath", label)
        node.operation = operation
        for target, value in zip(node.inputs, values, strict=False):
            self.feed(target, value)
        return node

    def dot(self, one: Value, other: Value, label: str = "") -> Socket:
        """Dot product of two vectors."""
        return self._vector_node("DOT_PRODUCT", (one, other), label).outputs["Value"]

    def length(self, vector: Value, label: str = "") -> Socket:
        """Length of a vector."""
        return self._vector_node("LENGTH", (vector,), label).outputs["Value"]

    def vector_scale(self, vector: Value, factor: Value, label: str = "") -> Socket:
        """Vector times float."""
        node = self.node("ShaderNodeVectorMath", label)
        node.operation = "SCALE"
        self.feed(node.inputs["Vector"], vector)
        self.feed(node.inputs["Scale"], factor)
        return node.outputs["Vector"]

    def select(self, condition: Value, otherwise: Value, chosen: Value, label: str = "") -> Socket:
        """Float `chosen` where the condition is 1, `otherwise` where it is 0; exact at both ends."""
        return self._mix("FLOAT", (condition, otherwise, chosen), label)

    def select_vector(self, condition: Value, otherwise: Value, chosen: Value, label: str = "") -> Socket:
        """Vector (or color without alpha): `chosen` where the condition is 1, in proportion in between."""
        return self._mix("VECTOR", (condition, otherwise, chosen), label)

    def _mix(self, data_type: str, values: tuple[Value, Value, Value], label: str) -> Socket:
        """Mix node of this type; its sockets of other types, which it has as well, stay unused."""
        node = self.node("ShaderNodeMix", label)
        node.data_type = data_type
        node.factor_mode = "UNIFORM"
        node.clamp_factor = True
        kind = data_type.capitalize()
        by_name = {socket.identifier: socket for socket in node.inputs}
        for name, value in zip(("Factor_Float", f"A_{kind}", f"B_{kind}"), values, strict=True):
            self.feed(by_name[name], value)
        return next(socket for socket in node.outputs if socket.identifier == f"Result_{kind}")

    def combine(self, x: Value, y: Value, z: Value, label: str = "") -> Socket:
        """Vector of three floats."""
        node = self.node("ShaderNodeCombineXYZ", label)
        for target, value in zip(node.inputs, (x, y, z), strict=True):
            self.feed(target, value)
        return node.outputs[0]

    def separate(self, vector: Value, label: str = "") -> tuple[Socket, Socket, Socket]:
        """Components of a vector."""
        node = self.node("ShaderNodeSeparateXYZ", label)
        self.feed(node.inputs[0], vector)
        return node.outputs[0], node.outputs[1], node.outputs[2]

    def rotate_euler(self, vector: Value, euler: Value, label: str = "") -> Socket:
        """Vector Rotate node, XYZ Euler angles about the origin."""
        node = self.node("ShaderNodeVectorRotate", label)
        node.rotation_type = "EULER_XYZ"
        self.feed(node.inputs["Vector"], vector)
        self.feed(node.inputs["Rotation"], euler)
        return node.outputs[0]

    # Images
    # ----------------------------------------------------------------------------------------------------

    def separate_color(self, color: Value, label: str = "") -> tuple[Socket, Socket, Socket, Socket]:
        """Red, green, blue and alpha as they are stored: nothing is divided by alpha."""
        node = self.node("CompositorNodeSeparateColor", label)
        node.mode = "RGB"
        self.feed(node.inputs[0], color)
        return node.outputs[0], node.outputs[1], node.outputs[2], node.outputs[3]

    def combine_color(self, red: Value, green: Value, blue: Value, alpha: Value = 1.0, label: str = "") -> Socket:
        """Color of four floats."""
        node = self.node("CompositorNodeCombineColor", label)
        node.mode = "RGB"
        for target, value in zip(node.inputs, (red, green, blue, alpha), strict=True):
            self.feed(target, value)
        return node.outputs[0]

    def image_size(self, image: Value, label: str = "") -> tuple[Socket, Socket]:
        """Width and height of an image in pixels; 0 and 0 for a plain color or a missing file."""
        node = self.node("CompositorNodeImageInfo", label)
        self.feed(node.inputs[0], image)
        width, height, _ = self.separate(node.outputs["Dimensions"])
        return width, height

    def render_area(self, label: str = "") -> Socket:
        """A float image of zeros that has exactly the render's size, whatever is linked elsewhere.

        A Box Mask without an input is the one node of both versions that takes its size from the render
        alone. As the first operand it makes Blender bring the other operands to the render's pixels.
        """
        mask = self.node("CompositorNodeBoxMask", label)
        return self.math("MULTIPLY", mask.outputs[0], 0.0)

    def map_uv(self, image: Value, uv: Value, interpolation: str, label: str = "") -> Socket:
        """Look an image up at texture coordinates; the third component of `uv` must be 1.

        `interpolation` is "Nearest" (either version) or "Bilinear" (5.x only: u repeats, v ends at the
        edges).
        """
        node = self.node("CompositorNodeMapUV", label)
        if SETTINGS_ARE_SOCKETS:
            node.inputs["Interpolation"].default_value = interpolation
            node.inputs["Extension X"].default_value = "Repeat"
            node.inputs["Extension Y"].default_value = "Extend"
        else:
            if interpolation != "Nearest":
                raise ValueError(f"Map UV has no {interpolation} interpolation in Blender 4.5.")
            node.filter_type = "NEAREST"
        self.feed(node.inputs["Image"], image)
        self.feed(node.inputs["UV"], uv)
        return node.outputs[0]

    def scale_by(self, image: Value, factor: Value, interpolation: str = "Nearest", label: str = "") -> Socket:
        """Scale an image about its center by one factor for both axes."""
        node = self._scale(image, interpolation, label)
        if SETTINGS_ARE_SOCKETS:
            node.inputs["Type"].default_value = "Relative"
        else:
            node.space = "RELATIVE"
        self.feed(node.inputs["X"], factor)
        self.feed(node.inputs["Y"], factor)
        return node.outputs[0]

    def scale_to_render(self, image: Value, interpolation: str, label: str = "") -> Socket:
        """Stretch an image over the whole render."""
        node = self._scale(image, interpolation, label)
        if SETTINGS_ARE_SOCKETS:
            node.inputs["Type"].default_value = "Render Size"
            node.inputs["Frame Type"].default_value = "Stretch"
        else:
            node.space = "RENDER_SIZE"
            node.frame_method = "STRETCH"
        return node.outputs[0]

    def _scale(self, image: Value, interpolation: str, label: str) -> bpy.types.Node:
        node = self.node("CompositorNodeScale", label)
        self.feed(node.inputs["Image"], image)
        self._resampling(node, interpolation)
        return node

    def translate(self, image: Value, x: Value, y: Value, interpolation: str, label: str = "") -> Socket:
        """Shift an image by pixels."""
        node = self.node("CompositorNodeTranslate", label)
        self.feed(node.inputs["Image"], image)
        self.feed(node.inputs["X"], x)
        self.feed(node.inputs["Y"], y)
        self._resampling(node, interpolation)
        return node.outputs[0]

    @staticmethod
    def _resampling(node: bpy.types.Node, interpolation: str) -> None:
        if SETTINGS_ARE_SOCKETS:
            node.inputs["Interpolation"].default_value = interpolation
            node.inputs["Extension X"].default_value = "Extend"
            node.inputs["Extension Y"].default_value = "Extend"
        else:
            node.interpolation = interpolation.upper()
