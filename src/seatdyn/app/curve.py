"""Command about curves of the non-linear system: curve."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

from seatdyn.app.options import (
    ModelOptions,
    OutputOptions,
    Plot,
    number_option,
    numbers,
    option,
)
from seatdyn.app.show import (
    draw,
    finish,
    plot_target,
    progress_bar,
    write_json,
    write_line,
    write_table,
)
from seatdyn.errors import RequestError, Status


class LevelKind(StrEnum):
    """What a level of the base motion is."""

    AMPLITUDE = "amplitude"
    RMS = "rms"
    DISPLACEMENT = "displacement"


def curve(
    model: ModelOptions,
    frequency: Annotated[
        tuple[str, str],
        option(
            "--frequency",
            "First and last frequency, Hz; the branch is taken from rest at the first.",
            metavar="START STOP",
            panel="Request",
        ),
    ],
    level: Annotated[
        list[float],
        number_option("--level", "Level of the base motion; may be repeated.", panel="Request"),
    ],
    out: OutputOptions,
    kind: Annotated[
        LevelKind,
        option(
            "--kind",
            "What --level is: peak or r.m.s. acceleration, m/s2, or peak displacement, m.",
            panel="Request",
            default=True,
        ),
    ] = LevelKind.AMPLITUDE,
    output: Annotated[
        str, option("--output", "Output whose amplitude is given.", panel="Request", default=True)
    ] = "seat-base",
    plot: Plot = None,
) -> None:
    """Steady amplitude over the frequency at given levels, through folds, with stability."""
    from seatdyn.analysis.curves import folds, response_curve
    from seatdyn.units import suggestion

    plot_target(plot)
    system = model.system()
    start, stop = numbers("--frequency", frequency, "START STOP")
    with progress_bar("curve") as progress:
        data = response_curve(system, (start, stop), level, kind=kind.value, progress=progress)
    status, names = data.attrs["status"], data.output.values.tolist()
    if names and output not in names:
        raise RequestError(f"--output {output}: no such output. {suggestion(output, names)}")
    rows = []
    for k, value in enumerate(level):
        row = data.isel(level=k).dropna("point", subset=["frequency"])
        rows.append(
            {
                "level": value,
                "frequency": row["frequency"].values,
                "amplitude": row["amplitude"].sel(output=output).values if names else [],
                "stable": row["stable"].values.tolist(),
                "folds": folds(data, k),
                "events": [
                    {"kind": str(what), "frequency": float(where)}
                    for what, where in zip(
                        row["event_kind"].values, row["event_frequency"].values, strict=True
                    )
                    if what
                ],
            }
        )
    if names:
        draw(data, plot)
    if out.as_json:
        facts = {"status": status, "message": data.attrs["message"]}
        unit = {"level": data.level.attrs["units"], "frequency": "Hz"}
        if names:
            unit["amplitude"] = str(data.output_unit.sel(output=output).item())
        write_json(facts | {"output": output, "unit": unit, "kind": kind.value, "levels": rows})
    elif Status(status).valid:
        table = []
        for found in rows:
            best = int(found["amplitude"].argmax())
            table.append(
                (
                    f"{found['level']:g}",
                    float(found["amplitude"][best]),
                    float(found["frequency"][best]),
                    " ".join(f"{place:.5g}" for place in found["folds"]) or "none",
                    all(found["stable"]),
                )
            )
        columns = ["level", f"highest {output}", "at [Hz]", "folds [Hz]", "all stable"]
        write_table("Response curves", columns, table)
        write_line("--json has all points, --plot draws them")
    finish(status, data.attrs["message"])
