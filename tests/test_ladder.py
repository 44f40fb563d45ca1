"""Exact propagators of the linear part, and the steps that are made of them."""

from __future__ import annotations

import copy
import math
import pickle

import mpmath
import numba
import numpy as np
import pytest

import seatdyn as sd
from conftest import oscillator, paper_system
from seatdyn.analysis.ladder import INSTANTS, _propagators
from seatdyn.analysis.run import Problem, Settings
from seatdyn.kernels import dense
from seatdyn.kernels.exponential import LATER, LEVELS, NODES, POINTS, TO_BERNSTEIN
from seatdyn.kernels.product import product


def exact(a, g, h, place, degree):
    """T and the answer to an input (2 s - 1)^degree, s = 0 .. 1 over the step, with 40 digits."""
    size = a.shape[0]
    with mpmath.workdps(40):
        # the powers s^0 / 0!, s^1 / 1!, ... drive each other
        whole = mpmath.zeros(size + degree + 1)
        for i in range(size):
            for j in range(size):
                whole[i, j] = mpmath.mpf(a[i, j]) * mpmath.mpf(h)
            for k in range(degree + 1):
                weight = mpmath.binomial(degree, k) * 2**k * (-1) ** (degree - k)
                weight *= mpmath.factorial(k)
                whole[i, size + k] = mpmath.mpf(g[i]) * mpmath.mpf(h) * weight
        for k in range(degree):
            whole[size + k + 1, size + k] = 1
        found = mpmath.expm(whole * mpmath.mpf(place))
        numbers = np.array([[float(x) for x in row] for row in found.tolist()])
    return numbers[:size, :size], numbers[:size, size]


@pytest.mark.parametrize("rate", [1.0, 1e4])
def test_propagators_have_all_their_digits(rate):
    """Of a damped oscillator with a force, from steps of microseconds on."""
    a = np.array([[0.0, 1.0], [-(rate**2), -0.4 * rate]])
    g = np.array([0.0, 1.0])
    steps = 0.3 * 2.0 ** np.arange(1 - LEVELS, 1)
    free, driven = _propagators(a, g[:, None], steps)
    for level in (0, 7, LEVELS - 1):
        for place in (0, 4, LATER, LATER + 1):
            for degree in (0, 5, 8):
                transition, answer = exact(a, g, steps[level], INSTANTS[1 + place], degree)
                ours = driven[level, place, :, 0] @ (2 * NODES - 1) ** degree
                change = free[level, place] - np.eye(2), transition - np.eye(2)
                np.testing.assert_allclose(*change, rtol=1e-12, atol=2e-16)
                full = np.abs(exact(a, g, steps[level], INSTANTS[1 + place], 0)[1]).max()
                assert np.all(np.abs(ours - answer) < 1e-14 * full * np.array([1.0, rate]))


@pytest.mark.parametrize(
    "element",
    [
        sd.QuadraticDamper(1000.0),
        sd.PiecewiseSpring(1000.0, 0.02, 0.01),
        sd.CoulombFriction(30.0, slope=200.0),
    ],
    ids=lambda element: type(element).__name__,
)
def test_tight_tolerances_are_kept_without_a_flood_of_steps(element):
    """Roundings of the propagators once held the steps back: 130,000 where 3,000 are enough."""
    sine = sd.Sine(1.55, amplitude=0.8857)
    system = paper_system(element)
    ends, steps = [], []
    for settings in (Settings(rtol=1e-8), Settings(rtol=1e-12)):
        problem = Problem.make(system, sine.motion, settings)
        run = problem.run(0.0, 8 * sine.period, problem.start(np.zeros(6)))
        ends.append(run.end.y)
        steps.append(run.steps)
    by_others = Problem.make(system, sine.motion, Settings(rtol=1e-12, method="runge-kutta"))
    end = by_others.run(0.0, 8 * sine.period, by_others.start(np.zeros(6))).end.y
    scale = np.repeat([np.abs(end[:3]).max(), np.abs(end[3:]).max()], 3)
    assert np.max(np.abs(ends[0] - end) / scale) < 1e-9
    assert np.max(np.abs(ends[1] - end) / scale) < 1e-11
    assert steps[1] < 4 * steps[0]


@pytest.mark.parametrize("method", ["ladder", "runge-kutta"])
def test_a_law_that_gives_no_number_ends_the_run_there(method):
    @sd.force_law({"stiffness": "N/m", "edge": "m"})
    def root(d, v, p):
        return p[0] * (math.sqrt(p[1]) - math.sqrt(p[1] - d))

    run = sd.simulate(
        paper_system(root(stiffness=100.0, edge=0.005)), sd.Sine(1.55, amplitude=0.8857), 2.0,
        settings=Settings(method=method),
    )  # fmt: skip
    assert run.attrs["status"] == "step_too_small"
    assert "no number" in run.attrs["message"]
    assert np.all(np.isfinite(run.displacement))
    assert 0.0 < run.time[-1] < 0.2  # where the edge is


