# SPDX-License-Identifier: GPL-3.0-or-later
"""The lines that viewports draw: the shadow's outline is where the picture's shadow is, the disk's edges are its."""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector
from small_scene import add_hole, environment_image, render, use_sky

SIZE = (96, 96)


@pytest.fixture
def outline(addon_module: Callable[[str], ModuleType]) -> ModuleType:
    return addon_module("scene.hole_outline")


def eye_of(scene: bpy.types.Scene) -> np.ndarray:
    return np.array(scene.camera.matrix_world.translation)


@pytest.mark.parametrize("motion", ["FIDO", "FREE_FALL", "CIRCULAR"])
def test_the_outline_is_where_the_shadow_is_rendered(
    scene: bpy.types.Scene, tmp_path: Path, exr: ModuleType, outline: ModuleType, motion: str
) -> None:
    """Each column and row of pixels of a turned, moved hole of high spin, to one pixel."""
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    use_sky(scene, environment_image(np.ones((4, 8, 3), np.float32)))
    hole = add_hole(scene, sky=False, spin=0.99, motion=motion, mass_scale=0.2)
    scene.umbra.redshift_brightness = scene.umbra.redshift_color = 0.0
    hole.location, hole.rotation_euler, hole.scale = (0.3, -0.4, 0.2), (1.0, 0.3, 0.5), (1.5, 1.5, 1.5)
    picture = render(scene, tmp_path / "picture.exr", exr)[..., :3].max(axis=-1)
    shadow = np.argwhere(picture < 0.5)
    (line,) = outline.lines(hole, eye_of(scene))
    seen = np.array([world_to_camera_view(scene, scene.camera, Vector(place))[:2] for place in line])
    places = np.stack([(1.0 - seen[:, 1]) * SIZE[1], seen[:, 0] * SIZE[0]], axis=-1)
    assert len(shadow) > 300
    np.testing.assert_allclose(places.min(axis=0), shadow.min(axis=0), atol=1.0)
    np.testing.assert_allclose(places.max(axis=0), shadow.max(axis=0) + 1, atol=1.0)


def test_the_disks_edges_are_in_its_plane(scene: bpy.types.Scene, outline: ModuleType) -> None:
    hole = add_hole(scene, spin=0.0, mass_scale=0.5)
    hole.umbra.disk.texture = scene.umbra.environment_image
    hole.umbra.disk.enabled = True
    hole.umbra.disk.outer_radius = 14.0
    hole.location, hole.rotation_euler = (1.0, 2.0, 3.0), (0.7, -0.2, 0.1)
    bpy.context.view_layer.update()
    _shadow, inner, outer = outline.lines(hole, eye_of(scene))
    axis = np.array(hole.matrix_world)[:3, 2]
    for line, radius in ((inner, 3.0), (outer, 7.0)):  # half of 6 M, the innermost orbit, and of 14 M
        from_center = line - np.array(hole.location)
        np.testing.assert_allclose(np.linalg.norm(from_center, axis=-1), radius, rtol=1e-6)
        np.testing.assert_allclose(from_center @ axis, 0.0, atol=1e-5)


def test_eyes_far_away_and_inside(scene: bpy.types.Scene, outline: ModuleType) -> None:
    """Without perspective the shadow is sqrt(27) M large; inside the horizon there is none."""
    hole = add_hole(scene, spin=0.0, mass_scale=0.5)
    for eye, is_far in ((np.array([0.0, 3.0, 4.0]), True), (np.array([0.0, 3e8, 4e8]), False)):
        (line,) = outline.lines(hole, eye, is_far=is_far)
        across = np.cross(line, eye / np.linalg.norm(eye))
        np.testing.assert_allclose(np.linalg.norm(across, axis=-1), 0.5 * np.sqrt(27.0), rtol=1e-3)
    assert outline.lines(hole, np.zeros(3)) == []
    assert outline.lines(hole, np.array([0.0, 0.9, 0.0])) == []


def test_a_hidden_hole_has_no_lines(scene: bpy.types.Scene, addon_module: Callable[[str], ModuleType]) -> None:
    overlay = addon_module("ui.hole_overlay")
    space = next(each for each in bpy.data.screens["Layout"].areas if each.type == "VIEW_3D").spaces[0]
    context = SimpleNamespace(scene=scene, space_data=space, view_layer=bpy.context.view_layer)
    assert overlay.shown_hole(context) is None
    hole = add_hole(scene)
    assert overlay.shown_hole(context) == hole
    for owner, name, off in (
        (space.overlay, "show_overlays", False),
        (space.overlay, "show_extras", False),
        (hole, "hide_viewport", True),
        (space, "show_object_viewport_empty", False),
    ):
        setattr(owner, name, off)
        bpy.context.view_layer.update()
        assert overlay.shown_hole(context) is None, name
        setattr(owner, name, not off)
    bpy.context.view_layer.update()
    assert overlay.shown_hole(context) == hole
    assert not overlay._handles.now  # nothing is drawn in the background
