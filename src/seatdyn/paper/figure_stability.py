"""Figure 2: where body and linear suspension are stable."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from seatdyn.analysis.boundary import stability_boundary
from seatdyn.analysis.stability import stability_map
from seatdyn.output.style import label, legend_below, line, new_figure
from seatdyn.paper.cases import DAMPING, SEAT_MASS, STIFFNESS, paper_system

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FACTORS = (0.1, 1.0, 2.0, 4.0)  # of c_m
# Ranges of seat mass (kg) and of damping over 260 N s/m shown, by back-on.
RANGES = {True: (45.0, 24.0), False: (100.0, 1.2)}
PLACES = {True: {"N": (8.0, 8.0), "S": (37.0, 16.0)}, False: {"N": (8.0, 0.075), "S": (70.0, 0.9)}}
GRID = 240
FREQUENCIES = np.linspace(0.02, 60.0, 60_000)  # Hz, along the boundary


def draw_stability() -> Figure:
    """Both bodies side by side; the region N is filled for the stiffness c_m."""
    figure, axes = new_figure(1, 2, height=95)
    for panel, back_on in zip(axes, (True, False), strict=True):
        _draw_body(panel, back_on)
    axes[0].set_title("back-on + VIS, linear", loc="left")
    axes[1].set_title("back-off + VIS, linear", loc="left")
    axes[0].set_ylabel("damping $\\alpha_m$ / (260 N s/m)")
    legend_below(figure, axes[0], 5)
    return figure


def _draw_body(axes: Axes, back_on: bool) -> None:
    """One panel: curves on which a pole crosses the axis, from their closed form."""
    mass, damping = RANGES[back_on]
    system = paper_system(back_on)
    boundary = stability_boundary(
        system, frequency=FREQUENCIES, stiffness=[factor * STIFFNESS for factor in FACTORS]
    )
    for i, factor in enumerate(FACTORS):
        curve = boundary.isel(stiffness=i)
        edge = curve["stable_edge"].values
        x = np.where(edge, curve["seat_mass"].values, np.nan)
        y = np.where(edge, curve["damping"].values / DAMPING, np.nan)
        name = "$c_m$" if factor == 1.0 else f"{factor:g} $c_m$"
        axes.plot(x, y, label=name, **line(i))
    masses = np.linspace(0.0, mass, GRID + 1)[1:]
    dampings = np.linspace(0.0, damping, GRID)
    stable = stability_map(
        system, seat_mass=masses, damping=dampings * DAMPING, stiffness=[STIFFNESS]
    )["stable"].values[..., 0]
    axes.contourf(
        masses, dampings, stable.T.astype(float), levels=[-0.5, 0.5], colors=["#e6e6ec"], zorder=0
    )
    axes.plot(SEAT_MASS, 1.0, marker="*", color="black", markersize=8, linestyle="none",
              label="paper's seat")  # fmt: skip
    for text, place in PLACES[back_on].items():
        axes.text(*place, text, fontsize=14, ha="center", va="center", fontweight="bold")
    axes.set(xlim=(0.0, mass), ylim=(0.0, damping))
    axes.set_xlabel(label("seat mass $m_0$", "kg"))
