"""Measurement files: what is read, and every kind of broken file with its message."""

from __future__ import annotations

import math
import sys
import tracemalloc

import numpy as np
import pytest
from scipy.io import savemat, wavfile

import seatdyn as sd
from seatdyn.signals.files import LARGEST_FILE
from seatdyn.signals.measurement import doubts, require_same_clock
from seatdyn.signals.text import BLOCK

RATE = 100.0
COUNT = 300
ROWS = [(i / RATE, math.sin(0.3 * i), math.cos(0.2 * i)) for i in range(COUNT)]
FLOOR, SEAT = (np.array([row[k] for row in ROWS]) for k in (1, 2))
G = 9.80665


def text(rows=ROWS, head="time,floor,seat", separator=",", point=".", digits=6):
    lines = [head.replace(",", separator)] if head else []
    lines += [
        separator.join(f"{cell:.{digits}f}".replace(".", point) for cell in row) for row in rows
    ]
    return "\n".join(lines) + "\n"


def changed(line, content):
    """The file with one line replaced, counted from 1."""
    lines = text().split("\n")
    lines[line - 1] = content
    return "\n".join(lines)


# ---------------------------------------------------------------- read

LAYOUTS = {
    "comma": (text(), {}),
    "semicolon and decimal comma": (text(separator=";", point=","), {}),
    "tab and decimal comma": (text(separator="\t", point=","), {}),
    "blanks": (text(separator=" "), {}),
    "header as a comment": ("# " + text(), {}),
    "empty lines and comments": (text().replace("\n", "\n\n# remark\n"), {}),
    "separator at the end of lines": (text().replace("\n", ",\n"), {}),
    "quotes": (text(head='"time","floor","seat"'), {}),
    "metadata before the header": ("Logger 7\nrate;100\n\n" + text(separator=";"), {}),
    "units in brackets": (text(head="Time [s],floor [m/s²],seat (m/s^2)"), {}),
    "units in a row of their own": (text(head="time,floor,seat\ns,m/s2,m/s2"), {}),
    "milliseconds": (text([(1e3 * t, a, b) for t, a, b in ROWS], head="t [ms],floor,seat"), {}),
    "a column of dates": (
        "when,floor,seat\n" + "\n".join(f"2024-05-01 10:00,{a:.6f},{b:.6f}" for _, a, b in ROWS),
        {"rate": RATE},
    ),
    "Windows line ends": (text().replace("\n", "\r\n"), {}),
}


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "utf-16"])
def test_layouts_of_text(layout, encoding, tmp_path):
    content, options = LAYOUTS[layout]
    file = tmp_path / "ride.csv"
    file.write_bytes(content.encode(encoding))
    record = sd.read_measurement(file, **options)
    assert list(record.channels) == ["floor", "seat"]
    assert record.rate == pytest.approx(RATE, rel=1e-6)
    np.testing.assert_allclose(record["floor"], FLOOR, atol=1e-6)
    np.testing.assert_allclose(record["seat"], SEAT, atol=1e-6)
    assert record.unit == "m/s2"
    only = sd.read_measurement(file, ["seat"], **options)
    assert list(only.channels) == ["seat"]


def test_decimal_commas_that_begin_after_whole_numbers(tmp_path):
    file = tmp_path / "ride.csv"
    rows = text(separator=";", point=",").splitlines()
    rows[1] = "0;0;0"
    file.write_text("\n".join(rows), encoding="utf-8")
    record = sd.read_measurement(file)
    np.testing.assert_allclose(record["seat"][1:], SEAT[1:], atol=1e-6)


