"""Critical values of one parameter: the paper's, hard ones, and random systems against poles."""

import mpmath
import numpy as np
import pytest
from scipy.optimize import brentq

import seatdyn as sd
from seatdyn.analysis import crossings
from seatdyn.analysis.characteristic import substituted
from seatdyn.analysis.stability import stability_points
from seatdyn.model.system import linear_model
from test_stability import ALPHA, CM, SEED, abscissa, poles_of, random_system, system_of

CRITICAL_MASS = {  # damping / 260 -> kg at 0.1, 1, 2, 4 times the stiffness, and the frequency
    2: ([28.957968, 29.449049, 29.994696, 31.085988], 21.49),
    6: ([26.917515, 27.360190, 27.852051, 28.835772], 22.64),
    12: ([20.750267, 21.138846, 21.570601, 22.434110], 24.16),
}


@pytest.mark.parametrize("ratio", CRITICAL_MASS)
def test_critical_seat_mass_of_back_on(ratio):
    masses, frequency = CRITICAL_MASS[ratio]
    for factor, mass in zip((0.1, 1, 2, 4), masses, strict=True):
        system = system_of("back_on", stiffness=factor * CM, damping=ratio * ALPHA)
        c = sd.critical_values(system, vary="seat_mass", low=1.0, high=400.0)
        assert c["value"].values == pytest.approx([mass], abs=6e-7)
        assert c["frequency"].values == pytest.approx([frequency], abs=6e-3)
        assert c["stable_below"].values.tolist() == [False]
        root = brentq(lambda m, s=system: abscissa(s, seat_mass=m), mass - 1, mass + 1, xtol=1e-13)
        assert c["value"].item() == pytest.approx(root, rel=1e-9)


@pytest.mark.parametrize(
    ("factor", "damping"), [(0.1, 2.1197), (1, 27.4466), (2, 70.4755), (4, 207.2836)]
)
def test_critical_damping_of_back_off(factor, damping):
    system = system_of("back_off", stiffness=factor * CM)
    c = sd.critical_values(system, vary="damping", low=0.0, high=1e4)
    assert c["value"].values == pytest.approx([damping], abs=6e-5)
    assert (c.attrs["stable_at_low"], c.attrs["stable_at_high"]) == (0, 1)
    root = brentq(lambda x: abscissa(system, damping=x), damping - 1, damping + 1, xtol=1e-13)
    assert c["value"].item() == pytest.approx(root, rel=1e-9)


def test_second_unstable_range_without_damper():
    c = sd.critical_values(system_of("back_on", damping=0.0), vary="seat_mass", low=0, high=1000)
    np.testing.assert_allclose(c["value"], [29.98897219, 320.01071437], atol=1e-8)
    np.testing.assert_array_equal(c["stable_above"], [True, False])


def test_one_critical_value_with_thirty_digits():
    """Two equations, Re and Im of det(M s^2 + C s + K) at s = i w, solved by mpmath alone."""
    system = system_of("back_off")
    found = sd.critical_values(system, vary="damping", low=0.0, high=1e4)
    model = linear_model(system)
    with mpmath.workdps(30):
        m, c, k = (mpmath.matrix(x.tolist()) for x in (model.mass, model.damping, model.stiffness))

        def equations(w, damping):
            at = c.copy()
            at[0, 0] += damping - mpmath.mpf(ALPHA)
            det = mpmath.det(-m * w**2 + at * (1j * w) + k) / 1e12
            return det.real, det.imag

        w, damping = mpmath.findroot(equations, (2 * np.pi * 1.54, 27.4))
    assert found["value"].item() == pytest.approx(float(damping), rel=1e-12)
    assert 2 * np.pi * found["frequency"].item() == pytest.approx(float(w), rel=1e-12)


@pytest.mark.parametrize("seed", range(15))
def test_critical_values_against_a_scan(seed):
    system = random_system(seed, most=6)
    searched = {
        "seat_mass": (0.5, 300.0),
        "damping": (0.0, 4000.0),
        "stiffness": (0.0, 1e5),
        "gk": (-1e5, 1e5),
        "gc": (-3e3, 3e3),
    }
    for name, (low, high) in searched.items():
        c = sd.critical_values(system, vary=name, low=low, high=high)
        scan = np.linspace(low, high, 402)[1:-1]
        real = stability_points(system, method="poles", **{name: scan})["max_real"].values
        flips = scan[:-1][(real[:-1] < 0) != (real[1:] < 0)]
        values = c["value"].values[c["verdict_changes"].values]
        step = scan[1] - scan[0]
        for flip in flips:  # an odd number of critical values in each cell that flips
            inside = (values > flip) & (values <= flip + step)
            assert inside.sum() % 2 == 1
            root = brentq(
                lambda x, n=name: abscissa(system, **{n: x}), flip, flip + step, xtol=1e-12
            )
            assert np.min(np.abs(values[inside] / root - 1.0)) < 1e-8
        for value, w in zip(c["value"].values, 2 * np.pi * c["frequency"].values, strict=True):
            poles = poles_of(system, **{name: value})
            assert np.min(np.abs(poles - 1j * w)) < 1e-8 * np.abs(poles).max()


