"""Commands about standards and measured records: assess, weighting."""

from __future__ import annotations

import json
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from seatdyn.app.options import OutputOptions, Plot, number_option, option, parsed
from seatdyn.app.show import (
    draw,
    plot_target,
    report_target,
    say,
    write_json,
    write_line,
    write_table,
)
from seatdyn.errors import RequestError, Status
from seatdyn.units import number

if TYPE_CHECKING:
    import xarray as xr

    from seatdyn.standards.weighting import Array, Weighting

HOUR = 3600.0  # s
UPPERMOST = 80.0  # Hz, of a transmissibility in JSON
DRAWN, DRAWN_POINTS = (0.1, 400.0), 400  # Hz, of a weighting


class Unit(StrEnum):
    """Units that a record may be in."""

    SI = "m/s2"
    G = "g"


class Axis(StrEnum):
    """Axes of a seat."""

    X = "x"
    Y = "y"
    Z = "z"


def assess(
    file: Annotated[
        Path, typer.Argument(help="Measured record: text, .wav, .mat, .tdms, .uff, .mf4.")
    ],
    out: OutputOptions,
    axis: Annotated[Axis, option("--axis", "Axis of the record.", panel="Record", default=True)] = (
        Axis.Z
    ),
    column: Annotated[
        str | None, option("--column", "Channel of the seat, name or number.", panel="Record")
    ] = None,
    floor_column: Annotated[
        str | None, option("--floor-column", "Channel of the floor.", panel="Record")
    ] = None,
    floor_file: Annotated[
        Path | None,
        option("--floor-file", "Where the floor is.", panel="Record", default="the same file"),
    ] = None,
    unit: Annotated[
        Unit | None,
        option("--unit", "Of the file.", panel="Record", default="what it says, else m/s2"),
    ] = None,
    rate: Annotated[
        float | None,
        number_option("--rate", "Samples per second, Hz, of a file without time.", panel="Record"),
    ] = None,
    time_column: Annotated[
        str | None, option("--time-column", "Column of the time.", panel="Record", default="time")
    ] = None,
    full_scale: Annotated[
        float | None,
        number_option("--full-scale", "Acceleration of a full WAV integer.", panel="Record"),
    ] = None,
    exposure_time: Annotated[
        float,
        number_option("--exposure-time", "Hours a day, for A(8).", panel="Request", default=True),
    ] = 8.0,
    weighting_name: Annotated[
        str | None,
        option("--weighting", "Weighting.", panel="Request", default="Wk for z, Wd for x and y"),
    ] = None,
    point: Annotated[
        str, option("--point", "seat_surface or seat_frame.", panel="Request", default=True)
    ] = "seat_surface",
    plot: Plot = None,
    report: Annotated[
        Path | None, option("--report", "Write a report: .html.", panel="Output")
    ] = None,
) -> None:
    """Weighted r.m.s., VDV, MTVV, crest factor, A(8) of a record; with a floor channel SEAT."""
    from seatdyn.analysis.assess import assess as compute
    from seatdyn.signals.files import read_measurement

    plot_target(plot)
    report_target(report)
    number(
        exposure_time, "--exposure-time", "h", minimum=1 / HOUR, maximum=24.0, error=RequestError
    )
    if floor_file is not None and floor_column is None:
        raise RequestError("--floor-file needs --floor-column: the channel of the floor in it.")
    options: dict[str, Any] = {
        "unit": unit.value if unit else None,
        "rate": rate,
        "time": time_column,
        "full_scale": full_scale,
    }
    wanted = [column] if column is not None else None
    if wanted is not None and floor_column is not None and floor_file is None:
        wanted.append(floor_column)
    record = read_measurement(file, wanted, **options)
    names = list(record.channels)
    if column is None and floor_column is None and len(names) > 1:
        raise RequestError(
            f"{str(file)!r} has the channels {', '.join(names)}; choose one with --column, and the "
            "floor, if it is among them, with --floor-column."
        )
    if column is None and floor_column is not None and floor_file is None:
        raise RequestError("--floor-column needs --column: the channel of the seat.")
    below = None
    if floor_column is not None and floor_file is not None:
        below = read_measurement(floor_file, [floor_column], **options)
    floor = None
    if floor_column is not None:
        floor = {axis.value: names[-1] if below is None else next(iter(below.channels))}
    data = compute(
        record,
        {axis.value: names[0]},
        floor=floor,
        floor_record=below,
        exposure=HOUR * exposure_time,
        point=point,
        weightings={axis.value: weighting_name} if weighting_name else None,
    )
    draw(data, plot)
    if report is not None:
        from seatdyn.output.assessment import write_assessment

        write_assessment(data, report)
        say(f"wrote {report}")
    if out.as_json:
        write_json(_answer(data, axis.value))
    else:
        _tell(data, axis.value)


