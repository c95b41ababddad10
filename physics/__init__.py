# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays of light around a spinning (Kerr) black hole, and the maps and pictures made of them.

Hands on the documented API, which is all that the add-on and other programs use. The rooms, from camera and hole to a
file: `shot`, `kerr`, `geodesics`, `sampling`, `disk_passes`, `maps`, `files`; `light`, `matter` and `reference` turn
maps into pictures, `accuracy_check` judges them, `cli` is the command line, `images` and `numerics` serve all.
"""

from .numerics import interrupts  # noqa: F401  before all that takes time

# isort: split

from .accuracy_check.accuracy import (
    DEFAULT_ENVIRONMENT_WIDTH,
    accuracy_steps,
    check_accuracy,
)
from .accuracy_check.accuracy import DEFAULT_SAMPLES as DEFAULT_ACCURACY_SAMPLES
from .accuracy_check.accuracy_report import AccuracyReport, DiskAccuracy
from .disk_passes.disk_pass import DiskPass
from .files.companions import COMPANION_MARKS, files_beside, write_map_files
from .files.disk_pass_file import FORMAT as DISK_PASS_FORMAT
from .files.disk_pass_file import (
    find_pass,
    pass_path,
    read_disk_pass,
    read_disk_passes,
    write_disk_pass,
    write_disk_passes,
)
from .files.exit_map_file import FORMAT as EXIT_MAP_FORMAT
from .files.exit_map_file import read_exit_map, read_exit_map_metadata, write_exit_map
from .files.footprint_file import FORMAT as FOOTPRINT_FORMAT
from .files.footprint_file import footprint_path, read_footprint, write_footprint
from .files.light_layer_file import FORMAT as LIGHT_LAYER_FORMAT
from .files.light_layer_file import light_layer_path, read_light_layer, write_light_layer
from .files.map_check import Finding as MapFinding
from .files.map_check import State as MapState
from .files.map_check import check_map
from .files.map_file import MapFormat, MapOrigin
from .files.star_file import FORMAT as STARS_FORMAT
from .files.star_file import read_stars, stars_path, write_stars
from .files.warp_map_file import FORMAT as WARP_MAP_FORMAT
from .files.warp_map_file import read_warp_map, read_warp_map_metadata, write_warp_map
from .files.world_map_file import FORMAT as WORLD_MAP_FORMAT
from .files.world_map_file import read_world_map, read_world_map_metadata, write_world_map
from .geodesics.disk_tracer import DEFAULT_CROSSINGS, MOST_CROSSINGS, DiskResult, trace_disk
from .geodesics.tracer import DEFAULT_METHOD, DEFAULT_TOLERANCE, METHODS, Fate, TraceResult, trace_rays
from .images.exr import read_exr, read_exr_header, write_exr
from .images.exr import replacing as replacing_file
from .images.exr import target_of as temporary_target
from .images.exr_library import exr_library
from .images.picture import linear_from_srgb
from .images.png import write_png
from .kerr.metric import ergosphere_radius, horizon_radius, isco_radius, photon_orbit_radius
from .kerr.observer import Observer, local_velocity
from .kerr.orbiting_matter import matter_direction, orbital_frequency, redshift_factor
from .kerr.shadow_outline import shadow_outline
from .light import color as color_law
from .light.black_body import SECOND_RADIATION_CONSTANT
from .light.black_body import color as black_body_color
from .light.black_body import luminance as black_body_luminance
from .light.black_body import rgb as black_body_rgb
from .light.color import DEFAULT_TEMPERATURE as DEFAULT_SKY_TEMPERATURE
from .light.color import redshift_gain
from .light.disk_flux import PROFILES as DISK_PROFILES
from .light.disk_flux import page_thorne_flux
from .light.disk_flux import peak_flux as peak_disk_flux
from .light.disk_flux import peak_radius as peak_disk_radius
from .light.disk_flux import relative_flux as relative_disk_flux
from .light.glare import GLARES
from .light.matter_settings import (
    MATTER_PRESET_TABLE,
    MATTER_PRESETS,
    MATTER_SETTINGS,
    MatterLook,
    MatterPreset,
)
from .light.milky_way import galactic_axes
from .light.settings import Choice, Setting
from .light.sky_levels import FEWEST_ROWS as FEWEST_SKY_ROWS
from .light.sky_levels import LARGEST_HALF, SkyLevels, sky_levels
from .light.sky_levels import MARGIN as SKY_LEVEL_MARGIN
from .light.sky_settings import GLARE, SKY_FILTER, SKY_SETTINGS
from .light.sky_settings import RENDER_ARGUMENTS as SKY_ARGUMENTS
from .light.star_sky import Stars, load_stars, milky_way_sky, star_sky
from .maps.disk_passes import DiskPasses
from .maps.exit_map import ExitMap, bake_exit_map, bake_exit_map_steps
from .maps.footprint import footprint
from .maps.lens import DEFAULT_SPHERE_RADIUS as DEFAULT_LENS_RADIUS
from .maps.lens import LensNumbers
from .maps.sharing import MapBaker, turned_map
from .maps.warp_map import WarpMap, bake, bake_steps
from .maps.world_map import FINAL as WORLD_MAP_GRID
from .maps.world_map import HEADER_PARTS as WORLD_MAP_HEADER_PARTS
from .maps.world_map import PREVIEW as WORLD_MAP_PREVIEW_GRID
from .maps.world_map import SHORTEST as WORLD_MAP_SHORTEST
from .maps.world_map import STAMP as WORLD_MAP_STAMP
from .maps.world_map import WorldMap
from .maps.world_map import world_map_steps as bake_world_map_steps
from .maps.world_map import world_parameters as world_map_parameters
from .matter.light_layer import LightBaker, LightLayer, LightParameters, clock_rate, light_steps, render_matter
from .matter.mean_light import disk_radiance
from .matter.picture import Picture
from .matter.world_light import FINAL as WORLD_LIGHT_GRID
from .matter.world_light import PREVIEW as WORLD_LIGHT_PREVIEW_GRID
from .matter.world_light import world_light_parameters
from .numerics.background import Background
from .numerics.errors import BlackHoleError, Cancelled, ImageFileError, UnstableOrbitWarning, WarpMapError
from .numerics.work import drain, share_of
from .reference.glare import add_glare
from .reference.reference_render import (
    ANGLE_SLACK,
    LARGEST_ONE_PLUS_Z,
    SMALLEST_ONE_PLUS_Z,
    ReferencePicture,
)
from .reference.reference_render import HALVE_ABOVE as RESIZE_HALVE_ABOVE
from .reference.reference_render import MAGENTA as INVALID_MAP_COLOR
from .reference.reference_render import over_sky as disk_over_sky
from .reference.reference_render import render as render_reference
from .shot.cameras import Camera, HolePanorama, PanoramaCamera, PerspectiveCamera
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
from .stars.catalog_file import catalog_digest, read_star_catalog
from .stars.star_layer import StarBaker, StarLayer
from .stars.star_settings import StarParameters, StarSettings, star_view

__all__ = [
    "ANGLE_SLACK",
    "COMPANION_MARKS",
    "DEFAULT_ACCURACY_SAMPLES",
    "DEFAULT_CROSSINGS",
    "DEFAULT_ENVIRONMENT_WIDTH",
    "DEFAULT_INTERPOLATION",
    "DEFAULT_LENS_RADIUS",
    "DEFAULT_METHOD",
    "DEFAULT_SKY_TEMPERATURE",
    "DEFAULT_TOLERANCE",
    "DISK_PASS_FORMAT",
    "DISK_PROFILES",
    "EXIT_MAP_FORMAT",
    "FEWEST_SKY_ROWS",
    "FOOTPRINT_FORMAT",
    "GLARE",
    "GLARES",
    "IDENTITY",
    "INVALID_MAP_COLOR",
    "LARGEST_HALF",
    "LARGEST_ONE_PLUS_Z",
    "LIGHT_LAYER_FORMAT",
    "MATTER_PRESETS",
    "MATTER_PRESET_TABLE",
    "MATTER_SETTINGS",
    "METHODS",
    "MOST_CROSSINGS",
    "MOTIONS",
    "RESIZE_HALVE_ABOVE",
    "SECOND_RADIATION_CONSTANT",
    "SKY_ARGUMENTS",
    "SKY_FILTER",
    "SKY_LEVEL_MARGIN",
    "SKY_SETTINGS",
    "SMALLEST_ONE_PLUS_Z",
    "STARS_FORMAT",
    "SUPERSAMPLING",
    "WARP_MAP_FORMAT",
    "WORLD_LIGHT_GRID",
    "WORLD_LIGHT_PREVIEW_GRID",
    "WORLD_MAP_FORMAT",
    "WORLD_MAP_GRID",
    "WORLD_MAP_HEADER_PARTS",
    "WORLD_MAP_PREVIEW_GRID",
    "WORLD_MAP_SHORTEST",
    "WORLD_MAP_STAMP",
    "AccuracyReport",
    "Background",
    "BlackHoleError",
    "Camera",
    "Cancelled",
    "Choice",
    "Disk",
    "DiskAccuracy",
    "DiskPass",
    "DiskPasses",
    "DiskResult",
    "ExitMap",
    "Fate",
    "HolePanorama",
    "ImageFileError",
    "LensNumbers",
    "LightBaker",
    "LightLayer",
    "LightParameters",
    "MapBaker",
    "MapFinding",
    "MapFormat",
    "MapOrigin",
    "MapState",
    "MatterLook",
    "MatterPreset",
    "Observer",
    "PanoramaCamera",
    "PerspectiveCamera",
    "Picture",
    "ReferencePicture",
    "Setting",
    "SkyLevels",
    "StarBaker",
    "StarLayer",
    "StarParameters",
    "StarSettings",
    "Stars",
    "TraceResult",
    "UnstableOrbitWarning",
    "WarpMap",
    "WarpMapError",
    "WarpMapParameters",
    "WorldMap",
    "accuracy_steps",
    "add_glare",
    "bake",
    "bake_exit_map",
    "bake_exit_map_steps",
    "bake_steps",
    "bake_world_map_steps",
    "black_body_color",
    "black_body_luminance",
    "black_body_rgb",
    "catalog_digest",
    "check_accuracy",
    "check_map",
    "clock_rate",
    "color_law",
    "disk_over_sky",
    "disk_radiance",
    "drain",
    "ergosphere_radius",
    "exr_library",
    "files_beside",
    "find_pass",
    "footprint",
    "footprint_path",
    "galactic_axes",
    "horizon_radius",
    "isco_radius",
    "light_layer_path",
    "light_steps",
    "linear_from_srgb",
    "load_stars",
    "local_velocity",
    "looking_at_hole",
    "matter_direction",
    "milky_way_sky",
    "orbital_frequency",
    "page_thorne_flux",
    "pass_path",
    "peak_disk_flux",
    "peak_disk_radius",
    "photon_orbit_radius",
    "read_disk_pass",
    "read_disk_passes",
    "read_exit_map",
    "read_exit_map_metadata",
    "read_exr",
    "read_exr_header",
    "read_footprint",
    "read_light_layer",
    "read_star_catalog",
    "read_stars",
    "read_warp_map",
    "read_warp_map_metadata",
    "read_world_map",
    "read_world_map_metadata",
    "redshift_factor",
    "redshift_gain",
    "relative_disk_flux",
    "render_matter",
    "render_reference",
    "replacing_file",
    "shadow_outline",
    "share_of",
    "sky_levels",
    "star_sky",
    "star_view",
    "stars_path",
    "temporary_target",
    "trace_disk",
    "trace_rays",
    "turned_map",
    "unstable_orbit_warning",
    "world_light_parameters",
    "world_map_parameters",
    "write_disk_pass",
    "write_disk_passes",
    "write_exit_map",
    "write_exr",
    "write_footprint",
    "write_light_layer",
    "write_map_files",
    "write_png",
    "write_stars",
    "write_warp_map",
    "write_world_map",
]
