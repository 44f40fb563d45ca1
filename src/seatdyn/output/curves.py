"""Pictures of response curves: stable parts solid, unstable ones dashed, folds marked."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from seatdyn.output.style import COLOURS

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHOWN = ("seat-base", "acc_seat")  # where the Dataset holds more outputs than two
MARKS = {
    "fold": "o",
    "period doubling": "s",
    "Neimark-Sacker": "D",
    "branch point": "^",
    "graze": "x",
    "break": "|",
}
MILLI = 1e3


def draw_curves(figure: Figure, data: xr.Dataset) -> None:
    """Amplitude over the parameter for every level; one panel an output."""
    known = data.output.values.tolist()
    names = known if len(known) <= len(SHOWN) else [name for name in SHOWN if name in known]
    if "level" not in data.dims:
        data = data.expand_dims("level")
    panels = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for ax, name in zip(panels, names, strict=True):
        _panel(ax, data, name)
    parameter = data.attrs["parameter"]
    panels[-1].set_xlabel(f"{parameter} [{data[parameter].attrs['units']}]")


def _panel(ax: Axes, data: xr.Dataset, name: str) -> None:
    unit = str(data.output_unit.sel(output=name).item())
    factor, unit = (MILLI, "mm") if unit == "m" else (1.0, unit)
    parameter = data.attrs["parameter"]
    seen: set[str] = set()
    for k in range(data.sizes["level"]):
        row = data.isel(level=k)
        x = row[parameter].to_numpy()
        y = factor * row["amplitude"].sel(output=name).to_numpy()
        stable = row["stable"].to_numpy().astype(bool) & np.isfinite(x)
        colour = COLOURS[k % len(COLOURS)]
        # a piece belongs to the unstable part where one of its ends does
        through = np.where(stable, y, np.nan)
        unstable = ~stable & np.isfinite(x)
        broken = np.where(unstable | np.roll(unstable, 1) | np.roll(unstable, -1), y, np.nan)
        ax.plot(x, broken, "--", color=colour, linewidth=1.0)
        ax.plot(x, through, color=colour, linewidth=1.6, label=_label(row))
        for j, kind in enumerate(row["event_kind"].values.tolist()):
            if kind:
                place = float(row[f"event_{parameter}"][j])
                height = factor * float(row["event_amplitude"].sel(output=name)[j])
                style: dict[str, Any] = {"color": colour, "markerfacecolor": "white", "zorder": 3}
                label = kind if kind not in seen else None
                seen.add(kind)
                ax.plot([place], [height], MARKS[kind], label=label, **style)
    ax.set_ylabel(f"amplitude of {name} [{unit}]")
    ax.set_ylim(bottom=0.0)
    ax.grid(alpha=0.3)
    ax.legend(frameon=False, title="stable: solid, unstable: dashed")


def _label(row: xr.Dataset) -> str | None:
    if "level" not in row.coords or "kind" not in row["level"].attrs:
        return None
    level = row["level"]
    return f"{float(level):g} {level.attrs['units']} {level.attrs['kind']}"
