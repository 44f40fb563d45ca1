"""From samples of acceleration to a displacement that is exactly consistent with them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def integrate_samples(time: Array, acceleration: Array) -> Array:
    """Quintic segments of displacement (k, 6) whose second derivative is the cubic spline.

    Parameters
    ----------
    time : (k+1,) s, increasing
    acceleration : (k+1,) m/s2; the motion starts at rest at zero
    """
    from scipy.interpolate import CubicSpline

    cubic = CubicSpline(time, acceleration).c[::-1].T  # (k, 4), rising powers
    steps = np.diff(time)
    divisors = np.arange(1, 5)
    gain_v = (cubic * steps[:, None] ** divisors / divisors).sum(1)
    velocity = np.concatenate([[0.0], np.cumsum(gain_v)])
    divisors = np.array([2.0, 6.0, 12.0, 20.0])
    gain_x = velocity[:-1] * steps + (cubic * steps[:, None] ** np.arange(2, 6) / divisors).sum(1)
    displacement = np.concatenate([[0.0], np.cumsum(gain_x)])
    return np.column_stack([displacement[:-1], velocity[:-1], cubic / divisors])


def end_of(time: Array, polynomials: Array) -> tuple[float, float]:
    """Displacement (m) and velocity (m/s) at the end of the last segment."""
    step = float(time[-1] - time[-2])
    last = np.polynomial.Polynomial(polynomials[-1])
    return float(last(step)), float(last.deriv()(step))


def end_at_rest(time: Array, acceleration: Array) -> tuple[Array, Array]:
    """Add the smoothest small acceleration after which the motion ends at rest at zero.

    The addition is s^2 (1-s)^2 (p + q (1-2s)) over the whole length, s = 0 .. 1. Returns the new
    segments and the addition.
    """
    s = (time - time[0]) / (time[-1] - time[0])
    bump = s**2 * (1 - s) ** 2
    shapes = [bump, bump * (1 - 2 * s)]
    effects = np.array([end_of(time, integrate_samples(time, shape)) for shape in shapes]).T
    present = np.array(end_of(time, integrate_samples(time, acceleration)))
    weights = np.linalg.solve(effects, -present)
    addition = weights[0] * shapes[0] + weights[1] * shapes[1]
    return integrate_samples(time, acceleration + addition), addition
