"""Another occupant on the same seat: exact for linear seats, closed forms, refusals."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import seatdyn as sd

F = np.geomspace(0.1, 40.0, 60)
SEAT = sd.Seat(18.0, [sd.Spring(9950.0), sd.Damper(260.0)])
DUMMY = sd.SeatedBody("dummy", {"seat": 75.0}, ())
NAMES = ["ksiazek1997_back_off", "ksiazek1997_back_on", "wei1998_2b", "boileau1998"]


def on_seat(body, seat=SEAT):
    return (
        sd.frequency_response(sd.SeatSystem(body, seat), frequency=F)
        .transmissibility.sel(node="seat")
        .values
    )


def swap(t, before, after, seat_mass=18.0):
    return sd.swap_occupant(t, frequency=F, before=before, after=after, seat_mass=seat_mass)


@pytest.mark.parametrize("names", list(itertools.permutations([*NAMES, "dummy"], 2)), ids="-".join)
def test_prediction_is_the_direct_computation(names):
    before, after = (DUMMY if name == "dummy" else sd.load_body(name) for name in names)
    found = swap(on_seat(before), before, after)
    direct = on_seat(after)
    # at low frequency T is nearly 1, and 1 - 1/T has fewer digits
    np.testing.assert_allclose(found.transmissibility, direct, rtol=1e-10)


def test_stiffness_is_that_of_the_suspension():
    s = 2j * np.pi * F
    body = sd.load_body("wan1995")
    found = swap(on_seat(body), body, DUMMY)
    np.testing.assert_allclose(found.dynamic_stiffness, 9950.0 + 260.0 * s, rtol=1e-9)
    assert found.dynamic_stiffness.units == "N/m"
    assert found.attrs["status"] == "ok"


def test_an_inert_load_on_a_spring_and_damper():
    """T = (k + c s)/(k + c s + m s^2), from one mass to another, by hand."""
    s = 2j * np.pi * F
    k = 30e3 + 400.0 * s
    light, heavy = k / (k + 50.0 * s**2), k / (k + 98.0 * s**2)
    fifty, ninety_eight = np.full(F.size, 50.0 + 0j), np.full(F.size, 98.0 + 0j)
    found = swap(light, fifty, ninety_eight, seat_mass=0.0)
    np.testing.assert_allclose(found.transmissibility, heavy, rtol=1e-11)


def test_measured_masses_and_a_body_may_be_mixed():
    body = sd.load_body("fairley1989")
    masses = sd.frequency_response(body, frequency=F).apparent_mass.values
    one = swap(on_seat(DUMMY), DUMMY, body).transmissibility
    other = swap(on_seat(DUMMY), np.full(F.size, 75.0 + 0j), masses).transmissibility
    np.testing.assert_allclose(one, other, rtol=1e-14)


def test_the_mass_of_the_frame_matters():
    body = sd.load_body("fairley1989")
    wrong = swap(on_seat(DUMMY), DUMMY, body, seat_mass=0.0).transmissibility
    assert abs(wrong - on_seat(body)).max() > 0.1


def test_a_stiff_connection_stays_stiff():
    found = swap(np.ones(F.size, dtype=complex), DUMMY, sd.load_body("wan1995"))
    np.testing.assert_allclose(found.transmissibility, 1.0)


GOOD = {
    "transmissibility": np.full(3, 1.2 + 0.1j),
    "frequency": [1.0, 2.0, 3.0],
    "before": np.full(3, 50.0),
    "after": np.full(3, 80.0 + 1j),
    "seat_mass": 10.0,
}
BAD = {
    "transmissibility has no phase": {"transmissibility": np.full(3, 1.2)},
    r"transmissibility has the shape \(2,\), frequency \(3,\)": {
        "transmissibility": np.full(2, 1j)
    },
    r"transmissibility\[1\] is zero": {"transmissibility": np.array([1j, 0j, 1j])},
    r"transmissibility\[2\] is not finite; leave 3 Hz out": {
        "transmissibility": np.array([1j, 1j, np.nan])
    },
    "frequency": {"frequency": [0.0, 1.0, 2.0]},
    "before = 'fat' is of the wrong kind; give one complex number .*, or a SeatedBody": {
        "before": "fat"
    },
    r"after has the shape \(1,\)": {"after": 75.0},
    r"after\[0\] is not finite": {"after": np.array([np.inf, 1.0, 1.0])},
    "seat_mass = -1 kg": {"seat_mass": -1.0},
    "no mass moves on the seat at 1 Hz": {"before": np.zeros(3), "seat_mass": 0.0},
}


@pytest.mark.parametrize("message", BAD)
def test_what_cannot_be_answered_is_refused(message):
    assert sd.swap_occupant(**GOOD).attrs["status"] == "ok"
    with pytest.raises(sd.RequestError, match=message):
        sd.swap_occupant(**{**GOOD, **BAD[message]})


# ---------------------------------------------------------------- an inert load alone


def test_an_inert_load_has_its_mass_and_no_poles():
    response = sd.frequency_response(DUMMY, frequency=F)
    np.testing.assert_array_equal(response.apparent_mass, 75.0)
    assert sd.is_stable(DUMMY)
    assert sd.is_stable(DUMMY, method="hurwitz")
    assert sd.active_bands(DUMMY).sizes["band"] == 0
    for analysis in (sd.poles, sd.modes):
        with pytest.raises(sd.RequestError, match="No mass moves by itself"):
            analysis(DUMMY)
