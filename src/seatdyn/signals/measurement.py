"""A measured record: channels that share one clock, and what can be wrong with them."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from seatdyn.errors import MeasurementError
from seatdyn.units import ACCELERATION, RATE, number, suggestion

Array = NDArray[np.float64]

GRAVITY = 9.80665  # m/s2
UNITS = {"m/s2": 1.0, "g": GRAVITY}
FEWEST_SAMPLES = 8
MOST_SAMPLES = 50_000_000  # of one channel: 400 MB

CLIPPED_RUN = 3  # equal samples in a row at the extreme value, which a smooth signal does not have
CLIPPED_RUNS = 2  # such runs
ABRUPT = 4.0  # smallest steps of the record, with which a run must be entered and left
NEAR_GRAVITY = 0.1  # relative: a mean this close to 1 g is gravity
LARGEST_ON_A_SEAT = 200.0  # m/s2: about 20 g; nobody sits there
SMALLEST_USUAL = 0.15  # m/s2 r.m.s.: less is rare in vehicles, but usual for numbers in g


@dataclass(frozen=True, eq=False)
class Measurement:
    """Accelerations sampled together.

    Parameters
    ----------
    channels : samples by name, m/s2, of equal length, at least 8, finite
    rate : samples per second, 1e-3 .. 1e7 Hz
    start : clock at the first sample, s, where known
    source : file that they are from
    unit : that they were stored in; `channels` are in m/s2 always

    Raises
    ------
    MeasurementError
        Channels of different length, a sample that is not finite or beyond 1e6 m/s2, no channel.

    Examples
    --------
    >>> import numpy as np, seatdyn as sd
    >>> t = np.arange(0.0, 10.0, 0.005)
    >>> record = sd.Measurement({"seat": np.sin(12.0 * t)}, rate=200.0)
    >>> record.duration
    10.0
    """

    channels: Mapping[str, ArrayLike]
    rate: float
    start: float | None = None
    source: str = ""
    unit: str = "m/s2"

    def __post_init__(self) -> None:
        """Check and freeze every channel."""
        where = f"Measurement {self.source!r}" if self.source else "Measurement"
        if not self.channels:
            raise MeasurementError(f"{where} has no channel; give at least one.")
        rate = number(self.rate, f"{where}.rate", "Hz", **RATE, error=MeasurementError)
        object.__setattr__(self, "rate", rate)
        checked = {name: _checked(where, name, values) for name, values in self.channels.items()}
        lengths = {name: values.size for name, values in checked.items()}
        if len(set(lengths.values())) > 1:
            raise MeasurementError(
                f"{where} has channels of different length: {lengths}. They were not sampled "
                "together; cut them to the same stretch of time."
            )
        object.__setattr__(self, "channels", MappingProxyType(checked))

    def __repr__(self) -> str:
        """What is in it, without the samples."""
        names = ", ".join(self.channels)
        return f"Measurement({names}; {self.duration:.6g} s at {self.rate:.6g} Hz)"

    def __getitem__(self, name: str) -> Array:
        """Samples of a channel in m/s2; an unknown name is an error with a suggestion."""
        if name not in self.channels:
            raise MeasurementError(
                f"{self.source or 'The measurement'} has no channel {name!r}. "
                f"{suggestion(str(name), self.channels)}"
            )
        return np.asarray(self.channels[name])

    @property
    def samples(self) -> int:
        """Number of samples of each channel."""
        return np.size(next(iter(self.channels.values())))

    @property
    def duration(self) -> float:
        """Number of samples over the rate, s."""
        return self.samples / self.rate


def _checked(where: str, name: str, values: ArrayLike) -> Array:
    """A read-only channel of finite numbers."""
    try:
        samples = np.array(values, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise MeasurementError(
            f"{where}: channel {name!r} = {reprlib.repr(values)} must be a list of numbers."
        ) from None
    if samples.ndim != 1 or samples.size < FEWEST_SAMPLES:
        raise MeasurementError(
            f"{where}: channel {name!r} has the shape {samples.shape}; it must be one list of at "
            f"least {FEWEST_SAMPLES} samples."
        )
    bad = ~np.isfinite(samples)
    if np.any(bad):
        place = int(np.argmax(bad))
        raise MeasurementError(
            f"{where}: channel {name!r}, sample {place} is {samples[place]}, as are "
            f"{np.count_nonzero(bad) - 1} others. Cut the record there; a gap cannot be filled."
        )
    most = ACCELERATION["maximum"]
    if np.max(np.abs(samples)) > most:
        place = int(np.argmax(np.abs(samples)))
        raise MeasurementError(
            f"{where}: channel {name!r}, sample {place} is {samples[place]:g} m/s2, beyond "
            f"{most:g} m/s2. Check the unit and the calibration."
        )
    samples.setflags(write=False)
    return samples


def doubts(samples: Array, name: str, unit: str) -> list[str]:
    """What looks wrong with a channel that can be evaluated all the same.

    Parameters
    ----------
    samples : m/s2
    name : of the channel, for the messages
    unit : that was stated for the file, "m/s2" or "g"

    Raises
    ------
    MeasurementError
        A channel that does not change: a dead sensor or the wrong column.
    """
    low, high = float(samples.min()), float(samples.max())
    if low == high:
        raise MeasurementError(
            f"Channel {name!r} is constant, {low:g} m/s2 throughout. The sensor was not connected, "
            "or this is the wrong column."
        )
    found = []
    runs = sum(_runs_at(samples, extreme) for extreme in (low, high))
    if runs >= CLIPPED_RUNS:
        found.append(
            f"Channel {name!r} looks clipped: {runs} times it stays at {low:g} or {high:g} m/s2 "
            f"for {CLIPPED_RUN} samples or more. Peaks are cut off and every value is too small; "
            "measure again with a larger range."
        )
    mean, fluctuation = float(samples.mean()), float(samples.std())
    other = "g" if unit == "m/s2" else "m/s2"
    # gravity in the wrong unit: 1 stated as m/s2, or 9.81 stated as g
    wrong_gravity = 1.0 if unit == "m/s2" else GRAVITY**2
    if abs(abs(mean) / wrong_gravity - 1.0) < NEAR_GRAVITY and fluctuation < wrong_gravity:
        found.append(
            f"Channel {name!r} looks as if it were in {other}, not in {unit}: its mean is "
            f"{mean / UNITS[unit]:.3g} {unit}, which is gravity in {other}. State the unit."
        )
    elif unit == "g" and max(-low, high) > LARGEST_ON_A_SEAT:
        found.append(
            f"Channel {name!r} reaches {max(-low, high) / GRAVITY:.3g} g. On a seat that is more "
            "likely m/s2; state the unit, or check the calibration."
        )
    elif unit == "m/s2" and fluctuation < SMALLEST_USUAL:
        found.append(
            f"Channel {name!r} has an r.m.s. of only {fluctuation:.2g} m/s2. Were the numbers in "
            f"g, it would be {GRAVITY * fluctuation:.2g} m/s2; state the unit if so."
        )
    return found


def _runs_at(samples: Array, extreme: float) -> int:
    """How often the samples stay at an extreme value for `CLIPPED_RUN` samples, abruptly.

    The rounded top of a slow wave is flat, too, where the numbers have few digits; but it is
    reached and left by a digit or two.
    """
    at = np.concatenate([[False], samples == extreme, [False]])
    edges = np.flatnonzero(np.diff(at.astype(np.int8)))
    starts, ends = edges[::2], edges[1::2]
    long = (ends - starts >= CLIPPED_RUN) & (starts > 0) & (ends < samples.size)
    steps = np.abs(np.diff(samples))
    digit = float(np.min(steps, initial=np.inf, where=steps > 0.0))
    before = np.abs(samples[starts[long] - 1] - extreme)
    after = np.abs(samples[ends[long]] - extreme)
    return int(np.count_nonzero(np.minimum(before, after) > ABRUPT * digit))


def require_same_clock(first: Measurement, second: Measurement) -> None:
    """Refuse two records whose samples were not taken at the same instants.

    Raises
    ------
    MeasurementError
        Another number of samples, a start that differs by half a sample or more, or rates that
        lead to half a sample between the ends.
    """
    names = [record.source or "one record" for record in (first, second)]
    differs = []
    if first.samples != second.samples:
        differs.append(f"{first.samples} and {second.samples} samples")
    drift = (first.samples - 1) * (1 / second.rate - 1 / first.rate)
    if abs(drift) * first.rate >= 0.5:
        differs.append(
            f"{first.rate:.7g} and {second.rate:.7g} Hz, which is {1e3 * drift:.3g} ms at the end"
        )
    if first.start is not None and second.start is not None:
        late = second.start - first.start
        if abs(late) * first.rate >= 0.5:
            differs.append(f"starts {1e3 * late:.3g} ms apart")
    if differs:
        raise MeasurementError(
            f"The clocks of {names[0]} and {names[1]} do not agree: {'; '.join(differs)}. "
            "Resample both to one clock, or record them with one instrument."
        )
