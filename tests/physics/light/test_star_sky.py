# SPDX-License-Identifier: GPL-3.0-or-later
"""The panorama of the real stars against published positions, magnitudes and colors."""

import math

import numpy as np
import pytest
from galaxy_model import unresolved_glow

from physics import BlackHoleError
from physics.light.black_body import LUMINANCE_WEIGHTS
from physics.light.black_body import color as black_body_color
from physics.light.milky_way import BAND, BRIGHTNESS, diffuse_light, galactic_axes
from physics.light.star_color import temperature_from_color_index
from physics.light.star_sky import (
    ZERO_MAGNITUDE,
    Stars,
    draw_stars,
    load_stars,
    row_solid_angles,
    star_sky,
    texel_directions,
)

HEIGHT = 1024

# Right ascension and declination (degrees, J2000) and V: SIMBAD.
KNOWN = {
    "Sirius": (101.287155, -16.716116, -1.46),
    "Betelgeuse": (88.792939, 7.407064, 0.42),
    "Polaris": (37.954561, 89.264109, 2.02),
    "Achernar": (24.428523, -57.236753, 0.46),  # one of the southern sky
    "Alpheratz": (2.096916, 29.090431, 2.06),  # close to right ascension 0, the middle of the panorama
}

# One magnitude 10 star per square degree, in magnitude 0 stars per steradian.
S10 = 1e-4 / math.radians(1.0) ** 2


def one_star(ra_degrees: float, dec_degrees: float, b_v: float = 0.45) -> Stars:
    ra, dec = np.radians([[ra_degrees], [dec_degrees]])
    return Stars(ra, dec, np.array([0.0]), np.array([b_v]))


def direction(ra_degrees: float, dec_degrees: float) -> np.ndarray:
    ra, dec = np.radians([ra_degrees, dec_degrees])
    return np.array([np.cos(dec) * np.cos(ra), np.cos(dec) * np.sin(ra), np.sin(dec)])


def light(picture: np.ndarray) -> np.ndarray:
    """Light of each texel: luminance times solid angle."""
    return picture.astype(np.float64) @ LUMINANCE_WEIGHTS * row_solid_angles(len(picture))[:, np.newaxis]


@pytest.fixture(scope="module")
def stars_only() -> np.ndarray:
    return star_sky(HEIGHT, galactic_glow=False)


@pytest.fixture(scope="module")
def directions() -> np.ndarray:
    return texel_directions(np.arange(HEIGHT), HEIGHT)


@pytest.mark.parametrize("height", [16, 100, 512])
def test_all_the_light_of_the_catalog_is_there(height: int) -> None:
    expected = np.sum(10.0 ** (-0.4 * load_stars().magnitude)) * ZERO_MAGNITUDE
    picture = star_sky(height, galactic_glow=False)
    assert picture.shape == (height, 2 * height, 3)
    assert picture.dtype == np.float32
    assert light(picture).sum() == pytest.approx(expected, rel=1e-6)


def test_magnitude_limit_leaves_out_the_faint_stars() -> None:
    assert len(load_stars().magnitude) == 41411
    bright = load_stars(2.0)
    assert bright.magnitude.max() <= 2.0
    expected = bright.flux.sum() * ZERO_MAGNITUDE
    assert light(star_sky(64, magnitude_limit=2.0, galactic_glow=False)).sum() == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("name", KNOWN)
def test_known_stars_are_where_they_belong(name: str, stars_only: np.ndarray, directions: np.ndarray) -> None:
    ra, dec, magnitude = KNOWN[name]
    star = direction(ra, dec)
    near = directions @ star > math.cos(4.0 * math.pi / HEIGHT)
    share = light(stars_only)[near]
    assert share.sum() == pytest.approx(10.0 ** (-0.4 * magnitude) * ZERO_MAGNITUDE, rel=0.1)
    centroid = share @ directions[near]
    off = math.acos(min(1.0, centroid @ star / np.linalg.norm(centroid)))
    assert off < 0.2 * math.pi / HEIGHT
    # Blender's own mapping of that direction to the picture, in texels from the left and the top.
    u, v = 0.5 - math.atan2(star[1], star[0]) / (2 * math.pi), 0.5 + math.asin(star[2]) / math.pi
    row, column = int((1.0 - v) * HEIGHT), int(u * 2 * HEIGHT)
    brightest = np.where(near, stars_only @ LUMINANCE_WEIGHTS, 0.0)
    found_row, found_column = np.unravel_index(np.argmax(brightest), brightest.shape)
    assert abs(found_row - row) <= 1
    assert abs(found_column - column) * math.cos(math.radians(dec)) <= 1


