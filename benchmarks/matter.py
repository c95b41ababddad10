# SPDX-License-Identifier: GPL-3.0-or-later
"""The light of matter: seconds of processor time per layer, and how far one ray per pixel is from sixty-four."""

# isort: off
# isort: on

import dataclasses
import math
import time
from collections.abc import Callable, Iterator

import numpy as np

import physics
from physics.matter.surface import Surface
from physics.matter.thin_layer import thin_layer
from physics.sampling.view import View

SPIN, RADIUS, OUTER, FIELD_OF_VIEW = 0.9, 30.0, 18.0, math.radians(40.0)
THICKNESS = 0.1
FINER = 8


def lines(repeats: int) -> Iterator[str]:
    """Layers in full HD and at preview size, and errors at 480 x 270 from 5 degrees."""
    film = physics.MATTER_PRESETS["gargantua"]
    thick = dataclasses.replace(film, thickness=THICKNESS, depth=12.0)
    yield "light of matter, spin 0.9, 30 M, disk to 18 M, processor seconds"
    for width, height, degrees in ((1920, 1080, 10.0), (480, 270, 10.0)):
        parameters = _shot(width, height, degrees)
        baked = physics.bake(parameters)
        covered = np.mean([each.coverage > 0.0 for each in baked.disk_passes]) * len(baked.disk_passes)
        thin = _best(lambda baked=baked: _lit(baked, film), repeats)
        both = _best(
            lambda parameters=parameters: physics.render_matter(physics.LightParameters(parameters, film)), repeats
        )
        yield f"  {width} x {height}, {100 * covered:.0f} % covered: thin {thin:.3f} s, with its bake {both:.3f} s"
    for width, height, degrees in ((1920, 1080, 5.0), (480, 270, 5.0)):
        parameters = physics.LightParameters(_shot(width, height, degrees), thick)
        layer = physics.render_matter(parameters)
        seconds = _best(lambda parameters=parameters: physics.render_matter(parameters), min(repeats, 2))
        yield f"  {width} x {height}, {100 * (layer.transmittance < 0.99).mean():.0f} % covered: thick {seconds:.2f} s"
    small, large = _shot(480, 270, 5.0), _shot(480 * FINER, 270 * FINER, 5.0)
    surface = Surface(film, physics.Disk(3, None, OUTER), SPIN)
    for number, (one, other) in enumerate(
        zip(physics.bake(small).disk_passes, physics.bake(large).disk_passes, strict=True), start=1
    ):
        found = thin_layer(surface, [one], View(small), 0.0)[..., :3]
        wanted = thin_layer(surface, [other], View(large), 0.0, filtered=False)[..., :3]
        wanted = wanted.reshape(270, FINER, 480, FINER, 3).mean(axis=(1, 3))
        error, light = np.abs(found - wanted).sum() / wanted.sum(), found.sum() / wanted.sum()
        yield f"  480 x 270 from 5 degrees, image {number}: error {100 * error:.1f} %, light {100 * light:.1f} %"


def _shot(width: int, height: int, degrees: float) -> physics.WarpMapParameters:
    angle = math.radians(degrees)
    place = (RADIUS * math.cos(angle), 0.0, RADIUS * math.sin(angle))
    camera = physics.PerspectiveCamera.from_field_of_view(width, height, FIELD_OF_VIEW)
    disk = physics.Disk(3, None, OUTER)
    return physics.WarpMapParameters(SPIN, camera, place, physics.looking_at_hole(place), disk=disk)


def _lit(baked: physics.WarpMap, look: physics.MatterLook) -> physics.LightLayer:
    view = physics.WarpMapParameters.from_metadata(baked.metadata["parameters"])
    return physics.render_matter(physics.LightParameters(view, look), physics.DiskPasses.of(baked))


def _best(work: Callable[[], object], repeats: int) -> float:
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)
