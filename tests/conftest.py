# SPDX-License-Identifier: GPL-3.0-or-later
"""The installed extension, for the tests that need Blender; the others start without importing bpy."""

import atexit
import importlib
import importlib.util
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parent.parent
SESSION = pytest.StashKey[pytest.Session]()

# Blender reads this when bpy is first imported, so it must be set before any test module is collected: what
# these tests install, enable and save never touches the user's own Blender.
USER_RESOURCES = Path(tempfile.mkdtemp(prefix="umbra-tests-"))
os.environ["BLENDER_USER_RESOURCES"] = str(USER_RESOURCES)
atexit.register(shutil.rmtree, USER_RESOURCES, ignore_errors=True)

# Many tests start processes, which would compile the extension and the package again each time.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """Remember the session, whose exit status is the process's."""
    session.config.stash[SESSION] = session


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config: pytest.Config) -> None:
    """End the process here if Blender is in it, with all said and done.

    As a Python module Blender 4.5 is only shut down when the last reference to it goes. After a long session some are
    left, and then the process waits for one of Blender's own threads for ever.
    """
    session = config.stash.get(SESSION, None)
    if session is not None and "bpy" in sys.modules:
        shutil.rmtree(USER_RESOURCES, ignore_errors=True)
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(int(session.exitstatus))


@pytest.fixture(scope="session")
def build_extension() -> ModuleType:
    """The module that builds the zip (not importable by name: its folder's name starts with a dot)."""
    spec = importlib.util.spec_from_file_location("build_extension", ROOT / ".ci" / "build_extension.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def extension_zip(build_extension: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The extension built for this machine, with the same code as the zip that is published."""
    output = tmp_path_factory.mktemp("extension")
    (made,) = build_extension.build([build_extension.current_platform()], output)
    return made


@pytest.fixture(scope="session")
def addon(extension_zip: Path) -> Iterator[ModuleType]:
    """The extension as a user has it, installed from its zip and enabled: bl_ext.user_default.<id>."""
    import bpy

    addon_utils = importlib.import_module("addon_utils")  # Blender's own; bpy must be imported before
    name = "bl_ext.user_default.umbra_black_hole"
    bpy.ops.extensions.package_install_files(repo="user_default", filepath=str(extension_zip), enable_on_install=True)
    assert name in bpy.context.preferences.addons, f"{name} was installed but could not be enabled"
    yield importlib.import_module(name)
    # Handlers that are still registered when the process ends make Blender 4.5 hang.
    addon_utils.disable(name, default_set=False)


@pytest.fixture(scope="session")
def addon_module(addon: ModuleType) -> Callable[[str], ModuleType]:
    """A function that imports a submodule of the installed extension: addon_module("ui.operators")."""

    def submodule(name: str) -> ModuleType:
        return importlib.import_module(f"{addon.__name__}.{name}")

    return submodule


@pytest.fixture
def factory_scene(addon: ModuleType) -> None:
    """Blender's factory scene, with the extension still enabled, whatever the test before left behind."""
    import bpy

    bpy.ops.wm.read_homefile(use_factory_startup=True)
