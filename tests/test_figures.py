"""Figures: one call draws any Dataset, labelled, from a file as from memory."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
import xarray as xr
from matplotlib.image import imread

import seatdyn as sd
from conftest import ON, paper_system

SINE = sd.Sine(1.55, amplitude=0.8857)
JUMP = sd.PiecewiseSpring(4000.0, bump_clearance=0.02, rebound_clearance=0.01)
SYSTEM = paper_system(sd.QuadraticDamper(100.0), JUMP, body=ON)
AXES = {"seat_mass": np.linspace(5.0, 60.0, 30), "damping": np.linspace(0.0, 3000.0, 30)}
RESULTS = {
    "time history": lambda: sd.simulate(SYSTEM, SINE, 2.0),
    "steady state": lambda: sd.steady_state(SYSTEM, SINE),
    "frequency response": lambda: sd.frequency_response(
        SYSTEM, frequency=np.geomspace(0.3, 50, 200)
    ),
    "response of a body": lambda: sd.frequency_response(
        SYSTEM.body, frequency=np.linspace(0.3, 50, 200)
    ),
    "map": lambda: sd.stability_map(SYSTEM, **AXES),
    "map of three": lambda: sd.stability_map(SYSTEM, **AXES, stiffness=[5e3, 2e4]),
    "poles": lambda: sd.poles(SYSTEM),
    "unstable poles": lambda: sd.poles(paper_system(c=5.0)),
    "zeros": lambda: sd.zeros(SYSTEM.body, output="m1"),
}


def texts(figure):
    return [axes.get_xlabel() + axes.get_ylabel() for axes in figure.axes if axes.get_visible()]


@pytest.mark.parametrize("kind", RESULTS)
def test_every_result_has_a_picture_with_units(kind, tmp_path):
    path = tmp_path / "x.png"
    figure = sd.plot(RESULTS[kind](), path)
    image = imread(path)
    assert image.shape[1] == 1200
    assert image[..., :3].std() > 0.05  # something is drawn
    labels = [text for text in texts(figure) if text]
    assert labels
    assert all("[" in text for text in labels)
    # constrained layout gives up, with a warning that pytest shows, where axes do not fit
    boxes = [axes.get_position() for axes in figure.axes if axes.get_visible()]
    assert all(box.width > 0.1 and box.height > 0.1 for box in boxes)


def test_curves_are_the_data():
    data = sd.simulate(SYSTEM, SINE, 1.0)
    acceleration, relative, force = sd.plot(data).axes
    drawn = {line.get_label(): line.get_ydata() for line in acceleration.lines}
    assert set(drawn) == {"base", "seat", "m1", "m2"}
    assert np.array_equal(drawn["m2"], data.acceleration.sel(node="m2"))
    travel = next(line for line in relative.lines if line.get_label() == "seat-base")
    np.testing.assert_allclose(
        travel.get_ydata(), 1e3 * data.relative_displacement.sel(pair="seat-base")
    )
    assert {"QuadraticDamper", "PiecewiseSpring", "suspension"} <= {
        line.get_label() for line in force.lines
    }


def test_unstable_poles_stand_out():
    labels = [c.get_label() for c in sd.plot(sd.poles(paper_system(c=5.0))).axes[0].collections]
    assert "pole not in the left half plane" in labels
    labels = [c.get_label() for c in sd.plot(sd.poles(paper_system())).axes[0].collections]
    assert "pole not in the left half plane" not in labels


def test_a_loaded_result_is_drawn_alike(tmp_path):
    data = sd.frequency_response(SYSTEM, frequency=[1.0, 2.0, 3.0])
    sd.plot(data, tmp_path / "a.png")
    sd.plot(sd.load(sd.save(data, tmp_path / "x.nc")), tmp_path / "b.png")
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


@pytest.mark.parametrize("suffix", [".svg", ".pdf"])
def test_vector_formats(suffix, tmp_path):
    sd.plot(sd.poles(SYSTEM), tmp_path / f"x{suffix}", title="A title")
    assert (tmp_path / f"x{suffix}").stat().st_size > 5000


def test_refusals(tmp_path):
    unstable = sd.steady_state(paper_system(c=5.0), SINE)
    with pytest.raises(sd.OutputError, match="cannot be drawn: its status is 'unstable'"):
        sd.plot(unstable)
    with pytest.raises(sd.OutputError, match="no known kind of result"):
        sd.plot(xr.Dataset({"x": ("t", [1.0])}))
    with pytest.raises(sd.OutputError, match=r"int is no xarray.Dataset"):
        sd.plot(3)
    with pytest.raises(sd.OutputError, match=r"must end in \.png or \.svg or \.pdf"):
        sd.plot(sd.poles(SYSTEM), tmp_path / "x.jpg")


def test_pyplot_is_left_alone():
    code = (
        "import sys, seatdyn as sd\n"
        f"sd.plot(sd.poles(sd.load_body({ON!r})))\n"
        "assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
