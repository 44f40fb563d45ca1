"""What does a realisation of 600 s at 1 kHz cost, and what with SciPy at equal error?

The paper's seat with its back-off body (three masses) is shaken by EM3. Ours: sixteen realisations
side by side, generation of the input and integration timed apart. Means and mean squares of all 19
outputs are gathered, extremes and fourth powers of two or of all; at 1 kHz or finer, or at instants
at most 10 ms apart with the steps that `random_response` chooses. SciPy: RK45 over the same record,
a quintic polynomial between its nodes, in plain Python floats; travel at the same instants; the
cheapest tolerance whose travel is as near to the reference as ours (r.m.s. of the difference over
r.m.s.). It runs over a tenth of the record, and its time is scaled up. One thread, warm, processor
time, best of the rounds.

The machine's limit is the time that all products would take at the rate of a large matrix product
(OpenBLAS, measured in the same run); laws, memory and bookkeeping come on top.

    python benchmarks/random_response.py [--json FILE] [--rows FILE] [--repeat N] [--seconds S]
"""

from __future__ import annotations

import argparse
import json
import math
import os
import time
from functools import cache
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import numpy as np
from rows import Row, write
from scipy.fft import irfft, next_fast_len
from scipy.integrate import solve_ivp

import seatdyn as sd
from seatdyn.analysis.ensemble import LONGEST_STEP, Ensemble, choose_steps
from seatdyn.kernels.lanes import LANES
from seatdyn.model.noise import quintic_segments
from seatdyn.signals.synthesis import Synthesis

EM3, SEED = sd.seat_test_input("EM3"), 1
# spacing in s, and the outputs whose extremes are gathered (None: all)
GATHERED = {
    "at 1 kHz": (1e-3, ("seat-base", "acc_seat")),
    "at 1 kHz, all extremes": (1e-3, None),
    "as chosen": (LONGEST_STEP, None),
}
TARGET, SHARE_TARGET = 300.0, 2.0  # RK45 over ours; generation over integration, and reverse
SHARE = 0.1  # of the record that SciPy runs over
TOLERANCES = [10.0**-e for e in np.arange(2, 12, 0.5)]
FINER = 8  # steps of the reference in one of ours
K, C = 9950.0, 260.0


def stops_and_friction(d, v):
    """Coulomb friction of 30 N, and stops of a 3/2 power after 40 mm."""
    force = 30.0 * 2 / math.pi * math.atan(1000.0 * v)
    if d > 0.04:
        force += 1e6 * (d - 0.04) ** 1.5 * max(0.0, 1 + 0.5 * v)
    elif d < -0.04:
        force -= 1e6 * (-0.04 - d) ** 1.5 * max(0.0, 1 - 0.5 * v)
    return force


CASES = {
    "quadratic 300": ((sd.QuadraticDamper(300.0),), lambda d, v: 300.0 * abs(v) * v),
    "stops and friction": (
        (sd.CoulombFriction(30.0, slope=1000.0), sd.ContactStop(1e6, 0.04, 0.04, damping=0.5)),
        stops_and_friction,
    ),
}


def clock(function, *args):
    """Result and processor time in s."""
    start = time.process_time()
    result = function(*args)
    return result, time.process_time() - start


def best(repeat, function, *args):
    """Least processor time of some calls."""
    return min(clock(function, *args)[1] for _ in range(repeat))


def paper_system(*elements):
    """The paper's seat with further elements."""
    seat = sd.Seat(35.0, [sd.Spring(K), sd.Damper(C), *elements])
    return sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat)


def ours(system, gathered, seconds, repeat):
    """Times in s for a realisation, and the travel of the first part with its relative error."""
    spacing, peaks = GATHERED[gathered]
    synthesis = Synthesis(EM3, seconds)
    wanted, _ = choose_steps(system, synthesis, SEED, 1e-3)
    ensemble = Ensemble.make(system, synthesis, 0, SEED, wanted, spacing=spacing, peaks=peaks)
    records = ensemble.base(0)
    row = {
        "gathered": gathered,
        "generation_ms": 1e3 * best(repeat, ensemble.base, 0) / LANES,
        "integration_ms": 1e3 * best(repeat, ensemble.respond, *records, (), 0) / LANES,
        "limit_ms": 1e3 * products(ensemble) / product_rate(),
        "step_ms": 1e3 * synthesis.step / ensemble.steps,
    }
    nodes = round(SHARE * synthesis.intervals) + 1
    steps = ensemble.steps
    fine = Ensemble.make(system, synthesis, 0, SEED, FINER * steps, spacing=ensemble.spacing)
    kept = ("seat-base",)
    travel = ensemble.run(0, kept, nodes=nodes).series[0, 0]
    reference = fine.run(0, kept, nodes=nodes).series[0, 0]
    row["error"] = relative(travel, reference)
    return row, ensemble, nodes, reference


