# SPDX-License-Identifier: GPL-3.0-or-later
"""The metric, the observers' motions, and the way from a camera's direction to a ray's constants."""

import math

import numpy as np
import pytest
from references import angle_between, random_sky, unit_vectors

from physics import BlackHoleError, Fate, Observer, UnstableOrbitWarning, trace_rays
from physics.kerr.metric import ergosphere_radius, horizon_radius, metric_functions
from physics.kerr.rays import camera_directions, camera_triad, light_in_fido_frame, rays_from_camera, rays_from_triad

PLACES = [(0.9, 5.0, 1.0), (0.998, 1.5, 0.3), (0.0, 3.0, 2.0), (-0.5, 20.0, 1.5)]


def metric_tensor(spin, r, theta):
    """g_tt, g_tphi, g_phiphi of the Kerr metric in its textbook form (Misner, Thorne & Wheeler, Eq. 33.2)."""
    rho2 = r**2 + spin**2 * math.cos(theta) ** 2
    sin2 = math.sin(theta) ** 2
    return (
        -(1.0 - 2.0 * r / rho2),
        -2.0 * spin * r * sin2 / rho2,
        (r**2 + spin**2 + 2.0 * spin**2 * r * sin2 / rho2) * sin2,
    )


@pytest.mark.parametrize(("spin", "r", "theta"), PLACES)
def test_metric_functions_make_the_textbook_metric(spin, r, theta):
    m = metric_functions(spin, r, theta)
    g_tt, g_tp, g_pp = metric_tensor(spin, r, theta)
    assert m.varpi**2 == pytest.approx(g_pp, rel=1e-12)
    assert -m.omega * m.varpi**2 == pytest.approx(g_tp, rel=1e-12, abs=1e-15)
    assert -(m.alpha**2) + (m.omega * m.varpi) ** 2 == pytest.approx(g_tt, rel=1e-11)


def test_static_observer_is_at_rest():
    """Its 4-velocity has no phi part: the FIDO measures -omega varpi / alpha."""
    observer = Observer.static(0.9, 5.0, 1.0, 0.0)
    m = metric_functions(0.9, 5.0, 1.0)
    assert observer.direction == (0.0, 0.0, -1.0)
    assert m.omega + observer.direction[2] * observer.beta * m.alpha / m.varpi == pytest.approx(0.0, abs=1e-16)


@pytest.mark.parametrize(("spin", "prograde"), [(0.7, True), (0.7, False), (-0.7, True), (-0.7, False), (0.0, True)])
def test_circular_orbit_is_a_geodesic(spin, prograde):
    """Gamma^r_ab u^a u^b = 0: d/dr of (g_tt + 2 g_tp Omega + g_pp Omega^2) vanishes, by finite differences."""
    r = 12.0
    observer = Observer.circular_orbit(spin, r, prograde=prograde)
    m = metric_functions(spin, r, math.pi / 2)
    omega = m.omega + observer.beta * observer.direction[2] * m.alpha / m.varpi

    def norm(radius):
        g_tt, g_tp, g_pp = metric_tensor(spin, radius, math.pi / 2)
        return g_tt + 2.0 * g_tp * omega + g_pp * omega**2

    step = 1e-3
    assert (norm(r + step) - norm(r - step)) / (2.0 * step) == pytest.approx(0.0, abs=1e-9)
    along_spin = omega * (math.copysign(1.0, spin) if spin else 1.0) > 0.0
    assert along_spin == prograde


def test_free_fall_has_unit_energy_and_no_angular_momentum():
    observer = Observer.free_fall(0.9, 4.0, 0.8, 0.0)
    alpha = metric_functions(0.9, 4.0, 0.8).alpha
    assert alpha / math.sqrt(1.0 - observer.beta**2) == pytest.approx(1.0, rel=1e-14)
    assert observer.direction == (-1.0, 0.0, 0.0)


