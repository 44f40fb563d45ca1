"""Elements with states of their own: closed forms, and SciPy with the equations written out."""

from __future__ import annotations

import dataclasses
import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import seatdyn as sd
from conftest import oscillator, paper_system
from seatdyn.analysis.lowering import lower
from seatdyn.kernels.jit import MEMORY_FORCE, MEMORY_RATE, compiled_law
from seatdyn.model.memory import MemoryElement
from test_elements import DIMENSIONS


def sign(x):
    return float(x > 0) - float(x < 0)


def dahl(d, v, w, a, s):
    force = s[0] + 5.0 * v
    return force, [2e4 * v * (1 - s[0] / 20.0 * sign(v))]


def lugre(d, v, w, a, s):
    level = 20.0 + 10.0 * math.exp(-((v / 0.01) ** 2))
    rate = v - 2e5 * abs(v) * s[0] / level
    return 2e5 * s[0] + 60.0 * rate + 5.0 * v, [rate]


def bouc_wen(d, v, w, a, s):
    z = s[0]
    rate = 1.2 * v - 2e4 * abs(v) * abs(z) ** 0.5 * z - 1e4 * v * abs(z) ** 1.5
    return 5e3 * (0.1 * d + 0.9 * z) + 20.0 * v, [rate]


def zener(d, v, w, a, s):
    return 5e3 * d + 8e3 * (d - s[0]), [(d - s[0]) / 0.02]


def tank(d, v, w, a, s):
    """Amounts of air in bellows and tank as volumes at the pressure of rest."""
    over = 6e-4 * s[0]
    bellows = 5e5 * ((6e-4 - over) / (6e-4 + 4e-3 * d)) ** 1.3
    reservoir = 5e5 * ((2e-3 + over) / 2e-3) ** 1.3
    return (5e5 - bellows) * 4e-3, [(bellows - reservoir) / 2e7 / 6e-4]


def spencer(d, v, w, a, s):
    u = 0.1
    alpha, c0, c1 = 14000 + 69500 * u, 2100 + 350 * u, 28300 + 295 * u
    y, z = s
    y_rate = (alpha * z + c0 * v + 4690 * (d - y)) / (c0 + c1)
    slip = v - y_rate
    z_rate = -3.63e6 * abs(slip) * abs(z) * z - 3.63e6 * slip * z**2 + 301 * slip
    return c1 * y_rate + 500 * (d - 0.143), [y_rate, z_rate]


def semi_active(command):
    def law(d, v, w, a, s):
        return max(-200.0, min(200.0, s[0] * v)), [(command(v, w, a) - s[0]) / 0.01]

    return law


def sky(v, w, a):
    if v == 0.0:
        return 475.0
    return max(50.0, min(900.0, 700.0 * w / v))


def switched(seen, v, threshold):
    share = seen / math.sqrt(seen**2 + threshold**2) * sign(v)
    return 50.0 + 850.0 * (1 + share) / 2


def mr_sky(d, v, w, a, s):
    wanted = (800.0 * w * sign(v) - 20.0 - 100.0 * abs(v)) / 200.0
    force = (20.0 + 200.0 * s[0]) * 2 / math.pi * math.atan(300.0 * v) + 100.0 * v
    return force, [(max(0.0, min(1.5, wanted)) - s[0]) / 0.015]


