"""Propagators of the ensemble kernel: one step of a system relative to its base."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from seatdyn.analysis.lowering import lower
from seatdyn.analysis.outputs import (
    across,
    body_force,
    motion_of,
    named_outputs,
    suspension_forces,
)
from seatdyn.analysis.run import Samples
from seatdyn.kernels.columns import ELEMENTS, FIRST, SECOND
from seatdyn.kernels.ensemble import March
from seatdyn.kernels.plant import Plant
from seatdyn.model.body import SEAT
from seatdyn.model.excitation import Motion
from seatdyn.model.system import BASE, SeatSystem

Array = NDArray[np.float64]
POWERS = 6  # coefficients of the base displacement: a quintic
INVARIANT = 1e-10  # of the stiffness or damping: a sum below it is zero, and motion without effect


def make_march(system: SeatSystem, spacing: float, steps: int) -> tuple[tuple[str, ...], March]:
    """Names of the outputs, and the propagators for `steps` steps in `spacing` (s)."""
    plant = lower(system, Motion())
    own, drive = relative_dynamics(plant)
    n, m = own.shape[0], plant.gain.shape[0]
    n2, h = 2 * n, spacing / steps

    # y' = A y + G (x0, x0', x0'') - pull f with x0 a quintic and every f a parabola in time
    size = n2 + POWERS + 3 * m
    augmented = np.zeros((size, size))
    augmented[:n, n:n2] = np.eye(n)
    augmented[n:n2, :n2] = own
    augmented[n:n2, n2 : n2 + 3] = drive
    shift = np.arange(n2, n2 + POWERS - 1)
    augmented[shift, shift + 1] = 1.0
    force = n2 + POWERS
    augmented[n:n2, force : force + m] = -plant.pull
    chain = np.arange(force, size - m)
    augmented[chain, chain + m] = 1.0
    whole, half = expm(augmented * h)[:n2].T, expm(augmented * (h / 2))[:n2].T  # row a source

    incidence = np.zeros((n2, 2 * m))
    for j in range(m):
        for node, sign in ((plant.channels[j, FIRST], -1.0), (plant.channels[j, SECOND], 1.0)):
            if node >= 0:
                incidence[node, j] += sign
                incidence[n + node, m + j] += sign

    inputs = hermite(h) @ whole[n2:force]
    half_inputs = hermite(h) @ half[n2:force]
    # h phi_k(h A) pull, k = 1, 2, 3: responses to a force 1, t/h, t^2/2h^2; the same for h/2
    constant, linear, square = (whole[force + k * m : force + (k + 1) * m] / h**k for k in range(3))
    short, ramp = (half[force + k * m : force + (k + 1) * m] / (h / 2) ** k for k in range(2))
    stages = [short, short - 2 * ramp, constant - 2 * linear, 2 * ramp, 2 * linear]
    weights = [
        constant - 3 * linear + 4 * square,
        2 * linear - 4 * square,
        2 * linear - 4 * square,
        4 * square - linear,
    ]
    names, outputs = output_matrix(system, plant)
    return names, March(
        state=np.ascontiguousarray(whole[:n2]),
        inputs=np.ascontiguousarray(inputs),
        forces=np.concatenate(weights),
        middle=np.concatenate([half[:n2], half_inputs]) @ incidence,
        end=np.concatenate([whole[:n2], inputs]) @ incidence,
        stages=np.concatenate(stages) @ incidence,
        inside=np.stack([quintic(spacing, (k + 1) * h) for k in range(steps)]),
        outputs=outputs,
        channels=plant.channels,
        elements=plant.elements,
        parameters=plant.parameters,
    )


def relative_dynamics(plant: Plant) -> tuple[Array, Array]:
    """Relative accelerations (N, 2N) per state [r, r'] and (N, 3) per base x, v, a; no channels.

    Where the system is invariant to translation or to velocity the base x or v has no effect.
    """
    n = plant.linear.shape[0]
    drive = np.empty((n, 3))
    for order in range(2):
        own, base = plant.linear[:, order * n : (order + 1) * n], plant.linear[:, 2 * n + order]
        total = own.sum(1) + base
        size = np.abs(own).sum(1) + np.abs(base)
        drive[:, order] = np.where(np.abs(total) > INVARIANT * size, total, 0.0)
    drive[:, 2] = -1.0
    return plant.linear[:, : 2 * n], drive


def hermite(spacing: float) -> Array:
    """From x, v, a at both ends of an interval to x and its five derivatives at the start, (6, 6).

    Row a source.
    """
    k = np.arange(POWERS)
    rows = [np.eye(POWERS)[order] for order in range(3)]
    rows += [_taylor(1.0, order) for order in range(3)]
    scale_sources = np.tile(spacing ** np.arange(3.0), 2)
    inverse = np.linalg.inv(np.array(rows)).T
    return np.asarray(scale_sources[:, None] * inverse / spacing**k)


def quintic(spacing: float, time: float) -> Array:
    """From x, v, a at both ends of an interval to x, v, a at `time` after its start, (6, 3)."""
    return np.asarray(hermite(spacing) @ np.array([_taylor(time, k) for k in range(3)]).T)


def _taylor(time: float, order: int) -> Array:
    """Weights of the derivatives at 0 in the derivative `order` at `time`, (6,)."""
    weights = np.zeros(POWERS)
    weight = 1.0
    for k in range(order, POWERS):
        weights[k] = weight
        weight *= time / (k - order + 1)
    return weights


def all_outputs(system: SeatSystem, samples: Samples) -> dict[str, Array]:
    """The outputs of a random response: those of a steady state, and some that only it needs."""
    force = suspension_forces(system, samples)
    return {
        "acc_base": motion_of(system, samples, BASE, 2),
        **named_outputs(system, samples),
        "vel_seat-base": across(system, samples, (BASE, SEAT), 1),
        "F_suspension": force["spring"] + force["damper"] + force["nonlinear"],
        "F_body": body_force(system, samples),
    }


def output_matrix(system: SeatSystem, plant: Plant) -> tuple[tuple[str, ...], Array]:
    """Names of the outputs and their weights (2N + 3 + e, s) of state, base and element forces."""
    n, e = plant.linear.shape[0], plant.elements.shape[0]
    size = 3 * n + 3 + e
    unit = np.eye(size)
    samples = Samples(
        time=np.zeros(size),
        base=unit[:, 3 * n : 3 * n + 3].T,
        displacement=unit[:, :n],
        velocity=unit[:, n : 2 * n],
        acceleration=unit[:, 2 * n : 3 * n],
        force=unit[:, 3 * n + 3 :],
        elastic=np.zeros((size, e)),
    )
    outputs = all_outputs(system, samples)
    weights = np.column_stack(list(outputs.values()))
    state, acceleration = weights[: 2 * n], weights[2 * n : 3 * n]
    base, force = weights[3 * n : 3 * n + 3].copy(), weights[3 * n + 3 :].copy()

    own, drive = relative_dynamics(plant)
    for order in range(3):  # absolute motion is the relative one and that of the base
        base[order] += weights[order * n : (order + 1) * n].sum(0)
    base += drive.T @ acceleration
    for j in range(plant.gain.shape[0]):
        lost = plant.pull[:, j] @ acceleration
        force[plant.channels[j, ELEMENTS] : plant.channels[j + 1, ELEMENTS]] -= lost
    return tuple(outputs), np.concatenate([state + own.T @ acceleration, base, force])
