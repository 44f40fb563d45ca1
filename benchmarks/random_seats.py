"""Do steady states converge, and to right answers? Random seats over all bodies and elements.

Draws seats from the ranges of `tests/seats_at_random.py`, asks for their steady state, counts what
converges by the rule stated there, and looks at a sample in time: a motion taken as initial state
has to come back after one period. Prints ranges, seed, statuses and every failure. With --json a
run can be stopped and goes on where it was; several may share the sets (--first), and one that is
given the lines of all prints the table.

    python benchmarks/random_seats.py [--sets N] [--first I] [--seed S] [--sample N] [--json FILE]
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
import warnings
from collections import Counter
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"
sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

import numpy as np

import seats_at_random as seats

NOTHING = {"status": "error", "method": "", "stable": -1, "verdict": "", "converged": False}


def one(number, seed, sampled):
    """What came of one set, as plain numbers."""
    case = seats.random_set(number, seed)
    began = time.process_time()
    row = {
        "set": number,
        "kinds": case.kinds,
        "sharp": case.sharp,
        "states": bool(case.system.memory_elements),
    }
    try:
        outcome = seats.outcome_of(case)
    except Exception as error:  # a fault of ours is a failure of that set, not the end of all
        what = f"{case}: {type(error).__name__}: {error}"
        return row | NOTHING | {"seconds": time.process_time() - began, "what": what}
    row |= {
        "status": outcome.status,
        "method": outcome.method,
        "stable": outcome.stable,
        "verdict": outcome.verdict,
        "converged": outcome.converged,
        "seconds": time.process_time() - began,
        "what": "" if outcome.converged else f"{case}: {outcome.message}",
    }
    if sampled and outcome.status in ("converged", "grazing"):
        row["miss"] = seats.miss(case, outcome)
        row["what"] = str(case)
    return row


def table(rows, options):
    """What is printed."""
    n, good = len(rows), sum(row["converged"] for row in rows)
    lines = [f"{n} sets from {options.first}, seed {options.seed}, tolerance {seats.TOLERANCE:g}"]
    lines += [f"  {name}: {low:g} .. {high:g}" for name, (low, high) in seats.RANGES.items()]
    lines += [f"  elements, one to three of {len(seats.KINDS)}: {', '.join(seats.KINDS)}"]
    lines += [f"converged: {good} of {n}, {100 * good / n:.2f} %"]
    jumps, states = (sum(row[key] for row in rows) for key in ("sharp", "states"))
    lines += [
        f"with jumps or friction {100 * jumps / n:.0f} %, with states {100 * states / n:.0f} %"
    ]
    kinds = Counter((r["status"], r["method"], r["stable"], r["verdict"]) for r in rows)
    lines += ["", "| status | method | stable | response from rest | sets |", "| --- " * 5 + "|"]
    for kind, count in kinds.most_common():
        lines.append("| " + " | ".join(map(str, (*kind, count))) + " |")
    lines += ["", *(row["what"] for row in rows if not row["converged"])]
    sample = [row for row in rows if "miss" in row]
    if sample:
        misses = np.array([row["miss"] for row in sample])
        share = np.mean([row["sharp"] for row in sample])
        unstable = sum(row["stable"] == 0 for row in sample)
        allowed = seats.ALLOWED * seats.TOLERANCE
        lines += [
            "",
            f"sample in time: {len(sample)}, {100 * share:.0f} % with jumps or friction, "
            f"{unstable} unstable",
            f"miss after a period: worst {misses.max():.1e}, median {np.median(misses):.1e}",
            f"beyond {allowed:g}: {np.sum(misses > allowed)}",
        ]
        lines += [f"  {r['miss']:.1e} {r['what']}" for r in sample if not r["miss"] <= allowed]
    return "\n".join(lines)


def main():
    """Run the sets, print the table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--sets", type=int, default=10_000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=seats.SEED)
    parser.add_argument("--sample", type=int, default=300, help="of the sets, looked at in time")
    parser.add_argument("--json", metavar="FILE", help="rows are appended as they come")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    every = max(1, options.sets // max(options.sample, 1))
    kept = Path(options.json) if options.json else None
    rows = [json.loads(line) for line in kept.open()] if kept and kept.exists() else []
    known = {row["set"] for row in rows}
    for number in range(options.first, options.first + options.sets):
        if number in known:
            continue
        if len(rows) % 100 == 0:
            print(f"{len(rows)} of {options.sets} sets", file=sys.stderr, flush=True)
        sampled = options.sample > 0 and number % every == 0
        rows.append(one(number, options.seed, sampled))
        if kept:
            with kept.open("a") as lines:
                lines.write(json.dumps(rows[-1]) + "\n")
    print(table(rows, options))


if __name__ == "__main__":
    main()
