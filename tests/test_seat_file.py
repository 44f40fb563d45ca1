"""Seats as files: what is written is read back, and what is wrong is named."""

from __future__ import annotations

import json

import pytest

import seatdyn as sd
from seatdyn.model.description import seat_description
from seatdyn.model.seat_file import KINDS, list_seats, load_seat, save_seat
from seatdyn.output.seat_table import seat_rows
from test_elements import LAWS
from test_memory import LAWS as WITH_STATES

ALL = {**LAWS, **WITH_STATES, "kelvin-voigt": (sd.KelvinVoigt(4e4, 300.0), None)}


@pytest.mark.parametrize("name", [name for name in ALL if name != "user"])
def test_every_element_comes_back_from_a_file(name, tmp_path):
    element = ALL[name][0]
    assert type(element).__name__ in KINDS
    seat = sd.Seat(31.5, [sd.Spring(9950.0, label='"soft" # 1'), element], title="a test")
    save_seat(seat, tmp_path / "seat.toml")
    assert load_seat(tmp_path / "seat.toml") == seat


def test_a_seat_of_the_catalogue_runs():
    assert "illustrative_suspension" in list_seats()
    for name in list_seats():
        seat = load_seat(name)
        assert seat.name == name
        assert seat.source
        system = sd.SeatSystem(sd.load_body("wei1998_1b"), seat)
        run = sd.simulate(system, sd.HalfSineShock(amplitude=15.0, duration=0.05), 1.0)
        assert run.attrs["status"] == "ok"


def test_the_illustrative_seat_is_as_described():
    """Buffers from 40 mm on, about 1 kN at the ends of the travel, resonance near 1.6 Hz."""
    seat = load_seat("illustrative_suspension")
    buffers = seat.suspension[3]
    assert buffers.force_at(0.0399) == 0.0
    assert buffers.force_at(-0.05) == pytest.approx(-1000.0)
    inert = sd.SeatedBody("inert", {"seat": 75.0}, ())
    assert sd.poles(sd.SeatSystem(inert, seat)).f0.item() == pytest.approx(1.6, abs=0.05)


def test_units_of_texts(tmp_path):
    file = tmp_path / "seat.toml"
    file.write_text(
        'mass = "20000 g"\n'
        '[[suspension]]\ntype = "Spring"\nstiffness = "9.5 N/mm"\n'
        '[[suspension]]\ntype = "AirSpring"\npressure = "5 bar"\narea = "50 cm2"\n'
        'volume = "0.8 l"\nexponent = 1.3\nbetween = ["base", "seat"]\n'
    )
    seat = load_seat(file)
    assert seat.mass == pytest.approx(20.0)
    assert seat.suspension[0].stiffness == pytest.approx(9500.0)
    air = seat.suspension[1]
    assert (air.pressure, air.area, air.volume) == pytest.approx((5e5, 5e-3, 8e-4))


SPRING = 'mass = 20.0\n[[suspension]]\ntype = "Spring"\n'
WRONG = {
    "mass = [": "not valid TOML",
    "title = 'x'": "needs a mass",
    "mas = 20.0": "no field 'mas'.*Did you mean 'mass'",
    "mass = '20 kN'": "Seat.mass = '20 kN' is not in a unit that fits; use one of kg, g, t",
    "mass = -1.0": r"Seat.mass = -1 kg is not allowed",
    "mass = 20.0\ntitle = 3": "Seat.title = 3 must be a text",
    "mass = 20.0\nsuspension = 3": "must be a list of tables",
    "mass = 20.0\n[[suspension]]\nstiffness = 1": "suspension 1 needs a type",
    "mass = 20.0\n[[suspension]]\ntype = 'Sprung'": "unknown type 'Sprung'.*'Spring'",
    SPRING: r"suspension 1 \(Spring\) needs stiffness",
    SPRING + "stifness = 1.0": "no parameter 'stifness'.*'stiffness'",
    SPRING + "stiffness = 'stiff'": "'stiff' is not a number with a unit",
    SPRING + "stiffness = '1..2 N/m'": "is not a number with a unit",
    SPRING + "stiffness = -5.0": "Spring.stiffness = -5 N/m is not allowed",
    SPRING + "stiffness = 5.0\nbetween = ['base']": "must name two different nodes",
}


@pytest.mark.parametrize("content", WRONG)
def test_what_is_wrong_in_a_file_is_named(content, tmp_path):
    file = tmp_path / "seat.toml"
    file.write_text(content)
    with pytest.raises(sd.ModelError, match=WRONG[content]) as caught:
        load_seat(file)
    assert "seat.toml" in str(caught.value)


def test_other_refusals(tmp_path):
    with pytest.raises(sd.ModelError, match=r"Unknown seat 'ilustrative_suspension'.*Did you"):
        load_seat("ilustrative_suspension")
    with pytest.raises(sd.ModelError, match="does not exist"):
        load_seat(tmp_path / "none.toml")
    own = sd.Seat(20.0, [LAWS["user"][0]])
    with pytest.raises(sd.ModelError, match="force law of your own"):
        save_seat(own, tmp_path / "own.toml")
    with pytest.raises(sd.ModelError, match=r"ends in '\.toml'"):
        save_seat(own, tmp_path / "own.txt")
    with pytest.raises(sd.OutputError, match="was not written"):
        save_seat(sd.Seat(20.0), tmp_path / "missing" / "seat.toml")


def test_description_has_every_number_with_its_unit():
    """What is behind a lever, a law of one's own, tables, a cushion and delays included."""

    @sd.force_law({"k3": "N/m3"})
    def cubic(d, v, p):
        return p[0] * d**3

    seat = sd.Seat(
        20.0,
        [
            sd.ScissorLever(sd.Damper(900.0), 0.4, 0.25, label="damper"),
            cubic(k3=1e6),
            sd.TableDamper((-1.0, 0.0, 1.0), (-300.0, 0.0, 200.0), delay=0.01),
        ],
        cushion=[sd.Zener(60e3, 30e3, 0.02)],
        cushion_mass=1.0,
    )
    found = seat_description(seat, [*seat.suspension, *seat.cushion])
    lever, own, table, foam = found["elements"]
    assert lever["element"] == "damper"
    assert lever["type"] == "ScissorLever"
    assert lever["parameters"]["Damper: coefficient"] == {"value": 900.0, "unit": "N s/m"}
    assert lever["parameters"]["arm"] == {"value": 0.4, "unit": "m"}
    assert own["parameters"] == {"k3": {"value": 1e6, "unit": "N/m3"}}
    assert table["parameters"]["velocity"]["unit"] == "m/s"
    assert table["parameters"]["delay"] == {"value": 0.01, "unit": "s"}
    assert foam["between"] == ["seat", "seat_surface"]
    rows = seat_rows(json.dumps(found))
    assert ("cushion", "mass", "1", "kg") in rows
    assert ("TableDamper, base to seat", "force", "-300, 0, 200", "N") in rows
