# SPDX-License-Identifier: GPL-3.0-or-later
"""Every error has a code, and the troubleshooting page explains exactly the codes that exist."""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Iterator

from pages import DOCS, ROOT

PACKAGES = ("physics", "blender_addon")
FORM = re.compile(r"[a-z]+\.[a-z]+(-[a-z]+)*")

TREES = {
    path.relative_to(ROOT): ast.parse(path.read_text(encoding="utf-8"))
    for package in PACKAGES
    for path in sorted((ROOT / package).rglob("*.py"))
}


def error_classes() -> set[str]:
    """BlackHoleError, its subclasses, and the error of the farm's script, which runs without the add-on."""
    classes = [node for tree in TREES.values() for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
    found, size = {"BlackHoleError", "Fault"}, 0
    while len(found) > size:
        size = len(found)
        found |= {node.name for node in classes if {ast.unparse(base).split(".")[-1] for base in node.bases} & found}
    return found


def errors() -> Iterator[tuple[str, ast.Call]]:
    """Where an error is made, and the call that makes it."""
    names = error_classes()
    for path, tree in TREES.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] in names:
                yield f"{path}:{node.lineno}", node


def codes_of(call: ast.Call) -> list[str]:
    """The codes that stand in a call; none where it passes the code of another error on."""
    (value,) = [keyword.value for keyword in call.keywords if keyword.arg == "code"]
    return [node.value for node in ast.walk(value) if isinstance(node, ast.Constant) and isinstance(node.value, str)]


def sections() -> dict[str, list[str]]:
    """The codes of each section of the page, in the first column of its table."""
    page = (DOCS / "troubleshooting.md").read_text(encoding="utf-8")
    found = {
        part.partition("\n")[0]: re.findall(r"^\| `([^`]+)` \|", part, re.MULTILINE) for part in page.split("\n## ")
    }
    return {title: codes for title, codes in found.items() if codes}


CODES = {code for _where, call in errors() for code in codes_of(call)}


def test_every_error_has_a_code():
    assert error_classes() >= {"SceneError", "MapFolderError", "WarpMapError", "ImageFileError"}
    assert len(list(errors())) > 150
    for where, call in errors():
        given = [keyword.value for keyword in call.keywords if keyword.arg == "code"]
        assert given, f"{where}: an error without a code"
        if not codes_of(call):
            assert isinstance(given[0], ast.Attribute), f"{where}: the code is neither a literal nor another error's"
            assert given[0].attr == "code", where


def test_codes_are_kind_and_what():
    assert not [code for code in CODES if not FORM.fullmatch(code)]


def test_the_page_explains_the_codes_that_exist():
    explained = Counter(code for codes in sections().values() for code in codes)
    assert not CODES - explained.keys(), "docs/troubleshooting.md does not explain these codes"
    assert not explained.keys() - CODES, "docs/troubleshooting.md explains codes that do not exist"
    assert not [code for code, times in explained.items() if times > 1]


def test_each_section_is_of_one_kind():
    kinds = [{code.partition(".")[0] for code in codes} for codes in sections().values()]
    assert all(len(each) == 1 for each in kinds)
    assert len(set().union(*kinds)) == len(kinds)


def test_sentences_end_with_a_full_stop():
    """Those that stand in the call; others are formatted elsewhere, or end with an argument."""
    for where, call in errors():
        sentence = call.args[0]
        if isinstance(sentence, ast.Call) and ast.unparse(sentence.func) == "advice":
            sentence = sentence.args[0]
        last = sentence.values[-1] if isinstance(sentence, ast.JoinedStr) else sentence
        if isinstance(last, ast.Constant):
            assert str(last.value).endswith("."), where
