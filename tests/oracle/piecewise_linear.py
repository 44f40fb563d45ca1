"""Jump law, first method: closed form between located crossings.

Within a zone the law is N = g d with g = 0 or gamma, so the motion is linear.  The base sine is
carried by two extra oscillator states, z = (y, sin w t, cos w t), z' = A_g z, and the solution is
the sum of exponentials z(t) = V exp(L (t - t0)) V^-1 z0.  Crossings of d with the edges of the
free zone are roots of that sum.  The periodic orbit is the fixed point of the map over one period,
found by Newton's method with the exact monodromy matrix (saltation matrices at the jumps).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from equations import BASE_ACCELERATION, DAMPING, SEAT_MASS, STIFFNESS, Array, Case
from peaks import Segment, amplitudes
from scipy.optimize import brentq

SAMPLES = 400  # per period, to bracket crossings and peaks


@dataclass(frozen=True)
class Zone:
    """Linear motion with extra stiffness g: z' = A z, with its eigenvectors."""

    stiffness: float
    matrix: Array
    values: np.ndarray
    vectors: np.ndarray
    inverse: np.ndarray

    def propagate(self, z: Array, times: Array) -> Array:
        """States at the times since z, shape (n, 8)."""
        weights = self.inverse @ z
        return np.asarray(((np.exp(np.outer(times, self.values)) * weights) @ self.vectors.T).real)

    def transition(self, time: float) -> Array:
        """exp(A time)."""
        return np.asarray(((self.vectors * np.exp(self.values * time)) @ self.inverse).real)


def travel_rows(case: Case) -> tuple[Array, Array]:
    """Rows giving d and v from z = (y, sin w t, cos w t)."""
    w = case.omega
    d, v = np.zeros(8), np.zeros(8)
    d[0], d[6] = 1.0, BASE_ACCELERATION / w**2
    v[3], v[7] = 1.0, BASE_ACCELERATION / w
    return d, v


def make_zone(case: Case, stiffness: float) -> Zone:
    """The linear system of the zone with N = stiffness * d."""
    d, v = travel_rows(case)
    matrix = np.zeros((8, 8))
    matrix[:6, :6] = case.free_matrix()
    matrix[3] -= ((STIFFNESS + stiffness) * d + DAMPING * v) / SEAT_MASS
    matrix[6, 7], matrix[7, 6] = case.omega, -case.omega
    values, vectors = np.linalg.eig(matrix)
    return Zone(stiffness, matrix, values, vectors, np.linalg.inv(vectors))


@dataclass(frozen=True)
class Piece:
    """One stay in one zone, from time start (state z) to time end."""

    zone: Zone
    start: float
    end: float
    z: Array


