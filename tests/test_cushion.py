"""A cushion between seat frame and occupant: against the assembled chain, and in the limits."""

from __future__ import annotations

import numpy as np
import pytest

import seatdyn as sd

FRAME = [sd.Spring(9500.0), sd.Damper(600.0)]
FREQUENCY = np.geomspace(0.3, 20.0, 40)


def person(name="fairley1989"):
    return sd.load_body(name)


def on_cushion(*cushion, mass=1.5, body=None, suspension=FRAME):
    seat = sd.Seat(20.0, suspension, cushion=cushion, cushion_mass=mass)
    return sd.SeatSystem(body or person(), seat)


def test_nodes_outputs_and_masses():
    system = on_cushion(sd.KelvinVoigt(60e3, 700.0))
    assert system.nodes == ("seat", "seat_surface", "m1")
    assert np.diag(system.linear.mass).tolist() == [20.0, 1.5 + 6.0, 45.6]
    run = sd.simulate(system, sd.Sine(2.0, amplitude=1.0), 1.0)
    assert run.pair.values.tolist() == ["seat-base", "seat_surface-seat", "m1-seat_surface"]
    state = sd.steady_state(system, sd.Sine(2.0, amplitude=1.0))
    assert {"acc_seat", "acc_seat_surface", "m1-seat_surface"} <= set(state.output.values)


def test_kelvin_voigt_cushion_is_the_chain_of_springs():
    """Choi and Han's chain: frame, cushion, body; the dynamic stiffness assembled by hand."""
    k, c = 60e3, 700.0
    response = sd.frequency_response(on_cushion(sd.KelvinVoigt(k, c)), frequency=FREQUENCY)
    for f, value in zip(FREQUENCY, response.transmissibility.values.T, strict=True):
        s = 2j * np.pi * f
        suspension, foam, body = 9500.0 + 600.0 * s, k + c * s, 45005.0 + 1360.0 * s
        matrix = np.array(
            [
                [20.0 * s**2 + suspension + foam, -foam, 0],
                [-foam, 7.5 * s**2 + foam + body, -body],
                [0, -body, 45.6 * s**2 + body],
            ]
        )
        np.testing.assert_allclose(value, np.linalg.solve(matrix, [suspension, 0, 0]), rtol=1e-10)


def test_a_hard_cushion_is_none():
    body = person("ksiazek1997_back_on")  # its feedback acts on the motion of what it sits on
    hard = on_cushion(sd.KelvinVoigt(1e11, 1e5), mass=0.5, body=body)
    bare = sd.SeatSystem(body, sd.Seat(20.5, FRAME))
    one = sd.frequency_response(hard, frequency=FREQUENCY)
    other = sd.frequency_response(bare, frequency=FREQUENCY)
    for node in ("seat", "m1", "m2"):
        np.testing.assert_allclose(
            one.transmissibility.sel(node=node), other.transmissibility.sel(node=node), rtol=2e-5
        )
    np.testing.assert_allclose(one.body_apparent_mass, other.body_apparent_mass, rtol=1e-10)


def test_apparent_mass_of_the_body_is_that_of_the_body_alone():
    system = on_cushion(sd.KelvinVoigt(60e3, 700.0))
    alone = sd.frequency_response(person(), frequency=FREQUENCY).apparent_mass
    on_seat = sd.frequency_response(system, frequency=FREQUENCY).body_apparent_mass
    np.testing.assert_allclose(on_seat, alone, rtol=1e-10)


def test_force_of_the_body_on_its_cushion():
    """What the cushion carries less the inertia of its mass, and the body's own forces."""
    system = on_cushion(sd.KelvinVoigt(60e3, 700.0), sd.ContactStop(1e6, 0.01, 0.01))
    run = sd.simulate(system, sd.Sine(3.0, amplitude=3.0), 2.0)
    d = run.relative_displacement.sel(pair="m1-seat_surface").values
    v = (run.velocity.sel(node="m1") - run.velocity.sel(node="seat_surface")).values
    by_body = 45005.0 * d + 1360.0 * v - 6.0 * run.acceleration.sel(node="seat_surface").values
    np.testing.assert_allclose(run.body_force, by_body, atol=1e-6 * np.abs(by_body).max())
    assert run.attrs["energy_residual"] < 1e-8


