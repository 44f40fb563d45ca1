"""Every kind of bad input: refused at once, with a message that says what, where and what now."""

from __future__ import annotations

import re

import numpy as np
import pytest
from typer.testing import CliRunner

import seatdyn as sd
from conftest import paper_system
from seatdyn.app.cli import app

LINK = sd.Link(("seat", "m1"), 1e4, 100.0)
SYSTEM = paper_system()
SINE = sd.Sine(1.0, amplitude=1.0)
GAIN = sd.FeedbackTerm("k1", 10.0, weights={"m1": 1.0})
NO_PERIOD = sd.SineSum([SINE, sd.Sine(2**0.5, amplitude=1.0)])


def body(masses=None, links=(LINK,), feedback=()):
    return sd.SeatedBody("test", {"m1": 10.0} if masses is None else masses, links, feedback)


PYTHON = {
    "negative seat mass": (
        lambda: sd.Seat(-1.0),
        sd.ModelError,
        "Seat.mass = -1 kg is not allowed; it must be a finite number > 0 kg.",
    ),
    "zero body mass": (
        lambda: body({"m1": 0.0}),
        sd.ModelError,
        "SeatedBody('test').masses['m1'] = 0 kg is not allowed; it must be a finite number > 0 kg.",
    ),
    "NaN stiffness": (
        lambda: sd.Spring(np.nan),
        sd.ModelError,
        "Spring.stiffness = nan N/m is not allowed; it must be a finite number >= 0 N/m.",
    ),
    "infinite damping": (
        lambda: sd.Damper(np.inf),
        sd.ModelError,
        "Damper.coefficient = inf N s/m is not allowed; it must be a finite number >= 0 N s/m.",
    ),
    "text instead of a number": (
        lambda: sd.Seat("35"),
        sd.ModelError,
        "Seat.mass = '35' is not a number; it must be a finite number > 0 kg.",
    ),
    "unknown body": (
        lambda: sd.load_body("ksiazek1997_back_of"),
        sd.ModelError,
        "Unknown body 'ksiazek1997_back_of'. Did you mean 'ksiazek1997_back_off' or "
        "'ksiazek1997_back_on'?",
    ),
    "missing body file": (
        lambda: sd.load_body("nowhere.toml"),
        sd.ModelError,
        "Body file 'nowhere.toml' does not exist.",
    ),
    "zero frequency": (
        lambda: sd.Sine(0.0, amplitude=1.0),
        sd.ExcitationError,
        "Sine.frequency = 0 Hz is not allowed; it must be a finite number > 0 Hz. A motion at zero "
        "frequency has no finite displacement.",
    ),
    "both levels": (
        lambda: sd.Sine(1.0, amplitude=1.0, rms=1.0),
        sd.ExcitationError,
        "Sine needs exactly one level, amplitude (m/s2 peak) or rms (m/s2), but both",
    ),
    "no level": (
        lambda: sd.Sine(1.0),
        sd.ExcitationError,
        "Sine needs exactly one level, amplitude (m/s2 peak) or rms (m/s2), but neither",
    ),
    "negative level": (
        lambda: sd.Sine(1.0, rms=-1.0),
        sd.ExcitationError,
        "Sine.rms = -1 m/s2 is not allowed; it must be a finite number >= 0 m/s2.",
    ),
    "negative clearance": (
        lambda: sd.EndStop(1e4, -0.01, 0.01),
        sd.ModelError,
        "EndStop.bump_clearance = -0.01 m is not allowed; it must be a finite number >= 0 m.",
    ),
    "table not monotone": (
        lambda: sd.TableSpring((0.0, 0.02, 0.01), (0.0, 1.0, 2.0)),
        sd.ModelError,
        "TableSpring.displacement must increase from point to point, but point 2 (0.01) does not "
        "exceed point 1 (0.02). Sort the table and average repeated points.",
    ),
    "table with a hole": (
        lambda: sd.TableDamper((0.0, np.nan), (0.0, 1.0)),
        sd.ModelError,
        "TableDamper.velocity[1] = nan is not finite; remove or repair it.",
    ),
    "table of words": (
        lambda: sd.TableSpring(("a", "b"), (0.0, 1.0)),
        sd.ModelError,
        "TableSpring.displacement must be a list of numbers.",
    ),
    "one element, no list": (
        lambda: sd.Seat(35.0, sd.Damper(1.0)),
        sd.ModelError,
        "must be a list of elements, such as [Spring(9950.0), Damper(260.0)].",
    ),
    "no element": (
        lambda: sd.Seat(35.0, [260.0]),
        sd.ModelError,
        "Seat.suspension holds 260.0, which is no element; use Spring, Damper, QuadraticDamper",
    ),
    "unknown node of an element": (
        lambda: paper_system(sd.Spring(1.0, between=("seat", "m11"))),
        sd.ModelError,
        "Spring.between names the unknown node 'm11'. Did you mean 'm1'?",
    ),
    "link of one node": (
        lambda: sd.Link("seat"),
        sd.ModelError,
        "Link.between = 'seat' is not allowed; it must name two different nodes.",
    ),
    "two gains of one name": (
        lambda: body(feedback=[sd.FeedbackForce("m1", "seat", [GAIN, GAIN])]),
        sd.ModelError,
        "SeatedBody('test').feedback uses a gain name twice: ['k1', 'k1'].",
    ),
    "mass without a link": (
        lambda: body({"m1": 10.0, "m2": 5.0}),
        sd.ModelError,
        "SeatedBody('test'): no link leads from the seat to ['m2']; add a Link.",
    ),
    "absurdly long run": (
        lambda: sd.simulate(SYSTEM, SINE, 1e9),
        sd.RequestError,
        "duration = 1e+09 s at output_step = 0.001 s asks for 1e+12 points; at most 2e+07 are "
        "allowed. Shorten the run or lengthen output_step.",
    ),
    "too many steps": (
        lambda: sd.simulate(SYSTEM, SINE, 1e6, output_step=1.0),
        sd.RequestError,
        "duration = 1e+06 s needs more than 1e+07 steps; at most 5000000 are allowed.",
    ),
    "zero duration": (
        lambda: sd.simulate(SYSTEM, SINE, 0.0),
        sd.RequestError,
        "duration = 0 s is not allowed; it must be a finite number > 0 s.",
    ),
    "output step too long": (
        lambda: sd.simulate(SYSTEM, SINE, 1.0, output_step=2.0),
        sd.RequestError,
        "output_step = 2 s exceeds duration = 1 s; make it shorter.",
    ),
    "wrong size of initial state": (
        lambda: sd.simulate(SYSTEM, SINE, 1.0, initial=[0.0, 0.0]),
        sd.RequestError,
        "initial has 2 numbers; it must have 6 finite ones: the displacements (m) of "
        "('seat', 'm1', 'm2'), then their velocities (m/s).",
    ),
    "unknown initial state": (
        lambda: sd.simulate(SYSTEM, SINE, 1.0, initial="Rest"),
        sd.RequestError,
        "initial = 'Rest' is not allowed; use 'rest', 'equilibrium', 'periodic' or an array of 6",
    ),
    "periodic start of an unstable system": (
        lambda: sd.simulate(paper_system(c=5.0), SINE, 1.0, initial="periodic"),
        sd.RequestError,
        "initial = 'periodic' is not possible: The linear system has a pole with non-negative "
        "real part",
    ),
    "steady state without a period": (
        lambda: sd.steady_state(SYSTEM, NO_PERIOD),
        sd.RequestError,
        "SineSum has no period, so there is no periodic steady state; use Sine or",
    ),
    "unknown parameter of a map": (
        lambda: sd.stability_map(SYSTEM, seat_mas=[20.0, 30.0], damping=[100.0]),
        sd.RequestError,
        "This system has no parameter 'seat_mas'. Did you mean 'seat_mass'?",
    ),
    "map of one parameter": (
        lambda: sd.stability_map(SYSTEM, seat_mass=[20.0, 30.0]),
        sd.RequestError,
        "stability_map got 1 parameters (seat_mass); it needs two or three",
    ),
    "range reversed": (
        lambda: sd.critical_values(SYSTEM, vary="damping", low=5.0, high=1.0),
        sd.RequestError,
        "The range of damping from 5 to 1 N s/m is empty; low must be less than high. Exchange",
    ),
    "unknown output": (
        lambda: sd.zeros(SYSTEM, output="m11"),
        sd.RequestError,
        "No free node 'm11' here. Did you mean 'm1'?",
    ),
    "frequency below zero": (
        lambda: sd.frequency_response(SYSTEM, frequency=[1.0, -1.0]),
        sd.RequestError,
        "frequency[1] = -1 Hz is not allowed; it must be a finite number > 0 Hz.",
    ),
    "unknown linearisation": (
        lambda: sd.poles(SYSTEM, linearise="secant"),
        sd.RequestError,
        "linearise = 'secant' is not allowed; use None or 'tangent'.",
    ),
    "parameter of an own law": (
        lambda: sd.force_law({"k3": "N/m3"})(lambda d, v, p: p[0] * d**3)(k=1.0),
        sd.ModelError,
        "has no parameter 'k'. Did you mean 'k3'?",
    ),
}


