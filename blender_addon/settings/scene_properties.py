# SPDX-License-Identifier: GPL-3.0-or-later
"""How a scene's black hole is rendered: `scene.umbra`.

Files hold the numbers of enum items, not their identifiers: an item keeps its number for good
(`tests/data/saved_enums.json`).
"""

import bpy

from ..core import changes
from ..core.changes import Change
from ..core.physics_api import physics
from . import output_choice, saved_names
from .table_properties import property_of
from .typed import SceneSettings

# Accuracy -> errors of direction, radians, allowed to the tracing of a ray and to interpolation between rays.
ACCURACIES = {
    "DRAFT": (1e-4, 1e-4),
    "STANDARD": (physics.DEFAULT_TOLERANCE, physics.DEFAULT_INTERPOLATION),
    "REFERENCE": (1e-11, 0.0),
}

# Rows of `physics.SKY_SETTINGS` that are properties; the exposure is an input of the node groups only.
SKY_PROPERTIES = ("redshift_color", "redshift_brightness", "sky_temperature")

# Items of the enum `lens_rays`.
EXIT_MAP, IN_SHADER = "EXIT_MAP", "IN_SHADER"

# Items of the enum `stars`.
WITH_BUILT_IN_SKY, ALWAYS, NEVER = "AUTO", "ON", "OFF"

NO_LIMIT = 20.0
"""A limit of magnitude that leaves no star out."""

# Items of the enum `method`.
METHOD_NUMBERS = {"gauss-legendre": 0, "cash-karp": 1, "cash-karp-printed": 2}


def _is_hole(_settings: object, candidate: bpy.types.Object) -> bool:
    return candidate.umbra.is_black_hole


