"""Results on disk: nothing lost, nothing half written."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr

import seatdyn as sd
from conftest import paper_system

SINE = sd.Sine(1.55, amplitude=0.8857)
SYSTEM = paper_system(sd.QuadraticDamper(100.0))
RESULTS = {
    "poles": lambda: sd.poles(SYSTEM),
    "modes": lambda: sd.modes(SYSTEM),
    "zeros": lambda: sd.zeros(SYSTEM, output="m1"),
    "frequency response": lambda: sd.frequency_response(SYSTEM, frequency=[1.0, 2.0]),
    "no active bands": lambda: sd.active_bands(
        sd.SeatedBody("passive", {"m": 50.0}, [sd.Link(("seat", "m"), 1e4, 100.0)])
    ),
    "map": lambda: sd.stability_map(SYSTEM, seat_mass=[20.0, 30.0], damping=[0.0, 9.0, 99.0]),
    "boundary": lambda: sd.stability_boundary(SYSTEM, frequency=[1.0, 2.0]),
    "critical": lambda: sd.critical_values(SYSTEM, vary="damping", low=0.0, high=1e3),
    "time history": lambda: sd.simulate(SYSTEM, SINE, 1.0),
    "steady state": lambda: sd.steady_state(SYSTEM, SINE),
    "no steady state": lambda: sd.steady_state(paper_system(c=5.0), SINE),
}


def assert_same(got, want):
    """Identical to the last bit: values, types, order, attributes."""
    xr.testing.assert_identical(got, want)
    assert list(got.variables) == list(want.variables)
    for name, variable in want.variables.items():
        assert got[name].dtype == variable.dtype
        assert got[name].values.tobytes() == variable.values.tobytes()
    for owner in (want, *want.variables.values()):
        assert all(type(value) is not np.ndarray for value in owner.attrs.values())
    assert {k: type(v) for k, v in got.attrs.items()} == {k: type(v) for k, v in want.attrs.items()}


@pytest.mark.parametrize("kind", RESULTS)
def test_every_result_comes_back_identical(kind, tmp_path):
    data = RESULTS[kind]()
    assert_same(sd.load(sd.save(data, tmp_path / "x.nc")), data)


def test_values_and_attributes_that_netcdf_does_not_have(tmp_path):
    attrs = {
        "yes": True, "nothing": None, "nested": {"a": [1, None, {"b": False}]}, "empty": "",
        "nan": float("nan"), "count": 3, "huge": 10**30, "list": [1, 2.5], "greek": "ζ = 0.1",
        "no": False, "json": '{"a": 1}',
    }  # fmt: skip
    data = xr.Dataset(
        {
            "z": ("x", np.array([1 + 2j, complex(np.nan, -0.0), complex(-np.inf, 0.0)]), attrs),
            "z32": ("x", np.array([1j, 2, 3], dtype=np.complex64)),
            "scalar": ((), 2.5),
            "count": ("x", np.array([1, 2, 3], dtype=np.int32)),
            "flag": (("x", "y"), np.array([[True, False]] * 3)),
            "word": ("y", np.array(["ä", "longer text"])),
        },
        coords={"x": [0.1, 0.2, 0.3], "y": ["a", "bc"], "unit": ("y", ["m", "m/s2"])},
        attrs=attrs,
    )
    got = sd.load(sd.save(data, tmp_path / "x.nc"))
    assert_same(got, data)
    assert got.attrs["nested"] == attrs["nested"]


def test_units_of_time_stay_numbers(tmp_path):
    data = xr.Dataset({"t": ("i", [0.5, 1.5], {"units": "s"})})
    assert sd.load(sd.save(data, tmp_path / "x.nc")).t.dtype == np.float64


def test_other_programs_read_plain_netcdf(tmp_path):
    data = sd.poles(SYSTEM)
    with xr.open_dataset(sd.save(data, tmp_path / "x.nc"), engine="h5netcdf") as plain:
        assert np.array_equal(plain["pole.real"], data.pole.values.real)
        assert plain["pole.real"].attrs["units"] == "1/s"


def test_nothing_is_left_behind_and_an_older_file_survives(tmp_path):
    file = sd.save(xr.Dataset({"x": ("t", [1.0])}), tmp_path / "x.nc")
    before = file.read_bytes()
    bad = xr.Dataset({"x": ("t", np.array([object()], dtype=object))})
    with pytest.raises(sd.OutputError, match="cannot hold this Dataset"):
        sd.save(bad, file)
    assert file.read_bytes() == before
    assert list(tmp_path.iterdir()) == [file]


def test_full_disk(tmp_path):
    """A limit on the size of files makes writing fail in the middle, as a full disk does."""
    file = sd.save(xr.Dataset({"x": ("t", [1.0])}), tmp_path / "x.nc")
    before = file.read_bytes()
    code = (
        "import resource, sys, numpy as np, xarray as xr, seatdyn as sd\n"
        "data = xr.Dataset({'x': ('t', np.random.default_rng(1).random(1_000_000))})\n"
        "limit = resource.getrlimit(resource.RLIMIT_FSIZE)[1]\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (1_000_000, limit))\n"
        "try:\n    sd.save(data, sys.argv[1])\n"
        "except sd.OutputError as error:\n    print(error)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(file)], capture_output=True, text=True, check=True
    )
    assert "x.nc' was not written: File too large. What was there before is" in done.stdout
    assert file.read_bytes() == before
    assert list(tmp_path.iterdir()) == [file]


PLACES = {
    "x.csv": r"must end in \.nc, not in '\.csv'",
    "missing/x.nc": "The directory .*missing' does not exist; create it first",
    "file.txt/x.nc": "file.txt' is a file, not a directory; choose another place",
    "folder.nc": "folder.nc' is a directory; give the name of a file",
}


@pytest.mark.parametrize("place", PLACES)
def test_places_where_nothing_can_be_written(place, tmp_path):
    (tmp_path / "file.txt").write_text("")
    (tmp_path / "folder.nc").mkdir()
    with pytest.raises(sd.OutputError, match=PLACES[place]):
        sd.save(xr.Dataset(), tmp_path / place)


def test_directory_without_rights(tmp_path, monkeypatch):
    # tests may run as root, for whom every directory is writable
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(
        sd.OutputError, match="is not writable; choose another or change its rights"
    ):
        sd.save(xr.Dataset(), tmp_path / "x.nc")


def test_what_cannot_be_loaded(tmp_path):
    with pytest.raises(sd.OutputError, match="does not exist or is no file"):
        sd.load(tmp_path / "missing.nc")
    (tmp_path / "text.nc").write_text("not netCDF")
    with pytest.raises(sd.OutputError, match="is not a readable netCDF-4 file"):
        sd.load(tmp_path / "text.nc")
    whole = sd.save(sd.poles(SYSTEM), tmp_path / "whole.nc").read_bytes()
    (tmp_path / "half.nc").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(sd.OutputError, match="is not a readable netCDF-4 file"):
        sd.load(tmp_path / "half.nc")
    xr.Dataset({"x": ("t", [1.0])}).to_netcdf(tmp_path / "foreign.nc", engine="h5netcdf")
    with pytest.raises(sd.OutputError, match=r"was not written by seatdyn.save; open it with"):
        sd.load(tmp_path / "foreign.nc")


def test_only_datasets_are_saved(tmp_path):
    with pytest.raises(sd.OutputError, match=r"list is no xarray.Dataset"):
        sd.save([1.0], tmp_path / "x.nc")
