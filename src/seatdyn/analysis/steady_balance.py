"""A balanced motion as a steady state: statuses, stability, energy, the check by integration."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

import seatdyn
from seatdyn.analysis.balance import Balanced
from seatdyn.analysis.delay_time import LateProblem
from seatdyn.analysis.energy import WORST_RESIDUAL, outside_power, powers
from seatdyn.analysis.hysteretic import problem_for
from seatdyn.analysis.outputs import named_outputs
from seatdyn.analysis.periodic import UNSTABLE, fill, harmonics_of
from seatdyn.analysis.run import Problem, Settings, State
from seatdyn.analysis.transient import to_dataset
from seatdyn.errors import Status
from seatdyn.kernels.balance import CONVERGED, TOO_MANY_EVENTS
from seatdyn.kernels.levels import NOT_ACCURATE
from seatdyn.kernels.orbit import HIGH, LOW
from seatdyn.model.excitation import Excitation
from seatdyn.model.semi_active import switches

if TYPE_CHECKING:
    import xarray as xr

GRAZING = 1e-3  # of the fastest motion: slower crossings of a jump graze it
PIECES = 160  # of a period, between events, that the energy balance is integrated over
GAUSS = np.polynomial.legendre.leggauss(6)
CHECK = Settings(rtol=1e-11)
AGREEMENT = 10.0  # tolerances: what the check allows


def status_of(balanced: Balanced, slowest: float) -> Status:
    """How harmonic balance ended; `slowest` as given by `Balanced.floquet`."""
    if balanced.code == TOO_MANY_EVENTS:
        return Status.CHATTERING
    if not balanced.found:
        return Status.NOT_CONVERGED
    if slowest < 0.0:
        return Status.STICKING
    if balanced.code == NOT_ACCURATE:
        return Status.NOT_ACCURATE
    assert balanced.code == CONVERGED
    return Status.GRAZING if slowest < GRAZING else Status.CONVERGED


def jumping(balanced: Balanced) -> list[str]:
    """What harmonics follow slowly: elements whose force or command jumps, for messages."""
    elements = balanced.system.nonlinear_elements
    forces = [
        f"the force of {e.name} jumps" for e in elements if any(b.jumps for b in e.lower().breaks)
    ]
    controls = [
        f"the control of {e.name} switches" for e in balanced.system.memory_elements if switches(e)
    ]
    return forces + controls


def not_found(jumps: list[str], periods: int) -> str:
    """Why harmonic balance has no motion, and what to do; `periods` that were run in time."""
    text = "Harmonic balance found no motion with the period of the excitation"
    if not jumps:
        return f"{text}. Use method='time'."
    return (
        f"{text}: {', '.join(jumps)}, which harmonics follow slowly. Time integration came to none "
        f"within {periods} periods, either: the motion may never repeat itself. Look at it with "
        "`simulate`, or use method='time' with its `max_periods`."
    )


def energy_residual(balanced: Balanced, problem: Problem) -> float:
    """Works over the period that do not add up to nothing, relative to the integrated powers."""
    phases = balanced.event_phases % (2 * np.pi)
    edges = np.unique(np.concatenate([np.linspace(0.0, 2 * np.pi, PIECES + 1), phases]))
    middle, half = (edges[1:] + edges[:-1]) / 2, np.diff(edges) / 2
    samples = balanced.sample((middle[:, None] + half[:, None] * GAUSS[0]).ravel())
    base, dissipated, feedback = powers(problem.system, problem.plant, samples)
    weights = (half[:, None] * GAUSS[1]).ravel()
    flows = np.array([base, -dissipated, feedback, outside_power(samples)])
    defect = abs(float(flows.sum(0) @ weights))
    through = float(np.abs(flows).sum(0) @ weights)
    return defect / max(through, 1e-300)


def check_by_integration(balanced: Balanced, problem: Problem, period: float) -> float:
    """Largest deviation of a time run over one period from the balanced motion, relative.

    It starts on the motion; compared are the state at the end, with the largest motion, and the
    amplitudes.
    """
    from seatdyn.analysis.steady import extrema, orbit_scales

    state = start_of(balanced, problem)
    start = state.y
    run = problem.run(0.0, period, state)
    if run.status is not Status.OK:
        return float("inf")
    deviation = float(np.max(np.abs(run.end.y - start) / orbit_scales(problem, run)))
    high, low = extrema(run)
    ours = (balanced.look.extrema[HIGH] - balanced.look.extrema[LOW]) / 2
    theirs = np.array([(high[name] - low[name]) / 2 for name in balanced.names])
    moving = theirs > 0.0
    deviations = np.abs(ours - theirs)[moving] / theirs[moving]
    return max(deviation, float(deviations.max(initial=0.0)))


def start_of(balanced: Balanced, problem: Problem) -> State:
    """The balanced motion at t = 0 as the start of a time run, with the past that it needs."""
    if isinstance(problem, LateProblem):
        return balanced.late_start(problem)
    return problem.start(balanced.start())


def balanced_state(
    balanced: Balanced, excitation: Excitation, tolerance: float, *, check: bool
) -> xr.Dataset:
    """The Dataset of `steady_state`; only attributes where there is no motion."""
    import xarray as xr

    period = 2 * np.pi / balanced.problem.omega
    attributes: dict[str, Any] = {
        "method": "hb",
        "tolerance": tolerance,
        "error_estimate": balanced.error,
        "periods": 0,
        "samples": balanced.samples,
        "evaluations": balanced.evaluations,
        "seatdyn_version": seatdyn.__version__,
        "inputs": json.dumps(
            {
                "system": repr(balanced.system),
                "excitation": repr(excitation),
                "notes": excitation.notes,
            }
        ),
    }
    multipliers, slowest = balanced.floquet() if balanced.found else (np.zeros(0), np.inf)
    status = status_of(balanced, slowest)
    if not balanced.found or status is Status.STICKING:
        nothing = {"status": str(status), "message": status.message, "floquet_max": np.nan}
        return xr.Dataset(attrs=attributes | nothing)
    problem = problem_for(balanced.system, excitation, CHECK)
    message = status.message
    residual = energy_residual(balanced, problem)
    if status.valid and residual > max(WORST_RESIDUAL, 100 * tolerance):
        status, message = Status.INCONSISTENT, Status.INCONSISTENT.message
    if status is Status.CONVERGED:
        largest = float(np.abs(multipliers[0]))
        attributes |= {"floquet_max": largest, "stable": int(largest < 1.0)}
    else:  # grazing: the motion after a small disturbance is not linear in it
        multipliers = np.full_like(multipliers, np.nan)
        attributes["floquet_max"] = float("nan")
    if check:
        deviation = check_by_integration(balanced, problem, period)
        attributes["check_deviation"] = deviation
        if status.valid and not deviation <= AGREEMENT * max(tolerance, balanced.error):
            status = Status.INCONSISTENT
            message = f"Time integration deviates by {deviation:.2g} from harmonic balance."
    if attributes.get("stable") == 0:
        message = f"{UNSTABLE} {message}"
    attributes |= {"status": str(status), "message": message, "energy_residual": residual}

    samples = balanced.in_period()
    data = to_dataset(balanced.system, samples)
    values = np.array(list(named_outputs(balanced.system, samples).values()))
    high, low = balanced.look.extrema[[HIGH, LOW]]
    fill(
        data, balanced.names, (high - low) / 2, high, low, np.sqrt(np.mean(values**2, axis=1)),
        harmonics_of(values), multipliers,
    )  # fmt: skip
    data.attrs = attributes
    return data
