"""The catalogue of bodies: published figures, passivity, support mass, scaling, bad input."""

from __future__ import annotations

import dataclasses
import re
import tomllib
import warnings

import numpy as np
import pytest

import seatdyn as sd
from seatdyn.model import body as body_module
from seatdyn.model.system import linear_model

CATALOGUE = sorted((body_module.Path(body_module.__file__).parent / "catalogue").glob("*.toml"))
BODIES = {name: sd.load_body(name) for name in sd.list_bodies()}
PASSIVE = [name for name, body in BODIES.items() if not body.is_active]
PEOPLE = [name for name in PASSIVE if BODIES[name].group == "vibration"]
ACTIVE = [name for name, body in BODIES.items() if body.is_active]
HIGHEST = 20.0  # Hz, end of the search for peaks

# Sitting mass kg, undamped natural frequencies below 40 Hz, peak of the apparent mass in Hz, kg and
# over the mass, apparent mass at 20 Hz over the mass, phase at 10 Hz in degrees, peak of the
# transmissibility to the head and its frequency: computed apart from seatdyn, as rounded there.
FIGURES = {
    "fairley1989": ("51.60", "5.00", "4.23", "73.8", "1.43", "0.25", "-73", "", ""),
    "wei1998_1b": ("51.20", "5.08", "4.15", "68.5", "1.34", "0.29", "-65", "", ""),
    "wei1998_2b": ("50.80", "5.21, 9.53", "4.59", "77.4", "1.52", "0.25", "-70", "", ""),
    "boileau1998": (
        *("55.20", "5.11, 18.61, 35.42", "4.57", "90.5", "1.64", "0.23", "-90", "1.78", "4.67"),
    ),
    "wan1995": (
        *("60.67", "4.43, 12.40, 19.39, 34.02", "3.68", "79.2", "1.31", "0.24", "-77"),
        *("1.37", "3.98"),
    ),
    "coermann1962": ("56.80", "5.80", "4.21", "66.8", "1.18", "0.51", "-49", "", ""),
    "stech1969_dri": ("34.51", "8.42", "8.06", "85.9", "2.49", "0.31", "-100", "", ""),
}


def agrees(value, printed, units=0.5):
    """Whether a number rounds to the printed one; a printed place of a peak has a grid's error."""
    digits = len(printed.partition(".")[2])
    return abs(value - float(printed)) <= units * 10.0**-digits


def largest(function):
    """Place and size of the largest absolute value of a function of frequencies up to 20 Hz."""
    low, high = 0.5, HIGHEST
    for _ in range(6):
        grid = np.linspace(low, high, 200)
        values = np.abs(function(grid))
        i = int(np.argmax(values))
        low, high = grid[max(i - 1, 0)], grid[min(i + 1, grid.size - 1)]
    return float(grid[i]), float(values[i])


def at_seat(body):
    """Apparent mass of a body as a function of frequencies."""
    return lambda f: sd.frequency_response(body, frequency=f).apparent_mass.values


def at_head(body):
    """Transmissibility to the head as a function of frequencies."""
    return lambda f: (
        sd.frequency_response(body, frequency=f).transmissibility.sel(node=body.head).values
    )


def by_hand(file, node=None):
    """Apparent mass, or motion of a node, as a function of frequencies, from the numbers alone."""
    data = tomllib.loads(file.read_text(encoding="utf-8"))
    nodes = [node for node in data["masses"] if node != "seat"]

    def at(f):
        s = 2j * np.pi * f
        z = np.diag([data["masses"][node] * s**2 for node in nodes]).astype(complex)
        drive = np.zeros(len(nodes), dtype=complex)
        for link in data["links"]:
            k = link["stiffness"] + s * link["damping"]
            ends = [nodes.index(node) if node != "seat" else -1 for node in link["between"]]
            for here, there in (ends, ends[::-1]):
                if here >= 0:
                    z[here, here] += k
                    if there >= 0:
                        z[here, there] -= k
                    else:
                        drive[here] += k
        motion = dict(zip(nodes, np.linalg.solve(z, drive), strict=True)) | {"seat": 1.0 + 0.0j}
        total = sum(data["masses"].get(name, 0.0) * x for name, x in motion.items())
        return motion[node] if node else total

    return np.vectorize(at)


