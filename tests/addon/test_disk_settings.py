# SPDX-License-Identifier: GPL-3.0-or-later
"""The disk's settings: what they bake, what they leave alone, what they add and take away, and what they refuse."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from small_scene import add_hole, find_map, links_of, plain_name, shrink


@pytest.fixture
def scene(tmp_path: Path) -> bpy.types.Scene:
    """A small scene with maps of its own."""
    scene = bpy.context.scene
    shrink(scene, (48, 27))
    scene.umbra.map_folder = str(tmp_path / "maps")
    return scene


@pytest.fixture
def hole(scene: bpy.types.Scene) -> bpy.types.Object:
    hole = add_hole(scene)
    hole.umbra.disk.enabled = True
    return hole


def files(tmp_path: Path) -> dict[str, int]:
    return {plain_name(path): path.stat().st_mtime_ns for path in sorted((tmp_path / "maps").glob("*.exr"))}


def bake() -> None:
    assert bpy.ops.umbra.bake_frame() == {"FINISHED"}


MAP, LAYER = "Scene_Black_Hole_48x27_0001.exr", "Scene_Black_Hole_48x27_light_0001.exr"


def test_the_layer_is_a_file_of_its_own(
    scene: bpy.types.Scene, hole: bpy.types.Object, tmp_path: Path, addon_module: Callable[[str], ModuleType]
) -> None:
    bake()
    assert list(files(tmp_path)) == [MAP, LAYER]
    for wanted in addon_module("outputs.frames").requests_at(scene, 1):
        assert addon_module("bake.check").is_valid(wanted)
        assert addon_module("bake.check").count_baked(scene, hole.name, wanted, range(1, 5)) == 1


def test_passes_are_baked_if_they_are_asked_for(
    scene: bpy.types.Scene, hole: bpy.types.Object, tmp_path: Path, addon_module: Callable[[str], ModuleType]
) -> None:
    scene.umbra.disk_passes = True
    bake()
    names = [f"Scene_Black_Hole_48x27_disk{number}_0001.exr" for number in (1, 2, 3)]
    assert list(files(tmp_path)) == [MAP, *names, LAYER]
    physics = addon_module("core.physics_api").physics
    warp_map = physics.read_warp_map(find_map(tmp_path / "maps", MAP))
    for number, name in enumerate(names, start=1):
        one = physics.read_disk_pass(find_map(tmp_path / "maps", name))
        assert one.metadata["crossing"] == number
        assert one.metadata["hash"] == warp_map.metadata["hash"]


# What the compositor does, what makes another layer, and whether that is of another geometry.
@pytest.mark.parametrize(
    ("name", "value", "is_live"),
    [
        ("inner_at_isco", False, False),
        ("outer_radius", 12.0, False),
        ("retrograde", True, False),
        ("crossings", 2, False),
        ("turning_speed", 3.0, False),
        ("band", "MONOCHROMATIC", False),
        ("temperature", 5000.0, False),
        ("seed", 7, False),
        ("exposure", 2.0, True),
        ("opacity", 0.5, True),
        ("tint", (1.0, 0.5, 0.5), True),
        ("light", True, True),
    ],
)
def test_settings_make_another_layer_and_leave_the_map_alone(
    scene: bpy.types.Scene, hole: bpy.types.Object, tmp_path: Path, name: str, value: object, is_live: bool
) -> None:
    bake()
    before = files(tmp_path)
    setattr(hole.umbra.disk, name, value)
    bake()
    after = files(tmp_path)
    assert after[MAP] == before[MAP]
    assert (after[LAYER] == before[LAYER]) == is_live


def damage(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[-40:] = bytes(40)
    path.write_bytes(content)


def of_another_frame(path: Path) -> None:
    path.write_bytes(path.with_name(path.name.replace("_0001", "_0002")).read_bytes())


@pytest.mark.parametrize("spoil", [Path.unlink, damage, of_another_frame])
def test_a_spoilt_layer_makes_the_frame_stale(
    scene: bpy.types.Scene,
    hole: bpy.types.Object,
    tmp_path: Path,
    addon_module: Callable[[str], ModuleType],
    spoil: Callable[[Path], None],
) -> None:
    fault_of = addon_module("bake.check").fault_of
    bake()
    scene.frame_set(2)
    bake()
    scene.frame_set(1)
    _, wanted = addon_module("outputs.frames").requests_at(scene, 1)
    assert wanted.path == find_map(tmp_path / "maps", LAYER)
    assert fault_of(wanted) is None
    spoil(wanted.path)
    assert "_light_" in fault_of(wanted)
    bake()
    assert fault_of(wanted) is None


def test_switching_the_disk_off_takes_all_of_it_away(
    scene: bpy.types.Scene, addon_module: Callable[[str], ModuleType]
) -> None:
    hole = add_hole(scene)
    setup = addon_module("outputs.shared.compositor_tree").find_setup(scene)
    links, nodes = links_of(setup.tree), len(setup.tree.nodes)
    images, groups, objects = (set(each.keys()) for each in (bpy.data.images, bpy.data.node_groups, bpy.data.objects))
    hole.umbra.disk.enabled = True
    hole.umbra.disk.light = True
    assert len(setup.tree.nodes) > nodes
    assert setup.group.inputs["Disk"].is_linked
    hole.umbra.disk.enabled = False
    assert links_of(setup.tree) == links
    assert len(setup.tree.nodes) == nodes
    assert set(bpy.data.images.keys()) == images
    assert set(bpy.data.node_groups.keys()) == groups
    assert set(bpy.data.objects.keys()) == objects


def test_removing_the_set_up_removes_the_disk_and_a_new_one_brings_it_back(
    scene: bpy.types.Scene, hole: bpy.types.Object, addon_module: Callable[[str], ModuleType]
) -> None:
    assert bpy.ops.umbra.remove_compositor() == {"FINISHED"}
    assert not any(each.name.startswith("Umbra") for each in bpy.data.node_groups)
    assert bpy.ops.umbra.setup_compositor() == {"FINISHED"}
    assert addon_module("outputs.shared.compositor_tree").find_setup(scene).group.inputs["Disk"].is_linked


def test_the_groups_of_version_0_1_give_way_to_the_layer(
    scene: bpy.types.Scene, hole: bpy.types.Object, tmp_path: Path, addon_module: Callable[[str], ModuleType]
) -> None:
    """A file as version 0.1 left it: the disk drawn by a group from passes and packed tables."""
    tree_of = addon_module("outputs.shared.compositor_tree")
    setup = tree_of.find_setup(scene)
    wanted = links_of(setup.tree)
    tree, layer = setup.tree, tree_of.find_node(setup.tree, "disk_layer")
    image = layer.image
    tree.nodes.remove(layer)
    bpy.data.images.remove(image)
    former = bpy.data.node_groups.new("Umbra Disk 3", "CompositorNodeTree")
    former["umbra_disk_version_3"] = 4
    former.interface.new_socket("Disk", in_out="OUTPUT", socket_type="NodeSocketColor")
    for name in ("Pass 1", "Colors", "Texture"):
        former.interface.new_socket(name, in_out="INPUT", socket_type="NodeSocketColor")
    former.interface.new_socket("Streaks", in_out="INPUT", socket_type="NodeSocketFloat")
    node = tree.nodes.new("CompositorNodeGroup")
    node.node_tree, node["umbra_role"] = former, "disk"
    node.inputs["Streaks"].driver_add("default_value").driver.expression = "frame"
    tree.links.new(node.outputs["Disk"], setup.group.inputs["Disk"])
    for name, role in (("Pass 1", "disk_pass_1"), ("Colors", "disk_colors"), ("Texture", "disk_texture")):
        table = tree.nodes.new("CompositorNodeImage")
        table["umbra_role"] = role
        table.image = bpy.data.images.new(f"Umbra Disk {name.replace('Texture', 'Streaks')}", 1, 16)
        tree.links.new(table.outputs["Image"], node.inputs[name])
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "saved.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "saved.blend"))
    tree = tree_of.find_setup(bpy.context.scene).tree
    assert links_of(tree) == wanted
    assert not any("Streaks" in curve.data_path for curve in tree.animation_data.drivers)
    assert not [each.name for each in bpy.data.node_groups if each.name.startswith("Umbra Disk")]
    assert [each.name for each in bpy.data.images if each.name.startswith("Umbra Disk")] == ["Umbra Disk Light"]


@pytest.mark.parametrize(
    ("settings", "method", "message"),
    [
        ({"outer_radius": 1.5}, None, "outer radius is 1.5 M; it must be larger than the inner one"),
        ({"inner_at_isco": False, "inner_radius": 1.0}, None, "inner radius is 1 M; the horizon"),
        ({}, "cash-karp-printed", "disk"),
    ],
)
def test_impossible_disks_are_refused_with_a_sentence(
    scene: bpy.types.Scene, hole: bpy.types.Object, settings: dict[str, object], method: str | None, message: str
) -> None:
    for name, value in settings.items():
        setattr(hole.umbra.disk, name, value)
    if method is not None:
        scene.umbra.method = method
    with pytest.raises(RuntimeError, match=message):
        bpy.ops.umbra.bake_frame()


def test_light_has_the_brightness_of_the_picture_and_no_camera_sees_it(
    scene: bpy.types.Scene, hole: bpy.types.Object, tmp_path: Path, addon_module: Callable[[str], ModuleType]
) -> None:
    """A white plate close to the plane of a bright even disk is lit by the disk's own radiance."""
    settings = hole.umbra.disk
    values = {
        "strands": 0.0, "smoke": 0.0, "falloff": 0.0, "color_variation": 0.0, "depth": 100.0, "exposure": 0.0,
        "inner_softness": 0.0, "outer_softness": 0.0, "temperature": 6500.0, "light": True,
    }  # fmt: skip
    for name, value in values.items():
        setattr(settings, name, value)
    light = addon_module("outputs.shared.disk_light").find(hole)
    assert light is not None
    assert not light.visible_camera
    scale = hole.umbra.mass_scale
    bpy.ops.mesh.primitive_plane_add(size=0.2 * scale, location=(0.0, 12.0 * scale, 0.1 * scale))
    plate = bpy.data.materials.new("White")
    if bpy.app.version < (5, 0):
        plate.use_nodes = True
    plate.node_tree.nodes.clear()
    diffuse = plate.node_tree.nodes.new("ShaderNodeBsdfDiffuse")
    diffuse.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    output = plate.node_tree.nodes.new("ShaderNodeOutputMaterial")
    plate.node_tree.links.new(diffuse.outputs[0], output.inputs["Surface"])
    bpy.context.object.data.materials.append(plate)
    for each in list(bpy.data.objects):
        if each.type == "LIGHT":
            bpy.data.objects.remove(each)
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.0
    # from below, through the light: it is not in the way, and the plate's lower face is what it lights
    scene.camera.location = (0.0, 12.0 * scale, -1.0 * scale)
    scene.camera.rotation_euler = (3.14159265, 0.0, 0.0)
    scene.camera.data.clip_start = 1e-3
    scene.cycles.samples = 256
    scene.render.use_compositing = False
    scene.render.filepath = str(tmp_path / "lit.exr")
    bpy.ops.render.render(write_still=True)
    modules = addon_module("core.physics_api")
    pixels, _ = modules.physics.read_exr(tmp_path / "lit.exr")
    lit = pixels[12:15, 22:26].reshape(-1, 4)
    assert (lit[:, 3] == 1.0).all()
    assert pixels[0, 0, 3] == 0.0, "beside the plate there is nothing, not the glowing disk"
    expected = modules.physics.black_body_color(6500.0)
    # The disk fills all but the horizon of what the plate sees; 256 samples a pixel, twelve pixels.
    np.testing.assert_allclose(lit[:, :3].mean(axis=0), expected, rtol=0.05)


