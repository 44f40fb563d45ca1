"""Picture and report of a random response."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from seatdyn.output.report import figure_png, write_page
from seatdyn.output.seat_table import seat_rows

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

WIDTH = 10.0  # inches
MILLI = 1e3
GROUPS = {  # unit of the outputs: words of the axis, factor
    "m/s2": ("acceleration, r.m.s. [m/s²]", 1.0),
    "m": ("displacement, r.m.s. [mm]", MILLI),
    "m/s": ("velocity, r.m.s. [m/s]", 1.0),
    "N": ("force, r.m.s. [N]", 1.0),
}


def draw_random(figure: Figure, data: xr.Dataset) -> None:
    """R.m.s. values of all outputs with their intervals, an axes for each unit."""
    units = data.output_unit.values.astype(str)
    groups = [unit for unit in GROUPS if np.any(units == unit)]
    counts = [int(np.count_nonzero(units == unit)) for unit in groups]
    figure.set_size_inches(WIDTH, 1.5 + 0.32 * sum(counts) + 0.4 * len(groups))
    axes: Any = figure.subplots(
        len(groups), 1, squeeze=False, gridspec_kw={"height_ratios": [n + 1 for n in counts]}
    )
    for ax, unit in zip(axes[:, 0], groups, strict=True):
        label, factor = GROUPS[unit]
        one = data.isel(output=np.flatnonzero(units == unit))
        value = factor * one.rms.values
        low, high = (factor * one[f"rms_{end}"].values for end in ("low", "high"))
        place = np.arange(value.size)
        ax.errorbar(
            value, place, xerr=[value - low, high - value], fmt="o", capsize=4, markersize=4
        )
        for y, x, text in zip(place, high, value, strict=True):
            ax.annotate(
                f"{text:.4g}", (x, y), xytext=(8, 0), textcoords="offset points",
                va="center", fontsize="small",
            )  # fmt: skip
        ax.set_yticks(place, one.output.values)
        ax.set_ylim(value.size - 0.5, -0.5)
        ax.set_xlim(0.0, 1.15 * float(np.nanmax(high)))
        ax.set_xlabel(label)
        ax.grid(True, axis="x", color="0.9", linewidth=0.7)
        ax.set_axisbelow(True)
        ax.spines[["top", "right"]].set_visible(False)
    attrs = data.attrs
    figure.suptitle(
        f"{attrs['realisations']} realisations of {attrs['duration_s']:g} s, "
        f"{100 * attrs['confidence']:g} % intervals",
        fontsize="medium",
    )


def write_random(data: xr.Dataset, path: str | Path) -> Path:
    """Write a random response as one HTML file with everything in it.

    Parameters
    ----------
    data : result of `random_response`
    path : ends in ``.html``, in a directory that exists

    Raises
    ------
    OutputError
        A place that cannot be written.
    """
    from seatdyn.output.figures import plot

    columns = [data[name].values for name in ("rms", "rms_low", "rms_high", "lowest", "highest")]
    rows = [
        (str(name), [f"{value:.4g}" for value in values], str(unit))
        for name, unit, *values in zip(
            data.output.values, data.output_unit.values, *columns, strict=True
        )
    ]
    context = {
        "attrs": data.attrs,
        "rows": rows,
        "seat": seat_rows(data.attrs["seat_description"]),
        "picture": figure_png(plot(data)),
    }
    return write_page("random.html", context, path)
