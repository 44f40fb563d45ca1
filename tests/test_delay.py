"""Linear systems with delayed forces, against the quasi-polynomial written out by hand."""

import dataclasses
import itertools
import json

import mpmath
import numpy as np
import pytest
from typer.testing import CliRunner

import seatdyn as sd
from conftest import OFF, ON, oscillator, paper_system
from oracle.equations import BODIES, DAMPING, SEAT_MASS, STIFFNESS
from seatdyn.analysis.delay import rightmost_roots, roots_right_of
from seatdyn.analysis.linear import dynamic_stiffness
from seatdyn.analysis.stability import stability_points
from seatdyn.app.cli import app

NAMES = {OFF: "back_off", ON: "back_on"}
WHAT = ("suspension", "feedback", "Damper")
KNOWN = {OFF: 0.0228, ON: 0.0263}  # s, whole suspension, to the digits known before


def rows_by_hand(s, body, tau, what, damping=DAMPING, stiffness=STIFFNESS, mass=SEAT_MASS):
    """Characteristic matrix over (x, x1, x2), from the printed equations; s of any kind."""
    b, exp = BODIES[body], mpmath.exp if isinstance(s, mpmath.mpc) else np.exp
    late = {name: exp(-s * tau) if name in what else 1 for name in WHAT}
    e = late["suspension"]
    p1, p2 = b.k1 + b.al1 * s, b.k2 + b.al2 * s
    # F_A on m1 is -(f0 x + f1 x1 + f2 x2)
    f = late["feedback"]
    if body == "back_off":
        f0 = -b.k11 - b.k12 * s + b.k13 + b.k14 * s
    else:
        f0 = b.k11 - b.k12 * s + b.k13 - b.k14 * s
    f1, f2 = b.k11 + b.k12 * s, b.k13 + b.k14 * s
    seat = mass * s * s + p1 + p2 + e * (stiffness + late["Damper"] * damping * s)
    return [
        [seat, -p1, -p2],
        [-p1 + f * f0, b.m1 * s * s + p1 + f * f1, f * f2],
        [-p2 - f * f0, -f * f1, b.m2 * s * s + p2 - f * f2],
    ]


def quasi_polynomial(s, *case, **values):
    """Its determinant."""
    (a, b, c), (d, e, f), (g, h, i) = rows_by_hand(s, *case, **values)
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


def zeros_in_box(case, low, high, top, determinant=quasi_polynomial):
    """Zeros less poles with low < Re s < high, |Im s| < top, from turns of the determinant."""
    edges = [complex(low, -top), complex(high, -top), complex(high, top), complex(low, top)]
    turns = 0.0
    for a, b in zip(edges, edges[1:] + edges[:1], strict=True):
        values = determinant(a + (b - a) * np.linspace(0.0, 1.0, 40_001), *case)
        turns += np.sum(np.angle(values[1:] / values[:-1]))
    return round(turns / (2 * np.pi))


@pytest.mark.parametrize("body", [OFF, ON])
@pytest.mark.parametrize(
    ("what", "tau"),
    [("suspension", 0.004), ("suspension", 0.0229), ("suspension", 0.3), ("feedback", 0.05),
     ("Damper", 0.05)],
)  # fmt: skip
def test_poles_are_the_rightmost_zeros(body, what, tau):
    data = sd.poles(paper_system(body=body).delayed(tau, what))
    found, line = data.pole.values, data.attrs["complete_above"]
    case = (NAMES[body], mpmath.mpf(tau), what)
    mpmath.mp.dps = 30
    for s in found[found.imag >= 0]:
        exact = complex(mpmath.findroot(lambda z: quasi_polynomial(z, *case), mpmath.mpc(s)))
        assert abs(s - exact) <= 1e-10 * max(1.0, abs(exact))
    assert np.unique(found.round(6)).size == found.size >= 6
    assert np.all(found.real > line)
    # none is missing right of the line; all of them lie below |Im s| = 600 here
    assert zeros_in_box((NAMES[body], tau, what), line, 200.0, 600.0) == found.size
    assert data.attrs["stable"] == int(np.all(found.real < 0.0))


