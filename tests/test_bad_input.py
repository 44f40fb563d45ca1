"""Every kind of bad input: refused at once, with a message that says what, where and what now."""

from __future__ import annotations

import re

import numpy as np
import pytest
from typer.testing import CliRunner

import seatdyn as sd
from conftest import oscillator, paper_system
from seatdyn.analysis.transient import check_request
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
        "Seat.mass = -1 kg is not allowed; it must be a number in 1e-06 .. 1e+06 kg.",
    ),
    "zero body mass": (
        lambda: body({"m1": 0.0}),
        sd.ModelError,
        "SeatedBody('test').masses['m1'] = 0 kg is not allowed; it must be a number in 1e-06 ..",
    ),
    "NaN stiffness": (
        lambda: sd.Spring(np.nan),
        sd.ModelError,
        "Spring.stiffness = nan N/m is not allowed; it must be a number in 0 .. 1e+12 N/m.",
    ),
    "infinite damping": (
        lambda: sd.Damper(np.inf),
        sd.ModelError,
        "Damper.coefficient = inf N s/m is not allowed; it must be a number in 0 .. 1e+09 N s/m.",
    ),
    "text instead of a number": (
        lambda: sd.Seat("35"),
        sd.ModelError,
        "Seat.mass = '35' is not a number; it must be a number in 1e-06 .. 1e+06 kg.",
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
        "Sine.frequency = 0 Hz is not allowed; it must be a number in 0.0001 .. 100000 Hz. Towards "
        "zero frequency the displacement has no bound; check the unit.",
    ),
    "both levels": (
        lambda: sd.Sine(1.0, amplitude=1.0, rms=1.0),
        sd.ExcitationError,
        "Sine needs exactly one level, amplitude (m/s2 peak) or rms (m/s2), but both were given; "
        "pass one of them.",
    ),
    "no level": (
        lambda: sd.Sine(1.0),
        sd.ExcitationError,
        "Sine needs exactly one level, amplitude (m/s2 peak) or rms (m/s2), but neither was given; "
        "pass one of them.",
    ),
    "negative level": (
        lambda: sd.Sine(1.0, rms=-1.0),
        sd.ExcitationError,
        "Sine.rms = -1 m/s2 is not allowed; it must be a number in 0 .. 1e+06 m/s2.",
    ),
    "absurdly light seat": (
        lambda: sd.Seat(1e-320),
        sd.ModelError,
        "kg is not allowed; it must be a number in 1e-06 .. 1e+06 kg.",
    ),
    "absurdly stiff spring": (
        lambda: sd.Spring(1e308),
        sd.ModelError,
        "Spring.stiffness = 1e+308 N/m is not allowed; it must be a number in 0 .. 1e+12 N/m.",
    ),
    "absurd damping": (
        lambda: sd.Damper(1e10),
        sd.ModelError,
        "Damper.coefficient = 1e+10 N s/m is not allowed; it must be a number in 0 .. 1e+09 N s/m.",
    ),
    "absurd body mass": (
        lambda: body({"m1": 1e300}),
        sd.ModelError,
        "masses['m1'] = 1e+300 kg is not allowed; it must be a number in 1e-06 .. 1e+06 kg.",
    ),
    "absurd link": (
        lambda: sd.Link(("seat", "m1"), -1e300),
        sd.ModelError,
        "Link.stiffness = -1e+300 N/m is not allowed; it must be a number in -1e+12 .. 1e+12 N/m.",
    ),
    "absurd gain": (
        lambda: sd.FeedbackTerm("k1", 1e300),
        sd.ModelError,
        "FeedbackTerm.gain = 1e+300 N/m or N s/m is not allowed",
    ),
    "absurd weight": (
        lambda: sd.FeedbackTerm("k1", 1.0, weights={"m1": 1e300}),
        sd.ModelError,
        "FeedbackTerm.weights['m1'] of term 'k1' = 1e+300 is not allowed",
    ),
    "absurd preload": (
        lambda: sd.Preload(-1e300),
        sd.ModelError,
        "Preload.force = -1e+300 N is not allowed; it must be a number in -1e+09 .. 1e+09 N.",
    ),
    "absurd polynomial": (
        lambda: sd.PolynomialDamper((0.0, 1e300)),
        sd.ModelError,
        "PolynomialDamper.polynomial[1] = 1e+300 is not allowed",
    ),
    "polynomial that is no list": (
        lambda: sd.PolynomialDamper(3.0),
        sd.ModelError,
        "PolynomialDamper.polynomial = 3.0 must be a list of 1 to 5 numbers.",
    ),
    "integer too large for a float": (
        lambda: sd.Seat(10**400),
        sd.ModelError,
        "Seat.mass = inf kg is not allowed",
    ),
    "table out of range": (
        lambda: sd.TableSpring((0.0, 1e300), (0.0, 1.0)),
        sd.ModelError,
        "TableSpring.displacement[1] = 1e+300 m is not allowed; it must be a number in -1000 ..",
    ),
    "table with a cliff": (
        lambda: sd.TableSpring((0.0, 1e-300), (0.0, 1.0)),
        sd.ModelError,
        "TableSpring.displacement: points 0 and 1 (0 and 1e-300 m) make a slope above 1e+12",
    ),
    "gain with the name of a suspension parameter": (
        lambda: sd.FeedbackTerm("seat_mass", 1.0),
        sd.ModelError,
        "FeedbackTerm.name = 'seat_mass' is not allowed; it must be a text, and not one of "
        "('damping', 'stiffness', 'seat_mass'), which name the suspension. Rename the gain",
    ),
    "node with the name of an acceleration": (
        lambda: body({"acc_seat": 1.0}),
        sd.ModelError,
        "SeatedBody('test').masses['acc_seat']: outputs are named 'acc_...', 'F_...' and 'm2-m1'",
    ),
    "node with the name of a force": (
        lambda: body({"F_damper": 1.0}),
        sd.ModelError,
        "must not contain '-' or begin with 'acc_' or 'F_'; rename the node.",
    ),
    "node with the name of a pair": (
        lambda: body({"seat-base": 1.0}),
        sd.ModelError,
        "must not contain '-' or begin with 'acc_' or 'F_'; rename the node.",
    ),
    "node without a name": (
        lambda: body({"": 1.0}),
        sd.ModelError,
        "SeatedBody('test').masses names a node ''; a name must be a text, such as 'm1'.",
    ),
    "node with the name of the base": (
        lambda: body({"base": 1.0}),
        sd.ModelError,
        "the name 'base' is reserved for the base under the seat; rename the node.",
    ),
    "one link, no list": (
        lambda: body(links=LINK),
        sd.ModelError,
        "is of the wrong kind; it must be a list of Link objects.",
    ),
    "negative clearance": (
        lambda: sd.EndStop(1e4, -0.01, 0.01),
        sd.ModelError,
        "EndStop.bump_clearance = -0.01 m is not allowed; it must be a number in 0 .. 1000 m.",
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
        "duration = 1e+06 s needs about 2e+07 steps or more; at most 5000000 are allowed. Shorten",
    ),
    "too many rows of a ladder, two a step": (
        lambda: sd.simulate(SYSTEM, SINE, 3e5, output_step=1.0),
        sd.RequestError,
        "duration = 300000 s needs about 6e+06 steps or more; at most 5000000 are allowed.",
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
    "initial state of words": (
        lambda: sd.simulate(SYSTEM, SINE, 1.0, initial=["a"] * 6),
        sd.RequestError,
        "initial = ['a', 'a', 'a', 'a', 'a', 'a'] is no list of numbers; it must have 6 finite",
    ),
    "initial displacement out of range": (
        lambda: sd.simulate(SYSTEM, SINE, 1.0, initial=[1e10, 0, 0, 0, 0, 0]),
        sd.RequestError,
        "initial[0] (displacement of 'seat') = 1e+10 m is not allowed; it must be a number in "
        "-1000 .. 1000 m.",
    ),
    "initial velocity out of range": (
        lambda: sd.simulate(SYSTEM, SINE, 1.0, initial=[0, 0, 0, 0, 0, -1e5]),
        sd.RequestError,
        "initial[5] (velocity of 'm2') = -100000 m/s is not allowed; it must be a number in",
    ),
    "no base motion": (
        lambda: sd.simulate(SYSTEM, 3.0, 1.0),
        sd.RequestError,
        "excitation = 3.0 is no base motion; use Sine, SineSum, Step, HalfSineShock, Sweep, Record",
    ),
    "body without a seat": (
        lambda: sd.simulate(body(), SINE, 1.0),
        sd.RequestError,
        "system = test (SeatedBody) is not allowed: simulate needs a SeatSystem, and so does "
        "steady_state; put the body on a Seat: SeatSystem(body, Seat(mass, [...])).",
    ),
    "no settings": (
        lambda: sd.simulate(SYSTEM, SINE, 1.0, settings={"rtol": 1e-6}),
        sd.RequestError,
        "settings = {'rtol': 1e-06} is not allowed; use Settings(rtol=...) or None.",
    ),
    "load without a spring": (
        lambda: sd.simulate(oscillator(sd.Preload(1.0)), sd.Still(), 1.0, initial="equilibrium"),
        sd.RequestError,
        "initial = 'equilibrium' is not possible: no state in which the constant forces are "
        "balanced was found near zero. Start from 'rest' or from an array",
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
    ("poles", "--damping", "-1"): "it must be a number in 0 .. 1e+09 N s/m",
    ("poles", "--quadratic", "-1"): "QuadraticDamper.coefficient = -1 N s2/m2 is not allowed",
    ("poles", "--seat-mass", "heavy"): "Invalid value for '--seat-mass': 'heavy' is not a number",
    ("poles", "--seat-mass", "1e-320"): "it must be a number in 1e-06 .. 1e+06 kg",
    ("poles", "--stiffness", "1e308"): "it must be a number in 0 .. 1e+12 N/m",
    ("poles", "--seat-mass", "3_5"): "'3_5' is not a number; write it like 9950, 0.02 or 1e-3",
    ("frf", "--frequency", "1", "2", "1_0"): "--frequency: N = '1_0' is not a number; write it",
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
    (*STEADY, "--rms", "1", "--amplitude", "1"): "but both were given; pass one of them",
    (*STEADY, "--amplitude", "1_0"): "'1_0' is not a number",
    ("steady", "--frequency", "1e-200", "--rms", "1"): "in 0.0001 .. 100000 Hz",
    ("steady", "--frequency", "1e300", "--rms", "1"): "Sine.frequency = 1e+300 Hz is not allowed",
    (*STEADY, "--rms", "1e300"): "Sine.rms = 1e+300 m/s2 is not allowed",
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
    'name = "x"\nmasses = 3\nlinks = []': "SeatedBody('x').masses = 3 is of the wrong kind",
    'name = "x"\nmasses = [[1]]\nlinks = []': (
        "SeatedBody('x').masses = [[1]] is of the wrong kind; it must map node names to numbers"
    ),
    'name = "x"\nmasses = {m1 = 1}\nlinks = [[1]]': "a field that is unknown or of the wrong kind",
    'name = "x"\nmasses = {m-1 = 1}\nlinks = []': "rename the node",
    'name = "x"\nmasses = {m1 = 1' + 400 * "0" + "}\nlinks = []": (
        "SeatedBody('x').masses['m1'] = inf kg is not allowed"
    ),
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


def test_what_is_asked_of_a_time_run_is_checked_in_one_place():
    check_request(SYSTEM, SINE)
    with pytest.raises(sd.RequestError, match="is no base motion"):
        check_request(SYSTEM, sd.Sine)
    with pytest.raises(sd.RequestError, match="put the body on a Seat"):
        check_request(body(), SINE)


def test_the_limits_themselves_are_allowed():
    for mass, k, c in ((1e-6, 0.0, 0.0), (1e6, 1e12, 1e9)):
        system = paper_system(mass=mass, k=k, c=c)
        assert np.isfinite(sd.poles(system).pole.values).all()


@pytest.mark.parametrize(("load", "carried"), [(130.0, 30.5), (-240.0, -41.0)])
def test_an_equilibrium_inside_a_jump_is_not_refused(load, carried):
    """At d = 0.01 the spring bears 99.5 N, the jump 0 .. 50 N; at -0.02, 199 N and 0 .. 100 N."""
    system = paper_system(sd.PiecewiseSpring(5000.0, 0.02, 0.01), sd.Preload(-load))
    run = sd.simulate(system, sd.Still(), 1.0, initial="equilibrium")
    edge = 0.01 if load > 0.0 else -0.02
    travel = run.relative_displacement.sel(pair="seat-base").values
    np.testing.assert_allclose(travel, edge, atol=1e-12)
    force = run.element_force.sel(element="PiecewiseSpring").values
    np.testing.assert_allclose(force, carried, atol=1e-6)


@pytest.mark.parametrize("load", [50.0, 200.0, -150.0, -400.0])
def test_an_equilibrium_beside_a_jump_stays(load):
    system = paper_system(sd.PiecewiseSpring(5000.0, 0.02, 0.01), sd.Preload(-load))
    run = sd.simulate(system, sd.Still(), 1.0, initial="equilibrium")
    travel = run.relative_displacement.sel(pair="seat-base").values
    stiffness = 9950.0 if -199.0 < load < 99.5 else 14950.0
    np.testing.assert_allclose(travel, load / stiffness, rtol=1e-9)


def test_settings_are_public():
    assert sd.Settings(rtol=1e-6).rtol == 1e-6
