"""Steady states: against the independent oracle, and the cases that have none."""

from __future__ import annotations

import numpy as np
import pytest

import seatdyn as sd
from conftest import OFF, ON, OUTPUTS, oracle_rows, oscillator, paper_system
from seatdyn.analysis.run import Settings

CASES = {
    "table03": (OFF, 1.55, lambda p: sd.PiecewiseSpring(p, 0.02, 0.01)),
    "table04": (ON, 1.58, lambda p: sd.PiecewiseSpring(p, 0.02, 0.01)),
    "table05": (OFF, 1.55, sd.QuadraticDamper),
    "table06": (ON, 1.58, sd.QuadraticDamper),
    "table07": (OFF, 1.55, sd.CoulombFriction),
    "table08": (ON, 1.58, sd.CoulombFriction),
}


def worst_deviation(table, rows):
    """Largest deviation from the oracle, relative, or to the column's maximum at a zero."""
    body, frequency, element = CASES[table]
    largest = np.max([values for _, values in oracle_rows(f"{table}_as_printed")], axis=0)
    worst = 0.0
    for parameter, values in rows:
        state = sd.steady_state(
            paper_system(element(parameter), body=body), sd.Sine(frequency, amplitude=0.8857)
        )
        assert state.attrs["status"] == "converged"
        assert state.attrs["energy_residual"] < 1e-6
        reference = np.array(values)
        scale = np.where(reference == 0.0, largest, np.abs(reference))
        error = np.abs(state.amplitude.sel(output=OUTPUTS).values - reference) / scale
        worst = max(worst, float(error.max()))
    return worst


