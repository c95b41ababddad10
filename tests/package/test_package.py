# SPDX-License-Identifier: GPL-3.0-or-later
"""The published zip: what is in it, what its code may not do, and that Blender takes it in and lets it go."""

import ast
import importlib
import sys
import tomllib
import zipfile
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]
NAME = "bl_ext.user_default.umbra_black_hole"
PLATFORMS = {"linux-x64", "linux-arm64", "macos-x64", "macos-arm64", "windows-x64", "windows-arm64"}
NETWORK_MODULES = {
    "ftplib",
    "http",
    "httpx",
    "requests",
    "smtplib",
    "socket",
    "ssl",
    "urllib",
    "urllib3",
    "xmlrpc",
}


@pytest.fixture(scope="session")
def published(build_extension: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> zipfile.ZipFile:
    """The zip for every platform. Building it ends with Blender's own validation."""
    (made,) = build_extension.build(sorted(PLATFORMS), tmp_path_factory.mktemp("published"))
    with zipfile.ZipFile(made) as archive:
        yield archive


@pytest.fixture(scope="session")
def manifest(published: zipfile.ZipFile) -> dict:
    return tomllib.loads(published.read("blender_manifest.toml").decode())


@pytest.fixture(scope="session")
def sources(published: zipfile.ZipFile) -> dict[str, ast.Module]:
    """The syntax tree of each Python file in the zip."""
    return {name: ast.parse(published.read(name), name) for name in published.namelist() if name.endswith(".py")}


def imported_modules(tree: ast.Module) -> set[str]:
    """Top-level names of the modules that this file imports absolutely, anywhere in it."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found.update(alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            found.add(node.module.partition(".")[0])
    return found


def shipped_files() -> set[str]:
    """What the two folders in the repository hold, without caches and hidden files."""
    found = set()
    for folder, prefix in ((ROOT / "blender_addon", Path()), (ROOT / "physics", Path("physics"))):
        for path in folder.rglob("*"):
            inside = path.relative_to(folder)
            if path.is_file() and not any(part == "__pycache__" or part.startswith(".") for part in inside.parts):
                found.add((prefix / inside).as_posix())
    return found


def test_contains_the_code_the_license_the_wheels_and_nothing_else(published: zipfile.ZipFile) -> None:
    names = {name for name in published.namelist() if not name.endswith("/")}
    wheels = {name for name in names if name.startswith("wheels/")}
    assert names - wheels == shipped_files() | {"LICENSE"}
    assert all(name.endswith(".whl") for name in wheels)


def test_contains_no_tests_and_no_caches(published: zipfile.ZipFile) -> None:
    for name in published.namelist():
        parts = Path(name).parts
        assert not {"tests", "__pycache__"} & set(parts)
        assert not any(part.startswith((".", "test_")) or part.endswith(".pyc") for part in parts)


def test_versions_agree(manifest: dict) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert manifest["version"] == project["version"]
    assert f"## [{manifest['version']}]" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_manifest_covers_the_supported_blenders(manifest: dict) -> None:
    assert manifest["blender_version_min"] == "4.5.0"
    assert tuple(map(int, manifest["blender_version_max"].split("."))) > (5, 2, 99)
    assert manifest["license"] == ["SPDX:GPL-3.0-or-later", "SPDX:CC-BY-SA-4.0"]
    assert set(manifest["permissions"]) == {"files"}


def test_every_platform_has_its_wheels(published: zipfile.ZipFile, manifest: dict) -> None:
    assert set(manifest["platforms"]) == PLATFORMS
    listed = {wheel.removeprefix("./") for wheel in manifest["wheels"]}
    assert listed == {name for name in published.namelist() if name.endswith(".whl")}
    tags = {
        "linux-x64": ("manylinux", "x86_64"),
        "linux-arm64": ("manylinux", "aarch64"),
        "macos-x64": ("macosx", "x86_64"),
        "macos-arm64": ("macosx", "arm64"),
        "windows-x64": ("win", "amd64"),
        "windows-arm64": ("win", "arm64"),
    }
    for system, machine in tags.values():
        for python in ("cp311", "cp313", "cp314"):
            fitting = [w for w in listed if f"-{python}-{system}" in w and w.endswith(f"_{machine}.whl")]
            assert len(fitting) == 1, f"{python} on {system} {machine}: {fitting}"


def test_leaves_the_module_search_path_alone(sources: dict[str, ast.Module]) -> None:
    for name, tree in sources.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "sys":
                assert node.attr not in {"path", "meta_path", "path_hooks"}, f"{name} line {node.lineno}"
            if isinstance(node, ast.ImportFrom) and node.module == "sys":
                assert not {"path", "meta_path", "path_hooks"} & {alias.name for alias in node.names}, name
        assert "site" not in imported_modules(tree), name


def test_never_uses_the_network(sources: dict[str, ast.Module]) -> None:
    for name, tree in sources.items():
        assert not imported_modules(tree) & NETWORK_MODULES, name


def test_imports_only_what_blender_or_the_zip_brings(sources: dict[str, ast.Module]) -> None:
    brought = {"bpy", "mathutils", "numpy", "OpenEXR", "OpenImageIO"}
    # In a checkout the add-on finds the physics beside it, under its plain name, and in one place only.
    extra = {"core/physics_api.py": {"physics"}}
    # Blender's own Python modules, part of every Blender.
    blender = {"_cycles", "addon_utils", "bl_ui", "bpy_extras", "gpu", "blf", "bmesh"}
    for name, tree in sources.items():
        unknown = imported_modules(tree) - sys.stdlib_module_names - brought - extra.get(name, set())
        assert unknown <= (set() if name.startswith("physics/") else blender), name


def test_splits_by_platform(build_extension: ModuleType, tmp_path: Path) -> None:
    made = build_extension.build(["linux-x64", "windows-x64"], tmp_path, split=True)
    assert [path.stem.partition("-0")[2].partition("-")[2] for path in made] == ["linux_x64", "windows_x64"]
    for path, tag in zip(made, ("manylinux", "win"), strict=True):
        wheels = [name for name in zipfile.ZipFile(path).namelist() if name.endswith(".whl")]
        assert len(wheels) == 3
        assert all(f"-{tag}" in wheel for wheel in wheels)


def test_a_missing_wheel_is_named(build_extension: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a network, pip's failure becomes a sentence that names the wheel and where to put it."""
    monkeypatch.setattr(build_extension, "WHEEL_CACHE", tmp_path)
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.delenv("PIP_FIND_LINKS", raising=False)
    with pytest.raises(SystemExit, match=r"openexr-.*-cp313-cp313-win_amd64\.whl is missing.*Check the network"):
        build_extension.wheel("cp313", "windows-x64")


def test_the_bundled_wheel_that_fits_is_installed(addon: ModuleType) -> None:
    import bpy

    site = Path(bpy.utils.user_resource("EXTENSIONS"), ".local", "lib")
    python = f"{sys.version_info.major}{sys.version_info.minor}"
    binaries = [path.name for path in site.rglob("OpenEXR*") if path.suffix in {".so", ".pyd"}]
    assert len(binaries) == 1
    assert python in binaries[0]


def traces() -> dict[str, list[str]]:
    """What of this extension Blender knows at the moment: classes, properties, handlers, menu entries."""
    import bpy

    def ours(function: object) -> bool:
        return getattr(function, "__module__", "").startswith(NAME)

    handlers = {
        name: getattr(bpy.app.handlers, name)
        for name in dir(bpy.app.handlers)
        if isinstance(getattr(bpy.app.handlers, name), list)
    }
    drawn = {
        name: getattr(getattr(getattr(bpy.types, name), "draw", None), "_draw_funcs", [])
        for name in dir(bpy.types)
        if "_MT_" in name or "_PT_" in name or "_HT_" in name
    }
    owners = ("Scene", "Object", "Camera", "World", "WindowManager", "Collection", "ViewLayer")
    return {
        "classes": sorted(name for name in dir(bpy.types) if "umbra" in name.lower()),
        "operators": sorted(dir(bpy.ops.umbra)),
        "properties": sorted(
            f"{owner}.{name}" for owner in owners for name in dir(getattr(bpy.types, owner)) if "umbra" in name
        ),
        "handlers": sorted(f"{name}:{f.__name__}" for name, calls in handlers.items() for f in calls if ours(f)),
        "menus": sorted(f"{name}:{f.__name__}" for name, calls in drawn.items() for f in calls if ours(f)),
    }


def test_registers_unregisters_and_registers_again_cleanly(addon: ModuleType, factory_scene: None) -> None:
    addon_utils = importlib.import_module("addon_utils")
    enabled = traces()
    assert enabled["operators"]
    for _ in range(2):
        addon_utils.disable(NAME)
        assert not any(traces().values()), "unregistering left something behind"
        assert addon_utils.enable(NAME) is not None
        assert traces() == enabled