@pytest.mark.parametrize("kind", PYTHON)
def test_python_api_refuses(kind):
    call, error, message = PYTHON[kind]
    with pytest.raises(error, match=re.escape(message)):
        call()


STEADY = ("steady", "--frequency", "1.5")
RUN = ("simulate", "--frequency", "1", "--rms", "1", "--duration")
MAP = ("stability", "--damping-range", "0", "500", "5", "--seat-mass-range")
COMMANDS = {
    ("poles", "--seat-mass", "-3"): "Seat.mass = -3 kg is not allowed",
    ("poles", "--seat-mass", "nan"): "Seat.mass = nan kg is not allowed",
    ("poles", "--stiffness", "inf"): "Spring.stiffness = inf N/m is not allowed",
    ("poles", "--damping", "-1"): "it must be a finite number >= 0 N s/m",
    ("poles", "--quadratic", "-1"): "QuadraticDamper.coefficient = -1 N s2/m2 is not allowed",
    ("poles", "--seat-mass", "heavy"): "Invalid value for '--seat-mass': 'heavy' is not a number",
    ("poles", "--seat-mas", "3"): "No such option: --seat-mas",
    ("pole",): "No such command 'pole'",
    ("poles", "--body", "ksiazek1997_back_of"): "Did you mean 'ksiazek1997_back_off'",
    ("poles", "--body-alone", "--coulomb", "3"): "--coulomb describes the seat, which --body-alone",
    ("poles", "--coulomb-slope", "9"): "--coulomb-slope has no effect without --coulomb",
    ("poles", "--free-travel", "-1", "1"): "--free-travel has no effect without --end-stop",
    ("poles", "--linearise", "secant"): "'secant' is not one of 'tangent'",
    ("zeros", "--output", "m11"): "No free node 'm11' here. Did you mean 'm1'?",
    ("frf",): "Missing option '--frequency'",
    ("frf", "--frequency", "1", "2"): "Option '--frequency' requires 3 arguments",
    ("frf", "--frequency", "1", "2", "x"): "--frequency: N = 'x' is not a number",
    ("frf", "--frequency", "3", "2", "9"): "START must be less than STOP. Exchange the ends",
    ("frf", "--frequency", "0", "2", "9"): "frequency[0] = 0 Hz is not allowed",
    ("frf", "--frequency", "0", "2", "9", "--log"): "a logarithmic range must start above 0",
    ("frf", "--frequency", "1", "nan", "9"): "both ends of the range must be finite numbers",
    ("frf", "--frequency", "1", "2", "1"): "the number of points must be in 2 .. 1000000",
    (*MAP[:5],): "1 range was given; a map needs two or three",
    (*MAP, "60", "5", "9"): "--seat-mass-range 60 5 9: START must be less than STOP",
    (*MAP, "5", "60", "9.5"): "the number of points must be a whole number",
    (*MAP, "5", "60", "9", "--gain-range", "k1", "0", "1", "2"): "has no parameter 'k1'. Did you",
    (*MAP, "5", "60", "9", "--method", "nyquist"): "use 'hurwitz' or 'poles'",
    ("critical", "--vary", "seat-mas", "--range", "1", "2"): "Did you mean 'seat_mass'?",
    ("critical", "--vary", "damping", "--range", "5", "1"): "Exchange the ends",
    STEADY: "Sine needs exactly one level",
    ("steady", "--rms", "1"): "A base motion is needed: give --frequency in Hz",
    (*STEADY, "--rms", "1", "--amplitude", "1"): "but both",
    ("steady", "--frequency", "0", "--rms", "1"): "Sine.frequency = 0 Hz is not allowed",
    (*STEADY, "--rms", "1", "--end-stop", "1", "--free-travel", "0.01", "-0.02"): (
        "--free-travel 0.01 -0.02 m is not allowed; LOWER must be <= 0 (bump) and UPPER >= 0"
    ),
    (*STEADY, "--rms", "1", "--end-stop", "1", "--free-travel", "0.01", "0.02"): "Check the order",
    (*RUN, "1"): "Missing option '--out'",
    (*RUN, "1e9", "--out", "x.nc"): "asks for 1e+12 points; at most 2e+07 are allowed",
    (*RUN, "1", "--out", "x.csv"): "'x.csv' must end in .nc, not in '.csv'",
    (*RUN, "1", "--out", "nowhere/x.nc"): "The directory 'nowhere' does not exist; create it",
    (*RUN, "1", "--out", "x.nc", "--plot", "x.jpg"): "must end in .png or .svg or .pdf",
    (*RUN, "1", "--out", "file.txt/x.nc"): "'file.txt' is a file, not a directory",
    (*RUN, "1", "--out", "x.nc", "--initial", "Rest"): "use 'rest', 'equilibrium', 'periodic'",
}


