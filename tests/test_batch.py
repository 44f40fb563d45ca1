"""Many steady states in one call: a seeded sample against time integration, and what fails."""

from __future__ import annotations

import numpy as np
import pytest

import seatdyn as sd
from conftest import paper_system
from seatdyn.analysis.balance import condense, output_rows
from seatdyn.analysis.members import Members
from seatdyn.analysis.parameters import with_parameters

SINE = sd.Sine(1.55, amplitude=0.8857)
SEED, MEMBERS = 20, 100
# ranges of the parameters of every case, beside those of the base motion, the mass and the spring
CASES = {
    "quadratic": (sd.QuadraticDamper(1.0), {"QuadraticDamper.coefficient": (50.0, 1500.0)}),
    "friction": (sd.CoulombFriction(1.0), {"CoulombFriction.force": (5.0, 60.0)}),
    "gap": (
        sd.PiecewiseSpring(1.0, 0.02, 0.01, jumping=False),
        {"PiecewiseSpring.stiffness": (500.0, 20000.0)},
    ),
    "jump": (
        sd.PiecewiseSpring(1.0, 0.02, 0.01),
        {"PiecewiseSpring.stiffness": (200.0, 5000.0)},
    ),
}
COMMON = {
    "frequency": (0.8, 8.0),
    "base_amplitude": (0.2, 3.0),
    "seat_mass": (20.0, 60.0),
    "Spring.stiffness": (6000.0, 20000.0),
}
TOLERANCE = 1e-4


@pytest.mark.parametrize("name", CASES)
def test_seeded_sets_converge_and_agree_with_time_integration(name):
    element, own = CASES[name]
    system = paper_system(element)
    generator = np.random.default_rng(SEED)
    sets = {key: generator.uniform(*ends, MEMBERS) for key, ends in (COMMON | own).items()}
    states = sd.steady_states(system, SINE, sets, tolerance=TOLERANCE)
    good = np.isin(states.status.values, ["converged", "grazing"])
    print(f"{name}: {good.sum()} of {MEMBERS}, seed {SEED}", set(states.status.values[~good]))
    assert good.mean() >= 0.97
    assert np.all(np.isnan(states.amplitude.values[~good]))
    compared = 0
    for p in np.nonzero(good & (states.floquet_max.values < 0.99))[0][:8]:
        member = with_parameters(
            system, SINE, {key: float(values[p]) for key, values in sets.items()}
        )
        reached = sd.steady_state(*member, method="time")
        assert reached.attrs["status"] == "converged"
        np.testing.assert_allclose(states.amplitude.values[p], reached.amplitude, rtol=TOLERANCE)
        compared += 1
    assert compared == 8


def test_a_set_that_fails_is_a_row():
    system = paper_system(sd.QuadraticDamper(1.0))
    states = sd.steady_states(system, SINE, {"seat_mass": [35.0, -1.0, 40.0]})
    assert states.status.values.tolist() == ["converged", "refused", "converged"]
    assert "Seat.mass = -1 kg" in str(states.message.values[1])
    assert np.all(np.isnan(states.amplitude.values[1]))
    alone = sd.steady_state(system, SINE, method="hb")
    np.testing.assert_allclose(states.amplitude.values[0], alone.amplitude, rtol=1e-9)


def test_bad_requests():
    with pytest.raises(sd.RequestError, match=r"Nothing here is called 'Spring\.stifness'"):
        sd.steady_states(paper_system(), SINE, {"Spring.stifness": [1.0]})
    with pytest.raises(sd.RequestError, match="arrays of one length"):
        sd.steady_states(paper_system(), SINE, {"seat_mass": [30.0, 40.0], "frequency": [1.0]})


PIECES = sd.PiecewiseSpring(900.0, 0.02, 0.01)


@pytest.mark.parametrize(
    ("elements", "own"),
    [
        ((sd.QuadraticDamper(300.0), PIECES), {"QuadraticDamper.coefficient": (10.0, 900.0)}),
        ((PIECES,), {"PiecewiseSpring.bump_clearance": (0.005, 0.03)}),
    ],
)
def test_sets_lowered_at_once_are_those_of_their_own_systems(elements, own):
    """Matrices, laws, breaks, base and outputs; those out of range are left to be refused."""
    system = paper_system(*elements)
    generator = np.random.default_rng(4)
    ranges = COMMON | {"Damper.coefficient": (100.0, 900.0)} | own
    sets = {key: generator.uniform(*ends, 5) for key, ends in ranges.items()}
    sets["Damper.coefficient"][3] = -1.0
    members = Members(system, SINE, sets)
    assert members.known.tolist() == [True, True, True, False, True]
    for p in np.nonzero(members.known)[0]:
        values = {key: float(column[p]) for key, column in sets.items()}
        theirs = with_parameters(system, SINE, values)
        got, rows = members[p], members.rows(slice(p, p + 1), slice(None))[0]
        exact = dict(zip(got._fields, condense(*theirs), strict=True))
        for field, ours in zip(got._fields, got, strict=True):
            np.testing.assert_allclose(ours, exact[field], rtol=1e-10, atol=1e-12, err_msg=field)
        np.testing.assert_allclose(rows, output_rows(theirs[0])[1], rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    ("case", "values"),
    [
        (  # the peak of m2-seat lies between a crossing and the next sample
            "quadratic",
            {
                "frequency": 7.755914418639011,
                "base_amplitude": 0.48373476350152195,
                "seat_mass": 52.81507723351218,
                "Spring.stiffness": 7310.940685641536,
                "QuadraticDamper.coefficient": 514.1711686695465,
            },
        ),
        (  # the stop is touched for less than the time between two samples
            "gap",
            {
                "base_amplitude": 0.2,
                "PiecewiseSpring.stiffness": 1000.0,
                "PiecewiseSpring.rebound_clearance": 0.00939,
            },
        ),
    ],
)
def test_no_peak_is_missed_beside_or_between_crossings(case, values):
    element, _ = CASES[case]
    system = paper_system(element)
    sets = {key: np.array([value]) for key, value in values.items()}
    states = sd.steady_states(system, SINE, sets, tolerance=1e-6)
    exact = sd.steady_state(*with_parameters(system, SINE, values), method="time")
    moving = exact.amplitude.values > 0.0
    np.testing.assert_allclose(
        states.amplitude.values[0][moving], exact.amplitude.values[moving], rtol=1e-5
    )
