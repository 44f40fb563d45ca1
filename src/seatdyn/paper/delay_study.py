"""What a reaction delay of the whole suspension does to the paper's systems. Not in print.

The paper's abstract speaks of "a sequence of time delay of the VIS reactions"; its tables have
none. So this is our own study: both bodies, the linear seat and each non-linear law at one value,
formulas as printed, under the paper's sine, from rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from seatdyn.analysis.delay_margin import delay_margin
from seatdyn.analysis.outputs import named_outputs
from seatdyn.analysis.response import frequency_response
from seatdyn.analysis.run import Settings
from seatdyn.analysis.steady import steady_state
from seatdyn.analysis.transient import run_for
from seatdyn.errors import Status
from seatdyn.model.excitation import Sine
from seatdyn.model.system import SeatSystem
from seatdyn.paper.cases import AMPLITUDE, FREQUENCY, PRINTED_ZONE, STIFFNESS, law, paper_system
from seatdyn.paper.tables import Array

LONGEST = 0.05  # s
DELAYS = np.linspace(0.0, LONGEST, 17)
BISECTIONS = 3  # of the interval in which the periodic motion is lost
VALUES = {"linear": 0.0, "gamma": 1000.0, "beta1": 500.0, "beta2": 50.0}
SHOWN = ("acc_m1", "acc_m2", "acc_seat", "F_spring", "F_damper", "F_nonlinear")
SETTINGS, TOLERANCE = Settings(rtol=1e-8), 1e-7
MOST_PERIODS, PATIENCE = 120, 400  # until a motion repeats itself; where it still falls
WINDOWS, WINDOW = 5, 60  # a run from rest: number of windows, and periods of each
PER_PERIOD = 64  # samples of a window

PERIODIC, FALLS, BOUNDED, GROWS = "periodic", "falls", "bounded", "grows"


@dataclass(frozen=True)
class Response:
    """What a seat does at one delay: largest and smallest values of the outputs SHOWN."""

    delay: float
    kind: str
    high: Array
    low: Array


@dataclass(frozen=True)
class Sweep:
    """Responses over the delay, and delays in s at which linear limits of the seat destabilise.

    margin : the linear part, without the law
    outer : with the law's stiffness and damping at large motion
    """

    responses: list[Response]
    margin: float
    outer: float

    @property
    def last_periodic(self) -> float:
        """Longest delay of the unbroken row of periodic responses, s."""
        row = [r.delay for r in self.responses if r.kind != PERIODIC]
        limit = min(row, default=np.inf)
        return max(r.delay for r in self.responses if r.delay < limit)


def system_of(back_on: bool, parameter: str) -> SeatSystem:
    """The paper's body on its seat with one law at the value studied."""
    if parameter == "linear":
        return paper_system(back_on)
    return paper_system(back_on, law(parameter, VALUES[parameter], PRINTED_ZONE, 0.0))


@cache
def sweep(back_on: bool, parameter: str) -> Sweep:
    """All responses of one system, with finer delays where periodic motion ends."""
    system, sine = system_of(back_on, parameter), Sine(FREQUENCY[back_on], amplitude=AMPLITUDE)
    margin = outer = float(delay_margin(system).delay_margin)
    if parameter == "gamma":  # the spring of the outer zone comes on top
        stiffer = paper_system(back_on, stiffness=STIFFNESS + VALUES["gamma"])
        outer = float(delay_margin(stiffer).delay_margin)
    elif parameter == "beta1":  # the damping grows with the motion
        outer = np.inf
    if parameter == "linear":
        # its amplitudes are exact; beyond the margin it grows for ever
        delays = [*(float(d) for d in DELAYS if d < margin), margin * (1.0 - 1e-3)]
        return Sweep([linear_response(system, sine, d) for d in delays], margin, outer)

    def find(delay: float) -> Response:
        return response(system.delayed(delay), sine, delay)

    responses = [find(float(delay)) for delay in DELAYS]
    last = next((k for k, r in enumerate(responses) if r.kind != PERIODIC), None)
    if last:
        good, bad = responses[last - 1], responses[last]
        for _ in range(BISECTIONS):
            middle = find(0.5 * (good.delay + bad.delay))
            responses.append(middle)
            good, bad = (middle, bad) if middle.kind == PERIODIC else (good, middle)
    return Sweep(sorted(responses, key=lambda r: r.delay), margin, outer)


def linear_response(system: SeatSystem, sine: Sine, delay: float) -> Response:
    """Amplitudes of the linear system from its frequency response."""
    data = frequency_response(system.delayed(delay), frequency=[sine.frequency])
    motion = {f"acc_{n}": data.transmissibility.sel(node=n).item() for n in system.nodes}
    spring, damper = (data.element_force.sel(element=e).item() for e in ("Spring", "Damper"))
    values = motion | {"F_spring": spring, "F_damper": damper, "F_nonlinear": 0.0}
    high = np.array([abs(values[name]) * sine.peak for name in SHOWN])
    return Response(float(delay), PERIODIC, high, -high)


def response(system: SeatSystem, sine: Sine, delay: float) -> Response:
    """Steady state where there is one; else whether the motion from rest stays bounded."""
    for most in (MOST_PERIODS, PATIENCE):
        state = steady_state(system, sine, settings=SETTINGS, tolerance=TOLERANCE, max_periods=most)
        if state.attrs["status"] == Status.CONVERGED:
            shown = state.sel(output=list(SHOWN))
            return Response(delay, PERIODIC, shown.maximum.values, shown.minimum.values)
        kind, high, low = from_rest(system, sine)
        if kind != FALLS:
            break
    return Response(delay, BOUNDED if kind == FALLS else kind, high, low)


def from_rest(system: SeatSystem, sine: Sine) -> tuple[str, Array, Array]:
    """Whether the motion from rest grows, falls or wanders, and its bounds in the last window."""
    run = run_for(system, sine, WINDOWS * WINDOW / sine.frequency, settings=SETTINGS)
    nothing = np.full(len(SHOWN), np.nan)
    if run.status is not Status.OK:
        return GROWS, nothing, nothing
    highs, lows = [], []
    for k in range(1, WINDOWS):
        times = (k * WINDOW + np.arange(WINDOW * PER_PERIOD) / PER_PERIOD) / sine.frequency
        outputs = named_outputs(system, run.at(times))
        values = np.array([outputs[name] for name in SHOWN])
        highs.append(values.max(1))
        lows.append(values.min(1))
    seat = SHOWN.index("acc_seat")
    change = np.diff([high[seat] - low[seat] for high, low in zip(highs, lows, strict=True)])
    kind = GROWS if np.all(change > 0.0) else FALLS if np.all(change < 0.0) else BOUNDED
    return kind, highs[-1], lows[-1]