def test_without_header(tmp_path):
    file = tmp_path / "ride.txt"
    file.write_text(text(head=""), encoding="utf-8")
    record = sd.read_measurement(file)  # the first column only increases: it is the time
    assert list(record.channels) == ["2", "3"]
    np.testing.assert_allclose(sd.read_measurement(file, [3], time=1)["3"], SEAT, atol=1e-6)
    file.write_text(text([row[1:] for row in ROWS], head=""), encoding="utf-8")
    record = sd.read_measurement(file, rate=50.0)
    assert list(record.channels) == ["1", "2"]
    assert record.duration == pytest.approx(COUNT / 50.0)
    assert record.start is None


def test_g_becomes_m_per_s2(tmp_path):
    file = tmp_path / "ride.csv"
    file.write_text(text(head="time,floor [g],seat [g]"), encoding="utf-8")
    stated = sd.read_measurement(file)
    assert stated.unit == "g"
    np.testing.assert_allclose(stated["floor"], G * FLOOR, atol=1e-5)
    file.write_text(text(), encoding="utf-8")
    np.testing.assert_allclose(sd.read_measurement(file, unit="g")["floor"], G * FLOOR, atol=1e-5)


def test_clock_start_and_rounded_times(tmp_path):
    """600 Hz with three decimals: steps of 1 and 2 ms are rounding, not gaps."""
    file = tmp_path / "ride.csv"
    rows = [(5.0 + i / 600.0, math.sin(i), 0.0) for i in range(6000)]
    file.write_text(text(rows, digits=3), encoding="utf-8")
    record = sd.read_measurement(file, ["floor"])
    assert record.rate == pytest.approx(600.0, rel=1e-6)
    assert record.start == 5.0
    file.write_text(text(rows[:3000] + rows[3003:], digits=3), encoding="utf-8")
    with pytest.raises(sd.MeasurementError, match=r"has a gap after line 3001 .* missing: 3;"):
        sd.read_measurement(file, ["floor"])


def test_wav(tmp_path):
    file = tmp_path / "ride.wav"
    table = np.column_stack([FLOOR, SEAT])
    wavfile.write(file, int(RATE), table.astype(np.float32))
    np.testing.assert_allclose(sd.read_measurement(file, [2])["2"], SEAT, atol=1e-6)
    for kind, bits in (("int16", 15), ("int32", 31)):
        wavfile.write(file, int(RATE), np.round(table * (2**bits - 1)).astype(kind))
        record = sd.read_measurement(file, full_scale=2.0, unit="g")
        np.testing.assert_allclose(record["1"], 2.0 * G * FLOOR, atol=1e-3)
    wavfile.write(file, int(RATE), np.round(table * 127 + 128).astype("uint8"))
    record = sd.read_measurement(file, full_scale=2.0)
    np.testing.assert_allclose(record["2"], 2.0 * SEAT, atol=0.024)


def test_matlab(tmp_path):
    file = tmp_path / "ride.mat"
    savemat(file, {"acc": np.column_stack([FLOOR, SEAT]), "fs": RATE, "who": "text"})
    record = sd.read_measurement(file)
    assert list(record.channels) == ["acc_1", "acc_2"]
    assert record.rate == RATE
    np.testing.assert_allclose(record["acc_2"], SEAT)
    savemat(
        file,
        {"floor": FLOOR, "t": np.arange(COUNT) / RATE + 3.0, "peaks": [1.0, 2.0], "h": [1j, 2.0]},
    )
    record = sd.read_measurement(file)
    assert list(record.channels) == ["floor"]
    assert record.rate == pytest.approx(RATE)
    assert record.start == 3.0


def test_memory_grows_with_the_channels_asked_for_and_not_with_the_file(tmp_path):
    file = tmp_path / "long.csv"
    row = ",".join(["0.123456"] * 6)
    peaks, counts = [], (2 * BLOCK, 5 * BLOCK)
    for count in counts:
        with file.open("w", encoding="utf-8") as stream:
            stream.write("n," + ",".join("abcdef") + "\n")
            stream.writelines(f"{i},{row}\n" for i in range(count))
        tracemalloc.start()
        record = sd.read_measurement(file, ["n"], rate=1000.0)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert record["n"][-1] == count - 1
    more = (peaks[1] - peaks[0]) / (counts[1] - counts[0])
    assert more < 4 * 8  # bytes a sample, of the 60 in the file


