"""Narrow-band noise, as the paper shakes its seats with."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from seatdyn.errors import ExcitationError
from seatdyn.signals.shaping import Shaping
from seatdyn.signals.spectrum import Array, Spectrum, check_band, integrate
from seatdyn.units import ACCELERATION, FREQUENCY, quantity, validated

WIDE = 10.0  # cuts of a resonant band: its centre over and times this


@dataclass(frozen=True)
class NarrowBand(Spectrum):
    """Noise around one frequency.

    "resonant" is white noise through s/(s^2 + 2 pi B s + w0^2), cut at `low` and `high`; B is its
    half-power bandwidth. "rectangular" is flat from centre - B/2 to centre + B/2.

    Parameters
    ----------
    centre : Hz, 1e-4 .. 1e5
    bandwidth : B in Hz, 1e-6 .. 1e5; of a rectangle less than twice the centre
    rms : acceleration in the whole band, m/s2, 0 .. 1e6
    shape : "resonant" or "rectangular"
    cuts : lowest and highest frequency of the resonant shape in Hz; by default a tenth and ten
        times the centre

    Examples
    --------
    >>> import seatdyn as sd
    >>> noise = sd.NarrowBand(1.55, 0.02, rms=0.686)
    >>> round(noise.acceleration_rms(), 6), round(1000 * noise.displacement_rms(), 2)
    (0.686, 7.52)
    """

    centre: float = quantity("Hz", **FREQUENCY)
    bandwidth: float = quantity("Hz", minimum=1e-6, maximum=FREQUENCY["maximum"])
    _: KW_ONLY
    rms: float = quantity("m/s2", **ACCELERATION)
    shape: Literal["resonant", "rectangular"] = "resonant"
    cuts: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        """Check every number and place the cuts."""
        validated(self, error=ExcitationError)
        if self.shape not in ("resonant", "rectangular"):
            raise ExcitationError(
                f"NarrowBand.shape = {self.shape!r} is not allowed; "
                "it must be 'resonant' or 'rectangular'."
            )
        if self.cuts is not None:
            if self.shape == "rectangular":
                raise ExcitationError(
                    "NarrowBand.cuts belong to the resonant shape; a rectangle ends at "
                    "centre -+ bandwidth/2. Leave them out."
                )
            if not (isinstance(self.cuts, tuple | list) and len(self.cuts) == 2):
                raise ExcitationError(
                    f"NarrowBand.cuts = {self.cuts!r} must be two frequencies in Hz."
                )
            object.__setattr__(self, "cuts", check_band("NarrowBand", *self.cuts))
        hint = "A rectangle must lie above zero: bandwidth < 2 centre." if self._flat else ""
        check_band("NarrowBand", self.low, self.high, hint)
        if not self.low < self.centre < self.high:
            raise ExcitationError(
                f"NarrowBand: centre = {self.centre:g} Hz must lie between the cuts "
                f"{self.low:g} and {self.high:g} Hz."
            )

    @property
    def _flat(self) -> bool:
        return self.shape == "rectangular"

    @property
    def low(self) -> float:  # type: ignore[override]
        """Low cut in Hz."""
        if self._flat:
            return self.centre - self.bandwidth / 2
        return self.cuts[0] if self.cuts is not None else self.centre / WIDE

    @property
    def high(self) -> float:  # type: ignore[override]
        """High cut in Hz."""
        if self._flat:
            return self.centre + self.bandwidth / 2
        return self.cuts[1] if self.cuts is not None else self.centre * WIDE

    @property
    def knots(self) -> Array:
        """Finer towards the peak."""
        if self._flat:
            return np.array([self.low, self.high])
        away = self.bandwidth / 4 * 1.25 ** np.arange(200)
        near = np.concatenate([self.centre - away, self.centre + away, [self.centre]])
        inside = near[(near > self.low) & (near < self.high)]
        return np.union1d(inside, super().knots)

    @property
    def finest(self) -> float:
        """The bandwidth, or the low cut."""
        return min(self.bandwidth, self.low)

    @cached_property
    def shaping(self) -> Shaping:  # type: ignore[override]
        """The filter of the class docstring, or a constant, with the gain of the level."""
        if self._flat:
            return Shaping(self.rms / math.sqrt(self.bandwidth), 0, ())
        decay, omega = math.pi * self.bandwidth, 2 * math.pi * self.centre
        turn = np.emath.sqrt(omega**2 - decay**2)
        poles = (complex(-decay + 1j * turn), complex(-decay - 1j * turn))
        unit = Shaping(1.0, 1, poles)
        raw = integrate(lambda f: np.abs(unit.response(f)) ** 2, self.knots).sum()
        return Shaping(self.rms / math.sqrt(raw), 1, poles)

    def inside(self, frequency: Array) -> Array:
        """Power of the filter."""
        return np.asarray(np.abs(self.shaping.response(frequency)) ** 2)