def test_light_follows_keyframes(
    scene: bpy.types.Scene, hole: bpy.types.Object, tmp_path: Path, addon_module: Callable[[str], ModuleType]
) -> None:
    """A ball lit by the disk alone: two stops more of exposure, and half the strength, make it twice as bright."""
    hole.umbra.disk.light = True
    for name, values in {"exposure": (0.0, 2.0), "light_strength": (1.0, 0.5)}.items():
        for frame, value in zip((1, 3), values, strict=True):
            setattr(hole.umbra.disk, name, value)
            hole.keyframe_insert(f"umbra.disk.{name}", frame=frame)
    scale = hole.umbra.mass_scale
    bpy.ops.mesh.primitive_uv_sphere_add(radius=scale, location=(0.0, -8.0 * scale, 3.0 * scale))
    for each in list(bpy.data.objects):
        if each.type == "LIGHT":
            bpy.data.objects.remove(each)
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.0
    scene.camera.location, scene.camera.rotation_euler = (0.0, -14.0 * scale, 3.0 * scale), (1.5707963, 0.0, 0.0)
    scene.cycles.samples = 16
    scene.render.use_compositing = False
    scene.frame_start, scene.frame_end = 1, 3
    scene.render.filepath = str(tmp_path / "lit_####.exr")
    scene.frame_set(2)
    bpy.ops.render.render(animation=True)
    exr = addon_module("core.physics_api").physics
    lit = [exr.read_exr(tmp_path / f"lit_{frame:04d}.exr")[0][..., :3].sum() for frame in (1, 2, 3)]
    assert lit[0] > 1.0
    # Blender's eased curve is half-way at frame 2: one stop, and three quarters.
    # Cycles picks the same faces with other shares of the light: a percent with so few samples.
    assert lit[1] / lit[0] == pytest.approx(1.5, rel=0.03)
    assert lit[2] / lit[0] == pytest.approx(2.0, rel=0.03)


