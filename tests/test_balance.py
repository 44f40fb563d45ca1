"""Harmonic balance: closed forms, the oracle's tables, time integration, and what it refuses."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

import seatdyn as sd
from conftest import OFF, ON, OUTPUTS, oracle_rows, oscillator, paper_system
from seatdyn.analysis import steady
from seatdyn.analysis.balance import balance
from seatdyn.analysis.run import Problem, Settings
from seatdyn.analysis.steady_balance import balanced_state
from seatdyn.kernels.orbit import HIGH, LOW

TABLES = {
    "table03": (OFF, 1.55, lambda p: sd.PiecewiseSpring(p, 0.02, 0.01), 1e-5),
    "table04": (ON, 1.58, lambda p: sd.PiecewiseSpring(p, 0.02, 0.01), 1e-5),
    "table05": (OFF, 1.55, sd.QuadraticDamper, 1e-6),
    "table06": (ON, 1.58, sd.QuadraticDamper, 1e-6),
    "table07": (OFF, 1.55, sd.CoulombFriction, 1e-4),
    "table08": (ON, 1.58, sd.CoulombFriction, 1e-4),
}


@sd.force_law({"force": "N"}, jumps_at={"velocity": [0.0]})
def dry(d, v, p):
    return p[0] if v > 0.0 else (-p[0] if v < 0.0 else 0.0)


@sd.force_law({"k3": "N/m3"})
def cubic(d, v, p):
    return p[0] * d * d * d


MIXED = sd.SeatSystem(
    sd.load_body(OFF),
    sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(260.0), sd.QuadraticDamper(400.0)]),
    (
        sd.PiecewiseSpring(8000.0, 0.004, 0.003, between=("seat", "m1")),
        cubic(k3=2e9, between=("seat", "m2")),
    ),
)
SYSTEMS = {
    "quadratic": paper_system(sd.QuadraticDamper(1000.0)),
    "jump": paper_system(sd.PiecewiseSpring(1000.0, 0.02, 0.01)),
    "gap": paper_system(sd.PiecewiseSpring(1000.0, 0.02, 0.01, jumping=False)),
    "friction": paper_system(sd.CoulombFriction(30.0, slope=200.0)),
    "stop": paper_system(sd.EndStop(20000.0, 0.012, 0.01, 300.0)),
    "dry": paper_system(dry(force=20.0)),
    "several": paper_system(
        sd.QuadraticDamper(300.0),
        sd.PiecewiseSpring(1000.0, 0.02, 0.01),
        sd.CoulombFriction(10.0, slope=100.0),
    ),
    "three channels": MIXED,
}


def amplitudes(balanced):
    values = (balanced.look.extrema[HIGH] - balanced.look.extrema[LOW]) / 2
    return dict(zip(balanced.names, values, strict=True))


# ---------------------------------------------------------------- printed and closed forms


@pytest.mark.parametrize("table", TABLES)
def test_every_row_of_the_paper_agrees_with_the_oracle(table):
    """As accurate as asked, and the estimate is no less than the true error."""
    body, frequency, element, tolerance = TABLES[table]
    rows = oracle_rows(f"{table}_as_printed")
    largest = np.max([values for _, values in rows], axis=0)
    worst = 0.0
    for parameter, values in rows:
        system = paper_system(element(parameter), body=body)
        found = balance(system, sd.Sine(frequency, amplitude=0.8857), tolerance)
        got = amplitudes(found)
        reference = np.array(values)
        scale = np.where(reference == 0.0, largest, np.abs(reference))
        error = float(np.max(np.abs([got[o] for o in OUTPUTS] - reference) / scale))
        assert found.code == 0
        assert error <= found.error <= tolerance
        worst = max(worst, error)
    print(f"{table}: worst deviation {worst:.1e} of {tolerance:g}")


@pytest.mark.parametrize(
    ("beta", "rho", "printed"),
    [
        (0.8, 0.2, 2.711415),
        (0.8, 0.5, 2.332235),
        (1.2, 0.4, 1.902028),
        (1.25, 0.6, 0.988996),
        (1.5, 0.3, 0.721110),
        (2.0, 0.5, 0.220479),
    ],
)
def test_dry_friction_without_stops(beta, rho, printed):
    """Den Hartog 1931, k x0/P = z0/(beta^2 Y): six digits, and the closed form."""
    system = oscillator(sd.Spring(1.0), dry(force=rho * beta**2))  # m = Y = 1
    sine = sd.Sine(beta / (2 * math.pi), amplitude=beta**2)
    found = balance(system, sine, 1e-7)
    v, u = 1 / (1 - beta**2), math.tan(math.pi / (2 * beta)) / beta
    exact = math.sqrt(v**2 - rho**2 * u**2)
    assert exact == pytest.approx(printed, abs=6e-7)
    got = amplitudes(found)["seat-base"] / beta**2
    assert got == pytest.approx(exact, rel=max(found.error, 1e-9))
    assert found.error < 1e-6


# omega: amplitude with one harmonic; |X1|, |X3|, max |x|
DUFFING = {
    0.5: (0.373230, (0.372898, 0.005612, 0.378526)),
    0.8: (0.598887, (0.597833, 0.005939, 0.603819)),
    1.0: (0.913388, (0.909140, 0.012724, 0.922029)),
    1.2: (1.302843, (1.291902, 0.025185, 1.317560)),
    1.4: (0.321992, (0.322004, 0.000252, 0.322256)),
    2.0: (0.099903, (0.099903, 0.000004, 0.099906)),
}
DUFFING_SYSTEM = oscillator(sd.Spring(1.0), sd.Damper(0.1), cubic(k3=0.5))


def duffing(omega, amplitude):
    """x'' + 0.1 x' + x + 0.5 x^3 = 0.3 cos(omega t), x = travel, from one harmonic."""
    sine = sd.Sine(omega / (2 * math.pi), amplitude=0.3, phase=math.pi / 2)
    stiffness = 1 - omega**2 + 0.375 * amplitude**2 + 0.1j * omega
    first = amplitude * cmath.exp(1j * cmath.phase(-0.3 / stiffness))
    guess = np.array([[0.0], [first]])
    return balance(DUFFING_SYSTEM, sine, 1e-9, guess=guess)


