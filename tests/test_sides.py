"""The force of a channel beyond the breaks of its laws, one point and eight points at a time."""

from __future__ import annotations

import numba
import numpy as np
import pytest

import seatdyn as sd
from conftest import oscillator
from seatdyn.analysis.run import Problem, Settings
from seatdyn.kernels.sides import channel_force, channel_rows

ELEMENTS = {
    "kink in v": [sd.QuadraticDamper(500.0)],
    "kinks in d": [sd.PiecewiseSpring(1000.0, 0.02, 0.01, jumping=False)],
    "jumps in d": [sd.PiecewiseSpring(1000.0, 0.02, 0.01)],
    "jump in v": [sd.StribeckFriction(40.0, 60.0, 0.05, dry=True)],
    "all of them": [
        sd.AsymmetricDamper(bump=600.0, rebound=200.0),
        sd.PiecewiseSpring(1000.0, 0.02, 0.01),
        sd.StribeckFriction(40.0, 60.0, 0.05, dry=True),
    ],
}


@numba.njit
def by_rows(plant, motion, side, forces):
    channel_rows(plant, 0, motion, side, forces, np.zeros((5, 8)))


@numba.njit
def by_points(plant, motion, side, forces):
    for i in range(8):
        forces[0, i] = channel_force(plant, 0, motion[0, i], motion[1, i], side)


def plant_of(elements):
    """The system as the kernels have it, all its elements in one channel."""
    seat = oscillator(sd.Spring(8000.0), sd.Damper(100.0), *elements)
    return Problem.make(seat, sd.Sine(1.0, amplitude=1.0).motion, Settings()).plant


@pytest.mark.parametrize("name", ELEMENTS)
def test_eight_points_at_once_have_the_force_of_each(name):
    """On all sides of all breaks, on the breaks themselves, and far beyond them."""
    plant = plant_of(ELEMENTS[name])
    rng = np.random.default_rng(1)
    on_breaks = np.array([-0.02, 0.0, 0.01])
    for _ in range(50):
        motion = rng.normal(size=(2, 8)) * [[0.02], [0.3]]
        motion[0, :3], motion[1, 2:5] = on_breaks, 0.0
        side = rng.choice([-1, 1], plant.breaks.shape[0])
        found, expected = np.zeros((1, 8)), np.zeros((1, 8))
        kept = motion.copy()
        by_rows(plant, motion, side, found)
        by_points(plant, motion, side, expected)
        np.testing.assert_allclose(found, expected, rtol=1e-14, atol=1e-11)
        np.testing.assert_array_equal(motion, kept)


def test_beyond_a_break_a_force_is_its_own_reflection():
    """Quadratic damping goes on as the parabola turned about the break: 2 F(0) - F(-v)."""
    plant = plant_of(ELEMENTS["kink in v"])
    v = np.linspace(-0.5, 0.5, 8)
    forces = np.zeros((1, 8))
    by_rows(plant, np.array([np.zeros(8), v]), np.array([1]), forces)
    np.testing.assert_allclose(forces[0], 500.0 * v * np.abs(v), rtol=1e-14)
    plant = plant_of([sd.PiecewiseSpring(1000.0, 0.02, 0.01)])
    d = np.linspace(-0.019, 0.05, 8)
    below = np.where(plant.breaks[:, 2] > 0, -1, 1)  # inside both stops
    by_rows(plant, np.array([d, np.zeros(8)]), below, forces)
    np.testing.assert_array_equal(forces[0], 0.0)  # the free travel goes on
