"""Base motions: consistent derivatives, no drift, clear refusals."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

import seatdyn as sd

RNG = np.random.default_rng(5)
MOTIONS = {
    "sine": (sd.Sine(1.55, amplitude=0.9, phase=0.3), 4.0),
    "rms": (sd.Sine(1.55, rms=0.686), 4.0),
    "sum": (sd.SineSum([sd.Sine(1.5, 0.5), sd.Sine(4.0, 1.0)]), 4.0),
    "step": (sd.Step(0.05, 0.3, 0.2), 1.0),
    "shock": (sd.HalfSineShock(50.0, 0.01), 0.3),
    "linear sweep": (sd.Sweep(0.8, 8.0, 8.0, amplitude=1.0), 9.0),
    "logarithmic sweep": (sd.Sweep(8.0, 0.8, 8.0, rms=0.7, spacing="logarithmic"), 11.0),
    "record": (sd.Record(np.sin(np.linspace(0, 40, 400)) * 0.5, rate=50.0), 7.98),
    "still": (sd.Still(), 1.0),
}
ENDING = ("shock", "linear sweep", "logarithmic sweep", "record")


@pytest.mark.parametrize("name", MOTIONS)
def test_velocity_and_displacement_are_integrals_of_the_acceleration(name):
    motion, length = MOTIONS[name]
    t = np.linspace(0.0, length, 200001)[:-1]  # a record ends with a jump to rest
    x, v, a = motion.displacement(t), motion.velocity(t), motion.acceleration(t)
    size = max(np.abs(v).max(), 1e-12)
    assert np.abs(cumulative_simpson(a, x=t, initial=0) + v[0] - v).max() < 1e-7 * size + 1e-10
    assert np.abs(cumulative_simpson(v, x=t, initial=0) + x[0] - x).max() < 1e-8 * size + 1e-10


@pytest.mark.parametrize("name", ENDING)
def test_motions_that_end_leave_no_velocity_and_no_displacement(name):
    motion, length = MOTIONS[name]
    assert abs(float(motion.velocity(length))) < 1e-12
    assert abs(float(motion.displacement(length))) < 1e-12


def test_levels():
    t = np.linspace(0.0, 1 / 1.55, 100001)
    rms = sd.Sine(1.55, rms=0.686)
    assert math.sqrt(np.mean(rms.acceleration(t[:-1]) ** 2)) == pytest.approx(0.686, rel=1e-9)
    peak = sd.Sine(1.55, amplitude=0.8857)
    assert peak.acceleration(t).max() == pytest.approx(0.8857, rel=1e-8)
    assert sd.Sine(2.0, 1.0, phase=0.4).acceleration(0.0) == pytest.approx(math.sin(0.4))


def test_sweep_has_its_amplitude_and_frequency():
    sweep = sd.Sweep(0.8, 8.0, 8.0, amplitude=1.3)
    t = np.linspace(0.0, 8.0, 400001)
    a = sweep.acceleration(t)
    assert a.max() == pytest.approx(1.3, rel=1e-4)
    crossings = t[1:][(a[1:] > 0) & (a[:-1] <= 0)]
    late = crossings[-2:]
    assert 1 / np.diff(late)[0] == pytest.approx(sweep.frequency(late.mean()), rel=2e-3)
    # nothing but oscillation: the mean of a few periods is small against the amplitude
    x = sweep.displacement(t)
    assert abs(x[t < 4.0].mean()) < 0.05 * np.abs(x).max()


def test_sweep_of_one_frequency_is_the_sine():
    t = np.linspace(0.0, 10.0, 1001)
    sweep = sd.Sweep(1.5, 1.5, 10.0, amplitude=1.0)
    np.testing.assert_allclose(sweep.displacement(t), sd.Sine(1.5, 1.0).displacement(t), atol=1e-8)


def test_uncompensated_shock_warns_and_keeps_its_velocity():
    with pytest.warns(sd.DriftWarning, match="velocity"):
        shock = sd.HalfSineShock(50.0, 0.01, residual="keep")
    assert float(shock.velocity(1.0)) == pytest.approx(2 * 50.0 * 0.01 / math.pi)
    assert shock.notes["residual_velocity_m_per_s"] == pytest.approx(0.3183, rel=1e-3)


def test_compensation_is_reported():
    assert sd.HalfSineShock(50.0, 0.01).notes["compensating_acceleration_m_per_s2"] == -5.0
    record = sd.Record(RNG.normal(size=300) + 0.2, rate=100.0)
    assert abs(record.notes["mean_removed_m_per_s2"] - 0.2) < 0.2
    assert record.notes["compensating_acceleration_m_per_s2"] > 0.0


def test_uncompensated_record_warns():
    with pytest.warns(sd.DriftWarning, match="ends with"):
        sd.Record(np.ones(100), rate=100.0, mean="keep", drift="keep")


def test_record_passes_through_its_samples():
    samples = RNG.normal(size=200)
    record = sd.Record(samples, rate=100.0, mean="keep")
    added = record.acceleration(np.arange(200) / 100.0) - samples
    assert np.abs(added[:-1]).max() <= record.notes["compensating_acceleration_m_per_s2"] * 1.0001


def test_record_with_a_gap_is_refused():
    time = np.arange(100) / 50.0
    time[60:] += 0.5
    with pytest.raises(sd.ExcitationError, match=r"gap after sample 59 \(t = 1\.18 s\)"):
        sd.Record(np.zeros(100), time=time)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: sd.Record(np.zeros(3), rate=10.0), "3 samples"),
        (lambda: sd.Record([0.0] * 9 + [math.nan], rate=10.0), r"samples\[9\] = nan"),
        (lambda: sd.Record(np.zeros(20)), "exactly one of rate"),
        (lambda: sd.Record(np.zeros(20), rate=-1.0), "rate"),
        (lambda: sd.Record(np.zeros(20), rate=10.0, high_pass=6.0), "half the sampling rate"),
        (lambda: sd.Record(np.zeros(20), rate=10.0, mean="zero"), "mean"),
        (lambda: sd.Record(["a"] * 10, rate=100), r"samples = \['a', .* list of numbers"),
        (lambda: sd.Record(np.zeros(10), time=["a"] * 10), r"time = \['a', .* list of numbers"),
        (lambda: sd.Record(np.ones(10), rate=1e-300), r"rate = 1e-300 Hz .* 0\.001 \.\. 1e\+07 Hz"),
        (lambda: sd.Record(np.ones(10), rate=1e8), r"rate = 1e\+08 Hz"),
        (lambda: sd.Record(np.full(10, 1e300), rate=1.0), r"samples\[0\] = 1e\+300 m/s2"),
        (lambda: sd.Record(np.ones(10), rate=1.0, high_pass=1e-9), r"1e-06 \.\. 0\.49 Hz"),
        (lambda: sd.Sine(0.0, amplitude=1.0), "frequency = 0 Hz"),
        (lambda: sd.Sine(1e-200, amplitude=1.0), r"1e-200 Hz .* 0\.0001 \.\. 100000 Hz"),
        (lambda: sd.Sine(1e300, amplitude=1.0), r"1e\+300 Hz .* 0\.0001 \.\. 100000 Hz"),
        (lambda: sd.Sine(1.0, amplitude=1e300), r"amplitude = 1e\+300 m/s2"),
        (lambda: sd.Sine(1.0, amplitude=1.0, phase=1e300), "phase"),
        (lambda: sd.Sine(-1.0, amplitude=1.0), "frequency = -1 Hz"),
        (lambda: sd.Sine(1.0), "neither was given; pass one"),
        (lambda: sd.Sine(1.0, amplitude=1.0, rms=1.0), "both were given; pass one of them"),
        (lambda: sd.Sine(1.0, amplitude=math.inf), "amplitude = inf"),
        (lambda: sd.Sine("fast", amplitude=1.0), "not a number"),
        (lambda: sd.SineSum([]), "at least one Sine"),
        (lambda: sd.SineSum(sd.Sine(1.0, 1.0)), "parts = Sine.* list of at least one Sine"),
        (lambda: sd.SineSum(3), "parts = 3 .* list of at least one Sine"),
        (lambda: sd.HalfSineShock(10.0, 0.0), "duration = 0"),
        (lambda: sd.HalfSineShock(1e300, 0.01), r"amplitude = 1e\+300"),
        (lambda: sd.HalfSineShock(10.0, 0.01, spread=1e-300), "spread"),
        (lambda: sd.HalfSineShock(10.0, 0.01, start=1e300), "start"),
        (lambda: sd.HalfSineShock(10.0, 0.01, start=0.01), "compensating pulse"),
        (lambda: sd.Step(0.1, -1.0), "duration = -1"),
        (lambda: sd.Step(1e300, 1.0), r"height = 1e\+300 m"),
        (lambda: sd.Step(0.1, 1e-200), "duration = 1e-200 s"),
        (lambda: sd.Sweep(1.0, 2.0, 3.0), "neither"),
        (lambda: sd.Sweep(1e-200, 2.0, 3.0, 1.0), "begin = 1e-200 Hz"),
        (lambda: sd.Sweep(1.0, 1e300, 3.0, 1.0), r"end = 1e\+300 Hz"),
        (
            lambda: sd.Sweep(0.5, 20.0, 1e7, amplitude=1.0),
            r"1e\+07 s up to 20 Hz needs 2e\+10 segments; at most 5e\+06 .* 2500 s\. Shorten",
        ),
        (lambda: sd.Sweep(1.0, 2.0, 3.0, 1.0, spacing="cubic"), "spacing"),
    ],
)
def test_bad_motions_say_what_is_wrong(make, message):
    with pytest.raises(sd.ExcitationError, match=message):
        make()


@pytest.mark.parametrize(
    ("frequencies", "period"),
    [
        ((1.5, 4.0), 2.0),
        ((1.0, 1.001), 1000.0),
        ((1.0, 998 / 997, 992 / 991), None),  # they meet again after 988027 s
        ((1.0, 2**0.5), None),
    ],
)
def test_common_period(frequencies, period):
    total = sd.SineSum([sd.Sine(f, amplitude=1.0) for f in frequencies])
    assert total.period == (period if period is None else pytest.approx(period))


@pytest.mark.parametrize(
    "motion",
    [
        sd.Sine(1e-4, amplitude=1e6),
        sd.Sine(1e5, amplitude=1.0),
        sd.Step(1e3, 1e-6, 1e9),
        sd.HalfSineShock(1e6, 1e3, spread=1e6),
        sd.HalfSineShock(1e6, 1e-6, spread=1e-3),
        sd.Sweep(1e-4, 1e5, 1e-6, amplitude=1e6),
        sd.Sweep(1.0, 1.0, 1e-6, amplitude=1.0),
        sd.Record(np.sin(np.arange(8)) * 1e6, rate=1e-3),
        sd.Record(np.sin(np.arange(8)), rate=1e7, high_pass=10.0),
    ],
    ids=lambda motion: type(motion).__name__,
)
def test_the_limits_of_motions_are_usable(motion):
    for derivative in range(3):
        values = motion.motion.evaluate(np.linspace(0.0, 1.0, 50), derivative)
        assert np.isfinite(values).all()


def test_records_are_told_apart():
    samples = RNG.normal(size=50)
    record, same = sd.Record(samples, rate=10.0), sd.Record(list(samples), rate=10.0)
    other = sd.Record(np.append(samples[:-1], 0.0), rate=10.0)
    assert record == record
    assert record != other
    assert len({record, record, other}) == 2
    assert repr(record) == repr(same)
    assert repr(record) != repr(other)
    assert repr(record).startswith("Record(50 samples, rate=10.0, mean='remove'")
    assert len(record.digest) == 64
    assert record.digest in repr(record)
    samples[0] += 1.0  # the record keeps what it was given
    assert record.samples[0] == same.samples[0]


def test_read_record(tmp_path):
    file = tmp_path / "floor.csv"
    rows = [f"{i / 50},{0.1 * math.sin(i)},{i}" for i in range(50)]
    file.write_text("time,floor,count\n" + "\n".join(rows) + "\n", encoding="utf-8")
    record = sd.read_record(file, "floor", unit="g")
    assert record.rate == pytest.approx(50.0)
    assert max(record.samples) == pytest.approx(0.1 * 9.80665, rel=1e-2)
    with pytest.raises(sd.ExcitationError, match=r"no column 'flor'.*'floor'"):
        sd.read_record(file, "flor")
    with pytest.raises(sd.ExcitationError, match="does not exist"):
        sd.read_record(tmp_path / "nothing.csv", "floor")
    empty = tmp_path / "empty.csv"
    empty.write_text("time,floor\n", encoding="utf-8")
    with pytest.raises(sd.ExcitationError, match="no samples"):
        sd.read_record(empty, "floor")
    broken = tmp_path / "broken.csv"
    broken.write_text("time,floor\n0.0,1.0\n0.1,much\n", encoding="utf-8")
    with pytest.raises(sd.ExcitationError, match=r"line 3, column 'floor': 'much' is not a number"):
        sd.read_record(broken, "floor")
