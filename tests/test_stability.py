"""Both stability criteria, maps, boundaries and critical values, each against another way."""

import doctest
from importlib import import_module

import mpmath
import numpy as np
import pytest

import seatdyn as sd
from seatdyn.analysis.characteristic import characteristic_polynomial, substituted
from seatdyn.analysis.stability import stability_points
from seatdyn.kernels.hurwitz import is_hurwitz
from seatdyn.model.system import linear_model

CM, ALPHA = 9950.0, 260.0  # suspension of the paper, N/m and N s/m
SEED = 20240607
RANGES = {"seat_mass": (5.0, 400.0), "damping": (0.0, 6000.0), "stiffness": (500.0, 60000.0)}


def system_of(body, mass=35.0, stiffness=CM, damping=ALPHA):
    seat = sd.Seat(mass, [sd.Spring(stiffness), sd.Damper(damping)])
    return sd.SeatSystem(sd.load_body(f"ksiazek1997_{body}"), seat)


def random_system(seed, most=12):
    """1 to 12 body masses on a seat, with feedback that is not reciprocal."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, most + 1))
    names = ["seat", *(f"m{i}" for i in range(1, n + 1))]
    pairs = [(names[rng.integers(0, i)], names[i]) for i in range(1, n + 1)]
    links = tuple(sd.Link(p, rng.uniform(5e3, 5e4), rng.uniform(50, 1500)) for p in pairs)
    terms = tuple(
        sd.FeedbackTerm(
            name,
            rng.normal() * size,
            of,
            {names[i]: rng.normal() for i in rng.choice(n + 1, min(n + 1, 3), replace=False)},
        )
        for name, of, size in (("gk", "displacement", 1.5e4), ("gc", "velocity", 300.0))
    )
    on, reaction = rng.choice(n + 1, 2, replace=False)
    masses = {name: rng.uniform(3, 60) for name in names[1:]}
    body = sd.SeatedBody(
        "random", masses, links, (sd.FeedbackForce(names[on], names[reaction], terms),)
    )
    return sd.SeatSystem(body, sd.Seat(20.0, [sd.Spring(9e3), sd.Damper(300.0)]))


def poles_of(system, **values):
    """Poles by the inverse of M written out, apart from the package's companion matrix."""
    m, c, k = substituted(linear_model(system), values)
    inverse = np.linalg.inv(m)
    n = len(m)
    a = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ k, -inverse @ c]])
    return np.linalg.eigvals(a)


def abscissa(system, **values):
    return poles_of(system, **values).real.max()


# ---------------------------------------------------------------- polynomial and Routh's array


def test_characteristic_polynomial_of_two_masses():
    m, c, k = np.diag([2.0, 3.0]), np.array([[5.0, 1.0], [-2.0, 4.0]]), np.array([[7.0, 0], [3, 9]])
    a, b = np.array([2.0, 5, 7]), np.array([3.0, 4, 9])
    expected = np.polysub(np.polymul(a, b), np.polymul([1.0, 0], [-2.0, 3]))
    np.testing.assert_allclose(characteristic_polynomial(m, c, k), expected, rtol=1e-13)


def test_coefficients_of_an_undamped_system_are_exactly_zero():
    p = characteristic_polynomial(
        np.diag([1.0, 2.0]), np.zeros((2, 2)), np.array([[5, -2], [-2, 4]])
    )
    np.testing.assert_allclose(p, [2, 0, 14, 0, 16], rtol=1e-13)
    assert p[1] == p[3] == 0.0


@pytest.mark.parametrize("seed", range(6))
def test_coefficients_to_all_digits_for_many_masses(seed):
    model = linear_model(random_system(seed))
    m, c, k = model.mass, model.damping, model.stiffness
    n = model.size
    with mpmath.workdps(80):
        points = [mpmath.mpf(5 * (i - n)) for i in range(2 * n + 1)]
        pencil = [mpmath.matrix(x.tolist()) for x in (m, c, k)]
        values = [mpmath.det(pencil[0] * s**2 + pencil[1] * s + pencil[2]) for s in points]
        powers = mpmath.matrix([[s**i for i in range(2 * n, -1, -1)] for s in points])
        exact = [float(x) for x in mpmath.lu_solve(powers, mpmath.matrix(values))]
    np.testing.assert_allclose(characteristic_polynomial(m, c, k), exact, rtol=1e-10)


