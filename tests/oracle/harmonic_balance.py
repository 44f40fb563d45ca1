"""Smooth laws, second method: harmonic balance condensed on the suspension velocity.

The law acts on one quantity, v = x' - x0'.  With the linear part eliminated, harmonic k obeys

    v_k = L_k - G_k N_k(v),     G_k = i k w [Z(i k w)^-1]_00,     Z = -k^2 w^2 M + i k w C + K

where L_k is the linear response (first harmonic only) and N_k(v) the harmonics of the force along
v, found by alternating between frequency and time (FFT).  Newton's method solves it; each linear
system (identity plus a smoothing operator) by GMRES, preconditioned by the exact inverse on the
lowest harmonics.  All other motions follow from N_k.  Accelerations are taken from the equation of
motion with the exact law on the series for d and v, not by differentiating series.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from equations import BASE_ACCELERATION, DAMPING, SEAT_MASS, STIFFNESS, Array, Case
from numpy.typing import NDArray
from peaks import Segment, amplitudes
from scipy.linalg import lu_factor, lu_solve
from scipy.sparse.linalg import LinearOperator, gmres

Complex = NDArray[np.complex128]
OVERSAMPLING = 4
LOW = 150  # harmonics of the preconditioner's exact block


@dataclass
class HarmonicBalance:
    """Series q(t) = Re sum_{k=0}^{harmonics} q_k exp(i k w t)."""

    case: Case
    harmonics: int

    def __post_init__(self) -> None:
        self.count = OVERSAMPLING * 2 ** int(np.ceil(np.log2(self.harmonics)))
        self.k = np.arange(self.harmonics + 1)
        w = self.case.omega
        s = 1j * self.k * w
        free = self.case.free_matrix()
        mass = np.diag([SEAT_MASS, self.case.body.m1, self.case.body.m2])
        stiffness, damping = -mass @ free[3:, :3], -mass @ free[3:, 3:]
        stiffness[0, 0] += STIFFNESS
        damping[0, 0] += DAMPING
        dynamic = (s**2)[:, None, None] * mass + s[:, None, None] * damping + stiffness
        unit = np.zeros((self.harmonics + 1, 3, 1))
        unit[:, 0] = 1.0
        self.receptance = np.linalg.solve(dynamic.astype(complex), unit)[:, :, 0]  # (K + 1, 3)
        # x0 = -(a/w^2) sin w t = Re[i (a/w^2) exp(i w t)]
        self.base = np.zeros(self.harmonics + 1, dtype=complex)
        self.base[1] = 1j * BASE_ACCELERATION / w**2
        self.s = s
        drive = (STIFFNESS + DAMPING * s) * self.base
        self.linear_motion = self.receptance * drive[:, None]
        self.linear_v = s * (self.linear_motion[:, 0] - self.base)
        self.gain = s * self.receptance[:, 0]

    def to_time(self, coefficients: Complex) -> Array:
        """Samples of Re sum q_k exp(i k w t) at count equal steps."""
        half = np.zeros(self.count // 2 + 1, dtype=complex)
        half[: self.harmonics + 1] = 0.5 * self.count * coefficients
        half[0] *= 2
        return np.asarray(np.fft.irfft(half, self.count))

    def to_harmonics(self, samples: Array) -> Complex:
        """Inverse of :meth:`to_time`, truncated."""
        out = np.fft.rfft(samples)[: self.harmonics + 1] * (2 / self.count)
        out[0] *= 0.5
        return np.asarray(out)

    def _residual(self, v: Complex) -> Complex:
        force = self.case.law.force_of_velocity(self.to_time(v))
        return np.asarray(v - self.linear_v + self.gain * self.to_harmonics(force))

    def _preconditioner(self, slope: Array) -> LinearOperator:
        """Exact inverse of I + G N' on harmonics 0..LOW, identity above."""
        n = min(LOW, self.harmonics)
        p = np.fft.fft(slope) / self.count  # two-sided coefficients of N'(v(t))
        i = np.arange(n + 1)
        minus, plus = p[i[:, None] - i[None, :]], p[i[:, None] + i[None, :]]
        # N'(t) Re[q e^{ilwt}] has harmonic k: minus * q + plus * conj(q) (half of it for k = 0)
        half = np.where(i == 0, 0.5, 1.0)[:, None]
        a = self.gain[: n + 1, None] * minus * half
        b = self.gain[: n + 1, None] * plus * half
        block = np.block([[(a + b).real, (b - a).imag], [(a + b).imag, (a - b).real]]) + np.eye(
            2 * n + 2
        )
        factor = lu_factor(block)
        size = self.harmonics + 1
        low = np.concatenate([i, i + size])

        def apply(vector: Array) -> Array:
            out = np.array(vector, dtype=float).ravel()
            out[low] = lu_solve(factor, out[low])
            return out

        return LinearOperator((2 * size, 2 * size), matvec=apply, dtype=float)

    def _newton_step(self, v: Complex, residual: Complex, rtol: float) -> Complex:
        slope = self.case.law.slope_of_velocity(self.to_time(v))
        size = self.harmonics + 1

        def apply(vector: Array) -> Array:
            q = vector[:size] + 1j * vector[size:]
            out = q + self.gain * self.to_harmonics(slope * self.to_time(q))
            return np.concatenate([out.real, out.imag])

        operator = LinearOperator((2 * size, 2 * size), matvec=apply, dtype=float)
        right = -np.concatenate([residual.real, residual.imag])
        step, _ = gmres(
            operator,
            right,
            rtol=rtol,
            atol=0.0,
            restart=150,
            maxiter=4,
            M=self._preconditioner(slope),
        )
        return np.asarray(step[:size] + 1j * step[size:])

    def solve(self, guess: Complex | None = None) -> Complex:
        """Harmonics of v, converged to rounding."""
        v: Complex = np.array(self.linear_v)
        if guess is not None:
            v = np.zeros_like(v)
            n = min(len(guess), len(v))
            v[:n] = guess[:n]
        residual = self._residual(v)
        size = float(np.linalg.norm(residual))
        for _ in range(60):
            if size < 1e-15:
                return v
            step = self._newton_step(v, residual, 1e-6 if size < 1e-4 else 1e-3)
            length = 1.0
            while True:
                trial = v + length * step
                trial_residual = self._residual(trial)
                trial_size = float(np.linalg.norm(trial_residual))
                if trial_size < (1 - 0.25 * length) * size or length < 1e-3:
                    break
                length *= 0.5
            if size < 1e-12 and trial_size > 0.5 * size:
                return v
            v, residual, size = trial, trial_residual, trial_size
        raise RuntimeError(f"harmonic balance did not converge, residual {size:.2e}")

    def segment(self, v: Complex) -> Segment:
        """Outputs of the solution on the sampling grid, and by direct summation in between."""
        case, law = self.case, self.case.law
        force = self.to_harmonics(law.force_of_velocity(self.to_time(v)))
        motion = self.linear_motion - self.receptance * force[:, None]
        series = np.concatenate([motion, self.s[:, None] * motion], axis=1)  # (K + 1, 6)
        h = case.period / self.count
        times = h * np.arange(self.count + 1)
        states = np.stack([self.to_time(c) for c in series.T], axis=1)
        states = np.concatenate([states, states[:1]])

        def outputs(states: Array, times: Array) -> Array:
            base = case.base_array(times)
            return case.outputs(states, base, law.force_of_velocity(states[:, 3] - base[:, 1]))

        def evaluate(times: Array) -> Array:
            phases = np.exp(1j * case.omega * np.outer(times, self.k))
            return outputs((phases @ series).real, times)

        return Segment(times, evaluate, outputs(states, times))


def solve(case: Case, harmonics: int, guess: Complex | None = None) -> tuple[Array, Complex, Array]:
    """Amplitudes (14), harmonics of v (for the next guess), state at t = 0."""
    system = HarmonicBalance(case, harmonics)
    v = system.solve(guess)
    segment = system.segment(v)
    force = system.to_harmonics(case.law.force_of_velocity(system.to_time(v)))
    motion = system.linear_motion - system.receptance * force[:, None]
    start = np.concatenate([motion, system.s[:, None] * motion], axis=1).sum(axis=0).real
    return amplitudes([segment]), v, np.asarray(start)
