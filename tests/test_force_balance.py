"""Harmonic balance under forces on nodes: receptances, and time integration."""

import dataclasses
import math

import numpy as np
import pytest

import seatdyn as sd
from conftest import paper_system
from test_memory import LAWS

SHAKER = sd.SineForce("m1", 3.1, amplitude=60.0, phase=0.4)
BASE = sd.Sine(1.55, amplitude=0.8857)
PUSHES = {
    "at rest": sd.WithForces([SHAKER]),
    # the base once, the force twice in a period; two on one node; a weight
    "on a moving base": sd.WithForces(
        [
            sd.SineForce("m1", 3.1, amplitude=60.0, phase=0.4),
            sd.SineForce("m1", 1.55, amplitude=20.0),
            sd.SineForce("seat", 4.65, amplitude=30.0, phase=-1.0),
            sd.ConstantForce("m2", -40.0),
        ],
        BASE,
    ),
}
LATE_ZENER = dataclasses.replace(LAWS["zener"][0], delay=0.0203)
SYSTEMS = {
    "quadratic": (paper_system(sd.QuadraticDamper(500.0)), 1e-6),
    "jump": (paper_system(sd.PiecewiseSpring(3000.0, 0.004, 0.003)), 5e-6),
    "friction": (paper_system(sd.CoulombFriction(20.0)), 1e-4),
    "hysteresis": (paper_system(LAWS["bouc-wen"][0]), 3e-6),
    "late": (paper_system(sd.QuadraticDamper(500.0)).delayed(0.015), 1e-6),
    "late, with states": (paper_system(LATE_ZENER, sd.QuadraticDamper(300.0)), 3e-6),
}


@pytest.mark.parametrize("push", PUSHES)
@pytest.mark.parametrize("name", SYSTEMS)
def test_balance_and_time_agree(name, push):
    system, tolerance = SYSTEMS[name]
    excitation = PUSHES[push]
    ours = sd.steady_state(system, excitation, method="hb", tolerance=tolerance, check=True)
    theirs = sd.steady_state(system, excitation, method="time")
    assert ours.attrs["status"] == theirs.attrs["status"] == "converged"
    assert ours.attrs["method"] == "hb"
    moving = theirs.amplitude > 1e-9 * float(theirs.amplitude.max())
    error = float(np.abs(ours.amplitude / theirs.amplitude - 1).where(moving).max())
    assert error <= tolerance
    for one in ("maximum", "minimum"):  # a constant force moves the middle
        apart = np.abs(ours[one] - theirs[one]) / theirs.amplitude
        assert float(apart.where(moving).max()) <= 2 * tolerance
    assert ours.attrs["check_deviation"] <= 2 * tolerance
    assert ours.attrs["energy_residual"] < 1e-6
    if "floquet_multipliers" in theirs:  # else the run came to rest before they were worked out
        assert ours.attrs["floquet_max"] == pytest.approx(theirs.attrs["floquet_max"], abs=1e-4)


@pytest.mark.parametrize("delay", [0.0, 0.015])
def test_a_linear_seat_has_its_receptances(delay):
    """All harmonics at once, forces and base together."""
    system = paper_system().delayed(delay, "Damper") if delay else paper_system()
    state = sd.steady_state(system, PUSHES["on a moving base"], method="hb")
    time = state.time.values
    expected = {node: np.zeros(time.size) for node in system.nodes}

    def add(node, response, frequency, size, phase):
        turn = np.exp(1j * (2 * math.pi * frequency * time + phase))
        expected[node] += (response * size * turn).imag

    for force in PUSHES["on a moving base"].forces:
        if isinstance(force, sd.ConstantForce):
            found = sd.receptance(system, node=force.node, frequency=[1e-6]).receptance
            for node in system.nodes:
                expected[node] += found.sel(node=node).item().real * force.level
            continue
        found = sd.receptance(system, node=force.node, frequency=[force.frequency]).receptance
        for node in system.nodes:
            add(node, found.sel(node=node).item(), force.frequency, force.peak, force.phase)
    found = sd.frequency_response(system, frequency=[1.55]).transmissibility
    level = -0.8857 / (2 * math.pi * 1.55) ** 2
    for node in system.nodes:
        add(node, found.sel(node=node).item(), 1.55, level, 0.0)
        ours = state.displacement.sel(node=node).values
        assert np.abs(ours - expected[node]).max() <= 1e-8 * np.abs(expected[node]).max()


def test_auto_and_what_harmonics_do_not_make():
    system, tolerance = SYSTEMS["quadratic"]
    auto = sd.steady_state(system, PUSHES["at rest"], method="auto", tolerance=tolerance)
    assert auto.attrs["method"] == "hb"
    with pytest.raises(sd.RequestError, match="has no period"):
        sd.steady_state(system, sd.WithForces([sd.PulseForce("seat", 10.0, 0.1)]), method="hb")