@pytest.mark.parametrize(
    ("roots", "stable"),
    [
        ([-1], True),
        ([0], False),
        ([1], False),
        ([-1, -2, -3], True),
        ([2j, -2j], False),
        ([-1, 2j, -2j], False),
        ([-1 + 3j, -1 - 3j, -1e-9], True),
        ([-1 + 3j, -1 - 3j, 1e-9], False),
        ([0.1 + 5j, 0.1 - 5j, -3, -4], False),
        ([2j, -2j, 3j, -3j], False),
        ([1, -1, 2, -2], False),
        ([0, 0, -1, -1], False),
    ],
)
def test_routh_array(roots, stable):
    assert is_hurwitz(np.poly(roots).real.astype(float)) == stable


def test_routh_array_against_roots():
    rng = np.random.default_rng(1)
    for _ in range(500):
        n = int(rng.integers(1, 9))
        pairs = rng.normal(-0.8, 1.0, n) + 1j * rng.normal(size=n) * 3
        roots = np.concatenate(
            [pairs, pairs.conj(), rng.normal(-0.8, 1.0, int(rng.integers(0, 3)))]
        )
        if np.abs(roots.real).min() > 1e-3:
            assert is_hurwitz(np.poly(roots).real.astype(float)) == bool(np.all(roots.real < 0))


# ---------------------------------------------------------------- verdicts and maps


def test_one_mass():
    for c, k, stable in (
        (1.0, 1.0, True),
        (0.0, 1.0, False),
        (-1.0, 1.0, False),
        (1.0, -1.0, False),
    ):
        body = sd.SeatedBody("one", {"m1": 3.0}, (sd.Link(("seat", "m1"), k, c),))
        for method in ("poles", "hurwitz"):
            assert sd.is_stable(body, method=method) is stable


@pytest.mark.parametrize("seed", range(60))
def test_criteria_agree_on_random_systems(seed):
    system = random_system(seed)
    poles = poles_of(system)
    if abs(poles.real.max()) > 1e-7 * np.abs(poles).max():
        stable = bool(poles.real.max() < 0)
        assert sd.is_stable(system, method="poles") is stable
        assert sd.is_stable(system, method="hurwitz") is stable


@pytest.mark.parametrize(
    "axes",
    [
        {"damping": np.linspace(0, 4000, 9), "seat_mass": np.linspace(10, 60, 7)},
        {"k11": np.linspace(-2e5, 3e5, 8), "k14": np.linspace(-3e3, 3e3, 5), "k12": [-1781.0]},
        {"stiffness": [500.0, 3e4], "k13": np.linspace(-2e5, 2e5, 6), "seat_mass": [20.0, 300.0]},
    ],
)
def test_map_against_single_systems(axes):
    system = system_of("back_on")
    fast = sd.stability_map(system, **axes)
    slow = sd.stability_map(system, method="poles", **axes)
    assert fast["stable"].dims == slow["stable"].dims == tuple(axes)
    grids = np.meshgrid(*axes.values(), indexing="ij")
    for index in np.ndindex(grids[0].shape):
        point = {name: grid[index] for name, grid in zip(axes, grids, strict=True)}
        largest = abscissa(system, **point)
        assert slow["max_real"].values[index] == pytest.approx(largest, rel=1e-9, abs=1e-10)
        if abs(largest) > 1e-9:
            assert fast["stable"].values[index] == slow["stable"].values[index] == (largest < 0)
    assert (
        fast[next(iter(axes))].attrs["units"]
        == linear_model(system).parameters[next(iter(axes))].unit
    )


def test_progress_is_reported():
    for method in ("hurwitz", "poles"):
        seen = []
        sd.stability_map(
            system_of("back_off"),
            method=method,
            seat_mass=np.linspace(10, 60, 80),
            damping=np.linspace(0, 500, 80),
            progress=seen.append,
        )
        assert seen == sorted(seen)
        assert seen[-1] == 1.0