def test_forces_of_links_are_those_across_them():
    system = on_cushion(sd.KelvinVoigt(60e3, 700.0))
    response = sd.frequency_response(system, frequency=FREQUENCY)
    s = 2j * np.pi * FREQUENCY
    stretch = response.relative_displacement.sel(pair="m1-seat_surface").values
    link = response.element_force.sel(element="seat-m1 link").values
    np.testing.assert_allclose(link, (45005.0 + 1360.0 * s) * stretch / s**2, rtol=1e-10)


def test_zener_cushion_in_time_is_its_frequency_response():
    foam, f = sd.Zener(50e3, 40e3, 0.015), 3.7
    state = sd.steady_state(on_cushion(foam), sd.Sine(f, amplitude=1.0))
    assert state.attrs["status"] == "converged"
    s = 2j * np.pi * f
    cushion = 50e3 + 40e3 * s * 0.015 / (1 + s * 0.015)
    suspension, body = 9500.0 + 600.0 * s, 45005.0 + 1360.0 * s
    matrix = np.array(
        [
            [20.0 * s**2 + suspension + cushion, -cushion, 0],
            [-cushion, 7.5 * s**2 + cushion + body, -body],
            [0, -body, 45.6 * s**2 + body],
        ]
    )
    wanted = np.abs(np.linalg.solve(matrix, [suspension, 0, 0]))
    got = [float(state.amplitude.sel(output=f"acc_{node}")) for node in state.node.values]
    np.testing.assert_allclose(got, wanted, rtol=1e-6)
    response = sd.frequency_response(on_cushion(foam), frequency=[f]).transmissibility[:, 0]
    np.testing.assert_allclose(np.abs(response), wanted, rtol=1e-12)
    assert sd.poles(on_cushion(foam)).sizes["root"] == 7


def test_seat_factor_is_taken_at_the_surface():
    """Against the integral over the band by the trapezoidal rule."""
    from seatdyn.analysis.seat_factor import seat_factor

    soft, spectrum = on_cushion(sd.KelvinVoigt(30e3, 300.0)), sd.seat_test_input("EM5")
    f = np.linspace(spectrum.low, spectrum.high, 4001)
    g = spectrum.density(f) * np.abs(sd.weighting("Wk").factor(f)) ** 2
    t = sd.frequency_response(soft, frequency=f).transmissibility.sel(node="seat_surface").values
    factor = np.sqrt(np.trapezoid(g * np.abs(t) ** 2, f) / np.trapezoid(g, f))
    assert seat_factor(soft, spectrum) == pytest.approx(factor, rel=1e-4)


def test_refused():
    with pytest.raises(sd.ModelError, match=r"give Seat\.cushion_mass"):
        on_cushion(sd.KelvinVoigt(6e4, 1.0), mass=0.0, body=person("ksiazek1997_back_off"))
    with pytest.raises(sd.ModelError, match="no effect without a cushion"):
        sd.Seat(20.0, FRAME, cushion_mass=1.0)
    with pytest.raises(sd.ModelError, match="must be a list of elements"):
        sd.Seat(20.0, FRAME, cushion=sd.Spring(1.0))
    taken = sd.SeatedBody("x", {"seat_surface": 3.0}, (sd.Link(("seat", "seat_surface"), 1e4),))
    with pytest.raises(sd.ModelError, match="rename the mass"):
        on_cushion(sd.KelvinVoigt(6e4, 1.0), body=taken)


def test_a_cushion_comes_back_from_a_file(tmp_path):
    seat = sd.Seat(20.0, FRAME, cushion=[sd.Zener(5e4, 4e4, 0.015)], cushion_mass=1.2)
    sd.save_seat(seat, tmp_path / "seat.toml")
    assert sd.load_seat(tmp_path / "seat.toml") == seat
