"""Options that several commands share: dataclasses, spread over the signature of a command."""

from __future__ import annotations

import dataclasses
import functools
import inspect
from collections.abc import Callable, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from seatdyn.errors import ModelError, RequestError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from seatdyn.analysis.linear import Linearise
    from seatdyn.model.body import SeatedBody
    from seatdyn.model.elements import Element
    from seatdyn.model.excitation import Sine
    from seatdyn.model.seat import Seat
    from seatdyn.model.system import SeatSystem

BODY = "ksiazek1997_back_off"
SEAT_MASS, STIFFNESS, DAMPING = 35.0, 9950.0, 260.0  # kg, N/m, N s/m: the paper's seat
COULOMB_SLOPE = 1000.0  # s/m, formula (5) of the paper
FREE_TRAVEL = (-0.02, 0.01)  # m, formula (3) of the paper
MOST_POINTS = 1_000_000  # of one axis
FEEDBACK = "feedback"  # what may be delayed of a body alone

# fields of ModelOptions that describe the paper's kind of seat
OF_SEAT = (
    *("seat_mass", "stiffness", "damping", "quadratic", "coulomb", "coulomb_slope", "end_stop"),
    "free_travel",
)

Range = tuple[str, str, str]  # START STOP N; read by `points`, whose messages name the value
Number = float | None


class Tangent(StrEnum):
    """The only way to make non-linear elements linear."""

    TANGENT = "tangent"


def option(
    name: str,
    text: str,
    *,
    panel: str = "Model",
    default: str | bool = False,
    metavar: str | None = None,
) -> Any:
    """Describe an option; `default` is shown where the default itself is None."""
    return typer.Option(
        name, help=text, rich_help_panel=panel, show_default=default, metavar=metavar
    )


def number_option(
    name: str, text: str, *, panel: str = "Model", default: str | bool = False
) -> Any:
    """Describe an option that is one number."""

    def read(value: str | float) -> float:
        try:
            return parsed(value)
        except ValueError:
            raise typer.BadParameter(
                f"{value!r} is not a number; write it like 9950, 0.02 or 1e-3"
            ) from None

    return typer.Option(
        name,
        help=text,
        rich_help_panel=panel,
        show_default=default,
        metavar="NUMBER",
        parser=read,
    )


Plot = Annotated[
    Path | None, option("--plot", "Draw the result: .png, .svg or .pdf.", panel="Output")
]


