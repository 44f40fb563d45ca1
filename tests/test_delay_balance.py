"""Harmonic balance with delayed forces, against time integration and frequency responses."""

import numpy as np
import pytest

import seatdyn as sd
from conftest import OFF, ON, paper_system

SINES = {OFF: sd.Sine(1.55, amplitude=0.8857), ON: sd.Sine(1.58, amplitude=0.8857)}
GAP = {"bump_clearance": 0.01, "rebound_clearance": 0.01}
LAWS = {
    "quadratic": (sd.QuadraticDamper(500.0), 1e-6),
    "gap": (sd.PiecewiseSpring(1000.0, **GAP, jumping=False), 1e-6),
    "jump": (sd.PiecewiseSpring(1000.0, **GAP), 5e-6),
}


@pytest.mark.parametrize("body", [OFF, ON])
@pytest.mark.parametrize("name", LAWS)
def test_balance_and_time_agree(name, body):
    element, tolerance = LAWS[name]
    system = paper_system(element, body=body).delayed(0.015)
    balanced = sd.steady_state(system, SINES[body], method="hb", tolerance=tolerance, check=True)
    timed = sd.steady_state(system, SINES[body], method="time")
    assert balanced.attrs["status"] == timed.attrs["status"] == "converged"
    difference = np.abs(balanced.amplitude / timed.amplitude - 1.0)
    assert difference.max() <= 2 * tolerance
    assert difference.max() <= max(10 * balanced.attrs["error_estimate"], 1e-8)
    assert balanced.attrs["check_deviation"] <= tolerance
    assert balanced.attrs["energy_residual"] < 1e-6
    # one monodromy operator from two orbits that were found without each other
    assert balanced.attrs["floquet_max"] == pytest.approx(timed.attrs["floquet_max"], abs=1e-6)
    first = np.abs(balanced.floquet_multipliers.values[:2])
    assert first == pytest.approx(np.abs(timed.floquet_multipliers.values[:2]), abs=1e-6)
    for quantity in ("element_force", "acceleration", "relative_displacement"):
        ours, theirs = balanced[quantity].values, timed[quantity].values
        size = np.abs(theirs).max(axis=1, keepdims=True)
        typical = np.quantile(np.abs(ours - theirs) / size, 0.98)  # but for samples at a jump
        assert typical <= 1e-5


def test_coulomb_friction():
    system = paper_system(sd.CoulombFriction(50.0), body=ON).delayed(0.015)
    balanced = sd.steady_state(system, SINES[ON], method="hb", tolerance=1e-4)
    timed = sd.steady_state(system, SINES[ON], method="time")
    assert balanced.attrs["status"] == "converged"
    assert np.abs(balanced.amplitude / timed.amplitude - 1.0).max() <= 1e-4


@pytest.mark.parametrize("tau", [0.004, 0.06])
def test_linear_forces_with_several_delays(tau):
    # a suspension, an element and the feedback, each with its own
    system = paper_system().delayed(tau, "Damper").delayed(0.003, "feedback")
    system = sd.SeatSystem(
        system.body, system.seat, (sd.Spring(500.0, between=("base", "m1"), delay=0.02),)
    )
    balanced = sd.steady_state(system, SINES[OFF], method="hb")
    assert balanced.attrs["status"] == "converged"
    response = sd.frequency_response(system, frequency=[1.55])
    level = 0.8857 / (2 * np.pi * 1.55) ** 2
    for node in system.nodes:
        expected = abs(response.transmissibility.sel(node=node).item()) * level
        assert float(balanced.amplitude.sel(output=node)) == pytest.approx(expected, rel=1e-7)
    for element, output in (("Damper", "F_damper"),):
        expected = abs(response.element_force.sel(element=element).item()) * 0.8857
        assert float(balanced.amplitude.sel(output=output)) == pytest.approx(expected, rel=1e-7)
    poles = sd.poles(system).pole.values
    expected = np.exp(poles.real.max() / 1.55)
    assert balanced.attrs["floquet_max"] == pytest.approx(expected, abs=1e-8)


def test_an_unstable_motion_is_found_and_called_so():
    margin = float(sd.delay_margin(paper_system()).delay_margin)
    system = paper_system().delayed(1.05 * margin)
    balanced = sd.steady_state(system, SINES[OFF], method="hb")
    assert balanced.attrs["stable"] == 0
    poles = sd.poles(system).pole.values
    expected = np.exp(poles.real.max() / 1.55)
    assert balanced.attrs["floquet_max"] == pytest.approx(expected, abs=1e-8)


def test_many_parameter_sets():
    system = paper_system(sd.QuadraticDamper(500.0)).delayed(0.015)
    states = sd.steady_states(system, SINES[OFF], {"seat_mass": [30.0, 35.0]})
    timed = sd.steady_state(system, SINES[OFF], method="time")
    assert states.amplitude.values[1] == pytest.approx(timed.amplitude.values, rel=1e-5)
    assert float(states.floquet_max[1]) == pytest.approx(timed.attrs["floquet_max"], abs=1e-6)
    assert states.floquet_max.values[0] != states.floquet_max.values[1]
