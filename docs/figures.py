# SPDX-License-Identifier: GPL-3.0-or-later
"""The figures of the physics page, computed with `physics` each time that the manual is built.

PYTHONPATH=. python docs/figures.py FOLDER
"""

import math
import sys
from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from physics import Observer, trace_rays
from physics.geodesics.mino import radial_polynomial
from physics.kerr.critical_curve import critical_carter_constant, critical_impact_parameters
from physics.kerr.metric import ergosphere_radius, horizon_radius, isco_radius, metric_functions, photon_orbit_radius
from physics.kerr.rays import camera_directions, rays_from_camera
from physics.light.disk_flux import relative_flux

SPINS = (0.0, 0.5, 0.9, 0.998)
FAR = 1e4
"""Radius, in M, of a camera that counts as far away."""

STYLE = {
    "figure.figsize": (7.0, 4.2),
    "figure.constrained_layout.use": True,
    "font.size": 10,
    "axes.grid": True,
    "grid.alpha": 0.25,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "svg.hashsalt": "umbra",  # the same figure is the same file
}


def draw_all(folder: Path) -> None:
    """Draw every figure into the folder, as SVG."""
    mpl.use("Agg")
    folder.mkdir(parents=True, exist_ok=True)
    with plt.rc_context(STYLE):
        for name, draw in FIGURES.items():
            figure = draw()
            figure.savefig(folder / f"{name}.svg", metadata={"Date": None})
            plt.close(figure)


def critical_curves() -> Figure:
    """The shadow's edge for several spins, seen from far away in the plane of the rotation (Eqs. 9, 10)."""
    figure, axes = plt.subplots(figsize=(5.2, 5.2))
    for spin in SPINS:
        low, high = critical_impact_parameters(spin)
        b = np.clip(0.5 * (low + high) + 0.5 * (high - low) * np.cos(np.linspace(0.0, math.pi, 400)), low, high)
        # Seen from the plane, -b across and sqrt(q) up are the place on the sky in units of M / distance.
        up = np.sqrt(np.maximum(critical_carter_constant(spin, b), 0.0))
        (line,) = axes.plot(-b, up, label=f"spin {spin:g}")
        axes.plot(-b, -up, color=line.get_color())
    axes.set(aspect="equal", xlabel="across, −b (M)", ylabel="up, ±√q (M)")
    axes.legend(loc="center")
    return figure


def special_radii() -> Figure:
    """Horizon, light's orbits, innermost stable orbits and the ergosphere's rim against the spin."""
    figure, axes = plt.subplots()
    spins = np.sin(np.linspace(0.0, 0.5 * math.pi, 200)[:-1])  # closer together towards 1
    curves: dict[str, Callable[[float], float]] = {
        "innermost stable orbit, retrograde": lambda a: isco_radius(a, prograde=False),
        "innermost stable orbit (ISCO)": isco_radius,
        "light's orbit, retrograde": lambda a: photon_orbit_radius(a, prograde=False),
        "light's orbit": photon_orbit_radius,
        "ergosphere, in the plane": lambda a: ergosphere_radius(a, 0.5 * math.pi),
        "horizon": horizon_radius,
    }
    for label, radius in curves.items():
        axes.plot(spins, [radius(float(spin)) for spin in spins], label=label)
    axes.set(xlabel="spin", ylabel="radius (M)", xlim=(0.0, 1.0), ylim=(0.0, 9.5))
    axes.legend(fontsize=8, ncols=2)
    return figure


def _looking(spin: float, b: np.ndarray, r: float) -> np.ndarray:
    """Where a FIDO in the equatorial plane looks to see light of these impact parameters, phi_rd, radians.

    Light that comes out to it: with n_r > 0 and, from Eqs. 7 and 8, n_phi = b alpha / (varpi (1 - b omega)).
    """
    metric = metric_functions(spin, r, 0.5 * math.pi)
    return math.pi + np.arcsin(b * metric.alpha / (metric.varpi * (1.0 - b * metric.omega)))


