"""The command about the catalogue: bodies, listed or compared."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from seatdyn.app.options import Number, OutputOptions, Plot, number_option, option
from seatdyn.app.show import draw, plot_target, write_json, write_line, write_table
from seatdyn.errors import RequestError, Status

if TYPE_CHECKING:
    import xarray as xr

KEYS = (
    *("name", "title", "posture", "masses", "total_mass", "support_mass", "subject_mass"),
    *("band", "head", "group", "confidence", "source", "provenance", "scaling"),
)
COMPARED = (
    *("mass", "support_mass", "natural_frequency", "apparent_mass_peak"),
    *("apparent_mass_peak_frequency", "head_peak", "head_peak_frequency"),
    *("group", "confidence", "active", "scaling", "status"),
)
TITLE = "Bodies (kg, Hz): mass, resonance, peak of apparent mass and head/seat"


def bodies(
    out: OutputOptions,
    compare: Annotated[
        bool, option("--compare", "Resonance and size of apparent mass and head.", panel="Request")
    ] = False,
    sitting_mass: Annotated[
        Number,
        number_option("--sitting-mass", "Scale all to this mass on the seat, kg.", panel="Request"),
    ] = None,
    plot: Plot = None,
) -> None:
    """List the bodies of the catalogue, or compare them."""
    if compare:
        _compare(out, sitting_mass, plot)
        return
    for name, value in (("--sitting-mass", sitting_mass), ("--plot", plot)):
        if value is not None:
            raise RequestError(f"{name} has no effect without --compare; give both.")
    from seatdyn.model.body import list_bodies, load_body

    known = [load_body(name) for name in list_bodies()]
    if out.as_json:
        write_json(
            {"bodies": [{k: getattr(b, k) for k in KEYS} | {"active": b.is_active} for b in known]}
        )
        return
    rows = [(b.name, b.total_mass, b.group, b.confidence, b.is_active) for b in known]
    write_table("Bodies", ["name", "mass [kg]", "group", "confidence", "active"], rows)


def _compare(out: OutputOptions, sitting_mass: Number, plot: Plot) -> None:
    from seatdyn.analysis.compare import compare_bodies

    plot_target(plot)
    data = compare_bodies(sitting_mass=sitting_mass)
    draw(data, plot)
    if out.as_json:
        write_json(
            {
                "status": Status.OK,
                "bodies": [
                    {"name": str(one.body.values)}
                    | {key: one[key].item() for key in COMPARED}
                    | {"active_bands": _bands(one)}
                    for one in (data.isel(body=i) for i in range(data.sizes["body"]))
                ],
            }
        )
        return
    numbers = (
        *("mass", "natural_frequency", "apparent_mass_peak", "apparent_mass_peak_frequency"),
        "head_peak",
    )
    rows = zip(
        data.body.values.tolist(),
        *([float(f"{x:.4g}") for x in data[key].values] for key in numbers),
        data.confidence.values.tolist(),
        data.active.values.tolist(),
        strict=True,
    )
    columns = ["name", "mass", "f0", "peak", "at", "head", "confidence", "active"]
    write_table(TITLE, columns, list(rows))
    for i, name in enumerate(data.body.values):
        for band in _bands(data.isel(body=i)):
            ends = f"{band['low']:.4g} .. {band['high']:.4g} Hz"
            write_line(f"{name} feeds power into its seat: {ends}")


def _bands(one: xr.Dataset) -> list[dict[str, Any]]:
    """Bands of one body where it feeds power into its seat."""
    ends = zip(one.active_low.values.tolist(), one.active_high.values.tolist(), strict=True)
    return [{"low": low, "high": high} for low, high in ends if low == low]
