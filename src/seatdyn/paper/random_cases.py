"""How the paper's random study is read, and every row of Tables 9 and 10 computed under a reading.

All levels are computed at a_0. Lengths divided by n turn the motion at n a_0 under

    gamma d beyond b     beta1 |v| v     (2/pi) beta2 atan(s v)

into the one at a_0 under the same laws with b/n, n beta1, and beta2/n with n s; the ratio of the
r.m.s. values to those of the linear suspension, to which n is nothing, stays.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from seatdyn.analysis.ensemble import Ensemble, choose_steps, settling_time
from seatdyn.analysis.linear import poles
from seatdyn.analysis.random import ratio_interval
from seatdyn.kernels.lanes import LANES
from seatdyn.model.elements import (
    CoulombFriction,
    NonlinearElement,
    PiecewiseSpring,
    QuadraticDamper,
)
from seatdyn.paper.cases import PRINTED_ZONE, SLOPE, STATED_RMS, STIFFNESS, paper_system
from seatdyn.paper.laws import offset_coulomb
from seatdyn.paper.random_tables import RATIO_OUTPUTS, printed_ratios
from seatdyn.paper.tables import Array
from seatdyn.signals.narrow_band import NarrowBand
from seatdyn.signals.synthesis import Synthesis

BANDWIDTH = 0.015  # Hz, half-power; Table 9 fits 0.01 to 0.03 at the stated r.m.s.
CUTS = (0.5, 4.65)  # Hz; the resonant band has 1e-4 of its mean square outside
CONFIDENCE = 0.95
NARROW = 0.005  # half width of every interval, over its ratio, at which no more are run
STEP_TOLERANCE = 5e-4  # error of an r.m.s. value
SEED = 1
REVERSED = {10.0: 40.0, 20.0: 20.0, 40.0: 10.0}  # beta2 in print: what its column belongs to


@dataclass(frozen=True)
class RandomReading:
    """One way to read the paper's random study.

    name : key in the summary
    text : one line for people
    centre : of the noise, Hz, back-off and back-on
    duration : gathered in every realisation, s
    realisations : most of them, a multiple of 16
    from_rest : the run begins at rest on a base that drifts with a/w, and is gathered at once;
        else the base has no drift, and the start is passed over
    literal : formulas, free zone and heads of columns as printed
    offset : added to the velocity in (5) at the level a_0, m/s
    """

    name: str
    text: str
    centre: tuple[float, float]
    duration: float
    realisations: int
    from_rest: bool = False
    literal: bool = True
    offset: float = 0.0

    def noise(self, back_on: bool) -> NarrowBand:
        """The noise at the level a_0."""
        return NarrowBand(self.centre[back_on], BANDWIDTH, rms=STATED_RMS, cuts=CUTS)

    def drift(self, back_on: bool) -> float | None:
        """Drift of the base: that of a sine of this r.m.s. integrated from zero, m/s."""
        peak = math.sqrt(2.0) * STATED_RMS
        return peak / (2 * math.pi * self.centre[back_on]) if self.from_rest else None


CONSISTENT = RandomReading(
    "consistent",
    "Gaussian noise of 0.686 m/s² r.m.s. through s/(s² + 2πBs + ω²), B = 0.015 Hz, centre 1.55 Hz "
    "(back-off) and 1.58 Hz (back-on); base without drift, steady state; formulas, free zone and "
    "heads as printed",
    centre=(1.55, 1.58),
    duration=300.0,
    realisations=96,
)
AS_READ = RandomReading(
    "as_read",
    "the same noise at the damped frequencies of Table 2, 1.54 and 1.57 Hz; 30 s from rest on a "
    "base that drifts with a/ω, a = 0.970 m/s²; no free zone in (3); Coulomb columns in reverse "
    "and 0.6 m/s added to the velocity in (5)",
    centre=(1.54, 1.57),
    duration=30.0,
    realisations=512,
    from_rest=True,
    literal=False,
    offset=0.6,
)
RANDOM_READINGS = (CONSISTENT, AS_READ)


class RandomCase(NamedTuple):
    """One suspension at the level a_0: all that the mean squares of a row depend on.

    parameter : "gamma", "beta1", "beta2", or "" for the linear one
    value : of the parameter
    zone : clearances of (3), m
    slope : of (5), s/m
    """

    reading: RandomReading
    back_on: bool
    parameter: str = ""
    value: float = 0.0
    zone: tuple[float, float] = (0.0, 0.0)
    slope: float = 0.0


def row_case(number: int, row: int, reading: RandomReading) -> RandomCase:
    """The case of one row of Table 9 or 10."""
    table = printed_ratios(number)
    parameter, value, n = table.rows[row]
    if parameter == "beta1":
        return RandomCase(reading, table.back_on, parameter, n * value)
    if parameter == "beta2":
        friction = value if reading.literal else REVERSED[value]
        return RandomCase(reading, table.back_on, parameter, friction / n, slope=n * SLOPE)
    zone = (PRINTED_ZONE[0] / n, PRINTED_ZONE[1] / n) if reading.literal else (0.0, 0.0)
    return RandomCase(reading, table.back_on, parameter, value, zone)


class Members(NamedTuple):
    """Mean squares of the columns of every realisation, (members, 8), and the error of the step."""

    squares: Array
    step_error: float


@cache
def members(case: RandomCase) -> Members:
    """Run the realisations of a case: all of the linear one, of others until `NARROW`."""
    reading = case.reading
    element, stiffness = _suspension(case)
    system = paper_system(case.back_on, element, stiffness=stiffness)
    settle, drift = 0.0, reading.drift(case.back_on)
    if drift is None:  # the same for all cases of a body, which see the same base motions
        found = poles(paper_system(case.back_on))
        settle = settling_time(found["real"].to_numpy())
    synthesis = Synthesis(reading.noise(case.back_on), settle + reading.duration)
    steps, error = choose_steps(system, synthesis, SEED, STEP_TOLERANCE, drift=drift)
    skipped = round(settle / synthesis.step)
    ensemble = Ensemble.make(system, synthesis, skipped, SEED, steps, peaks=(), drift=drift)
    columns = [ensemble.names.index(name) for name in RATIO_OUTPUTS]
    squares = np.empty((0, len(columns)))
    while len(squares) < reading.realisations:
        block = ensemble.run(len(squares) // LANES)
        squares = np.concatenate([squares, block.moments[columns, 1].T])
        if case.parameter:
            ratio, low, high = _ratio(case, squares)
            if np.max((high - low) / ratio) <= 2 * NARROW:
                break
    return Members(squares, error)


def _suspension(case: RandomCase) -> tuple[NonlinearElement | None, float]:
    """The non-linear element of a case, and the stiffness of the spring beside it."""
    if case.parameter == "beta1":
        return QuadraticDamper(case.value), STIFFNESS
    if case.parameter == "beta2":
        offset = case.reading.offset
        if offset:
            return offset_coulomb(friction=case.value, slope=case.slope, offset=offset), STIFFNESS
        return CoulombFriction(case.value, case.slope), STIFFNESS
    if any(case.zone):
        return PiecewiseSpring(case.value, *case.zone), STIFFNESS
    return None, STIFFNESS + case.value  # without a free zone (3) is a spring


def _ratio(case: RandomCase, squares: Array) -> Array:
    """Ratio to the linear suspension under the same base motions, and its interval, (3, 8)."""
    below = members(RandomCase(case.reading, case.back_on)).squares[: len(squares)]
    return ratio_interval(squares, below, CONFIDENCE)


def compute_ratios(
    number: int, reading: RandomReading, *, progress: Callable[[float], None] | None = None
) -> Array:
    """All rows of Table 9 or 10 under a reading: ratio, low and high end of its interval.

    Realisations are paired: both suspensions see the same base motions.

    Returns
    -------
    Array
        (3, 36, 8).
    """
    table = printed_ratios(number)
    cases = [row_case(number, i, reading) for i in range(len(table.rows))]
    linear = RandomCase(reading, table.back_on)
    members(linear)  # the others are compared with it
    wanted = list(dict.fromkeys(cases))
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        for k, _ in enumerate(pool.map(members, wanted)):
            if progress is not None:
                progress((k + 1) / len(wanted))
    return np.stack([_ratio(case, members(case).squares) for case in cases], axis=1)


def step_error(number: int, reading: RandomReading) -> float:
    """Largest error that the step makes of an r.m.s. value of a table."""
    rows = range(len(printed_ratios(number).rows))
    return max(members(row_case(number, i, reading)).step_error for i in rows)


def random_provenance(numbers: Iterable[int]) -> dict[str, Any]:
    """What the tables were computed with."""
    return {
        "rms_m_per_s2": STATED_RMS,
        "bandwidth_Hz": BANDWIDTH,
        "band_Hz": list(CUTS),
        "seed": SEED,
        "confidence": CONFIDENCE,
        "most_realisations": {r.name: r.realisations for r in RANDOM_READINGS},
        "step_error": {
            f"table{number:02d}": {r.name: step_error(number, r) for r in RANDOM_READINGS}
            for number in numbers
        },
    }