@pytest.mark.parametrize(
    ("ra", "dec"),
    [(0, 0), (180, 10), (77, -45.3), (200, 85), (300, -89.5), (10, 89.97), (123, 90), (0, -90)],
)
def test_a_star_is_round_and_keeps_its_light_everywhere(ra: float, dec: float, directions: np.ndarray) -> None:
    picture = draw_stars(one_star(ra, dec), HEIGHT, star_width=2.0)
    share = light(picture)
    assert share.sum() == pytest.approx(1.0, rel=1e-12)
    star = direction(ra, dec)
    east = np.array([-math.sin(math.radians(ra)), math.cos(math.radians(ra)), 0.0])
    across = directions @ east * HEIGHT / math.pi
    up = directions @ np.cross(star, east) * HEIGHT / math.pi
    assert np.sum(share * across**2) == pytest.approx(4.0, rel=0.02)
    assert np.sum(share * up**2) == pytest.approx(4.0, rel=0.02)
    assert abs(np.sum(share * across * up)) < 0.02


def test_the_seam_is_invisible() -> None:
    on_the_seam = draw_stars(one_star(180.0, 20.0), 256)
    np.testing.assert_allclose(on_the_seam, on_the_seam[:, ::-1], rtol=1e-9, atol=1e-9 * on_the_seam.max())
    assert on_the_seam[:, 0].max() > 0.3 * on_the_seam.max()
    # The glow goes on across the seam as smoothly as anywhere else.
    glow = diffuse_light(texel_directions(np.arange(256), 256)) @ LUMINANCE_WEIGHTS
    steps = np.abs(np.diff(glow, axis=1, append=glow[:, :1])).mean(axis=0)
    assert steps[-1] < 1.5 * np.median(steps)


def test_hot_stars_are_blue_and_cool_stars_are_red() -> None:
    # Rigel, Sirius, the Sun, Arcturus, Betelgeuse
    colors = black_body_color(temperature_from_color_index([-0.03, 0.01, 0.65, 1.23, 1.85]))
    blue_over_red = colors[:, 2] / colors[:, 0]
    assert np.all(np.diff(blue_over_red) < 0.0)
    assert blue_over_red[0] > 1.0 > blue_over_red[2]
    np.testing.assert_allclose(colors @ LUMINANCE_WEIGHTS, 1.0, rtol=1e-12)


def test_temperature_of_the_sun() -> None:
    # B-V = 0.65 gives 5778 K (IAU nominal 5772 K).
    assert temperature_from_color_index(0.65) == pytest.approx(5772.0, abs=20.0)
    assert temperature_from_color_index(math.nan) == pytest.approx(6600.0, abs=50.0)


@pytest.mark.parametrize(
    ("temperature", "x", "y"),
    # Chromaticities of Planckian radiators: Wyszecki & Stiles 1982, "Color Science", table 1(3.11).
    [(3000.0, 0.4369, 0.4041), (5000.0, 0.3451, 0.3516), (6500.0, 0.3135, 0.3237), (10000.0, 0.2807, 0.2884)],
)
def test_black_body_chromaticity(temperature: float, x: float, y: float) -> None:
    rec709_to_xyz = np.array(  # IEC 61966-2-1
        [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    )
    tristimulus = rec709_to_xyz @ black_body_color(temperature)
    np.testing.assert_allclose(tristimulus[:2] / tristimulus.sum(), [x, y], atol=0.003)


def test_extreme_stars_have_a_color_within_the_gamut() -> None:
    colors = black_body_color(temperature_from_color_index([-0.4, 5.46]))
    assert np.all(np.isfinite(colors))
    assert np.all(colors >= 0.0)
    assert colors[1, 2] == 0.0


def test_galactic_axes_point_to_the_center_and_the_pole() -> None:
    axes = galactic_axes()
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-15)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    # Center 17h 45m 37.2s -28 56' 10", pole 12h 51m 26.3s +27 07' 42" (J2000).
    np.testing.assert_allclose(axes[0], direction(266.4050, -28.9362), atol=2e-5)
    np.testing.assert_allclose(axes[2], direction(192.8595, 27.1283), atol=2e-5)


def galactic(longitude: float, latitude: float) -> np.ndarray:
    """Equatorial direction of galactic coordinates in degrees."""
    return direction(longitude, latitude) @ galactic_axes()