# ---------------------------------------------------------------- the figures of the catalogue


@pytest.mark.parametrize("name", FIGURES)
@pytest.mark.parametrize("way", ["seatdyn", "by hand"])
def test_computed_figures(name, way):
    body = BODIES[name]
    mass, natural, peak_at, peak, ratio, at_20, phase, head, head_at = FIGURES[name]

    file = CATALOGUE[sd.list_bodies().index(name)]
    response = at_seat(body) if way == "seatdyn" else by_hand(file)
    assert agrees(body.total_mass, mass)
    f, size = largest(response)
    assert agrees(f, peak_at, units=1.0)
    assert agrees(size, peak)
    assert agrees(size / body.total_mass, ratio)
    at_10, last = response(np.array([10.0, 20.0]))
    assert agrees(abs(last) / body.total_mass, at_20)
    assert agrees(np.degrees(np.angle(at_10)), phase)
    model = linear_model(body)
    squares = np.linalg.eigvals(np.linalg.solve(model.mass, model.stiffness)).real
    found = [f for f in np.sort(np.sqrt(squares)) / (2 * np.pi) if f < 40.0]
    assert len(found) == len(natural.split(", "))
    assert all(map(agrees, found, natural.split(", ")))
    assert bool(head) == bool(body.head)
    if head:
        f, size = largest(at_head(body) if way == "seatdyn" else by_hand(file, body.head))
        assert agrees(size, head)
        assert agrees(f, head_at, units=1.0)


def test_every_passive_body_has_its_figures():
    assert sorted(FIGURES) == PASSIVE


@pytest.mark.parametrize("name", PEOPLE)
def test_apparent_mass_is_that_of_a_person(name):
    """Largest at 3.5 to 6.5 Hz, 1.15 to 2 times the static mass; the head at 4 Hz, 1.2 to 1.9."""
    body = BODIES[name]
    f, size = largest(at_seat(body))
    assert 3.5 < f < 6.5
    assert 1.15 < size / body.total_mass < 2.0
    if body.head:
        f, size = largest(at_head(body))
        assert 3.5 < f < 6.5
        assert 1.2 < size < 1.9


@pytest.mark.parametrize("name", PASSIVE)
def test_a_body_without_feedback_is_passive_and_weighs_its_mass(name):
    body = BODIES[name]
    response = sd.frequency_response(body, frequency=np.geomspace(0.01, 200.0, 300))
    assert np.all(response.impedance.values.real > 0.0)
    assert sd.active_bands(body, frequency_max=200.0).sizes["band"] == 0
    static = sd.frequency_response(body, frequency=[1e-3]).apparent_mass.item()
    assert static == pytest.approx(body.total_mass, rel=1e-6)
    assert sd.poles(body).attrs["stable"]


@pytest.mark.parametrize("name", ACTIVE)
def test_the_bodies_of_the_paper_are_not_passive(name):
    assert sd.active_bands(BODIES[name]).sizes["band"] > 0


def test_every_file_is_complete_and_honest():
    assert [file.stem for file in CATALOGUE] == sd.list_bodies()
    for name, body in BODIES.items():
        assert body.name == name
        for text in (body.title, body.source, body.posture, body.provenance):
            assert text
        assert body.confidence in ("printed", "high", "medium")
        if body.group == "vibration" and not body.is_active:
            low, high = body.band
            assert low < largest(at_seat(body))[0] < high
        if body.confidence != "printed":
            for kind in ("fitted_to", "links"):
                assert kind in body.provenance


# ---------------------------------------------------------------- mass that moves with the seat


def two_ways():
    """A body with a support mass on a seat, and the same mass as part of the seat."""
    body = BODIES["wei1998_2b"]
    bare = dataclasses.replace(
        body, masses={node: m for node, m in body.masses.items() if node != "seat"}
    )
    elements = [sd.Spring(6000.0), sd.Damper(300.0), sd.QuadraticDamper(150.0)]
    return (
        sd.SeatSystem(body, sd.Seat(20.0, elements)),
        sd.SeatSystem(bare, sd.Seat(20.0 + body.support_mass, elements)),
    )


