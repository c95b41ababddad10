# SPDX-License-Identifier: GPL-3.0-or-later
"""What a map is known by: rounding noise changes nothing, and what an artist can see changes all."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from physics import Disk, PanoramaCamera, PerspectiveCamera, WarpMapParameters, looking_at_hole
from physics.shot.identity import BAKE_VERSION, DISK_BAKE_VERSION, agree, hash_of, version_of

PLACE = (9.0, -4.0, 2.5)
BASE = WarpMapParameters(
    0.9,
    PerspectiveCamera(64, 36, focal_length=35.0, shift_x=0.1),
    PLACE,
    looking_at_hole(PLACE),
    motion="velocity",
    velocity=(0.1, -0.2, 0.05),
    disk=Disk(crossings=2, inner_radius=3.0),
)
# The parameters of a map as version 0.1.0 writes them into its header.
PLAIN_SHOT = """{
 "spin": 0.9, "camera": {"kind": "perspective", "width": 64, "height": 36, "focal_length": 35.0, "sensor_width": 36.0,
 "sensor_height": 24.0, "sensor_fit": "AUTO", "shift_x": 0.0, "shift_y": 0.0, "pixel_aspect_x": 1.0,
 "pixel_aspect_y": 1.0}, "camera_position": [9.0, -4.0, 2.5], "camera_to_hole": [[0.40613846605344767,
 -0.2248286334755729, 0.8857220963492212], [0.9138115486202572, 0.09992383710025463, -0.39365426504409834],
 [-0.0, 0.9692612198724698, 0.24603391565256144]], "hole_to_world": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0],
 [0.0, 0.0, 1.0]], "motion": "fido", "velocity": [0.0, 0.0, 0.0], "supersampling": 1, "tolerance": 1e-06,
 "method": "gauss-legendre", "interpolation": 5e-06
}"""


def moved(by: float) -> WarpMapParameters:
    """The camera's place, its axes and its velocity, all off by as much, in all directions."""
    rng = np.random.default_rng(5)

    def off(values: object) -> object:
        array = np.array(values)
        return (array + by * rng.choice([-1.0, 1.0], array.shape)).tolist()

    return replace(
        BASE,
        camera_position=tuple(off(BASE.camera_position)),
        camera_to_hole=tuple(map(tuple, off(BASE.camera_to_hole))),
        hole_to_world=tuple(map(tuple, off(BASE.hole_to_world))),
        velocity=tuple(off(BASE.velocity)),
    )


def test_double_precision_noise_does_not_change_the_hash() -> None:
    """BLAS rounds a product of 3 x 3 matrices by 4e-16 at most; the numbers here are away from rounding borders."""
    for by in (1e-17, 4e-16, 2e-15):
        assert moved(by).hash == BASE.hash


def test_minus_zero_is_zero() -> None:
    one, other = (replace(BASE, camera_position=(9.0, y, 2.5)) for y in (0.0, -1e-17))
    assert one.hash == other.hash


def test_a_border_between_roundings_is_no_border() -> None:
    """Two neighboring doubles that round to different decimals: two hashes, and one map."""
    border = 3.0000000005
    below, above = (replace(BASE, camera_position=(each, 0.0, 9.0)) for each in (border - 1e-15, border + 1e-15))
    assert below.hash != above.hash
    assert below.agrees_with(above.to_metadata())
    assert above.agrees_with(below.to_metadata())


@pytest.mark.parametrize("unit_in_the_last_place", [2.0**-24, 2.0**-23])
def test_single_precision_noise_agrees(unit_in_the_last_place: float) -> None:
    """Blender's matrices are float32: the spacing of numbers from 0.5 to 1 is 2^-24, from 1 to 2 2^-23."""
    assert moved(unit_in_the_last_place).agrees_with(BASE.to_metadata())


def test_what_can_be_seen_does_not_agree() -> None:
    """A thousandth of a pixel of this picture is 3e-5 radians; the smallest steps of Blender's sliders are larger."""
    assert not moved(3e-6).agrees_with(BASE.to_metadata())
    changes = {
        "spin": 0.90001,
        "camera": replace(BASE.camera, focal_length=35.001),
        "motion": "fido",
        "supersampling": 2,
        "tolerance": BASE.tolerance * (1.0 + 1e-9),
        "method": "cash-karp",
        "interpolation": 0.0,
        "disk": None,
    }
    for name, value in changes.items():
        other = replace(BASE, **{name: value})
        assert not other.agrees_with(BASE.to_metadata()), name
        assert not BASE.agrees_with(other.to_metadata()), name
    for disk in (Disk(2), Disk(2, 3.00001), Disk(3, 3.0), Disk(2, 3.0, retrograde=True)):
        assert not replace(BASE, disk=disk).agrees_with(BASE.to_metadata())
    assert not replace(BASE, camera=PanoramaCamera(64, 36)).agrees_with(BASE.to_metadata())


def test_noise_grows_with_the_distance_only_for_places() -> None:
    far = replace(BASE, camera_position=(1e4, 0.0, 0.0))
    assert replace(far, camera_position=(1e4, 1e-3, 0.0)).agrees_with(far.to_metadata())
    assert not replace(far, velocity=(0.1, -0.2, 0.051)).agrees_with(far.to_metadata())


def test_not_a_number_agrees_with_nothing() -> None:
    values = BASE.to_metadata()
    assert not agree({**values, "spin": math.nan}, values)
    assert not agree({**values, "camera_position": [math.nan, 0.0, 0.0]}, values)
    assert not agree({**values, "camera_position": "nowhere"}, values)
    assert not agree({**values, "spin": True}, {**values, "spin": 1.0})


def test_hashes_of_version_0_1_0_are_known() -> None:
    """They were of all digits: written down from the release, for a plain shot at 10 M."""
    values = json.loads(PLAIN_SHOT)
    written = "15d64bc2658d99a4342b9cbf2a0c3d575ae74c5b1afed747783ced1895331cec"
    assert hash_of(values) != written
    assert version_of(hash_of(values), values) == version_of(written, values) == BAKE_VERSION
    disk = BASE.to_metadata()
    assert version_of(hash_of(disk, 1), disk) == 1 < DISK_BAKE_VERSION == version_of(hash_of(disk), disk)
    for text in (hash_of({**values, "spin": 0.5}), hash_of(values, BAKE_VERSION + 1), ""):
        assert version_of(text, values) is None
    assert version_of(written, {**values, "spin": 0.5}) is None
