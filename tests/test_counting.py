"""Level crossings, peaks, rainflow cycles and contacts."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import seatdyn as sd
from seatdyn.signals.counting import (
    contacts,
    gaussian_contact,
    gaussian_crossings,
    level_crossings,
    peaks,
    probability,
    rainflow,
    turning_points,
)
from seatdyn.signals.synthesis import synthesise_many

# ASTM E1049-85, Figure 6: range, mean and count of every cycle, as printed there
ASTM = [-2, 1, -3, 5, -1, 3, -4, 4, -2]
CYCLES = [
    (3, -0.5, 0.5), (4, -1, 0.5), (4, 1, 1), (8, 1, 0.5), (9, 0.5, 0.5), (8, 0, 0.5), (6, 1, 0.5)
]  # fmt: skip


def test_rainflow_of_the_printed_example():
    cycles = rainflow(ASTM)
    got = sorted(zip(cycles.range, cycles.mean, cycles.weight, strict=True))
    assert got == sorted((float(a), float(b), float(c)) for a, b, c in CYCLES)
    np.testing.assert_allclose(cycles.exceedances([3, 4, 4.5, 9, 9.5]), [4, 3.5, 2, 0.5, 0])
    whole = cycles.weight == 1.0
    assert [ASTM[i] for i in (*cycles.begin[whole], *cycles.end[whole])] == [-1, 3]


def test_points_on_a_slope_and_plateaus_change_nothing():
    fine = np.interp(np.linspace(0, 8, 81), np.arange(9), ASTM)
    np.testing.assert_allclose(rainflow(np.repeat(fine, 2)).range, rainflow(ASTM).range)
    assert turning_points(np.repeat(ASTM, 3)).tolist() == [0, 3, 6, 9, 12, 15, 18, 21, 24]
    assert turning_points([1.0, 1.0]).tolist() == [0]
    assert rainflow([1.0, 1.0]).range.size == 0


@given(arrays(float, st.integers(2, 60), elements=st.integers(-9, 9).map(float)))
def test_rainflow_keeps_the_ways_and_the_largest_range(signal):
    cycles = rainflow(signal)
    # every way up and down is part of exactly one cycle (twice) or half cycle (once)
    total = np.sum(2 * cycles.weight * cycles.range)
    assert total == pytest.approx(np.abs(np.diff(signal)).sum())
    assert cycles.range.max(initial=0.0) == pytest.approx(np.ptp(signal))
    mirrored = rainflow(-signal)
    np.testing.assert_allclose(mirrored.range, cycles.range)
    np.testing.assert_allclose(mirrored.mean, -cycles.mean)


def test_crossings_and_peaks_of_a_sine():
    t = np.linspace(0.0, 10.0, 4001)
    signal = np.sin(2 * np.pi * t)
    counted = level_crossings(signal, [0.5, -0.5, 1.1])
    assert counted.upward.tolist() == [10, 10, 0]
    assert counted.downward.tolist() == [10, 10, 0]
    maxima, minima = peaks(signal, 0.0)
    np.testing.assert_allclose(maxima, 1.0, atol=1e-12)
    assert maxima.size == minima.size == 10
    cycles = rainflow(signal)
    np.testing.assert_allclose(cycles.exceedances([1.9, 0.9]), [9.5, 10.5])
    # a touch is no crossing, a plateau on the level is one
    assert level_crossings([0.0, 1.0, 0.0], [1.0]).upward.tolist() == [0]
    assert level_crossings([0.0, 1.0, 1.0, 2.0], [1.0]).upward.tolist() == [1]


def test_contacts_in_bump_and_rebound():
    t = np.linspace(0.0, 10.0, 100001)
    travel = 0.05 * np.sin(2 * np.pi * t)
    hits = contacts(travel, bump_clearance=0.04, rebound_clearance=0.03)
    assert (hits.bump, hits.rebound) == (10, 10)
    assert hits.bump_share == pytest.approx(math.acos(0.8) / math.pi, rel=1e-3)
    assert hits.rebound_share == pytest.approx(math.acos(0.6) / math.pi, rel=1e-3)
    assert hits.bump_depth == pytest.approx(0.01)
    assert hits.rebound_depth == pytest.approx(0.02)
    none = contacts(travel, bump_clearance=0.06, rebound_clearance=0.06)
    assert none == (0, 0, 0.0, 0.0, 0.0, 0.0)


def test_crossings_of_noise_follow_rice():
    """Counted crossings of 200 records against Rice's formula, of levels up to three sigma."""
    em3, members, seconds = sd.seat_test_input("EM3"), 200, 100.0
    motion = synthesise_many(em3, seconds, seed=6, members=members)
    sigma, rate = em3.displacement_rms(), em3.velocity_rms()
    levels = sigma * np.array([0.0, 1.0, 2.0, 3.0])
    counted = sum(level_crossings(x, levels).upward for x in motion.displacement.T)
    wanted = gaussian_crossings(levels, sigma, rate) * seconds * members
    # crossings repel each other less than they would if independent: 4 Poisson deviations
    assert np.all(np.abs(counted - wanted) < 4 * np.sqrt(wanted))
    assert wanted[-1] > 100


def test_probability_of_contact_of_noise():
    """Share of records that reach a stop, against independent crossings."""
    em3, members, seconds = sd.seat_test_input("EM3"), 400, 60.0
    motion = synthesise_many(em3, seconds, seed=7, members=members)
    sigma, rate = em3.displacement_rms(), em3.velocity_rms()
    stop = 3.6 * sigma
    hits = int(np.sum(np.abs(motion.displacement).max(0) > stop))
    wanted = gaussian_contact(
        seconds, rms=sigma, rate_rms=rate, bump_clearance=stop, rebound_clearance=stop
    )
    found = probability(hits, members)
    assert hits > 50
    # the formula is on the safe side, but not by much: large peaks come in groups
    assert found.low < wanted < 1.5 * found.probability


def test_interval_of_a_probability():
    assert probability(0, 10).high == pytest.approx(1 - 0.025**0.1)
    assert probability(10, 10).low == pytest.approx(0.025**0.1)
    half = probability(5, 10)
    assert (half.low, half.high) == pytest.approx((0.1871, 0.8129), abs=1e-4)
    assert probability(5, 10, confidence=0.5).low > half.low


def test_gaussian_contact_limits():
    asked = {"rms": 0.01, "rate_rms": 0.1, "bump_clearance": 0.02, "rebound_clearance": 0.05}
    short = gaussian_contact(1e-6, **asked)
    assert short == pytest.approx(0.0227501, abs=1e-5)  # already touching: Phi(-2)
    assert gaussian_contact(1e5, **asked) == pytest.approx(1.0)
    moved = gaussian_contact(10.0, **asked, mean=0.02)
    assert moved < gaussian_contact(10.0, **asked)


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda: rainflow([1.0]), "at least 2 samples"),
        (lambda: rainflow([[1.0, 2.0]]), "at least 2 samples in a row"),
        (lambda: rainflow([1.0, math.nan, 2.0]), r"signal\[1\] = nan is not finite"),
        (lambda: rainflow(["a", "b"]), "list of numbers"),
        (lambda: probability(11, 10), "hits = 11"),
        (lambda: gaussian_crossings(0.0, 0.0, 1.0), "rms = 0"),
        (lambda: contacts([0, 1.0], bump_clearance=-1, rebound_clearance=1), "bump_clearance = -1"),
    ],
)
def test_bad_requests_say_what_is_wrong(ask, message):
    with pytest.raises(sd.RequestError, match=message):
        ask()
