"""Metrics against the signal-burst table of ISO 8041-1 and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

import seatdyn as sd
from seatdyn.standards.metrics import (
    AXIS_FACTORS,
    combined_vdv,
    motion_sickness_dose,
    mtvv,
    rms,
    running_rms,
    total_value,
    vdv,
    vomiting_share,
)

# ISO 8041-1:2017, Tables 6 to 8: r.m.s., VDV, MTVV linear, MTVV exponential. 0: no end.
BURSTS = {
    "band": {
        1: (0.0433, 0.498, 0.137, 0.135),
        2: (0.0612, 0.593, 0.193, 0.188),
        4: (0.0865, 0.705, 0.274, 0.258),
        8: (0.122, 0.838, 0.387, 0.344),
        16: (0.173, 0.996, 0.547, 0.437),
        0: (0.546, 1.77, 0.547, 0.549),
    },
    "Wk": {
        1: (0.0299, 0.323, 0.0944, 0.0922),
        2: (0.0411, 0.380, 0.130, 0.125),
        4: (0.0577, 0.455, 0.182, 0.171),
        8: (0.0814, 0.543, 0.257, 0.228),
        16: (0.115, 0.648, 0.363, 0.289),
        0: (0.362, 1.15, 0.364, 0.363),
    },
    "Wd": {
        1: (0.00669, 0.0779, 0.0212, 0.0197),
        2: (0.00906, 0.0852, 0.0286, 0.0264),
        4: (0.0116, 0.0923, 0.0366, 0.0330),
        8: (0.0148, 0.101, 0.0469, 0.0400),
        16: (0.0197, 0.115, 0.0611, 0.0481),
        0: (0.0590, 0.197, 0.0611, 0.0594),
    },
}
RATE = 4000.0
PERIOD = 2 * np.pi / 100  # s


def saw_tooth(cycles):
    """Bursts of 1 m/s2 peak, rising from zero, at 1 s and every 10 s, in a record of 60 s.

    A sample is the mean over its interval, so that jumps between samples are not lost.
    """
    edges = np.arange(round(60 * RATE) + 1) / RATE
    integral = np.zeros(edges.size)
    starts = 1.0 + 10.0 * np.arange(6) if cycles else [0.0]
    for start in starts:
        phase = np.clip((edges - start) / PERIOD, 0.0, cycles or np.inf) % 1.0
        integral += PERIOD * np.where(phase < 0.5, phase**2, (1.0 - phase) ** 2)
    return np.diff(integral) * RATE


@pytest.mark.parametrize("cycles", [1, 2, 4, 8, 16, 0])
def test_signal_bursts_of_iso_8041(cycles):
    burst = saw_tooth(cycles)
    assert np.max(burst) == pytest.approx(1.0, abs=0.02)
    for name, rows in BURSTS.items():
        wk = sd.weighting("Wk")
        weighted = (wk.band_limits if name == "band" else sd.weighting(name)).apply(burst, RATE)
        got = (
            float(rms(weighted)),
            float(vdv(weighted, RATE)),
            float(mtvv(weighted, RATE)),
            float(mtvv(weighted, RATE, kind="exponential")),
        )
        np.testing.assert_allclose(got, rows[cycles], rtol=0.015, err_msg=name)


def test_vdv_of_a_sine_and_of_gaussian_noise():
    t = np.arange(0.0, 100.0, 1e-3)
    sine = sd.metrics(3.0 * np.sin(2 * np.pi * 5 * t), 1000.0)
    assert sine.rms == pytest.approx(3 / math.sqrt(2), rel=1e-9)
    assert sine.vdv_ratio == pytest.approx(1.106682, abs=5e-7)  # 1.5^(1/4)
    assert sine.crest_factor == pytest.approx(math.sqrt(2), rel=1e-9)
    assert sine.mtvv == pytest.approx(sine.rms, rel=1e-9)
    assert sine.evdv == pytest.approx(1.4 * sine.rms * 100**0.25, rel=1e-12)
    assert sine.msdv == pytest.approx(sine.rms * 10.0, rel=1e-9)
    noise = np.random.default_rng(2631).standard_normal(1_000_000)
    gauss = sd.metrics(noise, 1000.0)
    # the fourth moment of n independent samples has the relative deviation sqrt(96/n)/3, its
    # fourth root a quarter of it: 8e-4; three of them are allowed
    assert gauss.vdv_ratio == pytest.approx(1.316074, rel=2.5e-3)  # 3^(1/4)
    assert gauss.reasons == []


def test_running_rms_of_a_step():
    """a = 1 from t = 0: sqrt(t/tau) and sqrt(1 - exp(-t/tau)), after n samples at time n/rate."""
    rate, tau = 200.0, 0.3
    t = np.arange(1, 401) / rate
    linear = running_rms(np.ones(400), rate, tau=tau)
    np.testing.assert_allclose(linear, np.sqrt(np.minimum(t / tau, 1.0)), rtol=1e-12)
    exponential = running_rms(np.ones(400), rate, tau=tau, kind="exponential")
    np.testing.assert_allclose(exponential, np.sqrt(1 - np.exp(-t / tau)), rtol=1e-12)


def test_running_rms_where_the_window_is_no_multiple_of_the_step():
    values = np.arange(1.0, 9.0)
    got = running_rms(values, 1.0, tau=2.5)
    want = math.sqrt((8.0**2 + 7.0**2 + 0.5 * 6.0**2) / 2.5)
    assert got[-1] == pytest.approx(want, rel=1e-12)


def test_running_rms_matches_a_plain_window():
    a = np.random.default_rng(3).standard_normal(1000)
    got = running_rms(a, 100.0)
    want = [math.sqrt(np.sum(a[max(0, i - 99) : i + 1] ** 2) / 100) for i in range(1000)]
    np.testing.assert_allclose(got, want, rtol=1e-10)


def test_a_short_record_has_a_running_value_too():
    assert float(mtvv(np.ones(50), 100.0)) == pytest.approx(math.sqrt(0.5))


def test_doses_add_up_as_they_say():
    a = np.random.default_rng(4).standard_normal(2000)
    first, second = float(vdv(a[:700], 100.0)), float(vdv(a[700:], 100.0))
    assert combined_vdv([first, second]) == pytest.approx(float(vdv(a, 100.0)), rel=1e-12)
    doses = motion_sickness_dose(a[:700], 100.0), motion_sickness_dose(a[700:], 100.0)
    assert math.hypot(*doses) == pytest.approx(float(motion_sickness_dose(a, 100.0)), rel=1e-12)


def test_motion_sickness():
    """Six hours of 0.5 m/s2 at 0.2 Hz."""
    rate = 5.0
    t = np.arange(0.0, 6 * 3600.0, 1 / rate)
    heave = sd.weighting("Wf").apply(0.5 * math.sqrt(2.0) * np.sin(2 * np.pi * 0.2 * t), rate)
    dose = float(motion_sickness_dose(heave, rate))
    assert dose == pytest.approx(
        abs(sd.weighting("Wf").factor(0.2)) * 0.5 * math.sqrt(6 * 3600.0), rel=0.01
    )
    assert vomiting_share(dose) == pytest.approx(dose / 3)
    assert vomiting_share(1e4) == 100.0


def test_total_value():
    values = {"x": 0.3, "y": 0.2, "z": 0.5}
    want = math.sqrt((1.4 * 0.3) ** 2 + (1.4 * 0.2) ** 2 + 0.5**2)
    assert total_value(values) == pytest.approx(want, rel=1e-12)
    assert total_value(values, "comfort seat") == pytest.approx(math.sqrt(0.38), rel=1e-12)
    assert AXIS_FACTORS["comfort rotation"]["y"].unit == "m/rad"
    with pytest.raises(sd.RequestError, match=r"purpose = 'helth' is not known. Did you mean"):
        total_value(values, "helth")
    with pytest.raises(sd.RequestError, match="axis 'w' is not known"):
        total_value({"w": 1.0})


def test_shocks_ask_for_more_than_the_rms():
    a = 0.01 * np.random.default_rng(5).standard_normal(60_000)
    a[30_000:30_020] = 5.0
    m = sd.metrics(a, 1000.0)
    assert m.crest_factor > 9.0
    assert [reason.partition(" = ")[0] for reason in m.reasons] == [
        "crest factor",
        "MTVV / r.m.s.",
        "VDV / (r.m.s. T^1/4)",
    ]


def test_silence_has_no_ratios():
    m = sd.metrics(np.zeros(500), 100.0)
    assert m.rms == m.vdv == m.mtvv == 0.0
    assert math.isnan(m.crest_factor)
    assert m.reasons == []


def test_refused():
    with pytest.raises(sd.RequestError, match="one channel at a time"):
        sd.metrics(np.zeros((2, 5)), 100.0)
    with pytest.raises(sd.RequestError, match="use 'linear' or 'exponential'"):
        running_rms(np.zeros(5), 100.0, kind="quadratic")
    with pytest.raises(sd.RequestError, match=r"tau = 0.001 s is not allowed"):
        running_rms(np.zeros(5), 100.0, tau=1e-3)
