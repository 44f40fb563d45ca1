"""What can go wrong, one exception per stage, and the status that every result carries."""

from __future__ import annotations

from enum import StrEnum


class SeatdynError(ValueError):
    """Base of every error raised on purpose by seatdyn: bad input, never a bug."""


class ModelError(SeatdynError):
    """A body, seat, element or system that cannot exist."""


class ExcitationError(SeatdynError):
    """A base motion that is not usable: no level, a gap in a record, a drift."""


class MeasurementError(SeatdynError):
    """A measured record that is not usable: a gap, text, a dead channel, clocks that disagree."""


class RequestError(SeatdynError):
    """A question that the analysis cannot answer as asked."""


class OutputError(SeatdynError):
    """A result that cannot be written where it was asked for."""


class SeatdynWarning(UserWarning):
    """Base of every warning of seatdyn."""


class ExtrapolationWarning(SeatdynWarning):
    """A measured table was used outside its range."""


class BandWarning(SeatdynWarning):
    """A body was used only above the frequencies that its model was made for."""


class DriftWarning(SeatdynWarning):
    """A base motion ends with a velocity or displacement left over."""


class MeasurementWarning(SeatdynWarning):
    """A measured record that looks wrong: clipped, or in another unit than stated."""


class Status(StrEnum):
    """How a computation ended; only the numbers of `valid` results may be used."""

    OK = "ok"
    CONVERGED = "converged"
    UNSTABLE = "unstable"
    SELF_EXCITED = "self_excited"
    NO_PERIODIC_RESPONSE = "no_periodic_response"
    CHATTERING = "chattering"
    DIVERGED = "diverged"
    STEP_LIMIT = "step_limit"
    STEP_TOO_SMALL = "step_too_small"
    INCONSISTENT = "inconsistent"
    GRAZING = "grazing"
    SUBHARMONIC = "subharmonic"
    NOT_CONVERGED = "not_converged"
    NOT_ACCURATE = "not_accurate"
    STICKING = "sticking"

    @property
    def message(self) -> str:
        """One sentence for a person."""
        return _MESSAGES[self]

    @property
    def valid(self) -> bool:
        """Whether the numbers beside this status may be used."""
        return self in (Status.OK, Status.CONVERGED, Status.GRAZING)


_MESSAGES = {
    Status.OK: "The run reached its end.",
    Status.CONVERGED: "The steady state repeats itself within the stated tolerance.",
    Status.UNSTABLE: "The linear system has a pole with non-negative real part: it has no steady "
    "state. Change seat mass or damping (see `seatdyn critical`).",
    Status.SELF_EXCITED: "The system goes on moving when the base has stopped: it drives itself. "
    "Add damping or seat mass (see `seatdyn poles`).",
    Status.NO_PERIODIC_RESPONSE: "No response with the period of the excitation was reached: it "
    "grows, is subharmonic, quasi-periodic or chaotic. Look at it with `simulate`.",
    Status.CHATTERING: "A force that jumps was crossed more often than the allowed number of "
    "events per second. Raise `stick_speed` or soften the jump.",
    Status.DIVERGED: "The motion grew beyond any bound.",
    Status.STEP_LIMIT: "The run was cut off at its largest number of steps. Shorten it, or raise "
    "`max_steps`.",
    Status.STEP_TOO_SMALL: "The step size fell to the rounding of time: a force law is too steep, "
    "jumps without saying where, or gives no number (NaN).",
    Status.NOT_CONVERGED: "The iteration did not settle within the iterations allowed. Raise their "
    "number or the tolerance.",
    Status.INCONSISTENT: "The energy balance does not close: a force law jumps without saying "
    "where, or the tolerance is too loose. Declare the jump, or lower `rtol`.",
    Status.GRAZING: "The steady state repeats itself within the stated tolerance, but it touches a "
    "jump of a force almost without speed, so that its Floquet multipliers are not defined.",
    Status.SUBHARMONIC: "The response repeats itself only after several periods of the "
    "excitation, so it has no amplitude over one of them. Look at it with `simulate`.",
    Status.NOT_ACCURATE: "The most harmonics allowed do not reach the tolerance: the error "
    "estimate says what they reach. Raise `tolerance`, or use method='time'.",
    Status.STICKING: "The motion would stick at a jump of a force, which harmonic balance cannot "
    "follow. Use method='time'.",
}
