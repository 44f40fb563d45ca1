"""What is said about how the paper must be read, each statement tried again."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from seatdyn.analysis.boundary import critical_values
from seatdyn.analysis.linear import poles
from seatdyn.model.body import SeatedBody, load_body
from seatdyn.model.system import SeatSystem
from seatdyn.paper.cases import BODIES, DAMPING, STIFFNESS, paper_system
from seatdyn.paper.claims_fitted import FITTED
from seatdyn.paper.claims_text import Claim
from seatdyn.paper.misprints import read_rows

STIFFNESS_FACTORS = (0.1, 1.0, 2.0, 4.0)


def verify_claims(progress: Callable[[float, str], None]) -> list[Claim]:
    """Try every statement; the order is that of the report."""
    checks = (sign_sets, critical_points, *FITTED)
    claims = []
    for i, check in enumerate(checks):
        progress(i / len(checks), f"Readings: {check.__name__.replace('_', ' ')}")
        claims.append(check())
    return claims


def sign_sets() -> Claim:
    """Only one set of signs in (1) and (2) gives the poles of Table 2."""
    printed = {line["model"]: line for line in read_rows("table02.csv")}
    worst: dict[str, list[tuple[float, tuple[float, ...]]]] = {}
    for back_on, model in ((False, "back_off+VIS"), (True, "back_on+VIS")):
        line = printed[model]
        wanted = np.array([float(line[f"pole{i}_{k}_Hz"]) for i in (1, 2, 3) for k in ("re", "im")])
        found = []
        for signs in itertools.product((1.0, -1.0), repeat=4):
            body = _with_signs(load_body(BODIES[back_on]), signs)
            system = SeatSystem(body, paper_system(back_on).seat)
            upper = poles(system)
            if upper.sizes["mode"] != 3:  # a pair has become real: nothing like the print
                found.append((np.inf, signs))
                continue
            ours = np.column_stack([upper["real"], upper["imag"]])[::-1].ravel() / (2 * np.pi)
            found.append((float(np.max(np.abs(ours / wanted - 1.0))), signs))
        worst[model] = sorted(found)
    numbers: dict[str, Any] = {}
    for model, found in worst.items():
        numbers[model] = {"as_printed": found[0][0], "next_best": found[1][0]}
        numbers[model]["best_is_printed"] = found[0][1] == _printed_signs(model)
    good = all(
        n["best_is_printed"] and n["as_printed"] < 0.01 < 0.02 < n["next_best"]
        for n in numbers.values()
    )
    texts = [
        f"{model}: {100 * n['as_printed']:.2f} %, next best set {100 * n['next_best']:.0f} %"
        for model, n in numbers.items()
    ]
    return Claim(
        "signs",
        "Of the 16 sign sets in (1) and (2), only the printed one is within 2 % of the poles with "
        "suspension in Table 2.",
        "Largest deviation of a pole's part. " + "; ".join(texts) + ".",
        "confirmed" if good else "not confirmed",
        numbers,
    )


def _printed_signs(model: str) -> tuple[float, ...]:
    """Sign of the seat's motion in each of the four terms, relative to the mass's."""
    return (-1.0, -1.0, 1.0, 1.0) if model.startswith("back_off") else (1.0, -1.0, 1.0, -1.0)


def _with_signs(body: SeatedBody, signs: tuple[float, ...]) -> SeatedBody:
    """The body with these signs of the seat's motion in its feedback."""
    (force,) = body.feedback
    terms = tuple(
        replace(term, weights={**term.weights, "seat": sign})
        for term, sign in zip(force.terms, signs, strict=True)
    )
    return replace(body, feedback=(replace(force, terms=terms),))


def critical_points() -> Claim:
    """Where Figure 2 has its edges, and back-off is unstable at low damping."""
    back_on = {}
    for ratio, factor in itertools.product((2.0, 6.0, 12.0), STIFFNESS_FACTORS):
        system = paper_system(True, damping=ratio * DAMPING, stiffness=factor * STIFFNESS)
        back_on[f"alpha/260={ratio:g}, {factor:g} c_m"] = _critical(system, "seat_mass", 1.0, 100.0)
    back_off = {
        f"{factor:g} c_m": _critical(
            paper_system(False, stiffness=factor * STIFFNESS), "damping", 0.0, 1000.0
        )
        for factor in STIFFNESS_FACTORS
    }
    masses = [value for values in back_on.values() for value in values]
    dampings = [value for values in back_off.values() for value in values]
    single = all(len(v) == 1 for v in (*back_on.values(), *back_off.values()))
    return Claim(
        "stability",
        "Back-on is unstable below a seat mass of 20.8 to 31.1 kg (damping 2 to 12 times 260 N "
        "s/m); back-off, stable according to the paper, is unstable below 2.1, 27.4, 70.5, 207 N "
        "s/m at 0.1, 1, 2, 4 c_m and 35 kg.",
        f"Back-on: one critical mass each, {min(masses):.4f} to {max(masses):.4f} kg. Back-off: "
        + ", ".join(f"{value:.4f}" for value in dampings)
        + " N s/m, that is "
        + ", ".join(f"{value / DAMPING:.4f}" for value in dampings)
        + " of 260 N s/m. What the paper says of back-off does not hold at low damping.",
        "confirmed" if single else "not confirmed",
        {"back_on_seat_mass_kg": back_on, "back_off_damping_N_s_per_m": back_off},
    )


def _critical(system: SeatSystem, vary: str, low: float, high: float) -> list[float]:
    found = critical_values(system, vary=vary, low=low, high=high)
    return [float(v) for v in found["value"].values[found["verdict_changes"].values]]
