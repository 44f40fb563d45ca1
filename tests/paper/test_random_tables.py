"""Tables 9 and 10: the print, the runs behind every ratio, and both against each other."""

import csv
from dataclasses import replace

import numpy as np
import pytest

import seatdyn as sd
from seatdyn.analysis.march import all_outputs
from seatdyn.analysis.random import ratio_interval
from seatdyn.analysis.random_linear import linear_response
from seatdyn.analysis.transient import run_for
from seatdyn.model.excitation import Motion
from seatdyn.model.noise import quintic_segments
from seatdyn.paper.blocks import write_ratios
from seatdyn.paper.cases import PRINTED_ZONE, SLOPE, STATED_RMS, STIFFNESS, paper_system
from seatdyn.paper.misprints import excluded_cells, load_misprints
from seatdyn.paper.random_cases import (
    AS_READ,
    CONSISTENT,
    RANDOM_READINGS,
    SEED,
    RandomCase,
    compute_ratios,
    members,
    row_case,
    step_error,
)
from seatdyn.paper.random_claims import random_claims
from seatdyn.paper.random_tables import RANDOM_TABLES, RATIO_OUTPUTS, printed_ratios
from seatdyn.paper.writing import OutputFolder

LEFT_OUT = {9: 32, 10: 32}


@pytest.mark.parametrize("number", RANDOM_TABLES)
def test_tables_have_the_printed_shape(number):
    table = printed_ratios(number)
    assert table.values.shape == (36, 8)
    assert len(set(table.rows)) == len(set(table.labels)) == 36
    assert {n for _, _, n in table.rows} == {1, 2, 4, 8}
    np.testing.assert_array_equal(table.rounding, 5e-5)
    assert table.values[0, 0] == {9: 0.8643, 10: 0.8907}[number]


@pytest.mark.parametrize("number", RANDOM_TABLES)
def test_every_certain_misprint_is_a_cell_with_this_print(number):
    table = printed_ratios(number)
    certain = [
        m
        for m in load_misprints()
        if m.table == str(number) and m.confidence == "high" and m.column.startswith("T_")
    ]
    assert len(certain) == len(excluded_cells(number)) == table.excluded.sum() == LEFT_OUT[number]
    for misprint in certain:
        i, j = table.labels.index(misprint.row), table.columns.index(misprint.column)
        assert table.values[i, j] == float(misprint.printed)
        assert misprint.basis


def test_copied_groups_are_copied():
    for number in RANDOM_TABLES:
        table = printed_ratios(number)
        copied = table.values[table.labels.index("beta2=40, 2a0")]
        source = table.values[table.labels.index("beta2=10, 2a0")]
        assert np.sum(copied == source) >= 7  # one T_VIS differs in the last digit


def short(reading, **changes):
    return replace(reading, duration=40.0, realisations=16, **changes)


@pytest.mark.parametrize(
    ("label", "element"),
    [
        ("beta1=500, 4a0", sd.QuadraticDamper(500.0)),
        ("beta2=20, 4a0", sd.CoulombFriction(20.0, SLOPE)),
        ("gamma=1000, 4a0", sd.PiecewiseSpring(1000.0, *PRINTED_ZONE)),
    ],
)
def test_a_level_is_the_stated_one_with_lengths_divided(label, element):
    reading = short(CONSISTENT)
    case = row_case(9, printed_ratios(9).labels.index(label), reading)
    scaled = members(case).squares
    noise = replace(reading.noise(False), rms=4 * STATED_RMS)
    system = paper_system(False, element)
    data = sd.random_response(
        system,
        sd.RandomMotion(noise, reading.duration, seed=SEED),
        realisations=16,
        step_tolerance=1e-4,
    )
    level = data["member_rms"].sel(output=list(RATIO_OUTPUTS)).to_numpy()
    np.testing.assert_allclose(np.sqrt(scaled) * 4, level, rtol=2e-3)