LAWS = {
    "dahl": (sd.DahlFriction(20.0, 2e4, viscous=5.0), dahl),
    "lugre": (sd.LuGreFriction(20.0, 30.0, 0.01, 2e5, 60.0, 5.0), lugre),
    "bouc-wen": (sd.BoucWen(5e3, 0.1, 2e4, 1e4, 1.5, 1.2, 20.0), bouc_wen),
    "zener": (sd.Zener(5e3, 8e3, 0.02), zener),
    "tank": (sd.AirSpringWithTank(5e5, 4e-3, 6e-4, 2e-3, 2e7, 1.3), tank),
    "spencer": (sd.SpencerDamper.spencer1997(0.1), spencer),
    "passive": (
        sd.SemiActiveDamper(50.0, 900.0, 0.01, saturation=200.0, command=300.0),
        semi_active(lambda v, w, a: 300.0),
    ),
    "skyhook": (
        sd.SemiActiveDamper(50.0, 900.0, 0.01, saturation=200.0, control="skyhook", gain=700.0),
        semi_active(sky),
    ),
    "on-off": (
        sd.SemiActiveDamper(
            50.0, 900.0, 0.01, saturation=200.0, control="on-off skyhook", threshold=0.01
        ),
        semi_active(lambda v, w, a: switched(w, v, 0.01)),
    ),
    "acceleration": (
        sd.SemiActiveDamper(50.0, 900.0, 0.01, saturation=200.0, control="acceleration"),
        semi_active(lambda v, w, a: switched(a, v, 0.05)),
    ),
    "mr": (
        sd.MRDamper(100.0, 20.0, 200.0, 1.5, 0.015, control="skyhook", gain=800.0, slope=300.0),
        mr_sky,
    ),
}
SKY = ("passive", "skyhook", "on-off", "acceleration", "mr")  # never drive, whatever w and a are
MASS, STIFFNESS, SINE = 60.0, 9000.0, sd.Sine(1.6, amplitude=1.5)


def test_every_element_is_tested():
    def leaves(kind):  # elements of other tests may be known here, too
        subs = [sub for sub in kind.__subclasses__() if sub.__module__.startswith("seatdyn.")]
        return [leaf for sub in subs for leaf in (leaves(sub) or [sub])]

    tested = {type(element) for element, _ in LAWS.values()}
    assert set(leaves(MemoryElement)) == tested
    page = (Path(__file__).parents[1] / "docs" / "elements.md").read_text(encoding="utf-8")
    assert all(f"`{kind.__name__}`" in page for kind in tested)


@pytest.mark.parametrize("name", LAWS)
def test_compiled_law_is_its_formula(name):
    element, formula = LAWS[name]
    law = element.lower()
    force = compiled_law(law.force, name, MEMORY_FORCE).ctypes
    rate = compiled_law(law.rate, name, MEMORY_RATE).ctypes
    p = pointer(law.parameters)
    rng = np.random.default_rng(4)
    for _ in range(40):
        d, v, w, a = rng.uniform(-0.1, 0.1, 4)
        s = rng.uniform(-0.9, 0.9, len(law.scale)) * law.scale
        if name in SKY:
            s = element.settled(0.0) + np.abs(s) * (1 - element.settled(0.0)[0] / law.scale[0])
        out = np.zeros(len(law.scale))
        rate(d, v, w, a, pointer(s), p, out.ctypes.data_as(p._type_pointer))
        wanted, rates = formula(d, v, w, a, s)
        assert force(d, v, pointer(s), p) == pytest.approx(wanted, rel=1e-12, abs=1e-9)
        np.testing.assert_allclose(out, rates, rtol=1e-11, atol=1e-9)


def pointer(values):
    """Numbers as a pointer to doubles that keeps them alive."""
    import ctypes

    kind = ctypes.POINTER(ctypes.c_double)
    array = np.array(values, dtype=float)
    result = array.ctypes.data_as(kind)
    result._type_pointer = kind
    return result


