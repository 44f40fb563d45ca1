"""Frequency weightings against every printed factor, and the time signal against the factors."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import signal

import seatdyn as sd
from seatdyn.standards.source import Grade
from seatdyn.standards.weighting import WEIGHTINGS

# ISO 8041-1:2017 Annex B, true centres 10^(n/10) Hz from n = -10
ANNEX_B = {
    "Wk": """0.03121 0.04931 0.07756 0.1207 0.1832 0.2644 0.3504 0.4188 0.4588 0.4767 0.4825 0.4846
        0.4935 0.5308 0.6335 0.8071 0.9648 1.039 1.054 1.037 0.9884 0.8989 0.7743 0.6373 0.5103
        0.4031 0.3160 0.2451 0.1857 0.1339 0.08873 0.05311 0.02922 0.01528 0.007795 0.003935
        0.001978""",
    "Wd": """0.06242 0.09867 0.1553 0.2420 0.3682 0.5330 0.7097 0.8540 0.9443 0.9914 1.011 1.007
        0.9707 0.8913 0.7733 0.6398 0.5143 0.4081 0.3226 0.2550 0.2017 0.1597 0.1266 0.1004 0.07958
        0.06299 0.04965 0.03872 0.02946 0.02130 0.01414 0.008478 0.004668 0.002442 0.001246
        0.0006293 0.0003164""",
}
# the same standard, Table 1: factor at the reference frequency, rad/s
REFERENCE = {
    "Wk": (100, "0.7718"), "Wd": (100, "0.1261"), "Wb": (100, "0.8126"), "Wc": (100, "0.5145"),
    "We": (100, "0.06287"), "Wj": (100, "1.019"), "Wm": (100, "0.3362"), "Wf": (2.5, "0.3888"),
    "Wh": (500, "0.2020"),
}  # fmt: skip
# ISO 2631-1:1997 Tables 3 and 4, times 1000, at the nominal centres
NOMINAL = """
    0.1 0.125 0.16 0.2 0.25 0.315 0.4 0.5 0.63 0.8 1 1.25 1.6 2 2.5 3.15 4 5 6.3 8 10 12.5
    16 20 25 31.5 40 50 63 80 100 125 160 200 250 315 400
