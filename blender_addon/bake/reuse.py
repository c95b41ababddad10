# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps that are there already under other names: of another version of the file, or of a former name of the scene.

They get a second name, where the file system can do that, and are copied otherwise. Nothing that another shot may need
is removed.
"""

import os
import re
from pathlib import Path

from .folder import link
from .kinds import MapKind
from .names import kind_of, name_pattern
from .request import MapRequest

# What maps of the same frame, size and kind have in common.
_Place = tuple[str, int, MapKind]


class OtherNames:
    """The maps in a folder, of all shots, by frame, size and kind."""

    def __init__(self, folder: Path) -> None:
        self._pattern = name_pattern()
        self._maps: dict[_Place, list[Path]] = {}
        try:
            names = os.listdir(folder)
        except OSError:
            names = []
        for name in names:
            match = self._pattern.fullmatch(name)
            if match is not None and match["beside"] is None:
                self._maps.setdefault(_place(match), []).append(folder / name)

    def take_over(self, wanted: MapRequest) -> bool:
        """Give a map that was made from the same parameters the wanted name as well; return whether there is one.

        Only headers are looked at: check the map afterwards.

        Raises
        ------
        OSError
            If the folder cannot be written to.
        """
        match = self._pattern.fullmatch(wanted.path.name)
        for other in self._maps.get(_place(match), ()) if match is not None else ():
            if other != wanted.path and wanted.lies_at(other):
                pairs = list(zip(wanted.formats(other), wanted.files, strict=True))
                for source, target in pairs[1:]:
                    link(source, target, copy=True)
                return link(*pairs[0], copy=True)
        return False


def _place(match: re.Match[str]) -> _Place:
    return match["size"], int(match["number"]), kind_of(match)


def carry(source: Path, old: str, target: Path, new: str, *, copy: bool = False) -> int:
    """Give all maps of a shot other names as well, as its file is saved or opened under one; return how many.

    Maps that have those names already are kept.

    Parameters
    ----------
    source, target : Path
        The folders.
    old, new : str
        What the maps' names begin with, from `names.shot_name`.
    copy : bool
        Copy maps where the file system has no second names. Otherwise they stay where they are.

    Raises
    ------
    OSError
        If the folder cannot be written to.
    """
    if (source, old) == (target, new):
        return 0
    pattern = name_pattern(old)
    try:
        names = [name for name in sorted(os.listdir(source)) if pattern.fullmatch(name)]
    except OSError:
        return 0
    carried = 0
    for name in names:
        path, destination = source / name, target / (new + name.removeprefix(old))
        if destination.exists():
            continue
        target.mkdir(parents=True, exist_ok=True)
        if not link(path, destination, copy=copy):
            break
        carried += 1
    return carried
