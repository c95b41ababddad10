# SPDX-License-Identifier: GPL-3.0-or-later
"""What the EXR files of warp maps, exit maps and disk passes share: a header that says all, and its checks."""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..images.exr import PathLike, read_channels, read_exr_header, write_channels
from ..numerics.errors import ImageFileError, WarpMapError
from ..shot.identity import bake_version, hash_of, version_of
from ..shot.map_parameters import WarpMapParameters

CHANNELS = ("R", "G", "B", "A")

# Header attributes, all strings.
ATTRIBUTE_FORMAT = "umbraFormat"
ATTRIBUTE_HASH = "umbraHash"
ATTRIBUTE_COUNTS = "umbraCounts"
ATTRIBUTE_PARAMETERS = "umbraParameters"
ATTRIBUTE_CHECKSUM = "umbraChecksum"
ATTRIBUTE_SEAL = "umbraHeaderChecksum"

# What `ATTRIBUTE_SEAL` is not about: itself, and what the pixels are checked by.
_UNSEALED = (ATTRIBUTE_SEAL, ATTRIBUTE_CHECKSUM)

Planes = Sequence[NDArray[Any]]


class MapOrigin(Protocol):
    """What a file should be made from: `WarpMapParameters`, or what a layer is made from."""

    @property
    def hash(self) -> str:
        """The hash of all of it."""

    @property
    def map_size(self) -> tuple[int, int]:
        """Width and height in pixels."""


def made_from_view(metadata: Mapping[str, Any], wanted: WarpMapParameters) -> bool:
    """Return whether a file was made from these parameters, but for the noise of single-precision arithmetic.

    Parameters
    ----------
    metadata : mapping
        ``hash`` and ``parameters`` of the file.
    wanted : WarpMapParameters
    """
    if metadata["hash"] == wanted.hash:
        return True
    made = metadata["parameters"]
    return bool(metadata["hash"] == hash_of(made)) and wanted.agrees_with(made)


@dataclass(frozen=True)
class MapFormat:
    """One kind of map file."""

    name: str
    """What `umbraFormat` begins with."""
    version: int
    noun: str
    """What a message calls it, with its article."""
    comments: str
    """What the channels are, for whoever opens the file elsewhere."""
    pictures: int = 1
    """Pictures of the map's size that the file holds, one below the other."""
    attributes: tuple[str, ...] = ()
    """Further header attributes, strings, that the kind has."""
    is_made_from: Callable[[Mapping[str, Any], Any], bool] = made_from_view
    """Whether metadata are those of a file of this version that was made from given parameters."""

    @property
    def stamp(self) -> str:
        """The whole value of `umbraFormat`."""
        return f"{self.name} {self.version}"

    def write(self, path: PathLike, planes: Planes, metadata: Mapping[str, Any], further: Sequence[str] = ()) -> None:
        """Write four planes with their header, completely or not at all.

        Parameters
        ----------
        path : path
            Its folder is made if need be; an existing file is replaced.
        planes : sequence of ndarray of float32
            R, G, B and A, of one shape each.
        metadata : mapping
            ``hash``, ``counts`` and ``parameters``.
        further : sequence of str
            The values of `attributes`.

        Raises
        ------
        ImageFileError
            If the file cannot be written.
        """
        header = {
            ATTRIBUTE_FORMAT: self.stamp,
            ATTRIBUTE_HASH: metadata["hash"],
            ATTRIBUTE_COUNTS: json.dumps(metadata["counts"]),
            ATTRIBUTE_PARAMETERS: json.dumps(metadata["parameters"]),
            ATTRIBUTE_CHECKSUM: checksum(planes),
            "comments": self.comments,
            **dict(zip(self.attributes, further, strict=True)),
        }
        header[ATTRIBUTE_SEAL] = seal(header)
        write_channels(path, dict(zip(CHANNELS, planes, strict=True)), header)

    def read(self, path: PathLike) -> tuple[list[NDArray[Any]], dict[str, Any]]:
        """Read the four planes and the metadata, and check header and checksum.

        Parameters
        ----------
        path : path

        Returns
        -------
        planes : list of ndarray
            R, G, B and A.
        metadata : dict
            ``format``, ``hash``, ``counts`` and ``parameters``, and the further attributes.

        Raises
        ------
        WarpMapError
            If the file is missing, damaged, cut short, or of another kind; the message names it and says which.
        """
        try:
            channels, header = read_channels(path)
        except ImageFileError as error:
            raise WarpMapError(advice(str(error)), code=error.code) from error
        metadata = self._metadata(path, header)
        planes = [channels[name] for name in CHANNELS if name in channels]
        if len(planes) != len(CHANNELS) or checksum(planes) != header.get(ATTRIBUTE_CHECKSUM):
            raise WarpMapError(
                advice(f"{path} is damaged: its pixels are not those that were written."), code="map.damaged"
            )
        return planes, metadata

    def read_metadata(self, path: PathLike) -> dict[str, Any]:
        """Read the metadata from the header.

        Parameters
        ----------
        path : path

        Returns
        -------
        dict
            As from `read`.

        Raises
        ------
        WarpMapError
            If the file is missing, its header is damaged, or it is of another kind.
        """
        try:
            header = read_exr_header(path)
        except ImageFileError as error:
            raise WarpMapError(advice(str(error)), code=error.code) from error
        return self._metadata(path, header)

    def _metadata(self, path: PathLike, header: Mapping[str, Any]) -> dict[str, Any]:
        stamp = header.get(ATTRIBUTE_FORMAT)
        if not isinstance(stamp, str) or not stamp.startswith(self.name + " "):
            raise WarpMapError(advice(f"{Path(path)} is not {self.noun}."), code="map.other-kind")
        if stamp != self.stamp:
            raise WarpMapError(
                advice(f"{Path(path)} is {self.noun} of another version ({stamp})."), code="map.other-version"
            )
        try:
            parameters = json.loads(header[ATTRIBUTE_PARAMETERS])
            counts = json.loads(header[ATTRIBUTE_COUNTS])
            made_from = WarpMapParameters.from_metadata(parameters)
            _check(made_from)
            width, height = made_from.map_size
            readable = isinstance(counts["unresolved"], int) and all(
                type(each) is int and each >= 0 for each in counts.values()
            )
            identity = identity_of(str(header[ATTRIBUTE_HASH]), made_from, parameters)
        except (ArithmeticError, AttributeError, KeyError, TypeError, ValueError, RecursionError) as error:
            raise WarpMapError(
                advice(f"{Path(path)} is damaged: its header cannot be read."), code="map.damaged"
            ) from error
        sealed = header.get(ATTRIBUTE_SEAL, seal(header))
        if not readable or identity is None or sealed != seal(header):
            raise WarpMapError(
                advice(f"{Path(path)} is damaged: its header is not the one that was written."), code="map.damaged"
            )
        if list(header["size"]) != [width, height * self.pictures]:
            raise WarpMapError(
                advice(f"{Path(path)} is damaged: its size is not that of its parameters."), code="map.damaged"
            )
        further = {name: str(header.get(name, "")) for name in self.attributes}
        return {"format": stamp, "hash": identity, "counts": counts, "parameters": parameters, **further}


