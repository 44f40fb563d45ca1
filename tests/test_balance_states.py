"""Harmonic balance of elements with states: closed forms, time integration, and what it refuses."""

from __future__ import annotations

import math

import numpy as np
import pytest

import seatdyn as sd
from conftest import oscillator, paper_system
from seatdyn.analysis.balance import balance
from test_memory import LAWS

PLAIN = [sd.Spring(9950.0), sd.Damper(260.0)]
AIR = {"pressure": 4e5, "area": 3e-3, "volume": 1e-3, "exponent": 1.3}
MIXED = {
    "with a jump": paper_system(LAWS["dahl"][0], sd.PiecewiseSpring(1000.0, 0.02, 0.01)),
    "two of them": paper_system(LAWS["bouc-wen"][0], LAWS["lugre"][0]),
    "in the cushion": sd.SeatSystem(
        sd.load_body("fairley1989"),
        sd.Seat(
            20.0,
            PLAIN,
            cushion=[
                sd.KelvinVoigt(60e3, 700.0),
                sd.SemiActiveDamper(50.0, 900.0, 0.01, control="on-off skyhook", threshold=0.01),
            ],
        ),
    ),
    "nothing but air": sd.SeatSystem(
        sd.load_body("fairley1989"),
        sd.Seat(20.0, [sd.Damper(400.0), sd.AirSpringWithTank(tank=2e-3, restriction=2e7, **AIR)]),
    ),
}


@pytest.mark.parametrize("case", [*LAWS, *MIXED])
def test_state_agrees_with_the_one_reached_from_rest(case, sine):
    """Amplitudes within the estimate, which meets the tolerance; the time run comes back."""
    system = MIXED[case] if case in MIXED else paper_system(LAWS[case][0])
    tolerance = 1e-5 if case == "with a jump" else 3e-6
    ours = sd.steady_state(system, sine, method="hb", tolerance=tolerance, check=True)
    theirs = sd.steady_state(system, sine, method="time")
    assert ours.attrs["status"] == theirs.attrs["status"] == "converged"
    assert (ours.attrs["method"], ours.attrs["stable"]) == ("hb", 1)
    error = np.nanmax(np.abs(ours.amplitude / theirs.amplitude - 1))
    assert error <= ours.attrs["error_estimate"] <= tolerance
    assert ours.attrs["check_deviation"] < tolerance
    assert ours.attrs["energy_residual"] < 1e-6
    n = ours.sizes["node"]
    assert ours.sizes["multiplier"] == 2 * n + ours.sizes["state"]
    assert theirs.attrs["floquet_max"] == pytest.approx(ours.attrs["floquet_max"], rel=0.02)
    scale = np.abs(theirs.internal_state).max("time")
    assert (
        float((np.abs(ours.internal_state - theirs.internal_state).max("time") / scale).max())
        < 1e-4
    )


def test_a_linear_element_with_a_state_has_its_closed_form():
    """A Zener element under one mass: the complex stiffness, in every digit of the estimate."""
    mass, damping, zener = 60.0, 200.0, sd.Zener(5e3, 8e3, 0.02)
    omega = 2 * math.pi * 1.6
    system = oscillator(sd.Damper(damping), zener, mass=mass)
    found = balance(system, sd.Sine(1.6, amplitude=1.5), 1e-8)
    stiffness = 5e3 + 8e3 * 1j * omega * 0.02 / (1 + 1j * omega * 0.02) + 1j * omega * damping
    travel = abs(mass * 1.5 / (stiffness - mass * omega**2))
    high, low = found.look.extrema[:2, found.names.index("seat-base")]
    assert (high - low) / 2 == pytest.approx(travel, rel=1e-8)
    assert found.code == 0


def test_a_stuck_dahl_element_is_a_spring():
    """Far below its sliding force: sigma d, and the multipliers of the linear system."""
    sine = sd.Sine(1.6, amplitude=1e-4)
    stuck = oscillator(*PLAIN, sd.DahlFriction(50.0, 5e3), mass=60.0)
    found = sd.steady_state(stuck, sine, method="hb")
    omega = 2 * math.pi * 1.6
    travel = abs(60.0 * 1e-4 / (9950.0 + 5e3 + 260j * omega - 60.0 * omega**2))
    ratio = float(found.amplitude.sel(output="seat-base")) / travel
    assert ratio == pytest.approx(1.0, abs=5e3 * 4 * travel / 50.0)  # what slides
    decay = math.exp(-260.0 / 60.0 / 2 / 1.6)
    assert np.sort(np.abs(found.floquet_multipliers))[0] == pytest.approx(decay, rel=1e-2)


def test_in_a_batch_and_by_auto(sine):
    system = paper_system(sd.BoucWen(4e3, 0.2, 300.0, 50.0))
    sets = {"BoucWen.stiffness": [2e3, 4e3], "frequency": [1.55, 3.0]}
    states = sd.steady_states(system, sine, sets, tolerance=1e-5)
    assert states.status.values.tolist() == ["converged", "converged"]
    alone = sd.steady_state(system, sd.Sine(3.0, amplitude=0.8857), method="auto", tolerance=1e-5)
    assert alone.attrs["method"] == "hb"
    np.testing.assert_allclose(states.amplitude[1], alone.amplitude, rtol=1e-9)


def test_air_spring_alone_carries_the_seat(sine):
    """Without a linear spring the mean of the motion is held by the law alone."""
    seat = sd.Seat(20.0, [sd.Damper(400.0), sd.AirSpring(**AIR)])
    system = sd.SeatSystem(sd.load_body("fairley1989"), seat)
    ours = sd.steady_state(system, sine, method="hb", check=True)
    theirs = sd.steady_state(system, sine, method="time")
    assert ours.attrs["status"] == "converged"
    np.testing.assert_allclose(ours.amplitude, theirs.amplitude, rtol=2e-6)
    np.testing.assert_allclose(ours.maximum, theirs.maximum, rtol=2e-6)
    assert ours.attrs["energy_residual"] < 1e-6


def test_multipliers_of_a_stiff_light_cushion():
    """Its linear part is faster than the steps that the channels ask for."""
    cushion = [sd.KelvinVoigt(30e3, 800.0)]
    seat = sd.Seat(20.0, [*PLAIN, sd.QuadraticDamper(500.0)], cushion=cushion, cushion_mass=0.5)
    system = sd.SeatSystem(sd.load_body("wan1995"), seat)
    slow = sd.Sine(0.8, amplitude=1.0)
    ours = sd.steady_state(system, slow, method="hb")
    theirs = sd.steady_state(system, slow, method="time")
    np.testing.assert_allclose(
        np.abs(ours.floquet_multipliers[:3]), np.abs(theirs.floquet_multipliers[:3]), atol=1e-4
    )
