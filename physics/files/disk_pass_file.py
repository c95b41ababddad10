# SPDX-License-Identifier: GPL-3.0-or-later
"""The file format of a disk's passes: like a warp map's, one file for each crossing. See docs/disk.md."""

from __future__ import annotations

import math

import numpy as np

from ..disk_passes.disk_pass import DiskPass
from ..images.exr import PathLike
from ..numerics.errors import WarpMapError
from .map_file import MapFormat, advice

FORMAT = MapFormat(
    "umbra disk pass",
    1,
    "a disk pass",
    "R: radius on the disk (M); G: azimuth in the hole's frame (radians); B: g; A: coverage",
    attributes=("umbraCrossing",),
)


def write_disk_pass(path: PathLike, disk_pass: DiskPass) -> None:
    """Write a pass to an EXR file, whole or not at all: R, G, B, A are radius, phi, g and coverage.

    Parameters
    ----------
    path : path
        Its folder is made if need be; a file that is there is replaced.
    disk_pass : DiskPass

    Raises
    ------
    ImageFileError
        When the file cannot be written.
    """
    planes = (disk_pass.radius, disk_pass.phi, disk_pass.g, disk_pass.coverage)
    FORMAT.write(path, planes, disk_pass.metadata, (str(disk_pass.metadata["crossing"]),))


def read_disk_pass(path: PathLike) -> DiskPass:
    """Read a pass and check it: its format, its parameters, its pixels' checksum and ranges.

    Raises
    ------
    WarpMapError
        When the file is missing, damaged, cut short, or not a disk pass; the message names it and says which.
    """
    (radius, phi, g, coverage), metadata = FORMAT.read(path)
    disk = metadata["parameters"].get("disk")
    crossing = metadata.pop("umbraCrossing")
    seen = coverage > 0.0
    fits = (
        ((coverage >= 0.0) & (coverage <= 1.0)).all()
        and ((phi >= 0.0) & (phi < np.float32(2.0 * math.pi))).all()
        and (np.isfinite(radius) & np.isfinite(g)).all()
        and (radius[seen] > 0.0).all()
        and (g[seen] > 0.0).all()
    )
    if not (fits and disk and crossing.isdigit() and 1 <= int(crossing) <= disk["crossings"]):
        raise WarpMapError(advice(f"{path} is damaged: it holds values that no disk pass has."))
    return DiskPass(radius, phi, g, coverage, {**metadata, "crossing": int(crossing)})
