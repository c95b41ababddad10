# SPDX-License-Identifier: GPL-3.0-or-later
"""What a header states is what the map was made from: nothing in it can change, or be made up, and pass."""

import hashlib
import json

import numpy as np
import OpenEXR
import pytest
from exr_files import attributes
from shots import shot

from physics import (
    BlackHoleError,
    Disk,
    PerspectiveCamera,
    WarpMapError,
    bake,
    bake_exit_map,
    bake_world_map_steps,
    check_accuracy,
    drain,
    read_disk_pass,
    read_exit_map,
    read_warp_map,
    read_warp_map_metadata,
    read_world_map,
    world_map_parameters,
    write_disk_pass,
    write_exit_map,
    write_exr,
    write_warp_map,
    write_world_map,
)
from physics.cli import main
from physics.images import exr_header

OWN = ("umbraFormat", "umbraHash", "umbraCounts", "umbraParameters", "umbraCrossing", "umbraHeaderChecksum")


@pytest.fixture(scope="module")
def maps(tmp_path_factory):
    """(reader, path) of a small file of each kind of map."""
    folder = tmp_path_factory.mktemp("maps")
    parameters = shot(24, 14, radius=30.0, disk=Disk(crossings=3))
    baked = bake(parameters)
    write_warp_map(folder / "warp.exr", baked)
    write_disk_pass(folder / "disk.exr", baked.disk_passes[0])
    write_exit_map(folder / "exit.exr", bake_exit_map(shot(24, 14, radius=30.0)))
    write_world_map(folder / "world.exr", drain(bake_world_map_steps(world_map_parameters(parameters, (16, 12)))))
    return {
        "warp": (read_warp_map, folder / "warp.exr"),
        "disk": (read_disk_pass, folder / "disk.exr"),
        "exit": (read_exit_map, folder / "exit.exr"),
        "world": (read_world_map, folder / "world.exr"),
    }


def rewritten(source, target, **changes):
    """The file with other header attributes, by the OpenEXR package alone; None leaves one out."""
    with OpenEXR.File(str(source), separate_channels=True) as file:
        planes = {name: channel.pixels.copy() for name, channel in file.channels().items()}
        header = {key: value for key, value in file.header().items() if isinstance(value, str)}
    kept = {key: value for key, value in {**header, **changes}.items() if value is not None}
    with OpenEXR.File({**kept, "compression": OpenEXR.ZIP_COMPRESSION}, planes) as file:
        file.write(str(target))
    return header


def hash_of(parameters):
    """The hash as version 0.1.0 made it: of the JSON text of all parameters."""
    text = json.dumps({"bake_version": 1, **parameters}, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def stated(path):
    with OpenEXR.File(str(path)) as file:
        return json.loads(file.header()["umbraParameters"])


@pytest.mark.parametrize("kind", ["warp", "disk", "exit", "world"])
def test_every_flipped_bit_of_the_header_is_found(maps, tmp_path, capsys, kind):
    """One bit in every third byte of all that the header says; names included, and `verify` says the same."""
    read, path = maps[kind]
    data, broken = path.read_bytes(), tmp_path / "broken.exr"
    good = read(path).metadata
    for name, begin, value, end in attributes(data):
        if name not in OWN:
            continue
        for place in range(begin, end, 3):
            changed = bytearray(data)
            changed[place] ^= 1 << (place % 8)
            broken.write_bytes(changed)
            if value <= place:
                with pytest.raises(WarpMapError):
                    read(broken)
            else:  # in its name, type or length; that of the checksum itself is the one that may go
                try:
                    assert read(broken).metadata == good
                    assert name == "umbraHeaderChecksum"
                except WarpMapError:
                    pass
    broken.write_bytes(data.replace(b'"spin": 0.999', b'"spin": 0.998'))
    assert main(["verify", str(broken)]) == 1
    assert "1 damaged" in capsys.readouterr().out


@pytest.mark.parametrize(
    "change",
    [
        {"spin": 5.0},
        {"spin": float("nan")},
        {"camera_position": [0.0, 0.0, 0.0]},
        {"camera_position": [float("inf"), 0.0, 0.0]},
        {"tolerance": float("nan")},
        {"interpolation": 10**400},
        {"motion": "sideways"},
        {"supersampling": 10**9},
        {"disk": {"crossings": 10**9, "inner_radius": None, "outer_radius": 20.0, "retrograde": False}},
        {"disk": {"crossings": 3, "inner_radius": float("nan"), "outer_radius": 20.0, "retrograde": False}},
        {"hole_to_world": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 2.0]]},
    ],
)
@pytest.mark.parametrize("kind", ["warp", "disk", "exit", "world"])
def test_a_shot_that_cannot_be_is_refused_even_with_its_own_hash(maps, tmp_path, kind, change):
    read, path = maps[kind]
    parameters = {**stated(path), **change}
    made_up = {"umbraParameters": json.dumps(parameters), "umbraHash": hash_of(parameters), "umbraHeaderChecksum": None}
    rewritten(path, tmp_path / "map.exr", **made_up)
    with pytest.raises(WarpMapError, match="header"):
        read(tmp_path / "map.exr")


