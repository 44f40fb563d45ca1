"""Bodies beside each other: the table, the curves, one seat for all, the command, the picture."""

from __future__ import annotations

import dataclasses
import json
import runpy
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import seatdyn as sd
from conftest import OFF, ON
from seatdyn.app.cli import app
from test_docs import same

SEAT = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(600.0)])
DUMMY = sd.SeatedBody("dummy", {"seat": 75.0}, ())
WEAK = sd.Seat(25.0, [sd.Spring(9950.0), sd.Damper(260.0)])  # back-on is unstable on it


def row(data, name):
    return data.sel(body=name)


def test_table_says_what_the_analyses_say():
    data = sd.compare_bodies()
    assert data.body.values.tolist() == sd.list_bodies()
    for name in sd.list_bodies():
        body, one = sd.load_body(name), row(data, name)
        assert one.mass.item() == body.total_mass
        assert one.support_mass.item() == body.support_mass
        assert one.active.item() == body.is_active
        assert (one.group.item(), one.confidence.item()) == (body.group, body.confidence)
        assert one.status.item() == "ok"
        bands = sd.active_bands(body)
        n = bands.sizes["band"]
        np.testing.assert_array_equal(one.active_low.values[:n], bands.low)
        np.testing.assert_array_equal(one.active_high.values[:n], bands.high)
        assert np.isnan(one.active_low.values[n:]).all()
        response = sd.frequency_response(body, frequency=data.frequency)
        np.testing.assert_array_equal(one.apparent_mass, response.apparent_mass)
        fine = sd.frequency_response(body, frequency=np.linspace(0.5, 20.0, 4_000))
        i = int(np.argmax(abs(fine.apparent_mass.values)))
        assert one.apparent_mass_peak.item() == pytest.approx(
            abs(fine.apparent_mass[i]).item(), rel=1e-5
        )
        assert one.apparent_mass_peak_frequency.item() == pytest.approx(
            fine.frequency.values[i], abs=5e-3
        )
        assert np.isnan(one.head_peak.item()) == (not body.head)
        if body.head:
            head = fine.transmissibility.sel(node=body.head)
            assert one.head_peak.item() == pytest.approx(abs(head).max().item(), rel=1e-5)
    assert all("units" in variable.attrs for variable in data.data_vars.values())


def test_natural_frequency_is_that_of_the_slowest_oscillation():
    one_mass = row(sd.compare_bodies(["coermann1962"]), "coermann1962")
    closed_form = np.sqrt(75500.0 / 56.8) / (2 * np.pi)
    assert one_mass.natural_frequency.item() == pytest.approx(closed_form, rel=1e-12)
    overdamped = sd.SeatedBody("slow", {"m": 10.0}, (sd.Link(("seat", "m"), 10.0, 1e3),))
    data = sd.compare_bodies([overdamped, DUMMY])
    assert np.isnan(data.natural_frequency.values).all()
    assert row(data, "dummy").apparent_mass_peak.item() == 75.0


def test_on_one_seat_at_one_sitting_mass():
    data = sd.compare_bodies(sitting_mass=60.0, seat=SEAT)
    np.testing.assert_allclose(data.mass, 60.0)
    for name in sd.list_bodies():
        body = sd.load_body(name).scaled(sitting_mass=60.0)
        direct = sd.frequency_response(sd.SeatSystem(body, SEAT), frequency=data.frequency)
        np.testing.assert_array_equal(
            row(data, body.name).transmissibility, direct.transmissibility.sel(node="seat")
        )
        assert row(data, body.name).scaling.item() == body.provenance["scaling"]


def test_an_unstable_body_has_no_transmissibility():
    data = sd.compare_bodies([OFF, ON], seat=WEAK)
    assert data.status.values.tolist() == ["ok", "unstable"]
    assert np.isfinite(row(data, OFF).transmissibility).all()
    assert np.isnan(row(data, ON).transmissibility).all()


def test_non_linear_elements_are_named_or_linearised():
    seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.CoulombFriction(20.0, 50.0)])
    left_out = sd.compare_bodies(["wei1998_1b"], seat=seat)
    assert json.loads(left_out.attrs["ignored"]) == ["CoulombFriction"]
    tangent = sd.compare_bodies(["wei1998_1b"], seat=seat, linearise="tangent")
    assert json.loads(tangent.attrs["ignored"]) == []
    assert abs(tangent.transmissibility - left_out.transmissibility).max() > 1.0


def test_result_survives_a_file(tmp_path):
    data = sd.compare_bodies([OFF, ON], seat=WEAK, sitting_mass=60.0)
    assert sd.load(sd.save(data, tmp_path / "x.nc")).identical(data)


