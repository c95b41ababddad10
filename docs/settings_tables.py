# SPDX-License-Identifier: GPL-3.0-or-later
"""Write the tables of settings into the manual's pages: `python docs/settings_tables.py` after a change of a table."""

import re
import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent
sys.path.insert(0, str(DOCS.parent))

from physics import MATTER_SETTINGS, SKY_SETTINGS, Setting  # noqa: E402  found only now

_PLACE = re.compile(r"(<!-- settings: (\w+) -->\n).*?(<!-- end of settings -->\n)", re.DOTALL)


def _meaning(setting: Setting) -> str:
    if setting.choices:
        items = [f"*{each.label}* (`{each.identifier}`): {each.description}" for each in setting.choices]
        return f"{setting.description}. {'. '.join(items)}"
    unit = f" {setting.unit}" if setting.unit else ""
    return f"{setting.description}. {setting.low:,.10g} to {setting.high:,.10g}{unit}"


def _option(setting: Setting) -> str:
    values = ", ".join(f"`{each.value}`" for each in setting.choices)
    return f"`{setting.option}` {values}".rstrip()


def disk_table() -> str:
    """Return the table of the disk's look."""
    rows = [
        f"| {setting.label} | `{name}` | {_option(setting)} | {_meaning(setting)} |\n"
        for name, setting in MATTER_SETTINGS.items()
    ]
    return "| control | property | `python -m physics bake` | |\n|---|---|---|---|\n" + "".join(rows)


def sky_table() -> str:
    """Return the table of the sky's look."""
    rows = [f"| {setting.label} | {_option(setting)} | {_meaning(setting)} |\n" for setting in SKY_SETTINGS.values()]
    return "| control | `python -m physics render` | |\n|---|---|---|\n" + "".join(rows)


TABLES = {"disk": disk_table, "sky": sky_table}
PAGES = (DOCS / "disk_settings.md", DOCS / "sky.md")


def filled(page: str) -> str:
    """Return a page's text with its tables as they should be."""
    return _PLACE.sub(lambda place: f"{place[1]}{TABLES[place[2]]()}{place[3]}", page)


def main() -> None:
    """Write the tables."""
    for page in PAGES:
        page.write_text(filled(page.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