def test_support_mass_is_mass_of_the_seat_in_every_analysis():
    one, other = two_ways()
    assert one.body.support_mass == 6.7
    assert other.body.support_mass == 0.0
    np.testing.assert_allclose(sd.poles(one).pole, sd.poles(other).pole, rtol=1e-9)
    f = np.geomspace(0.2, 40.0, 50)
    a, b = (sd.frequency_response(system, frequency=f) for system in (one, other))
    for name in ("transmissibility", "apparent_mass", "element_force"):
        np.testing.assert_allclose(a[name], b[name], rtol=1e-9)
    sine = sd.Sine(2.3, amplitude=1.5)
    runs = [sd.simulate(system, sine, duration=3.0, output_step=0.01) for system in (one, other)]
    np.testing.assert_allclose(runs[0].acceleration, runs[1].acceleration, atol=1e-6)
    states = [sd.steady_state(system, sine) for system in (one, other)]
    np.testing.assert_allclose(states[0].amplitude, states[1].amplitude, rtol=1e-6)


def test_support_mass_belongs_to_the_body_where_forces_are_told_apart():
    one, other = two_ways()
    f = np.array([0.5, 2.0, 5.0, 15.0])
    a, b = (sd.frequency_response(system, frequency=f) for system in (one, other))
    np.testing.assert_allclose(a.body_apparent_mass - b.body_apparent_mass, 6.7, rtol=1e-9)
    alone = sd.frequency_response(one.body, frequency=f).apparent_mass
    np.testing.assert_allclose(a.body_apparent_mass, alone, rtol=1e-9)
    sine = sd.Sine(2.3, amplitude=1.5)
    runs = [sd.simulate(system, sine, duration=3.0, output_step=0.01) for system in (one, other)]
    inertia = 6.7 * runs[0].acceleration.sel(node="seat").values
    np.testing.assert_allclose(runs[0].body_force, runs[1].body_force - inertia, atol=1e-4)


# ---------------------------------------------------------------- other sitting masses


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("mass", [40.0, 72.0])
def test_scaling_keeps_poles_and_shapes(name, mass):
    body = BODIES[name]
    other = body.scaled(sitting_mass=mass)
    factor = mass / body.total_mass
    assert other.total_mass == pytest.approx(mass, rel=1e-12)
    np.testing.assert_allclose(sd.poles(other).pole, sd.poles(body).pole, rtol=1e-9)
    f = np.geomspace(0.1, 40.0, 30)
    a, b = (sd.frequency_response(x, frequency=f) for x in (body, other))
    np.testing.assert_allclose(b.transmissibility, a.transmissibility, rtol=1e-9)
    np.testing.assert_allclose(b.apparent_mass, factor * a.apparent_mass, rtol=1e-9)
    assert f"{body.total_mass:g} to {mass:g} kg" in other.provenance["scaling"]
    assert "scaling" not in body.provenance
    assert ("assumed by seatdyn" in other.provenance["scaling"]) == (name != "fairley1989")


def test_fairley_and_griffin_s_rule():
    """0.8837 and 0.1163 of the sitting mass; 5 Hz and a damping ratio of 0.475."""
    heavy = BODIES["fairley1989"].scaled(sitting_mass=72.0)
    assert heavy.masses["m1"] == pytest.approx(0.8837 * 72.0, rel=1e-4)
    assert heavy.masses["seat"] == pytest.approx(0.1163 * 72.0, rel=1e-3)
    assert heavy.links[0].stiffness == pytest.approx(heavy.masses["m1"] * 31.416**2, rel=1e-3)
    c = 2 * 0.475 * 31.416 * heavy.masses["m1"]
    assert heavy.links[0].damping == pytest.approx(c, rel=1e-3)
    assert heavy.subject_mass == pytest.approx(65.0 * 72.0 / 51.6)


def test_scaling_twice_and_back():
    body = BODIES["ksiazek1997_back_on"]
    there = body.scaled(sitting_mass=50.0)
    back = there.scaled(sitting_mass=70.8)
    assert back.masses == pytest.approx(body.masses)
    gains = [[t.gain for force in b.feedback for t in force.terms] for b in (body, back)]
    assert gains[0] == pytest.approx(gains[1])
    assert "; then all masses" in back.provenance["scaling"]


