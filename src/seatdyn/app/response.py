"""Commands about the non-linear system in time: steady, simulate."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

from seatdyn.app.options import (
    ModelOptions,
    OutputOptions,
    Plot,
    SineOptions,
    number_option,
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
from seatdyn.errors import Status


class Method(StrEnum):
    """How a steady state is found."""

    AUTO = "auto"
    HB = "hb"
    TIME = "time"


def steady(
    model: ModelOptions,
    motion: SineOptions,
    out: OutputOptions,
    method: Annotated[
        Method,
        option(
            "--method",
            "hb: harmonic balance, stable or not; time: integration from rest; auto: hb where it "
            "is accurate and stable, else time.",
            panel="Request",
            default=True,
        ),
    ] = Method.TIME,
    tolerance: Annotated[
        float | None,
        number_option(
            "--tolerance", "Largest relative error.", panel="Request", default="1e-9, hb 1e-6"
        ),
    ] = None,
    plot: Plot = None,
) -> None:
    """Periodic steady state under a sine: amplitudes = (max - min)/2 over one period."""
    from seatdyn.analysis.steady import steady_state

    plot_target(plot)
    data = steady_state(model.system(), motion.sine(), method=method.value, tolerance=tolerance)
    names = data.output.values.tolist()
    values = {key: data[key].values.tolist() for key in ("amplitude", "rms")}
    status = data.attrs["status"]
    if Status(status).valid:
        draw(data, plot)
    from seatdyn.analysis.outputs import output_unit

    units = [output_unit(name) for name in names]
    facts = ("method", "error_estimate", "floquet_max", "periods", "tolerance", "energy_residual")
    stable = data.attrs.get("stable")
    if out.as_json:
        write_json(
            {
                "status": status,
                "converged": status == Status.CONVERGED,
                "message": data.attrs["message"],
                "amplitude": dict(zip(names, values["amplitude"], strict=True)),
                "rms": dict(zip(names, values["rms"], strict=True)),
                "unit": dict(zip(names, units, strict=True)),
                **{key: data.attrs.get(key) for key in facts},
                "stable": None if stable is None else bool(stable),
                **({"order": data.attrs["order"]} if "order" in data.attrs else {}),
            }
        )
    elif Status(status).valid:
        rows = zip(names, values["amplitude"], values["rms"], units, strict=True)
        write_table("Steady state", ["output", "amplitude", "rms", "unit"], rows)
        error = f"relative error about {data.attrs['error_estimate']:.1g}"
        if data.attrs["method"] == "time":
            write_line(f"converged after {data.attrs['periods']} periods, {error}")
        else:
            verdict = "stability undefined" if stable is None else ("unstable", "stable")[stable]
            write_line(f"harmonic balance, {verdict}, {error}")
    finish(status, data.attrs["message"])


def simulate(
    model: ModelOptions,
    motion: SineOptions,
    duration: Annotated[
        float, number_option("--duration", "Length of the run, s.", panel="Request")
    ],
    file: Annotated[Path, option("--out", "netCDF file to write, .nc.", panel="Output")],
    out: OutputOptions,
    output_step: Annotated[
        float, number_option("--output-step", "Output step, s.", panel="Request", default=True)
    ] = 1e-3,
    initial: Annotated[
        str,
        option("--initial", "rest, equilibrium or periodic.", panel="Request", default=True),
    ] = "rest",
    plot: Plot = None,
) -> None:
    """Time response to a sine, written to a netCDF file."""
    import numpy as np

    from seatdyn.analysis.transient import simulate as compute
    from seatdyn.output.files import SUFFIXES, save, writable

    writable(file, SUFFIXES)
    plot_target(plot)
    with progress_bar("simulate") as progress:
        data = compute(
            model.system(),
            motion.sine(),
            duration,
            output_step=output_step,
            initial=initial,
            progress=progress,
        )
    save(data, file)
    draw(data, plot)
    status = data.attrs["status"]
    rows = [
        *((f"acc_{n}", "m/s2", data.acceleration.sel(node=n)) for n in data.node.values),
        *((str(p), "m", data.relative_displacement.sel(pair=p)) for p in data.pair.values),
        *((name, "N", data[name]) for name in ("suspension_force", "body_force")),
    ]
    peaks = {
        name: float(np.abs(values).max()) if Status(status).valid else None
        for name, _, values in rows
    }
    if out.as_json:
        facts = ("status", "message", "steps", "events", "energy_residual")
        write_json(
            {
                **{key: data.attrs[key] for key in facts},
                "duration": float(data.time[-1]),
                "peak": peaks,
                "unit": {name: unit for name, unit, _ in rows},
                "file": str(file),
            }
        )
    else:
        table = [(name, peaks[name], unit) for name, unit, _ in rows]
        write_table("Largest absolute values", ["output", "peak", "unit"], table)
        write_line(
            f"{data.attrs['steps']} steps, {data.attrs['events']} events, energy residual "
            f"{data.attrs['energy_residual']:.1g}; written to {file}"
        )
    finish(status)
