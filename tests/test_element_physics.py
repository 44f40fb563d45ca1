"""Elements in motion, against closed forms and independent solvers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq
from scipy.special import gamma

import seatdyn as sd
from conftest import oscillator


def flight(element, speed, mass=1.0, **kwargs):
    """A free mass thrown at `speed` from the middle."""
    system = oscillator(element, mass=mass)
    # at contact a power of 3/2 starts with an unbounded derivative: below the usual tolerance
    kwargs |= {"output_step": 1e-4, "settings": sd.Settings(rtol=1e-9)}
    return sd.simulate(system, sd.Still(), initial=[0.0, speed], **kwargs)


def leaving(run, edge):
    """Time of contact and speed after it, from the straight flights before and after."""
    t, x, v = (run.time.values, run.displacement[0].values, run.velocity[0].values)
    inside = np.flatnonzero(x > edge)
    before, after = inside[0] - 2, inside[-1] + 2
    enter = t[before] + (edge - x[before]) / v[before]
    leave = t[after] - (x[after] - edge) / v[after]
    return leave - enter, -v[after]


def test_hertz_impact_has_its_depth_and_duration():
    """delta_max = (5 m v^2/(4 k))^(2/5), duration 2.943275 delta_max/v (Hertz 1881)."""
    k, m, v = 3e6, 2.5, 0.8
    run = flight(sd.ContactStop(k, 9.0, 0.01), v, mass=m, duration=0.05)
    depth = (5 * m * v**2 / (4 * k)) ** 0.4
    duration, after = leaving(run, 0.01)
    assert run.displacement.values.max() - 0.01 == pytest.approx(depth, rel=1e-4)  # on the grid
    assert duration == pytest.approx(2.943275 * depth / v, rel=2e-6)
    assert after == pytest.approx(v, rel=1e-7)


@pytest.mark.parametrize("damping", [0.3, 2.0])
def test_hunt_crossley_restitution_is_exact(damping):
    """lambda v - ln(1 + lambda v) is the same before and after, whatever k, m and n."""
    run = flight(sd.ContactStop(1e5, 9.0, 0.01, exponent=2.2, damping=damping), 0.6, duration=0.25)
    _, after = leaving(run, 0.01)
    lost = damping * 0.6 - math.log1p(damping * 0.6)
    most = min(0.6, (1 - 1e-12) / damping)
    expected = brentq(lambda e: -damping * e - math.log1p(-damping * e) - lost, 1e-9, most)
    assert after == pytest.approx(expected, rel=1e-6)


def test_damping_helpers_give_their_restitution_near_one():
    for e in (0.95, 0.98):
        for rule in (sd.hunt_crossley, sd.lankarani_nikravesh):
            stop = sd.ContactStop(1e5, 9.0, 0.01, damping=rule(e, impact_speed=0.6))
            _, after = leaving(flight(stop, 0.6, duration=0.2), 0.01)
            assert after / 0.6 == pytest.approx(e, abs=2 * (1 - e) ** 2)


# Amplitude of travel times k over the force m w^2 Y: exact (Den Hartog 1931), for beta, rho
DEN_HARTOG = [
    (0.8, 0.2, 2.711415),
    (0.8, 0.5, 2.332235),
    (1.2, 0.4, 1.902028),
    (1.25, 0.6, 0.988996),
    (1.5, 0.3, 0.721110),
    (2.0, 0.5, 0.220479),
]


@pytest.mark.parametrize(("beta", "rho", "exact"), DEN_HARTOG)
def test_dry_friction_is_den_hartog(beta, rho, exact):
    mass, frequency, level = 2.0, 1.3, 1.5
    k = mass * (2 * math.pi * frequency / beta) ** 2
    friction = sd.StribeckFriction(rho * mass * level, rho * mass * level, 1.0, dry=True)
    state = sd.steady_state(
        oscillator(sd.Spring(k), friction, mass=mass), sd.Sine(frequency, amplitude=level)
    )
    assert state.attrs["status"] == "converged"
    travel = float(state.amplitude.sel(output="seat-base"))
    v, u = 1 / (1 - beta**2), math.tan(math.pi / (2 * beta)) / beta
    closed = math.sqrt(v**2 - rho**2 * u**2)
    assert closed == pytest.approx(exact, abs=6e-7)
    assert travel * k / (mass * level) == pytest.approx(closed, rel=1e-7)


def test_dry_friction_holds_below_its_static_force():
    """Below the break-away level nothing moves; above it something does."""
    friction = sd.StribeckFriction(6.0, 10.0, 0.01, dry=True)
    system = oscillator(sd.Spring(500.0), friction, mass=5.0)

    def travel(level):
        base = sd.Sine(2.0, amplitude=level)
        along = [float(base.displacement(0.0)), float(base.velocity(0.0))]
        run = sd.simulate(system, base, 3.0, initial=along)
        return float(np.abs(run.relative_displacement.sel(pair="seat-base")).max())

    assert travel(1.99) < 1e-9
    assert travel(2.02) > 1e-6


def solved(acceleration, z0, times):
    """Independent solution of x'' = acceleration(t, x, x')."""
    answer = solve_ivp(
        lambda t, y: [y[1], acceleration(t, y[0], y[1])], (0, times[-1]), z0,
        method="DOP853", rtol=1e-12, atol=1e-14, t_eval=times,
    )  # fmt: skip
    return answer.y[0]


def test_air_spring_follows_the_gas_law():
    p0, area, volume, n, mass = 6e5, 4e-3, 8e-4, 1.38, 80.0
    spring = sd.AirSpring(p0, area, volume, n)
    assert spring.tangent()[0] == pytest.approx(n * p0 * area**2 / volume, rel=1e-12)
    run = sd.simulate(oscillator(spring, mass=mass), sd.Still(), 1.0, initial=[-0.1, 0.0])

    def acceleration(t, x, v):
        pressure = p0 * (volume / (volume + area * x)) ** n
        return (pressure - p0) * area / mass

    expected = solved(acceleration, [-0.1, 0.0], run.time.values)
    np.testing.assert_allclose(run.displacement[0], expected, atol=2e-8)


def test_edges_of_the_air_spring_are_where_a_twentieth_is_left():
    for slope in (-0.02, 0.0, 0.03):
        spring = sd.AirSpring(6e5, 4e-3, 8e-4, 1.38, area_slope=slope)
        *_, low, high = spring.lower().parameters
        area = np.polynomial.Polynomial([4e-3, slope])
        left = [8e-4 + area.integ()(low), area(low), area(high)]
        assert min(left[0] / 8e-4, left[1] / 4e-3) == pytest.approx(0.05)
        assert slope >= 0.0 or left[2] / 4e-3 == pytest.approx(0.05)


def test_quasi_zero_stiffness():
    """K/kv = 1 + 2 alpha (1 - gamma^2/(x^2 + gamma^2)^(3/2)), and the period of free motion."""
    kv, ko, length = 5000.0, 2500.0, 0.2
    mechanism = sd.ThreeSpring.quasi_zero(kv, ko, length)
    alpha, ratio = ko / kv, mechanism.span / length
    assert alpha == pytest.approx(ratio / (2 * (1 - ratio)))
    x, h = np.linspace(-0.1, 0.1, 41), 1e-6
    slope = (mechanism.force_at(x + h) - mechanism.force_at(x - h)) / (2 * h)
    closed = 1 + 2 * alpha * (1 - ratio**2 / ((x / length) ** 2 + ratio**2) ** 1.5)
    np.testing.assert_allclose(slope / kv, closed, atol=1e-8)

    mass, amplitude = 60.0, 0.04

    def potential(d):
        return kv * d**2 / 2 + ko * (math.hypot(d, mechanism.span) - length) ** 2

    def slowness(angle):  # x = A sin(angle) takes the square root away
        d = amplitude * math.sin(angle)
        drop = 2 * (potential(amplitude) - potential(d)) / mass
        return amplitude * math.cos(angle) / math.sqrt(drop)

    period = 4 * quad(slowness, 0, math.pi / 2 - 1e-7, epsabs=1e-12)[0]
    run = sd.simulate(
        oscillator(mechanism, mass=mass), sd.Still(), 1.5 * period, initial=[amplitude, 0.0]
    )
    v = run.velocity[0].values
    back = np.flatnonzero((v[1:-1] > 0) & (v[2:] <= 0))[0] + 1
    share = v[back] / (v[back] - v[back + 1])
    measured = run.time.values[back] + share * 1e-3
    assert measured == pytest.approx(period, rel=1e-5)


@pytest.mark.parametrize("exponent", [0.4, 1.5, 3.0])
def test_power_damper_dissipates_its_closed_form(exponent):
    """Per cycle at speed V: pi X c_n V^n (2/sqrt pi) Gamma(n/2 + 1)/Gamma(n/2 + 3/2)."""
    amplitude, omega = 0.01, 12.0
    top = amplitude * omega
    damper = sd.PowerDamper(70.0, exponent, blend=1e-9 if exponent < 1 else 0.0)
    angle = 2 * np.pi * (np.arange(20000) + 0.5) / 20000
    force = damper.force_at(0.0, top * np.cos(angle))
    work = np.sum(force * top * np.cos(angle)) * 2 * np.pi / omega / 20000
    equivalent = 70.0 * top ** (exponent - 1) * 2 / math.sqrt(math.pi)
    equivalent *= gamma(exponent / 2 + 1) / gamma(exponent / 2 + 1.5)
    assert work == pytest.approx(np.pi * equivalent * omega * amplitude**2, rel=1e-6)


def test_balance_damper_cancels_its_spring():
    """On the way to the middle spring and damper carry nothing together, within the limits."""
    damper = sd.BalanceDamper(900.0, 0.0, 1e6)
    d, v = np.random.default_rng(2).uniform(-0.05, 0.05, (2, 400))
    total = 900.0 * d + damper.force_at(d, v)
    assert np.all(np.abs(total[d * v < 0]) < 1e-12)
    assert np.all(damper.force_at(d, v)[d * v >= 0] == 0.0)


def test_scissor_moves_as_its_lagrangian_says():
    """A spring and damper between the feet, in coordinates of the feet's distance."""
    k, c, arm, height, mass = 30e3, 150.0, 0.5, 0.28, 70.0
    system = oscillator(
        sd.ScissorLever(sd.Spring(k), arm, height),
        sd.ScissorLever(sd.Damper(c), arm, height),
        mass=mass,
    )
    run = sd.simulate(system, sd.Still(), 1.5, initial=[-0.06, 0.1])
    rest = math.sqrt(arm**2 - height**2)

    def acceleration(t, x, v):
        h = height + x
        w = math.sqrt(arm**2 - h**2)
        w_rate = -h * v / w
        return (k * (w - rest) + c * w_rate) * h / w / mass

    expected = solved(acceleration, [-0.06, 0.1], run.time.values)
    np.testing.assert_allclose(run.displacement[0], expected, atol=1e-8)


@pytest.mark.parametrize("exponent", [1.0, 2.0])
def test_stribeck_friction_against_an_independent_solver(exponent):
    fc, fs, vs, k, mass = 20.0, 35.0, 0.03, 4000.0, 60.0
    friction = sd.StribeckFriction(fc, fs, vs, exponent, viscous=10.0, slope=300.0)
    system = oscillator(sd.Spring(k), friction, mass=mass)
    run = sd.simulate(system, sd.Sine(1.4, amplitude=2.0), 2.0)
    omega = 2 * math.pi * 1.4

    def acceleration(t, x, v):
        d = x + 2.0 / omega**2 * math.sin(omega * t)
        rate = v + 2.0 / omega * math.cos(omega * t)
        level = fc + (fs - fc) * math.exp(-(abs(rate / vs) ** exponent))
        return -(k * d + level * 2 / math.pi * math.atan(300 * rate) + 10.0 * rate) / mass

    expected = solved(acceleration, [0.0, 0.0], run.time.values)
    np.testing.assert_allclose(run.displacement[0], expected, atol=3e-8)


# ---------------------------------------------------------------- what is refused


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: sd.StribeckFriction(20.0, 10.0, 0.1), "static = 10 N is not allowed"),
        (lambda: sd.StribeckFriction(20.0, 30.0, 0.0), "StribeckFriction.speed"),
        (lambda: sd.PowerDamper(10.0, 0.5), "blend = 0 m/s is not allowed"),
        (lambda: sd.BalanceDamper(10.0, 5.0, 1.0), "maximum = 1 N s/m is not allowed"),
        (lambda: sd.ThreeSpring.quasi_zero(10.0, 0.0, 0.1), "oblique = 0"),
        (lambda: sd.ScissorLever(sd.Spring(1.0), 0.3, 0.4), "height = 0.4 m is not allowed"),
        (lambda: sd.ScissorLever("spring", 0.3, 0.2), "must be an element"),
        (lambda: sd.Lever(sd.Spring(1.0), (0.5, 20.0), 0.1, 0.1), "positive over the whole"),
        (lambda: sd.lankarani_nikravesh(1.2, 0.5), "restitution = 1.2"),
        (lambda: sd.ScissorLever(late(edge=0.3, k=2.0), 0.5, 0.3).lower(), "cannot carry over"),
    ],
)
def test_refused(make, message):
    with pytest.raises(sd.ModelError, match=message):
        make()


@sd.force_law({"k": "N", "edge": "m/s"}, jumps_at={"velocity": ["edge"]})
def late(d, v, p):
    return p[0] if v > p[1] else 0.0
