"""Realisations of a spectrum as displacement, velocity and acceleration on a coarse uniform grid.

All three come from the same Fourier coefficients, so they are consistent and cannot drift. The
grid has about 10 points in the shortest period; between them a quintic polynomial through
displacement, velocity and acceleration at both ends leaves, of a sine at the top of the band, at
most 1.4e-6 of its displacement, 8e-6 of its velocity and 9e-5 of its acceleration.

"gaussian" draws complex normal coefficients: the result is a Gaussian process whose covariance is
that of the spectrum, periodic only after `period`, which is longer than the record by a few
correlation lengths. "random-phase" gives every line its exact amplitude and a random phase: each
record has the spectrum exactly, and repeats itself just after its end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seatdyn.errors import ExcitationError
from seatdyn.signals.spectrum import Spectrum
from seatdyn.units import DURATION, number

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Kind = Literal["gaussian", "random-phase"]

POINTS_PER_PERIOD = 10.0  # of the highest frequency
FORGOTTEN = 4.0  # inverse widths of the finest feature after which a record has forgotten itself
MOST_NODES = 20_000_000
TOGETHER = 8  # members in one call of the transform: they fit into the cache


class Realisation(NamedTuple):
    """Base motion at the nodes of a uniform grid, arrays (n,) or, of many members, (n, members)."""

    step: float  # s
    displacement: Array  # m
    velocity: Array  # m/s
    acceleration: Array  # m/s2

    @property
    def time(self) -> Array:
        """Instants of the nodes in s."""
        return np.asarray(self.step * np.arange(self.displacement.shape[0]))


@dataclass(frozen=True)
class Synthesis:
    """What all realisations of one spectrum and duration share.

    Parameters
    ----------
    spectrum : Spectrum
    duration : s; the grid has a node at its begin and its end
    kind : "gaussian" or "random-phase"

    Raises
    ------
    ExcitationError
        A kind that is not known, a grid of more than 20 million nodes, or random phases over a
        duration that does not resolve the spectrum.
    """

    spectrum: Spectrum
    duration: float
    kind: Kind = "gaussian"

    def __post_init__(self) -> None:
        """Check the request."""
        if not isinstance(self.spectrum, Spectrum):
            raise ExcitationError(
                f"spectrum = {self.spectrum!r} is no spectrum; use NarrowBand, SpectrumTable, "
                "SpectrumFormula, Road or seat_test_input."
            )
        duration = number(self.duration, "duration", "s", **DURATION, error=ExcitationError)
        object.__setattr__(self, "duration", duration)
        if self.kind not in ("gaussian", "random-phase"):
            raise ExcitationError(
                f"kind = {self.kind!r} is not allowed; it must be 'gaussian' or 'random-phase'."
            )
        memory = FORGOTTEN / self.spectrum.finest
        nodes = (duration + memory) * self.spectrum.high * POINTS_PER_PERIOD
        if nodes > MOST_NODES:
            raise ExcitationError(
                f"duration = {duration:g} s of a spectrum from {self.spectrum.low:g} to "
                f"{self.spectrum.high:g} Hz with features of {self.spectrum.finest:g} Hz needs "
                f"{nodes:.3g} nodes; at most {MOST_NODES:.0e} are allowed. Shorten it or narrow "
                "the band."
            )
        if self.kind == "random-phase" and duration < memory:
            raise ExcitationError(
                f"duration = {duration:g} s is too short for random phases: features of "
                f"{self.spectrum.finest:g} Hz need {memory:g} s. Lengthen it, or use 'gaussian'."
            )

    @cached_property
    def intervals(self) -> int:
        """Number of grid intervals in the duration."""
        from scipy.fft import next_fast_len

        wanted = math.ceil(self.duration * self.spectrum.high * POINTS_PER_PERIOD)
        # a record of random phases is one period of the transform
        return int(next_fast_len(wanted, real=True)) if self.kind == "random-phase" else wanted

    @property
    def nodes(self) -> int:
        """Number of grid points, both ends included."""
        return self.intervals + 1

    @property
    def step(self) -> float:
        """Grid spacing in s."""
        return self.duration / self.intervals

    @cached_property
    def length(self) -> int:
        """Length of the transform."""
        from scipy.fft import next_fast_len

        if self.kind == "random-phase":
            return self.intervals
        memory = FORGOTTEN / self.spectrum.finest
        return int(next_fast_len(self.nodes + math.ceil(memory / self.step), real=True))

    @property
    def period(self) -> float:
        """Time in s after which the motion would repeat itself; at least the duration."""
        return self.length * self.step

    @cached_property
    def _lines(self) -> tuple[slice, Array, Array]:
        """Place in the transform, angular frequency and r.m.s. acceleration of every line."""
        spacing = 1.0 / self.period
        first = max(1, math.floor(self.spectrum.low / spacing + 0.5))
        last = math.floor(self.spectrum.high / spacing + 0.5)
        edges = (np.arange(first, last + 2) - 0.5) * spacing
        power = self.spectrum.mean_squares(edges)
        omega = 2 * np.pi * spacing * np.arange(first, last + 1, dtype=float)
        return slice(first, last + 1), np.asarray(omega), np.sqrt(power)

    def coefficients(self, generator: np.random.Generator) -> ComplexArray:
        """One draw of c in a(t) = Re sum c exp(i omega t), (lines,), m/s2."""
        _, omega, level = self._lines
        if self.kind == "gaussian":
            pairs = generator.standard_normal(2 * omega.size).view(complex)
            return np.asarray(level * pairs)
        angle = generator.uniform(0.0, 2 * np.pi, omega.size)
        return np.asarray(math.sqrt(2.0) * level * np.exp(1j * angle))

    def realise(self, generator: np.random.Generator) -> Realisation:
        """One realisation."""
        drawn = self.coefficients(generator)[None]
        x, v, a = (motion[0] for motion in self._motions(drawn))
        return Realisation(self.step, x, v, a)

    def fill(
        self,
        seed: int,
        displacement: Array,
        velocity: Array,
        acceleration: Array,
        *,
        first: int = 0,
    ) -> None:
        """Fill arrays (nodes, members) with members `first`, `first` + 1, ... of a seed.

        Member k is the same, to rounding, whatever the number of members and the first of them.
        """
        targets = (displacement, velocity, acceleration)
        shape = (self.nodes, displacement.shape[-1])
        for target in targets:
            if target.shape != shape:
                raise ExcitationError(
                    f"An array of the shape {target.shape} was given; {self.nodes} nodes (rows) "
                    "by members (columns) are needed."
                )
        for begin in range(0, shape[1], TOGETHER):
            members = range(begin, min(begin + TOGETHER, shape[1]))
            drawn = [self.coefficients(member_generator(seed, first + k)) for k in members]
            for target, motion in zip(targets, self._motions(np.array(drawn)), strict=True):
                target[:, members.start : members.stop] = motion.T

    def _motions(self, coefficients: ComplexArray) -> tuple[Array, Array, Array]:
        """Displacement, velocity and acceleration (members, nodes) of Fourier coefficients."""
        place, omega, _ = self._lines
        lines = np.zeros((coefficients.shape[0], self.length // 2 + 1), dtype=complex)
        result = []
        for factor in (-1.0 / omega**2, -1j / omega, np.ones(1)):
            lines[:, place] = 0.5 * factor * coefficients
            result.append(self._transform(lines))
        return result[0], result[1], result[2]

    def _transform(self, lines: ComplexArray) -> Array:
        from scipy.fft import irfft

        full = irfft(lines, self.length, axis=1, norm="forward", workers=1)
        if self.kind == "random-phase":  # the last node is the first one again
            full = np.concatenate([full, full[:, :1]], axis=1)
        return np.asarray(full[:, : self.nodes])


def member_generator(seed: int, member: int) -> np.random.Generator:
    """Random numbers of one member: its own stream, spawned from the seed."""
    sequence = np.random.SeedSequence(seed, spawn_key=(member,))
    return np.random.Generator(np.random.PCG64(sequence))


def synthesise(
    spectrum: Spectrum,
    duration: float,
    *,
    kind: Kind = "gaussian",
    generator: np.random.Generator,
) -> Realisation:
    """One realisation of a spectrum.

    Parameters
    ----------
    spectrum : Spectrum of the acceleration
    duration : s, 1e-6 .. 1e9
    kind : "gaussian" or "random-phase", see the module
    generator : source of the random numbers

    Returns
    -------
    Realisation
        `displacement`, `velocity`, `acceleration`, (n,), at the instants `time`, `step` s apart.

    Examples
    --------
    >>> import numpy as np
    >>> from seatdyn.signals.narrow_band import NarrowBand
    >>> noise = NarrowBand(1.55, 0.2, rms=0.7, shape="rectangular")
    >>> motion = synthesise(
    ...     noise, 100.0, kind="random-phase", generator=np.random.default_rng(1)
    ... )
    >>> round(float(np.std(motion.acceleration[:-1])), 6)
    0.7
    """
    return Synthesis(spectrum, duration, kind).realise(generator)


def synthesise_many(
    spectrum: Spectrum,
    duration: float,
    *,
    seed: int,
    members: int,
    first: int = 0,
    kind: Kind = "gaussian",
) -> Realisation:
    """Members `first` ... `first` + `members` - 1 of a seed, as arrays (n, members).

    Member k is the same, to rounding, whatever the number of members: it has its own stream of
    random numbers, ``numpy.random.SeedSequence(seed).spawn(k + 1)[k]``. To fill arrays in place use
    ``Synthesis(spectrum, duration, kind).fill``.

    Examples
    --------
    >>> from seatdyn.signals.inputs import seat_test_input
    >>> many = synthesise_many(seat_test_input("EM3"), 20.0, seed=1, members=3)
    >>> one = synthesise_many(seat_test_input("EM3"), 20.0, seed=1, members=1, first=2)
    >>> bool(abs(many.acceleration[:, 2] - one.acceleration[:, 0]).max() < 1e-13)
    True
    """
    plan = Synthesis(spectrum, duration, kind)
    x, v, a = (np.empty((plan.nodes, members)) for _ in range(3))
    plan.fill(seed, x, v, a, first=first)
    return Realisation(plan.step, x, v, a)
