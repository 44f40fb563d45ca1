"""Poles, zeros, modes, responses: closed forms first, then the paper, then random systems."""

import doctest
import json
from importlib import import_module

import mpmath
import numpy as np
import pytest

import seatdyn as sd
from seatdyn.model.system import LinearModel, linear_model

TWO_PI = 2 * np.pi


def one_mass(m=2.0, k=50.0, c=3.0):
    return sd.SeatedBody("one", {"m1": m}, (sd.Link(("seat", "m1"), k, c),))


def paper_system(body, mass=35.0, stiffness=9950.0, damping=260.0, extra=()):
    seat = sd.Seat(mass, [sd.Spring(stiffness), sd.Damper(damping), *extra])
    return sd.SeatSystem(sd.load_body(f"ksiazek1997_{body}"), seat)


def chain(n, rng=None, damped=True):
    """Masses in a row above the seat."""
    rng = rng or np.random.default_rng(7)
    names = ["seat", *(f"m{i}" for i in range(1, n + 1))]
    links = [
        sd.Link((names[i], names[i + 1]), rng.uniform(1e3, 1e5), damped * rng.uniform(50, 2e3))
        for i in range(n)
    ]
    return sd.SeatedBody("chain", {name: rng.uniform(2, 60) for name in names[1:]}, tuple(links))