def test_light_goes_with_its_hole(
    scene: bpy.types.Scene, hole: bpy.types.Object, addon_module: Callable[[str], ModuleType]
) -> None:
    hole.umbra.disk.light = True
    assert addon_module("outputs.shared.disk_light").find(hole) is not None
    bpy.data.objects.remove(hole)
    addon_module("outputs.refreshing").refresh_disk(scene)
    assert not any("umbra_disk_light" in each for each in bpy.data.objects)
    assert not addon_module("outputs.shared.compositor_tree").find_setup(scene).group.inputs["Disk"].is_linked


def test_holes_of_two_scenes_keep_values_of_their_own(
    scene: bpy.types.Scene, hole: bpy.types.Object, addon_module: Callable[[str], ModuleType]
) -> None:
    other = bpy.data.scenes.new("Other")
    second = bpy.data.objects.new("Second Hole", None)
    other.collection.objects.link(second)
    second.umbra.is_black_hole = True
    second.umbra.spin = 0.1
    other.umbra.active_hole = second
    addon_module("outputs.compositor.compositing").set_up(other)
    second.umbra.disk.enabled = True
    hole.umbra.disk.exposure, second.umbra.disk.exposure = 1.0, -2.0
    find_setup = addon_module("outputs.shared.compositor_tree").find_setup
    exposures = [find_setup(each).group.inputs["Disk Exposure"].default_value for each in (scene, other)]
    assert exposures == pytest.approx([1.0, -2.0])


