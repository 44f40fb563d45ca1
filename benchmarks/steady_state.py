"""How fast is one steady state by harmonic balance, against our own integration in time?

The paper's seat under 1.55 Hz, 0.8857 m/s2, back-off. Both sides start from a system lowered before
and end with the amplitudes of all 15 outputs (harmonic balance) or with the periodic state (time),
at a tolerance that makes all amplitudes right to the error asked; the reference is time
integration at 1e-11. One thread, warm, processor time, minimum of the rounds. Rows "of many" are of
one call for 2048 seats, the strength of the law within 5 % of that of the row, one of them just it:
solved several at once where the law is smooth. Everything is timed but lowering.

The package harmonicbalance gives the travel alone, from a linear part condensed before (see
`peer_harmonicbalance` for the repair of its derivative). Gradients are those of all 15 amplitudes
to three parameters, their systems lowered each time; beside them the value alone, by the same call
without parameters.

    python benchmarks/steady_state.py [--rows FILE] [--repeat N]
"""

from __future__ import annotations

import argparse
import os
import time

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import numpy as np
import peer_harmonicbalance
from rows import Row, markdown, write

import seatdyn as sd
from seatdyn.analysis.balance import balance, output_names
from seatdyn.analysis.balance_many import balance_many
from seatdyn.analysis.members import Members
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
STRENGTHS = {
    sd.QuadraticDamper: ("QuadraticDamper.coefficient", 1000.0),
    sd.CoulombFriction: ("CoulombFriction.force", 50.0),
}
MANY = 2048
# of the ratio to time integration
TARGETS = {"quadratic 1000": 20.0}
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


def paper_seat(element):
    """The seat of the paper with one element more."""
    seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(260.0), element])
    return sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat)


def measure(name, rounds):
    """Rows of one law, and solutions per second."""
    element, error, target = CASES[name]
    system = paper_seat(element)

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
    time_error = float(np.max(np.abs(swings(orbit.run, found.names) / exact - 1)))
    goal = f", target {target:g}/s" if target else ""
    used = f"{found.samples} samples, {found.evaluations} residuals"
    work, least = f"steady state, {name}, to {error:g}", TARGETS.get(name, np.nan)
    off = float(np.max(np.abs(got / exact - 1)))
    rate = f"{1 / ours:.0f} solutions/s"
    rows = [Row(work, ours, "seatdyn in time", theirs, off, time_error, least, f"{rate}; {used}")]
    many = of_many(system, element, error, rounds)
    if many is not None:
        ours, amplitude = many
        off = float(np.max(np.abs(amplitude / exact - 1)))
        rate = f"{1 / ours:.0f} solutions/s{goal}"
        work = f"{work}, of many"
        rows.append(Row(work, ours, "seatdyn in time", theirs, off, time_error, least, rate))
    return rows


def of_many(system, element, error, rounds):
    """Time of one solution of many, and amplitudes of the first; None for laws that break."""
    name, value = STRENGTHS.get(type(element), (None, None))
    if name is None:
        return None
    rng = np.random.default_rng(0)
    strength = value * np.concatenate([[1.0], rng.uniform(0.95, 1.05, MANY - 1)])
    members = Members(system, SINE, {name: strength})
    count = len(output_names(system))
    many = members.many(np.arange(MANY), np.arange(count))
    best, amplitude, estimate = np.inf, None, None
    balance_many(many, error)
    for _ in range(max(3, rounds // 2)):
        start = time.process_time()
        amplitude, estimate = balance_many(many, error)
        best = min(best, time.process_time() - start)
    assert np.all(estimate <= error)
    return best / MANY, amplitude[0]


def against_harmonicbalance(rounds):
    """Rows beside the package harmonicbalance, with as few harmonics as make its travel right."""
    element, error, _ = CASES["quadratic 1000"]
    system = paper_seat(element)
    found = balance(system, SINE, error)
    exact_run = find_orbit(
        Problem.make(system, SINE.motion, Settings(rtol=1e-11)), SINE, 1e-10, 5000
    )
    exact = swings(exact_run.run, found.names)
    got = (found.look.extrema[HIGH] - found.look.extrema[LOW]) / 2
    travel = found.names.index("seat-base")
    for count in range(5, 64, 2):
        solve = peer_harmonicbalance.travel_of(
            found.problem, lambda d, v: 1000.0 * np.abs(v) * v, count
        )
        off = abs(peer_harmonicbalance.swing(solve()) / exact[travel] - 1)
        if off <= error:
            break
    arguments = (found.problem, found.work, found.look, error, 64, 4096, False)
    alone = fastest(lambda: levels.ascend(*arguments), rounds)
    ours, amplitude = of_many(system, element, error, rounds)
    theirs = fastest(solve, max(2, rounds // 3))
    peer = f"harmonicbalance, travel only, {count} harmonics"
    work, target = f"steady state, quadratic 1000, to {error:g}", 100.0
    scalar = "some 0.3 Mflop in scalar code: 40 times the time at full vector width"
    vector = "all 15 outputs; half of the time goes to them"
    own = [float(np.max(np.abs(x / exact - 1))) for x in (got, amplitude)]
    return [
        Row(work, alone, peer, theirs, own[0], off, target, scalar),
        Row(f"{work}, of many", ours, peer, theirs, own[1], off, target, vector),
    ]


def gradient(rounds):
    """Row of value and gradient beside the value alone: the target is a ratio of 1/2."""
    element, error, _ = CASES["quadratic 1000"]
    system = paper_seat(element)
    names = ["Spring.stiffness", "Damper.coefficient", "QuadraticDamper.coefficient"]
    found = sd.steady_gradient(system, SINE, names, tolerance=error)
    exact = sd.steady_gradient(system, SINE, names, tolerance=1e-9)
    off = np.abs(found.amplitude_gradient / exact.amplitude_gradient - 1).max()
    both = fastest(lambda: sd.steady_gradient(system, SINE, names, tolerance=error), rounds)
    alone = fastest(lambda: sd.steady_state(system, SINE, method="hb"), rounds)
    return Row(
        "steady state, value and gradient to 3 parameters",
        both,
        "seatdyn, the value alone (steady_state)",
        alone,
        float(off),
        float("nan"),
        0.5,
        "six systems lowered by Python beside one solution",
    )


def main():
    """Print the table; write it where asked."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rows", metavar="FILE")
    parser.add_argument("--repeat", type=int, default=9)
    options = parser.parse_args()
    rows = [row for name in CASES for row in measure(name, options.repeat)]
    rows += [*against_harmonicbalance(options.repeat), gradient(options.repeat)]
    print(markdown(rows))
    if options.rows:
        write(rows, options.rows)


if __name__ == "__main__":
    main()
