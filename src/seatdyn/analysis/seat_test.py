"""The laboratory seat test as a simulation: simulated input vibration test, and damping test.

The platform moves with the spectrum of an input class, corrected run by run to the level that the
class asks for; a light and a heavy occupant sit on the seat; the SEAT factor of a run is the
frequency-weighted acceleration (Wk) at the seat surface over that of the platform (ISO
10326-1:2016, clause 10). What comes out is a statement about the model that went in, and no
certificate.
"""

from __future__ import annotations

import json
import math
import reprlib
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import seatdyn
from seatdyn.analysis.ensemble import Members, settling_time
from seatdyn.analysis.ensemble_runs import ensemble_for, steps_for
from seatdyn.analysis.linear import poles
from seatdyn.analysis.lowering import forces_at
from seatdyn.analysis.random import student
from seatdyn.analysis.seat_factor import WEIGHTING, Weighted
from seatdyn.analysis.stability import is_stable
from seatdyn.analysis.transient import simulate
from seatdyn.errors import RequestError, SeatdynWarning, Status
from seatdyn.kernels.lanes import LANES
from seatdyn.model.body import SEAT, SeatedBody, load_body
from seatdyn.model.description import seat_description
from seatdyn.model.elements import NonlinearElement
from seatdyn.model.noise import LARGEST_SEED, RandomMotion
from seatdyn.model.seat import Seat
from seatdyn.model.system import BASE, SeatSystem
from seatdyn.signals.counting import contact_speeds, contacts
from seatdyn.signals.estimators import rms_between, transfer_function
from seatdyn.signals.inputs import SeatTestInput, seat_test_input
from seatdyn.signals.spectrum import Spectrum
from seatdyn.signals.synthesis import Synthesis
from seatdyn.standards.acceptance import (
    HEAVY_PERSON,
    LIGHT_PERSON,
    RUN_AGREEMENT,
    RUNS,
    acceptance_limits,
)
from seatdyn.standards.inputs import LOWEST
from seatdyn.standards.metrics import rms, vdv
from seatdyn.standards.source import Constant, Grade
from seatdyn.standards.weighting import weighting
from seatdyn.units import number, whole

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]
SITTING_SHARE = Constant(
    0.75,
    "1",
    "mass on the seat over mass of the person, feet supported: 0.74 (Boileau and Rakheja 1998) to "
    "0.79 (Fairley and Griffin 1989)",
    Grade.UNCERTAIN,
)
SPACING = 2.5e-3  # s between samples of the signals: 400 Hz
RESOLUTION = 0.1  # Hz of the transmissibility
SHORTEST = 40.0  # s of a run: four segments of the transmissibility
MOST_RUNS = 1024
DEFAULT_BODY = "fairley1989"
ASSUMED_SCALING = "all masses, links and gains in one ratio, poles unchanged; assumed by seatdyn"
THREADS = 2
UNBOUNDED = 1e6  # m, m/s or m/s2: the motion has no bound
SHAKEN, COASTING, COAST_RATE = 20.0, 80.0, 100.0  # s, s and Hz of the search for self-excitation
AT_REST = 0.01  # of the level while shaken
LEVELS = dict.fromkeys(
    ("platform_rms", "weighted_platform", "weighted_seat", "corrected_seat"), "m/s2"
)


class Stop(NamedTuple):
    """An end stop of the suspension, and how its own travel counts: 1, or -1 from seat to base."""

    element: NonlinearElement
    bump: float  # clearance, m
    rebound: float
    sign: float = 1.0