# ---------------------------------------------------------------- broken

BROKEN = {
    "empty": ("", {}, "ride.csv' is empty (0 bytes); was the measurement stored?"),
    "blank": ("\n\n", {}, "is empty; was the measurement stored?"),
    "header only": ("time,floor\n", {}, "has a header and no samples"),
    "text for a sample": (
        changed(151, "1.49,oops,1"), {}, "line 151, column 'floor': 'oops' is not a number. Repair"
    ),
    "no row of numbers": ("a,b\nc,d\ne,f\n", {}, "has no row of numbers in its first 3 lines"),
    "NaN": (changed(151, "1.49,nan,1"), {}, "line 151, column 'floor': nan is no sample. The"),
    "infinite": (changed(9, "0.07,1,-inf"), {}, "line 9, column 'seat': -inf is no sample"),
    "missing sample": (
        changed(151, "1.49,,1"), {}, "line 151, column 'floor' is empty: a sample is missing"
    ),
    "missing first sample": (changed(2, "0.0,,1"), {}, "line 2, column 'floor' is empty"),
    "cut off": (text()[:-12], {}, "line 301 has 2 cells; the columns asked for need 3"),
    "gap": (
        text(ROWS[:100] + ROWS[103:]), {},
        "has a gap after line 101 (t = 0.99 s), samples missing: 3; the step is 0.04 s, elsewhere",
    ),
    "gap of one sample with few digits": (
        text(ROWS[:100] + ROWS[101:], digits=2), {}, "has a gap after line 101 (t = 0.99 s), sam"
    ),
    "gap after empty lines": (
        text(ROWS[:100] + ROWS[103:]).replace("\n0.5", "\n\n0.5"), {}, "a gap after line 111"
    ),
    "two rates": (
        text(ROWS[:100] + ROWS[100::2]), {}, "changes from 100 to 50 Hz after line 102 (t = 1 s)"
    ),
    "two rates, most samples later": (
        text(ROWS[:100:2] + ROWS[100:]), {}, "changes from 50 to 100 Hz after line 52 (t = 1 s)"
    ),
    "time runs backwards": (
        text(ROWS[:100] + ROWS[50:]), {}, "time goes from 0.99 to 0.5 s after line 101. Time must"
    ),
    "a sample twice": (text(ROWS[:100] + ROWS[99:]), {}, "from 0.99 to 0.99 s after line 101"),
    "uneven clock": (
        text([(t * (1 + 0.02 * t), a, b) for t, a, b in ROWS]), {}, "has an uneven clock after line"
    ),
    "wandering clock": (
        text([(t + 0.03 * math.sin(0.3 * t), t, t) for t in np.arange(0, 20, 0.01)], digits=9), {},
        "the instants wander by",
    ),
    "rate against time": (
        text(), {"rate": 200.0}, "has a time column with 100 Hz, but a rate of 200 Hz was given"
    ),
    "no time and no rate": (text(head="when,floor,seat"), {}, "has no time column that could be"),
    "unknown column": (text(), {"columns": ["saet"]}, "no column 'saet'. Did you mean 'seat'?"),
    "number of a column": (
        text(head=""), {"columns": ["seat"], "rate": 1.0}, "has no header, and so no column 'seat'"
    ),
    "a name twice": (
        text(head="time,seat,seat"), {"columns": ["seat"]}, "has 2 columns 'seat'; give the number"
    ),
    "another quantity": (
        text(head="time,floor [V],seat"), {}, "channel 'floor' is in 'V', which is not an accel"
    ),
    "two units": (text(head="time,floor [g],seat [m/s2]"), {}, "has channels in m/s2 and others"),
    "unit against the file": (
        text(head="time,floor [g],seat [g]"), {"unit": "m/s2"}, "says that it is in g, but the uni"
    ),
    "unknown unit": (text(), {"unit": "ft/s2"}, "unit = 'ft/s2' is not allowed; it must be one"),
    "time in another unit": (text(head="time [mm],floor,seat"), {}, "the time column is in 'mm'"),
    "too large numbers": (changed(5, "0.03,1e9,1"), {}, "sample 3 is 1e+09 m/s2, beyond 1e+06"),
    "not text": ("\0\1\2" * 100, {}, "is not a text file"),
    "too short": (text(ROWS[:5]), {}, "has 5 samples; a record must have at least 8"),
    "time as a channel": (text(), {"columns": ["time"]}, "column 'time' is the time, and no accel"),
    "too many cells": (
        changed(150, "1.48,0,5,1"), {}, "line 150 has 4 cells, other lines have 3; which of them"
    ),
    "decimal commas between commas": (
        text().replace(".", ","), {"rate": RATE, "columns": [1]}, "has commas for decimal points"
    ),
    "quoted decimal commas": (
        "seat\n" + "".join(f'"{y:.3f}"\n'.replace(".", ",") for y in SEAT), {"rate": RATE},
        "has commas for decimal points",
    ),
    "only time": ("time\n" + "\n".join(str(i) for i in range(20)), {}, "no channel beside"),
    "full scale of a text": (text(), {"full_scale": 1.0}, "full_scale is for WAV files only"),
}  # fmt: skip


