# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays of light around a spinning (Kerr) black hole, and the warp maps made of them."""

from .errors import BlackHoleError, Cancelled, ImageFileError, UnstableOrbitWarning, WarpMapError
from .observer import Observer
from .tracer import DEFAULT_METHOD, DEFAULT_TOLERANCE, METHODS, Fate, TraceResult, trace_rays
