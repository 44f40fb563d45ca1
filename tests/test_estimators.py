"""Estimated spectra and transmissibilities against systems that are known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

import seatdyn as sd
from seatdyn.signals.estimators import (
    band_rms,
    clock_drift,
    delay,
    power_density,
    third_octaves,
    transfer_function,
)

RATE = 256.0
COUNT = int(240 * RATE)


def noise(seed, count=COUNT):
    return np.random.default_rng(seed).standard_normal(count)


def seat(x, f0=1.6, zeta=0.3):
    """A suspension as a digital filter, and its frequency response."""
    w = 2 * np.pi * f0
    b, a = signal.bilinear([2 * zeta * w, w**2], [1.0, 2 * zeta * w, w**2], RATE)
    return signal.lfilter(b, a, x), lambda f: signal.freqz(b, a, f, fs=RATE)[1]


def test_density_of_white_noise_and_of_a_sine():
    g = power_density(noise(1), RATE)
    assert np.diff(g.frequency) == pytest.approx(0.25)
    # variance 1 over 128 Hz; the mean of 490 values with `averages` averages each
    inner = g.value[10:-10]
    assert inner.mean() == pytest.approx(1 / 128, rel=4 / np.sqrt(g.averages * inner.size))
    assert inner.std() / inner.mean() == pytest.approx(1 / np.sqrt(g.averages), rel=0.1)
    t = np.arange(COUNT) / RATE
    sine = power_density(3.0 * np.sin(2 * np.pi * 8.0 * t), RATE)
    assert np.sum(sine.value) * 0.25 == pytest.approx(4.5, rel=1e-3)


@pytest.mark.parametrize("kind", ["H1", "H2"])
def test_transmissibility_of_a_known_system(kind):
    x = noise(2)
    y, exact = seat(x)
    worst = []
    for resolution in (0.25, 0.0625):
        h = transfer_function(x, y, RATE, kind=kind, resolution=resolution)
        band = (h.frequency >= 1.0) & (h.frequency <= 40.0)
        error = np.abs(h.value[band] / exact(h.frequency[band]) - 1.0)
        worst.append(float(error.max()))
    # segments cut the ringing off, the less the longer they are
    assert worst[0] < 0.1
    assert worst[1] < 0.02
    assert np.all(h.coherence[band] > 0.98)


def test_noise_biases_the_one_that_the_theory_says():
    """Noise in the output leaves H1 alone and raises H2 by 1/coherence; in the input otherwise."""
    x = noise(3)
    y, exact = seat(x)
    dirty = 0.7 * np.std(y) * noise(4)
    at = slice(4, 60)  # 1 .. 15 Hz
    h1, h2 = (transfer_function(x, y + dirty, RATE, kind=kind) for kind in ("H1", "H2"))
    want = np.abs(exact(h1.frequency[at]))
    z = (np.abs(h1.value[at]) / want - 1.0) / h1.random_error[at]
    assert abs(z.mean()) < 0.5
    assert 0.7 < z.std() < 1.3  # the random error is what it says
    np.testing.assert_allclose(np.abs(h2.value) * h2.coherence, np.abs(h1.value), rtol=1e-9)
    clean = transfer_function(x + 0.5 * noise(5), y, RATE, kind="H2")
    np.testing.assert_allclose(np.abs(clean.value[at]), want, rtol=0.15)


def test_coherence_of_a_known_noise():
    x = noise(6)
    h = transfer_function(x, x + 0.5 * noise(7), RATE)
    assert np.median(h.coherence) == pytest.approx(1 / 1.25, abs=0.01)


def test_bands_hold_all_of_the_energy():
    x = noise(8)
    n = np.arange(-3, 22)
    f = np.fft.rfftfreq(COUNT, 1 / RATE)
    spectrum = np.fft.rfft(x)
    spectrum[(f < 10**-0.35) | (f > 10**2.05)] = 0.0
    inside = np.fft.irfft(spectrum, COUNT)
    bands = band_rms(inside, RATE, 10.0 ** (n / 10))
    assert np.isnan(bands).tolist() == [False] * 24 + [True]  # 126 Hz ends above 128 Hz
    known = bands[:-1]
    assert np.sum(known**2) == pytest.approx(np.var(inside), rel=0.01)
    # white noise: 3 dB, that is 10^(1/20), from band to band
    step = known[8:24] / known[7:23]
    assert step == pytest.approx(np.full(16, 10**0.05), rel=0.05)


def test_a_sine_falls_into_its_band():
    t = np.arange(COUNT) / RATE
    bands = band_rms(2.0 * np.sin(2 * np.pi * 4.0 * t), RATE)
    place = int(np.argmin(np.abs(third_octaves() - 4.0)))
    assert bands[place] == pytest.approx(np.sqrt(2.0), rel=1e-6)
    assert np.all(np.delete(bands, place) < 1e-6)
    assert np.isnan(band_rms(np.sin(t[:512]), RATE)[0])  # 2 s do not resolve 0.5 Hz


def test_delay_and_drift():
    t = np.arange(COUNT) / RATE
    x = signal.sosfilt(signal.butter(4, (0.7, 20.0), "bandpass", fs=RATE, output="sos"), noise(9))
    late = np.roll(x, 77)
    assert delay(x, late, RATE) == pytest.approx(77 / RATE, abs=1e-9)
    y, _ = seat(x)
    assert clock_drift(x, y, RATE) == pytest.approx(0.0, abs=1e-3)
    for ppm in (100.0, -300.0):
        drifting = np.interp(t * (1 + 1e-6 * ppm), t, y) + 0.1 * noise(10)
        # from the middle of the first third to that of the last: 160 s
        assert clock_drift(x, drifting, RATE) == pytest.approx(-160e-6 * ppm, abs=2e-3)


def test_refused():
    with pytest.raises(sd.MeasurementError, match=r"A record of 10 s is too short .* last 4 / res"):
        power_density(noise(1, 2560), RATE)
    with pytest.raises(sd.MeasurementError, match="x has 2560 and y 2500 samples"):
        transfer_function(noise(1, 2560), noise(1, 2500), RATE)
    with pytest.raises(sd.MeasurementError, match="use 'H1' or 'H2'"):
        transfer_function(noise(1), noise(1), RATE, kind="H3")