HARD = [  # body, mass, stiffness, damping, parameter, low, high, critical values, stable at low
    (
        *("back_off", 74.44506001047, 4279.722714580895, 11.75052464095992),
        *("k12", -4000, 4000, [-3459.2940519213, 802.0289473305843], False),
    ),
    (
        *("back_off", 37.73055435616234, 420.0554641441269, 640.568942643142),
        *("damping", 0, 8000, [0.856514722455], False),
    ),
    (
        *("back_on", 27.494660136258773, 22867.785580306074, 2624.3609802503356),
        *("k11", -60000, 60000, [-560.2564197047], False),
    ),
    (
        *("back_off", 19.67538981783565, 1541.8349202088284, 4.53319970949395),
        *("k12", -4000, 4000, [-1249.150625932], True),
    ),
    (  # and none at zero stiffness, the open end, from rounding
        *("back_on", 46.96872142306522, 43426.967198927436, 77.85993984303612),
        *("stiffness", 0, 400000, [304710.0385804], True),
    ),
]


@pytest.mark.parametrize(
    ("body", "mass", "stiffness", "damping", "vary", "low", "high", "expected", "stable"), HARD
)
def test_critical_values_that_are_hard_to_polish(
    body, mass, stiffness, damping, vary, low, high, expected, stable
):
    system = system_of(body, mass, stiffness, damping)
    c = sd.critical_values(system, vary=vary, low=low, high=high)
    np.testing.assert_allclose(c["value"], expected, rtol=2e-12)
    assert c["verdict_changes"].all()
    assert bool(c.attrs["stable_at_low"]) is stable
    assert bool(c.attrs["stable_at_high"]) is stable ^ (len(expected) % 2 == 1)


def test_boundary_at_a_damping_that_is_small_against_the_present_one():
    body, mass, stiffness, damping = HARD[1][:4]
    system = system_of(body, mass, stiffness, damping)
    edge = sd.stability_boundary(system, seat_mass=[mass], stiffness=[stiffness])
    np.testing.assert_allclose(edge["damping"].values.ravel(), HARD[1][7], rtol=2e-12)
    assert edge["stable_edge"].all()


def test_a_critical_value_that_was_not_found_is_bisected(monkeypatch):
    system = system_of("back_on", damping=0.0)
    request = {"vary": "seat_mass", "low": 0.0, "high": 1000.0}
    whole = sd.critical_values(system, **request)
    monkeypatch.setattr(crossings, "_candidates", lambda *_: [])
    found = sd.critical_values(system, **request)
    np.testing.assert_allclose(found["value"], whole["value"], rtol=1e-12)
    monkeypatch.setattr(crossings, "_polish", lambda *_: None)
    found = sd.critical_values(system, **request)
    np.testing.assert_allclose(found["value"], whole["value"], rtol=1e-9)
    monkeypatch.setattr(crossings, "_add", lambda *_: False)
    with pytest.raises(sd.RequestError, match=r"cannot be told from rounding.*narrower range"):
        sd.critical_values(system, **request)


def compare_critical_values(count, seed):
    """Verdicts near both ends and within all intervals between critical values, by eigenvalues."""
    searched = {"damping": (0.0, 8000.0), "stiffness": (0.0, 4e5), "seat_mass": (0.0, 400.0)}
    searched |= {"k11": (-6e4, 6e4), "k12": (-4e3, 4e3), "k13": (-6e4, 6e4), "k14": (-4e3, 4e3)}
    fractions = np.array([1e-7, 1e-4, 0.01, 0.1, 0.5, 0.9, 0.99, 1 - 1e-4, 1 - 1e-7])
    rng = np.random.default_rng(seed)
    checked = near = 0
    wrong = []
    for i in range(count):
        mass, stiffness = np.exp(rng.uniform(0.0, np.log(80.0))), 10 ** rng.uniform(2.5, 5.0)
        case = ("back_off", "back_on")[i % 2], mass, stiffness, 10 ** rng.uniform(0.0, 3.5)
        system = system_of(*case)
        for name, (low, high) in searched.items():
            c = sd.critical_values(system, vary=name, low=low, high=high)
            edges = np.concatenate([[low], c["value"].values, [high]])
            verdicts = [*c["stable_below"].values, bool(c.attrs["stable_at_high"])]
            assert verdicts[0] == bool(c.attrs["stable_at_low"])
            points = edges[:-1, None] + fractions * np.diff(edges)[:, None]
            m, k, z = substituted(linear_model(system), {name: points.ravel()})
            m, k, z = np.broadcast_arrays(m, k, z)
            inverse, eye = np.linalg.inv(m), np.broadcast_to(np.eye(len(m[0])), m.shape)
            top = np.concatenate([np.zeros_like(m), eye], axis=2)
            bottom = np.concatenate([-inverse @ z, -inverse @ k], axis=2)
            poles = np.linalg.eigvals(np.concatenate([top, bottom], axis=1))
            margin = (poles.real.max(axis=1) / np.abs(poles).max(axis=1)).reshape(points.shape)
            clear = np.abs(margin) > 1e-9
            checked, near = checked + clear.sum(), near + np.sum(~clear)
            if np.any(clear & ((margin < 0) != np.array(verdicts)[:, None])):
                wrong.append((*case, name))
    print(f"{count} systems, seed {seed}: {checked} verdicts, {near} more within 1e-9, {wrong=}")
    assert near < checked / 10
    assert wrong == []


def test_critical_values_against_eigenvalues():
    compare_critical_values(200, SEED)


@pytest.mark.slow
def test_critical_values_against_eigenvalues_for_many_systems():
    compare_critical_values(2000, SEED + 1)


# ---------------------------------------------------------------- absurd parameters