def test_several_delays_at_once():
    system = paper_system().delayed(0.03).delayed(0.011, "feedback").delayed(0.007, "Damper")
    assert system.delays == pytest.approx((0.011, 0.03, 0.037))  # the damper's is added
    roots, line = rightmost_roots(system.linear, 12)

    def determinant(s):
        rows = rows_by_hand(s, "back_off", 0.011, "feedback", damping=0.0, stiffness=0.0)
        rows[0][0] += np.exp(-0.03 * s) * (STIFFNESS + np.exp(-0.007 * s) * DAMPING * s)
        return np.linalg.det(np.array(rows))

    for s in roots:
        slope = (determinant(s + 1e-4) - determinant(s - 1e-4)) / 2e-4
        assert abs(determinant(s) / slope) <= 1e-10 * abs(s)
    assert roots_right_of(system.linear, line) == roots.size


def test_shapes_solve_the_characteristic_equation():
    system = paper_system(body=ON).delayed(0.02)
    data = sd.modes(system)
    d = dynamic_stiffness(system.linear, data.pole.values)
    left = np.einsum("mij,mj->mi", d, data["shape"].values)
    assert np.abs(left).max() <= 1e-9 * np.abs(d).max()


@pytest.mark.parametrize("what", WHAT)
@pytest.mark.parametrize("body", [OFF, ON])
def test_poles_tend_to_those_without_delay(body, what):
    plain = sd.poles(paper_system(body=body)).pole.values
    once, twice = (
        np.abs(plain[:, None] - sd.poles(paper_system(body=body).delayed(tau, what)).pole.values)
        for tau in (1e-7, 2e-7)
    )
    # at first order in the delay
    assert twice.min(axis=1) / once.min(axis=1) == pytest.approx(2.0, rel=1e-2)
    assert np.all(once.min(axis=1) <= 1e-4 * np.abs(plain))


def margin_by_hand(body, what, start):
    """Delay and rate where the determinant vanishes on the axis, to 25 digits."""
    mpmath.mp.dps = 25

    def parts(tau, w):
        value = quasi_polynomial(mpmath.mpc(0, w), body, tau, what)
        return value.real, value.imag

    tau, w = mpmath.findroot(parts, start)
    return float(tau), float(w)


@pytest.mark.parametrize("what", WHAT)
@pytest.mark.parametrize("body", [OFF, ON])
def test_delay_margin(body, what):
    system = paper_system(body=body)
    data = sd.delay_margin(system, of=what, maximum=0.2)
    margin, rate = float(data.delay_margin), 2 * np.pi * float(data.frequency)
    tau, w = margin_by_hand(NAMES[body], what, (margin * 1.02, rate * 0.99))
    assert margin == pytest.approx(tau, rel=1e-11)
    assert rate == pytest.approx(w, rel=1e-11)
    if what == "suspension":
        assert margin == pytest.approx(KNOWN[body], abs=5e-5)
    # nothing crosses before: zeros counted by hand on both sides, and between all switches
    before = zeros_in_box((NAMES[body], 0.999 * margin, what), 0.0, 200.0, 600.0)
    assert before == 0
    edges = np.append(data.delay.values, 0.2)
    for i, (a, b) in enumerate(itertools.pairwise(edges)):
        between = zeros_in_box((NAMES[body], 0.5 * (a + b), what), 0.0, 200.0, 600.0)
        assert between == int(data.unstable_above[i])


def test_margin_of_an_oscillator_with_delayed_damping_is_known():
    # x'' + 2 D x'(t - tau) + x = 0: w = D + sqrt(D^2 + 1), w tau = pi/2 (the force turns by 90 deg)
    ratio = 0.1
    system = oscillator(sd.Spring(1.0), sd.Damper(2 * ratio))
    data = sd.delay_margin(system, of="Damper", maximum=10.0)
    rate = ratio + np.sqrt(ratio**2 + 1)
    assert 2 * np.pi * float(data.frequency) == pytest.approx(rate, rel=1e-13)
    assert float(data.delay_margin) == pytest.approx(np.pi / 2 / rate, rel=1e-13)
    # it comes back: w tau = 3 pi/2 at the other rate, and is lost again
    back = 1.5 * np.pi / (np.sqrt(ratio**2 + 1) - ratio)
    assert data.delay.values[1] == pytest.approx(back, rel=1e-13)
    assert data.stable_above.values[:2].tolist() == [False, True]


