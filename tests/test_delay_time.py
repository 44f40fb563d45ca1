"""Time runs with delayed forces, against closed forms and an independent method of steps."""

import dataclasses
from math import factorial

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import seatdyn as sd
from conftest import OFF, ON, amplitude_after, oscillator, paper_system
from oracle.equations import BODIES, DAMPING, SEAT_MASS, STIFFNESS
from seatdyn.analysis.run import Problem, Settings

SINE = sd.Sine(1.55, amplitude=0.8857)
RATE = 2 * np.pi * 1.5  # rad/s


def delayed_cosine(rate, tau, t):
    """Solution of x'' = -rate^2 x(t - tau) with x = 1 before, a polynomial on every interval."""
    x = np.ones_like(t)
    for n in range(1, 60):
        late = np.maximum(t - (n - 1) * tau, 0.0)
        x += (-1.0) ** n * (rate * late) ** (2 * n) / factorial(2 * n)
    return x


def method_of_steps(late, tau, excitation, end):
    """Seat displacement at multiples of 10 ms by SciPy, one interval of the delay after another.

    late(d, v) : force of the suspension in N on what the seat did a delay ago, relative to the base
    """
    body = BODIES["back_off"]
    x0, v0 = excitation.displacement, excitation.velocity
    pieces = []

    def past(t):
        if t <= 0.0:
            return -float(x0(0.0)), 0.0  # all stood still
        y = pieces[min(int(t / tau), len(pieces) - 1)](t)
        return y[0] - float(x0(t)), y[3] - float(v0(t))

    def rhs(t, y):
        x, x1, x2, v, v1, v2 = y
        f1 = body.k1 * (x1 - x) + body.al1 * (v1 - v)
        f2 = body.k2 * (x2 - x) + body.al2 * (v2 - v)
        active = body.active_force(y)
        seat = (f1 + f2 - late(*past(t - tau))) / SEAT_MASS
        return [v, v1, v2, seat, (active - f1) / body.m1, (-active - f2) / body.m2]

    grid, found, y = np.arange(0.01, end + 1e-9, 0.01), [], np.zeros(6)
    for k in range(int(np.ceil(end / tau))):
        span = (k * tau, (k + 1) * tau)
        # the delayed base starts with a velocity: its first interval must not see it early
        piece = solve_ivp(rhs, span, y, "DOP853", rtol=1e-12, atol=1e-14, dense_output=True)
        pieces.append(piece.sol)
        y = piece.y[:, -1]
        found += [piece.sol(t)[0] for t in grid[(grid > span[0]) & (grid <= span[1])]]
    return np.array(found)


def seat_of(system, excitation, end, rtol=1e-10, **options):
    data = sd.simulate(
        system, excitation, end, output_step=0.01, settings=Settings(rtol=rtol), **options
    )
    assert data.attrs["status"] == "ok"
    assert data.attrs["energy_residual"] < 1e-7
    return data.displacement.sel(node="seat").values[1:]


@pytest.mark.parametrize("tau", [0.05, 0.0503, 0.3])
def test_delayed_spring_against_its_closed_form(tau):
    system = oscillator(sd.Spring(RATE**2)).delayed(tau)
    data = sd.simulate(
        system, sd.Still(), 1.0, output_step=0.01, initial=[1.0, 0.0], settings=Settings(rtol=1e-10)
    )
    exact = delayed_cosine(RATE, tau, data.time.values)
    assert np.abs(data.displacement.values[0] - exact).max() <= 1e-9 * np.abs(exact).max()
    assert data.attrs["energy_residual"] < 1e-9


def fixed_steps(system, step, end, y):
    """State at the end with steps of one size, but for those that land on breaks."""
    problem = Problem.make(system, sd.Still().motion, Settings(rtol=1e-2))
    problem = dataclasses.replace(problem, longest_step=step)
    run = problem.run(0.0, end, problem.start(np.array(y)))
    return run.end.y[0], run.steps


