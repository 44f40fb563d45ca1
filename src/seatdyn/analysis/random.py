"""Random response: an ensemble of time runs, and how well it determines each r.m.s. value."""

from __future__ import annotations

import json
import math
import os
import reprlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import seatdyn
from seatdyn.analysis.checkpoint import Checkpoint
from seatdyn.analysis.ensemble import LONGEST_STEP, Members, settling_time
from seatdyn.analysis.ensemble_runs import ensemble_for, steps_for
from seatdyn.analysis.linear import poles
from seatdyn.analysis.random_linear import NOTE, output_coords
from seatdyn.analysis.transient import check_request
from seatdyn.errors import RequestError, Status
from seatdyn.kernels.lanes import LANES
from seatdyn.model.description import seat_description
from seatdyn.model.noise import RandomMotion
from seatdyn.model.system import SeatSystem
from seatdyn.signals.synthesis import Synthesis
from seatdyn.units import number, whole

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]
FEWEST = 8  # realisations before an interval may end an ensemble
MOST = 1_000_000
UNBOUNDED = 1e6  # m, m/s2 or N r.m.s. of any output: the motion has no bound


def random_response(
    system: SeatSystem,
    excitation: RandomMotion,
    *,
    realisations: int = 64,
    interval: float | None = None,
    confidence: float = 0.95,
    settle: float | None = None,
    step_tolerance: float = 1e-3,
    spacing: float = LONGEST_STEP,
    peaks: Sequence[str] | None = None,
    keep: Sequence[str] = (),
    workers: int | None = None,
    checkpoint: str | Path | None = None,
    progress: Callable[[float], None] | None = None,
) -> xr.Dataset:
    """R.m.s. values of the response to a random base motion, from many realisations.

    Every realisation starts at rest relative to the base, is run for `settle` and then gathered
    over the duration of `excitation` (whose fading is not used). The interval of an r.m.s. value
    is that of Student's t for the logarithm of the mean of the realisations' mean squares. Steps
    are fixed: linear motion is exact, forces of non-linear elements are taken to fourth order, and
    the error that the step makes of any r.m.s. value is measured by halving it (`step_error`).
    Systems with delays or with elements that have states are run as `simulate` does; their steps
    follow the motion, and `step_error` is what a hundredth of the tolerance of a step changes.

    Parameters
    ----------
    system : SeatSystem
    excitation : RandomMotion; realisation k is its member k, whatever its own `member`
    realisations : largest number of them, 2 .. 1e6
    interval : stop as soon as the half width of every interval, relative to the r.m.s. value, is
        at most this (after 8 realisations)
    confidence : of the intervals, 0.5 .. 0.9999
    settle : s passed over first; by default seven time constants of the slowest pole of the
        linear part, at most 120 s
    step_tolerance : largest `step_error`, 1e-6 .. 0.1; halving ends at steps of 0.02 ms
    spacing : largest distance in s of the instants that averages, extremes and series are taken
        at, 1e-5 .. 0.01
    peaks : names of outputs whose extremes and fourth powers are gathered; by default of all. They
        have to be worked out at every instant, means and mean squares have not.
    keep : names of outputs whose series are kept
    workers : threads; by default one for every processor
    checkpoint : file (.npz) that finished blocks are written to; a run that was interrupted is
        taken up from it
    progress : called with the share done

    Returns
    -------
    xarray.Dataset
        rms, rms_low, rms_high, mean, highest, lowest (output); member_rms, member_fourth (mean of
        x^4)^(1/4), (realisation, output); series (realisation, kept, time) where asked for.
        highest, lowest and member_fourth are NaN for outputs not among `peaks`.
        Attributes: status, step_error, settle_s, spacing_s, realisations, confidence, seed, ...

    Raises
    ------
    RequestError
        A request that cannot be answered, such as a delay beside elements with states, or a
        checkpoint of another request.
    OutputError
        A checkpoint that cannot be written.

    Examples
    --------
    >>> import seatdyn as sd
    >>> seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(260.0), sd.QuadraticDamper(500.0)])
    >>> system = sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat)
    >>> noise = sd.NarrowBand(1.55, 0.2, rms=0.7)
    >>> data = sd.random_response(system, sd.RandomMotion(noise, 60.0, seed=1), realisations=16)
    >>> bool(data.rms_low.sel(output="acc_m1") < data.rms.sel(output="acc_m1"))
    True
    """
    request = _Request.check(
        system, excitation, realisations, interval, confidence, settle, step_tolerance, spacing,
        peaks,
    )  # fmt: skip
    ensemble, error = request.prepare()
    kept = [_output(name, ensemble.names) for name in keep]
    store = Checkpoint(checkpoint, request.identity(ensemble)) if checkpoint else None
    blocks = math.ceil(request.realisations / LANES)
    moments = [] if store is None else store.read()
    moments, series = moments[:blocks], []
    if kept:  # series are not in the checkpoint
        moments = []
    status, stop = Status.OK, False
    threads = workers or os.cpu_count() or 1

    def gathered() -> Array:
        joined = np.concatenate([np.moveaxis(m, -1, 0) for m in moments])
        return np.asarray(joined[: request.realisations])

    if system.is_linear and not request.stable:
        status, stop = Status.UNSTABLE, True
    stop = stop or (bool(moments) and request.reached(gathered()))
    if not stop and len(moments) < blocks:
        numbers = iter(range(len(moments), blocks))
        for number_, block in ensemble.blocks(numbers, threads, kept):
            moments.append(block.moments)
            series.append(block.series)
            if store is not None:
                store.write(moments)
            if progress is not None:
                progress((number_ + 1) / blocks)
            if not np.max(block.moments[:, 1]) <= UNBOUNDED**2:
                status = Status.DIVERGED
                break
            if request.reached(gathered()):
                break
    usable = status is Status.OK
    members = gathered() if usable else np.full((1, len(ensemble.names), 5), np.nan)
    data = _dataset(request, ensemble, members, status)
    if kept and usable:
        joined = np.concatenate(series)[: request.realisations]
        time = ensemble.spacing * np.arange(joined.shape[-1])
        data = data.assign_coords(kept=kept, time=("time", time, {"units": "s"}))
        data["series"] = (("realisation", "kept", "time"), joined)
    data.attrs |= {"step_error": error}
    return data


