"""Pictures and report of an assessed record, and of a simulation beside it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from seatdyn.output.bodies import frequency_axis
from seatdyn.output.report import figure_png, write_page
from seatdyn.standards.exposure import (
    ACTION_VALUES,
    COMFORT_SOURCE,
    DAY,
    HOUR,
    LIMIT_VALUES,
    ZONE_RMS,
    ZONE_TEXT,
    ZONE_VDV,
    ZONES_MEANT_FOR,
)
from seatdyn.standards.metrics import (
    AXIS_FACTORS,
    CREST_LIMIT,
    EVDV_FACTOR,
    MTVV_LIMIT,
    MTVV_TIME,
    VDV_LIMIT,
)
from seatdyn.standards.weighting import weighting

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH = 10.0  # inches
LOOKS, GRID = {"floor": "#8a8a8a", "simulated": "C3"}, "0.9"
UPPERMOST = 80.0  # Hz
SHOWN = (0.5, 40.0)  # Hz, of a transmissibility: below, a record of minutes says little
ACCIDENT = 1e-3  # share of frequencies at which channels without relation may look coherent
LARGEST_DIFFERENCE = 20.0  # dB, at which bars are cut off
RESULTS = {  # rows of the table: variable, unit, digits
    "weighted r.m.s.": ("weighted_rms", "m/s²"),
    "peak, weighted": ("peak", "m/s²"),
    "crest factor": ("crest_factor", ""),
    "MTVV (linear, 1 s)": ("mtvv", "m/s²"),
    "VDV of the record": ("vdv", "m/s^1.75"),
    "eVDV": ("evdv", "m/s^1.75"),
    "MTVV / r.m.s.": ("mtvv_ratio", ""),
    "VDV / (r.m.s. T^¼)": ("vdv_ratio", ""),
    "A(8), k included": ("a8", "m/s²"),
    "daily VDV, k included": ("daily_vdv", "m/s^1.75"),
    "floor, weighted r.m.s.": ("floor_weighted_rms", "m/s²"),
}


def draw_assessment(figure: Figure, data: xr.Dataset) -> None:
    """Running r.m.s., band levels, and with a floor transmissibility and coherence, by axis."""
    axes = [str(axis) for axis in data.axis.values]
    isolated = "transmissibility" in data
    rows = 3 if isolated else 2
    figure.set_size_inches(WIDTH, 2.8 * rows)
    grid = figure.subplots(rows, len(axes), squeeze=False)
    for column, axis in enumerate(axes):
        one = data.sel(axis=axis)
        _running(grid[0, column], one, axis, json.loads(data.attrs["weightings"])[axis])
        bands = {"seat": one.band_rms.values}
        if "floor_band_rms" in data:
            bands["floor"] = one.floor_band_rms.values
        _bands(grid[1, column], data.band.values, bands)
        if isolated:
            _transmissibility(grid[2, column], one)


def draw_weighting(figure: Figure, data: xr.Dataset) -> None:
    """Factor and phase of a frequency weighting, with the frequencies that were asked for."""
    f = data.frequency.values
    size, turn = figure.subplots(2, 1, sharex=True)
    size.loglog(f, data.weighting_factor)
    size.loglog(data.asked, data.asked_factor, "o", color="C1", markersize=5)
    size.set_ylabel(f"factor of {data.attrs['weighting']} [1]")
    size.set_title(f"{data.attrs['weighting']}: {data.attrs['use']}", fontsize="medium")
    turn.plot(f, data.weighting_phase)
    turn.set_ylabel("phase [°]")
    for ax in (size, turn):
        frequency_axis(ax, float(f[0]), float(f[-1]))
    size.set_xlabel("")


def _running(ax: Axes, one: xr.Dataset, axis: str, name: str) -> None:
    ax.plot(one.time, one.running_rms, linewidth=1.0)
    ax.axhline(float(one.weighted_rms), color="C1", linestyle="--", linewidth=1.2)
    ax.set_title(
        f"axis {axis}, {name}: r.m.s. {float(one.weighted_rms):.3g} m/s² (dashed), MTVV "
        f"{float(one.mtvv):.3g} m/s², VDV {float(one.vdv):.3g} m/s$^{{1.75}}$",
        fontsize="medium",
    )
    ax.set_xlabel("time [s]")
    ax.set_ylabel("running r.m.s. [m/s²]")
    ax.set_xlim(0.0, float(one.time[-1]))
    ax.set_ylim(bottom=0.0)
    _finish(ax)


def _bands(ax: Axes, centres: Any, levels: dict[str, Any]) -> None:
    edges = np.append(centres * 10**-0.05, centres[-1] * 10**0.05)
    for name, values in levels.items():
        look: dict[str, Any] = {"linewidth": 1.8}
        if name in LOOKS:
            look = {"color": LOOKS[name], "linestyle": "--"}
        ax.stairs(values, edges, baseline=None, label=name, **look)
    ax.set_xscale("log")
    ax.set_xticks([0.5, 1, 2, 4, 8, 16, 31.5, 63], ["0.5", "1", "2", "4", "8", "16", "31.5", "63"])
    ax.minorticks_off()
    ax.set_xlim(edges[0], edges[-1])
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel("third octave [Hz]")
    ax.set_ylabel("unweighted r.m.s. [m/s²]")
    _finish(ax)
    ax.legend(frameon=False)


def _transmissibility(ax: Axes, one: xr.Dataset) -> None:
    f = one.frequency.values
    inside = (f >= SHOWN[0]) & (f <= SHOWN[1])
    error = one.random_error.values[inside]
    # n averages of unrelated channels exceed this coherence with the probability `ACCIDENT`
    least = 1.0 - ACCIDENT ** (1.0 / max(float(one.averages) - 1.0, 1.0))
    related = one.coherence.values[inside] > least
    size = np.where(related, np.abs(one.transmissibility.values[inside]), np.nan)
    ax.plot(f[inside], size, label="|H1|")
    low, high = size * (1 - 2 * error), size * (1 + 2 * error)
    ax.fill_between(f[inside], np.maximum(low, 0.0), high, alpha=0.25, label="± 2 random errors")
    ax.plot(f[inside], one.coherence.values[inside], color="C1", linestyle=":", label="coherence")
    ax.axhline(1.0, color="black", linewidth=0.6)
    ax.set_xscale("log")
    ax.set_xticks([0.5, 1, 2, 4, 8, 16, 31.5], ["0.5", "1", "2", "4", "8", "16", "31.5"])
    ax.minorticks_off()
    ax.set_xlim(SHOWN)
    ax.set_ylim(0.0, max(1.2, 1.1 * float(np.nanmax(size, initial=0.0))))
    ax.set_xlabel("frequency [Hz]")
    ax.set_ylabel("seat/floor, coherence [1]")
    ax.set_title(
        ", ".join(f"{v.attrs['long_name']} {float(v):.3f}" for v in (one.seat_rms, one.seat_vdv)),
        fontsize="medium",
    )
    _finish(ax)
    ax.legend(frameon=False)


def draw_comparison(figure: Figure, data: xr.Dataset) -> None:
    """Band levels of measurement and simulation, and their difference below, by axis."""
    axes = [str(axis) for axis in data.axis.values]
    figure.set_size_inches(WIDTH, 6.5)
    grid = figure.subplots(2, len(axes), squeeze=False, sharex=True)
    for column, axis in enumerate(axes):
        one = data.sel(axis=axis)
        levels = {k: one[f"{k}_band_rms"].values for k in ("measured", "simulated")}
        _bands(grid[0, column], data.band.values, levels)
        grid[0, column].set_xlabel("")
        grid[0, column].set_title(f"axis {axis}", fontsize="medium")
        ax = grid[1, column]
        ax.bar(
            data.band.values,
            np.clip(
                np.nan_to_num(one.band_difference.values), -LARGEST_DIFFERENCE, LARGEST_DIFFERENCE
            ),
            width=0.18 * data.band.values,
        )
        ax.axhline(0.0, color="black", linewidth=0.8)
        ax.set_xlabel("third octave [Hz]")
        ax.set_ylabel(f"simulated over measured [dB], up to ±{LARGEST_DIFFERENCE:g}")
        _finish(ax)


def _finish(ax: Axes) -> None:
    ax.grid(True, color=GRID, linewidth=0.7)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)


def write_assessment(data: xr.Dataset, path: str | Path) -> Path:
    """Write an assessed record as one HTML file with everything in it.

    Parameters
    ----------
    data : result of `assess`
    path : ends in ``.html``, in a directory that exists

    Raises
    ------
    OutputError
        A place that cannot be written.
    """
    from seatdyn.output.figures import plot

    axes = [str(axis) for axis in data.axis.values]
    rows = [
        (label, [f"{float(data[name].sel(axis=axis)):.4g}" for axis in axes], unit)
        for label, (name, unit) in RESULTS.items()
        if name in data
    ]
    rows += [
        (data[name].attrs["long_name"], [f"{v:.4g}" for v in data[name].values.tolist()], "")
        for name in ("seat_rms", "seat_vdv")
        if name in data
    ]
    context = {
        "axes": axes,
        "rows": rows,
        "attrs": data.attrs,
        "hours": data.attrs["exposure"] / HOUR,
        "zones": {
            "r.m.s.": ZONE_TEXT[data.attrs["guidance_rms"]],
            "eVDV": ZONE_TEXT[data.attrs["guidance_vdv"]],
        },
        "zones_fit": ZONES_MEANT_FOR[0] <= data.attrs["exposure"] <= ZONES_MEANT_FOR[1],
        "isolated": "seat_rms" in data,
        "warnings": json.loads(data.attrs["warnings"]),
        "reasons": json.loads(data.attrs["reasons"]),
        "weightings": json.loads(data.attrs["weightings"]),
        "channels": json.loads(data.attrs["channels"]),
        "floor_channels": json.loads(data.attrs["floor_channels"]),
        "times": [
            (_daily(float(data[name].sel(axis=axis))), axis, text)
            for name, text in (("time_to_action", "action"), ("time_to_limit", "limit"))
            for axis in axes
        ],
        "constants": _constants(axes, json.loads(data.attrs["weightings"])),
        "picture": figure_png(plot(data)),
    }
    return write_page("assessment.html", context, path)


def _daily(time: float) -> str:
    return f"after {time / HOUR:.3g} h a day" if time <= DAY else "not within a day"


def _constants(axes: list[str], weightings: dict[str, str]) -> list[tuple[str, str, str, str]]:
    """What the numbers rest on: name, value, clause, grade."""
    rows = [
        (f"weighting {w.name}", "poles and zeros", w.clause, str(w.grade))
        for w in (weighting(name) for name in dict.fromkeys(weightings.values()))
    ]
    named = {f"k of axis {axis}": AXIS_FACTORS["health"][axis] for axis in axes} | {
        "integration time of MTVV": MTVV_TIME,
        "factor of eVDV": EVDV_FACTOR,
        "crest factor above which more is needed": CREST_LIMIT,
        "the same, MTVV / r.m.s.": MTVV_LIMIT,
        "the same, VDV ratio": VDV_LIMIT,
        "action value of A(8)": ACTION_VALUES["a8"],
        "limit value of A(8)": LIMIT_VALUES["a8"],
        "action value of VDV": ACTION_VALUES["vdv"],
        "limit value of VDV": LIMIT_VALUES["vdv"],
        "caution zone by r.m.s., lower end up to 10 min": ZONE_RMS["low"],
        "the same by r.m.s., upper end": ZONE_RMS["high"],
        "the same by eVDV, lower end": ZONE_VDV["low"],
        "the same by eVDV, upper end": ZONE_VDV["high"],
    }
    clause, grade = COMFORT_SOURCE
    rows.append(("likely reactions", "six bands", clause, str(grade)))
    return rows + [
        (name, f"{c.value:g} {c.unit}".removesuffix(" 1"), c.clause, str(c.grade))
        for name, c in named.items()
    ]
