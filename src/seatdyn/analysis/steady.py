"""Periodic steady state: by harmonic balance, or by integration until the motion repeats itself."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.approach import Approach, most_multiplier, sharper
from seatdyn.analysis.energy import energy_balance
from seatdyn.analysis.hysteretic import problem_for
from seatdyn.analysis.linear import poles
from seatdyn.analysis.outputs import named_outputs
from seatdyn.analysis.periodic import PER_PERIOD, UNSTABLE, fill, harmonics_of, sorted_multipliers
from seatdyn.analysis.run import Problem, Run, Settings, State
from seatdyn.analysis.stability import is_stable
from seatdyn.analysis.transient import (
    check_request,
    initial_state,
    run_attributes,
    to_dataset,
    warn_extrapolation,
)
from seatdyn.errors import RequestError, Status
from seatdyn.model.elements import (
    CoulombFriction,
    NonlinearElement,
    PiecewiseSpring,
    Preload,
    QuadraticDamper,
)
from seatdyn.model.excitation import Excitation
from seatdyn.model.system import SeatSystem
from seatdyn.units import number

if TYPE_CHECKING:
    import xarray as xr

    from seatdyn.analysis.balance import Balanced

Array = NDArray[np.float64]
MOST_STEPS = 500_000  # of one period
DEFAULT = Settings(rtol=1e-9, max_steps=MOST_STEPS)
SHARES = np.linspace(0.0, 1.0, 13)  # of a step, where extrema are looked for
REFINED, CLOSER = 33, 17  # points around each extremum on the second look, and on the third
TOLERANCE, BALANCE_TOLERANCE = 1e-9, 1e-6  # where none is given; the latter for "hb" alone
LONGEST_SUBHARMONIC = 8  # periods
ALTERNATING = 1e-4  # change over one period, relative, of a subharmonic that is taken for one
CLOSE = 1e-3  # relative change per period below which Newton may finish
PERTURBATION = 1e-5  # relative, for the monodromy matrix
SELDOM = 128  # periods
NEWTON_STEPS = 6
# of a motion that harmonic balance has almost found
FINISH = Settings(rtol=1e-11, max_steps=MOST_STEPS)
FAR = 1e2  # m, m/s: a run that ends there, for whatever reason, grows without bound
STICKING_PERIODS = 200  # of time integration where harmonic balance cannot follow


def steady_state(
    system: SeatSystem,
    excitation: Excitation,
    *,
    method: Literal["auto", "hb", "time"] = "time",
    tolerance: float | None = None,
    check: bool = False,
    max_periods: int = 5000,
    settings: Settings = DEFAULT,
) -> xr.Dataset:
    """Periodic response to a periodic base motion.

    "hb", harmonic balance, finds a motion with the period of the excitation, starting from the
    linear response, with as many harmonics as its error estimate asks for. Where all harmonics
    allowed are too few, Newton's method on the period map finishes; where it fails and a force
    jumps, or the control of a damper switches, which harmonics cannot follow, time integration
    looks for the motion, starting with the seat moving as the base (attribute `finished` "time" in
    both cases). Where that fails, too, it is led from a motion at another level of the excitation.
    The motion may be unstable (attribute `stable` 0): it solves the equations, but no test shows
    it.

    "time" integrates from rest until the state repeats; when it nearly does, Newton's method on the
    period map finishes, and its solution is taken only if it is stable (all Floquet multipliers
    inside the unit circle) and repeats within `tolerance` when integrated once more.

    "auto" is "hb" where that reaches the tolerance on a stable motion, else "time". It is not the
    default: the kernels of harmonic balance take longest to compile on a fresh installation.

    Parameters
    ----------
    system, excitation : the excitation must have a period; for "hb" it must be made of sines,
        of base motion and of forces on nodes
    method : see above; the attribute `method` says which was used
    tolerance : "time": largest change of the state over one period, relative to its largest motion;
        "hb": largest error estimate, relative to the amplitude of each output. 1e-9 unless given,
        1e-6 for method "hb"
    check : run one period in time from the balanced motion; the largest relative deviation of final
        state and amplitudes becomes the attribute `check_deviation`
    max_periods : of time integration, after which the response is called not periodic

    Returns
    -------
    xarray.Dataset
        amplitude (half of maximum minus minimum over the period), maximum, minimum, rms (output);
        harmonics (output, harmonic), complex amplitudes; floquet_multipliers; and one period of
        everything that `simulate` gives. Attributes: status, method, error_estimate, floquet_max,
        stable, periods, energy_residual; order, of a subharmonic response, in periods. Without a
        steady state the numbers are NaN and the status says why.

    Raises
    ------
    RequestError
        An excitation without a period, or for "hb" one that is no sum of sines.

    Examples
    --------
    >>> import seatdyn as sd
    >>> seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(260.0)])
    >>> system = sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat)
    >>> state = sd.steady_state(system, sd.Sine(1.55, amplitude=0.8857))
    >>> round(float(state.amplitude.sel(output="acc_seat")), 5), state.attrs["method"]
    (4.01629, 'time')
    """
    check_request(system, excitation)
    if method not in ("auto", "hb", "time"):
        raise RequestError(f"method = {method!r} is not allowed; use 'auto', 'hb' or 'time'.")
    if tolerance is None:
        tolerance = BALANCE_TOLERANCE if method == "hb" else TOLERANCE
    tolerance = number(tolerance, "tolerance", "", above=0.0, error=RequestError)
    max_periods = round(number(max_periods, "max_periods", "", minimum=1.0, error=RequestError))
    require_period(excitation)
    if method != "time":
        data = _by_balance(system, excitation, method, tolerance, check)
        if data is not None:
            return data
    return _by_integration(system, excitation, tolerance, max_periods, settings)


def require_period(excitation: Excitation) -> float:
    """The period in s; refused where there is none."""
    if excitation.period is None:
        raise RequestError(
            f"{type(excitation).__name__} has no period, so there is no periodic steady state; "
            "use Sine or a SineSum of commensurable frequencies, or `simulate`."
        )
    return excitation.period


def _by_balance(
    system: SeatSystem, excitation: Excitation, method: str, tolerance: float, check: bool
) -> xr.Dataset | None:
    """Steady state by harmonic balance; with "auto" None where integration has to decide."""
    from seatdyn.analysis.balance import balance
    from seatdyn.analysis.neighbours import from_neighbour
    from seatdyn.analysis.steady_balance import balanced_state, jumping, not_found

    known = not system.delays
    if method == "auto" and not known:
        return None
    balanced = balance(system, excitation, tolerance)
    if balanced is None:
        if method == "auto":
            return None
        raise RequestError(
            "method = 'hb' needs base motion and forces made of sines, and "
            f"{type(excitation).__name__} is not; use method='time'."
        )
    data = balanced_state(balanced, excitation, tolerance, check=check)
    if method == "hb":
        finished = _finish(balanced, excitation, data.attrs["status"], tolerance, check=check)
        if finished is None and known and data.attrs["status"] == Status.NOT_CONVERGED:
            neighbour = from_neighbour(system, excitation, tolerance)
            if neighbour is not None:
                balanced = neighbour
                data = balanced_state(balanced, excitation, tolerance, check=check)
        data = data if finished is None else finished
        if data.attrs["status"] == Status.NOT_CONVERGED:
            data.attrs["message"] = not_found(jumping(balanced), STICKING_PERIODS)
    good = data.attrs["status"] == Status.CONVERGED and data.attrs["stable"] == 1
    if not good and method == "auto":
        return None
    if "amplitude" not in data:
        data = _nothing(system).assign_attrs(data.attrs)
    else:
        warn_extrapolation(system, balanced.in_period)
    return data


def _finish(
    balanced: Balanced, excitation: Excitation, status: str, tolerance: float, *, check: bool
) -> xr.Dataset | None:
    """In time, what harmonic balance has almost found, or a motion that it cannot follow."""
    from seatdyn.analysis.steady_balance import jumping, start_of

    almost = status == Status.NOT_ACCURATE and tolerance >= FINISH.rtol
    lost = status in (Status.NOT_CONVERGED, Status.STICKING, Status.CHATTERING)
    if not almost and not (lost and jumping(balanced)):
        return None
    system = balanced.system
    problem = problem_for(system, excitation, FINISH if almost else DEFAULT)
    start = start_of(balanced, problem) if almost else _moving_as_the_base(problem)
    orbit: Orbit | None
    if almost and not system.delays:
        orbit = _newton(problem, require_period(excitation), start, tolerance, 0, stable=False)
    else:
        orbit = find_orbit(problem, excitation, tolerance, STICKING_PERIODS, start=start)
    if orbit is None or orbit.status is not Status.CONVERGED or not orbit.error <= tolerance:
        return None  # with "hb" the tolerance is one of the error
    data = _of_orbit(problem, excitation, orbit, tolerance)
    data.attrs |= {"method": "hb", "finished": "time"}
    data.attrs |= {"check_deviation": orbit.error} if check else {}
    return data


def _moving_as_the_base(problem: Problem) -> State:
    """The state in which every node has displacement and velocity of the base."""
    moving = [float(problem.motion.evaluate(0.0, order)) for order in (0, 1)]
    return problem.start(np.repeat(moving, problem.system.linear.size))


def _by_integration(
    system: SeatSystem,
    excitation: Excitation,
    tolerance: float,
    max_periods: int,
    settings: Settings,
) -> xr.Dataset:
    """Steady state reached from rest."""
    problem = problem_for(system, excitation, settings)
    orbit = find_orbit(problem, excitation, tolerance, max_periods)
    return _of_orbit(problem, excitation, orbit, tolerance)


def _of_orbit(
    problem: Problem, excitation: Excitation, orbit: Orbit, tolerance: float
) -> xr.Dataset:
    """What is told of an orbit, or of the reason why there is none."""
    system, rtol = problem.system, problem.settings.rtol
    if orbit.status is Status.CONVERGED and orbit.run is not None:
        # accelerations of light nodes are less accurate than the motion: the period that is told
        # has finer steps than those that led there
        finer = sharper(problem).run(0.0, orbit.period, orbit.run.end)
        if finer.status is Status.OK:
            orbit.run = finer
        balance = energy_balance(orbit.run)
        orbit.residual = balance.residual
        if not balance.closes(rtol):
            orbit.status = Status.INCONSISTENT
    data = _dataset(problem, orbit)
    known = "floquet_multipliers" in data
    largest = float(np.abs(data.floquet_multipliers[0])) if known else orbit.multiplier
    data.attrs |= {
        "status": str(orbit.status),
        "message": orbit.status.message,
        "method": "time",
        "error_estimate": max(orbit.error, rtol),
        "floquet_max": largest,
        "periods": orbit.periods,
        "tolerance": tolerance,
    }
    if orbit.status is Status.SUBHARMONIC:
        data.attrs["order"] = orbit.order
    if orbit.run is not None and orbit.status is Status.CONVERGED:
        run = orbit.run
        warn_extrapolation(system, lambda: run.in_steps(np.linspace(0.0, 1.0, 5)))
        inputs = run_attributes(orbit.run, system, excitation)
        data.attrs |= {k: v for k, v in inputs.items() if k not in ("status", "message", "method")}
        data.attrs |= {
            "integrator": inputs["method"],
            "energy_residual": orbit.residual,
            "stable": int(orbit.multiplier < 1.0),
        }
        if orbit.multiplier >= 1.0:
            data.attrs["message"] = f"{UNSTABLE} {orbit.status.message}"
    return data


def periodic_state(problem: Problem, excitation: Excitation) -> State:
    """State at t = 0 on the steady state; refused where there is none."""
    orbit = find_orbit(problem, excitation, 1e-8, 5000)
    if orbit.status is not Status.CONVERGED or orbit.run is None:
        raise RequestError(f"initial = 'periodic' is not possible: {orbit.status.message}")
    end = orbit.run.end
    return end if problem.system.delays else problem.start(end.y)


class Orbit:
    """A periodic orbit, or the reason why there is none."""

    def __init__(
        self,
        status: Status,
        period: float,
        run: Run | None = None,
        *,
        error: float = np.nan,
        multiplier: float = np.nan,
        periods: int = 0,
        order: int = 1,
        multipliers: NDArray[np.complex128] | None = None,
    ) -> None:
        """Keep what was found."""
        self.status, self.period, self.run = status, period, run
        self.error, self.multiplier, self.periods = error, multiplier, periods
        self.residual, self.order = np.nan, order
        self.multipliers = multipliers


def find_orbit(
    problem: Problem,
    excitation: Excitation,
    tolerance: float,
    max_periods: int,
    *,
    start: State | None = None,
) -> Orbit:
    """Integrate from rest, or from `start`, until the motion repeats itself."""
    period = require_period(excitation)
    linear = all(is_affine(element) for element in problem.system.nonlinear_elements)
    linear = linear and not problem.system.memory_elements
    if linear and not is_stable(problem.system, linearise="tangent"):
        return Orbit(Status.UNSTABLE, period)
    if problem.system.delays:
        from seatdyn.analysis.delay_orbit import find_late_orbit
        from seatdyn.analysis.delay_time import LateProblem, LateState

        assert isinstance(problem, LateProblem)
        if start is not None and not isinstance(start, LateState):
            start = problem.rest(start.y)
        return find_late_orbit(problem, period, tolerance, max_periods, linear=linear, start=start)
    state = problem.start(initial_state(problem, "rest")) if start is None else start
    approach = Approach()
    past: deque[Array] = deque(maxlen=LONGEST_SUBHARMONIC)
    for count in range(1, max_periods + 1):
        run = problem.run(0.0, period, state)
        motion = run.end.y[: 2 * problem.system.linear.size]
        if run.status is not Status.OK and not np.abs(motion).max() <= FAR:
            # friction and stops may hold a small motion of an unstable linear part, not a large one
            grows = not poles(problem.system).attrs["stable"]
            status = Status.UNSTABLE if grows else Status.NO_PERIODIC_RESPONSE
            return Orbit(status, period, periods=count)
        if run.status is not Status.OK:
            return Orbit(run.status, period, periods=count)
        scales = orbit_scales(problem, run)
        change = np.abs(run.end.y - state.y) / scales
        approach.see(change, run)
        if approach.is_over(tolerance):
            last = problem.run(0.0, period, run.end)
            return Orbit(
                Status.CONVERGED,
                period,
                last,
                error=max(approach.error, approach.changes[-1]),
                multiplier=approach.rate,
                periods=count,
            )
        order = _repeats_after(past, run, tolerance, scales)
        if order:
            return Orbit(Status.SUBHARMONIC, period, periods=count, order=order)
        past.append(state.y)
        # Newton costs as much as 2N periods: at once where it is exact, when the motion nearly
        # repeats itself, and now and then where it creeps
        near = approach.changes[-1] < CLOSE and count % (4 * run.end.y.size) in (0, 8)
        if (near or count % SELDOM == 0 or (linear and count == 1)) and not run.end.is_held:
            orbit = _newton(problem, period, run.end, tolerance, count)
            if orbit is not None:
                return orbit
        if approach.stalls():
            problem = sharper(problem)
        led = approach.lead()
        if led:
            y = run.end.y + led * (run.end.y - state.y)
            state = replace(run.end, y=y) if run.end.is_held else problem.start(y)
        else:
            state = run.end
    return Orbit(Status.NO_PERIODIC_RESPONSE, period, periods=max_periods)


def _repeats_after(past: deque[Array], run: Run, tolerance: float, scales: Array) -> int:
    """Number of periods (2 .. 8) after which the state repeats itself while it alternates, or 0.

    past : states at the starts of the periods before this run, the last one latest
    """
    ago = [float(np.max(np.abs(run.end.y - y) / scales)) for y in reversed(past)]
    start = run.record[0, 1 : 1 + scales.size]
    alternates = float(np.max(np.abs(run.end.y - start) / scales)) > ALTERNATING
    for k, change in enumerate(ago):
        if alternates and change <= tolerance:
            return k + 2
    return 0


def is_affine(element: NonlinearElement) -> bool:
    """Whether an element with a law of its own is linear or constant after all."""
    if isinstance(element, Preload):
        return True
    if isinstance(element, PiecewiseSpring):
        free = element.bump_clearance + element.rebound_clearance
        return element.stiffness == 0.0 or free == 0.0
    if isinstance(element, QuadraticDamper):
        return element.coefficient == 0.0
    return isinstance(element, CoulombFriction) and element.force == 0.0


def orbit_scales(problem: Problem, run: Run) -> Array:
    """Largest displacement and velocity of the run, as a vector over the state."""
    n = problem.system.linear.size
    z = max(np.abs(run.record[:, 1 : n + 1]).max(), problem.floor[0])
    v = max(np.abs(run.record[:, n + 1 : 2 * n + 1]).max(), problem.floor[1])
    states = np.abs(run.record[:, 2 * n + 1 : run.end.y.size + 1]).max(0)
    return np.concatenate([np.repeat([z, v], n), np.maximum(states, problem.state_floor)])


def _newton(
    problem: Problem,
    period: float,
    state: State,
    tolerance: float,
    count: int,
    *,
    stable: bool = True,
) -> Orbit | None:
    """Newton's method on the period map; None unless it ends on an orbit, `stable` if asked.

    It repeats itself within the tolerance, and is as near to the true one if steps lead there.
    """
    y = state.y
    jacobian = np.eye(y.size)
    residual_before, found = np.inf, None
    for step in range(NEWTON_STEPS):
        run = problem.run(0.0, period, problem.start(y))
        if run.status is not Status.OK or run.end.is_held:
            return found
        scales = orbit_scales(problem, run)
        residual = float(np.max(np.abs(run.end.y - y) / scales))
        if step and residual <= tolerance:
            multipliers = np.abs(np.linalg.eigvals(jacobian))
            multiplier = float(multipliers.max())
            if stable and multiplier >= most_multiplier(run):
                return None
            error = residual * max(1.0, 1.0 / max(np.abs(1.0 - multipliers).min(), 1e-300))
            if found is None or error < found.error:
                found = Orbit(
                    Status.CONVERGED, period, run, error=error, multiplier=multiplier, periods=count
                )
            if error <= tolerance:
                return found
        if residual > 0.5 * residual_before:
            return found
        residual_before = residual
        jacobian = period_map(problem, period, run, y, scales)
        if not np.all(np.isfinite(jacobian)):  # disturbances grow beyond all numbers
            return found
        y = y + np.linalg.solve(np.eye(y.size) - jacobian, run.end.y - y)
    return found


def period_map(problem: Problem, period: float, run: Run, y: Array, scales: Array) -> Array:
    """Derivative of the state after one period with respect to its start, by differences."""
    jacobian = np.empty((y.size, y.size))
    for i in range(y.size):
        shifted = y.copy()
        shifted[i] += PERTURBATION * scales[i]
        other = problem.run(0.0, period, problem.start(shifted))
        jacobian[:, i] = (other.end.y - run.end.y) / (PERTURBATION * scales[i])
    return jacobian


def extrema(run: Run) -> tuple[dict[str, float], dict[str, float]]:
    """Maximum and minimum of every output over the run, one-sided limits at jumps included.

    The run is one period of a periodic motion. Every step is looked at in 13 points; then the step
    of each extremum and its neighbours on a finer grid, never across a jump, and the place of the
    extremum on a third one: steps may be so long that a parabola misses it on the second.
    """
    system, steps = run.problem.system, run.steps
    coarse = named_outputs(system, run.in_steps(SHARES))
    rows: list[int] = []
    for values in coarse.values():
        for place in (int(np.argmax(values)), int(np.argmin(values))):
            step = place // SHARES.size
            rows += [(step - 1) % steps, step, (step + 1) % steps]
    shares = np.linspace(0.0, 1.0, REFINED)
    samples = run.sample(np.repeat(rows, REFINED), np.tile(shares, len(rows)))
    parts = []
    for i, values in enumerate(named_outputs(system, samples).values()):
        by_step = values.reshape(-1, REFINED)[6 * i : 6 * i + 6]
        peaks = np.append(np.argmax(by_step[:3], axis=1), np.argmin(by_step[3:], axis=1))
        before = shares[np.clip(peaks - 1, 0, REFINED - 3)]
        parts.append(before[:, None] + np.linspace(0.0, 2.0 / (REFINED - 1), CLOSER))
    closest = run.sample(np.repeat(rows, CLOSER), np.clip(np.concatenate(parts), 0, 1).ravel())
    high, low = {}, {}
    for i, (name, values) in enumerate(named_outputs(system, closest).items()):
        by_step = values.reshape(-1, CLOSER)[6 * i : 6 * i + 6]
        high[name] = max(_vertex(row) for row in by_step[:3])
        low[name] = -max(_vertex(-row) for row in by_step[3:])
    return high, low


def _vertex(values: Array) -> float:
    """Maximum of equidistant values, by the parabola through the highest and its neighbours."""
    k = int(np.argmax(values))
    middle = min(max(k, 1), values.size - 2)
    left, centre, right = values[middle - 1 : middle + 2]
    bend = left - 2 * centre + right
    place = 0.5 * (left - right) / bend if bend < 0.0 else np.inf
    if abs(place) > 1.0:
        return float(values[k])
    return float(max(values[k], centre - (right - left) ** 2 / (8 * bend)))


def _nothing(system: SeatSystem) -> xr.Dataset:
    """NaN where there is no steady state."""
    import xarray as xr

    from seatdyn.analysis.balance import output_names

    names = output_names(system)
    nan: dict[str, Any] = {
        key: ("output", np.full(len(names), np.nan))
        for key in ("amplitude", "maximum", "minimum", "rms")
    }
    return xr.Dataset(nan, coords={"output": names})


def _dataset(problem: Problem, orbit: Orbit) -> xr.Dataset:
    """One period, and amplitudes; NaN where there is no steady state."""
    system = problem.system
    if orbit.run is None or orbit.status is not Status.CONVERGED:
        return _nothing(system)
    time = orbit.period * np.arange(PER_PERIOD) / PER_PERIOD
    samples = orbit.run.at(time)
    outputs = named_outputs(system, samples)
    high, low = extrema(orbit.run)
    names = list(outputs)
    values = np.array(list(outputs.values()))
    top, bottom = np.array([high[n] for n in names]), np.array([low[n] for n in names])
    multipliers = orbit.multipliers
    if not system.delays:  # with these a state is more than its numbers of the moment
        scales = orbit_scales(problem, orbit.run)
        start = orbit.run.record[0, 1 : 1 + scales.size]
        jacobian = period_map(orbit.run.problem, orbit.period, orbit.run, start, scales)
        if np.all(np.isfinite(jacobian)):
            multipliers = sorted_multipliers(jacobian)
    data = to_dataset(system, samples)
    fill(
        data, names, (top - bottom) / 2, top, bottom, np.sqrt(np.mean(values**2, axis=1)),
        harmonics_of(values), multipliers,
    )  # fmt: skip
    return data
