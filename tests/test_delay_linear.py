"""Linear systems whose elements have states and act late, against equations written by hand.

The complex stiffnesses below are the elements' equations solved for a motion exp(s t); they have
poles, so that zeros are counted as turns and poles.
"""

import dataclasses
import itertools

import mpmath
import numpy as np
import pytest

import seatdyn as sd
from conftest import OFF, ON, oscillator, paper_system
from seatdyn.analysis.linear import dynamic_stiffness
from test_delay import NAMES, quasi_polynomial, rows_by_hand, zeros_in_box
from test_memory import LAWS

GAS = 5e5 * 1.3  # n p0 of the tank of LAWS
COMPLIANCE = np.array([6e-4, 2e-3]) / GAS  # of bellows and tank
FOAM = {
    "zener": lambda s: 5e3 + 8e3 * 0.02 * s / (1 + 0.02 * s),
    "tank": lambda s: (
        4e-3**2 * (1 + 2e7 * COMPLIANCE[1] * s) / (COMPLIANCE.sum() + 2e7 * COMPLIANCE.prod() * s)
    ),
    # small motions: the contact sticks
    "dahl": lambda s: 2e4 + 5.0 * s,
    "bouc-wen": lambda s: 5e3 * (0.1 + 0.9 * 1.2) + 20.0 * s,
}
SLOWEST = {  # 1/s: the pole of each complex stiffness
    "zener": -1 / 0.02,
    "tank": -COMPLIANCE.sum() / (2e7 * COMPLIANCE.prod()),
}
CASES = [  # element, its delay, what else is late, by how much
    ("zener", 0.004, "suspension", 0.0),
    ("zener", 0.0203, "suspension", 0.0),
    ("zener", 0.3, "suspension", 0.0),
    ("zener", 0.0, "Damper", 0.05),
    ("zener", 0.011, "feedback", 0.03),
    ("tank", 0.0203, "suspension", 0.0),
    ("dahl", 0.011, "suspension", 0.0),
    ("bouc-wen", 0.0203, "Damper", 0.007),
]


def characteristic(s, body, name, late, what, tau):
    """The determinant with an element more between base and seat; s of any kind."""
    exp = mpmath.exp if isinstance(s, mpmath.mpc) else np.exp
    drag = FOAM[name](s) * exp(-s * late)
    rows = rows_by_hand(s, body, tau, what)
    (_, _, _), (_, e, f), (_, h, i) = rows
    return quasi_polynomial(s, body, tau, what) + drag * (e * i - f * h)


def system_of(body, name, late, what, tau):
    element = dataclasses.replace(LAWS[name][0], delay=late)
    system = paper_system(element, body=body)
    return system.delayed(tau, what) if tau else system


def roots_in_box(case, low, high, top):
    """Zeros with low < Re s < high, |Im s| < top, of the determinant, which has a pole."""
    inside = low < SLOWEST.get(case[1], -np.inf) < high
    return zeros_in_box(case, low, high, top, characteristic) + int(inside)


@pytest.mark.parametrize("body", [OFF, ON])
@pytest.mark.parametrize("case", CASES)
def test_poles_are_the_rightmost_zeros(case, body):
    data = sd.poles(system_of(body, *case), linearise="tangent")
    found, line = data.pole.values, data.attrs["complete_above"]
    mpmath.mp.dps = 30
    for s in found[found.imag >= 0]:
        exact = complex(
            mpmath.findroot(lambda z: characteristic(z, NAMES[body], *case), mpmath.mpc(s))
        )
        assert abs(s - exact) <= 1e-10 * max(1.0, abs(exact))
    states = len(LAWS[case[0]][0].linearised().b)
    assert np.unique(found.round(6)).size == found.size >= 6 + states
    assert np.all(found.real > line)
    assert roots_in_box((NAMES[body], *case), line, 200.0, 700.0) == found.size
    assert data.attrs["stable"] == int(np.all(found.real < 0.0))
    assert sd.is_stable(system_of(body, *case), linearise="tangent") == bool(data.attrs["stable"])