def test_impossible_observers_are_refused_in_words():
    with pytest.raises(BlackHoleError, match="ergosphere"):
        Observer.static(0.9, 1.9, math.pi / 2, 0.0)
    assert ergosphere_radius(0.9, math.pi / 2) == 2.0
    with pytest.raises(BlackHoleError, match="inside the black hole"):
        Observer.static(0.9, 1.2, 0.0, 0.0)
    with pytest.raises(BlackHoleError, match="prograde photon orbit"):
        Observer.circular_orbit(0.9, 1.5)
    with pytest.raises(BlackHoleError, match="retrograde photon orbit"):
        Observer.circular_orbit(0.9, 3.5, prograde=False)
    with pytest.raises(BlackHoleError, match="below 1"):
        Observer(10.0, 1.0, 0.0, 1.0)
    with pytest.raises(BlackHoleError, match="theta"):
        Observer(10.0, -0.1, 0.0)
    with pytest.raises(BlackHoleError, match="unit vector"):
        Observer(10.0, 1.0, 0.0, 0.5, (1.0, 1.0, 0.0))
    with pytest.raises(BlackHoleError, match="finite"):
        Observer(math.nan, 1.0, 0.0)
    with pytest.raises(BlackHoleError, match="spin"):
        trace_rays(1.0, Observer.fido(10.0, 1.0, 0.0), 1.0, 1.0)
    with pytest.raises(BlackHoleError, match="inside the black hole"):
        trace_rays(0.0, Observer.fido(2.0, 1.0, 0.0), [], [])


def test_unstable_orbits_warn():
    with pytest.warns(UnstableOrbitWarning, match="unstable"):
        Observer.circular_orbit(0.0, 5.0)
    Observer.circular_orbit(0.0, 6.0)


@pytest.mark.parametrize(
    "direction", [(0.0, 0.0, 1.0), (0.36, 0.48, -0.8), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)]
)
def test_camera_triad_is_orthonormal_and_right_handed(direction):
    triad = camera_triad(Observer(10.0, 1.0, 0.0, 0.5, direction))
    assert triad @ triad.T == pytest.approx(np.eye(3), abs=1e-15)
    assert np.linalg.det(triad) == pytest.approx(1.0)
    assert triad[1] == pytest.approx(direction)


def test_constants_of_motion_satisfy_the_null_condition():
    """g^ab p_a p_b = 0 with p_t = -1 and the momenta of Eq. 7: R = (Delta p_r)^2 with R of Eq. 3."""
    spin, observer = 0.9, Observer(5.0, 1.0, 0.0, 0.4, (0.6, 0.0, 0.8))
    rays = rays_from_camera(spin, observer, camera_directions(*random_sky(500)))
    r, delta = observer.r, observer.r**2 - 2.0 * observer.r + spin**2
    big_p = r**2 + spin**2 - spin * rays.b
    radial = big_p**2 - delta * ((rays.b - spin) ** 2 + rays.q)
    assert rays.radial**2 == pytest.approx(radial, rel=1e-10, abs=1e-10 * r**4)


def test_aberration_matches_a_lorentz_boost():
    """Eq. 5 against the boost of the 4-vector, for motion along e_y."""
    beta = 0.6
    moving = Observer(10.0, 1.0, 0.0, beta)
    looking = camera_directions(*random_sky(200))
    gamma = 1.0 / math.sqrt(1.0 - beta**2)
    # The photon moves along -N with unit energy in the camera's frame.
    energy = gamma * (1.0 - beta * looking[:, 1])
    along = gamma * (-looking[:, 1] + beta)
    boosted = np.stack([-looking[:, 0], along, -looking[:, 2]], axis=-1) / energy[:, None]
    still = rays_from_camera(0.5, Observer(10.0, 1.0, 0.0), -boosted)
    seen = rays_from_camera(0.5, moving, looking)
    assert seen.b == pytest.approx(still.b, rel=1e-12, abs=1e-12)
    assert seen.radial == pytest.approx(still.radial, rel=1e-11, abs=1e-11)
    # 1 + z carries the Doppler factor: the camera's energy is 1, the FIDO's `energy`.
    assert seen.one_plus_z == pytest.approx(still.one_plus_z * energy, rel=1e-12)


