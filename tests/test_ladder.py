"""Exact propagators of the linear part, and the steps that are made of them."""

from __future__ import annotations

import copy
import math
import pickle

import mpmath
import numpy as np
import pytest

import seatdyn as sd
from conftest import paper_system
from seatdyn.analysis.ladder import _propagators
from seatdyn.analysis.run import Problem, Settings
from seatdyn.kernels import dense
from seatdyn.kernels.exponential import LATER, LEVELS, NODES, PLACES


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
                transition, answer = exact(a, g, steps[level], PLACES[1 + place], degree)
                ours = driven[level, place, :, 0] @ (2 * NODES - 1) ** degree
                change = free[level, place] - np.eye(2), transition - np.eye(2)
                np.testing.assert_allclose(*change, rtol=1e-12, atol=2e-16)
                full = np.abs(exact(a, g, steps[level], PLACES[1 + place], 0)[1]).max()
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
