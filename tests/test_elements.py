"""The test that every element must pass, and each law against its formula."""

from __future__ import annotations

import contextlib
import ctypes
import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

import seatdyn as sd
from conftest import oscillator, paper_system
from seatdyn.analysis.lowering import lower
from seatdyn.kernels import dense
from seatdyn.kernels.jit import lanes_law_address
from seatdyn.kernels.laws import arctangent
from seatdyn.model.elements import NonlinearElement


def jump(d, v):
    return 700.0 * d if d > 0.01 or d < -0.02 else 0.0


def gap(d, v):
    return 700.0 * (d - 0.01) if d > 0.01 else 700.0 * min(d + 0.02, 0.0)


def stop(d, v):
    if d > 0.01:
        return max(0.0, 5e3 * (d - 0.01) + 40.0 * v)
    return min(0.0, 5e3 * (d + 0.02) + 40.0 * v) if d < -0.02 else 0.0


def tangent(d, v):
    edge = 0.999 * 0.05
    inside = min(max(d, -edge), edge)
    t = math.tan(math.pi * inside / 0.1)
    spring = 300.0 * (0.1 / math.pi * t + (1 + t * t) * (d - inside))
    return spring + 10.0 * d - 20.0 * d**2 + 3e3 * d**3 + 1e4 * d**5


TABLE_X, TABLE_F = (-0.05, -0.02, 0.0, 0.03, 0.06), (-60.0, -10.0, 0.0, 5.0, 90.0)


def table(x):
    spline = PchipInterpolator(TABLE_X, TABLE_F)
    inside = min(max(x, TABLE_X[0]), TABLE_X[-1])
    return float(spline(inside) + spline.derivative()(inside) * (x - inside))


@sd.force_law({"k": "N/m", "edge": "m"}, jumps_at={"displacement": ["edge"]})
def user_law(d, v, p):
    return p[0] * d if d > p[1] else 0.0


def smooth_sign(v):
    return 2 / math.pi * math.atan(200.0 * v)


def sign(x):
    return (x > 0) - (x < 0)


def stribeck(v, sign_of_v):
    return (15.0 + 10.0 * math.exp(-((v / 0.02) ** 2))) * sign_of_v + 12.0 * v


def hunt_crossley(d, v, n=1.5):
    if d > 0.01:
        return 2e4 * (d - 0.01) ** n * max(0.0, 1.0 + 4.0 * v)
    return -2e4 * (-0.02 - d) ** n * max(0.0, 1.0 - 4.0 * v) if d < -0.02 else 0.0


def air(d):
    """Load at d = 0 less the load at d, from the area as derivative of the volume."""
    area = np.polynomial.Polynomial([1e-3, -2e-3])
    volume = 1.5e-4 + area.integ()(d)
    gauge = 2e5 * (1.5e-4 / volume) ** 1.3 - 101325.0
    return (2e5 - 101325.0) * 1e-3 - gauge * area(d)


def oblique(d):
    """Two springs from (+-a, 0) to (0, d), free length 0.15 m: twice the vertical component."""
    length = math.hypot(d, 0.1)
    return 700.0 * d + 2 * 500.0 * (length - 0.15) * d / length


def balanced(d, v):
    if d * v >= 0:
        return 20.0 * v
    return v * min(max(-400.0 * d / v, 20.0), 150.0)


def scissor(d, v):
    """A stop of 3 kN/m and 40 N s/m, between feet of a scissor, by virtual work."""

    def travel(x):
        return math.sqrt(0.5**2 - 0.3**2) - math.sqrt(0.5**2 - (0.3 + x) ** 2)

    r = (0.3 + d) / math.sqrt(0.5**2 - (0.3 + d) ** 2)
    e = travel(d)
    push = 0.0
    if e > 0.01:
        push = max(0.0, 3e3 * (e - 0.01) + 40.0 * r * v)
    elif e < -0.02:
        push = min(0.0, 3e3 * (e + 0.02) + 40.0 * r * v)
    return r * push