@dataclasses.dataclass(frozen=True)
class ModelOptions:
    """Body, seat and suspension."""

    body: Annotated[
        str, option("--body", "Name of a body (see `bodies`), or path of a .toml.", default=True)
    ] = BODY
    seat: Annotated[
        str | None,
        option(
            "--seat",
            "Name of a seat, or path of a .toml, instead of the options below.",
            default="the paper's",
            metavar="NAME|FILE",
        ),
    ] = None
    seat_mass: Annotated[
        Number, number_option("--seat-mass", "Mass of the seat, kg.", default=f"{SEAT_MASS:g}")
    ] = None
    stiffness: Annotated[
        Number, number_option("--stiffness", "Suspension spring, N/m.", default=f"{STIFFNESS:g}")
    ] = None
    damping: Annotated[
        Number, number_option("--damping", "Suspension damper, N s/m.", default=f"{DAMPING:g}")
    ] = None
    quadratic: Annotated[
        Number, number_option("--quadratic", "Quadratic damping beta1 |v| v: beta1, N s2/m2.")
    ] = None
    coulomb: Annotated[Number, number_option("--coulomb", "Coulomb friction: force beta2, N.")] = (
        None
    )
    coulomb_slope: Annotated[
        Number,
        number_option(
            "--coulomb-slope", "Slope of its arctangent, s/m.", default=f"{COULOMB_SLOPE:g}"
        ),
    ] = None
    end_stop: Annotated[
        Number,
        number_option("--end-stop", "Jumping force gamma d outside the free travel: gamma, N/m."),
    ] = None
    free_travel: Annotated[
        tuple[str, str] | None,
        option(
            "--free-travel",
            "Ends of the free travel, m, signed.",
            metavar="LOWER UPPER",
            default=f"{FREE_TRAVEL[0]:g} {FREE_TRAVEL[1]:g}",
        ),
    ] = None

    delay: Annotated[
        Number, number_option("--delay", "Reaction delay of what --delayed names, s.")
    ] = None
    delayed: Annotated[
        str | None,
        option(
            "--delayed",
            "suspension, feedback (of the body) or an element, such as Damper.",
            default="suspension",
            metavar="WHAT",
        ),
    ] = None

    def load_body(self) -> SeatedBody:
        """Return the body."""
        from seatdyn.model.body import load_body

        if self.delayed is not None and self.delay is None:
            raise ModelError("--delayed has no effect without --delay; give both.")
        body = load_body(self.body)
        late = self.delay is not None and self.delayed == FEEDBACK
        return body.delayed(_given(self.delay, 0.0)) if late else body

    def system(self) -> SeatSystem:
        """Return body, seat and suspension."""
        from seatdyn.model.system import SeatSystem

        system = SeatSystem(self.load_body(), self.load_seat())
        if self.delay is None or self.delayed == FEEDBACK:
            return system
        return system.delayed(self.delay, self.delayed or "suspension")

    def load_seat(self) -> Seat:
        """Return seat and suspension."""
        from seatdyn.model.elements import CoulombFriction, Damper, QuadraticDamper, Spring
        from seatdyn.model.seat import Seat

        if self.seat is not None:
            return self._seat_of_file(self.seat)
        suspension: list[Element] = [
            Spring(_given(self.stiffness, STIFFNESS)),
            Damper(_given(self.damping, DAMPING)),
        ]
        if self.quadratic is not None:
            suspension.append(QuadraticDamper(self.quadratic))
        if self.coulomb is not None:
            slope = _given(self.coulomb_slope, COULOMB_SLOPE)
            suspension.append(CoulombFriction(self.coulomb, slope))
        elif self.coulomb_slope is not None:
            raise ModelError("--coulomb-slope has no effect without --coulomb; give both.")
        if self.end_stop is not None:
            suspension.append(self._end_stop(self.end_stop))
        elif self.free_travel is not None:
            raise ModelError("--free-travel has no effect without --end-stop; give both.")
        return Seat(_given(self.seat_mass, SEAT_MASS), tuple(suspension))

    def _seat_of_file(self, name: str) -> Seat:
        from seatdyn.model.seat_file import load_seat

        for field in OF_SEAT:
            if getattr(self, field) is not None:
                raise ModelError(
                    f"--{field.replace('_', '-')} describes a seat, and --seat {name} another one; "
                    "drop one of them, or put the number into the seat file."
                )
        return load_seat(name)

    def delayable(self) -> SeatSystem:
        """Return the system for a request over the delay itself, which is then not given."""
        if self.delay is not None:
            raise RequestError("--delay fixes the delay, which is asked for here; drop it.")
        # any delay will do: it tells what is varied
        return dataclasses.replace(self, delay=1.0).system()

    def _end_stop(self, gamma: float) -> Element:
        from seatdyn.model.elements import PiecewiseSpring

        lower, upper = FREE_TRAVEL
        if self.free_travel is not None:
            lower, upper = numbers("--free-travel", self.free_travel, "LOWER UPPER")
        if not lower <= 0.0 <= upper:
            raise ModelError(
                f"--free-travel {lower:g} {upper:g} m is not allowed; LOWER must be <= 0 (bump) "
                f"and UPPER >= 0 (rebound), such as {FREE_TRAVEL[0]:g} {FREE_TRAVEL[1]:g}. "
                "Check the order and the signs."
            )
        return PiecewiseSpring(gamma, bump_clearance=-lower, rebound_clearance=upper)

    def only_body(self) -> SeatedBody:
        """Return the body alone; options of the seat are refused rather than ignored."""
        of_body = ("body", "delay", "delayed") if self.delayed == FEEDBACK else ("body",)
        for field in dataclasses.fields(self):
            if field.name not in of_body and getattr(self, field.name) is not None:
                raise RequestError(
                    f"--{field.name.replace('_', '-')} describes the seat, which --body-alone "
                    "leaves out; drop one of them."
                )
        return self.load_body()


@dataclasses.dataclass(frozen=True)
class LinearOptions:
    """How a linear command treats non-linear elements."""

    linearise: Annotated[
        Tangent | None,
        option("--linearise", "Tangent of non-linear elements at rest.", default="leave them out"),
    ] = None

    @property
    def mode(self) -> Linearise:
        """The argument `linearise` of the analyses."""
        return "tangent" if self.linearise else None


