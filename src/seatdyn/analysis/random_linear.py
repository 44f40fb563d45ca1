"""Random response of a linear (or linearised) seat system: exact, in three independent ways.

`linear_response` integrates over frequency or solves a Lyapunov equation (`covariance`);
`linear_time_response` steps realisations through time, exactly from node to node, and averages.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seatdyn.analysis.covariance import Covariance, in_frequency, in_state_space, transfer
from seatdyn.analysis.linear import Linearise, labelled, on_left
from seatdyn.analysis.linear_map import LinearMap, linear_map, tangents
from seatdyn.analysis.outputs import output_unit
from seatdyn.analysis.response import checked_frequencies
from seatdyn.errors import RequestError, Status
from seatdyn.model.noise import quintic_segments
from seatdyn.model.system import SeatSystem, linear_model, refuse_delays
from seatdyn.signals.spectrum import Spectrum
from seatdyn.signals.synthesis import Kind, Synthesis
from seatdyn.units import number

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]
Method = Literal["frequency", "lyapunov"]
SETTLED = 1e-7  # what is left of the begin of a run where averaging starts
BATCH = 32  # members stepped at once
CONFIDENCE = 0.95
NOTE = "see output_unit"


def linear_response(
    system: SeatSystem,
    spectrum: Spectrum,
    *,
    linearise: Linearise = None,
    method: Method = "frequency",
    frequency: ArrayLike | None = None,
) -> xr.Dataset:
    """Stationary response of the linear part to random base motion.

    Parameters
    ----------
    system : SeatSystem
    spectrum : Spectrum of the base acceleration
    linearise : None leaves non-linear elements out (named in the attribute `ignored`); "tangent"
        takes their tangent at rest
    method : "frequency" (adaptive integral), or "lyapunov" (state space of system and shaping
        filter; not for tables and formulas, and without rates)
    frequency : Hz, where densities of the outputs are wanted as well

    Returns
    -------
    xarray.Dataset
        Over `output` (names as in `steady_state`, unit in `output_unit`): `rms`; `rate_rms`, of
        the time derivative; `upcrossings`, of the mean, in Hz. `covariance` (output, with).
        With `frequency`: `density` (output, frequency), unit squared per Hz. All NaN, with the
        attribute `status` "unstable", if the linear part is unstable.

    Raises
    ------
    RequestError
        No SeatSystem, no spectrum, an unknown method, a frequency that is not > 0.

    Examples
    --------
    >>> import seatdyn as sd
    >>> seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(260.0)])
    >>> system = sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat)
    >>> response = linear_response(system, sd.seat_test_input("EM3"))
    >>> round(1000 * response.rms.sel(output="seat-base").item(), 2)
    31.99
    """
    check_request(system, spectrum)
    if method not in ("frequency", "lyapunov"):
        raise RequestError(f"method = {method!r} is not allowed; use 'frequency' or 'lyapunov'.")
    model = linear_model(system, linearise)
    gains = tangents(system) if linearise == "tangent" else None
    matrices = linear_map(system, gains, linearise=linearise)
    size = len(matrices.names)
    stable = is_settling(matrices)
    found = None
    if stable:
        route = in_frequency if method == "frequency" else in_state_space
        found = route(matrices.system, spectrum)
    square = np.full((size, size), np.nan) if found is None else found.covariance
    variables = levels(found, size)
    variables["covariance"] = (("output", "with"), square, NOTE, "covariance")
    coords = output_coords(matrices.names) | {"with": list(matrices.names)}
    if frequency is not None:
        f = np.asarray(checked_frequencies(frequency), dtype=float)
        gain = np.abs(transfer(matrices.system, f).T) ** 2
        density = gain * (spectrum.density(f) if stable else np.nan)
        variables["density"] = (("output", "frequency"), density, NOTE, "density, per Hz")
        coords["frequency"] = (("frequency",), f, {"units": "Hz", "long_name": "frequency"})
    request = {"function": "linear_response", "method": method, "linearise": linearise}
    return labelled(variables, coords, model, request, **_attributes(stable, spectrum))


def linear_time_response(
    system: SeatSystem,
    spectrum: Spectrum,
    duration: float,
    *,
    realisations: int,
    seed: int,
    kind: Kind = "gaussian",
    linearise: Linearise = None,
) -> xr.Dataset:
    """The same from realisations: exact steps in time, averages and their intervals.

    Every run starts from rest; averaging starts when 1e-7 of its begin is left, and lasts for
    `duration`. Between nodes the displacement of the base is a quintic polynomial.

    Parameters
    ----------
    system, spectrum, linearise : as in `linear_response`
    duration : of the average of one realisation, s
    realisations : number of independent ones, at least 2
    seed : whole number >= 0
    kind : "gaussian" or "random-phase"

    Returns
    -------
    xarray.Dataset
        Over `output`: `rms`, and `rms_low` and `rms_high`, the ends of its 95 % interval by
        Student's t over the mean squares of the realisations; `mean_square` (realisation, output).

    Raises
    ------
    RequestError
        As `linear_response`, or fewer than 2 realisations.
    """
    from scipy.stats import t as student

    check_request(system, spectrum)
    number(realisations, "realisations", "", minimum=2.0, maximum=1e9, error=RequestError)
    refuse_delays(system.delays)
    model = linear_model(system, linearise)
    gains = tangents(system) if linearise == "tangent" else None
    matrices = linear_map(system, gains, linearise=linearise)
    stable = is_settling(matrices)
    squares = np.full((realisations, len(matrices.names)), np.nan)
    if stable:
        squares = _mean_squares(matrices, spectrum, duration, realisations, seed, kind)
    mean, spread = squares.mean(0), squares.std(0, ddof=1) / math.sqrt(realisations)
    reach = student.ppf(0.5 + CONFIDENCE / 2, realisations - 1) * spread
    ends = {"rms": mean, "rms_low": np.maximum(mean - reach, 0.0), "rms_high": mean + reach}
    variables: dict[str, Any] = {
        key: (("output",), np.sqrt(value), NOTE, key) for key, value in ends.items()
    }
    variables["mean_square"] = (("realisation", "output"), squares, NOTE, "mean square")
    request = {
        "function": "linear_time_response", "duration": duration, "realisations": realisations,
        "seed": seed, "kind": kind, "linearise": linearise,
    }  # fmt: skip
    coords = output_coords(matrices.names) | {"realisation": np.arange(realisations)}
    return labelled(variables, coords, model, request, **_attributes(stable, spectrum))


def _mean_squares(
    matrices: LinearMap,
    spectrum: Spectrum,
    duration: float,
    realisations: int,
    seed: int,
    kind: Kind,
) -> Array:
    """Mean squares of the outputs of each member, (members, o)."""
    from seatdyn.kernels.jit import CompileNotice
    from seatdyn.kernels.recursion import accumulate

    a, b, c, d = matrices.system.prompt
    slowest = -float(np.max(matrices.system.poles.real))
    plan = Synthesis(spectrum, duration - math.log(SETTLED) / slowest, kind)
    skip = plan.nodes - 1 - math.floor(duration / plan.step)
    step, drive = exact_step(a, b, plan.step)
    rows = np.hstack([c, d])
    size = len(step)
    squares = []
    for first in range(0, realisations, BATCH):
        members = min(BATCH, realisations - first)
        x, v, a = (np.empty((plan.nodes, members)) for _ in range(3))
        plan.fill(seed, x, v, a, first=first)
        gram = np.zeros((size + 3, size + 3, members))
        with CompileNotice():
            accumulate(step, drive, x, v, a, skip, np.zeros((size, members)), gram)
        full = gram + np.transpose(gram, (1, 0, 2))
        full[np.arange(size + 3), np.arange(size + 3)] /= 2
        squares.append(np.einsum("oi,ijm,oj->mo", rows, full, rows) / (plan.nodes - skip))
    return np.concatenate(squares)


def exact_step(a: Array, b: Array, step: float) -> tuple[Array, Array]:
    """Matrices (S, S) and (S, 6) of one step of x' = A x + B [u, u'] with a quintic u.

    They take the state, and [u, u', u''] at the begin and the end of the step, to the state at the
    end: the exponential of the system joined to the derivatives of u, of which the sixth is zero.
    """
    from scipy.linalg import expm

    size, count = len(a), 6
    joined = np.zeros((size + count, size + count))
    joined[:size, :size], joined[:size, size : size + 2] = a, b
    joined[size:, size:] = np.eye(count, k=1)
    # powers of the step as units of the derivatives, so that none is huge
    unit = np.append(np.ones(size), step ** -np.arange(count, dtype=float))
    propagator = expm(step * joined * unit / unit[:, None]) * unit[:, None] / unit
    hermite = np.empty((count, count))
    for i, row in enumerate(np.eye(count)):
        x, v, acceleration = row[[0, 3]], row[[1, 4]], row[[2, 5]]
        hermite[:, i] = quintic_segments(step, x, v, acceleration)[0]
    factorials = [math.factorial(j) for j in range(count)]
    derivatives = np.array(factorials)[:, None] * hermite
    return propagator[:size, :size], propagator[:size, size:] @ derivatives


def is_settling(matrices: LinearMap) -> bool:
    """Whether every free motion dies out, so that there is a stationary response."""
    values = matrices.system.poles
    return bool(np.all(on_left(values.real, np.max(np.abs(values)))))


def check_request(system: Any, spectrum: Any) -> None:
    """Refuse what is no seat system, or no spectrum."""
    if not isinstance(system, SeatSystem):
        raise RequestError(
            f"system = {type(system).__name__} is not allowed: a random response needs a "
            "SeatSystem; put the body on a Seat: SeatSystem(body, Seat(mass, [...]))."
        )
    if not isinstance(spectrum, Spectrum):
        raise RequestError(
            f"spectrum = {spectrum!r} is no spectrum; use NarrowBand, SpectrumTable, "
            "SpectrumFormula, Road or seat_test_input."
        )


def output_coords(names: Sequence[str]) -> dict[str, Any]:
    """Coordinates `output` and `output_unit`."""
    return {
        "output": list(names),
        "output_unit": ("output", [output_unit(name) for name in names]),
    }


def levels(found: Covariance | None, size: int) -> dict[str, Any]:
    """R.m.s. of outputs and of their rates, and crossings of the mean; NaN without a covariance."""
    if found is None:
        found = Covariance(np.full((size, size), np.nan), np.full(size, np.nan))
    rms, rate = np.sqrt(np.diagonal(found.covariance)), np.sqrt(found.rate)
    with np.errstate(invalid="ignore"):  # an output that is always zero does not cross
        crossings = rate / rms / (2 * np.pi)
    return {
        "rms": (("output",), rms, NOTE, "r.m.s."),
        "rate_rms": (("output",), rate, NOTE, "r.m.s. of the rate, per s"),
        "upcrossings": (("output",), crossings, "Hz", "upward crossings of the mean"),
    }


def _attributes(stable: bool, spectrum: Spectrum) -> dict[str, Any]:
    status = Status.OK if stable else Status.UNSTABLE
    return {"status": str(status), "message": status.message, "spectrum": repr(spectrum)}
