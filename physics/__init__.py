# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays of light around a spinning (Kerr) black hole, and the warp maps made of them."""

from .cameras import PanoramaCamera, PerspectiveCamera
from .errors import BlackHoleError, Cancelled, ImageFileError, UnstableOrbitWarning, WarpMapError
from .observer import Observer
from .sharing import turned_map
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
    "DEFAULT_INTERPOLATION",
    "DEFAULT_METHOD",
    "DEFAULT_TOLERANCE",
    "IDENTITY",
    "METHODS",
    "MOTIONS",
    "SUPERSAMPLING",
    "BlackHoleError",
    "Cancelled",
    "Fate",
    "ImageFileError",
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
    "read_warp_map",
    "read_warp_map_metadata",
    "trace_rays",
    "turned_map",
    "unstable_orbit_warning",
    "write_warp_map",
]
