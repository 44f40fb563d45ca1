"""Figures 28 to 31: ratios of r.m.s. values over the level, quadratic damping."""

from __future__ import annotations

from typing import TYPE_CHECKING

from seatdyn.output.style import line, marker, new_figure
from seatdyn.paper.random_cases import AS_READ, CONSISTENT
from seatdyn.paper.random_tables import RATIO_OUTPUTS, printed_ratios
from seatdyn.paper.tables import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COEFFICIENTS = (100.0, 500.0, 1000.0)  # N s2/m2
LEVELS = (1, 2, 4, 8)  # times a_0
ACCELERATIONS = ("acc_m1", "acc_m2", "acc_seat")
FORCES = ("F_suspension", "F_body")
NAMES = {
    "acc_m1": "$T_{xb1}$, acceleration of $m_1$",
    "acc_m2": "$T_{xb2}$, of $m_2$",
    "acc_seat": "$T_{xb}$, of the seat",
    "F_suspension": "$T_{VIS}$, force of the suspension",
    "F_body": "$T_{MOD}$, force of the body",
}


def draw_ratios(
    number: int, outputs: tuple[str, ...], computed: dict[int, dict[str, Array]]
) -> Figure:
    """Ratios of Table 9 or 10: print as markers, readings as lines, the interval of one shaded."""
    table = printed_ratios(number)
    figure, axes = new_figure(1, len(outputs), height=85, sharey=True)
    for panel, output in zip(axes, outputs, strict=True):
        column = RATIO_OUTPUTS.index(output)
        for i, value in enumerate(COEFFICIENTS):
            rows = [table.rows.index(("beta1", value, n)) for n in LEVELS]
            style = line(i)
            ratio, low, high = computed[number][AS_READ.name][:, rows, column]
            name = f"$\\beta_1$ = {value:g} N s²/m²"
            panel.fill_between(LEVELS, low, high, color=style["color"], alpha=0.15, linewidth=0)
            panel.plot(LEVELS, ratio, label=name, **style)
            steady = computed[number][CONSISTENT.name][0, rows, column]
            panel.plot(LEVELS, steady, **(style | {"linewidth": 0.6, "alpha": 0.8}))
            panel.plot(LEVELS, table.values[rows, column], zorder=3, **marker(i))
        panel.set_xscale("log", base=2)
        panel.set_xticks(LEVELS, ["$a_0$", *(f"{n}$a_0$" for n in LEVELS[1:])])
        panel.set_title(NAMES[output], loc="left")
        panel.set_xlabel("r.m.s. level of the base")
    axes[0].set_ylabel("non-linear over linear")
    axes[0].set_ylim(0.0, 1.0)
    posture = "back-on" if table.back_on else "back-off"
    figure.suptitle(
        f"{posture}, Table {number}. Markers: printed; thick: as_read with its 95 % interval; "
        "thin: consistent",
        fontsize="medium",
    )
    handles, texts = axes[0].get_legend_handles_labels()
    figure.legend(handles, texts, loc="outside lower center", ncols=3, handlelength=3.2)
    return figure
