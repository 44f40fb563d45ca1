"""How fast is one 30 s run of the paper's seat, against SciPy's best solver at equal error?

Both sides run 30 s of 1.55 Hz, 0.8857 m/s2, back-off, from rest, and give the suspension travel on
a 1 kHz grid. Each solver uses the cheapest tolerance of its list whose amplitude of travel over the
last period is right to 1e-6. SciPy's right-hand side is plain Python, scalar by scalar (arrays of
six numbers would be slower). One thread, medians of interleaved repetitions.

    python benchmarks/time_response.py [--json FILE] [--repeat N]
"""

from __future__ import annotations

import argparse
import json
import math
import os
import statistics
import time

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import numpy as np
from scipy.integrate import solve_ivp

import seatdyn as sd
from seatdyn.analysis.run import Problem, Settings

ERROR = 1e-6
OMEGA, LEVEL, END = 2 * math.pi * 1.55, 0.8857, 30.0
GRID = np.linspace(0.0, END, 30001)
LAST = GRID > END - 2 * math.pi / OMEGA
TOLERANCES = [10.0**-e for e in np.arange(3, 11, 0.5)]
TARGET = 100
CASES = {
    "linear": ((), lambda d, v: 0.0),
    "quadratic 1000": ((sd.QuadraticDamper(1000.0),), lambda d, v: 1000.0 * abs(v) * v),
    "Coulomb 50, slope 1000": (
        (sd.CoulombFriction(50.0),),
        lambda d, v: 50.0 * 2 / math.pi * math.atan(1000.0 * v),
    ),
    "gap 1000": (
        (sd.PiecewiseSpring(1000.0, 0.02, 0.01, jumping=False),),
        lambda d, v: 1000.0 * (d - 0.01 if d > 0.01 else d + 0.02 if d < -0.02 else 0.0),
    ),
    "jump 1000": (
        (sd.PiecewiseSpring(1000.0, 0.02, 0.01),),
        lambda d, v: 1000.0 * d if d > 0.01 or d < -0.02 else 0.0,
    ),
}


def plain_right_hand_side(law):
    """Equations of the back-off body on the seat in plain Python numbers."""
    sin, cos = math.sin, math.cos
    m1, k1, a1 = 9.1, 11972.5557, 3251.9783
    m2, k2, a2 = 61.7, 22456.7485, 519.0440
    k11, k12, k13, k14 = 97323.2354, -2226.0653, -1960.5176, 1164.3525
    x_level, v_level = -LEVEL / OMEGA**2, -LEVEL / OMEGA

    def rhs(t, y):
        x, x1, x2, v, v1, v2 = y.tolist()
        d, s = x - x_level * sin(OMEGA * t), v - v_level * cos(OMEGA * t)
        e1, w1, e2, w2 = x1 - x, v1 - v, x2 - x, v2 - v
        active = -k11 * e1 - k12 * w1 - k13 * (x2 + x) - k14 * (v2 + v)
        f1, f2 = k1 * e1 + a1 * w1, k2 * e2 + a2 * w2
        seat = (f1 + f2 - 9950.0 * d - 260.0 * s - law(d, s)) / 35.0
        return (v, v1, v2, seat, (active - f1) / m1, (-active - f2) / m2)

    return rhs


def amplitude(travel):
    """Half of peak to peak over the last period."""
    tail = travel[LAST]
    return (tail.max() - tail.min()) / 2


def scipy_travel(law, method, tolerance):
    """Travel on the grid by SciPy."""
    solution = solve_ivp(
        plain_right_hand_side(law), (0.0, END), np.zeros(6), method, GRID,
        rtol=tolerance, atol=tolerance * 1e-2,
    )  # fmt: skip
    return solution.y[0] + LEVEL / OMEGA**2 * np.sin(OMEGA * GRID)


