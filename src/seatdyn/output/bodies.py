"""Pictures of bodies beside each other."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from seatdyn.output.style import COLOURS, DASHES

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TICKS = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)  # Hz


def draw_bodies(figure: Figure, data: xr.Dataset) -> None:
    """Apparent mass over mass, head over seat, and seat over base where there is a seat."""
    panels: list[tuple[str, Any]] = [
        ("apparent mass over mass [1]", abs(data.apparent_mass) / data.mass),
        ("head/seat [1]", abs(data["head"])),
    ]
    if "transmissibility" in data:
        panels.append(("seat/base [1]", abs(data.transmissibility)))
    rows = 1 + len(panels) // 3
    figure.set_size_inches(figure.get_size_inches()[0], 4.0 * rows + (rows == 1))
    axes = figure.subplots(rows, 2, squeeze=False).ravel()
    f = data.frequency.values
    for ax, (label, values) in zip(axes, panels, strict=False):
        for i, name in enumerate(data.body.values):
            curve = values.isel(body=i).values
            if not np.all(np.isnan(curve)):
                ax.plot(f, curve, label=str(name), **body_line(i))
        ax.set_ylabel(label)
        ax.set_ylim(bottom=0.0)
        frequency_axis(ax, float(f.min()), float(f.max()))
    handles, labels = axes[0].get_legend_handles_labels()
    look: dict[str, Any] = {"frameon": False, "handlelength": 3.2}
    if len(panels) < len(axes):
        axes[-1].set_axis_off()
        axes[-1].legend(handles, labels, loc="center left", **look)
    else:
        figure.legend(handles, labels, loc="outside lower center", ncols=3, **look)


def body_line(i: int) -> dict[str, Any]:
    """Colour and dashes of the i-th body, different for 25 of them."""
    n = len(COLOURS)
    return {"color": COLOURS[i % n], "linestyle": DASHES[(i + i // n) % len(DASHES)]}


def frequency_axis(ax: Axes, low: float, high: float) -> None:
    """Logarithmic axis of frequencies with plain numbers."""
    ax.set_xscale("log")
    inside = [tick for tick in TICKS if low <= tick <= high]
    ax.set_xticks(inside, [f"{tick:g}" for tick in inside])
    ax.minorticks_off()
    ax.set_xlim(low, high)
    ax.set_xlabel("frequency [Hz]")
    ax.grid(True, color="0.9", linewidth=0.7)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)