@pytest.mark.parametrize("name", LAWS)
def test_law_is_true_in_any_units(name):
    """The same element in other units of length, time and mass: force and rates convert."""
    element = LAWS[name][0]
    scales = metre, second, kilogram = 2.0, 0.5, 4.0
    own = {
        "1/m^n": lambda e: (-e.exponent, 0, 0),
        "N/A": (1, -2, 1),
        "A": (0, 0, 0),
        "s": (0, 1, 0),
        "Pa s/m3": (-4, -1, 1),
        **DIMENSIONS,
    }

    def factor(unit):
        powers = own[unit](element) if callable(own[unit]) else own[unit]
        return math.prod(scale**power for scale, power in zip(scales, powers, strict=True))

    plain = {"gain": "N s/m", "threshold": "m/s", "command": "N s/m"}
    units = {f.name: f.metadata.get("unit", plain.get(f.name)) for f in dataclasses.fields(element)}
    changes = {
        key: getattr(element, key) * factor(unit)
        for key, unit in units.items()
        if unit is not None and getattr(element, key) is not None
    }
    if element.__class__ is sd.SemiActiveDamper and element.control == "acceleration":
        changes["threshold"] = 0.05 * metre / second**2
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("seatdyn.model.elements.validated", lambda obj: None)
        patch.setattr("seatdyn.model.semi_active.check_control", lambda *args: None)
        other = dataclasses.replace(element, **changes)
    rng = np.random.default_rng(5)
    kinds = [factor(unit) for _, unit in element.states]
    for _ in range(20):
        d, v, w, a = rng.uniform(-0.1, 0.1, 4)
        s = rng.uniform(0.1, 0.9, len(kinds)) * element.lower().scale
        first, second_law = element.lower(), other.lower()
        one, two = np.zeros(len(kinds)), np.zeros(len(kinds))
        first.rate(d, v, w, a, s, first.parameters, one)
        there = (d * metre, v * metre / second, w * metre / second, a * metre / second**2)
        second_law.rate(*there, s * kinds, second_law.parameters, two)
        np.testing.assert_allclose(two, one * kinds / second, rtol=1e-9)
        force = second_law.force(*there[:2], s * kinds, second_law.parameters)
        expected = first.force(d, v, s, first.parameters) * kilogram * metre / second**2
        assert force == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("name", LAWS)
def test_run_is_that_of_an_independent_solver(name):
    """One mass on a spring and the element; the equations of motion written out for SciPy."""
    element, formula = LAWS[name]
    time = np.linspace(0.0, 1.5, 301)
    run = sd.simulate(
        oscillator(sd.Spring(STIFFNESS), element, mass=MASS), SINE, 1.5, output_step=0.005,
        settings=sd.Settings(rtol=1e-9),
    )  # fmt: skip
    omega, level = 2 * math.pi * 1.6, 1.5 / (2 * math.pi * 1.6) ** 2

    def rate(t, y):
        d = y[0] + level * math.sin(omega * t)
        v = y[1] + level * omega * math.cos(omega * t)
        force, _ = formula(d, v, y[1], 0.0, y[2:])
        a = -(STIFFNESS * d + force) / MASS
        return [y[1], a, *formula(d, v, y[1], a, y[2:])[1]]

    start = [0.0, 0.0, *element.settled(0.0)]
    answer = solve_ivp(rate, (0, 1.5), start, "LSODA", rtol=1e-10, atol=1e-13, t_eval=time)
    assert run.attrs["status"] == "ok"
    scale = np.abs(answer.y[0]).max()
    np.testing.assert_allclose(run.displacement[0], answer.y[0], atol=2e-6 * scale)
    d = answer.y[0] + level * np.sin(omega * time)
    v = answer.y[1] + level * omega * np.cos(omega * time)
    rows = zip(d, v, answer.y[1], answer.y[2:].T, strict=True)
    forces = [formula(x, rate, w, 0.0, s)[0] for x, rate, w, s in rows]
    computed = run.element_force[1].values
    np.testing.assert_allclose(computed, forces, atol=3e-4 * np.abs(forces).max())


@pytest.mark.parametrize("name", LAWS)
def test_energy_balances(name):
    run = sd.simulate(paper_system(LAWS[name][0]), sd.Sine(2.0, amplitude=0.6), 2.0)
    assert run.attrs["status"] == "ok"
    assert run.attrs["energy_residual"] < 1e-6
    assert run.internal_state.sizes["state"] == len(LAWS[name][0].states)
    assert bool(run.internal_state.notnull().all())


