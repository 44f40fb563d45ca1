"""A measured base acceleration as excitation."""

from __future__ import annotations

import hashlib
import reprlib
import warnings
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from seatdyn.errors import DriftWarning, ExcitationError, MeasurementError
from seatdyn.model.excitation import DEGREES, Array, Excitation, Motion
from seatdyn.model.integration import end_at_rest, end_of, integrate_samples
from seatdyn.signals.clock import rate_of
from seatdyn.signals.files import Column, Unit, read_measurement
from seatdyn.units import ACCELERATION, RATE, number

FEWEST_SAMPLES = 8
MOST_SAMPLES = 20_000_000
LOWEST_CUT, HIGHEST_CUT = 1e-6, 0.49  # of the sampling rate
PADDING = 9  # samples beside a filtered record, as scipy takes them for one section


@dataclass(frozen=True, eq=False)
class Record(Excitation):
    """Sampled base acceleration, interpolated by a cubic spline.

    Parameters
    ----------
    samples : acceleration in m/s2, within +-1e6, at least 8
    rate : sampling rate in Hz, 1e-3 .. 1e7; or give `time`
    time : instants in s, evenly spaced within 1 % of the interval
    mean : "remove" subtracts the mean acceleration; "keep" leaves it
    drift : "compensate" adds the smallest smooth acceleration after which the base ends at rest at
        zero; "keep" leaves final velocity and displacement, and warns
    high_pass : cut-off in Hz, 1e-6 .. 0.49 of the rate, of a zero-phase second-order
        Butterworth filter, or None. A long record needs it: integration turns slow errors into
        large displacements.

    After the record the base stays where it ended. Records are compared by identity; `repr` names
    the samples by their number and a SHA-256 digest.
    """

    samples: ArrayLike
    rate: float | None = None
    time: ArrayLike | None = None
    mean: Literal["remove", "keep"] = "remove"
    drift: Literal["compensate", "keep"] = "compensate"
    high_pass: float | None = None

    def __post_init__(self) -> None:
        """Check samples, time base and options."""
        for name, allowed in (("mean", ("remove", "keep")), ("drift", ("compensate", "keep"))):
            if getattr(self, name) not in allowed:
                raise ExcitationError(
                    f"Record.{name} = {getattr(self, name)!r} is not allowed; "
                    f"it must be {allowed[0]!r} or {allowed[1]!r}."
                )
        samples = self._numbers("samples")
        if not FEWEST_SAMPLES <= samples.size <= MOST_SAMPLES:
            raise ExcitationError(
                f"Record.samples has {samples.size} samples; it must have "
                f"{FEWEST_SAMPLES} to {MOST_SAMPLES}."
            )
        if not np.all(np.isfinite(samples)):
            place = int(np.argmin(np.isfinite(samples)))
            raise ExcitationError(
                f"Record.samples[{place}] = {samples[place]} is not finite; "
                "repair the record or cut it there."
            )
        most = ACCELERATION["maximum"]
        if np.any(np.abs(samples) > most):
            place = int(np.argmax(np.abs(samples) > most))
            raise ExcitationError(
                f"Record.samples[{place}] = {samples[place]:g} m/s2 is not allowed; it must be a "
                f"number in {-most:g} .. {most:g} m/s2. Check the unit of the record."
            )
        object.__setattr__(self, "samples", samples)
        if (self.rate is None) == (self.time is None):
            given = "neither was" if self.rate is None else "both were"
            raise ExcitationError(
                f"Record needs exactly one of rate (Hz) and time (s), but {given} given; "
                "pass one of them."
            )
        if self.time is not None:
            object.__setattr__(self, "rate", self._rate_of(self._numbers("time")))
        rate = number(self.rate, "Record.rate", "Hz", **RATE, error=ExcitationError)
        object.__setattr__(self, "rate", rate)
        if self.high_pass is not None:
            cut = number(
                self.high_pass,
                "Record.high_pass",
                "Hz",
                minimum=LOWEST_CUT * rate,
                maximum=HIGHEST_CUT * rate,
                hint="It must stay below half the sampling rate.",
                error=ExcitationError,
            )
            object.__setattr__(self, "high_pass", cut)
        if self.drift == "keep":
            x, v = end_of(self._time, self._segments[0])
            warnings.warn(
                f"Record(drift='keep') ends with a velocity of {v:.4g} m/s and a displacement of "
                f"{x:.4g} m.",
                DriftWarning,
                stacklevel=3,
            )

    def __repr__(self) -> str:
        """Options, and what identifies the samples."""
        return (
            f"Record({np.size(self.samples)} samples, rate={self.rate!r}, mean={self.mean!r}, "
            f"drift={self.drift!r}, high_pass={self.high_pass!r}, sha256={self.digest!r})"
        )

    @cached_property
    def digest(self) -> str:
        """SHA-256 of the samples as little-endian doubles."""
        return hashlib.sha256(np.asarray(self.samples, dtype="<f8").tobytes()).hexdigest()

    def _numbers(self, name: str) -> Array:
        """A read-only copy of a list of numbers."""
        given = getattr(self, name)
        try:
            values = np.array(given, dtype=float).ravel()
        except (TypeError, ValueError, OverflowError):
            raise ExcitationError(
                f"Record.{name} = {reprlib.repr(given)} must be a list of numbers; "
                "remove or repair what is text."
            ) from None
        values.setflags(write=False)
        return values

    def _rate_of(self, time: Array) -> float:
        samples = np.asarray(self.samples)
        if time.shape != samples.shape or not np.all(np.isfinite(time)):
            raise ExcitationError(
                f"Record.time must hold one finite instant for each of the {samples.size} samples."
            )
        try:
            return rate_of(time, "Record.time", lambda i: f"sample {i}")
        except MeasurementError as error:
            raise ExcitationError(str(error)) from None

    @property
    def _time(self) -> Array:
        return np.arange(np.size(self.samples)) / float(self.rate or 1.0)

    @cached_property
    def _segments(self) -> tuple[Array, dict[str, float]]:
        """Quintic segments and what was done to get them."""
        samples, notes = np.array(self.samples), {}
        if self.mean == "remove":
            notes["mean_removed_m_per_s2"] = float(samples.mean())
            samples = samples - samples.mean()
        if self.high_pass is not None:
            from scipy.signal import butter, sosfiltfilt

            sections = butter(2, self.high_pass, "highpass", fs=self.rate, output="sos")
            padding = min(PADDING, samples.size - 1)
            samples = sosfiltfilt(sections, samples, padlen=padding)
            notes["high_pass_Hz"] = self.high_pass
        if self.drift == "keep":
            return integrate_samples(self._time, samples), notes
        segments, addition = end_at_rest(self._time, samples)
        notes["compensating_acceleration_m_per_s2"] = float(np.abs(addition).max())
        return segments, notes

    @property
    def notes(self) -> dict[str, float]:
        """Mean removed, filter, largest compensating acceleration."""
        return self._segments[1]

    def lower(self) -> Motion:
        """A segment per sample, and the state that the record ends in."""
        x, v = end_of(self._time, self._segments[0])
        after = np.zeros(DEGREES)
        if self.drift == "keep":
            after[:2] = x, v
        rows = np.vstack([self._segments[0], after])
        return Motion(self._time, rows, np.zeros((rows.shape[0], 3)))


def read_record(
    path: str | Path,
    column: Column,
    *,
    time: Column | None = None,
    rate: float | None = None,
    unit: Unit | None = None,
    mean: Literal["remove", "keep"] = "remove",
    drift: Literal["compensate", "keep"] = "compensate",
    high_pass: float | None = None,
) -> Record:
    """Read a base acceleration from a measurement file.

    Parameters
    ----------
    path, time, rate, unit : as in `read_measurement`
    column : name of the acceleration, or its number from 1
    mean, drift, high_pass : see `Record`

    Raises
    ------
    ExcitationError
        Whatever makes the file unusable, with the line; see `read_measurement`.
    """
    try:
        measured = read_measurement(path, [column], time=time, rate=rate, unit=unit)
    except MeasurementError as error:
        raise ExcitationError(str(error)) from None
    (samples,) = measured.channels.values()
    return Record(samples, measured.rate, mean=mean, drift=drift, high_pass=high_pass)