class Layout:
    """Stands in for a panel's layout, and refuses what Blender would refuse."""

    def __init__(self, drawn: list[str]) -> None:
        self.drawn = drawn

    def column(self, **_options: object) -> "Layout":
        return Layout(self.drawn)

    def label(self, text: str) -> None:
        self.drawn.append(text)

    def separator(self) -> None:
        self.drawn.append("")

    def prop(self, owner: object, name: str, **_options: object) -> None:
        assert name in owner.bl_rna.properties
        self.drawn.append(name)

    template_ID = prop

    def operator_menu_enum(self, operator: str, name: str, **_options: object) -> None:
        kind = bpy.ops.umbra.disk_preset
        assert operator == "umbra.disk_preset"
        assert name in kind.get_rna_type().properties
        self.drawn.append(operator)


def test_panel_shows_every_setting(hole: bpy.types.Object, addon_module: Callable[[str], ModuleType]) -> None:
    panels = addon_module("ui.disk_panel")
    drawn: list[str] = []
    settings = hole.umbra.disk

    class Panel:
        layout = Layout(drawn)

    for at_isco, profile in ((True, "novikov_thorne"), (False, "power_law")):
        settings.inner_at_isco, settings.profile, settings.light = at_isco, profile, not at_isco
        settings.texture = None if at_isco else bpy.data.images.new("Picture", 4, 4)
        settings.thickness, settings.gap_depth, settings.spots = (0.0, 0.0, 0) if at_isco else (0.1, 0.5, 2)
        for panel in panels.CLASSES[1:]:
            if hasattr(panel, "draw_header"):
                panel.draw_header(Panel, bpy.context)
            panel.draw(Panel, bpy.context)
    shown = [each for each in settings.bl_rna.properties if not (each.is_readonly or each.is_hidden)]
    names = {each.identifier for each in shown} - {"name"}
    assert names <= set(drawn)
    assert "Begins at 2.32 M" in drawn
