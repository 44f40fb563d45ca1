"""What a steady state has beyond a time run, whichever way it was found."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.outputs import output_unit

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]
PER_PERIOD = 1024  # points of the period where it is looked at, and kept
HARMONICS = 20
UNSTABLE = "This motion solves the equations, but it is unstable."


def sorted_multipliers(matrix: Array) -> NDArray[np.complex128]:
    """Eigenvalues of a monodromy matrix, largest first; infinite where it is not finite.

    Disturbances grow beyond all numbers then.
    """
    if not np.all(np.isfinite(matrix)):
        return np.full(len(matrix), np.inf, dtype=complex)
    values = np.linalg.eigvals(matrix).astype(complex)
    return np.asarray(values[np.argsort(-np.abs(values))])


def harmonics_of(values: Array) -> NDArray[np.complex128]:
    """Complex harmonics (o, HARMONICS + 1) of outputs (o, p) at equal phases of a period."""
    spectrum = np.fft.rfft(values, axis=1)[:, : HARMONICS + 1] / values.shape[1]
    spectrum[:, 1:] *= 2
    return np.asarray(spectrum)


def fill(
    data: xr.Dataset,
    names: list[str],
    amplitude: Array,
    maximum: Array,
    minimum: Array,
    rms: Array,
    harmonics: Any,
    multipliers: Any,
) -> None:
    """Add what a steady state has beyond a time run."""
    data.coords["output"] = names
    data.coords["harmonic"] = np.arange(harmonics.shape[1])
    data.coords["output_unit"] = ("output", [output_unit(name) for name in names])
    note = {"units": "see output_unit"}
    data["amplitude"] = ("output", amplitude, note)
    data["maximum"] = ("output", maximum, note)
    data["minimum"] = ("output", minimum, note)
    data["rms"] = ("output", rms, note)
    data["harmonics"] = (("output", "harmonic"), harmonics, note)
    if multipliers is not None:
        data["floquet_multipliers"] = ("multiplier", multipliers, {"units": "1"})