def products(ensemble):
    """Multiplications with addition of a realisation, those of the laws left out."""
    march = ensemble.march
    step = (march.across, march.second, march.third, march.fourth, march.step)
    instants, sources, _ = ensemble.outputs.shape
    gather = sources * (sources + 1) / 2 + instants * sources * len(ensemble.peaks)
    steps = march.base.size + ensemble.steps * sum(matrix.size for matrix in step)
    return ensemble.synthesis.intervals * (steps + gather * ensemble.steps / ensemble.every)


@cache
def product_rate(size=512):
    """Multiplications with addition that the machine does in a second, one thread."""
    matrix = np.random.default_rng(SEED).standard_normal((size, size))
    return size**3 / best(10, np.matmul, matrix, matrix)


def relative(values, reference):
    """R.m.s. of the difference over r.m.s."""
    return float(np.sqrt(np.mean((values - reference) ** 2) / np.mean(reference**2)))


def right_hand_side(law, step, rows):
    """Equations of the back-off body on the seat, base from quintic polynomials."""
    m1, k1, a1 = 9.1, 11972.5557, 3251.9783
    m2, k2, a2 = 61.7, 22456.7485, 519.0440
    k11, k12, k13, k14 = 97323.2354, -2226.0653, -1960.5176, 1164.3525
    last = len(rows) - 1

    def rhs(t, y):
        x, x1, x2, v, v1, v2 = y.tolist()
        i = min(int(t / step), last)
        s = t - i * step
        c0, c1, c2, c3, c4, c5 = rows[i]
        base = c0 + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5))))
        base_v = c1 + s * (2 * c2 + s * (3 * c3 + s * (4 * c4 + s * 5 * c5)))
        d, w = x - base, v - base_v
        e1, w1, e2, w2 = x1 - x, v1 - v, x2 - x, v2 - v
        active = -k11 * e1 - k12 * w1 - k13 * (x2 + x) - k14 * (v2 + v)
        f1, f2 = k1 * e1 + a1 * w1, k2 * e2 + a2 * w2
        seat = (f1 + f2 - K * d - C * w - law(d, w)) / 35.0
        return (v, v1, v2, seat, (active - f1) / m1, (-active - f2) / m2)

    return rhs


def scipy_travel(law, ensemble, nodes, count):
    """A function of the tolerance that gives the travel of the first realisation."""
    x, v, a = (part[0, :nodes] for part in ensemble.base(0))
    step = ensemble.synthesis.step
    rows = quintic_segments(step, x, v, a)
    rhs = right_hand_side(law, step, [tuple(row) for row in rows.tolist()])
    grid = ensemble.spacing * np.arange(count)
    node = np.minimum((grid / step).astype(int), len(rows) - 1)
    base = sum(rows[node, k] * (grid - node * step) ** k for k in range(6))
    start = np.array([x[0]] * 3 + [v[0]] * 3)

    def travel(tolerance):
        solution = solve_ivp(
            rhs, (0.0, grid[-1]), start, "RK45", grid, rtol=tolerance, atol=1e-3 * tolerance
        )
        return solution.y[0] - base

    return travel


def measure(name, seconds, repeat):
    """Rows of one system with a law, one for each way to gather."""
    elements, law = CASES[name]
    system = paper_system(*elements)
    found = {}
    for gathered in GATHERED:
        row, ensemble, nodes, reference = ours(system, gathered, seconds, repeat)
        if ensemble.spacing not in found:
            found[ensemble.spacing] = peer(law, ensemble, nodes, reference, row["error"], repeat)
        row |= {"case": name, **found[ensemble.spacing]}
        row["ratio"] = 1e3 * row["scipy_s"] / (row["generation_ms"] + row["integration_ms"])
        yield row