def _answer(data: xr.Dataset, axis: str) -> dict[str, Any]:
    """Everything about one axis, for JSON."""
    import numpy as np

    one, attrs = data.sel(axis=axis), data.attrs
    values = {str(name): float(v) for name, v in one.data_vars.items() if v.ndim == 0}
    hours = {f"{name}_h": values.pop(name) / HOUR for name in ("time_to_action", "time_to_limit")}
    answer: dict[str, Any] = {
        "status": attrs["status"],
        "axis": axis,
        "weighting": json.loads(attrs["weightings"])[axis],
        "seat_rms": None,
        "seat_vdv": None,
        **values,
        **hours,
        "exposure_time": attrs["exposure"] / HOUR,
        **{key: attrs[key] for key in ("a8_verdict", "vdv_verdict", "guidance_rms")},
        **{key: attrs[key] for key in ("guidance_vdv", "comfort", "duration", "rate", "point")},
        "unit": attrs["unit_of_source"],
        "bands": {"frequency": data.band.values, "rms": one.band_rms.values},
        "reasons": json.loads(attrs["reasons"])[axis],
        "warnings": json.loads(attrs["warnings"]),
        "note": attrs["note"],
    }
    if "transmissibility" in data:
        part = one.sel(frequency=slice(0.0, UPPERMOST))
        h = part.transmissibility.values
        answer["transmissibility"] = {
            "frequency": part.frequency.values,
            "magnitude": abs(h),
            "phase": np.angle(h),
            "coherence": part.coherence.values,
            "random_error": part.random_error.values,
        }
    return answer


def _tell(data: xr.Dataset, axis: str) -> None:
    """Print the result for people."""
    one, attrs = data.sel(axis=axis), data.attrs
    names = [
        *("weighted_rms", "peak", "crest_factor", "mtvv", "vdv", "evdv", "a8", "daily_vdv"),
        *("floor_weighted_rms", "floor_vdv", "seat_rms", "seat_vdv"),
    ]
    rows = [
        (str(one[name].attrs["long_name"]), float(one[name]), one[name].attrs["units"])
        for name in names
        if name in data
    ]
    used = json.loads(attrs["weightings"])[axis]
    write_table(f"Axis {axis}, {used}", ["quantity", "value", "unit"], rows)
    write_line(
        f"{attrs['exposure'] / HOUR:.3g} h a day: A(8) {attrs['a8_verdict']}, VDV "
        f"{attrs['vdv_verdict']}; caution zone: {attrs['guidance_rms']} by r.m.s., "
        f"{attrs['guidance_vdv']} by eVDV; {attrs['comfort']}"
    )
    for reason in json.loads(attrs["reasons"])[axis]:
        write_line(f"more than the r.m.s. is needed: {reason}")
    write_line(f"measured at the {attrs['point']}; no certificate")


def weighting(
    name: Annotated[str, typer.Argument(help="Wk, Wd, Wc, We, Wj, Wf, Wb, Wm, Wh or Wg.")],
    frequency: Annotated[list[str], typer.Argument(help="Frequencies, Hz.", metavar="HZ...")],
    out: OutputOptions,
    plot: Plot = None,
) -> None:
    """Factor (1) and phase (degrees, -180 .. 180, negative is a lag) of a frequency weighting."""
    import numpy as np

    from seatdyn.standards.weighting import weighting as find

    chosen = find(name)
    plot_target(plot)
    f = np.array([_frequency(text) for text in frequency])
    value = chosen.factor(f)
    factor, phase = np.abs(value), np.degrees(np.angle(value))
    draw(_weighting_data(chosen, f), plot)
    if out.as_json:
        write_json(
            {
                "status": Status.OK,
                "weighting": chosen.name,
                "frequency": f,
                "factor": factor,
                "phase": phase,
                "clause": chosen.clause,
                "grade": chosen.grade,
            }
        )
        return
    with np.errstate(divide="ignore"):
        level = 20 * np.log10(factor)
    rows = list(zip(f.tolist(), factor.tolist(), level.tolist(), phase.tolist(), strict=True))
    columns = ["frequency [Hz]", "factor", "level [dB]", "phase [°]"]
    write_table(f"{chosen.name}: {chosen.use}", columns, rows)
    write_line(f"{chosen.clause}; {chosen.grade}")


def _weighting_data(chosen: Weighting, asked: Array) -> xr.Dataset:
    """The weighting over all its band, and where it was asked for."""
    import numpy as np
    import xarray as xr

    band = np.array([*DRAWN, *asked[asked > 0.0]])
    f = np.geomspace(band.min(), band.max(), DRAWN_POINTS)
    over, here = chosen.factor(f), chosen.factor(asked)
    return xr.Dataset(
        {
            "weighting_factor": ("frequency", np.abs(over), {"units": "1"}),
            "weighting_phase": ("frequency", np.degrees(np.unwrap(np.angle(over))), {"units": "°"}),
            "asked_factor": ("asked", np.abs(here), {"units": "1"}),
        },
        coords={"frequency": ("frequency", f, {"units": "Hz"}), "asked": asked},
        attrs={"weighting": chosen.name, "use": chosen.use, "status": "ok"},
    )


def _frequency(text: str) -> float:
    try:
        return parsed(text)
    except ValueError:
        raise RequestError(f"HZ = {text!r} is not a number; give frequencies in Hz.") from None
