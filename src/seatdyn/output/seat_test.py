"""Pictures, words and report of a simulated seat test."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from seatdyn.analysis.seat_test import SITTING_SHARE
from seatdyn.output.report import figure_png, write_page
from seatdyn.output.seat_table import seat_rows
from seatdyn.standards.acceptance import (
    DAMPING_HEIGHT,
    DAMPING_RANGE,
    DAMPING_TRAVEL,
    HEAVY_PERSON,
    INERT_MASS,
    LIGHT_PERSON,
    RUN_AGREEMENT,
    RUNS,
    verdict,
)
from seatdyn.standards.inputs import INPUT_GRADE
from seatdyn.standards.weighting import weighting

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH = 10.0  # inches
MILLI = 1e3
LIMIT = "#a3261c"
POINTS = {
    "seat": "seat frame; the seat has no cushion",
    "seat_surface": "seat surface, between cushion and occupant",
}
SIDES = ("bump", "rebound")
LEAST_COHERENCE = (
    0.5  # below it a transmissibility is drawn pale: most of the motion is not from the platform
)
FACTORS = {"seat_rms": "SEAT factor, r.m.s.", "seat_vdv": "SEAT factor, VDV"}
PER_SIDE = {  # variable: words, unit for people, factor
    "travel_max": ("largest travel", "mm", MILLI),
    "end_stop_impacts": ("impacts per run", "", 1.0),
    "impact_speed": ("fastest impact", "m/s", 1.0),
    "buffer_force": ("largest force of the stops", "N", 1.0),
}


def verdicts(data: xr.Dataset, resonance: xr.Dataset | None = None) -> dict[str, Any]:
    """Below the limits of the class, above, or undecided; by occupant, and of the damping test."""
    limit = json.loads(data.attrs["limits"])
    if limit is None:
        return {}
    ends = {
        str(name): [float(data[f"seat_rms_{end}"].sel(occupant=name)) for end in ("low", "high")]
        for name in data.occupant.values
    }
    found: dict[str, Any] = {
        "seat_factor": {name: verdict(limit["seat_factor"], *pair) for name, pair in ends.items()}
    }
    if resonance is not None:
        value = resonance.attrs["transmissibility_at_resonance"]
        found["resonance"] = verdict(limit["resonance"], value, value)
    return found


def result_rows(data: xr.Dataset) -> list[tuple[str, list[str], str]]:
    """Label, one text per occupant, and unit of every row of the table of results."""
    each = [data.sel(occupant=name) for name in data.occupant.values]
    rows = [("sitting mass", [f"{float(one.sitting_mass):g}" for one in each], "kg")]
    for name, label in FACTORS.items():
        half = (data[f"{name}_high"] - data[name]).values
        pairs = zip(data[name].values, half, strict=True)
        rows.append((label, [f"{value:.3f} ± {reach:.3f}" for value, reach in pairs], ""))
    for name, (label, unit, factor) in PER_SIDE.items():
        for side in SIDES:
            texts = [_digits(factor * float(one[name].sel(side=side))) for one in each]
            rows.append((f"{label}, {side}", texts, unit))
    texts = [f"{100 * float(one.agreement):.2g} %" for one in each]
    rows.append((f"first {RUNS.value:g} runs agree within", texts, ""))
    rows.append(("status", [str(one.member_status.values) for one in each], ""))
    none = {"nan": "-", "nan ± nan": "-", "nan %": "-"}
    return [(label, [none.get(text, text) for text in texts], unit) for label, texts, unit in rows]


def _digits(value: float) -> str:
    return f"{value:.3g}" if abs(value) < 1000.0 else f"{value:.0f}"


def sentences(data: xr.Dataset, resonance: xr.Dataset | None = None) -> list[str]:
    """What is to be said beside the numbers."""
    attrs = data.attrs
    limit, found = json.loads(attrs["limits"]), verdicts(data, resonance)
    share = f"{100 * attrs['confidence']:g} %"
    said = [
        f"{attrs['input_class']} ({attrs['standard']}), body {attrs['body']} (scaling: "
        f"{attrs['scaling']}); {attrs['runs']} runs of {attrs['duration_s']:g} s each, seed "
        f"{attrs['seed']}; {share} intervals; error of the time step about "
        f"{attrs['step_error']:.1g}",
        f"SEAT taken at the {POINTS[attrs['point']]}",
    ]
    if resonance is not None:
        test = resonance.attrs
        said.append(
            f"damping test with {test['inert_mass_kg']:g} kg: transmissibility "
            f"{test['transmissibility_at_resonance']:.3g} at {test['resonance_hz']:.3g} Hz "
            f"({test['status']})"
        )
    if limit is None:
        said.append(f"no limits of acceptance are known for {attrs['input_class']}")
    else:
        words = "" if limit["verified"] else "UNVERIFIED "
        text = f"{words}limit of the SEAT factor {limit['seat_factor']:g}: " + ", ".join(
            f"{name} {word}" for name, word in found["seat_factor"].items()
        )
        if resonance is not None:
            text += f"; {words}limit at resonance {limit['resonance']:g}: {found['resonance']}"
        said.append(text)
    return [*said, "a simulation, no certificate"]


def draw_seat_test(figure: Figure, data: xr.Dataset) -> None:
    """SEAT factors, travel against the stops, transmissibility and coherence."""
    figure.set_size_inches(WIDTH, 7.5)
    (factors, travel), (gain, coherence) = figure.subplots(2, 2)
    names = [str(name) for name in data.occupant.values]
    labels = [
        f"{name}\n{float(mass):.3g} kg on the seat"
        for name, mass in zip(names, data.sitting_mass.values, strict=True)
    ]
    _factors(factors, data, labels)
    _travel(travel, data, labels)
    if "transmissibility" in data:
        _transmissibility(gain, coherence, data, names)
    figure.suptitle(
        f"Simulated seat test, {data.attrs['input_class']}, {data.attrs['body']}: no certificate",
        fontsize="medium",
    )


def _factors(ax: Axes, data: xr.Dataset, labels: list[str]) -> None:
    place = np.arange(len(labels))
    for shift, (name, marker) in zip((-0.08, 0.08), zip(FACTORS, "os", strict=True), strict=True):
        value = data[name].values
        reach = [value - data[f"{name}_low"].values, data[f"{name}_high"].values - value]
        ax.errorbar(
            place + shift, value, reach, fmt=marker, capsize=4,
            label=FACTORS[name].removeprefix("SEAT factor, "),
        )  # fmt: skip
    for k in np.flatnonzero(np.isnan(data.seat_rms.values)):
        status = str(data.member_status.values[k]).replace("_", "-")
        ax.annotate(f"none:\n{status}", (k, 0.1), ha="center", color=LIMIT)
    limit = json.loads(data.attrs["limits"])
    if limit is not None:
        words = "limit" if limit["verified"] else "limit, unverified"
        ax.axhline(limit["seat_factor"], color=LIMIT, linestyle="--", linewidth=1.2, label=words)
    ax.set_xticks(place, labels)
    ax.set_xlim(-0.5, len(labels) - 0.5)
    ax.set_ylim(0.0, 1.25 * max(1.0, float(np.nanmax(data.seat_vdv_high.values, initial=0.0))))
    ax.set_ylabel("SEAT factor [1]")
    ax.legend(frameon=False, ncols=3, loc="upper center", fontsize="small")
    _finish(ax, "y")


def _travel(ax: Axes, data: xr.Dataset, labels: list[str]) -> None:
    place = np.arange(len(labels))
    stops = MILLI * data.clearance.values
    most = float(np.nanmax(MILLI * data.travel_max.values, initial=1.0))
    for side, sign in zip(SIDES, (-1.0, 1.0), strict=True):
        one = data.sel(side=side)
        ends = sign * MILLI * one.travel_max.values
        ax.bar(place, ends, width=0.35, color="C0" if sign > 0.0 else "C2", alpha=0.85)
        for x, end, count, force in zip(
            place, ends, one.end_stop_impacts.values, one.buffer_force.values, strict=True
        ):
            if math.isfinite(end):
                text = f"{count:.3g} impacts\n{_digits(force)} N" if count else "no impact"
                ax.annotate(
                    text, (x, end), xytext=(0, 5 * sign), textcoords="offset points",
                    ha="center", va="bottom" if sign > 0.0 else "top", fontsize="small",
                )  # fmt: skip
        clearance = stops[SIDES.index(side)]
        if math.isfinite(clearance):
            label = "begin of the end stops" if sign > 0.0 else None
            ax.axhline(sign * clearance, color="black", linestyle=":", linewidth=1.2, label=label)
            most = max(most, clearance)
    ax.axhline(0.0, color="black", linewidth=0.8)
    ax.set_ylim(-1.5 * most, 1.7 * most)
    ax.set_xlim(-0.5, len(labels) - 0.5)
    ax.set_xticks(place, labels)
    ax.set_ylabel("largest travel [mm]: bump −, rebound +")
    if np.any(np.isfinite(stops)):
        ax.legend(frameon=False, loc="upper right", fontsize="small")
    _finish(ax, "y")


def _transmissibility(gain: Axes, coherence: Axes, data: xr.Dataset, names: list[str]) -> None:
    f, highest = data.frequency.values, 1.0
    for name in names:
        one = data.sel(occupant=name)
        if np.all(np.isnan(one.coherence.values)):
            continue
        certain = np.where(
            one.coherence.values >= LEAST_COHERENCE, np.abs(one.transmissibility), np.nan
        )
        (line,) = gain.plot(f, certain, label=name)
        pale, highest = np.abs(one.transmissibility), max(highest, float(np.nanmax(certain)))
        gain.plot(f, pale, color=line.get_color(), alpha=0.3, linewidth=0.8)
        coherence.plot(f, one.coherence.values, label=name)
    gain.axhline(1.0, color="black", linewidth=0.6)
    gain.plot([], [], color="0.6", linewidth=0.8, label=f"coherence < {LEAST_COHERENCE:g}")
    gain.set_ylim(0.0, 1.2 * highest)
    gain.set_ylabel("transmissibility |H1| [1]")
    coherence.set_ylabel("coherence [1]")
    coherence.set_ylim(0.0, 1.05)
    for ax in (gain, coherence):
        ax.set_xlim(0.0, float(f[-1]))
        ax.set_xlabel("frequency [Hz]")
        ax.legend(frameon=False)
        _finish(ax)


def draw_damping_test(figure: Figure, data: xr.Dataset) -> None:
    """Transmissibility over frequency with the resonance marked."""
    figure.set_size_inches(WIDTH, 5.0)
    ax = figure.subplots()
    f, ratio = data.frequency.values, data.transmissibility.values
    attrs = data.attrs
    ax.plot(f, ratio, marker=".", label=f"{attrs['inert_mass_kg']:g} kg inert")
    peak = attrs["resonance_hz"], attrs["transmissibility_at_resonance"]
    if math.isfinite(peak[1]):
        ax.plot(*peak, "o", markersize=10, markerfacecolor="none", color=LIMIT)
        ax.annotate(
            f"{peak[1]:.3g} at {peak[0]:.3g} Hz", peak, xytext=(12, 4),
            textcoords="offset points", color=LIMIT,
        )  # fmt: skip
    failed = ~np.isfinite(ratio)
    if failed.any():
        ax.plot(f[failed], np.zeros(failed.sum()), "x", color=LIMIT, label="no steady state")
    ax.axhline(1.0, color="black", linewidth=0.6)
    ax.set_xlim(f[0], f[-1])
    ax.set_ylim(bottom=0.0)
    ax.set_xlabel("frequency [Hz]")
    ax.set_ylabel("transmissibility [1]")
    ax.set_title(
        f"Damping test, platform height {MILLI * attrs['height_m']:.3g} mm peak to peak: a "
        "simulation, no certificate",
        fontsize="medium",
    )
    ax.legend(frameon=False)
    _finish(ax)


def _finish(ax: Axes, axis: Any = "both") -> None:
    ax.grid(True, axis=axis, color="0.9", linewidth=0.7)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)


def write_seat_test(
    data: xr.Dataset, path: str | Path, resonance: xr.Dataset | None = None
) -> Path:
    """Write a seat test as one HTML file with everything in it.

    Parameters
    ----------
    data : result of `seat_test`
    path : ends in ``.html``, in a directory that exists
    resonance : result of `damping_test` of the same seat

    Raises
    ------
    OutputError
        A place that cannot be written.
    """
    from seatdyn.output.figures import plot

    limit = json.loads(data.attrs["limits"])
    context = {
        "attrs": data.attrs,
        "occupants": data.occupant.values.tolist(),
        "rows": result_rows(data),
        "sentences": sentences(data, resonance),
        "limit": limit,
        "seat": seat_rows(data.attrs["seat_description"]),
        "resonance": resonance.attrs if resonance is not None else None,
        "constants": _constants(data),
        "pictures": [
            (figure_png(plot(one)), text)
            for one, text in (
                (data, "SEAT factors, travel against the stops, transmissibility and coherence"),
                (resonance, "transmissibility of the damping test"),
            )
            if one is not None
        ],
    }
    return write_page("seat_test.html", context, path)


def _constants(data: xr.Dataset) -> list[tuple[str, str, str, str]]:
    """What the numbers rest on: name, value, clause, grade."""
    attrs = data.attrs
    weight = weighting(attrs["weighting"])
    named = {
        "runs that are compared": RUNS,
        "agreement asked of them": RUN_AGREEMENT,
        "light person, lightest": LIGHT_PERSON[0],
        "light person, heaviest": LIGHT_PERSON[1],
        "heavy person, lightest": HEAVY_PERSON[0],
        "heavy person, heaviest": HEAVY_PERSON[1],
        "share of the mass on the seat": SITTING_SHARE,
        "inert mass of the damping test": INERT_MASS,
        "its platform height, share of the travel": DAMPING_TRAVEL,
        "the same, at most": DAMPING_HEIGHT,
        "its lowest frequency over the resonance": DAMPING_RANGE[0],
        "its highest": DAMPING_RANGE[1],
    }
    rows = [
        (f"weighting {weight.name}", "poles and zeros", weight.clause, str(weight.grade)),
        (
            f"density and level of {attrs['input_class']}",
            "filters",
            attrs["standard"],
            str(INPUT_GRADE),
        ),
    ]
    rows += [
        (name, f"{c.value:g} {c.unit}".removesuffix(" 1"), c.clause, str(c.grade))
        for name, c in named.items()
    ]
    limit = json.loads(attrs["limits"])
    if limit is not None:
        for name, key in (
            ("limit of the SEAT factor", "seat_factor"),
            ("limit at resonance", "resonance"),
        ):
            rows.append((name, f"{limit[key]:g}", limit["source"], limit["grade"]))
    return rows
