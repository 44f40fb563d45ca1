"""Steady-state amplitudes (max - min)/2 with refined peaks."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from equations import Array
from scipy.optimize import minimize_scalar

CANDIDATE_BAND = 1e-3  # of the range: grid maxima this close to the top are all refined
MAX_CANDIDATES = 6


@dataclass(frozen=True)
class Segment:
    """A smooth stretch of the orbit: the outputs on a grid, and exactly at any time between."""

    times: Array  # (n,), both ends included
    evaluate: Callable[[Array], Array]  # times (m,) -> (m, outputs)
    values: Array = field(default_factory=lambda: np.empty(0))  # on the grid; evaluated if absent

    def __post_init__(self) -> None:
        if not self.values.size:
            object.__setattr__(self, "values", self.evaluate(self.times))


def _refine(segment: Segment, column: int, index: int, sign: float) -> float:
    """Largest value of sign * output between the grid neighbours of index (bounded Brent)."""
    t = segment.times
    low = t[max(index - 1, 0)] - t[index]
    high = t[min(index + 1, len(t) - 1)] - t[index]
    found = minimize_scalar(
        lambda s: -sign * float(segment.evaluate(np.array([t[index] + s]))[0, column]),
        bounds=(low, high),
        method="bounded",
        options={"xatol": 1e-7 * (high - low)},
    )
    return float(-found.fun)


def largest(segments: Sequence[Segment], column: int, sign: float) -> float:
    """Largest sign * output over all segments, ends (one-sided limits) included."""
    tops = [sign * s.values[:, column] for s in segments]
    best = max(float(top.max()) for top in tops)
    band = best - CANDIDATE_BAND * (best - min(float(top.min()) for top in tops))
    candidates = []
    for segment, top in zip(segments, tops, strict=True):
        padded = np.concatenate([[-np.inf], top, [-np.inf]])
        is_peak = (top >= padded[:-2]) & (top >= padded[2:]) & (top >= band)
        candidates += [(float(top[i]), segment, int(i)) for i in np.flatnonzero(is_peak)]
    candidates.sort(key=lambda item: -item[0])
    for _, segment, index in candidates[:MAX_CANDIDATES]:
        best = max(best, _refine(segment, column, index, sign))
    return best


def amplitudes(segments: Sequence[Segment]) -> Array:
    """(max - min)/2 of each output over the segments."""
    count = segments[0].values.shape[1]
    result = np.zeros(count)
    for column in range(count):
        if any(np.ptp(s.values[:, column]) > 0 for s in segments):
            result[column] = 0.5 * (
                largest(segments, column, 1.0) + largest(segments, column, -1.0)
            )
    return result
