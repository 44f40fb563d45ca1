"""How fast is one 30 s run with a delayed damper, against jitcdde at equal error?

The damper force 260 v + 300 |v| v of the paper's back-off seat acts late; 1.55 Hz, 0.8857 m/s2.
Before the run the masses are at rest and the base moves as it does later. The error is that of the
seat's displacement at 100 Hz, over its largest value, against a run at the smallest tolerance.
jitcdde runs at a tolerance of 1e-8; seatdyn takes the cheapest tolerance that is as accurate.
Process CPU time of one thread, smallest of interleaved rounds; compiling is not counted. Without
jitcdde (it needs a C compiler) seatdyn runs alone.

    python benchmarks/delay.py [--json FILE] [--repeat N]
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import json
import math
import os
import tempfile
import time
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import numpy as np
from rows import Row, write

import seatdyn as sd
from seatdyn.analysis.delay_time import LateState
from seatdyn.analysis.run import Problem, Settings

DELAYS = (0.005, 0.0203, 0.05)  # s
OMEGA, LEVEL, END = 2 * math.pi * 1.55, 0.8857, 30.0
GRID = np.arange(1, 3001) / 100.0
TOLERANCES = [10.0**-e for e in np.arange(4, 10.5, 0.1)]
PEER_TOLERANCE = 1e-8
TARGET = 10


def our_problem(delay, rtol):
    """The seat, lowered, and its start."""
    seat = sd.Seat(
        35.0,
        [sd.Spring(9950.0), sd.Damper(260.0, delay=delay), sd.QuadraticDamper(300.0, delay=delay)],
    )
    system = sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat)
    problem = Problem.make(system, sd.Sine(1.55, amplitude=LEVEL).motion, Settings(rtol=rtol))
    rest = problem.start(np.zeros(6))
    past = dataclasses.replace(problem.at_rest(0.0, rest.y), still=0)
    return problem, LateState(rest.y, rest.side, rest.held, past)


def our_seat(problem, start):
    """Displacement of the seat on the grid by seatdyn."""
    return problem.run(0.0, END, start).states(GRID)[:, 0]


def peer(delay):
    """The same equations, compiled by jitcdde; a function that runs them, or None."""
    try:
        from jitcdde import jitcdde, t, y
        from symengine import cos, sin
    except ImportError:
        return None
    m1, k1, a1 = 9.1, 11972.5557, 3251.9783
    m2, k2, a2 = 61.7, 22456.7485, 519.0440
    k11, k12, k13, k14 = 97323.2354, -2226.0653, -1960.5176, 1164.3525
    x, x1, x2, v, v1, v2 = (y(i) for i in range(6))
    base = -LEVEL / OMEGA**2 * sin(OMEGA * t)
    speed = y(3, t - delay) + LEVEL / OMEGA * cos(OMEGA * (t - delay))
    late = 260.0 * speed + 300.0 * abs(speed) * speed
    active = -k11 * (x1 - x) - k12 * (v1 - v) - k13 * (x2 + x) - k14 * (v2 + v)
    f1, f2 = k1 * (x1 - x) + a1 * (v1 - v), k2 * (x2 - x) + a2 * (v2 - v)
    equations = [
        v, v1, v2,
        (f1 + f2 - 9950.0 * (x - base) - late) / 35.0, (active - f1) / m1, (-active - f2) / m2,
    ]  # fmt: skip
    solver = jitcdde(equations, delays=[0.0, delay], max_delay=delay, verbose=False)
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        solver.compile_C(simplify=False)  # its build would read a pyproject.toml where it runs

    def run(tolerance):
        solver.purge_past()
        solver.constant_past(np.zeros(6), time=0.0)
        solver.set_integration_parameters(rtol=tolerance, atol=tolerance * 1e-3, first_step=1e-4)
        start = time.process_time()
        solver.step_on_discontinuities()
        seat = [solver.integrate(when)[0] if when > solver.t else np.nan for when in GRID]
        return np.array(seat), time.process_time() - start

    return run


def cpu(function, *args):
    """Result and CPU time in s."""
    start = time.process_time()
    result = function(*args)
    return result, time.process_time() - start


def measure(delay, repeat):
    """One row of the table."""
    reference = our_seat(*our_problem(delay, 1e-12))
    size = np.abs(reference).max()

    def error(seat):
        return float(np.nanmax(np.abs(seat - reference)) / size)

    run_peer = peer(delay)
    row = {"delay": delay, "target": TARGET}
    wanted = 1e-8
    if run_peer is not None:
        wanted = error(run_peer(PEER_TOLERANCE)[0])
        row |= {"peer": "jitcdde", "peer_rtol": PEER_TOLERANCE, "peer_error": wanted}
    for rtol in TOLERANCES:
        ours = our_problem(delay, rtol)
        row |= {"rtol": rtol, "error": error(our_seat(*ours))}
        if row["error"] <= wanted:
            break
    ours_ms, peer_ms = [], []
    for _ in range(repeat):
        ours_ms.append(1e3 * cpu(our_seat, *ours)[1])
        if run_peer is not None:
            peer_ms.append(1e3 * run_peer(PEER_TOLERANCE)[1])
    row["ours_ms"] = min(ours_ms)
    if peer_ms:
        row |= {"peer_ms": min(peer_ms), "ratio": min(peer_ms) / min(ours_ms)}
    return row


def main():
    """Print the table; write it where asked."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--json", metavar="FILE")
    parser.add_argument("--rows", metavar="FILE")
    parser.add_argument("--repeat", type=int, default=7)
    options = parser.parse_args()
    rows = [measure(delay, options.repeat) for delay in DELAYS]
    print("| delay, ms | seatdyn, ms (error) | jitcdde, ms (error) | ratio | target |")
    print("| --- | --- | --- | --- | --- |")
    for row in rows:
        them = f"{row['peer_ms']:.0f} ({row['peer_error']:.0e})" if "peer" in row else "not there"
        ratio = f"{row['ratio']:.0f}" if "peer" in row else "-"
        print(
            f"| {1e3 * row['delay']:g} | {row['ours_ms']:.1f} ({row['error']:.0e}) | {them} "
            f"| {ratio} | {row['target']} |"
        )
    if options.rows:
        limit = "law calls and history look-ups; no vector instructions"
        write(
            [
                Row(
                    f"30 s run, damper {1e3 * row['delay']:g} ms late",
                    1e-3 * row["ours_ms"], "jitcdde", 1e-3 * row["peer_ms"],
                    row["error"], row["peer_error"], TARGET, limit,
                )
                for row in rows
                if "peer" in row
            ],
            options.rows,
        )  # fmt: skip
    if options.json:
        Path(options.json).write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
