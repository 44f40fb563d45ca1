"""One delayed force and every delay with a pole on the imaginary axis, exactly.

With the delayed force f(t) = c' y(t - tau) of the state y (displacements, velocities, states of
elements), y' = A y - b f,

    poles:   1 + exp(-s tau) G(s) = 0,   G(s) = c' (s I - A)^-1 b

A pole at s = i w needs |G(i w)| = 1, whatever the delay. These w are the imaginary eigenvalues of
the Hamiltonian matrix [A, b b'; -c c', -A'] (Boyd, Balakrishnan and Kabamba, Math. Control Signals
Syst. 2 (1989) 207): none can be missed. The phase of G then gives all delays with a pole there,
one in every 2 pi/w, and the slope of |G| says to which side it crosses, the same for each of them
(Cooke and Grossman, J. Math. Anal. Appl. 86 (1982) 592). So the number of unstable poles is known
for every delay.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.characteristic import parameter
from seatdyn.analysis.linear import Array, ComplexArray, companion, on_left
from seatdyn.analysis.pencil import RANK, Pencil, state_columns
from seatdyn.errors import RequestError
from seatdyn.model.system import LinearModel

NEAR_AXIS = 1e-3  # how far, relatively, an eigenvalue may be off the axis to be tried
NEWTON_STEPS = 30
SETTLED = 1e-13
ON_LEVEL = 1e-9  # of log |G| at a crossing
SAME = 1e-9  # relative distance of rates that are one crossing
CHUNK = 4096  # points whose matrices are held at once


@dataclass(frozen=True)
class Loop:
    """One delayed force at P points: A (P, S, S), b (P, S), c (P, S), S = 2N + q."""

    a: Array
    b: Array
    c: Array
    nodes: int  # N

    def gain(self, w: Array, point: NDArray[np.int_]) -> tuple[ComplexArray, ComplexArray]:
        """G(i w) and G'/G at rates w of the points."""
        a, b, c = self.a[point], self.b[point], self.c[point]
        resolvent = 1j * w[:, None, None] * np.eye(a.shape[-1]) - a
        x = np.linalg.solve(resolvent, b[..., None].astype(complex))
        dx = -np.linalg.solve(resolvent, x)
        g, dg = (np.einsum("pi,pij->p", c, v) for v in (x, dx))
        with np.errstate(all="ignore"):
            return g, dg / g


@dataclass(frozen=True)
class Crossings:
    """Poles on the imaginary axis: rate w, first delay, and how many poles become unstable there.

    `unstable` (P,) counts the unstable poles without delay.
    """

    unstable: NDArray[np.int_]
    point: NDArray[np.int_]
    rate: Array
    first: Array
    change: NDArray[np.int_]

    def count(self, delay: Array) -> NDArray[np.int_]:
        """Unstable poles at every point and every one of the delays (T,), (P, T)."""
        total = np.repeat(self.unstable[:, None], delay.size, axis=1)
        passed = (delay - self.first[:, None]) * self.rate[:, None] / (2 * np.pi)
        passed = np.maximum(np.floor(passed) + 1.0, 0.0)
        np.add.at(total, self.point, (self.change[:, None] * passed).astype(int))
        return total


def loop_of(model: LinearModel, values: Mapping[str, Array] | None = None) -> Loop:
    """The delayed force of a model, at P values of named parameters.

    Raises
    ------
    RequestError
        No force is delayed, or several independent ones.
    """
    pencil, n, values = Pencil.of(model), model.size, values or {}
    terms = {name: parameter(model, name) for name in values}
    count = next((np.size(value) for value in values.values()), 1)
    matrices = [np.broadcast_to(m, (count, *m.shape)) for m in
                (pencil.stiffness, pencil.damping, pencil.mass)]  # fmt: skip
    late = [state_columns(part.stiffness, part.damping, n) for part in pencil.late]
    lefts = [term.left[:, None] for term in terms.values() if term.delay > 0.0]
    left, sizes, _ = np.linalg.svd(np.hstack([*late, *lefts, np.zeros((n, 1))]))
    if len(late) != 1 or np.sum(sizes > RANK * sizes[0]) > 1:
        raise RequestError(
            f"This system has {'no' if not late else 'several'} delayed forces that act "
            "independently; delay_margin and maps over delay take one: a suspension between two "
            "nodes, or one feedback force. Follow the poles with `poles`."
        )
    direction = left[:, 0]
    signal = np.broadcast_to(direction @ late[0], (count, pencil.degree))
    for name, term in terms.items():
        change = np.asarray(values[name], dtype=float) - term.value
        if term.delay > 0.0:
            row = np.zeros(pencil.degree)
            row[term.order * n : (term.order + 1) * n] = (direction @ term.left) * term.right
            signal = signal + change[:, None] * row
        else:
            entry = np.zeros(matrices[term.order].shape[1:])
            entry[:n, :n] = np.outer(term.left, term.right)
            matrices[term.order] = matrices[term.order] + change[:, None, None] * entry
    stiffness, damping, mass = matrices
    b = np.zeros((count, pencil.degree))
    pull = np.linalg.solve(mass, np.broadcast_to(direction[:, None], (count, n, 1)))
    b[:, n : 2 * n] = pull[..., 0]
    return Loop(companion(mass, damping, stiffness), b, signal, n)


