"""Time runs: exact linear solutions, independent solvers, energy, events, sticking, limits."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import seatdyn as sd
from conftest import ON, oscillator, paper_system
from seatdyn.analysis import energy
from seatdyn.analysis.run import Problem, Run, Settings
from seatdyn.analysis.transient import run_for

FINE = Settings(rtol=1e-11)
ELEMENTS = {
    "linear": (),
    "quadratic": (sd.QuadraticDamper(500.0),),
    "coulomb": (sd.CoulombFriction(30.0),),
    "jump": (sd.PiecewiseSpring(1000.0, 0.02, 0.01),),
    "gap": (sd.PiecewiseSpring(1000.0, 0.02, 0.01, jumping=False),),
    "stops": (sd.EndStop(20e3, 0.02, 0.015, damping=200.0),),
    "tangent": (sd.TangentPolynomialSpring(2000.0, 0.08, (100.0, 2e3, 3e5)),),
    "polynomial": (sd.PolynomialDamper((50.0, 100.0, 4e4, 0.0, 1e6)),),
    "asymmetric": (sd.AsymmetricDamper(bump=100.0, rebound=300.0),),
    "preload": (sd.Preload(20.0),),
    "table": (
        sd.TableSpring((-0.2, -0.05, 0.0, 0.05, 0.2), (-900.0, -150.0, 0.0, 100.0, 700.0)),
        sd.TableDamper((-2.0, -0.3, 0.0, 0.3, 2.0), (-300.0, -100.0, 0.0, 60.0, 200.0)),
    ),
    "everything": (
        sd.QuadraticDamper(100.0),
        sd.CoulombFriction(10.0),
        sd.PiecewiseSpring(500.0, 0.02, 0.01),
        sd.EndStop(20e3, 0.03, 0.03, damping=100.0),
        sd.AsymmetricDamper(bump=20.0, rebound=60.0),
    ),
}


@pytest.mark.parametrize("method", ["ladder", "runge-kutta"])
def test_linear_run_is_the_matrix_exponential(method, sine):
    system = paper_system()
    linear = system.linear
    inverse = np.linalg.inv(linear.mass)
    omega = 2 * math.pi * 1.55
    a = np.zeros((8, 8))  # displacements, velocities, base displacement and velocity
    a[:3, 3:6] = np.eye(3)
    a[3:6, :3], a[3:6, 3:6] = -inverse @ linear.stiffness, -inverse @ linear.damping
    a[3:6, 6], a[3:6, 7] = inverse @ linear.drive_stiffness, inverse @ linear.drive_damping
    a[6, 7], a[7, 6] = 1.0, -(omega**2)
    start = np.array([0, 0, 0, 0, 0, 0, 0, -0.8857 / omega])
    run = sd.simulate(
        system, sine, 5.0, output_step=0.25, settings=Settings(rtol=1e-11, method=method)
    )
    for i, t in enumerate(run.time.values):
        exact = expm(a * t) @ start
        np.testing.assert_allclose(run.displacement.values[:, i], exact[:3], atol=3e-11)
        np.testing.assert_allclose(run.velocity.values[:, i], exact[3:6], atol=3e-9)


@pytest.mark.parametrize("name", ELEMENTS)
def test_both_integrators_agree_and_energy_balances(name, sine):
    system = paper_system(*ELEMENTS[name])
    one, other = (
        sd.simulate(system, sine, 6.0, settings=Settings(rtol=1e-10, method=method))
        for method in ("ladder", "runge-kutta")
    )
    scale = float(np.abs(one.displacement).max())
    assert float(np.abs(one.displacement - other.displacement).max()) < 2e-8 * scale
    default = sd.simulate(system, sine, 6.0)
    assert default.attrs["energy_residual"] < 1e-6
    assert float(np.abs(default.displacement - one.displacement).max()) < 1e-6 * scale


def test_error_falls_with_the_tolerance(sine):
    """No floor of error hides in interpolation or events."""
    system = paper_system(*ELEMENTS["everything"])
    reference = sd.simulate(system, sine, 4.0, settings=Settings(rtol=1e-12))
    errors = []
    for rtol in (1e-5, 1e-7, 1e-9):
        run = sd.simulate(system, sine, 4.0, settings=Settings(rtol=rtol))
        errors.append(float(np.abs(run.displacement - reference.displacement).max()))
    assert errors[0] < 1e-5
    assert errors[1] < errors[0] / 10
    assert errors[2] < errors[1] / 10


def chain_of_twelve():
    """Seeded system of 12 masses: random links, non-reciprocal feedback, three channels."""
    rng = np.random.default_rng(20240501)
    names = [f"n{i}" for i in range(1, 12)]
    masses = dict(zip(names, rng.uniform(2.0, 15.0, 11), strict=True))
    links = []
    for i, name in enumerate(names):
        other = "seat" if i == 0 else names[rng.integers(0, i)]
        links.append(sd.Link((other, name), rng.uniform(2e4, 8e4), rng.uniform(100.0, 600.0)))
    links.append(sd.Link(("seat", "n11"), 3e4, 200.0))
    terms = (
        sd.FeedbackTerm("g1", 2000.0, "displacement", {"n3": 1.0, "seat": 1.0}),
        sd.FeedbackTerm("g2", -30.0, "velocity", {"n5": 1.0, "seat": -1.0}),
    )
    body = sd.SeatedBody("twelve", masses, tuple(links), (sd.FeedbackForce("n2", "n7", terms),))
    seat = sd.Seat(30.0, [sd.Spring(2e4), sd.Damper(400.0), sd.QuadraticDamper(300.0)])
    further = (
        sd.CoulombFriction(15.0, slope=200.0, between=("n1", "n4")),
        sd.PiecewiseSpring(4e3, 4e-4, 3e-4, between=("seat", "n6")),
    )
    return sd.SeatSystem(body, seat, further), masses, links


def test_twelve_masses_agree_with_an_independent_solver():
    system, masses, links = chain_of_twelve()
    names = ["seat", *masses]
    m = np.array([30.0, *masses.values()])
    at = {name: i for i, name in enumerate(names)}
    omega, level = 2 * math.pi * 2.3, 1.5

    def rhs(t, y, branch):
        z, v = y[:12], y[12:]
        x0 = -level / omega**2 * math.sin(omega * t)
        v0 = -level / omega * math.cos(omega * t)
        force = np.zeros(12)

        def pull(a, b, f):
            force[b] -= f
            force[a] += f

        for link in links:
            a, b = at[link.between[0]], at[link.between[1]]
            pull(a, b, link.stiffness * (z[b] - z[a]) + link.damping * (v[b] - v[a]))
        active = -2000.0 * (z[at["n3"]] + z[0]) + 30.0 * (v[at["n5"]] - v[0])
        force[at["n2"]] += active
        force[at["n7"]] -= active
        d, s = z[0] - x0, v[0] - v0
        force[0] -= 2e4 * d + 400.0 * s + 300.0 * abs(s) * s
        slip = v[at["n4"]] - v[at["n1"]]
        pull(at["n1"], at["n4"], 15.0 * 2 / math.pi * math.atan(200.0 * slip))
        stretch = z[at["n6"]] - z[0]
        if branch != 0:
            pull(0, at["n6"], 4e3 * stretch)
        return np.concatenate([v, force / m])

    def low(t, y, branch):
        return y[at["n6"]] - y[0] + 4e-4

    def high(t, y, branch):
        return y[at["n6"]] - y[0] - 3e-4

    low.terminal = high.terminal = True
    t, y, branch, crossings = 0.0, np.zeros(24), 0, 0
    grid, found = np.linspace(0.0, 3.0, 301), np.empty((301, 12))
    while t < 3.0:
        low.direction = -1 if branch == 0 else 1
        high.direction = 1 if branch == 0 else -1
        inside = grid[(grid >= t) & (grid <= 3.0)]
        part = solve_ivp(
            rhs, (t, 3.0), y, "DOP853", args=(branch,), rtol=1e-11, atol=1e-14,
            events=(low, high), dense_output=True, max_step=0.01,
        )  # fmt: skip
        reached = inside[inside <= part.t[-1]]
        found[np.searchsorted(grid, reached)] = part.sol(reached)[:12].T
        t, y = part.t[-1], part.y[:, -1]
        if part.status == 1:
            crossings += 1
            branch = 0 if branch else (-1 if part.t_events[0].size else 1)
    run = sd.simulate(
        system, sd.Sine(2.3, amplitude=level), 3.0, output_step=0.01, settings=Settings(rtol=1e-10)
    )
    assert crossings > 10
    assert run.attrs["energy_residual"] < 1e-6
    worst = np.abs(run.displacement.values.T - found).max() / np.abs(found).max()
    assert worst < 1e-6


def concatenated(runs):
    """One run from pieces that follow each other."""
    record = np.concatenate([*(r.record[:-1] for r in runs[:-1]), runs[-1].record])
    marks = np.concatenate([*(r.marks[:-1] for r in runs[:-1]), runs[-1].marks])
    return Run(runs[0].problem, runs[0].status, 0, record, marks, runs[-1].end)


def test_a_skipped_event_breaks_the_energy_balance(sine):
    """Once the stop is overlooked for a moment, the balance says so."""
    system = paper_system(*ELEMENTS["jump"])
    problem = Problem.make(system, sine.motion, Settings())
    whole = problem.run(0.0, 4.0, problem.start(np.zeros(6)))
    assert energy.energy_balance(whole).residual < 1e-6
    changes = np.flatnonzero(np.any(np.diff(whole.marks[:, :2], axis=0) != 0, axis=1))
    crossing = whole.record[changes[3] + 1, 0]
    first = problem.run(0.0, crossing - 0.01, problem.start(np.zeros(6)))
    blind = Problem.make(paper_system(), sine.motion, Settings())
    missed = blind.run(crossing - 0.01, crossing + 0.01, blind.start(first.end.y))
    # the overlooked stretch, kept on the branch that it started on
    marks = np.repeat(first.marks[-1:], missed.record.shape[0], axis=0)
    missed = Run(problem, missed.status, 0, missed.record, marks, missed.end)
    rest = problem.run(crossing + 0.01, 4.0, problem.start(missed.end.y))
    assert energy.energy_balance(concatenated([first, missed, rest])).residual > 1e-6


def test_a_flipped_active_force_breaks_the_energy_balance(sine, monkeypatch):
    run = run_for(paper_system(), sine, 4.0)
    assert energy.energy_balance(run).residual < 1e-6
    right = energy.powers

    def wrong(system, plant, samples):
        base, dissipation, feedback = right(system, plant, samples)
        return base, dissipation, -feedback

    monkeypatch.setattr(energy, "powers", wrong)
    assert energy.energy_balance(run).residual > 1e-3


def jump_seat(load, damping=5.0):
    """One mass of 10 kg, k = 100, with a jump of 4 N at d = 0.02, under a constant load."""
    return oscillator(
        sd.Spring(100.0), sd.Damper(damping), sd.PiecewiseSpring(200.0, 1.0, 0.02),
        sd.Preload(-load), mass=10.0,
    )  # fmt: skip


def test_a_load_balanced_inside_the_jump_comes_to_rest_on_it():
    """k d + F = load with F anywhere in [0, 4] N at d = 0.02: load 4 N needs F = 2 N."""
    run = sd.simulate(jump_seat(4.0, 60.0), sd.Still(), 20.0)
    assert run.attrs["status"] == "ok"
    end = run.isel(time=-1)
    assert float(end.displacement.sel(node="seat")) == pytest.approx(0.02, abs=1e-9)
    assert float(end.velocity.sel(node="seat")) == pytest.approx(0.0, abs=1e-9)
    assert float(end.element_force.sel(element="PiecewiseSpring")) == pytest.approx(2.0, abs=1e-9)
    assert run.attrs["energy_residual"] < 1e-6


def test_a_held_seat_lets_go_when_the_balancing_force_leaves_the_jump():
    """A slow base acceleration m a(t) moves the balance out of the jump: release near F = 4 N."""
    system = jump_seat(4.0, 60.0)
    settled = sd.simulate(system, sd.Still(), 20.0)
    state = np.concatenate([settled.displacement.values[:, -1], settled.velocity.values[:, -1]])
    # base falls, so that the seat lags behind: d rises once more than 4 N are needed
    shaken = sd.simulate(system, sd.Sine(0.5, amplitude=0.5), 4.0, initial=state)
    d = shaken.relative_displacement.sel(pair="seat-base").values
    force = shaken.element_force.sel(element="PiecewiseSpring").values
    held = np.abs(d - 0.02) < 1e-9
    assert held.any()
    assert not held.all()
    assert force[held].min() > -1e-9
    assert force[held].max() < 4.0 + 1e-9
    assert shaken.attrs["energy_residual"] < 1e-6


def test_a_load_outside_the_jump_does_not_stick():
    run = sd.simulate(jump_seat(7.0, 60.0), sd.Still(), 20.0)
    # beyond the jump: (100 + 200) d = 7
    assert float(run.displacement.values[0, -1]) == pytest.approx(7.0 / 300.0, abs=1e-8)


@pytest.mark.parametrize("margin", [-1e-6, -1e-10, 0.0, 1e-10, 1e-6])
def test_grazing_the_threshold(margin):
    """The free oscillation just misses, meets or passes the jump; motion stays that of the spring.

    Undamped, released at -(0.02 + margin): the largest d is 0.02 + margin. What the jump does in
    the short stay beyond it vanishes with the margin like its square root.
    """
    system = oscillator(sd.Spring(100.0), sd.PiecewiseSpring(200.0, 1.0, 0.02), mass=1.0)
    start = 0.02 + margin
    run = sd.simulate(
        system, sd.Still(), 2.0, initial=[-start, 0.0], settings=FINE, energy_check=True
    )
    assert run.attrs["status"] == "ok"
    assert run.attrs["energy_residual"] < 1e-6
    exact = -start * np.cos(10.0 * run.time.values)
    allowed = 1e-8 if margin <= 0.0 else 60 * math.sqrt(margin) * 0.02
    assert np.abs(run.displacement.values[0] - exact).max() < allowed


def test_a_system_excited_by_its_own_activity():
    """Back-on on a light seat is unstable; with quadratic damping and a jump it oscillates."""
    system = paper_system(
        sd.QuadraticDamper(500.0), sd.PiecewiseSpring(2e3, 5e-4, 3e-4), body=ON, mass=24.0
    )
    assert not sd.is_stable(system)
    run = sd.simulate(system, sd.Still(), 40.0, initial=[1e-4, 0, 0, 0, 0, 0])
    assert run.attrs["status"] == "ok"
    assert run.attrs["energy_residual"] < 1e-6
    travel = run.relative_displacement.sel(pair="seat-base")
    late = travel.where((run.time > 30.0) & (run.time <= 35.0), drop=True)
    later = travel.where(run.time > 35.0, drop=True)
    assert float(later.max()) == pytest.approx(float(late.max()), rel=2e-2)
    assert float(later.max()) > 1e-3


def test_too_many_events_end_the_run_with_their_status():
    system = jump_seat(4.0, damping=0.0)
    limits = Settings(max_events_per_second=20, stick_speed=0.0)
    run = sd.simulate(system, sd.Still(), 30.0, initial=[0.02001, 0.0], settings=limits)
    assert run.attrs["status"] == "chattering"
    assert float(run.time[-1]) < 30.0


def test_dry_friction_of_a_user_sticks():
    """A jump at v = 0 declared by the user: Coulomb decay of 4 F/k a cycle, then rest."""

    @sd.force_law({"force": "N"}, jumps_at={"velocity": [0.0]})
    def dry(d, v, p):
        return p[0] if v > 0.0 else -p[0]

    system = oscillator(sd.Spring(100.0), dry(force=1.0), mass=1.0)
    run = sd.simulate(
        system, sd.Still(), 3.0, initial=[0.105, 0.0], settings=FINE, output_step=1e-4
    )
    x = run.displacement.values[0]
    half = math.pi / 10.0
    for n in range(1, 5):
        turn = x[round(n * half / 1e-4)]
        assert abs(turn) == pytest.approx(0.105 - 0.02 * n, abs=2e-8)
    # at 0.005 the spring pulls with 0.5 N < 1 N: it stays after the fifth half cycle
    assert x[-1] == pytest.approx(-0.005, abs=1e-9)
    assert run.attrs["energy_residual"] < 1e-6


def test_a_late_pulse_is_not_stepped_over():
    system = paper_system()
    shock = sd.HalfSineShock(50.0, 0.002, start=25.0)
    run = sd.simulate(system, shock, 26.0)
    reference = run_for(system, shock, 26.0, settings=Settings(rtol=1e-12, method="runge-kutta"))
    exact = reference.at(run.time.values).displacement.T
    assert np.abs(exact).max() > 1e-6
    assert np.abs(run.displacement.values - exact).max() < 1e-7 * np.abs(exact).max()


def test_preload_shifts_the_ride_height():
    run = sd.simulate(
        oscillator(sd.Spring(100.0), sd.Preload(5.0)), sd.Still(), 1.0, initial="equilibrium"
    )
    np.testing.assert_allclose(run.displacement.values, -0.05, atol=1e-12)


def test_periodic_start_has_no_transient(sine):
    run = sd.simulate(paper_system(*ELEMENTS["quadratic"]), sine, 1.29032258, initial="periodic")
    one = run.displacement.interp(time=[0.1, 0.3])
    other = run.displacement.interp(time=[0.1 + 1 / 1.55, 0.3 + 1 / 1.55])
    np.testing.assert_allclose(one.values, other.values, atol=1e-6)


def test_constant_base_displacement_shifts_the_active_body():
    """Neither body is translation invariant: +3.6 mm (off), -14.7 mm (on) per 0.1 m."""
    for body, shift in (("ksiazek1997_back_off", 3.6e-3), (ON, -14.7e-3)):
        run = sd.simulate(paper_system(body=body), sd.Step(0.1, 0.5), 30.0, output_step=0.1)
        last = run.relative_displacement.sel(pair="m1-seat").values[-1]
        assert last == pytest.approx(shift, abs=6e-5)


def test_extrapolated_table_warns_and_names_itself(sine):
    spring = sd.TableSpring((-0.01, 0.0, 0.01), (-10.0, 0.0, 10.0), label="gas spring A7")
    with pytest.warns(sd.ExtrapolationWarning, match="gas spring A7"):
        sd.simulate(paper_system(spring), sine, 5.0)


def test_progress_is_reported_and_can_stop_the_run(sine):
    shares = []
    sd.simulate(paper_system(), sine, 100.0, output_step=0.1, progress=shares.append)
    assert shares[-1] == 1.0
    assert len(shares) > 2

    def stop(share):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sd.simulate(paper_system(), sine, 100.0, output_step=0.1, progress=stop)


@pytest.mark.parametrize("duration", [1e9, -1.0, float("nan"), 0.0])
def test_absurd_durations_are_refused(duration, sine):
    with pytest.raises(sd.RequestError, match="duration"):
        sd.simulate(paper_system(), sine, duration)


@pytest.mark.parametrize("delay", [0.0, 0.01])
def test_states_alone_are_those_of_the_whole_solution(delay):
    system = paper_system(sd.PiecewiseSpring(1000.0, 0.02, 0.01, delay=delay))
    problem = Problem.make(system, sd.Sine(1.55, amplitude=0.8857).motion, Settings())
    start = problem.rest(np.zeros(6)) if delay else problem.start(np.zeros(6))
    run = problem.run(0.0, 2.0, start)
    time = np.linspace(0.0, 2.0, 777)
    samples = run.at(time)
    expected = np.hstack([samples.displacement, samples.velocity])
    assert np.array_equal(run.states(time), expected)
    order = np.random.default_rng(1).permutation(time.size)  # rows are found forwards and backwards
    assert np.array_equal(run.states(time[order]), expected[order])
    assert run.states(time[:0]).shape == (0, 6)