def test_a_copy_of_a_problem_outlives_it():
    sine = sd.Sine(1.55, amplitude=0.8857)
    problem = Problem.make(paper_system(sd.QuadraticDamper(1000.0)), sine.motion, Settings())
    end = problem.run(0.0, 1.0, problem.start(np.zeros(6))).end.y
    copies = copy.deepcopy(problem), pickle.loads(pickle.dumps(problem))
    del problem
    rubbish = [np.full(1000, math.nan) for _ in range(1000)]
    for twin in copies:
        assert np.array_equal(twin.run(0.0, 1.0, twin.start(np.zeros(6))).end.y, end)
    del rubbish


@pytest.mark.parametrize("parts", [(dense.FIRST_HALF, dense.SECOND_HALF), (dense.SINGLE,) * 2])
@pytest.mark.parametrize("h", [1e-11, 1e-7, 3e-5])
def test_velocities_are_right_in_the_shortest_steps(parts, h):
    """A break just behind the end of a step leaves a next step of next to nothing."""
    times = 1.0 + h * np.arange(3)

    def motion(t):
        return 0.1 * np.sin(30.0 * t), 3.0 * np.cos(30.0 * t), -90.0 * np.sin(30.0 * t)

    z, v, a = motion(times)
    record = np.column_stack([times, z, v, a, np.append(a[1:], a[-1])])
    marks = np.array([[*parts, dense.SINGLE]]).T
    inside = np.linspace(times[0], times[-1], 41)
    found = dense.states(record, marks, inside)
    np.testing.assert_allclose(found[:, 0], motion(inside)[0], rtol=1e-13)
    np.testing.assert_allclose(found[:, 1], motion(inside)[1], rtol=1e-10)


def both(system, excitation, start, duration, rtol):
    """The run by the ladder, and the one by Dormand-Prince steps at the tightest tolerance."""
    runs = []
    for settings in (Settings(rtol=rtol), Settings(rtol=1e-12, method="runge-kutta")):
        problem = Problem.make(system, excitation.motion, settings)
        runs.append(problem.run(0.0, duration, problem.start(np.array(start, dtype=float))))
    return runs


def worst_between_steps(ours, theirs, duration):
    """Largest deviation of displacements and velocities at any time, over the largest of them."""
    time = np.linspace(0.0, duration, 5001)
    found, expected = ours.states(time), theirs.states(time)
    n = found.shape[1] // 2
    scale = np.repeat([np.abs(expected[:, :n]).max(), np.abs(expected[:, n:]).max()], n)
    return float(np.max(np.abs(found - expected) / scale))


def test_a_step_that_is_cut_ends_where_it_says():
    """At a graze its place is corrected so often that the last correction came without a state."""
    omega, natural, damping, depth = 2 * math.pi * 1.5, 2 * math.pi * 2.2, 1.4, 1e-9
    answer = -1.0 / (natural**2 - omega**2 + 1j * omega * damping)
    edge, sine = abs(answer) * (1 - depth), sd.Sine(1.5, amplitude=1.0)
    seat = oscillator(
        sd.Spring(natural**2), sd.Damper(damping), sd.PiecewiseSpring(natural**2, 1.0, edge)
    )
    start = answer.imag, (1j * omega * answer).imag + float(sine.velocity(0.0))
    run = both(seat, sine, start, 1.0, 1e-11)[0]
    first = 1 + int(np.argmax(np.any(np.diff(run.marks[:, :2], axis=0) != 0, axis=1)))
    time, displacement = run.record[first, :2]
    assert abs(displacement - float(sine.displacement(time)) - edge) < 1e-11 * edge
    reached = (math.asin(1 - depth) - np.angle(answer)) % (2 * math.pi) / omega
    assert abs(time - reached) < 1e-8


def test_a_cut_step_keeps_its_solution_between_its_ends():
    """Where light masses hang on stiff links, laws make large accelerations of tiny errors."""
    body = sd.SeatedBody("light", {"n1": 0.002}, (sd.Link(("seat", "n1"), 1e6, 1e3),))
    for damper in (sd.AsymmetricDamper(bump=600.0, rebound=200.0), sd.QuadraticDamper(500.0)):
        system = sd.SeatSystem(body, sd.Seat(39.0, [sd.Spring(16e3), sd.Damper(100.0), damper]))
        for rtol in (1e-3, 1e-5):
            runs = both(system, sd.Step(0.07, 0.9), np.zeros(4), 4.0, rtol)
            assert worst_between_steps(*runs, 4.0) < 20 * rtol


def test_breaks_between_two_points_of_a_step_are_noticed():
    """A cut before the second point: all later ones lay beyond two breaks, on another line."""
    damper = sd.BalanceDamper(6761.73147713733, 178.27883485343824, 1797.5809648675076)
    seat = sd.Seat(35.0, [sd.Spring(22390.0), sd.Damper(260.0), damper])
    system = sd.SeatSystem(sd.load_body("fairley1989"), seat)
    for level in (6.0, 7.0):
        runs = both(system, sd.Sine(60.0, amplitude=level), (0.0, 0.0, 0.05, 0.05), 2.0, 1e-11)
        assert worst_between_steps(*runs, 2.0) < 1e-9


