"""Zeros of transmissibilities, from a pencil whose infinite zeros are taken out beforehand.

The transmissibility T(s) = c (M s^2 + C s + K)^-1 (p + q s) is that of x' = A x + B u, y = c x
with x = [z, w], w = z' - M^-1 q u: this choice of w takes the input velocity out. Its zeros are
the finite generalised eigenvalues of Rosenbrock's pencil

    [ A - s I   B ]
    [   c       0 ]

whose infinite ones rounding turns into huge numbers. So they are removed first, exactly: with the
relative degree r, from the first Markov parameter c A^(r-1) B that does not vanish, a zero
direction lies in the kernel V of c, c A, ..., c A^(r-1), and the equations left by a basis L of
what is orthogonal to B, A B, ..., A^(r-1) B determine it: the zeros are the 2N - r eigenvalues of
L' A V - s L' V, where L' V is regular because the Hankel matrix of the first 2r - 1 Markov
parameters is triangular with the non-zero one on its diagonal. Same idea, one staircase for all
outputs: Emami-Naeini and Van Dooren, Automatica 18 (1982) 415.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from seatdyn.analysis.linear import (
    Array,
    ComplexArray,
    Linearisable,
    Linearise,
    as_linear_model,
    labelled,
    natural_rate,
    with_conjugates,
)
from seatdyn.errors import RequestError
from seatdyn.model.system import LinearModel

if TYPE_CHECKING:
    import xarray as xr

# Real parts of zeros below this fraction of the largest zero are rounding: an undamped absorber
# has its zeros on the axis and is minimum phase.
ON_AXIS = 1e-12
POLISH = 1e-2  # largest relative change of a zero by polishing
NEWTON_STEPS = 20


def zeros(system: Linearisable, *, output: str, linearise: Linearise = None) -> xr.Dataset:
    """Zeros of the transmissibility from the driven node to `output`, sorted by modulus.

    Parameters
    ----------
    system, linearise : as in `poles`
    output : name of a free node

    Returns
    -------
    xarray.Dataset
        Over `zero` (conjugates both listed): `value`, complex, `real`, `imag` in 1/s, `f0` =
        |s|/2 pi in Hz, `right_half_plane`. Attributes `output`, `drive`, `relative_degree` (poles
        less zeros), `minimum_phase` (1: no zero in the right half plane).

    Raises
    ------
    RequestError
        `output` is no free node, or nothing of the drive reaches it.

    Notes
    -----
    Generalised eigenvalues of a pencil freed of its infinite zeros; see the head of this module.

    Examples
    --------
    >>> import seatdyn as sd
    >>> z = sd.zeros(sd.load_body("ksiazek1997_back_off"), output="m1")
    >>> z.sizes["zero"], z.attrs["minimum_phase"]
    (3, 0)
    """
    model = as_linear_model(system, linearise)
    row = model.index(output)
    rate = natural_rate(model.mass, model.stiffness)
    a, b = _without_input_velocity(model, rate)
    c = np.eye(2 * model.size)[row]
    degree = relative_degree(a, b, c)
    if degree is None:
        raise RequestError(
            f"output = {output!r}: no motion of {model.drive!r} reaches this node, so it has no "
            "transmissibility. Choose another node or add a link."
        )
    values = finite_zeros(a, b, c, degree) * rate
    upper = np.array([_polish(model, row, zero) for zero in values[values.imag >= 0.0]])
    values = with_conjugates(upper[np.lexsort((upper.imag, np.abs(upper)))])
    largest = np.max(np.abs(values), initial=0.0)
    right = values.real > ON_AXIS * largest
    dims = ("zero",)
    return labelled(
        {
            "value": (dims, values, "1/s", "zero"),
            "real": (dims, values.real, "1/s", "real part"),
            "imag": (dims, values.imag, "1/s", "imaginary part"),
            "f0": (dims, np.abs(values) / (2 * np.pi), "Hz", "undamped frequency"),
            "right_half_plane": (dims, right, "1", "positive real part"),
        },
        {"zero": np.arange(1, values.size + 1)},
        model,
        {"function": "zeros", "output": output, "linearise": linearise},
        output=output,
        drive=model.drive,
        relative_degree=degree,
        minimum_phase=int(not np.any(right)),
    )


def relative_degree(a: Array, b: Array, c: Array) -> int | None:
    """Return the smallest r with c A^(r-1) B not zero; None if the output is never reached.

    A Markov parameter counts as zero if it is below the rounding of its own terms, which the same
    product of absolute values bounds. Where structure makes it zero it is exactly zero.
    """
    rounding = len(a) * np.finfo(float).eps
    v, bound = b, np.abs(b)
    for r in range(1, len(a) + 1):
        if abs(c @ v) > r * rounding * (np.abs(c) @ bound):
            return r
        v, bound = a @ v, np.abs(a) @ bound
    return None


def finite_zeros(a: Array, b: Array, c: Array, degree: int) -> ComplexArray:
    """Return the n - degree finite zeros of the pencil of (A, B, c) with no direct term."""
    from scipy.linalg import eigvals

    v = _complement_of_krylov(a.T, c, degree)
    left = _complement_of_krylov(a, b, degree)
    return np.asarray(eigvals(left.T @ a @ v, left.T @ v), dtype=complex)


def _without_input_velocity(model: LinearModel, rate: float) -> tuple[Array, Array]:
    """A (2N, 2N) and B (2N,) for the states [z, w/rate], time in units of 1/rate."""
    n = model.size
    columns = np.column_stack([model.stiffness, model.damping, model.drive_stiffness])
    scaled = np.linalg.solve(model.mass, columns)
    k, c, p = scaled[:, :n] / rate**2, scaled[:, n : 2 * n] / rate, scaled[:, -1] / rate**2
    q = np.linalg.solve(model.mass, model.drive_damping) / rate
    a = np.block([[np.zeros((n, n)), np.eye(n)], [-k, -c]])
    return a, np.concatenate([q, p - c @ q])


def _complement_of_krylov(a: Array, start: Array, count: int) -> Array:
    """Orthonormal basis (n, n - count) of what is orthogonal to start, A start, ...

    Powers of A soon point all one way; each new direction is made orthogonal to the others first
    (Arnoldi), twice, which spans the same space without loss.
    """
    basis = np.zeros((len(a), count))
    vector = start
    for i in range(count):
        for _ in range(2):
            vector = vector - basis @ (basis.T @ vector)
        basis[:, i] = vector / np.linalg.norm(vector)
        vector = a @ basis[:, i]
    return np.linalg.qr(basis, mode="complete")[0][:, count:]


def _polish(model: LinearModel, row: int, zero: complex) -> complex:
    """Newton's method on T(s) with the sparse matrices themselves; the start where it fails.

    The bases above are accurate to rounding, but a long chain of masses has zeros that react
    strongly to it.
    """
    s, step = zero, POLISH * abs(zero)
    for _ in range(NEWTON_STEPS):
        p = model.stiffness + s * model.damping + s**2 * model.mass
        slope = model.damping + 2.0 * s * model.mass
        try:
            z = np.linalg.solve(p, model.drive_stiffness + s * model.drive_damping)
            dz = np.linalg.solve(p, model.drive_damping - slope @ z)
        except np.linalg.LinAlgError:
            return zero
        new = z[row] / dz[row] if dz[row] != 0.0 else 0.0
        if not abs(new) < step:
            break
        s, step = s - new, abs(new)
    return complex(s) if abs(s - zero) <= POLISH * abs(zero) else zero
