"""The look of every figure: sizes, colours that differ in grey too, line styles, units.

Figures are made as objects, never through pyplot, so that drawing leaves nothing behind.
"""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MM = 1.0 / 25.4  # inch
WIDTH = 160.0  # mm, the text width of a page
DPI = 160

# Dark to light, so that print in grey keeps the order; told apart by colour-blind readers too.
COLOURS = ("#1b1b3a", "#b8322a", "#1f77b4", "#d98c1f", "#5a9e6f")
DASHES: tuple[Any, ...] = (
    "solid",
    (0, (6, 2)),
    (0, (1.5, 1.5)),
    (0, (7, 2, 1.5, 2)),
    (0, (4, 1.5, 1.5, 1.5, 1.5, 1.5)),
)
MARKERS = ("o", "s", "^", "D", "v")

RC: dict[str, Any] = {
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.labelsize": 8.5,
    "legend.fontsize": 7.5,
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.5,
    "axes.axisbelow": True,
    "axes.linewidth": 0.7,
    "lines.linewidth": 1.3,
    "lines.markersize": 4,
    "legend.frameon": False,
    "mathtext.default": "regular",
    "svg.fonttype": "none",
    "svg.hashsalt": "seatdyn",  # equal figures give equal files
    "figure.constrained_layout.use": True,
    "figure.constrained_layout.w_pad": 0.06,  # inch
    "figure.constrained_layout.h_pad": 0.06,
}


def line(i: int) -> dict[str, Any]:
    """Colour and dashes of the i-th curve."""
    return {"color": COLOURS[i % len(COLOURS)], "linestyle": DASHES[i % len(DASHES)]}


def marker(i: int) -> dict[str, Any]:
    """Open marker of the i-th curve, without a line."""
    return {
        "color": COLOURS[i % len(COLOURS)],
        "marker": MARKERS[i % len(MARKERS)],
        "linestyle": "none",
        "markerfacecolor": "white",
        "markeredgewidth": 0.9,
    }


def label(quantity: str, unit: str) -> str:
    """Axis label ``quantity in unit``; units as SI symbols with exponents."""
    symbols = {
        "m/s2": "m/s²",
        "N s2/m2": "N s²/m²",
        "N s/m": "N s/m",
    }
    return f"{quantity} in {symbols.get(unit, unit)}"


def new_figure(
    rows: int = 1, columns: int = 1, *, height: float = 90.0, **options: Any
) -> tuple[Figure, list[Axes]]:
    """Figure of text width with its axes, row by row; `height` in mm."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH * MM, height * MM))
    axes = figure.subplots(rows, columns, squeeze=False, **options)
    return figure, list(axes.ravel())


def legend_below(figure: Figure, axes: Axes, columns: int) -> None:
    """Legend under the axes, where it covers no data."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, handlelength=3.2)


def render(draw: Callable[[], Figure]) -> tuple[bytes, bytes]:
    """Draw in this style; PNG and SVG as bytes, without a date in them."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    with rc_context(cast(Any, RC)):
        figure = draw()
        FigureCanvasAgg(figure)
        png, svg = io.BytesIO(), io.BytesIO()
        figure.savefig(png, format="png", dpi=DPI, metadata={"Software": None})
        figure.savefig(svg, format="svg", metadata={"Date": None})
    return png.getvalue(), svg.getvalue()
