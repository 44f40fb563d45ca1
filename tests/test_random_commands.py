"""The commands random and seat-test, their pictures and reports."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from typer.testing import CliRunner

import seatdyn as sd
from conftest import listen, paper_system
from seatdyn.app.cli import app
from seatdyn.output.seat_test import result_rows, verdicts, write_seat_test

NOISE = ("--input", "EM3", "--duration", "20", "--realisations", "4", "--seed", "7")
SHORT = ("--runs", "3", "--duration", "40")
SEAT = sd.Seat(
    20.0,
    [sd.Spring(9500.0), sd.Damper(700.0), sd.EndStop(1e5, 0.03, 0.025)],
    title="A seat with stops",
    source="made up for tests",
)


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    """A working directory with a seat file."""
    sd.save_seat(SEAT, tmp_path / "seat.toml")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def tested():
    return sd.seat_test(SEAT, "EM3", runs=3, duration=40.0)


def run(*arguments, code=0):
    done = CliRunner().invoke(app, [str(a) for a in arguments])
    assert done.exit_code == code, done.output
    return done


def answer(*arguments, code=0):
    return json.loads(run(*arguments, "--json", code=code).stdout)


# ---------------------------------------------------------------- random


def test_random_gives_what_python_gives():
    got = answer("random", *NOISE, "--coulomb", 50)
    motion = sd.RandomMotion(sd.seat_test_input("EM3"), 20.0, seed=7)
    want = sd.random_response(paper_system(sd.CoulombFriction(50.0)), motion, realisations=4)
    assert got["status"] == "ok"
    assert list(got["rms"]) == want.output.values.tolist()
    for name, row in got["rms"].items():
        one = want.sel(output=name)
        assert (row["value"], row["low"], row["high"]) == pytest.approx(
            (float(one.rms), float(one.rms_low), float(one.rms_high)), rel=1e-12
        )
    assert got["unit"]["seat-base"] == "m"
    assert (got["seed"], got["realisations"]) == (7, 4)
    assert got["step_error"] == want.attrs["step_error"] > 0.0
    assert got["settle"] == want.attrs["settle_s"]
    assert got["range"]["F_suspension"]["highest"] > 0.0
    assert got["exact"] is None
    assert got["body"] == "ksiazek1997_back_off"
    assert got["seat"]["mass"] == 35.0
    damper, friction = got["seat"]["elements"][1:]
    assert damper["parameters"] == {"coefficient": {"value": 260.0, "unit": "N s/m"}}
    assert friction["type"] == "CoulombFriction"
    assert friction["between"] == ["base", "seat"]
    assert friction["parameters"]["force"] == {"value": 50.0, "unit": "N"}


def test_linear_answers_hold_the_exact_value():
    got = answer("random", "--input", "EM1", "--duration", 60, "--realisations", 32, "--level", 1.5)
    assert got["input"]["rms"] == pytest.approx(1.5)
    assert got["step_error"] == 0.0
    for name in ("acc_m1", "acc_seat", "seat-base"):
        # within twice the 95 % interval, which 1 of 16,000 misses
        row, exact = got["rms"][name], got["exact"][name]
        assert abs(exact - row["value"]) < row["high"] - row["low"]
    assert "exact" in run("random", *NOISE).stdout


@pytest.mark.parametrize(
    ("options", "rms"),
    [
        (("narrow-band", "--centre", 2, "--bandwidth", 0.3, "--level", 0.7), 0.7),
        (("road-C", "--speed", 10), sd.Road("C", 10.0).acceleration_rms()),
        (("road-C", "--speed", 10, "--level", 2), 2.0),
        (("EM6",), sd.seat_test_input("EM6").acceleration_rms()),
        (("em6",), sd.seat_test_input("EM6").acceleration_rms()),
        (("Road-c", "--speed", 10), sd.Road("C", 10.0).acceleration_rms()),
    ],
)
def test_inputs(options, rms):
    got = answer("random", "--duration", 10, "--realisations", 2, "--input", *options)
    assert got["input"]["rms"] == pytest.approx(rms)
    assert 0.0 < got["input"]["band"][0] < got["input"]["band"][1]
    assert got["rms"]["acc_base"]["value"] == pytest.approx(rms, rel=0.3)


def test_seat_of_a_file_takes_the_place_of_the_options():
    got = answer("random", *NOISE, "--seat", "seat.toml")
    motion = sd.RandomMotion(sd.seat_test_input("EM3"), 20.0, seed=7)
    system = sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), SEAT)
    want = sd.random_response(system, motion, realisations=4)
    assert got["rms"]["acc_seat"]["value"] == pytest.approx(float(want.rms.sel(output="acc_seat")))
    poles = answer("poles", "--seat", "illustrative_suspension", "--linearise", "tangent")
    assert poles["ignored"] == []


def test_random_stops_at_the_interval():
    got = answer("random", "--input", "EM3", "--duration", 60, "--realisations", 500,
                 "--interval", 0.05)  # fmt: skip
    assert got["realisations"] < 500
    rows = [row for row in got["rms"].values() if row["value"] > 0.0]
    assert all(row["high"] - row["low"] < 0.1 * row["value"] * 1.01 for row in rows)


def test_unstable_system_has_no_rms():
    got = answer("random", *NOISE, "--damping", 5, code=3)
    assert got["status"] == "unstable"
    assert got["rms"]["acc_m1"] == {"value": None, "low": None, "high": None}


def test_interrupted_command_goes_on_where_it_was(folder):
    command = [sys.executable, "-m", "seatdyn", "random", "--input", "EM3", "--duration", "120"]
    command += ["--realisations", "4000", "--seed", "3", "--coulomb", "50", "--checkpoint", "a.npz"]
    process = subprocess.Popen(
        command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True, preexec_fn=listen
    )
    file = folder / "a.npz"
    end = time.monotonic() + 120.0
    while not file.exists() and time.monotonic() < end:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode in (130, -signal.SIGINT)
    assert err.endswith("what was finished is in a.npz: the same command goes on from there\n")
    assert "Traceback" not in err
    with np.load(file) as stored:
        finished = stored["blocks"].shape[0]
    assert 1 <= finished < 250
    options = ("--input", "EM3", "--duration", 120, "--seed", 3, "--coulomb", 50)
    before = file.stat().st_mtime_ns
    resumed = answer("random", *options, "--realisations", 16, "--checkpoint", "a.npz")
    assert file.stat().st_mtime_ns == before  # all of it was there
    assert resumed["rms"] == answer("random", *options, "--realisations", 16)["rms"]
    refused = run("random", *NOISE, "--checkpoint", "a.npz", code=2)
    assert "belongs to another request" in refused.stderr


# ---------------------------------------------------------------- seat-test


def test_seat_test_gives_what_python_gives(tested):
    got = answer("seat-test", "--seat", "seat.toml", "--class", "EM3", *SHORT)
    assert got["status"] == "ok"
    assert got["point"] == "seat"
    assert "no certificate" in got["kind"]
    for name in ("light", "heavy"):
        one = tested.sel(occupant=name)
        for factor in ("seat_rms", "seat_vdv"):
            row = got[factor][name]
            want = [float(one[factor + end]) for end in ("", "_low", "_high")]
            assert [row["value"], row["low"], row["high"]] == pytest.approx(want, rel=1e-12)
        for side in ("bump", "rebound"):
            part = one.sel(side=side)
            assert got["travel_max"][name][side] == pytest.approx(float(part.travel_max))
            impacts = got["end_stop_impacts"][name][side]
            assert impacts["count"] == float(part.end_stop_impacts)
            assert impacts["speed"] == pytest.approx(float(part.impact_speed))
            assert impacts["force"] == pytest.approx(float(part.buffer_force))
        assert got["agreement"][name]["agrees"] is bool(one.agrees)
    assert got["limits"]["verified"] is False
    assert got["limits"]["grade"] == "recalled, uncertain"
    assert got["limits"]["seat_factor"] == 1.0
    assert got["damping_test"] is None


def test_occupants_limits_and_damping_test(folder):
    (folder / "mine.toml").write_text(
        'source = "my copy"\ngrade = "read"\nverified = true\n'
        '[classes.EM6]\nmachines = "mine"\nseat_factor = 0.05\nresonance = 9.0\n',
        encoding="utf-8",
    )
    got = answer(
        "seat-test", "--seat", "seat.toml", "--class", "EM6", *SHORT, "--occupant", "me=60",
        "--body", "ksiazek1997_back_off", "--limits", "mine.toml", "--damping-test",
    )  # fmt: skip
    assert list(got["seat_rms"]) == ["me"]
    assert got["sitting_mass"] == {"me": 60.0}
    assert got["limits"]["verified"] is True
    assert got["limits"]["verdict"] == {"seat_factor": {"me": "above"}, "resonance": "below"}
    assert "assumed by seatdyn" in got["scaling"]
    test = got["damping_test"]
    assert 1.0 < test["transmissibility"] < 9.0
    assert test["height"] == pytest.approx(0.4 * 0.055)
    none = answer("seat-test", "--seat", "seat.toml", "--class", "AG1", *SHORT)
    assert none["limits"] is None


def test_occupant_without_a_result_leaves_the_other(folder):
    sd.save_seat(sd.Seat(20.0, [sd.Spring(9500.0), sd.Damper(700.0)]), folder / "light.toml")
    done = run(
        "seat-test", "--seat", "light.toml", "--class", "EM3", *SHORT, "--body",
        "ksiazek1997_back_on", "--json", "--report", "a.html", "--plot", "a.png", code=3,
    )  # fmt: skip
    got = json.loads(done.stdout)
    assert got["status"] == "unstable"
    assert got["occupant_status"] == {"light": "ok", "heavy": "unstable"}
    assert got["seat_rms"]["heavy"]["value"] is None
    assert got["seat_rms"]["light"]["value"] > 0.0
    assert "status unstable" in done.stderr
    assert "unstable" in (folder / "a.html").read_text(encoding="utf-8")


def test_damping_test_is_refused_before_the_long_runs(folder, monkeypatch):
    import seatdyn.analysis.seat_test as module

    sd.save_seat(sd.Seat(20.0, [sd.Spring(9500.0), sd.Damper(700.0)]), folder / "bare.toml")
    monkeypatch.setattr(module, "seat_test", None)  # calling it would be another error
    done = run("seat-test", "--seat", "bare.toml", "--class", "em3", "--damping-test", code=2)
    assert "--travel 0.1" in done.stderr


def test_seat_test_in_words():
    shown = run("seat-test", "--seat", "seat.toml", "--class", "EM3", *SHORT, "--damping-test")
    assert "UNVERIFIED limit of the SEAT factor 1" in shown.stdout
    assert "a simulation, no certificate" in shown.stdout
    assert "seat frame; the seat has no cushion" in shown.stdout
    assert "damping test with 75 kg" in shown.stdout


REFUSED = {
    ("seat-test", "--class", "EM3"): "--seat illustrative_suspension has plausible numbers",
    ("seat-test", "--seat", "seat.toml"): "--class is needed",
    ("seat-test", "--seat", "none.toml", "--class", "EM3"): "'none.toml' does not exist",
    ("seat-test", "--seat", "seat.toml", "--class", "EM33"): "Did you mean 'EM3'",
    ("seat-test", "--seat", "seat.toml", "--class", "EM3", "--runs", "2"): "runs = 2 is not",
    ("seat-test", "--seat", "seat.toml", "--class", "EM3", "--occupant", "60"): "is not NAME=KG",
    ("seat-test", "--seat", "seat.toml", "--class", "EM3", "--occupant", "=60"): "name of its own",
    ("seat-test", "--seat", "seat.toml", "--class", "EM3", "--occupant", "a=9"): "15 .. 200 kg",
    ("seat-test", "--seat", "seat.toml", "--class", "EM3", "--travel", "0.1"): "--damping-test",
    ("seat-test", "--seat", "seat.toml", "--class", "EM3", "--limits", "no.toml"): "cannot be read",
    ("seat-test", "--seat", "seat.toml", "--class", "EM3", "--report", "a.txt"): "end in .html",
    ("random", "--input", "EM3"): "Missing option '--duration'",
    ("random", *NOISE, "--realisations", "x"): "valid integer",
    ("random", *NOISE, "--realisations", "1"): "realisations = 1 is not allowed",
    ("random", *NOISE, "--seed", "-1"): "RandomMotion.seed = -1",
    ("random", *NOISE, "--centre", "2"): "--centre has no effect with --input EM3",
    ("random", *NOISE, "--level", "0"): "level = 0 m/s2 is not allowed",
    ("random", *NOISE, "--input", "EM0"): "no seat-test input class 'EM0'",
    ("random", *NOISE, "--input", "road-C"): "--input road-C needs --speed",
    ("random", *NOISE, "--input", "road-X", "--speed", "3"): "'X' is not allowed",
    ("random", *NOISE, "--input", "narrow-band", "--centre", "2"): "needs --bandwidth, --level",
    ("random", *NOISE, "--checkpoint", "a.txt"): "must end in .npz",
    ("random", *NOISE, "--seat", "seat.toml", "--damping", "3"): "--damping describes a seat",
    ("random", *NOISE, "--plot", "a.txt"): "must end in",
}


@pytest.mark.parametrize("arguments", REFUSED, ids=" ".join)
def test_commands_refuse_with_one_message(arguments):
    done = run(*arguments, "--json", code=2)
    assert REFUSED[arguments] in done.stderr
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1
    assert done.stdout == ""


# ---------------------------------------------------------------- pictures and reports


def test_picture_and_report_of_a_random_response(folder):
    done = run("random", *NOISE, "--coulomb", 50, "--plot", "a.png", "--report", "a.html")
    assert done.stderr.splitlines()[-2:] == ["wrote a.png", "wrote a.html"]
    assert (folder / "a.png").stat().st_size > 20_000
    text = (folder / "a.html").read_text(encoding="utf-8")
    assert "This is a simulation" in text
    assert "data:image/png;base64," in text
    assert 'src="http' not in text
    assert "CoulombFriction(" not in text  # a table, not Python
    assert '<th scope="row">CoulombFriction, base to seat</th><td class="text">force</td>' in text
    assert '<td>50</td><td class="text">N</td>' in text
    figure = sd.plot(
        sd.random_response(
            paper_system(), sd.RandomMotion(sd.seat_test_input("EM3"), 10.0, seed=1), realisations=2
        )
    )
    units = [ax.get_xlabel().rpartition("[")[2] for ax in figure.axes]
    assert units == ["m/s²]", "mm]", "m/s]", "N]"]


def test_picture_of_a_seat_test(tested):
    factors, travel, gain, coherence = sd.plot(tested).axes
    limit = [line for line in factors.lines if line.get_linestyle() == "--"]
    assert [line.get_ydata()[0] for line in limit] == [1.0]
    ends = [bar.get_height() for bar in travel.patches]
    assert sorted(ends) == pytest.approx(
        sorted([*(-1e3 * tested.travel_max.values[:, 0]), *(1e3 * tested.travel_max.values[:, 1])])
    )
    assert len(coherence.lines) == 2
    assert "transmissibility" in gain.get_ylabel()


def test_picture_of_a_damping_test():
    test = sd.damping_test(sd.Seat(20.0, [sd.Spring(9500.0), sd.Damper(900.0)]), travel=0.05)
    (axes,) = sd.plot(test).axes
    marked = axes.lines[1].get_xydata()[0]
    assert marked == pytest.approx(
        [test.attrs["resonance_hz"], test.attrs["transmissibility_at_resonance"]]
    )
    assert "no certificate" in axes.get_title()


def test_report_of_a_seat_test(tested, tmp_path):
    resonance = sd.damping_test(SEAT)
    text = write_seat_test(tested, tmp_path / "a.html", resonance).read_text(encoding="utf-8")
    assert "This is a simulation, and no certificate." in text
    assert "unverified" in text
    assert "A seat with stops" in text
    assert "made up for tests" in text
    assert "EndStop(" not in text
    assert '<td class="text">rebound clearance</td><td>0.025</td><td class="text">m</td>' in text
    assert "as the source means it" in text  # how the body was scaled
    assert text.count("data:image/png;base64,") == 2
    assert 'src="http' not in text
    assert "recalled, uncertain" in text
    assert f"{float(tested.seat_rms[0]):.3f} ±" in text


def test_verdicts_follow_the_interval(tested):
    found = verdicts(tested)["seat_factor"]
    for name, word in found.items():
        one = tested.sel(occupant=name)
        inside = one.seat_rms_low <= 1.0 < one.seat_rms_high
        assert word == ("undecided" if inside else "above" if one.seat_rms > 1.0 else "below")
    assert len(result_rows(tested)[1][1]) == 2
