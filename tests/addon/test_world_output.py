# SPDX-License-Identifier: GPL-3.0-or-later
"""Output: World. What Cycles and EEVEE show against numpy's own look-up, and that switching back leaves no trace."""

import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from small_scene import (
    environment_image,
    environment_pixels,
    links_of,
    read,
    render,
    run_python,
    shrink,
    use_sky,
    world_sky,
)

pytestmark = pytest.mark.filterwarnings("ignore:.*use_nodes.*:DeprecationWarning")

SIZE = (96, 54)
ROTATION = (0.3, -0.2, 1.0)


@pytest.fixture
def modules(addon_module: Callable[[str], ModuleType]) -> Callable[[str], ModuleType]:
    return addon_module


@pytest.fixture
def physics(addon_module: Callable[[str], ModuleType]) -> ModuleType:
    return addon_module("core.physics_api")


@pytest.fixture
def scene(tmp_path: Path) -> bpy.types.Scene:
    """A scene with an environment, a camera near (0, -6, 1), a tilted hole on whose orbit it moves."""
    scene = bpy.context.scene
    shrink(scene, SIZE)
    scene.cycles.filter_width = 0.01
    scene.umbra.map_folder = str(tmp_path / "maps")
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    world_sky(scene, environment_image())
    scene.world.node_tree.nodes["Mapping"].inputs["Rotation"].default_value = ROTATION
    scene.camera.location, scene.camera.rotation_euler = (0.0, -6.0, 1.0), (1.42, 0.0, 0.0)
    hole = bpy.data.objects.new("Hole", None)
    scene.collection.objects.link(hole)
    hole.rotation_euler = (0.4, 0.5, 0.1)
    hole.umbra.is_black_hole = True
    hole.umbra.spin, hole.umbra.mass_scale, hole.umbra.motion = 0.95, 0.2, "CIRCULAR"
    scene.umbra.active_hole = hole
    return scene


def switch(output: str = "WORLD") -> None:
    assert bpy.ops.umbra.set_output(output=output) == {"FINISHED"}


def group(scene: bpy.types.Scene) -> bpy.types.Node:
    return scene.world.node_tree.nodes["Umbra World"]


def map_of(scene: bpy.types.Scene, physics: ModuleType, frame: int = 1):
    (path,) = Path(scene.umbra.map_folder).glob(f"*_world_{frame:04d}.exr")
    return physics.physics.read_world_map(path)


def looking(scene: bpy.types.Scene, physics: ModuleType) -> np.ndarray:
    """World directions of the pixels' centers, row by row from the top."""
    width, height = SIZE
    data = scene.camera.data
    camera = physics.physics.PerspectiveCamera(width, height, focal_length=data.lens, sensor_width=data.sensor_width)
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    axes = np.array(scene.camera.matrix_world, dtype=np.float64)[:3, :3]
    return camera.directions(x.ravel(), y.ravel()) @ axes.T