def rms_ratio(
    numerator: xr.Dataset, denominator: xr.Dataset, confidence: float = 0.95
) -> xr.Dataset:
    """Ratio of the r.m.s. values of two random responses to the same realisations.

    The intervals use that both saw the same base motions: that of the ratio of the mean squares
    is Student's t for the mean of q1 - R q2 over the realisations.

    Parameters
    ----------
    numerator, denominator : results of `random_response` with the same spectrum, seed, duration
    confidence : 0.5 .. 0.9999

    Returns
    -------
    xarray.Dataset
        ratio, low, high (output), for the outputs that both have.

    Raises
    ------
    RequestError
        Results that did not see the same realisations.
    """
    import xarray as xr

    for name in ("excitation", "settle_s"):
        if numerator.attrs[name] != denominator.attrs[name]:
            raise RequestError(
                f"rms_ratio needs two responses to the same realisations, but {name} differs: "
                f"{numerator.attrs[name]} and {denominator.attrs[name]}."
            )
    count = min(numerator.sizes["realisation"], denominator.sizes["realisation"])
    first, second = (
        data["member_rms"].isel(realisation=slice(count)) ** 2 for data in (numerator, denominator)
    )
    first, second = xr.align(first, second, join="inner")
    found = ratio_interval(first.to_numpy(), second.to_numpy(), confidence)
    data = xr.Dataset(
        {n: ("output", v) for n, v in zip(("ratio", "low", "high"), found, strict=True)},
        coords={"output": first["output"]},
    )
    for variable in data.variables.values():
        variable.attrs.setdefault("units", "1")
    data.attrs = {"confidence": confidence, "realisations": count, "status": str(Status.OK)}
    return data


def ratio_interval(first: Array, second: Array, confidence: float) -> Array:
    """Ratio of two r.m.s. values and both ends of its interval, (3, outputs).

    first, second : mean squares of the same realisations, (members, outputs)
    """
    count = first.shape[0]
    with np.errstate(divide="ignore", invalid="ignore"):  # an output that the second has not
        ratio = first.mean(0) / second.mean(0)
        spread = (first - ratio * second).std(0, ddof=1) / second.mean(0)
    half = student(count, confidence) * spread / math.sqrt(count)
    return np.sqrt([ratio, np.maximum(ratio - half, 0.0), ratio + half])


def student(count: int, confidence: float) -> float:
    """Two-sided quantile of Student's t for the mean of `count` values."""
    from scipy.stats import t

    return float(t.ppf(0.5 + confidence / 2, count - 1)) if count > 1 else math.nan


def rms_intervals(mean_squares: Array, confidence: float) -> tuple[Array, Array, Array]:
    """R.m.s. values and both ends of their intervals, from (members, outputs) to (outputs,).

    Student's t for the logarithm of the mean of the mean squares: these are positive and skewed to
    the right, so that an interval of equal arms would miss more often than it says.
    """
    count = mean_squares.shape[0]
    mean = mean_squares.mean(0)
    spread = mean_squares.std(0, ddof=1) if count > 1 else np.full_like(mean, np.nan)
    relative = spread / np.where(mean > 0.0, mean, 1.0)
    arm = np.exp(student(count, confidence) * relative / math.sqrt(count) / 2)
    rms = np.sqrt(mean)
    return rms, rms / arm, rms * arm