def seat_test(
    seat: Seat,
    input_class: str | SeatTestInput,
    *,
    body: SeatedBody | str = DEFAULT_BODY,
    occupants: Mapping[str, float] | None = None,
    runs: int = LANES,
    duration: float = 180.0,
    seed: int = 1,
    confidence: float = 0.95,
    step_tolerance: float = 1e-3,
    limits: str | Path | None = None,
    progress: Callable[[float], None] | None = None,
) -> xr.Dataset:
    """Simulated input vibration test of a seat with a light and a heavy occupant.

    Parameters
    ----------
    seat : Seat
    input_class : such as "EM3", or what `seat_test_input` gives
    body : model of the occupant, scaled to the sitting masses; a name of `list_bodies()` or a body
    occupants : name -> sitting mass in kg (the mass that rests on the seat). By default persons of
        55 and 98 kg, of whom 75 % sit on the seat; 15 .. 200 kg
    runs : per occupant, 3 .. 1024. The laboratory makes three and asks that each is within 5 % of
        their mean (`agreement` is that of the first three); more of them narrow the interval
    duration : of a run, s, 40 .. 1e5, after the start has been forgotten
    seed : of all runs
    confidence : of the intervals, 0.5 .. 0.9999
    step_tolerance : largest relative error that the time step makes of any r.m.s. value
    limits : file of acceptance limits (`acceptance_limits`); by default the unverified ones
    progress : called with the share done

    Returns
    -------
    xarray.Dataset
        By occupant: seat_rms and seat_vdv (SEAT factors, means over the runs) with `_low`, `_high`
        (Student's t); agreement, agrees; by side (bump, rebound): travel_max (m), end_stop_impacts
        (mean number in a run), impact_speed (largest, m/s), buffer_force (largest, N);
        transmissibility (H1, complex) and coherence over frequency; member_status, and NaN for an
        occupant that has no valid result, such as one that drives the seat ("self_excited"). By
        occupant and run: run_seat_rms, run_seat_vdv, platform_rms (m/s2, band of the class),
        weighted_platform, weighted_seat, corrected_seat (m/s2). By side: clearance (free travel to
        the stops, m). Attributes: status, point (where SEAT was taken), step_error, seed, limits
        (JSON), ...

    Raises
    ------
    RequestError, ExcitationError, ModelError
        What cannot be tested, such as an unknown class or a mass outside the range.

    Warns
    -----
    SeatdynWarning
        An occupant drives the seat.

    Examples
    --------
    >>> import seatdyn as sd
    >>> seat = sd.load_seat("illustrative_suspension")
    >>> test = sd.seat_test(seat, "EM3", runs=3, duration=60.0)
    >>> test.attrs["status"], test.occupant.values.tolist()
    ('ok', ['light', 'heavy'])
    """
    if not isinstance(seat, Seat):
        raise RequestError(f"seat = {reprlib.repr(seat)} is no Seat; use load_seat or Seat(...).")
    spectrum = seat_test_input(input_class) if isinstance(input_class, str) else input_class
    if not isinstance(spectrum, SeatTestInput):
        raise RequestError(f"input_class = {reprlib.repr(input_class)} is no class such as 'EM3'.")
    model = load_body(body) if isinstance(body, str) else body
    if not isinstance(model, SeatedBody):
        raise RequestError(f"body = {reprlib.repr(body)} is no SeatedBody; use load_body.")
    runs = whole(runs, "runs", minimum=3, maximum=MOST_RUNS, error=RequestError)
    seed = whole(seed, "seed", minimum=0, maximum=LARGEST_SEED, error=RequestError)
    duration = number(duration, "duration", "s", minimum=SHORTEST, maximum=1e5, error=RequestError)
    confidence = number(
        confidence, "confidence", "", minimum=0.5, maximum=0.9999, error=RequestError
    )
    limit = acceptance_limits(limits).get(spectrum.name)
    people = dict(occupants) if occupants is not None else default_occupants()
    if not people:
        raise RequestError("occupants = {} is not allowed; give at least one sitting mass in kg.")
    systems = {
        name: SeatSystem(model.scaled(sitting_mass=mass), seat) for name, mass in people.items()
    }
    states = {name: _prospect(system, spectrum) for name, system in systems.items()}
    sound = [system for name, system in systems.items() if states[name].valid]
    plan = _Plan.make(sound, spectrum, duration, seed, step_tolerance) if sound else None
    results = []
    for k, (name, system) in enumerate(systems.items()):

        def report(share: float, done: int = k) -> None:
            if progress is not None:
                progress((done + share) / len(systems))

        if plan is not None and states[name].valid:
            tested = _test(system, plan, runs, confidence, report)
        else:
            tested = _Record().summary(runs, states[name], confidence)
        results.append(tested.assign_coords(occupant=name))
    request: dict[str, Any] = {
        "runs": runs,
        "duration_s": duration,
        "seed": seed,
        "confidence": confidence,
        "step_error": plan.error if plan else math.nan,
        "settle_s": plan.settle * plan.synthesis.step if plan else math.nan,
        "limits": json.dumps(asdict(limit) if limit else None),
    }
    data = _joined(results, seat, model, spectrum, **request)
    free = clearances(end_stops(systems[next(iter(systems))]))
    data["clearance"] = (("side",), free, {"units": "m"})
    data.coords["sitting_mass"] = (("occupant",), list(people.values()), {"units": "kg"})
    moving = [name for name, status in states.items() if status is Status.SELF_EXCITED]
    if moving:
        warnings.warn(
            f"{model.name} on this seat goes on moving when the platform has stopped (occupant "
            f"{', '.join(moving)}): it drives the seat itself, and there is no SEAT factor. Add "
            "damping or seat mass; look at `poles` and `critical_values`.",
            SeatdynWarning,
            stacklevel=2,
        )
    return data


