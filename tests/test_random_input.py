"""Spectra, their realisations, and random base motion."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest
from scipy import stats
from scipy.integrate import cumulative_simpson, quad

import seatdyn as sd
from seatdyn.signals.spectrum import Spectrum
from seatdyn.signals.synthesis import Synthesis, member_generator, synthesise_many
from seatdyn.standards.inputs import INPUT_CLASSES

EM3 = sd.seat_test_input("EM3")
RESONANT = sd.NarrowBand(1.55, 0.2, rms=0.7)
FLAT = sd.NarrowBand(1.7, 1.0, rms=0.6, shape="rectangular")
ROAD = sd.Road("C", speed=10.0, highest=1.0)

# R.m.s. velocity (m/s) and displacement (mm) above 0.3 Hz, worked out apart from this package.
MOTION = {
    "EM1": (0.1410, 13.48), "EM2": (0.1538, 13.89), "EM3": (0.1296, 11.70), "EM4": (0.0722, 6.53),
    "EM7": (0.1108, 5.61), "EM8": (0.0457, 2.42), "EM9": (0.0586, 2.57), "IT1": (0.0447, 1.54),
    "IT4": (0.1194, 10.79), "AG2": (0.1320, 9.30), "AG3": (0.1266, 9.54),
}  # fmt: skip
PEAKS = {"EM1": (2.210, 1.94), "EM5": (0.764, 2.09), "EM6": (0.341, 7.65), "AG1": (5.547, 3.24)}


# ---------------------------------------------------------------- spectra


@pytest.mark.parametrize("name", INPUT_CLASSES)
def test_class_integrates_to_its_target(name):
    spectrum = sd.seat_test_input(name)
    rms = spectrum.acceleration_rms(0.89, spectrum.high)
    assert rms == pytest.approx(spectrum.target, rel=5e-3)
    square = quad(lambda f: float(spectrum.density(f)), 0.89, spectrum.high, limit=200)[0]
    assert rms == pytest.approx(math.sqrt(square), rel=1e-8)


@pytest.mark.parametrize("name", MOTION)
def test_class_has_the_motion_worked_out_elsewhere(name):
    spectrum, (velocity, displacement) = sd.seat_test_input(name), MOTION[name]
    assert spectrum.velocity_rms() == pytest.approx(velocity, abs=1.5e-4)
    assert 1000 * spectrum.displacement_rms() == pytest.approx(displacement, abs=6e-3)


@pytest.mark.parametrize("name", PEAKS)
def test_class_peaks_where_it_should(name):
    f = np.linspace(0.5, 11.0, 100001)
    density = sd.seat_test_input(name).density(f)
    assert density.max() == pytest.approx(PEAKS[name][0], abs=6e-4)
    assert f[np.argmax(density)] == pytest.approx(PEAKS[name][1], abs=6e-3)


@pytest.mark.parametrize("spectrum", [EM3, sd.seat_test_input("EM5"), RESONANT, FLAT, ROAD])
def test_shaping_filter_has_the_density(spectrum):
    f = np.geomspace(spectrum.low, spectrum.high, 50)
    power = np.abs(spectrum.shaping.response(f)) ** 2
    np.testing.assert_allclose(power, spectrum.density(f), rtol=1e-12)
    assert all(np.real(pole) < 0.0 for pole in spectrum.shaping.poles)


def test_narrow_band_is_the_filter_it_says():
    noise = sd.NarrowBand(1.55, 0.02, rms=0.686)
    assert noise.acceleration_rms() == pytest.approx(0.686, rel=1e-12)
    square = quad(lambda f: float(noise.density(f)), 0.155, 15.5, points=[1.55], limit=500)[0]
    assert math.sqrt(square) == pytest.approx(0.686, rel=1e-8)
    top = float(noise.density(1.55))
    half = [math.sqrt(1.55**2 + 0.01**2) + side * 0.01 for side in (-1, 1)]
    np.testing.assert_allclose(noise.density(half), top / 2, rtol=1e-9)
    # uncut: mean square = G0 pi B/2; the cuts at a tenth and ten times f0 take 0.2 % of it
    assert top * math.pi * 0.02 / 2 == pytest.approx(0.686**2, rel=2e-3)
    assert FLAT.density([1.19, 1.21, 2.19, 2.21]).tolist() == pytest.approx([0, 0.36, 0.36, 0])


def test_road_has_the_densities_of_iso_8608():
    road, level = sd.Road("C", speed=12.0), 256e-6
    f = np.array([0.5, 2.0, 20.0])
    wave = f / 12.0
    displacement = level * (wave / 0.1) ** -2 / 12.0
    np.testing.assert_allclose(road.density(f), displacement * (2 * np.pi * f) ** 4, rtol=1e-12)
    exact = math.sqrt(level * 0.1**2 * (1 / 0.01 - 1 / 10))
    assert road.displacement_rms() == pytest.approx(exact, rel=1e-9)
    velocity = math.sqrt(4 * math.pi**2 * 0.1**2 * 12.0 * level * (road.high - road.low))
    assert road.velocity_rms() == pytest.approx(velocity, rel=1e-9)


def test_table_is_straight_in_logarithms():
    table = sd.SpectrumTable([1.0, 2.0, 8.0], [1.0, 8.0, 0.5])
    assert table.density(math.sqrt(2.0)) == pytest.approx(math.sqrt(8.0))
    assert table.density([0.99, 8.01]).tolist() == [0.0, 0.0]
    # f^3 from 1 to 2, then 32 f^-2
    square = (2**4 - 1) / 4 + 32 * (1 / 2 - 1 / 8)
    assert table.acceleration_rms() ** 2 == pytest.approx(square, rel=1e-9)
    assert table.acceleration_rms(2.0, 4.0) ** 2 == pytest.approx(32 * (1 / 2 - 1 / 4), rel=1e-9)
    formula = sd.SpectrumFormula(lambda f: f**3, 1.0, 2.0)
    assert formula.velocity_rms() ** 2 == pytest.approx((4 - 1) / 2 / (2 * math.pi) ** 2)
    assert formula.displacement_rms() ** 2 == pytest.approx(math.log(2) / (2 * math.pi) ** 4)


def test_spectra_are_told_apart():
    short = sd.SpectrumTable([1.0, 2.0], [0.5, 0.5])
    assert repr(short) == "SpectrumTable((1.0, 2.0), (0.5, 0.5))"
    f = np.linspace(1.0, 2.0, 50)
    long, other = sd.SpectrumTable(f, f), sd.SpectrumTable(f, 2 * f)
    assert repr(long).startswith("SpectrumTable(50 points, 1.0 .. 2.0 Hz, sha256=")
    assert repr(long) != repr(other)
    formulas = [sd.SpectrumFormula(lambda f, c=c: c * f, 1.0, 2.0) for c in (1.0, 1.0, 2.0)]
    assert repr(formulas[0]) == repr(formulas[1]) != repr(formulas[2])
    assert repr(sd.seat_test_input("EM3")) == "SeatTestInput(name='EM3', low=0.3)"


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: sd.seat_test_input("EM31"), r"'EM31'\. Did you mean 'EM3'"),
        (lambda: sd.seat_test_input("EM3", low=2.0), r"low = 2 Hz .* 0\.001 \.\. 0\.89 Hz"),
        (lambda: sd.Road("I", speed=10.0), "road_class = 'I' .* A, B, C"),
        (lambda: sd.Road("A", speed=0.0), r"Road\.speed = 0 m/s"),
        (lambda: sd.Road("A", 10.0, lowest=1.0, highest=0.5), "must lie below"),
        (lambda: sd.NarrowBand(1.5, 0.1), "rms"),
        (lambda: sd.NarrowBand(1.5, 4.0, rms=1.0, shape="rectangular"), "bandwidth < 2 centre"),
        (lambda: sd.NarrowBand(1.5, 0.1, rms=1.0, shape="round"), "shape = 'round'"),
        (lambda: sd.NarrowBand(1.5, 0.1, rms=1.0, cuts=(2.0, 3.0)), "between the cuts"),
        (lambda: sd.NarrowBand(1.5, 0.1, rms=1.0, cuts=3.0), "two frequencies"),
        (
            lambda: sd.NarrowBand(1.5, 0.1, rms=1.0, cuts=(1.0, 2.0), shape="rectangular"),
            "cuts belong to the resonant shape",
        ),
        (lambda: sd.SpectrumTable([1.0, 2.0], [1.0]), "give 2 to"),
        (lambda: sd.SpectrumTable([1.0, 2.0, 3.0], [1.0, 2.0]), "3 frequencies and 2 values"),
        (lambda: sd.SpectrumTable([2.0, 1.0], [1.0, 1.0]), r"frequency\[1\] = 1 Hz must exceed"),
        (lambda: sd.SpectrumTable([1.0, 2.0], [1.0, 0.0]), r"values\[1\] = 0 .* number > 0"),
        (lambda: sd.SpectrumTable(["a", "b"], [1.0, 0.0]), "list of numbers"),
        (lambda: sd.SpectrumFormula(lambda f: -f, 1.0, 2.0), "gives -1 at 1 Hz"),
        (lambda: sd.SpectrumFormula(3.0, 1.0, 2.0), "no function"),
        (lambda: sd.RandomMotion(EM3, 10.0, seed=-1), "seed = -1"),
        (lambda: sd.RandomMotion(EM3, 10.0, seed=1.5), "seed = 1.5"),
        (lambda: sd.RandomMotion(EM3, 10.0, seed=1, ramp=6.0), "ramp = 6 s"),
        (lambda: sd.RandomMotion("EM3", 10.0, seed=1), "no spectrum; use NarrowBand"),
        (lambda: sd.RandomMotion(EM3, 1e6, seed=1), "Shorten it"),
        (lambda: sd.RandomMotion(EM3, 10.0, seed=1, kind="sines"), "kind = 'sines'"),
        (lambda: sd.RandomMotion(EM3, 10.0, seed=1, kind="random-phase"), "too short for random"),
        (lambda: EM3.acceleration_rms(5.0, 3.0), "must lie below"),
    ],
)
def test_bad_requests_say_what_is_wrong(make, message):
    error = TypeError if message == "rms" else sd.ExcitationError
    with pytest.raises(error, match=message):
        make()


# ---------------------------------------------------------------- realisations


def exact(plan, coefficients, time):
    """Displacement, velocity and acceleration as the sum of all lines, at any time."""
    omega = plan._lines[1]
    wave = np.exp(1j * np.outer(time, omega))
    return [(wave @ (coefficients * (1j * omega) ** (order - 2))).real for order in range(3)]


def test_nodes_are_the_sum_of_the_lines():
    plan = Synthesis(EM3, 20.0)
    drawn = plan.coefficients(member_generator(3, 0))
    motion = plan.realise(member_generator(3, 0))
    for got, wanted in zip(motion[1:], exact(plan, drawn, motion.time), strict=True):
        np.testing.assert_allclose(got, wanted, atol=1e-12 * np.abs(wanted).max())


@pytest.mark.parametrize(
    ("spectrum", "bounds"),
    [
        # a line at the top of the band: the limits that the module states, of the largest value
        (sd.NarrowBand(10.0, 1e-3, rms=1.0, shape="rectangular"), (1.4e-6, 8e-6, 9e-5)),
        (EM3, (2e-9, 1e-7, 5e-6)),
    ],
)
def test_quintics_between_the_nodes_are_as_accurate_as_stated(spectrum, bounds):
    motion = sd.RandomMotion(spectrum, 20.0, seed=4, ramp=0.0)
    drawn = motion.synthesis.coefficients(member_generator(4, 0))
    time = np.random.default_rng(1).uniform(0.0, 20.0, 3000)
    for order, wanted in enumerate(exact(motion.synthesis, drawn, time)):
        got = motion.motion.evaluate(time, order)
        assert np.abs(got - wanted).max() < bounds[order] * np.abs(wanted).max()


def test_members_do_not_depend_on_the_batch():
    plan = Synthesis(EM3, 12.0)
    many = synthesise_many(EM3, 12.0, seed=9, members=19)
    few = synthesise_many(EM3, 12.0, seed=9, members=2, first=15)
    stream = np.random.Generator(np.random.PCG64(np.random.SeedSequence(9).spawn(17)[16]))
    alone = plan.realise(stream)
    for a, b, c in zip(many[1:], few[1:], alone[1:], strict=True):
        np.testing.assert_allclose(a[:, 15:17], b, rtol=0, atol=1e-14)
        np.testing.assert_allclose(a[:, 16], c, rtol=0, atol=1e-14)
    correlation = np.corrcoef(many.acceleration.T)
    assert np.abs(correlation - np.eye(19)).max() < 0.6
    with pytest.raises(sd.ExcitationError, match="nodes"):
        plan.fill(1, np.empty((3, 2)), np.empty((3, 2)), np.empty((3, 2)))


def test_spectrum_of_realisations_passes_a_chi_square_test():
    """Periodograms of windowed records, not of whole transforms: 2 P/G is chi-square with 2."""
    duration, members = 100.0, 150
    motion = synthesise_many(EM3, duration, seed=11, members=members)
    window = np.hanning(motion.acceleration.shape[0])[:, None]
    spectrum = np.fft.rfft(motion.acceleration * window, axis=0)
    power = 2 * motion.step / np.sum(window**2) * np.abs(spectrum) ** 2
    f = np.fft.rfftfreq(window.size, motion.step)
    chosen = np.flatnonzero((f > 1.0) & (f < 11.0))[::4]  # apart enough to be independent
    squares = (2 * power[chosen] / EM3.density(f[chosen])[:, None]).sum(1)
    shares = stats.chi2.cdf(squares, 2 * members)
    assert stats.kstest(shares, "uniform").pvalue > 0.01
    total = stats.chi2.cdf(squares.sum(), 2 * members * chosen.size)
    assert 0.005 < total < 0.995
    # the same test tells a spectrum that is 3 % too high
    assert stats.chi2.cdf(squares.sum() / 1.03, 2 * members * chosen.size) < 1e-4


def test_covariance_over_a_record_shorter_than_its_memory():
    """A record of 30 s of a band that remembers 50 s must not be periodic over 30 s."""
    noise = sd.NarrowBand(1.55, 0.02, rms=1.0, cuts=(0.5, 3.0))
    motion = synthesise_many(noise, 30.0, seed=2, members=2000)
    lags = np.array([0.0, 10.0, 25.0, 30.0])
    place = np.round(lags / motion.step).astype(int)
    at = motion.acceleration
    got = [np.mean(at[0] * at[k]) for k in place]
    time = motion.step * place
    wanted = [
        noise.mean_squares([0.5, 3.0])[0] if t == 0.0 else quad(
            lambda f: float(noise.density(f)), 0.5, 3.0, weight="cos", wvar=2 * np.pi * t,
            limit=2000,
        )[0]
        for t in time
    ]  # fmt: skip
    assert max(np.abs(wanted[1:])) > 0.2
    np.testing.assert_allclose(got, wanted, atol=4 / math.sqrt(2000))


def relative_error(spectrum, power, seconds):
    """Standard error of a mean square over its value, for a Gaussian record of this length."""
    f = np.linspace(spectrum.low, spectrum.high, 200001)
    g = spectrum.density(f) * (2 * np.pi * f) ** power
    step = f[1] - f[0]
    return math.sqrt(np.sum(g**2) * step / seconds) / (np.sum(g) * step)


@pytest.mark.parametrize("spectrum", [RESONANT, ROAD, sd.seat_test_input("EM6")])
def test_levels_are_those_of_the_spectrum(spectrum):
    seconds, members = 60.0, 64
    motion = synthesise_many(spectrum, seconds, seed=1, members=members)
    wanted = [spectrum.mean_squares([spectrum.low, spectrum.high], p)[0] for p in (-4, -2, 0)]
    for values, square, power in zip(motion[1:], wanted, (-4, -2, 0), strict=True):
        error = relative_error(spectrum, power, seconds * members)
        assert np.mean(values**2) == pytest.approx(square, rel=4 * error)
        assert error < 0.1
    kurtosis = stats.kurtosis(motion.acceleration[::50].ravel())
    assert abs(kurtosis) < 0.5


def test_a_thousand_long_records_do_not_drift():
    """600 s of EM3, 1000 seeds: displacement as the spectrum says, at the end as at the begin."""
    plan = Synthesis(EM3, 600.0)
    block = 40
    x, v, a = (np.empty((plan.nodes, block)) for _ in range(3))
    squares, means, parts = [], [], []
    for first in range(0, 1000, block):
        plan.fill(20, x, v, a, first=first)
        tenths = np.array_split(np.square(x, out=v), 10)
        parts.append([part.mean() for part in tenths])
        squares.append(np.mean(parts[-1]))
        means.append(x.mean(0))
    wanted = EM3.displacement_rms() ** 2
    error = relative_error(EM3, -4, 600.0 * 1000)
    assert error < 2e-3
    assert np.mean(squares) == pytest.approx(wanted, rel=3.5 * error)
    of_tenth = np.mean(parts, axis=0) / wanted - 1.0
    assert np.abs(of_tenth).max() < 4 * error * math.sqrt(10)
    assert np.abs(means).max() < 0.02 * math.sqrt(wanted)


def test_random_phases_have_the_spectrum_in_every_record():
    plan = Synthesis(EM3, 40.0, "random-phase")
    motion = synthesise_many(EM3, 40.0, seed=5, members=5, kind="random-phase")
    a = motion.acceleration
    np.testing.assert_allclose(np.sqrt(np.mean(a[:-1] ** 2, axis=0)), EM3.acceleration_rms())
    np.testing.assert_allclose(a[-1], a[0])
    lines = np.abs(np.fft.rfft(a[:-1], axis=0)) / (a.shape[0] - 1) * math.sqrt(2)
    f = np.fft.rfftfreq(a.shape[0] - 1, plan.step)
    edges = np.array([1.9875, 2.0125])
    np.testing.assert_allclose(lines[np.argmin(np.abs(f - 2.0))] ** 2, EM3.mean_squares(edges)[0])
    assert plan.period == pytest.approx(40.0)


def test_gaussian_records_do_not_repeat():
    plan = Synthesis(EM3, 40.0)
    assert plan.period > 40.0 + 4.0 / 0.3
    motion = plan.realise(member_generator(1, 0))
    assert motion.time[-1] == pytest.approx(40.0)
    assert abs(motion.acceleration[-1] - motion.acceleration[0]) > 1e-3


# ---------------------------------------------------------------- base motion


@pytest.mark.parametrize("kind", ["gaussian", "random-phase"])
def test_random_motion_is_consistent_and_ends_at_rest(kind):
    motion = sd.RandomMotion(EM3, 30.0, seed=3, kind=kind)
    t = np.linspace(0.0, 30.0, 200001)
    x, v, a = motion.displacement(t), motion.velocity(t), motion.acceleration(t)
    assert np.abs(cumulative_simpson(a, x=t, initial=0) - v).max() < 1e-7
    assert np.abs(cumulative_simpson(v, x=t, initial=0) - x).max() < 1e-9
    for values in (x, v, a):
        assert values[0] == 0.0
    for derivative in range(3):
        assert abs(motion.motion.evaluate(30.0 - 1e-9, derivative)) < 1e-6
        assert motion.motion.evaluate(31.0, derivative) == 0.0
    begin, end = motion.steady
    raw = motion.realise()
    inside = (raw.time > begin) & (raw.time < end)
    np.testing.assert_allclose(motion.acceleration(raw.time[inside]), raw.acceleration[inside])


def test_random_motion_drives_a_run():
    from conftest import paper_system

    system = paper_system(sd.QuadraticDamper(100.0))
    motion = sd.RandomMotion(EM3, 10.0, seed=1)
    run = sd.simulate(system, motion, duration=10.0, output_step=0.01)
    assert run.attrs["status"] == "ok"
    assert "seed=1" in run.attrs["inputs"]
    assert abs(run.attrs["energy_residual"]) < 1e-7
    other = sd.simulate(system, motion.of_member(1), duration=10.0, output_step=0.01)
    assert np.abs(run.acceleration - other.acceleration).max() > 1.0


@dataclass(frozen=True)
class OnePeak(Spectrum):
    """A spectrum of one's own, as CONTRIBUTING shows it."""

    level: float
    peak: float
    ratio: float
    low: float
    high: float

    def inside(self, frequency):
        f, f0 = frequency, self.peak
        return self.level * f**4 / ((f0**2 - f**2) ** 2 + (2 * self.ratio * f0 * f) ** 2)


def test_a_spectrum_of_ones_own_needs_its_band_and_density_only():
    own = OnePeak(0.2, 2.0, 0.3, 0.4, 8.0)
    square = quad(lambda f: float(own.density(f)), 0.4, 8.0)[0]
    assert own.acceleration_rms() == pytest.approx(math.sqrt(square), rel=1e-9)
    motion = synthesise_many(own, 60.0, seed=1, members=20)
    error = relative_error(own, 0, 1200.0)
    assert np.mean(motion.acceleration**2) == pytest.approx(square, rel=4 * error)
    assert own.shaping is None
    assert sd.RandomMotion(own, 60.0, seed=1).steady[0] > 0.5
