# SPDX-License-Identifier: GPL-3.0-or-later
"""Every sentence that the code can say to a user, found in its source; the page that explains them."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "troubleshooting.md"

# What speaks to the user, by the name that is called.
SPEAKERS = {"report", "warn", "popup", "end_process", "poll_message_set", "wrapped", "Line", "status_text_set"}
# Texts of tooltips and of --help.
DESCRIBING = {"description", "help", "name", "bl_description"}
# Errors that no user can cause.
INTERNAL = {"AssertionError", "NotImplementedError"}
# What these say is their result, not a fault; pages of their own explain it.
REPORTS = {"accuracy_report.py"}
# Runs on a farm without the add-on, and speaks to its log.
FARM_SCRIPTS = {"umbra_farm.py"}
LEAST_WORDS = 3
# A function that returns so many words returns the beginning of a sentence, which another one ends.
WORDS_OF_A_CLAUSE = 5
# Letters that an entry of the page needs to be a part of a sentence that is known by it.
LEAST_LETTERS = 7
PLACEHOLDER = "…"


@dataclass(frozen=True)
class Message:
    """A sentence with a placeholder for each value, and where it is said."""

    text: str
    where: str


def messages() -> list[Message]:
    """The sentences of both packages."""
    files = [*sorted((ROOT / "physics").rglob("*.py")), *sorted((ROOT / "blender_addon").rglob("*.py"))]
    found = []
    for file in files:
        if file.name in REPORTS | FARM_SCRIPTS:
            continue
        tree = ast.parse(file.read_text(encoding="utf-8"))
        for node in _spoken(tree, speaks=False):
            text = " ".join(_template(node).split())
            if len(text.split()) >= LEAST_WORDS and any(letter.isalpha() for letter in text):
                found.append(Message(text, f"{file.relative_to(ROOT)}:{node.lineno}"))
    return found


def _template(node: ast.expr | None) -> str:
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else PLACEHOLDER
    if isinstance(node, ast.JoinedStr):
        return "".join(_template(part) for part in node.values)
    return PLACEHOLDER


def _spoken(node: ast.AST, speaks: bool) -> Iterator[ast.expr]:
    """String literals that a user may read: in errors and reports, and wherever they end as sentences do."""
    if isinstance(node, ast.Constant | ast.JoinedStr):
        text = _template(node)
        if speaks or (text.rstrip().endswith(".") and not text.endswith("...")):
            yield node
        return
    if isinstance(node, ast.Raise):
        speaks = _name_of(node.exc) not in INTERNAL
        if not speaks:
            return
    elif isinstance(node, ast.Return):
        speaks = len(_template(node.value).split()) >= WORDS_OF_A_CLAUSE
    elif isinstance(node, ast.Call):
        speaks = speaks or _name_of(node) in SPEAKERS or _to_standard_error(node)
    for child in ast.iter_child_nodes(node):
        if _is_docstring(child) or (isinstance(child, ast.keyword) and child.arg in DESCRIBING):
            continue
        if isinstance(child, ast.Assign) and _name_of(child.targets[0]) in DESCRIBING:
            continue
        yield from _spoken(child, speaks)


def _name_of(node: ast.AST | None) -> str:
    if isinstance(node, ast.Call):
        node = node.func
    return node.attr if isinstance(node, ast.Attribute) else getattr(node, "id", "")


def _to_standard_error(call: ast.Call) -> bool:
    return _name_of(call) == "print" and any(
        keyword.arg == "file" and _name_of(keyword.value) == "stderr" for keyword in call.keywords
    )


def _is_docstring(node: ast.AST) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def entries() -> list[str]:
    """What the page quotes: the code in the first column of its tables."""
    quoted: list[str] = []
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        if line.startswith("| `"):
            quoted += re.findall(r"`([^`]+)`", line.split(" | ")[0])
    return quoted


def explains(entry: str, message: Message) -> bool:
    """Whether an entry of the page quotes a message.

    One with hardly any words of its own would match many by accident: it has to be the whole message.
    """
    if sum(letter.isalpha() for letter in entry) < LEAST_LETTERS:
        return entry == message.text
    pattern = ".*".join(re.escape(part) for part in " ".join(entry.split()).split(PLACEHOLDER))
    return re.search(pattern, message.text) is not None