def default_occupants() -> dict[str, float]:
    """Sitting masses in kg of a light person of 55 kg and a heavy one of 98 kg."""
    share = SITTING_SHARE.value
    return {"light": share * LIGHT_PERSON[1].value, "heavy": share * HEAVY_PERSON[0].value}


def measuring_point(system: SeatSystem) -> str:
    """Node where the SEAT factor is taken: between cushion and occupant, or else the frame."""
    return system.contact


def end_stops(system: SeatSystem) -> list[Stop]:
    """End stops between base and seat frame, whichever of the two they are written from."""
    found = []
    for element in system.nonlinear_elements:
        bump, rebound = (getattr(element, f"{s}_clearance", None) for s in ("bump", "rebound"))
        if set(element.between) != {BASE, SEAT} or bump is None or rebound is None:
            continue
        if element.between == (BASE, SEAT):
            found.append(Stop(element, bump, rebound))
        else:  # what compresses it is rebound of the suspension
            found.append(Stop(element, rebound, bump, -1.0))
    return found


class _Plan(NamedTuple):
    """What all occupants share: they are shaken by the same platform."""

    spectrum: SeatTestInput
    synthesis: Synthesis
    settle: int  # intervals of the grid
    steps: int
    level: float  # m/s2 r.m.s. over the whole band
    seed: int
    error: float

    @classmethod
    def make(
        cls,
        systems: list[SeatSystem],
        spectrum: SeatTestInput,
        duration: float,
        seed: int,
        tolerance: float,
    ) -> _Plan:
        """Long enough to forget the start, and steps short enough, for every system."""
        found = [poles(system) for system in systems]
        roots = [p["real"].to_numpy() + 1j * p["imag"].to_numpy() for p in found]
        settle = max(settling_time(values) for values in roots)
        synthesis = Synthesis(spectrum, duration + settle)
        level = spectrum.target * spectrum.acceleration_rms() / spectrum.acceleration_rms(LOWEST)
        chosen = [steps_for(s, synthesis, seed, tolerance, level=level) for s in systems]
        return cls(
            spectrum,
            synthesis,
            # an interval to spare: segments of the transmissibility are whole samples
            max(0, math.floor(settle / synthesis.step) - 1),
            max(steps for steps, _ in chosen),
            level,
            seed,
            max(error for _, error in chosen),
        )

    def ensemble(self, system: SeatSystem) -> Members:
        """One occupant's runs."""
        return ensemble_for(
            system,
            self.synthesis,
            self.settle,
            self.seed,
            self.steps,
            spacing=SPACING,
            peaks=(),
            level=self.level,
        )


def _test(
    system: SeatSystem,
    plan: _Plan,
    runs: int,
    confidence: float,
    progress: Callable[[float], None],
) -> xr.Dataset:
    """All runs of one occupant."""
    ensemble = plan.ensemble(system)
    point = measuring_point(system)
    wanted = ("acc_base", f"acc_{point}", "seat-base", "vel_seat-base")
    record = _Record(rate=1.0 / ensemble.spacing, stops=end_stops(system))
    blocks = math.ceil(runs / LANES)
    for number_, block in ensemble.blocks(iter(range(blocks)), THREADS, wanted):
        if not np.max(np.abs(block.series)) <= UNBOUNDED:
            return record.summary(runs, Status.DIVERGED, confidence)
        for signals in block.series[: runs - number_ * LANES]:
            record.add(signals, plan.spectrum)
        progress((number_ + 1) / blocks)
    return record.summary(runs, Status.OK, confidence)