@pytest.mark.parametrize("omega", DUFFING)
def test_duffing(omega):
    one_harmonic, printed = DUFFING[omega]
    check_duffing(duffing(omega, one_harmonic), printed, stable=True)


def check_duffing(found, printed, *, stable):
    first, third, peak = printed
    series = found.work.series[0]
    assert abs(series[1, 0]) == pytest.approx(first, abs=1e-6)
    assert abs(series[3, 0]) == pytest.approx(third, abs=1e-6)
    assert amplitudes(found)["seat-base"] == pytest.approx(peak, abs=1e-6)
    multipliers, _ = found.floquet()
    assert (abs(multipliers[0]) < 1.0) == stable
    # Liouville: their product is exp(-0.1 period)
    product = math.exp(-0.1 * 2 * math.pi / found.problem.omega)
    assert np.prod(multipliers).real == pytest.approx(product, rel=1e-6)


def test_duffing_has_three_motions():
    """At omega = 1.4: small, unstable, large."""
    check_duffing(duffing(1.4, 1.471285), (1.455691, 0.025634, 1.481770), stable=False)
    check_duffing(duffing(1.4, 1.688680), (1.669665, 0.040046, 1.710653), stable=True)


# ---------------------------------------------------------------- against time integration


@pytest.mark.parametrize("name", SYSTEMS)
def test_motion_repeats_itself_in_time_and_multipliers_are_those_of_the_period_map(name, sine):
    system = SYSTEMS[name]
    found = balance(system, sine, 1e-7)
    problem = Problem.make(system, sine.motion, Settings(rtol=1e-12))

    def after(y):
        return problem.run(0.0, sine.period, problem.start(y)).end.y

    start = found.start()
    n = start.size // 2
    scale = np.repeat([np.abs(start[:n]).max(), np.abs(start[n:]).max()], n)
    assert np.max(np.abs(after(start) - start) / scale) < max(10 * found.error, 1e-8)
    matrix = np.empty((2 * n, 2 * n))
    for i, size in enumerate(scale):
        step = np.eye(2 * n)[i] * 1e-6 * size
        matrix[:, i] = (after(start + step) - after(start - step)) / (2e-6 * size)
    exact = np.linalg.eigvals(matrix)
    multipliers, slowest = found.floquet()
    assert slowest > 0.1  # of the largest velocity: no jump is grazed
    for value in multipliers:
        assert np.min(np.abs(exact - value)) < 3e-5


@pytest.mark.parametrize("name", SYSTEMS)
def test_state_agrees_with_the_one_reached_from_rest(name, sine):
    balanced = sd.steady_state(SYSTEMS[name], sine, method="hb", check=True)
    reached = sd.steady_state(SYSTEMS[name], sine, method="time")
    assert balanced.attrs["status"] == reached.attrs["status"] == "converged"
    assert (balanced.attrs["method"], reached.attrs["method"]) == ("hb", "time")
    assert balanced.attrs["stable"] == reached.attrs["stable"] == 1
    np.testing.assert_allclose(balanced.amplitude, reached.amplitude, rtol=2e-6)
    np.testing.assert_allclose(balanced.rms, reached.rms, rtol=1e-4)
    np.testing.assert_allclose(
        balanced.floquet_multipliers[:2], reached.floquet_multipliers[:2], atol=1e-4
    )
    assert balanced.attrs["check_deviation"] < 2e-6
    assert balanced.attrs["energy_residual"] < 2e-5
    for node in ("seat", "m1"):
        ours = balanced.displacement.sel(node=node)
        theirs = reached.displacement.sel(node=node)
        np.testing.assert_allclose(ours, theirs, atol=1e-6 * float(abs(theirs).max()))
    first = balanced.harmonics.sel(output="seat-base").values[:5]
    np.testing.assert_allclose(
        first, reached.harmonics.sel(output="seat-base").values[:5], atol=1e-6 * abs(first).max()
    )


