# SPDX-License-Identifier: GPL-3.0-or-later
"""How Sphinx builds the manual: `make manual`. Needs no network, and what it builds needs none either."""

import re
import sys
import tomllib
from pathlib import Path

from docutils import nodes
from sphinx.addnodes import pending_xref
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
sys.path[:0] = [str(ROOT), str(DOCS)]

import figures  # noqa: E402  found only now

import physics  # noqa: E402

project = "Umbra Black Hole"
author = "Umbra Black Hole developers"
copyright = f"2026 {author}"
version = release = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
language = "en"

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
myst_enable_extensions = ["attrs_block"]
myst_heading_anchors = 4  # GitHub's names of headings

html_theme = "furo"
html_title = f"{project} {release}"
html_show_sphinx = False
html_copy_source = False

# Names in single backquotes are code in the docstrings, not always something with an entry of its own.
default_role = "code"
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstrings say more, and say it in words
autodoc_preserve_defaults = True
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True
# Types are written for people ("float or ndarray, shape (n,)"): only names of this package are looked up.
nitpick_ignore_regex = [(r"py:.*", r"(?!physics\.).*")]

# Names of the API by where they are defined.
PUBLIC_NAMES = {
    f"{found.__module__}.{found.__qualname__}": name
    for name in physics.__all__
    if hasattr(found := getattr(physics, name), "__qualname__")
}

# Pages of the table of contents that are left out while they are not there.
OPTIONAL = ("live_preview", "world", "long_shots", "farms", "accuracy")

# Pages whose text is a file elsewhere, from a heading to the next one of its rank; GitHub shows the file itself.
MIRRORS = {
    "demo_scenes": ("blend_files/README.md", "# Demo scenes"),
    "developers": ("README.md", "## For developers"),
    "data": ("physics/light/data/README.md", "# Data"),
    "changelog": ("CHANGELOG.md", "# Changelog"),
}
_LINK = re.compile(r"\]\(([^)#\s]+)(#[^)\s]*)?\)")


def _mirrored(file: str, heading: str) -> str:
    """The part of a file below a heading, which becomes the page's title."""
    rank = heading.index(" ")
    _before, found, rest = f"\n{(ROOT / file).read_text(encoding='utf-8')}".partition(f"\n{heading}\n")
    if not found:
        raise ValueError(f"{file} has no heading '{heading}', which a page of the manual shows.")
    return f"# {heading[rank + 1 :]}\n{re.split(f'^#{{1,{rank}}} ', rest, maxsplit=1, flags=re.MULTILINE)[0]}"


def _linked(folder: Path, text: str) -> str:
    """Lead links to files outside of the manual, as seen from a folder, to the pages that show the same text."""
    pages = {ROOT / file: page for page, (file, _heading) in MIRRORS.items()} | {ROOT / "README.md": "index"}

    def lead(link: re.Match[str]) -> str:
        path, anchor = link[1], link[2] or ""
        if "://" in path or path.startswith("mailto:"):
            return link[0]
        target = (folder / path).resolve()
        if target in pages:
            page = "developers" if anchor == "#for-developers" else pages[target]
            return f"]({page}.md)"
        return f"]({target.relative_to(DOCS).as_posix()}{anchor})" if target.is_relative_to(DOCS) else link[0]

    return _LINK.sub(lead, text)


def _read_page(_app: Sphinx, page: str, source: list[str]) -> None:
    """Fill in pages that show a file elsewhere, and keep links within the manual."""
    if page in MIRRORS:
        file, heading = MIRRORS[page]
        source[0] = _linked((ROOT / file).parent, _mirrored(file, heading))
    else:
        source[0] = _linked(DOCS, source[0])
    if page == "index":
        for name in OPTIONAL:
            if not (DOCS / f"{name}.md").exists():
                source[0] = source[0].replace(f"\n{name}\n", "\n")


def _public_name(
    app: Sphinx, environment: BuildEnvironment, node: pending_xref, content: nodes.Element
) -> nodes.Element | None:
    """Find `physics.kerr.observer.Observer`, as type hints say, where it is documented: `physics.Observer`."""
    name = PUBLIC_NAMES.get(node.get("reftarget", ""))
    if node.get("refdomain") != "py" or name is None:
        return None
    return environment.get_domain("py").resolve_xref(
        environment, node["refdoc"], app.builder, node["reftype"], f"physics.{name}", node, content
    )


def _plain_stars(_app: Sphinx, _what: str, _name: str, _object: object, _options: object, lines: list[str]) -> None:
    """Have a shape like (*shape, 3) printed, where reStructuredText would begin emphasis."""
    lines[:] = [re.sub(r"\(\*(?=\w)", r"(\\*", line) for line in lines]


def _draw_figures(_app: Sphinx) -> None:
    figures.draw_all(DOCS / "generated")


def setup(app: Sphinx) -> None:
    """Connect this project's own steps to the build."""
    app.connect("builder-inited", _draw_figures)
    app.connect("source-read", _read_page)
    app.connect("autodoc-process-docstring", _plain_stars)
    app.connect("missing-reference", _public_name)