def checksum(planes: Planes) -> str:
    """Return the CRC-32 of the channels' bytes, one after another.

    Parameters
    ----------
    planes : sequence of ndarray
        Taken as little-endian float32.

    Returns
    -------
    str
        ``crc32`` and eight hexadecimal digits.
    """
    value = 0
    for plane in planes:
        value = zlib.crc32(np.ascontiguousarray(plane, dtype="<f4").data, value)
    return f"crc32 {value:08x}"


def seal(header: Mapping[str, Any]) -> str:
    """Return the CRC-32 of the header's own attributes, which finds a bit that flipped in any of them.

    Parameters
    ----------
    header : mapping
        Attributes by name; those of other programs do not count.

    Returns
    -------
    str
        ``crc32`` and eight hexadecimal digits.
    """
    own = {name: value for name, value in header.items() if name.startswith("umbra") and name not in _UNSEALED}
    text = json.dumps({name: value for name, value in own.items() if isinstance(value, str)}, sort_keys=True)
    return f"crc32 {zlib.crc32(text.encode()):08x}"


def identity_of(stated: str, made_from: WarpMapParameters, parameters: Mapping[str, Any]) -> str | None:
    """Return the hash of what a header says a map was made from, if the header states that hash.

    Parameters
    ----------
    stated : str
        The hash in the header.
    made_from : WarpMapParameters
        What its parameters are.
    parameters : mapping
        They themselves, as the header has them.

    Returns
    -------
    str or None
        `WarpMapParameters.hash`, also for a file of version 0.1.0, whose hash was of all digits; for a map of another
        version of the bake the stated hash. None if the hash is not of these parameters.
    """
    version = version_of(stated, parameters)
    if version is None:
        return None
    return made_from.hash if version == bake_version(parameters) else stated


def _check(made_from: WarpMapParameters) -> None:
    """Raise BlackHoleError if nothing can be made from these parameters."""
    with np.errstate(all="ignore"):
        made_from.validate()


def advice(sentence: str) -> str:
    """Return a sentence about a faulty file with the advice to bake it again."""
    return f"{sentence.removesuffix('.')}; bake it again."
