# SPDX-License-Identifier: GPL-3.0-or-later
"""The disk of a hole without spin, and a hot spot on it, against light paths by Binet's equation.

Luminet 1979, Astron. Astrophys. 75, 228: a light path lies in a plane, where u = 1 / r obeys u'' = 3 u^2 - u; it meets
the disk at the angle where that plane does (his isoradials); the redshift is his Eq. 19. The flux is Page & Thorne's
integral (1974, Astrophys. J. 191, 499) without spin, in closed form.
"""

import dataclasses
import math

import numpy as np
import pytest
from test_thin_layer import rendered, shot

import physics
from physics.light.matter_settings import BOLOMETRIC, MatterLook
from physics.matter.surface import Surface
from physics.matter.thin_layer import thin_layer
from physics.sampling.view import View

CAMERA = 30.0
BARE = MatterLook(strands=0.0, smoke=0.0, inner_softness=0.0, outer_softness=0.0, band=BOLOMETRIC, light_travel=1.0)
STEPS = 600


def schwarzschild(degrees, size):
    parameters = dataclasses.replace(shot(*size, degrees, supersampling=1), spin=0.0, disk=physics.Disk(2, None, 18.0))
    return physics.bake(parameters), parameters


def paths(parameters):
    """Radius, azimuth, delay, redshift and cosine of emission where pixels see the disk, for the first two crossings:
    dicts of arrays (pixels,); NaN for none."""
    width, height = parameters.map_size
    y, x = (each.ravel() + 0.5 for each in np.mgrid[0:height, 0:width])
    looking = parameters.camera.directions(x, y) @ np.array(parameters.camera_to_hole).T
    place = np.array(parameters.camera_position)
    outward = place / np.linalg.norm(place)
    radial = looking @ outward
    aside = looking - radial[:, None] * outward
    sine = np.linalg.norm(aside, axis=1)
    aside /= sine[:, None]
    lapse = math.sqrt(1.0 - 2.0 / CAMERA)
    b = CAMERA * sine / lapse
    normal = np.cross(outward, aside)
    first = np.arctan2(-outward[2], aside[:, 2]) % math.pi
    first[first < 1e-9] += math.pi

    def rates(u, slope):
        return slope, 3.0 * u * u - u, 1.0 / (b * u * u * (1.0 - 2.0 * u))

    u, slope, late = np.full(len(b), 1.0 / CAMERA), -radial / sine * lapse / CAMERA, np.zeros(len(b))
    found = []
    for number in range(2):
        step = (first if number == 0 else np.full(len(b), math.pi)) / STEPS
        with np.errstate(all="ignore"):
            for _ in range(STEPS):
                k1 = rates(u, slope)
                k2 = rates(u + 0.5 * step * k1[0], slope + 0.5 * step * k1[1])
                k3 = rates(u + 0.5 * step * k2[0], slope + 0.5 * step * k2[1])
                k4 = rates(u + step * k3[0], slope + step * k3[1])
                late = late + step / 6.0 * (k1[2] + 2.0 * k2[2] + 2.0 * k3[2] + k4[2])
                u, slope = (
                    each + step / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
                    for each, a1, a2, a3, a4 in zip((u, slope), k1[:2], k2[:2], k3[:2], k4[:2], strict=True)
                )
                u = np.where((u > 0.0) & (u < 0.5), u, np.nan)
            r = 1.0 / u
            r = np.where((r > 6.0) & (r < 18.0), r, np.nan)
            # Light runs against the path: its angular momentum about the axis is -b n_z.
            g = np.sqrt(1.0 - 3.0 / r) / (1.0 + r**-1.5 * b * normal[:, 2]) / lapse
            mu = g * lapse * b * np.sqrt(1.0 - normal[:, 2] ** 2) / r
        angle = first + number * math.pi
        where = np.cos(angle)[:, None] * outward + np.sin(angle)[:, None] * aside
        found.append({"r": r, "phi": np.arctan2(where[:, 1], where[:, 0]), "late": late.copy(), "g": g, "mu": mu})
    return found


