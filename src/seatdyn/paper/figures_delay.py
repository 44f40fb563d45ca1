"""Our own figures about reaction delay: amplitudes over the delay, and how much delay is borne."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from seatdyn.analysis.stability import stability_map
from seatdyn.output.style import label, line, new_figure
from seatdyn.paper.cases import AMPLITUDE, DAMPING, FREQUENCY, paper_system
from seatdyn.paper.delay_study import (
    BOUNDED,
    GROWS,
    LONGEST,
    PERIODIC,
    VALUES,
    Sweep,
    sweep,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

POSTURES = {False: "back-off", True: "back-on"}
TITLES = {
    "linear": "linear",
    "gamma": f"piecewise force (3), γ = {VALUES['gamma']:g} N/m",
    "beta1": f"quadratic damping (4), $\\beta_1$ = {VALUES['beta1']:g} N s²/m²",
    "beta2": f"Coulomb force (5), $\\beta_2$ = {VALUES['beta2']:g} N",
}
SYMBOLS = ("$m_1$", "$m_2$", "seat $m_0$", "spring", "damper", "non-linear")
HIGHEST = 3.0  # times the largest amplitude within the first half of the margin: top of a panel
GRID = 300
DAMPINGS = 4.0  # largest damping of the map over that of the paper


@dataclass(frozen=True)
class OwnFigure:
    """A figure that the paper does not have."""

    key: str
    caption: str
    draw: Callable[[], Figure]


def draw_sweep(back_on: bool) -> Figure:
    """Accelerations (left) and suspension forces (right) over the delay, a row for each law."""
    figure, axes = new_figure(len(VALUES), 2, height=210, sharex=True)
    for row, parameter in enumerate(VALUES):
        found = sweep(back_on, parameter)
        for column, (first, last) in enumerate(((0, 3), (3, 6))):
            panel = axes[2 * row + column]
            shown = [i for i in range(first, last) if parameter != "linear" or i < 5]
            _draw_panel(panel, found, shown)
            unit = "m/s2" if column == 0 else "N"
            panel.set_ylabel(label("acceleration" if column == 0 else "force", unit))
        axes[2 * row].set_title(TITLES[parameter], loc="left")
    axes[0].set_title(
        f"{POSTURES[back_on]}, {AMPLITUDE} m/s² peak, {FREQUENCY[back_on]} Hz\n{TITLES['linear']}",
        loc="left",
    )
    for panel in axes[-2:]:
        panel.set_xlabel(label("delay of the suspension force", "ms"))
        panel.set_xlim(0.0, 1e3 * LONGEST)
    axes[0].text(
        1e3 * sweep(back_on, "linear").margin, 1.0,
        f" {1e3 * sweep(back_on, 'linear').margin:.2f} ms", va="bottom",
        transform=axes[0].get_xaxis_transform(),
    )  # fmt: skip
    handles, labels = axes[4].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower left", ncols=3, handlelength=3.2)
    handles, labels = axes[5].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower right", ncols=3, handlelength=3.2)
    return figure


def _draw_panel(panel: Axes, found: Sweep, shown: list[int]) -> None:
    """Amplitudes while the motion is periodic; maximum and minimum where it is only bounded."""
    delays = 1e3 * np.array([r.delay for r in found.responses])
    kinds = np.array([r.kind for r in found.responses])
    high = np.array([r.high for r in found.responses])
    low = np.array([r.low for r in found.responses])
    periodic, bounded = kinds == PERIODIC, kinds == BOUNDED
    for i in shown:
        amplitude = np.where(periodic, (high[:, i] - low[:, i]) / 2, np.nan)
        panel.plot(delays, amplitude, label=SYMBOLS[i], **line(i % 3))
        if np.any(bounded):
            for marks, values in (("^", high), ("v", -low)):
                panel.plot(
                    delays[bounded], values[bounded, i], marks, color=line(i % 3)["color"],
                    markersize=3,
                )  # fmt: skip
    panel.axvline(1e3 * found.margin, color="black", linewidth=0.8, linestyle=(0, (2, 2)))
    if found.outer < found.margin:
        panel.axvline(1e3 * found.outer, color="black", linewidth=0.8, linestyle=(0, (6, 2, 1, 2)))
    top = panel.get_ylim()[1]
    early = periodic & (delays <= 500.0 * found.margin)
    largest = np.nanmax((high[early] - low[early])[:, shown] / 2)
    panel.set_ylim(0.0, min(top, max(HIGHEST * largest, 0.0)) if largest > 0.0 else top)
    grows = delays[kinds == GROWS]
    if grows.size or delays[-1] < 1e3 * LONGEST:
        begin = float(grows.min()) if grows.size else 1e3 * found.margin
        panel.axvspan(begin, 1e3 * LONGEST, color="#e6e6ec", zorder=0, linewidth=0)
        panel.text(
            0.5 * (begin + 1e3 * LONGEST), 0.5, "grows", ha="center", va="center",
            transform=panel.get_xaxis_transform(),
        )  # fmt: skip


def draw_margin() -> Figure:
    """Stable region over damping and delay, both bodies."""
    figure, axes = new_figure(1, 2, height=85, sharey=True)
    dampings = np.linspace(0.0, DAMPINGS * DAMPING, GRID)
    delays = np.linspace(0.0, LONGEST, GRID)
    for panel, back_on in zip(axes, (False, True), strict=True):
        stable = stability_map(paper_system(back_on), damping=dampings, delay=delays)["stable"]
        panel.contourf(
            dampings, 1e3 * delays, stable.values.T.astype(float), levels=[-0.5, 0.5],
            colors=["#e6e6ec"],
        )  # fmt: skip
        panel.contour(
            dampings, 1e3 * delays, stable.values.T.astype(float), levels=[0.5],
            colors=[line(0)["color"]], linewidths=1.3,
        )  # fmt: skip
        margin = sweep(back_on, "linear").margin
        panel.plot(DAMPING, 1e3 * margin, marker="*", color="black", markersize=8, linestyle="none")
        panel.annotate(
            f"{1e3 * margin:.2f} ms", (DAMPING, 1e3 * margin), xytext=(6, 4),
            textcoords="offset points",
        )  # fmt: skip
        panel.text(0.17 * dampings[-1], 45.0, "unstable", ha="center", fontweight="bold")
        panel.text(0.45 * dampings[-1], 5.0, "stable", ha="center", fontweight="bold")
        panel.set_title(f"{POSTURES[back_on]} + VIS, linear, whole force late", loc="left")
        panel.set_xlabel(label("damping $\\alpha_m$", "N s/m"))
    axes[0].set_ylabel(label("delay", "ms"))
    return figure


OWN_FIGURES = (
    *(
        OwnFigure(
            f"delay_{'on' if back_on else 'off'}",
            f"Accelerations and suspension forces, {POSTURES[back_on]}, over a delay of the whole "
            "suspension force, from rest. Lines: amplitude of the periodic motion. Triangles, if "
            "any: maximum and minimum (sign turned) of a bounded motion that is not periodic. "
            "Dotted: the delay at which the linear part loses stability; dash-dotted: the same "
            "with the spring of the outer zone. Grey: the motion grows without bound.",
            partial(draw_sweep, back_on),
        )
        for back_on in (False, True)
    ),
    OwnFigure(
        "delay_margin",
        "Where body and linear suspension are stable (white) if the whole suspension force is "
        "late. Star: the paper's damping, with the delay at which stability is lost.",
        draw_margin,
    ),
)