def predicted(scene: bpy.types.Scene, physics: ModuleType, frame: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Numpy's picture of the frame, and where it can be compared: not within a texel of the environment's poles,
    where Blender's own environment look-up reaches over to the other pole."""
    origin, one_plus_z, visible = map_of(scene, physics, frame).look_up(looking(scene, physics))
    turned = origin @ physics.physics.numerics.sphere.euler_rotation(ROTATION).T
    colors = physics.physics.reference.reference_render.sample_environment(environment_pixels(), turned)
    colors *= physics.physics.redshift_gain(one_plus_z, 1.0, 1.0, physics.physics.DEFAULT_SKY_TEMPERATURE, colors)
    colors[~visible] = 0.0
    polar = np.arccos(np.abs(turned[:, 2]).clip(max=1.0))
    return colors.reshape(*SIZE[::-1], 3), (polar > math.pi / 16).reshape(SIZE[::-1])


def differences(picture: np.ndarray, expected: np.ndarray, where: np.ndarray) -> np.ndarray:
    """Relative differences, of each pixel the largest."""
    return (np.abs(picture[..., :3] - expected) / np.maximum(expected, 0.1)).max(axis=-1)[where]


def test_cycles_shows_what_numpy_predicts(scene, physics, tmp_path) -> None:
    switch()
    picture = render(scene, tmp_path / "picture.exr", physics.physics)
    expected, where = predicted(scene, physics)
    assert 0.05 < (expected.max(axis=-1) == 0.0).mean() < 0.6
    found = differences(picture, expected, where)
    assert np.median(found) < 1e-6  # single precision
    # next to the shadow the sky turns by a thousand times what the ray turns
    assert np.quantile(found, 0.99) < 1e-4
    assert (found > 1e-2).sum() <= 2, "a ray may fall on the other side of the edge"


def test_eevee_shows_what_numpy_predicts(scene, physics, tmp_path) -> None:
    scene.render.engine = "BLENDER_EEVEE" if bpy.app.version >= (5, 0) else "BLENDER_EEVEE_NEXT"
    scene.eevee.taa_render_samples = 1
    scene.render.filter_size = 0.0
    switch()
    picture = render(scene, tmp_path / "picture.exr", physics.physics)
    expected, where = predicted(scene, physics)
    found = differences(picture, expected, where)
    assert np.median(found) < 2e-3  # EEVEE composes in half floats
    assert (found > 2e-2).sum() <= 4


def test_a_camera_that_turns_needs_no_new_map_and_one_that_moves_does(scene, physics, tmp_path) -> None:
    scene.camera.rotation_euler.z = 0.0
    scene.camera.keyframe_insert("rotation_euler", frame=1)
    scene.camera.rotation_euler.z = 0.2
    scene.camera.keyframe_insert("rotation_euler", frame=2)
    scene.camera.keyframe_insert("location", frame=2)
    scene.camera.location.x = 0.7
    scene.camera.keyframe_insert("location", frame=3)
    scene.frame_start, scene.frame_end = 1, 3
    switch()
    scene.render.filepath = str(tmp_path / "frame_")
    bpy.ops.render.render(animation=True)
    hashes = [map_of(scene, physics, frame).metadata["hash"] for frame in (1, 2, 3)]
    assert hashes[0] == hashes[1] != hashes[2]
    for frame in (1, 2, 3):
        scene.frame_set(frame)
        picture = read(tmp_path / f"frame_{frame:04d}.exr", physics.physics)
        expected, where = predicted(scene, physics, frame)
        assert np.quantile(differences(picture, expected, where), 0.99) < 1e-4, f"frame {frame}"


def test_a_map_that_is_out_of_date_is_baked_and_read_again(scene, physics, tmp_path) -> None:
    switch()
    render(scene, tmp_path / "one.exr", physics.physics)
    scene.umbra.active_hole.umbra.spin = 0.1
    picture = render(scene, tmp_path / "two.exr", physics.physics)
    expected, where = predicted(scene, physics)
    assert np.quantile(differences(picture, expected, where), 0.99) < 1e-4


def test_other_rays_see_the_lensed_or_the_plain_sky(scene, physics, tmp_path) -> None:
    """A mirror in front of the camera, turned back by 90 degrees to the left: it shows what lies there."""
    bpy.ops.mesh.primitive_plane_add(size=20.0, location=(0.0, -5.0, 1.0), rotation=(math.pi / 2, 0.0, math.pi / 4))
    mirror = bpy.data.materials.new("Mirror")
    mirror.use_nodes = True
    tree = mirror.node_tree
    tree.nodes.clear()
    gloss, output = tree.nodes.new("ShaderNodeBsdfGlossy"), tree.nodes.new("ShaderNodeOutputMaterial")
    gloss.inputs["Roughness"].default_value = 0.0
    gloss.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    tree.links.new(gloss.outputs[0], output.inputs["Surface"])
    bpy.context.object.data.materials.append(mirror)
    normal = np.array([math.sqrt(0.5), -math.sqrt(0.5), 0.0])
    plain = render(scene, tmp_path / "plain.exr", physics.physics)
    switch()
    lensed = render(scene, tmp_path / "lensed.exr", physics.physics)
    group(scene).inputs["Lensed Light"].default_value = 0.0
    only_camera = render(scene, tmp_path / "camera.exr", physics.physics)
    assert np.allclose(only_camera, plain, atol=1e-5)

    directions = looking(scene, physics)
    mirrored = directions - 2.0 * (directions @ normal)[:, None] * normal
    origin, one_plus_z, visible = map_of(scene, physics).look_up(mirrored)
    turned = origin @ physics.physics.numerics.sphere.euler_rotation(ROTATION).T
    expected = physics.physics.reference.reference_render.sample_environment(environment_pixels(), turned)
    expected *= physics.physics.redshift_gain(one_plus_z, 1.0, 1.0, physics.physics.DEFAULT_SKY_TEMPERATURE, expected)
    expected[~visible] = 0.0
    found = differences(lensed, expected.reshape(*SIZE[::-1], 3), (np.abs(turned[:, 2]) < 0.98).reshape(SIZE[::-1]))
    assert np.quantile(found, 0.98) < 1e-3
    assert np.abs(lensed - plain).max() > 0.05


def test_lensing_is_one_click(scene, physics, tmp_path) -> None:
    plain = render(scene, tmp_path / "plain.exr", physics.physics)
    switch()
    lensed = render(scene, tmp_path / "lensed.exr", physics.physics)
    assert bpy.ops.umbra.toggle_lensing() == {"FINISHED"}
    assert np.allclose(render(scene, tmp_path / "off.exr", physics.physics), plain, atol=1e-5)
    assert bpy.ops.umbra.toggle_lensing() == {"FINISHED"}
    assert np.array_equal(render(scene, tmp_path / "on.exr", physics.physics), lensed)


def test_without_a_map_the_sky_is_magenta(scene, physics, modules, tmp_path) -> None:
    """As in a Blender without the add-on that lacks the files."""
    switch()
    handlers = modules("render.handlers")
    handlers.unregister()
    try:
        picture = render(scene, tmp_path / "picture.exr", physics.physics)
    finally:
        handlers.register()
    assert np.array_equal(picture[..., :3], np.broadcast_to([1.0, 0.0, 1.0], picture[..., :3].shape))


def state_of(scene: bpy.types.Scene) -> tuple:
    world = scene.world
    tree = world.node_tree
    nodes = [
        (node.name, tuple(node.location), [str(getattr(each, "default_value", "")) for each in node.inputs])
        for node in tree.nodes
    ]
    settings = (scene.render.film_transparent, scene.render.use_lock_interface, tuple(scene.keys()))
    return world, world.name, tuple(world.keys()), nodes, links_of(tree), settings, len(bpy.data.worlds)


def test_switching_back_restores_the_world_exactly(scene, physics, tmp_path) -> None:
    names = [each.name for data in (bpy.data.worlds, bpy.data.node_groups, bpy.data.images) for each in data]
    before = state_of(scene)
    switch()
    assert scene.world != before[0]
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 3.0
    switch("COMPOSITOR")
    assert state_of(scene) == before
    assert [each.name for data in (bpy.data.worlds, bpy.data.node_groups, bpy.data.images) for each in data] == names


def test_the_look_goes_with_the_output(scene) -> None:
    use_sky(scene)
    assert bpy.ops.umbra.setup_compositor() == {"FINISHED"}
    node = next(each for each in scene_tree(scene).nodes if each.name == "Umbra Black Hole")
    node.inputs["Exposure"].default_value, node.inputs["Redshift Color"].default_value = 1.5, 0.25
    node.inputs["Environment Rotation"].default_value = (0.0, 0.0, 0.5)
    switch()
    assert scene.world.node_tree.nodes["Mapping"].inputs["Rotation"].default_value[2] == 0.5
    assert group(scene).inputs["Exposure"].default_value == 1.5
    assert group(scene).inputs["Redshift Color"].default_value == 0.25
    group(scene).inputs["Redshift Brightness"].default_value = 0.5
    group(scene).inputs["Exposure"].default_value = 2.0
    switch("CYCLES_LENS")
    assert scene.umbra.redshift_brightness == 0.5
    assert "Umbra World" not in scene.world.node_tree.nodes
    switch("COMPOSITOR")
    node = next(each for each in scene_tree(scene).nodes if each.name == "Umbra Black Hole")
    assert node.inputs["Redshift Brightness"].default_value == 0.5


def scene_tree(scene: bpy.types.Scene) -> bpy.types.NodeTree:
    return scene.node_tree if bpy.app.version < (5, 0) else scene.compositing_node_group


def test_any_world_is_bent(scene, physics, tmp_path) -> None:
    """Nodes of any kind that look at Generated coordinates, also a plain color, which has a shadow in it."""
    tree = scene.world.node_tree
    tree.nodes.clear()
    background, output = tree.nodes.new("ShaderNodeBackground"), tree.nodes.new("ShaderNodeOutputWorld")
    tree.links.new(background.outputs[0], output.inputs["Surface"])
    background.inputs["Color"].default_value = (0.2, 0.4, 0.8, 1.0)
    switch()
    group(scene).inputs["Redshift Brightness"].default_value = 0.0
    group(scene).inputs["Redshift Color"].default_value = 0.0
    picture = render(scene, tmp_path / "picture.exr", physics.physics)
    visible = map_of(scene, physics).look_up(looking(scene, physics))[2].reshape(SIZE[::-1])
    shown = picture[..., 2] > 0.4
    assert (shown != visible).sum() <= 2
    assert np.allclose(picture[shown][:, :3], (0.2, 0.4, 0.8), atol=1e-5)


def test_a_world_that_cannot_be_bent_is_said_and_left_alone(scene) -> None:
    scene.world.node_tree.nodes.clear()
    with pytest.raises(RuntimeError, match="has no Background or Emission node"):
        switch()
    assert scene.umbra.output == "COMPOSITOR"
    assert len(bpy.data.worlds) == 1
    scene.world = None
    with pytest.raises(RuntimeError, match="has no World"):
        switch()
    scene.umbra.output = "WORLD"  # set by hand: a message, and back
    assert scene.umbra.output == "COMPOSITOR"


def test_scenes_have_worlds_and_maps_of_their_own(scene, physics, tmp_path) -> None:
    other = bpy.data.scenes.new("Other")
    other.world = scene.world
    original = scene.world
    switch()
    assert other.world == original != scene.world
    copied = scene.copy()  # shares the lensed World: it stays one
    assert copied.world == scene.world
    switch("COMPOSITOR")
    assert scene.world == original
    assert copied.world is not None


def test_any_lens_and_motion_can_be_rendered(scene, physics, tmp_path) -> None:
    """A fisheye panorama, which the warp map does not know."""
    data = scene.camera.data
    data.type = "PANO"
    owner = data if hasattr(data, "panorama_type") else data.cycles
    owner.panorama_type = "FISHEYE_EQUIDISTANT"
    scene.umbra.active_hole.umbra.motion = "FREE_FALL"
    switch()
    picture = render(scene, tmp_path / "picture.exr", physics.physics)
    assert 0.02 < (picture[..., :3].max(axis=-1) == 0.0).mean() < 0.9
    data.type = "ORTHO"
    assert bpy.ops.umbra.bake_frame.poll()
    with pytest.raises(RuntimeError, match="orthographic"):
        bpy.ops.umbra.bake_frame()


def test_a_saved_file_renders_without_the_add_on(scene, physics, tmp_path) -> None:
    switch()
    expected = render(scene, tmp_path / "expected.exr", physics.physics)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "file.blend"))
    code = (
        f"bpy.ops.wm.open_mainfile(filepath={str(tmp_path / 'file.blend')!r})\n"
        f"bpy.context.scene.render.filepath = {str(tmp_path / 'bare.exr')!r}\n"
        "assert not hasattr(bpy.context.scene, 'umbra')\n"
        "bpy.ops.render.render(write_still=True)\n"
    )
    done = run_python(code, resources=tmp_path / "resources")
    assert done.returncode == 0, done.stderr
    assert np.allclose(read(tmp_path / "bare.exr", physics.physics), expected, atol=1e-5)