def _prospect(system: SeatSystem, spectrum: Spectrum) -> Status:
    """What is known of a system before it is tested."""
    if is_stable(system):
        return Status.OK
    if system.is_linear:
        return Status.UNSTABLE
    return Status.SELF_EXCITED if self_excited(system, spectrum) else Status.OK


def self_excited(system: SeatSystem, spectrum: Spectrum) -> bool:
    """Whether a system goes on moving after a platform that shook it has come to rest.

    Only a system whose linear part is unstable can; friction, say, may still end its motion.
    """
    shaking = RandomMotion(spectrum, SHAKEN, seed=0)
    run = simulate(system, shaking, SHAKEN + COASTING, output_step=1.0 / COAST_RATE)
    if not Status(run.attrs["status"]).valid:
        return True
    surface = run.acceleration.sel(node=measuring_point(system)).values
    before, after = surface[: round(SHAKEN * COAST_RATE)], surface[-round(SHAKEN * COAST_RATE) :]
    return bool(rms(after) > AT_REST * rms(before))


class _Record:
    """What is kept of the runs of one occupant."""

    def __init__(self, rate: float = math.nan, stops: Sequence[Stop] = ()) -> None:
        """Start empty."""
        self.rate, self.stops = rate, stops
        self.runs: list[dict[str, Any]] = []
        self.transfers: list[tuple[NDArray[np.complex128], Array]] = []
        self.frequency = np.zeros(0)

    def add(self, signals: Array, spectrum: SeatTestInput) -> None:
        """Evaluate a run: platform and surface acceleration, travel and its rate, (4, n)."""
        platform, surface, travel, speed = signals
        weighted = weighting(WEIGHTING).apply(signals[:2], self.rate)
        below, above = rms(weighted).tolist()
        dose = vdv(weighted, self.rate)
        target = weighted_target(spectrum)
        self.runs.append(
            {
                "run_seat_rms": above / below,
                "run_seat_vdv": dose[1] / dose[0],
                "platform_rms": rms_between(platform, self.rate, [(LOWEST, spectrum.high)])[0],
                "weighted_platform": below,
                "weighted_seat": above,
                "corrected_seat": above * target / below,
                "travel": np.array([-travel.min(), travel.max()]),
                **impacts(travel, speed, self.stops),
            }
        )
        estimate = transfer_function(platform, surface, self.rate, resolution=RESOLUTION)
        inside = (estimate.frequency > 0.0) & (estimate.frequency <= spectrum.high)
        self.frequency = estimate.frequency[inside]
        self.transfers.append((estimate.value[inside], estimate.coherence[inside]))

    def summary(self, runs: int, status: Status, confidence: float) -> xr.Dataset:
        """Means, intervals and extremes over the runs; NaN where there is no valid result."""
        import xarray as xr

        valid = status is Status.OK
        empty = {
            **dict.fromkeys(("run_seat_rms", "run_seat_vdv", *LEVELS), math.nan),
            **dict.fromkeys(("travel", "count", "speed", "force"), np.full(2, math.nan)),
        }
        rows = self.runs if valid else [empty] * runs
        each = {name: np.array([row[name] for row in rows]) for name in empty}
        variables: dict[str, Any] = {
            name: (("run",), each[name], {"units": unit}) for name, unit in LEVELS.items()
        }
        for name in ("seat_rms", "seat_vdv"):
            values = each[f"run_{name}"]
            half = student(values.size, confidence) * values.std(ddof=1) / math.sqrt(values.size)
            ends = {"": 0.0, "_low": -half, "_high": half}
            variables |= {
                name + end: ((), values.mean() + shift, {"units": "1"})
                for end, shift in ends.items()
            }
            variables[f"run_{name}"] = (("run",), values, {"units": "1"})
        first = each["corrected_seat"][: int(RUNS.value)]
        off = float(np.max(np.abs(first / first.mean() - 1.0)))
        variables |= {
            "member_status": ((), str(status)),
            "agreement": ((), off, {"units": "1"}),
            "travel_max": (("side",), each["travel"].max(0), {"units": "m"}),
            "end_stop_impacts": (("side",), each["count"].mean(0), {"units": "1"}),
            "impact_speed": (("side",), each["speed"].max(0), {"units": "m/s"}),
            "buffer_force": (("side",), each["force"].max(0), {"units": "N"}),
        }
        coords: dict[str, Any] = {"side": ["bump", "rebound"], "run": np.arange(runs)}
        if valid:
            value, coherence = (
                np.mean(list(part), axis=0) for part in zip(*self.transfers, strict=True)
            )
            variables["transmissibility"] = (("frequency",), value, {"units": "1"})
            variables["coherence"] = (("frequency",), coherence, {"units": "1"})
            coords["frequency"] = ("frequency", self.frequency, {"units": "Hz"})
        attrs = {"status": str(status), "message": status.message}
        return xr.Dataset(variables, coords=coords, attrs=attrs)


