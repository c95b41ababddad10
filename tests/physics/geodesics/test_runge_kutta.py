# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of the Runge-Kutta pair, the loop that is driven by it, and the fates of rays it gives up."""

import itertools
import math

import numpy as np
import pytest
from references import angle_between, random_sky, unit_vectors

from physics import BlackHoleError, Cancelled, Fate, Observer, trace_rays
from physics.geodesics import tracer
from physics.numerics.runge_kutta import CASH_KARP, Tableau, integrate


def order_conditions(tableau, weights):
    """Residuals of the conditions for order 1 to 5 of an explicit Runge-Kutta method (Butcher's rooted trees)."""
    n = len(weights)
    a = np.zeros((n, n))
    for i, row in enumerate(tableau.stages):
        a[i, : len(row)] = row
    b, c = np.array(weights), a.sum(axis=1)
    trees = {
        1: [(b.sum(), 1)],
        2: [(b @ c, 1 / 2)],
        3: [(b @ c**2, 1 / 3), (b @ a @ c, 1 / 6)],
        4: [(b @ c**3, 1 / 4), (b @ (c * (a @ c)), 1 / 8), (b @ a @ c**2, 1 / 12), (b @ a @ a @ c, 1 / 24)],
        5: [
            (b @ c**4, 1 / 5),
            (b @ (c**2 * (a @ c)), 1 / 10),
            (b @ (c * (a @ c**2)), 1 / 15),
            (b @ (c * (a @ a @ c)), 1 / 30),
            (b @ (a @ c) ** 2, 1 / 20),
            (b @ a @ c**3, 1 / 20),
            (b @ a @ (c * (a @ c)), 1 / 40),
            (b @ a @ a @ c**2, 1 / 60),
            (b @ a @ a @ a @ c, 1 / 120),
        ],
    }
    return {order: max(abs(value - exact) for value, exact in conditions) for order, conditions in trees.items()}


def test_cash_karp_is_of_order_five_with_an_embedded_four():
    carried = order_conditions(CASH_KARP, CASH_KARP.weights)
    assert max(carried.values()) < 1e-15
    embedded = np.array(CASH_KARP.weights) - np.array(CASH_KARP.error_weights)
    residuals = order_conditions(CASH_KARP, embedded)
    assert max(residuals[order] for order in (1, 2, 3, 4)) < 1e-15
    assert residuals[5] > 1e-4


class Rotation:
    """Points on unit circles, each at a speed of its own, until a given time: the solution is cos and sin."""

    def __init__(self, speed, end, states=None):
        self.speed, self.end = speed, end
        self.state = np.stack([np.ones_like(speed), np.zeros_like(speed), np.zeros_like(speed)])

    def derivative(self, state, out):
        out[0], out[1], out[2] = -self.speed * state[1], self.speed * state[0], 1.0

    def error(self, difference, state, slope):
        return np.abs(difference[:2]).max(axis=0)

    def first_step(self):
        return np.full(len(self.speed), 0.1)

    def limit(self, state, slope, step):
        return np.minimum(step, self.end - state[2])

    def ended(self, state):
        return self.end - state[2] < 1e-12

    def failed(self, state):
        return np.zeros(state.shape[1], dtype=bool)

    def select(self, rays):
        return Rotation(self.speed[rays], self.end)


