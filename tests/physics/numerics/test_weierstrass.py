# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion in a quartic potential: against elementary and Jacobian functions, lattice constants, and its own equation."""

import math

import numpy as np
import pytest

from physics.numerics.weierstrass import QuarticMotion, Weierstrass


def columns(*values):
    return tuple(np.atleast_1d(np.asarray(value, dtype=float)) for value in values)


def jacobi(t, modulus):
    """sn, cn and dn by descending Landen transformations (Abramowitz & Stegun 1964, 16.4)."""
    a, c = [1.0], [modulus]
    b = math.sqrt(1.0 - modulus * modulus)
    while c[-1] > 1e-16:
        a_next, c_next, b = 0.5 * (a[-1] + b), 0.5 * (a[-1] - b), math.sqrt(a[-1] * b)
        a.append(a_next)
        c.append(c_next)
    phi = 2.0 ** (len(a) - 1) * a[-1] * t
    for n in range(len(a) - 1, 0, -1):
        phi = 0.5 * (phi + np.arcsin(c[n] / a[n] * np.sin(phi)))
    return np.sin(phi), np.cos(phi), np.sqrt(1.0 - (modulus * np.sin(phi)) ** 2)


def motion(c2, c3, c4, u, slope, times):
    """u and u' after each of some times, (m, n), from the same start."""
    c2, c3, c4, u, slope = columns(c2, c3, c4, u, slope)
    function = Weierstrass.of_quartic(c2, c3, c4)
    return QuarticMotion(function, np.stack([c2, c3, c4]), u, slope).after(*function.at(times))


@pytest.mark.parametrize("kappa", [0.3, 5.0, 1000.0])
def test_far_from_a_hole_light_goes_straight(kappa):
    """U = 1 - kappa^2 u^2: u is a sine. Up to three half turns; doublings cost few digits."""
    phase, start = np.linspace(0.01, 9.0, 500)[:, None], 0.4
    u, slope = motion(-(kappa**2), 0.0, 0.0, math.sin(start) / kappa, math.cos(start), phase / kappa)
    assert np.abs(kappa * u - np.sin(start + phase)).max() < 1e-8
    assert np.abs(slope - np.cos(start + phase)).max() < 1e-8


@pytest.mark.parametrize("modulus", [0.1, 0.8, 0.999])
def test_jacobis_sine_is_a_quartic_motion(modulus):
    """sn'^2 = (1 - sn^2)(1 - k^2 sn^2), from a place that is neither a root nor 0.

    Where two roots are about to merge, as next to the critical curve, rounding grows like e^(2 t).
    """
    times, start = np.linspace(0.01, 3.0, 500)[:, None], 0.5
    sine, cosine, delta = jacobi(np.array([start]), modulus)
    u, slope = motion(-(1.0 + modulus**2), 0.0, modulus**2, sine, cosine * delta, times)
    sine, cosine, delta = jacobi(start + times, modulus)
    assert np.abs(u - sine).max() < 1e-7
    assert np.abs(slope - cosine * delta).max() < 1e-7


def test_lattices_of_square_and_hexagon():
    """P and P' at the real half-period, where P is the root e_1 and P' is 0.

    1.311.. is that of g_2 = 4, g_3 = 0 and 1.529.. that of g_2 = 0, g_3 = 1 (Abramowitz & Stegun 1964, 18.14, 18.13).
    """
    lemniscatic, equianharmonic = 1.31102877714605990523, 1.52995403705719287491
    # with g_2 = c_4 + c_2^2 / 12 and g_3 = c_2 c_4 / 6 - c_2^3 / 216 - c_3^2 / 16
    c2, c3, c4 = columns([0.0, -2.0 * 3.0 ** (2.0 / 3.0)], [0.0, 0.0], [4.0, -(3.0 ** (1.0 / 3.0))])
    function = Weierstrass.of_quartic(c2, c3, c4)
    assert c4 + c2**2 / 12.0 == pytest.approx([4.0, 0.0], abs=1e-14)
    assert c2 * c4 / 6.0 - c2**3 / 216.0 == pytest.approx([0.0, 4.0 / 3.0], abs=1e-14)
    value, slope = function.at(np.array([lemniscatic, equianharmonic * 0.75 ** (1.0 / 6.0)]))
    assert value == pytest.approx([1.0, 3.0 ** (-1.0 / 3.0)], abs=1e-9)
    assert slope == pytest.approx([0.0, 0.0], abs=1e-8)


def test_there_and_back_and_all_along_the_equation_holds():
    """Of random quartics: u'^2 = U, and half a time twice is the whole, forwards and backwards."""
    random = np.random.default_rng(4)
    c2, c3, c4 = -(random.uniform(1.0, 8.0, 300) ** 2), random.uniform(0.0, 100.0, 300), random.uniform(-30.0, 0.0, 300)
    u = random.uniform(0.0, 0.1, 300)

    def potential(u):
        return 1.0 + u * u * (c2 + u * (c3 + u * c4))

    slope = np.sqrt(potential(u))
    function, quartic = Weierstrass.of_quartic(c2, c3, c4), np.stack([c2, c3, c4])
    time = random.uniform(0.05, 1.2, 300) / function.rate
    value, rate = function.at(time)
    far, fast = QuarticMotion(function, quartic, u, slope).after(value, rate)
    calm = (np.abs(far) < 2.0) & (np.abs(fast) < 30.0)
    assert calm.mean() > 0.5
    assert np.abs(fast**2 - potential(far))[calm].max() < 1e-6
    half = function.at(0.5 * time)
    middle = QuarticMotion(function, quartic, *QuarticMotion(function, quartic, u, slope).after(*half))
    (end, end_slope), (start, start_slope) = middle.around(*half)
    for ours, theirs in ((end, far), (end_slope, fast), (start, u), (start_slope, slope)):
        assert np.abs(ours - theirs)[calm].max() < 1e-6
