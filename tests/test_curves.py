"""Curves through folds: exact values of the Duffing oscillator, and time runs on each side."""

from __future__ import annotations

import math

import numpy as np
import pytest

import seatdyn as sd
from conftest import OFF, oscillator, paper_system
from seatdyn.analysis.curves import folds
from seatdyn.analysis.stability import is_stable


@sd.force_law({"k1": "N/m", "k3": "N/m3"})
def cubic(d, v, p):
    return p[0] * d + p[1] * d**3


@pytest.fixture(scope="module")
def duffing():
    """x'' + 0.1 x' + x + 0.5 x^3 = 0.3 cos(w t), in relative motion, over w = 0.5 .. 2."""
    system = oscillator(sd.Damper(0.1), cubic(k1=1.0, k3=0.5))
    return system, sd.response_curve(system, (0.5 / (2 * math.pi), 2.0 / (2 * math.pi)), 0.3)


def crossings(curve, omega):
    """Amplitudes of the travel where the branch passes an angular frequency, and stability."""
    w = 2 * math.pi * curve.frequency.isel(level=0).to_numpy()
    x = curve.amplitude.sel(output="seat-base").isel(level=0).to_numpy()
    stable = curve.stable.isel(level=0).to_numpy()
    found = []
    for k in np.flatnonzero((w[:-1] - omega) * (w[1:] - omega) <= 0.0):
        near = slice(max(k - 1, 0), k + 3)
        order = np.argsort(w[near])
        fit = np.polynomial.Polynomial.fit(w[near][order], x[near][order], min(3, order.size - 1))
        found.append((float(fit(omega)), bool(stable[k])))
    return found


def test_duffing_has_its_exact_amplitudes_on_three_branches(duffing):
    """Largest |x| of the exact solutions at w = 1.4: upper, unstable, lower."""
    _, curve = duffing
    assert curve.attrs["status"] == "ok"
    exact = [(1.710653, True), (1.481770, False), (0.322256, True)]
    found = crossings(curve, 1.4)
    assert [stable for _, stable in found] == [stable for _, stable in exact]
    assert found[1][0] == pytest.approx(1.481770, abs=2e-5)  # of the interpolation between points
    for omega, value in ((0.5, 0.378526), (0.8, 0.603819), (1.2, 1.317560), (2.0, 0.099906)):
        assert crossings(curve, omega)[0][0] == pytest.approx(value, abs=2e-5)


def test_branch_ends_exactly_on_the_range(duffing):
    system, _ = duffing
    for start, value in ((0.5, 1.710653), (2.0, 0.322256)):
        curve = sd.response_curve(system, (start / (2 * math.pi), 1.4 / (2 * math.pi)), 0.3)
        assert float(curve.amplitude.sel(output="seat-base")[0, -1]) == pytest.approx(
            value, abs=1e-6
        )


def test_points_are_steady_states_of_time_integration_where_stable(duffing):
    system, curve = duffing
    w = curve.frequency.isel(level=0).to_numpy()
    for k in (3, len(w) - 4):
        sine = sd.Sine(float(w[k]), amplitude=0.3)
        state = sd.steady_state(system, sine)
        expected = float(state.amplitude.sel(output="seat-base"))
        found = float(curve.amplitude.sel(output="seat-base")[0, k])
        # from rest the lower branch is reached, which is the only one at both places
        assert found == pytest.approx(expected, rel=1e-6)


def test_folds_bound_the_unstable_part(duffing):
    _, curve = duffing
    places = folds(curve, 0)
    assert len(places) == 2
    stable = curve.stable.isel(level=0).to_numpy()
    w = curve.frequency.isel(level=0).to_numpy()
    inside = w[~stable]
    assert inside.max() <= places.max() + 1e-9
    assert inside.min() >= places.min() - 1e-9
    # just outside of the folds in frequency there is one solution, between them there are three
    for place, sign in zip(sorted(places), (-1, 1), strict=True):
        for outside, count in ((1e-3, 1), (-1e-3, 3)):
            assert len(crossings(curve, 2 * math.pi * place * (1 + sign * outside))) == count


def test_both_directions_give_the_same_branch(duffing):
    system, curve = duffing
    ends = (2.0 / (2 * math.pi), 0.5 / (2 * math.pi))
    back = sd.response_curve(system, ends, 0.3)
    assert np.allclose(np.sort(folds(back, 0)), np.sort(folds(curve, 0)), rtol=1e-6)
    for (a, _), (b, _) in zip(crossings(curve, 1.4), crossings(back, 1.4)[::-1], strict=True):
        assert a == pytest.approx(b, rel=5e-4)  # of the interpolation