def random_body(seed):
    """1 to 12 masses in any topology, with feedback that is not reciprocal."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 13))
    names = ["seat", *(f"m{i}" for i in range(1, n + 1))]
    masses = {name: rng.uniform(1, 80) for name in names[1:]}
    if rng.random() < 0.5:
        masses["seat"] = rng.uniform(0, 5)
    pairs = [(names[rng.integers(0, i)], names[i]) for i in range(1, n + 1)]
    for _ in range(int(rng.integers(0, n + 1))):
        a, b = rng.choice(n + 1, 2, replace=False)
        pairs.append((names[a], names[b]))
    links = tuple(sd.Link(p, rng.uniform(1e3, 1e5), rng.uniform(0, 3e3)) for p in pairs)
    forces = []
    for f in range(int(rng.integers(0, 3))):
        on, reaction = rng.choice(n + 1, 2, replace=False)
        terms = tuple(
            sd.FeedbackTerm(
                f"g{f}{t}",
                rng.normal() * (2e4 if of == "displacement" else 400),
                of,
                {names[i]: rng.normal() for i in rng.choice(n + 1, min(n + 1, 3), replace=False)},
            )
            for t, of in enumerate(("displacement", "velocity"))
        )
        forces.append(sd.FeedbackForce(names[on], names[reaction], terms))
    return sd.SeatedBody(f"random{seed}", masses, links, tuple(forces))


def written_out(body, seat=None, frequencies=()):
    """Dynamic equations summed up force by force, for all nodes: base (if any), seat, masses."""
    nodes = (["base"] if seat else []) + ["seat", *body.nodes]
    at = {node: i for i, node in enumerate(nodes)}
    z = np.zeros((len(frequencies), len(nodes), len(nodes)), dtype=complex)
    s = 2j * np.pi * np.asarray(frequencies)
    for node, m in body.masses.items():
        z[:, at[node], at[node]] += m * s**2
    pulls = [(link.between, link.stiffness, link.damping) for link in body.links]
    if seat:
        z[:, at["seat"], at["seat"]] += seat.mass * s**2
        pulls += [(e.between, *e.linear) for e in seat.suspension]
    for (a, b), k, c in pulls:
        for i, j, sign in ((a, a, 1), (b, b, 1), (a, b, -1), (b, a, -1)):
            z[:, at[i], at[j]] += sign * (k + s * c)
    for force in body.feedback:
        for term in force.terms:
            for node, weight in term.weights.items():
                value = term.gain * weight * (1 if term.of == "displacement" else s)
                z[:, at[force.on], at[node]] += value
                z[:, at[force.reaction], at[node]] -= value
    motion = np.linalg.solve(z[:, 1:, 1:], -z[:, 1:, :1])[..., 0]
    force = z[:, 0, 0] + np.einsum("fj,fj->f", z[:, 0, 1:], motion)
    return nodes[1:], motion.T, force


# ---------------------------------------------------------------- one mass, two masses


def test_one_mass_poles_in_closed_form():
    m, k, c = 2.0, 50.0, 3.0
    p = sd.poles(one_mass(m, k, c))
    assert p["real"].item() == pytest.approx(-c / (2 * m), rel=1e-13)
    assert p["imag"].item() == pytest.approx(np.sqrt(k / m - (c / (2 * m)) ** 2), rel=1e-13)
    assert p["f0"].item() == pytest.approx(np.sqrt(k / m) / TWO_PI, rel=1e-13)
    assert p["fd"].item() == pytest.approx(p["imag"].item() / TWO_PI, rel=1e-15)
    assert p["damping_ratio"].item() == pytest.approx(c / (2 * np.sqrt(k * m)), rel=1e-13)
    assert p["stable"].item() is True
    assert p.attrs["stable"] == 1
    assert p["pole"].values[0] == np.conj(p["pole"].values[1])


def test_overdamped_mass_has_two_rows():
    p = sd.poles(one_mass(1.0, 2.0, 3.0))
    np.testing.assert_allclose(p["real"], [-1.0, -2.0], rtol=1e-13)
    np.testing.assert_array_equal(p["imag"], [0.0, 0.0])


def test_one_mass_responses_in_closed_form():
    m, k, c = 2.0, 50.0, 3.0
    f = np.array([5.0, 1e-4, 0.7, 90.0])
    s = 1j * TWO_PI * f
    r = sd.frequency_response(one_mass(m, k, c), frequency=f)
    t = (k + c * s) / (m * s**2 + c * s + k)
    np.testing.assert_allclose(r["transmissibility"][0], t, rtol=1e-13)
    np.testing.assert_allclose(r["apparent_mass"], m * t, rtol=1e-13)
    np.testing.assert_allclose(r["impedance"], s * m * t, rtol=1e-13)
    np.testing.assert_allclose(r["relative_displacement"].sel(pair="m1-seat"), t - 1, rtol=1e-8)
    np.testing.assert_allclose(r["element_force"].sel(element="seat-m1 link"), -m * t, rtol=1e-13)


def test_one_mass_zero_and_its_absence():
    z = sd.zeros(one_mass(), output="m1")
    assert z["value"].item() == pytest.approx(-50.0 / 3.0, rel=1e-13)
    assert (z.attrs["relative_degree"], z.attrs["minimum_phase"]) == (1, 1)
    assert sd.zeros(one_mass(c=0.0), output="m1").sizes["zero"] == 0


def test_two_equal_masses_undamped():
    links = (sd.Link(("seat", "m1"), 100.0), sd.Link(("m1", "m2"), 100.0))
    body = sd.SeatedBody("two", {"m1": 1.0, "m2": 1.0}, links)
    p = sd.poles(body)
    squares = 100.0 * (3 + np.array([-1, 1]) * np.sqrt(5)) / 2
    np.testing.assert_allclose((p["f0"] * TWO_PI) ** 2, squares, rtol=1e-13)
    assert p.attrs["stable"] == 0  # on the axis is not stable
    shapes = sd.modes(body)["shape"].values
    golden = (1 + np.sqrt(5)) / 2
    np.testing.assert_allclose(shapes, [[1 / golden, 1], [1, -1 / golden]], atol=1e-12)
    z = sd.zeros(body, output="m1")  # the upper mass as absorber: zeros at +- i 10
    np.testing.assert_allclose(z["value"], [10j, -10j], atol=1e-12)
    assert z.attrs["minimum_phase"] == 1
    with pytest.raises(sd.RequestError, match="undamped natural frequency"):
        sd.frequency_response(one_mass(1.0, 1.0, 0.0), frequency=[1 / TWO_PI])


@pytest.mark.parametrize("n", [1, 2, 5, 12])
def test_zeros_of_a_chain_are_those_of_its_links(n):
    body = chain(n)
    z = sd.zeros(body, output=f"m{n}")
    expected = sorted(link.stiffness / link.damping for link in body.links)
    np.testing.assert_allclose(-z["value"].values.real, expected, rtol=1e-7)
    assert np.all(z["value"].values.imag == 0.0)
    assert sd.zeros(body, output="m1").sizes["zero"] == 2 * n - 1
    assert sd.zeros(chain(n, damped=False), output=f"m{n}").sizes["zero"] == 0


# ---------------------------------------------------------------- the paper

TABLE_2 = [  # model, printed real, imag, f0, fd in Hz of each pole as printed (Table 2)
    ("back_off", False, [("-7.42", "8.25", "11.1", "8.25"), ("-0.72", "4.74", "4.80", "4.74")]),
    (
        "back_off",
        True,
        [
            ("-15.8", "11.8", "19.7", "11.8"),
            ("-1.33", "4.48", "4.68", "4.48"),
            ("-0.173", "1.54", "1.55", "1.54"),
        ],
    ),
    ("back_on", False, [("-5.52", "26.5", "27.1", "26.5"), ("-2.73", "6.14", "6.72", "6.14")]),
    (
        "back_on",
        True,
        [
            ("-0.84", "21.1", "21.117", "21.1"),
            ("-14.5", "1.86", "14.7", "1.86"),
            ("-0.201", "1.57", "1.58", "1.57"),
        ],
    ),
]
OUTSIDE_ROUNDING = {"-0.84": -0.834895, "21.117": 21.117736}


@pytest.mark.parametrize(("body", "suspended", "printed"), TABLE_2)
def test_table_2_within_its_rounding(body, suspended, printed):
    system = paper_system(body) if suspended else sd.load_body(f"ksiazek1997_{body}")
    p = sd.poles(system).sortby("f0", ascending=False)
    computed = np.stack([p["real"] / TWO_PI, p["imag"] / TWO_PI, p["f0"], p["fd"]], axis=1)
    for row, texts in zip(computed, printed, strict=True):
        for value, text in zip(row, texts, strict=True):
            half = 0.5 * 10.0 ** -len(text.split(".")[1])
            if text in OUTSIDE_ROUNDING:
                assert abs(value - float(text)) > half
                assert value == pytest.approx(OUTSIDE_ROUNDING[text], abs=1e-6)
            else:
                assert abs(value - float(text)) <= half * (1 + 1e-9), text


def zeros_by_cramer(model, node):
    """Zeros as roots of the numerator determinant, interpolated with 60 digits."""
    n, j = model.size, model.index(node)
    with mpmath.workdps(60):
        points = [mpmath.mpf(3 * (i - n)) for i in range(2 * n + 1)]
        values = []
        for s in points:
            p = mpmath.matrix(n, n)
            for a in range(n):
                drive = mpmath.mpf(model.drive_stiffness[a]) + s * model.drive_damping[a]
                for b in range(n):
                    p[a, b] = mpmath.mpf(model.stiffness[a, b]) + s * model.damping[a, b]
                    p[a, b] += s**2 * model.mass[a, b]
                p[a, j] = drive
            values.append(mpmath.det(p))
        vandermonde = mpmath.matrix([[s**i for i in range(2 * n, -1, -1)] for s in points])
        coefficients = list(mpmath.lu_solve(vandermonde, mpmath.matrix(values)))
        largest = max(abs(c) for c in coefficients)
        while abs(coefficients[0]) < largest * mpmath.mpf(10) ** -40:
            coefficients.pop(0)
        roots = mpmath.polyroots(coefficients, maxsteps=500, extraprec=400, asc=False)
        return np.array([complex(root) for root in roots])


@pytest.mark.parametrize(
    ("body", "suspended", "node", "count", "minimum_phase"),
    [
        ("back_off", False, "m1", 3, 0),
        ("back_off", False, "m2", 3, 1),
        ("back_on", False, "m1", 3, 0),
        ("back_on", False, "m2", 3, 0),
        ("back_off", True, "m1", 4, 0),
        ("back_off", True, "m2", 4, 1),
        ("back_off", True, "seat", 5, 1),
        ("back_on", True, "m1", 4, 0),
        ("back_on", True, "m2", 4, 0),
        ("back_on", True, "seat", 5, 1),
    ],
)
def test_zeros_of_the_paper(body, suspended, node, count, minimum_phase):
    system = paper_system(body) if suspended else sd.load_body(f"ksiazek1997_{body}")
    z = sd.zeros(system, output=node)
    assert z.sizes["zero"] == count
    assert z.attrs["minimum_phase"] == minimum_phase
    expected = zeros_by_cramer(linear_model(system), node)
    assert int(np.all(expected.real <= 0)) == minimum_phase
    for value in z["value"].values:
        assert np.min(np.abs(expected - value)) <= 1e-10 * abs(value)
    np.testing.assert_array_equal(z["right_half_plane"], z["real"] > 0)


def test_static_apparent_mass_and_active_bands():
    for body, mass in (("back_off", 69.954), ("back_on", 61.663)):
        model = sd.load_body(f"ksiazek1997_{body}")
        r = sd.frequency_response(model, frequency=[1e-5])
        assert r["apparent_mass"].values.real[0] == pytest.approx(mass, abs=5e-4)
    off = sd.active_bands(sd.load_body("ksiazek1997_back_off"))
    on = sd.active_bands(sd.load_body("ksiazek1997_back_on"))
    np.testing.assert_allclose(off["low"], [0.0])
    np.testing.assert_allclose(off["high"], [4.54], atol=5e-3)
    np.testing.assert_allclose(on["low"], [0.0, 20.8], atol=0.05)
    np.testing.assert_allclose(on["high"], [0.81, 34.3], atol=0.05)


# ---------------------------------------------------------------- any system


@pytest.mark.parametrize("seed", range(24))
def test_responses_against_a_direct_solve(seed):
    body = random_body(seed)
    f = np.geomspace(0.3, 60.0, 17)
    seat = sd.Seat(20.0, [sd.Spring(8e3), sd.Damper(300.0), sd.Spring(500.0)])
    for system, suspension in ((body, None), (sd.SeatSystem(body, seat), seat)):
        nodes, motion, force = written_out(body, suspension, f)
        s = 1j * TWO_PI * f
        r = sd.frequency_response(system, frequency=f)
        assert r["node"].values.tolist() == nodes
        scale = np.abs(motion).max(axis=0)
        assert np.max(np.abs(r["transmissibility"].values - motion) / scale) < 1e-10
        mass = force / s**2
        bound = 1e-9 * (np.abs(mass) + body.total_mass * scale)
        assert np.all(np.abs(r["apparent_mass"].values - mass) < bound)
        # momentum: feedback and links are internal forces of the body
        total = sum(
            m * r["transmissibility"].sel(node=n) for n, m in body.masses.items() if n in nodes
        )
        if suspension:
            total = total + suspension.mass * r["transmissibility"].sel(node="seat")
        else:
            total = total + body.masses.get("seat", 0.0)
        assert np.all(np.abs(r["apparent_mass"].values - total.values) < bound)
        if suspension:
            np.testing.assert_allclose(
                r["body_apparent_mass"],
                sd.frequency_response(body, frequency=f)["apparent_mass"],
                rtol=1e-7,
            )
            assert list(r["element"].values[-3:]) == ["Spring", "Damper", "Spring 2"]
        # poles, shapes and state space say the same
        m = linear_model(system)
        shapes = sd.modes(system)
        for pole, shape in zip(shapes["pole"].values, shapes["shape"].values, strict=True):
            terms = [m.mass * pole**2, m.damping * pole, m.stiffness]
            size = sum(np.abs(t).max() for t in terms)
            assert np.max(np.abs(sum(terms) @ shape)) < 1e-9 * size
        ss = sd.state_space(system)
        x = np.linalg.solve(s[0] * np.eye(len(ss.A)) - ss.A, ss.B @ [1, s[0]])
        y = ss.C @ x + ss.D @ [1, s[0]]
        expected = np.concatenate([motion[:, 0] * s[0] ** i for i in range(3)])
        np.testing.assert_allclose(y, expected, rtol=1e-7, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("seed", range(12))
def test_zeros_make_the_transmissibility_vanish(seed):
    body = random_body(seed)
    model = linear_model(body)
    node = body.nodes[-1]
    try:
        values = sd.zeros(body, output=node)["value"].values
    except sd.RequestError:
        pytest.skip("node not reached")
    expected = zeros_by_cramer(model, node)
    assert values.size == expected.size
    for value in values:
        assert np.min(np.abs(expected - value)) <= 1e-6 * np.max(np.abs(expected))


@pytest.mark.parametrize("seed", range(12))
def test_active_bands_against_a_fine_grid(seed):
    body = random_body(seed)
    bands = sd.active_bands(body)
    f = np.linspace(0.0, 50.0, 4003)[1:-1]
    _, _, force = written_out(body, None, f)
    negative = force.imag < 0.0
    inside = np.zeros(f.size, dtype=bool)
    for low, high in zip(bands["low"].values, bands["high"].values, strict=True):
        inside |= (f > low) & (f < high)
    clear = np.abs(force.imag) > 1e-7 * np.abs(force)
    np.testing.assert_array_equal(inside[clear], negative[clear])
    for edge in np.concatenate([bands["low"], bands["high"]]):
        if 0.0 < edge < 50.0:
            _, _, around = written_out(body, None, edge * np.array([1 - 1e-8, 1 + 1e-8]))
            assert around.imag[0] * around.imag[1] < 0.0


def test_passive_body_is_passive():
    body = chain(4)
    f = np.geomspace(1e-4, 100, 400)
    r = sd.frequency_response(body, frequency=f)
    assert np.all(r["impedance"].values.real > 0.0)
    assert r["apparent_mass"].values[0] == pytest.approx(body.total_mass, rel=1e-6)
    assert sd.active_bands(body).sizes["band"] == 0
    assert sd.active_bands(chain(3, damped=False)).sizes["band"] == 0


def test_forces_balance_the_paper_bodies():
    for name in ("back_off", "back_on"):
        body = sd.load_body(f"ksiazek1997_{name}")
        r = sd.frequency_response(body, frequency=[0.5, 3.0, 20.0])
        force = r["element_force"]
        t = r["transmissibility"]
        active = force.sel(element="m1-m2 feedback").values
        on_1 = active - force.sel(element="seat-m1 link").values
        on_2 = -active - force.sel(element="seat-m2 link").values
        np.testing.assert_allclose(on_1, body.masses["m1"] * t.sel(node="m1").values, rtol=1e-9)
        np.testing.assert_allclose(on_2, body.masses["m2"] * t.sel(node="m2").values, rtol=1e-9)


def test_low_frequency_keeps_its_digits():
    seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(260.0)])
    r = sd.frequency_response(sd.SeatSystem(chain(3), seat), frequency=[1e-4])
    travel = r["relative_displacement"].sel(pair="seat-base").values[0]
    s = 1j * TWO_PI * 1e-4
    expected = -r["apparent_mass"].values[0] * s**2 / (9950.0 + 260.0 * s)
    assert abs(travel / expected - 1) < 1e-11


# ---------------------------------------------------------------- requests


def test_left_out_elements_are_named_and_tangents_used():
    friction = sd.CoulombFriction(20.0, slope=10.0)
    system = paper_system("back_off", extra=[friction, sd.QuadraticDamper(100.0)])
    plain = sd.poles(system)
    assert json.loads(plain.attrs["ignored"]) == ["CoulombFriction", "QuadraticDamper"]
    assert json.loads(plain.attrs["request"])["linearise"] is None
    tangent = sd.poles(system, linearise="tangent")
    assert json.loads(tangent.attrs["ignored"]) == []
    same = sd.poles(paper_system("back_off", damping=260.0 + friction.tangent()[1]))
    np.testing.assert_allclose(tangent["pole"], same["pole"], rtol=1e-12)
    response = sd.frequency_response(system, frequency=[1.0], linearise="tangent")
    assert "CoulombFriction" in response["element"].values


def test_every_variable_has_a_unit():
    system = paper_system("back_on")
    for data in (
        sd.poles(system),
        sd.modes(system),
        sd.zeros(system, output="seat"),
        sd.frequency_response(system, frequency=[1.0, 2.0]),
        sd.active_bands(system),
    ):
        assert data.attrs["seatdyn_version"] == sd.__version__
        assert all("units" in v.attrs for v in data.data_vars.values())


def test_matrices_are_accepted():
    system = paper_system("back_off")
    model = linear_model(system)
    np.testing.assert_array_equal(sd.poles(model)["pole"], sd.poles(system)["pole"])
    r = sd.frequency_response(model, frequency=[2.0])
    assert "element_force" not in r


def massless():
    one = np.eye(2)
    zero = np.zeros((3, 3))
    return LinearModel(("seat", "m1"), "base", np.diag([1.0, 0.0]) * one, zero, zero, zero, zero)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda b: sd.frequency_response(b, frequency=[1.0, 0.0]), r"frequency\[1\] = 0 Hz.*> 0"),
        (lambda b: sd.frequency_response(b, frequency=[np.nan]), "frequency.*nan"),
        (lambda b: sd.frequency_response(b, frequency=[np.inf]), "frequency.*inf"),
        (lambda b: sd.frequency_response(b, frequency=[]), "frequency.*shape"),
        (lambda b: sd.frequency_response(b, frequency="fast"), "array of numbers"),
        (lambda b: sd.zeros(b, output="m3"), "m3.*Did you mean"),
        (lambda b: sd.zeros(b, output="seat"), "No free node 'seat'"),
        (lambda b: sd.poles(b, linearise="secant"), "linearise = 'secant'"),
        (lambda b: sd.poles(linear_model(b), linearise="tangent"), "give the SeatSystem"),
        (lambda b: sd.poles(3.0), "must be a SeatSystem"),
        (lambda b: sd.active_bands(b, frequency_max=-1.0), "frequency_max = -1 Hz"),
    ],
)
def test_bad_requests(call, words):
    with pytest.raises(sd.RequestError, match=words):
        call(sd.load_body("ksiazek1997_back_off"))


def test_a_node_without_mass_or_without_drive_is_refused():
    with pytest.raises(sd.ModelError, match="no mass"):
        sd.poles(massless())
    links = (sd.Link(("seat", "m1"), 1e3, 10.0), sd.Link(("seat", "m2")))
    body = sd.SeatedBody("loose", {"m1": 1.0, "m2": 1.0}, links)
    with pytest.raises(sd.RequestError, match="no motion of 'seat' reaches"):
        sd.zeros(body, output="m2")


def test_what_is_too_large_to_compute_with_is_refused():
    suspension = [sd.Spring(9950.0), sd.Damper(260.0)]
    body = sd.load_body("ksiazek1997_back_off")
    with pytest.raises(sd.ModelError, match=r"stiffness = 1e\+308"):
        sd.poles(sd.SeatSystem(body, sd.Seat(35.0, [sd.Spring(1e308)])))
    with pytest.raises(sd.ModelError, match=r"mass = .*e-32"):
        sd.poles(sd.SeatSystem(body, sd.Seat(1e-320, suspension)))
    zero, one = np.zeros((2, 2)), np.array([[1.0, -1.0], [-1.0, 1.0]])
    for mass, stiffness in ((1.0, 1e308), (1e-320, 1.0), (1.0, np.nan), (1e-200, 1.0)):
        model = LinearModel(
            ("m1",), "seat", np.full((1, 1), mass), stiffness * one, one, zero, zero
        )
        for call in (sd.poles, sd.modes, sd.state_space, sd.is_stable):
            with pytest.raises(sd.ModelError, match=r"not finite or beyond 1e\+100"):
                call(model)


@pytest.mark.parametrize("module", ["linear", "zeros", "response"])
def test_examples_in_the_documentation(module):
    result = doctest.testmod(import_module(f"seatdyn.analysis.{module}"))
    assert result.attempted > 0
    assert result.failed == 0