def test_order_where_the_delay_is_no_multiple_of_the_step():
    tau, end = 0.0503, 1.0
    exact = delayed_cosine(RATE, tau, np.array([end]))[0]
    system = oscillator(sd.Spring(RATE**2)).delayed(tau)
    steps = np.array([0.04, 0.02, 0.01, 0.005])
    errors = [abs(fixed_steps(system, h, end, [1.0, 0.0])[0] - exact) for h in steps]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > 4.0)
    assert errors[-1] < 1e-10


def test_order_where_the_delay_is_shorter_than_the_step():
    tau, end = 0.00037, 1.0
    system = oscillator(sd.Spring(RATE**2), sd.Damper(4.0)).delayed(tau)

    def at_end(rtol):
        problem = Problem.make(system, sd.Still().motion, Settings(rtol=rtol))
        run = problem.run(0.0, end, problem.start(np.array([1.0, 0.0])))
        return run.end.y[0], run.steps

    reference = at_end(1e-12)[0]
    values, steps = np.array([at_end(10.0**-e) for e in (4, 5, 6, 7, 8, 9)]).T
    assert end / steps[0] > 20 * tau  # steps are much longer
    slope = np.polyfit(np.log(steps), np.log(np.abs(values - reference)), 1)[0]
    assert slope < -4.0
    # and the limit is the right one: the frequency and damping of the dominant pole
    pole = sd.poles(system).pole.values
    s = pole[np.argmax(pole.real)]
    data = sd.simulate(
        system, sd.Still(), 1.0, output_step=0.05, initial=[1.0, 0.0], settings=Settings(rtol=1e-11)
    )
    recursion(data.displacement.values[0][2:], s, 0.05, 1e-8)


def recursion(x, s, step, tolerance):
    """Samples of one decaying or growing oscillation obey its recursion."""
    z = np.exp(s * step)
    left = x[2:] - 2 * z.real * x[1:-1] + abs(z) ** 2 * x[:-2]
    assert np.abs(left).max() <= tolerance * np.abs(x).max()


@pytest.mark.parametrize("tau", [0.005, 0.0203])
def test_smooth_laws_against_the_method_of_steps(tau):
    system = paper_system(sd.QuadraticDamper(300.0)).delayed(tau)
    found = seat_of(system, SINE, 0.6)
    other = method_of_steps(
        lambda d, v: STIFFNESS * d + DAMPING * v + 300.0 * abs(v) * v, tau, SINE, 0.6
    )
    assert np.abs(found - other).max() <= 1e-8 * np.abs(other).max()


def test_a_short_delay_against_the_method_of_steps():
    tau = 0.0004
    found = seat_of(paper_system().delayed(tau), SINE, 0.1)
    other = method_of_steps(lambda d, v: STIFFNESS * d + DAMPING * v, tau, SINE, 0.1)
    assert np.abs(found - other).max() <= 1e-8 * np.abs(other).max()


def test_corners_of_the_base_motion_are_felt_once_more():
    tau, shock = 0.0203, sd.HalfSineShock(20.0, 0.011)
    system = paper_system(sd.TangentPolynomialSpring(5000.0, 0.1, [0.0, 0.0, 1e6])).delayed(tau)
    spring = sd.TangentPolynomialSpring(5000.0, 0.1, [0.0, 0.0, 1e6])
    other = method_of_steps(
        lambda d, v: STIFFNESS * d + DAMPING * v + float(spring.force_at(d)), tau, shock, 0.3
    )
    found = seat_of(system, shock, 0.3)
    assert np.abs(found - other).max() <= 2e-7 * np.abs(other).max()


