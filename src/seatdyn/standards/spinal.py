"""Dose of repeated shocks to the lumbar spine, ISO 2631-5:2018, vertical axis, seated.

The seat acceleration z passes a filter, H(s) = N / (D1 .. D6), factors 1 + 2 zeta s/w + (s/w)^2,
that gives the response of the spine. From its positive (compressive) peaks A_i, one between two
zero crossings:

    dose            D   = 1.07 (sum A_i^6)^(1/6)                       m/s2
    of a day        D_d = [sum_j D_j^6 t_dj/t_mj]^(1/6)
    stress          S_d = m_z D_d                                      MPa
    injury factor   R   = [sum_{i=0}^{n-1} (S_d N^(1/6) / (S_u(b+i) - S_stat))^6]^(1/6)
    risk            P   = 1 - exp(-(R/alpha)^beta)

S_u = 6.75 MPa - S_age (b + i) is the strength at the age b + i, S_stat = 9.81 m_z the static
stress. Annex A of the standard, a finite-element model, is not here.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seatdyn.errors import RequestError
from seatdyn.standards.source import Constant, Grade
from seatdyn.standards.weighting import checked_samples, through_spectrum
from seatdyn.units import RATE, number

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Sex = Literal["male", "female"]

NUMERATOR = (34.0, 0.35)  # rad/s, damping ratio
DENOMINATORS = (
    (31.0, 0.21),
    (230.0, 0.88),
    (260.0, 0.80),
    (320.0, 0.40),
    (380.0, 0.75),
    (420.0, 0.65),
)
FILTER_SOURCE = ("ISO 2631-5:2018, clause 5 and Annex D", Grade.CHECKED)

_CLAUSE = "ISO 2631-5:2018, clause 5"
DOSE_FACTOR = Constant(1.07, "1", _CLAUSE, Grade.CHECKED)
STRENGTH = Constant(6.75, "MPa", _CLAUSE, Grade.CHECKED)
STRESS_FACTOR = {
    "male": Constant(0.029, "MPa s2/m", _CLAUSE, Grade.CHECKED),  # 82 kg
    "female": Constant(0.025, "MPa s2/m", _CLAUSE, Grade.CHECKED),  # 64 kg
}
AGEING = {
    "male": Constant(0.052, "MPa/a", _CLAUSE, Grade.CHECKED),
    "female": Constant(0.039, "MPa/a", _CLAUSE, Grade.CHECKED),
}
WEIBULL = {  # alpha, beta
    "male": (
        Constant(1.613, "1", _CLAUSE, Grade.CHECKED),
        Constant(2.799, "1", _CLAUSE, Grade.CHECKED),
    ),
    "female": (
        Constant(0.959, "1", _CLAUSE, Grade.CHECKED),
        Constant(3.709, "1", _CLAUSE, Grade.CHECKED),
    ),
}
GRAVITY = 9.81  # m/s2, as the standard takes it
POWER = 6


def spinal_factor(frequency: ArrayLike) -> ComplexArray:
    """Complex response of the spine to the seat acceleration, at frequencies in Hz."""
    s = 2j * np.pi * np.asarray(frequency, dtype=float)

    def quadratic(w: float, zeta: float) -> ComplexArray:
        return np.asarray(1.0 + 2.0 * zeta * s / w + (s / w) ** 2)

    value = quadratic(*NUMERATOR)
    for w, zeta in DENOMINATORS:
        value = value / quadratic(w, zeta)
    return value


def spinal_response(samples: ArrayLike, rate: float) -> Array:
    """Acceleration of the lumbar spine, m/s2, from that of the seat; the mean is removed first.

    Parameters
    ----------
    samples : vertical seat acceleration, m/s2, positive upwards, along the last axis
    rate : samples per second, Hz; the standard's own filter runs at 256 Hz
    """
    x = checked_samples(samples)
    rate = number(rate, "rate", "Hz", **RATE, error=RequestError)
    slowest = min(w * zeta for w, zeta in DENOMINATORS)
    return through_spectrum(x - x.mean(axis=-1, keepdims=True), rate, spinal_factor, slowest)


def compressive_peaks(response: ArrayLike) -> Array:
    """Largest value of every stretch in which the response of the spine is positive, m/s2."""
    a = checked_samples(response)
    positive = np.concatenate([[False], a > 0.0, [False]])
    edges = np.flatnonzero(np.diff(positive.astype(np.int8)))
    starts, ends = edges[::2], edges[1::2]
    if starts.size == 0:
        return np.zeros(0)
    # every other piece of reduceat is a stretch that is not positive
    return np.asarray(np.maximum.reduceat(np.append(a, 0.0), np.ravel([starts, ends], "F"))[::2])


def acceleration_dose(peaks: ArrayLike) -> float:
    """D = 1.07 (sum A^6)^(1/6) of the compressive peaks, m/s2."""
    a = np.asarray(peaks, dtype=float)
    return float(DOSE_FACTOR.value * np.sum(a**POWER) ** (1 / POWER))


def daily_dose(doses: Iterable[tuple[float, float, float]]) -> float:
    """Dose of a day, m/s2, from (dose, exposure in s, measured duration in s) of its parts."""
    return float(sum(d**POWER * td / tm for d, td, tm in doses) ** (1 / POWER))


@dataclass(frozen=True)
class SpinalRisk:
    """Risk of an injury of the lumbar spine, made by `spinal_risk`.

    Parameters
    ----------
    stress : daily equivalent compressive stress S_d, MPa
    injury_factor : R, 1
    probability : of an injury, 0 .. 1
    """

    stress: float
    injury_factor: float
    probability: float


def spinal_risk(dose: float, *, sex: Sex, age: float, years: int, days: float) -> SpinalRisk:
    """Injury factor and probability after years of a daily dose.

    Parameters
    ----------
    dose : of a day, m/s2, see `daily_dose`
    sex : "male" (82 kg) or "female" (64 kg)
    age : at which exposure begins, years, 15 .. 80
    years : of exposure, 1 .. 60
    days : of exposure per year, 1 .. 366

    Raises
    ------
    RequestError
        A number outside its range, or an age at which no strength would be left.

    Examples
    --------
    Five shocks of 40 m/s2 a day, 120 days a year, from the age of 20 to 40:

    >>> from seatdyn.standards.spinal import acceleration_dose, spinal_risk
    >>> dose = acceleration_dose([40.0] * 5)
    >>> risk = spinal_risk(dose, sex="male", age=20, years=20, days=120)
    >>> print(f"{dose:.2f} {risk.injury_factor:.2f} {risk.probability:.2f}")
    55.97 1.22 0.37
    """
    if sex not in STRESS_FACTOR:
        raise RequestError(f"sex = {sex!r} is not allowed; use 'male' or 'female'.")
    d = number(dose, "dose", "m/s2", minimum=0.0, maximum=1e6, error=RequestError)
    b = number(age, "age", "years", minimum=15.0, maximum=80.0, error=RequestError)
    n = number(years, "years", "years", minimum=1.0, maximum=60.0, error=RequestError)
    per_year = number(days, "days", "per year", minimum=1.0, maximum=366.0, error=RequestError)
    if n != int(n):
        raise RequestError(f"years = {n:g} is not allowed; give whole years.")
    m = STRESS_FACTOR[sex].value
    stress = m * d
    left = STRENGTH.value - AGEING[sex].value * (b + np.arange(int(n))) - GRAVITY * m
    if left[-1] <= 0.0:
        raise RequestError(
            f"age = {b:g} and years = {n:g} lead to an age of {b + n - 1:g}, at which the model "
            "leaves the spine no strength; shorten the exposure."
        )
    factor = float(np.sum((stress * per_year ** (1 / POWER) / left) ** POWER) ** (1 / POWER))
    alpha, beta = (c.value for c in WEIBULL[sex])
    return SpinalRisk(stress, factor, 1.0 - math.exp(-((factor / alpha) ** beta)))