def loop_crossings(loop: Loop) -> Crossings:
    """All poles on the imaginary axis for any delay, at every point of a loop."""
    parts = [
        _crossings_of(replace(loop, a=loop.a[part], b=loop.b[part], c=loop.c[part]), start)
        for start in range(0, len(loop.a), CHUNK)
        for part in [slice(start, start + CHUNK)]
    ]
    return Crossings(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _crossings_of(
    loop: Loop, offset: int
) -> tuple[NDArray[np.int_], NDArray[np.int_], Array, Array, NDArray[np.int_]]:
    """Fields of `Crossings` for a chunk whose first point has the index `offset`."""
    a, b, c = loop.a, loop.b, loop.c
    closed = np.linalg.eigvals(a - b[..., :, None] * c[..., None, :])
    radius = np.abs(closed).max(axis=1, keepdims=True)
    unstable = np.sum(~on_left(closed.real, radius), axis=1)
    # b and c of one size, and displacements of the size of velocities: only accuracy depends on it
    n, size = loop.nodes, a.shape[-1]
    rate = np.sqrt(np.abs(a[:, n : 2 * n, :n]).max(axis=(1, 2)))
    scale = np.ones(b.shape)
    scale[:, :n] = np.where(rate > 0.0, rate, 1.0)[:, None]
    a_scaled = scale[:, :, None] * a / scale[:, None, :]
    b_scaled, c_scaled = b * scale, c / scale
    with np.errstate(all="ignore"):
        even = np.linalg.norm(c_scaled, axis=1) / np.linalg.norm(b_scaled, axis=1)
    even = np.sqrt(np.where(np.isfinite(even) & (even > 0.0), even, 1.0))[:, None]
    b_scaled, c_scaled = b_scaled * even, c_scaled / even
    hamiltonian = np.empty((len(a), 2 * size, 2 * size))
    hamiltonian[:, :size, :size] = a_scaled
    hamiltonian[:, size:, size:] = -np.swapaxes(a_scaled, 1, 2)
    hamiltonian[:, :size, size:] = b_scaled[:, :, None] * b_scaled[:, None, :]
    hamiltonian[:, size:, :size] = -c_scaled[:, :, None] * c_scaled[:, None, :]
    values = np.linalg.eigvals(hamiltonian)
    near = (values.imag > 0.0) & (np.abs(values.real) <= NEAR_AXIS * np.abs(values))
    point, column = np.nonzero(near)
    w, good = _polished(loop, values.imag[point, column], point)
    point, w = point[good], w[good]
    order = np.lexsort((w, point))
    point, w = point[order], w[order]
    if w.size:  # eigenvalues come as mirror images, on the axis in pairs only where |G| touches 1
        again = (np.diff(point) == 0) & (np.diff(w) <= SAME * w[1:])
        keep = np.concatenate([[True], ~again])
        point, w = point[keep], w[keep]
    g, ratio = loop.gain(w, point)
    # exp(i w tau) = -G; a pole goes to the right where |G| falls along the axis
    first = np.mod(np.angle(-g), 2 * np.pi) / w
    change = 2 * np.sign(ratio.imag).astype(int)
    return unstable, point + offset, w, first, change


def _polished(loop: Loop, w: Array, point: NDArray[np.int_]) -> tuple[Array, NDArray[np.bool_]]:
    """Newton's method on log |G(i w)| = 0, and where it ended on a rate w > 0 near the start."""
    start, good = w.copy(), np.ones(w.size, dtype=bool)
    for _ in range(NEWTON_STEPS):
        g, ratio = loop.gain(w, point)
        with np.errstate(all="ignore"):
            step = np.log(np.abs(g)) / ratio.imag  # d log|G| / dw = -Im(G'/G)
        good &= np.isfinite(step) & (np.abs(w + step - start) <= 0.1 * start)
        w = np.where(good, w + step, w)
        if not np.any(good) or np.all(np.abs(step[good]) <= SETTLED * w[good]):
            break
    level = np.abs(np.log(np.abs(loop.gain(w, point)[0])))
    return w, good & (level <= ON_LEVEL)
