"""Ensembles of systems with delays or with elements that have states."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import seatdyn as sd
from seatdyn.analysis.ensemble import Ensemble
from seatdyn.analysis.ensemble_runs import RunEnsemble
from seatdyn.analysis.random_linear import linear_response
from seatdyn.analysis.seat_factor import seat_factor
from seatdyn.signals.synthesis import Synthesis

EM3 = sd.seat_test_input("EM3")
DAHL = sd.DahlFriction(50.0, 2e4)


def on_seat(*elements, delay=0.0, damping=700.0):
    seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(damping), *elements], delay=delay)
    return sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat)


def motion(duration, seed=1):
    return sd.RandomMotion(EM3, duration, seed=seed)


def test_runs_repeat_the_members_that_march():
    """The same base motions, outputs, instants and moments; steps of both made fine."""
    system, synthesis, settle = on_seat(sd.QuadraticDamper(300.0)), Synthesis(EM3, 10.0), 200
    march = Ensemble.make(system, synthesis, settle, 3, 64)
    runs = replace(RunEnsemble.make(system, synthesis, settle, 3), rtol=1e-10)
    assert runs.names == march.names
    assert runs.spacing == march.spacing
    x, v, a = march.base(0)
    wanted = march.respond(x, v, a, ("acc_m1", "F_body"), settle)
    found = runs.respond(x[:2], v[:2], a[:2], ("acc_m1", "F_body"), settle)
    np.testing.assert_allclose(found.series, wanted.series[:2], rtol=1e-6, atol=1e-6)
    near = np.abs(found.moments - wanted.moments[:, :, :2])
    assert np.all(near <= 1e-7 * np.abs(wanted.moments[:, :, :2]) + 1e-9)


def test_a_delay_that_vanishes_changes_nothing():
    late = sd.random_response(
        on_seat(sd.QuadraticDamper(300.0), delay=1e-8), motion(20.0), realisations=4
    )
    prompt = sd.random_response(
        on_seat(sd.QuadraticDamper(300.0)), motion(20.0), realisations=4, step_tolerance=1e-6
    )
    for variable in ("rms", "member_rms", "highest", "lowest"):
        np.testing.assert_allclose(late[variable], prompt[variable], rtol=1e-5, atol=1e-9)
    assert 0.0 < late.attrs["step_error"] < 1e-4


@pytest.mark.parametrize(
    "system",
    [on_seat(delay=0.02), on_seat(sd.Zener(4e3, 8e3, 0.05))],
    ids=["delay", "state"],
)
def test_linear_systems_cover_the_frequency_integral(system):
    exact = linear_response(system, EM3)
    if not system.delays:
        lyapunov = linear_response(system, EM3, method="lyapunov")
        inside = ["seat-base", "m1-seat", "F_spring"]
        np.testing.assert_allclose(
            exact.rms.sel(output=inside), lyapunov.rms.sel(output=inside), rtol=1e-5
        )
    found = sd.random_response(system, motion(60.0), realisations=16)
    assert found.attrs["status"] == "ok"
    for name in ("acc_m1", "acc_seat", "seat-base", "m2-m1", "F_spring", "F_linear"):
        # within twice the 95 % interval, which 1 of 3,000 misses
        row, want = found.sel(output=name), exact.rms.sel(output=name)
        assert abs(row.rms - want) < row.rms_high - row.rms_low, name
        assert row.rms_high / row.rms_low < 1.2


def test_result_depends_on_the_seed_only_and_nothing_is_lost(tmp_path):
    system, file = on_seat(DAHL), tmp_path / "a.npz"
    whole = sd.random_response(system, motion(8.0), realisations=48, workers=1)

    def interrupt(share):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sd.random_response(
            system, motion(8.0), realisations=48, checkpoint=file, progress=interrupt
        )
    with np.load(file) as stored:
        assert stored["blocks"].shape[0] == 1
    shares = []
    again = sd.random_response(
        system, motion(8.0), realisations=48, checkpoint=file, progress=shares.append, workers=2
    )
    assert shares == pytest.approx([2 / 3, 1.0])  # the first block was there
    assert np.array_equal(again.member_rms, whole.member_rms)
    stopped = sd.random_response(system, motion(8.0), realisations=48, interval=0.5)
    assert stopped.attrs["realisations"] == 16
    ratio = sd.rms_ratio(whole, whole)
    assert np.nanmax(np.abs(ratio.ratio - 1.0)) < 1e-12


def test_friction_with_presliding_is_near_to_dry_friction():
    """It yields over 25 um, which is worth 1 % of a level; friction that is ten times as stiff as
    this comes within 0.4 %.
    """
    stiff = sd.random_response(on_seat(sd.DahlFriction(50.0, 2e6)), motion(10.0), realisations=2)
    dry = sd.random_response(on_seat(sd.CoulombFriction(50.0, 2e4)), motion(10.0), realisations=2)
    none = sd.random_response(on_seat(), motion(10.0), realisations=2)
    for name in ("acc_seat", "seat-base", "F_nonlinear"):
        one, other = (float(data.rms.sel(output=name)) for data in (stiff, dry))
        assert one == pytest.approx(other, rel=0.012)
    assert float(none.rms.sel(output="seat-base")) > 1.05 * float(dry.rms.sel(output="seat-base"))


def test_seat_test_of_a_late_suspension():
    seat = sd.Seat(20.0, [sd.Spring(9500.0), sd.Damper(700.0)], delay=0.01)
    body = sd.load_body("fairley1989")
    found = sd.seat_test(seat, "EM3", occupants={"one": 60.0}, runs=8, duration=60.0)
    exact = seat_factor(sd.SeatSystem(body.scaled(sitting_mass=60.0), seat), EM3)
    prompt = seat_factor(
        sd.SeatSystem(body.scaled(sitting_mass=60.0), replace(seat, delay=0.0)), EM3
    )
    row = found.sel(occupant="one")
    assert abs(row.seat_rms - exact) < row.seat_rms_high - row.seat_rms_low
    assert abs(row.seat_rms - prompt) > row.seat_rms_high - row.seat_rms_low


def test_what_cannot_be_answered():
    unstable = sd.random_response(on_seat(delay=0.3), motion(5.0), realisations=2)
    assert unstable.attrs["status"] == "unstable"
    assert np.isnan(unstable.rms).all()
    held = on_seat(sd.LuGreFriction(300.0, 300.0, 0.01, 1e5, 300.0), damping=10.0)
    data = sd.random_response(held, motion(3.0), realisations=2, settle=1.0)
    assert data.attrs["status"] == "ok"  # its linear part alone is unstable


@pytest.mark.parametrize(
    ("element", "low", "high"),
    [(sd.BoucWen(5e3, 0.1, 50.0, 20.0, viscous=20.0), -0.07, 0.0), (DAHL, -0.02, 0.06)],
    ids=["bouc-wen", "dahl"],
)
def test_bias_of_statistical_linearisation(element, low, high):
    """Of the travel; the interval is some 4 % wide on either side."""
    system = on_seat(element, damping=260.0)
    found = sd.statistical_linearisation(system, EM3).rms.sel(output="seat-base")
    runs = sd.random_response(system, motion(60.0), realisations=16).sel(output="seat-base")
    assert low < float(found / runs.rms) - 1.0 < high
    plain = linear_response(on_seat(damping=260.0), EM3).rms.sel(output="seat-base")
    assert float(plain / runs.rms) - 1.0 > 0.1  # what leaving it out would miss