def clearances(stops: Sequence[Stop]) -> Array:
    """Free travel in bump and rebound, m, (2,); NaN without stops."""
    if not stops:
        return np.full(2, math.nan)
    return np.array([min(stop.bump for stop in stops), min(stop.rebound for stop in stops)])


def impacts(travel: Array, speed: Array, stops: Sequence[Stop]) -> dict[str, Array]:
    """Contacts with the stops of a run, by side (bump, rebound), (2,).

    Of several stops on one side the first one reached counts, and their forces add up.

    Parameters
    ----------
    travel, speed : sampled displacement (m) and velocity (m/s) across the suspension
    stops : their clearances and laws

    Returns
    -------
    dict
        count of contacts; largest speed at contact (m/s), between the samples; largest force of
        the stops (N). Zero where there was no contact.
    """
    if not stops:
        return {name: np.zeros(2) for name in ("count", "speed", "force")}
    clearance = clearances(stops)
    free = {"bump_clearance": clearance[0], "rebound_clearance": clearance[1]}
    hits = contacts(travel, **free)
    speeds = contact_speeds(travel, speed, **free)
    pushes = []
    for sign, limit in zip((-1.0, 1.0), clearance, strict=True):
        d, v = (signal[sign * travel > limit] for signal in (travel, speed))
        push = np.zeros(d.size)
        for stop in stops:
            push += sign * stop.sign * forces_at(stop.element, stop.sign * d, stop.sign * v)
        pushes.append(np.max(push, initial=0.0))
    return {
        "count": np.array([hits.bump, hits.rebound], dtype=float),
        "speed": np.array([np.max(side, initial=0.0) for side in speeds]),
        "force": np.array(pushes),
    }


def weighted_target(spectrum: SeatTestInput) -> float:
    """Weighted r.m.s. acceleration of the platform in m/s2 that the class asks for."""
    exact = Weighted(spectrum, weighting(WEIGHTING)).acceleration_rms()
    return exact * spectrum.target / spectrum.acceleration_rms(LOWEST)


def _joined(
    results: list[xr.Dataset], seat: Seat, body: SeatedBody, spectrum: SeatTestInput, **request: Any
) -> xr.Dataset:
    """One Dataset over the occupants, with what produced it."""
    import xarray as xr

    system = SeatSystem(body, seat)

    worst = next((d for d in results if d.attrs["status"] != Status.OK), results[0])
    data = xr.concat(
        results,
        "occupant",
        data_vars="all",
        coords="minimal",
        compat="override",
        join="outer",
        combine_attrs="override",
    )
    limit = RUN_AGREEMENT.value
    data["agrees"] = (("occupant",), data["agreement"].to_numpy() <= limit, {"units": "1"})
    data.attrs = {
        "status": worst.attrs["status"],
        "message": worst.attrs["message"],
        "kind": "simulated input vibration test: a simulation, no certificate",
        "input_class": spectrum.name,
        "standard": spectrum.definition.standard,
        "weighting": WEIGHTING,
        "point": measuring_point(system),
        "seat": repr(seat),
        "seat_description": json.dumps(seat_description(seat, system.all_elements)),
        "seat_title": seat.title,
        "seat_source": seat.source,
        "body": body.name,
        "scaling": body.scaling or ASSUMED_SCALING,
        "seatdyn_version": seatdyn.__version__,
        **request,
    }
    return data
