"""ISO 2631-5:2004: the test signal of the standard, and closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import seatdyn as sd
from seatdyn.standards.spinal import compressive_peaks
from seatdyn.standards.spinal_2004 import (
    acceleration_dose,
    equivalent_stress,
    injury_factor,
    spinal_response,
)

OWN = 160.0
# of the standard, with 10 % allowed: largest, smallest, second largest peak
EXPECTED = {"x": (3.025, -4.048, 2.065), "y": (3.025, -4.048, 2.065), "z": (1.661, -1.512, 0.308)}
# what another implementation of the same constants got
OTHER = {"x": (3.025, -4.048, 2.065), "z": (1.651, -1.489, 0.313)}


def shock(rate=OWN):
    t = np.arange(round(2 * rate)) / rate
    return np.interp(t, [0.0, 0.05, 0.2, 0.4, 0.5, 0.55, 2.0], [0, 2, 2, -2, -2, 0, 0])


def extremes(axis, rate=OWN):
    y = spinal_response(shock(rate), rate, axis)
    tops = np.sort(compressive_peaks(y))[::-1]
    return tops[0], y.min(), tops[1]


@pytest.mark.parametrize("axis", EXPECTED)
def test_response_to_the_test_signal(axis):
    np.testing.assert_allclose(extremes(axis), EXPECTED[axis], rtol=0.1)
    if axis in OTHER:
        np.testing.assert_allclose(extremes(axis), OTHER[axis], atol=0.0015)


def test_records_of_another_rate_are_resampled():
    np.testing.assert_allclose(extremes("x", 500.0), EXPECTED["x"], rtol=0.03)


def test_horizontal_filter_is_an_oscillator():
    """2.125 Hz, damping ratio 0.22: displacement-like response 2 zeta w s + w^2 over the same."""
    rate, f0, zeta = OWN, 2.125, 0.22
    y = spinal_response(np.ones(2000), rate, "x")
    assert y[-1] == pytest.approx(1.0, rel=1e-3)
    poles = np.roots([1.0, -1.957115, 0.963949])
    s = np.log(poles[0]) * rate
    assert abs(s) / (2 * np.pi) == pytest.approx(f0, rel=1e-3)
    assert -s.real / abs(s) == pytest.approx(zeta, rel=0.01)


def test_peaks_of_either_sign_count_sideways_only():
    y = np.array([0.0, 2.0, -3.0, 1.0, -1.0])
    assert acceleration_dose(y, "z") == pytest.approx((2.0**6 + 1.0) ** (1 / 6))
    assert acceleration_dose(y, "y") == pytest.approx((2.0**6 + 3.0**6 + 1.0 + 1.0) ** (1 / 6))


def test_stress_and_injury_factor():
    assert equivalent_stress({"z": 10.0}) == pytest.approx(0.32)
    both = equivalent_stress({"x": 32.0, "z": 15.0})
    assert both == pytest.approx(0.48 * 2 ** (1 / 6))
    once = injury_factor(0.5, age=20, years=1, days=1)
    assert once == pytest.approx(0.5 / (6.75 - 0.066 * 20 - 0.25))
    assert injury_factor(0.5, age=20, years=1, days=64) == pytest.approx(2 * once)
    with pytest.raises(sd.RequestError, match="leave the spine no strength"):
        injury_factor(0.5, age=80, years=40, days=240)
    with pytest.raises(sd.RequestError, match="axis 'Z' is not known"):
        spinal_response(np.ones(10), OWN, "Z")