LAWS = {
    "stribeck": (
        sd.StribeckFriction(15.0, 25.0, 0.02, viscous=12.0, slope=200.0),
        lambda d, v: stribeck(v, smooth_sign(v)),
    ),
    "dry friction": (
        sd.StribeckFriction(15.0, 25.0, 0.02, viscous=12.0, dry=True),
        lambda d, v: stribeck(v, sign(v)),
    ),
    "Hertz contact": (sd.ContactStop(2e4, 0.02, 0.01, damping=4.0), hunt_crossley),
    "contact": (
        sd.ContactStop(2e4, 0.02, 0.01, exponent=1.25, damping=4.0),
        lambda d, v: hunt_crossley(d, v, 1.25),
    ),
    "air spring": (
        sd.AirSpring(2e5, 1e-3, 1.5e-4, 1.3, area_slope=-2e-3),
        lambda d, v: air(d),
    ),
    "three springs": (sd.ThreeSpring(700.0, 500.0, 0.15, 0.1), lambda d, v: oblique(d)),
    "power damper": (
        sd.PowerDamper(80.0, 2.5),
        lambda d, v: 80.0 * abs(v) ** 2.5 * sign(v),
    ),
    "blended damper": (
        sd.PowerDamper(40.0, 0.5, blend=0.02),
        lambda d, v: 40.0 * v / (v**2 + 0.02**2) ** 0.25,
    ),
    "balance": (sd.BalanceDamper(400.0, 20.0, 150.0), balanced),
    "bingham": (
        sd.BinghamDamper(15.0, 30.0, offset=-4.0, slope=200.0),
        lambda d, v: 15.0 * smooth_sign(v) + 30.0 * v - 4.0,
    ),
    "dry bingham": (
        sd.BinghamDamper(15.0, 30.0, dry=True),
        lambda d, v: 15.0 * sign(v) + 30.0 * v,
    ),
    "tanh": (
        sd.TanhDamper(30.0, 200.0, 15.0, 10.0, width=0.4, offset=3.0),
        lambda d, v: 30.0 * v + 200.0 * d + 15.0 * math.tanh(10.0 * v + 0.4 * sign(d)) + 3.0,
    ),
    "smooth tanh": (
        sd.TanhDamper(30.0, 200.0, 15.0, 50.0),
        lambda d, v: 30.0 * v + 200.0 * d + 15.0 * math.tanh(50.0 * v),
    ),
    "scissor": (sd.ScissorLever(sd.EndStop(3e3, 0.02, 0.01, 40.0), 0.5, 0.3), scissor),
    "scissor spring": (
        sd.ScissorLever(sd.Spring(800.0), 0.5, 0.3),
        lambda d, v: (
            800.0
            * (0.4 - math.sqrt(0.25 - (0.3 + d) ** 2))
            * (0.3 + d)
            / math.sqrt(0.25 - (0.3 + d) ** 2)
        ),
    ),
    "shifted": (
        sd.Shifted(sd.AirSpring(2e5, 1e-3, 1.5e-4, 1.3, area_slope=-2e-3), -0.02),
        lambda d, v: air(d - 0.02) - air(-0.02),
    ),
    "shifted stop": (
        sd.Shifted(sd.EndStop(5e3, 0.01, 0.02, damping=40.0), 0.01),
        stop,
    ),
    "lever": (
        sd.Lever(sd.Damper(90.0), (0.6, -2.0, 5.0), bump_travel=0.2, rebound_travel=0.2),
        lambda d, v: 90.0 * (0.6 - 2.0 * d + 5.0 * d * d) ** 2 * v,
    ),
    "quadratic": (sd.QuadraticDamper(30.0), lambda d, v: 30.0 * abs(v) * v),
    "coulomb": (
        sd.CoulombFriction(20.0, slope=300.0),
        lambda d, v: 20.0 * 2 / math.pi * math.atan(300.0 * v),
    ),
    "jump": (sd.PiecewiseSpring(700.0, 0.02, 0.01), jump),
    "gap": (sd.PiecewiseSpring(700.0, 0.02, 0.01, jumping=False), gap),
    "end stop": (sd.EndStop(5e3, 0.02, 0.01, damping=40.0), stop),
    "tangent": (
        sd.TangentPolynomialSpring(300.0, 0.05, (10.0, -20.0, 3e3, 0.0, 1e4)),
        tangent,
    ),
    "polynomial damper": (
        sd.PolynomialDamper((30.0, 100.0, 5e3, -1e3, 2e5)),
        lambda d, v: (30.0 + 100.0 * d + 5e3 * d**2 - 1e3 * d**3 + 2e5 * d**4) * v,
    ),
    "asymmetric": (
        sd.AsymmetricDamper(bump=40.0, rebound=90.0),
        lambda d, v: (40.0 if v < 0 else 90.0) * v,
    ),
    "table spring": (sd.TableSpring(TABLE_X, TABLE_F), lambda d, v: table(d)),
    "table damper": (sd.TableDamper(TABLE_X, TABLE_F), lambda d, v: table(v)),
    "preload": (sd.Preload(12.0), lambda d, v: 12.0),
    "user": (user_law(k=500.0, edge=0.015), lambda d, v: 500.0 * d if d > 0.015 else 0.0),
}
DISSIPATIVE = (
    *("quadratic", "coulomb", "polynomial damper", "asymmetric", "table damper", "stribeck"),
    *("dry friction", "power damper", "blended damper", "balance", "dry bingham", "lever"),
)
ODD = (
    *("quadratic", "coulomb", "stribeck", "dry friction", "power damper", "blended damper"),
    *("balance", "dry bingham", "smooth tanh"),
)
IN_LANES = ("coulomb", "jump", "gap", "end stop", "Hertz contact", "bingham")  # vectorised
STICKS = ("dry friction", "dry bingham", "tanh")  # no tangent at rest: the force jumps there