def seen_around(longitude: float, latitude: float, reach: float) -> np.ndarray:
    """Mean light within some degrees of a place in galactic coordinates."""
    across, up = np.meshgrid(np.linspace(-reach, reach, 41), np.linspace(-reach, reach, 41))
    places = [galactic(longitude + x, latitude + y) for x, y in zip(across.ravel(), up.ravel(), strict=True)]
    return diffuse_light(np.array(places)).mean(axis=0)


def test_the_milky_way_has_the_sky_s_brightness() -> None:
    """Integrated starlight: hundreds of S10 in the plane, most near the center, little at the poles.

    Leinert et al. 1998, A&AS 127, 1, section 10: 20 to 60 S10 at the poles, of which the catalog's stars are half.
    """
    degrees = np.arange(-89.5, 90.0)
    band = degrees[np.abs(degrees) < math.degrees(BAND)]
    light = np.array(
        [[diffuse_light(galactic(length, b)) @ LUMINANCE_WEIGHTS for length in range(0, 360, 2)] for b in band]
    )
    mean = np.average(light.mean(axis=1), weights=np.cos(np.radians(band)))
    assert mean == pytest.approx(BRIGHTNESS, rel=0.03)  # at 1 and 2 degrees
    assert 100.0 < mean / S10 < 400.0
    assert light.std() / light.mean() > 0.35
    assert diffuse_light(galactic(0.0, 89.0)) @ LUMINANCE_WEIGHTS < 20.0 * S10


def test_the_brightness_is_the_models() -> None:
    """A double-exponential disc behind dust, less the stars of the catalog."""
    model = unresolved_glow(float(load_stars().flux.sum()))
    degrees = np.arange(-14.5, 15.0)
    light = [model(np.array([galactic(length, b) for length in range(0, 360, 2)])).mean() for b in degrees]
    assert np.average(light, weights=np.cos(np.radians(degrees))) == pytest.approx(BRIGHTNESS, rel=0.01)


def test_the_center_is_bright_and_yellow() -> None:
    center, away = seen_around(0.0, 0.0, 5.0), seen_around(180.0, 0.0, 5.0)
    assert center @ LUMINANCE_WEIGHTS > 4.0 * (away @ LUMINANCE_WEIGHTS)
    reddest = black_body_color(5000.0)
    assert center[0] / center[2] > reddest[0] / reddest[2]


@pytest.mark.parametrize(
    ("longitude", "latitude", "reach", "is_bright"),
    [
        (280.5, -32.9, 2.0, True),  # the Large Magellanic Cloud
        (302.8, -44.3, 1.0, True),  # the Small one
        (303.0, -0.5, 1.5, False),  # the Coalsack
        (353.0, 16.5, 2.0, False),  # rho Ophiuchi's cloud
        (172.0, -14.0, 3.0, False),  # the Taurus cloud
    ],
)
def test_clouds_are_where_they_are(longitude: float, latitude: float, reach: float, is_bright: bool) -> None:
    """As bright or dark spots against the mean of what lies 3 reaches around them."""
    spot = seen_around(longitude, latitude, reach) @ LUMINANCE_WEIGHTS
    around = seen_around(longitude, latitude, 3.0 * reach) @ LUMINANCE_WEIGHTS
    assert spot > 1.5 * around if is_bright else spot < 0.8 * around


def test_the_sky_is_the_stars_and_the_milky_way() -> None:
    picture, alone = star_sky(64), star_sky(64, galactic_glow=False)
    glow = diffuse_light(texel_directions(np.arange(64), 64)) * ZERO_MAGNITUDE
    np.testing.assert_allclose(picture - alone, glow, rtol=2e-3, atol=1e-6)


def test_black_space_is_black() -> None:
    """At the exposure that the add-on gives the sky, 2.5 stops: half of the texels away from the band."""
    sky = star_sky(1024) * 2.0**2.5
    away = np.abs(np.arcsin(texel_directions(np.arange(1024), 1024) @ galactic_axes()[2])) > math.radians(30.0)
    median = np.median(sky[away] @ LUMINANCE_WEIGHTS)
    assert 255.0 * 12.92 * median < 12.0  # sRGB's linear part (IEC 61966-2-1)
    assert sky.max() > 1.0


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"height": 8}, "8 texels high is too small; give at least 16"),
        ({"height": 64, "star_width": 0.0}, "star width of 0.0 texels is not drawable"),
        ({"height": 64, "magnitude_limit": math.nan}, "magnitude limit is not a number"),
    ],
)
def test_impossible_skies_are_refused(arguments: dict, sentence: str) -> None:
    with pytest.raises(BlackHoleError, match=sentence):
        star_sky(**arguments)
