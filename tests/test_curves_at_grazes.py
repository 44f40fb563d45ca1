"""Curves where a motion begins to touch a break of a law, beside true bifurcations.

An oscillator x'' + 2 z x' + x = -a sin(w t) meets, above x = b, a damper that acts upwards only.
Just above the level at which the linear motion reaches b, the damper takes c (x_max - b) of its
momentum. So the derivative of the period map goes over from D to D - c u v^T: its determinant
stays, and its trace leaps by -c exp(-z T) sin(r T)/r, r^2 = 1 - z^2.
"""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve

import seatdyn as sd
from conftest import oscillator
from seatdyn.analysis.continuation import trace

ZETA, GAP = 0.05, 0.01


@sd.force_law(
    {"c": "N s/m", "gap": "m"}, jumps_at={"displacement": ["gap"]}, kinks_at={"velocity": [0.0]}
)
def damper_above(d, v, p):
    return p[0] * v if d > p[1] and v > 0.0 else 0.0


def touching(omega, c, delay=0.0):
    """Family over the level in units of the grazing one, and the multipliers on its two sides."""
    parts = [sd.Spring(1.0), sd.Damper(2 * ZETA, delay=delay), damper_above(c=c, gap=GAP)]
    damping = 2j * ZETA * omega * cmath.exp(-1j * omega * delay)
    level, system = GAP * abs(1.0 - omega**2 + damping), oscillator(*parts)

    def make(share):
        return system, sd.Sine(omega / (2 * math.pi), amplitude=share * level)

    period, r = 2 * math.pi / omega, math.sqrt(1.0 - ZETA**2)
    fall = math.exp(-ZETA * period)
    traces = 2 * fall * math.cos(r * period), -c * fall * math.sin(r * period) / r
    sides = [np.roots([1.0, -value, fall**2]) for value in np.cumsum(traces)]
    return make, *(np.abs(side).max() for side in sides)


def events(curve):
    return list(zip(curve.event_kind.values, curve.event_share.values, strict=True))


def test_multiplier_that_leaps_at_a_graze_is_no_period_doubling():
    """It leaps from 0.675 to -1.335; later the motion becomes stable again by a true one."""
    make, free, touched = touching(0.8, 2.5)
    assert free == pytest.approx(0.675, abs=1e-3)
    assert touched == pytest.approx(1.335, abs=1e-3)
    branch = trace(make, 0.9, 1.1)
    graze, doubling = branch.special
    assert (graze.kind, doubling.kind) == ("graze", "period doubling")
    assert graze.point.value == pytest.approx(1.0, abs=1e-6)
    assert graze.point.maximum["seat-base"] == pytest.approx(GAP, rel=1e-6)
    before = [p for p in branch.points if p.value < 1.0]
    assert np.allclose(np.abs([p.multipliers[0] for p in before]), free, rtol=1e-5)
    # differences with 1e-5 of the motion touch the damper for sqrt(2e-5) of a radian already
    assert graze.point.multipliers[0].real == pytest.approx(-touched, rel=0.03)
    assert doubling.point.multipliers[0].real == pytest.approx(-1.0, abs=1e-4)
    # from rest, in time: what repeats itself after two periods where one period is unstable
    place = doubling.point.value
    for share, status in ((0.5 * (1.0 + place), "subharmonic"), (2 * place - 1.0, "converged")):
        assert sd.steady_state(*make(share)).attrs["status"] == status


@pytest.mark.parametrize(("omega", "c"), [(1.6, 2.5), (2.3, 6.0)], ids=["stable", "unstable"])
def test_curve_goes_on_round_a_corner(omega, c):
    """Neither the multipliers nor the direction of the curve are continuous there."""
    make, free, touched = touching(omega, c)
    branch = trace(make, 0.9, 1.1)
    assert branch.status == "ok"
    assert [special.kind for special in branch.special] == ["graze"]
    assert branch.special[0].point.value == pytest.approx(1.0, abs=1e-6)
    multipliers = np.abs([p.multipliers[0] for p in branch.points])
    values = np.array([p.value for p in branch.points])
    assert np.allclose(multipliers[values < 1.0], free, rtol=1e-5)
    assert abs(branch.special[0].point.multipliers[0]) == pytest.approx(touched, rel=0.03)
    assert np.all(np.abs(np.diff(values)) < 0.01)  # no gap


def test_curve_that_ends_at_a_graze_has_no_branch_point_there():
    """One multiplier leaps beyond +1: the touching motion lives at the levels below, too."""
    make, free, touched = touching(1.1, 2.5)
    assert free < 1.0 < touched
    curve = sd.parameter_curve(make, 0.9, 1.1, name="share")
    assert [kind for kind, _ in events(curve)] == ["break"]
    assert float(curve.event_share[0]) == pytest.approx(1.0, abs=1e-6)


def test_graze_of_a_seat_that_reacts_late():
    """The level is that of the linear motion; the multiplier comes from a piece of history."""
    make, _, _ = touching(0.8, 2.5, delay=0.05)
    kind, level = events(sd.parameter_curve(make, 0.9, 1.1, name="share"))[0]
    assert kind == "graze"
    assert level == pytest.approx(1.0, abs=1e-6)


@sd.force_law({"k1": "N/m", "k3": "N/m3"})
def double_well(d, v, p):
    return -p[0] * d + p[1] * d**3


def test_multiplier_that_passes_one_smoothly_is_a_branch_point():
    """x'' + 2 x' - k x + x^3 = 2 sin(2 t) loses its symmetry; SciPy finds where."""

    def rates(t, y, k):
        x, v, dx, dv = y  # and a small disturbance
        force = 2.0 * v - k * x + x**3
        return [v, 2.0 * math.sin(2.0 * t) - force, dv, -2.0 * dv - (3.0 * x**2 - k) * dx]

    def after_half(k, y):
        run = solve_ivp(rates, (0.0, math.pi / 2), y, args=(k,), rtol=1e-11, atol=1e-12)
        return run.y[:, -1]

    def distance_from_one(k):
        start = fsolve(lambda y: after_half(k, [*y, 0.0, 0.0])[:2] + y, [0.1, -0.5], xtol=1e-11)
        half = np.column_stack([after_half(k, [*start, *unit])[2:] for unit in np.eye(2)])
        return np.abs(np.linalg.eigvals(half)).max() - 1.0  # the stiffness repeats itself

    place = brentq(distance_from_one, 0.0, 0.5, xtol=1e-9)
    sine = sd.Sine(2.0 / (2 * math.pi), amplitude=2.0)
    curve = sd.parameter_curve(
        lambda k: (oscillator(sd.Damper(2.0), double_well(k1=k, k3=1.0)), sine), -0.5, 0.5,
        name="share",
    )  # fmt: skip
    assert curve.attrs["status"] == "ok"
    ((kind, found),) = events(curve)
    assert kind == "branch point"
    assert found == pytest.approx(place, abs=1e-5)