def flux(r):
    root, three, six = np.sqrt(r), math.sqrt(3.0), math.sqrt(6.0)
    log = np.log((root + three) * (six - three) / ((root - three) * (six + three)))
    return (root - six + log * three / 2.0) / ((r - 3.0) * r**2.5)


LARGEST = flux(np.linspace(6.001, 18.0, 100_000)).max()
BRIGHTNESS = np.array([0.2126, 0.7152, 0.0722])


@pytest.mark.parametrize("degrees", [10.0, 40.0])
def test_isoradials_and_flux_are_luminets(degrees):
    baked, parameters = schwarzschild(degrees, (96, 54))
    surface = Surface(dataclasses.replace(BARE, depth=1e4), parameters.disk, 0.0)
    for number, path in enumerate(paths(parameters)):
        one = baked.disk_passes[number]
        seen = (one.coverage.ravel() == 1.0) & np.isfinite(path["r"])
        assert seen.sum() > (100, 10)[number]
        assert one.radius.ravel()[seen] == pytest.approx(path["r"][seen], rel=2e-3)
        layer = thin_layer(surface, [one], View(parameters), 0.0, filtered=False).reshape(-1, 4)
        wanted = flux(path["r"]) / LARGEST * path["g"] ** 4
        bright = seen & (wanted > 0.01 * np.nanmax(wanted))
        assert layer[bright, :3] @ BRIGHTNESS == pytest.approx(wanted[bright], rel=0.03)


def test_a_hot_spots_light_curve_has_its_doppler_peaks_delays_and_second_image():
    baked, parameters = schwarzschild(12.0, (240, 135))
    radius, size, heat, depth = 9.0, 0.15, 1.0, 0.5
    look = dataclasses.replace(BARE, depth=depth, spots=1, spot_radius=radius, spot_size=size, spot_heat=heat)
    dark = rendered(baked, dataclasses.replace(look, spots=0)).light
    omega = radius**-1.5
    wholes = [each.coverage.ravel() == 1.0 for each in baked.disk_passes]
    # Pixels on rims see a part of the disk that their middles do not tell.
    even = np.logical_and.reduce(
        [whole | (each.coverage.ravel() == 0.0) for whole, each in zip(wholes, baked.disk_passes, strict=True)]
    )
    images = paths(parameters)
    found, wanted, second = [], [], []
    for share in np.linspace(0.0, 1.0, 12, endpoint=False):
        time = share * 2.0 * math.pi / omega
        lit = rendered(baked, look, time).light - dark
        found.append((lit.reshape(-1, 3)[even] @ BRIGHTNESS).sum())
        through, total = np.ones(240 * 135), []
        for path, whole in zip(images, wholes, strict=True):
            turned = path["phi"] - omega * (time - path["late"])
            turned -= 2.0 * math.pi * np.round(turned / (2.0 * math.pi))
            spot = heat * np.exp(-(turned**2 + np.log(path["r"] / radius) ** 2) / (2.0 * size**2))
            alpha = 1.0 - np.exp(-depth / path["mu"])
            light = flux(path["r"]) / LARGEST * path["g"] ** 4 * np.expm1(4.0 * spot) * alpha
            total.append(np.nansum((through * light)[whole & even]))
            through = through * np.where(whole, 1.0 - np.nan_to_num(alpha), 1.0)
        wanted.append(sum(total))
        second.append(total[1])
    wanted = np.array(wanted)
    print(found / wanted, wanted)
    # Beaming makes the curve vary; the second image is a visible part of it.
    assert wanted.max() > 3.0 * wanted.min()
    assert max(s / w for s, w in zip(second, wanted, strict=True)) > 0.02
    assert found == pytest.approx(wanted, rel=0.01, abs=0.002 * wanted.max())