# Dormand & Prince 1980, J. Comput. Appl. Math. 6, 19: another pair is another table.
DORMAND_PRINCE = Tableau(
    "Dormand-Prince 5(4)",
    stages=(
        (),
        (1 / 5,),
        (3 / 40, 9 / 40),
        (44 / 45, -56 / 15, 32 / 9),
        (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
        (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
        (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
    ),
    weights=(35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84, 0.0),
    error_weights=(71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40),
    order=5,
    error_order=5,
)


@pytest.mark.parametrize("tableau", [CASH_KARP, DORMAND_PRINCE], ids=lambda tableau: tableau.name)
def test_rays_of_different_pace_each_keep_the_tolerance(tableau):
    speed = np.geomspace(0.01, 100.0, 40)
    errors = []
    for tolerance in (1e-6, 1e-9):
        *_, outcome = integrate(Rotation(speed, 3.0), tableau, tolerance, 100_000)
        assert outcome.reached.all()
        exact = np.stack([np.cos(3.0 * speed), np.sin(3.0 * speed)])
        errors.append(np.abs(outcome.state[:2] - exact).max(axis=0))
    # Local errors add up over speed * time radians, a few steps a radian.
    assert (errors[0] < 1e-6 * (10.0 + 10.0 * speed)).all()
    assert (errors[1] < 1e-9 * (10.0 + 10.0 * speed)).all()


def test_steps_that_run_out_leave_a_ray_unreached():
    *_, outcome = integrate(Rotation(np.array([0.01, 100.0]), 3.0), CASH_KARP, 1e-9, 20)
    assert outcome.reached.tolist() == [True, False]


def test_unresolved_rays_are_counted_and_carry_no_answer():
    result = trace_rays(0.9, Observer.fido(10.0, 1.3, 0.0), *random_sky(500), method="cash-karp", max_steps=6)
    given_up = result.fate == Fate.UNRESOLVED
    assert 0 < given_up.sum() == result.counts["unresolved"] < 500
    assert np.isnan(result.theta[given_up]).all()
    assert np.isnan(result.one_plus_z[given_up]).all()
    # More steps resolve them; fewer never change the answer of those that were resolved.
    full = trace_rays(0.9, Observer.fido(10.0, 1.3, 0.0), *random_sky(500), method="cash-karp")
    assert full.counts["unresolved"] == 0
    sky = result.fate == Fate.SKY
    assert np.array_equal(full.theta[sky], result.theta[sky])


def test_another_table_traces_the_same_sky(monkeypatch):
    theta_rd, phi_rd = random_sky(1000)
    observer = Observer.circular_orbit(0.9, 8.0)
    method = tracer.Method("dormand-prince", "", "", tracer.stepping(DORMAND_PRINCE, tracer.mino_systems))
    monkeypatch.setitem(tracer.METHODS, method.name, method)
    one = trace_rays(0.9, observer, theta_rd, phi_rd, tolerance=1e-10, method="cash-karp")
    other = trace_rays(0.9, observer, theta_rd, phi_rd, tolerance=1e-10, method="dormand-prince")
    sky = one.fate == Fate.SKY
    assert np.array_equal(one.fate, other.fate)
    distance = angle_between(unit_vectors(one.theta, one.phi), unit_vectors(other.theta, other.phi))[sky]
    # Two pairs, one tolerance: errors of 1e-10 a step, amplified some 1e2 times by the rays nearest to the edge.
    assert np.quantile(distance, 0.99) < 1e-8


def test_error_follows_the_tolerance():
    theta_rd, phi_rd = random_sky(300)
    observer = Observer.fido(10.0, 1.0, 0.0)
    exact = trace_rays(0.9, observer, theta_rd, phi_rd, tolerance=1e-12, method="cash-karp")
    sky = exact.fate == Fate.SKY
    previous = math.inf
    for tolerance in (1e-4, 1e-6, 1e-8, 1e-10):
        result = trace_rays(0.9, observer, theta_rd, phi_rd, tolerance=tolerance, method="cash-karp")
        error = angle_between(unit_vectors(result.theta, result.phi), unit_vectors(exact.theta, exact.phi))[sky]
        assert np.median(error) < min(tolerance, previous / 10.0)
        previous = np.median(error)


def test_shapes_blocks_progress_and_cancelling(monkeypatch):
    theta_rd, phi_rd = random_sky(60)
    observer = Observer.fido(10.0, 1.0, 0.0)
    whole = trace_rays(0.5, observer, theta_rd.reshape(6, 10), phi_rd.reshape(6, 10))
    assert whole.fate.shape == whole.theta.shape == whole.phi.shape == whole.one_plus_z.shape == (6, 10)
    assert trace_rays(0.5, observer, 1.0, 2.0).theta.shape == ()
    assert trace_rays(0.5, observer, [], []).theta.shape == (0,)

    monkeypatch.setattr("physics.numerics.blocks.BLOCK_SIZE", 7)
    fractions = []
    blocked = trace_rays(0.5, observer, theta_rd, phi_rd, progress=fractions.append)
    assert np.array_equal(blocked.theta, whole.theta.ravel(), equal_nan=True)
    assert len(fractions) == 9
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0
    answers = itertools.chain([False, False], itertools.repeat(True))
    fractions.clear()
    with pytest.raises(Cancelled):
        trace_rays(0.5, observer, theta_rd, phi_rd, progress=fractions.append, cancel=lambda: next(answers))
    assert len(fractions) == 2


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"tolerance": 0.0}, "tolerance"),
        ({"tolerance": math.nan}, "tolerance"),
        ({"method": "euler"}, "no method 'euler'"),
        ({"max_steps": 0}, "steps"),
    ],
)
def test_wrong_settings_are_refused_in_words(settings, words):
    with pytest.raises(BlackHoleError, match=words):
        trace_rays(0.5, Observer.fido(10.0, 1.0, 0.0), 1.0, 1.0, **settings)


def test_directions_that_are_not_numbers_are_refused():
    with pytest.raises(BlackHoleError, match="finite"):
        trace_rays(0.5, Observer.fido(10.0, 1.0, 0.0), [1.0, math.nan], 1.0)
