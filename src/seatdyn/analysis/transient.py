"""Time response."""

from __future__ import annotations

import json
import reprlib
import warnings
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

import seatdyn
from seatdyn.analysis.energy import energy_balance
from seatdyn.analysis.hysteretic import problem_for
from seatdyn.analysis.outputs import (
    across,
    body_force,
    element_forces,
    motion_of,
    pair_name,
    pairs,
    state_names,
    suspension_forces,
)
from seatdyn.analysis.run import Problem, Run, Samples, Settings
from seatdyn.errors import ExtrapolationWarning, RequestError, Status
from seatdyn.kernels import dense
from seatdyn.kernels.columns import BREAKS, FIRST, IS_JUMP, ON_DISPLACEMENT, SECOND, VALUE
from seatdyn.model.body import warn_above_band
from seatdyn.model.excitation import Excitation
from seatdyn.model.system import SeatSystem
from seatdyn.units import LENGTH, SPEED, number

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]
MOST_POINTS = 20_000_000  # of the output grid
DEFAULT_STEP = 1e-3  # s
BALANCED = 1e-9  # of the forces in balance: what an equilibrium may leave


def simulate(
    system: SeatSystem,
    excitation: Excitation,
    duration: float,
    *,
    output_step: float = DEFAULT_STEP,
    initial: Literal["rest", "equilibrium", "periodic"] | ArrayLike = "rest",
    settings: Settings | None = None,
    energy_check: bool = True,
    progress: Callable[[float], None] | None = None,
) -> xr.Dataset:
    """Motion of a system from t = 0 to `duration`.

    Parameters
    ----------
    system : SeatSystem
    excitation : base motion
    duration : s, > 0
    output_step : s between output points; the solution itself takes the steps that it needs
    initial : "rest" in the absolute frame; "equilibrium" under constant forces (`Preload`);
        "periodic" on the steady state; or an array of displacements (m, within +-1000), then
        velocities (m/s, within +-1e4), (2N,)
    settings : accuracy and limits, see `Settings`
    energy_check : work out the energy balance (`energy_residual`, relative to the throughput)
    progress : called with the share done

    Returns
    -------
    xarray.Dataset
        displacement, velocity, acceleration (node, time); relative_displacement (pair, time);
        element_force (element, time); internal_state (state, time) of elements that have some;
        suspension_force, body_force, base_displacement,
        base_velocity, base_acceleration (time). Attributes: status, message, energy_residual, ...

    Raises
    ------
    RequestError
        No SeatSystem, no base motion, an initial state, duration or step that is not usable, or a
        grid of more than 20 million points.

    Examples
    --------
    >>> import seatdyn as sd
    >>> seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(260.0)])
    >>> system = sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat)
    >>> run = sd.simulate(system, sd.Sine(1.55, amplitude=0.8857), duration=1.0)
    >>> run.attrs["status"], run.sizes["time"]
    ('ok', 1001)
    """
    run = run_for(system, excitation, duration, output_step, initial, settings, progress)
    end = run.record[-1, 0]
    count = round(end / output_step) + 1
    time = np.linspace(0.0, (count - 1) * output_step, count)
    time = time[time <= end * (1 + 1e-12)]
    data = to_dataset(system, run.at(np.minimum(time, end)))
    data.attrs |= run_attributes(run, system, excitation)
    if energy_check:
        balance = energy_balance(run)
        if run.status is Status.OK and not balance.closes(run.problem.settings.rtol):
            data.attrs |= {
                "status": str(Status.INCONSISTENT),
                "message": Status.INCONSISTENT.message,
            }
        data.attrs |= {
            "energy_residual": balance.residual,
            "energy_change_J": balance.change,
            "base_work_J": balance.base_work,
            "dissipated_J": balance.dissipated,
            "feedback_work_J": balance.feedback_work,
            "force_work_J": balance.force_work,
        }
    return data


def run_for(
    system: SeatSystem,
    excitation: Excitation,
    duration: float,
    output_step: float = DEFAULT_STEP,
    initial: Literal["rest", "equilibrium", "periodic"] | ArrayLike = "rest",
    settings: Settings | None = None,
    progress: Callable[[float], None] | None = None,
) -> Run:
    """The run behind `simulate`: steps and solution, without a Dataset."""
    check_request(system, excitation)
    settings = Settings() if settings is None else settings
    if not isinstance(settings, Settings):
        raise RequestError(
            f"settings = {reprlib.repr(settings)} is not allowed; use Settings(rtol=...) or None."
        )
    duration = number(duration, "duration", "s", above=0.0, error=RequestError)
    output_step = number(output_step, "output_step", "s", above=0.0, error=RequestError)
    if output_step > duration:
        raise RequestError(
            f"output_step = {output_step:g} s exceeds duration = {duration:g} s; make it shorter."
        )
    if duration / output_step > MOST_POINTS:
        raise RequestError(
            f"duration = {duration:g} s at output_step = {output_step:g} s asks for "
            f"{duration / output_step:.3g} points; at most {MOST_POINTS:.0e} are allowed. "
            "Shorten the run or lengthen output_step."
        )
    problem = problem_for(system, excitation, settings)
    rows_per_step = 2 if problem.uses_ladder else 1  # of the ladder: two halves, a row each
    rows = rows_per_step * duration / problem.longest_step
    if rows > settings.max_steps:
        raise RequestError(
            f"duration = {duration:g} s needs about {rows:.3g} steps or more; at most "
            f"{settings.max_steps} are allowed. Shorten the run, or raise Settings.max_steps."
        )
    if isinstance(initial, str) and initial == "periodic":
        from seatdyn.analysis.steady import periodic_state

        start = periodic_state(problem, excitation)
    else:
        start = problem.start(initial_state(problem, initial))
    run = problem.run(0.0, duration, start, progress)
    warn_extrapolation(system, lambda: run.in_steps(np.linspace(0.0, 1.0, 5)))
    return run


