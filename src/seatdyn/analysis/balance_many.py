"""Harmonic balance of many members at once: a row of them takes every step together.

The equations are those of `seatdyn.kernels.balance`,

    R_k = D_k - D0_k + G_k F_k(D) = 0

They are solved by the fixed point D - P R(D), where P_k = (1 + G_k (c_d + i k omega c_v))^-1 would
be the exact step were every channel its equivalent linear element: a spring c_d and damper c_v that
take the same power from the motion. Steps are mixed by Anderson's method [1], which needs no
derivatives of the laws and converges for smooth laws and for steep friction alike.

Levels, error estimate and peaks are those of `seatdyn.kernels.levels` and `orbit`. It is for laws
without jumps and stops. What does not converge is left to the caller.

[1] D. G. Anderson, Iterative procedures for nonlinear integral equations, J. ACM 12 (1965) 547-560
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seatdyn.kernels.columns import ELEMENTS
from seatdyn.kernels.condensed import OVERSAMPLING
from seatdyn.kernels.levels import (
    LEAST_GAIN,
    MOST_GAIN,
    NEWTON_SHARE,
    ROUNDING,
    SLOWING,
    SMALLEST_RESIDUAL,
    SUDDEN,
    SUDDEN_STEEP,
    UNRESOLVED,
)
from seatdyn.kernels.rows import WIDTH
from seatdyn.kernels.side_by_side import DEPTH, PAIRS, UNSURE, look, respond, settle

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

FEWEST, MOST = 64, 4096  # samples of a period
TOGETHER = 32 * WIDTH  # members of a level: their arrays stay small
LARGEST_FACTOR = 1e4  # of an elimination without pivoting
PATIENCE = 2  # levels that may fail
STEEP_GAIN = 3.0  # of the change between two levels, where forces are steep
STEEPER = 8.0  # than a sine of the same range: no smooth force is


class Many(NamedTuple):
    """Periodic problems of p members; see `Condensed` and `Look` for what they have in common.

    linear (p, N, 2N+2), pull (p, N, m), base (p, B), omega (p,), parameters (p, q),
    rows (p, o, C)
    channels, elements : of all, with the addresses of laws for rows
    """

    linear: Array
    pull: Array
    base: Complex
    omega: Array
    parameters: Array
    rows: Array
    channels: Integers
    elements: Integers

    def take(self, which: Integers | slice) -> Many:
        """Some of the members."""
        own = {name: getattr(self, name)[which] for name in self._fields[:6]}
        return self._replace(**own)


def balance_many(many: Many, tolerance: float) -> tuple[Array, Array]:
    """Amplitudes (p, o) of the outputs, and error estimates (p,), NaN where there are none."""
    size = len(many.omega)
    amplitude, error = np.full((size, many.rows.shape[1]), np.nan), np.full(size, np.nan)
    for start in range(0, size, TOGETHER):
        part = slice(start, start + TOGETHER)
        amplitude[part], error[part] = _ascend(many.take(part), tolerance)
    return amplitude, error


def _ascend(many: Many, tolerance: float) -> tuple[Array, Array]:
    """From few samples to as many as the estimates ask for."""
    size, outputs = many.rows.shape[:2]
    m = many.pull.shape[2]
    amplitude, error = np.full((size, outputs), np.nan), np.full(size, np.nan)
    place, failures = np.arange(size), np.zeros(size, int)
    newton = max(NEWTON_SHARE * tolerance, SMALLEST_RESIDUAL)
    series = np.zeros((size, m, 0, 2))
    before = np.full((size, 2, outputs), np.nan)
    change_before = np.full(size, np.inf)
    n, level = FEWEST, None
    while place.size and n <= MOST:
        level = Level(many, n, level)
        found, left, leap = level.solve(series, newton)
        solved = np.isfinite(left)
        failures += ~solved
        extrema, unsure = level.extrema()
        # close enough, and with no force much steeper than a sine
        resolved, smooth = leap <= UNRESOLVED, leap <= STEEPER * np.pi / n
        extrema[~(solved & resolved)] = np.nan
        change = change_of(extrema, before, found, series)
        estimate = np.maximum(unsure, estimate_of(change, change_before, smooth, left))
        done = estimate <= tolerance
        amplitude[place[done]] = (extrema[done, 0] - extrema[done, 1]) / 2
        error[place[done]] = estimate[done]
        stay = np.nonzero(~done & (failures < PATIENCE) & ~np.isnan(left))[0]
        if stay.size < place.size:
            many, place, failures, level = many.take(stay), place[stay], failures[stay], None
        before, change_before, series = extrema[stay], change[stay], found[stay]
        n *= 2
    return amplitude, error


def in_rows(values: Array) -> Array:
    """Numbers (p, ...) of members as rows (G, ..., W); the last member fills the last row."""
    groups = -(-len(values) // WIDTH)
    filled = values[np.minimum(np.arange(groups * WIDTH), len(values) - 1)]
    return np.ascontiguousarray(
        np.moveaxis(filled.reshape(groups, WIDTH, *values.shape[1:]), 1, -1)
    )


class Level:
    """Members with n samples of the period."""

    def __init__(self, many: Many, n: int, before: Level | None) -> None:
        """Work out the linear motion, but what a level before has of the same members."""
        self._many, self._n, self._size = many, n, len(many.omega)
        groups, nodes, m = -(-self._size // WIDTH), *many.pull.shape[1:]
        count = n // OVERSAMPLING
        self._omega = in_rows(many.omega)
        base = np.stack([many.base.real, many.base.imag], axis=2)
        base[:, 1:] *= 0.5
        self._base = in_rows(base)
        self._node = np.empty((groups, nodes, m + 1, count, 2, WIDTH))
        self._across = np.empty((groups, m, m + 1, count, 2, WIDTH))
        self._doubt, known = np.zeros((groups, WIDTH)), 0
        if before is not None:
            known, self._doubt = before._node.shape[3], before._doubt
            self._node[:, :, :, :known], self._across[:, :, :, :known] = (
                before._node,
                before._across,
            )
        respond(
            in_rows(many.linear), in_rows(many.pull), self._base, self._omega, many.channels, known,
            self._node, self._across, self._doubt, np.empty((nodes, nodes + m + 1, 2, WIDTH)),
        )  # fmt: skip
        angle = 2 * np.pi * np.arange(n) / n
        self._roots = np.stack([np.cos(angle), -np.sin(angle)], axis=1)
        self._lines = np.empty((2, n, WIDTH))

    def _members(self, rows: Array) -> Array:
        """Numbers of members (p, ...) from rows."""
        moved = np.moveaxis(rows, -1, 1)
        return moved.reshape(len(rows) * WIDTH, *moved.shape[2:])[: self._size]

    def solve(self, guess: Array, tolerance: float) -> tuple[Array, Array, Array]:
        """Harmonics (p, m, K, 2), residuals (p,), and leaps of the forces between samples (p,).

        From the harmonics known, or else from the linear motion. A residual is infinite where there
        is no solution, and not a number where the linear motion is not known.
        """
        many, n = self._many, self._n
        groups, m, _, count = self._across.shape[:4]
        series = np.zeros((groups, m, count, 2, WIDTH))
        known = guess.shape[2]
        series[:, :, :known] = in_rows(guess)
        if not known:
            series[:] = self._across[:, :, m]
        e, q = len(many.elements), many.parameters.shape[1]
        self._force = np.empty_like(series)
        self._forces = np.empty((groups, e, n, WIDTH))
        self._total = np.empty((groups, m, n, WIDTH))
        left, leap = np.empty((2, groups, WIDTH))
        settle(
            self._across, self._omega, in_rows(many.parameters), many.channels, many.elements,
            self._roots, tolerance, series, self._force, self._forces, self._total, left, leap,
            np.empty((PAIRS + 2 * DEPTH, m, count, 2, WIDTH)), self._lines,
            np.empty((2, m, n, WIDTH)), np.empty(q * n * WIDTH),
            np.empty((DEPTH, DEPTH, WIDTH)), np.empty((DEPTH, DEPTH + 1, WIDTH)),
            np.empty((m, 2, WIDTH)), np.empty((m, m + 1, 2, WIDTH)),
        )  # fmt: skip
        left[~(self._doubt <= LARGEST_FACTOR**2)] = np.nan
        return self._members(series), self._members(left), self._members(leap)

    def extrema(self) -> tuple[Array, Array]:
        """Highest and lowest value (p, 2, o) of every output over the period.

        And how unsure they are for what is between the samples, relative to the amplitude (p,).
        """
        many, n = self._many, self._n
        nodes, e = many.linear.shape[1], len(many.elements)
        # accelerations follow from the rest
        cuts = np.cumsum([2 * nodes, nodes, e])
        state, acceleration, force, drive = np.split(many.rows, cuts, axis=2)
        state = state + acceleration @ many.linear[:, :, : 2 * nodes]
        shift = acceleration @ many.linear[:, :, 2 * nodes :]
        drive = drive + np.concatenate([shift, np.zeros_like(shift[..., :1])], axis=2)
        channel = np.repeat(np.arange(len(many.channels) - 1), np.diff(many.channels[:, ELEMENTS]))
        force = force - (acceleration @ many.pull)[..., channel]
        weights = np.concatenate([state, force, drive], axis=2)
        matters = np.any(weights != 0.0, axis=0)
        used = np.nonzero(matters)[1]
        begins = np.concatenate([[0], np.cumsum(matters.sum(axis=1))])
        extrema = np.empty((len(self._node), 2 * UNSURE, weights.shape[1], WIDTH))
        look(
            self._node, self._force, self._forces, self._base, self._omega, in_rows(weights),
            used, begins, self._roots, extrema, self._lines,
            np.empty((self._node.shape[3], 2, WIDTH)),
            np.empty((weights.shape[2], n, WIDTH)), np.empty((n, WIDTH)),
        )  # fmt: skip
        found, unsure = np.split(self._members(extrema), [UNSURE], axis=1)
        swing, least = (found[:, 0] - found[:, 1]) / 2, ROUNDING * np.abs(found).max(axis=1)
        unsure = unsure.max(axis=1) / np.maximum(swing, np.maximum(least, np.finfo(float).tiny))
        return found, unsure.max(axis=1)


def change_of(extrema: Array, before: Array, series: Array, series_before: Array) -> Array:
    """Largest change (p,) of an extremum relative to the amplitude of its output; inf if unknown.

    And not less than the change of the motion: a single extremum may happen to stay.

    extrema, before : (p, 2, o); series, series_before : (p, m, K, 2)
    """
    moved = np.abs(extrema - before).max(axis=1)
    swing = (extrema[:, 0] - extrema[:, 1]) / 2
    with np.errstate(divide="ignore", invalid="ignore"):
        change = np.where(moved > ROUNDING * np.abs(extrema).max(axis=1), moved / swing, 0.0)
    change[np.isnan(moved)] = np.inf
    difference = series.copy()
    difference[:, :, : series_before.shape[2]] -= series_before
    with np.errstate(divide="ignore", invalid="ignore"):
        whole = np.sqrt((difference**2).sum(axis=(1, 2, 3)) / (series**2).sum(axis=(1, 2, 3)))
    return np.asarray(np.fmax(change.max(axis=1), whole))


def estimate_of(change: Array, change_before: Array, smooth: Flags, left: Array) -> Array:
    """Errors (p,) from the last two changes and what was left of the residual."""
    before = np.where(np.isfinite(change_before), change_before, 0.0)
    ratio = np.divide(change, before, out=np.ones_like(change), where=before > 0.0)
    known = smooth & (before > 0.0)
    gain = np.where(known, np.clip(SLOWING * ratio, LEAST_GAIN, MOST_GAIN), MOST_GAIN)
    gain = np.where(smooth, gain, STEEP_GAIN)
    sudden = np.where(smooth, SUDDEN, SUDDEN_STEEP)
    return np.asarray(np.maximum(change * gain, sudden * before) + 4.0 * left + ROUNDING)
