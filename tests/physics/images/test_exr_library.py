# SPDX-License-Identifier: GPL-3.0-or-later
"""The libraries that read and write EXR files: either does the same, and without one a sentence says so."""

import importlib.util
import json
import os
import struct
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import OpenEXR
import pytest

from physics.images import exr, own_symbols
from physics.images.openexr_library import OpenEXRLibrary

ROOT = Path(__file__).resolve().parents[3]

# Hides packages from a process before anything is imported.
BLOCKER = """
import importlib.abc, sys
class Hidden(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name in {hidden!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Hidden())
"""


def blender_packages() -> str:
    """Blender's own folder of packages, found without starting it."""
    found = importlib.util.find_spec("bpy")
    if found is None:
        pytest.skip("Blender is not installed here")
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    base = next(
        parent for parent in Path(found.origin).parents if parent.name == "bpy" and any(parent.glob("*.*/python"))
    )
    (folder,) = base.glob(f"*/python/lib/{version}/site-packages")
    return str(folder)


def run(code: str, *, hidden: set[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", BLOCKER.format(hidden=hidden) + code],
        capture_output=True,
        text=True,
        timeout=200,
        check=False,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )


def planes() -> dict[str, np.ndarray]:
    random = np.random.default_rng(3).normal(size=(4, 33, 20)).astype(np.float32)
    random[0, :3] = [[np.nan], [np.inf], [-0.0]]
    return dict(zip("RGBA", random, strict=True))


ATTRIBUTES = {"umbraFormat": "umbra warp map 1", "umbraParameters": json.dumps({"spin": 0.9}), "comments": "Größe"}

OPENIMAGEIO = """
import sys
import numpy as np
import physics
from physics.images import exr
name = physics.exr_library([{packages!r}])
assert name.startswith("OpenImageIO 3."), name
data = np.load({folder!r} + "/planes.npz")
attributes = {attributes!r}
channels, header = exr.read_channels({folder!r} + "/a.exr")
for key in data:
    assert channels[key].dtype == data[key].dtype and channels[key].tobytes() == data[key].tobytes(), key
assert header == {{**attributes, "size": (20, 33)}}, header
exr.write_channels({folder!r} + "/b.exr", dict(data), attributes)
half = {{key: plane.astype(np.float16) if key == "A" else plane for key, plane in data.items()}}
exr.write_channels({folder!r} + "/c.exr", half, attributes)
with open({folder!r} + "/cut.exr", "wb") as file:
    file.write(open({folder!r} + "/a.exr", "rb").read()[:-100])
for path, code in (("cut.exr", "file.bad-exr"), ("none.exr", "file.missing"), ("planes.npz", "file.bad-exr")):
    try:
        exr.read_channels({folder!r} + "/" + path)
    except physics.ImageFileError as error:
        assert error.code == code, error
    else:
        raise SystemExit(path)
try:
    exr.write_channels("/proc/umbra/b.exr", dict(data), attributes)
except physics.ImageFileError as error:
    assert error.code == "file.not-written", error
print("done", "OpenEXR" in sys.modules)
"""


def test_openimageio_reads_and_writes_the_same_bits(tmp_path: Path) -> None:
    """Both ways: files of OpenEXR by OpenImageIO, and files of OpenImageIO by OpenEXR; header and pixels."""
    np.savez(tmp_path / "planes.npz", **planes())
    exr.write_channels(tmp_path / "a.exr", planes(), ATTRIBUTES)
    code = OPENIMAGEIO.format(packages=blender_packages(), folder=str(tmp_path), attributes=ATTRIBUTES)
    result = run(code, hidden={"OpenEXR"})
    assert (result.returncode, result.stdout.strip(), result.stderr) == (0, "done False", "")
    for name, kinds in (("b.exr", {}), ("c.exr", {"A": np.float16})):
        channels, header = exr.read_channels(tmp_path / name)
        assert {key: value for key, value in header.items() if value} == {**ATTRIBUTES, "size": (20, 33)}
        for key, plane in planes().items():
            assert channels[key].tobytes() == plane.astype(kinds.get(key, np.float32)).tobytes()
        with OpenEXR.File(str(tmp_path / name), header_only=True) as file:
            assert file.header()["compression"] == OpenEXR.ZIP_COMPRESSION


def test_without_any_library_the_command_line_says_so_at_once(tmp_path: Path) -> None:
    for words in (
        f"bake {tmp_path}/m.exr",
        f"render {tmp_path}/m.exr {tmp_path}/s.exr {tmp_path}/p.exr",
        f"verify {tmp_path}",
    ):
        code = f"import sys\nfrom physics.cli import main\nsys.exit(main({words.split()!r}))"
        result = run(code, hidden={"OpenEXR", "OpenImageIO"})
        assert result.returncode == 1, result.stderr
        assert result.stderr.count("\n") == 1
        assert "EXR files can be neither read nor written" in result.stderr
        assert "[file.no-library]" in result.stderr
    assert list(tmp_path.iterdir()) == []


def test_tracing_needs_no_library() -> None:
    code = "import physics\nprint(physics.trace_rays(0.9, physics.Observer.fido(10.0, 1.0, 0.0), [1.0], [1.0]).fate)"
    assert run(code, hidden={"OpenEXR", "OpenImageIO"}).returncode == 0


# What other programs may have loaded under the name: the releases before 3.3 had InputFile and OutputFile alone.
STAND_IN = """
import importlib.metadata, sys, types
old = types.ModuleType("OpenEXR")
old.__version__ = "1.3.9"
old.InputFile = old.OutputFile = object
sys.modules["OpenEXR"] = old
{before}
import physics
{action}
assert sys.modules["OpenEXR"] is old
"""


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere the first one that is loaded counts")
def test_an_old_openexr_that_is_loaded_first_is_left_alone(tmp_path: Path) -> None:
    """The newer one is loaded beside it, under another name."""
    exr.write_channels(tmp_path / "a.exr", planes(), ATTRIBUTES)
    action = f"print(physics.exr_library())\nprint(physics.read_exr({str(tmp_path / 'a.exr')!r})[1])"
    result = run(STAND_IN.format(before="", action=action), hidden=set())
    assert result.returncode == 0, result.stderr
    assert result.stdout.startswith(f"OpenEXR {OpenEXR.__version__}")
    assert "umbra warp map 1" in result.stdout


def test_an_old_openexr_and_no_other_gives_way_to_openimageio() -> None:
    action = "print(physics.exr_library())"
    before = "importlib.metadata.distributions = lambda **_: []"
    result = run(STAND_IN.format(before=before, action=action), hidden=set())
    assert result.returncode == 0, result.stderr
    assert result.stdout.startswith("OpenImageIO 3.")


def test_headers_are_read_alike_with_and_without_the_library(tmp_path: Path) -> None:
    """The header's own parser against OpenEXR's, for all that a program may ask for."""
    path = tmp_path / "a.exr"
    header = {"a": 1, "b": 2.5, "text": "é", "chromaticities": (0.7, 0.3, 0.2, 0.7, 0.1, 0.05, 0.31, 0.32)}
    with OpenEXR.File({**header, "envmap": OpenEXR.ENVMAP_CUBE}, planes()) as file:
        file.write(str(path))
    found = exr.read_exr_header(path)
    assert found.pop("chromaticities") == pytest.approx(header.pop("chromaticities"))
    assert found == {**header, "envmap": 1, "size": (20, 33)}
    assert exr.read_channels(path)[1].keys() == exr.read_exr_header(path).keys()


class Without:
    """A library that opens files by their names only, as before release 3.5, and cannot take its threads back."""

    ZIP_COMPRESSION, scanlineimage, __version__ = OpenEXR.ZIP_COMPRESSION, OpenEXR.scanlineimage, "3.3.0"

    @staticmethod
    def File(source: object, *rest: object, **named: object) -> object:
        if not isinstance(source, str | dict):
            raise TypeError("incompatible constructor arguments")
        return OpenEXR.File(source, *rest, **named)


def test_older_releases_that_read_by_name_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    exr.write_channels(tmp_path / "a.exr", planes(), ATTRIBUTES)
    monkeypatch.setitem(sys.modules, "OpenEXR", Without)
    older = OpenEXRLibrary()
    assert older.name == "OpenEXR 3.3.0"
    monkeypatch.setattr(exr, "library", lambda: older)
    channels, header = exr.read_channels(tmp_path / "a.exr")
    assert all(channels[key].tobytes() == plane.tobytes() for key, plane in planes().items())
    assert header["umbraFormat"] == ATTRIBUTES["umbraFormat"]


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere all names are text")
def test_a_name_that_is_no_utf_8(tmp_path: Path) -> None:
    path = os.fsdecode(os.fsencode(tmp_path) + b"/sky_\xe9.exr")
    exr.write_channels(path, planes(), ATTRIBUTES)
    channels, header = exr.read_channels(path)
    assert all(channels[key].tobytes() == plane.tobytes() for key, plane in planes().items())
    assert header == exr.read_exr_header(path)


# --- the copy that is bound to itself -------------------------------------------------------------


def test_only_a_whole_library_is_marked() -> None:
    """Truncated, mangled and foreign files stay as they are, whatever their numbers point at."""
    library = Path(OpenEXR.__file__).read_bytes()
    assert own_symbols.mark_symbolic(bytearray(library)) == (sys.platform == "linux")
    random = np.random.default_rng(7)
    for length in (0, 3, 6, 40, 63, 64, 100, 500, 4096):
        cut = bytearray(library[:length])
        own_symbols.mark_symbolic(cut)
    for _ in range(300):
        broken = bytearray(library[:8192])
        for place in random.integers(6, 1000, 8):
            broken[place] = int(random.integers(256))
        own_symbols.mark_symbolic(broken)
    for head in (b"\x7fELF\x01\x01", b"\x7fELF\x02\x02", b"MZ", b"\xcf\xfa\xed\xfe"):  # 32 bits, big-endian, PE, Mach-O
        other = bytearray(head + library[len(head) :])
        before = bytes(other)
        assert not own_symbols.mark_symbolic(other)
        assert bytes(other) == before
    no_end = bytearray(b"\x7fELF\x02\x01" + bytes(58))
    struct.pack_into("<Q", no_end, 32, 64)
    struct.pack_into("<HH", no_end, 54, 56, 1)
    no_end += struct.pack("<IIQQQQQQ", 2, 0, 120, 0, 0, 32, 32, 8) + struct.pack("<qQqQ", 1, 0, 1, 0)
    assert not own_symbols.mark_symbolic(no_end)


WAYS = """
import errno, os, sys, tempfile

def refuse(*_, **__):
    raise OSError(errno.EPERM, "not permitted")

{setup}
import physics
from physics.images import own_symbols
import OpenEXR
marked = hasattr(OpenEXR, own_symbols._MARK)
print(physics.exr_library(), own_symbols.is_bound_to_itself(OpenEXR, "exr_start_read"), marked)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux has one scope of names for all libraries")
@pytest.mark.parametrize(
    ("setup", "marked"),
    [
        ("", True),
        ("os.memfd_create = refuse", True),
        ("del os.memfd_create", True),
        # neither memory nor a folder, as in a sandbox whose /tmp forbids programs: loaded in the ordinary way
        ("os.memfd_create = refuse\ntempfile.TemporaryDirectory = refuse", False),
    ],
    ids=["memory", "memory forbidden", "no memory files", "nothing"],
)  # fmt: skip
def test_each_way_to_load_the_library(setup: str, marked: bool) -> None:
    result = run(WAYS.format(setup=setup), hidden=set())
    assert result.returncode == 0, result.stderr
    assert result.stdout.split()[-2:] == ["True", str(marked)]


def test_a_module_loaded_in_the_ordinary_way_is_not_used_where_it_calls_others(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(own_symbols, "is_global", lambda _function: True)
    plain = SimpleNamespace(File=object, ZIP_COMPRESSION=3, scanlineimage=0)
    monkeypatch.setitem(sys.modules, "OpenEXR", plain)
    monkeypatch.setattr("importlib.metadata.distributions", lambda **_: [])
    with pytest.raises(ImportError, match="another add-on has loaded"):
        OpenEXRLibrary()
