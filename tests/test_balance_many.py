"""Several members side by side: against one by one, time integration, and closed forms."""

from __future__ import annotations

import numba
import numpy as np
import pytest

import seatdyn as sd
from conftest import paper_system
from seatdyn.analysis.balance import LOOSE
from seatdyn.analysis.balance_many import NotOdd, ascend, balance_many, in_rows
from seatdyn.analysis.members import Members, affine_numbers, are_stiff, changed_numbers
from seatdyn.analysis.parameters import with_parameters
from seatdyn.kernels.rows import (
    WIDTH,
    Space,
    aligned,
    any_larger,
    load,
    root_of,
    spread,
    store,
    where_larger,
)
from seatdyn.kernels.rows_fourier import harmonics, samples_of
from seatdyn.model.elements import NonlinearElement
from seats_at_random import KINDS

SINE = sd.Sine(1.55, amplitude=0.8857)
SEED = 31
COMMON = {
    "frequency": (0.8, 8.0),
    "base_amplitude": (0.2, 3.0),
    "seat_mass": (20.0, 60.0),
    "Spring.stiffness": (6000.0, 20000.0),
}


def cushioned():
    """A seat with two channels: friction in the suspension, a hardening cushion."""
    suspension = [sd.Spring(9950.0), sd.Damper(400.0), sd.CoulombFriction(20.0, slope=100.0)]
    cushion = [sd.KelvinVoigt(60e3, 700.0), sd.QuadraticDamper(800.0)]
    seat = sd.Seat(35.0, suspension, cushion=cushion, cushion_mass=1.5)
    return sd.SeatSystem(sd.load_body("wei1998_2b"), seat)


# system, parameters of its own
CASES = {
    "quadratic": (
        lambda: paper_system(sd.QuadraticDamper(1.0)),
        {"QuadraticDamper.coefficient": (50.0, 1500.0)},
    ),
    "steep friction": (
        lambda: paper_system(sd.CoulombFriction(1.0)),
        {"CoulombFriction.force": (5.0, 60.0)},
    ),
    "bump and rebound": (
        lambda: paper_system(sd.AsymmetricDamper(100.0, 500.0)),
        {"AsymmetricDamper.bump": (50.0, 300.0), "AsymmetricDamper.rebound": (300.0, 2000.0)},
    ),
    "two in a channel": (
        lambda: paper_system(sd.QuadraticDamper(1.0), sd.CoulombFriction(20.0, slope=50.0)),
        {"QuadraticDamper.coefficient": (50.0, 900.0), "CoulombFriction.slope": (20.0, 200.0)},
    ),
    "two channels": (
        cushioned,
        {"QuadraticDamper.coefficient": (50.0, 900.0), "CoulombFriction.force": (5.0, 40.0)},
    ),
}


def draw(own, count):
    generator = np.random.default_rng(SEED)
    return {key: generator.uniform(*ends, count) for key, ends in (COMMON | own).items()}


def side_by_side(system, sets, tolerance, outputs=slice(None)):
    """Amplitudes and estimates of the fast way alone."""
    members = Members(system, SINE, sets)
    assert members.known.all()
    assert members.smooth
    names = sd.steady_state(system, SINE, method="hb", tolerance=1e-3).output.values
    places = np.arange(len(names))[outputs]
    return balance_many(members.many(np.arange(len(members.known)), places), tolerance)


@pytest.mark.parametrize("name", CASES)
def test_members_are_solved_right_and_the_estimate_covers_the_error(name):
    """Beside each other and one by one share the equations; the method is another.

    Of all outputs: an acceleration may peak at a corner, or see a friction steeper than the motion.
    """
    make, own = CASES[name]
    system, sets = make(), draw(own, 10 * WIDTH + 3)
    exact = sd.steady_states(system, SINE, sets, tolerance=1e-7)
    known = (exact.status == "converged").values  # else 4096 samples do not give 1e-7
    assert known.mean() >= 0.7
    for tolerance in (1e-3, 1e-4, 1e-5, 1e-6):
        amplitude, error = side_by_side(system, sets, tolerance)
        solved = np.isfinite(error)
        assert solved.mean() >= 0.8 or tolerance < 1e-5  # corners are left to the other way
        assert np.all(error[solved] <= tolerance)
        solved &= known
        off = np.abs(amplitude / exact.amplitude.values - 1)[solved].max(axis=1)
        assert np.all(off <= error[solved] + 2e-7)


@pytest.mark.parametrize("name", ["quadratic", "two channels"])
def test_half_a_period_tells_the_other_half(name):
    """The same numbers as from all of it, and the same estimates: not one equation is another."""
    make, own = CASES[name]
    system, sets = make(), draw(own, 2 * WIDTH)
    members = Members(system, SINE, sets)
    many = members.many(np.arange(2 * WIDTH), slice(None))
    whole, half = (ascend(many, 1e-6, odd, [Space(), Space()]) for odd in (False, True))
    np.testing.assert_allclose(half[0], whole[0], rtol=1e-9)
    np.testing.assert_allclose(half[1], whole[1], rtol=1e-2)


