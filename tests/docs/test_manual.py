# SPDX-License-Identifier: GPL-3.0-or-later
"""The manual builds without a warning, every link in it leads somewhere, and it needs no network to be read."""

import ast
import importlib.util
import re
import subprocess
import sys
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import numpy as np
import pytest
from pages import DOCS, PAGES, ROOT, anchors, links

import physics

SCREENSHOTS = DOCS / "screenshots"
LARGEST_SCREENSHOT = 150_000  # bytes


@dataclass
class Page(HTMLParser):
    """Where a built page leads to, what it loads, and the places in it that can be led to."""

    leads: list[str] = field(default_factory=list)
    loads: list[str] = field(default_factory=list)
    places: set[str] = field(default_factory=set)

    def __post_init__(self):
        super().__init__()

    def handle_starttag(self, tag, attrs):
        given = {name: value for name, value in attrs if value is not None}
        self.places |= {given[name] for name in ("id", "name") if name in given}
        if tag == "a" and "href" in given:
            self.leads.append(given["href"])
        elif tag == "link" and given.get("rel") in ("stylesheet", "icon", "preload"):
            self.loads.append(given["href"])
        self.loads += [given["src"]] if "src" in given else []
        self.loads += [given["data"]] if tag == "object" and "data" in given else []


@pytest.fixture(scope="session")
def manual(tmp_path_factory):
    """The folder of the built manual."""
    folder = tmp_path_factory.mktemp("manual")
    options = ["-W", "-n", "--keep-going", "-q", "-d", folder / "doctrees"]  # those of `make manual`
    command = [sys.executable, "-m", "sphinx", *options, DOCS, folder / "html"]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    return folder / "html"


@pytest.fixture(scope="session")
def built(manual):
    """The built pages by their paths."""
    pages = {}
    for path in manual.rglob("*.html"):
        pages[path] = Page()
        pages[path].feed(path.read_text(encoding="utf-8"))
    return pages


def test_each_link_leads_somewhere(built, manual):
    for path, page in built.items():
        for link in page.leads + page.loads:
            parts = urlsplit(link)
            if parts.scheme:
                # only its form: asking for it would need a network
                assert re.match(r"https?://[\w-]+(\.[\w-]+)+(/|$)", link), f"{path.name}: {link}"
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            assert target.exists(), f"{path.name} leads to {link}, which is not there"
            if parts.fragment and target.suffix == ".html":
                assert unquote(parts.fragment) in built[target].places, f"{path.name} leads to {link}: no such place"


def test_pages_load_nothing_from_elsewhere(built):
    for path, page in built.items():
        assert not [load for load in page.loads if urlsplit(load).netloc], path.name


def test_every_page_can_be_reached(built, manual):
    (index,) = [page for path, page in built.items() if path == manual / "index.html"]
    reached = {link.split("#")[0] for link in index.leads}
    for source in DOCS.glob("*.md"):
        assert f"{source.stem}.html" in reached | {"index.html"}, f"{source.name} is in no table of contents"


def test_every_public_name_is_documented(built, manual):
    places = built[manual / "api.html"].places
    assert not [name for name in physics.__all__ if f"physics.{name}" not in places]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_hold_on_github_too(page):
    for link in links(page):
        parts = urlsplit(link)
        if parts.scheme:
            continue
        target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
        assert target.exists(), f"{page.name} leads to {link}, which is not there"
        assert target.is_relative_to(ROOT), link
        if parts.fragment:
            assert parts.fragment in anchors(target), f"{page.name} leads to {link}: no such heading"


def test_screenshots_are_small_used_and_taken_by_the_script():
    stage = ast.parse((SCREENSHOTS / "stage.py").read_text(encoding="utf-8"))
    (pictures,) = [
        node.value for node in stage.body if isinstance(node, ast.AnnAssign) and node.target.id == "PICTURES"
    ]
    names = {key.value for key in pictures.keys}
    shown = {Path(link).stem for page in PAGES for link in links(page) if "screenshots/" in link}
    files = {path.stem: path for path in SCREENSHOTS.glob("*.png")}
    assert files.keys() == names == shown
    assert not [path.name for path in files.values() if path.stat().st_size > LARGEST_SCREENSHOT]


def test_deflection_in_the_figure_agrees_with_the_closed_form():
    """Within 1e-6 radians: the figure's camera is 1e4 M away, not infinitely far, which leaves some 1e-7."""
    spec = importlib.util.spec_from_file_location("figures", DOCS / "figures.py")
    figures = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(figures)
    b = np.sqrt(27.0) + np.geomspace(1e-3, 12.0, 50)
    difference = figures.traced_deflection(0.0, b) - figures.schwarzschild_deflection(b)
    assert np.abs(difference).max() < 1e-6
    # its own check, against the series 4/b + 15 pi/(4 b^2) + 128/(3 b^3) + ... far away
    far = np.array([1e3])
    series = 4.0 / far + 15.0 * np.pi / (4.0 * far**2) + 128.0 / (3.0 * far**3)
    np.testing.assert_allclose(figures.schwarzschild_deflection(far), series, rtol=1e-7)
