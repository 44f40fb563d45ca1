"""The clock of a record: sampling rate from instants, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from seatdyn.errors import MeasurementError

Array = NDArray[np.float64]

FEWEST_INSTANTS = 8
UNEVEN = 1e-2  # of the sampling interval: a larger deviation is a gap
SAME_RATE = 1e-3  # relative: what a stated rate may differ from that of the instants
LARGEST_DRIFT = 0.5  # samples: what instants may wander from an even clock
STRETCH = 0.9  # of the steps in a stretch that must agree, for it to have a rate of its own
FEWEST_DIGITS, MOST_DIGITS = 0, 9  # behind the decimal point of instants in s
LOOKED_AT = 1000  # steps from which the rounding of instants is seen
PARTS = 4  # of these steps, each of which must show it
NOT_ONCE = 0.02  # share of the steps: more often than by accident


def rate_of(time: Array, source: str, place: Callable[[int], str]) -> float:
    """Sampling rate in Hz of instants in s.

    Parameters
    ----------
    time : instants, at least 8, finite
    source : what they are from, for the messages
    place : name of a sample such as "line 17", for the messages

    Raises
    ------
    MeasurementError
        Too few instants, time runs backwards, samples are missing, or the rate changes.
    """
    if time.size < FEWEST_INSTANTS:
        raise MeasurementError(
            f"{source} has {time.size} samples; a record must have at least {FEWEST_INSTANTS}."
        )
    steps = np.diff(time)
    if np.any(steps <= 0.0):
        i = int(np.argmax(steps <= 0.0))
        raise MeasurementError(
            f"{source}: time goes from {time[i]:.9g} to {time[i + 1]:.9g} s after {place(i)}. "
            "Time must increase: sort the record, or remove what was stored twice. If the instants "
            "are rounded, remove them and give the rate of the instrument."
        )
    usual, unit = float(np.median(steps)), _rounding(time)
    if unit > 0.0:
        usual = float(np.mean(steps[:LOOKED_AT]))
    wrong = np.abs(steps - usual) > UNEVEN * usual + 1.01 * unit
    if np.any(wrong):
        _refuse_uneven(time, wrong, usual, source, place)
    rate = (time.size - 1) / float(time[-1] - time[0])
    if unit > 0.0:
        # the last instant is rounded, too; the slope of a line through all of them is not
        centred = np.arange(time.size) - (time.size - 1) / 2
        rate = float((centred @ centred) / (centred @ time))
    drift = float(np.max(np.abs(time - time[0] - np.arange(time.size) / rate)))
    if drift > LARGEST_DRIFT / rate + unit:
        raise MeasurementError(
            f"{source}: the instants wander by {1e3 * drift:.3g} ms, {drift * rate:.3g} samples, "
            "from an even clock. Resample the record, or remove the instants and give the rate of "
            "the instrument."
        )
    return rate


def _rounding(time: Array) -> float:
    """Unit of the last digit of instants, s, where their steps differ because of it; else 0."""
    head = time[: LOOKED_AT + 1]
    for digits in range(FEWEST_DIGITS, MOST_DIGITS + 1):
        unit = 10.0**-digits
        counts = head / unit
        if np.allclose(counts, np.round(counts), rtol=0.0, atol=1e-3):
            steps = np.diff(np.round(counts))
            low = steps.min()
            # rounding mixes two neighbouring steps everywhere; a change of rate does so once
            shares = [np.mean(part > low) for part in np.array_split(steps, PARTS)]
            mixed = min(shares) > NOT_ONCE and max(shares) < 1 - NOT_ONCE
            return unit if mixed and steps.max() == low + 1 else 0.0
    return 0.0


def _refuse_uneven(
    time: Array, wrong: NDArray[np.bool_], usual: float, source: str, place: Callable[[int], str]
) -> None:
    steps, i = np.diff(time), int(np.argmax(wrong))
    # the median may lie on either side of a change of rate
    for cut in (i, steps.size - int(np.argmax(wrong[::-1]))):
        before, after = steps[:cut], steps[cut:]
        if min(before.size, after.size) < 2:
            continue
        first, second = float(np.median(before)), float(np.median(after))
        alike = min(
            np.mean(np.abs(part - middle) <= UNEVEN * middle)
            for part, middle in ((before, first), (after, second))
        )
        if alike > STRETCH and abs(second / first - 1.0) > UNEVEN:
            raise MeasurementError(
                f"{source}: the sampling rate changes from {1 / first:.6g} to {1 / second:.6g} Hz "
                f"after {place(cut)} (t = {time[cut]:.6g} s). Split the record there, or resample "
                "it to one rate."
            )
    missing = round(float(steps[i]) / usual) - 1
    where = f"after {place(i)} (t = {time[i]:.6g} s)"
    step = f"the step is {steps[i]:.4g} s, elsewhere {usual:.4g} s"
    if missing < 1:
        raise MeasurementError(
            f"{source} has an uneven clock {where}: {step}; so are {np.count_nonzero(wrong)} of "
            f"{steps.size} steps. Resample the record, or remove the instants and give the rate of "
            "the instrument."
        )
    raise MeasurementError(
        f"{source} has a gap {where}, samples missing: {missing}; {step}. Cut the record there, or "
        "resample it."
    )


def require_rate(stated: float, found: float, source: str) -> None:
    """Refuse a stated rate that the time column contradicts."""
    if abs(stated / found - 1.0) > SAME_RATE:
        raise MeasurementError(
            f"{source} has a time column with {found:.6g} Hz, but a rate of {stated:.6g} Hz was "
            "given. Leave the rate out, or correct it."
        )
