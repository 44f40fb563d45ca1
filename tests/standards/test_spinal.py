"""ISO 2631-5:2018: its worked example, the filter of its Annex D, and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

import seatdyn as sd
from seatdyn.standards.spinal import (
    acceleration_dose,
    compressive_peaks,
    daily_dose,
    spinal_factor,
    spinal_response,
    spinal_risk,
)

# Annex D: the digital filter for 256 Hz
ANNEX_D_B = [
    *(-5.71e-6, 2.001e-5, 1.3739e-3, 1.454192e-2, 2.515231e-2, -1.424205e-2, -4.426284e-2),
    *(-8.88851e-3, 1.771572e-2, 1.021642e-2, 2.03074e-3, 5.598e-5),
]
ANNEX_D_A = [
    *(1.0, -3.3232176, 4.25612615, -1.98041727, -1.48873547, 3.32951129, -2.94907214),
    *(1.65340341, -0.6356778, 0.16751942, -0.02807698, 0.00234873),
]
ANNEX_D_RATE = 256.0


def test_factor():
    assert abs(spinal_factor(0.0)) == 1.0
    assert abs(spinal_factor(5.0)) == pytest.approx(1.543, abs=5e-4)


def test_factor_agrees_with_the_digital_filter_of_annex_d():
    """The standard accepts 0.04 up to 40 Hz and 0.08 up to 80 Hz; they agree to 0.0016."""
    f = np.linspace(0.0, 80.0, 401)
    _, h = signal.freqz(ANNEX_D_B, ANNEX_D_A, f, fs=ANNEX_D_RATE)
    assert np.max(np.abs(np.abs(h) - np.abs(spinal_factor(f)))) < 0.002


@pytest.mark.parametrize("rate", [256.0, 512.0, 1000.0])
def test_response_in_time(rate):
    """Against the recursion of Annex D, run at its own rate on the same shock."""
    t = np.arange(0.0, 4.0, 1 / rate)
    own = np.arange(0.0, 4.0, 1 / ANNEX_D_RATE)

    def shock(at):
        return 10.0 * np.exp(-(((at - 2.0) / 0.03) ** 2)) * np.sin(2 * np.pi * 6.0 * (at - 2.0))

    got = spinal_response(shock(t), rate)
    want = signal.lfilter(ANNEX_D_B, ANNEX_D_A, shock(own))
    scale = np.max(np.abs(want))
    for extreme in (np.max, np.min):
        assert extreme(got) == pytest.approx(extreme(want), abs=0.02 * scale)


def test_mean_is_removed():
    x = np.random.default_rng(5).standard_normal(2000)
    np.testing.assert_allclose(
        spinal_response(x + 9.81, 500.0), spinal_response(x, 500.0), atol=1e-10
    )


def test_peaks_are_one_between_two_zero_crossings():
    a = [1.0, 3.0, 2.0, -1.0, -5.0, 0.0, 2.0, 2.5, 1.0, -0.1, 4.0]
    assert compressive_peaks(a).tolist() == [3.0, 2.5, 4.0]
    assert compressive_peaks([-1.0, 0.0, -2.0]).size == 0
    t = np.arange(0.0, 10.0, 1e-3)
    peaks = compressive_peaks(np.sin(2 * np.pi * 3.0 * t))
    assert peaks.size == 30
    np.testing.assert_allclose(peaks, 1.0, atol=1e-4)


def test_worked_example_male():
    dose = acceleration_dose([40.0] * 5)
    assert dose == pytest.approx(55.97, abs=0.005)
    risk = spinal_risk(dose, sex="male", age=20, years=20, days=120)
    assert risk.injury_factor == pytest.approx(1.22, abs=0.005)
    assert risk.probability == pytest.approx(0.37, abs=0.005)


def test_worked_example_female():
    """S_d 1.40 MPa as printed; R is printed as 0.97, its own formula gives 0.962."""
    risk = spinal_risk(acceleration_dose([40.0] * 5), sex="female", age=20, years=20, days=120)
    assert risk.stress == pytest.approx(1.40, abs=0.005)
    assert risk.injury_factor == pytest.approx(0.962, abs=0.0005)


# injury factor at which the probability is 10, 50, 90 %, as printed
PROBABILITY = {"male": (0.72, 1.42, 2.17), "female": (0.52, 0.87, 1.20)}


@pytest.mark.parametrize("sex", PROBABILITY)
def test_probability(sex):
    """One day a year for one year: R = S_d / (S_u - S_stat)."""
    for printed, wanted in zip(PROBABILITY[sex], (0.1, 0.5, 0.9), strict=True):
        low, high = (_probability(sex, printed + shift) for shift in (-0.006, 0.006))
        assert low < wanted < high


def _probability(sex, factor):
    m, ageing = {"male": (0.029, 0.052), "female": (0.025, 0.039)}[sex]
    dose = factor * (6.75 - ageing * 20 - 9.81 * m) / m
    risk = spinal_risk(dose, sex=sex, age=20, years=1, days=1)
    assert risk.injury_factor == pytest.approx(factor, rel=1e-12)
    return risk.probability


def test_doses_of_a_day():
    assert daily_dose([(30.0, 60.0, 60.0)]) == pytest.approx(30.0)
    assert daily_dose([(30.0, 64 * 60.0, 60.0)]) == pytest.approx(60.0)
    assert daily_dose([(30.0, 1.0, 1.0), (30.0, 1.0, 1.0)]) == pytest.approx(30.0 * 2 ** (1 / 6))


BAD = {
    "sex": ({"sex": "m"}, "use 'male' or 'female'"),
    "age": ({"age": 5}, "age = 5 years is not allowed"),
    "part of a year": ({"years": 2.5}, "give whole years"),
    "no strength left": ({"age": 80, "years": 60}, "leaves the spine no strength"),
    "dose": ({"dose": -1.0}, "dose = -1 m/s2 is not allowed"),
}


@pytest.mark.parametrize("case", BAD)
def test_refused(case):
    change, message = BAD[case]
    request = {"dose": 10.0, "sex": "male", "age": 20, "years": 20, "days": 100} | change
    with pytest.raises(sd.RequestError) as caught:
        spinal_risk(request.pop("dose"), **request)
    assert message in str(caught.value)