def test_margins_at_the_ends():
    unstable = sd.delay_margin(paper_system(c=20.0))
    assert np.isnan(unstable.delay_margin)
    assert unstable.attrs["stable_without_delay"] == 0
    # a damper much weaker than its parallel may come as late as it likes
    strong = oscillator(sd.Spring(100.0), sd.Damper(5.0), sd.Damper(0.5, label="weak"))
    assert np.isinf(sd.delay_margin(strong, of="weak").delay_margin)


@pytest.mark.parametrize("body", [OFF, ON])
def test_map_by_crossings_and_by_poles(body):
    rng = np.random.default_rng(11)
    system = paper_system(body=body)
    axes = {
        "damping": np.sort(rng.uniform(0.0, 2000.0, 6)),
        "delay": np.sort(rng.uniform(0.0, 0.06, 7)),
        "seat_mass": np.sort(rng.uniform(10.0, 100.0, 5)),
    }
    fast = sd.stability_map(system, **axes)
    slow = sd.stability_map(system, method="poles", **axes)
    assert fast.stable.dims == slow.stable.dims == tuple(axes)
    assert np.array_equal(fast.stable, slow.stable)
    assert 0.1 < float(fast.stable.mean()) < 0.9
    # without an axis of delay, at that of the system
    part = sd.stability_map(
        system.delayed(float(axes["delay"][3])),
        damping=axes["damping"],
        seat_mass=axes["seat_mass"],
    )
    assert np.array_equal(part.stable, fast.stable[:, 3])
    gains = sd.stability_map(
        system.delayed(0.0005, "feedback"), k13=np.linspace(-3e4, 3e4, 5), delay=[0.0, 5e-4, 2e-3]
    )
    again = sd.stability_map(
        system.delayed(0.0005, "feedback"), method="poles",
        k13=np.linspace(-3e4, 3e4, 5), delay=[0.0, 5e-4, 2e-3],
    )  # fmt: skip
    assert np.array_equal(gains.stable, again.stable)


def test_a_map_without_delay_agrees_with_routh():
    damping, mass = np.linspace(1.0, 300.0, 9), np.linspace(5.0, 80.0, 8)
    plain = sd.stability_map(paper_system(), damping=damping, seat_mass=mass)
    delayed = sd.stability_map(paper_system(), damping=damping, seat_mass=mass, delay=[0.0, 1e-9])
    assert np.array_equal(delayed.stable[..., 0], plain.stable)
    assert np.array_equal(delayed.stable[..., 1], plain.stable)
    assert 0.0 < float(plain.stable.mean()) < 1.0


@pytest.mark.parametrize("given", [{"seat_mass": [35.0]}, {"stiffness": [9950.0]}])
def test_boundary(given):
    tau, f = 0.02, np.linspace(0.5, 20.0, 200)
    edge = sd.stability_boundary(paper_system().delayed(tau), frequency=f, **given)
    other = "stiffness" if "seat_mass" in given else "seat_mass"
    values = {
        "mass": given.get("seat_mass", [None])[0] or edge[other].values[0],
        "stiffness": given.get("stiffness", [None])[0] or edge[other].values[0],
        "damping": edge.damping.values[0],
    }
    s = 2j * np.pi * f
    on_axis = quasi_polynomial(s, "back_off", tau, "suspension", **values)
    step = 1e-5 * s
    slope = (
        quasi_polynomial(s + step, "back_off", tau, "suspension", **values)
        - quasi_polynomial(s - step, "back_off", tau, "suspension", **values)
    ) / (2 * step)
    assert np.all(np.abs(on_axis / slope) <= 1e-8 * np.abs(s))
    assert edge.stable_edge.values.any()
    # the edge is one: stable on one side of the damping, unstable on the other
    i = int(np.argmax(edge.stable_edge.values[0]))
    point = {other: edge[other].values[0, i], **{k: v[0] for k, v in given.items()}}
    sides = [
        bool(
            sd.stability_map(
                paper_system().delayed(tau), damping=[share * edge.damping.values[0, i]],
                **{k: [v] for k, v in point.items()},
            ).stable
        )
        for share in (0.999, 1.001)
    ]  # fmt: skip
    assert sorted(sides) == [False, True]