"""
TABLE_3 = {
    "Wk": """31.2 48.6 79.0 121 182 263 352 418 459 477 482 484 494 531 631 804 967 1039 1054 1036
        988 902 768 636 513 405 314 246 186 132 88.7 54.0 28.5 15.2 7.90 3.98 1.95""",
    "Wd": """62.4 97.3 158 243 365 530 713 853 944 992 1011 1008 968 890 776 642 512 409 323 253 212
        161 125 100 80.0 63.2 49.4 38.8 29.5 21.1 14.1 8.63 4.55 2.43 1.26 0.64 0.31""",
    "Wc": """843 929 972 991 1000 1007 1012 1017 1022 1024 1013 974 891 776 647 512 409 325 256 199
        156 118 84.4""",  # from 0.5 Hz
}
# printed otherwise than the formula says: Wd at 10 Hz by 5 %, the others in the last digit
MISPRINTS = {("Wd", "10"): 201.7, ("Wk", "1.25"): 484.55, ("Wk", "16"): 768.7}
# acceptance limits of the magnitude, ISO 8041-1 Tables 4 and 5: k of 10^(k/10) Hz, low, high
CENTRAL, SKIRT = (0.89, 1.12), (0.79, 1.26)
TRANSITIONS = {"Wf": (-13, -9, -4, 0), "Wm": (-3, 1, 18, 22), "Wh": (6, 10, 29, 33)}
WHOLE_BODY = (-6, -2, 18, 22)


def unit_of_last_digit(text):
    """Half of it is what rounding leaves."""
    return 10.0 ** -len(text.partition(".")[2])


def agrees(printed, computed, scale=1.0):
    return abs(scale * computed - float(printed)) <= 0.5000001 * unit_of_last_digit(printed)


@pytest.mark.parametrize("name", ANNEX_B)
def test_factors_of_iso_8041_at_true_centres(name):
    printed = ANNEX_B[name].split()
    assert len(printed) == 37
    got = abs(sd.weighting(name).factor(10.0 ** (np.arange(-10, 27) / 10)))
    wrong = [(p, g) for p, g in zip(printed, got, strict=True) if not agrees(p, g)]
    assert wrong == []


@pytest.mark.parametrize("name", REFERENCE)
def test_factor_at_the_reference_frequency(name):
    omega, printed = REFERENCE[name]
    got = abs(sd.weighting(name).factor(omega / (2 * np.pi)))
    assert agrees(printed, got)


@pytest.mark.parametrize("name", TABLE_3)
def test_factors_of_iso_2631_at_nominal_centres(name):
    printed = TABLE_3[name].split()
    centres = NOMINAL.split()[7:30] if name == "Wc" else NOMINAL.split()
    got = abs(sd.weighting(name).factor([float(f) for f in centres]))
    wrong = {
        (name, f): 1000 * g
        for f, p, g in zip(centres, printed, got, strict=True)
        if not agrees(p, g, 1000.0)
    }
    expected = {key: value for key, value in MISPRINTS.items() if key[0] == name}
    assert wrong.keys() == expected.keys()
    for key, value in expected.items():
        assert wrong[key] == pytest.approx(value, abs=0.06)


def test_limits_of_the_weightings():
    """Gains that the filters have by construction."""
    for weighting in WEIGHTINGS.values():
        assert weighting.factor(0.0) == 0.0
        # without band limits: 1 where only steps are, d.c. gain (f5/f6)^2 K
        z, p, k = weighting.zpk()
        f = np.array([0.3, 3.0, 30.0])
        _, h = signal.freqs_zpk(z, p, k, 2 * np.pi * f)
        np.testing.assert_allclose(weighting.factor(f), h, rtol=1e-9)
    wb = sd.weighting("Wb")
    middle = wb.factor(0.01) / wb.band_limits.factor(0.01)
    assert abs(middle) == pytest.approx(0.400, rel=1e-3)
    # Wm: f3 = f4 and Q = 0.5 make one pole
    wm = sd.weighting("Wm")
    f = np.geomspace(0.1, 100.0, 30)
    one_pole = 1 / (1 + 1j * f * 2 * np.pi * 0.028)
    np.testing.assert_allclose(wm.factor(f) / wm.band_limits.factor(f), one_pole, rtol=1e-12)


def test_every_constant_says_where_it_is_from():
    for weighting in WEIGHTINGS.values():
        assert weighting.clause.startswith(("ISO", "BS"))
        assert isinstance(weighting.grade, Grade)
    assert sd.weighting("Wg").grade is Grade.FOUND


# ---------------------------------------------------------------- in time


@pytest.mark.parametrize("rate", [200.0, 256.0, 500.0, 2000.0])
@pytest.mark.parametrize("name", ["Wk", "Wd", "Wb", "Wc", "Wm"])
def test_gain_of_the_time_signal_up_to_80_hz(name, rate):
    """Measured on sines, amplitude and phase, well inside what acceptance limits allow."""
    weighting = sd.weighting(name)
    t = np.arange(int(24 * rate)) / rate
    middle = (t >= 10.0) & (t < 20.0)
    f = np.array([0.5, 1.0, 4.0, 8.0, 16.0, 31.5, 50.0, 63.0, 80.0])
    weighted = weighting.apply(np.cos(2 * np.pi * f[:, None] * t), rate)[:, middle]
    reference = np.exp(-2j * np.pi * f[:, None] * t[middle])
    got = 2 * np.mean(weighted * reference, axis=-1)
    np.testing.assert_allclose(got, weighting.factor(f), rtol=1e-6)


@pytest.mark.parametrize("name", WEIGHTINGS)
def test_time_signal_stays_within_the_acceptance_limits(name):
    """Broad-band noise through the filter, against the design goal in third octaves."""
    weighting = sd.weighting(name)
    rate = 8000.0 if name == "Wh" else 400.0
    low1, low2, high1, high2 = TRANSITIONS.get(name, WHOLE_BODY)
    n = np.arange(low1 - 3, high2 + 1)
    centres = 10.0 ** (n / 10)
    count = int(rate * 60 / centres[0])
    noise = np.random.default_rng(8041).standard_normal(min(count, 400_000))
    spectrum, weighted = np.fft.rfft(noise), np.fft.rfft(weighting.apply(noise, rate))
    f = np.fft.rfftfreq(noise.size, 1 / rate)
    for k, centre in zip(n, centres, strict=True):
        band = (f >= centre * 10**-0.05) & (f < centre * 10**0.05) & (f < 0.45 * rate)
        if np.count_nonzero(band) < 3:
            continue
        goal = np.sqrt(np.sum(abs(spectrum[band] * weighting.factor(f[band])) ** 2))
        gain = np.sqrt(np.sum(abs(weighted[band]) ** 2)) / goal
        low, high = CENTRAL if low2 <= k <= high1 else SKIRT
        assert (low if low1 <= k <= high2 else 0.0) <= gain <= high, (name, k, gain)


def test_time_signal_is_that_of_the_analogue_filter():
    """A triangle wave that starts at t = 0, against the exact response of a linear system."""
    weighting, rate = sd.weighting("Wk"), 1000.0
    t = np.arange(0.0, 4.0, 1 / rate)
    triangle = signal.sawtooth(2 * np.pi * 3.0 * t + np.pi / 2, 0.5)
    _, exact, _ = signal.lsim(signal.ZerosPolesGain(*weighting.zpk()), triangle, t)
    got = weighting.apply(triangle, rate)
    assert np.max(np.abs(got - exact)) < 2e-3 * np.max(np.abs(exact))


def test_time_signal_starts_from_rest_and_does_not_wrap_around():
    weighting, rate = sd.weighting("Wf"), 50.0
    x = np.zeros(3000)
    x[-500:] = 1.0  # rings long after the record: none of it may come back at the start
    got = weighting.apply(x, rate)
    assert np.max(np.abs(got[:2400])) < 1e-3 * np.max(np.abs(got))
    more = weighting.apply(np.concatenate([x, np.zeros(20_000)]), rate)
    np.testing.assert_allclose(more[: x.size], got, atol=1e-12)


def test_many_channels_at_once():
    x = np.random.default_rng(1).standard_normal((2, 3, 500))
    got = sd.weighting("Wd").apply(x, 200.0)
    assert got.shape == x.shape
    np.testing.assert_allclose(got[1, 2], sd.weighting("Wd").apply(x[1, 2], 200.0), atol=1e-14)


def test_the_bilinear_transform_would_droop():
    """The figure that the docstring names, and why the weighting is applied to the spectrum."""
    weighting = sd.weighting("Wk")
    z, p, k = signal.bilinear_zpk(*weighting.zpk(), 200.0)
    _, h = signal.freqz_zpk(z, p, k, [80.0], fs=200.0)
    assert abs(h[0] / weighting.factor(80.0)) - 1 == pytest.approx(-0.88, abs=0.01)


# ---------------------------------------------------------------- refused

BAD = {
    "unknown weighting": (lambda: sd.weighting("Wl"), "There is no weighting 'Wl'. Did you mean"),
    "negative frequency": (lambda: sd.weighting("Wk").factor(-1.0), "frequency = -1 Hz is not"),
    "infinite frequency": (lambda: sd.weighting("Wk").factor([1.0, math.inf]), "= inf Hz is not"),
    "text": (lambda: sd.weighting("Wk").factor("one"), "must be numbers, in Hz"),
    "NaN": (lambda: sd.weighting("Wk").apply([0.0, math.nan], 100.0), "samples[1] = nan is not"),
    "nothing": (lambda: sd.weighting("Wk").apply([], 100.0), "at least one number"),
    "no rate": (lambda: sd.weighting("Wk").apply([1.0], 0.0), "rate = 0 Hz is not allowed"),
}


@pytest.mark.parametrize("case", BAD)
def test_refused(case):
    call, message = BAD[case]
    with pytest.raises(sd.RequestError) as caught:
        call()
    assert message in str(caught.value)