def share_held_at_the_mean(run):
    """Share of the instants where the seat is held; the damper goes to the mean command then."""
    speed = (run.velocity.sel(node="seat") - run.base_velocity).to_numpy()
    held = (np.abs(speed[:-1]) < 1e-12) & (np.abs(speed[1:]) < 1e-12)
    c, t = run.internal_state.to_numpy()[0], run.time.to_numpy()
    expected = 475.0 + (c[:-1] - 475.0) * np.exp(-np.diff(t) / 0.01)
    np.testing.assert_allclose(c[1:][held], expected[held], rtol=1e-6)
    return held.mean()


@pytest.mark.parametrize("name", ["skyhook", "on-off", "acceleration"])
def test_a_held_damper_is_commanded_what_is_between_both_directions(name):
    """Not what rounding makes of the sign of its speed: c' = (mean - c)/lag while it stands."""
    stuck = sd.StribeckFriction(sliding=25.0, static=40.0, speed=0.05, dry=True)
    parts = [sd.Spring(STIFFNESS), sd.Damper(200.0), stuck, LAWS[name][0]]
    run = sd.simulate(oscillator(*parts, mass=MASS), sd.Sine(5.0, amplitude=0.8), 2.0)
    assert 0.1 < share_held_at_the_mean(run) < 0.9


@pytest.mark.parametrize("name", SKY)
def test_adjustable_dampers_never_drive(name):
    law = LAWS[name][0].lower()
    rng = np.random.default_rng(6)
    for d, v, s in rng.uniform(-1, 1, (500, 3)) * (0.1, 2.0, 2 * law.scale[0]):
        force = law.force(d, v, [s], law.parameters)
        assert force * v >= 0.0


@pytest.mark.parametrize("name", [name for name in LAWS if name not in SKY])
def test_closed_loops_take_energy(name):
    time = np.linspace(0.0, 3.0, 3001)
    d = 0.01 * np.sin(2 * np.pi * time)
    force = LAWS[name][0].response(time, d)
    last = time >= 2.0
    assert np.trapezoid(force[last], d[last]) > 0.0


# ---------------------------------------------------------------- closed forms


def test_dahl_loop_is_exact():
    """F = Fc - (Fc - F0) exp(-sigma |d - d0|/Fc) on every branch between two turns."""
    time = np.linspace(0.0, 2.0, 2001)
    d = 2e-3 * np.sin(2 * np.pi * time)
    force = sd.DahlFriction(30.0, 4e4).response(time, d)
    turns = [0, 250, 750, 1250, 1750, 2000]
    start = 0.0
    for i, (begin, end) in enumerate(pairwise(turns)):
        limit = 30.0 * (-1) ** i
        branch = slice(begin, end + 1)
        exact = limit - (limit - start) * np.exp(-4e4 / 30.0 * np.abs(d[branch] - d[begin]))
        np.testing.assert_allclose(force[branch], exact, atol=1e-5)
        start = exact[-1]


def test_lugre_slides_at_its_stribeck_curve():
    element = LAWS["lugre"][0]
    for speed in (0.002, 0.01, 0.1):
        time = np.linspace(0.0, 0.05 / speed, 2001)
        force = element.response(time, speed * time)
        expected = 20.0 + 10.0 * math.exp(-((speed / 0.01) ** 2)) + 5.0 * speed
        assert force[-1] == pytest.approx(expected, rel=1e-8)


def test_bouc_wen_yields_at_its_largest_z():
    element = LAWS["bouc-wen"][0]
    assert element.largest == pytest.approx((1.2 / 3e4) ** (1 / 1.5))
    time = np.linspace(0.0, 1.0, 2001)
    force = element.response(time, 0.05 * time)
    z = (force - 5e3 * 0.1 * 0.05 * time - 20.0 * 0.05) / (5e3 * 0.9)
    assert z[-1] == pytest.approx(element.largest, rel=1e-8)