def test_a_state_that_no_force_feels_is_a_pole_of_its_own():
    """A damper whose command stands still: the lag of its valve, and a late damper."""
    passive = dataclasses.replace(LAWS["passive"][0], delay=0.004)
    found = sd.poles(paper_system(passive), linearise="tangent").pole.values
    plain = sd.poles(paper_system(sd.Damper(300.0, delay=0.004))).pole.values
    expected = np.append(plain, -1 / 0.01)
    for s in found:
        assert np.abs(expected - s).min() <= 1e-9 * abs(s)
    assert np.abs(found + 1 / 0.01).min() <= 1e-9


def test_shapes_solve_the_characteristic_equation():
    system = paper_system(dataclasses.replace(LAWS["zener"][0], delay=0.02), body=ON)
    data = sd.modes(system)
    d = dynamic_stiffness(system.linear, data.pole.values)
    left = np.einsum("mij,mj->mi", d, data["shape"].values)
    assert np.abs(left).max() <= 1e-9 * np.abs(d).max()


@pytest.mark.parametrize("name", FOAM)
def test_poles_tend_to_those_without_delay(name):
    plain = sd.poles(paper_system(LAWS[name][0]), linearise="tangent").pole.values
    once, twice = (
        np.abs(
            plain[:, None]
            - sd.poles(
                paper_system(dataclasses.replace(LAWS[name][0], delay=tau)), linearise="tangent"
            ).pole.values
        ).min(axis=1)
        for tau in (1e-7, 2e-7)
    )
    assert twice == pytest.approx(2.0 * once, rel=1e-2)  # at first order in the delay
    assert np.all(once <= 1e-4 * np.abs(plain))


@pytest.mark.parametrize("name", FOAM)
def test_frequency_response(name):
    tau, f = 0.0203, np.array([0.7, 1.55, 4.0, 21.0])
    system = system_of(OFF, name, tau, "feedback", 0.011)
    data = sd.frequency_response(system, frequency=f, linearise="tangent")
    received = sd.receptance(system, node="m1", frequency=f, linearise="tangent")
    for i, s in enumerate(2j * np.pi * f):
        drag = FOAM[name](s) * np.exp(-s * tau)
        rows = np.array(rows_by_hand(s, "back_off", 0.011, "feedback"))
        rows[0, 0] += drag
        drive = np.array([9950.0 + 260.0 * s + drag, 0.0, 0.0])
        z = np.linalg.solve(rows, drive)
        assert data.transmissibility.values[:, i] == pytest.approx(z, rel=1e-9)
        pull = data.element_force.sel(element=LAWS[name][0].name).values[i]
        assert pull == pytest.approx(drag * (z[0] - 1.0) / s**2, rel=1e-9)
        moved = np.linalg.solve(rows, [0.0, 1.0, 0.0])
        assert received.receptance.values[:, i] == pytest.approx(moved, rel=1e-9)


# ---------------------------------------------------------------- margins and maps


def delayed_case(name, what, tau):
    """Arguments of `characteristic` after the body, where `what` is late."""
    if what == LAWS[name][0].name:
        return name, tau, "suspension", 0.0
    return name, tau if what == "suspension" else 0.0, what, tau


@pytest.mark.parametrize("body", [OFF, ON])
@pytest.mark.parametrize(
    ("name", "what"),
    [("zener", "suspension"), ("zener", "Zener"), ("zener", "Damper"), ("zener", "feedback"),
     ("tank", "suspension"), ("tank", "AirSpringWithTank"), ("dahl", "suspension")],
)  # fmt: skip
def test_delay_margin(name, what, body):
    """Both real equations on the axis to 25 digits; the number of zeros between all switches."""
    system = paper_system(LAWS[name][0], body=body)
    data = sd.delay_margin(system, of=what, maximum=0.1, linearise="tangent")
    margin, rate = float(data.delay_margin), 2 * np.pi * float(data.frequency)
    assert data.attrs["stable_without_delay"] == 1
    mpmath.mp.dps = 25

    def parts(tau, w):
        case = delayed_case(name, what, tau)
        value = characteristic(mpmath.mpc(0, w), NAMES[body], *case)
        return value.real, value.imag

    if np.isfinite(margin):
        tau, w = mpmath.findroot(parts, (margin * 1.02, rate * 0.99))
        assert margin == pytest.approx(float(tau), rel=1e-11)
        assert rate == pytest.approx(float(w), rel=1e-11)
    edges = np.concatenate([[0.0], data.delay.values, [0.1]])
    for i, (a, b) in enumerate(itertools.pairwise(edges)):
        case = delayed_case(name, what, 0.5 * (a + b))
        between = roots_in_box((NAMES[body], *case), 0.0, 300.0, 900.0)
        assert between == (int(data.unstable_above[i - 1]) if i else 0)


