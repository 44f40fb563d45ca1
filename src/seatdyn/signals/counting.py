"""Counts on a signal: level crossings, peaks, rainflow cycles, contacts with end stops.

All counts are of the samples joined by straight lines; sample at least 20 times in the period of
the fastest motion, or peaks are missed. Methods and names are those of ASTM E1049-85, its clauses
5.1 (level crossings), 5.2 (peaks) and 5.4.4 (rainflow).
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seatdyn.errors import RequestError
from seatdyn.units import DURATION, LENGTH, number

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


class Crossings(NamedTuple):
    """Number of crossings of each level, (L,)."""

    upward: Indices
    downward: Indices


class Cycles(NamedTuple):
    """Rainflow cycles, arrays (k,), in the order in which they are closed."""

    range: Array
    mean: Array
    weight: Array  # 1 for a cycle, 0.5 for half of one
    begin: Indices  # sample at either end
    end: Indices

    def exceedances(self, ranges: ArrayLike) -> Array:
        """Number of cycles with at least these ranges, same shape."""
        asked = np.asarray(ranges, dtype=float)
        order = np.argsort(self.range)
        below = np.concatenate([[0.0], np.cumsum(self.weight[order])])
        place = np.searchsorted(self.range[order], asked, side="left")
        return np.asarray(self.weight.sum() - below[place])


class Contacts(NamedTuple):
    """Contacts of a suspension with its end stops, in bump and in rebound apart."""

    bump: int  # number
    rebound: int
    bump_share: float  # of the time
    rebound_share: float
    bump_depth: float  # largest compression of the stop, m
    rebound_depth: float


class Share(NamedTuple):
    """A probability estimated from independent trials, and the ends of its interval."""

    probability: float
    low: float
    high: float


def turning_points(signal: ArrayLike) -> Indices:
    """Samples at which the signal turns, with its first and last one; of a plateau the first.

    Examples
    --------
    >>> turning_points([0.0, 1.0, 1.0, 3.0, 2.0, 2.0, 5.0]).tolist()
    [0, 3, 4, 6]
    """
    y = _samples(signal)
    kept = np.flatnonzero(np.append(True, np.diff(y) != 0.0))
    slope = np.sign(np.diff(y[kept]))
    turns = np.flatnonzero(slope[1:] != slope[:-1]) + 1
    ends = [kept[0], kept[-1]] if kept.size > 1 else [kept[0]]
    return np.unique(np.concatenate([ends, kept[turns]])).astype(np.int64)


def level_crossings(signal: ArrayLike, levels: ArrayLike) -> Crossings:
    """Crossings of levels. A touch that turns back is none.

    Parameters
    ----------
    signal : (n,), at least 2 finite samples
    levels : (L,)

    Examples
    --------
    >>> level_crossings([-1.0, 1.0, -1.0, 2.0], [0.0, 1.5]).upward.tolist()
    [2, 1]
    """
    y = _samples(signal)
    wanted = np.atleast_1d(np.asarray(levels, dtype=float))
    upward, downward = [], []
    for level in wanted:
        above = y[y != level] > level
        change = np.diff(above.astype(np.int8))
        upward.append(np.count_nonzero(change > 0))
        downward.append(np.count_nonzero(change < 0))
    return Crossings(np.array(upward, dtype=np.int64), np.array(downward, dtype=np.int64))


def peaks(signal: ArrayLike, reference: float | None = None) -> tuple[Array, Array]:
    """Maxima above and minima below a reference level, by default the mean of the signal.

    Returns
    -------
    maxima, minima : arrays of values, in time; the ends of the signal are no peaks

    Examples
    --------
    >>> maxima, minima = peaks([0.0, 2.0, 1.0, 3.0, -1.0, 0.0], reference=0.0)
    >>> maxima.tolist(), minima.tolist()
    ([2.0, 3.0], [-1.0])
    """
    y = _samples(signal)
    level = float(np.mean(y)) if reference is None else reference
    level = number(level, "reference", "", error=RequestError)
    values = y[turning_points(y)]
    inner, before, after = values[1:-1], values[:-2], values[2:]
    maxima = inner[(inner > before) & (inner > after) & (inner > level)]
    minima = inner[(inner < before) & (inner < after) & (inner < level)]
    return maxima, minima


def rainflow(signal: ArrayLike) -> Cycles:
    """Rainflow cycles by the three-point method of ASTM E1049-85, clause 5.4.4.

    A range that is followed by one at least as large is a cycle; one that begins with the signal,
    and what is left over at its end, is half a cycle.

    Examples
    --------
    >>> cycles = rainflow([-2, 1, -3, 5, -1, 3, -4, 4, -2])
    >>> cycles.range.tolist(), cycles.weight.tolist()
    ([3.0, 4.0, 4.0, 8.0, 9.0, 8.0, 6.0], [0.5, 0.5, 1.0, 0.5, 0.5, 0.5, 0.5])
    """
    y = _samples(signal)
    stack: list[int] = []
    found: list[tuple[int, int, float]] = []
    values = y.tolist()
    for point in turning_points(y).tolist():
        stack.append(point)
        while len(stack) >= 3:
            a, b, c = (values[i] for i in stack[-3:])
            if abs(c - b) < abs(b - a):
                break
            if len(stack) == 3:
                found.append((stack[0], stack[1], 0.5))
                del stack[0]
            else:
                found.append((stack[-3], stack[-2], 1.0))
                del stack[-3:-1]
    found += [(a, b, 0.5) for a, b in pairwise(stack)]
    rows = np.array(found, dtype=float).reshape(-1, 3)
    begin, end = rows[:, 0].astype(np.int64), rows[:, 1].astype(np.int64)
    return Cycles(np.abs(y[end] - y[begin]), (y[end] + y[begin]) / 2, rows[:, 2], begin, end)


def contacts(travel: ArrayLike, *, bump_clearance: float, rebound_clearance: float) -> Contacts:
    """Contacts of a suspension with its end stops, from its travel.

    Parameters
    ----------
    travel : d in m, (n,), evenly sampled, positive in rebound
    bump_clearance, rebound_clearance : free travel in m, 0 .. 1000

    Examples
    --------
    >>> hits = contacts([0.0, -0.03, 0.0, -0.01], bump_clearance=0.02, rebound_clearance=0.05)
    >>> hits.bump, hits.rebound, round(hits.bump_depth, 9)
    (1, 0, 0.01)
    """
    d = _samples(travel)
    low, high = _clearances(bump_clearance, rebound_clearance)
    touched = [-d > low, d > high]
    begun = [int(hit[0]) + int(np.count_nonzero(hit[1:] & ~hit[:-1])) for hit in touched]
    return Contacts(
        bump=begun[0],
        rebound=begun[1],
        bump_share=float(np.mean(touched[0])),
        rebound_share=float(np.mean(touched[1])),
        bump_depth=max(0.0, float(-d.min()) - low),
        rebound_depth=max(0.0, float(d.max()) - high),
    )


def contact_speeds(
    travel: ArrayLike, speed: ArrayLike, *, bump_clearance: float, rebound_clearance: float
) -> tuple[Array, Array]:
    """Speeds in m/s at which a suspension reaches its end stops, in bump and in rebound.

    Between two samples the speed goes with the travel. A contact with which the record begins has
    no speed that is known, and is left out.

    Parameters
    ----------
    travel, bump_clearance, rebound_clearance : as in `contacts`
    speed : rate of the travel in m/s, (n,)

    Examples
    --------
    >>> bump, rebound = contact_speeds(
    ...     [0.0, -0.03, 0.0], [-0.6, -0.2, 0.6], bump_clearance=0.02, rebound_clearance=0.05
    ... )
    >>> bump.round(6).tolist(), rebound.tolist()
    ([0.333333], [])
    """
    d, v = _samples(travel), _samples(speed)
    if d.shape != v.shape:
        raise RequestError(f"travel has {d.size} and speed {v.size} samples; give as many.")
    found = []
    for sign, clearance in zip(
        (-1, 1), _clearances(bump_clearance, rebound_clearance), strict=True
    ):
        past = sign * d - clearance
        begin = np.flatnonzero((past[1:] > 0.0) & (past[:-1] <= 0.0))
        share = past[begin] / (past[begin] - past[begin + 1])
        found.append(sign * (v[begin] + share * (v[begin + 1] - v[begin])))
    return found[0], found[1]


def probability(hits: int, trials: int, *, confidence: float = 0.95) -> Share:
    """Probability from `hits` in independent `trials`, with the exact interval.

    For instance of contact with an end stop, from the number of realisations with contact. The
    interval is that of Clopper and Pearson (Biometrika 26 (1934) 404): its confidence is at least
    the one asked for, also without a single hit.

    Examples
    --------
    >>> probability(0, 60).high < 0.06
    True
    """
    from scipy.stats import beta

    n = round(number(trials, "trials", "", minimum=1.0, error=RequestError))
    k = round(number(hits, "hits", "", minimum=0.0, maximum=float(n), error=RequestError))
    inside = number(confidence, "confidence", "", minimum=0.0, maximum=1.0, error=RequestError)
    tail = (1.0 - inside) / 2
    low = float(beta.ppf(tail, k, n - k + 1)) if k else 0.0
    high = float(beta.ppf(1.0 - tail, k + 1, n - k)) if k < n else 1.0
    return Share(k / n, low, high)


def gaussian_crossings(level: ArrayLike, rms: float, rate_rms: float, mean: float = 0.0) -> Array:
    """Upward crossings of a level per second by a stationary Gaussian signal (Rice 1944).

    rate_rms/(2 pi rms) exp(-(level - mean)^2/(2 rms^2)); as many go downward.

    Parameters
    ----------
    level, rms, mean : in one unit
    rate_rms : of the time derivative, per s

    Examples
    --------
    >>> round(float(gaussian_crossings(0.0, 0.01, 0.1)), 6)
    1.591549
    """
    sigma = number(rms, "rms", "", above=0.0, error=RequestError)
    rate = number(rate_rms, "rate_rms", "per s", minimum=0.0, error=RequestError)
    score = (np.asarray(level, dtype=float) - mean) / sigma
    return np.asarray(rate / sigma / (2 * math.pi) * np.exp(-0.5 * score**2))


def gaussian_contact(
    duration: float,
    *,
    rms: float,
    rate_rms: float,
    bump_clearance: float,
    rebound_clearance: float,
    mean: float = 0.0,
) -> float:
    """Probability that a Gaussian travel reaches an end stop within a time.

    1 - P0 exp(-nu T/P0), with P0 the probability to begin inside the clearances and nu the rate of
    leaving them: crossings are taken for independent. That is safe for high clearances, and too
    pessimistic for a narrow band, whose large peaks come in groups (Vanmarcke, J. Appl. Mech. 42
    (1975) 215).

    Parameters
    ----------
    duration : T in s
    rms, rate_rms, mean : of the travel, m and m/s, such as `linear_response` gives
    bump_clearance, rebound_clearance : m, 0 .. 1000

    Examples
    --------
    >>> p = gaussian_contact(
    ...     60.0, rms=0.01, rate_rms=0.1, bump_clearance=0.04, rebound_clearance=0.05
    ... )
    >>> round(p, 4)
    0.0319
    """
    from scipy.special import ndtr

    time = number(duration, "duration", "s", **DURATION, error=RequestError)
    low, high = _clearances(bump_clearance, rebound_clearance)
    leaving = float(gaussian_crossings([-low, high], rms, rate_rms, mean).sum())
    inside = float(ndtr((high - mean) / rms) - ndtr((-low - mean) / rms))
    return 1.0 - inside * math.exp(-leaving * time / inside) if inside > 0.0 else 1.0


def _clearances(bump: float, rebound: float) -> tuple[float, float]:
    low = number(bump, "bump_clearance", "m", **LENGTH, error=RequestError)
    return low, number(rebound, "rebound_clearance", "m", **LENGTH, error=RequestError)


def _samples(signal: ArrayLike) -> Array:
    """A signal as an array, or a refusal."""
    try:
        y = np.asarray(signal, dtype=float)
    except (TypeError, ValueError):
        raise RequestError("The signal must be a list of numbers.") from None
    if y.ndim != 1 or y.size < 2:
        raise RequestError(f"The signal has the shape {y.shape}; give at least 2 samples in a row.")
    if not np.all(np.isfinite(y)):
        place = int(np.argmin(np.isfinite(y)))
        raise RequestError(f"signal[{place}] = {y[place]} is not finite; repair or cut it there.")
    return y
