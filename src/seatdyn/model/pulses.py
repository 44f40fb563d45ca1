"""Base motions that end: smooth step, half-sine shock, frequency sweep."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from seatdyn.errors import DriftWarning, ExcitationError
from seatdyn.model.excitation import DEGREES, Array, Excitation, Motion, peak_level, set_number
from seatdyn.model.integration import integrate_samples
from seatdyn.units import ACCELERATION, DURATION, FREQUENCY, LENGTH, Limits, either_sign

SMOOTH_STEP = np.array([0.0, 0.0, 0.0, 10.0, -15.0, 6.0])  # 0 to 1, velocity and acceleration 0
POINTS_PER_PERIOD = 100  # of the fastest motion of a sweep; spline error below 1e-7
MOST_SEGMENTS = 5_000_000  # of a sweep
LATEST = 1e9  # s
SHOCK_DURATION = Limits(minimum=1e-6, maximum=1e3)  # s
SPREAD = Limits(minimum=1e-3, maximum=1e6)


@dataclass(frozen=True)
class Step(Excitation):
    """Smooth displacement step x0 = h (10 s^3 - 15 s^4 + 6 s^5), s = (t - start)/duration.

    Parameters
    ----------
    height : h in m, within +-1000
    duration : rise time, s, 1e-6 .. 1e9
    start : s, 0 .. 1e9
    """

    height: float
    duration: float
    start: float = 0.0

    def __post_init__(self) -> None:
        """Check every number."""
        set_number(self, "height", "m", **either_sign(LENGTH))
        set_number(self, "duration", "s", **DURATION)
        set_number(self, "start", "s", minimum=0.0, maximum=LATEST)

    def lower(self) -> Motion:
        """Still, rising, still."""
        rising = self.height * SMOOTH_STEP / self.duration ** np.arange(DEGREES)
        end = np.array([self.height, 0.0, 0.0, 0.0, 0.0, 0.0])
        starts, rows = [self.start, self.start + self.duration], [rising, end]
        if self.start > 0.0:
            starts, rows = [0.0, *starts], [np.zeros(DEGREES), *rows]
        return Motion(np.array(starts), np.array(rows), np.zeros((len(starts), 3)))


@dataclass(frozen=True)
class HalfSineShock(Excitation):
    """Half-sine pulse of base acceleration.

    A lone pulse leaves the base with the velocity 2 a D/pi. By default two opposite half-sines,
    `spread` times longer and 1/(2 spread) times as high, stand before and after it, so that the
    base ends at rest where it began.

    Parameters
    ----------
    amplitude : peak acceleration a, m/s2, within +-1e6
    duration : D of the pulse, s, 1e-6 .. 1000
    start : begin of the main pulse, s, up to 1e9; default: as early as the pulse before it allows
    residual : "compensate", or "keep" the final velocity (warned about)
    spread : length of each compensating pulse over `duration`, 1e-3 .. 1e6

    Examples
    --------
    >>> import seatdyn as sd
    >>> shock = sd.HalfSineShock(50.0, 0.01)
    >>> abs(shock.velocity(1.0)) < 1e-12, abs(shock.displacement(1.0)) < 1e-12
    (np.True_, np.True_)
    """

    amplitude: float
    duration: float
    start: float | None = None
    residual: Literal["compensate", "keep"] = field(default="compensate", kw_only=True)
    spread: float = field(default=5.0, kw_only=True)

    def __post_init__(self) -> None:
        """Check every number, and that there is room for the pulse before."""
        set_number(self, "amplitude", "m/s2", **either_sign(ACCELERATION))
        set_number(self, "duration", "s", **SHOCK_DURATION)
        set_number(self, "spread", "", **SPREAD)
        if self.residual not in ("compensate", "keep"):
            raise ExcitationError(
                f"HalfSineShock.residual = {self.residual!r} is not allowed; "
                "it must be 'compensate' or 'keep'."
            )
        earliest = self.spread * self.duration if self.residual == "compensate" else 0.0
        object.__setattr__(self, "start", earliest if self.start is None else self.start)
        hint = "The compensating pulse before it needs this time; or use residual='keep'."
        set_number(self, "start", "s", minimum=earliest, maximum=LATEST, hint=hint)
        if self.residual == "keep":
            warnings.warn(
                f"HalfSineShock(residual='keep') leaves the base with a velocity of "
                f"{self.velocity_change:.4g} m/s: its displacement grows for ever.",
                DriftWarning,
                stacklevel=3,
            )

    @property
    def velocity_change(self) -> float:
        """Velocity gained in the main pulse, m/s."""
        return 2 * self.amplitude * self.duration / math.pi

    @property
    def notes(self) -> dict[str, float]:
        """Height of the compensating pulses, or the velocity that is left."""
        if self.residual == "keep":
            return {"residual_velocity_m_per_s": self.velocity_change}
        return {"compensating_acceleration_m_per_s2": -self.amplitude / (2 * self.spread)}

    def lower(self) -> Motion:
        """Segments: a half sine of acceleration is a sine plus a straight line."""
        begin, long = float(self.start or 0.0), self.spread * self.duration
        if self.residual == "keep":
            pulses = [(begin, self.duration, self.amplitude)]
        else:
            side = -self.amplitude / (2 * self.spread)
            pulses = [
                (begin - long, long, side),
                (begin, self.duration, self.amplitude),
                (begin + self.duration, long, side),
            ]
        starts, rows, sines = [], [], []
        x = v = 0.0
        if pulses[0][0] > 0.0:
            starts.append(0.0)
            rows.append(np.zeros(DEGREES))
            sines.append((0.0, 0.0, 0.0))
        for start, length, height in pulses:
            omega = math.pi / length
            rate = v + height / omega
            starts.append(start)
            rows.append(np.array([x, rate, 0.0, 0.0, 0.0, 0.0]))
            sines.append((-height / omega**2, omega, 0.0))
            x, v = x + rate * length, v + 2 * height / omega
        starts.append(pulses[-1][0] + pulses[-1][1])
        if self.residual == "compensate":
            x = v = 0.0  # exactly; the sums above leave rounding
        rows.append(np.array([x, v, 0.0, 0.0, 0.0, 0.0]))
        sines.append((0.0, 0.0, 0.0))
        return Motion(np.array(starts), np.array(rows), np.array(sines))


@dataclass(frozen=True)
class Sweep(Excitation):
    """Base acceleration a sin(phase(t)) whose frequency moves from `begin` to `end`.

    It starts in motion, free of drift, as `Sine` does; what drift the changing frequency leaves is
    removed as a straight line of displacement. After `duration` the base is brought to rest at
    zero by a smooth quintic, within two periods of the last frequency.

    Parameters
    ----------
    begin, end : frequencies in Hz, 1e-4 .. 1e5
    duration : s, 1e-6 .. 1e9; 100 segments per period of the higher frequency, at most 5e6 in all
    amplitude, rms : level in m/s2, 0 .. 1e6, peak or r.m.s.; exactly one
    spacing : "linear" or "logarithmic" in time
    """

    begin: float
    end: float
    duration: float
    amplitude: float | None = None
    rms: float | None = field(default=None, kw_only=True)
    spacing: Literal["linear", "logarithmic"] = field(default="linear", kw_only=True)

    def __post_init__(self) -> None:
        """Check every number and that exactly one level is given."""
        set_number(self, "begin", "Hz", **FREQUENCY)
        set_number(self, "end", "Hz", **FREQUENCY)
        set_number(self, "duration", "s", **DURATION)
        if self.spacing not in ("linear", "logarithmic"):
            raise ExcitationError(
                f"Sweep.spacing = {self.spacing!r} is not allowed; use 'linear' or 'logarithmic'."
            )
        peak_level(self)
        if self._segments > MOST_SEGMENTS:
            highest = max(self.begin, self.end)
            longest = MOST_SEGMENTS / (POINTS_PER_PERIOD * highest)
            raise ExcitationError(
                f"Sweep.duration = {self.duration:g} s up to {highest:g} Hz needs "
                f"{self._segments:.3g} segments; at most {MOST_SEGMENTS:.0e} are allowed, which is "
                f"{longest:.4g} s. Shorten the sweep or lower its higher frequency."
            )

    @property
    def _segments(self) -> int:
        return math.ceil(self.duration * max(self.begin, self.end) * POINTS_PER_PERIOD)

    def frequency(self, time: Array) -> Array:
        """Instantaneous frequency in Hz."""
        share = np.asarray(time) / self.duration
        if self.spacing == "linear":
            return self.begin + (self.end - self.begin) * share
        return np.asarray(self.begin * (self.end / self.begin) ** share)

    def phase(self, time: Array) -> Array:
        """Phase in rad: 2 pi times the integral of the frequency."""
        ratio = math.log(self.end / self.begin)
        if self.spacing == "linear" or ratio == 0.0:
            mean = self.begin + (self.end - self.begin) * np.asarray(time) / (2 * self.duration)
            return 2 * np.pi * mean * time
        growth = np.expm1(ratio * np.asarray(time) / self.duration)
        return np.asarray(2 * np.pi * self.begin * self.duration / ratio * growth)

    def lower(self) -> Motion:
        """Quintic segments through the integrated acceleration, and the stop at the end."""
        count = self._segments + 1
        time = np.linspace(0.0, self.duration, count)
        phase, omega = self.phase(time), 2 * np.pi * self.frequency(time)
        polynomials = integrate_samples(time, peak_level(self) * np.sin(phase))
        # the motion is oscillation plus a straight line; the line is the drift
        slowness = np.gradient(omega, time) / omega**2
        shape = np.column_stack(
            [
                np.ones(count),
                time,
                *(np.sin(phase) / omega**2 * slowness**k for k in (0, 2)),
                *(np.cos(phase) / omega**2 * slowness**k for k in (1, 3)),
            ]
        )
        displacement = np.append(polynomials[:, 0], 0.0)
        step = time[1] - time[0]
        displacement[-1] = np.polynomial.polynomial.polyval(step, polynomials[-1])
        scale = np.abs(shape).max(0)
        scale[scale == 0.0] = 1.0
        drift = np.linalg.lstsq(shape / scale, displacement, rcond=None)[0][:2] / scale[:2]
        polynomials[:, 0] -= drift[0] + drift[1] * time[:-1]
        polynomials[:, 1] -= drift[1]
        return bring_to_rest(time, polynomials, 2.0 / self.end)


def bring_to_rest(time: Array, polynomials: Array, duration: float) -> Motion:
    """Append a quintic that takes the motion at the end of `time` to rest at zero."""
    step = time[-1] - time[-2]
    last = np.polynomial.Polynomial(polynomials[-1])
    x, v, a = (float(last.deriv(k)(step)) if k else float(last(step)) for k in range(3))
    n = np.arange(DEGREES)
    conditions = np.array(
        [
            duration**n,
            n * duration ** np.maximum(n - 1, 0),
            n * (n - 1) * duration ** np.maximum(n - 2, 0),
        ]
    )
    known = np.array([x, v, a / 2])
    rest = np.linalg.solve(conditions[:, 3:], -conditions[:, :3] @ known)
    rows = np.vstack([polynomials, [*known, *rest], np.zeros(DEGREES)])
    starts = np.append(time, time[-1] + duration)
    return Motion(starts, rows, np.zeros((starts.size, 3)))
