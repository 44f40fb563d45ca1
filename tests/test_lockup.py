"""The level at which a suspension with dry friction begins to move."""

from __future__ import annotations

import numpy as np
import pytest

import seatdyn as sd
from conftest import oscillator, paper_system


def friction(force):
    return sd.StribeckFriction(force, force, 0.1, dry=True)


def test_one_mass_breaks_away_as_den_hartog_says():
    system = oscillator(sd.Spring(400.0), friction(3.0), mass=6.0)
    assert sd.lockup_boundary(system, [0.5, 5.0]).level.values == pytest.approx([0.5, 0.5])


@pytest.mark.parametrize("body", ["fairley1989", "boileau1998"])
def test_time_integration_sticks_below_and_moves_above(body):
    system = paper_system(friction(40.0), body=body, c=100.0)
    frequency = 3.0
    level = float(sd.lockup_boundary(system, [frequency]).level[0])
    moved = []
    for share in (0.85, 1.15):
        # a sweep over next to no range; the start may leave an offset, hence the margin
        rising = sd.Sweep(frequency, frequency * 1.0001, 20.0, amplitude=share * level)
        run = sd.simulate(system, rising, 20.0, energy_check=False)
        late = run.relative_displacement.sel(pair="seat-base")[-3000:]
        moved.append(float(late.max() - late.min()))
    assert moved[0] < 1e-9
    assert moved[1] > 1e-6


def test_smooth_friction_is_refused():
    with pytest.raises(sd.RequestError, match="dry friction"):
        sd.lockup_boundary(paper_system(sd.CoulombFriction(50.0)), [1.0])
    assert np.isfinite(sd.poles(paper_system())["real"]).all()


ENGINES = {  # elements that do nothing, each for an engine of its own
    "prompt": (),
    "states": (sd.Zener(1e-9, 1e-9, 0.05),),
    "late": (sd.Spring(1e-9, delay=0.013),),
}


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("excess", [1e-3, 1e-4])
def test_a_short_slip_is_not_missed(engine, excess):
    """The base asks for more than friction can bear, for a short while in each half period.

    With the relative acceleration a (1 + e) sin - a, about e - (w t)^2/2 times a at its peak, the
    mass slips from w t = -sqrt(2 e) to 2 sqrt(2 e), by 4.5 a (e / w)^2. It is the same from step
    ends that see the excess and from such that do not.
    """
    force, mass, omega = 40.0, 20.0, 2 * np.pi
    system = oscillator(sd.Spring(1e-9), friction(force), *ENGINES[engine], mass=mass)
    slips = []
    for phase in (0.1, 0.7, 1.3, 1.9, 2.5, 3.3):
        sine = sd.Sine(1.0, amplitude=force / mass * (1 + excess), phase=phase)
        # the start leaves a speed that friction takes first
        run = sd.simulate(system, sine, 8.0, settings=sd.Settings(rtol=1e-12), energy_check=False)
        travel = run.relative_displacement.sel(pair="seat-base")
        held = travel.interp(time=np.arange(8.0, 15.0) / 2 - phase / omega)  # between the slips
        slips.append(np.abs(np.diff(held)))
    expected = 4.5 * force / mass * (excess / omega) ** 2
    np.testing.assert_allclose(slips, expected, rtol=3e-3)


CREEPING = {"load": 100.0, "force": 50.0, "mass": 20.0, "stiffness": 1e4}


def creeping(*elements):
    """A preload lets it slip a little less every period, 1/n of the way being left after n."""
    load, force, mass, stiffness = CREEPING.values()
    own = (sd.Spring(stiffness), sd.Damper(600.0), sd.Preload(-load), friction(force))
    return oscillator(*own, *elements, mass=mass)


