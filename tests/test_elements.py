"""The test that every element must pass, and each law against its formula."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

import seatdyn as sd
from conftest import oscillator, paper_system
from seatdyn.analysis.lowering import lower
from seatdyn.kernels import dense
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


LAWS = {
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
DISSIPATIVE = ("quadratic", "coulomb", "polynomial damper", "asymmetric", "table damper")
ODD = ("quadratic", "coulomb")


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


@pytest.mark.parametrize("name", LAWS)
@settings(max_examples=60, deadline=None)
@given(d=st.floats(-0.1, 0.1), v=st.floats(-0.1, 0.1))
def test_compiled_law_is_its_formula(name, d, v):
    element, formula = LAWS[name]
    assert compiled(element, [d], [v])[0] == pytest.approx(formula(d, v), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("name", LAWS)
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
