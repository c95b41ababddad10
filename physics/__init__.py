# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays of light around a spinning (Kerr) black hole, and the warp maps made of them."""

from .disk_passes.disk_pass import DiskPass
from .files.disk_pass_file import read_disk_pass, write_disk_pass
from .files.warp_map_file import read_warp_map, read_warp_map_metadata, write_warp_map
from .geodesics.disk_tracer import DEFAULT_CROSSINGS, MOST_CROSSINGS, DiskResult, trace_disk
from .geodesics.tracer import DEFAULT_METHOD, DEFAULT_TOLERANCE, METHODS, Fate, TraceResult, trace_rays
from .kerr.observer import Observer
from .maps.sharing import MapBaker, turned_map
from .maps.warp_map import WarpMap, bake, bake_steps
from .numerics.background import Background
from .numerics.errors import BlackHoleError, Cancelled, ImageFileError, UnstableOrbitWarning, WarpMapError
from .shot.cameras import PanoramaCamera, PerspectiveCamera
from .shot.disk import Disk
from .shot.map_parameters import (
    DEFAULT_INTERPOLATION,
    IDENTITY,
    MOTIONS,
    SUPERSAMPLING,
    WarpMapParameters,
    looking_at_hole,
    unstable_orbit_warning,
)

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