def compare_criteria(body, count, seed):
    """Verdicts at random points; how many are near the boundary, and how many differ off it."""
    rng = np.random.default_rng(seed)
    columns = {name: rng.uniform(*limits, count) for name, limits in RANGES.items()}
    system = system_of(body)
    slow = stability_points(system, method="poles", **columns)
    fast = stability_points(system, method="hurwitz", **columns)
    near = np.abs(slow["margin"].values) < 1e-9
    differ = slow["stable"].values != fast["stable"].values
    stable = float(slow["stable"].mean())
    wrong = int(np.sum(differ & ~near))
    print(f"{body}: {count} points, seed {seed}, ranges {RANGES}, stable {stable:.4f},")
    print(f"    within 1e-9 of the boundary: {near.sum()}, disagreeing elsewhere: {wrong}")
    assert 0.0 < stable < 1.0
    assert near.sum() < count / 1000
    assert wrong == 0


@pytest.mark.parametrize("body", ["back_off", "back_on"])
def test_criteria_agree_on_random_points(body):
    compare_criteria(body, 20_000, SEED)


@pytest.mark.slow
@pytest.mark.parametrize("body", ["back_off", "back_on"])
def test_criteria_agree_on_a_million_random_points(body):
    compare_criteria(body, 1_000_000, SEED + 1)


# ---------------------------------------------------------------- critical values