@pytest.mark.parametrize("arguments", COMMANDS, ids=" ".join)
def test_command_line_refuses_with_one_message(arguments, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file.txt").write_text("")
    result = CliRunner().invoke(app, [arguments[0], "--json", *arguments[1:]])
    assert result.exit_code == 2, result.output
    assert COMMANDS[arguments] in result.stderr
    assert result.stderr.startswith("error: ")
    assert result.stderr.count("\n") == 1
    assert result.stdout == ""
    assert sorted(file.name for file in tmp_path.iterdir()) == ["file.txt"]


FILES = {
    "": "the field 'name' is missing or misspelt. A body needs name, masses and links.",
    "name = [": "is not valid TOML",
    'name = "x"\nlinks = []': "the field 'masses' is missing or misspelt",
    'name = "x"\nmasses = 3\nlinks = []': "a field that is unknown or of the wrong kind",
    'name = "x"\nmasses = {m1 = 1}\nlinks = [{between = ["seat", "m1"], stifness = 1}]': "stifness",
    'name = "x"\nmasses = {m1 = -1}\nlinks = [{between = ["seat", "m1"]}]': (
        "SeatedBody('x').masses['m1'] = -1 kg is not allowed"
    ),
    'name = "x"\nmasses = {m1 = 1}\nlinks = [{between = ["seat", "m2"]}]': (
        "SeatedBody('x').links names the unknown node 'm2'. Did you mean 'm1'?"
    ),
    'name = "x"\nmasses = {m1 = 1}\nlinks = []': "no link leads from the seat to ['m1']",
}


@pytest.mark.parametrize("content", FILES)
def test_body_files(content, tmp_path):
    path = tmp_path / "body.toml"
    path.write_text(content)
    with pytest.raises(sd.ModelError, match=re.escape(FILES[content])):
        sd.load_body(path)
    result = CliRunner().invoke(app, ["poles", "--body", str(path)])
    assert result.exit_code == 2
    assert FILES[content] in result.stderr


def test_body_file_that_is_not_text(tmp_path):
    path = tmp_path / "body.toml"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(sd.ModelError, match="is not valid TOML"):
        sd.load_body(path)
