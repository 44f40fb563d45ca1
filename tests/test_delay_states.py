"""Delays beside elements with states of their own and forces on nodes.

The oracles keep the states of a late element by its own late travel, s' = f(d(t - tau), ..., s(t)),
as the delay is defined; the kernel lets them go with the motion of the moment.
"""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import seatdyn as sd
from conftest import amplitude_after, oscillator, paper_system
from seatdyn.analysis.run import Problem, Settings
from test_memory import LAWS, MASS, STIFFNESS, share_held_at_the_mean

SINE = sd.Sine(1.6, amplitude=1.5)
OMEGA, LEVEL = 2 * math.pi * 1.6, 1.5 / (2 * math.pi * 1.6) ** 2
K0, K1, RELAXATION = 5e3, 8e3, 0.02  # of the Zener element of LAWS


def late(name, tau):
    return dataclasses.replace(LAWS[name][0], delay=tau)


def base(t):
    return -LEVEL * math.sin(OMEGA * t), -LEVEL * OMEGA * math.cos(OMEGA * t)


def method_of_steps(name, tau, grid, drive=base, force=lambda t: 0.0, spring=0.0, prompt=False):
    """Displacement of a mass on a spring and a late element, force and first state, by SciPy.

    spring : stiffness in N/m of a second spring, which is late as well
    prompt : the element is not
    """
    element, formula = LAWS[name]
    y = np.array([0.0, 0.0, *element.settled(-drive(0.0)[0])])
    pieces = []

    def seen(t, y):
        """Travel, its rate and the absolute velocity in state y at t."""
        x0, v0 = drive(t)
        return y[0] - x0, y[1] - v0, y[1]

    def past(t):
        """The same at t in the past; before the start all stood still."""
        if t <= 0.0:
            return -drive(0.0)[0], 0.0, 0.0
        return seen(t, pieces[min(int(t / tau), len(pieces) - 1)](t))

    def rate(t, y, first):
        then = past(-1.0 if first else t - tau)
        d, v, w = seen(t, y) if prompt else then
        pull, rates = formula(d, v, w, 0.0, y[2:])
        a = (force(t) - STIFFNESS * (y[0] - drive(t)[0]) - pull - spring * then[0]) / MASS
        return [y[1], a, *([0.0] * len(rates) if first and not prompt else rates)]

    for k in range(math.ceil(grid[-1] / tau - 1e-9)):
        piece = solve_ivp(
            rate, (k * tau, (k + 1) * tau), y, "DOP853", rtol=1e-11, atol=1e-14, args=(k == 0,),
            dense_output=True, max_step=1e-3,  # stiff states leave its dense output behind
        )  # fmt: skip
        pieces.append(piece.sol)
        y = piece.y[:, -1]
    found = []
    for t in grid:
        y = pieces[min(int(t / tau), len(pieces) - 1)](t)
        d, v, w = seen(t, y) if prompt else past(t - tau)
        found.append([y[0], formula(d, v, w, 0.0, y[2:])[0], y[2]])
    return np.array(found).T


def run(system, excitation, end, step=0.005, rtol=1e-10, **options):
    data = sd.simulate(
        system, excitation, end, output_step=step, settings=Settings(rtol=rtol), **options
    )
    assert data.attrs["status"] == "ok"
    assert data.attrs["energy_residual"] < 1e-7
    return data


@pytest.mark.parametrize(
    ("name", "tau", "tolerance"),
    [
        ("bouc-wen", 0.0203, 1e-8),
        ("bouc-wen", 0.0011, 1e-8),  # shorter than the steps
        ("lugre", 0.0203, 1e-8),
        ("zener", 0.05, 1e-9),
        ("spencer", 0.0203, 1e-8),
        ("mr", 0.0203, 1e-8),
    ],
)
def test_a_late_element_with_states_against_the_method_of_steps(name, tau, tolerance):
    end = 0.4 if tau > 0.01 else 0.05
    system = oscillator(sd.Spring(STIFFNESS), late(name, tau), mass=MASS)
    data = run(system, SINE, end, rtol=1e-11)
    x, force, state = method_of_steps(name, tau, data.time.values[1:])
    assert np.abs(data.displacement.values[0, 1:] - x).max() <= tolerance * np.abs(x).max()
    pull = data.element_force.values[1, 1:]
    assert np.abs(pull - force).max() <= 100 * tolerance * np.abs(force).max()
    states = data.internal_state.values[0, 1:]
    assert np.abs(states - state).max() <= 100 * tolerance * np.abs(state).max()


