# SPDX-License-Identifier: GPL-3.0-or-later
"""The manual's tables of settings are those that the code is made from."""

import importlib.util

import pytest
from pages import DOCS

import physics

_SPEC = importlib.util.spec_from_file_location("settings_tables", DOCS / "settings_tables.py")
settings_tables = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(settings_tables)


@pytest.mark.parametrize("page", settings_tables.PAGES, ids=lambda page: page.stem)
def test_pages_have_the_tables(page):
    text = page.read_text(encoding="utf-8")
    assert settings_tables.filled(text) == text, "run python docs/settings_tables.py"
    assert text.count("<!-- settings: ") == 1


@pytest.mark.parametrize("table", [physics.MATTER_SETTINGS, physics.SKY_SETTINGS], ids=["disk", "sky"])
def test_rows_are_whole(table):
    rows = table.values()
    for names in ([row.option for row in rows], [row.label for row in rows]):
        assert all(names)
        assert len(set(names)) == len(names)
    for row in rows:
        assert row.problem(row.default) is None
        assert len(row.description) > 10
        assert not row.description.endswith(".")
        assert len({choice.number for choice in row.choices}) == len(row.choices)
        if not row.choices:
            soft_low = row.low if row.soft_low is None else row.soft_low
            soft_high = row.high if row.soft_high is None else row.soft_high
            assert row.low <= soft_low < soft_high <= row.high
    assert tuple(choice.value for choice in physics.MATTER_SETTINGS["profile"].choices) == physics.DISK_PROFILES