def radial_motion() -> Figure:
    """The radial potential U of rays in the plane: turned back where it would be negative, or not at all."""
    figure, panels = plt.subplots(1, 2, sharey=True, figsize=(8.0, 3.8))
    u = np.linspace(0.0, 0.75, 400)
    for axes, spin in zip(panels, (0.0, 0.9), strict=True):
        critical = critical_impact_parameters(spin)[1]
        b = np.array([0.8, 1.0, 1.25]) * critical
        observer = Observer.fido(FAR, 0.5 * math.pi, 0.0)
        looking = camera_directions(np.full(3, 0.5 * math.pi), _looking(spin, b, FAR))
        coefficients = np.stack(radial_polynomial(rays_from_camera(spin, observer, looking)), axis=-1)
        for (c2, c3, c4), each, fate in zip(coefficients, b, ("falls in", "circles", "turns back"), strict=True):
            axes.plot(u, 1.0 + u * u * (c2 + u * (c3 + u * c4)), label=f"b = {each:.3g} M: {fate}")
        axes.axhline(0.0, color="black", linewidth=0.8)
        axes.axvline(1.0 / horizon_radius(spin), color="gray", linestyle=":", label="horizon")
        axes.set(xlabel="u = 1/r (1/M)", title=f"spin {spin:g}", ylim=(-0.6, 1.6))
        axes.legend(fontsize=8)
    panels[0].set_ylabel("U(u) = (du/dλ)²")
    return figure


def paths() -> Figure:
    """Parallel light that falls in from the right, in the plane, forwards in time: u'' = U'/2 by Runge-Kutta steps."""
    figure, panels = plt.subplots(1, 2, sharex=True, sharey=True, figsize=(8.0, 4.2))
    b = np.linspace(-9.0, 9.0, 37)
    for axes, spin in zip(panels, (0.0, 0.9), strict=True):
        low, high = critical_impact_parameters(spin)
        horizon = horizon_radius(spin)
        for each, (x, y) in zip(b, _integrated(spin, b), strict=True):
            axes.plot(x, y, linewidth=0.8, color="tab:red" if low < each < high else "tab:blue")
        axes.add_patch(plt.Circle((0.0, 0.0), horizon, color="black", zorder=3))
        axes.set(aspect="equal", xlim=(-12.0, 12.0), ylim=(-11.0, 11.0), title=f"spin {spin:g}", xlabel="x (M)")
    panels[0].set_ylabel("y (M)")
    return figure


def _integrated(spin: float, b: np.ndarray, steps: int = 4000) -> list[tuple[np.ndarray, np.ndarray]]:
    """Paths x, y of light in the plane that comes in parallel to x, until it is at the horizon or far away."""
    c2, c3, c4 = spin * spin - b * b, 2.0 * (b - spin) ** 2, 0.0
    begin = 1e-3
    state = np.stack([np.full_like(b, begin), np.sqrt(1.0 + begin * begin * (c2 + begin * c3)), np.arcsin(b * begin)])

    def slope(state: np.ndarray) -> np.ndarray:
        u, rate, _ = state
        psi_rate = spin * (2.0 * u - spin * b * u * u) / (1.0 - 2.0 * u + spin * spin * u * u)
        return np.stack([rate, u * (c2 + u * (1.5 * c3 + 2.0 * c4 * u)), b + psi_rate])

    track, step = [state], 2.0 / steps
    limit = 0.97 / horizon_radius(spin)
    for _ in range(steps):
        k1 = slope(state)
        k2 = slope(state + 0.5 * step * k1)
        k3 = slope(state + 0.5 * step * k2)
        following = state + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + slope(state + step * k3))
        stays = (state[0] >= limit) | (state[0] < 0.5 * begin)
        state = np.where(stays, state, following)
        track.append(state)
    u, _, phi = np.moveaxis(np.array(track), 1, 0)
    r = 1.0 / np.maximum(u, 0.5 * begin)
    return list(zip((r * np.cos(phi)).T, (r * np.sin(phi)).T, strict=True))


def schwarzschild_deflection(b: np.ndarray) -> np.ndarray:
    """By how much light is bent without spin, radians: Darwin's closed form of 1959.

    4 sqrt(r0 / Q) (K(k) - F(zeta, k)) - pi with Q^2 = (r0 - 2)(r0 + 6), k^2 = (Q - r0 + 6) / (2 Q) and
    sin^2 zeta = (Q - r0 + 2) / (Q - r0 + 6), r0 the distance of closest approach. The elliptic integral is evaluated
    by Gauss-Legendre quadrature.
    """
    nearest = 2.0 * b / math.sqrt(3.0) * np.cos(np.arccos(-3.0 * math.sqrt(3.0) / b) / 3.0)
    q = np.sqrt((nearest - 2.0) * (nearest + 6.0))
    k2 = (q - nearest + 6.0) / (2.0 * q)
    zeta = np.arcsin(np.sqrt((q - nearest + 2.0) / (q - nearest + 6.0)))
    nodes, weights = np.polynomial.legendre.leggauss(400)
    half = 0.5 * (0.5 * math.pi - zeta)
    angles = zeta + half * (nodes[:, None] + 1.0)
    integral = half * (weights[:, None] / np.sqrt(1.0 - k2 * np.sin(angles) ** 2)).sum(axis=0)
    return 4.0 * np.sqrt(nearest / q) * integral - math.pi


