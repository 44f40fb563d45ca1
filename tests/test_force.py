"""Forces from outside on nodes, beside the base motion."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import seatdyn as sd
from conftest import oscillator, paper_system

FORCE = sd.SineForce("seat", 3.1, amplitude=40.0, phase=0.4)


def test_steady_state_is_the_receptance():
    system = paper_system()
    f = 2.3
    state = sd.steady_state(system, sd.WithForces([sd.SineForce("m1", f, rms=10.0)]))
    response = sd.receptance(system, node="m1", frequency=[f])
    for node in system.nodes:
        exact = float(abs(response.receptance.sel(node=node)[0])) * 10.0 * math.sqrt(2)
        assert float(state.amplitude.sel(output=node)) == pytest.approx(exact, rel=1e-6)
    np.testing.assert_allclose(
        response.accelerance, -((2 * np.pi * f) ** 2) * response.receptance, rtol=1e-12
    )


def test_receptance_is_symmetric_without_feedback():
    """Maxwell and Betti; the body of the paper is active, and breaks it."""
    passive = sd.SeatSystem(sd.load_body("boileau1998"), sd.load_seat("illustrative_suspension"))
    f = [1.0, 4.0, 9.0]
    one, other = passive.nodes[0], passive.nodes[-1]
    there = sd.receptance(passive, node=one, frequency=f).receptance.sel(node=other)
    back = sd.receptance(passive, node=other, frequency=f).receptance.sel(node=one)
    np.testing.assert_allclose(there, back, rtol=1e-10)
    active = paper_system()
    there = sd.receptance(active, node="seat", frequency=f).receptance.sel(node="m1")
    back = sd.receptance(active, node="m1", frequency=f).receptance.sel(node="seat")
    assert float(abs(there - back).max()) > 0.05 * float(abs(back).max())


def test_superposition_with_a_base_motion():
    system, base = paper_system(), sd.Sine(1.55, amplitude=0.8857)
    pulse = sd.PulseForce("m2", 300.0, duration=0.02, start=0.3)
    both = sd.simulate(system, sd.WithForces([FORCE, pulse], base), 1.5)
    one = sd.simulate(system, sd.WithForces([FORCE]), 1.5)
    two = sd.simulate(system, sd.WithForces([pulse]), 1.5)
    three = sd.simulate(system, base, 1.5)
    total = one.displacement + two.displacement + three.displacement
    np.testing.assert_allclose(both.displacement, total, atol=2e-8)
    assert both.attrs["energy_residual"] < 1e-8
    fine = sd.simulate(system, sd.WithForces([FORCE, pulse], base), 1.5, output_step=5e-5)
    time = fine.time.values
    power = FORCE.force(time) * fine.velocity.sel(node="seat").values
    power += pulse.force(time) * fine.velocity.sel(node="m2").values
    assert both.attrs["force_work_J"] == pytest.approx(np.trapezoid(power, time), rel=1e-4)


def test_impact_on_a_mass_is_its_closed_form():
    """A half-sine impulse on a free mass: speed 2 F T/(pi m) after it."""
    pulse = sd.PulseForce("seat", 500.0, duration=3e-3, start=0.0105)
    run = sd.simulate(oscillator(sd.Damper(0.0), mass=4.0), sd.WithForces([pulse]), 0.05)
    after = run.velocity[0].values[-1]
    assert after == pytest.approx(2 * 500.0 * 3e-3 / math.pi / 4.0, rel=1e-9)
    assert np.all(run.velocity[0].values[run.time.values <= 0.0105] == 0.0)


def test_run_with_non_linear_elements_is_that_of_an_independent_solver():
    gap, mass = sd.PiecewiseSpring(3e4, 0.004, 0.006, jumping=False), 30.0
    friction = sd.CoulombFriction(15.0, slope=200.0)
    system = oscillator(sd.Spring(6000.0), gap, friction, mass=mass)
    forces = [
        sd.SineForce("seat", 3.1, amplitude=120.0, phase=0.4),
        sd.ConstantForce("seat", -20.0),
    ]
    run = sd.simulate(system, sd.WithForces(forces), 2.0, settings=sd.Settings(rtol=1e-9))

    def rate(t, y):
        stop = 3e4 * (max(0.0, y[0] - 0.006) + min(0.0, y[0] + 0.004))
        slide = 15.0 * 2 / math.pi * math.atan(200.0 * y[1])
        push = 120.0 * math.sin(2 * math.pi * 3.1 * t + 0.4) - 20.0
        return [y[1], (push - 6000.0 * y[0] - stop - slide) / mass]

    answer = solve_ivp(
        rate, (0, 2.0), [0, 0], "DOP853", rtol=1e-11, atol=1e-13, t_eval=run.time.values,
        max_step=1e-3,
    )  # fmt: skip
    assert run.attrs["events"] > 10
    np.testing.assert_allclose(run.displacement[0], answer.y[0], atol=1e-8)


@pytest.mark.parametrize(("beta", "ratio"), [(0.8, 0.2), (1.2, 0.4), (2.0, 0.5)])
def test_dry_friction_under_a_harmonic_force_is_den_hartog(beta, ratio):
    """m x'' + k x + F sign x' = P cos w t (Den Hartog 1931): k x/P = sqrt(V^2 - (F/P)^2 U^2)."""
    mass, frequency, peak = 20.0, 2.0, 150.0
    k = mass * (2 * math.pi * frequency / beta) ** 2
    dry = sd.StribeckFriction(ratio * peak, ratio * peak, 1.0, dry=True)
    force = sd.WithForces([sd.SineForce("seat", frequency, amplitude=peak)])
    state = sd.steady_state(oscillator(sd.Spring(k), dry, mass=mass), force)
    v, u = 1 / (1 - beta**2), math.tan(math.pi / (2 * beta)) / beta
    exact = peak / k * math.sqrt(v**2 - ratio**2 * u**2)
    assert float(state.amplitude.sel(output="seat-base")) == pytest.approx(exact, rel=1e-7)


