"""How fast is a stability map, by either criterion, against a loop over python-control?

One thread, one run, same points. `python benchmarks/stability_map.py [--json FILE]`
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

import control
import numpy as np
from rows import Row, write

import seatdyn as sd
from seatdyn.analysis.stability import stability_points

TARGETS = {"hurwitz": 300.0, "poles": 5.0}
ROUNDS = 5
PEER_POINTS = 3000
AXES = {
    "seat_mass": np.linspace(5.0, 100.0, 100),
    "damping": np.linspace(0.0, 1000.0, 100),
    "stiffness": np.linspace(2e3, 4e4, 100),
}


def best_rate(run, points):
    """Points per second of the fastest of several rounds, and the last result."""
    best, result = np.inf, None
    for _ in range(ROUNDS):
        start = time.perf_counter()
        result = run()
        best = min(best, time.perf_counter() - start)
    return points / best, result


def peer_loop(system, columns):
    """Stability as a python-control user would map it: matrices, `ss`, `poles`, per point.

    The matrices are changed in place, which is the least work that such a loop can do.
    """
    a, b, c, d = (np.array(x) for x in sd.state_space(system)[:4])
    model = system.linear
    n = model.size
    force, mass0 = np.zeros(2 * n), model.mass[0, 0]
    base = a[n] * mass0
    k0, c0 = (model.parameters[name].value for name in ("stiffness", "damping"))
    verdict = np.empty(len(columns["seat_mass"]), dtype=bool)
    for i, (m, r, k) in enumerate(
        zip(columns["seat_mass"], columns["damping"], columns["stiffness"], strict=True)
    ):
        force[:] = base
        force[0] -= k - k0
        force[n] -= r - c0
        a[n] = force / m
        b[n] = (k / m, r / m)
        verdict[i] = control.ss(a, b, c, d).poles().real.max() < 0.0
    return verdict


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", metavar="FILE")
    parser.add_argument("--json", type=Path, metavar="FILE")
    arguments = parser.parse_args()
    rng = np.random.default_rng(11)
    seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(260.0)])
    report = {}
    for body in ("ksiazek1997_back_off", "ksiazek1997_back_on"):
        system = sd.SeatSystem(sd.load_body(body), seat)
        points = int(np.prod([axis.size for axis in AXES.values()]))
        sd.stability_map(system, **AXES)  # compile
        rates, maps = {}, {}
        for method in ("hurwitz", "poles"):
            rates[method], maps[method] = best_rate(
                lambda s=system, m=method: sd.stability_map(s, method=m, **AXES), points
            )
        sample = {name: rng.choice(axis, PEER_POINTS) for name, axis in AXES.items()}
        rates["control"], peer = best_rate(lambda s=system, c=sample: peer_loop(s, c), PEER_POINTS)
        poles = stability_points(system, method="poles", **sample)
        near = np.abs(poles["margin"].values) < 1e-9
        off_boundary = np.abs(maps["poles"]["max_real"].values) > 1e-7  # 1/s
        differ = maps["hurwitz"]["stable"].values != maps["poles"]["stable"].values
        report[body] = {
            "rates": rates,
            "ratios": {m: rates[m] / rates["control"] for m in TARGETS},
            "targets": TARGETS,
            "disagree_hurwitz_poles": int(np.sum(differ & off_boundary)),
            "disagree_poles_control": int(np.sum((poles["stable"].values != peer) & ~near)),
        }
    lines = [
        "| body | way | points/s | ratio to python-control | target |",
        "|---|---|---|---|---|",
    ]
    for body, row in report.items():
        lines.append(f"| {body} | python-control loop | {row['rates']['control']:.3g} | 1 | |")
        for method, target in TARGETS.items():
            rate, ratio = row["rates"][method], row["ratios"][method]
            lines.append(f"| {body} | {method} map | {rate:.3g} | {ratio:.3g} | {target:g} |")
    print("\n".join(lines))
    for body, row in report.items():
        print(
            f"\n{body}: disagreements off the boundary: hurwitz and poles "
            f"{row['disagree_hurwitz_poles']} of {points}, poles and python-control "
            f"{row['disagree_poles_control']} of {PEER_POINTS}"
        )
    if arguments.rows:
        limits = {
            "hurwitz": "arithmetic of six coefficients a point",
            "poles": "LAPACK's eigenvalues of small matrices",
        }
        write(
            [
                Row(
                    f"stability of a point, {body}, {method}", 1 / row["rates"][method],
                    "python-control", 1 / row["rates"]["control"],
                    0.0, 0.0, target, limits[method],
                )
                for body, row in report.items()
                for method, target in TARGETS.items()
            ],
            arguments.rows,
        )  # fmt: skip
    if arguments.json:
        arguments.json.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
