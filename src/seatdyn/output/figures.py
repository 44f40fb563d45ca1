"""One call draws any Dataset: time histories, steady states, frequency responses, maps, poles."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from seatdyn.disk import write_whole
from seatdyn.errors import OutputError
from seatdyn.output.assessment import draw_assessment, draw_comparison, draw_weighting
from seatdyn.output.bodies import draw_bodies
from seatdyn.output.curves import draw_curves
from seatdyn.output.files import require_dataset, writable
from seatdyn.output.random import draw_random
from seatdyn.output.seat_test import draw_damping_test, draw_seat_test

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SUFFIXES = (".png", ".svg", ".pdf")
WIDTH = 10.0  # inches; at DPI 1200 px
DPI = 120
STABLE, UNSTABLE, BASE = "#cfe3f2", "#e8998d", "#8a8a8a"
MILLI = 1e3  # displacements are drawn in mm
MOST_MAPS = 6  # slices of a map over three parameters
MOST_CURVES = 9
NAMES = {
    "seat_mass": "seat mass",
    "damping": "suspension damping",
    "stiffness": "suspension stiffness",
}


def plot(dataset: xr.Dataset, path: str | Path | None = None, *, title: str = "") -> Figure:
    """Draw a Dataset in the way that fits what it holds.

    Parameters
    ----------
    dataset : result of `simulate`, `steady_state`, `frequency_response`, `stability_map`, `poles`,
        `zeros`, `compare_bodies`, `assess`, `compare_bands`, `random_response`, `seat_test`,
        `damping_test`, `response_curve` or `parameter_curve`, computed or loaded
    path : also write the picture there, ``.png`` (1200 px wide), ``.svg`` or ``.pdf``
    title : over the picture

    Returns
    -------
    matplotlib.figure.Figure
        Free of pyplot; change it and save it with its own `savefig`.

    Raises
    ------
    OutputError
        Nothing that this function knows how to draw, or `path` cannot be written.

    Examples
    --------
    >>> import seatdyn as sd
    >>> figure = sd.plot(sd.poles(sd.load_body("ksiazek1997_back_off")))
    >>> figure.axes[0].get_xlabel()
    'real part [1/s]'
    """
    from matplotlib.figure import Figure

    target = None if path is None else writable(path, SUFFIXES)
    require_dataset(dataset)
    names = set(dataset.variables)
    figure = Figure(figsize=(WIDTH, 7.0), dpi=DPI, layout="constrained")
    if "seat_rms_low" in names:
        draw_seat_test(figure, dataset)
    elif "inert_mass_kg" in dataset.attrs:
        draw_damping_test(figure, dataset)
    elif "event_kind" in names:
        draw_curves(figure, dataset)
    elif "member_rms" in names:
        draw_random(figure, dataset)
    elif "weighted_rms" in names:
        draw_assessment(figure, dataset)
    elif "weighting_factor" in names:
        draw_weighting(figure, dataset)
    elif "band_difference" in names:
        draw_comparison(figure, dataset)
    elif "apparent_mass_peak" in names:
        draw_bodies(figure, dataset)
    elif {"harmonics", "time"} <= names:
        _steady(figure, dataset)
    elif {"acceleration", "time"} <= names:
        _history(figure.subplots(3, 1, sharex=True), dataset)
    elif {"transmissibility", "frequency"} <= names:
        _response(figure, dataset)
    elif "stable" in names and dataset["stable"].ndim in (2, 3):
        _map(figure, dataset)
    elif {"pole", "f0"} <= names or {"value", "right_half_plane"} <= names:
        figure.set_size_inches(WIDTH, 6.0)
        _plane(figure.subplots(), dataset)
    else:
        status = dataset.attrs.get("status")
        why = f"its status is {status!r}" if status else "no known kind of result"
        raise OutputError(
            f"This Dataset cannot be drawn: {why} (variables {sorted(map(str, names))}). Give a "
            "valid result of simulate, steady_state, frequency_response, stability_map, poles, "
            "zeros, compare_bodies, assess, compare_bands, random_response, seat_test, "
            "damping_test, response_curve or parameter_curve."
        )
    if title:
        figure.suptitle(title)
    if target is not None:
        picture = io.BytesIO()
        figure.savefig(picture, format=target.suffix[1:].lower(), dpi=DPI)
        write_whole(target, picture.getvalue())
    return figure


def _history(axes: Any, data: xr.Dataset) -> None:
    """Accelerations, relative displacements and forces over time, one axes each."""
    time = data.time.values
    curves: list[dict[str, Any]] = [
        {"base": data.base_acceleration.values},
        {
            str(pair): MILLI * data.relative_displacement.sel(pair=pair).values
            for pair in data.pair.values
        },
        {str(name): data.element_force.sel(element=name).values for name in data.element.values},
    ]
    curves[0] |= {str(node): data.acceleration.sel(node=node).values for node in data.node.values}
    if len(curves[2]) != 1:
        curves[2]["suspension"] = data.suspension_force.values
    labels = ("acceleration [m/s²]", "relative displacement [mm]", "force [N]")
    for ax, named, label in zip(axes, curves, labels, strict=True):
        shown = dict(list(named.items())[:MOST_CURVES])
        for name, values in shown.items():
            style = {"color": BASE, "linestyle": "--"} if name == "base" else {}
            peak = float(np.max(np.abs(values), initial=0.0))
            # the largest at the back, so that it hides no other
            ax.plot(time, values, label=name, linewidth=1.2, zorder=2 + 1 / (1 + peak), **style)
        ax.set_ylabel(label)
        _finish(ax)
        _legend(ax)
    axes[-1].set_xlabel("time [s]")
    axes[-1].set_xlim(time[0], time[-1])


def _steady(figure: Figure, data: xr.Dataset) -> None:
    """One period on the left, amplitudes on the right."""
    figure.set_size_inches(WIDTH, 7.5)
    left, right = figure.subfigures(  # type: ignore[misc]
        1, 2, width_ratios=[2.0, 1.0]
    )
    axes = left.subplots(3, 1, sharex=True)
    _history(axes, data)
    axes[0].set_title("one period")
    names = [str(name) for name in data.output.values]
    units = [str(unit) for unit in data.output_unit.values]
    amplitude = data.amplitude.values
    for ax, unit, factor, label in zip(
        right.subplots(3, 1),
        ("m/s2", "m", "N"),
        (1.0, MILLI, 1.0),
        ("acceleration [m/s²]", "displacement [mm]", "force [N]"),
        strict=True,
    ):
        chosen = [i for i, u in enumerate(units) if u == unit]
        bars = ax.barh(
            [names[i].removeprefix("acc_").removeprefix("F_") for i in chosen],
            factor * amplitude[chosen],
        )
        ax.bar_label(bars, fmt="%.3g", padding=3, fontsize="small")
        ax.margins(x=0.22)
        ax.invert_yaxis()
        ax.set_xlabel(label)
        _finish(ax, grid="x")
    right.axes[0].set_title("amplitudes")


def _response(figure: Figure, data: xr.Dataset) -> None:
    """Transmissibility and apparent mass in magnitude and phase, resistance below."""
    figure.set_size_inches(WIDTH, 7.5)
    axes = figure.subplots(2, 2, sharex=True)
    f = data.frequency.values
    drive = data.attrs.get("drive", "base")
    for node in data.node.values:
        values = data.transmissibility.sel(node=node).values
        axes[0, 0].plot(f, abs(values), label=f"{node}/{drive}")
        axes[1, 0].plot(f, np.degrees(np.unwrap(np.angle(values))))
    axes[0, 0].set_ylabel("transmissibility [1]")
    axes[1, 0].set_ylabel("phase of transmissibility [°]")
    axes[0, 1].plot(f, abs(data.apparent_mass), label=f"at {drive}")
    if "body_apparent_mass" in data:
        axes[0, 1].plot(f, abs(data.body_apparent_mass), label="of the body")
    axes[0, 1].set_ylabel("apparent mass [kg]")
    resistance = data.impedance.values.real
    axes[1, 1].plot(f, resistance, label=f"at {drive}")
    if "body_apparent_mass" in data:
        body = (2j * np.pi * f * data.body_apparent_mass.values).real
        axes[1, 1].plot(f, body, label="of the body")
        resistance = body
    axes[1, 1].axhline(0.0, color="black", linewidth=0.8)
    low = np.minimum(resistance, 0.0)
    axes[1, 1].fill_between(f, low, 0.0, color=UNSTABLE, alpha=0.6, label="body feeds power in")
    axes[1, 1].set_ylabel("resistance (real impedance) [N s/m]")
    for ax in axes[0]:
        ax.set_yscale("log")
    if f.size > 2 and f[0] > 0.0 and np.allclose(np.diff(np.log(f)), np.log(f[1] / f[0])):
        axes[0, 0].set_xscale("log")
    for ax in axes.flat:
        ax.set_xlim(f.min(), f.max())
        _finish(ax)
    for ax in (axes[0, 0], axes[0, 1], axes[1, 1]):
        ax.legend(frameon=False)
    for ax in axes[1]:
        ax.set_xlabel("frequency [Hz]")


def _map(figure: Figure, data: xr.Dataset) -> None:
    """Stable and unstable regions; of three parameters the last gives the slices."""
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    stable = data["stable"]
    x, y, *rest = (str(dim) for dim in stable.dims)
    slices: list[tuple[str, Any]] = [("", stable)]
    if rest:
        z = data[rest[0]]
        picked = np.unique(np.linspace(0, z.size - 1, min(MOST_MAPS, z.size)).round().astype(int))
        slices = [
            (f"{_named(z)} {z.values[i]:g} {z.attrs.get('units', '')}", stable.isel({rest[0]: i}))
            for i in picked
        ]
    columns = min(3, len(slices))
    rows = -(-len(slices) // columns)
    figure.set_size_inches(WIDTH, 6.5 if len(slices) == 1 else 1.0 + 3.5 * rows)
    axes = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
    for ax in axes.flat[len(slices) :]:
        ax.set_visible(False)
    colours = ListedColormap([UNSTABLE, STABLE])
    for ax, (name, values) in zip(axes.flat, slices, strict=False):
        ax.pcolormesh(
            data[x].values, data[y].values, values.values.T, cmap=colours, vmin=0, vmax=1,
            shading="nearest", rasterized=True,
        )  # fmt: skip
        ax.set_title(name, fontsize="medium")
        ax.label_outer()
    for ax in axes[-1]:
        ax.set_xlabel(_named(data[x], unit=True))
    for ax in axes[:, 0]:
        ax.set_ylabel(_named(data[y], unit=True))
    keys = [Patch(color=STABLE, label="stable"), Patch(color=UNSTABLE, label="unstable")]
    figure.legend(handles=keys, loc="outside upper right", ncols=2, frameon=False)


def _plane(ax: Axes, data: xr.Dataset) -> None:
    """Poles or zeros in the plane of s."""
    is_pole = "pole" in data
    values = data["pole" if is_pole else "value"].values
    right = values.real >= 0.0
    marker, kind = ("x", "pole") if is_pole else ("o", "zero")
    reach = 1.15 * np.max(np.abs(values), initial=1.0)
    for chosen, colour, label in (
        (~right, "C0", f"{kind} in the left half plane"),
        (right, "C3", f"{kind} not in the left half plane"),
    ):
        if np.any(chosen):
            look: dict[str, Any] = (
                {"color": colour} if is_pole else {"facecolors": "none", "edgecolors": colour}
            )
            real, imag = values[chosen].real, values[chosen].imag
            ax.scatter(
                real, imag, s=80, marker=marker, linewidths=2.0, label=label, zorder=3, **look
            )
    for s in values[values.imag >= 0.0]:
        text = f"{abs(s) / (2 * np.pi):.2f} Hz"
        if is_pole and abs(s) > 0.0:
            text += f", ζ = {-s.real / abs(s):.3f}"
        ax.annotate(
            text,
            (s.real, s.imag),
            xytext=(9, 9),
            textcoords="offset points",
            fontsize="small",
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.0},
        )
    low, high = min(values.real.min(initial=0.0), 0.0), max(values.real.max(initial=0.0), 0.0)
    span = high - low or 1.0
    ax.set_xlim(low - 0.1 * span, high + 0.3 * span)
    top = 1.2 * max(np.max(np.abs(values.imag), initial=0.0), 0.05 * reach)
    ax.set_ylim(-top, top)
    ax.axvspan(0.0, high + 0.3 * span, color=UNSTABLE, alpha=0.25, zorder=0)
    ax.axvline(0.0, color="black", linewidth=0.8)
    ax.axhline(0.0, color="black", linewidth=0.8)
    ax.set_xlabel("real part [1/s]")
    ax.set_ylabel("imaginary part [1/s]")
    if not is_pole:
        ax.set_title(f"zeros of {data.attrs.get('output')}/{data.attrs.get('drive')}", loc="left")
    _finish(ax)
    ax.legend(frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)


def _named(variable: xr.DataArray, *, unit: bool = False) -> str:
    """Name of a parameter for people, with its unit where asked."""
    name = NAMES.get(str(variable.name), str(variable.name))
    return f"{name} [{variable.attrs.get('units', '1')}]" if unit else name


def _legend(ax: Axes) -> None:
    """Put the legend beside the curves, where it covers none."""
    if ax.get_legend_handles_labels()[0]:
        ax.legend(frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.2)


def _finish(ax: Axes, grid: str = "both") -> None:
    """Give every axes the same look."""
    ax.grid(True, axis=grid, color="0.9", linewidth=0.7)  # type: ignore[arg-type]
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)