def test_force_on_the_body_is_seen_in_what_presses_the_seat():
    """At rest under a constant force on the trunk the seat carries it."""
    system = sd.SeatSystem(sd.load_body("fairley1989"), sd.Seat(20.0, [sd.Spring(9500.0)]))
    push = sd.WithForces([sd.ConstantForce("m1", -100.0)])
    run = sd.simulate(system, push, 0.1, initial="equilibrium")
    np.testing.assert_allclose(run.displacement.sel(node="seat"), -100.0 / 9500.0, rtol=1e-9)
    np.testing.assert_allclose(run.body_force, -100.0, rtol=1e-9)
    on_seat = sd.WithForces([sd.ConstantForce("seat", -100.0)])
    run = sd.simulate(system, on_seat, 0.1, initial="equilibrium")
    np.testing.assert_allclose(run.body_force, 0.0, atol=1e-6)


def test_equilibrium_with_elements_that_have_states():
    tank = sd.AirSpringWithTank(3e5, 4e-3, 8e-4, 2e-3, 1e7, 1.3)
    system = oscillator(tank, sd.Damper(10.0), mass=60.0)
    run = sd.simulate(
        system, sd.WithForces([sd.ConstantForce("seat", -50.0)]), 1.0, initial="equilibrium"
    )
    assert float(np.ptp(run.displacement.values)) < 1e-9
    assert tank.rest_force(float(run.displacement[0, 0])) == pytest.approx(-50.0, rel=1e-6)


def test_periods_of_forces_and_base():
    base = sd.Sine(2.0, amplitude=1.0)
    assert sd.WithForces([sd.SineForce("seat", 3.0, amplitude=1.0)], base).period == 1.0
    assert sd.WithForces([sd.ConstantForce("seat", 1.0)], base).period == 0.5
    assert sd.WithForces([sd.SineForce("seat", 3.0, amplitude=1.0)]).period == pytest.approx(1 / 3)
    assert sd.WithForces([sd.SineForce("seat", math.pi, amplitude=1.0)], base).period is None
    assert sd.WithForces([sd.PulseForce("seat", 1.0, 0.1)], base).period is None


def test_refused():
    both = sd.WithForces([FORCE])
    with pytest.raises(sd.RequestError, match="forces act on nodes too"):
        _ = both.motion
    with pytest.raises(sd.ExcitationError, match="exactly one level"):
        sd.SineForce("seat", 2.0)
    with pytest.raises(sd.ExcitationError, match="at least one force"):
        sd.WithForces([])
    with pytest.raises(sd.ExcitationError, match="is no base motion"):
        sd.WithForces([FORCE], both)
    with pytest.raises(sd.RequestError, match="Did you mean 'seat'"):
        sd.simulate(paper_system(), sd.WithForces([sd.ConstantForce("seet", 1.0)]), 1.0)