def our_travel(problem):
    """Travel on the grid by seatdyn, from a lowered problem."""
    run = problem.run(0.0, END, problem.start(np.zeros(6)))
    samples = run.at(GRID)
    return samples.displacement[:, 0] - samples.base[0]


def clock(function, *args):
    """Result and wall time in s."""
    start = time.perf_counter()
    result = function(*args)
    return result, time.perf_counter() - start


def cheapest(travel_at, reference):
    """Tolerance that meets the error in the least time, with its error, or None."""
    best = None
    for tolerance in TOLERANCES:
        travel, seconds = clock(travel_at, tolerance)
        error = abs(amplitude(travel) / reference - 1)
        if error <= ERROR and (best is None or seconds < best[2]):
            best = (tolerance, error, seconds)
        if best is not None and seconds > 3 * best[2]:
            break
    return best


def measure(name, repeat):
    """One row of the table."""
    elements, law = CASES[name]
    seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(260.0), *elements])
    system = sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat)
    sine = sd.Sine(1.55, amplitude=LEVEL)

    def problem(rtol, method="ladder"):
        return Problem.make(system, sine.motion, Settings(rtol=rtol, method=method))

    reference = amplitude(our_travel(problem(1e-12, "runge-kutta")))
    ours = cheapest(lambda rtol: our_travel(problem(rtol)), reference)
    peers = {}
    for method in ("RK45", "DOP853", "LSODA"):
        found = cheapest(lambda tol, method=method: scipy_travel(law, method, tol), reference)
        if found is not None:
            peers[method] = found
    best = min(peers, key=lambda method: peers[method][2])
    ready = problem(ours[0])
    times = {"ours": [], "ours, arrays only": [], "public simulate": [], "peer": []}
    for _ in range(repeat):
        times["ours"].append(clock(lambda: our_travel(problem(ours[0])))[1])
        times["ours, arrays only"].append(clock(our_travel, ready)[1])
        settings = Settings(rtol=ours[0])
        times["public simulate"].append(
            clock(lambda: sd.simulate(system, sine, END, settings=settings))[1]
        )
        times["peer"].append(clock(scipy_travel, law, best, peers[best][0])[1])
    median = {key: statistics.median(values) for key, values in times.items()}
    return {
        "case": name,
        "ours_ms": 1e3 * median["ours"],
        "ours_prepared_ms": 1e3 * median["ours, arrays only"],
        "simulate_ms": 1e3 * median["public simulate"],
        "ours_rtol": ours[0],
        "ours_error": ours[1],
        "peer": best,
        "peer_ms": 1e3 * median["peer"],
        "peer_rtol": peers[best][0],
        "peer_error": peers[best][1],
        "ratio": median["peer"] / median["ours"],
        "ratio_simulate": median["peer"] / median["public simulate"],
        "target": TARGET,
    }


def main():
    """Print the table; write it where asked."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--json", metavar="FILE")
    parser.add_argument("--repeat", type=int, default=5)
    options = parser.parse_args()
    rows = [measure(name, options.repeat) for name in CASES]
    print("| 30 s run | seatdyn, ms (error) | SciPy's best, ms (error) | ratio | target | simulate, ms (ratio) |")
    print("| --- | --- | --- | --- | --- | --- |")
    for row in rows:
        print(
            f"| {row['case']} | {row['ours_ms']:.2f} ({row['ours_error']:.0e}) "
            f"| {row['peer']} {row['peer_ms']:.0f} ({row['peer_error']:.0e}) "
            f"| {row['ratio']:.0f} | {row['target']} "
            f"| {row['simulate_ms']:.1f} ({row['ratio_simulate']:.0f}) |"
        )
    print(
        "\nseatdyn: lowering, run and 1 kHz output as arrays. simulate: the same with energy "
        "balance,\nall forces of all elements, and a labelled Dataset."
    )
    if options.json:
        with open(options.json, "w", encoding="utf-8") as file:
            json.dump(rows, file, indent=1)


if __name__ == "__main__":
    main()
