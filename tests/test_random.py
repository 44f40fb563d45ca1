"""Ensembles against the event-locating engine, closed forms, and themselves."""

from __future__ import annotations

import dataclasses
import math
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import kv

import seatdyn as sd
from conftest import OFF, ON, oscillator, paper_system
from seatdyn.analysis.ensemble import Ensemble, choose_steps
from seatdyn.analysis.random import rms_intervals
from seatdyn.analysis.transient import run_for
from seatdyn.kernels.lanes import LANES
from seatdyn.signals.synthesis import Synthesis

EM3 = sd.seat_test_input("EM3")
LAWS = {
    "linear": (),
    "quadratic": (sd.QuadraticDamper(1000.0),),
    "coulomb": (sd.CoulombFriction(50.0, slope=1000.0),),
    "gap": (sd.PiecewiseSpring(1000.0, 0.02, 0.01, jumping=False),),
    "jump": (sd.PiecewiseSpring(1000.0, 0.02, 0.01),),
    "stops": (sd.EndStop(40e3, 0.02, 0.02, damping=300.0), sd.QuadraticDamper(300.0)),
}
# Breaks are not located, so sharp laws need short steps, and a jump (such as
# the damping of a stop at contact) leaves an error of first order.
STEP = {"coulomb": 1e-4, "jump": 1e-4, "stops": 1e-4}
TOLERANCE = {"jump": 1e-4, "stops": 1e-4}
STIFF_MODE = 10.0  # m2 to m1 moves with the body's stiff mode, which a jump excites


@pytest.mark.parametrize("name", LAWS)
@pytest.mark.parametrize("body", [OFF, ON])
def test_ensemble_repeats_the_engine_that_locates_events(name, body):
    system = paper_system(*LAWS[name], body=body)
    motion = sd.RandomMotion(EM3, 8.0, seed=3, member=1, ramp=0.0)
    synthesis = Synthesis(EM3, 8.0)
    steps = math.ceil(synthesis.step / STEP.get(name, 1e-3))
    ensemble = Ensemble.make(system, synthesis, 0, motion.seed, steps, spacing=1e-3)
    kept = ("seat-base", "m2-m1", "acc_m1", "F_suspension", "F_body")
    series = ensemble.run(0, kept).series[1]
    time = ensemble.spacing * np.arange(series.shape[-1])

    start = np.concatenate([np.full(3, motion.displacement(0.0)), np.full(3, motion.velocity(0.0))])
    run = run_for(system, motion, 8.0, initial=start, settings=sd.Settings(rtol=1e-9))
    samples = run.at(time)
    seat, m1, m2 = samples.displacement.T
    travel = seat - samples.base[0]
    tolerance = TOLERANCE.get(name, 1e-6)
    assert np.max(np.abs(series[0] - travel)) < tolerance * np.max(np.abs(travel))
    inner = np.max(np.abs(series[1] - (m2 - m1))) / np.max(np.abs(m2 - m1))
    assert inner < tolerance * STIFF_MODE
    smooth = name in ("linear", "quadratic")
    if smooth:
        acceleration = samples.acceleration[:, 1]
        assert np.max(np.abs(series[2] - acceleration)) < 1e-5 * np.max(np.abs(acceleration))


@pytest.mark.parametrize("name", ["linear", "stops"])
@pytest.mark.parametrize("spacing", [1e-3, 1e-2])
def test_moments_are_those_of_the_series(name, spacing):
    """Mean squares come from products of states; series and extremes are worked out."""
    ensemble = Ensemble.make(
        paper_system(*LAWS[name]), Synthesis(EM3, 20.0), 100, 1, 3, spacing=spacing
    )
    moments, series = ensemble.run(0, ensemble.names)
    assert ensemble.spacing <= spacing
    expected = [series.mean(2), *((series**k).mean(2) for k in (2, 4))]
    expected = np.moveaxis([*expected, series.min(2), series.max(2)], [0, 1, 2], [1, 2, 0])
    size = np.sqrt(moments[:, 1:2]) ** np.array([1, 2, 4, 1, 1])[:, None]
    assert np.all(np.abs(moments - expected) <= 1e-9 * size)

    few = dataclasses.replace(ensemble, peaks=("seat-base",)).run(0).moments
    row = ensemble.names.index("seat-base")
    assert np.array_equal(few[:, :2], moments[:, :2])
    assert np.array_equal(few[row], moments[row])
    assert np.all(np.isnan(np.delete(few, row, axis=0)[:, 2:]))