def check_request(system: Any, excitation: Any) -> None:
    """Refuse what is no seat system, or no base motion, in a request for a time run."""
    if not isinstance(system, SeatSystem):
        given = getattr(system, "name", None) or reprlib.repr(system)
        raise RequestError(
            f"system = {given} ({type(system).__name__}) is not allowed: simulate needs a "
            "SeatSystem, and so does steady_state; put the body on a Seat: "
            "SeatSystem(body, Seat(mass, [...]))."
        )
    if not isinstance(excitation, Excitation):
        raise RequestError(
            f"excitation = {reprlib.repr(excitation)} is no base motion; use Sine, SineSum, Step, "
            "HalfSineShock, Sweep, Record, RandomMotion or Still."
        )
    if excitation.period:
        warn_above_band(system.body, 1.0 / excitation.period, stacklevel=3)


def initial_state(
    problem: Problem, initial: Literal["rest", "equilibrium", "periodic"] | ArrayLike
) -> Array:
    """Displacements, then velocities, (2N,)."""
    size = 2 * problem.system.linear.size
    if isinstance(initial, str):
        if initial == "rest":
            return np.zeros(size)
        if initial == "equilibrium":
            return np.concatenate([equilibrium(problem), np.zeros(size // 2)])
        raise RequestError(
            f"initial = {initial!r} is not allowed; use 'rest', 'equilibrium', 'periodic' or an "
            f"array of {size} numbers."
        )
    nodes = problem.system.nodes
    wanted = f"the displacements (m) of {nodes}, then their velocities (m/s)."
    try:
        y = np.array(initial, dtype=float).ravel()
    except (TypeError, ValueError, OverflowError):
        raise RequestError(
            f"initial = {reprlib.repr(initial)} is no list of numbers; it must have {size} finite "
            f"ones: {wanted}"
        ) from None
    if y.size != size or not np.all(np.isfinite(y)):
        raise RequestError(
            f"initial has {y.size} numbers; it must have {size} finite ones: {wanted}"
        )
    for i, value in enumerate(y):
        moving = i >= size // 2
        label = f"initial[{i}] ({'velocity' if moving else 'displacement'} of {(nodes * 2)[i]!r})"
        most = (SPEED if moving else LENGTH)["maximum"]
        unit = "m/s" if moving else "m"
        number(value, label, unit, minimum=-most, maximum=most, error=RequestError)
    return y


def equilibrium(problem: Problem) -> Array:
    """Displacements (N,) at which all forces balance, the base held at its start.

    Where a force that jumps bears the load somewhere inside its jump, the channel rests on it.
    """
    n, breaks = problem.system.linear.size, problem.plant.breaks
    state = balance(problem)
    if state is not None:
        return state[:n]
    for j in range(problem.plant.gain.shape[0]):
        for row in range(problem.plant.channels[j, BREAKS], problem.plant.channels[j + 1, BREAKS]):
            if not breaks[row, IS_JUMP] or not breaks[row, ON_DISPLACEMENT]:
                continue
            place = breaks[row, VALUE] / breaks[row, ON_DISPLACEMENT]
            state = balance(problem, j, place)
            if state is None:
                continue
            either = [pull_at_rest(problem, j, np.nextafter(place, s)) for s in (-np.inf, np.inf)]
            if min(either) <= state[n] <= max(either):
                return state[:n]
    raise RequestError(
        "initial = 'equilibrium' is not possible: no state in which the constant forces are "
        "balanced was found near zero. Start from 'rest' or from an array, or give the loaded "
        "nodes a spring."
    )


def balance(problem: Problem, held: int = -1, place: float = 0.0) -> Array | None:
    """Displacements (N,) at which all forces balance, or None.

    Channel `held` (-1: none) is kept at the displacement `place`; the force in N that it needs
    follows the displacements.
    """
    from scipy.optimize import root

    linear, plant = replace(problem.system.linear.undelayed, relaxing=()), problem.plant
    n, m = linear.size, plant.gain.shape[0]
    x0 = float(problem.motion.evaluate(0.0))
    between = [(plant.channels[j, FIRST], plant.channels[j, SECOND]) for j in range(m)]

    def across(state: Array, j: int) -> float:
        first, second = (state[node] if node >= 0 else x0 for node in between[j])
        return float(second - first)

    def pulls(state: Array) -> Array:
        """Forces of the channels on the nodes, and of what else holds them, (m + ..., N)."""
        result = np.zeros((m, n))
        for j in range(m):
            pull = state[n] if j == held else pull_at_rest(problem, j, across(state, j))
            for node, sign in zip(between[j], (-1.0, 1.0), strict=True):
                if node >= 0:
                    result[j, node] = sign * pull
        return np.vstack([result, problem.rest_pulls(state[:n], x0)])

    def unbalanced(state: Array) -> Array:
        force = linear.stiffness @ state[:n] - linear.drive_stiffness * x0 + pulls(state).sum(0)
        return np.append(force, across(state, held) - place) if held >= 0 else np.asarray(force)

    state = np.asarray(root(unbalanced, np.zeros(n + (held >= 0)), tol=1e-12).x)
    size = np.abs(linear.stiffness) @ np.abs(state[:n]) + np.abs(linear.drive_stiffness * x0)
    size += np.abs(pulls(state)).sum(0)
    off = np.abs(unbalanced(state))
    balanced = np.all(off[:n] <= BALANCED * size.max()) and np.all(off[n:] <= BALANCED)
    return state if balanced else None


def pull_at_rest(problem: Problem, j: int, d: float) -> float:
    """Force of channel j in N at the displacement d (m) across it and no velocity."""
    return float(dense.element_forces(problem.plant, j, np.array([d]), np.zeros(1)).sum())


def warn_extrapolation(system: SeatSystem, look: Callable[[], Samples]) -> None:
    """Warn for every measured table that a motion left, naming it."""
    samples = None
    for channel in system.channels:
        for element in channel.elements:
            limits = element.lower().limits
            if limits is None:
                continue
            samples = samples or look()
            variable, low, high = limits
            values = across(system, samples, channel.between, int(variable == "velocity"))
            if values.min() < low or values.max() > high:
                warnings.warn(
                    f"The table of {element.name} was extrapolated: {variable} reached "
                    f"{values.min():.4g} .. {values.max():.4g}, the table covers {low:.4g} .. "
                    f"{high:.4g}. Measure further, or mistrust the run.",
                    ExtrapolationWarning,
                    stacklevel=4,
                )


def to_dataset(system: SeatSystem, samples: Samples) -> xr.Dataset:
    """Samples as a labelled Dataset."""
    import xarray as xr

    nodes, couples = system.nodes, pairs(system)
    forces = element_forces(system, samples)
    suspension = suspension_forces(system, samples)

    def per_node(order: int) -> Array:
        return np.array([motion_of(system, samples, node, order) for node in nodes])

    def unit(text: str) -> dict[str, str]:
        return {"units": text}

    stacked = np.array(list(forces.values())) if forces else np.zeros((0, samples.time.size))
    variables: dict[str, Any] = {
        "displacement": (("node", "time"), per_node(0), unit("m")),
        "velocity": (("node", "time"), per_node(1), unit("m/s")),
        "acceleration": (("node", "time"), per_node(2), unit("m/s2")),
        "relative_displacement": (
            ("pair", "time"),
            np.array([across(system, samples, pair, 0) for pair in couples]),
            unit("m"),
        ),
        "element_force": (("element", "time"), stacked, unit("N")),
        "suspension_force": (("time",), sum(suspension.values()), unit("N")),
        "body_force": (("time",), body_force(system, samples), unit("N")),
        "base_displacement": (("time",), samples.base[0], unit("m")),
        "base_velocity": (("time",), samples.base[1], unit("m/s")),
        "base_acceleration": (("time",), samples.base[2], unit("m/s2")),
    }
    coords: dict[str, Any] = {
        "time": ("time", samples.time, unit("s")),
        "node": list(nodes),
        "pair": [pair_name(pair) for pair in couples],
        "element": list(forces),
    }
    if samples.states is not None:
        names, units = state_names(system)
        variables["internal_state"] = (
            ("state", "time"),
            samples.states.T,
            {"units": "see state_unit"},
        )
        coords |= {"state": names, "state_unit": ("state", units)}
    return xr.Dataset(variables, coords=coords)


def run_attributes(run: Run, system: SeatSystem, excitation: Excitation) -> dict[str, Any]:
    """What produced a result, and how it ended."""
    settings = run.problem.settings
    return {
        "status": str(run.status),
        "message": run.status.message,
        "steps": run.steps,
        "events": run.events,
        "rtol": settings.rtol,
        "method": "ladder" if run.problem.uses_ladder else "runge-kutta",
        "seatdyn_version": seatdyn.__version__,
        "inputs": json.dumps(
            {"system": repr(system), "excitation": repr(excitation), "notes": excitation.notes}
        ),
    }
