# SPDX-License-Identifier: GPL-3.0-or-later
"""What the pages tell people to type is what works."""

import numpy as np
import pytest
from pages import PAGES, ROOT, blocks, languages
from shell_lines import check, commands

from physics.images.exr import write_exr

SIZE = (64, 36)
# Directives of the manual, and plain text.
OTHERS = {"", "text", "{figure}", "{toctree}", "{eval-rst}"}
KNOWN = {"python", "sh", "json", "yaml", "javascript"}


class SmallBlender:
    """Blender with the add-on as users have it, its renders small."""

    def __init__(self, request):
        self._request = request

    def empty(self):
        """Begin anew with the factory scene."""
        self._request.getfixturevalue("addon")
        import bpy

        bpy.ops.wm.read_homefile(use_factory_startup=True)
        scene = bpy.context.scene
        scene.render.resolution_x, scene.render.resolution_y = SIZE
        return scene

    def run(self, code):
        """Run Python in a scene of two frames with a hole."""
        self.empty().frame_end = 2
        import bpy

        bpy.ops.umbra.add_black_hole()
        exec(compile(code, "--python-expr", "exec"), {"__name__": "__main__"})

    def parse(self, words):
        """Have the add-on's command parse its words."""
        self._request.getfixturevalue("addon_module")("command.command_line")._parser().parse_args(words)


@pytest.fixture
def blender(request, tmp_path, monkeypatch):
    """Blender, started where it is needed, in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PWD", str(tmp_path))  # where Blender looks for the folder that it is in
    return SmallBlender(request)


def test_every_block_says_what_it_is():
    assert languages() <= OTHERS | KNOWN


@pytest.mark.parametrize("page", [page for page in PAGES if any(each.page == page for each in blocks("python"))],
                         ids=lambda page: str(page.relative_to(ROOT)))  # fmt: skip
def test_python_blocks_run(page, blender):
    """One after the other, as a reader would: what a block defines, the next one has."""
    known = {"__name__": "__main__"}
    for block in blocks("python"):
        if block.page == page:
            if "bpy" in block.code:
                blender.empty()
            exec(compile(block.code, str(block), "exec"), known)


@pytest.mark.parametrize("page", [page for page in PAGES if any(each.page == page for each in blocks("sh"))],
                         ids=lambda page: str(page.relative_to(ROOT)))  # fmt: skip
def test_shell_blocks_are_right(page, blender, tmp_path):
    write_exr(tmp_path / "sky.exr", np.full((16, 32, 3), 0.25, np.float32))
    for block in blocks("sh"):
        if block.page == page:
            for words in commands(block.code):
                check(words, blender)


@pytest.mark.parametrize(
    "line",
    [
        "blender -b scene.blend --no-such-option",
        "blender -b scene.blend -f",
        "make no-such-target",
        "openjd sing",
        "python -m physics bake map.png",
        "rm file",
    ],
)
def test_wrong_lines_are_found(line, blender):
    (words,) = commands(line)
    with pytest.raises(AssertionError):
        check(words, blender)