@pytest.mark.parametrize("kind", BROKEN)
def test_broken_file(kind, tmp_path):
    content, options, message = BROKEN[kind]
    file = tmp_path / "ride.csv"
    file.write_text(content, encoding="utf-8")
    with pytest.raises(sd.MeasurementError) as caught:
        sd.read_measurement(file, **options)
    assert message in str(caught.value)


def test_a_file_of_a_gigabyte_is_refused_before_it_is_read(tmp_path):
    file = tmp_path / "huge.csv"
    with file.open("wb") as stream:
        stream.truncate(2**30)
    tracemalloc.start()
    with pytest.raises(sd.MeasurementError, match=r"has 1024 MB; at most 512 MB are read\. Cut it"):
        sd.read_measurement(file)
    assert tracemalloc.get_traced_memory()[1] < 2**20
    tracemalloc.stop()
    assert LARGEST_FILE < 2**30


def test_broken_binary_files(tmp_path):
    wav, mat = tmp_path / "a.wav", tmp_path / "a.mat"
    wav.write_bytes(b"RIFF....nonsense")
    wavfile.write(tmp_path / "cut.wav", 100, np.zeros(500, dtype="float32"))
    (tmp_path / "cut.wav").write_bytes((tmp_path / "cut.wav").read_bytes()[:-999])
    mat.write_bytes(b"nonsense" * 40)
    wavfile.write(tmp_path / "int.wav", 100, np.zeros(50, dtype="int16"))
    savemat(tmp_path / "norate.mat", {"acc": FLOOR})
    savemat(tmp_path / "nothing.mat", {"note": "text"})
    for call, message in (
        (lambda: sd.read_measurement(tmp_path / "cut.wav"), "is cut off; copy it again"),
        (lambda: sd.read_measurement(wav), "is not a readable WAV file"),
        (lambda: sd.read_measurement(mat), "is not a readable MATLAB file"),
        (lambda: sd.read_measurement(tmp_path / "int.wav"), "holds integers (int16); give full_"),
        (lambda: sd.read_measurement(tmp_path / "norate.mat"), "give the rate in Hz"),
        (lambda: sd.read_measurement(tmp_path / "norate.mat", ["acc_9"], rate=1.0), "no channel"),
        (lambda: sd.read_measurement(tmp_path / "nothing.mat"), "holds no vector of numbers"),
        (lambda: sd.read_measurement(tmp_path / "none.csv"), "does not exist or is no file"),
    ):
        with pytest.raises(sd.MeasurementError) as caught:
            call()
        assert message in str(caught.value)


