"""Seats at random: how many steady states converge, and whether they are right."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import seatdyn as sd
from conftest import paper_system
from seatdyn.analysis.balance import balance
from seatdyn.model.custom import CustomElement
from seatdyn.model.elements import NonlinearElement
from seatdyn.model.memory import MemoryElement
from seatdyn.model.shift import Shifted
from seats_at_random import ALLOWED, KINDS, TOLERANCE, Outcome, miss, outcome_of, random_set


def check(cases, sampled):
    """All converge; the sample comes back after a period in time."""
    misses, sharp = [], 0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sd.SeatdynWarning)  # tables are used outside their range
        for i, case in enumerate(cases):
            outcome = outcome_of(case)
            assert outcome.converged, f"{case}: {outcome.status}"
            if i in sampled and outcome.status in ("converged", "grazing"):
                missed = miss(case, outcome)
                assert missed <= ALLOWED * TOLERANCE, str(case)
                misses.append(missed)
                sharp += case.sharp
    assert sharp >= 0.3 * len(misses)


def test_all_elements_are_drawn():
    """Every class of element but the linear ones is among the kinds."""
    rng = np.random.default_rng(0)
    drawn = {type(kind.draw(rng)) for kind in KINDS.values()}
    bases = (NonlinearElement, MemoryElement)

    def leaves(kind):
        return [leaf for sub in kind.__subclasses__() for leaf in (leaves(sub) or [sub])]

    known = {
        kind for base in bases for kind in leaves(base) if kind.__module__.startswith("seatdyn")
    }
    assert known - {CustomElement, Shifted} <= drawn  # a user's law; what `settled` makes


def test_seats_without_states():
    cases = [case for case in map(random_set, range(120)) if not case.system.memory_elements]
    check(cases[:40], range(0, 40, 2))


@pytest.mark.slow
def test_seats_of_all_elements():
    check([random_set(i) for i in range(20_000, 20_200)], range(0, 200, 4))


@pytest.mark.filterwarnings("ignore::seatdyn.errors.BandWarning")
def test_a_seat_held_at_a_jump_beside_another_motion():
    """From rest the active body keeps it moving, and never repeats; resting at d = 0 it stays."""
    case = random_set(29)
    held = sd.steady_state(case.system, case.sine, method="hb")
    assert (held.attrs["status"], held.attrs["finished"]) == ("converged", "time")
    assert float(held.amplitude.sel(output="seat-base")) < 1e-12
    other = sd.steady_state(case.system, case.sine, tolerance=TOLERANCE, max_periods=200)
    assert other.attrs["status"] == "no_periodic_response"


@pytest.mark.filterwarnings("ignore::seatdyn.errors.BandWarning")
def test_a_light_cushion_bounces_about_a_jump_until_it_rests():
    """What the location of every crossing leaves must not feed the bouncing."""
    case = random_set(20_151)
    assert "tanh damper" in case.kinds
    run = sd.simulate(case.system, case.sine, case.sine.period)
    assert run.attrs["status"] == "ok"
    assert run.attrs["events"] < 2000


@pytest.mark.filterwarnings("ignore::seatdyn.errors.BandWarning")
def test_what_the_steps_leave_is_no_other_motion():
    """Dry friction and a kinked damper: at rtol = 1e-9 periods differ by 1e-4, which is noise."""
    case = random_set(339)
    assert case.kinds == ("dry friction", "balance damper")
    state = sd.steady_state(case.system, case.sine, method="time", tolerance=TOLERANCE)
    assert state.attrs["status"] == "converged"


@pytest.mark.filterwarnings("ignore::seatdyn.errors.BandWarning")
def test_friction_does_not_hold_an_unstable_seat():
    """Poles at +18 1/s: the motion grows beyond any bound, and the status says so."""
    case = random_set(5118)
    assert set(case.kinds) == {"dry Bingham", "Bingham"}
    assert float(sd.poles(case.system)["real"].max()) > 0.0
    state = sd.steady_state(case.system, case.sine, method="time", tolerance=TOLERANCE)
    assert state.attrs["status"] == "unstable"
    assert np.all(np.isnan(state.amplitude))


@pytest.mark.filterwarnings("ignore::seatdyn.errors.BandWarning")
def test_growth_beyond_all_numbers_is_unstable():
    """A disturbance of this motion grows over one period until the run ends."""
    case = random_set(9671)
    state = sd.steady_state(case.system, case.sine, method="hb", tolerance=TOLERANCE)
    assert (state.attrs["status"], state.attrs["stable"]) == ("converged", 0)
    assert state.attrs["floquet_max"] == np.inf


def test_motions_of_too_many_harmonics_are_finished_in_time():
    """4096 samples of steep friction do not reach 1e-9; Newton's method on the period map does."""
    system, sine = paper_system(sd.CoulombFriction(50.0)), sd.Sine(1.55, amplitude=0.8857)
    state = sd.steady_state(system, sine, method="hb", tolerance=1e-9)
    a = state.attrs
    assert (a["status"], a["method"], a["finished"], a["stable"]) == ("converged", "hb", "time", 1)
    assert a["error_estimate"] <= 1e-9
    reached = sd.steady_state(system, sine, method="time", tolerance=1e-9)
    np.testing.assert_allclose(state.amplitude, reached.amplitude, rtol=1e-7)


@pytest.mark.filterwarnings("ignore::seatdyn.errors.BandWarning")
def test_growth_that_runs_out_of_steps_is_unstable():
    """Dahl friction needs steps as short as its way is long, so the bound is never reached."""
    case = random_set(592)
    assert case.kinds == ("Stribeck", "Dahl")
    few = sd.Settings(rtol=1e-9, max_steps=300_000)
    state = sd.steady_state(case.system, case.sine, method="time", settings=few)
    assert state.attrs["status"] == "unstable"


def test_growth_beside_an_element_with_states_is_unstable():
    case = random_set(379)
    assert case.kinds == ("Zener", "balance damper")
    state = sd.steady_state(case.system, case.sine, method="time", tolerance=TOLERANCE)
    assert state.attrs["status"] == "unstable"


@pytest.mark.filterwarnings("ignore::seatdyn.errors.SeatdynWarning")
def test_a_motion_is_led_from_another_level():
    """Unstable, and on no branch that begins at level zero; the response is quasi-periodic."""
    case = random_set(5640)
    asked = {"method": "hb", "tolerance": TOLERANCE}
    state = sd.steady_state(case.system, case.sine, **asked)
    assert (state.attrs["status"], state.attrs["stable"]) == ("converged", 0)
    outcome = Outcome("converged", "hb", 0, "", "", state)
    assert miss(case, outcome) <= ALLOWED * TOLERANCE


@pytest.mark.filterwarnings("ignore::seatdyn.errors.SeatdynWarning")
def test_no_steps_from_where_forces_have_no_number():
    """Dry friction about its rest: too many events at the start of every attempt, and no more."""
    case = random_set(5222)
    lost = balance(case.system, case.sine, TOLERANCE)
    assert not lost.found
    assert lost.evaluations < 50  # 75 or more of every attempt, each of them slow
    held = sd.steady_state(case.system, case.sine, method="hb", tolerance=TOLERANCE)
    assert (held.attrs["status"], held.attrs["finished"]) == ("converged", "time")