def test_a_law_that_is_not_odd_is_found_out():
    make, own = CASES["bump and rebound"]
    members = Members(make(), SINE, draw(own, WIDTH))
    with pytest.raises(NotOdd):
        ascend(members.many(np.arange(WIDTH), [0]), 1e-6, True, [Space(), Space()])


def test_stiff_enough_is_what_the_condition_says():
    rng = np.random.default_rng(3)
    turns = np.linalg.qr(rng.normal(size=(2, 40, 3, 3)))[0]
    least = 10.0 ** rng.uniform(-16.0, -8.0, 40)
    values = np.stack([np.ones(40), rng.uniform(0.1, 1.0, 40), least], axis=1)
    matrices = 7.0 * turns[0] @ (values[:, :, None] * turns[1])
    np.testing.assert_array_equal(are_stiff(matrices), np.linalg.cond(matrices) <= LOOSE)
    assert not are_stiff(np.zeros((1, 3, 3)))[0]


def test_one_member_against_time_integration():
    system = paper_system(sd.QuadraticDamper(1.0))
    sets = draw({"QuadraticDamper.coefficient": (300.0, 1500.0)}, WIDTH)
    sets["frequency"][:] = 1.55
    amplitude, error = side_by_side(system, sets, 1e-8)
    assert np.all(error <= 1e-8)
    for p in (0, WIDTH - 1):
        values = {key: float(column[p]) for key, column in sets.items()}
        member = with_parameters(system, SINE, values)
        reached = sd.steady_state(*member, method="time", settings=sd.Settings(rtol=1e-12))
        np.testing.assert_allclose(amplitude[p], reached.amplitude, rtol=2e-8)


def test_a_linear_seat_is_the_transmissibility():
    """With a law that gives nothing, in closed form."""
    system, sets = paper_system(sd.QuadraticDamper(0.0)), draw({}, 5)
    amplitude, _ = side_by_side(system, sets, 1e-9)
    names = list(sd.steady_state(system, SINE, method="hb").output.values)
    for p in range(5):
        member = with_parameters(system, SINE, {key: float(x[p]) for key, x in sets.items()})
        found = sd.frequency_response(member[0], frequency=[member[1].frequency])
        ratio = np.abs(found.transmissibility.sel(node="seat").values[0])
        got = amplitude[p, names.index("acc_seat")]
        np.testing.assert_allclose(got, ratio * member[1].peak, rtol=1e-10)


def test_a_seat_without_channels():
    sets = draw({}, 2 * WIDTH)
    together = sd.steady_states(paper_system(), SINE, sets, stability=False)
    alone = sd.steady_states(paper_system(), SINE, sets)
    assert (together.status == "converged").all()
    np.testing.assert_allclose(together.amplitude, alone.amplitude, rtol=2e-6)


def test_what_is_asked_for_does_not_change_what_is_found():
    """All sets at once, some outputs, in another order: the same numbers."""
    system, own = CASES["quadratic"][0](), CASES["quadratic"][1]
    sets = draw(own, 20)
    whole = sd.steady_states(system, SINE, sets, stability=False)
    names = ["F_damper", "acc_seat"]
    some = sd.steady_states(system, SINE, sets, stability=False, outputs=names)
    assert some.output.values.tolist() == names
    np.testing.assert_allclose(some.amplitude, whole.amplitude.sel(output=names), rtol=2e-6)
    alone = sd.steady_states(system, SINE, sets, outputs=names)  # with stability: one by one
    np.testing.assert_allclose(some.amplitude, alone.amplitude, rtol=2e-6)
    assert (whole.status == "converged").all()
    with pytest.raises(sd.RequestError, match=r"No output is called 'acc_seet'.*acc_seat"):
        sd.steady_states(system, SINE, sets, outputs=["acc_seet"])


def test_what_is_not_solved_together_is_solved_alone(monkeypatch):
    """No steps, no solution: the rows are there all the same, from the other way."""
    import seatdyn.analysis.batch as batch

    system, own = CASES["quadratic"][0](), CASES["quadratic"][1]
    sets = draw(own, 16)
    whole = sd.steady_states(system, SINE, sets, stability=False)

    def lame(many, tolerance):
        amplitude, error = balance_many(many, tolerance)
        amplitude[::2], error[::2] = np.nan, np.nan
        return amplitude, error

    monkeypatch.setattr(batch, "balance_many", lame)
    mixed = sd.steady_states(system, SINE, sets, stability=False)
    assert (mixed.status == "converged").all()
    np.testing.assert_allclose(mixed.amplitude, whole.amplitude, rtol=2e-6)


def plain_fields(kind):
    """Fields of a law without states that are numbers, and are drawn."""
    element = kind.draw(np.random.default_rng(5))
    if not isinstance(element, NonlinearElement):
        return []
    return [key for key in kind.ranges if isinstance(getattr(element, key, None), float)][:3]


PLAIN = {name: fields for name, kind in KINDS.items() if (fields := plain_fields(kind))}


