"""The command about random base motion: random."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from seatdyn.app.options import ModelOptions, OutputOptions, Plot, number_option, option
from seatdyn.app.show import (
    Interrupted,
    draw,
    finish,
    plot_target,
    progress_bar,
    report_target,
    say,
    write_json,
    write_line,
    write_table,
)
from seatdyn.errors import RequestError, Status

if TYPE_CHECKING:
    import xarray as xr

    from seatdyn.model.system import SeatSystem
    from seatdyn.signals.spectrum import Spectrum

NARROW_BAND, ROAD = "narrow-band", "road-"
MOTION = "Base motion"

Report = Annotated[Path | None, option("--report", "Write a report: .html.", panel="Output")]
Seed = Annotated[int, option("--seed", "Whole number >= 0.", panel="Request", default=True)]


def random(
    model: ModelOptions,
    kind: Annotated[
        str,
        option(
            "--input",
            "Class (EM1 .. EM9, IT1 .. IT4, AG1 .. AG3), narrow-band, road-A .. road-H.",
            panel=MOTION,
            metavar="NAME",
        ),
    ],
    duration: Annotated[
        float, number_option("--duration", "Of one realisation, s.", panel="Request")
    ],
    out: OutputOptions,
    level: Annotated[
        float | None,
        number_option(
            "--level",
            "R.m.s. base acceleration, m/s2, over the whole band of the input.",
            panel=MOTION,
            default="of class or road; needed for a narrow band",
        ),
    ] = None,
    centre: Annotated[
        float | None, number_option("--centre", "Of a narrow band, Hz.", panel=MOTION)
    ] = None,
    bandwidth: Annotated[
        float | None, number_option("--bandwidth", "Of a narrow band, Hz.", panel=MOTION)
    ] = None,
    speed: Annotated[float | None, number_option("--speed", "On a road, m/s.", panel=MOTION)] = (
        None
    ),
    realisations: Annotated[
        int, option("--realisations", "Largest number of them.", panel="Request", default=True)
    ] = 64,
    seed: Seed = 1,
    interval: Annotated[
        float | None,
        number_option(
            "--interval",
            "Stop when every r.m.s. value is known within this share of it.",
            panel="Request",
        ),
    ] = None,
    checkpoint: Annotated[
        Path | None,
        option("--checkpoint", "Go on from what is in this .npz file.", panel="Request"),
    ] = None,
    plot: Plot = None,
    report: Report = None,
) -> None:
    """R.m.s. values under random base motion, with intervals, from many realisations."""
    from seatdyn.analysis.random import random_response
    from seatdyn.model.noise import RandomMotion

    plot_target(plot)
    report_target(report)
    system = model.system()
    spectrum = _spectrum(kind, level, centre, bandwidth, speed)
    motion = RandomMotion(spectrum, duration, seed=seed)
    try:
        with progress_bar("random") as progress:
            data = random_response(
                system,
                motion,
                realisations=realisations,
                interval=interval,
                checkpoint=checkpoint,
                progress=progress,
            )
    except KeyboardInterrupt:
        if checkpoint is None or not checkpoint.exists():
            raise
        raise Interrupted(
            f"what was finished is in {checkpoint}: the same command goes on from there"
        ) from None
    exact = _exact(system, spectrum)
    status = data.attrs["status"]
    if Status(status).valid:
        draw(data, plot)
        if report is not None:
            from seatdyn.output.random import write_random

            write_random(data, report)
            say(f"wrote {report}")
    if out.as_json:
        write_json(_random_answer(data, spectrum, exact))
    elif Status(status).valid:
        _tell_random(data, spectrum, exact)
    finish(status)


def _spectrum(
    kind: str,
    level: float | None,
    centre: float | None,
    bandwidth: float | None,
    speed: float | None,
) -> Spectrum:
    """The base motion asked for; options that it does not know are refused."""
    from seatdyn.signals.inputs import Road, seat_test_input
    from seatdyn.signals.narrow_band import NarrowBand

    road = kind.lower().startswith(ROAD)
    narrow = kind.lower() == NARROW_BAND
    given = {"--centre": centre, "--bandwidth": bandwidth, "--speed": speed}
    known = ("--centre", "--bandwidth") if narrow else ("--speed",) if road else ()
    for name, value in given.items():
        if value is not None and name not in known:
            raise RequestError(f"{name} has no effect with --input {kind}; drop it.")
    missing = [name for name in known if given[name] is None]
    if narrow and level is None:
        missing.append("--level")
    if missing:
        raise RequestError(f"--input {kind} needs {', '.join(missing)}.")
    if narrow:
        return NarrowBand(centre, bandwidth, rms=level)  # type: ignore[arg-type]
    plain = Road(kind[len(ROAD) :].upper(), speed) if road else seat_test_input(kind)  # type: ignore[arg-type]
    return plain if level is None else plain.at_level(level)


def _exact(system: SeatSystem, spectrum: Spectrum) -> dict[str, float] | None:
    """R.m.s. values without random numbers, which a linear system has."""
    from seatdyn.analysis.random_linear import linear_response

    if not system.is_linear or (system.delays and system.memory_elements):
        return None
    rms = linear_response(system, spectrum).rms
    return dict(zip(rms.output.values.tolist(), rms.values.tolist(), strict=True))


def _random_answer(
    data: xr.Dataset, spectrum: Spectrum, exact: dict[str, float] | None
) -> dict[str, Any]:
    names, attrs = data.output.values.tolist(), data.attrs

    def by_output(**columns: str) -> dict[str, Any]:
        rows = zip(*(data[name].values.tolist() for name in columns.values()), strict=True)
        return {
            name: dict(zip(columns, row, strict=True))
            for name, row in zip(names, rows, strict=True)
        }

    return {
        "status": attrs["status"],
        "message": attrs["message"],
        "rms": by_output(value="rms", low="rms_low", high="rms_high"),
        "exact": exact,
        "range": by_output(lowest="lowest", highest="highest"),
        "unit": dict(zip(names, data.output_unit.values.tolist(), strict=True)),
        "body": attrs["body"],
        "seat": json.loads(attrs["seat_description"]),
        "input": {
            "name": repr(spectrum),
            "rms": spectrum.acceleration_rms(),
            "band": [spectrum.low, spectrum.high],
        },
        "realisations": attrs["realisations"],
        "confidence": attrs["confidence"],
        "duration": attrs["duration_s"],
        "settle": attrs["settle_s"],
        "step": attrs["step_s"],
        "step_error": attrs["step_error"],
        "seed": attrs["seed"],
    }


def _tell_random(data: xr.Dataset, spectrum: Spectrum, exact: dict[str, float] | None) -> None:
    columns = [data[name].values.tolist() for name in ("rms", "rms_low", "rms_high")]
    head = ["output", "rms", "low", "high"]
    if exact is not None:
        columns.append([exact.get(name) for name in data.output.values.tolist()])
        head.append("exact")
    rows = zip(data.output.values.tolist(), *columns, data.output_unit.values, strict=True)
    write_table("Random response", [*head, "unit"], list(rows))
    attrs = data.attrs
    write_line(
        f"base {spectrum.acceleration_rms():.4g} m/s2 r.m.s. in {spectrum.low:.4g} .. "
        f"{spectrum.high:.4g} Hz; {attrs['realisations']} realisations "
        f"of {attrs['duration_s']:g} s after {attrs['settle_s']:.3g} s, seed {attrs['seed']}; "
        f"{100 * attrs['confidence']:g} % intervals; error of the time step about "
        f"{attrs['step_error']:.1g}"
    )
