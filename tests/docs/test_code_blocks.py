# SPDX-License-Identifier: GPL-3.0-or-later
"""What the pages tell people to type is what works."""

import numpy as np
import pytest
from pages import PAGES, ROOT, blocks, languages
from shell_lines import check, commands

from physics.exr import write_exr

SIZE = (64, 36)
# Directives of the manual, and plain text.
OTHERS = {"", "text", "{figure}", "{toctree}", "{eval-rst}"}
KNOWN = {"python", "sh", "json", "yaml", "javascript"}


@pytest.fixture
def scene_of_blender(request, tmp_path, monkeypatch):
    """A function that empties Blender, and makes its renders small; in a folder of its own."""
    monkeypatch.chdir(tmp_path)

    def empty():
        request.getfixturevalue("addon")
        import bpy

        bpy.ops.wm.read_homefile(use_factory_startup=True)
        bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y = SIZE
        return bpy.context.scene

    return empty


def test_every_block_says_what_it_is():
    assert languages() <= OTHERS | KNOWN


@pytest.mark.parametrize("page", [page for page in PAGES if any(each.page == page for each in blocks("python"))],
                         ids=lambda page: str(page.relative_to(ROOT)))  # fmt: skip
def test_python_blocks_run(page, scene_of_blender):
    """One after the other, as a reader would: what a block defines, the next one has."""
    known = {"__name__": "__main__"}
    for block in blocks("python"):
        if block.page == page:
            if "bpy" in block.code:
                scene_of_blender()
            exec(compile(block.code, str(block), "exec"), known)


@pytest.mark.parametrize("page", [page for page in PAGES if any(each.page == page for each in blocks("sh"))],
                         ids=lambda page: str(page.relative_to(ROOT)))  # fmt: skip
def test_shell_blocks_are_right(page, scene_of_blender, tmp_path):
    def run_in_blender(code):
        scene = scene_of_blender()
        scene.frame_end = 2
        import bpy

        bpy.ops.umbra.add_black_hole()
        exec(compile(code, "--python-expr", "exec"), {"__name__": "__main__"})

    write_exr(tmp_path / "sky.exr", np.full((16, 32, 3), 0.25, np.float32))
    for block in blocks("sh"):
        if block.page == page:
            for words in commands(block.code):
                check(words, run_in_blender)


@pytest.mark.parametrize("line", ["blender -b scene.blend --no-such-option", "make no-such-target", "rm file",
                                  "blender -b scene.blend -f", "python -m physics bake map.png"])  # fmt: skip
def test_wrong_lines_are_found(line, scene_of_blender):
    (words,) = commands(line)
    with pytest.raises(AssertionError):
        check(words, lambda _code: None)