def test_jump_of_a_delayed_law():
    gamma, zone, speed, tau, mass = 200.0, 0.1, 1.0, 0.05, 2.0
    spring = sd.PiecewiseSpring(gamma, 1.0, zone)
    system = oscillator(spring, mass=mass).delayed(tau)
    end = zone / speed + 1.9 * tau
    data = sd.simulate(
        system, sd.Still(), end, output_step=end / 50, initial=[0.0, speed],
        settings=Settings(rtol=1e-11),
    )  # fmt: skip
    # free until the force of the threshold arrives, then a cubic
    t, begin = data.time.values, zone / speed
    u = np.maximum(t - tau, begin)
    gained = (u**3 - begin**3) / 6 - begin**2 * (u - begin) / 2
    exact = speed * t - gamma * speed / mass * gained
    assert np.abs(data.displacement.values[0] - exact).max() <= 1e-12
    assert data.attrs["events"] == 1
    force = data.element_force.values[0]
    assert force == pytest.approx(np.where(t > begin + tau, gamma * speed * (t - tau), 0.0))


def test_before_the_start_all_stood_still():
    tau = 0.02
    data = sd.simulate(paper_system().delayed(tau), SINE, 0.05, output_step=1e-3)
    seat, early = data.acceleration.sel(node="seat").values, data.time.values < tau - 1e-9
    assert np.all(seat[early] == 0.0)
    assert np.all(data.element_force.sel(element="Damper").values[early] == 0.0)
    # then it feels the velocity with which the base began
    at_tau = round(tau / 1e-3)
    expected = DAMPING * float(SINE.velocity(0.0)) / SEAT_MASS
    assert seat[at_tau] == pytest.approx(expected, rel=1e-6)
    then = data.element_force.sel(element="Spring").values
    travel = data.relative_displacement.sel(pair="seat-base").values
    assert then[at_tau:] == pytest.approx(STIFFNESS * travel[: then.size - at_tau], abs=1e-9)


@pytest.mark.parametrize("what", ["feedback", "Damper"])
def test_growth_is_that_of_the_rightmost_pole(what):
    tau = 0.05 if what == "feedback" else 0.2
    system = paper_system(body=OFF).delayed(tau, what)
    poles = sd.poles(system).pole.values
    s = poles[np.argmax(poles.real)]
    assert s.real > 0.0
    data = sd.simulate(
        system, sd.Still(), 12.0, output_step=0.05, initial=[0.01, 0, 0, 0, 0, 0],
        settings=Settings(rtol=1e-11),
    )  # fmt: skip
    late = data.displacement.sel(node="m2").values[160:]
    recursion(late, s, 0.05, 1e-6)


def test_several_delays_in_time_and_in_the_frequency_response():
    system = paper_system().delayed(0.004).delayed(0.003, "feedback").delayed(0.009, "Damper")
    assert len(system.delays) == 3
    state = sd.steady_state(system, SINE)
    response = sd.frequency_response(system, frequency=[1.55])
    level = 0.8857 / (2 * np.pi * 1.55) ** 2
    for node in system.nodes:
        expected = abs(response.transmissibility.sel(node=node).item()) * level
        assert float(state.amplitude.sel(output=node)) == pytest.approx(expected, rel=1e-8)
    for element in ("Spring", "Damper"):
        force = state.element_force.sel(element=element).values
        expected = abs(response.element_force.sel(element=element).item()) * 0.8857
        assert (force.max() - force.min()) / 2 == pytest.approx(expected, rel=1e-4)
    assert state.attrs["energy_residual"] < 1e-8