def test_a_failed_frame_ends_a_headless_render(scene, tmp_path) -> None:
    switch()
    scene.umbra.auto_bake = False
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "file.blend"))
    done = run_python(
        f"bpy.ops.wm.open_mainfile(filepath={str(tmp_path / 'file.blend')!r})\nbpy.ops.render.render()\nprint('ended')"
    )
    assert done.returncode == 1
    assert "The world map" in done.stderr
    assert "ended" not in done.stdout


def test_a_changed_group_is_mended_when_a_file_is_opened(scene, physics, tmp_path) -> None:
    switch()
    expected = render(scene, tmp_path / "expected.exr", physics.physics)
    tree = group(scene).node_tree
    tree["umbra_world_version"] = 0
    tree.nodes.remove(next(node for node in tree.nodes if node.bl_idname == "ShaderNodeMath"))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "file.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "file.blend"))
    scene = bpy.context.scene
    assert np.allclose(render(scene, tmp_path / "again.exr", physics.physics), expected, atol=1e-6)


def test_the_cache_knows_world_maps(scene, physics, modules, tmp_path) -> None:
    switch()
    render(scene, tmp_path / "picture.exr", physics.physics)
    (path,) = Path(scene.umbra.map_folder).glob("*.exr")
    assert modules("bake.cache").FolderNames(scene, "Hole").maps == [(path.name, path)]
    names = modules("bake.names")
    match = names.name_pattern(names.shot_name(scene, "Hole")).fullmatch(path.name)
    assert names.kind_of(match) is modules("bake.kinds").WORLD_MAP