def test_frequency_response():
    tau, f = 0.03, np.array([0.7, 1.55, 4.0, 21.0])
    for what in ("suspension", "feedback"):
        data = sd.frequency_response(paper_system().delayed(tau, what), frequency=f)
        for i, frequency in enumerate(f):
            s = 2j * np.pi * frequency
            late = np.exp(-s * tau) if what == "suspension" else 1.0
            drive = np.array([late * (STIFFNESS + DAMPING * s), 0.0, 0.0])
            z = np.linalg.solve(np.array(rows_by_hand(s, "back_off", tau, what)), drive)
            assert data.transmissibility.values[:, i] == pytest.approx(z, rel=1e-12)
            force = late * (STIFFNESS + DAMPING * s) * (z[0] - 1.0) / s**2
            spring = data.element_force.sel(element="Spring").values[i]
            damper = data.element_force.sel(element="Damper").values[i]
            assert spring + damper == pytest.approx(force, rel=1e-12)
            # the base carries what the suspension passes on
            assert data.apparent_mass.values[i] == pytest.approx(-force, rel=1e-9)
            # on the body acts what accelerates it
            body = BODIES["back_off"]
            momentum = (body.m1 * z[1] + body.m2 * z[2]) / z[0]
            assert data.body_apparent_mass.values[i] == pytest.approx(momentum, rel=1e-9)


@pytest.mark.parametrize(
    "ask",
    [
        lambda s: sd.zeros(s, output="m1"),
        lambda s: sd.state_space(s),
        lambda s: sd.active_bands(s),
        lambda s: sd.critical_values(s, vary="damping", low=0.0, high=1000.0),
        lambda s: sd.stability_boundary(s, seat_mass=[35.0], stiffness=[9950.0]),
        lambda s: sd.is_stable(s, method="hurwitz"),
        lambda s: stability_points(s, damping=[1.0, 2.0]),
        lambda s: s.linear.stiffness,
        lambda s: s.linear.drive_damping,
    ],
)
def test_what_knows_no_delay_refuses(ask):
    ask(paper_system())
    with pytest.raises(sd.RequestError, match=r"0\.01 s late|not allowed"):
        ask(paper_system().delayed(0.01))
    with pytest.raises(sd.RequestError, match=r"0\.02 s late|not allowed"):
        ask(paper_system().delayed(0.02, "feedback"))


def test_lockup_with_late_friction_is_refused():
    friction = sd.StribeckFriction(40.0, 50.0, speed=0.01, dry=True)
    system = paper_system(friction)
    late_damper = sd.lockup_boundary(system.delayed(0.01, "Damper"), [1.0])
    assert float(late_damper.level[0]) == float(sd.lockup_boundary(system, [1.0]).level[0])
    with pytest.raises(sd.RequestError, match=r"0\.01 s late"):
        sd.lockup_boundary(system.delayed(0.01), [1.0])