@dataclasses.dataclass(frozen=True)
class AloneOptions:
    """Body on a seat, or alone."""

    body_alone: Annotated[bool, option("--body-alone", "The body on a rigid, moving seat.")] = False

    def choose(self, model: ModelOptions) -> SeatSystem | SeatedBody:
        """Return the system, or the body alone."""
        return model.only_body() if self.body_alone else model.system()


@dataclasses.dataclass(frozen=True)
class SineOptions:
    """Sinusoidal base motion."""

    frequency: Annotated[
        Number,
        number_option("--frequency", "Frequency of the base motion, Hz.", panel="Base motion"),
    ] = None
    amplitude: Annotated[
        Number, number_option("--amplitude", "Peak base acceleration, m/s2.", panel="Base motion")
    ] = None
    rms: Annotated[
        Number, number_option("--rms", "R.m.s. base acceleration, m/s2.", panel="Base motion")
    ] = None

    def sine(self) -> Sine:
        """Return the base motion."""
        from seatdyn.model.excitation import Sine

        if self.frequency is None:
            raise RequestError(
                "A base motion is needed: give --frequency in Hz, and --amplitude or --rms in m/s2."
            )
        return Sine(self.frequency, amplitude=self.amplitude, rms=self.rms)


@dataclasses.dataclass(frozen=True)
class OutputOptions:
    """How the answer is given."""

    as_json: Annotated[
        bool, option("--json", "One JSON object on standard output.", panel="Output")
    ] = False


def spread(command: Callable[..., None]) -> Callable[..., None]:
    """Replace every parameter of `command` that is a dataclass of options by these options."""
    hints = get_type_hints(command, include_extras=True)
    groups: dict[str, Any] = {
        name: kind for name, kind in hints.items() if dataclasses.is_dataclass(kind)
    }
    parameters: list[inspect.Parameter] = []
    for name, parameter in inspect.signature(command).parameters.items():
        if name not in groups:
            annotated = parameter.replace(
                annotation=hints[name], kind=inspect.Parameter.KEYWORD_ONLY
            )
            parameters.append(annotated)
            continue
        inner = get_type_hints(groups[name], include_extras=True)
        parameters += [
            inspect.Parameter(
                field.name,
                inspect.Parameter.KEYWORD_ONLY,
                default=field.default,
                annotation=inner[field.name],
            )
            for field in dataclasses.fields(groups[name])
        ]

    @functools.wraps(command)
    def call(**values: Any) -> None:
        gathered = {
            name: group(
                **{field.name: values.pop(field.name) for field in dataclasses.fields(group)}
            )
            for name, group in groups.items()
        }
        command(**gathered, **values)

    call.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    call.__annotations__ = {p.name: p.annotation for p in parameters}
    return call


def numbers(name: str, given: Sequence[str], names: str) -> list[float]:
    """Read the values of an option that has several."""
    values = []
    for label, text in zip(names.split(), given, strict=True):
        try:
            values.append(parsed(text))
        except ValueError:
            raise RequestError(
                f"{name}: {label} = {text!r} is not a number; write it like 9950, 0.02 or 1e-3."
            ) from None
    return values


def parsed(text: str | float) -> float:
    """Read a number; Python's underscores are refused, for 1_0 is more often a slip than 10."""
    if "_" in str(text):
        raise ValueError(text)
    return float(text)


def points(name: str, request: Range, *, logarithmic: bool = False) -> NDArray[Any]:
    """Grid START STOP N of an option, checked."""
    import numpy as np

    text = " ".join((name, *request))
    start, stop, steps = numbers(name, request, "START STOP N")
    count = int(steps) if np.isfinite(steps) else 0
    if count != steps:
        raise RequestError(f"{text}: the number of points must be a whole number.")
    if not 2 <= count <= MOST_POINTS:
        raise RequestError(f"{text}: the number of points must be in 2 .. {MOST_POINTS}.")
    if not (np.isfinite(start) and np.isfinite(stop)):
        raise RequestError(f"{text}: both ends of the range must be finite numbers.")
    if not start < stop:
        raise RequestError(f"{text}: START must be less than STOP. Exchange the ends.")
    if logarithmic and start <= 0.0:
        raise RequestError(f"{text}: a logarithmic range must start above 0.")
    grid = np.geomspace if logarithmic else np.linspace
    return np.asarray(grid(start, stop, count))


def _given(value: float | None, default: float) -> float:
    return default if value is None else value