@pytest.mark.parametrize("theta", [0.0, math.pi])
@pytest.mark.parametrize("phi", [0.0, 2.0])
def test_camera_on_the_axis_is_the_limit_of_cameras_beside_it(theta, phi):
    """Continuity: 1e-7 rad from the axis the sky is the same to about 1e-7 rad times the amplification."""
    spin, r = 0.9, 8.0
    beside = abs(theta - 1e-7)
    theta_rd, phi_rd = random_sky(300)
    on_axis = trace_rays(spin, Observer.fido(r, theta, phi), theta_rd, phi_rd, tolerance=1e-10)
    near = trace_rays(spin, Observer.fido(r, beside, phi), theta_rd, phi_rd, tolerance=1e-10)
    sky = (on_axis.fate == Fate.SKY) & (near.fate == Fate.SKY)
    assert sky.sum() > 200
    distance = angle_between(
        unit_vectors(on_axis.theta[sky], on_axis.phi[sky]), unit_vectors(near.theta[sky], near.phi[sky])
    )
    assert np.quantile(distance, 0.98) < 1e-5


def test_no_spin_is_spherically_symmetric():
    """A camera on the axis and one on the equator see the same bending."""
    psi = np.linspace(0.6, 3.0, 20)
    pole = trace_rays(0.0, Observer.fido(10.0, 0.0, 0.0), math.pi / 2, math.pi - psi)
    equator = trace_rays(0.0, Observer.fido(10.0, math.pi / 2, 0.0), math.pi / 2, math.pi - psi)
    inward = np.array([0.0, 0.0, -1.0])
    bent_pole = angle_between(unit_vectors(pole.theta, pole.phi), inward)
    bent_equator = angle_between(unit_vectors(equator.theta, equator.phi), np.array([-1.0, 0.0, 0.0]))
    assert bent_pole == pytest.approx(bent_equator, abs=1e-6)


def test_negative_spin_is_the_mirror_image():
    theta_rd, phi_rd = random_sky(400)
    one = trace_rays(0.8, Observer.fido(6.0, 1.0, 0.0), theta_rd, phi_rd)
    # Mirror phi -> -phi: e_y turns round, and so does the spin.
    other = trace_rays(-0.8, Observer.fido(6.0, 1.0, 0.0), theta_rd, -phi_rd)
    assert np.array_equal(one.fate, other.fate)
    sky = one.fate == Fate.SKY
    mirrored = unit_vectors(other.theta[sky], -other.phi[sky])
    assert angle_between(unit_vectors(one.theta[sky], one.phi[sky]), mirrored).max() < 1e-9


def test_axis_rays_with_exactly_zero_radial_momentum():
    """theta_rd = 0 with B = phi-hat gives p_r = 0 exactly: outside the photon sphere that is sky."""
    outside = trace_rays(0.5, Observer(10.0, 1.0, 0.0), [0.0, math.pi], [0.0, 0.0])
    assert (outside.fate == Fate.SKY).all()
    inside = trace_rays(0.5, Observer(2.2, 1.0, 0.0), [0.0, math.pi], [0.0, 0.0])
    assert (inside.fate == Fate.SHADOW).all()


def test_inside_everything():
    """Just outside the horizon the sky shrinks to a disc overhead, and every ray still has a fate of its own."""
    spin = 0.9999
    result = trace_rays(spin, Observer.fido(horizon_radius(spin) * 1.01, 1.0, 0.0), *random_sky(5000))
    assert result.counts["unresolved"] == 0
    assert 0 < result.counts["sky"] < 0.2 * 5000


def test_observers_at_one_place_see_one_sky():
    """The FIDO and a moving camera look at the same light in different directions (Eq. 5)."""
    fido = Observer.fido(8.0, 1.1, 0.0)
    moving = Observer(8.0, 1.1, 0.0, 0.7, (0.6, 0.0, 0.8))
    looking = unit_vectors(np.linspace(0.1, 3.0, 50), np.linspace(0.0, 6.0, 50))
    light, _ = light_in_fido_frame(moving, looking, np.eye(3))
    at_rest = rays_from_triad(0.8, fido, -light.T)
    in_motion = rays_from_triad(0.8, moving, looking)
    assert at_rest.b == pytest.approx(in_motion.b, rel=1e-12)
    assert at_rest.q == pytest.approx(in_motion.q, rel=1e-11)
