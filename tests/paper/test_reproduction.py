"""Computed tables against the oracle and against the print, and the whole run."""

import json
import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from seatdyn.errors import OutputError, RequestError
from seatdyn.model.excitation import Sine
from seatdyn.paper import cases
from seatdyn.paper.cases import AS_PRINTED, AS_READ, NEAR, compute_table, readings
from seatdyn.paper.deviations import TARGET, TARGETS, table_statistics
from seatdyn.paper.explanations import EXPLANATIONS
from seatdyn.paper.figures import FIGURES
from seatdyn.paper.figures_delay import OWN_FIGURES
from seatdyn.paper.random_cases import RANDOM_READINGS
from seatdyn.paper.random_tables import RANDOM_GROUPS, RANDOM_TABLES
from seatdyn.paper.reproduce import reproduce
from seatdyn.paper.tables import GROUPS, TABLES, group_columns, printed_table

ORACLE = Path(__file__).parents[1] / "oracle" / "data"
NEAR_READ = NEAR[1]
# At 1.58 Hz, a rounded number, these miss the target; at 1.579 Hz they meet it.
ROUNDED_FREQUENCY = {(6, "relative"), (8, "relative")}


@cache
def statistics(number, reading):
    return table_statistics(printed_table(number), compute_table(number, reading))


def oracle(name):
    return np.loadtxt(ORACLE / f"{name}.csv", delimiter=",", skiprows=1)[:, 1:15]


def assert_same(computed, expected):
    """Relative 1e-5, absolute on the column's maximum where the value is zero."""
    scale = np.where(expected == 0.0, np.abs(expected).max(axis=0), np.abs(expected))
    assert np.max(np.abs(computed - expected) / scale) < 1e-5


@pytest.mark.parametrize("number", TABLES)
def test_as_printed_agrees_with_the_oracle(number):
    assert_same(compute_table(number, AS_PRINTED), oracle(f"table{number:02d}_as_printed"))


@pytest.mark.parametrize("number", [4, 6, 8])
def test_as_printed_at_1579_agrees_with_the_oracle(number):
    assert_same(compute_table(number, NEAR[0]), oracle(f"table{number:02d}_as_printed_f1579"))


@pytest.mark.parametrize("number", [3, 4])
def test_read_zone_agrees_with_the_oracle(number):
    assert_same(compute_table(number, AS_READ), oracle(f"table{number:02d}_as_read"))


@pytest.mark.parametrize("number", [7, 8])
def test_offset_agrees_with_the_oracle(number):
    assert_same(compute_table(number, AS_READ), oracle(f"table{number:02d}_velocity_offset"))


def test_table_6_takes_its_motion_from_the_run_with_offset_only():
    computed = compute_table(6, AS_READ)
    motion = group_columns("displacement", "relative")
    rest = group_columns("acceleration", "force", "nonlinear_force")
    assert_same(computed[:, motion], oracle("table06_velocity_offset")[:, motion])
    assert_same(computed[:, rest], oracle("table06_as_printed")[:, rest])


def test_table_5_has_one_reading_only():
    np.testing.assert_array_equal(compute_table(5, AS_READ), compute_table(5, AS_PRINTED))


@pytest.mark.parametrize(("number", "group"), [(n, g) for n, gs in TARGETS.items() for g in gs])
def test_targets(number, group):
    at_rounded = statistics(number, AS_READ)[group]["rms"]
    if (number, group) in ROUNDED_FREQUENCY:
        assert TARGET < at_rounded < 0.004
        assert statistics(number, NEAR_READ)[group]["rms"] < 0.002
    else:
        assert at_rounded <= TARGET


def test_every_group_above_the_target_is_explained():
    above = {
        (number, group)
        for number in TABLES
        for group in GROUPS
        if statistics(number, AS_READ)[group]["rms"] > TARGET
    }
    assert above == set(EXPLANATIONS)