@pytest.mark.parametrize("kind", PLAIN)
def test_laws_said_to_be_affine_are(kind):
    """Numbers of laws at random fields are those of elements made with these fields."""
    rng = np.random.default_rng(5)
    elements = [KINDS[kind].draw(rng) for _ in range(4)]
    values = {key: np.array([getattr(e, key) for e in elements]) for key in PLAIN[kind]}
    found = affine_numbers(elements[0], values)
    for p in range(len(elements) if found is not None else 0):  # else each is asked
        exact = changed_numbers(elements[0], {key: float(x[p]) for key, x in values.items()})
        np.testing.assert_allclose(found.parameters[p], exact.parameters, rtol=1e-12)
        np.testing.assert_allclose(found.breaks[p], exact.breaks, rtol=1e-12)


def test_most_laws_are_affine():
    rng = np.random.default_rng(6)
    affine = [
        affine_numbers(KINDS[kind].draw(rng), {key: np.array(KINDS[kind].ranges[key])})
        for kind, (key, *_) in PLAIN.items()
    ]
    assert sum(found is not None for found in affine) > len(PLAIN) / 2


@numba.njit
def _arithmetic(x, y, result):
    a, b = load(x, 0), load(y, 0)
    store(result, 0, (a + b * 2.0 - 1.0 / b) / a)
    store(result, 1, where_larger(a, b, a, b))
    store(result, 2, root_of(a))
    store(result, 3, spread(3.0))
    return any_larger(a, 2.0), any_larger(a, b)


def test_rows_are_numbers_of_all_members():
    rng = np.random.default_rng(1)
    x, y = rng.uniform(0.1, 1.0, (2, 1, WIDTH))
    x[0, 3] = y[0, 3] + 1.0
    result = np.zeros((4, WIDTH))
    assert _arithmetic(x, y, result) == (False, True)
    expected = [(x + 2 * y - 1 / y) / x, np.maximum(x, y), np.sqrt(x), np.full_like(x, 3.0)]
    np.testing.assert_allclose(result, np.vstack(expected), rtol=1e-15)


@numba.njit
def _there_and_back(series, n, odd, roots, lines, rate, samples, slopes, back):
    count, rate = series.shape[0], load(rate, 0)
    samples_of(series, rate, 0, count, n, odd, roots, lines[0], lines[1], samples)
    samples_of(series, rate, 1, count, n, odd, roots, lines[0], lines[1], slopes)
    harmonics(samples, n, odd, roots, count, lines[0], lines[1], back)


@pytest.mark.parametrize("odd", [False, True])
@pytest.mark.parametrize("n", [64, 128])
def test_transforms_are_those_of_numpy(n, odd):
    """Of the odd harmonics alone, from half a period."""
    rng = np.random.default_rng(2)
    count, own = n // 2, slice(1, None, 2) if odd else slice(None)
    coefficients = rng.normal(size=(WIDTH, count)) + 1j * rng.normal(size=(WIDTH, count))
    coefficients[:, 0] = coefficients[:, 0].real
    coefficients[:, :: 2 if odd else n] *= 0.0 if odd else 1.0
    few = coefficients[:, own]
    series = in_rows(np.stack([few.real, few.imag], axis=2))[0]
    angle = 2 * np.pi * np.arange(n) / n
    roots = np.stack([np.cos(angle), -np.sin(angle)], axis=1)
    rate = rng.uniform(1.0, 2.0, WIDTH)
    kept = n // 2 if odd else n
    samples, slopes, back = np.zeros((kept, WIDTH)), np.zeros((kept, WIDTH)), np.zeros_like(series)
    space = np.zeros((2, n, WIDTH))
    _there_and_back(series, kept, odd, roots, space, rate[None], samples, slopes, back)
    exact = np.fft.irfft(coefficients, n, norm="forward")[:, :kept]
    np.testing.assert_allclose(samples.T, exact, atol=1e-12)
    turned = 1j * rate[:, None] * np.arange(count) * coefficients
    exact = np.fft.irfft(turned, n, norm="forward")[:, :kept]
    np.testing.assert_allclose(slopes.T, exact, atol=1e-11)
    np.testing.assert_allclose(back, series, atol=1e-13)


def test_memory_for_rows_is_used_again():
    """Arrays begin where a row may, do not overlap, and are the same ones after a clearing."""
    space = Space()
    for _ in range(2):
        space.clear()
        taken = [space.take(3, size, WIDTH) for size in (1, 5000, 7, 20000, 2)]
        taken.append(space.take(3))
        for value, array in enumerate(taken):
            assert array.ctypes.data % (8 * WIDTH) == 0
            array[...] = value
        assert all(array.min() == array.max() == i for i, array in enumerate(taken))
        places = [array.ctypes.data for array in taken]
    space.clear()
    assert space.take(3, 1, WIDTH).ctypes.data == places[0]
    table = np.arange(48.0).reshape(6, 8).T
    np.testing.assert_array_equal(aligned(table), table)
