"""Damping test of a seat: transmissibility at resonance under an inert mass."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

import seatdyn
from seatdyn.analysis.seat_test import clearances, end_stops, measuring_point
from seatdyn.analysis.steady import steady_state
from seatdyn.errors import RequestError, Status
from seatdyn.model.body import SEAT, SeatedBody
from seatdyn.model.excitation import Sine
from seatdyn.model.seat import Seat
from seatdyn.model.system import SeatSystem, suspension_total
from seatdyn.standards.acceptance import (
    DAMPING_HEIGHT,
    DAMPING_RANGE,
    DAMPING_TRAVEL,
    INERT_MASS,
)
from seatdyn.units import number

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]
FREQUENCY_STEP = 0.05  # Hz, largest


def damping_test(
    seat: Seat,
    *,
    mass: float = INERT_MASS.value,
    travel: float | None = None,
    expected: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> xr.Dataset:
    """Transmissibility at resonance of a seat that carries an inert mass.

    The platform moves sinusoidally, with a height (peak to peak) of 40 % of the suspension travel
    or 50 mm, whichever is less, at frequencies from 0.5 to 2 times the expected resonance in steps
    of at most 0.05 Hz; at each the steady state is awaited.

    Parameters
    ----------
    seat : Seat
    mass : inert mass on the seat, kg, 1 .. 500
    travel : of the suspension, m; by default between its end stops
    expected : resonance, Hz; by default the undamped frequency of mass and tangent stiffness
    progress : called with the share done

    Returns
    -------
    xarray.Dataset
        transmissibility (r.m.s. acceleration of seat over platform), status (frequency).
        Attributes: resonance_hz, transmissibility_at_resonance, height_m, point, status, ...

    Raises
    ------
    RequestError
        A seat without stops and no `travel`, or without stiffness and no `expected`.

    Examples
    --------
    >>> import seatdyn as sd
    >>> seat = sd.Seat(20.0, [sd.Spring(9500.0), sd.Damper(500.0)])
    >>> test = sd.damping_test(seat, travel=0.1)
    >>> round(test.attrs["transmissibility_at_resonance"], 2)
    2.19
    """
    return DampingTest.make(seat, mass=mass, travel=travel, expected=expected).run(progress)


class DampingTest(NamedTuple):
    """A damping test that was checked: the seat with its load, and how the platform moves."""

    system: SeatSystem
    mass: float
    height: float  # m, peak to peak
    frequency: Array  # Hz

    @classmethod
    def make(
        cls,
        seat: Seat,
        *,
        mass: float = INERT_MASS.value,
        travel: float | None = None,
        expected: float | None = None,
    ) -> DampingTest:
        """Refuse what cannot be tested."""
        if not isinstance(seat, Seat):
            raise RequestError(
                f"seat = {reprlib.repr(seat)} is no Seat; use load_seat or Seat(...)."
            )
        mass = number(mass, "mass", "kg", minimum=1.0, maximum=500.0, error=RequestError)
        system = SeatSystem(SeatedBody("inert mass", {SEAT: mass}, ()), seat)
        if travel is None:
            stops = end_stops(system)
            if not stops:
                raise RequestError(
                    "travel is needed: the suspension has no end stops to measure it between. "
                    "Give it in m, such as damping_test(seat, travel=0.1), or --travel 0.1."
                )
            travel = float(clearances(stops).sum())
        travel = number(travel, "travel", "m", above=0.0, maximum=1.0, error=RequestError)
        if expected is None:
            stiffness, _ = suspension_total(system, 0, "tangent")
            if not stiffness > 0.0:
                raise RequestError(
                    "expected is needed: the suspension has no stiffness. Give the resonance in Hz."
                )
            expected = math.sqrt(stiffness / (seat.mass + mass)) / (2 * math.pi)
        expected = number(expected, "expected", "Hz", above=0.0, maximum=100.0, error=RequestError)
        height = min(DAMPING_TRAVEL.value * travel, DAMPING_HEIGHT.value)
        low, high = (ratio.value * expected for ratio in DAMPING_RANGE)
        steps = math.ceil((high - low) / FREQUENCY_STEP)
        return cls(system, mass, height, np.linspace(low, high, steps + 1))

    def run(self, progress: Callable[[float], None] | None = None) -> xr.Dataset:
        """Await the steady state at every frequency."""
        import xarray as xr

        frequency, system = self.frequency, self.system
        ratio, status = np.full(frequency.size, np.nan), []
        point = measuring_point(system)
        for k, f in enumerate(frequency):
            amplitude = self.height / 2 * (2 * math.pi * f) ** 2
            state = steady_state(system, Sine(float(f), amplitude=amplitude))
            status.append(state.attrs["status"])
            level = float(state.rms.sel(output=f"acc_{point}"))
            ratio[k] = level / (amplitude / math.sqrt(2.0))
            if progress is not None:
                progress((k + 1) / frequency.size)
        found = np.isfinite(ratio)
        best = int(np.nanargmax(ratio)) if found.any() else -1
        worst = next((s for s in status if not Status(s).valid), str(Status.OK))
        return xr.Dataset(
            {
                "transmissibility": (("frequency",), ratio, {"units": "1"}),
                "member_status": (("frequency",), status),
            },
            coords={"frequency": ("frequency", frequency, {"units": "Hz"})},
            attrs={
                "status": worst,
                "message": Status(worst).message,
                "kind": "damping test: a simulation, no certificate",
                "resonance_hz": float(frequency[best]) if best >= 0 else math.nan,
                "transmissibility_at_resonance": float(ratio[best]) if best >= 0 else math.nan,
                "height_m": self.height,
                "inert_mass_kg": self.mass,
                "point": point,
                "seat": repr(system.seat),
                "seatdyn_version": seatdyn.__version__,
            },
        )
