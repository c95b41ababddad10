# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays of light around a spinning (Kerr) black hole, and the warp maps made of them."""

from .background import Background
from .cameras import PanoramaCamera, PerspectiveCamera
from .disk import Disk
from .disk_pass import DiskPass
from .disk_pass_file import read_disk_pass, write_disk_pass
from .disk_tracer import DEFAULT_CROSSINGS, MOST_CROSSINGS, DiskResult, trace_disk
from .errors import BlackHoleError, Cancelled, ImageFileError, UnstableOrbitWarning, WarpMapError
from .observer import Observer
from .sharing import MapBaker, turned_map
from .shot import (
    DEFAULT_INTERPOLATION,
    IDENTITY,
    MOTIONS,
    SUPERSAMPLING,
    WarpMapParameters,
    looking_at_hole,
    unstable_orbit_warning,
)
from .tracer import DEFAULT_METHOD, DEFAULT_TOLERANCE, METHODS, Fate, TraceResult, trace_rays
from .warp_map import WarpMap, bake, bake_steps
from .warp_map_file import read_warp_map, read_warp_map_metadata, write_warp_map

__all__ = [
    "DEFAULT_CROSSINGS",
    "DEFAULT_INTERPOLATION",
    "DEFAULT_METHOD",
    "DEFAULT_TOLERANCE",
    "IDENTITY",
    "METHODS",
    "MOST_CROSSINGS",
    "MOTIONS",
    "SUPERSAMPLING",
    "Background",
    "BlackHoleError",
    "Cancelled",
    "Disk",
    "DiskPass",
    "DiskResult",
    "Fate",
    "ImageFileError",
    "MapBaker",
    "Observer",
    "PanoramaCamera",
    "PerspectiveCamera",
    "TraceResult",
    "UnstableOrbitWarning",
    "WarpMap",
    "WarpMapError",
    "WarpMapParameters",
    "bake",
    "bake_steps",
    "looking_at_hole",
    "read_disk_pass",
    "read_warp_map",
    "read_warp_map_metadata",
    "trace_disk",
    "trace_rays",
    "turned_map",
    "unstable_orbit_warning",
    "write_disk_pass",
    "write_warp_map",
]
