"""Static equilibrium, ride height, and motion about rest."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import seatdyn as sd

G = 9.80665
STOP = sd.EndStop(60e3, 0.04, 0.05, damping=200.0)
AIR = sd.AirSpring(4.5e5, 4e-3, 8e-4, 1.3, area_slope=-3e-3)


def on(*suspension, mass=56.0, **seat):
    body = sd.SeatedBody("inert", {"seat": mass}, ())
    return sd.SeatSystem(body, sd.Seat(20.0, suspension, **seat))


def rest(system):
    return sd.static_equilibrium(system).isel(pair=0)


def test_linear_spring_with_preload():
    state = rest(on(sd.Spring(9500.0, preload=700.0), STOP))
    travel = (700.0 - 76.0 * G) / 9500.0
    assert float(state.weight) == pytest.approx(76.0 * G)
    assert float(state.travel) == pytest.approx(travel, rel=1e-12)
    assert float(state.stiffness) == pytest.approx(9500.0, rel=1e-8)
    assert float(state.bump_clearance) == pytest.approx(0.04 + travel)
    assert float(state.rebound_clearance) == pytest.approx(0.05 - travel)


def test_air_spring_bears_the_weight_at_the_gas_law():
    """The gauge pressure times the area is the weight."""
    state = rest(on(AIR))

    def push(d):
        volume = 8e-4 + 4e-3 * d - 1.5e-3 * d**2
        return (4.5e5 * (8e-4 / volume) ** 1.3 - 101325.0) * (4e-3 - 3e-3 * d)

    travel = brentq(lambda d: push(d) - 76.0 * G, -0.1, 0.1, xtol=1e-15)
    assert float(state.travel) == pytest.approx(travel, rel=1e-10)
    slope = (push(travel - 1e-6) - push(travel + 1e-6)) / 2e-6
    assert float(state.stiffness) == pytest.approx(slope, rel=1e-6)


@pytest.mark.parametrize("travel", [0.0, -0.012, 0.02])
@pytest.mark.parametrize(
    "spring",
    [sd.Spring(9500.0), AIR, sd.AirSpringWithTank(4.5e5, 4e-3, 8e-4, 2e-3, 1e7, 1.3)],
)
def test_adjusted_seat_rests_where_it_is_wanted(spring, travel):
    table = sd.TableSpring((-0.1, 0.1), (-300.0, 350.0))
    system = sd.adjust_ride_height(on(spring, table, STOP), travel=travel)
    assert float(rest(system).travel) == pytest.approx(travel, abs=1e-12)


def test_adjusted_for_one_and_used_by_another():
    """A stiffer air spring under a heavier person; unadjusted he sinks."""
    light = sd.adjust_ride_height(on(AIR, mass=75.0), mass=50.0)
    assert float(rest(light).travel) < -0.01
    heavy = sd.adjust_ride_height(on(AIR, mass=75.0))
    assert heavy.seat.suspension[0].tangent()[0] > light.seat.suspension[0].tangent()[0]
    assert heavy.seat.suspension[0].load == pytest.approx(95.0 * G)


@pytest.mark.parametrize(
    "spring",
    [
        sd.Spring(9500.0, preload=650.0),
        sd.AirSpring(2.6e5, 4e-3, 8e-4, 1.3, area_slope=-3e-3),
        sd.TableSpring((-0.1, 0.0, 0.1), (-1600.0, -600.0, 100.0)),
        sd.ScissorLever(sd.TableSpring((-0.1, 0.0, 0.1), (-2600.0, -900.0, 100.0)), 0.4, 0.25),
    ],
)
def test_settled_system_moves_as_the_one_with_its_weight(spring):
    """The full system under a constant force m g, from its equilibrium, moves the same."""
    elements = [spring, STOP, sd.QuadraticDamper(300.0), sd.Damper(80.0), sd.Preload(-40.0)]
    system = on(*elements)
    down = float(rest(system).travel)
    assert abs(down) > 1e-3
    base = sd.Sine(1.7, amplitude=2.5)
    moving = sd.simulate(sd.settled(system), base, 2.0)
    # all loads that a law leaves out, and the weight, as one constant force
    shown = 0.0 if isinstance(spring, sd.Spring) else float(spring.force_at(0.0))
    left_out = spring.load + shown
    whole = on(*elements, sd.Preload(76.0 * G - left_out))
    same = sd.simulate(whole, base, 2.0, initial=[down, 0.0])
    travel = moving.relative_displacement[0] + down
    np.testing.assert_allclose(travel, same.relative_displacement[0], atol=2e-7)
    assert float(travel.min()) < -0.04  # the stop is touched where it is
    assert sd.settled(system).seat.suspension[1].bump_clearance == pytest.approx(0.04 + down)


def test_settled_tank_spring_is_the_same_gas():
    tank = sd.AirSpringWithTank(4.5e5, 4e-3, 8e-4, 2e-3, 1e7, 1.3)
    moved = tank.about(-0.02)
    time = np.linspace(0.0, 1.0, 2001)
    d = 0.01 * np.sin(2 * np.pi * 3.0 * time)
    one, other = tank.response(time, d - 0.02), moved.response(time, d)
    np.testing.assert_allclose(other, one - one[0], atol=1e-4)
    assert moved.load == pytest.approx(tank.load - tank.rest_force(-0.02))


def test_cushion_sinks_under_what_is_above_it():
    foam = sd.KelvinVoigt(60e3, 500.0)
    system = on(sd.Spring(9500.0, preload=740.0), cushion=[foam], cushion_mass=1.0)
    state = sd.static_equilibrium(system)
    assert state.pair.values.tolist() == ["seat-base", "seat_surface-seat"]
    np.testing.assert_allclose(state.weight, [77.0 * G, 57.0 * G])
    assert float(state.travel[1]) == pytest.approx(-57.0 * G / 60e3)


def test_refused():
    with pytest.raises(sd.RequestError, match=r"lies in the bump stop of EndStop.*78\.45 mm"):
        sd.static_equilibrium(on(sd.Spring(9500.0), sd.EndStop(1e-3, 0.04, 0.05)))
    with pytest.raises(sd.RequestError, match="do not bear"):
        sd.static_equilibrium(on(sd.Damper(500.0)))
    with pytest.raises(sd.RequestError, match="Name one with element"):
        sd.adjust_ride_height(on(sd.Spring(1e3), sd.Spring(2e3)))
    with pytest.raises(sd.RequestError, match=r"names 0 springs.*'main'"):
        sd.adjust_ride_height(on(sd.Spring(1e3, label="main"), sd.Spring(2e3)), element="man")
    with pytest.raises(sd.ModelError, match="pressure"):
        sd.adjust_ride_height(on(AIR, sd.Spring(1e3, preload=5e3)))
    body = sd.load_body("fairley1989")
    past = sd.Spring(1e3, between=("base", "m1"))
    with pytest.raises(sd.RequestError, match="beside the suspension"):
        sd.static_equilibrium(sd.SeatSystem(body, sd.Seat(20.0, [sd.Spring(1e4)]), [past]))
    with pytest.raises(sd.RequestError, match="from below upwards"):
        sd.static_equilibrium(on(sd.Spring(9e3, between=("seat", "base"))))


def test_named_spring_is_the_one_adjusted():
    system = sd.adjust_ride_height(
        on(sd.Spring(1e3, label="main"), sd.Spring(2e3, label="helper")), element="helper"
    )
    assert [one.load for one in system.seat.suspension] == [0.0, pytest.approx(76.0 * G)]