def disk_seen(scene: bpy.types.Scene, physics: ModuleType, frame: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """The disk's light, and the share that passes, for the pixels of a frame, from the layer for all directions."""
    (path,) = Path(scene.umbra.map_folder).glob(f"*_world_light_{frame:04d}.exr")
    layer = physics.physics.read_light_layer(path)
    hole = np.array(scene.umbra.active_hole.matrix_world)[:3, :3]
    hole /= np.linalg.norm(hole, axis=0)
    camera = np.array(layer.metadata["parameters"]["camera_to_hole"])
    x, y = physics.physics.HolePanorama(*physics.physics.WORLD_LIGHT_GRID).pixels(
        looking(scene, physics) @ hole @ camera
    )
    planes = np.concatenate([layer.light, layer.transmittance[..., None]], axis=-1).astype(np.float64)
    rows, columns = planes.shape[:2]
    left, above = np.floor(x - 0.5), np.floor(y - 0.5)
    share_x, share_y = (x - 0.5 - left)[:, None], (y - 0.5 - above)[:, None]

    def row(shift: int) -> np.ndarray:
        down = np.clip(above + shift, 0, rows - 1).astype(int)
        one, other = (planes[down, (left + step).astype(int) % columns] for step in (0, 1))
        return one + share_x * (other - one)

    found = (row(0) + share_y * (row(1) - row(0))).reshape(*SIZE[::-1], 4)
    return found[..., :3], found[..., 3:]


@pytest.mark.parametrize("engine", ["CYCLES", "EEVEE"])
def test_the_disk_is_before_the_bent_sky(
    scene: bpy.types.Scene, physics: ModuleType, modules: Callable, tmp_path: Path, engine: str
) -> None:
    if engine == "EEVEE":
        scene.render.engine = "BLENDER_EEVEE" if bpy.app.version >= (5, 0) else "BLENDER_EEVEE_NEXT"
        scene.eevee.taa_render_samples = 1
        scene.render.filter_size = 0.0
    disk = scene.umbra.active_hole.umbra.disk
    switch()
    nodes, links = len(scene.world.node_tree.nodes), links_of(scene.world.node_tree)
    groups, images = set(bpy.data.node_groups.keys()), set(bpy.data.images.keys())
    disk.enabled, disk.exposure, disk.opacity, disk.tint = True, 1.0, 0.75, (1.0, 0.5, 0.25)
    lines = modules("ui.status").lines(bpy.context)
    assert "The disk is a part of the World" in " ".join(line.text for line in lines)
    picture = render(scene, tmp_path / "picture.exr", physics.physics)
    expected, where = predicted(scene, physics)
    light, passes = disk_seen(scene, physics)
    assert (passes < 0.7).mean() > 0.05, "there should be a disk in the picture"
    covers = 0.75 * (1.0 - passes)
    expected = (1.0 - covers) * expected + 0.75 * 2.0 * np.array([1.0, 0.5, 0.25]) * light
    found = differences(picture, expected, where)
    half_floats = engine == "EEVEE"
    assert np.median(found) < (2e-3 if half_floats else 1e-5)
    assert np.quantile(found, 0.98) < (2e-2 if half_floats else 2e-3)
    disk.enabled = False
    assert (len(scene.world.node_tree.nodes), links_of(scene.world.node_tree)) == (nodes, links)
    assert (set(bpy.data.node_groups.keys()), set(bpy.data.images.keys())) == (groups, images)


def test_keyframes_of_the_disk_are_followed_in_the_world(
    scene: bpy.types.Scene, physics: ModuleType, tmp_path: Path
) -> None:
    disk = scene.umbra.active_hole.umbra.disk
    disk.enabled = True
    for frame, exposure, temperature in ((1, 0.0, 3000.0), (2, 2.0, 9000.0)):
        disk.exposure, disk.temperature = exposure, temperature
        disk.keyframe_insert("exposure", frame=frame)
        disk.keyframe_insert("temperature", frame=frame)
    switch()
    scene.frame_start, scene.frame_end = 1, 2
    scene.render.filepath = str(tmp_path / "frame_")
    bpy.ops.render.render(animation=True)
    for frame in (1, 2):
        scene.frame_set(frame)
        picture = read(tmp_path / f"frame_{frame:04d}.exr", physics.physics)
        expected, where = predicted(scene, physics, frame)
        light, passes = disk_seen(scene, physics, frame)
        found = differences(picture, passes * expected + 2.0**disk.exposure * light, where)
        assert np.quantile(found, 0.98) < 2e-3


def test_the_lens_disk_goes_with_the_lens(scene: bpy.types.Scene) -> None:
    """Its nodes would draw an old disk over every picture."""
    scene.umbra.active_hole.umbra.disk.enabled = True
    switch("CYCLES_LENS")
    assert "umbra_lens_tree_before" in scene
    switch("WORLD")
    assert "umbra_lens_tree_before" not in scene
    tree = scene.compositing_node_group if bpy.app.version >= (5, 0) else scene.node_tree
    assert tree is None or not any("umbra_role" in node for node in tree.nodes)


def test_the_world_again_keeps_the_artists_values(scene: bpy.types.Scene) -> None:
    switch()
    group(scene).inputs["Exposure"].default_value = 3.0
    switch()
    assert group(scene).inputs["Exposure"].default_value == 3.0


def test_a_saved_file_reads_the_maps_of_its_hole(scene: bpy.types.Scene, tmp_path: Path, modules: Callable) -> None:
    switch()
    scene.umbra.active_hole.name = "Renamed"
    modules("outputs.world.world_sync").point_at_nothing(scene)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "renamed.blend"))
    (image,) = {node.image for node in group(scene).node_tree.nodes if "umbra_world_map" in node}
    assert "_Renamed_" in image.filepath