# ---------------------------------------------------------------- doubtful, and clocks

T = np.arange(0.0, 20.0, 0.005)
RIDE = np.sin(2 * np.pi * 2.1 * T) + 0.5 * np.sin(2 * np.pi * 7.3 * T)
DOUBTS = {
    "clipped": (np.clip(RIDE, -0.9, 0.9), "m/s2", "looks clipped"),
    "clipped, few digits": (np.round(np.clip(RIDE, -0.9, 0.9), 3), "m/s2", "looks clipped"),
    "clipped on one side": (np.maximum(RIDE, -0.8), "m/s2", "looks clipped"),
    "gravity of 1 in m/s2": (1.0 + 0.1 * RIDE, "m/s2", "as if it were in g, not in m/s2: its mean"),
    "gravity downwards": (-1.0 + 0.1 * RIDE, "m/s2", "as if it were in g"),
    "gravity of 9.81 in g": (G * (9.81 + RIDE), "g", "as if it were in m/s2, not in g"),
    "25 g": (G * 25.0 * RIDE, "g", "On a seat that is more likely m/s2"),
    "small": (0.1 * RIDE, "m/s2", "only 0.079 m/s2. Were the numbers in g, it would be 0.78 m/s2"),
}


@pytest.mark.parametrize("kind", DOUBTS)
def test_doubts(kind):
    samples, unit, message = DOUBTS[kind]
    (found,) = doubts(samples, "seat", unit)
    assert message in found
    assert "'seat'" in found


def test_no_doubt_about_a_sound_record():
    assert doubts(RIDE, "seat", "m/s2") == []
    assert doubts(G + RIDE, "seat", "m/s2") == []  # gravity in the right unit
    assert doubts(0.1 * G * RIDE, "seat", "g") == []
    slow = np.round(np.sin(2 * np.pi * 0.5 * T), 2)  # flat tops of many samples, by rounding
    assert np.count_nonzero(slow == 1.0) > 50
    assert doubts(slow, "seat", "m/s2") == []


def test_constant_channel_is_refused():
    with pytest.raises(sd.MeasurementError, match=r"Channel 'seat' is constant, 0\.3 m/s2"):
        doubts(np.full(100, 0.3), "seat", "m/s2")


def record(count=COUNT, rate=RATE, start=0.0, source="floor.csv"):
    return sd.Measurement({"a": np.sin(np.arange(count))}, rate, start, source)


CLOCKS = {
    "length": (record(290), "290 and 300 samples"),
    "rate": (record(rate=100.3), "100.3 and 100 Hz, which is 8.94 ms at the end"),
    "start": (record(start=0.02), "starts -20 ms apart"),
}


@pytest.mark.parametrize("kind", CLOCKS)
def test_clocks_that_do_not_agree(kind):
    other, message = CLOCKS[kind]
    with pytest.raises(sd.MeasurementError) as caught:
        require_same_clock(other, record(source="seat.csv"))
    assert "The clocks of floor.csv and seat.csv do not agree" in str(caught.value)
    assert message in str(caught.value)


def test_clocks_that_agree():
    require_same_clock(record(rate=100.05), record(start=None))
    require_same_clock(record(start=0.004), record())


def test_a_measurement_of_channels_of_different_length():
    with pytest.raises(sd.MeasurementError, match="were not sampled together"):
        sd.Measurement({"a": np.zeros(10), "b": np.zeros(11)}, 10.0)
    with pytest.raises(sd.MeasurementError, match="sample 3 is nan, as are 0 others"):
        sd.Measurement({"a": [0.0] * 3 + [math.nan] + [0.0] * 9}, 10.0)
    with pytest.raises(sd.MeasurementError, match="has no channel; give at least one"):
        sd.Measurement({}, 10.0)
    with pytest.raises(sd.MeasurementError, match=r"no channel 'seta'\. Did you mean 'seat'"):
        sd.Measurement({"seat": FLOOR}, 10.0)["seta"]


