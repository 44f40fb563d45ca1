"""How fast is one steady state by harmonic balance, against our own integration in time?

The paper's seat under 1.55 Hz, 0.8857 m/s2, back-off. Both sides start from a system lowered before
and end with the amplitudes of all 15 outputs (harmonic balance) or with the periodic state (time),
at a tolerance that makes all amplitudes right to the error asked; the reference is time
integration at 1e-11. One thread, warm, processor time, minimum of the rounds.

    python benchmarks/steady_state.py [--rows FILE] [--repeat N]
"""

from __future__ import annotations

import argparse
import os
import time

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import numpy as np
from rows import Row, markdown, write

import seatdyn as sd
from seatdyn.analysis.balance import balance
from seatdyn.analysis.run import Problem, Settings
from seatdyn.analysis.steady import extrema, find_orbit
from seatdyn.kernels import levels
from seatdyn.kernels.orbit import HIGH, LOW

SINE = sd.Sine(1.55, amplitude=0.8857)
# element, error asked, target of solutions per second
CASES = {
    "quadratic 1000": (sd.QuadraticDamper(1000.0), 1e-6, 5000.0),
    "Coulomb 50, slope 1000": (sd.CoulombFriction(50.0), 1e-4, 1000.0),
    "gap 1000": (sd.PiecewiseSpring(1000.0, 0.02, 0.01, jumping=False), 1e-6, None),
    "jump 1000": (sd.PiecewiseSpring(1000.0, 0.02, 0.01), 1e-5, None),
}
TARGET = 20.0  # of the ratio to time integration
CALLS = 20


def fastest(function, rounds):
    """Least processor time of one call, s."""
    best = np.inf
    for _ in range(rounds):
        start = time.process_time()
        for _ in range(CALLS):
            function()
        best = min(best, (time.process_time() - start) / CALLS)
    return best


def swings(run, names):
    """Amplitudes of a periodic run."""
    high, low = extrema(run)
    return np.array([(high[name] - low[name]) / 2 for name in names])


def measure(name, rounds):
    """One row, and solutions per second."""
    element, error, target = CASES[name]
    seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(260.0), element])
    system = sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat)

    def problem(rtol):
        return Problem.make(system, SINE.motion, Settings(rtol=rtol))

    found = balance(system, SINE, error)
    arguments = (found.problem, found.work, found.look, error, 64, 4096, False)
    got = (found.look.extrema[HIGH] - found.look.extrema[LOW]) / 2
    exact = swings(find_orbit(problem(1e-11), SINE, 1e-10, 5000).run, found.names)
    ready = problem(error)
    orbit = find_orbit(ready, SINE, error, 5000)
    ours = fastest(lambda: levels.ascend(*arguments), rounds)
    theirs = fastest(lambda: find_orbit(ready, SINE, error, 5000), max(2, rounds // 3))
    goal = f", target {target:g}/s" if target else ""
    return Row(
        f"steady state, {name}, to {error:g}",
        ours,
        "seatdyn in time",
        theirs,
        float(np.max(np.abs(got / exact - 1))),
        float(np.max(np.abs(swings(orbit.run, found.names) / exact - 1))),
        TARGET,
        f"{1 / ours:.0f} solutions/s{goal}; {found.samples} samples, {found.evaluations} residuals",
    )


def main():
    """Print the table; write it where asked."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rows", metavar="FILE")
    parser.add_argument("--repeat", type=int, default=9)
    options = parser.parse_args()
    rows = [measure(name, options.repeat) for name in CASES]
    print(markdown(rows))
    if options.rows:
        write(rows, options.rows)


if __name__ == "__main__":
    main()
