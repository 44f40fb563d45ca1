"""Measured records: numbers against known signals, the command, the report, the pictures."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from typer.testing import CliRunner

import seatdyn as sd
from seatdyn.app.cli import app
from seatdyn.output.assessment import write_assessment

RATE, SECONDS = 200.0, 120
COUNT = int(RATE * SECONDS)
T = np.arange(COUNT) / RATE
F = np.fft.rfftfreq(COUNT, 1 / RATE)


def transmissibility(f, f0=1.6, zeta=0.3):
    """An oscillator on a moving base."""
    r = f / f0
    return (1 + 2j * zeta * r) / (1 - r**2 + 2j * zeta * r)


def ride(seed=7, low=1.0, high=12.0, rms=1.5):
    """Floor and seat of a periodic ride: every line of a band alike, the seat exactly known."""
    inside = np.logical_and(low <= F, high >= F)
    phase = np.random.default_rng(seed).uniform(0.0, 2 * np.pi, F.size)
    floor = np.where(inside, np.exp(1j * phase), 0.0)
    scale = rms / np.std(np.fft.irfft(floor, COUNT))
    both = scale * floor, scale * floor * transmissibility(F)
    return tuple(np.fft.irfft(line, COUNT) for line in both), inside


(FLOOR, SEAT), INSIDE = ride()
RECORD = sd.Measurement({"floor": FLOOR, "seat": SEAT}, RATE)


@pytest.fixture(scope="module")
def result():
    return sd.assess(RECORD, {"z": "seat"}, floor={"z": "floor"}, exposure=4 * 3600.0)


def test_weighted_values_and_seat_factor_against_the_spectrum(result):
    """Second way: sums over the lines, without a time signal."""
    weight = np.abs(sd.weighting("Wk").factor(F[INSIDE])) ** 2
    above = np.abs(transmissibility(F[INSIDE])) ** 2
    line = 1.5**2 / np.count_nonzero(INSIDE)
    one = result.sel(axis="z")
    # the filter starts from rest, which costs the first seconds of 120 s
    assert float(one.weighted_rms) == pytest.approx(math.sqrt(line * (weight * above).sum()), 0.005)
    want = math.sqrt((weight * above).sum() / weight.sum())
    assert float(one.seat_rms) == pytest.approx(want, rel=0.005)
    # Gaussian by the number of lines: VDV/(aw T^1/4) near 3^(1/4)
    assert float(one.vdv_ratio) == pytest.approx(3**0.25, rel=0.03)
    assert float(one.seat_vdv) == pytest.approx(want, rel=0.05)


def test_exposure(result):
    one = result.sel(axis="z")
    aw, vdv = float(one.weighted_rms), float(one.vdv)
    assert float(one.a8) == pytest.approx(aw * math.sqrt(0.5), rel=1e-12)
    assert float(one.daily_vdv) == pytest.approx(vdv * (4 * 3600 / SECONDS) ** 0.25, rel=1e-12)
    assert float(one.time_to_action) == pytest.approx(8 * 3600 * (0.5 / aw) ** 2, rel=1e-12)
    assert result.attrs["a8_verdict"] == "below action value"
    assert result.attrs["point"] == "seat surface, between cushion and occupant"
    assert "no certificate" in result.attrs["note"]


def test_transmissibility_and_coherence(result):
    one = result.sel(axis="z", frequency=slice(1.5, 11.5))
    exact = transmissibility(one.frequency.values)
    np.testing.assert_allclose(one.transmissibility.values, exact, rtol=0.08, atol=0.02)
    # near the resonance the segments cut the ringing off
    assert np.all(one.coherence.sel(frequency=slice(3.0, 11.5)).values > 0.99)
    assert np.all(one.random_error.sel(frequency=slice(3.0, 11.5)).values < 0.03)


def test_every_variable_has_a_unit_and_the_result_is_saved_whole(result, tmp_path):
    assert all("units" in variable.attrs for variable in result.data_vars.values())
    file = sd.save(result, tmp_path / "assessed.nc")
    assert sd.load(file).identical(result)


def test_three_axes():
    rng = np.random.default_rng(1)
    channels = {
        name: a * rng.standard_normal(4000) for name, a in zip("abc", (1, 2, 3), strict=True)
    }
    record = sd.Measurement(channels, RATE)
    every = sd.assess(record, {"x": "a", "y": "b", "z": "c"})
    assert every.axis.values.tolist() == ["x", "y", "z"]
    assert json.loads(every.attrs["weightings"]) == {"x": "Wd", "y": "Wd", "z": "Wk"}
    rms = every.weighted_rms.values
    assert every.a8.values == pytest.approx(rms * [1.4, 1.4, 1.0], rel=1e-12)
    assert every.attrs["total_value"] == pytest.approx(np.linalg.norm(rms), rel=1e-12)
    assert every.attrs["worst_axis"] == "z"
    single = sd.assess(sd.Measurement({"c": channels["c"]}, RATE))
    assert float(single.vdv.sel(axis="z")) == float(every.vdv.sel(axis="z"))
    other = sd.assess(single_record(channels["c"]), weightings={"z": "Wb"})
    assert float(other.weighted_rms[0]) == pytest.approx(
        sd.metrics(sd.weighting("Wb").apply(centred(channels["c"]), RATE), RATE).rms
    )


def single_record(samples):
    return sd.Measurement({"c": samples}, RATE)


def centred(samples):
    return samples - samples.mean()


def test_gravity_does_not_count():
    one, other = (sd.assess(single_record(SEAT + g)) for g in (0.0, 9.81))
    assert float(other.weighted_rms[0]) == pytest.approx(float(one.weighted_rms[0]), rel=1e-9)


def test_simulation_beside_measurement(result):
    simulated = sd.assess(
        sd.Measurement({"seat": 2.0 * SEAT, "floor": FLOOR}, RATE),
        {"z": "seat"},
        floor={"z": "floor"},
    )
    beside = sd.compare_bands(result, simulated).sel(axis="z")
    inside = (beside.band > 1.2) & (beside.band < 10.0)
    np.testing.assert_allclose(beside.band_difference[inside], 20 * math.log10(2.0), rtol=1e-9)
    np.testing.assert_allclose(beside.isolation_difference[inside], 20 * math.log10(2.0), rtol=1e-9)
    bands = beside.measured_isolation[inside].values
    exact = [
        np.sqrt(np.mean(np.abs(transmissibility(np.linspace(f * 0.891, f * 1.122, 200))) ** 2))
        for f in beside.band.values[inside]
    ]
    np.testing.assert_allclose(bands, exact, rtol=0.05)
    with pytest.raises(sd.RequestError, match="simulated must be a result of `assess`"):
        sd.compare_bands(result, sd.poles(sd.load_body("ksiazek1997_back_off")))
    sideways = sd.assess(sd.Measurement({"a": SEAT}, RATE), {"x": "a"})
    with pytest.raises(sd.RequestError, match="they must share one"):
        sd.compare_bands(result, sideways)


# ---------------------------------------------------------------- doubts and refusals

LATE = np.roll(SEAT, round(0.8 * RATE))
DRIFTING = np.interp(T * 1.0005, T, SEAT)
DOUBTFUL = {
    "clipped": ({"seat": np.clip(SEAT, -2.0, 2.0)}, {}, RATE, "looks clipped"),
    "in g": ({"seat": SEAT / 9.80665}, {}, RATE, "Were the numbers in g, it would be"),
    "too late": ({"seat": LATE, "floor": FLOOR}, {"floor": {"z": "floor"}}, RATE, "s later, lo"),
    "drifting": (
        {"seat": DRIFTING, "floor": FLOOR}, {"floor": {"z": "floor"}}, RATE, "clocks drift apart"
    ),
    "low rate": ({"seat": SEAT}, {}, 100.0, "nothing above 50 Hz is in it"),
    "short": ({"seat": SEAT[:1000]}, {}, RATE, "lasts 5 s; that is too short"),
    "below a second": ({"seat": SEAT[:100]}, {}, RATE, "lasts 0.5 s, less than the 1 s of the run"),
    "floor is seat": ({"seat": SEAT}, {"floor": {"z": "seat"}}, RATE, "are the same samples"),
}  # fmt: skip


@pytest.mark.parametrize("case", DOUBTFUL)
def test_doubtful_records_are_assessed_with_a_warning(case):
    channels, options, rate, message = DOUBTFUL[case]
    with pytest.warns(sd.MeasurementWarning) as caught:
        data = sd.assess(sd.Measurement(channels, rate), {"z": "seat"}, **options)
    texts = [str(w.message) for w in caught]
    assert any(message in text for text in texts)
    assert json.loads(data.attrs["warnings"]) == texts
    assert float(data.weighted_rms[0]) > 0.0


REFUSED = {
    "which axis": (lambda: sd.assess(RECORD), "has 2 channels (floor, seat); say which one"),
    "axis": (lambda: sd.assess(RECORD, {"w": "seat"}), "axis 'w' is not known; use x, y, z"),
    "no axis": (lambda: sd.assess(RECORD, {}), "seat names no channel"),
    "channel": (lambda: sd.assess(RECORD, {"z": "seta"}), "no channel 'seta'. Did you mean 'seat'"),
    "floor of another axis": (
        lambda: sd.assess(RECORD, {"z": "seat"}, floor={"x": "floor"}), "no channel of axis 'z'"
    ),
    "point": (lambda: sd.assess(RECORD, {"z": "seat"}, point="head"), "point = 'head' is not"),
    "exposure": (
        lambda: sd.assess(RECORD, {"z": "seat"}, exposure=90_000.0), "exposure = 90000 s is not"
    ),
    "weighting": (
        lambda: sd.assess(RECORD, {"z": "seat"}, weightings={"z": "Wq"}), "no weighting 'Wq'"
    ),
    "dead channel": (
        lambda: sd.assess(sd.Measurement({"seat": np.zeros(500)}, RATE)), "is constant, 0 m/s2"
    ),
    "time in ms": (
        lambda: sd.assess(sd.Measurement({"seat": SEAT}, 0.2)), "has 0.2 samples per second; to be"
    ),
    "clocks": (
        lambda: sd.assess(
            sd.Measurement({"seat": SEAT}, RATE), floor={"z": "floor"},
            floor_record=sd.Measurement({"floor": FLOOR}, 200.1),
        ),
        "do not agree: 200.1 and 200 Hz",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_refused(case):
    call, message = REFUSED[case]
    with pytest.raises(sd.SeatdynError) as caught:
        call()
    assert message in str(caught.value)


# ---------------------------------------------------------------- command, report, pictures


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    columns = {"ride.csv": [T, FLOOR / 9.80665, SEAT / 9.80665], "seat.csv": [T, SEAT]}
    for name, values in columns.items():
        head = "time,floor,seat" if len(values) == 3 else "time,seat"
        np.savetxt(name, np.column_stack(values), delimiter=",", header=head, comments="")
    instants = (0, 1, 2, *range(9, 20))
    (tmp_path / "gap.csv").write_text("time,a\n" + "".join(f"{i},1\n" for i in instants))
    return tmp_path


def run(*arguments, code=0):
    done = CliRunner().invoke(app, [str(a) for a in arguments])
    assert done.exit_code == code, done.output
    return done


BOTH = ("assess", "ride.csv", "--axis", "z", "--column", "seat", "--floor-column", "floor")


def test_command_gives_what_python_gives(folder, result):
    done = run(*BOTH, "--unit", "g", "--exposure-time", 4, "--json")
    got = json.loads(done.stdout)
    assert done.stderr == ""
    one = result.sel(axis="z")
    names = [
        *("weighted_rms", "vdv", "mtvv", "crest_factor", "evdv", "a8", "daily_vdv", "seat_rms"),
        *("seat_vdv", "floor_weighted_rms", "peak"),
    ]
    for name in names:
        assert got[name] == pytest.approx(float(one[name]), rel=1e-6), name
    assert got["status"] == "ok"
    assert got["weighting"] == "Wk"
    assert got["exposure_time"] == 4.0
    assert got["unit"] == "g"
    assert got["warnings"] == []
    assert got["point"] == "seat surface, between cushion and occupant"
    h = got["transmissibility"]
    assert len(h["frequency"]) == len(h["coherence"]) == len(h["magnitude"])
    assert max(h["frequency"]) <= 80.0
    # a floor in a file of its own
    other = json.loads(
        run("assess", "ride.csv", "--column", "seat", "--floor-file", "ride.csv", "--floor-column",
            "floor", "--unit", "g", "--json").stdout
    )  # fmt: skip
    assert other["seat_rms"] == got["seat_rms"]


def test_command_without_floor(folder):
    got = json.loads(run("assess", "seat.csv", "--json").stdout)
    assert got["seat_rms"] is None
    assert "transmissibility" not in got
    shown = run("assess", "seat.csv").stdout
    assert "weighted rms" in shown
    assert "no certificate" in shown


def test_a_warning_goes_to_standard_error(folder):
    done = run(*BOTH, "--json")  # g taken for m/s2
    assert done.stderr.startswith("warning: Channel ")
    assert "in g" in json.loads(done.stdout)["warnings"][0]


COMMANDS = {
    ("assess", "gap.csv"): "has a gap after line 4 (t = 2 s), samples missing: 6",
    ("assess", "none.csv"): "'none.csv' does not exist",
    ("assess", "ride.csv"): "has the channels floor, seat; choose one with --column",
    ("assess", "ride.csv", "--floor-column", "floor"): "--floor-column needs --column",
    ("assess", "ride.csv", "--column", "saet"): "Did you mean 'seat'?",
    ("assess", "seat.csv", "--floor-file", "ride.csv"): "--floor-file needs --floor-column",
    ("assess", "seat.csv", "--unit", "ft"): "'ft' is not one of 'm/s2', 'g'",
    ("assess", "seat.csv", "--rate", "100"): "has a time column with 200 Hz, but a rate of 100 Hz",
    ("assess", "seat.csv", "--column", "time"): "column 'time' is the time, and no acceleration",
    ("assess", "seat.csv", "--axis", "w"): "'w' is not one of 'x', 'y', 'z'",
    ("assess", "seat.csv", "--report", "a.txt"): "must end in .html",
    ("assess", "seat.csv", "--exposure-time", "30"): "--exposure-time = 30 h is not allowed",
    ("weighting", "Wx", "1"): "There is no weighting 'Wx'",
    ("weighting", "Wk", "one"): "HZ = 'one' is not a number",
    ("weighting", "Wk", "1e999"): "frequency = inf Hz is not allowed",
}


@pytest.mark.parametrize("arguments", COMMANDS, ids=" ".join)
def test_command_refuses_with_one_message(folder, arguments):
    done = run(*arguments, "--json", code=2)
    assert COMMANDS[arguments] in done.stderr
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1
    assert done.stdout == ""


def test_weighting_command(folder):
    got = json.loads(run("weighting", "wk", 1, 4, 16, "--json", "--plot", "wk.png").stdout)
    assert (folder / "wk.png").read_bytes().startswith(b"\x89PNG")
    value = sd.weighting("Wk").factor([1.0, 4.0, 16.0])
    assert got["frequency"] == [1.0, 4.0, 16.0]
    np.testing.assert_allclose(got["factor"], np.abs(value), rtol=1e-12)
    np.testing.assert_allclose(got["phase"], np.degrees(np.angle(value)), rtol=1e-12)
    shown = run("weighting", "Wd", 10).stdout
    assert "0.2017" in shown or "0.201" in shown


def test_report_stands_alone_and_is_no_certificate(folder):
    done = run(*BOTH, "--unit", "g", "--report", "report.html", "--plot", "picture.png")
    assert "wrote report.html" in done.stderr
    text = (folder / "report.html").read_text(encoding="utf-8")
    assert "This is no certificate." in text
    assert "data:image/png;base64," in text
    assert 'src="http' not in text
    assert "recalled, uncertain" in text
    assert "seat surface, between cushion and occupant" in text
    assert (folder / "picture.png").stat().st_size > 20_000


def test_report_names_the_doubts(tmp_path):
    with pytest.warns(sd.MeasurementWarning):
        data = sd.assess(sd.Measurement({"seat": np.clip(SEAT, -2.0, 2.0)}, RATE))
    file = write_assessment(data, tmp_path / "a.html")
    assert "looks clipped" in file.read_text(encoding="utf-8")


def test_pictures(result):
    figure = sd.plot(result)
    assert len(figure.axes) == 3
    assert "SEAT factor" in figure.axes[2].get_title()
    assert len(sd.plot(sd.compare_bands(result, result)).axes) == 2
    frame = sd.assess(RECORD, {"z": "seat"}, floor={"z": "floor"}, point="seat_frame")
    assert "SEAT" not in sd.plot(frame).axes[2].get_title()
