"""Harmonic balance of many members at once: a row of them takes every step together.

The equations are those of `seatdyn.kernels.balance`,

    R_k = D_k - D0_k + G_k F_k(D) = 0

They are solved by the fixed point D - P R(D), where P_k = (1 + G_k (c_d + i k omega c_v))^-1 would
be the exact step were every channel its equivalent linear element: a spring c_d and damper c_v that
take the same power from the motion. Steps are mixed by Anderson's method [1], which needs no
derivatives of the laws and converges for smooth laws and for steep friction alike.

Where the base has odd harmonics only and the laws are odd, the second half of a period is the first
turned over, and half of all samples and harmonics tell the rest. The forces show whether they are.

Levels, error estimate and peaks are those of `seatdyn.kernels.levels` and `orbit`. It is for laws
without jumps and stops. What does not converge is left to the caller.

[1] D. G. Anderson, Iterative procedures for nonlinear integral equations, J. ACM 12 (1965) 547-560
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seatdyn.kernels.condensed import OVERSAMPLING
from seatdyn.kernels.levels import (
    NEWTON_SHARE,
    ROUNDING,
    SMALLEST_RESIDUAL,
    SUDDEN,
    SUDDEN_STEEP,
    UNRESOLVED,
)
from seatdyn.kernels.rows import WIDTH, Space, aligned
from seatdyn.kernels.rows_look import AHEAD, ROUGH, look
from seatdyn.kernels.side_by_side import DEPTH, LEFT, PAIRS, respond, settle

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

FEWEST, MOST = 64, 4096  # samples of a period
TOGETHER = 64 * WIDTH  # members of a level: their arrays stay small
LARGEST_FACTOR = 1e4  # of an elimination without pivoting
PATIENCE = 2  # levels that may fail
UNEVEN = 3  # steps between the fastest and the slowest member from which on they are sorted
# fourth differences that fall below this share from level to level are not those of a corner: there
# they halve, and of a smooth force fall to 1/16; and what a corner's peak may miss in terms of them
SMOOTHER, BESIDE_CORNER = 1.0 / 6.0, 0.35
STEEP_GAIN = 3.0  # of the change between two levels, where forces are steep
STEEPER = 8.0  # than a sine: no smooth force is


class Many(NamedTuple):
    """Periodic problems of p members; see `Condensed` and `Look` for what they have in common.

    linear (p, N, 2N+2), pull (p, N, m), base (p, B), omega (p,), parameters (p, q),
    weights (p, o, C) of outputs in the columns z, v, element forces, and u, u', u''
    channels, elements : of all, with the addresses of laws for rows
    """

    linear: Array
    pull: Array
    base: Complex
    omega: Array
    parameters: Array
    weights: Array
    channels: Integers
    elements: Integers

    def take(self, which: Integers | slice) -> Many:
        """Some of the members."""
        own = {name: getattr(self, name)[which] for name in self._fields[:6]}
        return self._replace(**own)


class NotOdd(Exception):
    """A law that gives another force, not only another sign, to the motion with the other sign."""


def balance_many(many: Many, tolerance: float) -> tuple[Array, Array]:
    """Amplitudes (p, o) of the outputs, and error estimates (p,), NaN where there are none."""
    size = len(many.omega)
    amplitude, error = np.full((size, many.weights.shape[1]), np.nan), np.full(size, np.nan)
    odd = not np.any(many.base[:, ::2])  # as long as the laws are
    spaces = [Space(), Space()]
    for start in range(0, size, TOGETHER):
        part = slice(start, start + TOGETHER)
        try:
            amplitude[part], error[part] = ascend(many.take(part), tolerance, odd, spaces)
        except NotOdd:
            odd = False
            amplitude[part], error[part] = ascend(many.take(part), tolerance, odd, spaces)
    return amplitude, error


def ascend(many: Many, tolerance: float, odd: bool, spaces: list[Space]) -> tuple[Array, Array]:
    """The same for members of one level, from few samples to as many as the estimates ask for.

    odd : take the second half of a period for the first turned over; raises NotOdd
    spaces : two, for the arrays of a level and of the one before
    """
    size, outputs = many.weights.shape[:2]
    m = many.pull.shape[2]
    amplitude, error = np.full((size, outputs), np.nan), np.full(size, np.nan)
    place, failures = np.arange(size), np.zeros(size, int)
    steepest = 1.0
    series = np.zeros((size, m, 0, 2))
    before = np.full((size, 2, outputs), np.nan)
    change_before, rough_before = np.full(size, np.inf), np.full((size, outputs), np.inf)
    n, rows = FEWEST, Rows(many, odd, spaces)
    while n <= MOST:
        newton = max(NEWTON_SHARE * tolerance / steepest, SMALLEST_RESIDUAL)
        found, (left, leap, even, steps) = rows.solve(n, series, newton)
        if np.any(even):
            raise NotOdd
        solved = np.isfinite(left)
        failures += ~solved
        extrema, unsure, rough = rows.extrema()
        # close enough, and with no force much steeper than a sine
        steep = leap * n / np.pi  # in terms of a sine of the same range
        resolved, smooth = leap <= UNRESOLVED, steep <= STEEPER
        # outputs with forces see through them what is left of the motion
        steep = np.where(smooth | ~rows.forced.any(), 1.0, steep)
        extrema[~(solved & resolved)] = np.nan
        change = change_of(extrema, before, found, series)
        estimate = np.maximum(unsure, estimate_of(change, change_before, smooth, steep * left))
        corner = np.where(rough > SMOOTHER * rough_before, BESIDE_CORNER * rough, 0.0)
        estimate = np.maximum(estimate, corner.max(axis=1))
        done = estimate <= tolerance
        amplitude[place[done]] = (extrema[done, 0] - extrema[done, 1]) / 2
        error[place[done]] = estimate[done]
        stay = np.nonzero(~done & (failures < PATIENCE) & ~np.isnan(left))[0]
        if not stay.size:
            break
        steepest = steep[stay].max()
        if stay.size < place.size or (n == FEWEST and np.ptp(steps) >= UNEVEN):
            stay = stay[np.argsort(steps[stay], kind="stable")]  # a row waits for its slowest
            many, place, failures = many.take(stay), place[stay], failures[stay]
            rows = Rows(many, odd, spaces)
        before, change_before, series = extrema[stay], change[stay], found[stay]
        rough_before = rough[stay]
        n *= 2
    return amplitude, error


def in_rows(values: Array) -> Array:
    """Numbers (p, ...) of members as rows (G, ..., W); the last member fills the last row."""
    missing = -len(values) % WIDTH
    if missing:
        values = np.concatenate([values, np.repeat(values[-1:], missing, axis=0)])
    grouped = values.reshape(len(values) // WIDTH, WIDTH, values[0].size).transpose(0, 2, 1)
    rows: Array = aligned(grouped).reshape(len(grouped), *values.shape[1:], WIDTH)
    return rows


class Rows:
    """Members as rows, their linear motion as far as it is known, and their motion."""

    def __init__(self, many: Many, odd: bool, spaces: list[Space]) -> None:
        """Arrange the members; with `odd` the second half of a period is the first, turned over."""
        self._many, self._odd, self._size = many, odd, len(many.omega)
        self._spaces = spaces
        base = np.stack([many.base.real, many.base.imag], axis=2)
        base[:, 1:] *= 0.5
        self._base, self._omega = in_rows(base), in_rows(many.omega)
        self._linear, self._pull = in_rows(many.linear), in_rows(many.pull)
        self._parameters, self._weights = in_rows(many.parameters), in_rows(many.weights)
        needed = np.any(many.weights != 0.0, axis=0)
        self._matters, self._used = needed.any(axis=0), np.nonzero(needed)[1]
        self._begins = np.concatenate([[0], np.cumsum(needed.sum(axis=1))])
        first = 2 * many.pull.shape[1]
        self.forced = needed[:, first : first + len(many.elements)].any(axis=1)
        groups, nodes, m = len(self._base), *many.pull.shape[1:]
        kept = self._matters[:nodes] | self._matters[nodes : 2 * nodes]
        self._places = np.where(kept, np.cumsum(kept) - 1, -1)
        self._node = np.empty((groups, kept.sum(), m + 1, 0, 2, WIDTH))
        self._across = np.empty((groups, m, m + 1, 0, 2, WIDTH))
        self._doubt = np.zeros((groups, WIDTH))

    def _refine(self, count: int) -> None:
        """Work out the linear motion of so many harmonics, but what is known of it."""
        known, linear, take = self._node.shape[3], [self._node, self._across], self._spaces[0].take
        for i, before in enumerate(linear):
            linear[i] = take(*before.shape[:3], count, 2, WIDTH)
            linear[i][:, :, :, :known] = before
        self._node, self._across = linear
        nodes, m = self._many.pull.shape[1:]
        respond(
            self._linear, self._pull, self._base, self._omega, self._many.channels, known,
            self._odd, self._places, *linear, self._doubt,
            take(nodes, nodes + m + 1, 2, WIDTH),
        )  # fmt: skip

    def _members(self, rows: Array) -> Array:
        """Numbers of members (p, ...) from rows."""
        flat = rows.reshape(len(rows), -1, WIDTH).transpose(0, 2, 1)
        return flat.reshape(len(rows) * WIDTH, *rows.shape[1:-1])[: self._size]

    def solve(self, n: int, guess: Array, tolerance: float) -> tuple[Array, Array]:
        """Harmonics (p, m, K, 2), and what `settle` finds (4, p), with n samples of the period.

        From the harmonics known, or else from the linear motion. A residual is infinite where there
        is no solution, and not a number where the linear motion is not known.
        """
        many, samples = self._many, n // 2 if self._odd else n
        count = samples // OVERSAMPLING
        self._spaces.reverse()  # the linear motion known so far is in the other one
        self._spaces[0].clear()
        take = self._spaces[0].take
        self._refine(count)
        groups, m = self._across.shape[:2]
        series = take(groups, m, count, 2, WIDTH)
        known = guess.shape[2]
        if known:
            series[:, :, :known], series[:, :, known:] = in_rows(guess), 0.0
        else:
            series[:] = self._across[:, :, m]
        e, q = len(many.elements), many.parameters.shape[1]
        angle = 2 * np.pi * np.arange(n) / n
        self._roots = np.stack([np.cos(angle), -np.sin(angle)], axis=1)
        self._lines = take(2, samples, WIDTH)
        self._force = take(*series.shape)
        self._forces = take(groups, e, samples, WIDTH)
        found = np.empty((groups, 4, WIDTH))
        settle(
            self._across, self._omega, self._parameters, many.channels, many.elements,
            self._roots, tolerance, self._odd, series, self._force, self._forces, found,
            take(PAIRS + 2 * DEPTH, m, count, 2, WIDTH), self._lines,
            take(2, m, samples, WIDTH), take(m, samples, WIDTH),
            take(q * samples * WIDTH),
            take(DEPTH, DEPTH, WIDTH), take(DEPTH, DEPTH + 1, WIDTH),
            take(m, 2, WIDTH), take(m, m + 1, 2, WIDTH),
        )  # fmt: skip
        found[:, LEFT][~(self._doubt <= LARGEST_FACTOR**2)] = np.nan
        return self._members(series), self._members(found).T

    def extrema(self) -> tuple[Array, Array, Array]:
        """Highest and lowest value (p, 2, o) of every output over the period.

        And relative to the amplitude how unsure they are for what is between the samples (p,), and
        how rough outputs that forces enter are there (p, o).
        """
        count, samples = self._node.shape[3], self._lines.shape[1]
        outputs, columns = self._many.weights.shape[1:]
        take = self._spaces[0].take
        extrema = take(len(self._node), ROUGH + 2, outputs, WIDTH)
        look(
            self._node, self._places, self._force, self._forces, self._base, self._omega,
            self._weights,
            self._matters, self._used, self._begins, self._roots, self._odd, extrema, self._lines,
            take(count, 2, WIDTH), take(columns, samples, WIDTH),
            take(samples + 2 * AHEAD, WIDTH),
        )  # fmt: skip
        high, low, *unsure, rough, other = self._members(extrema).transpose(1, 0, 2)
        swing, least = (high - low) / 2, ROUNDING * np.maximum(np.abs(high), np.abs(low))
        swing = np.maximum(swing, np.maximum(least, np.finfo(float).tiny))
        rough = self.forced * np.maximum(rough, other) / swing
        return np.stack([high, low], axis=1), (np.maximum(*unsure) / swing).max(axis=1), rough


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
    """Errors (p,) from the last two changes and what was left of the residual.

    The last change is that of the level before. No less is taken: the changes of a force with
    corners, which lie anywhere between the samples, fall irregularly.
    """
    before = np.where(np.isfinite(change_before), change_before, 0.0)
    gain = np.where(smooth, 1.0, STEEP_GAIN)
    sudden = np.where(smooth, SUDDEN, SUDDEN_STEEP)
    return np.asarray(np.maximum(change * gain, sudden * before) + 4.0 * left + ROUNDING)