@sd.force_law({"k3": "N/m3", "k5": "N/m5"})
def quintic(d, v, p):
    return p[0] * d**3 + p[1] * d**5


@pytest.mark.parametrize(
    ("element", "level"),
    [(cubic(k1=0.0, k3=2e7), 1.5), (quintic(k3=-3e6, k5=4e8), 1.0)],
    ids=["hardening", "softening"],
)
def test_seat_jumps_where_the_curve_folds(element, level):
    """Time integration is started on each side of the jump."""
    system = paper_system(element, body="fairley1989", mass=20.0, c=120.0)
    curve = sd.response_curve(system, (0.8, 3.0), level)
    assert curve.attrs["status"] == "ok"
    low, high = np.sort(folds(curve, 0))[:2]
    middle = (low + high) / 2
    found = crossings(curve, 2 * math.pi * middle)
    assert [stable for _, stable in found] == [True, False, True]
    # sweep up and down in steps: each time the motion stays on its branch up to the fold
    kept = {}
    for name, sweep in (
        ("up", np.linspace(low - 0.1, middle, 8)),
        ("down", np.linspace(high + 0.1, middle, 8)),
    ):
        state = "rest"
        for f in sweep:
            run = sd.simulate(
                system, sd.Sine(f, amplitude=level), round(60 * f) / f, initial=state,
                energy_check=False, output_step=1e-2,
            )  # fmt: skip
            last = run.isel(time=-1)
            state = np.concatenate([last.displacement, last.velocity])
        tail = run.relative_displacement.sel(pair="seat-base")[-round(3 / f / 1e-2) :]
        kept[name] = float(tail.max() - tail.min()) / 2
    amplitudes = sorted(amplitude for amplitude, stable in found if stable)
    assert sorted(kept.values()) == pytest.approx(amplitudes, rel=5e-3)


def test_undamped_limit_follows_the_backbone_of_the_gap_spring():
    """Free period of the oscillator with a gap spring, standards case (1, 4, 0.5, 1.2)."""
    system = oscillator(
        sd.Spring(1.0), sd.Damper(2e-3), sd.PiecewiseSpring(4.0, 0.5, 0.5, jumping=False)
    )
    period = 3.684137336
    levels = np.array([3.9e-3, 4.2e-3])
    curve = sd.response_curve(system, (0.12, 0.30), levels)
    peaks = sd.backbone(curve, "seat-base")
    frequency = np.interp(1.2, peaks.amplitude, peaks.frequency)
    assert peaks.amplitude.min() < 1.2 < peaks.amplitude.max()
    assert frequency == pytest.approx(1 / period, rel=1e-3)


def test_parameter_curve_is_a_row_of_steady_states():
    body, sine = sd.load_body(OFF), sd.Sine(1.55, amplitude=0.8857)

    def seat(gamma):
        parts = [sd.Spring(9950.0), sd.Damper(260.0), sd.PiecewiseSpring(gamma, 0.02, 0.01)]
        return sd.SeatSystem(body, sd.Seat(35.0, parts)), sine

    curve = sd.parameter_curve(seat, 100.0, 1000.0, name="gamma", unit="N/m")
    assert curve.attrs["status"] == "ok"
    for k in (0, curve.sizes["point"] - 1):
        state = sd.steady_state(*seat(float(curve.gamma[k])))
        for name in ("acc_m1", "seat", "F_nonlinear"):
            row = curve.amplitude.sel(output=name)
            assert float(row[k]) == pytest.approx(float(state.amplitude.sel(output=name)), rel=1e-6)


def test_curve_goes_on_where_a_motion_begins_to_touch_a_jump():
    element = sd.PiecewiseSpring(8000.0, 0.02, 0.01)
    system = paper_system(element, sd.QuadraticDamper(100.0), body="fairley1989")
    curve = sd.response_curve(system, (1.1, 1.5), 0.5)
    assert curve.attrs["status"] == "ok"
    breaks = curve.event_kind.isel(level=0).to_numpy() == "break"
    touched = curve.event_amplitude.sel(output="seat-base")[0].to_numpy()[breaks]
    assert touched[0] == pytest.approx(0.01, rel=1e-3)
    last = float(curve.amplitude.sel(output="seat-base")[0].dropna("point")[-1])
    state = sd.steady_state(system, sd.Sine(1.5, amplitude=0.5))
    assert last == pytest.approx(float(state.amplitude.sel(output="seat-base")), rel=1e-6)