def test_friction_holds_what_the_base_begins_to_move():
    """From the wrong side of a jump the motion came back within the first step, unseen."""
    cushion = [sd.KelvinVoigt(35139.0, 804.0), sd.BinghamDamper(47.7, 317.0, dry=True)]
    seat = sd.Seat(18.3, [sd.Spring(15935.0), sd.Damper(204.0)], cushion=cushion, cushion_mass=0.8)
    system = sd.SeatSystem(sd.load_body("wei1998_1b"), seat)
    start = np.zeros(2 * system.linear.size)
    runs = both(system, sd.Sine(0.92, amplitude=4.0), start, 1.0, 1e-8)
    assert runs[0].marks[0, 1] >= 0  # it is held
    assert runs[0].events == runs[1].events
    assert worst_between_steps(*runs, 1.0) < 1e-7


def test_jumps_of_the_curvature_show_in_the_error():
    """A table of cubics: its Legendre coefficients fall like powers, not by the same ratio."""
    table = sd.TableSpring(np.linspace(-0.0173, 0.0173, 5), [-114.9, -79.2, 0.0, 79.2, 114.9])
    seat = oscillator(sd.Spring(4700.0), sd.Damper(150.0), table, mass=30.0)
    for level in (5.0, 8.0):
        runs = both(seat, sd.Sine(60.0, amplitude=level), np.zeros(2), 1.0, 1e-8)
        assert worst_between_steps(*runs, 1.0) < 1e-6


@numba.njit
def multiply(known, row, place, matrices, index, result):
    product(known, row, place, matrices, index, result)


@pytest.mark.parametrize("blocks", [1, 2, 3, 4, 7])
def test_a_row_times_a_matrix(blocks):
    """However many columns are summed up at once, from any place of the row on."""
    rng = np.random.default_rng(blocks)
    matrices, row = rng.normal(size=(3, 5, 8 * blocks)), rng.normal(size=9)
    known, result = rng.normal(size=8 * blocks), np.zeros(8 * blocks)
    multiply(None, row, 0, matrices, 1, result)
    np.testing.assert_allclose(result, row[:5] @ matrices[1], rtol=1e-13, atol=1e-14)
    multiply(known, row, 4, matrices, 2, result)
    np.testing.assert_allclose(result, known + row[4:] @ matrices[2], rtol=1e-13, atol=1e-14)


def test_a_polynomial_keeps_above_the_least_of_its_coefficients():
    """What a step is said to keep off by: Bernstein coefficients from values at its points."""
    rng = np.random.default_rng(2)
    x = np.linspace(0.0, 1.0, 1001)
    for _ in range(200):
        polynomial = np.polynomial.Chebyshev(rng.normal(size=POINTS), [0.0, 1.0])
        inner = polynomial(NODES) @ TO_BERNSTEIN
        assert inner[-1] == inner[-2]
        least = min(inner.min(), polynomial(0.0), polynomial(1.0))
        assert polynomial(x).min() >= least - 1e-12
    np.testing.assert_allclose(NODES @ TO_BERNSTEIN[:, :-1], np.arange(1, 8) / 8, rtol=1e-12)


@pytest.mark.parametrize("rtol", [1e-3, 1e-6])
def test_a_periodic_motion_goes_from_break_to_break(rtol):
    """Steps become as long as they may, and stay so: breaks stand half a period apart."""
    system = paper_system(sd.QuadraticDamper(1000.0))
    problem = Problem.make(system, sd.Sine(1.55, amplitude=0.8857).motion, Settings(rtol=rtol))
    run = problem.run(0.0, 60.0, problem.start(np.zeros(6)))
    assert run.events == 186
    periods = np.searchsorted(run.record[:, 0], 60.0 - np.array([4, 3, 2, 1]) / 1.55)
    rows = np.diff(periods)
    assert rows.min() == rows.max() == (8 if rtol == 1e-3 else 32)


def test_what_comes_to_rest_is_not_thrown_at_its_breaks():
    """A cut that misplaces a light node by less than the tolerance made it cross breaks in vain."""
    body = sd.SeatedBody("light", {"n1": 0.002}, (sd.Link(("seat", "n1"), 1e6, 1e3),))
    damper = sd.AsymmetricDamper(bump=600.0, rebound=200.0)
    system = sd.SeatSystem(body, sd.Seat(39.0, [sd.Spring(16e3), sd.Damper(100.0), damper]))
    for rtol in (1e-3, 3e-4, 1e-4, 1e-5):
        ours, theirs = both(system, sd.Step(0.07, 0.9), np.zeros(4), 4.0, rtol)
        assert ours.events < 3 * theirs.events
