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
