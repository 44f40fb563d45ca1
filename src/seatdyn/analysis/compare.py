"""Bodies beside each other: mass, resonance, apparent mass, head, and how one seat serves them."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from seatdyn.analysis.linear import Array, ComplexArray, Linearise, as_linear_model, labelled, poles
from seatdyn.analysis.response import active_bands, checked_frequencies, frequency_response
from seatdyn.analysis.seat_factor import seat_factor
from seatdyn.analysis.stability import is_stable
from seatdyn.errors import RequestError, Status
from seatdyn.model.body import SeatedBody, list_bodies, list_of, load_body
from seatdyn.model.seat import Seat
from seatdyn.model.system import SeatSystem
from seatdyn.signals.inputs import seat_test_input
from seatdyn.signals.spectrum import Spectrum

if TYPE_CHECKING:
    import xarray as xr

PEAKS = (0.5, 20.0)  # Hz, where the largest apparent mass and head motion are looked for
FREQUENCY = np.geomspace(0.25, 25.0, 401)  # Hz, of the curves unless others are asked for
LOOKS, POINTS = 5, 200  # each look is at the neighbourhood of the largest value of the one before


def compare_bodies(
    bodies: Iterable[str | SeatedBody] | None = None,
    *,
    sitting_mass: float | None = None,
    seat: Seat | None = None,
    inputs: Iterable[str] | Mapping[str, Spectrum] | None = None,
    frequency: ArrayLike = FREQUENCY,
    linearise: Linearise = None,
) -> xr.Dataset:
    """Table and curves of several bodies, alone and on one seat.

    Parameters
    ----------
    bodies : names of the catalogue or bodies, each name once; all of the catalogue by default
    sitting_mass : scale every body to this mass on the seat (`SeatedBody.scaled`), kg, 15 .. 200
    seat : put every body on this seat, too
    inputs : with a seat, base motions to give SEAT factors for: names of seat-test classes such as
        "EM3", or name -> spectrum of the base acceleration
    frequency : Hz, > 0, of the curves
    linearise : of the non-linear elements of the seat, as in `poles`

    Returns
    -------
    xarray.Dataset
        Over `body`: `mass` on the seat and `support_mass` in kg; `natural_frequency` in Hz, the
        lowest |pole|/2 pi of an oscillating mode; the largest apparent mass
        `apparent_mass_peak` in kg and `head_peak`, the largest transmissibility to the head (NaN
        without head), each within 0.5 .. 20 Hz and with its frequency; `group`, `confidence`,
        `active` (whether it has feedback forces), `scaling` (how its mass was reached) and
        `status`. Over (`body`, `band`): `active_low` and `active_high` in Hz, where the body feeds
        power into its seat, filled up with NaN. Over (`body`, `frequency`), complex:
        `apparent_mass` in kg and `head` (head/seat). With a seat also `transmissibility`
        (seat/base), and with inputs over (`body`, `input`) `seat_factor`: r.m.s. acceleration of
        the seat over that of the base, both weighted by Wk, at the node "seat", the frame, of the
        linear system; NaN where the status is "unstable".

    Raises
    ------
    RequestError
        No bodies, or a name twice; `linearise` or `inputs` without a seat.
    ModelError
        An unknown body, or a sitting mass out of its range.
    ExcitationError
        An unknown seat-test class.

    Examples
    --------
    >>> import seatdyn as sd
    >>> table = sd.compare_bodies(["fairley1989", "boileau1998"])
    >>> table.apparent_mass_peak_frequency.values.round(1).tolist()
    [4.2, 4.6]
    """
    chosen = _chosen(bodies, sitting_mass)
    if linearise is not None and seat is None:
        raise RequestError(f"linearise = {linearise!r} is about the elements of a seat; give one.")
    spectra = _spectra(inputs)
    if spectra and seat is None:
        raise RequestError(f"inputs = {list(spectra)} need a seat that they shake; give one.")
    f = checked_frequencies(frequency)
    rows = [_row(body, f) for body in chosen]
    widest = max(row.bands.shape[1] for row in rows)
    bands = np.full((len(rows), 2, widest), np.nan)
    for i, row in enumerate(rows):
        bands[i, :, : row.bands.shape[1]] = row.bands
    systems = [SeatSystem(body, seat) for body in chosen] if seat is not None else []
    stable = [is_stable(system, linearise=linearise) for system in systems or chosen]
    along, curve = ("body",), ("body", "frequency")
    variables: dict[str, Any] = {
        "mass": (along, [b.total_mass for b in chosen], "kg", "mass on the seat"),
        "support_mass": (along, [b.support_mass for b in chosen], "kg", "mass fixed to the seat"),
        "natural_frequency": (along, [r.natural for r in rows], "Hz", "lowest natural frequency"),
        "apparent_mass_peak": (along, [r.load[1] for r in rows], "kg", "largest apparent mass"),
        "apparent_mass_peak_frequency": (along, [r.load[0] for r in rows], "Hz", "its frequency"),
        "head_peak": (along, [r.head[1] for r in rows], "1", "largest head/seat"),
        "head_peak_frequency": (along, [r.head[0] for r in rows], "Hz", "its frequency"),
        "active_low": (("body", "band"), bands[:, 0], "Hz", "feeds power into its seat from"),
        "active_high": (("body", "band"), bands[:, 1], "Hz", "feeds power into its seat to"),
        "apparent_mass": (curve, [r.load_curve for r in rows], "kg", "apparent mass"),
        "head": (curve, [r.head_curve for r in rows], "1", "head/seat"),
        "active": (along, [b.is_active for b in chosen], "1", "has feedback forces"),
        "group": (along, [b.group for b in chosen], "1", "kind of model"),
        "confidence": (along, [b.confidence for b in chosen], "1", "in the numbers"),
        "scaling": (along, [b.provenance.get("scaling", "") for b in chosen], "1", "scaling"),
        "status": (
            along,
            [str(Status.OK if s else Status.UNSTABLE) for s in stable],
            "1",
            "of the body on its seat",
        ),
    }
    if systems:
        values = [
            frequency_response(system, frequency=f, linearise=linearise)
            .transmissibility.sel(node=system.contact)
            .values
            if good
            else np.full(f.size, np.nan + 0j)
            for system, good in zip(systems, stable, strict=True)
        ]
        variables["transmissibility"] = (curve, values, "1", "seat/base")
        if spectra:
            factors = [
                [seat_factor(system, g, linearise=linearise) for g in spectra.values()]
                for system in systems
            ]
            variables["seat_factor"] = (("body", "input"), factors, "1", "SEAT factor, Wk")
    coords: dict[str, Any] = {
        "body": [body.name for body in chosen],
        "frequency": ("frequency", f, {"units": "Hz", "long_name": "frequency"}),
    }
    if spectra:
        coords["input"] = list(spectra)
    request = {
        "function": "compare_bodies",
        "sitting_mass": sitting_mass,
        "seat": None if seat is None else repr(seat),
        "inputs": {name: repr(spectrum) for name, spectrum in spectra.items()},
        "linearise": linearise,
    }
    described = json.dumps([repr(body) for body in chosen])
    model = as_linear_model((systems or chosen)[0], linearise)
    return labelled(variables, coords, model, request, bodies=described)


@dataclass(frozen=True)
class _Row:
    """What one body has alone; a peak is (frequency in Hz, size), bands are (2, n) in Hz."""

    natural: float
    load: tuple[float, float]
    head: tuple[float, float]
    bands: Array
    load_curve: ComplexArray
    head_curve: ComplexArray


def _row(body: SeatedBody, f: Array) -> _Row:
    def load(frequency: Array) -> ComplexArray:
        return np.asarray(frequency_response(body, frequency=frequency).apparent_mass.values)

    def head(frequency: Array) -> ComplexArray:
        motion = frequency_response(body, frequency=frequency).transmissibility
        return np.asarray(motion.sel(node=body.head).values)

    bands = active_bands(body)
    no_head = np.full(f.size, np.nan + 0j)
    return _Row(
        natural=_lowest(body),
        load=largest(load, *PEAKS),
        head=largest(head, *PEAKS) if body.head else (np.nan, np.nan),
        bands=np.array([bands.low.values, bands.high.values]),
        load_curve=load(f),
        head_curve=head(f) if body.head else no_head,
    )


def largest(
    function: Callable[[Array], ComplexArray], low: float, high: float
) -> tuple[float, float]:
    """Frequency in Hz and size of the largest modulus within `low` .. `high`."""
    for _ in range(LOOKS):
        grid = np.linspace(low, high, POINTS)
        size = np.abs(function(grid))
        i = int(np.argmax(size))
        low, high = grid[max(i - 1, 0)], grid[min(i + 1, POINTS - 1)]
    return float(grid[i]), float(size[i])


def _lowest(body: SeatedBody) -> float:
    """Lowest natural frequency in Hz of an oscillating mode, NaN without one."""
    if not body.nodes:
        return np.nan
    found = poles(body)
    oscillating = found.f0.values[found["imag"].values > 0.0]
    return float(oscillating.min()) if oscillating.size else np.nan


def _spectra(inputs: Iterable[str] | Mapping[str, Spectrum] | None) -> dict[str, Spectrum]:
    """Spectra of a request by their names."""
    if inputs is None:
        return {}
    if isinstance(inputs, Mapping):
        for name, spectrum in inputs.items():
            if not isinstance(spectrum, Spectrum):
                raise RequestError(
                    f"inputs[{name!r}] = {spectrum!r} is no spectrum; use `seat_test_input`, "
                    "`SpectrumTable` or another."
                )
        return {str(name): spectrum for name, spectrum in inputs.items()}
    return {
        name: seat_test_input(name) for name in ([inputs] if isinstance(inputs, str) else inputs)
    }


def _chosen(
    bodies: Iterable[str | SeatedBody] | None, sitting_mass: float | None
) -> list[SeatedBody]:
    """Bodies of a request, scaled where that is asked for."""
    given = list_bodies() if bodies is None else bodies
    if isinstance(given, str | SeatedBody):
        given = [given]
    loaded = list_of(
        SeatedBody, [load_body(b) if isinstance(b, str) else b for b in given], "bodies"
    )
    if not loaded:
        raise RequestError(f"bodies is empty; name some of {list_bodies()}.")
    names = [body.name for body in loaded]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise RequestError(
            f"bodies has {twice[0]!r} twice; give every body a name of its own, such as with "
            "dataclasses.replace(body, name=...)."
        )
    if sitting_mass is None:
        return list(loaded)
    return [body.scaled(sitting_mass=sitting_mass) for body in loaded]