def test_peaks_of_some_outputs_only():
    system, motion = paper_system(*LAWS["stops"]), sd.RandomMotion(EM3, 5.0, seed=1)
    every = sd.random_response(system, motion, realisations=2)
    some = sd.random_response(system, motion, realisations=2, peaks=["seat-base"])
    assert np.array_equal(every.rms, some.rms)
    assert some.highest.sel(output="seat-base") == every.highest.sel(output="seat-base")
    assert np.isnan(some.highest.sel(output="acc_seat"))
    fine = sd.random_response(system, motion, realisations=2, spacing=1e-3)
    assert fine.attrs["spacing_s"] <= 1e-3 < some.attrs["spacing_s"]
    assert fine.highest.sel(output="seat-base") > every.highest.sel(output="seat-base")


def test_forces_balance():
    """The suspension and the body are all that accelerates the seat."""
    system = paper_system(*LAWS["stops"])
    data = sd.random_response(
        system,
        sd.RandomMotion(EM3, 5.0, seed=1),
        realisations=2,
        keep=["acc_seat", "F_suspension", "F_body", "acc_base"],
    )
    seat, suspension, body, base = np.moveaxis(data["series"].to_numpy(), 1, 0)
    assert np.max(np.abs(35.0 * seat + suspension - body)) < 1e-9 * np.max(np.abs(suspension))
    assert np.std(base) == pytest.approx(EM3.acceleration_rms(), rel=0.2)


def test_linear_ensemble_covers_the_frequency_integral():
    system = paper_system()
    frequency = np.linspace(EM3.low, EM3.high, 20001)
    response = sd.frequency_response(system, frequency=frequency)
    exact = {
        f"acc_{node}": math.sqrt(
            np.trapezoid(
                np.abs(response["transmissibility"].sel(node=node).to_numpy()) ** 2
                * EM3.density(frequency),
                frequency,
            )
        )
        for node in ("seat", "m1", "m2")
    }
    data = sd.random_response(
        system, sd.RandomMotion(EM3, 300.0, seed=5), realisations=64, confidence=0.999
    )
    for name, value in exact.items():
        row = data.sel(output=name)
        assert row["rms_low"] < value < row["rms_high"]
        assert row["rms_high"] / row["rms_low"] < 1.05


def test_result_depends_on_the_seed_only(tmp_path):
    system = paper_system(*LAWS["gap"])
    motion = sd.RandomMotion(EM3, 20.0, seed=7)
    one = sd.random_response(system, motion, realisations=40, workers=1)
    two = sd.random_response(system, motion, realisations=40, workers=3)
    assert np.array_equal(one["member_rms"], two["member_rms"])
    few = sd.random_response(system, motion, realisations=5)
    assert np.array_equal(one["member_rms"][:5], few["member_rms"])
    other = sd.random_response(system, dataclasses.replace(motion, seed=8), realisations=40)
    assert not np.any(other["member_rms"] == one["member_rms"])


def test_interrupted_run_is_taken_up_again(tmp_path):
    system = paper_system(*LAWS["gap"])
    motion = sd.RandomMotion(EM3, 20.0, seed=7)
    file = tmp_path / "run.npz"
    shares = []

    def interrupt(share):
        shares.append(share)
        if share >= 0.5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sd.random_response(
            system, motion, realisations=64, workers=1, checkpoint=file, progress=interrupt
        )
    assert shares == [0.25, 0.5]
    shares.clear()
    resumed = sd.random_response(
        system, motion, realisations=64, checkpoint=file, progress=shares.append
    )
    assert shares == [0.75, 1.0]
    whole = sd.random_response(system, motion, realisations=64)
    assert np.array_equal(resumed["member_rms"], whole["member_rms"])
    with pytest.raises(sd.RequestError, match=r"excitation was .*7, .* is .*seed=8") as caught:
        sd.random_response(system, dataclasses.replace(motion, seed=8), checkpoint=file)
    assert "system" not in str(caught.value)
    with pytest.raises(sd.RequestError, match="another request: another system"):
        sd.random_response(paper_system(*LAWS["quadratic"]), motion, checkpoint=file)
    for broken in (b"broken", b"", file.read_bytes()[:300]):  # a copy that was cut off, too
        file.write_bytes(broken)
        with pytest.raises(sd.RequestError, match="cannot be read"):
            sd.random_response(system, motion, checkpoint=file)
    with pytest.raises(sd.OutputError, match="was not written"):
        sd.random_response(system, motion, realisations=16, checkpoint=tmp_path / "no" / "a.npz")


