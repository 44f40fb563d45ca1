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


def test_a_creeping_seat_is_led_to_where_it_is_held():
    """A preload lets it slip a little less every period, 1/n of the way being left after n."""
    load, force, mass, level = 100.0, 50.0, 20.0, 1.8
    elements = [sd.Spring(1e4), sd.Damper(600.0), sd.Preload(-load), friction(force)]
    state = sd.steady_state(oscillator(*elements, mass=mass), sd.Sine(5.0, amplitude=level))
    assert state.attrs["status"] == "converged"
    assert state.attrs["periods"] < 50
    travel = float(state.relative_displacement.sel(pair="seat-base")[0])
    assert travel == pytest.approx((load - force + mass * level) / 1e4, rel=1e-3)


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