def peer(law, ensemble, nodes, reference, error, repeat):
    """Time and error of the cheapest tolerance of SciPy that is as near to the reference."""
    travel_at = scipy_travel(law, ensemble, nodes, reference.size)
    for tolerance in TOLERANCES:
        found = relative(travel_at(tolerance), reference)
        if found <= error:
            break
    return {
        "scipy_rtol": tolerance,
        "scipy_error": found,
        "scipy_s": best(repeat, travel_at, tolerance) / SHARE,
        "equal": found <= error,
    }


def verdict(good):
    """A word for a target."""
    return "pass" if good else "FAIL"


def plain_generation(options):
    """Time in ms of a realisation whose three records are made at 1 kHz."""
    length = next_fast_len(round(1e3 * options.seconds), real=True)
    lines = np.random.default_rng(SEED).standard_normal((3, length // 2 + 1)) + 0j
    return 1e3 * best(options.repeat, irfft, lines, length)


def main():
    """Print the tables; write them where asked."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--json", metavar="FILE")
    parser.add_argument("--rows", metavar="FILE")
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=600.0)
    options = parser.parse_args()
    print(
        f"| {options.seconds:g} s, one realisation | gathered | step, ms | generation, ms "
        "| integration, ms (error) | limit, ms | generation over integration (target <= 2) "
        "| RK45, s (rtol, error) | ratio (target 300) |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    rows = []
    for name in CASES:
        for row in measure(name, options.seconds, options.repeat):
            rows.append(row)
            share = row["generation_ms"] / row["integration_ms"]
            note = "" if row["equal"] else ", less exact"
            print(
                f"| {name} | {row['gathered']} | {row['step_ms']:.2f} | {row['generation_ms']:.1f} "
                f"| {row['integration_ms']:.1f} ({row['error']:.0e}) | {row['limit_ms']:.1f} "
                f"| {share:.2f} {verdict(share <= SHARE_TARGET)} | {row['scipy_s']:.1f} "
                f"({row['scipy_rtol']:.0e}, {row['scipy_error']:.0e}{note}) "
                f"| {row['ratio']:.0f} {verdict(row['ratio'] >= TARGET)} |",
                flush=True,
            )
    print(
        "\n| linear | gathered | step, ms | generation, ms | response, ms | limit, ms "
        "| response over generation (target <= 2) |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for gathered in GATHERED:
        row = ours(paper_system(), gathered, options.seconds, options.repeat)[0]
        row["case"] = "linear"
        rows.append(row)
        share = row["integration_ms"] / row["generation_ms"]
        print(
            f"| exact steps | {gathered} | {row['step_ms']:.2f} | {row['generation_ms']:.1f} "
            f"| {row['integration_ms']:.1f} | {row['limit_ms']:.1f} "
            f"| {share:.2f} {verdict(share <= SHARE_TARGET)} |"
        )
    print(
        "\nThe input is made on a grid of ten nodes in its shortest period and is a quintic between"
        "\nthem; a linear system is stepped from node to node, and exact at every instant between."
        "\nDisplacement, velocity, acceleration by inverse FFTs at 1 kHz cost "
        f"{plain_generation(options):.0f} ms. Products: {2e-9 * product_rate():.0f} Gflop/s."
    )
    if options.rows:
        write([table_row(row, options.seconds) for row in rows], options.rows)
    if options.json:
        Path(options.json).write_text(json.dumps(rows, indent=1), encoding="utf-8")


def table_row(row, seconds):
    """A row of the table of all benchmarks."""
    work = f"{seconds:g} s random, {row['case']}, gathered {row['gathered']}"
    spent = row["integration_ms"]
    limit = f"{spent / row['limit_ms']:.1f} times its products; "
    if "scipy_s" not in row:
        limit += "memory, turning of the records"
        return Row(
            work, 1e-3 * spent, "generation of the input", 1e-3 * row["generation_ms"],
            math.nan, math.nan, 1 / SHARE_TARGET, limit,
        )  # fmt: skip
    limit += "laws, memory"
    return Row(
        work, 1e-3 * (row["generation_ms"] + spent), "SciPy RK45", row["scipy_s"],
        row["error"], row["scipy_error"], TARGET, limit,
    )  # fmt: skip


if __name__ == "__main__":
    main()