def traced_deflection(spin: float, b: np.ndarray) -> np.ndarray:
    """By how much light of these impact parameters, all of one sign and growing outwards, is bent, radians."""
    looking = _looking(spin, b, FAR)
    observer = Observer.fido(FAR, 0.5 * math.pi, 0.0)
    seen = trace_rays(spin, observer, 0.5 * math.pi, looking, tolerance=1e-10)
    bent = np.sign(b) * (looking - seen.phi)
    return np.unwrap((bent % (2.0 * math.pi))[::-1])[::-1]  # from the outermost, which is bent by less than a turn


def deflection() -> Figure:
    """The angle by which light is bent against its impact parameter: traced, and in closed form without spin."""
    figure, axes = plt.subplots()
    away = np.geomspace(1e-4, 12.0, 120)
    for spin in (0.0, 0.5, 0.9):
        low, high = critical_impact_parameters(spin)
        for end, style in ((high, "-"), (low, "--")) if spin else ((high, "-"),):
            b = np.sign(end) * (abs(end) + away)
            label = f"spin {spin:g}" + (", against it" if end < 0.0 else ", with it" if spin else ", traced")
            axes.plot(np.abs(b), np.degrees(traced_deflection(spin, b)), style, label=label)
    b = critical_impact_parameters(0.0)[1] + away[::6]
    axes.plot(b, np.degrees(schwarzschild_deflection(b)), "k.", label="spin 0, Darwin's closed form")
    axes.plot(b, np.degrees(4.0 / b), color="gray", linestyle=":", label="4 M / b, far from the hole")
    axes.set(xlabel="impact parameter |b| (M)", ylabel="bent by (degrees)", xlim=(2.0, 12.0), ylim=(0.0, 400.0))
    axes.legend(fontsize=8)
    return figure


def orbit_redshift() -> Figure:
    """1 + z around the sky of an observer on a circular orbit, in the plane of the orbit (Eq. 13)."""
    figure, axes = plt.subplots()
    degrees = np.linspace(-180.0, 180.0, 721)
    for r in (6.0, 10.0, 22.0, 100.0):
        observer = Observer.circular_orbit(0.9, r)
        # 0 is ahead (phi_rd = 90 degrees); the hole is at +90
        seen = trace_rays(0.9, observer, 0.5 * math.pi, np.radians(degrees + 90.0))
        axes.plot(degrees, seen.one_plus_z, label=f"orbit at {r:g} M")
    axes.axhline(1.0, color="black", linewidth=0.8)
    axes.set(xlabel="degrees from straight ahead, towards the hole", ylabel="1 + z", xticks=range(-180, 181, 45))
    axes.legend()
    return figure


def disk_light() -> Figure:
    """The light that each radius of a disk sends out, by Page and Thorne's closed form (1974, Eq. 15n)."""
    figure, axes = plt.subplots()
    for spin in SPINS:
        r = np.geomspace(1.0001 * isco_radius(spin), 40.0, 400)
        axes.plot(r, relative_flux("novikov_thorne", spin, r, isco_radius(spin)), label=f"spin {spin:g}")
    axes.set(xlabel="radius (M)", ylabel="light sent out, relative to the brightest", xscale="log")
    axes.minorticks_off()
    axes.set_xticks([2, 5, 10, 20, 40], labels=["2", "5", "10", "20", "40"])
    axes.legend()
    return figure


FIGURES: dict[str, Callable[[], Figure]] = {
    "critical_curves": critical_curves,
    "special_radii": special_radii,
    "radial_motion": radial_motion,
    "paths": paths,
    "deflection": deflection,
    "orbit_redshift": orbit_redshift,
    "disk_light": disk_light,
}


if __name__ == "__main__":
    draw_all(Path(sys.argv[1]))
