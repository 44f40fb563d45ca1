"""The study of reaction delay: its verdicts, against linear limits."""

import numpy as np
import pytest

import seatdyn as sd
from seatdyn.output.style import render
from seatdyn.paper.cases import AMPLITUDE, FREQUENCY
from seatdyn.paper.delay_study import (
    BOUNDED,
    GROWS,
    PERIODIC,
    SHOWN,
    from_rest,
    linear_response,
    response,
    system_of,
)
from seatdyn.paper.figures_delay import OWN_FIGURES

SINES = {back_on: sd.Sine(FREQUENCY[back_on], amplitude=AMPLITUDE) for back_on in (False, True)}


def outer_limit(back_on):
    stiffer = system_of(back_on, "linear").seat.suspension[0].stiffness + 1000.0
    seat = sd.Seat(35.0, [sd.Spring(stiffer), sd.Damper(260.0)])
    system = sd.SeatSystem(system_of(back_on, "linear").body, seat)
    return float(sd.delay_margin(system).delay_margin)


@pytest.mark.parametrize("back_on", [False, True])
def test_piecewise_seat_is_lost_where_its_outer_spring_loses_it(back_on):
    limit, system = outer_limit(back_on), system_of(back_on, "gamma")
    below, above = 0.99 * limit, 1.03 * limit
    assert response(system.delayed(below), SINES[back_on], below).kind == PERIODIC
    assert response(system.delayed(above), SINES[back_on], above).kind == GROWS


def test_linear_response_is_the_steady_state():
    system, delay = system_of(True, "linear"), 0.02
    exact = linear_response(system, SINES[True], delay)
    state = sd.steady_state(system.delayed(delay), SINES[True])
    names = [name for name in SHOWN if name != "F_nonlinear"]
    shown = state.amplitude.sel(output=names).values
    assert exact.high[: len(names)] == pytest.approx(shown, rel=1e-7)


def test_bounded_motion_that_is_not_periodic():
    # between its last periodic motion and where it grows, the Coulomb seat wanders
    system = system_of(False, "beta2").delayed(0.02375)
    kind, high, low = from_rest(system, SINES[False])
    assert kind == BOUNDED
    assert np.all(high > low)
    state = sd.steady_state(system, SINES[False], max_periods=200)
    assert state.attrs["status"] == "no_periodic_response"


def test_the_map_is_drawn():
    (figure,) = (figure for figure in OWN_FIGURES if figure.key == "delay_margin")
    png, svg = render(figure.draw)
    assert png.startswith(b"\x89PNG")
    assert b"22.80 ms" in svg
    assert b"26.26 ms" in svg
