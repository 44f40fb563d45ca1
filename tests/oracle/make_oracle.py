"""Regenerate the reference amplitudes of Tables 3-8, each row by two independent methods.

    python make_oracle.py                      all files into data/
    python make_oracle.py table06 table08      files whose name begins so
    python make_oracle.py --compare DIR        also compare with the same readings in DIR
    python make_oracle.py --settle             also settle from rest and from random states

Recorded are the values of the first method (closed form for the jump law, DOP853 with shooting for
the smooth laws); ``solver_rel_diff`` is the largest relative difference of the second one from it
over the 14 columns.  Exit status 1 if any row exceeds the tolerance.
"""

from __future__ import annotations

import argparse
import csv
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import harmonic_balance
import numpy as np
import piecewise_linear
import time_domain
from equations import BASE_ACCELERATION, BODIES, FREQUENCY, OUTPUTS, Array, Case, Law

DATA = Path(__file__).resolve().parent / "data"
TOLERANCE = 1e-8
HARMONICS = {"quadratic": 3000, "coulomb": 8000}
SETTLE_EVERY = 3  # smooth laws: rows 3, 6, 9 ...; settling is slow there
START_OFFSET = 1e-4  # the shooting starts beside the other method's state, not on it

GAMMA = (0, 1, 100, 200, 300, 400, 500, 600, 700, 800, 900, 1000)  # N/m
BETA1 = (0, 50, 100, 200, 300, 400, 500, 600, 700, 800, 900, 1000)  # N s2/m2
BETA2 = (0, 10, 15, 20, 25, 30, 35, 40, 45, 50)  # N
ROWS = {"jump": ("gamma", GAMMA), "quadratic": ("beta1", BETA1), "coulomb": ("beta2", BETA2)}
TABLES = {
    3: ("back_off", "jump"),
    4: ("back_on", "jump"),
    5: ("back_off", "quadratic"),
    6: ("back_on", "quadratic"),
    7: ("back_off", "coulomb"),
    8: ("back_on", "coulomb"),
}


@dataclass(frozen=True)
class Sheet:
    """One CSV file: a table under one reading."""

    table: int
    reading: str
    frequency: float

    @property
    def name(self) -> str:
        """File name without the ending."""
        return f"table{self.table:02d}_{self.reading}"

    def case(self, coefficient: float) -> Case:
        """The case of the row with this coefficient."""
        posture, kind = TABLES[self.table]
        law = Law(kind, coefficient)
        if self.reading == "as_read":
            law = Law(kind, coefficient, lower=-0.01, upper=0.01)
        elif self.reading == "velocity_offset":
            base_velocity = BASE_ACCELERATION / (2 * np.pi * self.frequency)
            law = Law(kind, coefficient, offset=base_velocity)
        return Case(BODIES[posture], self.frequency, law)


def sheets() -> Iterator[Sheet]:
    """All files."""
    for table, (posture, kind) in TABLES.items():
        frequency = FREQUENCY[posture]
        yield Sheet(table, "as_printed", frequency)
        yield Sheet(table, "as_read" if kind == "jump" else "velocity_offset", frequency)
        if posture == "back_on":
            yield Sheet(table, "as_printed_f1579", 1.579)


def relative_difference(first: Array, second: Array) -> float:
    """Largest |first - second| / |first|, columns that are zero in both left out."""
    scale = np.maximum(np.abs(first), np.abs(second))
    keep = scale > 0
    return float(np.max(np.abs(first - second)[keep] / scale[keep]))


def solve_row(
    case: Case, guess: harmonic_balance.Complex | None
) -> tuple[Array, float, float, harmonic_balance.Complex | None]:
    """Amplitudes, difference of the two methods, largest multiplier, guess for the next row."""
    if case.law.kind == "jump":
        values, start, multiplier = piecewise_linear.solve(case)
        second, _, _ = time_domain.solve(case, start + START_OFFSET)
        return values, relative_difference(values, second), multiplier, None
    count = HARMONICS[case.law.kind]
    second, series, start = harmonic_balance.solve(case, count, guess)
    values, _, multiplier = time_domain.solve(case, start + START_OFFSET)
    return values, relative_difference(values, second), multiplier, series