def test_curve_reaches_the_motion_without_contact_behind_a_fold():
    """Contact ends at a fold and, unstable, in a graze; free motion lasts from there on."""
    system = paper_system(sd.PiecewiseSpring(5000.0, 0.02, 0.01))
    curve = sd.response_curve(system, (1.84, 1.95), 0.5).isel(level=0)
    assert curve.attrs["status"] == "ok"
    kinds = curve.event_kind.values.tolist()
    assert sorted(set(kinds)) == ["break", "fold"]
    f = curve.frequency.to_numpy()
    travel = curve.amplitude.sel(output="seat-base").to_numpy()
    free = travel < 0.01
    graze, fold = (float(curve.event_frequency[kinds.index(kind)]) for kind in ("break", "fold"))
    assert np.min(f[free]) == pytest.approx(graze, abs=1e-3)
    assert np.max(f[free]) == 1.95
    assert graze < fold == pytest.approx(np.max(f[~free]))
    linear = sd.frequency_response(paper_system(), frequency=f[free])
    gain = np.abs(linear.transmissibility.sel(node="seat") - 1.0)
    expected = gain * 0.5 / (2 * math.pi * f[free]) ** 2
    assert np.allclose(travel[free], expected, rtol=1e-6)


def test_multiplier_of_a_linear_system_is_that_of_its_poles():
    system = paper_system()
    assert is_stable(system)
    curve = sd.response_curve(system, (1.0, 2.0), 0.5)
    slowest = float(sd.poles(system)["real"].max())
    expected = np.exp(slowest / curve.frequency)
    assert np.allclose(curve.floquet_max, expected, rtol=1e-4)


def late_seat(delay, *more):
    """The paper's seat with its whole suspension force late."""
    parts = [sd.Spring(9950.0, delay=delay), sd.Damper(260.0, delay=delay), *more]
    return sd.SeatSystem(sd.load_body(OFF), sd.Seat(35.0, parts))


def test_curve_of_a_seat_that_reacts_late_is_a_row_of_steady_states():
    system = late_seat(0.01, sd.QuadraticDamper(500.0, delay=0.01))
    curve = sd.response_curve(system, (1.5, 1.6), 0.5)
    assert curve.attrs["status"] == "ok"
    middle = curve.sizes["point"] // 2
    for k in (middle, curve.sizes["point"] - 1):
        state = sd.steady_state(system, sd.Sine(float(curve.frequency[0, k]), amplitude=0.5))
        for name in ("acc_m1", "seat-base"):
            row = curve.amplitude.sel(output=name)[0]
            assert float(row[k]) == pytest.approx(float(state.amplitude.sel(output=name)), rel=1e-7)
        assert float(curve.floquet_max[0, k]) == pytest.approx(state.attrs["floquet_max"], rel=1e-6)


def test_motion_of_a_linear_seat_turns_unstable_at_its_delay_margin():
    """Multipliers of a run with delay against characteristic roots: they share no code."""
    sine = sd.Sine(1.55, amplitude=0.5)
    curve = sd.parameter_curve(
        lambda delay: (late_seat(delay), sine), 0.0225, 0.0231, name="delay", unit="s"
    )
    margin = float(sd.delay_margin(late_seat(0.0)).delay_margin)
    assert curve.event_kind.values.tolist() == ["Neimark-Sacker"]
    assert float(curve.event_delay[0]) == pytest.approx(margin, rel=1e-6)


def test_curve_of_a_seat_with_hysteresis_is_a_row_of_steady_states():
    system = paper_system(sd.DahlFriction(50.0, 1e5))
    curve = sd.response_curve(system, (1.5, 1.6), 0.5)
    assert curve.attrs["status"] == "ok"
    state = sd.steady_state(system, sd.Sine(1.6, amplitude=0.5))
    for name in ("acc_seat", "seat-base"):
        row = curve.amplitude.sel(output=name)[0]
        assert float(row[-1]) == pytest.approx(float(state.amplitude.sel(output=name)), rel=1e-6)


def test_unstable_start_says_so():
    curve = sd.response_curve(paper_system(c=10.0), (1.0, 2.0), 0.5)
    assert curve.attrs["status"] == "unstable"


@pytest.mark.parametrize(
    ("arguments", "options", "message"),
    [
        (((1.0, 1.0), 0.5), {}, "range"),
        (((0.0, 1.0), 0.5), {}, "frequency"),
        ((1.0, 0.5), {}, "two numbers"),
        (((1.0, 2.0), 0.0), {}, "level"),
        (((1.0, 2.0), [0.5, -1.0]), {}, "level"),
        (((1.0, 2.0), 0.5), {"kind": "peak"}, "amplitude"),
    ],
)
def test_bad_requests_are_named(arguments, options, message):
    with pytest.raises(sd.RequestError, match=message):
        sd.response_curve(paper_system(), *arguments, **options)