class _Request(NamedTuple):
    """A request that was checked."""

    system: SeatSystem
    excitation: RandomMotion
    realisations: int
    interval: float | None
    confidence: float
    settle: float
    step_tolerance: float
    spacing: float
    peaks: tuple[str, ...] | None
    stable: bool

    @classmethod
    def check(
        cls,
        system: SeatSystem,
        excitation: RandomMotion,
        realisations: int,
        interval: float | None,
        confidence: float,
        settle: float | None,
        step_tolerance: float,
        spacing: float,
        peaks: Sequence[str] | None,
    ) -> _Request:
        """Refuse what cannot be answered."""
        check_request(system, excitation)
        if not isinstance(excitation, RandomMotion):
            raise RequestError(
                f"excitation = {reprlib.repr(excitation)} is not random; use "
                "RandomMotion(spectrum, duration, seed=...), or `simulate` for one record."
            )

        def checked(value: float, name: str, unit: str, low: float, high: float) -> float:
            return number(value, name, unit, minimum=low, maximum=high, error=RequestError)

        count = whole(realisations, "realisations", minimum=2, maximum=MOST, error=RequestError)
        if interval is not None:
            interval = checked(interval, "interval", "", 1e-5, 1.0)
        found = poles(system)
        values = found["real"].to_numpy() + 1j * found["imag"].to_numpy()
        stable = bool(np.all(values.real < 0.0))
        if settle is None:
            settle = settling_time(values)
        return cls(
            system,
            excitation,
            count,
            interval,
            checked(confidence, "confidence", "", 0.5, 0.9999),
            checked(settle, "settle", "s", 0.0, 1e6),
            checked(step_tolerance, "step_tolerance", "", 1e-6, 0.1),
            checked(spacing, "spacing", "s", 1e-5, LONGEST_STEP),
            None if peaks is None else tuple(peaks),
            stable,
        )

    def prepare(self) -> tuple[Members, float]:
        """The ensemble, and the error that its step makes of the r.m.s. values."""
        motion = self.excitation
        total = motion.duration + self.settle
        synthesis = Synthesis(motion.spectrum, total, motion.kind)
        settle = round(self.settle / synthesis.step)
        steps, error = steps_for(self.system, synthesis, motion.seed, self.step_tolerance)
        found = ensemble_for(
            self.system, synthesis, settle, motion.seed, steps, spacing=self.spacing
        )
        if self.peaks is not None:
            found = replace(found, peaks=tuple(_output(name, found.names) for name in self.peaks))
        return found, error

    def reached(self, members: Array) -> bool:
        """Whether every interval is narrow enough."""
        if self.interval is None or members.shape[0] < FEWEST:
            return False
        rms, low, high = rms_intervals(members[:, :, 1], self.confidence)
        size = np.where(rms > 0.0, rms, 1.0)
        return bool(np.max((high - low) / (2 * size)) <= self.interval)

    def identity(self, ensemble: Members) -> str:
        """What determines the members, as text."""
        return json.dumps(
            {
                "system": repr(self.system),
                "excitation": _description(self.excitation),
                "settle": self.settle,
                "steps": ensemble.steps,
                "spacing": ensemble.spacing,
                "peaks": ensemble.peaks,
                "version": seatdyn.__version__,
            }
        )


def _description(motion: RandomMotion) -> str:
    """The family of realisations that a member belongs to."""
    return (
        f"{motion.spectrum!r}, duration={motion.duration:g}, seed={motion.seed}, "
        f"kind={motion.kind!r}"
    )


def _output(name: str, names: Sequence[str]) -> str:
    if name not in names:
        from seatdyn.units import suggestion

        raise RequestError(f"There is no output {name!r}. {suggestion(name, names)}")
    return name


def _dataset(request: _Request, ensemble: Members, members: Array, status: Status) -> xr.Dataset:
    import xarray as xr

    names = list(ensemble.names)
    rms, low, high = rms_intervals(members[:, :, 1], request.confidence)
    note = {"units": NOTE}
    per_output: dict[str, Any] = {
        "rms": rms,
        "rms_low": low,
        "rms_high": high,
        "mean": members[:, :, 0].mean(0),
        "lowest": members[:, :, 3].min(0),
        "highest": members[:, :, 4].max(0),
    }
    per_member = {"member_rms": members[:, :, 1] ** 0.5, "member_fourth": members[:, :, 2] ** 0.25}
    return xr.Dataset(
        {name: (("output",), values, note) for name, values in per_output.items()}
        | {name: (("realisation", "output"), v, note) for name, v in per_member.items()},
        coords=output_coords(names),
        attrs={
            "status": str(status),
            "message": status.message,
            "realisations": members.shape[0],
            "confidence": request.confidence,
            "duration_s": request.excitation.duration,
            "settle_s": request.settle,
            "step_s": ensemble.step,
            "spacing_s": ensemble.spacing,
            "seed": request.excitation.seed,
            "excitation": _description(request.excitation),
            "system": repr(request.system),
            "body": request.system.body.name,
            "seat_description": json.dumps(
                seat_description(request.system.seat, request.system.all_elements)
            ),
            "seatdyn_version": seatdyn.__version__,
        },
    )
