"""The command about the laboratory test of a seat, as a simulation: seat-test."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from seatdyn.app.options import OutputOptions, Plot, number_option, option, parsed
from seatdyn.app.random import Report, Seed
from seatdyn.app.show import (
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

ILLUSTRATIVE = "illustrative_suspension"


def seat_test(
    out: OutputOptions,
    seat: Annotated[
        str | None, option("--seat", "Name of a seat, or path of a .toml.", metavar="NAME|FILE")
    ] = None,
    input_class: Annotated[
        str | None, option("--class", "EM1 .. EM9, IT1 .. IT4, AG1 .. AG3.", panel="Request")
    ] = None,
    body: Annotated[
        str, option("--body", "Name of a body (see `bodies`), or path of a .toml.", default=True)
    ] = "fairley1989",
    occupant: Annotated[
        list[str] | None,
        option(
            "--occupant",
            "Name and sitting mass, kg; may be repeated.",
            panel="Request",
            metavar="NAME=KG",
            default="light and heavy: 75 % of 55 and 98 kg",
        ),
    ] = None,
    runs: Annotated[int, option("--runs", "Per occupant.", panel="Request", default=True)] = 16,
    duration: Annotated[
        float, number_option("--duration", "Of a run, s.", panel="Request", default=True)
    ] = 180.0,
    seed: Seed = 1,
    limits: Annotated[
        Path | None,
        option(
            "--limits", "Limits of acceptance, .toml.", panel="Request", default="unverified ones"
        ),
    ] = None,
    damping: Annotated[
        bool,
        option("--damping-test", "Transmissibility at resonance, 75 kg inert.", panel="Request"),
    ] = False,
    travel: Annotated[
        float | None,
        number_option(
            "--travel",
            "Of the suspension, m, for the damping test.",
            panel="Request",
            default="between its end stops",
        ),
    ] = None,
    plot: Plot = None,
    report: Report = None,
) -> None:
    """Simulated laboratory test of a seat: SEAT factors with a light and a heavy occupant.

    A simulation, and no certificate.
    """
    from seatdyn.analysis.damping_test import DampingTest
    from seatdyn.analysis.seat_test import seat_test as compute
    from seatdyn.model.body import load_body
    from seatdyn.model.seat_file import load_seat

    plot_target(plot)
    report_target(report)
    if seat is None:
        raise RequestError(
            "--seat is needed: the path of a seat file, or a name. To try things out, --seat "
            f"{ILLUSTRATIVE} has plausible numbers of no product."
        )
    if input_class is None:
        raise RequestError("--class is needed: the input class of the test, such as --class EM3.")
    if travel is not None and not damping:
        raise RequestError("--travel has no effect without --damping-test; give both.")
    tested = load_seat(seat)
    model = load_body(body)
    # what it lacks is said before the long runs
    inert = DampingTest.make(tested, travel=travel) if damping else None
    with progress_bar("seat-test") as progress:
        data = compute(
            tested,
            input_class,
            body=model,
            occupants=_occupants(occupant) if occupant else None,
            runs=runs,
            duration=duration,
            seed=seed,
            limits=limits,
            progress=progress,
        )
    resonance = None
    if inert is not None:
        with progress_bar("damping test") as progress:
            resonance = inert.run(progress)
    states = [data.attrs["status"], *([resonance.attrs["status"]] if resonance else [])]
    status = next((state for state in states if not Status(state).valid), states[0])
    usable = [Status(state).valid for state in data.member_status.values]
    if any(usable):  # of some occupants at least
        draw(data, plot)
        if report is not None:
            from seatdyn.output.seat_test import write_seat_test

            write_seat_test(data, report, resonance)
            say(f"wrote {report}")
    if out.as_json:
        write_json(_test_answer(data, resonance))
    else:
        _tell_test(data, resonance)
    finish(status)


def _occupants(given: list[str]) -> dict[str, float]:
    """Sitting masses in kg by name."""
    masses: dict[str, float] = {}
    for text in given:
        name, _, mass = text.partition("=")
        try:
            value = parsed(mass)
        except ValueError:
            raise RequestError(
                f"--occupant {text!r} is not NAME=KG; write it like --occupant light=41.25."
            ) from None
        if not name or name in masses:
            raise RequestError(f"--occupant {text!r} needs a name of its own, such as light=41.25.")
        masses[name] = value
    return masses


def _test_answer(data: xr.Dataset, resonance: xr.Dataset | None) -> dict[str, Any]:
    from seatdyn.output.seat_test import verdicts

    attrs = data.attrs
    each = {str(name): data.sel(occupant=name) for name in data.occupant.values}
    sides = [str(side) for side in data.side.values]

    def by_side(one: xr.Dataset, **names: str) -> dict[str, Any]:
        return {
            side: {key: float(one[name].sel(side=side)) for key, name in names.items()}
            for side in sides
        }

    factors = {
        name: {
            occupant: {
                key: float(one[name + end])
                for key, end in (("value", ""), ("low", "_low"), ("high", "_high"))
            }
            for occupant, one in each.items()
        }
        for name in ("seat_rms", "seat_vdv")
    }
    answer: dict[str, Any] = {
        "status": attrs["status"],
        "message": attrs["message"],
        "kind": attrs["kind"],
        "point": attrs["point"],
        **factors,
        "travel_max": {
            name: dict(zip(sides, one.travel_max.values.tolist(), strict=True))
            for name, one in each.items()
        },
        "end_stop_impacts": {
            name: by_side(one, count="end_stop_impacts", speed="impact_speed", force="buffer_force")
            for name, one in each.items()
        },
        "agreement": {
            name: {"value": float(one.agreement), "agrees": bool(one.agrees)}
            for name, one in each.items()
        },
        "occupant_status": {name: str(one.member_status.values) for name, one in each.items()},
        "sitting_mass": {name: float(one.sitting_mass) for name, one in each.items()},
        "limits": json.loads(attrs["limits"]),
        "damping_test": None,
        "seat": json.loads(attrs["seat_description"]),
        "unit": {"travel_max": "m", "speed": "m/s", "force": "N", "sitting_mass": "kg"},
        **{key: attrs[key] for key in ("input_class", "standard", "weighting", "body", "scaling")},
        **{key: attrs[key] for key in ("runs", "seed", "confidence", "step_error")},
        "duration": attrs["duration_s"],
    }
    if answer["limits"] is not None:
        answer["limits"]["verdict"] = verdicts(data, resonance)
    if resonance is not None:
        answer["damping_test"] = {
            "status": resonance.attrs["status"],
            "kind": resonance.attrs["kind"],
            "resonance": resonance.attrs["resonance_hz"],
            "transmissibility": resonance.attrs["transmissibility_at_resonance"],
            "inert_mass": resonance.attrs["inert_mass_kg"],
            "height": resonance.attrs["height_m"],
        }
    return answer


def _tell_test(data: xr.Dataset, resonance: xr.Dataset | None) -> None:
    from seatdyn.output.seat_test import result_rows, sentences

    names = data.occupant.values.tolist()
    rows = [(label, *values, unit) for label, values, unit in result_rows(data)]
    write_table("Simulated input vibration test", ["quantity", *names, "unit"], rows)
    for sentence in sentences(data, resonance):
        write_line(sentence)