DIMENSIONS = {  # powers of metre, second and kilogram
    "": (0, 0, 0),
    "m": (1, 0, 0),
    "m2": (2, 0, 0),
    "m3": (3, 0, 0),
    "m/s": (1, -1, 0),
    "s/m": (-1, 1, 0),
    "N": (1, -2, 1),
    "N/m": (0, -2, 1),
    "N s/m": (0, -1, 1),
    "N s2/m2": (-1, 0, 1),
    "Pa": (-1, -2, 1),
    "N/m^n": lambda e: (1 - e.exponent, -2, 1),
    "N (s/m)^n": lambda e: (1 - e.exponent, e.exponent - 2, 1),
}
POWERS = {"polynomial": {sd.Lever: lambda i: (-i, 0, 0)}}  # fields that are lists


def fields_with_units(element):
    inner = getattr(element, "element", None)
    own = [f for f in dataclasses.fields(element) if "unit" in f.metadata and f.name != "delay"]
    listed = [f for f in POWERS if hasattr(element, f) and type(element) not in POWERS[f]]
    return (own or inner) and not listed


@contextlib.contextmanager
def no_limits():
    """Let numbers in odd units pass."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("seatdyn.model.elements.validated", lambda obj: None)
        yield


def in_units(element, *scales):
    """The element with every field converted."""

    def factor(powers):
        powers = powers(element) if callable(powers) else powers
        return math.prod(scale**power for scale, power in zip(scales, powers, strict=True))

    changes = {
        f.name: getattr(element, f.name) * factor(DIMENSIONS[f.metadata["unit"]])
        for f in dataclasses.fields(element)
        if "unit" in f.metadata and f.name != "delay"  # which is no part of the law
    }
    for name, kinds in POWERS.items():
        if type(element) in kinds:
            values = getattr(element, name)
            powers = kinds[type(element)]
            changes[name] = tuple(v * factor(powers(i)) for i, v in enumerate(values))
    if hasattr(element, "element"):
        changes["element"] = in_units(element.element, *scales)
    return dataclasses.replace(element, **changes)


def compiled(element, d, v):
    """Force of the compiled law, (p,)."""
    plant = lower(oscillator(sd.Spring(1.0), element), sd.Still().motion)
    return dense.element_forces(plant, 0, np.asarray(d, float), np.asarray(v, float))[:, 0]


def test_every_element_is_tested():
    def leaves(kind):
        return [leaf for sub in kind.__subclasses__() for leaf in (leaves(sub) or [sub])]

    tested = {type(element) for element, _ in LAWS.values()}
    assert {kind for kind in leaves(NonlinearElement) if kind.__module__.startswith("seatdyn")} == (
        tested
    )


def test_every_element_has_its_equation_in_the_docs():
    page = (Path(__file__).parents[1] / "docs" / "elements.md").read_text(encoding="utf-8")
    for element, _ in LAWS.values():
        kind = type(element)
        assert kind.__module__ == "seatdyn.model.custom" or f"`{kind.__name__}`" in page


@pytest.mark.parametrize("name", LAWS)
@settings(max_examples=60, deadline=None)
@given(d=st.floats(-0.1, 0.1), v=st.floats(-0.1, 0.1))
def test_compiled_law_is_its_formula(name, d, v):
    element, formula = LAWS[name]
    assert compiled(element, [d], [v])[0] == pytest.approx(formula(d, v), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("name", LAWS)
def test_vectorised_law_is_the_compiled_law(name):
    element = LAWS[name][0]
    d, v = np.random.default_rng(8).uniform(-0.06, 0.06, (2, 200))
    np.testing.assert_allclose(element.force_at(d, v), compiled(element, d, v), rtol=1e-14)
    assert element.force_at(d[:, None], v).shape == (200, 200)


@pytest.mark.parametrize("name", [*IN_LANES, "contact", "table spring", "shifted stop", "user"])
def test_law_for_lanes_is_the_compiled_law(name):
    """It adds what the law gives for every member, whatever their number."""
    element = LAWS[name][0]
    law = element.lower()
    d, v = np.random.default_rng(7).uniform(-0.06, 0.06, (2, 19))
    found, parameters = np.ones(19), np.array([*law.parameters, 0.0])
    arrays = [ctypes.POINTER(ctypes.c_double)] * 4
    compiled = ctypes.CFUNCTYPE(None, ctypes.c_int64, *arrays)(
        lanes_law_address(law.function, element.name)
    )
    compiled(19, *(np.ctypeslib.as_ctypes(a) for a in (d, v, parameters, found)))
    np.testing.assert_allclose(found - 1.0, element.force_at(d, v), rtol=1e-12, atol=1e-12)


def test_arc_tangent_is_right_to_the_last_place():
    x = np.concatenate([np.linspace(-4.0, 4.0, 20001), 10.0 ** np.linspace(-300, 300, 2001)])
    x = np.concatenate([x, [0.0, np.inf, -np.inf]])
    found = np.array([arctangent(value) for value in x.tolist()])
    assert np.all(np.abs(found - np.arctan(x)) <= np.spacing(np.abs(np.arctan(x))))
    assert math.isnan(arctangent(math.nan))


@pytest.mark.parametrize("name", LAWS)
def test_law_is_true_in_any_units(name):
    """In millimetres, milliseconds and tonnes the same element gives the same force.

    Each field is converted by its own unit, so that a wrong unit or a hidden constant shows.
    """
    element = LAWS[name][0]
    if not fields_with_units(element):
        pytest.skip("coefficients or tables whose unit is that of their power")
    d, v = np.random.default_rng(9).uniform(-0.06, 0.06, (2, 50))
    metre, second, kilogram = 2.0, 0.5, 4.0  # new units per old one: exact in binary
    force = kilogram * metre / second**2
    with no_limits():
        other = in_units(element, metre, second, kilogram)
        values = other.force_at(d * metre, v * metre / second)
    np.testing.assert_allclose(values, force * element.force_at(d, v), rtol=1e-9, atol=1e-12)


def test_small_slopes_of_the_laws_that_have_none_are_refused():
    for name in STICKS:
        with pytest.raises(sd.ModelError, match="no tangent at rest"):
            LAWS[name][0].tangent()


@pytest.mark.parametrize("name", [name for name in LAWS if name not in STICKS])
def test_tangent_is_the_slope_of_the_compiled_law(name):
    element = LAWS[name][0]
    h = 1e-6
    along_d = compiled(element, [-h, h], [0.0, 0.0])
    along_v = compiled(element, [0.0, 0.0], [-h, h])
    k, c = element.tangent()
    assert (along_d[1] - along_d[0]) / (2 * h) == pytest.approx(k, rel=1e-5, abs=1e-4)
    assert (along_v[1] - along_v[0]) / (2 * h) == pytest.approx(c, rel=1e-4, abs=1e-4)


@pytest.mark.parametrize("name", LAWS)
def test_breaks_are_declared(name):
    """Between declared breaks no law jumps by more than its slope allows."""
    element = LAWS[name][0]
    spots = [b.value for b in element.lower().breaks if b.jumps and b.displacement]
    d = np.linspace(-0.045, 0.045, 9001)
    middles = 0.5 * (d[1:] + d[:-1])
    near = np.any([np.abs(middles - spot) < 1.01e-5 for spot in [*spots, np.inf]], axis=0)
    largest = np.zeros(middles.size)
    for speed in (-0.05, 0.05):  # a stop with damping jumps on the way in only
        rises = np.abs(np.diff(compiled(element, d, np.full(d.size, speed))))
        assert np.all(rises[~near] < 0.5)
        largest = np.maximum(largest, rises)
    for spot in spots:
        assert largest[np.abs(middles - spot) < 1.01e-5].max() > 0.5


@pytest.mark.parametrize("name", DISSIPATIVE)
def test_dampers_never_drive(name):
    rng = np.random.default_rng(3)
    d, v = rng.uniform(-0.05, 0.05, (2, 2000))
    assert np.all(compiled(LAWS[name][0], d, v) * v >= 0.0)


@pytest.mark.parametrize("name", ODD)
def test_symmetric_dampers_are_odd(name):
    v = np.linspace(-1, 1, 201)
    force = compiled(LAWS[name][0], np.zeros(201), v)
    np.testing.assert_allclose(force, -force[::-1], atol=1e-12)


@pytest.mark.filterwarnings("ignore::seatdyn.errors.ExtrapolationWarning")
@pytest.mark.parametrize("name", LAWS)
def test_energy_balances_with_every_element(name):
    system = paper_system(LAWS[name][0])
    run = sd.simulate(system, sd.Sine(2.0, amplitude=0.6), 3.0)
    assert run.attrs["status"] == "ok"
    assert run.attrs["energy_residual"] < 1e-6


def test_linear_laws_are_the_linear_elements(sine):
    """The same spring and damper as matrix entries and as channel elements."""
    as_table = paper_system(sd.TangentPolynomialSpring(0.0, 1.0, (500.0,)), k=9450.0)
    both = sd.AsymmetricDamper(60.0, 60.0)
    as_branch = sd.SeatSystem(as_table.body, sd.Seat(35.0, [*as_table.seat.suspension[:1],
        sd.Damper(200.0), both, as_table.seat.suspension[2]]))  # fmt: skip
    one = sd.simulate(paper_system(), sine, 4.0)
    other = sd.simulate(as_branch, sine, 4.0)
    scale = float(np.abs(one.displacement).max())
    assert float(np.abs(one.displacement - other.displacement).max()) < 1e-6 * scale


def test_order_and_direction_of_elements_do_not_matter(sine):
    a, b = sd.QuadraticDamper(200.0), sd.PiecewiseSpring(800.0, 0.02, 0.01)
    flipped = sd.PiecewiseSpring(800.0, 0.01, 0.02, between=("seat", "base"))
    one = sd.simulate(paper_system(a, b), sine, 4.0)
    other = sd.simulate(paper_system(flipped, a), sine, 4.0)
    np.testing.assert_allclose(one.displacement, other.displacement, atol=2e-9)
    np.testing.assert_allclose(one.suspension_force, other.suspension_force, atol=2e-4)


def test_a_user_law_that_cannot_be_compiled_is_refused():
    @sd.force_law({"k": "N/m"})
    def wrong(d, v, p):
        return {"force": p[0] * d}["force"] + undefined_name  # noqa: F821

    with pytest.raises(sd.ModelError, match="cannot be compiled"):
        sd.simulate(oscillator(sd.Spring(1.0), wrong(k=1.0)), sd.Still(), 1.0)


def test_parameters_of_a_user_law_are_checked():
    with pytest.raises(sd.ModelError, match=r"no parameter 'kk'.*'k'"):
        user_law(kk=1.0, edge=0.1)
    with pytest.raises(sd.ModelError, match="needs the parameters"):
        user_law(k=1.0)
    with pytest.raises(sd.ModelError, match=r"not a number|not allowed"):
        user_law(k=float("nan"), edge=0.1)