@pytest.mark.parametrize("kind", ["warp", "disk", "exit", "world"])
def test_another_shots_parameters_do_not_pass(maps, tmp_path, kind):
    """All values are possible, and no checksum is there; only the hash tells."""
    read, path = maps[kind]
    parameters = {**stated(path), "spin": 0.5}
    rewritten(path, tmp_path / "map.exr", umbraParameters=json.dumps(parameters), umbraHeaderChecksum=None)
    with pytest.raises(WarpMapError, match="header"):
        read(tmp_path / "map.exr")


@pytest.mark.parametrize("kind", ["warp", "disk", "exit", "world"])
def test_maps_of_version_0_1_0_are_read(maps, tmp_path, kind):
    """They have the hash of all digits of their parameters, and no checksum of the header.

    Those with a disk keep their hash: they were baked by the first version of the disk, and are out of date.
    """
    read, path = maps[kind]
    parameters = stated(path)
    former = hash_of(parameters)
    rewritten(path, tmp_path / "map.exr", umbraHash=former, umbraHeaderChecksum=None)
    expected = {**read(path).metadata}
    if parameters.get("disk"):
        expected["hash"] = former
    assert read(tmp_path / "map.exr").metadata == expected


def test_a_header_cannot_make_the_check_of_accuracy_endless(maps, tmp_path, capsys):
    path = maps["warp"][1]
    parameters = stated(path)
    parameters["disk"]["crossings"] = 10**9
    rewritten(
        path, tmp_path / "map.exr", umbraParameters=json.dumps(parameters), umbraHash=hash_of(parameters),
        umbraHeaderChecksum=None,
    )  # fmt: skip
    with pytest.raises(WarpMapError, match="header"):
        check_accuracy(tmp_path / "map.exr")
    assert main(["accuracy", str(tmp_path / "map.exr")]) == 1
    assert capsys.readouterr().err.count("\n") == 1


def test_passes_of_a_former_version_belong_to_their_map(maps, tmp_path):
    """Map and pass have the same former hash; the check of accuracy takes both."""
    for kind, name in (("warp", "map.exr"), ("disk", "map_disk1.exr")):
        path = maps[kind][1]
        rewritten(path, tmp_path / name, umbraHash=hash_of(stated(path)), umbraHeaderChecksum=None)
    report = check_accuracy(tmp_path / "map.exr", passes=[tmp_path / "map_disk1.exr"], samples=20)
    assert len(report.disk) == 1


@pytest.mark.parametrize(
    ("width", "height", "supersampling", "possible"),
    [(8192, 4320, 4, False), (8192, 4320, 2, True), (8192, 4096, 4, True), (65536, 1, 4, False), (65536, 1, 2, True)],
)
def test_what_cannot_be_read_is_refused_before_any_ray(width, height, supersampling, possible):
    """The limits of the reader: 2^29 pixels, 2^17 along a side. An exit map is two pictures high."""
    assert (exr_header.MOST_PIXELS, exr_header.LARGEST_SIDE) == (2**29, 2**17)
    parameters = shot(camera=PerspectiveCamera(width, height, 30.0), supersampling=supersampling)
    if possible:
        parameters.validate()
        return
    with pytest.raises(BlackHoleError, match="pixels large") as caught:
        bake(parameters)
    assert caught.value.code == "camera.size"


def test_an_exit_map_counts_twice():
    parameters = shot(camera=PerspectiveCamera(8192, 4096, 30.0), supersampling=4)
    parameters.validate()
    with pytest.raises(BlackHoleError, match="pixels large"):
        bake_exit_map(parameters)


def test_no_writer_makes_what_the_reader_refuses(tmp_path):
    with pytest.raises(BlackHoleError, match="make it smaller"):
        write_exr(tmp_path / "wide.exr", np.zeros((1, 2**17 + 1, 3), np.float16))
    assert not list(tmp_path.iterdir())


def test_metadata_is_checked_without_the_pixels(maps, tmp_path):
    path = maps["warp"][1]
    rewritten(path, tmp_path / "map.exr", umbraCounts=json.dumps({"unresolved": -1}))
    with pytest.raises(WarpMapError, match="header"):
        read_warp_map_metadata(tmp_path / "map.exr")
