"""Daily exposure, health guidance, comfort, and limits of acceptance that a user can replace."""

from __future__ import annotations

import math

import pytest

import seatdyn as sd
from seatdyn.standards.exposure import (
    ACTION_VALUES,
    HOUR,
    LIMIT_VALUES,
    against_directive,
    comfort_reaction,
    health_guidance,
    time_to_reach,
)


def test_eight_hours_are_the_reference():
    day = sd.daily_exposure([sd.Task("drive", 8 * HOUR, {"x": 0.5, "y": 0.4, "z": 0.6})])
    assert dict(day.a8) == pytest.approx({"x": 0.7, "y": 0.56, "z": 0.6})
    assert day.largest() == ("x", pytest.approx(0.7))
    assert day.verdict() == "above action value"


def test_tasks_add_up_axis_by_axis():
    tasks = [
        sd.Task("a", 2 * HOUR, {"x": 0.3, "z": 0.8}, {"x": 4.0, "z": 9.0}, measured=600.0),
        sd.Task("b", 4 * HOUR, {"x": 0.6, "z": 0.5}, {"x": 5.0, "z": 6.0}, measured=1200.0),
    ]
    day = sd.daily_exposure(tasks)
    assert day.a8["x"] == pytest.approx(1.4 * math.sqrt((0.09 * 2 + 0.36 * 4) / 8))
    assert day.a8["z"] == pytest.approx(math.sqrt((0.64 * 2 + 0.25 * 4) / 8))
    assert day.vdv["x"] == pytest.approx(1.4 * (4.0**4 * 12 + 5.0**4 * 12) ** 0.25)
    assert day.vdv["z"] == pytest.approx((9.0**4 * 12 + 6.0**4 * 12) ** 0.25)
    assert day.largest("vdv")[0] == "z"
    # halving a task in two changes nothing
    halves = [sd.Task("a", HOUR, t.rms, t.vdv, t.measured) for t in (tasks[0], tasks[0])]
    assert sd.daily_exposure([*halves, tasks[1]]).a8 == pytest.approx(day.a8)


@pytest.mark.parametrize(("axis", "k"), [("x", 1.4), ("z", 1.0)])
def test_time_to_reach_leads_to_the_threshold(axis, k):
    limit = LIMIT_VALUES["a8"].value
    t = time_to_reach(0.9, axis, limit)
    assert k * 0.9 * math.sqrt(t / (8 * HOUR)) == pytest.approx(limit)
    dose = time_to_reach(6.0, axis, ACTION_VALUES["vdv"].value, measure="vdv", measured=900.0)
    assert k * 6.0 * (dose / 900.0) ** 0.25 == pytest.approx(9.1)
    assert time_to_reach(0.0, axis, limit) == math.inf


def test_values_of_the_directive():
    assert [float(v) for v in ACTION_VALUES.values()] == [0.5, 9.1]
    assert [float(v) for v in LIMIT_VALUES.values()] == [1.15, 21.0]
    assert against_directive(0.5) == "below action value"
    assert against_directive(1.15) == "above action value"
    assert against_directive(1.16) == "above limit value"
    assert against_directive(9.2, "vdv") == "above action value"


def test_guidance_zones_at_eight_hours():
    """0.43 and 0.87 m/s2 by (B.1); by (B.2) 0.466 and 0.932 m/s2 lie on the ends."""
    zones = health_guidance(0.6, 8 * HOUR)
    assert zones["rms"].low == pytest.approx(0.43, abs=0.005)
    assert zones["rms"].high == pytest.approx(0.87, abs=0.005)
    assert [zones["vdv"].low, zones["vdv"].high] == [8.5, 17.0]
    for a, end in ((0.466, 8.5), (0.932, 17.0)):
        assert health_guidance(a, 8 * HOUR)["vdv"].value == pytest.approx(end, abs=0.01)
    assert [health_guidance(a, 8 * HOUR)["rms"].zone for a in (0.4, 0.6, 0.9)] == [
        *("below", "caution", "above")
    ]