@pytest.mark.parametrize(("tau", "frequency"), [(0.02, 1.55), (0.05, 25.0)])
def test_floquet_multipliers_of_a_linear_system(tau, frequency):
    # the second delay is longer than the period
    system = paper_system().delayed(tau, "suspension" if tau < 0.03 else "Damper")
    state = sd.steady_state(system, sd.Sine(frequency, amplitude=1.0))
    assert state.attrs["status"] == "converged"
    poles = sd.poles(system).pole.values
    assert state.attrs["floquet_max"] == pytest.approx(
        np.exp(poles.real.max() / frequency), abs=1e-8
    )
    level = 1.0 / (2 * np.pi * frequency) ** 2
    response = sd.frequency_response(system, frequency=[frequency])
    expected = abs(response.transmissibility.sel(node="m2").item()) * level
    assert float(state.amplitude.sel(output="m2")) == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize(
    "element",
    [sd.QuadraticDamper(500.0), sd.CoulombFriction(50.0), sd.PiecewiseSpring(1000.0, 0.01, 0.01)],
)
def test_steady_state_is_what_a_long_run_ends_in(element):
    system = paper_system(element, body=ON).delayed(0.015)
    sine = sd.Sine(1.58, amplitude=0.8857)
    state = sd.steady_state(system, sine)
    assert state.attrs["status"] == "converged"
    assert state.attrs["floquet_max"] < 1.0
    amplitude = float(state.amplitude.sel(output="seat-base"))
    assert amplitude_after(system, sine, 60) == pytest.approx(amplitude, rel=2e-5)
    # and a run that starts on it stays on it
    period = 1.0 / 1.58
    again = sd.simulate(system, sine, 3 * period, output_step=period / 500, initial="periodic")
    travel = again.relative_displacement.sel(pair="seat-base").values
    assert travel[:501] == pytest.approx(travel[1000:1501], abs=2e-6 * amplitude)


def test_no_steady_state_beyond_the_margin():
    margin = float(sd.delay_margin(paper_system()).delay_margin)
    below = sd.steady_state(paper_system().delayed(0.99 * margin), SINE)
    beyond = sd.steady_state(paper_system().delayed(1.01 * margin), SINE)
    assert below.attrs["status"] == "converged"
    assert beyond.attrs["status"] == "unstable"
    assert np.all(np.isnan(beyond.amplitude))


def test_dry_friction_sticks_beside_a_delayed_damper():
    friction = sd.StribeckFriction(90.0, 100.0, speed=0.01, dry=True)
    sine = sd.Sine(1.0, amplitude=0.9)
    plain = sd.simulate(paper_system(friction), sine, 3.0)
    late = sd.simulate(paper_system(friction).delayed(1e-7, "Damper"), sine, 3.0)
    assert late.attrs["energy_residual"] < 1e-6
    travel = [data.relative_displacement.sel(pair="seat-base") for data in (plain, late)]
    stuck = np.mean(np.abs(np.diff(travel[1].values)) < 1e-13)
    assert stuck > 0.05  # it does rest
    assert np.abs(travel[0] - travel[1]).max() <= 1e-5 * np.abs(travel[0]).max()


def test_equilibrium_under_a_delayed_suspension():
    system = paper_system(sd.Preload(99.5)).delayed(0.02)
    data = sd.simulate(system, sd.Still(), 0.5, initial="equilibrium")
    assert np.abs(data.acceleration.values).max() <= 1e-9
    assert data.relative_displacement.sel(pair="seat-base").values == pytest.approx(
        data.relative_displacement.values[0, 0]
    )


def test_a_long_run_in_pieces():
    seen = []
    system = paper_system().delayed(0.015)
    data = sd.simulate(system, SINE, 70.0, output_step=0.01, progress=seen.append)
    assert seen == pytest.approx([1 / 3, 2 / 3, 1.0])
    response = sd.frequency_response(system, frequency=[1.55])
    level = abs(response.transmissibility.sel(node="m1").item()) * 0.8857 / (2 * np.pi * 1.55) ** 2
    tail = data.displacement.sel(node="m1").values[-2000:]
    assert tail.max() == pytest.approx(level, rel=1e-3)
    assert data.attrs["energy_residual"] < 1e-8


def test_a_delay_too_short_for_time_is_refused():
    with pytest.raises(sd.RequestError, match="1e-12 s"):
        sd.simulate(paper_system().delayed(1e-12), SINE, 1.0)
