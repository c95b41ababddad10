# SPDX-License-Identifier: GPL-3.0-or-later
"""Drivers that fail: Blender takes 0 in their place, and nobody would know."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import bpy
import pytest
from small_scene import add_hole, refused, run_python

Run = Callable[[str], int]


@pytest.fixture
def run(addon_module: Callable[[str], ModuleType]) -> Run:
    return lambda line: addon_module("command.command_line").run(line.split())


def broken(owner: bpy.types.bpy_struct, path: str, expression: str = "1/0", index: int = -1) -> bpy.types.Driver:
    driver = owner.driver_add(path, index).driver
    driver.expression = expression
    return driver


@pytest.mark.parametrize("expression", ["1/0", "float('nan')", "1e308 * 10", "sqrt(-1)", "not_there", "1 if"])
def test_whatever_is_wrong_with_it(
    scene: bpy.types.Scene, run: Run, capfd: pytest.CaptureFixture[str], expression: str
) -> None:
    hole = add_hole(scene)
    broken(hole, "umbra.spin", expression)
    assert run("bake --frames 1") == 1
    error = capfd.readouterr().err
    assert 'umbra.spin) of object "Black Hole"' in error
    assert "[settings.driver]" in error
    assert not list(Path(scene.umbra.map_folder).glob("*.exr"))


def owners(scene: bpy.types.Scene) -> dict[str, bpy.types.ID]:
    camera = scene.camera
    parent = bpy.data.objects.new("Parent", None)
    scene.collection.objects.link(parent)
    camera.parent = parent
    target = bpy.data.objects.new("Target", None)
    scene.collection.objects.link(target)
    camera.constraints.new("COPY_ROTATION").target = target
    hole = scene.umbra.active_hole
    return {"hole": hole, "camera": camera, "data": camera.data, "scene": scene, "parent": parent, "target": target}


@pytest.mark.parametrize(
    ("owner", "path", "index"),
    [
        ("hole", "location", 1),
        ("hole", "umbra.mass_scale", -1),
        ("hole", "umbra.disk.outer_radius", -1),
        ("hole", "umbra.disk.light_strength", -1),
        ("camera", "rotation_euler", 2),
        ("camera", 'constraints["Copy Rotation"].influence', -1),
        ("data", "lens", -1),
        ("data", "shift_x", -1),
        ("data", "dof.aperture_fstop", -1),
        ("scene", "umbra.sphere_radius", -1),
        ("scene", "umbra.redshift_color", -1),
        ("parent", "location", 0),
        ("target", "rotation_euler", 0),
    ],
)
def test_whosever_it_is(
    scene: bpy.types.Scene, run: Run, capfd: pytest.CaptureFixture[str], owner: str, path: str, index: int
) -> None:
    add_hole(scene)
    found = owners(scene)[owner]
    broken(found, path, index=index)
    assert run("bake --frames 1") == 1
    error = capfd.readouterr().err
    assert path.rpartition(".")[2] in error
    assert f'"{found.name}"' in error
    assert "[settings.driver]" in error


def test_a_variable_that_is_no_number(scene: bpy.types.Scene, run: Run, capfd: pytest.CaptureFixture[str]) -> None:
    hole = add_hole(scene)
    scene.camera["broken"] = float("nan")
    for kind in ("SUM", "SCRIPTED"):
        driver = broken(hole, "umbra.spin", "source")
        driver.type = kind
        source = driver.variables.new()
        source.name = "source"
        source.targets[0].id, source.targets[0].data_path = scene.camera, '["broken"]'
        assert run("bake --frames 1") == 1
        assert "[settings.driver]" in capfd.readouterr().err
        hole.driver_remove("umbra.spin")
    assert run("bake --frames 1") == 0


def test_drivers_that_work(scene: bpy.types.Scene, run: Run) -> None:
    """Also those of kinds that are not evaluated a second time, and those of no concern."""
    hole = add_hole(scene)
    broken(hole, "umbra.spin", "min(frame, 9) / 10 if frame > 0 else 0.5")
    distance = broken(hole, "umbra.mass_scale", "0.1 + distance * 0.01")
    variable = distance.variables.new()
    variable.name, variable.type = "distance", "LOC_DIFF"
    variable.targets[0].id, variable.targets[1].id = scene.camera, hole
    other = bpy.data.objects.new("Other", None)
    scene.collection.objects.link(other)
    broken(other, "location", index=0)
    assert run("bake --frames 1") == 0


def test_a_place_that_is_no_number(scene: bpy.types.Scene, run: Run, capfd: pytest.CaptureFixture[str]) -> None:
    add_hole(scene)
    scene.camera.location.x = float("nan")
    assert run("bake --frames 1") == 1
    assert "[hole.not-finite]" in capfd.readouterr().err


@pytest.mark.parametrize(
    "change",
    [
        "hole.driver_add('umbra.spin').driver.expression = '1/(frame - 2)'\n",
        "tree = scene.node_tree if bpy.app.version < (5, 0) else scene.compositing_node_group\n"
        "group = next(node for node in tree.nodes if node.type == 'GROUP')\n"
        "group.inputs['Exposure'].driver_add('default_value').driver.expression = '1/0'\n",
        "tree = scene.world.node_tree\nscene.umbra.environment_source = 'WORLD'\n"
        "texture = tree.nodes.new('ShaderNodeTexEnvironment')\n"
        "texture.image = scene.umbra.environment_image\n"
        "background = tree.nodes['Background']\ntree.links.new(texture.outputs[0], background.inputs[0])\n"
        "background.inputs[1].driver_add('default_value').driver.expression = '1/0'\n"
        "bpy.ops.umbra.setup_compositor()\n",
    ],
    ids=["spin", "exposure", "strength of the sky"],
)
def test_a_render_is_refused(tmp_path: Path, change: str) -> None:
    begin = f"""
import os
from pathlib import Path
from small_scene import add_hole, shrink
scene = bpy.context.scene
shrink(scene)
scene.frame_start, scene.frame_end = 1, 2
scene.umbra.map_folder = {str(tmp_path / "maps")!r}
scene.render.filepath = {str(tmp_path / "picture_")!r}
hole = add_hole(scene)
"""
    result = run_python(f"{begin}{change}bpy.ops.render.render(animation=True)\nos._exit(0)\n")
    assert refused(result)
    assert "[settings.driver]" in result.stderr


def test_the_panel_says_it(scene: bpy.types.Scene, addon_module: Callable[[str], ModuleType]) -> None:
    hole = add_hole(scene)
    broken(hole, "umbra.spin")
    lines = addon_module("ui.status").lines(bpy.context)
    assert "umbra.spin" in " ".join(line.text for line in lines)