def test_ensemble_stops_at_the_interval_asked_for():
    system = paper_system(*LAWS["quadratic"])
    motion = sd.RandomMotion(EM3, 60.0, seed=2)
    data = sd.random_response(system, motion, realisations=2000, interval=0.02)
    half = ((data["rms_high"] - data["rms_low"]) / (2 * data["rms"])).max()
    assert half <= 0.02
    assert data.attrs["realisations"] < 2000
    assert data.attrs["status"] == "ok"


def test_step_error_is_what_halving_shows():
    system = paper_system(*LAWS["coulomb"])
    synthesis = Synthesis(EM3, 40.0)
    steps, error = choose_steps(system, synthesis, 1, 1e-4)
    assert error <= 1e-4
    rough, worse = choose_steps(system, synthesis, 1, 1e-2)
    assert rough < steps
    assert worse > error
    exact, fine = (
        Ensemble.make(system, synthesis, 100, 1, k).run(0).moments[:, 1] ** 0.5
        for k in (16 * steps, rough)
    )
    assert np.max(np.abs(np.sqrt(np.mean((fine / exact - 1) ** 2, 1)))) < 3 * worse


def test_ratio_of_the_same_realisations_is_much_sharper_than_either():
    motion = sd.RandomMotion(sd.NarrowBand(1.55, 0.05, rms=0.7), 200.0, seed=4)
    linear = sd.random_response(paper_system(), motion, realisations=32)
    damped = sd.random_response(paper_system(sd.QuadraticDamper(100.0)), motion, realisations=32)
    ratio = sd.rms_ratio(damped, linear)
    row = ratio.sel(output="acc_m1")
    assert row["low"] < row["ratio"] < row["high"]
    assert float(row["ratio"]) == pytest.approx(
        float(damped.rms.sel(output="acc_m1") / linear.rms.sel(output="acc_m1")), rel=1e-12
    )
    own = damped.sel(output="acc_m1")
    assert (row["high"] - row["low"]) / row["ratio"] < (own.rms_high - own.rms_low) / own.rms / 2
    other = sd.random_response(paper_system(), dataclasses.replace(motion, seed=5), realisations=32)
    with pytest.raises(sd.RequestError, match="same realisations"):
        sd.rms_ratio(damped, other)


def test_unstable_systems_say_so():
    motion = sd.RandomMotion(EM3, 5.0, seed=1)
    unstable = paper_system(c=10.0)
    data = sd.random_response(unstable, motion, realisations=2)
    assert data.attrs["status"] == "unstable"
    assert np.all(np.isnan(data["rms"]))
    held = paper_system(sd.QuadraticDamper(500.0), c=10.0)
    data = sd.random_response(held, motion, realisations=2)
    assert data.attrs["status"] == "ok"

    @sd.force_law({"k": "N/m"})
    def runaway(d, v, p):
        return -p[0] * d

    data = sd.random_response(paper_system(runaway(k=50e3)), motion, realisations=2)
    assert data.attrs["status"] == "diverged"
    assert np.all(np.isnan(data["rms"]))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"realisations": 1}, "realisations"),
        ({"realisations": 2.5}, "whole"),
        ({"interval": 0.0}, "interval"),
        ({"confidence": 1.0}, "confidence"),
        ({"settle": -1.0}, "settle"),
        ({"keep": ["acc_m9"]}, "acc_m"),
        ({"peaks": ["acc_m9"]}, "acc_m"),
        ({"spacing": 0.1}, "spacing"),
        ({"checkpoint": "run.txt"}, "npz"),
    ],
)
def test_bad_requests_are_named(changes, message):
    with pytest.raises(sd.RequestError, match=message):
        sd.random_response(paper_system(), sd.RandomMotion(EM3, 5.0, seed=1), **changes)


def test_only_random_motions():
    with pytest.raises(sd.RequestError, match="RandomMotion"):
        sd.random_response(paper_system(), sd.Sine(1.0, amplitude=1.0))


# --- exact stationary densities under white noise, in the time scale of OMEGA ---------------

OMEGA = 8 * math.pi  # rad/s of the oscillators


@sd.force_law({"k1": "N/m", "k3": "N/m3"})
def duffing(d, v, p):
    return p[0] * d + p[1] * d**3


@sd.force_law({"c1": "N s/m", "c3": "N s/m3", "omega": "1/s"})
def energy_damper(d, v, p):
    rate = v / p[2]
    return (p[0] + p[1] * (rate * rate + d * d) / 2) * v


