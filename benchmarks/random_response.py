"""What does a realisation of 600 s at 1 kHz cost, and what with SciPy at equal error?

The paper's seat with its back-off body (three masses) is shaken by EM3. Ours: sixteen realisations
side by side, generation of the input and integration timed apart; all outputs are gathered either
at 1 kHz or finer, or as `random_response` does it, at instants at most 10 ms apart, with the steps
that it chooses. SciPy: RK45 over the same record, a quintic polynomial between its nodes, in plain
Python floats; travel at the same instants; the cheapest tolerance whose travel is as near to the
reference as ours (r.m.s. of the difference over r.m.s.). It runs over a tenth of the record, and
its time is scaled up. One thread, warm, processor time, best of the rounds.

    python benchmarks/random_response.py [--json FILE] [--repeat N] [--seconds S]
"""

from __future__ import annotations

import argparse
import json
import math
import os
import time
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
SPACINGS = {"1 kHz": 1e-3, "as chosen": LONGEST_STEP}  # s
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


def ours(system, spacing, seconds, repeat):
    """Times in s for a realisation, and the travel of the first part with its relative error."""
    synthesis = Synthesis(EM3, seconds)
    wanted, _ = choose_steps(system, synthesis, SEED, 1e-3)
    ensemble = Ensemble.make(system, synthesis, 0, SEED, wanted, spacing=spacing)
    generation = best(repeat, ensemble.base, 0)
    whole = best(repeat, ensemble.run, 0)
    row = {
        "generation_ms": 1e3 * generation / LANES,
        "integration_ms": 1e3 * (whole - generation) / LANES,
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


def measure(name, gathered, seconds, repeat):
    """One row of the table."""
    elements, law = CASES[name]
    system = paper_system(*elements)
    row, ensemble, nodes, reference = ours(system, SPACINGS[gathered], seconds, repeat)
    travel_at = scipy_travel(law, ensemble, nodes, reference.size)
    for tolerance in TOLERANCES:
        travel, spent = clock(travel_at, tolerance)
        error = relative(travel, reference)
        if error <= row["error"]:
            break
    found = {"scipy_rtol": tolerance, "scipy_error": error, "scipy_s": spent / SHARE}
    total = row["generation_ms"] + row["integration_ms"]
    ratios = {
        "generation_share": row["generation_ms"] / row["integration_ms"],
        "ratio": 1e3 * found["scipy_s"] / total,
        "equal": error <= row["error"],
    }
    return {"case": name, "gathered": gathered, **row, **found, **ratios}


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
        f"| {options.seconds:g} s, one realisation | gathered at | step, ms | generation, ms "
        "| integration, ms (error) | generation over integration (target <= 2) "
        "| RK45, s (rtol, error) | ratio (target 300) |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    rows = []
    for name in CASES:
        for gathered in SPACINGS:
            row = measure(name, gathered, options.seconds, options.repeat)
            rows.append(row)
            note = "" if row["equal"] else ", less exact"
            print(
                f"| {name} | {gathered} | {row['step_ms']:.2f} | {row['generation_ms']:.1f} "
                f"| {row['integration_ms']:.1f} ({row['error']:.0e}) "
                f"| {row['generation_share']:.2f} | {row['scipy_s']:.1f} "
                f"({row['scipy_rtol']:.0e}, {row['scipy_error']:.0e}{note}) | {row['ratio']:.0f} |",
                flush=True,
            )
    print(
        "\n| linear | gathered at | step, ms | generation, ms | response, ms "
        "| ratio (target <= 2) |"
    )
    print("| --- | --- | --- | --- | --- | --- |")
    for gathered, spacing in SPACINGS.items():
        row = ours(paper_system(), spacing, options.seconds, options.repeat)[0]
        row |= {"case": "linear", "gathered": gathered}
        rows.append(row)
        print(
            f"| exact steps | {gathered} | {row['step_ms']:.2f} | {row['generation_ms']:.1f} "
            f"| {row['integration_ms']:.1f} | {row['integration_ms'] / row['generation_ms']:.2f} |"
        )
    print(
        "\nThe input is made on a grid of ten nodes in its shortest period and is a quintic between"
        "\nthem; as chosen, a linear system is stepped from node to node. Displacement, velocity,"
        f"\nacceleration by inverse FFTs at 1 kHz cost {plain_generation(options):.0f} ms."
    )
    if options.rows:
        limit = "calls of the laws; the linear part runs in vector registers"
        write(
            [
                Row(
                    f"{options.seconds:g} s random, {row['case']}, gathered at {row['gathered']}",
                    1e-3 * (row["generation_ms"] + row["integration_ms"]), "SciPy RK45",
                    row["scipy_s"], row["error"], row["scipy_error"], 300, limit,
                )
                for row in rows
                if "scipy_s" in row
            ],
            options.rows,
        )  # fmt: skip
    if options.json:
        Path(options.json).write_text(json.dumps(rows, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
