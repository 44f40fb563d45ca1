"""The printed tables as data, their misprints, and the files they are written to."""

import csv
import json
import os
import stat
from pathlib import Path

import numpy as np
import pytest

from seatdyn.errors import OutputError
from seatdyn.paper.blocks import write_amplitudes, write_linear
from seatdyn.paper.deviations import TARGETS, group_statistics, relative_deviation
from seatdyn.paper.linear_tables import EXCEPTIONS, outside_rounding, table01, table02
from seatdyn.paper.misprints import excluded_cells, load_misprints
from seatdyn.paper.tables import COLUMNS, GROUPS, OUTPUTS, TABLES, group_columns, printed_table
from seatdyn.paper.writing import OutputFolder

EXCLUDED = {
    3: {"gamma=800 F_gamma"},
    4: set(),
    5: {"beta1=100 x1-x", "beta1=600 x2-x", "beta1=700 x1-x"},
    6: {"beta1=50 xb2", "beta1=50 x2"},
    7: set(),
    8: {"beta2=50 x1-x"},
}


@pytest.mark.parametrize("number", TABLES)
def test_tables_have_the_printed_shape(number):
    table = printed_table(number)
    rows = 10 if number in (7, 8) else 12
    assert table.values.shape == (rows, 14)
    assert table.rows[0] == 0.0
    assert np.all(np.diff(table.rows) > 0.0)
    assert table.parameter == {0: "gamma", 1: "beta1", 2: "beta2"}[(number - 3) // 2]
    assert [float(t) for line in table.text for t in line] == table.values.ravel().tolist()


def test_groups_cover_every_column_once():
    places = [c for group in GROUPS for c in group_columns(group)]
    assert sorted(places) == list(range(14))
    assert len(set(OUTPUTS)) == len(COLUMNS) == 14


@pytest.mark.parametrize("number", TABLES)
def test_total_and_spring_force_are_exchanged_in_print(number):
    table = printed_table(number)
    squares = dict(zip(OUTPUTS, (table.values**2).T, strict=True))
    np.testing.assert_allclose(
        squares["F_linear"], squares["F_damper"] + squares["F_spring"], rtol=0.012
    )


@pytest.mark.parametrize("number", TABLES)
def test_certain_misprints_are_single_cells_of_the_table(number):
    table = printed_table(number)
    names = {table.cell(int(i), int(j)) for i, j in np.argwhere(table.excluded)}
    assert names == EXCLUDED[number]
    for (row, column), misprint in excluded_cells(number).items():
        i, j = table.labels.index(row), table.columns.index(column)
        assert float(misprint.printed) == table.values[i, j]
        assert misprint.basis


def test_no_block_of_cells_is_ever_left_out():
    wide = [m for m in load_misprints() if "all" in m.row or ".." in m.row or m.row == "header"]
    assert wide
    assert not any(m.excluded for m in wide)


def test_statistics_of_a_known_deviation():
    table = printed_table(5)
    computed = table.values * 1.01
    computed[3, 0] = table.values[3, 0] * 0.98
    found = group_statistics(table, computed, "acceleration")
    assert found["rms"] == pytest.approx(np.sqrt((35 * 0.01**2 + 0.02**2) / 36))
    assert found["worst"] == pytest.approx(-0.02)
    assert found["worst_cell"] == "beta1=200 xb1"
    assert found["cells"] == 36
    assert found["excluded"] == []


def test_statistics_leave_misprints_out_and_take_zeros_apart():
    table = printed_table(5)
    computed = table.values.copy()
    computed[2, 7] *= 3.0  # beta1=100 x1-x, a certain misprint
    computed[0, 13] = 0.25  # a printed zero
    relative = group_statistics(table, computed, "relative")
    assert relative["rms"] == 0.0
    assert set(relative["excluded"]) == EXCLUDED[5]
    assert relative["cells"] == 33
    force = group_statistics(table, computed, "nonlinear_force")
    assert force["rms"] == 0.0
    assert force["zeros"] == {"cells": ["beta1=0 F_beta1"], "largest": 0.25}
    assert np.isnan(relative_deviation(table.values, computed)[0, 13])


def test_rounding_of_the_print():
    table = printed_table(5)
    assert table.rounding[0, 0] == pytest.approx(0.005)  # 4.23
    assert table.rounding[2, 7] == pytest.approx(0.00005)  # 0.0090
    found = group_statistics(table, table.values, "force")
    assert 1e-4 < found["rounding"] < 1e-3


def test_table_1_agrees_in_every_number():
    cells = table01()
    assert len(cells) == 26
    assert outside_rounding(cells) == []
    counts = {(c.row, c.column): c.computed for c in cells}
    for body in ("back_off", "back_on"):
        assert counts["mass sum", body] == pytest.approx(70.8)
        assert (counts["zeros", body], counts["poles", body]) == (3.0, 4.0)


def test_table_2_is_ours_rounded_but_for_the_two_exceptions():
    cells = table02()
    assert len(cells) == 40
    wrong = outside_rounding(cells)
    assert {(c.row, c.column) for c in wrong} == EXCEPTIONS
    assert {c.printed for c in wrong} == {"-0.84", "21.117"}
    assert [c.computed for c in wrong] == pytest.approx([-0.834894575, 21.117736112], rel=1e-9)


def read(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_csv_has_the_three_blocks(tmp_path):
    table = printed_table(3)
    write_amplitudes(OutputFolder(tmp_path), table, {"a": table.values * 1.5, "b": table.values})
    lines = read(tmp_path / "tables" / "table03.csv")
    assert [line["block"] for line in lines[::12]] == ["printed"] + ["computed", "deviation"] * 2
    assert [line["reading"] for line in lines[::12]] == ["", "a", "a", "b", "b"]
    assert lines[0]["xb1"] == "4.23"
    assert float(lines[12]["xb1"]) == pytest.approx(1.5 * 4.23)
    assert float(lines[24]["xb1"]) == pytest.approx(0.5)
    assert lines[24]["F_gamma"] == ""  # printed zero: no relative deviation


def test_csv_of_a_linear_table(tmp_path):
    write_linear(OutputFolder(tmp_path), "table02", table02(), "model")
    lines = read(tmp_path / "tables" / "table02.csv")
    assert [line["block"] for line in lines[::4]] == ["printed", "computed", "deviation"]
    assert lines[0]["pole3_re_Hz"] == ""  # a body alone has two pairs
    assert float(lines[-1]["pole1_f0_Hz"]) == pytest.approx(0.000736, abs=1e-6)


def test_a_file_in_place_of_the_folder_is_refused(tmp_path):
    (tmp_path / "out").write_text("here already")
    with pytest.raises(OutputError, match=r"out.*Choose a folder"):
        OutputFolder(tmp_path / "out")
    assert (tmp_path / "out").read_text() == "here already"


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="the superuser may write anywhere")
def test_a_read_only_folder_is_refused(tmp_path):
    tmp_path.chmod(stat.S_IRUSR | stat.S_IXUSR)
    try:
        with pytest.raises(OutputError, match="Choose a folder"):
            OutputFolder(tmp_path / "out")
    finally:
        tmp_path.chmod(stat.S_IRWXU)


def test_a_full_disk_leaves_the_older_file_and_says_so(tmp_path, monkeypatch):
    folder = OutputFolder(tmp_path)
    folder.write("summary.json", "old")

    def full(*args, **kwargs):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(OutputError, match=r"summary\.json.*No space left on device"):
        folder.write("summary.json", "new")
    monkeypatch.undo()
    assert (tmp_path / "summary.json").read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["summary.json"]


def test_json_is_strict(tmp_path):
    folder = OutputFolder(tmp_path)
    with pytest.raises(ValueError, match="JSON"):
        folder.write_json("bad.json", {"x": float("nan")})
    folder.write_json("good.json", {"targets": {str(k): list(v) for k, v in TARGETS.items()}})
    assert json.loads((tmp_path / "good.json").read_text())["targets"]["5"]
