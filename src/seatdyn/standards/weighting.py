"""Frequency weightings of ISO 8041-1, ISO 2631 and BS 6841.

Every one is the same product of four analogue filters, with s = i 2 pi f and w = 2 pi f_i:

    band limits   Hh = s^2 / (s^2 + s w1/Q1 + w1^2),   Hl = 1 / (1 + s/(Q1 w2) + (s/w2)^2)
    transition    Ht = K (1 + s/w3) / (1 + s/(Q4 w4) + (s/w4)^2)
    upward step   Hs = [(1 + s/(Q5 w5) + (s/w5)^2) / (1 + s/(Q6 w6) + (s/w6)^2)] (w5/w6)^2

A frequency that is infinite leaves its factor out. ISO 8041-1 prints factors at the true centres
10^(n/10) Hz, ISO 2631-1 at the nominal ones; they differ by up to 0.8 %.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seatdyn.errors import RequestError
from seatdyn.standards.source import Grade
from seatdyn.units import RATE, number, suggestion

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

BUTTERWORTH = 1 / math.sqrt(2)  # Q of the band limits; BS 6841 prints 0.71
LONGEST_KEPT = 2**21  # samples of a record whose factors are kept for the next: 16 MB
SETTLED = 37.0  # time constants after which a decay is below the rounding of a double
ISO_8041 = "ISO 8041-1:2017, 5.6, Table 3"
BS_6841 = "BS 6841:1987, Table 3"


@dataclass(frozen=True)
class Weighting:
    """A frequency weighting.

    Parameters
    ----------
    name : such as "Wk"
    use : where on the body, and in which direction
    lower, upper : f1 and f2 in Hz, the band limits
    f3, f4, f5, f6 : Hz, see the head of this module
    q4, q5, q6 : quality factors, 1
    gain : K, 1
    band_q : Q of both band limits, 1
    clause, grade : where the constants are from
    """

    name: str
    use: str
    lower: float
    upper: float
    f3: float = math.inf
    f4: float = math.inf
    q4: float = 1.0
    f5: float = math.inf
    q5: float = 1.0
    f6: float = math.inf
    q6: float = 1.0
    gain: float = 1.0
    band_q: float = BUTTERWORTH
    clause: str = ISO_8041
    grade: Grade = Grade.CHECKED

    @property
    def band_limits(self) -> Weighting:
        """The band limits alone, without the weighting between them."""
        return Weighting(f"{self.name}, band limits only", self.use, self.lower, self.upper)

    def sections(self) -> Iterator[tuple[Array, Array]]:
        """Numerator and denominator of each factor, highest power of s first."""
        w1, w2 = 2 * math.pi * self.lower, 2 * math.pi * self.upper
        yield np.array([1.0, 0.0, 0.0]), np.array([1.0, w1 / self.band_q, w1**2])
        yield np.array([w2**2]), _quadratic(self.upper, self.band_q)
        if self.f4 < math.inf:
            w4 = 2 * math.pi * self.f4
            numerator = np.array(
                [1 / (2 * math.pi * self.f3), 1.0] if self.f3 < math.inf else [1.0]
            )
            yield self.gain * w4**2 * numerator, _quadratic(self.f4, self.q4)
        if self.f5 < math.inf:
            yield _quadratic(self.f5, self.q5), _quadratic(self.f6, self.q6)

    def zpk(self) -> tuple[ComplexArray, ComplexArray, float]:
        """Zeros and poles in rad/s and gain of the analogue filter, as in scipy.signal."""
        zeros, poles, gain = [], [], 1.0
        for numerator, denominator in self.sections():
            zeros.append(np.roots(numerator))
            poles.append(np.roots(denominator))
            gain *= float(numerator[0] / denominator[0])
        return np.concatenate(zeros).astype(complex), np.concatenate(poles).astype(complex), gain

    def factor(self, frequency: ArrayLike) -> ComplexArray:
        """Complex weighting factor at any frequencies.

        Parameters
        ----------
        frequency : Hz, finite, >= 0, any shape

        Returns
        -------
        numpy.ndarray
            Of the shape of `frequency`. The real part of factor * exp(i w t) is the weighted
            cos(w t), so a negative phase is a lag.

        Raises
        ------
        RequestError
            A frequency that is negative, not finite or no number.

        Examples
        --------
        >>> import seatdyn as sd
        >>> print(abs(sd.weighting("Wk").factor([1.0, 4.0, 16.0])).round(4))
        [0.4825 0.9672 0.7687]
        """
        try:
            f = np.asarray(frequency, dtype=float)
        except (TypeError, ValueError, OverflowError):
            raise RequestError(
                f"{self.name}: frequency = {frequency!r} must be numbers, in Hz."
            ) from None
        wrong = ~(np.isfinite(f) & (f >= 0.0))
        if np.any(wrong):
            raise RequestError(
                f"{self.name}: frequency = {f[wrong].flat[0]:g} Hz is not allowed; it must be "
                "finite and >= 0 Hz."
            )
        s = 2j * np.pi * f
        above, below = np.ones(f.shape, dtype=complex), np.ones(f.shape, dtype=complex)
        for numerator, denominator in self.sections():
            above *= _at(numerator, s)
            below *= _at(denominator, s)
        return np.asarray(above / below)

    def apply(self, samples: ArrayLike, rate: float) -> Array:
        """Weighted time signal of a sampled one that was zero before its first sample.

        The spectrum of the samples, followed by zeros for as long as the filter rings, is
        multiplied by the analogue factor. So the gain is right up to half the sampling rate, where
        a filter made by the bilinear transform droops (at 80 Hz and 200 Hz sampling, Wk: by 88 %).

        Parameters
        ----------
        samples : along the last axis, any unit; finite
        rate : samples per second, 1e-3 .. 1e7 Hz. What lies above half of it is not in the record.

        Returns
        -------
        numpy.ndarray
            Of the shape and in the unit of `samples`.

        Raises
        ------
        RequestError
            No samples, one that is not finite, or a rate outside its range.

        Examples
        --------
        >>> import numpy as np, seatdyn as sd
        >>> t = np.arange(0.0, 60.0, 1 / 200)
        >>> weighted = sd.weighting("Wk").apply(np.sin(2 * np.pi * 16 * t), 200.0)
        >>> print(f"{weighted[4000:8000].std() * 2**0.5:.4f}")
        0.7687
        """
        x = checked_samples(samples)
        rate = number(rate, "rate", "Hz", **RATE, error=RequestError)
        slowest = float(np.min(-self.zpk()[1].real))
        return through_spectrum(x, rate, self.factor, slowest)


def weighting(name: str) -> Weighting:
    """Frequency weighting by its name.

    Parameters
    ----------
    name : "Wk" (z of a seat, feet), "Wd" (x, y of a seat; y, z of a backrest), "Wc" (x of a
        backrest), "We" (rotations), "Wj" (head, recumbent), "Wf" (motion sickness), "Wb" (rail),
        "Wm" (buildings), "Wh" (hand-arm); "Wg" of BS 6841; in any case

    Returns
    -------
    Weighting
        `factor(frequency)`, `apply(samples, rate)`, and where its constants are from.

    Raises
    ------
    RequestError
        An unknown name, with a suggestion.

    Examples
    --------
    >>> import seatdyn as sd
    >>> sd.weighting("Wd").use
    'seat x and y, backrest y and z'
    """
    known = str(name).capitalize()
    if known not in WEIGHTINGS:
        raise RequestError(f"There is no weighting {name!r}. {suggestion(known, WEIGHTINGS)}")
    return WEIGHTINGS[known]


def through_spectrum(
    samples: Array, rate: float, factor: Callable[[Array], ComplexArray], slowest: float
) -> Array:
    """Response to samples that follow upon rest, from the factor of an analogue filter.

    Zeros follow the samples for as long as the slowest pole rings (`slowest` is its decay in 1/s),
    so that nothing comes back at the start.
    """
    from scipy.fft import irfft, next_fast_len, rfft

    count = samples.shape[-1]
    length = next_fast_len(count + math.ceil(SETTLED * rate / slowest), real=True)
    spectrum = rfft(samples, length)
    # records of an ensemble are of one length; one that is very long comes alone
    of_lines = _of_lines if length <= LONGEST_KEPT else _of_lines.__wrapped__
    spectrum *= of_lines(factor, length, rate)
    return np.asarray(irfft(spectrum, length)[..., :count])


@lru_cache(maxsize=4)
def _of_lines(factor: Callable[[Array], ComplexArray], length: int, rate: float) -> ComplexArray:
    """Factor at the lines of a discrete spectrum."""
    value = factor(np.asarray(np.fft.rfftfreq(length, 1 / rate), dtype=float))
    value.setflags(write=False)
    return value


def checked_samples(samples: ArrayLike) -> Array:
    """Samples as doubles, at least one and all finite."""
    try:
        x = np.asarray(samples, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise RequestError("samples must be numbers; remove or repair what is text.") from None
    if x.ndim == 0 or x.size == 0:
        raise RequestError("samples must be a list of at least one number.")
    if not np.all(np.isfinite(x)):
        place = np.unravel_index(int(np.argmin(np.isfinite(x))), x.shape)
        where = ", ".join(str(int(i)) for i in place)
        raise RequestError(
            f"samples[{where}] = {x[place]} is not finite; repair the record or cut it there."
        )
    return x


def _at(polynomial: Array, s: ComplexArray) -> ComplexArray:
    """Value of a polynomial, highest power first; numpy.polyval takes twenty times as long."""
    value = np.asarray(polynomial[0], dtype=complex)
    for coefficient in polynomial[1:]:
        value = value * s + coefficient
    return value


def _quadratic(f: float, q: float) -> Array:
    """s^2 + s w/Q + w^2."""
    w = 2 * math.pi * f
    return np.array([1.0, w / q, w**2])


_WHOLE_BODY = Weighting("", "", 0.4, 100.0)
_WM_CORNER = 1 / (0.028 * 2 * math.pi)  # Hz: ISO 2631-2 gives the time constant, 28 ms
_WH_CORNER = 100 / (2 * math.pi)  # Hz

WEIGHTINGS: dict[str, Weighting] = {
    w.name: w
    for w in (
        replace(
            _WHOLE_BODY, name="Wk", use="seat z, feet x, y and z, standing z",
            f3=12.5, f4=12.5, q4=0.63, f5=2.37, q5=0.91, f6=3.35, q6=0.91,
        ),
        replace(
            _WHOLE_BODY, name="Wd", use="seat x and y, backrest y and z", f3=2.0, f4=2.0, q4=0.63,
        ),
        replace(_WHOLE_BODY, name="Wc", use="backrest x", f3=8.0, f4=8.0, q4=0.63),
        replace(_WHOLE_BODY, name="We", use="rotations", f3=1.0, f4=1.0, q4=0.63),
        replace(
            _WHOLE_BODY, name="Wj", use="head of a recumbent person",
            f5=3.75, q5=0.91, f6=5.32, q6=0.91,
        ),
        Weighting(
            "Wf", "motion sickness, z", 0.08, 0.63,
            f4=0.25, q4=0.86, f5=0.0625, q5=0.80, f6=0.10, q6=0.80,
        ),
        # K multiplies (a draft of ISO 8041 divided by it)
        replace(
            _WHOLE_BODY, name="Wb", use="seat z in rail vehicles (ISO 2631-4)",
            f3=16.0, f4=16.0, q4=0.55, f5=2.5, q5=0.90, f6=4.0, q6=0.95, gain=1.024,
        ),
        Weighting(
            "Wm", "buildings, any direction", 10**-0.1, 100.0,
            f3=_WM_CORNER, f4=_WM_CORNER, q4=0.5,
        ),
        Weighting(
            "Wh", "hand-arm, any direction", 10**0.8, 10**3.1,
            f3=_WH_CORNER, f4=_WH_CORNER, q4=0.64,
        ),
        Weighting(
            "Wg", "activity, z (BS 6841)", 0.8, 100.0,
            f3=1.5, f4=5.3, q4=0.68, gain=0.42, band_q=0.71, clause=BS_6841, grade=Grade.FOUND,
        ),
    )
}  # fmt: skip
