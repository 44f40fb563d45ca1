"""Spectra and transmissibilities estimated from samples, band levels, and whether clocks agree.

One-sided densities by Welch's method (Hann window, half overlap, mean removed), and from them, with
x the input and y the output (Bendat and Piersol, Random Data):

    H1 = Gxy / Gxx, noise in y does not bias it;   H2 = Gyy / Gyx, noise in x does not
    coherence gamma^2 = |Gxy|^2 / (Gxx Gyy)
    random error of |H|, relative: [(1 - gamma^2) / (2 n gamma^2)]^(1/2), n averages
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from seatdyn.errors import MeasurementError
from seatdyn.units import RATE, number

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

FEWEST_SEGMENTS = 4  # without overlap; the coherence of one segment is always 1
OVERLAP_CORRELATION = 1 / 6  # of the amplitudes of two Hann segments that overlap by half
LOWEST_BAND, HIGHEST_BAND = -3, 19  # 0.5 .. 80 Hz, as 10^(n/10) Hz


@dataclass(frozen=True, eq=False)
class Density:
    """One-sided power spectral density, made by `power_density`.

    Parameters
    ----------
    frequency : Hz
    value : (unit of the samples)^2/Hz
    averages : effective number of independent segments
    """

    frequency: Array
    value: Array
    averages: float


@dataclass(frozen=True, eq=False)
class Transfer:
    """Frequency response estimated from two channels, made by `transfer_function`.

    Parameters
    ----------
    frequency : Hz
    value : complex
    coherence : 0 .. 1
    random_error : standard deviation of |value| relative to it
    averages : effective number of independent segments
    """

    frequency: Array
    value: ComplexArray
    coherence: Array
    random_error: Array
    averages: float


def power_density(samples: ArrayLike, rate: float, *, resolution: float = 0.25) -> Density:
    """Power spectral density by Welch's method.

    Parameters
    ----------
    samples : one channel
    rate : samples per second, Hz
    resolution : distance of the frequencies, Hz; the record must last 4 / resolution at least

    Raises
    ------
    MeasurementError
        A record that is too short for the resolution.

    Examples
    --------
    >>> import numpy as np
    >>> from seatdyn.signals.estimators import power_density
    >>> noise = np.random.default_rng(1).standard_normal(100_000)
    >>> g = power_density(noise, 200.0)
    >>> print(f"{g.value[10:-10].mean():.3f}")  # variance 1 over 100 Hz
    0.010
    """
    from scipy.signal import welch

    x = np.asarray(samples, dtype=float)
    segment, averages = _segments(x.size, rate, resolution)
    f, g = welch(x, rate, **_welch(segment))
    return Density(f, g, averages)


def transfer_function(
    x: ArrayLike,
    y: ArrayLike,
    rate: float,
    *,
    resolution: float = 0.25,
    kind: Literal["H1", "H2"] = "H1",
) -> Transfer:
    """Frequency response from x to y with coherence and random error.

    Parameters
    ----------
    x, y : input and output, sampled together
    rate : samples per second, Hz
    resolution : distance of the frequencies, Hz; the record must last 4 / resolution at least
    kind : "H1" (noise in the output) or "H2" (noise in the input)

    Raises
    ------
    MeasurementError
        Channels of different length, a record too short for the resolution, an unknown kind.
    """
    first, second = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    if first.shape != second.shape:
        raise MeasurementError(
            f"x has {first.size} and y {second.size} samples; they must be sampled together."
        )
    if kind not in ("H1", "H2"):
        raise MeasurementError(f"kind = {kind!r} is not allowed; use 'H1' or 'H2'.")
    segment, averages = _segments(first.size, rate, resolution)
    of_x, of_y = (_segment_spectra(samples, segment) for samples in (first, second))
    gxx, gyy = (np.mean(np.abs(spectra) ** 2, axis=0) for spectra in (of_x, of_y))
    gxy = np.mean(np.conj(of_x) * of_y, axis=0)
    f: Array = np.arange(gxx.size) * (rate / segment)
    with np.errstate(divide="ignore", invalid="ignore"):
        coherence = np.minimum(np.abs(gxy) ** 2 / (gxx * gyy), 1.0)
        value = gxy / gxx if kind == "H1" else gyy / np.conj(gxy)
        error = np.sqrt((1.0 - coherence) / (2.0 * averages * coherence))
    return Transfer(f, value, coherence, error, averages)


def _segment_spectra(samples: Array, segment: int) -> ComplexArray:
    """Spectra of all segments at once, as Welch's method averages them, but not scaled."""
    from scipy.fft import rfft
    from scipy.signal import get_window

    rows = sliding_window_view(samples, segment)[:: segment - segment // 2]
    return np.asarray(rfft((rows - rows.mean(1, keepdims=True)) * get_window("hann", segment)))


def _welch(segment: int) -> dict[str, Any]:
    return {"window": "hann", "nperseg": segment, "noverlap": segment // 2, "detrend": "constant"}


def _segments(count: int, rate: float, resolution: float) -> tuple[int, float]:
    """Samples of a segment, and how many independent ones a record is worth."""
    rate = number(rate, "rate", "Hz", **RATE, error=MeasurementError)
    number(resolution, "resolution", "Hz", above=0.0, error=MeasurementError)
    segment = round(rate / resolution)
    if segment < 2 or count < FEWEST_SEGMENTS * segment:
        raise MeasurementError(
            f"A record of {count / rate:.4g} s is too short for a resolution of {resolution:g} Hz; "
            f"it must last {FEWEST_SEGMENTS} / resolution = {FEWEST_SEGMENTS / resolution:.4g} s. "
            "Take a coarser resolution."
        )
    n = (count - segment) // (segment - segment // 2) + 1
    return segment, n / (1.0 + 2.0 * (1.0 - 1.0 / n) * OVERLAP_CORRELATION**2)


def third_octaves(lowest: int = LOWEST_BAND, highest: int = HIGHEST_BAND) -> Array:
    """True centres 10^(n/10) Hz of third-octave bands (IEC 61260-1, base ten)."""
    return np.asarray(10.0 ** (np.arange(lowest, highest + 1) / 10.0))


def band_rms(samples: ArrayLike, rate: float, centres: ArrayLike | None = None) -> Array:
    """R.m.s. value in third-octave bands, from the spectrum of the whole record.

    Parameters
    ----------
    samples : one channel; its mean is removed
    rate : samples per second, Hz
    centres : Hz; `third_octaves()` without it

    Returns
    -------
    numpy.ndarray
        One value a band in the unit of the samples, NaN where the record is too short to resolve
        the band or has not enough samples per second. The squares of all bands add up to the mean
        square.
    """
    middle = third_octaves() if centres is None else np.asarray(centres, dtype=float)
    return rms_between(samples, rate, middle[:, None] * 10.0 ** np.array([-0.05, 0.05]))


def rms_between(samples: ArrayLike, rate: float, edges: ArrayLike) -> Array:
    """R.m.s. value in bands, from the spectrum of the whole record, as in `band_rms`.

    Parameters
    ----------
    samples : one channel; its mean is removed
    rate : samples per second, Hz
    edges : (k, 2), lower and upper end of each band, Hz
    """
    from scipy.fft import rfft

    x, ends = np.asarray(samples, dtype=float), np.asarray(edges, dtype=float)
    power = np.abs(rfft(x - x.mean())) ** 2 * 2.0 / x.size**2
    if x.size % 2 == 0:
        power[-1] /= 2.0
    step = rate / x.size
    # energy below each edge, a line being spread over the step around it
    upper = (np.arange(power.size) + 0.5) * step
    total = np.interp(ends, np.concatenate([[-0.5 * step], upper]),
                      np.concatenate([[0.0], np.cumsum(power)]))  # fmt: skip
    value = np.sqrt(np.maximum(total[:, 1] - total[:, 0], 0.0))
    resolved = (ends[:, 1] - ends[:, 0] >= step) & (ends[:, 1] <= rate / 2)
    return np.where(resolved, value, np.nan)


def delay(x: ArrayLike, y: ArrayLike, rate: float) -> float:
    """Time by which y follows x, s: where their cross-correlation is largest in size."""
    from scipy.signal import correlate

    first, second = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    product = correlate(second - second.mean(), first - first.mean(), mode="full", method="fft")
    return float(np.argmax(np.abs(product)) - (first.size - 1)) / rate


def clock_drift(x: ArrayLike, y: ArrayLike, rate: float) -> float:
    """Change of the delay from x to y between the first and the last third of a record, s.

    What the structure between the two sensors does is the same in both thirds. So the phase by
    which their cross-spectra differ is -2 pi f times the drift, and the product of one with the
    conjugate of the other is the transform of a pulse at the drift.
    """
    from scipy.fft import irfft, next_fast_len
    from scipy.signal import csd

    first, second = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    third = first.size // 3
    segment = max(third // FEWEST_SEGMENTS, 2)
    cross = [
        csd(first[part], second[part], rate, **_welch(segment))[1]
        for part in (slice(0, third), slice(-third, None))
    ]
    product = cross[1] * np.conj(cross[0])
    fine = next_fast_len(16 * segment, real=True)  # points of the pulse between two samples: 16
    pulse = irfft(product, fine)
    place = int(np.argmax(pulse))
    return float((place if place <= fine // 2 else place - fine) * segment / (fine * rate))
