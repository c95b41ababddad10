# SPDX-License-Identifier: GPL-3.0-or-later
"""Catalogs of stars as tables of text: right ascension, declination, magnitude and B-V, separated by commas."""

from __future__ import annotations

import csv
import hashlib
import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from ..light.star_sky import Stars
from ..numerics.errors import BlackHoleError

COLUMNS = ("right ascension", "declination", "magnitude", "B-V")
BRIGHTEST, FAINTEST = -30.0, 40.0
DIGITS = 16


def read_star_catalog(path: str | os.PathLike[str]) -> Stars:
    """Read a catalog of stars from a CSV file.

    Parameters
    ----------
    path : path
        Text in UTF-8 with one star per line: right ascension and declination in degrees (J2000, 0 to 360 and -90 to
        90), visual magnitude, and B-V, which may be left out or empty where it is not known. A first line that does not
        begin with a number is taken as the columns' names. Empty lines, and lines that begin with #, do not count.

    Returns
    -------
    Stars

    Raises
    ------
    BlackHoleError
        If the file cannot be read or a line is not a star; the message names the file and the line.
    """
    path = Path(path)
    rows: list[tuple[float, float, float, float]] = []
    try:
        with _explained(path), path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file)
            is_first = True
            for cells in reader:
                if not any(cell.strip() for cell in cells) or cells[0].lstrip().startswith("#"):
                    continue
                if not (is_first and _is_heading(cells[0])):
                    rows.append(_star(cells, f"{path}, line {reader.line_num}"))
                is_first = False
    except (UnicodeDecodeError, csv.Error) as error:
        raise BlackHoleError(
            f"The star catalog {path} is not a table of text (CSV in UTF-8).", code="file.bad-catalog"
        ) from error
    if not rows:
        raise BlackHoleError(f"The star catalog {path} holds no stars.", code="file.bad-catalog")
    ascension, declination, magnitude, color_index = np.array(rows, dtype=np.float64).T
    return Stars(np.radians(ascension), np.radians(declination), magnitude, color_index)


def catalog_digest(path: str | os.PathLike[str]) -> str:
    """Return a digest of a catalog's content, in hexadecimal.

    Raises
    ------
    BlackHoleError
        If the file cannot be read.
    """
    with _explained(path):
        return hashlib.sha256(Path(path).read_bytes()).hexdigest()[:DIGITS]


@contextmanager
def _explained(path: str | os.PathLike[str]) -> Iterator[None]:
    """Turn what the system says of a file into a sentence."""
    try:
        yield
    except FileNotFoundError as error:
        raise BlackHoleError(f"The star catalog {path} does not exist.", code="file.missing") from error
    except OSError as error:
        raise BlackHoleError(
            f"Cannot read the star catalog {path}: {(error.strerror or str(error)).lower()}.", code="file.no-access"
        ) from error


def _is_heading(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return True
    return False


def _star(cells: list[str], where: str) -> tuple[float, float, float, float]:
    texts = [cell.strip() for cell in cells]
    if len(texts) not in (3, 4):
        raise BlackHoleError(
            f"{where}: {len(texts)} columns; give right ascension, declination, magnitude and B-V.",
            code="file.bad-catalog",
        )
    texts += [""] * (4 - len(texts))
    values = []
    for text, name in zip(texts, COLUMNS, strict=True):
        try:
            values.append(math.nan if name == "B-V" and not text else float(text))
        except ValueError as error:
            raise BlackHoleError(f"{where}: the {name} {text!r} is not a number.", code="file.bad-catalog") from error
    ascension, declination, magnitude, color_index = values
    # B-V of black bodies ends near -0.4; Ballesteros' formula for temperatures at -0.67.
    ranges = ((ascension, -360.0, 360.0), (declination, -90.0, 90.0), (magnitude, BRIGHTEST, FAINTEST))
    for (value, low, high), name in zip(ranges, COLUMNS, strict=False):
        if not low <= value <= high:
            raise BlackHoleError(
                f"{where}: the {name} is {value:g}; it must be from {low:g} to {high:g}.", code="file.bad-catalog"
            )
    if not (math.isnan(color_index) or -0.6 <= color_index <= 10.0):
        raise BlackHoleError(
            f"{where}: the B-V is {color_index:g}; it must be from -0.6 to 10.", code="file.bad-catalog"
        )
    return ascension, declination, magnitude, color_index