class UmbraSceneProperties(bpy.types.PropertyGroup):
    """How a scene's black hole is rendered."""

    active_hole: bpy.props.PointerProperty(
        name="Black Hole",
        description="The black hole that is rendered; one a scene",
        type=bpy.types.Object,
        poll=_is_hole,
        update=lambda settings, _context: _refresh(settings),
    )
    output: bpy.props.EnumProperty(
        name="Output",
        description="How the black hole comes into the picture",
        items=output_choice.items,
        default=0,  # the number: items that are asked for have no default by name
        update=lambda settings, _context: _output_changed(settings),
        options=set(),
    )
    lens_rays: bpy.props.EnumProperty(
        name="Rays",
        description="Where the camera takes its bent rays from when rendering",
        items=(
            (
                EXIT_MAP,
                "Exit Map",
                "From a baked map, where it holds; beside the shadow the camera traces them itself",
                0,
            ),
            (IN_SHADER, "No Bake", "Each ray is traced by the camera itself: nothing to bake, a slower render", 1),
        ),
        default=EXIT_MAP,
        options=set(),
    )
    sphere_radius: bpy.props.FloatProperty(
        name="Lens Sphere",
        description="Radius, in M, of the sphere around the hole where bent rays begin. Objects are seen outside of it "
        "only; the rest of the picture does not depend on it",
        default=physics.DEFAULT_LENS_RADIUS,
        min=2.0,
        soft_min=5.0,
        soft_max=50.0,
        update=lambda settings, _context: _refresh(settings),
    )
    live_preview: bpy.props.BoolProperty(
        name="Live Preview",
        description="The viewport's sky and the thumbnail follow while you move the camera or the hole",
        default=False,
        update=lambda settings, _context: _preview_changed(settings),
        options=set(),
    )
    foreground: bpy.props.PointerProperty(
        name="Foreground",
        description="Collection of the objects that are shown unlensed in front of the hole",
        type=bpy.types.Collection,
    )
    foreground_scene: bpy.props.PointerProperty(
        name="Foreground Scene",
        description="Scene of the unbent camera that renders the foreground",
        type=bpy.types.Scene,
    )
    cpu_fallback: bpy.props.BoolProperty(
        name="CPU if the GPU Cannot",
        description="Render on the CPU when the GPU cannot run camera shaders. Switched off, that is an error",
        default=True,
        options=set(),
    )
    map_folder: bpy.props.StringProperty(
        name="Warp Maps",
        description="Folder of the warp maps, one file a frame. // means beside the .blend file; a file that "
        "is not saved yet uses a temporary folder",
        default="//umbra_maps/",
        subtype="DIR_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
        update=lambda settings, _context: _refresh(settings),
    )
    map_names: bpy.props.StringProperty(
        name="Map Names",
        description="What the names of this scene's maps begin with, as of the saved file",
        options={"HIDDEN"},
    )
    supersampling: bpy.props.EnumProperty(
        name="Samples",
        description="Rays a pixel, across and down. The shadow's edge is smooth in any case; more samples "
        "smooth the finest images of the sky beside it",
        items=(
            ("1", "1 x 1", "One ray per pixel", 0),
            ("2", "2 x 2", "Four rays per pixel", 1),
            ("4", "4 x 4", "Sixteen rays per pixel", 2),
        ),
        default="1",
        update=lambda settings, _context: _refresh(settings),
        options=set(),
    )
    # Labeled Accuracy; the identifier is that of the first version.
    quality: bpy.props.EnumProperty(
        name="Accuracy",
        description="How exactly the map is made: the error of direction allowed",
        items=(
            ("DRAFT", "Draft", "1e-4 radians, about a tenth of a pixel: for trying things out", 0),
            (
                "STANDARD",
                "Standard",
                f"{physics.DEFAULT_INTERPOLATION:g} radians, a hundredth of a pixel or less: for final pictures",
                1,
            ),
            ("REFERENCE", "Reference", "Every pixel is traced, as exactly as the arithmetic allows: slow", 2),
            ("CUSTOM", "Custom", "Tolerances of your own", 3),
        ),
        default="STANDARD",
        options=set(),
    )
    tolerance: bpy.props.FloatProperty(
        name="Tolerance",
        description="Error of direction allowed to the tracing of a ray, radians",
        default=physics.DEFAULT_TOLERANCE,
        min=1e-13,
        max=1e-2,
        precision=10,
        options=set(),
    )
    interpolation: bpy.props.FloatProperty(
        name="Interpolation",
        description="Error of direction allowed where the sky is smooth and rays are interpolated, radians. "
        "0 traces every pixel",
        default=physics.DEFAULT_INTERPOLATION,
        min=0.0,
        max=1e-2,
        precision=10,
        options=set(),
    )
    method: bpy.props.EnumProperty(
        name="Method",
        description="How the rays are traced",
        items=tuple(
            (each.name, each.label, each.description, METHOD_NUMBERS[each.name]) for each in physics.METHODS.values()
        ),
        default=physics.DEFAULT_METHOD,
        options=set(),
    )
    environment_source: bpy.props.EnumProperty(
        name="Sky",
        description="What the sky around the hole is made of",
        items=(
            (
                "WORLD",
                "World",
                "The Environment Texture of the scene's World, with its rotation and strength",
                0,
            ),
            ("IMAGE", "Image", "An equirectangular image chosen here", 1),
        ),
        default="WORLD",
        update=lambda settings, _context: _refresh(settings),
        options=set(),
    )
    environment_image: bpy.props.PointerProperty(
        name="Sky Image",
        description="An equirectangular picture of the whole sky",
        type=bpy.types.Image,
        update=lambda settings, _context: _refresh(settings),
    )
    disk_passes: bpy.props.BoolProperty(
        name="Disk Passes",
        description="Bake also where the disk's light comes from, a file per image of the disk: radius, azimuth, "
        "frequency ratio and coverage, for compositing",
        default=False,
        update=lambda settings, _context: _refresh(settings),
        options=set(),
    )
    stars: bpy.props.EnumProperty(
        name="Stars",
        description="Whether stars are drawn as points, at their exact places and of one size at any magnification. "
        "The built-in sky then has no stars in its texture",
        items=(
            (WITH_BUILT_IN_SKY, "With Built-in Sky", "Points with the built-in sky, none with others", 0),
            (ALWAYS, "On", "Points over any sky, one of your own as well", 1),
            (NEVER, "Off", "No points; the stars of the sky's picture are bent with it", 2),
        ),
        default=WITH_BUILT_IN_SKY,
        update=lambda settings, _context: _refresh(settings),
        options=set(),
    )
    star_limit: bpy.props.FloatProperty(
        name="Faintest Magnitude",
        description="Stars that are fainter are left out. The eye sees to 6.5, the built-in catalog goes to 8; 20 is "
        "no limit",
        default=NO_LIMIT,
        min=-2.0,
        max=NO_LIMIT,
        soft_max=9.0,
        precision=1,
        options=set(),
    )
    star_catalog: bpy.props.StringProperty(
        name="Catalog",
        description="Table of stars (CSV): right ascension and declination in degrees, magnitude, B-V. Empty is the "
        "built-in catalog of 41,411 stars",
        subtype="FILE_PATH",
        options={"PATH_SUPPORTS_BLEND_RELATIVE"},
    )
    hide_behind: bpy.props.BoolProperty(
        name="Hide Behind the Hole",
        description="Objects behind the hole are hidden where its shadow is in front of them, by the depth pass. "
        "Outside of the shadow they are drawn unbent",
        default=False,  # files of before have the picture of before; Add > Black Hole switches it on
        update=lambda settings, _context: _refresh(settings),
        options=set(),
    )
    auto_bake: bpy.props.BoolProperty(
        name="Bake When Rendering",
        description="Rendering bakes by itself each warp map that is missing or out of date. Switched off, "
        "such a frame is an error",
        default=True,
        options=set(),
    )


