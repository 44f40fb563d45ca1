"""Gradients of steady states: the linear system's exactly, the others' by differences."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest

import seatdyn as sd
from conftest import OFF, oscillator, paper_system
from seatdyn.analysis.balance import balance
from seatdyn.analysis.parameters import parameters_of, with_parameters
from seatdyn.errors import RequestError
from seatdyn.kernels.orbit import HIGH, LOW

SINE = sd.Sine(1.55, amplitude=0.8857)
COMMON = ("seat_mass", "frequency", "base_amplitude", "Spring.stiffness", "m2.mass", "k11")
CASES = {
    "quadratic": (sd.QuadraticDamper(1000.0), ("QuadraticDamper.coefficient",)),
    "gap": (
        sd.PiecewiseSpring(1000.0, 0.02, 0.01, jumping=False),
        ("PiecewiseSpring.stiffness", "PiecewiseSpring.bump_clearance"),
    ),
    "jump": (
        sd.PiecewiseSpring(1000.0, 0.02, 0.01),
        ("PiecewiseSpring.stiffness", "PiecewiseSpring.rebound_clearance"),
    ),
    "friction": (
        sd.CoulombFriction(30.0, slope=200.0),
        ("CoulombFriction.force", "CoulombFriction.slope"),
    ),
    "late": (sd.QuadraticDamper(500.0, delay=0.01), ("QuadraticDamper.delay", "m1-seat.damping")),
}


def amplitudes(system, sine):
    extrema = balance(system, sine, 1e-11, most=16384).look.extrema
    return (extrema[HIGH] - extrema[LOW]) / 2


def difference(system, sine, name):
    """Derivative of all amplitudes by differences of fourth order of converged solutions."""
    value = parameters_of(system, sine)[name][0]
    h = 2e-4 * value
    a = [amplitudes(*with_parameters(system, sine, {name: value + i * h})) for i in (-2, -1, 1, 2)]
    return (8 * (a[2] - a[1]) - (a[3] - a[0])) / (12 * h)


@pytest.mark.parametrize("case", CASES)
def test_gradients_are_the_differences_of_converged_solutions(case):
    """To 1e-6 of the amplitude per relative change of the parameter.

    The place of a peak between samples changes with a parameter, and with it the error of the
    polynomial through them: times the samples, that is some 1e-6 where friction is steep.
    """
    element, own = CASES[case]
    system = paper_system(element)
    names = [*COMMON, *own]
    found = sd.steady_gradient(system, SINE, names, tolerance=1e-8)
    assert found.attrs["status"] == "converged"
    assert np.all(np.isfinite(found.amplitude_gradient))
    assert np.allclose(found.amplitude, (found.maximum - found.minimum) / 2, rtol=1e-14)
    for name in names:
        got = found.amplitude_gradient.sel(parameter=name)
        value = float(found.value.sel(parameter=name))
        error = np.abs(got - difference(system, SINE, name)) * value
        assert float((error / found.amplitude).max()) < (1e-5 if case == "friction" else 1e-6)


def test_a_linear_oscillator_has_the_derivative_of_its_transfer_function():
    """|d| = m a0 / |k - m w^2 + i w c|, to stiffness, damping, mass and frequency."""
    mass, k, c, f = 50.0, 9000.0, 300.0, 2.5
    system = oscillator(sd.Spring(k), sd.Damper(c), mass=mass)

    def amplitude(mass=mass, k=k, c=c, f=f):
        w = 2 * math.pi * f
        size = (k - mass * w * w) ** 2 + (w * c) ** 2
        return 0.8857 * mass / cmath.sqrt(size)

    names = {"seat_mass": "mass", "Spring.stiffness": "k", "Damper.coefficient": "c"}
    names["frequency"] = "f"
    found = sd.steady_gradient(system, sd.Sine(f, amplitude=0.8857), list(names), tolerance=1e-9)
    for name, key in names.items():
        step = 1e-30
        value = {"mass": mass, "k": k, "c": c, "f": f}[key]
        exact = amplitude(**{key: value + 1j * step}).imag / step
        got = float(found.amplitude_gradient.sel(parameter=name, output="seat-base"))
        assert got == pytest.approx(exact, rel=1e-7)


def test_grazing_has_no_gradient(monkeypatch):
    import seatdyn.analysis.steady_balance as steady_balance

    monkeypatch.setattr(steady_balance, "GRAZING", 1e3)
    system = paper_system(sd.PiecewiseSpring(1000.0, 0.02, 0.01))
    found = sd.steady_gradient(system, SINE, ["seat_mass"])
    assert found.attrs["status"] == "grazing"
    assert np.all(np.isnan(found.amplitude_gradient))
    assert np.all(np.isfinite(found.amplitude))


def test_what_has_no_derivative_is_refused():
    system = paper_system(sd.QuadraticDamper(0.0), body=OFF)
    with pytest.raises(RequestError, match="other than zero"):
        sd.steady_gradient(system, SINE, ["QuadraticDamper.coefficient"])
    with pytest.raises(RequestError, match="is called"):
        sd.steady_gradient(system, SINE, ["Damper.coeficient"])