def stable_in_fifty_digits(system):
    """Routh's array of the exact polynomial of the matrices."""
    model = linear_model(system)
    n = 2 * model.size
    with mpmath.workdps(50):
        m, c, k = (mpmath.matrix(x.tolist()) for x in (model.mass, model.damping, model.stiffness))
        points = [mpmath.mpf(10) ** j for j in range(-(n // 2), n - n // 2 + 1)]
        powers = mpmath.matrix([[s**j for j in range(n, -1, -1)] for s in points])
        values = mpmath.matrix([mpmath.det(m * s**2 + c * s + k) for s in points])
        a = list(mpmath.lu_solve(powers, values))
        for i in range(1, n):
            if a[i] <= 0:
                return False
            for j in range(i + 1, n, 2):
                a[j] -= a[i - 1] / a[i] * a[j + 1]
        return bool(a[0] > 0 and a[n] > 0)


def test_verdicts_far_outside_of_all_seats():
    """All the parameters that a Seat takes: "hurwitz" answers, "poles" answers or refuses."""
    rng = np.random.default_rng(SEED)
    refused = 0
    for i in range(150):
        mass, stiffness = 10 ** rng.uniform(-6, 6), 10 ** rng.uniform(-3, 12)
        body = ("back_off", "back_on")[i % 2]
        system = system_of(body, mass, stiffness, 10 ** rng.uniform(-3, 9))
        expected = stable_in_fifty_digits(system)
        assert sd.is_stable(system, method="hurwitz") is expected
        try:
            verdict = sd.is_stable(system)
        except sd.RequestError:
            refused += 1
            with pytest.raises(sd.RequestError, match="hides on which side"):
                sd.poles(system)
        else:
            assert verdict is bool(sd.poles(system).attrs["stable"]) is expected
    assert 0 < refused < 40


def test_a_huge_value_does_not_change_the_verdicts_beside_it():
    system = system_of("back_off")
    dampings, masses = np.arange(20.0, 36.0), [35.0, 36.0]
    alone = sd.stability_map(system, damping=dampings, seat_mass=masses)["stable"].values
    assert 0 < alone.sum() < alone.size
    beside = sd.stability_map(system, damping=[*dampings, 1e9], seat_mass=[*masses, 1e6, 1e-6])
    np.testing.assert_array_equal(beside["stable"].values[:-1, :2], alone)
    gains = np.linspace(-4000.0, 4000.0, 41)
    plain = sd.stability_map(system, k12=gains, stiffness=[CM], damping=dampings)
    wide = sd.stability_map(
        system, k12=[-1e12, *gains, 1e12], stiffness=[CM, 1e12], damping=[*dampings, 1e9]
    )
    assert 0.0 < plain["stable"].mean() < 1.0
    np.testing.assert_array_equal(wide["stable"].values[1:-1, :1, :-1], plain["stable"].values)


def test_a_pole_at_zero_is_no_rounding():
    """Without a spring the seat drifts: unstable by both criteria, however strong the damper."""
    for body in ("back_off", "back_on"):
        for damping in (1.0, 260.0, 1e9):
            system = system_of(body, stiffness=0.0, damping=damping)
            assert sd.is_stable(system) is False
            assert sd.is_stable(system, method="hurwitz") is False
            assert sd.poles(system).attrs["stable"] == 0


def test_the_first_verdict_says_when_it_compiles(monkeypatch):
    seen = []

    class Notice:
        def __enter__(self):
            seen.append("begin")

        def __exit__(self, *_):
            seen.append("end")

    monkeypatch.setattr("seatdyn.kernels.jit.CompileNotice", Notice)
    sd.is_stable(system_of("back_on"), method="hurwitz")
    sd.stability_map(system_of("back_on"), damping=[1.0], seat_mass=[30.0])
    assert seen == ["begin", "end"] * 2


# ---------------------------------------------------------------- boundaries


def test_boundary_is_where_a_pole_is_on_the_axis():
    f = np.linspace(0.3, 30.0, 40)
    for body in ("back_off", "back_on"):
        system = system_of(body)
        by_mass = sd.stability_boundary(system, frequency=f, seat_mass=[20.0, 35.0])
        by_spring = sd.stability_boundary(system, frequency=f, stiffness=[995.0, CM])
        assert by_mass["stiffness"].dims == ("seat_mass", "frequency")
        assert by_spring["seat_mass"].dims == ("stiffness", "frequency")
        for curves in (by_mass, by_spring):
            flat = curves.to_dataframe().reset_index()
            flat = flat[(flat["seat_mass"] > 0.5) & (flat["stiffness"] > 0)]
            assert len(flat) >= 4
            for row in flat.itertuples():
                poles = poles_of(
                    system, seat_mass=row.seat_mass, damping=row.damping, stiffness=row.stiffness
                )
                offset = np.min(np.abs(poles - 2j * np.pi * row.frequency))
                assert offset < 1e-9 * np.abs(poles).max()
                if row.damping > 0:
                    w = 2 * np.pi * row.frequency
                    away = np.abs(np.abs(poles.imag) - w) + np.abs(poles.real)
                    others = poles[np.argsort(away)[2:]]
                    assert row.stable_edge == bool(np.all(others.real < 0))


def test_three_forms_of_the_boundary_agree():
    system = system_of("back_on")
    masses, springs = np.linspace(16.0, 30.0, 8), CM * np.array([0.1, 1.0, 4.0])
    branches = sd.stability_boundary(system, seat_mass=masses, stiffness=springs)
    assert branches["damping"].dims == ("stiffness", "seat_mass", "branch")
    for i, j in np.ndindex(len(springs), len(masses)):
        seen = branches.isel(stiffness=i, seat_mass=j)
        single = system_of("back_on", mass=masses[j], stiffness=springs[i])
        expected = sd.critical_values(single, vary="damping", low=0.0, high=1e6)["value"].values
        damping = seen["damping"].values[~np.isnan(seen["damping"].values)]
        np.testing.assert_allclose(damping, expected, rtol=1e-12)
        for value, f in zip(damping, seen["frequency"].values, strict=False):
            curve = sd.stability_boundary(system, frequency=[f], stiffness=[springs[i]])
            assert curve["seat_mass"].item() == pytest.approx(masses[j], rel=1e-9)
            assert curve["damping"].item() == pytest.approx(value, rel=1e-9)


def test_static_limit_of_the_suspension():
    body = sd.SeatedBody("m", {"m1": 50.0}, (sd.Link(("seat", "m1"), 1e4, 100.0),))
    system = sd.SeatSystem(body, sd.Seat(20.0, [sd.Spring(5e3), sd.Damper(100.0)]))
    edge = sd.stability_boundary(system, frequency=[1.0])
    assert edge.attrs["static_stiffness"] == pytest.approx(0.0, abs=1e-9)


# ---------------------------------------------------------------- requests

OFF = "back_off"


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda s: sd.stability_map(s, seat_mass=[1.0, 2.0]), "got 1 parameters.*two or three"),
        (lambda s: sd.stability_map(s), "got 0 parameters"),
        (lambda s: sd.stability_map(s, k11=[1], k12=[1], k13=[1], k14=[1]), "got 4 parameters"),
        (lambda s: sd.stability_map(s, seat_mas=[1.0], damping=[1.0]), "'seat_mas'.*Did you mean"),
        (lambda s: sd.stability_map(s, seat_mass=[0.0, 2.0], damping=[1.0]), "seat_mass = 0 kg"),
        (lambda s: sd.stability_map(s, seat_mass=[2.0], damping=[-1.0]), "damping = -1 N s/m"),
        (lambda s: sd.stability_map(s, seat_mass=[np.nan], damping=[1.0]), "seat_mass = nan"),
        (lambda s: sd.stability_map(s, seat_mass=[], damping=[1.0]), "seat_mass has the shape"),
        (lambda s: sd.stability_map(s, seat_mass=["a"], damping=[1.0]), "array of numbers in kg"),
        (
            lambda s: sd.stability_map(s, method="nyquist", seat_mass=[2.0], damping=[1.0]),
            "method = 'nyquist'",
        ),
        (lambda s: sd.is_stable(s, method="routh"), "method = 'routh'"),
        (
            lambda s: sd.stability_map(s, seat_mass=np.arange(1, 1e5), damping=np.arange(1e5)),
            r"99999 x 100000 = 1e\+10 points.*at most 2e\+07.*fewer points",
        ),
        (
            lambda s: sd.stability_map(
                s, method="poles", seat_mass=np.arange(1, 2001), damping=np.arange(2e3)
            ),
            r"2000 x 2000 = 4e\+06 points.*'poles' at most 2e\+06",
        ),
        (lambda s: sd.stability_map(s, seat_mass=[1e-320], damping=[1.0]), "seat_mass = .*e-32"),
        (lambda s: sd.stability_map(s, seat_mass=[1.0], damping=[1.0, 1e12]), r"damping = 1e\+12"),
        (lambda s: sd.critical_values(s, vary="damping", low=0, high=1e300), "damping .high. = 1e"),
        (lambda s: sd.critical_values(s, vary="mass", low=1, high=2), "'mass'.*seat_mass"),
        (lambda s: sd.critical_values(s, vary="damping", low=5, high=2), "from 5 to 2.*Exchange"),
        (lambda s: sd.critical_values(s, vary="damping", low=-5, high=2), r"damping \(low\) = -5"),
        (lambda s: sd.critical_values(s, vary="k11", low=0, high=np.inf), r"k11 \(high\) = inf"),
        (lambda s: sd.critical_values(s.body, vary="damping", low=0, high=1), "'damping'"),
        (lambda s: sd.stability_boundary(s, frequency=[0.0]), r"frequency\[0\] = 0 Hz"),
        (lambda s: sd.stability_boundary(s), "takes two of"),
        (
            lambda s: sd.stability_boundary(s, frequency=[1.0], seat_mass=[1.0], stiffness=[1.0]),
            "takes two of",
        ),
        (lambda s: sd.stability_boundary(s.body, frequency=[1.0]), "needs a seat"),
        (lambda s: stability_points(s, damping=[1.0], seat_mass=[1.0, 2.0]), "equal length"),
    ],
)
def test_bad_requests(call, words):
    with pytest.raises(sd.RequestError, match=words):
        call(system_of(OFF))


@pytest.mark.parametrize("module", ["stability", "boundary", "characteristic"])
def test_examples_in_the_documentation(module):
    result = doctest.testmod(import_module(f"seatdyn.analysis.{module}"))
    assert result.attempted > 0
    assert result.failed == 0