class PiecewiseLinear:
    """The jump-law system of one case."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.inner = make_zone(case, 0.0)
        self.outer = make_zone(case, case.law.coefficient)
        self.d_row, self.v_row = travel_rows(case)

    def _zone_at(self, d: float) -> Zone:
        return self.outer if self.case.law.stiffness_at(d) else self.inner

    def _root(self, zone: Zone, z: Array, edge: float, low: float, high: float) -> float:
        """Time at which d = edge, between two samples on either side of it."""

        def gap(s: float) -> float:
            return float(zone.propagate(z, np.array([s]))[0] @ self.d_row - edge)

        at_low, at_high = gap(low), gap(high)
        if at_low * at_high > 0:  # a sample on the edge to rounding
            return low if abs(at_low) < abs(at_high) else high
        return float(brentq(gap, low, high, xtol=1e-16, rtol=1e-15))

    def _first_crossing(self, zone: Zone, z: Array, d0: float, span: float) -> float | None:
        """Time to the first crossing of an edge within span, or None.  d0 fixes the region."""
        edges = (self.case.law.lower, self.case.law.upper)
        step = self.case.period / SAMPLES
        times = np.append(np.arange(0.0, span, step), span)
        d = zone.propagate(z, times) @ self.d_row
        d[0] = d0
        hits = []
        for edge in edges:
            side = d > edge
            changes = np.flatnonzero(side[1:] != side[:-1])
            if len(changes):
                i = int(changes[0])
                low = times[i] + (1e-9 * step if i == 0 else 0.0)
                hits.append(self._root(zone, z, edge, low, float(times[i + 1])))
        return min(hits) if hits else None

    def period_map(self, y: Array) -> tuple[Array, Array, list[Piece]]:
        """State after one period, monodromy matrix (6 x 6) and the pieces on the way."""
        z = np.concatenate([y, [0.0, 1.0]])
        time, period = 0.0, self.case.period
        d0 = float(self.d_row @ z)
        zone = self._zone_at(d0)
        total = np.eye(8)
        pieces: list[Piece] = []
        while True:
            hit = self._first_crossing(zone, z, d0, period - time)
            span = period - time if hit is None else hit
            pieces.append(Piece(zone, time, time + span, z))
            total = zone.transition(span) @ total
            z = zone.propagate(z, np.array([span]))[0]
            if hit is None:
                return z[:6], total[:6, :6], pieces
            time += span
            speed = float(self.v_row @ z)
            d0 = float(self.d_row @ z) + np.sign(speed) * 1e-9
            after = self._zone_at(d0)
            jump = (after.matrix - zone.matrix) @ z
            total = (np.eye(8) + np.outer(jump, self.d_row) / speed) @ total
            zone = after

    def linear_state(self) -> Array:
        """State at t = 0 of the steady motion with the force absent."""
        a = self.inner.matrix
        w = self.case.omega
        # y = S sin + C cos:  A S + b_s = -w C,  A C + b_c = w S
        block = np.block([[a[:6, :6], w * np.eye(6)], [-w * np.eye(6), a[:6, :6]]])
        solution = np.linalg.solve(block, -np.concatenate([a[:6, 6], a[:6, 7]]))
        return np.asarray(solution[6:])

    def periodic_orbit(self, guess: Array) -> tuple[Array, Array, list[Piece]]:
        """Fixed point of the period map, its monodromy matrix and its pieces."""
        y = guess
        best = np.inf
        for _ in range(40):
            after, monodromy, pieces = self.period_map(y)
            gap = after - y
            size = float(np.max(np.abs(gap)))
            if size < 1e-13 or (size < 1e-11 and size >= best):
                return y, monodromy, pieces
            best = min(best, size)
            y = y + np.linalg.solve(np.eye(6) - monodromy, gap)
        raise RuntimeError(f"no periodic orbit, gap {best:.2e}")

    def segments(self, pieces: list[Piece]) -> list[Segment]:
        """Outputs along the pieces; end values are the one-sided limits."""
        result = []
        for piece in pieces:

            def values(times: Array, piece: Piece = piece) -> Array:
                z = piece.zone.propagate(piece.z, times - piece.start)
                force = piece.zone.stiffness * (z @ self.d_row)
                return self.case.outputs(z[:, :6], self.case.base_array(times), force)

            count = max(8, int(SAMPLES * (piece.end - piece.start) / self.case.period))
            times = np.linspace(piece.start, piece.end, count)
            result.append(Segment(times, values))
        return result


def solve(case: Case, guess: Array | None = None) -> tuple[Array, Array, float]:
    """Amplitudes (14), state at t = 0 (for the next guess), largest Floquet multiplier."""
    system = PiecewiseLinear(case)
    y, monodromy, pieces = system.periodic_orbit(system.linear_state() if guess is None else guess)
    multiplier = float(np.max(np.abs(np.linalg.eigvals(monodromy))))
    return amplitudes(system.segments(pieces)), y, multiplier


def settle(case: Case, start: Array, periods: int = 60) -> Array:
    """Amplitudes of the motion reached from a given state by running the map many periods."""
    system = PiecewiseLinear(case)
    y = start
    for _ in range(periods):
        y, _, pieces = system.period_map(y)
    return amplitudes(system.segments(pieces))