@pytest.mark.skipif(bpy.app.version < (4, 3), reason="view layers have no World of their own")
def test_a_world_override_is_refused(scene: bpy.types.Scene, modules: Callable) -> None:
    switch()
    layer = scene.view_layers[0]
    if not hasattr(layer, "world_override"):
        pytest.skip("view layers of this Blender have no World of their own")
    layer.world_override = bpy.data.worlds.new("Other")
    with pytest.raises(modules("core.errors").SceneError, match="World Override"):
        modules("outputs.world.output").check_world(scene)


def test_a_farm_looks_for_world_maps(scene: bpy.types.Scene, tmp_path: Path, modules: Callable) -> None:
    """Without the add-on a World without its map would be magenta, and the exit status 0."""
    switch()
    assert bpy.ops.umbra.bake_frame() == {"FINISHED"}
    blend = tmp_path / "world.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    script = tmp_path / "umbra_farm.py"
    script.write_text(modules("farm.farm_templates").script(), encoding="utf-8")
    check = f"""
import importlib.util, pathlib
spec = importlib.util.spec_from_file_location("umbra_farm", {str(script)!r})
farm = importlib.util.module_from_spec(spec)
spec.loader.exec_module(farm)
bpy.ops.wm.open_mainfile(filepath={str(blend)!r})
(path,) = farm.map_files(bpy.context.scene, 1)
print(path.is_file(), path.name)
"""
    result = run_python(check)
    assert result.returncode == 0, result.stderr
    assert "True " in result.stdout
    assert "_world_0001.exr" in result.stdout
