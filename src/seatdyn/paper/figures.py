"""Figures 2 and 4 to 31: what each shows, and how it is drawn from results."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np

from seatdyn.output.style import label, legend_below, line, marker, new_figure
from seatdyn.paper.cases import (
    AMPLITUDE,
    AS_PRINTED,
    AS_READ,
    FREQUENCY,
    PRINTED_ZONE,
    READ_ZONE,
    Case,
    solve,
)
from seatdyn.paper.figure_stability import draw_stability
from seatdyn.paper.figures_random import ACCELERATIONS, FORCES, draw_ratios
from seatdyn.paper.tables import OUTPUTS, Array, printed_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Computed = dict[int, dict[str, Array]]
GAMMAS = (0.0, 100.0, 500.0, 1000.0)  # N/m
LEVELS = (1, 2, 4, 8)  # times a_0
# The paper does not say at which coefficient the levels are shown; these are ours.
SHOWN_QUADRATIC = 500.0  # N s2/m2, the middle of Tables 5 and 6
SHOWN_COULOMB = 50.0  # N, the last row of Tables 7 and 8
PERIODS = 2
POSTURES = {False: "back-off", True: "back-on"}
SYMBOLS = {
    "acc_m1": "$m_1$",
    "acc_m2": "$m_2$",
    "acc_seat": "seat $m_0$",
    "F_damper": "$F_a$",
    "F_spring": "$F_c$",
    "F_linear": "$F_c + F_a$",
}


@dataclass(frozen=True)
class PaperFigure:
    """One figure of the paper: its number, our caption, and how to draw it."""

    number: int
    caption: str
    draw: Callable[[Computed], Figure]

    @property
    def key(self) -> str:
        """Name of its files."""
        return f"fig{self.number:02d}"


@dataclass(frozen=True)
class History:
    """Two periods of a steady state: time s, seat acceleration m/s2, forces N."""

    time: Array
    acceleration: Array
    suspension: Array
    nonlinear: Array


@cache
def history(case: Case) -> History:
    """Time histories of one case."""
    data = solve(case.system, case.excitation)
    period = 1.0 / case.frequency
    time = data.time.values

    def repeated(values: Array) -> Array:
        return np.tile(values, PERIODS)

    force = data.element_force.values
    return History(
        np.concatenate([time + k * period for k in range(PERIODS)]),
        repeated(data.acceleration.sel(node="seat").values),
        repeated(data.suspension_force.values),
        repeated(force[2:].sum(axis=0)),
    )


def _cases(parameter: str, back_on: bool) -> dict[str, Case]:
    """The four histories of a figure: label -> case, under the reading that fits its table."""
    f = FREQUENCY[back_on]
    if parameter == "gamma":
        return {
            f"$\\gamma$ = {value:g} N/m": Case(
                back_on, parameter, value, f, AMPLITUDE, zone=READ_ZONE if value else PRINTED_ZONE
            )
            for value in GAMMAS
        }
    cases = {}
    for n in LEVELS:
        level = n * AMPLITUDE
        value = SHOWN_QUADRATIC if parameter == "beta1" else SHOWN_COULOMB
        offset = level / (2 * math.pi * f) if parameter == "beta2" else 0.0
        name = "$a_0$" if n == 1 else f"{n}$a_0$"
        cases[name] = Case(back_on, parameter, value, f, level, offset=offset)
    return cases


def _head(parameter: str, back_on: bool) -> str:
    """Title: model and reading."""
    law = {
        "gamma": "piecewise force (3), free zone −0.01 … +0.01 m",
        "beta1": f"quadratic damping (4), $\\beta_1$ = {SHOWN_QUADRATIC:g} N s²/m²",
        "beta2": f"Coulomb force (5), $\\beta_2$ = {SHOWN_COULOMB:g} N, offset $A/\\omega$",
    }[parameter]
    level = "" if parameter == "gamma" else "$a_0$ = "
    return (
        f"{POSTURES[back_on]}, {law}\n"
        f"reading as_read, {level}{AMPLITUDE} m/s² peak, {FREQUENCY[back_on]} Hz"
    )


def draw_acceleration(parameter: str, back_on: bool, _: Computed) -> Figure:
    """Time history of the seat acceleration."""
    figure, (axes,) = new_figure(height=85)
    for i, (name, case) in enumerate(_cases(parameter, back_on).items()):
        shown = history(case)
        axes.plot(shown.time, shown.acceleration, label=name, **line(i))
    axes.set(xlabel=label("time", "s"), ylabel=label("seat acceleration", "m/s2"))
    axes.set_title(_head(parameter, back_on), loc="left")
    axes.set_xlim(0.0, PERIODS / FREQUENCY[back_on])
    legend_below(figure, axes, 4)
    return figure


def draw_force(parameter: str, back_on: bool, _: Computed) -> Figure:
    """Time history of the non-linear force; for (4) and (5) under the total suspension force."""
    rows = 1 if parameter == "gamma" else 2
    figure, axes = new_figure(rows, height=50 + 40 * rows, sharex=True)
    for i, (name, case) in enumerate(_cases(parameter, back_on).items()):
        shown = history(case)
        axes[-1].plot(shown.time, shown.nonlinear, label=name, **line(i))
        if rows == 2:
            axes[0].plot(shown.time, shown.suspension, **line(i))
    symbol = {"gamma": "F", "beta1": "R", "beta2": "T"}[parameter]
    axes[-1].set(xlabel=label("time", "s"), ylabel=label(f"${symbol}$", "N"))
    if rows == 2:
        axes[0].set_ylabel(label("$F_{VIS}$", "N"))
    axes[0].set_title(_head(parameter, back_on), loc="left")
    axes[0].set_xlim(0.0, PERIODS / FREQUENCY[back_on])
    legend_below(figure, axes[-1], 4)
    return figure


def draw_influence(number: int, outputs: tuple[tuple[str, ...], ...], computed: Computed) -> Figure:
    """Columns of a table over its parameter: print as markers, both readings as lines."""
    table = printed_table(number)
    figure, axes = new_figure(len(outputs), height=55 + 35 * len(outputs), sharex=True)
    names = {"gamma": "\\gamma", "beta1": "\\beta_1", "beta2": "\\beta_2"}
    symbol = names[table.parameter]
    symbols = SYMBOLS | {
        "F_damper+nonlinear": f"$F_a + F_{{{symbol}}}$",
        "F_nonlinear": f"$F_{{{symbol}}}$",
    }
    i = 0
    for panel, group in zip(axes, outputs, strict=True):
        for output in group:
            column = OUTPUTS.index(output)
            values = {name: array[:, column] for name, array in computed[number].items()}
            panel.plot(table.rows, values[AS_READ.name], label=symbols[output], **line(i))
            panel.plot(
                table.rows, values[AS_PRINTED.name], **(line(i) | {"linewidth": 0.6, "alpha": 0.8})
            )
            panel.plot(table.rows, table.values[:, column], clip_on=False, zorder=3, **marker(i))
            i += 1
        unit = "m/s2" if group[0].startswith("acc") else "N"
        what = "acceleration amplitude" if unit == "m/s2" else "force amplitude"
        panel.set_ylabel(label(what, unit))
    unit = {"gamma": "N/m", "beta1": "N s2/m2", "beta2": "N"}[table.parameter]
    axes[-1].set_xlabel(label(f"${symbol}$", unit))
    axes[0].set_xlim(0.0, table.rows[-1])
    f = FREQUENCY[table.back_on]
    axes[0].set_title(
        f"{POSTURES[table.back_on]}, Table {number}, {AMPLITUDE} m/s² peak, {f} Hz\n"
        "markers: printed; thick: as_read; thin: as_printed",
        loc="left",
    )
    handles = [h for panel in axes for h in panel.get_legend_handles_labels()[0]]
    texts = [t for panel in axes for t in panel.get_legend_handles_labels()[1]]
    figure.legend(handles, texts, loc="outside lower center", ncols=5, handlelength=3.2)
    return figure


def _figures() -> tuple[PaperFigure, ...]:
    figures = [
        PaperFigure(
            2,
            "Stability of body and linear suspension over seat mass and damping for four "
            "stiffnesses: N unstable (filled for c_m), S stable. Left back-on as in the "
            "paper, right back-off, which the paper calls always stable.",
            lambda _: draw_stability(),
        )
    ]
    accelerations = (("acc_m1", "acc_m2", "acc_seat"),)
    forces = (("F_spring", "F_linear"), ("F_damper", "F_damper+nonlinear", "F_nonlinear"))
    laws = {"gamma": (4, "F", "γ"), "beta1": (12, "R", "β₁"), "beta2": (20, "T", "β₂")}
    for k, (parameter, (first, force, symbol)) in enumerate(laws.items()):
        for back_on in (False, True):
            start, table = first + 4 * back_on, 3 + 2 * k + back_on
            body = POSTURES[back_on]
            varied = (
                "γ = 0, 100, 500, 1000 N/m" if parameter == "gamma" else "levels a₀, 2a₀, 4a₀, 8a₀"
            )
            shown = (
                f"restoring force {force}(t)"
                if parameter == "gamma"
                else (f"suspension force F_VIS(t) (top) and {force}(t) in it (bottom)")
            )
            figures += [
                PaperFigure(
                    start,
                    f"Seat acceleration, {body}, {varied}.",
                    partial(draw_acceleration, parameter, back_on),
                ),
                PaperFigure(
                    start + 1,
                    f"{shown[0].upper()}{shown[1:]}, {body}, {varied}.",
                    partial(draw_force, parameter, back_on),
                ),
                PaperFigure(
                    start + 2,
                    f"Influence of {symbol} on the accelerations, {body} (Table {table}).",
                    partial(draw_influence, table, accelerations),
                ),
                PaperFigure(
                    start + 3,
                    f"Influence of {symbol} on the suspension forces, {body} (Table {table}).",
                    partial(draw_influence, table, forces),
                ),
            ]
    for back_on in (False, True):
        for k, (what, outputs) in enumerate(
            {"accelerations": ACCELERATIONS, "forces": FORCES}.items()
        ):
            figures.append(
                PaperFigure(
                    28 + 2 * back_on + k,
                    f"Ratios of the r.m.s. {what}, quadratic over linear damping, "
                    f"{POSTURES[back_on]}, under narrow-band noise (Table {9 + back_on}). The "
                    "paper does not say which ratios it shows.",
                    partial(draw_ratios, 9 + back_on, outputs),
                )
            )
    return tuple(figures)


FIGURES = _figures()
