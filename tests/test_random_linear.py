"""Random response of linear systems: three routes and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

import seatdyn as sd
from conftest import OFF, ON, oscillator, paper_system
from seatdyn.analysis.linear_map import linear_map
from seatdyn.analysis.random_linear import exact_step, linear_response, linear_time_response
from seatdyn.kernels.recursion import accumulate

EM3 = sd.seat_test_input("EM3")
SPECTRA = {
    "EM3": EM3,
    "EM6": sd.seat_test_input("EM6"),
    "AG1": sd.seat_test_input("AG1"),
    "resonant": sd.NarrowBand(1.55, 0.02, rms=0.686),
    "rectangular": sd.NarrowBand(1.7, 1.0, rms=0.6, shape="rectangular"),
    "road": sd.Road("C", speed=10.0),
}
OMEGA, ZETA = 2 * math.pi * 1.5, 0.2


def seat_oscillator(zeta=ZETA):
    """One mass: 1 kg, 1.5 Hz."""
    return oscillator(sd.Spring(OMEGA**2), sd.Damper(2 * zeta * OMEGA))


# ---------------------------------------------------------------- the routes agree


@pytest.mark.parametrize("body", [OFF, ON])
@pytest.mark.parametrize("name", SPECTRA)
def test_integral_and_lyapunov_equation_agree(name, body):
    system = paper_system(sd.CoulombFriction(20.0, 10.0), body=body)
    ways = ("frequency", "lyapunov")
    one, two = (
        linear_response(system, SPECTRA[name], method=way, linearise="tangent") for way in ways
    )
    np.testing.assert_allclose(one.rms, two.rms, rtol=2e-6)
    size = np.sqrt(np.outer(np.diag(one.covariance), np.diag(one.covariance)))
    assert np.abs((one.covariance - two.covariance) / size).max() < 4e-6
    assert np.isfinite(one.rate_rms).all()
    assert np.isnan(two.rate_rms).all()


@pytest.mark.parametrize("name", ["EM3", "rectangular"])
def test_time_average_agrees_with_the_integral(name):
    system = paper_system(sd.QuadraticDamper(100.0))
    wanted = linear_response(system, SPECTRA[name]).rms
    got = linear_time_response(system, SPECTRA[name], 300.0, realisations=96, seed=8)
    shown = wanted.output.values != "F_nonlinear"  # which is left out
    half = (got.rms_high - got.rms_low)[shown] / 2
    assert float((half / wanted[shown]).max()) < 0.02
    # of fourteen correlated outputs one may lie outside; none by far
    score = np.abs(got.rms - wanted)[shown] / half
    assert float(score.max()) < 1.5
    assert np.mean(score <= 1.0) > 0.9
    assert got.attrs["status"] == "ok"
    assert '"seed": 8' in got.attrs["request"]
    assert got.sizes["realisation"] == 96
    np.testing.assert_allclose(np.sqrt(got.mean_square.mean("realisation")), got.rms)


@pytest.mark.slow
def test_intervals_of_white_noise_on_one_mass_cover_the_truth():
    """95 % intervals of 1000 fixed seeds: 930 to 970 of them."""
    density = 0.04
    noise = sd.SpectrumTable([0.05, 15.0], [density, density])  # ten times the resonance
    wanted = linear_response(seat_oscillator(), noise).rms.sel(output="seat-base").item()
    endless = math.sqrt(density / (8 * ZETA * OMEGA**3))
    assert wanted == pytest.approx(endless, rel=5e-3)  # the cuts leave out 0.4 %
    covered = 0
    for seed in range(1000):
        got = linear_time_response(seat_oscillator(), noise, 60.0, realisations=8, seed=seed)
        one = got.sel(output="seat-base")
        covered += one.rms_low.item() <= wanted <= one.rms_high.item()
    assert 930 <= covered <= 970


def test_recursion_ends_where_the_engine_ends():
    system = paper_system()
    motion = sd.RandomMotion(EM3, 10.0, seed=2, ramp=0.0)
    raw, matrices = motion.realise(), linear_map(paper_system()).system.prompt
    step, drive = exact_step(matrices.a, matrices.b, raw.step)
    state, gram = np.zeros((6, 1)), np.zeros((9, 9, 1))
    columns = (values[:, None] for values in raw[1:])
    accumulate(step, drive, *columns, 0, state, gram)
    run = sd.simulate(
        system, motion, 10.0, output_step=10.0, settings=sd.Settings(rtol=1e-11)
    ).isel(time=-1)
    ends = np.concatenate([run.displacement, run.velocity])
    np.testing.assert_allclose(state[:, 0], ends, rtol=1e-9, atol=1e-12)
    assert gram[7, 7, 0] == pytest.approx(np.sum(raw.velocity**2))


def test_transfer_is_that_of_the_frequency_response():
    system, f = paper_system(), np.array([0.4, 1.5, 7.0])
    response = linear_response(system, EM3, frequency=f)
    other = sd.frequency_response(system, frequency=f)
    of_seat = np.abs(other.transmissibility.sel(node="seat")) ** 2 * EM3.density(f)
    np.testing.assert_allclose(response.density.sel(output="acc_seat"), of_seat, rtol=1e-10)
    pair = np.abs(other.relative_displacement.sel(pair="m1-seat")) ** 2
    wanted = pair * EM3.density(f) / (2 * np.pi * f) ** 4
    np.testing.assert_allclose(response.density.sel(output="m1-seat"), wanted, rtol=1e-9)


def test_density_integrates_to_the_level():
    system = paper_system()
    f = np.linspace(EM3.low, EM3.high, 20001)
    response = linear_response(system, EM3, frequency=f)
    square = np.trapezoid(response.density, f, axis=1)
    np.testing.assert_allclose(np.sqrt(square), response.rms, rtol=1e-5)
    assert float(response.density.sel(frequency=f[100], output="acc_seat")) > 0.0


# ---------------------------------------------------------------- closed forms


@pytest.mark.parametrize("zeta", [0.05, 0.3])
def test_white_noise_on_one_mass(zeta):
    """One-sided density G: z^2 = G/(8 zeta w0^3), z'^2 = G/(8 zeta w0),
    absolute acceleration^2 = G w0 (1 + 4 zeta^2)/(8 zeta); Crandall and Mark 1963."""
    density = 0.04
    low, high = 1e-3, 3e4
    noise = sd.SpectrumTable([low, high], [density, density])
    system = seat_oscillator(zeta)
    response = linear_response(system, noise)
    travel = math.sqrt(density / (8 * zeta * OMEGA**3))
    acceleration = math.sqrt(density * OMEGA * (1 + 4 * zeta**2) / (8 * zeta))
    assert response.rms.sel(output="seat-base").item() == pytest.approx(travel, rel=1e-3)
    assert response.rms.sel(output="acc_seat").item() == pytest.approx(acceleration, rel=1e-3)
    assert response.upcrossings.sel(output="seat-base").item() == pytest.approx(1.5, rel=1e-3)
    rate = response.rate_rms.sel(output="seat-base").item()
    assert rate == pytest.approx(math.sqrt(density / (8 * zeta * OMEGA)), rel=1e-3)


def test_limited_band_on_one_mass():
    """The same by the Lyapunov equation and by a general quadrature, in a band that cuts a lot."""
    noise = sd.NarrowBand(1.4, 1.2, rms=0.9, shape="rectangular")
    density = 0.9**2 / 1.2

    def size(f):
        w = 2 * math.pi * f
        return density / ((OMEGA**2 - w**2) ** 2 + (2 * ZETA * OMEGA * w) ** 2)

    wanted = math.sqrt(quad(size, 0.8, 2.0, epsrel=1e-12)[0])
    for method in ("frequency", "lyapunov"):
        got = linear_response(seat_oscillator(), noise, method=method).rms.sel(output="seat-base")
        assert got.item() == pytest.approx(wanted, rel=1e-6)


def test_response_follows_the_level():
    system = paper_system(body=ON)
    one = linear_response(system, sd.NarrowBand(1.57, 0.02, rms=0.5))
    two = linear_response(system, sd.NarrowBand(1.57, 0.02, rms=1.0))
    np.testing.assert_allclose(two.rms, 2 * one.rms, rtol=1e-9)
    assert one.output.values[0] == "acc_m1"
    assert one.output_unit.values[0] == "m/s2"


# ---------------------------------------------------------------- refusals


def test_an_unstable_system_has_no_level():
    system = paper_system(body=ON, mass=5.0)
    response = linear_response(system, EM3)
    assert response.attrs["status"] == "unstable"
    assert np.isnan(response.rms).all()
    assert np.isnan(response.covariance).all()
    run = linear_time_response(system, EM3, 30.0, realisations=2, seed=1)
    assert np.isnan(run.rms).all()


def test_ignored_elements_are_named():
    system = paper_system(sd.QuadraticDamper(100.0))
    assert "QuadraticDamper" in linear_response(system, EM3).attrs["ignored"]
    friction = paper_system(sd.CoulombFriction(20.0, 10.0))
    tangent = linear_response(friction, EM3, linearise="tangent")
    same = linear_response(paper_system(c=260.0 + 400.0 / math.pi), EM3)
    np.testing.assert_allclose(tangent.rms[:3], same.rms[:3], rtol=1e-9)
    assert tangent.rms.sel(output="F_nonlinear").item() > 0.0


# ---------------------------------------------------------------- elements with states


def test_a_linear_element_with_a_state_is_taken_exactly():
    """A Zener element between base and seat: all routes, and the frequency response."""
    zener = sd.Zener(1000.0, 8000.0, 0.05)
    system, f = paper_system(zener), np.array([0.5, 1.5, 6.0])
    response = linear_response(system, EM3, frequency=f)
    other = sd.frequency_response(system, frequency=f)
    of_seat = np.abs(other.transmissibility.sel(node="seat")) ** 2 * EM3.density(f)
    np.testing.assert_allclose(response.density.sel(output="acc_seat"), of_seat, rtol=1e-8)
    force = np.abs(other.element_force.sel(element="Zener")) ** 2 * EM3.density(f)
    np.testing.assert_allclose(response.density.sel(output="F_nonlinear"), force, rtol=1e-8)
    lyapunov = linear_response(system, EM3, method="lyapunov")
    np.testing.assert_allclose(response.rms, lyapunov.rms, rtol=1e-6)
    runs = linear_time_response(system, EM3, 200.0, realisations=64, seed=5)
    score = np.abs(runs.rms - response.rms) / (runs.rms_high - runs.rms_low)
    assert float(score.max()) < 0.75
    found = sd.statistical_linearisation(system, EM3)
    np.testing.assert_allclose(found.rms, response.rms, rtol=1e-10)
    # a slow dashpot leaves the springs in parallel, a quick one the first spring alone
    for time, stiffness in ((1e4, 9000.0), (1e-6, 1000.0)):
        limit = linear_response(paper_system(sd.Zener(1000.0, 8000.0, time)), EM3)
        spring = linear_response(paper_system(k=9950.0 + stiffness), EM3)
        np.testing.assert_allclose(limit.rms[:10], spring.rms[:10], rtol=1e-3)


def test_means_with_a_linear_element_with_a_state():
    """The mean rests on the spring of the Zener element alone."""
    load = (sd.Zener(1000.0, 8000.0, 0.05), sd.Preload(100.0))
    inert = oscillator(sd.Spring(9000.0), sd.Damper(500.0), *load, mass=70.0)
    found = sd.statistical_linearisation(inert, EM3)
    assert found["mean"].sel(output="seat").item() == pytest.approx(-0.01, rel=1e-6)
    assert found["mean"].sel(output="F_spring").item() == pytest.approx(-90.0, rel=1e-6)
    assert found["mean"].sel(output="F_nonlinear").item() == pytest.approx(90.0, rel=1e-6)


def test_other_elements_with_states_are_left_out_by_name():
    system = paper_system(sd.DahlFriction(20.0, 1e5), sd.QuadraticDamper(100.0))
    response = linear_response(system, EM3)
    assert response.attrs["ignored"] == '["DahlFriction", "QuadraticDamper"]'
    np.testing.assert_allclose(response.rms, linear_response(paper_system(), EM3).rms, rtol=1e-12)


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda s: linear_response(s.body, EM3), "SeatedBody is not allowed"),
        (lambda s: linear_response(s, sd.Sine(1.0, 1.0)), "no spectrum; use NarrowBand"),
        (lambda s: linear_response(s, EM3, method="guess"), "method = 'guess'"),
        (lambda s: linear_response(s, EM3, frequency=[0.0]), r"frequency\[0\] = 0 Hz"),
        (
            lambda s: linear_response(
                s, sd.SpectrumTable([1.0, 2.0], [1.0, 1.0]), method="lyapunov"
            ),
            "no rational shaping filter",
        ),
        (
            lambda s: linear_time_response(s, EM3, 10.0, realisations=1, seed=1),
            "realisations = 1",
        ),
    ],
)
def test_bad_requests_say_what_is_wrong(ask, message):
    with pytest.raises(sd.RequestError, match=message):
        ask(paper_system())


def test_late_forces_enter_by_their_phase():
    """Against the transfer functions of `frequency_response`, summed over the band."""
    seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(700.0)], delay=0.02)
    system = sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat).delayed(0.03, "feedback")
    response = linear_response(system, EM3, frequency=[1.3])
    f = np.linspace(EM3.low, EM3.high, 4001)
    other, density = sd.frequency_response(system, frequency=f), EM3.density(f)
    of_seat = np.abs(other.transmissibility.sel(node="seat")) ** 2 * density
    assert response.rms.sel(output="acc_seat").item() == pytest.approx(
        math.sqrt(np.trapezoid(of_seat, f)), rel=1e-6
    )
    pair = np.abs(other.relative_displacement.sel(pair="seat-base")) ** 2
    travel = math.sqrt(np.trapezoid(pair * density / (2 * np.pi * f) ** 4, f))
    assert response.rms.sel(output="seat-base").item() == pytest.approx(travel, rel=1e-6)
    # late forces have the level of what they answer to
    assert response.rms.sel(output="F_spring").item() == pytest.approx(9950.0 * travel, rel=1e-6)
    both = linear_response(system.delayed(0.0).delayed(0.0, "feedback"), EM3)
    assert both.rms.sel(output="seat-base").item() != pytest.approx(travel, rel=0.05)
    with pytest.raises(sd.RequestError, match="Lyapunov route"):
        linear_response(system, EM3, method="lyapunov")
    unstable = linear_response(system.delayed(0.2), EM3)
    assert unstable.attrs["status"] == "unstable"
    assert np.isnan(unstable.rms).all()