def test_bad_requests():
    with pytest.raises(sd.RequestError, match="bodies is empty"):
        sd.compare_bodies([])
    with pytest.raises(sd.RequestError, match="'dummy' twice"):
        sd.compare_bodies([DUMMY, dataclasses.replace(DUMMY)])
    with pytest.raises(sd.ModelError, match=r"bodies = .* is of the wrong kind"):
        sd.compare_bodies([DUMMY, 3])
    with pytest.raises(sd.ModelError, match=r"Unknown body 'wan1996'\. Did you mean 'wan1995'"):
        sd.compare_bodies(["wan1996"])
    with pytest.raises(sd.ModelError, match="sitting_mass"):
        sd.compare_bodies([OFF], sitting_mass=5.0)
    with pytest.raises(sd.RequestError, match="linearise = 'tangent' is about the elements"):
        sd.compare_bodies([OFF], linearise="tangent")


@pytest.mark.parametrize("seat", [None, SEAT])
def test_picture(seat, tmp_path):
    figure = sd.plot(sd.compare_bodies(seat=seat), tmp_path / "x.png")
    shown = [ax for ax in figure.axes if ax.axison]
    assert len(shown) == (2 if seat is None else 3)
    assert all("[" in ax.get_ylabel() for ax in shown)
    assert [len(ax.lines) for ax in shown][:2] == [9, 2]
    looks = {
        (line.get_color(), line.get_linestyle(), str(line._dash_pattern)) for line in shown[0].lines
    }
    assert len(looks) == 9
    assert (tmp_path / "x.png").stat().st_size > 10_000


# ---------------------------------------------------------------- the command


def run(*arguments):
    return CliRunner().invoke(app, ["bodies", *map(str, arguments)])


def test_command_gives_the_same_numbers(tmp_path):
    result = run("--compare", "--sitting-mass", 55, "--json", "--plot", tmp_path / "b.png")
    answer = json.loads(result.stdout)
    data = sd.compare_bodies(sitting_mass=55.0)
    assert answer["status"] == "ok"
    assert [one["name"] for one in answer["bodies"]] == data.body.values.tolist()
    for one in answer["bodies"]:
        for key in ("mass", "natural_frequency", "apparent_mass_peak"):
            assert one[key] == row(data, one["name"])[key].item()
    by_name = {one["name"]: one for one in answer["bodies"]}
    assert by_name["wei1998_1b_55kg"]["head_peak"] is None
    assert by_name["wei1998_1b_55kg"]["active_bands"] == []
    assert len(by_name[f"{ON}_55kg"]["active_bands"]) == 2
    assert (tmp_path / "b.png").stat().st_size > 10_000


def test_command_for_people():
    text = run("--compare").stdout
    assert "ksiazek1997_back_off feeds power into its seat: 0 .. 4.544 Hz" in text
    assert text.count("printed") == 2


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--sitting-mass", 55], "error: --sitting-mass has no effect without --compare"),
        (["--plot", "x.png"], "error: --plot has no effect without --compare"),
        (["--compare", "--sitting-mass", 5], "error: sitting_mass of SeatedBody('boileau1998') ="),
        (["--compare", "--plot", "x.txt"], "error: 'x.txt' must end in"),
    ],
)
def test_command_refuses(arguments, message):
    result = run("--json", *arguments)
    assert result.exit_code == 2
    assert result.stderr.startswith(message)
    assert result.stdout == ""


# ---------------------------------------------------------------- SEAT factors


def by_hand(body, seat_mass, k, c, spectrum, points=400_001):
    """SEAT factor by the trapezoidal rule on the equations of one mass on a seat, written out."""
    f = np.linspace(spectrum.low, spectrum.high, points)
    s = 2j * np.pi * f
    link = body.links[0].stiffness + body.links[0].damping * s
    m, support = body.masses["m1"], body.support_mass
    load = support + m * link / (link + m * s**2)  # apparent mass
    t = (k + c * s) / (k + c * s + s**2 * (seat_mass + load))
    base = spectrum.density(f) * abs(sd.weighting("Wk").factor(f)) ** 2
    return np.sqrt(np.trapezoid(base * abs(t) ** 2, f) / np.trapezoid(base, f))


