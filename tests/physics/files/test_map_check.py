# SPDX-License-Identifier: GPL-3.0-or-later
"""What a map's file is: valid, missing, stale, foreign or damaged."""

from pathlib import Path

import numpy as np
import pytest
from commands import run

from physics import (
    Disk,
    PerspectiveCamera,
    WarpMapParameters,
    bake,
    read_disk_pass,
    write_disk_pass,
    write_warp_map,
)
from physics.files.disk_pass_file import FORMAT as DISK_PASS
from physics.files.exit_map_file import FORMAT as EXIT_MAP
from physics.files.exit_map_file import write_exit_map
from physics.files.map_check import State, check_map
from physics.files.map_file import ATTRIBUTE_FORMAT
from physics.files.warp_map_file import FORMAT as WARP_MAP
from physics.images.exr import read_exr, target_of, write_exr
from physics.maps.exit_map import bake_exit_map

PARAMETERS = WarpMapParameters(
    spin=0.9,
    camera=PerspectiveCamera(32, 18, focal_length=30.0),
    camera_position=(20.0, 0.0, 3.0),
    disk=Disk(crossings=1),
)


@pytest.fixture(scope="module")
def originals(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """The bytes of one file of each kind."""
    folder = tmp_path_factory.mktemp("maps")
    baked = bake(PARAMETERS)
    write_warp_map(folder / "warp.exr", baked)
    write_disk_pass(folder / "disk.exr", baked.disk_passes[0])
    write_exit_map(folder / "exit.exr", bake_exit_map(PARAMETERS))
    return {path.stem: path.read_bytes() for path in folder.iterdir()}


KINDS = {"warp": WARP_MAP, "disk": DISK_PASS, "exit": EXIT_MAP}


@pytest.mark.parametrize("name", KINDS)
def test_states(tmp_path: Path, originals: dict[str, bytes], name: str) -> None:
    path, data, kind = tmp_path / "map.exr", originals[name], KINDS[name]

    def state(wanted: str | None = PARAMETERS.hash, thorough: bool = True) -> str:
        found = check_map(path, kind, wanted, thorough=thorough)
        assert (found.fault == "") == (found.state is State.VALID)
        assert found.state is State.VALID or str(path) in found.fault
        return found.state

    assert state() == "missing"
    path.write_bytes(data)
    assert state() == state(None) == "valid"
    assert state("another hash") == "stale"
    stamp = kind.stamp.encode()
    path.write_bytes(data.replace(stamp, stamp[:-1] + b"9"))
    assert state() == "stale"
    path.write_bytes(data.replace(ATTRIBUTE_FORMAT.encode(), b"umbraFormed"))
    assert state() == "foreign"
    path.write_text("a text")
    assert state() == "foreign"
    path.write_bytes(b"")
    assert state() == "damaged"
    path.unlink()
    path.mkdir()
    assert state() == "foreign"


@pytest.mark.parametrize("name", KINDS)
def test_other_kinds_are_foreign(tmp_path: Path, originals: dict[str, bytes], name: str) -> None:
    path = tmp_path / "map.exr"
    for other in KINDS.keys() - {name}:
        path.write_bytes(originals[other])
        assert check_map(path, KINDS[name]).state is State.FOREIGN


@pytest.mark.parametrize("name", KINDS)
def test_every_flipped_bit_of_the_pixels_and_every_cut_is_found(
    tmp_path: Path, originals: dict[str, bytes], name: str
) -> None:
    """Bytes spread over the whole file, header too: no change may pass for the map that was written."""
    path, data = tmp_path / "map.exr", originals[name]
    rng = np.random.default_rng(1)
    header = data.index(b"screenWindowWidth")
    for place in rng.integers(header + 80, len(data), 60):
        changed = bytearray(data)
        changed[place] ^= 1 << int(rng.integers(8))
        path.write_bytes(changed)
        found = check_map(path, KINDS[name], PARAMETERS.hash)
        # a bit that the decoder does not use leaves the pixels, which are what counts, as they are
        assert found.state is State.DAMAGED or _same_pixels(path, data, tmp_path), place
    for length in (*rng.integers(4, len(data) - 1, 20), len(data) - 1, 4):
        path.write_bytes(data[:length])
        assert check_map(path, KINDS[name], PARAMETERS.hash).state is State.DAMAGED, length


def _same_pixels(path: Path, data: bytes, folder: Path) -> bool:
    other = folder / "original.exr"
    other.write_bytes(data)
    return np.array_equal(read_exr(path)[0], read_exr(other)[0])


def test_headers_alone_are_taken_at_their_word(tmp_path: Path, originals: dict[str, bytes]) -> None:
    path = tmp_path / "map.exr"
    changed = bytearray(originals["warp"])
    changed[-100] ^= 0xFF
    path.write_bytes(changed)
    assert check_map(path, WARP_MAP, PARAMETERS.hash, thorough=False).state is State.VALID
    assert check_map(path, WARP_MAP, PARAMETERS.hash).state is State.DAMAGED


def test_names_of_half_files() -> None:
    assert target_of(".Scene_0001.abcd_123.tmp.exr") == "Scene_0001.exr"
    for name in ("Scene_0001.exr", ".Scene_0001.exr", "Scene.abcd_123.tmp.exr", ".Scene.exr.claim1"):
        assert target_of(name) is None


def test_the_command_verify(tmp_path: Path, originals: dict[str, bytes]) -> None:
    folder = tmp_path / "maps of a shot"
    folder.mkdir()
    for name, data in originals.items():
        (folder / f"{name}.exr").write_bytes(data)
    write_exr(folder / "picture.exr", np.zeros((4, 4, 3), np.float32))
    (folder / "notes.txt").write_text("not a map")
    result = run("verify", folder)
    assert result.returncode == 0, result.stderr
    assert "3 valid" in result.stdout
    assert "picture.exr is not a map: left out" in result.stdout
    assert run("verify", folder / "picture.exr").returncode == 1

    (folder / "disk.exr").write_bytes(originals["disk"][:-7])
    result = run("verify", folder)
    assert result.returncode == 1
    assert "damaged: " in result.stdout
    assert "disk.exr" in result.stdout
    assert "1 of 3 files do not hold" in result.stderr
    with pytest.raises(ValueError, match="cut short"):
        read_disk_pass(folder / "disk.exr")