def test_a_creeping_seat_is_the_same_to_all_engines():
    travels = []
    for elements in ENGINES.values():
        run = sd.simulate(
            creeping(*elements), sd.Sine(5.0, amplitude=1.8), 20.0, energy_check=False
        )
        travels.append(run.relative_displacement.sel(pair="seat-base").values)
    size = np.abs(travels[0]).max()
    for travel in travels[1:]:
        np.testing.assert_allclose(travel, travels[0], atol=1e-7 * size, rtol=0)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    ("frequency", "level", "phase"),
    # the last two begin a period beside the slip and inside it
    [(5.0, 1.8, 0.5), (3.3, 2.1, 0.5), (8.0, 2.4, 0.5), (5.0, 1.8, 5.76), (8.0, 2.4, 4.712389)],
)
def test_a_creeping_seat_is_led_to_where_it_is_held(engine, frequency, level, phase):
    sine = sd.Sine(frequency, amplitude=level, phase=phase)
    state = sd.steady_state(creeping(*ENGINES[engine]), sine)
    assert state.attrs["status"] == "converged"
    assert state.attrs["stable"] == 1
    assert state.attrs["periods"] < 600  # it would be some 1e5 without
    load, force, mass, stiffness = CREEPING.values()
    travel = float(state.relative_displacement.sel(pair="seat-base")[0])
    left = abs(travel - (load - force + mass * level) / stiffness)
    size = float(np.abs(state.displacement.values).max())
    assert left <= state.attrs["error_estimate"] * size <= 1e-4 * size


@pytest.mark.parametrize(
    ("late", "delay"),  # later feedback would shake the bodies on a seat that is held
    [("nothing", 0.0), ("feedback", 0.001), ("Damper", 0.01), ("Spring and Damper", 0.005)],
)
@pytest.mark.parametrize(
    ("body", "frequency", "share", "load"),
    [("ksiazek1997_back_off", 3.7, 0.25, -1.62), ("ksiazek1997_back_on", 4.6, 0.43, 1.24)],
)
def test_a_seat_creeps_to_where_friction_bears_the_rest(body, frequency, share, load, late, delay):
    """Friction bears the load less the spring, and what base and body ask for while it is held."""
    force = 60.0

    def system(*preload):
        return paper_system(friction(force), *preload, body=body, mass=45.0, c=1500.0)

    # what is held sees no force of its suspension
    held = system().delayed(delay, "feedback") if late == "feedback" else system()
    level = share * float(sd.lockup_boundary(held, [frequency]).level[0])
    loaded = system(sd.Preload(-load * force))
    for one in late.split(" and ") if delay else ():
        loaded = loaded.delayed(delay, one)
    state = sd.steady_state(loaded, sd.Sine(frequency, amplitude=level, phase=0.5))
    assert state.attrs["status"] == "converged"
    # the active body bears a part of a constant displacement, too
    k = system().linear.stiffness
    stiffness = k[0, 0] - k[0, 1:] @ np.linalg.solve(k[1:, 1:], k[1:, 0])
    end = force * (load - np.sign(load) * (1.0 - share)) / stiffness
    travel = float(state.relative_displacement.sel(pair="seat-base").mean())
    size = float(np.abs(state.displacement.values).max())
    assert abs(travel - end) <= state.attrs["error_estimate"] * size <= 2e-4 * size


def test_a_seat_that_drifts_to_a_centre_ends_there_in_all_engines():
    """It slips to both sides, a little more to one of them; every period removes the same share."""
    centres = []
    for elements in ENGINES.values():
        system = oscillator(sd.Spring(4.0), friction(3.0), sd.Preload(-1.6), *elements, mass=6.0)
        state = sd.steady_state(system, sd.Sine(2.0, amplitude=0.6, phase=0.1))
        assert state.attrs["error_estimate"] < 1e-8
        centres.append(float(state.relative_displacement.sel(pair="seat-base").mean()))
    np.testing.assert_allclose(centres, 1.6 / 4.0, rtol=1e-6)


@pytest.mark.parametrize("share", [0.99, 1.01])
def test_jumps_that_meet_hold_together(share):
    """At d = 0 and v = 0 a tanh damper and dry friction bear the sum of what each can bear."""
    height, width, force, mass = 20.0, 0.5, 15.0, 30.0
    damper = sd.TanhDamper(100.0, 200.0, height, 50.0, width)
    system = oscillator(sd.Spring(5e3), sd.Damper(300.0), damper, friction(force), mass=mass)
    sine = sd.Sine(6.0, amplitude=share * (height * np.tanh(width) + force) / mass)
    state = sd.steady_state(system, sine, method="hb")
    assert state.attrs["status"] == "converged"
    assert (float(state.amplitude.sel(output="seat-base")) < 1e-12) == (share < 1.0)
    rest = sd.steady_state(system, sine)  # the start alone moves it away from d = 0
    assert rest.attrs["energy_residual"] < 1e-9