def complex_stiffness(element, frequency, amplitude):
    """First harmonic of the force over that of the travel, in the steady state."""
    cycles, points = 4 + round(frequency / 4), 200  # long enough to forget the start
    time = np.linspace(0.0, cycles / frequency, cycles * points + 1)
    angle = 2 * np.pi * frequency * time
    force = element.response(time, amplitude * np.sin(angle))
    last = slice(-points - 1, -1)
    return 2j * np.mean(force[last] * np.exp(-1j * angle[last])) / amplitude


@pytest.mark.parametrize("frequency", [0.7, 8.0, 50.0])
def test_zener_complex_stiffness(frequency):
    wt = 2j * np.pi * frequency * 0.02
    exact = 5e3 + 8e3 * wt / (1 + wt)
    element = LAWS["zener"][0]
    assert complex_stiffness(element, frequency, 0.01) == pytest.approx(exact, rel=2e-5)
    assert element.linearised().stiffness(2j * np.pi * frequency) == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize("frequency", [0.3, 3.0, 30.0])
def test_air_spring_with_tank_is_a_zener_at_small_travel(frequency):
    element = LAWS["tank"][0]
    s = 2j * np.pi * frequency
    bellows, reservoir = 6e-4 / (1.3 * 5e5), 2e-3 / (1.3 * 5e5)
    exact = (
        4e-3**2 * (1 + s * 2e7 * reservoir) / (bellows + reservoir + s * 2e7 * bellows * reservoir)
    )
    assert complex_stiffness(element, frequency, 1e-5) == pytest.approx(exact, rel=1e-4)
    assert element.linearised().stiffness(s) == pytest.approx(exact, rel=1e-7)
    slow, fast = element.linearised().stiffness([1e-6j, 1e6j]).real
    assert slow == pytest.approx(1.3 * 5e5 * 4e-3**2 / 2.6e-3, rel=1e-6)
    assert fast == pytest.approx(1.3 * 5e5 * 4e-3**2 / 6e-4, rel=1e-6)


@pytest.mark.parametrize("name", ["zener", "tank"])
def test_settled_states_are_at_rest(name):
    element = LAWS[name][0]
    law = element.lower()
    for d in (-0.02, 0.03):
        out = [math.nan]
        law.rate(d, 0.0, 0.0, 0.0, element.settled(d), law.parameters, out)
        assert out[0] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("name", [name for name in LAWS if name not in SKY[1:]])
def test_linear_form_is_the_element_at_small_motion(name):
    """A travel of a nanometre, too little to slide."""
    element = LAWS[name][0]
    element = dataclasses.replace(element, x0=0.0) if name == "spencer" else element
    wanted = complex(element.linearised().stiffness(2j * np.pi * 5.0))
    assert complex_stiffness(element, 5.0, 1e-9) == pytest.approx(wanted, rel=2e-4)


@pytest.mark.parametrize("name", SKY[1:])
def test_switching_dampers_have_no_linear_form(name):
    with pytest.raises(sd.ModelError, match="no tangent at rest"):
        LAWS[name][0].linearised()


def test_skyhook_force_follows_the_absolute_velocity():
    """Within the limits of the damper and without lag the force is that of a damper to the sky."""
    element = sd.SemiActiveDamper(0.0, 1e5, 1e-4, control="skyhook", gain=500.0)
    time = np.linspace(0.0, 2.0, 4001)
    d, w = 0.01 * np.sin(2 * np.pi * time), 0.05 * np.sin(2 * np.pi * time + 0.4)
    force = element.response(time, d, w=w)
    v = 0.01 * 2 * np.pi * np.cos(2 * np.pi * time)
    can = (time > 0.01) & (w * v > 0) & (np.abs(v) > 5e-3) & (np.abs(w) > 5e-3)
    np.testing.assert_allclose(force[can], 500.0 * w[can], rtol=2e-2)
    cannot = (time > 0.01) & (w * v < 0) & (np.abs(v) > 5e-3) & (np.abs(w) > 5e-3)
    assert np.all(np.abs(force[cannot]) < 1e-3)