@pytest.mark.parametrize("table", CASES)
def test_rows_of_the_paper_agree_with_the_oracle(table):
    rows = oracle_rows(f"{table}_as_printed")
    assert worst_deviation(table, [rows[0], rows[len(rows) // 2], rows[-1]]) < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("table", CASES)
def test_all_rows_of_the_paper_agree_with_the_oracle(table):
    worst = worst_deviation(table, oracle_rows(f"{table}_as_printed"))
    print(f"{table}: worst deviation from the oracle {worst:.1e}")
    assert worst < 1e-6


def test_linear_amplitude_is_the_frequency_response(sine):
    system = paper_system()
    state = sd.steady_state(system, sine)
    response = sd.frequency_response(system, frequency=[1.55])
    for node in ("seat", "m1", "m2"):
        exact = 0.8857 * abs(complex(response.transmissibility.sel(node=node).values[0]))
        assert float(state.amplitude.sel(output=f"acc_{node}")) == pytest.approx(exact, rel=1e-8)
        harmonic = abs(complex(state.harmonics.sel(output=f"acc_{node}", harmonic=1)))
        assert harmonic == pytest.approx(exact, rel=1e-8)


def test_unstable_linear_system_is_refused(sine):
    state = sd.steady_state(paper_system(body=ON, mass=20.0), sine)
    assert state.attrs["status"] == "unstable"
    assert np.all(np.isnan(state.amplitude))
    assert "no steady state" in state.attrs["message"]


def test_quadratic_damping_can_hold_an_unstable_seat():
    """Just unstable without it; the response is judged by convergence, not by linear poles."""
    system = paper_system(sd.QuadraticDamper(2000.0), c=25.0)
    assert not sd.is_stable(system)
    state = sd.steady_state(system, sd.Sine(1.2, amplitude=3.0))
    assert state.attrs["status"] == "converged"
    assert state.attrs["floquet_max"] < 1.0
    again = sd.simulate(
        system, sd.Sine(1.2, amplitude=3.0), 60.0, output_step=1e-3, settings=Settings(rtol=1e-10)
    )
    tail = again.acceleration.sel(node="seat").where(again.time > 50.0, drop=True)
    swing = float(tail.max() - tail.min()) / 2
    assert float(state.amplitude.sel(output="acc_seat")) == pytest.approx(swing, rel=1e-4)


def test_self_excited_seat_under_a_small_sine_is_not_called_periodic():
    """A limit cycle of its own frequency beside the excitation: quasi-periodic."""
    system = paper_system(sd.QuadraticDamper(2000.0), c=15.0)
    state = sd.steady_state(system, sd.Sine(3.7, amplitude=0.01), max_periods=300)
    assert state.attrs["status"] == "no_periodic_response"
    assert np.all(np.isnan(state.amplitude))


def test_subharmonic_response_is_said_to_be_so():
    """A mass against a stop in the middle: its motion repeats after two periods."""
    stop = sd.PiecewiseSpring(20.0, 100.0, 0.0, jumping=False)
    system = oscillator(sd.Spring(1.0), sd.Damper(0.1), stop)
    sine = sd.Sine(3.3 / (2 * np.pi), amplitude=1.0)
    state = sd.steady_state(system, sine, max_periods=400)
    assert (state.attrs["status"], state.attrs["order"]) == ("subharmonic", 2)
    assert np.all(np.isnan(state.amplitude))
    run = sd.simulate(system, sine, 300 * sine.period, output_step=sine.period / 64)
    travel = run.displacement.sel(node="seat").values[-64 * 8 - 1 :]
    swing = float(np.ptp(travel))
    assert np.max(np.abs(travel[128:] - travel[:-128])) < 1e-4 * swing
    assert np.max(np.abs(travel[64:] - travel[:-64])) > 0.1 * swing
    # the motion with the period of the excitation exists, and is unstable
    balanced = sd.steady_state(system, sine, method="hb")
    assert (balanced.attrs["status"], balanced.attrs["stable"]) == ("converged", 0)


def test_chaotic_response_is_not_called_periodic():
    stop = sd.PiecewiseSpring(20.0, 100.0, 0.0, jumping=False)
    system = oscillator(sd.Spring(1.0), sd.Damper(0.1), stop)
    state = sd.steady_state(system, sd.Sine(2.9 / (2 * np.pi), amplitude=1.0), max_periods=400)
    assert state.attrs["status"] == "no_periodic_response"


def test_growth_without_bound_is_not_called_periodic(sine):
    system = paper_system(sd.CoulombFriction(1e-3), body=ON, mass=10.0)
    state = sd.steady_state(system, sine)
    assert state.attrs["status"] == "unstable"


def test_no_period_is_refused():
    with pytest.raises(sd.RequestError, match="no period"):
        sd.steady_state(paper_system(), sd.Step(0.01, 1.0))


def test_sum_of_sines_superposes():
    system = paper_system()
    parts = [sd.Sine(1.5, amplitude=0.5), sd.Sine(2.25, amplitude=0.3, phase=0.7)]
    both = sd.SineSum(parts)
    assert both.period == pytest.approx(1 / 0.75)
    state = sd.steady_state(system, both)
    alone = [sd.steady_state(system, part) for part in parts]
    for harmonic, single in ((2, alone[0]), (3, alone[1])):
        got = complex(state.harmonics.sel(output="seat", harmonic=harmonic))
        want = complex(single.harmonics.sel(output="seat", harmonic=1))
        assert got == pytest.approx(want, rel=1e-7)


def test_scaling_of_quadratic_damping():
    """a -> 4 a with beta -> beta/4 scales every motion by 4."""
    one = sd.steady_state(paper_system(sd.QuadraticDamper(800.0)), sd.Sine(1.55, amplitude=0.5))
    four = sd.steady_state(paper_system(sd.QuadraticDamper(200.0)), sd.Sine(1.55, amplitude=2.0))
    np.testing.assert_allclose(four.amplitude, 4 * one.amplitude, rtol=2e-7)


def test_gap_spring_of_one_mass_against_its_free_period():
    """Free vibration of x'' + x + 4 (|x| - 0.5)+ = 0 from 1.2: period 3.684137336 (closed form)."""
    system = oscillator(sd.Spring(1.0), sd.PiecewiseSpring(4.0, 0.5, 0.5, jumping=False))
    run = sd.simulate(
        system, sd.Still(), 3.684137336, initial=[1.2, 0.0], settings=Settings(rtol=1e-11)
    )
    # the last point lies up to one output step before the end: compare energies and phase there
    late = run.isel(time=-1)
    phase = 3.684137336 - float(late.time)
    stiff = 1.2 + 4 * 0.7
    assert float(late.displacement.sel(node="seat")) == pytest.approx(
        1.2 - stiff * phase**2 / 2, abs=1e-8
    )


def test_quadratic_decay_of_one_mass():
    """x'' + x + 0.5 x'|x'| = 0 from 1: the next maximum is at 0.593624260 below (closed form)."""
    system = oscillator(sd.Spring(1.0), sd.QuadraticDamper(0.5))
    run = sd.simulate(
        system, sd.Still(), 4.0, initial=[1.0, 0.0], settings=Settings(rtol=1e-11), output_step=1e-4
    )
    assert float(run.displacement.min()) == pytest.approx(-0.593624260, abs=2e-9)


@pytest.mark.parametrize("body", ["ksiazek1997_back_off", "stech1969_dri"])
@pytest.mark.parametrize("frequency", [0.5, 1.55, 8.0])
def test_every_amplitude_of_a_linear_seat_is_that_of_its_frequency_response(body, frequency):
    """Accelerations of light nodes, too, and peaks wherever in a step of a whole period."""
    sine = sd.Sine(frequency, amplitude=0.8857)
    system = paper_system(body=body)
    timed = sd.steady_state(system, sine, method="time")
    exact = sd.steady_state(system, sine, method="hb", tolerance=1e-10)
    assert exact.attrs["method"] == "hb"
    np.testing.assert_allclose(timed.amplitude, exact.amplitude, rtol=timed.attrs["error_estimate"])