def test_sum_of_sines_and_a_standing_offset():
    sines = sd.SineSum([sd.Sine(1.5, amplitude=0.5), sd.Sine(2.25, amplitude=0.3, phase=0.7)])
    system = paper_system(sd.QuadraticDamper(500.0), sd.Preload(40.0))
    balanced = sd.steady_state(system, sines, method="hb")
    reached = sd.steady_state(system, sines, method="time")
    np.testing.assert_allclose(balanced.amplitude, reached.amplitude, rtol=1e-6)
    np.testing.assert_allclose(balanced.maximum, reached.maximum, rtol=2e-6)


# ---------------------------------------------------------------- which method, and refusals


def test_auto_takes_what_is_accurate(sine):
    assert sd.steady_state(SYSTEMS["quadratic"], sine, method="auto").attrs["method"] == "hb"
    sharp = paper_system(sd.CoulombFriction(50.0))
    exact = sd.steady_state(sharp, sine, method="auto")
    assert exact.attrs["method"] == "time"
    quick = sd.steady_state(sharp, sine, method="auto", tolerance=1e-4)
    assert quick.attrs["method"] == "hb"
    assert quick.attrs["error_estimate"] < 1e-4
    np.testing.assert_allclose(quick.amplitude, exact.amplitude, rtol=1e-4)


def test_an_unstable_motion_is_marked(sine):
    """The unstable linear system has a periodic solution, which no one will see."""
    state = sd.steady_state(paper_system(body=ON, mass=20.0), sine, method="hb")
    assert state.attrs["status"] == "converged"
    assert state.attrs["stable"] == 0
    assert state.attrs["floquet_max"] > 1.0
    assert "unstable" in state.attrs["message"]


def test_sticking_is_finished_in_time(sine):
    """Dry friction that holds the seat for a part of the period."""
    system = paper_system(dry(force=90.0))
    state = sd.steady_state(system, sine, method="hb", tolerance=1e-9)
    assert (state.attrs["status"], state.attrs["finished"]) == ("converged", "time")
    reached = sd.steady_state(system, sine)
    assert reached.attrs["method"] == "time"
    np.testing.assert_allclose(state.amplitude, reached.amplitude, rtol=1e-5)


def test_what_is_finished_in_time_has_the_error_asked_for(sine, monkeypatch):
    """A motion that repeats itself within the tolerance may be further from the true one."""
    original = steady.find_orbit

    def less_sure(*arguments, **options):
        orbit = original(*arguments, **options)
        orbit.error = 2e-9
        return orbit

    monkeypatch.setattr(steady, "find_orbit", less_sure)
    state = sd.steady_state(paper_system(dry(force=90.0)), sine, method="hb", tolerance=1e-9)
    assert state.attrs["status"] != "converged"


def test_grazing_has_no_multipliers():
    """A jump reached with almost no speed."""
    free = balance(paper_system(), sd.Sine(1.55, amplitude=0.8857), 1e-9)
    reach = free.look.extrema[HIGH, free.names.index("seat-base")]
    system = paper_system(sd.PiecewiseSpring(1.0, 1.0, reach * (1 - 1e-7)))
    state = sd.steady_state(system, sd.Sine(1.55, amplitude=0.8857), method="hb", tolerance=1e-4)
    assert state.attrs["status"] == "grazing"
    assert np.all(np.isnan(state.floquet_multipliers))
    assert "stable" not in state.attrs
    assert float(state.amplitude.sel(output="seat-base")) == pytest.approx(
        float((free.look.extrema[HIGH] - free.look.extrema[LOW])[6] / 2), rel=1e-3
    )


def test_too_coarse_is_said(sine):
    found = balance(SYSTEMS["friction"], sine, 1e-12, most=256)
    state = balanced_state(found, sine, 1e-12, check=False)
    assert state.attrs["status"] == "not_accurate"
    assert state.attrs["error_estimate"] > 1e-12


def test_bad_requests(sine):
    with pytest.raises(sd.RequestError, match="method = 'newton' is not allowed"):
        sd.steady_state(paper_system(), sine, method="newton")