def settling_difference(case: Case, values: Array) -> float:
    """Largest difference from the motion reached from rest and from two random states."""
    settle = piecewise_linear.settle if case.law.kind == "jump" else time_domain.settle
    generator = np.random.default_rng(20)
    size = np.array([0.05, 0.05, 0.05, 0.5, 0.5, 0.5])
    starts = [np.zeros(6), *(size * generator.standard_normal((2, 6)))]
    return max(relative_difference(values, settle(case, start)) for start in starts)


def make_sheet(sheet: Sheet, with_settling: bool) -> float:
    """Compute and write one file; returns the worst difference of the two methods."""
    head, coefficients = ROWS[TABLES[sheet.table][1]]
    lines = [[head, *OUTPUTS, "solver_rel_diff"]]
    worst, guess = 0.0, None
    for index, coefficient in enumerate(coefficients):
        case = sheet.case(float(coefficient))
        values, difference, multiplier, guess = solve_row(case, guess)
        worst = max(worst, difference)
        text = f"{sheet.name} {head}={coefficient}: {difference:.1e}, multiplier {multiplier:.3f}"
        if with_settling and (case.law.kind == "jump" or index % SETTLE_EVERY == 2):
            text += f", settling {settling_difference(case, values):.1e}"
        print(text, flush=True)
        lines.append([str(coefficient), *(f"{v:.12g}" for v in values), f"{difference:.2e}"])
    DATA.mkdir(exist_ok=True)
    with (DATA / f"{sheet.name}.csv").open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(lines)
    return worst


def read_sheet(path: Path) -> dict[float, Array]:
    """Rows of a file: coefficient -> the 14 amplitudes."""
    with path.open() as file:
        rows = list(csv.reader(file))
    if rows[0][1:15] != list(OUTPUTS):
        raise ValueError(f"{path.name}: unexpected columns {rows[0]}")
    return {float(row[0]): np.array([float(cell) for cell in row[1:15]]) for row in rows[1:]}


def compare(sheet: Sheet, directory: Path) -> None:
    """Print the worst difference from the same reading in another directory, if it is there."""
    names = [sheet.name, f"table{sheet.table:02d}_gap_pm010"]
    if sheet.reading == "as_printed":
        names = [f"table{sheet.table:02d}"]
    elif sheet.reading != "as_read":
        names = names[:1]
    ours = read_sheet(DATA / f"{sheet.name}.csv")
    for path in (directory / f"{name}.csv" for name in names):
        if path.exists():
            theirs = read_sheet(path)
            if theirs.keys() != ours.keys():
                raise ValueError(f"{path.name}: other rows")
            worst = max(relative_difference(theirs[key], ours[key]) for key in ours)
            print(f"{sheet.name}: worst difference from {path.name} {worst:.1e}", flush=True)


def main() -> int:
    """Command line."""
    parser = argparse.ArgumentParser(description="Regenerate the oracle's tables.")
    parser.add_argument("names", nargs="*", help="beginnings of file names; all if none")
    parser.add_argument("--compare", type=Path, metavar="DIR")
    parser.add_argument("--settle", action="store_true")
    options = parser.parse_args()
    chosen = [s for s in sheets() if not options.names or s.name.startswith(tuple(options.names))]
    if not chosen:
        parser.error("no such table")
    begin = time.perf_counter()
    overall = 0.0
    for sheet in chosen:
        worst = make_sheet(sheet, options.settle)
        print(f"{sheet.name}: worst solver difference {worst:.1e}", flush=True)
        overall = max(overall, worst)
        if options.compare:
            compare(sheet, options.compare)
    print(f"worst of all {overall:.1e}; {time.perf_counter() - begin:.0f} s")
    return 0 if overall <= TOLERANCE else 1


if __name__ == "__main__":
    raise SystemExit(main())
