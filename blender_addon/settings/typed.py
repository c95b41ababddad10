# SPDX-License-Identifier: GPL-3.0-or-later
"""The types of the settings: what `object.umbra`, its `disk` and `scene.umbra` hold.

Blender makes properties of annotations that are calls, which a type checker cannot read, so they are declared here as
well. A test compares the two.
"""

from typing import TYPE_CHECKING

import bpy

if TYPE_CHECKING:
    from bpy.types import PropertyGroup as _Group
else:
    _Group = object  # these classes are not Blender's


class DiskSettings(_Group):
    """What `UmbraDiskProperties` holds; of the rows of `physics.MATTER_SETTINGS`, those that code asks for by name."""

    enabled: bool
    inner_at_isco: bool
    inner_radius: float
    outer_radius: float
    retrograde: bool
    crossings: int
    profile: str
    turning_speed: float
    texture: bpy.types.Image | None
    texture_use: str
    opacity: float
    tint: tuple[float, float, float]
    exposure: float
    thickness: float
    gap_depth: float
    spots: int
    light: bool
    light_strength: float
    look_version: int
    innermost_orbit: float


class HoleSettings(_Group):
    """What `UmbraHoleProperties` holds."""

    is_black_hole: bool
    spin: float
    mass_scale: float
    motion: str
    speed_of_light: float
    disk: DiskSettings


class SceneSettings(_Group):
    """What `UmbraSceneProperties` holds."""

    active_hole: bpy.types.Object | None
    output: str
    lens_rays: str
    sphere_radius: float
    redshift_color: float
    redshift_brightness: float
    sky_temperature: float
    sky_filter: str
    glare: str
    live_preview: bool
    foreground: bpy.types.Collection | None
    foreground_scene: bpy.types.Scene | None
    cpu_fallback: bool
    map_folder: str
    map_names: str
    supersampling: str
    quality: str
    tolerance: float
    interpolation: float
    method: str
    environment_source: str
    environment_image: bpy.types.Image | None
    disk_passes: bool
    stars: str
    star_limit: float
    star_catalog: str
    hide_behind: bool
    auto_bake: bool
