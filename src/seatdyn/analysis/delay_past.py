"""The past of a delayed run, as arrays that can be moved, cut and refined."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
POWERS = 5  # coefficients of the quartic of a state


@dataclass(frozen=True)
class Past:
    """Rows of a run and its marks up to now, the last row for now, and the breaks to come.

    A row has its time, displacements and velocities, the accelerations at its start and end, and
    for each state of an element its value and the other four coefficients of a quartic.

    still : number of rows in which the base stands still at `place`, m
    states : number of states of elements
    """

    record: Array
    marks: NDArray[np.int64]
    times: Array
    orders: NDArray[np.int64]
    still: int = 0
    place: float = 0.0
    states: int = 0

    @property
    def n(self) -> int:
        """Number of masses."""
        return int(self.record.shape[1] - 1 - POWERS * self.states) // 4

    @property
    def now(self) -> float:
        """Time of the last row in s."""
        return float(self.record[-1, 0])

    def moved(self, shift: float) -> Past:
        """The same `shift` s later, for a periodic base motion."""
        if shift == 0.0:
            return self
        record = self.record.copy()
        record[:, 0] += shift
        return replace(self, record=record, times=self.times + shift)

    def _rows(self, times: Array) -> tuple[NDArray[np.int64], Array]:
        """The rows that these times (s) lie in, and the shares of them that have passed."""
        starts = self.record[:, 0]
        row = np.searchsorted(starts, times, side="right") - 1
        row = np.clip(row, 0, starts.size - 2)
        return row, (times - starts[row]) / (starts[row + 1] - starts[row])

    def quartics(self) -> Array:
        """Coefficients (rows, q, 5) of the states, lowest power first: a view of the record."""
        return self.record[:, 1 + 4 * self.n :].reshape(len(self.record), self.states, POWERS)

    def states_at(self, times: Array) -> Array:
        """States (p, q) of the elements at times (p,) in s."""
        row, share = self._rows(times)
        powers = share[:, None] ** np.arange(POWERS)
        return np.asarray(np.einsum("pqk,pk->pq", self.quartics()[row], powers))

    def at(self, times: Array) -> tuple[Array, Array, Array]:
        """Displacements, velocities and accelerations (p, N) at times (p,) in s."""
        n, (row, share) = self.n, self._rows(times)
        start, end, s = self.record[row], self.record[row + 1], share[:, None]
        h = (end[:, 0] - start[:, 0])[:, None]
        z0, v0 = start[:, 1 : n + 1], h * start[:, n + 1 : 2 * n + 1]
        z1, v1 = end[:, 1 : n + 1], h * end[:, n + 1 : 2 * n + 1]
        k0, k1 = (h * h * start[:, i * n + 1 : (i + 1) * n + 1] for i in (2, 3))
        # the quintic of `dense.quintic`
        rise = z1 - z0
        p3 = 10 * rise - 6 * v0 - 4 * v1 - 1.5 * k0 + 0.5 * k1
        p4 = -15 * rise + 8 * v0 + 7 * v1 + 1.5 * k0 - k1
        p5 = 6 * rise - 3 * v0 - 3 * v1 - 0.5 * k0 + 0.5 * k1
        z = z0 + s * (v0 + s * (0.5 * k0 + s * (p3 + s * (p4 + s * p5))))
        v = (v0 + s * (k0 + s * (3 * p3 + s * (4 * p4 + s * 5 * p5)))) / h
        return z, v, (k0 + s * (6 * p3 + s * (12 * p4 + s * 20 * p5))) / h**2

    def refined(self, longest: float) -> Past:
        """The same with rows of at most `longest` s, so that it can be changed in between."""
        starts, ends = self.record[:-1, 0], self.record[1:, 0]
        parts = np.maximum(np.ceil((ends - starts) / longest), 1).astype(int)
        row = np.repeat(np.arange(parts.size), parts)
        share = np.arange(row.size) - np.repeat(np.cumsum(parts) - parts, parts)
        times = starts[row] + (ends - starts)[row] * share / parts[row]
        record = self.record[np.append(row, len(parts))].copy()
        n = self.n
        inside = np.flatnonzero(share > 0)
        record[inside, 0] = times[inside]
        record[inside, 1 : 3 * n + 1] = np.concatenate(self.at(times[inside]), axis=1)
        before = inside - 1  # rows that now end inside an old one
        record[before, 3 * n + 1 : 4 * n + 1] = record[inside, 2 * n + 1 : 3 * n + 1]
        marks = self.marks[np.append(row, len(parts))]
        finer = replace(self, record=record, marks=marks, still=int(np.sum(row < self.still)))
        shorten(finer.quartics()[:-1], share / parts[row], 1.0 / parts[row])
        return finer

    def recent(self, span: float) -> Past:
        """Cut to the last `span` s."""
        begin = self.now - span
        first = int(np.searchsorted(self.record[1:, 0], begin, side="right"))
        record = self.record[first:].copy()
        still = max(self.still - first, 0)
        cut = replace(self, record=record, marks=self.marks[first:], still=still)
        if record[0, 0] < begin:
            share = (begin - record[0, 0]) / (record[1, 0] - record[0, 0])
            motion = np.concatenate(self.at(np.array([begin])), axis=1)
            record[0, 0], record[0, 1 : 3 * self.n + 1] = begin, motion
            shorten(cut.quartics()[:1], np.array([share]), np.array([1.0 - share]))
        return cut


def shorten(quartics: Array, share: Array, ratio: Array) -> None:
    """Change coefficients (rows, q, 5) to those of a part of each row, `ratio` of it from `share`.

    The rows are changed in place.
    """
    old = quartics.copy()
    for j in range(POWERS):
        # the binomial theorem for (share + ratio s)^k
        quartics[:, :, j] = 0.0
        for k in range(j, POWERS):
            factor = math.comb(k, j) * ratio**j * share ** (k - j)
            quartics[:, :, j] += factor[:, None] * old[:, :, k]
