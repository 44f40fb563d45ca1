"""Harmonic balance of elements with states that act late, or stand beside what does."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import seatdyn as sd
from conftest import ON, oscillator, paper_system
from seatdyn.analysis.balance import balance
from test_balance_states import AIR, PLAIN
from test_delay_states import LEVEL, OMEGA, SINE, base, zener_response, zener_seat
from test_memory import LAWS, MASS, STIFFNESS

PERIOD = 2 * math.pi / OMEGA


def late(name, tau=0.0203):
    return dataclasses.replace(LAWS[name][0], delay=tau)


JUMP = sd.PiecewiseSpring(1000.0, 0.02, 0.01)
CASES = {  # system, tolerance, agreement of the multipliers
    "dahl": (paper_system(late("dahl")), 3e-6, 1e-6),
    "lugre": (paper_system(late("lugre")), 3e-6, 2e-5),
    "bouc-wen": (paper_system(late("bouc-wen")), 3e-6, 2e-6),
    "zener": (paper_system(late("zener")), 3e-6, 1e-7),
    "tank": (paper_system(late("tank")), 3e-6, 1e-7),
    "spencer": (paper_system(late("spencer", 0.002)), 3e-6, 1e-5),
    "on-off": (paper_system(late("on-off")), 3e-6, 2e-6),
    "mr": (paper_system(late("mr", 0.004)), 3e-6, 1e-4),
    "all of it": (paper_system(LAWS["bouc-wen"][0], JUMP, body=ON).delayed(0.011), 1e-5, 1e-5),
    "a late damper beside one at once": (
        paper_system(LAWS["dahl"][0]).delayed(0.03, "Damper"),
        3e-6,
        1e-6,
    ),
    "late feedback": (
        paper_system(LAWS["bouc-wen"][0]).delayed(0.0153, "feedback"),
        3e-6,
        1e-5,
    ),
    "two of them, each with its delay": (
        paper_system(late("dahl", 0.004), late("bouc-wen", 0.0203), late("zener", 0.011)),
        3e-6,
        1e-5,
    ),
    "longer than the period": (paper_system(sd.Zener(300.0, 200.0, 0.02, delay=0.7)), 3e-6, 1e-5),
    "in the cushion": (
        sd.SeatSystem(
            sd.load_body("fairley1989"),
            sd.Seat(20.0, PLAIN, cushion=[sd.KelvinVoigt(60e3, 700.0), late("on-off", 0.004)]),
        ),
        3e-6,
        1e-4,
    ),
    "carried by air at once": (
        sd.SeatSystem(
            sd.load_body("fairley1989"),
            sd.Seat(
                20.0,
                [
                    sd.Damper(400.0, delay=0.01),
                    sd.AirSpringWithTank(tank=2e-3, restriction=2e7, **AIR),
                    late("bouc-wen", 0.02),
                ],
            ),
        ),
        3e-6,
        1e-5,
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_balance_and_time_agree(case, sine):
    """Amplitudes within the estimate, which meets the tolerance; the time run comes back."""
    system, tolerance, of_multipliers = CASES[case]
    ours = sd.steady_state(system, sine, method="hb", tolerance=tolerance, check=True)
    theirs = sd.steady_state(system, sine, method="time")
    assert ours.attrs["status"] == theirs.attrs["status"] == "converged"
    assert (ours.attrs["method"], ours.attrs["stable"]) == ("hb", 1)
    error = float(np.nanmax(np.abs(ours.amplitude / theirs.amplitude - 1)))
    assert error <= ours.attrs["error_estimate"] <= tolerance
    assert ours.attrs["check_deviation"] < tolerance
    assert ours.attrs["energy_residual"] < 1e-6
    # the states that act, of then where the element is late
    scale = np.abs(theirs.internal_state).max("time")
    apart = np.abs(ours.internal_state - theirs.internal_state).max("time")
    assert float((apart / scale).max()) < 1e-4
    assert ours.attrs["floquet_max"] == pytest.approx(
        theirs.attrs["floquet_max"], abs=of_multipliers
    )


@pytest.mark.parametrize("tau", [0.0004, 0.0203, 0.7])
def test_late_zener_element_in_closed_form(tau):
    found = balance(zener_seat(tau), SINE, 1e-9)
    ratio, stiffness = zener_response(OMEGA, tau)
    high, low = found.look.extrema[:2, found.names.index("seat-base")]
    assert (high - low) / 2 == pytest.approx(abs(ratio - 1) * LEVEL, rel=1e-8)
    high, low = found.look.extrema[:2, found.names.index("F_nonlinear")]
    assert (high - low) / 2 == pytest.approx(abs(stiffness * (ratio - 1)) * LEVEL, rel=1e-8)
    # the multipliers from the characteristic roots, which share no code with time runs
    roots = sd.poles(zener_seat(tau)).pole.values
    expected = np.sort(np.abs(np.exp(roots * PERIOD)))[::-1]
    multipliers = np.abs(found.floquet()[0])
    # the past is a polynomial over the delay
    assert multipliers[:2] == pytest.approx(expected[:2], abs=1e-7 if tau < PERIOD else 1e-4)


@pytest.mark.parametrize("name", ["bouc-wen", "zener"])
def test_the_balanced_motion_solves_the_equations_written_out(name):
    """SciPy over one period from the balanced past, states by the late travel itself."""
    tau = 0.0203
    system = oscillator(sd.Spring(STIFFNESS), sd.Damper(200.0), late(name, tau), mass=MASS)
    found = balance(system, SINE, 1e-8)
    formula = LAWS[name][1]

    def motion(t):
        there = found.sample(np.atleast_1d(OMEGA * t))
        return there.displacement[0, 0], there.velocity[0, 0], there.states[0]

    pieces = []

    def past(t):
        """Travel, its rate and the absolute velocity at t."""
        x, v = motion(t)[:2] if t <= 0.0 else pieces[min(int(t / tau), len(pieces) - 1)](t)[:2]
        x0, v0 = base(t)
        return x - x0, v - v0, v

    def rate(t, y):
        pull, rates = formula(*past(t - tau), 0.0, y[2:])
        x0, v0 = base(t)
        return [y[1], (STIFFNESS * (x0 - y[0]) + 200.0 * (v0 - y[1]) - pull) / MASS, *rates]

    x, v, states = motion(0.0)
    y = np.array([x, v, *states])
    end = 0.0
    while end < PERIOD:
        begin, end = end, min(end + tau, PERIOD)
        piece = solve_ivp(
            rate, (begin, end), y, "DOP853", rtol=1e-8, atol=1e-11, dense_output=True,
            max_step=5e-3,
        )  # fmt: skip
        pieces.append(piece.sol)
        y = piece.y[:, -1]
    whole = found.in_period()
    size = [np.abs(whole.displacement).max(), np.abs(whole.velocity).max()]
    assert np.all(np.abs(y[:2] - [x, v]) <= 1e-6 * np.array(size))
    assert np.all(np.abs(y[2:] - states) <= 1e-6 * np.abs(whole.states).max(0))


def test_an_unstable_motion_is_found_and_called_so():
    """Beyond the margin of a linear seat; multipliers from the rightmost roots."""
    seat = oscillator(sd.Spring(STIFFNESS), sd.Damper(60.0), LAWS["zener"][0], mass=MASS)
    margin = float(sd.delay_margin(seat, of="Zener").delay_margin)
    for share, stable in ((0.9, 1), (1.1, 0)):
        system = seat.delayed(share * margin, "Zener")
        state = sd.steady_state(system, SINE, method="hb")
        assert state.attrs["stable"] == stable
        largest = np.exp(sd.poles(system).pole.values.real.max() * PERIOD)
        assert state.attrs["floquet_max"] == pytest.approx(largest, abs=1e-7)


def test_many_parameter_sets(sine):
    system = paper_system(late("bouc-wen"))
    states = sd.steady_states(system, sine, {"seat_mass": [30.0, 35.0]}, tolerance=3e-6)
    alone = sd.steady_state(system, sine, method="hb", tolerance=3e-6)
    np.testing.assert_allclose(states.amplitude[1], alone.amplitude, rtol=1e-9)
    assert states.floquet_max.values[0] != states.floquet_max.values[1]


def accelerated(tau):
    """A late damper whose current is switched by the sign of the seat's acceleration."""
    damper = LAWS["mr"][0]
    switched = dataclasses.replace(damper, control="acceleration", gain=None, delay=tau)
    return paper_system(switched)


