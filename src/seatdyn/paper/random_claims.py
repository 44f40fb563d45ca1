"""What is said about how Tables 9 and 10 must be read, checked on a computation of both."""

from __future__ import annotations

from typing import Any

import numpy as np

from seatdyn.paper.claims_text import Claim
from seatdyn.paper.random_cases import AS_READ, CONSISTENT, REVERSED, RandomCase, members
from seatdyn.paper.random_tables import PrintedRatios, printed_ratios
from seatdyn.paper.tables import Array

NOISE_TARGET = 0.012  # r.m.s. deviation of the quadratic ratios
DRIFT_TARGET = 4e-4  # the same of relative displacements
ACCELERATIONS, RELATIVE = slice(0, 3), slice(3, 6)

Ratios = dict[int, dict[str, Array]]


def random_claims(ratios: Ratios) -> list[Claim]:
    """Judge every statement."""
    return [
        _noise(ratios),
        _drift(ratios),
        _columns(),
        _piecewise(ratios),
        _coulomb(ratios),
    ]


def _rms(ratios: Ratios, reading: str, law: str, groups: tuple[str, ...]) -> dict[str, float]:
    """Largest r.m.s. deviation of some column groups, by table."""
    found = {}
    for number, computed in ratios.items():
        statistics = printed_ratios(number).statistics(computed[reading][0])
        found[f"table{number:02d}"] = max(statistics[g]["laws"][law]["rms"] for g in groups)
    return found


def _listed(numbers: dict[str, float], digits: int) -> str:
    """Shares as text."""
    return ", ".join(f"{100 * v:.{digits}f} % (Table {int(k[-2:])})" for k, v in numbers.items())


def _noise(ratios: Ratios) -> Claim:
    """One noise model for both tables."""
    numbers = _rms(ratios, CONSISTENT.name, "beta1", ("acceleration", "force"))
    good = all(v <= NOISE_TARGET for v in numbers.values())
    return Claim(
        "noise",
        "Gaussian noise of 0.686 m/s² r.m.s. through a resonant filter of 0.015 Hz half-power "
        "bandwidth at 1.55 and 1.58 Hz gives the accelerations and forces of Tables 9 and 10 with "
        f"quadratic damping to {100 * NOISE_TARGET:.1f} % r.m.s.",
        _listed(numbers, 2) + ".",
        "confirmed" if good else "not confirmed",
        numbers,
    )


def _drift(ratios: Ratios) -> Claim:
    """The base of the paper's random runs drifts."""
    drifting = _rms(ratios, AS_READ.name, "beta1", ("relative",))
    steady = _rms(ratios, CONSISTENT.name, "beta1", ("relative",))
    good = all(v <= DRIFT_TARGET for v in drifting.values())
    return Claim(
        "drift",
        "The relative displacements of Tables 9 and 10 come from runs of 30 s on a base that "
        "drifts with a/ω: the body reacts to its absolute position, so the drift hides the "
        "vibration.",
        f"Left with quadratic damping: {_listed(drifting, 3)}; without drift {_listed(steady, 0)}.",
        "confirmed" if good else "not confirmed",
        {"with_drift": drifting, "without": steady},
    )


def _columns() -> Claim:
    """The Coulomb columns stand in reverse."""
    numbers: dict[str, Any] = {}
    for number in (9, 10):
        table = printed_ratios(number)
        numbers[table.key] = {
            "as_headed": _spread(table, {v: v for v in REVERSED}),
            "reversed": _spread(table, REVERSED),
        }
    good = all(n["reversed"] < 0.2 < n["as_headed"] for n in numbers.values())
    texts = [
        f"Table {int(k[-2:])}: {n['reversed']:.3f}, as headed {n['as_headed']:.2f}"
        for k, n in numbers.items()
    ]
    return Claim(
        "coulomb_columns",
        "The Coulomb columns of Tables 9 and 10 stand in reverse order (40, 20, 10 N): only then "
        "1 − T goes with β₂/n, as it must.",
        "Standard deviation of ln((1 − T) n/β₂) over the printed accelerations, copied cells left "
        "out. " + "; ".join(texts) + ".",
        "confirmed" if good else "not confirmed",
        numbers,
    )


def _spread(table: PrintedRatios, friction: dict[float, float]) -> float:
    """How far the print is from 1 - T in proportion to beta2/n; a column has its own constant."""
    rows = [i for i, (parameter, _, _) in enumerate(table.rows) if parameter == "beta2"]
    over = np.array([table.rows[i][2] / friction[table.rows[i][1]] for i in rows])
    logs = np.log(np.abs(1.0 - table.values[rows, ACCELERATIONS]) * over[:, None])
    logs[table.excluded[rows, ACCELERATIONS]] = np.nan
    return float(np.nanstd(logs - np.nanmean(logs, axis=0)))


def _piecewise(ratios: Ratios) -> Claim:
    """The ratios of formula (3) do not depend on the level."""
    numbers: dict[str, Any] = {}
    texts = []
    for number, computed in ratios.items():
        table = printed_ratios(number)
        found = {}
        for value in (100.0, 500.0, 1000.0):
            row = table.rows.index(("gamma", value, 4))
            found[f"{value:g}"] = {
                "printed": float(table.values[row, 0]),
                "computed": float(computed[AS_READ.name][0, row, 0]),
            }
        numbers[table.key] = found
        pairs = (f"{v['computed']:.4f} ({v['printed']:.4f})" for v in found.values())
        texts.append(f"Table {number}: " + ", ".join(pairs))
    return Claim(
        "piecewise_ratios",
        "The printed ratios of formula (3) do not depend on the level, so no free zone acted: a "
        "spring γ beside c_m, under noise at the damped frequencies 1.54 and 1.57 Hz.",
        "T of m1 at γ = 100, 500, 1000 N/m, in brackets the print. "
        + "; ".join(texts)
        + ". The ratios at 100 N/m cannot be had together with the others.",
        "open",
        numbers,
    )


def _coulomb(ratios: Ratios) -> Claim:
    """Friction with an offset, and what no friction can do."""
    left = _rms(ratios, AS_READ.name, "beta2", ("acceleration", "force"))
    table = printed_ratios(9)
    row = table.labels.index("beta2=10, a0")  # 40 N in truth
    inner, outer, other = table.values[row, RELATIVE]
    size, first, second = np.sqrt(members(RandomCase(AS_READ, False)).squares.mean(0))[RELATIVE]
    longest = float((outer * first + other * second) / size)
    return Claim(
        "coulomb_ratios",
        "With the columns reversed, a constant 0.6 m/s in the argument of (5) gives the weak "
        "effect of friction on accelerations and forces in Table 9; in Table 10 friction would "
        "have to add energy.",
        f"Left: {_listed(left, 2)}. No offset gives ratios above 1, as Table 10 prints. No motion "
        "at all gives the relative displacements of Table 9: x2 − x1 is the difference of x2 − x "
        "and x1 − x, so with the r.m.s. values of the linear run and the ratios of these two at "
        f"40 N and a0 its own ratio is at most {longest:.4f}; printed is {inner:.4f}.",
        "open",
        {"left": left, "x2_minus_x1_printed": float(inner), "x2_minus_x1_at_most": longest},
    )