def test_guidance_zone_is_flat_for_ten_minutes():
    assert health_guidance(1.0, 60.0)["rms"].high == health_guidance(1.0, 600.0)["rms"].high == 6.0
    # (B.1): a^2 T is the same along an end of the zone
    ends = [health_guidance(1.0, h * HOUR)["rms"].low ** 2 * h for h in (1, 4, 8)]
    assert ends == pytest.approx([ends[0]] * 3)


def test_comfort_bands_overlap():
    assert comfort_reaction(0.1) == ["not uncomfortable"]
    assert comfort_reaction(0.55) == ["a little uncomfortable", "fairly uncomfortable"]
    assert comfort_reaction(0.7) == ["fairly uncomfortable"]
    assert comfort_reaction(2.2) == ["very uncomfortable", "extremely uncomfortable"]
    assert comfort_reaction(30.0) == ["extremely uncomfortable"]


def test_limits_of_acceptance_are_marked_unverified():
    limits = sd.acceptance_limits()
    assert list(limits) == [f"EM{i}" for i in range(1, 10)]
    assert not any(limit.verified for limit in limits.values())
    assert all("uncertain" in limit.grade for limit in limits.values())
    assert limits["EM3"].seat_factor == 1.0


def test_limits_of_a_user(tmp_path):
    own = tmp_path / "own.toml"
    head = 'source = "my copy"\ngrade = "read"\nverified = true\n'
    own.write_text(f'{head}[classes.EM3]\nmachines = "loader"\nseat_factor = 0.9\nresonance = 2\n')
    limit = sd.acceptance_limits(own)["EM3"]
    assert (limit.seat_factor, limit.resonance, limit.verified) == (0.9, 2.0, True)
    own.write_text(f'{head}[classes.EM3]\nmachines = "loader"\nseat_factor = 0.9\n')
    with pytest.raises(sd.RequestError, match="the field 'resonance' is missing"):
        sd.acceptance_limits(own)
    own.write_text("verified = maybe")
    with pytest.raises(sd.RequestError, match="is not valid TOML"):
        sd.acceptance_limits(own)
    with pytest.raises(sd.RequestError, match="cannot be read"):
        sd.acceptance_limits(tmp_path / "nothing.toml")


BAD = {
    "more than a day": (
        lambda: sd.daily_exposure([sd.Task("a", 13 * HOUR, {"z": 1.0})] * 2),
        "2 tasks of together 26 h",
    ),
    "no task": (lambda: sd.daily_exposure([]), "needs one task or more"),
    "hours for seconds is fine, days are not": (
        lambda: sd.Task("a", 1e6, {"z": 1.0}),
        "Task('a').exposure = 1e+06 s is not allowed; it must be a number in 0 .. 86400 s.",
    ),
    "unknown axis": (lambda: sd.Task("a", 60.0, {"Z": 1.0}), "axis 'Z' is not known; use x, y, z"),
    "negative": (lambda: sd.Task("a", 60.0, {"z": -1.0}), "Task('a').rms['z'] = -1 m/s2 is not"),
    "dose of what": (lambda: sd.Task("a", 60.0, {"z": 1.0}, {"z": 2.0}), "needs `measured`"),
    "different axes": (
        lambda: sd.daily_exposure(
            [sd.Task("a", 60.0, {"z": 1.0}), sd.Task("b", 60.0, {"x": 1.0, "z": 1.0})]
        ),
        "the same axes of all tasks",
    ),
    "time of an unknown axis": (lambda: time_to_reach(1.0, "Z", 0.5), "axis 'Z' is not known"),
    "no dose": (
        lambda: sd.daily_exposure([sd.Task("a", 60.0, {"z": 1.0})]).largest("vdv"),
        "give the tasks a `vdv`",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_refused(case):
    call, message = BAD[case]
    with pytest.raises(sd.RequestError) as caught:
        call()
    assert message in str(caught.value)