def test_where_a_delay_stands(tmp_path):
    damper = sd.Damper(260.0, delay=0.004)
    seat = sd.Seat(35.0, [sd.Spring(9950.0), damper, sd.QuadraticDamper(100.0)], delay=0.01)
    system = sd.SeatSystem(sd.load_body(OFF), seat, (sd.Spring(1.0, between=("seat", "m1")),))
    assert [element.delay for element in system.all_elements] == [0.01, 0.014, 0.01, 0.0]
    assert system.delays == (0.01, 0.014)
    assert [channel.delay for channel in system.channels] == [0.01]
    assert "stiffness" in system.linear.parameters
    assert sd.poles(system, linearise="tangent").attrs["ignored"] == "[]"
    mixed = sd.Seat(35.0, [sd.Spring(9000.0), sd.Spring(950.0, delay=0.01), damper])
    assert "stiffness" not in sd.SeatSystem(sd.load_body(OFF), mixed).linear.parameters

    @sd.force_law({"k3": "N/m3"})
    def cubic(d, v, p):
        return p[0] * d**3

    assert cubic(k3=1e6, delay=0.02).delay == 0.02
    sd.save_seat(seat, tmp_path / "seat.toml")
    assert sd.load_seat(tmp_path / "seat.toml") == seat
    body = sd.load_body(ON)
    assert body.delayed(0.03).feedback[0].delay == 0.03
    assert dataclasses.replace(body.delayed(0.03), feedback=body.feedback) == body


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: sd.Seat(35.0, [], delay=-0.1), "Seat.delay = -0.1 s"),
        (lambda: sd.Damper(260.0, delay=11.0), "Damper.delay = 11 s"),
        (lambda: sd.Damper(260.0, delay="20 ms"), "Damper.delay"),
        (lambda: sd.load_body(OFF).delayed(np.nan), "FeedbackForce.delay"),
        (lambda: oscillator(sd.Spring(1.0)).body.delayed(0.1), "no feedback force"),
        (lambda: sd.ScissorLever(sd.Spring(1.0, delay=0.1), arm=0.4, height=0.2), "to the lever"),
        (lambda: paper_system().delayed(0.1, "Dampr"), "Did you mean 'Damper'"),
        (lambda: sd.delay_margin(paper_system(), maximum=11.0), "maximum = 11 s"),
        (lambda: sd.delay_margin(paper_system().delayed(0.01), of="feedback"), "0.01"),
        (lambda: sd.stability_map(paper_system(), delay=[-1.0], damping=[1.0]), "delay[0] = -1 s"),
        (lambda: sd.stability_map(sd.load_body(OFF), delay=[0.1], k13=[1.0]), "delays"),
        (
            lambda: sd.stability_map(paper_system(), method="hurwitz", delay=[0.1], damping=[1.0]),
            "'crossings' or 'poles'",
        ),
    ],
)
def test_bad_delays(make, words):
    with pytest.raises(sd.SeatdynError) as caught:
        make()
    assert words in str(caught.value)


def test_a_body_alone():
    data = sd.delay_margin(sd.load_body(ON), of="feedback")
    margin = float(data.delay_margin)
    sides = [sd.is_stable(sd.load_body(ON).delayed(margin * share)) for share in (0.999, 1.001)]
    assert sides == [True, False]


def command(*arguments, code=0):
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    assert result.exit_code == code, result.output
    return json.loads(result.stdout) if "--json" in arguments else result.output


def test_command_delay_margin():
    found = command("delay-margin", "--body", ON, "--delayed", "feedback", "--json")
    data = sd.delay_margin(paper_system(body=ON), of="feedback")
    assert found["delay_margin"] == float(data.delay_margin)
    assert found["status"] == "ok"
    assert [switch["delay"] for switch in found["switches"]] == data.delay.values.tolist()
    unstable = command("delay-margin", "--damping", 20, "--json", code=3)
    assert unstable["status"] == "unstable"
    assert unstable["delay_margin"] is None
    assert "22.79" in command("delay-margin")


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("poles", "--delay", "0.03", "--json"), 0, '"stable": false'),
        (("frf", "--frequency", "1", "5", "3", "--delay", "0.01", "--json"), 0, '"low"'),
        (
            ("frf", "--frequency", "1", "5", "3", "--delay", "0.01", "--delayed", "feedback",
             "--json"), 0, '"active_bands": null',
        ),
        (("poles", "--body-alone", "--delay", "0.01", "--delayed", "feedback"), 0, "no"),
        (("poles", "--body-alone", "--delay", "0.01"), 2, "--delay describes the seat"),
        (("poles", "--delayed", "feedback"), 2, "no effect without --delay"),
        (("delay-margin", "--delay", "0.01"), 2, "drop it"),
        (("zeros", "--delay", "0.01"), 2, "0.01 s late"),
        (("critical", "--vary", "damping", "--range", "0", "9", "--delay", "0.01"), 2, "late"),
        (("stability", "--delay-range", "0", "0.05", "9", "--damping-range", "0", "900", "9"), 0,
         "unstable:"),
    ],
)  # fmt: skip
def test_commands_with_a_delay(arguments, code, words):
    result = CliRunner().invoke(app, list(arguments))
    assert result.exit_code == code
    assert words in result.output
