# SPDX-License-Identifier: GPL-3.0-or-later
"""Glare in the compositor's node group, against numpy's convolution by Fourier transforms."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace

import bpy
import numpy as np
import pytest
from compositor_scene import FloatArray, GroupRenderer
from small_scene import add_hole, environment_image, use_sky

import physics

SIZE = (320, 180)
KINDS = {"SUBTLE": 1, "FILM": 2}

# Blender's fast Gaussians are off by 1e-3 of their peaks, and a spike of no width is 1/7 of a pixel wide there.
SHAPE = 0.03
CONSERVED = 5e-4


@pytest.fixture
def shine(addon_module: Callable[[str], ModuleType], tmp_path: Path) -> Callable[..., FloatArray]:
    """A function that renders a sky, one texel per pixel and unbent, through the group with a kind of glare."""
    module = addon_module("nodes.black_hole_group")

    def render(sky: FloatArray, glare: int, **options: object) -> FloatArray:
        def add_group_node(tree: bpy.types.NodeTree, looks: int) -> bpy.types.Node:
            return module.add_group_node(tree, looks, glare)

        height, width = sky.shape[:2]
        group = GroupRenderer(SimpleNamespace(add_group_node=add_group_node), tmp_path)
        return group.render((width, height), warp_map=unbent(width, height), environment=sky, **options)[..., :3]

    return render


def unbent(width: int, height: int) -> FloatArray:
    """A map by which each pixel shows the texel of its own row and column."""
    longitude = np.pi * (1.0 - 2.0 * (np.arange(width) + 0.5) / width) % (2.0 * np.pi)
    polar = np.pi * (np.arange(height) + 0.5) / height
    channels = np.ones((height, width, 4), np.float32)
    channels[..., 0], channels[..., 1] = polar[:, np.newaxis], longitude
    return channels


def stars(size: tuple[int, int] = SIZE) -> FloatArray:
    """Bright points on a dim ground, far from the edges, and one that outshines all."""
    width, height = size
    sky = np.full((height, width, 4), 0.01, np.float32)
    rng = np.random.default_rng(5)
    rows, columns = rng.integers(height // 3, 2 * height // 3, 20), rng.integers(width // 3, 2 * width // 3, 20)
    sky[rows, columns, :3] = rng.gamma(0.5, 50.0, (20, 3))
    sky[height // 2, width // 2, :3] = 5000.0
    sky[..., 3] = 1.0
    return sky


@pytest.mark.parametrize("kind", KINDS)
def test_light_is_spread_as_numpy_does_and_conserved(shine: Callable[..., FloatArray], kind: str) -> None:
    plain = shine(stars(), 0)
    np.testing.assert_allclose(plain, stars()[..., :3], rtol=1e-3, atol=5e-3)  # off, each pixel shows its texel
    seen, expected = shine(stars(), KINDS[kind]), physics.add_glare(plain, KINDS[kind])
    moved = np.abs(expected - plain).sum()
    assert moved > 0.04 * plain.sum()
    assert np.abs(seen - expected).sum() < SHAPE * moved
    assert seen.sum() == pytest.approx(plain.sum(), rel=CONSERVED)
    assert seen.min() >= 0.0
    # a star that goes on by a pixel takes its glare along: nothing flickers
    on = shine(np.roll(stars(), 1, axis=1), KINDS[kind])
    np.testing.assert_allclose(on[:, 1:], seen[:, :-1], rtol=5e-3, atol=1e-3)


def test_sizes_follow_the_resolution(shine: Callable[..., FloatArray]) -> None:
    """The same share of the light lies within the same part of the picture."""
    shares = []
    for factor in (1, 2):
        width, height = SIZE[0] * factor, SIZE[1] * factor
        sky = np.zeros((height, width, 4), np.float32)
        sky[height // 2 - factor // 2 :, width // 2 - factor // 2 :][:factor, :factor] = 100.0
        light = shine(sky, KINDS["FILM"])[..., 1]
        row, column = np.mgrid[:height, :width]
        distance = np.hypot(row + 0.5 - height / 2.0, column + 0.5 - width / 2.0) / height
        shares.append([light[distance < radius].sum() / light.sum() for radius in (0.02, 0.05, 0.15)])
    np.testing.assert_allclose(shares[0], shares[1], atol=5e-3)
    assert shares[0][0] < 0.95 < shares[0][2]


def test_the_render_keeps_its_own_light(shine: Callable[..., FloatArray]) -> None:
    """Sky and disk glow over what stands before them, as in a lens; what is hidden does not."""
    rng = np.random.default_rng(6)
    front = np.zeros((*SIZE[::-1], 4), np.float32)
    front[:, : SIZE[0] // 2] = 1.0
    front[:, : SIZE[0] // 2, :3] = rng.random((SIZE[1], SIZE[0] // 2, 3))
    disk = np.zeros_like(front)
    disk[..., 3] = 1.0  # all of what is behind passes
    disk[60:90, 100:220] = (3.0, 2.0, 1.0, 0.5)
    alpha = front[..., 3:]
    behind = shine(stars(), 0, disk=disk, output="Sky")
    seen = shine(stars(), KINDS["FILM"], foreground=front, disk=disk)
    expected = front[..., :3] + physics.add_glare(behind * (1.0 - alpha), KINDS["FILM"])
    spread = expected - front[..., :3]
    assert np.abs(seen - expected).sum() < SHAPE * np.abs(spread - behind * (1.0 - alpha)).sum()
    assert spread[:, : SIZE[0] // 2].max() > 0.01
    dark = stars() * np.float32(0.0)
    np.testing.assert_array_equal(shine(dark, KINDS["FILM"], foreground=front), front[..., :3])


def test_a_pixel_that_is_no_number_does_not_fill_the_picture(shine: Callable[..., FloatArray]) -> None:
    sky = stars()
    sky[90, 40, :3] = np.nan
    seen = shine(sky, KINDS["FILM"])
    far = seen[:, SIZE[0] // 2 :]
    assert np.isfinite(far).all()
    np.testing.assert_allclose(far, shine(stars(), KINDS["FILM"])[:, SIZE[0] // 2 :], rtol=0.05, atol=1e-3)


def test_an_artist_chooses_it_and_the_stars_bring_it(
    scene: bpy.types.Scene, addon_module: Callable[[str], ModuleType], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(addon_module("bake.star_sky"), "HEIGHT", 64)
    monkeypatch.setattr(addon_module("bake.star_sky"), "FILE", "umbra_stars_64.exr")
    scene.umbra.property_unset("glare")
    tree_module = addon_module("outputs.shared.compositor_tree")

    def blurs() -> int:
        group = tree_module.find_setup(scene).group.node_tree
        return sum(node.bl_idname == "CompositorNodeBlur" for node in group.nodes)

    use_sky(scene, environment_image())
    add_hole(scene, sky=False)
    assert (scene.umbra.glare, blurs()) == ("OFF", 0)  # an image is shown as it is
    assert bpy.ops.umbra.use_star_sky() == {"FINISHED"}
    assert scene.umbra.glare == "SUBTLE"
    counts = []
    for kind in ("SUBTLE", "FILM", "OFF"):
        scene.umbra.glare = kind
        counts.append(blurs())
    assert counts == [len(physics.GLARES[kind]) for kind in (1, 2, 0)]
    assert bpy.ops.umbra.use_star_sky() == {"FINISHED"}
    assert scene.umbra.glare == "OFF"  # the artist's choice stays
    assert len([tree for tree in bpy.data.node_groups if "umbra_version" in tree]) == 1