@sd.force_law({"force": "N"}, jumps_at={"velocity": [0.0]})
def dry(d, v, p):
    return p[0] if v > 0.0 else (-p[0] if v < 0.0 else 0.0)


@dataclasses.dataclass(frozen=True)
class WhiteEnsemble(Ensemble):
    """Accelerations drawn anew at every node and linear between: white up to half the node rate.

    The quintic between nodes is then the exact cubic displacement. `level` is the one-sided
    density at low frequency, 2 variance spacing, in (m/s2)^2/Hz.
    """

    def base(self, block):
        h, nodes = self.synthesis.step, self.synthesis.nodes
        generator = np.random.default_rng([self.seed, block])
        a = math.sqrt(self.level / (2 * h)) * generator.standard_normal((LANES, nodes))
        v, x = np.zeros_like(a), np.zeros_like(a)
        v[:, 1:] = np.cumsum(h * (a[:, :-1] + a[:, 1:]) / 2, axis=1)
        x[:, 1:] = np.cumsum(h * v[:, :-1] + h * h * (2 * a[:, :-1] + a[:, 1:]) / 6, axis=1)
        return x, v, a


class Grid(NamedTuple):
    """Nodes `step` apart."""

    step: float
    nodes: int

    @property
    def intervals(self):
        return self.nodes - 1


def white_sdof():
    zeta, density = 0.1, 1.0
    system = oscillator(sd.Spring(OMEGA**2), sd.Damper(2 * zeta * OMEGA))
    exact = math.sqrt(density / (8 * zeta * OMEGA**3))
    return system, density, "seat-base", exact, 1 / 400, 20.0


def white_duffing():
    zeta, epsilon = 0.1, 0.5
    z = 1 / (8 * epsilon)
    exact = math.sqrt((kv(0.75, z) / kv(0.25, z) - 1) / (2 * epsilon))
    assert exact**2 == pytest.approx(0.5792048, abs=1e-7)
    system = oscillator(
        duffing(k1=OMEGA**2, k3=epsilon * OMEGA**2), sd.Damper(2 * zeta * OMEGA)
    )  # the standard deviation of the linear oscillator is 1 m
    return system, 8 * zeta * OMEGA**3, "seat-base", exact, 1 / 400, 20.0


def white_energy_damping():
    c1, c3, level = 0.1, 0.2, 0.05  # level = pi S0 at omega = 1
    exact = 0.262567638
    weight = [
        quad(lambda h, k=k: h**k * math.exp(-(c1 * h + c3 * h * h / 2) / level), 0, 20)[0]
        for k in range(2)
    ]
    assert weight[1] / weight[0] == pytest.approx(exact, abs=1e-8)
    system = oscillator(
        sd.Spring(OMEGA**2), energy_damper(c1=c1 * OMEGA, c3=c3 * OMEGA, omega=OMEGA)
    )
    return system, 4 * level * OMEGA**3, "seat-base", math.sqrt(exact), 1 / 400, 20.0


def white_dry_friction():
    """Only friction: v' = -mu sgn v + noise; var v = 2 D^2/mu^2, noise of density 4 D one-sided."""
    forgetting, mu = 0.05, 1.0  # s, 4 D/mu^2; m/s2
    strength = forgetting * mu**2 / 4
    exact = math.sqrt(2.0) * strength / mu
    return oscillator(dry(force=mu)), 4 * strength, "vel_seat-base", exact, forgetting / 800, 8.0


CASES = {
    case.__name__: case
    for case in (white_sdof, white_duffing, white_energy_damping, white_dry_friction)
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_intervals_cover_exact_values_as_often_as_they_say(name):
    system, density, output, exact, step, duration = CASES[name]()
    grid = Grid(step, round(1.2 * duration / step))
    settle = round(0.2 * duration / step)
    ensemble = WhiteEnsemble.make(system, grid, settle, 0, 1, level=density)
    column = ensemble.names.index(output)

    def mean_squares(seed):
        return dataclasses.replace(ensemble, seed=seed).run(0).moments[column, 1]

    with ThreadPoolExecutor(2) as pool:
        found = np.array(list(pool.map(mean_squares, range(1000))))  # (seeds, members)
    _, low, high = rms_intervals(found.T, 0.95)
    # noise that is not quite white, and the step, leave a bias; it has to vanish in the intervals
    bias = np.sqrt(found.mean()) / exact - 1
    standard_error = np.median(high / low - 1) / 4
    assert abs(bias) < 0.2 * standard_error
    assert 930 <= np.count_nonzero((low <= exact) & (exact <= high)) <= 970
