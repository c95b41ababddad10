# SPDX-License-Identifier: GPL-3.0-or-later
# What mypy_blender.py changes in the classes of the stubs for Blender, grouped by reason.

# --- properties of the add-on: their types are in mypy_blender.py -----------------------------------

class Object:
    umbra: typing.Any
    original: Object
    data: typing.Any  # its class depends on the object's type

class Scene:
    umbra: typing.Any
    original: Scene
    node_tree: NodeTree  # Blender 4.5; 5.0 has compositing_node_group
    use_nodes: bool
    cycles: typing.Any  # Cycles adds it
    render: RenderSettings
    display_settings: ColorManagedDisplaySettings

# --- pointers that are never empty where the add-on follows them ------------------------------------

class Context:
    scene: Scene
    view_layer: ViewLayer
    window_manager: WindowManager
    workspace: WorkSpace
    preferences: Preferences
    collection: Collection
    selected_objects: list[Object]

class Depsgraph:
    scene: Scene
    view_layer: ViewLayer

class ViewLayer:
    depsgraph: Depsgraph
    objects: LayerObjects

class NodeTree:
    interface: NodeTreeInterface

class NodeLink:
    from_node: Node
    from_socket: NodeSocket
    to_node: Node
    to_socket: NodeSocket

class FCurve:
    driver: Driver

class Image:
    colorspace_settings: ColorManagedInputColorspaceSettings
    pixels: bpy_prop_array

class DepsgraphObjectInstance:
    object: Object

class World:
    node_tree: NodeTree  # once nodes are in use

class Material:
    node_tree: NodeTree  # once nodes are in use

class UIPopupMenu:
    layout: UILayout

class KeyMapItem:
    properties: typing.Any  # those of its operator

# --- Blender calls these, and always with a context --------------------------------------------------

class Panel:
    bl_space_type: str
    bl_region_type: str
    layout: UILayout
    @classmethod
    def poll(cls, context: Context) -> bool: ...
    def draw(self, context: Context) -> None: ...
    def draw_header(self, context: Context) -> None: ...

class Menu:
    layout: UILayout
    def draw(self, context: Context) -> None: ...

class Header:
    layout: UILayout
    def draw(self, context: Context) -> None: ...

class Operator:
    layout: UILayout
    @classmethod
    def poll(cls, context: Context) -> bool: ...
    @classmethod
    def poll_message_set(cls, message: str, *arguments: object) -> None: ...
    def execute(self, context: Context) -> set[str]: ...
    def invoke(self, context: Context, event: Event) -> set[str]: ...
    def modal(self, context: Context, event: Event) -> set[str]: ...
    def cancel(self, context: Context) -> None: ...
    def report(self, type: set[str], message: str) -> None: ...

# --- Python's protocols and choices that the stubs leave out -----------------------------------------

class bpy_struct:
    @property
    def id_data(self) -> typing.Any: ...
    def __contains__(self, key: str) -> bool: ...
    def path_resolve(self, path: str, coerce: bool = True, /) -> typing.Any: ...
    def driver_add(self, path: str, index: int = -1, /) -> FCurve: ...

class bpy_prop_collection:
    def get(self, key: str, default: None = None, /) -> _GenericType1 | None: ...

class bpy_prop_array:
    def foreach_get(self, values: typing.Any) -> None: ...
    def foreach_set(self, values: typing.Any) -> None: ...
    def __iter__(self) -> collections.abc.Iterator[typing.Any]: ...
    def __len__(self) -> int: ...
    def __getitem__(self, index: int) -> typing.Any: ...

class ContextTempOverride:
    def __enter__(self) -> None: ...
    def __exit__(self, *exception: object) -> None: ...

class Vector:
    def __iter__(self) -> collections.abc.Iterator[float]: ...

class Color:
    def __iter__(self) -> collections.abc.Iterator[float]: ...

class Euler:
    def __iter__(self) -> collections.abc.Iterator[float]: ...

class Matrix:
    def __iter__(self) -> collections.abc.Iterator[Vector]: ...

class ColorManagedInputColorspaceSettings:
    name: str  # from the OpenColorIO configuration

class BlendDataNodeTrees:
    def new(self, name: str, type: str) -> NodeTree: ...

class RenderSettings:
    engine: str  # of render add-ons as well
    compositor_device: str
    image_settings: ImageFormatSettings

class Camera:
    cycles: typing.Any  # Cycles adds it
    cycles_custom: typing.Any
    type: str
    dof: CameraDOFSettings

class _GenericUI:
    @classmethod
    def append(cls, draw_func: collections.abc.Callable[..., None]) -> None: ...
    @classmethod
    def prepend(cls, draw_func: collections.abc.Callable[..., None]) -> None: ...
    @classmethod
    def remove(cls, draw_func: collections.abc.Callable[..., None]) -> None: ...

class UILayout:
    def label(self, *, text: str = "", icon: str = "NONE") -> None: ...

class NodeTreeInterface:
    def new_socket(
        self,
        name: str,
        *,
        description: str = "",
        in_out: str = "INPUT",
        socket_type: str = "DEFAULT",
        parent: NodeTreeInterfacePanel | None = None,
    ) -> NodeTreeInterfaceSocket: ...

# --- what all kinds have that the add-on meets: the kind is known by name or role, not by class ------

class NodeSocket:
    default_value: typing.Any
    node: Node
    links: NodeLinks

class Node:
    image: Image | None
    image_user: ImageUser
    node_tree: NodeTree | None
    scene: Scene | None
    layer: str
    projection: str
    vector_type: str
    is_active_output: bool
    attribute_name: str
    operation: str
    data_type: str
    factor_mode: str
    clamp_factor: bool
    rotation_type: str
    invert: bool
    mode: str
    filter_type: str
    space: str
    frame_method: str
    interpolation: str
    extension: str

class ID:
    animation_data: AnimData | None  # of most kinds

class ImagePreview:
    image_size: typing.Any  # a pair can be assigned

class Property:
    hard_min: float
    hard_max: float

class AddonPreferences:
    compute_device_type: str  # of Cycles

class WindowManager:
    def invoke_confirm(
        self, operator: Operator, event: Event, *, title: str = "", message: str = "", confirm_text: str = ""
    ) -> set[str]: ...

class Attribute:
    data: typing.Any

class NodeTreeInterfaceItem:
    name: str
    in_out: str
    identifier: str
    socket_type: str

class NodeTreeInterfaceSocket:
    in_out: str
    subtype: str
    min_value: float
    max_value: float
    default_value: typing.Any

class ActionStrip:
    channelbags: typing.Any
    def channelbag(self, slot: ActionSlot, *, ensure: bool = False) -> typing.Any: ...
