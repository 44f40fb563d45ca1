"""Random seats over all bodies and elements, and what is asked of their steady states.

`RANGES` and a seed are all there is to say about a set: everything is drawn from them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

import seatdyn as sd
from seatdyn.analysis.hysteretic import problem_for
from seatdyn.analysis.steady import orbit_scales

Ends = tuple[float, float]
SEED = 2026
TOLERANCE = 1e-6  # asked of every solution
ALLOWED = 10.0  # tolerances that a sampled solution may miss itself by after one period
MAX_PERIODS, FOR_A_VERDICT = 1000, 200  # of time integration
MARGIN = 1e-3  # of a largest multiplier to 1: nearer than that one period does not tell

# what every set has: log-uniform unless the range begins at zero or below
RANGES: dict[str, Ends] = {
    "level, m/s2 peak": (0.1, 8.0),
    "frequency, Hz": (0.5, 20.0),
    "seat mass, kg": (12.0, 60.0),
    "spring, N/m": (4e3, 25e3),
    "damper, N s/m": (100.0, 2000.0),
    "cushion stiffness, N/m": (30e3, 120e3),
    "cushion damping, N s/m": (200.0, 2000.0),
    "cushion mass, kg": (0.5, 3.0),
}
CUSHIONED = 0.3  # of the sets have a cushion
CLEARANCE = (0.004, 0.05)  # m, of every stop
FORCE = (5.0, 80.0)  # N, of every friction
STEEP = (50.0, 1000.0)  # s/m, of every smoothed sign
LIMITS = {"minimum": (30.0, 300.0), "maximum": (400.0, 3000.0), "lag": (0.003, 0.03)}
CURRENT = {
    "viscous": (50.0, 400.0),
    "yield_force": (5.0, 40.0),
    "yield_per_ampere": (20.0, 150.0),
    "largest_current": (0.5, 2.0),
    "lag": (0.003, 0.03),
    "slope": STEEP,
}
STOPS = {"bump_clearance": CLEARANCE, "rebound_clearance": CLEARANCE}
AIR = {"pressure": (2e5, 6e5), "area": (2e-3, 5e-3), "volume": (5e-4, 1.5e-3), "exponent": (1, 1.4)}


def fixed(**values: Any) -> Callable[[dict[str, float]], dict[str, Any]]:
    """Further arguments that are the same in every set."""
    return lambda drawn: drawn | values


def ordered(low: str, high: str, **values: Any) -> Callable[[dict[str, float]], dict[str, Any]]:
    """Two numbers in order."""
    return lambda x: x | {low: min(x[low], x[high]), high: max(x[low], x[high])} | values


def tabled(name: str) -> Callable[[dict[str, float]], dict[str, Any]]:
    """A table of five points that stiffens outwards."""

    def points(x: dict[str, float]) -> dict[str, Any]:
        force = np.array([-1.0 - x["rise"], -0.5, 0.0, 0.5, 1.0 + x["rise"]]) * x["force"]
        return {name: np.linspace(-x["reach"], x["reach"], 5), "force": force}

    return points


def behind(kind: type, **ranges: Ends) -> Callable[[dict[str, float]], dict[str, Any]]:
    """An element behind a lever."""

    def lever(x: dict[str, float]) -> dict[str, Any]:
        own = {key: x.pop(key) for key in ranges}
        if "bend" in x:
            x["polynomial"] = (x.pop("ratio"), x.pop("bend"))
        return x | {"element": kind(**own)}

    return lever


@dataclass(frozen=True)
class Kind:
    """A kind of element: its class, the ranges of its numbers, and whether it jumps or rubs."""

    make: Any
    ranges: dict[str, Ends]
    finish: Callable[[dict[str, float]], dict[str, Any]] = dict
    sharp: bool = False  # jumps, or is friction
    bears: bool = False  # may replace the spring

    def draw(self, rng: np.random.Generator) -> sd.Element:
        """One of them."""
        drawn = {key: draw(rng, ends) for key, ends in self.ranges.items()}
        return self.make(**self.finish(drawn))


BOUC_WEN = {
    "stiffness": (1e3, 2e4), "share": (0.05, 0.6), "gamma": (50.0, 2e3), "exponent": (1.0, 2.0),
}  # fmt: skip
KINDS: dict[str, Kind] = {
    "quadratic damper": Kind(sd.QuadraticDamper, {"coefficient": (20.0, 2e3)}),
    "power damper": Kind(
        sd.PowerDamper, {"coefficient": (50.0, 1e3), "exponent": (0.4, 2.5), "blend": (0.005, 0.05)}
    ),
    "asymmetric damper": Kind(sd.AsymmetricDamper, {"bump": (50.0, 1e3), "rebound": (50.0, 2e3)}),
    "polynomial damper": Kind(
        sd.PolynomialDamper,
        {"c0": (10.0, 200.0), "c2": (1e4, 1e6)},
        lambda x: {"polynomial": (x["c0"], 0.0, x["c2"])},
    ),
    "balance damper": Kind(
        sd.BalanceDamper,
        {"stiffness": (1e3, 1e4), "minimum": (20.0, 200.0), "maximum": (300.0, 3e3)},
    ),
    "table damper": Kind(
        sd.TableDamper, {"reach": (0.1, 0.6), "force": (50.0, 500.0), "rise": (-0.3, 2.0)},
        tabled("velocity"),
    ),
    "tanh damper": Kind(
        sd.TanhDamper,
        {"viscous": (50.0, 400.0), "stiffness": (100.0, 2e3), "height": (10.0, 150.0),
         "sharpness": (10.0, 200.0), "width": (0.0, 1.0)},
        sharp=True,
    ),
    "table spring": Kind(
        sd.TableSpring, {"reach": (0.01, 0.06), "force": (50.0, 300.0), "rise": (-0.3, 2.0)},
        tabled("displacement"),
    ),
    "tangent spring": Kind(
        sd.TangentPolynomialSpring,
        {"tangent_stiffness": (200.0, 5e3), "travel": (0.04, 0.12), "a3": (0.0, 1e6)},
        lambda x: x | {"polynomial": (0.0, 0.0, x.pop("a3"))},
    ),
    "air spring": Kind(sd.AirSpring, AIR | {"area_slope": (-5e-3, 5e-3)}, bears=True),
    "three springs": Kind(
        sd.ThreeSpring,
        {"vertical": (4e3, 15e3), "oblique": (500.0, 5e3), "free_length": (0.08, 0.2),
         "span": (0.07, 0.2)},
    ),
    "preload": Kind(sd.Preload, {"force": (-100.0, 100.0)}),
    "scissor": Kind(
        sd.ScissorLever, {"arm": (0.3, 0.6), "share": (0.4, 0.8), "coefficient": (100.0, 1e3)},
        lambda x: behind(sd.QuadraticDamper, coefficient=(0, 0))(
            {"arm": x["arm"], "height": x["share"] * x["arm"], "coefficient": x["coefficient"]}
        ),
    ),
    "lever": Kind(
        sd.Lever,
        {"ratio": (0.5, 1.5), "bend": (-2.0, 2.0), "bump_travel": (0.05, 0.1),
         "rebound_travel": (0.05, 0.1), "stiffness": (2e4, 2e5)} | STOPS,
        behind(sd.EndStop, stiffness=(0, 0), bump_clearance=(0, 0), rebound_clearance=(0, 0)),
    ),
    "gap spring": Kind(
        sd.PiecewiseSpring, {"stiffness": (1e3, 1e5)} | STOPS, fixed(jumping=False)
    ),
    "end stop": Kind(sd.EndStop, {"stiffness": (1e4, 2e5), "damping": (0.0, 500.0)} | STOPS),
    "contact stop": Kind(
        sd.ContactStop,
        {"stiffness": (1e5, 3e6), "exponent": (1.2, 2.0), "damping": (0.0, 3.0)} | STOPS,
    ),
    "jumping spring": Kind(
        sd.PiecewiseSpring, {"stiffness": (200.0, 1e4)} | STOPS, sharp=True
    ),
    "Coulomb": Kind(sd.CoulombFriction, {"force": FORCE, "slope": STEEP}, sharp=True),
    "Stribeck": Kind(
        sd.StribeckFriction,
        {"sliding": FORCE, "static": FORCE, "speed": (0.01, 0.1), "slope": STEEP},
        ordered("sliding", "static"),
        sharp=True,
    ),
    "dry friction": Kind(
        sd.StribeckFriction,
        {"sliding": FORCE, "static": FORCE, "speed": (0.01, 0.1)},
        ordered("sliding", "static", dry=True),
        sharp=True,
    ),
    "Bingham": Kind(
        sd.BinghamDamper, {"yield_force": FORCE, "viscous": (50.0, 400.0), "slope": STEEP},
        sharp=True,
    ),
    "dry Bingham": Kind(
        sd.BinghamDamper, {"yield_force": FORCE, "viscous": (50.0, 400.0)}, fixed(dry=True),
        sharp=True,
    ),
    "Dahl": Kind(
        sd.DahlFriction,
        {"sliding": FORCE, "stiffness": (5e3, 2e5), "exponent": (1.0, 2.0), "viscous": (0, 50)},
        sharp=True,
    ),
    "LuGre": Kind(
        sd.LuGreFriction,
        {"sliding": FORCE, "static": FORCE, "speed": (0.005, 0.05), "stiffness": (2e4, 3e5),
         "damping": (20.0, 300.0), "viscous": (0.0, 50.0)},
        ordered("sliding", "static"),
        sharp=True,
    ),
    "Bouc-Wen": Kind(
        sd.BoucWen, BOUC_WEN | {"lean": (-1.0, 1.0)},
        lambda x: x | {"beta": x.pop("lean") * x["gamma"]},
    ),
    "Zener": Kind(
        sd.Zener, {"stiffness": (1e3, 1e4), "relaxing": (1e3, 2e4), "time": (0.002, 0.2)}
    ),
    "air spring with tank": Kind(
        sd.AirSpringWithTank, AIR | {"tank": (1e-3, 5e-3), "restriction": (1e6, 1e9)}, bears=True
    ),
    "Spencer's damper": Kind(
        sd.SpencerDamper,
        {"alpha": (1e3, 4e4), "c0": (50.0, 400.0), "c1": (2e3, 3e4), "k0": (100.0, 2e3),
         "k1": (50.0, 500.0), "x0": (-0.02, 0.02), "gamma": (1e4, 1e6), "lean": (-1.0, 1.0),
         "scale": (10.0, 100.0)},
        lambda x: x | {"beta": x.pop("lean") * x["gamma"], "exponent": 2.0},
    ),
    "passive damper": Kind(
        sd.SemiActiveDamper, LIMITS | {"share": (0.0, 1.0)},
        lambda x: x | {"command": x["minimum"] + x.pop("share") * (x["maximum"] - x["minimum"])},
    ),
    "skyhook": Kind(
        sd.SemiActiveDamper, LIMITS | {"gain": (200.0, 3e3), "saturation": (300.0, 3e3)},
        fixed(control="skyhook"),
    ),
    "on-off skyhook": Kind(
        sd.SemiActiveDamper, LIMITS | {"threshold": (0.002, 0.05)},
        fixed(control="on-off skyhook"),
    ),
    "acceleration driven": Kind(
        sd.SemiActiveDamper, LIMITS | {"threshold": (0.05, 1.0)}, fixed(control="acceleration")
    ),
    "MR skyhook": Kind(
        sd.MRDamper, CURRENT | {"gain": (200.0, 3e3)}, fixed(control="skyhook"), sharp=True
    ),
    "MR on-off skyhook": Kind(
        sd.MRDamper, CURRENT | {"threshold": (0.002, 0.05)}, fixed(control="on-off skyhook"),
        sharp=True,
    ),
}  # fmt: skip
BEARING = 0.5  # of the seats with an air spring have no other


def draw(rng: np.random.Generator, ends: Ends) -> float:
    """Uniform in the logarithm, or uniform where the range begins at zero or below."""
    low, high = ends
    if low <= 0.0:
        return float(rng.uniform(low, high))
    return float(math.exp(rng.uniform(math.log(low), math.log(high))))


@dataclass(frozen=True)
class Set:
    """One seat under one sine."""

    number: int
    kinds: tuple[str, ...]
    system: sd.SeatSystem
    sine: sd.Sine

    @property
    def sharp(self) -> bool:
        """Whether a force jumps or is friction."""
        return any(KINDS[kind].sharp for kind in self.kinds)

    def __str__(self) -> str:
        """What a failure is reported with."""
        sine, body = self.sine, self.system.body.name
        where = f"{sine.peak:.3g} m/s2 at {sine.frequency:.3g} Hz"
        return f"set {self.number}: {body}, {' + '.join(self.kinds)}, {where}"


def random_set(number: int, seed: int = SEED) -> Set:
    """Set `number` of a seed; it does not depend on how many others are drawn."""
    rng = np.random.default_rng([seed, number])
    x = {name.split(",")[0]: draw(rng, ends) for name, ends in RANGES.items()}
    kinds = tuple(str(k) for k in rng.choice(list(KINDS), int(rng.integers(1, 4)), replace=False))
    cushioned = rng.uniform() < CUSHIONED
    suspension: list[sd.Element] = [sd.Spring(x["spring"]), sd.Damper(x["damper"])]
    cushion: list[sd.Element] = [sd.KelvinVoigt(x["cushion stiffness"], x["cushion damping"])]
    for kind in kinds:
        element, below = KINDS[kind].draw(rng), cushioned and rng.uniform() < 1 / 3
        (cushion if below else suspension).append(element)
        if KINDS[kind].bears and not below and rng.uniform() < BEARING:
            suspension = [e for e in suspension if not isinstance(e, sd.Spring)]
    own = {"cushion": cushion, "cushion_mass": x["cushion mass"]} if cushioned else {}
    bodies = [str(name) for name in sd.list_bodies()]
    body = sd.load_body(bodies[int(rng.integers(len(bodies)))])
    system = sd.SeatSystem(body, sd.Seat(x["seat mass"], suspension, **own))
    return Set(number, kinds, system, sd.Sine(x["frequency"], amplitude=x["level"]))


@dataclass(frozen=True)
class Outcome:
    """What `steady_state` said of a set.

    It counts as converged where there is a motion that solves the equations to the tolerance and
    its stability is known: a periodic one, stable or not (or one that grazes a jump, where
    stability does not exist); or a subharmonic one, which time integration has settled on.
    `verdict` says what time integration calls the response where the periodic motion is unstable.
    "unstable" counts, too: poles of the linear part have positive real parts, and time integration
    grows beyond any bound. Any other response that is not periodic is a failure.
    """

    status: str
    method: str
    stable: int
    verdict: str
    message: str
    state: Any

    @property
    def converged(self) -> bool:
        """See above."""
        if self.status == "converged":
            return self.stable in (0, 1)
        return self.status in ("grazing", "subharmonic", "unstable")


def outcome_of(case: Set) -> Outcome:
    """By harmonic balance; by time integration where that fails or its motion is unstable."""
    sine, asked = case.sine, {"tolerance": TOLERANCE}
    state = sd.steady_state(case.system, sine, method="hb", **asked)
    a, verdict, message = state.attrs, "periodic", state.attrs["message"]
    periods = FOR_A_VERDICT if a["status"] == "converged" else MAX_PERIODS
    if a["status"] not in ("converged", "grazing") or a.get("stable") == 0:
        reached = sd.steady_state(case.system, sine, method="time", max_periods=periods, **asked)
        verdict = reached.attrs["status"]
        if a.get("stable") != 0 or verdict == "converged":
            message = f"{reached.attrs['message']} (hb: {a['status']})"
            state, a = reached, reached.attrs
    stable = 1 if a["status"] == "subharmonic" else a.get("stable", -1)
    return Outcome(a["status"], a["method"], stable, verdict, message, state)


def miss(case: Set, outcome: Outcome) -> float:
    """How far the motion misses itself after one period in time, relative to its size.

    Divided by the growth over a period of the disturbance that an unstable motion amplifies; not a
    number where that is beyond all numbers.
    """
    state, sine = outcome.state, case.sine
    problem = problem_for(case.system, sine, sd.Settings(rtol=1e-11))
    parts = [state.displacement.values[:, 0], state.velocity.values[:, 0]]
    if "internal_state" in state:
        parts.append(state.internal_state.values[:, 0])
    start = np.concatenate(parts)
    run = problem.run(0.0, sine.period, problem.start(start))
    if run.status != "ok":
        return math.inf
    change = np.max(np.abs(run.end.y - start) / orbit_scales(problem, run))
    growth = state.attrs.get("floquet_max", 1.0)
    if growth == math.inf:
        return math.nan
    return float(change / max(1.0, growth if growth > 1.0 else 1.0))