def test_margin_of_a_late_zener_from_its_frequency_response():
    """G = S/(k + c s + m s^2): |G| = 1 by bisection, and its phase."""
    mass, k, c = 60.0, 9000.0, 200.0
    system = oscillator(sd.Spring(k), sd.Damper(c), LAWS["zener"][0], mass=mass)

    def loop(w):
        s = 1j * w
        return FOAM["zener"](s) / (k + c * s + mass * s * s)

    w = np.linspace(0.5, 60.0, 100_001)
    signs = np.flatnonzero(np.diff(np.abs(loop(w)) > 1.0))
    delays = []
    for low, high in zip(w[signs], w[signs + 1], strict=True):
        for _ in range(60):
            middle = 0.5 * (low + high)
            inside = (abs(loop(middle)) > 1.0) == (abs(loop(low)) > 1.0)
            low, high = (middle, high) if inside else (low, middle)
        delays.append(np.mod(np.angle(-loop(low)), 2 * np.pi) / low)
    data = sd.delay_margin(system, of="Zener", maximum=1.0)
    assert float(data.delay_margin) == pytest.approx(min(delays), rel=1e-12)
    assert float(data.delay[0]) == pytest.approx(min(delays), rel=1e-12)


@pytest.mark.parametrize("name", ["zener", "tank"])
def test_map_by_crossings_and_by_poles(name):
    rng = np.random.default_rng(12)
    system = paper_system(LAWS[name][0], body=ON)
    axes = {
        "damping": np.sort(rng.uniform(0.0, 2000.0, 5)),
        "delay": np.sort(rng.uniform(0.0, 0.06, 6)),
        "seat_mass": np.sort(rng.uniform(10.0, 100.0, 4)),
    }
    options = {"linearise": "tangent", **axes}
    fast = sd.stability_map(system, **options)
    slow = sd.stability_map(system, method="poles", **options)
    assert fast.stable.dims == slow.stable.dims == tuple(axes)
    assert np.array_equal(fast.stable, slow.stable)
    assert 0.1 < float(fast.stable.mean()) < 0.9
    late = sd.stability_map(
        system.delayed(float(axes["delay"][3])),
        linearise="tangent",
        damping=axes["damping"],
        seat_mass=axes["seat_mass"],
    )
    assert np.array_equal(late.stable, fast.stable[:, 3])
    # without delay, against the poles alone
    at_once = sd.stability_map(
        system, linearise="tangent", damping=axes["damping"], delay=[0.0, 1e-9]
    )
    for i, c in enumerate(axes["damping"]):
        stable = sd.is_stable(paper_system(LAWS[name][0], body=ON, c=c), linearise="tangent")
        assert at_once.stable.values[i].tolist() == [stable, stable]


def test_what_knows_no_states_refuses():
    system = paper_system(dataclasses.replace(LAWS["zener"][0], delay=0.02))
    for ask in (
        lambda: sd.zeros(system, output="m1"),
        lambda: sd.state_space(system),
        lambda: sd.is_stable(system, method="hurwitz"),
        lambda: system.linear.stiffness,
    ):
        with pytest.raises(sd.RequestError, match=r"0\.02 s late"):
            ask()
    plain = paper_system(LAWS["zener"][0])
    between = sd.Zener(1e3, 1e3, 0.1, between=("seat", "m1"))
    two = sd.SeatSystem(plain.body, plain.seat, (between,))
    with pytest.raises(sd.RequestError, match="several delayed forces"):
        sd.delay_margin(two, of="Zener")
    assert sd.poles(two.delayed(0.01, "Zener")).sizes["root"] >= 8
