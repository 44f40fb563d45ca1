"""Random base motion: one realisation of a spectrum as an excitation."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import KW_ONLY, dataclass
from functools import cached_property

import numpy as np

from seatdyn.errors import ExcitationError
from seatdyn.model.excitation import DEGREES, Array, Excitation, Motion, set_number
from seatdyn.model.pulses import SMOOTH_STEP
from seatdyn.signals.spectrum import Spectrum
from seatdyn.signals.synthesis import Kind, Realisation, Synthesis, member_generator
from seatdyn.units import DURATION

LARGEST_SEED = 2**63 - 1
MEAN_PERIODS = 2.0  # of the displacement, in the default ramp


@dataclass(frozen=True)
class RandomMotion(Excitation):
    """One realisation of a spectrum, faded in from rest and out to rest; then the base is still.

    Between the nodes of the coarse grid of `signals.synthesis` the displacement is a quintic
    polynomial. The fading multiplies the displacement by a smooth step (two derivatives zero at
    its ends); statistics belong to the time between the ramps, `steady`.

    Parameters
    ----------
    spectrum : Spectrum of the acceleration
    duration : s, 1e-6 .. 1e9, ramps included
    seed : whole number >= 0
    member : whole number >= 0; each member of a seed is an independent realisation
    kind : "gaussian", or "random-phase": every line of the spectrum with its exact amplitude
    ramp : s, 0 .. half of the duration; 0 leaves the motion as it is, so that the base starts with
        a displacement and a velocity. Default: two mean periods of the displacement, shortened to
        half of the duration.

    Examples
    --------
    >>> import seatdyn as sd
    >>> motion = sd.RandomMotion(sd.seat_test_input("EM3"), 60.0, seed=1)
    >>> [round(t, 2) for t in motion.steady]
    [1.14, 58.86]
    >>> motion.of_member(1).member
    1
    """

    spectrum: Spectrum
    duration: float
    _: KW_ONLY
    seed: int
    member: int = 0
    kind: Kind = "gaussian"
    ramp: float | None = None

    def __post_init__(self) -> None:
        """Check the request; the grid is checked too."""
        set_number(self, "duration", "s", **DURATION)
        for name in ("seed", "member"):
            value = getattr(self, name)
            whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
            if not (whole and 0 <= value <= LARGEST_SEED):
                raise ExcitationError(
                    f"RandomMotion.{name} = {value!r} is not allowed; it must be a whole number "
                    f"in 0 .. {LARGEST_SEED}."
                )
            object.__setattr__(self, name, int(value))
        if self.ramp is not None:
            hint = "It fades in and out within the duration."
            set_number(self, "ramp", "s", minimum=0.0, maximum=self.duration / 2, hint=hint)
        _ = self.synthesis

    @cached_property
    def synthesis(self) -> Synthesis:
        """Grid and lines, shared by all members."""
        return Synthesis(self.spectrum, self.duration, self.kind)

    @property
    def steady(self) -> tuple[float, float]:
        """Begin and end in s of the time between the ramps."""
        ramp = self.ramp
        if ramp is None:
            mean = self.spectrum.displacement_rms() / self.spectrum.velocity_rms()
            ramp = min(MEAN_PERIODS * 2 * math.pi * mean, self.duration / 2)
        return ramp, self.duration - ramp

    @property
    def notes(self) -> dict[str, float]:
        """The ramp, and the grid."""
        return {"ramp_s": self.steady[0], "grid_step_s": self.synthesis.step}

    def of_member(self, member: int) -> RandomMotion:
        """The same with another member of the seed."""
        return dataclasses.replace(self, member=member)

    def realise(self) -> Realisation:
        """Displacement, velocity and acceleration at the nodes, without the fading."""
        return self.synthesis.realise(member_generator(self.seed, self.member))

    def lower(self) -> Motion:
        """A quintic segment per grid interval, and rest."""
        raw = self.realise()
        x, v, a = self._faded(raw)
        rows = quintic_segments(raw.step, x, v, a)
        last = np.zeros(DEGREES)
        if self.steady[0] == 0.0:  # the base stays where it ends
            last[0] = x[-1]
        rows = np.vstack([rows, last])
        return Motion(raw.time, rows, np.zeros((rows.shape[0], 3)))

    def _faded(self, raw: Realisation) -> tuple[Array, Array, Array]:
        ramp = self.steady[0]
        x, v, a = raw.displacement, raw.velocity, raw.acceleration
        if ramp == 0.0:
            return x, v, a
        share = np.minimum(np.minimum(raw.time, self.duration - raw.time) / ramp, 1.0)
        sign = np.where(raw.time < self.duration / 2, 1.0, -1.0)
        rise = np.polynomial.Polynomial(SMOOTH_STEP)
        w0 = rise(share)
        w1 = sign * rise.deriv()(share) / ramp
        w2 = rise.deriv(2)(share) / ramp**2
        return x * w0, v * w0 + x * w1, a * w0 + 2 * v * w1 + x * w2


def quintic_segments(step: float, x: Array, v: Array, a: Array) -> Array:
    """Quintic polynomials (k, 6) between k+1 nodes that keep displacement, velocity, acceleration.

    The coefficients are of rising powers of the time since the node on the left.
    """
    velocity, bend = v[:-1] * step, a[:-1] * step**2  # in the time over the step
    rise = x[1:] - x[:-1] - velocity - bend / 2
    gain = v[1:] * step - velocity - bend
    twist = (a[1:] * step**2 - bend) / 2
    rows = np.column_stack(
        [
            x[:-1],
            velocity,
            bend / 2,
            10 * rise - 4 * gain + twist,
            -15 * rise + 7 * gain - 2 * twist,
            6 * rise - 3 * gain + twist,
        ]
    )
    return np.asarray(rows / step ** np.arange(DEGREES))
