"""What do 600 s of random base motion cost, and the linear response to them?

One thread, one run, minima of several rounds. Peer: the same motion from transforms at 1 kHz.
"""

import argparse
import json
import os
import time
from pathlib import Path

# one thread, before numpy is loaded
os.environ["OMP_NUM_THREADS"] = "1"
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["MKL_NUM_THREADS"] = "1"

import numpy as np
from scipy.fft import irfft, next_fast_len

import seatdyn as sd
from seatdyn.analysis.linear_map import linear_map
from seatdyn.analysis.random_linear import exact_step
from seatdyn.kernels.recursion import accumulate
from seatdyn.signals.synthesis import Synthesis, member_generator

DURATION, MEMBERS, ROUNDS, RATE = 600.0, 32, 5, 1000.0


def milliseconds(run, members=1):
    """Fastest of several rounds, in ms for each member."""
    run()  # compiles
    best = np.inf
    for _ in range(ROUNDS):
        start = time.perf_counter()
        run()
        best = min(best, time.perf_counter() - start)
    return 1000 * best / members


def fine(plan):
    """Displacement, velocity and acceleration at 1 kHz from one transform each."""
    place, omega, _ = plan._lines
    length = next_fast_len(round(plan.period * RATE), real=True)
    drawn = plan.coefficients(member_generator(1, 0))
    for factor in (-1.0 / omega**2, -1j / omega, 1.0):
        lines = np.zeros(length // 2 + 1, dtype=complex)
        lines[place] = 0.5 * factor * drawn
        irfft(lines, length, norm="forward")


def measure(name, system):
    """Times for one class of seat test."""
    plan = Synthesis(sd.seat_test_input(name), DURATION)
    motion = [np.empty((plan.nodes, MEMBERS)) for _ in range(3)]
    matrices = linear_map(system)
    step = exact_step(matrices.a, matrices.b, plan.step)
    size = len(matrices.a)
    gram = np.zeros((size + 3, size + 3, MEMBERS))

    def respond():
        accumulate(*step, *motion, 0, np.zeros((size, MEMBERS)), gram)

    return {
        "make_ms": milliseconds(lambda: plan.fill(1, *motion), MEMBERS),
        "make_at_1_kHz_ms": milliseconds(lambda: fine(plan)),
        "linear_response_ms": milliseconds(respond, MEMBERS),
    }


def main():
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(260.0)])
    system = sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat)
    rows = {name: measure(name, system) for name in ("EM3", "EM5")}
    for name, row in rows.items():
        print(name, {key: round(value, 2) for key, value in row.items()})
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(rows, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