for _name in SKY_PROPERTIES:
    UmbraSceneProperties.__annotations__[_name] = property_of(
        physics.SKY_SETTINGS[_name], lambda settings, _context: _refresh(settings)
    )
UmbraSceneProperties.__annotations__["sky_filter"] = property_of(
    physics.SKY_FILTER, lambda settings, _context: _refresh(settings)
)
UmbraSceneProperties.__annotations__["glare"] = property_of(
    physics.GLARE, lambda settings, _context: _refresh(settings)
)
saved_names.accept(UmbraSceneProperties, saved_names.SCENE)


def _refresh(settings: UmbraSceneProperties) -> None:
    changes.notify(Change.SCENE, settings.id_data)


def _output_changed(settings: UmbraSceneProperties) -> None:
    changes.notify(Change.OUTPUT, settings.id_data)


def _preview_changed(settings: UmbraSceneProperties) -> None:
    changes.notify(Change.PREVIEW, settings.id_data)


def looks_of(settings: SceneSettings) -> int:
    """The number of looks at the sky per pixel, from the chosen filter; 0 where it is not filtered."""
    return int(next(each.value for each in physics.SKY_FILTER.choices if each.identifier == settings.sky_filter))


def glare_of(settings: SceneSettings) -> int:
    """The kind of glare that is chosen, one of `physics.GLARES`; 0 where there is none."""
    return int(next(each.value for each in physics.GLARE.choices if each.identifier == settings.glare))


def tolerances_of(settings: SceneSettings) -> tuple[float, float]:
    """The errors of direction allowed to tracing and to interpolation, radians, from the chosen accuracy."""
    return ACCURACIES.get(settings.quality, (settings.tolerance, settings.interpolation))


CLASSES = (UmbraSceneProperties,)


def register() -> None:
    """Attach the properties to scenes."""
    bpy.types.Scene.umbra = bpy.props.PointerProperty(type=UmbraSceneProperties)


def unregister() -> None:
    """Detach the properties; their values stay in the file."""
    del bpy.types.Scene.umbra