# ---------------------------------------------------------------- analyses


def test_poles_of_a_zener_are_the_roots_of_its_polynomial():
    """m s^2 (1 + tau s) + (k0 + c s)(1 + tau s) + k1 tau s = 0: a pair and a real root."""
    system = oscillator(sd.Damper(40.0), LAWS["zener"][0], mass=60.0)
    inertia, relaxing = [60.0, 40.0, 5e3], [0.02, 1.0]
    roots = np.roots(np.polyadd(np.polymul(inertia, relaxing), [8e3 * 0.02, 0.0]))
    found = sd.poles(system)
    key = lambda z: (z.real, z.imag)  # noqa: E731
    np.testing.assert_allclose(
        sorted(found.pole.values, key=key), sorted(roots, key=key), rtol=1e-10
    )
    assert found.sizes["mode"] == 2
    assert found.attrs["ignored"] == "[]"


def test_frequency_response_with_a_zener_is_its_formula():
    system = oscillator(sd.Damper(40.0), LAWS["zener"][0], mass=60.0)
    f = np.array([0.5, 2.2, 9.0])
    s = 2j * np.pi * f
    foam = 5e3 + 8e3 * 0.02 * s / (1 + 0.02 * s)
    travel = -60.0 * s**2 / (60.0 * s**2 + foam + 40.0 * s)
    response = sd.frequency_response(system, frequency=f)
    np.testing.assert_allclose(response.transmissibility[0], 1 + travel, rtol=1e-12)
    np.testing.assert_allclose(
        response.element_force.sel(element="Zener"), foam * travel / s**2, rtol=1e-12
    )


def test_linear_analyses_leave_out_or_take_the_linear_form():
    plain = paper_system(LAWS["dahl"][0])
    assert sd.poles(plain).attrs["ignored"] == '["DahlFriction"]'
    stuck = paper_system(k=9950.0 + 2e4, c=265.0)
    np.testing.assert_allclose(
        sd.poles(plain, linearise="tangent").pole, sd.poles(stuck).pole, rtol=1e-9
    )
    with pytest.raises(sd.RequestError, match="Zener"):
        sd.zeros(paper_system(LAWS["zener"][0]), output="m1")


def test_steady_state_of_a_zener_is_its_frequency_response():
    element, mass = LAWS["zener"][0], 60.0
    system = oscillator(sd.Damper(40.0), element, mass=mass)
    state = sd.steady_state(system, sd.Sine(2.2, amplitude=1.0))
    s = 2j * np.pi * 2.2
    dynamic = 5e3 + 8e3 * s * 0.02 / (1 + s * 0.02) + 40.0 * s
    travel = abs(mass / (dynamic + mass * s**2))
    assert state.attrs["status"] == "converged"
    assert float(state.amplitude.sel(output="seat-base")) == pytest.approx(travel, rel=1e-6)


@pytest.mark.parametrize("name", ["dahl", "bouc-wen", "mr"])
def test_steady_state_repeats_itself(name):
    """From the last state of a long run nothing changes, and amplitudes are those of the run."""
    system = oscillator(sd.Spring(9000.0), sd.Damper(150.0), LAWS[name][0], mass=60.0)
    state = sd.steady_state(system, SINE, tolerance=1e-8)
    assert state.attrs["status"] == "converged"
    run = sd.simulate(system, SINE, 20.0)
    last = run.relative_displacement[0].values[run.time.values > 18.75]
    assert float(state.amplitude.sel(output="seat-base")) == pytest.approx(
        (last.max() - last.min()) / 2, rel=1e-5
    )