@pytest.mark.parametrize("prompt", [False, True])
def test_what_is_late_beside_an_element_with_states(prompt):
    tau, k = 0.0203, 2e3
    element = LAWS["bouc-wen"][0] if prompt else late("bouc-wen", tau)
    parts = [sd.Spring(STIFFNESS), element, sd.Spring(k, delay=tau)]
    found = run(oscillator(*parts, mass=MASS), SINE, 0.3)
    grid = found.time.values[1:]
    x, force, state = method_of_steps("bouc-wen", tau, grid, spring=k, prompt=prompt)
    assert np.abs(found.displacement.values[0, 1:] - x).max() <= 1e-8 * np.abs(x).max()
    pull = found.element_force.values[1, 1:]
    assert np.abs(pull - force).max() <= 1e-6 * np.abs(force).max()
    assert found.internal_state.values[0, 1:] == pytest.approx(state, abs=1e-6 * state.max())


def test_a_delay_of_the_suspension_is_that_of_its_elements_with_states():
    whole = oscillator(sd.Spring(2e3), LAWS["bouc-wen"][0], mass=MASS).delayed(0.02)
    single = oscillator(sd.Spring(2e3, delay=0.02), late("bouc-wen", 0.02), mass=MASS)
    found = [sd.simulate(system, SINE, 0.3).displacement for system in (whole, single)]
    assert np.all(found[0] == found[1])


def zener_response(w, tau):
    """Transmissibility of the mass on a spring, a damper of 200 N s/m and a late Zener element."""
    stiffness = K0 + K1 * 1j * w * RELAXATION / (1 + 1j * w * RELAXATION)
    prompt, drag = STIFFNESS + 200j * w, stiffness * np.exp(-1j * w * tau)
    return (prompt + drag) / (prompt + drag - MASS * w * w), stiffness


def zener_seat(tau):
    return oscillator(sd.Spring(STIFFNESS), sd.Damper(200.0), late("zener", tau), mass=MASS)


@pytest.mark.parametrize("tau", [0.0004, 0.0203])
def test_late_zener_element_in_the_frequency_domain(tau):
    system = zener_seat(tau)
    state = sd.steady_state(system, SINE, method="auto")
    assert state.attrs["method"] == "time"
    ratio, stiffness = zener_response(OMEGA, tau)
    amplitude = float(state.amplitude.sel(output="seat"))
    assert amplitude == pytest.approx(abs(ratio) * LEVEL, rel=1e-9)
    force = state.element_force.sel(element="Zener").values
    size = abs(stiffness * (ratio - 1)) * LEVEL
    assert np.sqrt(2 * np.mean(force**2)) == pytest.approx(size, rel=1e-8)
    assert state.attrs["energy_residual"] < 1e-8
    # the same of the linear analyses, and the slowest multiplier from the rightmost root
    response = sd.frequency_response(system, frequency=[1.6])
    assert abs(response.transmissibility.item()) == pytest.approx(abs(ratio), rel=1e-12)
    drag = response.element_force.sel(element="Zener").item()
    assert abs(drag) * 1.5 == pytest.approx(size, rel=1e-12)
    s = -3.0 + 15.0j
    for _ in range(60):
        stiff = K0 + K1 * s * RELAXATION / (1 + s * RELAXATION)
        square = -(STIFFNESS + 200.0 * s + stiff * np.exp(-s * tau)) / MASS
        s = 0.5 * (s + np.sqrt(square) * np.sign(np.sqrt(square).imag))
    assert abs(MASS * (s * s - square)) < 1e-6
    assert state.attrs["floquet_max"] == pytest.approx(math.exp(s.real / 1.6), abs=1e-7)


@pytest.mark.parametrize("tau", [0.0503, 0.00037])
def test_order(tau):
    """The delay is no multiple of the step, or shorter."""
    system, end = zener_seat(tau), 1.0

    def at_end(step, rtol=1e-2):
        problem = Problem.make(system, sd.Still().motion, Settings(rtol=rtol))
        problem = dataclasses.replace(problem, longest_step=step)
        return problem.run(0.0, end, problem.start(np.array([1.0, 0.0]))).end.y[0]

    exact = at_end(0.1, 1e-12)
    errors = [abs(at_end(h) - exact) for h in (0.016, 0.008, 0.004)]
    assert np.all(np.log2(np.array(errors[:-1]) / errors[1:]) > 4.0)
    assert errors[-1] < 1e-6


@pytest.mark.parametrize("name", ["bouc-wen", "mr"])
def test_a_vanishing_delay_changes_nothing(name):
    plain = run(oscillator(sd.Spring(STIFFNESS), LAWS[name][0], mass=MASS), SINE, 1.0)
    tau = 2e-6
    one, two = (
        run(oscillator(sd.Spring(STIFFNESS), late(name, k * tau), mass=MASS), SINE, 1.0)
        for k in (1, 2)
    )
    size = float(np.abs(plain.displacement).max())
    assert float(np.abs(one.displacement - plain.displacement).max()) < 1e-3 * size
    limit = 2 * one.displacement - two.displacement  # the first order in the delay is gone
    assert float(np.abs(limit - plain.displacement).max()) < 1e-7 * size