# ---------------------------------------------------------------- loggers


def write_tdms(file, step=1 / RATE):
    nptdms = pytest.importorskip("nptdms")
    channels = [
        nptdms.ChannelObject("ride", name, values, {"unit_string": "g", "wf_increment": dt})
        for name, values, dt in (("floor", FLOOR, 1 / RATE), ("seat", SEAT, step))
    ]
    with nptdms.TdmsWriter(file) as stream:
        stream.write_segment(channels)


def write_uff(file):
    pyuff = pytest.importorskip("pyuff")
    quantities = ("abscissa", "ordinate", "orddenom", "z_axis")
    exponents = {f"{q}_{e}_unit_exp": 0 for q in quantities for e in ("len", "force", "temp")}
    other = dict.fromkeys(("ver_num", "load_case_id", "rsp_node", "rsp_dir", "ref_node"), 1)
    sets = [
        pyuff.prepare_58(
            func_type=1, id1=name, ref_dir=0, binary=0, ord_data_type=4, abscissa_spacing=1,
            abscissa_inc=1 / RATE, abscissa_min=0.0, z_axis_value=0.0, abscissa_spec_data_type=17,
            ordinate_spec_data_type=12, orddenom_spec_data_type=0, z_axis_spec_data_type=0,
            ordinate_axis_units_lab="g", data=values, x=np.arange(COUNT) / RATE, num_pts=COUNT,
            return_full_dict=True, **exponents, **other,
        )
        for name, values in (("floor", FLOOR), ("seat", SEAT))
    ]  # fmt: skip
    pyuff.UFF(str(file)).write_sets(sets, "overwrite")


def write_mf4(file):
    asammdf = pytest.importorskip("asammdf")
    times = np.arange(COUNT) / RATE
    with asammdf.MDF(version="4.10") as content:
        content.append(
            [
                asammdf.Signal(v, times, name=n, unit="g")
                for n, v in (("floor", FLOOR), ("seat", SEAT))
            ]
        )
        content.save(file, overwrite=True)


@pytest.mark.parametrize(
    ("name", "write"), [("a.tdms", write_tdms), ("a.uff", write_uff), ("a.mf4", write_mf4)]
)
def test_files_of_loggers(name, write, tmp_path):
    """Where the packages are installed; elsewhere these are skipped."""
    file = tmp_path / name
    write(file)
    record = sd.read_measurement(file, ["seat"])
    assert record.rate == pytest.approx(RATE, rel=1e-6)
    assert record.unit == "g"
    np.testing.assert_allclose(record["seat"], G * SEAT, atol=1e-4)
    assert list(sd.read_measurement(file).channels) == ["floor", "seat"]
    file.write_bytes(b"nonsense")
    with pytest.raises(sd.MeasurementError, match=r"cannot be read by|holds no channel"):
        sd.read_measurement(file)


def test_channels_of_a_logger_with_different_rates(tmp_path):
    file = tmp_path / "a.tdms"
    write_tdms(file, step=2 / RATE)
    with pytest.raises(sd.MeasurementError, match="floor 100 Hz from 0 s, seat 50 Hz from 0 s"):
        sd.read_measurement(file)
    assert sd.read_measurement(file, ["seat"]).rate == pytest.approx(50.0)


@pytest.mark.parametrize(("name", "package"), [("a.tdms", "nptdms"), ("a.uff", "pyuff")])
def test_a_package_that_is_missing_is_named(name, package, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)
    (tmp_path / name).write_bytes(b"something")
    with pytest.raises(sd.MeasurementError, match=rf"the package {package} .* `pip install"):
        sd.read_measurement(tmp_path / name)