@pytest.mark.parametrize(
    ("tau", "frequency", "level"),
    [
        (0.0, 3.0, 2.0),
        (0.002, 3.0, 2.0),
        (0.008, 3.0, 2.0),
        pytest.param(0.02, 1.6, 1.5, marks=pytest.mark.slow),
        # where Newton's method in time is of no use either, while the motion repeats itself
        pytest.param(0.002, 1.0, 0.6, marks=pytest.mark.slow),
    ],
)
def test_a_switched_damper_is_finished_in_time(tau, frequency, level):
    sine = sd.Sine(frequency, amplitude=level)
    ours = sd.steady_state(accelerated(tau), sine, method="hb", tolerance=3e-6)
    theirs = sd.steady_state(accelerated(tau), sine, method="time")
    assert ours.attrs["status"] == theirs.attrs["status"] == "converged"
    assert (ours.attrs["method"], ours.attrs["finished"]) == ("hb", "time")
    error = float(np.nanmax(np.abs(ours.amplitude / theirs.amplitude - 1)))
    assert error <= ours.attrs["error_estimate"] <= 3e-6


@pytest.mark.slow
def test_a_switched_damper_that_hunts_is_refused_with_the_reason():
    """The last periods of a long run differ by tens of per cent."""
    sine, system = sd.Sine(1.0, amplitude=0.6), accelerated(0.02)
    state = sd.steady_state(system, sine, method="hb")
    assert state.attrs["status"] == "not_converged"
    assert "the control of MRDamper switches" in state.attrs["message"]
    assert "simulate" in state.attrs["message"]
    run = sd.simulate(system, sine, 40.0, output_step=1e-3, energy_check=False)
    seat = run.acceleration.sel(node="seat").values[-10001:-1].reshape(10, 1000)
    assert np.ptp(seat, axis=0).max() > 0.1 * np.abs(seat).max()
