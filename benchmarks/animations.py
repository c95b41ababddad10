# SPDX-License-Identifier: GPL-3.0-or-later
"""What an animation costs: frames that share their rays, and frames that do not."""

# isort: off
import measuring  # before numpy
# isort: on

import dataclasses
import functools
import math
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from measuring import Row

import physics
from physics import drain

SIZE = (1920, 1080)

Frames = list[physics.WarpMapParameters]

# Spin and radius of the camera's place: the scene of the other numbers, and an ordinary one.
PLACES = ((measuring.SPIN, measuring.RADIUS), (0.9, 22.0))


def rows(frames: int, orbit_frames: int) -> Iterator[Row | str]:
    orbit = moves(orbit_frames, *PLACES[0])["circular orbit, tracking"]
    with tempfile.TemporaryDirectory() as folder:
        seconds = timed(lambda: bake_and_write(orbit, Path(folder)))
        yield row(f"{orbit_frames} frames of the orbit, written", orbit, seconds)
        one = physics.bake(orbit[0])
        seconds = timed(lambda: [physics.write_warp_map(Path(folder) / "map.exr", one) for _ in orbit])
        yield row(f"{orbit_frames} times writing a map", orbit, seconds)
    for spin, radius in PLACES:
        yield f"{frames} frames at spin {spin:g}, r = {radius:g} M, together and each alone:"
        for name, shots in moves(frames, spin, radius).items():
            yield from together_and_alone(name, shots)


def row(name: str, shots: Frames, seconds: float) -> Row:
    return Row(name, seconds, len(shots), "frames/s")


def moves(frames: int, spin: float, radius: float) -> dict[str, Frames]:
    """Camera moves: the frames of the first share their rays, those of the others do not."""
    share = np.linspace(0.0, 1.0, frames)
    shot = functools.partial(measuring.shot, *SIZE, spin=spin, radius=radius)
    return {
        "circular orbit, tracking": [shot(azimuth=2.0 * math.pi * part) for part in share],
        "turn of the camera": [turned(shot(), 0.5 * part) for part in share],
        "zoom": [shot(camera=physics.PerspectiveCamera.from_field_of_view(*SIZE, 1.0 - 0.5 * part)) for part in share],
        "change of speed": [shot(motion="velocity", velocity=(0.0, 0.6 * part, 0.0)) for part in share],
        "move in r and theta": [raised(shot(radius=radius * (1.0 + 0.4 * part)), 0.5 * part) for part in share],
    }


def turned(parameters: physics.WarpMapParameters, angle: float) -> physics.WarpMapParameters:
    cosine, sine = math.cos(angle), math.sin(angle)
    turn = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
    return dataclasses.replace(parameters, camera_to_hole=(np.array(parameters.camera_to_hole) @ turn).tolist())


def raised(parameters: physics.WarpMapParameters, elevation: float) -> physics.WarpMapParameters:
    position = (parameters.radius * math.cos(elevation), 0.0, parameters.radius * math.sin(elevation))
    return dataclasses.replace(parameters, camera_position=position, camera_to_hole=physics.looking_at_hole(position))


def together_and_alone(name: str, shots: Frames) -> Iterator[Row]:
    """Each frame is baked both ways, one after the other, so that whatever else the machine does hits both."""
    baker = physics.MapBaker()
    seconds, rays = np.zeros(2), np.zeros(2, dtype=int)
    worst = 0.0, 0.0
    for each in shots:
        start = time.perf_counter()
        together = drain(baker.steps(each))
        middle = time.perf_counter()
        alone = physics.bake(each)
        seconds += middle - start, time.perf_counter() - middle
        rays += together.counts["rays"], alone.counts["rays"]
        errors = measuring.map_errors(together, alone)
        worst = max(worst[0], errors[0]), max(worst[1], errors[1])
    for i, label in enumerate(("together", "each alone")):
        line = dataclasses.replace(row(f"    {name}: {label}", shots, seconds[i]), rays=int(rays[i]))
        yield dataclasses.replace(line, typical=worst[0], largest=worst[1]) if i == 0 else line


def bake_and_write(shots: Frames, folder: Path) -> None:
    """As the extension does it: a map is written while the next one is traced."""
    baker = physics.MapBaker()
    with physics.Background() as writing:
        for number, each in enumerate(shots):
            warp_map = drain(baker.steps(each))
            writing.start(functools.partial(physics.write_warp_map, folder / f"{number % 10}.exr", warp_map))


def timed(work: Callable[[], object]) -> float:
    return measuring.best_time(work, 1)
