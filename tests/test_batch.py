"""Many steady states in one call: a seeded sample against time integration, and what fails."""

from __future__ import annotations

import numpy as np
import pytest

import seatdyn as sd
from conftest import paper_system
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
