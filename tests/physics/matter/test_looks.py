# SPDX-License-Identifier: GPL-3.0-or-later
"""The looks at their own exposure: what a screen can show of them."""

import math

import numpy as np
import pytest
from test_thin_layer import rendered, shot

import physics
from physics.light.matter_settings import MATTER_PRESETS, MatterLook


@pytest.fixture(scope="module")
def views():
    return [physics.bake(shot(160, 90, degrees)) for degrees in (5.0, 20.0)]


@pytest.mark.parametrize("name", MATTER_PRESETS)
def test_looks_are_within_the_screen_and_have_more_than_one_hue(views, name):
    for view in views:
        layer = rendered(view, MATTER_PRESETS[name])
        seen = (1.0 - layer.transmittance) > 0.05
        light = layer.light[seen]
        assert (light.max(axis=1) > 1.0).mean() <= 0.03
        bright = light @ np.array([0.2126, 0.7152, 0.0722], dtype=np.float32)
        order = np.argsort(bright)
        lit = order[bright[order] > 1e-3]
        hot, cool = light[lit[-len(lit) // 50 :]].sum(axis=0), light[lit[: len(lit) // 2]].sum(axis=0)
        assert hot[2] / hot[0] > 1.2 * cool[2] / cool[0]


def test_a_hot_spot_comes_round_in_its_orbit(views):
    # Its period is 2 pi (r^1.5 + a); half of it later it is elsewhere.
    look = MatterLook(strands=0.0, smoke=0.0, spots=1, spot_radius=9.0, spot_size=0.15)
    none = MatterLook(strands=0.0, smoke=0.0)
    period = 2.0 * math.pi * (9.0**1.5 + 0.9)
    plain = rendered(views[1], none).light
    start, half, whole = (
        np.abs(rendered(views[1], look, share * period).light - plain).sum(axis=2) for share in (0.0, 0.5, 1.0)
    )
    np.testing.assert_allclose(whole, start, atol=1e-3 * start.max())
    assert np.minimum(start, half).sum() < 0.1 * start.sum()


def test_gaps_and_infalling_gas():
    bare = shot(160, 90, 60.0, disk=physics.Disk(1, 1.6, 18.0))
    baked = physics.bake(bare)
    radius, covered = baked.disk_passes[0].radius, baked.disk_passes[0].coverage == 1.0
    look = MatterLook(strands=0.0, smoke=0.0, gap_radius=10.0, gap_width=0.1, gap_depth=1.0)
    opacity = 1.0 - rendered(baked, look).transmittance
    assert opacity[covered & (np.abs(radius - 10.0) < 0.2)].max() < 0.05
    assert opacity[covered & (np.abs(radius - 7.0) < 0.5)].min() > 0.7
    isco = physics.isco_radius(0.9)
    within = covered & (radius < 0.95 * isco)
    looks = [MatterLook(strands=0.0, smoke=0.0, infall=amount) for amount in (0.0, 1.0)]
    dark, lit = (rendered(baked, look).light[within].sum() for look in looks)
    assert lit > 10.0 * dark
