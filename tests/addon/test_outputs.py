# SPDX-License-Identifier: GPL-3.0-or-later
"""The protocol of outputs: a fourth one in a single file, and switches that happen wholly or not at all."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import bpy
import numpy as np
import pytest
from small_scene import add_hole, links_of, plain_name, render, world_sky

PLAIN = (0.25, 0.5, 0.75)


@pytest.fixture
def flat(addon_module: Callable[[str], ModuleType]) -> Iterator[object]:
    """An output that shows an even sky, darker where the frame's map says so: all that an output needs."""
    protocol, registry = addon_module("outputs.protocol"), addon_module("outputs.registry")
    requests, kinds = addon_module("bake.request"), addon_module("bake.kinds")
    errors = addon_module("core.errors")

    class FlatOutput(protocol.Output):
        identifier, number, label, description = "FLAT", 99, "Flat", "An even sky"
        refuses = fails = False

        def check(self, scene: bpy.types.Scene) -> None:
            if self.refuses:
                raise errors.SceneError("Not here: choose another output.", code="scene.flat")

        def install(self, scene: bpy.types.Scene, look: dict[str, object]) -> list[str]:
            scene["flat_before"] = scene.world
            scene.world = bpy.data.worlds.new("Flat")
            if bpy.app.version < (5, 0):
                scene.world.use_nodes = True
            if self.fails:
                raise errors.SceneError("It went wrong half-way.", code="scene.flat")
            return ["The sky is flat now."]

        def remove(self, scene: bpy.types.Scene) -> None:
            flat, scene.world = scene.world, scene["flat_before"]
            bpy.data.worlds.remove(flat)
            del scene["flat_before"]

        def is_in_use(self, scene: bpy.types.Scene) -> bool:
            return True

        def map_requests(self, scene: bpy.types.Scene, frame: object) -> list[object]:
            return [requests.request(scene, frame, kinds.WARP_MAP, frame.parameters)]

        def take_away(self, scene: bpy.types.Scene) -> None:
            self._show(scene, (1.0, 0.0, 1.0))

        def point_at(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, frame: object) -> list[str]:
            (wanted,) = self.map_requests(scene, frame)
            assert wanted.path.is_file()
            self._show(scene, PLAIN)
            return []

        def _show(self, scene: bpy.types.Scene, color: tuple[float, float, float]) -> None:
            background = next(node for node in scene.world.node_tree.nodes if node.type == "BACKGROUND")
            background.inputs["Color"].default_value = (*color, 1.0)

    output = FlatOutput()
    registry.add(output)
    yield output
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    registry.remove(output)


def state_of(scene: bpy.types.Scene) -> tuple[object, ...]:
    """All that an output may change of a scene, in a form that can be compared."""
    camera = scene.camera.data
    tree = scene.node_tree if bpy.app.version < (5, 0) else scene.compositing_node_group
    render = scene.render
    return (
        scene.umbra.output,
        (camera.type, camera.custom_mode, camera.custom_bytecode_hash, tuple(sorted(camera.keys()))),
        (scene.world.name, tuple(sorted((node.name, node.type) for node in scene.world.node_tree.nodes))),
        None if tree is None else (tree.name, links_of(tree), tuple(sorted(node.name for node in tree.nodes))),
        (render.film_transparent, render.use_compositing, render.use_lock_interface, render.compositor_precision),
        tuple(sorted(scene.keys())),
        tuple(sorted(each.name for each in bpy.data.worlds)),
    )


def test_a_fourth_output_in_one_file(
    scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType, flat: object, addon_module: Callable[[str], ModuleType]
) -> None:
    add_hole(scene)
    before = state_of(scene)
    assert bpy.ops.umbra.set_output(output="FLAT") == {"FINISHED"}
    assert scene.umbra.output == "FLAT"
    picture = render(scene, tmp_path / "flat.exr", exr)
    np.testing.assert_allclose(picture[..., :3], np.broadcast_to(PLAIN, picture[..., :3].shape), rtol=1e-6)
    assert [plain_name(each) for each in (tmp_path / "maps").iterdir()] == ["Scene_Black_Hole_64x36_0001.exr"]
    text = " ".join(line.text for line in addon_module("ui.status").lines(bpy.context))
    assert "1 of 3 frames baked" in text
    scene.umbra.output = "COMPOSITOR"
    assert state_of(scene) == before


@pytest.mark.parametrize("old", ["COMPOSITOR", "CYCLES_LENS", "WORLD"])
@pytest.mark.parametrize("how", ["refuses", "fails"])
def test_an_output_that_refuses_or_fails_changes_nothing(
    scene: bpy.types.Scene, flat: object, old: str, how: str
) -> None:
    world_sky(scene, bpy.data.images.new("Sky", 8, 4))
    add_hole(scene, sky=False)
    scene.umbra.active_hole.umbra.disk.enabled = True
    if old != "COMPOSITOR":
        assert bpy.ops.umbra.set_output(output=old) == {"FINISHED"}
    before = state_of(scene)
    setattr(flat, how, True)
    with pytest.raises(RuntimeError, match=r"Not here|half-way"):
        bpy.ops.umbra.set_output(output="FLAT")
    assert state_of(scene) == before
    scene.umbra.output = "FLAT"  # the setting itself, as the panel writes it
    assert state_of(scene) == before


def test_a_lens_without_its_shader_is_refused_before_anything_changes(
    scene: bpy.types.Scene, addon_module: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch
) -> None:
    errors = addon_module("core.errors")

    def no_shader(**_variant: bool) -> None:
        raise errors.SceneError("This Blender was built without Open Shading Language.", code="lens.none")

    monkeypatch.setattr(addon_module("outputs.lens.lens_shader"), "bytecode", no_shader)
    add_hole(scene)
    before = state_of(scene)
    with pytest.raises(RuntimeError, match="Open Shading Language"):
        bpy.ops.umbra.set_output(output="CYCLES_LENS")
    assert state_of(scene) == before
    assert scene.camera.data.type == "PERSP"


def test_state_of_the_session_survives_new_names_and_undo(
    scene: bpy.types.Scene, addon_module: Callable[[str], ModuleType]
) -> None:
    session = addon_module("core.session")
    notes = session.SESSION.per_scene(list, session.Life.FILE)
    notes.of(scene).append("kept")
    scene.name = "Renamed"
    assert notes.find(bpy.context.scene) == ["kept"]
    bpy.ops.ed.undo_push(message="one")
    scene.frame_end = 77
    bpy.ops.ed.undo_push(message="two")
    bpy.ops.ed.undo()
    assert bpy.context.scene.frame_end != 77
    assert notes.find(bpy.context.scene) == ["kept"]
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    assert notes.find(bpy.context.scene) is None