@pytest.mark.parametrize("damping", [5.0, 260.0, 3000.0])
@pytest.mark.parametrize("name", ["EM3", "EM6", "AG1"])
def test_seat_factor_of_one_mass(name, damping):
    body = sd.load_body("fairley1989")
    seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(damping)])
    data = sd.compare_bodies([body], seat=seat, inputs=[name])
    want = by_hand(body, 35.0, 9950.0, damping, sd.seat_test_input(name))
    assert data.seat_factor.item() == pytest.approx(want, rel=1e-6)


def test_seat_factor_of_every_body_is_the_integral_of_its_transmissibility():
    f = np.linspace(0.3, 11.22, 8_001)
    bodies = [body for body in sd.list_bodies() if sd.load_body(body).group == "vibration"]
    data = sd.compare_bodies(bodies, seat=SEAT, inputs=["EM3", "EM1"], frequency=f)
    for name in ("EM3", "EM1"):
        base = sd.seat_test_input(name).density(f) * abs(sd.weighting("Wk").factor(f)) ** 2
        seat = np.trapezoid(base * abs(data.transmissibility.values) ** 2, f)
        want = np.sqrt(seat / np.trapezoid(base, f))
        np.testing.assert_allclose(data.seat_factor.sel(input=name), want, rtol=1e-6)


def test_a_stiff_seat_has_a_seat_factor_of_one():
    rigid = sd.Seat(35.0, [sd.Spring(1e9), sd.Damper(1e5)])
    data = sd.compare_bodies(["fairley1989", OFF], seat=rigid, inputs=["EM3"])
    np.testing.assert_allclose(data.seat_factor, 1.0, atol=1e-3)


def test_seat_factor_does_not_depend_on_the_level_but_on_the_spectrum():
    f = np.geomspace(0.5, 20.0, 50)
    flat = {
        "low": sd.SpectrumTable(f, np.full(50, 0.1)),
        "high": sd.SpectrumTable(f, np.full(50, 9.0)),
    }
    data = sd.compare_bodies(["wan1995"], seat=SEAT, inputs=flat)
    low, high = data.seat_factor.values[0]
    assert low == pytest.approx(high, rel=1e-12)
    assert (
        abs(sd.compare_bodies(["wan1995"], seat=SEAT, inputs=["EM3"]).seat_factor.item() - low)
        > 0.1
    )


def test_no_seat_factor_without_a_steady_state():
    data = sd.compare_bodies([OFF, ON], seat=WEAK, inputs=["EM3"])
    assert np.isfinite(data.seat_factor.sel(body=OFF).item())
    assert np.isnan(data.seat_factor.sel(body=ON).item())


def test_bad_inputs():
    with pytest.raises(sd.RequestError, match="need a seat that they shake"):
        sd.compare_bodies([OFF], inputs=["EM3"])
    with pytest.raises(sd.ExcitationError, match="no seat-test input class 'EM99'"):
        sd.compare_bodies([OFF], seat=SEAT, inputs=["EM99"])
    with pytest.raises(sd.RequestError, match=r"inputs\['x'\] = 3 is no spectrum"):
        sd.compare_bodies([OFF], seat=SEAT, inputs={"x": 3})


# ---------------------------------------------------------------- the page about bodies

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "bodies.md").read_text(encoding="utf-8")


def drawn():
    """The script behind the page."""
    return runpy.run_path(str(ROOT / "docs" / "draw_bodies.py"))


def part(name):
    return PAGE.partition(f"<!-- {name}:begin -->")[2].partition(f"<!-- {name}:end -->")[0]


def test_page_shows_the_catalogue_as_it_is():
    script = drawn()
    text = script["catalogue"](sd.compare_bodies(frequency=script["F"]))
    assert same(part("catalogue"), text)
    for name in sd.list_bodies():
        assert (ROOT / "docs" / "images" / f"body_{name}.png").stat().st_size > 10_000
        assert f"images/body_{name}.png" in text


@pytest.mark.slow
def test_page_shows_seats_as_they_are():
    assert same(part("seats"), drawn()["seats"]())


def test_what_the_page_concludes():
    """The largest differences it names; the rest of its numbers is in its tables."""
    script = drawn()
    factor = script["factor"]
    at = {
        name: factor(OFF, 20e3, 300.0, name) / factor("fairley1989", 20e3, 300.0, name)
        for name in ("EM3", "EM8")
    }
    assert at["EM8"] == pytest.approx(1.45, abs=0.005)
    assert at["EM3"] == pytest.approx(1.39, abs=0.005)
    dampings = np.geomspace(50.0, 10e3, 12)
    assert min(factor(OFF, 9950.0, c, "EM1") for c in dampings) > 1.0
    assert min(factor(ON, 9950.0, c, "EM1") for c in dampings) < 0.97
