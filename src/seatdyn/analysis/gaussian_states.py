"""What an element with states of its own is, on average, to a Gaussian motion.

Travel, speed and states are taken for jointly Gaussian, x = (d, v, ..., s) with mean m and
covariance S. Then of any law g the linear function nearest to it in the mean square is

    E[g] + E[dg/dx] (x - m),    E[dg/dx] = S^-1 E[(x - m) g]

(Stein's lemma; Atalik and Utku 1976, Earthq. Eng. Struct. Dyn. 4:411-420), for the force as well as
for the rates of the states (Wen 1980, J. Appl. Mech. 47:150-154, for hysteresis). The integrals run
over one variable after the other, each conditional on those before it: Gauss-Legendre panels end
where a speed or a state is zero, and shrink towards a speed of zero, where friction is steep.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from seatdyn.kernels.jit import MEMORY_FORCE, MEMORY_RATE, CompileNotice, law_address
from seatdyn.model.memory import LinearMemory, MemoryElement

Array = NDArray[np.float64]
TRAVEL, SPEED, ABSOLUTE_SPEED, ACCELERATION = range(4)  # what an element may feel, then its states
ORDER = (SPEED, ABSOLUTE_SPEED, ACCELERATION)  # integrated first, with panels towards zero
REACH = 8.0  # standard deviations: 1e-15 of the probability lies beyond
STILL = 1e-4  # of the size of a state that matters: the least level it is given
SMALLEST = 1e-6  # of a standard deviation: what the variables before it leave of it at least
MANY = 4  # variables, speeds counted twice, beyond which a coarser rule is used


class Rule(NamedTuple):
    """Panels, points in each, panels towards a speed of zero, and points over the travel."""

    panels: int
    points: int
    grades: int
    travel: int


FINE, COARSE = Rule(8, 6, 8, 12), Rule(6, 4, 5, 8)


class StateEquivalent(NamedTuple):
    """Means of force (N) and rates (q,), the linear form, and the r.m.s. force about its mean."""

    mean: float
    rates: Array
    form: LinearMemory
    rms: float


@dataclass(frozen=True)
class Joint:
    """The Gaussian motion that an element feels, as numbers that may be varied freely.

    With k variables a place (k + k(k-1)/2 + means,) holds the logarithms of their standard
    deviations, the rows of the Cholesky factor of their correlations without its diagonal, and the
    mean travel over its standard deviation and the mean states over the size that matters.
    """

    element: MemoryElement

    @property
    def variables(self) -> list[int]:
        """Which of d, v, w, a and states (0 .. 3 + q), in the order of integration."""
        feels = self.element.feels
        states = [ACCELERATION + 1 + i for i in range(len(self.element.states))]
        travel = [TRAVEL] if TRAVEL in feels else []
        return [i for i in ORDER if i in feels] + states + travel

    @property
    def moving(self) -> list[int]:
        """Positions in `variables` of those that may have a mean."""
        return [k for k, i in enumerate(self.variables) if i not in ORDER]

    @property
    def size(self) -> int:
        """Numbers in a place."""
        k = len(self.variables)
        return k + k * (k - 1) // 2 + len(self.moving)

    def begin(self, base: tuple[float, float, float]) -> Array:
        """Levels of the base (m, m/s, m/s2), states of the size that matters, all independent."""
        level = dict(zip((TRAVEL, SPEED, ACCELERATION), base, strict=True))
        level[ABSOLUTE_SPEED] = base[1]
        level |= {ACCELERATION + 1 + i: s for i, s in enumerate(self.element.lower().scale)}
        sizes = np.array([level[i] for i in self.variables])
        settled = dict(enumerate(self.element.settled(0.0), ACCELERATION + 1))
        mean = np.array([settled.get(i, 0.0) for i in self.variables])
        return self.encode(np.diag(sizes**2), mean, sizes)

    def stretched(self, place: Array, factor: float) -> Array:
        """The same with motions `factor` times as large."""
        changed = place.copy()
        for k, i in enumerate(self.variables):
            changed[k] += math.log(factor) if i <= ACCELERATION else 0.0
        return changed

    def decode(self, place: Array) -> tuple[Array, Array, Array] | None:
        """Standard deviations (k,), means (k,) and Cholesky factor (k, k) of the covariance.

        None for what is no correlation.
        """
        k = len(self.variables)
        sigma = np.exp(place[:k])
        lower = np.zeros((k, k))
        lower[np.tril_indices(k, -1)] = place[k : k + k * (k - 1) // 2]
        left = 1.0 - np.sum(lower**2, axis=1)
        if np.any(left <= 0.0):
            return None
        lower[np.diag_indices(k)] = np.maximum(np.sqrt(left), SMALLEST)
        mean = np.zeros(k)
        mean[self.moving] = place[place.size - len(self.moving) :]
        mean *= self._sizes(sigma)
        return sigma, mean, sigma[:, None] * lower

    def encode(self, covariance: Array, mean: Array, sigma: Array) -> Array:
        """The place of a covariance (k, k) and means (k,); travel over its level in `sigma`."""
        size = self._sizes(sigma)
        state = np.array([i > ACCELERATION for i in self.variables])
        # a state that stays where it is has no level of its own
        own = np.maximum(np.sqrt(np.diagonal(covariance)), np.where(state, STILL * size, 0.0))
        correlation = covariance / np.outer(own, own)
        lower = np.linalg.cholesky(correlation + SMALLEST**2 * np.eye(own.size))
        below = lower[np.tril_indices(own.size, -1)]
        return np.concatenate([np.log(own), below, (mean / size)[self.moving]])

    def _sizes(self, sigma: Array) -> Array:
        """What means are measured in: levels, and sizes that matter of the states."""
        scale = dict(enumerate(self.element.lower().scale, ACCELERATION + 1))
        return np.array([scale.get(i, s) for i, s in zip(self.variables, sigma, strict=True)])


def equivalent_states(element: MemoryElement, mean: Array, factor: Array) -> StateEquivalent:
    """Linear form of an element under a Gaussian motion.

    Parameters
    ----------
    element : with states of its own
    mean, factor : of its `Joint.variables`: means (k,) and Cholesky factor of the covariance (k, k)

    Returns
    -------
    StateEquivalent
    """
    from seatdyn.kernels.evaluate import evaluate_memory

    variables, law = Joint(element).variables, element.lower()
    points, weights = _nodes(variables, mean, factor)
    q = len(element.states)
    felt = np.zeros((weights.size, 4 + q))
    felt[:, variables] = points
    with CompileNotice():
        values = evaluate_memory(
            law_address(law.force, element.name, MEMORY_FORCE),
            law_address(law.rate, element.name, MEMORY_RATE),
            np.array([*law.parameters, 0.0]),
            np.ascontiguousarray(felt[:, :4]),
            np.ascontiguousarray(felt[:, 4:]),
        )
    level = weights @ values
    away = points - mean
    # with the moments of the points themselves a linear law comes out exactly
    weighted = (away * weights[:, None]).T
    slopes = np.zeros((4 + q, 1 + q))
    slopes[variables] = np.linalg.solve(weighted @ away, weighted @ (values - level))
    form = LinearMemory(
        a=slopes[4:, 1:].T,
        b=slopes[TRAVEL, 1:],
        e=slopes[SPEED, 1:],
        c=slopes[4:, 0],
        k=float(slopes[TRAVEL, 0]),
        g=float(slopes[SPEED, 0]),
        h=slopes[ABSOLUTE_SPEED : ACCELERATION + 1, 1:].T,
    )
    square = float(weights @ (values[:, 0] - level[0]) ** 2)
    return StateEquivalent(float(level[0]), level[1:], form, math.sqrt(square))


def _nodes(variables: list[int], mean: Array, factor: Array) -> tuple[Array, Array]:
    """Points (p, k) and weights (p,) of the Gaussian density."""
    steep = sum(variable in ORDER for variable in variables)
    rule = FINE if len(variables) + steep <= MANY else COARSE
    points, weights = np.zeros((1, 0)), np.ones(1)
    for k, variable in enumerate(variables):
        centre = mean[k] + points @ factor[k, :k]
        if variable == TRAVEL:
            node, weight = np.polynomial.hermite_e.hermegauss(rule.travel)
            share = np.tile(node, (weights.size, 1))
            measure = np.tile(weight / math.sqrt(2 * math.pi), (weights.size, 1))
        else:
            share, measure = _panels(-centre / factor[k, k], rule, variable in ORDER)
        points = np.column_stack([np.repeat(points, share.shape[1], axis=0), share.ravel()])
        weights = (weights[:, None] * measure).ravel()
    return mean + points @ factor.T, weights / weights.sum()


def _panels(zero: Array, rule: Rule, graded: bool) -> tuple[Array, Array]:
    """Nodes and weights (p, n) of a standard normal, panels ending at `zero` (p,)."""
    towards = 3.0 ** -np.arange(rule.grades) if graded else np.zeros(0)
    near = np.concatenate([-towards, [0.0], towards])
    even = np.linspace(-REACH, REACH, rule.panels + 1)
    edges = np.hstack([np.tile(even, (zero.size, 1)), zero[:, None] + near])
    edges = np.sort(np.clip(edges, -REACH, REACH), axis=1)
    node, weight = np.polynomial.legendre.leggauss(rule.points)
    half = np.diff(edges, axis=1)[..., None] / 2
    share = (edges[:, :-1, None] + half * (1.0 + node)).reshape(zero.size, -1)
    density = np.exp(-0.5 * share**2) / math.sqrt(2 * math.pi)
    return share, (half * weight).reshape(zero.size, -1) * density