def test_ratios_of_a_spring_agree_with_the_frequency_integral():
    reading = replace(CONSISTENT, literal=False, realisations=32)
    row = printed_ratios(9).labels.index("gamma=500, 4a0")
    case = row_case(9, row, reading)
    first, second = (
        linear_response(paper_system(False, stiffness=c), reading.noise(False))
        for c in (STIFFNESS + 500.0, STIFFNESS)
    )
    shared = [name for name in RATIO_OUTPUTS if name in first["output"]]
    assert len(shared) >= 6
    columns = [RATIO_OUTPUTS.index(name) for name in shared]
    exact = (first["rms"] / second["rms"]).sel(output=shared).to_numpy()
    below = members(RandomCase(reading, False)).squares
    above = members(case).squares
    _, low, high = ratio_interval(above, below[: len(above)], 0.999)
    assert np.all((low[columns] < exact) & (exact < high[columns]))
    assert np.all(high - low < 0.02)


class Drifting(sd.RandomMotion):
    """A realisation with the drift added."""

    def lower(self):
        raw = self.realise()
        x, v = raw.displacement + DRIFT * raw.time, raw.velocity + DRIFT
        rows = quintic_segments(raw.step, x, v, raw.acceleration)
        end = np.zeros(6)
        end[0] = x[-1]
        return Motion(raw.time, np.vstack([rows, end]), np.zeros((len(rows) + 1, 3)))


DRIFT = AS_READ.drift(False)


def test_a_run_from_rest_on_a_drifting_base_agrees_with_the_engine():
    row = printed_ratios(9).labels.index("beta1=500, 2a0")
    case = row_case(9, row, replace(AS_READ, realisations=16))
    system = paper_system(False, sd.QuadraticDamper(1000.0))
    motion = Drifting(case.reading.noise(False), 30.0, seed=SEED, member=3, ramp=0.0)
    run = run_for(system, motion, 30.0, initial=np.zeros(6), settings=sd.Settings(rtol=1e-9))
    time = np.arange(0.0, 30.0, 0.01)
    outputs = all_outputs(system, run.at(time))
    expected = [np.sqrt(np.mean(outputs[name] ** 2)) for name in RATIO_OUTPUTS]
    np.testing.assert_allclose(np.sqrt(members(case).squares[3]), expected, rtol=3e-3)


def test_drift_explains_relative_displacements():
    """A few realisations show it: the print lies within 1e-3, without drift a third away."""
    reading = replace(AS_READ, realisations=64)
    for number in RANDOM_TABLES:
        table = printed_ratios(number)
        row = table.labels.index("beta1=500, a0")
        case = row_case(number, row, reading)
        below = members(RandomCase(reading, table.back_on)).squares
        ratio = np.sqrt(members(case).squares.mean(0) / below.mean(0))
        np.testing.assert_allclose(ratio[3:6], table.values[row, 3:6], atol=1e-3)


def test_csv_of_ratios(tmp_path):
    table = printed_ratios(9)
    ratio = np.stack([table.values * 1.1, table.values, table.values * 1.2])
    write_ratios(OutputFolder(tmp_path), table, {"a": ratio})
    with (tmp_path / "tables" / "table09.csv").open(encoding="utf-8", newline="") as file:
        lines = list(csv.DictReader(file))
    assert [line["block"] for line in lines[::36]] == [
        "printed",
        "computed",
        "low",
        "high",
        "deviation",
    ]
    assert float(lines[36]["T_xb1"]) == pytest.approx(1.1 * 0.8643, rel=1e-5)
    assert float(lines[-1]["T_MOD"]) == pytest.approx(0.1)


@pytest.mark.slow
def test_both_tables():
    """What the documentation says of Tables 9 and 10."""
    ratios = {
        number: {reading.name: compute_ratios(number, reading) for reading in RANDOM_READINGS}
        for number in RANDOM_TABLES
    }
    for number, computed in ratios.items():
        table = printed_ratios(number)
        for name, (ratio, low, high) in computed.items():
            assert np.all((low <= ratio) & (ratio <= high)), name
        steady = table.statistics(computed[CONSISTENT.name][0])
        for group in ("acceleration", "force"):
            assert steady[group]["laws"]["beta1"]["rms"] <= 0.012
        read = table.statistics(computed[AS_READ.name][0])
        assert read["relative"]["laws"]["beta1"]["rms"] <= 4e-4
        for reading in RANDOM_READINGS:
            assert step_error(number, reading) < 5e-4
    verdicts = {claim.key: claim.verdict for claim in random_claims(ratios)}
    assert "not confirmed" not in verdicts.values()