def test_results_carry_the_scaling():
    system = sd.SeatSystem(
        BODIES["ksiazek1997_back_off"].scaled(sitting_mass=50.0), sd.Seat(35.0, [sd.Spring(9950.0)])
    )
    run = sd.simulate(system, sd.Sine(2.0, rms=0.1), duration=0.2)
    assert "assumed by seatdyn" in run.attrs["inputs"]


@pytest.mark.parametrize("mass", [0.0, -1.0, 14.9, 200.1, np.nan, np.inf, "70", None])
def test_sitting_masses_outside_the_range_are_refused(mass):
    with pytest.raises(sd.ModelError, match=r"sitting_mass of SeatedBody\('fairley1989'\)"):
        BODIES["fairley1989"].scaled(sitting_mass=mass)


# ---------------------------------------------------------------- the band of a model

SEAT = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(600.0)])
ABOVE = {
    "body alone": lambda body: sd.frequency_response(body, frequency=[10.5, 30.0]),
    "on a seat": lambda body: sd.frequency_response(sd.SeatSystem(body, SEAT), frequency=[12.0]),
    "in time": lambda body: sd.simulate(
        sd.SeatSystem(body, SEAT), sd.Sine(12.0, rms=0.1), duration=0.1
    ),
    "steady": lambda body: sd.steady_state(sd.SeatSystem(body, SEAT), sd.Sine(12.0, rms=0.1)),
}


@pytest.mark.parametrize("way", ABOVE)
def test_above_its_band_a_body_warns_once_and_by_name(way):
    with pytest.warns(sd.BandWarning) as caught:
        ABOVE[way](BODIES["boileau1998"])
    (warning,) = [w for w in caught if w.category is sd.BandWarning]
    assert "'boileau1998' was made for 0.5 .. 10 Hz; what is asked" in str(warning.message)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ABOVE[way](BODIES["ksiazek1997_back_off"])  # says no band


def test_a_request_that_only_reaches_beyond_the_band_does_not_warn():
    system = sd.SeatSystem(BODIES["boileau1998"], SEAT)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sd.frequency_response(system, frequency=np.geomspace(0.1, 100.0, 20))
        sd.simulate(system, sd.Sine(9.0, rms=0.1), duration=0.1)
        sd.simulate(system, sd.Sine(0.2, rms=0.1), duration=0.1)
        sd.compare_bodies(["boileau1998"], seat=SEAT)


# ---------------------------------------------------------------- bad descriptions

BAD = {
    "subject_mass": (-3.0, "subject_mass = -3 kg is not allowed"),
    "band": ([20.0, 0.5], "band = 20 .. 0.5 Hz is not allowed; the first frequency must be below"),
    "head": ("hat", "head names the unknown node 'hat'"),
    "group": ("fun", "group = 'fun' is not allowed; it must be one of"),
    "confidence": ("sure", "confidence = 'sure' is not allowed"),
    "provenance": ("book", "provenance = 'book' is of the wrong kind"),
}


@pytest.mark.parametrize("field", BAD)
def test_descriptions_are_checked(field):
    value, message = BAD[field]
    with pytest.raises(sd.ModelError, match=re.escape(message)):
        dataclasses.replace(BODIES["fairley1989"], **{field: value})


@pytest.mark.parametrize("band", [5.0, [1.0], [1.0, 2.0, 3.0], "ab", [0.0, 5.0], [1.0, "x"]])
def test_bands_of_the_wrong_kind(band):
    with pytest.raises(sd.ModelError, match="band"):
        dataclasses.replace(BODIES["fairley1989"], band=band)


def test_unknown_fields_of_a_file_are_refused(tmp_path):
    path = tmp_path / "body.toml"
    text = CATALOGUE[sd.list_bodies().index("fairley1989")].read_text(encoding="utf-8")
    path.write_text(text.replace("subject_mass =", "subjekt_mass =", 1))
    message = re.escape("no field 'subjekt_mass'. Did you mean 'subject_mass'?")
    with pytest.raises(sd.ModelError, match=message):
        sd.load_body(path)