@pytest.mark.parametrize(
    ("status", "residual", "message"),
    [
        ("converged", float("nan"), "energy balance"),
        ("converged", 1e-3, "energy balance"),
        ("no_periodic_response", 0.0, "it wanders"),
    ],
)
def test_what_may_not_be_used_is_never_compared(monkeypatch, status, residual, message):
    attrs = {"status": status, "energy_residual": residual, "message": "it wanders"}
    result = type("Result", (), {"attrs": attrs})()
    monkeypatch.setattr(cases, "steady_state", lambda *args, **kwargs: result)
    with pytest.raises(RequestError, match=message):
        cases.solve(cases.paper_system(False), Sine(1.55, amplitude=1.0))


def test_the_read_zone_repairs_the_acceleration_of_m2():
    wrong = statistics(4, AS_PRINTED)["acceleration"]
    assert wrong["worst_cell"] == "gamma=1000 xb2"
    assert wrong["worst"] == pytest.approx(0.172, abs=0.001)
    assert abs(compute_table(4, AS_READ)[11, 1] / 4.29 - 1.0) < 1e-3


def test_an_unusable_folder_is_refused_before_anything_is_computed(tmp_path):
    (tmp_path / "out").write_text("")
    told = []
    with pytest.raises(OutputError, match="out"):
        reproduce(tmp_path / "out", progress=lambda share, text: told.append(text))
    assert told in ([], ["Tables 1 and 2"])


def test_what_was_finished_stays_when_a_run_is_cut_off(tmp_path):
    def stop(share, text):
        if text.startswith("Table 4"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        reproduce(tmp_path, progress=stop)
    assert {p.name for p in (tmp_path / "tables").iterdir()} == {
        "table01.csv",
        "table02.csv",
        "table03.csv",
        "columns.csv",
    }


@pytest.mark.slow
def test_the_whole_run(tmp_path):
    told = []
    summary = reproduce(tmp_path, progress=lambda share, text: told.append(share))
    assert told == sorted(told)
    assert (told[0], told[-1]) == (0.0, 1.0)

    def refuse(text):
        raise AssertionError(text)

    text = (tmp_path / "summary.json").read_text(encoding="utf-8")
    assert json.loads(text, parse_constant=refuse) == summary
    for number in range(1, 11):
        assert (tmp_path / "tables" / f"table{number:02d}.csv").stat().st_size > 200
    for number in TABLES:
        found = summary[f"table{number:02d}"]
        assert set(found) == {r.name for r in readings(number % 2 == 0)}
        assert all(set(groups) == set(GROUPS) for groups in found.values())
    for number in RANDOM_TABLES:
        found = summary[f"table{number:02d}"]
        assert set(found) == {r.name for r in RANDOM_READINGS}
        assert all(set(groups) == set(RANDOM_GROUPS) for groups in found.values())
    assert [f.number for f in FIGURES] == [2, *range(4, 32)]
    for figure in (*FIGURES, *OWN_FIGURES):
        png = (tmp_path / "figures" / f"{figure.key}.png").read_bytes()
        assert png.startswith(b"\x89PNG")
        assert b"</svg>" in (tmp_path / "figures" / f"{figure.key}.svg").read_bytes()[-20:]
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    links = re.findall(r'(?:src|href)="([^"]*)"', html)
    assert links
    assert all(link.startswith(("data:image/png", "#")) for link in links)
    assert not re.search(r"url\(|@import|<script", html)
    assert html.count("<figure>") == len(FIGURES) + len(OWN_FIGURES)
    assert html.count("Not in print.") == len(OWN_FIGURES)
    for anchor in (link for link in links if link.startswith("#")):
        assert f'id="{anchor[1:]}"' in html
    verdicts = {claim["key"]: claim["verdict"] for claim in summary["claims"]}
    assert "not confirmed" not in verdicts.values()
    assert {key for key, verdict in verdicts.items() if verdict == "open"} == {
        "amplitude",
        "table_5",
        "table_8",
        "piecewise_ratios",
        "coulomb_ratios",
    }
