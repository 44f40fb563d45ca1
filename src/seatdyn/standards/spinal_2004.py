"""Dose of repeated shocks to the lumbar spine, ISO 2631-5:2004, the edition before the one in use.

Kept for comparison with older studies. At 160 samples per second, with u the seat acceleration:

    x, y:  an oscillator of 2.125 Hz and damping ratio 0.22
    z:     x_j = tanh(sum_{k=1..4} w_kj y[t-k] + sum_{k=1..8} w_{k+4,j} u[t-k] + w_{13,j}), j = 1..7
           y[t] = sum_j W_j x_j + W_8

Peaks of either sign count in x and y, positive (compressive) ones in z:

    D_k = (sum A^6)^(1/6),  of a day D_k (t_d/t_m)^(1/6)
    S_ed = [sum_k (m_k D_kd)^6]^(1/6)                                              MPa
    R = [sum_i (S_ed N^(1/6) / (6.75 - 0.066 (b + i) - 0.25))^6]^(1/6)
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seatdyn.errors import RequestError
from seatdyn.standards.source import Constant, Grade
from seatdyn.standards.spinal import POWER, compressive_peaks
from seatdyn.standards.weighting import checked_samples
from seatdyn.units import RATE, number

Array = NDArray[np.float64]

_CLAUSE = "ISO 2631-5:2004, 5.2 to 5.4 and Annex A"
OWN_RATE = Constant(160.0, "Hz", _CLAUSE, Grade.CHECKED)
STRESS_FACTOR = {
    axis: Constant(m, "MPa s2/m", _CLAUSE, Grade.FOUND)
    for axis, m in (("x", 0.015), ("y", 0.035), ("z", 0.032))
}
STRENGTH = Constant(6.75, "MPa", _CLAUSE, Grade.RECALLED)
AGEING = Constant(0.066, "MPa/a", _CLAUSE, Grade.RECALLED)
STATIC = Constant(0.25, "MPa", _CLAUSE, Grade.RECALLED)
LARGEST_DENOMINATOR = 1000  # of the ratio of two rates

HORIZONTAL = ((0.0192752, 0.00433451, -0.0167763), (1.0, -1.957115, 0.963949))
PAST_RESPONSES, PAST_INPUTS = 4, 8
# rows 1 .. 13 of w, one column for each of the seven units
WEIGHTS = np.array(
    [
        [0.00130, 0.01841, -0.00336, 0.01471, 0.00174, 0.00137, 0.00145],
        [-0.00646, -0.00565, -0.00539, 0.01544, -0.00542, 0.00381, 0.00497],
        [-0.00091, -0.02073, 0.00708, -0.00091, 0.00255, -0.00216, 0.01001],
        [0.00898, -0.02626, 0.00438, -0.00595, -0.00774, -0.00034, 0.01280],
        [0.00201, 0.00579, 0.00330, -0.00065, -0.00459, -0.00417, -0.00468],
        [0.00158, 0.00859, 0.00166, 0.00490, -0.00546, 0.00057, -0.00797],
        [0.00361, 0.00490, 0.00452, 0.00079, -0.00604, -0.00638, -0.00529],
        [0.00167, -0.00098, 0.00743, 0.00795, -0.01095, 0.00627, -0.00341],
        [-0.00078, -0.00261, 0.00771, 0.00600, -0.00908, 0.00504, 0.00135],
        [-0.00405, -0.00210, 0.00520, 0.00176, -0.00465, -0.00198, 0.00451],
        [-0.00563, 0.00218, -0.00105, 0.00195, 0.00296, -0.00190, 0.00306],
        [-0.00372, 0.00037, -0.00045, -0.00197, 0.00289, -0.00448, 0.00216],
        [-0.31088, -0.95883, -0.67105, 0.14423, 0.04063, 0.07029, 1.03300],
    ]
)
OUT = np.array([57.96539, 52.32773, 49.78227, 53.16885, 56.02619, -27.79550, 72.34446])
OUT_BIAS = 21.51959


def spinal_response(samples: ArrayLike, rate: float, axis: str) -> Array:
    """Acceleration of the lumbar spine, m/s2, at 160 samples per second.

    Parameters
    ----------
    samples : seat acceleration of one axis, m/s2; resampled where `rate` is not 160 Hz
    rate : samples per second, Hz
    axis : "x", "y" or "z"; z is positive upwards
    """
    if axis not in STRESS_FACTOR:
        raise RequestError(f"axis {axis!r} is not known; use x, y, z.")
    u = _resampled(checked_samples(samples), rate)
    if axis != "z":
        from scipy.signal import lfilter

        return np.asarray(lfilter(*HORIZONTAL, u))
    past = np.zeros(PAST_RESPONSES)  # latest first
    inputs = np.concatenate([np.zeros(PAST_INPUTS), u])
    # what the inputs and the bias contribute does not depend on the responses
    windows = np.lib.stride_tricks.sliding_window_view(inputs, PAST_INPUTS)[: u.size, ::-1]
    known = windows @ WEIGHTS[PAST_RESPONSES:-1] + WEIGHTS[-1]
    y = np.empty(u.size)
    for t in range(u.size):
        y[t] = OUT @ np.tanh(past @ WEIGHTS[:PAST_RESPONSES] + known[t]) + OUT_BIAS
        past[1:] = past[:-1]
        past[0] = y[t]
    return y


def _resampled(samples: Array, rate: float) -> Array:
    from scipy.signal import resample_poly

    given = number(rate, "rate", "Hz", **RATE, error=RequestError)
    ratio = Fraction(OWN_RATE.value / given).limit_denominator(LARGEST_DENOMINATOR)
    if ratio == 1:
        return samples
    if ratio == 0:
        raise RequestError(f"rate = {given:g} Hz is too high to be resampled to 160 Hz.")
    return np.asarray(resample_poly(samples, ratio.numerator, ratio.denominator))


def acceleration_dose(response: ArrayLike, axis: str) -> float:
    """D_k = (sum A^6)^(1/6) of the peaks of the response of the spine, m/s2."""
    a = checked_samples(response)
    peaks = compressive_peaks(a)
    if axis != "z":
        peaks = np.concatenate([peaks, compressive_peaks(-a)])
    return float(np.sum(peaks**POWER) ** (1 / POWER))


def equivalent_stress(doses: Mapping[str, float]) -> float:
    """S_ed in MPa from the daily dose of each axis, m/s2; above 0.8 an effect is likely."""
    return float(
        sum((STRESS_FACTOR[axis].value * d) ** POWER for axis, d in doses.items()) ** (1 / POWER)
    )


def injury_factor(stress: float, *, age: float, years: int, days: float) -> float:
    """R after years of a daily S_ed; below 0.8 the probability of an effect is low, above 1.2 high.

    Parameters
    ----------
    stress : S_ed, MPa, >= 0
    age : at which exposure begins, years
    years : of exposure, >= 1
    days : of exposure per year

    Raises
    ------
    RequestError
        An exposure that lasts to an age at which no strength is left.
    """
    s = number(stress, "stress", "MPa", minimum=0.0, maximum=1e6, error=RequestError)
    left = STRENGTH.value - AGEING.value * (age + np.arange(years)) - STATIC.value
    if years < 1 or left[-1] <= 0.0:
        raise RequestError(
            f"age = {age:g} and years = {years} leave the spine no strength, or no time."
        )
    return float(np.sum((s * days ** (1 / POWER) / left) ** POWER) ** (1 / POWER))