def test_breaks_of_other_elements_are_met():
    """Beside a stop that jumps, and one with a kink, the run is that of SciPy in pieces."""
    stops = [sd.EndStop(4e4, 0.01, 0.01, damping=300.0), sd.PiecewiseSpring(2e4, 0.012, 0.008)]
    system = oscillator(sd.Spring(9000.0), LAWS["bouc-wen"][0], *stops, mass=60.0)
    one = sd.simulate(system, SINE, 2.0, settings=sd.Settings(rtol=1e-7))
    two = sd.simulate(system, SINE, 2.0, settings=sd.Settings(rtol=1e-10))
    assert one.attrs["status"] == two.attrs["status"] == "ok"
    assert one.attrs["events"] >= 20
    np.testing.assert_allclose(one.displacement, two.displacement, atol=2e-6)
    assert two.attrs["energy_residual"] < 1e-8


def test_the_engine_without_states_is_the_same():
    """An element with states but no force changes nothing: both engines agree."""
    nothing = sd.Zener(0.0, 0.0, 1.0)
    gap = sd.PiecewiseSpring(2e4, 0.012, 0.008, jumping=False)
    one = sd.simulate(paper_system(gap), SINE, 3.0)
    other = sd.simulate(paper_system(gap, nothing), SINE, 3.0)
    np.testing.assert_allclose(one.displacement, other.displacement, atol=1e-7)
    np.testing.assert_allclose(one.suspension_force, other.suspension_force, atol=1e-3)
    np.testing.assert_allclose(one.body_force, other.body_force, atol=1e-3)


@pytest.mark.parametrize("level", [0.5, 3.0])
def test_dry_friction_sticks_and_lets_go_as_without_states(level):
    nothing = sd.Zener(0.0, 0.0, 1.0)
    dry = sd.StribeckFriction(30.0, 45.0, 0.02, dry=True)
    stop = sd.EndStop(5e3, 0.005, 0.004, damping=200.0)
    base = sd.Sine(1.55, amplitude=level)
    one = sd.simulate(paper_system(dry, stop), base, 4.0)
    other = sd.simulate(paper_system(dry, stop, nothing), base, 4.0)
    assert one.attrs["events"] == other.attrs["events"] > 10
    np.testing.assert_allclose(one.displacement, other.displacement, atol=2e-8)
    forces = one.element_force.sel(element="StribeckFriction")
    both = other.element_force.sel(element="StribeckFriction")
    differs = np.abs(forces.values - both.values) > 1e-2
    assert differs.mean() < 0.01  # at the instants of its jumps only


def test_what_has_no_place_for_states_says_so():
    system = oscillator(sd.Spring(9000.0), LAWS["dahl"][0])
    with pytest.raises(sd.RequestError, match="DahlFriction"):
        lower(system, SINE.motion)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: sd.LuGreFriction(20.0, 10.0, 0.1, 1e5), "static = 10 N"),
        (lambda: sd.BoucWen(1e3, 0.1, 10.0, 20.0), "beta = 20"),
        (lambda: sd.DahlFriction(0.0, 1e4), "DahlFriction.sliding"),
        (lambda: sd.SemiActiveDamper(10.0, 5.0, 0.01), "maximum = 5"),
        (lambda: sd.SemiActiveDamper(1.0, 5.0, 0.01, control="sky"), "Did you mean 'skyhook'"),
        (lambda: sd.SemiActiveDamper(1.0, 5.0, 0.01, control="skyhook"), "needs a gain"),
        (lambda: sd.SemiActiveDamper(1.0, 5.0, 0.01, gain=3.0), "takes no gain"),
        (lambda: sd.SemiActiveDamper(1.0, 5.0, 0.01, command=6.0), "command = 6"),
        (lambda: sd.SemiActiveDamper(1.0, 5.0, 0.01, threshold=1.0), "takes no threshold"),
        (lambda: sd.MRDamper(1.0, 5.0, 0.0, 1.0, 0.01), "yield_per_ampere"),
        (lambda: sd.SpencerDamper.spencer1997(5.0), "voltage = 5 V"),
    ],
)
def test_refused(make, message):
    with pytest.raises(sd.ModelError, match=message):
        make()
