"""Commands about the linear part: poles, zeros, frf, stability, critical."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from seatdyn.app.options import (
    AloneOptions,
    LinearOptions,
    ModelOptions,
    OutputOptions,
    Plot,
    Range,
    number_option,
    numbers,
    option,
    points,
)
from seatdyn.app.show import (
    draw,
    finish,
    left_out,
    plot_target,
    progress_bar,
    write_json,
    write_line,
    write_table,
)
from seatdyn.errors import RequestError, Status

if TYPE_CHECKING:
    from seatdyn.model.body import SeatedBody
    from seatdyn.model.system import SeatSystem


def stable_status(system: SeatSystem | SeatedBody, linear: LinearOptions) -> Status:
    """Whether the linear part has a steady response at all."""
    from seatdyn.analysis.stability import is_stable

    return Status.OK if is_stable(system, linearise=linear.mode) else Status.UNSTABLE


def poles(
    model: ModelOptions, alone: AloneOptions, linear: LinearOptions, out: OutputOptions
) -> None:
    """Poles, natural frequencies and damping ratios (of an unstable system too: exit code 0)."""
    import numpy as np

    from seatdyn.analysis.linear import poles as compute

    data = compute(alone.choose(model), linearise=linear.mode)
    ignored, stable = left_out(data), bool(data.attrs["stable"])
    if out.as_json:
        s = data.pole.values
        with np.errstate(invalid="ignore"):  # a pole at zero has no damping ratio
            ratio = -s.real / np.abs(s)
        write_json(
            {
                "status": Status.OK if stable else Status.UNSTABLE,
                "stable": stable,
                "poles": s,
                "f0": np.abs(s) / (2 * np.pi),
                "fd": np.abs(s.imag) / (2 * np.pi),
                "damping_ratio": ratio,
                "ignored": ignored,
            }
        )
        return
    names = ("real", "imag", "f0", "fd", "damping_ratio", "stable")
    rows = zip(*(data[name].values.tolist() for name in names), strict=True)
    columns = ["mode", "real [1/s]", "imag [1/s]", "f0 [Hz]", "fd [Hz]", "damping ratio", "stable"]
    write_table("Poles", columns, [(i, *row) for i, row in enumerate(rows, 1)])


def zeros(
    model: ModelOptions,
    alone: AloneOptions,
    linear: LinearOptions,
    out: OutputOptions,
    output: Annotated[
        str | None, option("--output", "Node.", panel="Output", default="all nodes")
    ] = None,
) -> None:
    """Zeros of the transmissibility to each node, and whether it is of minimum phase."""
    from seatdyn.analysis.zeros import zeros as compute

    system = alone.choose(model)
    names = [output] if output is not None else list(system.nodes)
    found = {name: compute(system, output=name, linearise=linear.mode) for name in names}
    ignored = left_out(next(iter(found.values())))
    if out.as_json:
        keys = ("real", "imag", "right_half_plane")
        nodes = {
            name: {
                "zeros": [
                    dict(zip(keys, row, strict=True))
                    for row in zip(*(data[key].values.tolist() for key in keys), strict=True)
                ],
                "minimum_phase": bool(data.attrs["minimum_phase"]),
            }
            for name, data in found.items()
        }
        write_json({"status": Status.OK, "nodes": nodes, "ignored": ignored})
        return
    rows = [
        (name, *row)
        for name, data in found.items()
        for row in zip(
            *(data[key].values.tolist() for key in ("real", "imag", "f0", "right_half_plane")),
            strict=True,
        )
    ]
    columns = ["node", "real [1/s]", "imag [1/s]", "f0 [Hz]", "right half plane"]
    write_table("Zeros of the transmissibilities", columns, rows)


def frf(
    model: ModelOptions,
    alone: AloneOptions,
    linear: LinearOptions,
    out: OutputOptions,
    frequency: Annotated[
        Range, option("--frequency", "Range, Hz.", panel="Request", metavar="START STOP N")
    ],
    log: Annotated[bool, option("--log", "Logarithmic spacing.", panel="Request")] = False,
    plot: Plot = None,
) -> None:
    """Transmissibility of every node, relative displacement, apparent mass, impedance."""
    import numpy as np

    from seatdyn.analysis.response import active_bands, frequency_response

    plot_target(plot)
    system = alone.choose(model)
    grid = points("--frequency", frequency, logarithmic=log)
    data = frequency_response(system, frequency=grid, linearise=linear.mode)
    body = system if alone.body_alone else model.load_body()
    band_rows = None  # of a body with delayed feedback they are not known
    if not any(force.delay for force in model.load_body().feedback):
        bands = active_bands(body, frequency_max=float(grid[-1]))
        keys = ("low", "high", "cut_off")
        table = zip(*(bands[key].values.tolist() for key in keys), strict=True)
        band_rows = [dict(zip(keys, row, strict=True)) for row in table]
    status, ignored = stable_status(system, linear), left_out(data)
    draw(data, plot)
    size = np.abs(data.transmissibility)
    if out.as_json:

        def polar(name: str, dim: str) -> dict[str, Any]:
            table = {str(key): data[name].sel({dim: key}).values for key in data[dim].values}
            return {k: {"magnitude": abs(v), "phase": np.angle(v)} for k, v in table.items()}

        mass, impedance = data.apparent_mass.values, data.impedance.values
        write_json(
            {
                "status": status,
                "frequency": grid,
                "transmissibility": polar("transmissibility", "node"),
                "relative_displacement": polar("relative_displacement", "pair"),
                "apparent_mass": {"magnitude": abs(mass), "phase": np.angle(mass)},
                "impedance": {"real": impedance.real, "imag": impedance.imag},
                "active_bands": band_rows,
                "ignored": ignored,
            }
        )
    else:
        nodes = [str(node) for node in data.node.values]
        columns = [abs(data.apparent_mass).values, *(size.sel(node=node).values for node in nodes)]
        rows = zip(grid.tolist(), *(column.tolist() for column in columns), strict=True)
        write_table(
            f"Motion relative to {data.attrs['drive']}",
            ["frequency [Hz]", "apparent mass [kg]", *nodes],
            rows,
        )
        for node in nodes:
            along = size.sel(node=node).values
            place = int(np.argmax(along))
            peak = along[place]
            write_line(f"largest transmissibility of {node}: {peak:.4g} at {grid[place]:.4g} Hz")
        for band in band_rows or []:
            write_line(
                f"the body feeds power into the seat: {band['low']:.4g} .. {band['high']:.4g} Hz"
            )
    finish(
        status, "an unstable system has no steady response; these are formal transfer functions."
    )


def stability(
    model: ModelOptions,
    linear: LinearOptions,
    out: OutputOptions,
    seat_mass_range: Annotated[
        Range | None, option("--seat-mass-range", "Range, kg.", panel="Request", metavar="A B N")
    ] = None,
    damping_range: Annotated[
        Range | None, option("--damping-range", "Range, N s/m.", panel="Request", metavar="A B N")
    ] = None,
    stiffness_range: Annotated[
        Range | None, option("--stiffness-range", "Range, N/m.", panel="Request", metavar="A B N")
    ] = None,
    gain_range: Annotated[
        tuple[str, str, str, str] | None,
        option("--gain-range", "Range of a gain.", panel="Request", metavar="NAME A B N"),
    ] = None,
    delay_range: Annotated[
        Range | None, option("--delay-range", "Range, s.", panel="Request", metavar="A B N")
    ] = None,
    method: Annotated[
        str | None,
        option(
            "--method",
            "hurwitz or poles; with a delay crossings or poles.",
            panel="Request",
            default="the first",
        ),
    ] = None,
    plot: Plot = None,
) -> None:
    """Verdict on a grid of two or three parameters."""
    from seatdyn.analysis.stability import stability_map

    plot_target(plot)
    ranges = {"seat_mass": seat_mass_range, "damping": damping_range, "stiffness": stiffness_range}
    axes = {
        name: points(f"--{name.replace('_', '-')}-range", asked)
        for name, asked in ranges.items()
        if asked is not None
    }
    if delay_range is not None:
        axes["delay"] = points("--delay-range", delay_range)
    if gain_range is not None:
        axes[gain_range[0]] = points(f"--gain-range {gain_range[0]}", gain_range[1:])
    if not 2 <= len(axes) <= 3:
        given = "1 range was" if len(axes) == 1 else f"{len(axes)} ranges were"
        raise RequestError(
            f"{given} given; a map needs two or three of --seat-mass-range, --damping-range, "
            "--stiffness-range, --gain-range, --delay-range. For one parameter use `seatdyn "
            "critical` or `seatdyn delay-margin`."
        )
    system = model.delayable() if delay_range is not None else model.system()
    with progress_bar("stability map") as progress:
        data = stability_map(
            system,
            method=method,  # type: ignore[arg-type]
            linearise=linear.mode,
            progress=progress,
            **axes,
        )
    ignored, stable = left_out(data), data.stable.values
    share = 1.0 - float(stable.mean())
    draw(data, plot)
    if out.as_json:
        write_json(
            {
                "status": Status.OK,
                "axes": axes,
                "stable": stable.astype(int),
                "share_unstable": share,
                "ignored": ignored,
            }
        )
        return
    rows = [(name, axis[0], axis[-1], axis.size) for name, axis in axes.items()]
    write_table("Stability map", ["parameter", "from", "to", "points"], rows)
    write_line(f"unstable: {100 * share:.4g} % of {stable.size} points")


def delay_margin(
    model: ModelOptions,
    linear: LinearOptions,
    out: OutputOptions,
    maximum: Annotated[
        float,
        number_option("--maximum", "Longest delay of the list, s.", panel="Request", default=True),
    ] = 0.1,
) -> None:
    """Delay of the suspension (or of what --delayed names) at which stability is lost."""
    import math

    from seatdyn.analysis.delay_margin import delay_margin as compute

    of = model.delayed or "suspension"
    data = compute(model.delayable(), of=of, maximum=maximum, linearise=linear.mode)
    ignored = left_out(data)
    margin, frequency = float(data.delay_margin), float(data.frequency)
    status = Status.OK if data.attrs["stable_without_delay"] else Status.UNSTABLE
    keys = ("delay", "switch_frequency", "destabilising", "unstable_above", "stable_above")
    table = list(zip(*(data[key].values.tolist() for key in keys), strict=True))
    if out.as_json:
        names = ("delay", "frequency", *keys[2:])
        write_json(
            {
                "status": status,
                "of": of,
                "delay_margin": margin,
                "frequency": frequency,
                "stable_for_every_delay": math.isinf(margin),
                "switches": [dict(zip(names, row, strict=True)) for row in table],
                "ignored": ignored,
            }
        )
    elif status.valid:
        if math.isinf(margin):
            write_line(f"stable with every delay of the {of}")
        else:
            write_line(
                f"delay margin of the {of}: {1e3 * margin:.6g} ms, lost at {frequency:.5g} Hz"
            )
        heads = ["delay [s]", "frequency [Hz]", "destabilises", "unstable poles", "stable beyond"]
        write_table(f"Switching delays up to {maximum:g} s", heads, table)
    finish(status)


def critical(
    model: ModelOptions,
    linear: LinearOptions,
    out: OutputOptions,
    vary: Annotated[
        str, option("--vary", "seat-mass, damping, stiffness or a gain.", panel="Request")
    ],
    limits: Annotated[
        tuple[str, str],
        option("--range", "Range, in its unit.", panel="Request", metavar="LOW HIGH"),
    ],
) -> None:
    """Values of one parameter at which stability is lost or gained."""
    from seatdyn.analysis.boundary import critical_values

    name = vary.replace("-", "_")
    low, high = numbers("--range", limits, "LOW HIGH")
    data = critical_values(model.system(), vary=name, low=low, high=high, linearise=linear.mode)
    ignored = left_out(data)
    keys = [
        *("value", "frequency", "stable_below", "stable_above"),
        *("unstable_below", "unstable_above", "verdict_changes"),
    ]
    columns = (data[key].values.tolist() for key in keys)
    found = [dict(zip(keys, row, strict=True)) for row in zip(*columns, strict=True)]
    changes = [row for row in found if row["verdict_changes"]]
    if out.as_json:
        write_json(
            {
                "status": Status.OK,
                "vary": name,
                "unit": data.value.attrs["units"],
                "critical": [row["value"] for row in changes],
                "frequency": [row["frequency"] for row in changes],
                "stable_at_low": bool(data.attrs["stable_at_low"]),
                "stable_at_high": bool(data.attrs["stable_at_high"]),
                "crossings": found,
                "ignored": ignored,
            }
        )
        return
    if changes:
        heads = [f"{name} [{data.value.attrs['units']}]", "frequency [Hz]"]
        rows = [[f"{row['value']:.10g}", *list(row.values())[1:4]] for row in changes]
        write_table("Critical values", [*heads, "stable below", "stable above"], rows)
    else:
        verdict = "stable" if data.attrs["stable_at_low"] else "unstable"
        write_line(f"{verdict} for every {name} from {low:g} to {high:g}")
