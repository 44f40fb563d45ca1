"""Dampers that a controller adjusts: skyhook and acceleration-driven damping.

The controller sees the speed v across the damper and the absolute velocity w or acceleration a of
its second node, the seat. What it commands takes effect with a lag, and within the damper's limits:
a damper can only take power out.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar, Literal

from seatdyn.errors import ModelError
from seatdyn.kernels import memory_laws as laws
from seatdyn.model.dampers import check_order
from seatdyn.model.friction import SLOPE, no_tangent
from seatdyn.model.memory import AT_REST, LinearMemory, MemoryElement, MemoryLaw
from seatdyn.units import DAMPING, FORCE, Limits, number, quantity, suggestion

Control = Literal["passive", "skyhook", "on-off skyhook", "acceleration"]
CODES: dict[str, float] = {
    "passive": 0.0,
    "skyhook": laws.SKYHOOK,
    "on-off skyhook": laws.ON_OFF,
    "acceleration": laws.ACCELERATION,
}
THRESHOLDS = {"on-off skyhook": (1e-3, "m/s"), "acceleration": (0.05, "m/s2")}
LAG = Limits(minimum=1e-5, maximum=10.0)  # s
CURRENT = Limits(minimum=0.0, maximum=1e3)  # A


@dataclass(frozen=True)
class SemiActiveDamper(MemoryElement):
    """Damper with an adjustable coefficient: F = c v with c_min <= c <= c_max and |F| <= F_max.

    c follows its command with a lag, tau dc/dt = c_command - c. The control laws, w and a being the
    absolute velocity and acceleration of the second node (the seat):

    * "passive": the command is constant;
    * "skyhook": c_sky w/v within the limits, so that the force is that of a damper c_sky to the sky
      wherever a damper can give it (Karnopp, Crosby and Harwood 1974, J. Eng. Ind. 96:619-626);
    * "on-off skyhook": c_max where w v > 0, else c_min;
    * "acceleration": c_max where a v > 0, else c_min (Savaresi, Silani and Bittanti 2005, J. Dyn.
      Syst. Meas. Control 127:218-229).

    The last two switch over gradually around w = 0 or a = 0, by w/sqrt(w^2 + w_0^2): switched
    sharply, an acceleration-driven damper would chatter. Where dry friction holds the damper,
    v = 0, they command what is between both directions.

    Parameters
    ----------
    minimum, maximum : c_min and c_max in N s/m, 0 .. 1e9
    lag : tau in s, 1e-5 .. 10
    control : one of the above
    gain : c_sky in N s/m, 0 .. 1e9; for "skyhook"
    command : coefficient of "passive" in N s/m, c_min .. c_max; default c_min
    threshold : w_0 in m/s (default 0.001), or a_0 in m/s2 (default 0.05); 1e-5 .. 10
    saturation : F_max in N, 0 .. 1e9
    """

    states: ClassVar = (("coefficient", "N s/m"),)
    minimum: float = quantity("N s/m", **DAMPING)
    maximum: float = quantity("N s/m", **DAMPING)
    lag: float = quantity("s", **LAG)
    control: Control = field(default="passive", kw_only=True)
    gain: float | None = field(default=None, kw_only=True)
    command: float | None = field(default=None, kw_only=True)
    threshold: float | None = field(default=None, kw_only=True)
    saturation: float = quantity("N", default=FORCE["maximum"], **FORCE)

    def __post_init__(self) -> None:
        """Check the limits and that the control law has what it needs."""
        super().__post_init__()
        check_order(self.name, self.minimum, self.maximum)
        check_control(self, "N s/m", self.minimum, self.maximum)

    def lower(self) -> MemoryLaw:
        """The law; the command jumps where the seat or the damper stands."""
        limits = (self.minimum, self.maximum, self.saturation, self.lag)
        control = control_parameters(self)
        size = max(self.maximum, 1.0)
        return MemoryLaw(
            laws.semi_active_force, laws.semi_active_rate, (*limits, *control), (size,), AT_REST
        )

    def linearised(self) -> LinearMemory:
        """The passive damper; a switched one is not linear at any amplitude."""
        refuse_switching(self)
        return super().linearised()

    @property
    def feels(self) -> tuple[int, ...]:
        """What the control law measures."""
        return felt_by(self.control)

    def settled(self, d: float) -> tuple[float, ...]:
        """The passive command, or the smallest coefficient."""
        return (self.minimum if self.command is None else self.command,)


@dataclass(frozen=True)
class MRDamper(MemoryElement):
    """Magnetorheological damper whose current a controller sets.

    F = (f0 + f1 I) (2/pi) atan(slope v) + c v, a Bingham damper whose yield force grows with the
    current 0 <= I <= I_max, which follows its command with a lag, tau dI/dt = I_command - I. The
    control laws are those of `SemiActiveDamper`, on-off between no current and I_max; "skyhook"
    commands the current at which the force, its sign not smoothed, would be that of a damper c_sky
    to the sky.

    Parameters
    ----------
    viscous : c in N s/m, 0 .. 1e9
    yield_force : f0 without current in N, 0 .. 1e9
    yield_per_ampere : f1 in N/A, 1e-9 .. 1e9
    largest_current : I_max in A, 0 .. 1000
    lag : tau in s, 1e-5 .. 10
    control : "passive", "skyhook", "on-off skyhook" or "acceleration"
    gain : c_sky in N s/m, 0 .. 1e9; for "skyhook"
    command : current of "passive" in A, 0 .. I_max; default 0
    threshold : w_0 in m/s (default 0.001), or a_0 in m/s2 (default 0.05); 1e-5 .. 10
    slope : of the smoothed sign in s/m, 1e-6 .. 1e9
    """

    states: ClassVar = (("current", "A"),)
    viscous: float = quantity("N s/m", **DAMPING)
    yield_force: float = quantity("N", **FORCE)
    yield_per_ampere: float = quantity("N/A", minimum=1e-9, maximum=1e9)
    largest_current: float = quantity("A", **CURRENT)
    lag: float = quantity("s", **LAG)
    control: Control = field(default="passive", kw_only=True)
    gain: float | None = field(default=None, kw_only=True)
    command: float | None = field(default=None, kw_only=True)
    threshold: float | None = field(default=None, kw_only=True)
    slope: float = quantity("s/m", default=1000.0, **SLOPE)

    def __post_init__(self) -> None:
        """Check that the control law has what it needs."""
        super().__post_init__()
        check_control(self, "A", 0.0, self.largest_current)

    def lower(self) -> MemoryLaw:
        """The law; the command jumps where the seat or the damper stands."""
        damper = (self.viscous, self.yield_force, self.yield_per_ampere, self.slope)
        control = control_parameters(self)
        return MemoryLaw(
            laws.mr_force,
            laws.mr_rate,
            (*damper, self.largest_current, self.lag, *control),
            (max(self.largest_current, 1e-3),),
            AT_REST,
        )

    def linearised(self) -> LinearMemory:
        """The passive damper; a switched one is not linear at any amplitude."""
        refuse_switching(self)
        return super().linearised()

    @property
    def feels(self) -> tuple[int, ...]:
        """What the control law measures."""
        return felt_by(self.control)

    def settled(self, d: float) -> tuple[float, ...]:
        """The passive command, or no current."""
        return (self.command or 0.0,)


def felt_by(control: str) -> tuple[int, ...]:
    """Speed across the damper, and what the control law measures, see `MemoryElement.feels`."""
    return {"passive": (1,), "acceleration": (1, 3)}.get(control, (1, 2))


def switches(element: MemoryElement) -> bool:
    """Whether it has a control law that goes from one limit to the other at a zero."""
    return isinstance(element, SemiActiveDamper | MRDamper) and element.control in THRESHOLDS


def refuse_switching(element: SemiActiveDamper | MRDamper) -> None:
    """Refuse the linear form of a damper whose control law switches."""
    if element.control != "passive":
        raise no_tangent(element, f"{element.control!r} switches at any amplitude")


def control_parameters(element: SemiActiveDamper | MRDamper) -> tuple[float, ...]:
    """Control law, gain, command and threshold as the kernels read them."""
    default, _ = THRESHOLDS.get(element.control, (1.0, ""))
    threshold = default if element.threshold is None else element.threshold
    code = CODES[element.control]
    return (code, element.gain or 0.0, element.settled(0.0)[0], threshold)


def check_control(
    element: SemiActiveDamper | MRDamper, command_unit: str, smallest: float, largest: float
) -> None:
    """Check the control law, its gain and its command, and that nothing without effect is given."""
    name, control = element.name, element.control
    if control not in CODES:
        raise ModelError(
            f"{name}.control = {control!r} is not allowed. {suggestion(str(control), CODES)}"
        )
    if (control == "skyhook") != (element.gain is not None):
        wanted = "needs a gain in N s/m" if element.gain is None else "takes no gain"
        raise ModelError(f"{name} with control = {control!r} {wanted}; 'skyhook' alone has one.")
    if element.command is not None and control != "passive":
        raise ModelError(
            f"{name} with control = {control!r} takes no command; 'passive' alone has one."
        )
    if element.threshold is not None:
        if control not in THRESHOLDS:
            raise ModelError(f"{name} with control = {control!r} takes no threshold.")
        threshold = number(
            element.threshold,
            f"{name}.threshold",
            THRESHOLDS[control][1],
            minimum=1e-5,
            maximum=10.0,
        )
        object.__setattr__(element, "threshold", threshold)
    if element.gain is not None:
        gain = number(element.gain, f"{name}.gain", "N s/m", **DAMPING)
        object.__setattr__(element, "gain", gain)
    if element.command is not None:
        command = number(
            element.command, f"{name}.command", command_unit, minimum=smallest, maximum=largest
        )
        object.__setattr__(element, "command", command)
