"""How fast are ten thousand runs with different parameters, each to its steady amplitude to 1e-5?

Mass, stiffness and damping of the seat and the strength of the law are drawn at random (seed
printed) about the paper's seat; the base moves with 1.55 Hz, 0.8857 m/s2. All give the amplitude of
the travel. Ours is one call of `steady_states`: harmonic balance, sets of smooth laws several at
once. The peers run 30 s in time, as long as the transient lasts: SciPy's best solver on a sample of
the sets, heyoka's batch mode, where it can be imported, on more of them. Each peer uses the
cheapest tolerance whose travel is right to 1e-5 for all of its sample; the reference is our time
integration at 1e-11. Processor times, one thread, of one set.

    python benchmarks/many_runs.py [--rows FILE] [--sets N]
"""

from __future__ import annotations

import argparse
import math
import os
import time

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import numpy as np
import peer_heyoka
from rows import Row, markdown, write
from scipy.integrate import solve_ivp

import seatdyn as sd
from seatdyn.analysis.parameters import with_parameters

SEED, SETS, SAMPLE, ERROR = 3, 10_000, 4, 1e-5
OMEGA, LEVEL, END = 2 * math.pi * 1.55, 0.8857, 30.0
GRID = np.arange(round((END - 2 * math.pi / OMEGA) * 1000), 30001) / 1000.0
SINE = sd.Sine(1.55, amplitude=LEVEL)
TOLERANCES = [10.0**-e for e in np.arange(3, 10, 0.5)]
RANGES = {
    "seat_mass": (25.0, 50.0),
    "Spring.stiffness": (8000.0, 12000.0),
    "Damper.coefficient": (200.0, 500.0),
}
# element, what is drawn of it and its range, law of d, v and that parameter, target
CASES = {
    "quadratic": (
        sd.QuadraticDamper(1.0), "QuadraticDamper.coefficient", (300.0, 1500.0),
        lambda d, v, p: p * abs(v) * v, 4000.0,
    ),
    "Coulomb, slope 1000": (
        sd.CoulombFriction(1.0), "CoulombFriction.force", (10.0, 60.0),
        lambda d, v, p: p * 2 / math.pi * math.atan(1000.0 * v), 500.0,
    ),
    "gap": (
        sd.PiecewiseSpring(1.0, 0.02, 0.01, jumping=False), "PiecewiseSpring.stiffness",
        (500.0, 3000.0),
        lambda d, v, p: p * (d - 0.01 if d > 0.01 else d + 0.02 if d < -0.02 else 0.0), 500.0,
    ),
    "jump": (
        sd.PiecewiseSpring(1.0, 0.02, 0.01), "PiecewiseSpring.stiffness", (500.0, 3000.0),
        lambda d, v, p: p * d if d > 0.01 or d < -0.02 else 0.0, 500.0,
    ),
}  # fmt: skip


def right_hand_side(law, mass, stiffness, damping, strength):
    """Equations of the back-off body on the seat in plain Python."""
    sin, cos = math.sin, math.cos
    x_level, v_level = -LEVEL / OMEGA**2, -LEVEL / OMEGA

    def rhs(t, y):
        x, x1, x2, v, v1, v2 = y
        d, s = x - x_level * sin(OMEGA * t), v - v_level * cos(OMEGA * t)
        e1, w1, e2, w2 = x1 - x, v1 - v, x2 - x, v2 - v
        active = -97323.2354 * e1 + 2226.0653 * w1 + 1960.5176 * (x2 + x) - 1164.3525 * (v2 + v)
        f1, f2 = 11972.5557 * e1 + 3251.9783 * w1, 22456.7485 * e2 + 519.0440 * w2
        seat = (f1 + f2 - stiffness * d - damping * s - law(d, s, strength)) / mass
        return (v, v1, v2, seat, (active - f1) / 9.1, (-active - f2) / 61.7)

    return rhs


def swing(x):
    """Half of peak to peak of the travel, from the seat on the grid."""
    travel = x + LEVEL / OMEGA**2 * np.sin(OMEGA * GRID)
    return (travel.max(axis=-1) - travel.min(axis=-1)) / 2


def scipy_best(law, sets, exact):
    """Solver, time of a set and error, of the cheapest that is accurate on all sets."""
    best = None
    for method in ("RK45", "DOP853", "LSODA"):
        for tolerance in TOLERANCES:
            start = time.process_time()
            got = [
                solve_ivp(
                    right_hand_side(law, *row), (0.0, END), np.zeros(6), method, GRID,
                    rtol=tolerance, atol=tolerance * 1e-2,
                ).y[0]
                for row in sets
            ]  # fmt: skip
            seconds = (time.process_time() - start) / len(sets)
            error = np.max(np.abs(swing(np.array(got)) / exact - 1))
            if error <= ERROR:
                if best is None or seconds < best[1]:
                    best = (method, seconds, error)
                break
    return best


def heyoka_best(name, sets, exact):
    """Time of a set and error of heyoka's batch mode, at the cheapest accurate tolerance."""
    for tolerance in TOLERANCES:
        made = peer_heyoka.batch_integrator(name, OMEGA, LEVEL, tolerance)
        start = time.process_time()
        got = peer_heyoka.batch_seats(*made, sets, GRID)
        seconds = (time.process_time() - start) / len(sets)
        error = np.max(np.abs(swing(got) / exact - 1))
        if error <= ERROR:
            return seconds, error
    return None


def measure(name, count):
    """Rows of one law."""
    element, own, ends, law, target = CASES[name]
    seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(260.0), element])
    system = sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat)
    generator = np.random.default_rng(SEED)
    sets = {
        key: generator.uniform(*limits, count) for key, limits in (RANGES | {own: ends}).items()
    }
    few = {key: values[: 4 * SAMPLE] for key, values in sets.items()}
    asked = {"tolerance": ERROR, "stability": False, "outputs": ["seat-base"]}
    sd.steady_states(system, SINE, few, **asked)
    start = time.process_time()
    states = sd.steady_states(system, SINE, sets, **asked)
    ours = (time.process_time() - start) / count
    good = np.mean(states.status == "converged")
    rows = np.array(list(few.values())).T
    exact = []
    for row in rows:
        member = with_parameters(system, SINE, dict(zip(sets, row, strict=True)))
        reached = sd.steady_state(*member, method="time", settings=sd.Settings(rtol=1e-11))
        exact.append(float(reached.amplitude.sel(output="seat-base")))
    travel = np.array(exact)
    error = float(np.max(np.abs(states.amplitude.values[: len(rows), 0] / travel - 1)))
    solver, theirs, off = scipy_best(law, rows[:SAMPLE], travel[:SAMPLE])
    note = f"{1 / ours:.0f} sets/s, {100 * float(good):.2f} % converged of {count}, seed {SEED}"
    work = f"many runs, {name}, amplitude to {ERROR:g}"
    found = [Row(work, ours, f"SciPy {solver}, 30 s", theirs, error, off, target, note)]
    try:
        taylor = heyoka_best(name, rows, travel)
    except ImportError:
        taylor = None
    if taylor is not None:
        smooth = 5.0 if name == "quadratic" else 1.0
        found.append(
            Row(work, ours, "heyoka batch, 30 s", taylor[0], error, taylor[1], smooth, note)
        )
    return found


def main():
    """Print the table; write it where asked."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rows", metavar="FILE")
    parser.add_argument("--sets", type=int, default=SETS)
    options = parser.parse_args()
    rows = [row for name in CASES for row in measure(name, options.sets)]
    print(markdown(rows))
    if options.rows:
        write(rows, options.rows)


if __name__ == "__main__":
    main()
