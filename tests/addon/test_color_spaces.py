# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures in studios' color configurations, compared with plain Blender's and with those in Blender's own one."""

from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from small_scene import read, run_python

CONFIGURATIONS = [
    "ocio://cg-config-v2.1.0_aces-v1.3_ocio-v2.3",
    "ocio://studio-config-v2.1.0_aces-v1.3_ocio-v2.3",
]

# Linear Rec.709 to ACEScg, D65 to D60 by Bradford: the product of the matrices that the Academy publishes
# (ACES Project, transforms S-2014-004 and the sRGB primaries of ITU-R BT.709).
REC709_TO_ACESCG = np.array(
    [
        [0.613097, 0.339523, 0.047379],
        [0.070194, 0.916354, 0.013452],
        [0.020616, 0.109570, 0.869815],
    ]
)

SCENE = """
import os

from pathlib import Path
from small_scene import add_hole, environment_image, environment_pixels, shrink, world_sky
from bl_ext.user_default.umbra_black_hole.core import color_spaces
folder = Path({folder!r})
scene = bpy.context.scene
shrink(scene)
bpy.data.objects.remove(bpy.data.objects["Cube"])
scene.umbra.map_folder = str(folder / "maps")
scene.world.cycles.sampling_method = "NONE"  # a table of the sky's light would take longer than the render
image = bpy.data.images.new("Panorama", 32, 16, float_buffer={is_float}, is_data=False)
pixels = environment_pixels()
import numpy as np
full = np.ones((16, 32, 4), np.float32)
full[..., :3] = pixels
image.pixels.foreach_set(full[::-1].ravel())
image.pack()

def picture(name):
    scene.render.filepath = str(folder / name)
    bpy.ops.render.render(write_still=True)
"""


@pytest.mark.parametrize("configuration", CONFIGURATIONS)
@pytest.mark.parametrize("is_float", [True, False])
def test_a_sky_is_as_plain_blender_shows_it(
    tmp_path: Path, exr: ModuleType, monkeypatch: pytest.MonkeyPatch, configuration: str, is_float: bool
) -> None:
    """A hole of next to no mass: what differs is interpolation between texels, in pictures of 32 by 16."""
    monkeypatch.setenv("OCIO", configuration)
    script = (
        SCENE.format(folder=str(tmp_path), is_float=is_float)
        + """
world_sky(scene, image)
picture("plain.exr")
add_hole(scene, sky=False, mass_scale=1e-4)
picture("hole.exr")
os._exit(0)
"""
    )
    run_python(script).check_returncode()
    plain, hole = (read(tmp_path / f"{name}.exr", exr)[..., :3] for name in ("plain", "hole"))
    np.testing.assert_allclose(np.median(np.abs(hole - plain)), 0.0, atol=2e-3)
    assert np.ptp(plain) > 0.3


@pytest.mark.parametrize("configuration", CONFIGURATIONS)
def test_a_disk_has_the_same_colors_in_another_space(
    tmp_path: Path, exr: ModuleType, monkeypatch: pytest.MonkeyPatch, configuration: str
) -> None:
    """The picture in ACEScg is that in Rec.709 by the published matrix; it is the disk's alone, before a black sky."""
    script = (
        SCENE.format(folder=str(tmp_path), is_float=True)
        + """
image.pixels.foreach_set(np.zeros(full.size, np.float32))
scene.umbra.environment_image, scene.umbra.environment_source = image, "IMAGE"
hole = add_hole(scene, sky=False, mass_scale=0.3)
hole.umbra.disk.enabled = True
picture({name!r})
os._exit(0)
"""
    )
    pictures = []
    for name in ("own.exr", "aces.exr"):
        run_python(script.replace("{name!r}", repr(name))).check_returncode()
        pictures.append(read(tmp_path / name, exr)[..., :3])
        monkeypatch.setenv("OCIO", configuration)
    own, aces = pictures
    assert own.max() > 0.5
    np.testing.assert_allclose(aces, own @ REC709_TO_ACESCG.T, rtol=5e-3, atol=2e-3 * own.max())