def test_a_held_damper_is_commanded_what_is_between_both_directions():
    """Dry friction holds the seat beside a late damper; the control law sees no speed then."""
    stuck = sd.StribeckFriction(sliding=25.0, static=40.0, speed=0.05, dry=True)
    parts = [sd.Spring(STIFFNESS), sd.Damper(200.0, delay=0.003), stuck, LAWS["on-off"][0]]
    data = sd.simulate(oscillator(*parts, mass=MASS), sd.Sine(5.0, amplitude=0.8), 2.0)
    assert data.attrs["energy_residual"] < 1e-6
    assert 0.05 < share_held_at_the_mean(data) < 0.95


@pytest.mark.parametrize("name", LAWS)
def test_energy_balances(name):
    system = paper_system(late(name, 0.015))
    data = sd.simulate(system, sd.Sine(2.0, amplitude=0.6), 1.0)
    assert data.attrs["status"] == "ok"
    assert data.attrs["energy_residual"] < 1e-6
    assert bool(data.internal_state.notnull().all())


def test_a_state_acts_one_delay_after_it_began_to_move():
    tau = 0.02
    data = run(oscillator(sd.Spring(STIFFNESS), late("zener", tau), mass=MASS), SINE, 0.1, 1e-3)
    state = data.internal_state.values[0]
    early = data.time.values < tau + 1e-9
    assert np.all(state[early] == state[0])
    assert np.all(state[~early] != state[0])


@pytest.mark.parametrize("tau", [0.02, 0.04])
def test_steady_state_of_a_late_controlled_damper(tau):
    """A seat with a magnetorheological damper whose commands act late.

    With 40 ms the steps of the default tolerance leave more than the tolerance of the period.
    """
    damper = sd.MRDamper(150.0, 10.0, 60.0, 1.0, 0.01, control="skyhook", gain=600.0)
    seat = sd.Seat(35.0, [sd.Spring(9950.0), dataclasses.replace(damper, delay=tau)])
    system = sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat)
    sine = sd.Sine(1.55, amplitude=0.8857)
    state = sd.steady_state(system, sine)
    assert state.attrs["status"] == "converged"
    assert state.attrs["floquet_max"] < 1.0
    amplitude = float(state.amplitude.sel(output="seat-base"))
    assert amplitude_after(system, sine, 40) == pytest.approx(amplitude, rel=2e-5)


# ---------------------------------------------------------------- forces on nodes


def test_a_harmonic_force_is_not_late():
    system = paper_system().delayed(0.015)
    force = sd.SineForce("m2", 3.0, amplitude=50.0, phase=0.7)
    state = sd.steady_state(system, sd.WithForces([force]))
    expected = sd.receptance(system, node="m2", frequency=[3.0]).receptance
    for node in system.nodes:
        amplitude = float(state.amplitude.sel(output=node))
        size = abs(expected.sel(node=node).item()) * 50.0
        assert amplitude == pytest.approx(size, rel=1e-8)
    phase = np.angle(expected.sel(node="seat").item()) + 0.7 - math.pi / 2
    first = state.harmonics.sel(output="seat", harmonic=1).item()
    assert np.angle(first) == pytest.approx(math.remainder(phase, 2 * math.pi), abs=1e-6)
    assert state.attrs["energy_residual"] < 1e-8


def test_a_pulse_on_a_late_seat_against_the_method_of_steps():
    tau, begin, last, peak = 0.0203, 0.0312, 0.05, 300.0
    pulse = sd.WithForces(
        [sd.PulseForce("seat", peak, last, begin), sd.ConstantForce("seat", -40.0)]
    )

    def force(t):
        inside = begin < t < begin + last
        return -40.0 + (peak * math.sin(math.pi * (t - begin) / last) if inside else 0.0)

    data = run(oscillator(sd.Spring(STIFFNESS), late("bouc-wen", tau), mass=MASS), pulse, 0.3)
    x, *_ = method_of_steps("bouc-wen", tau, data.time.values[1:], lambda t: (0.0, 0.0), force)
    assert np.abs(data.displacement.values[0, 1:] - x).max() <= 1e-6 * np.abs(x).max()


def test_equilibrium_under_a_load_on_a_late_seat():
    system = paper_system(LAWS["zener"][0]).delayed(0.02)
    load = sd.WithForces([sd.ConstantForce("seat", -100.0)])
    data = sd.simulate(system, load, 0.5, initial="equilibrium")
    assert np.abs(data.acceleration.values).max() <= 1e-9
    assert np.abs(data.displacement.values).max() > 1e-3
