"""The seated body as data: masses, passive links, and linear feedback forces between masses."""

from __future__ import annotations

import reprlib
import tomllib
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from importlib import resources
from pathlib import Path
from typing import Any, Literal, TypeVar

from seatdyn.errors import BandWarning, ModelError
from seatdyn.units import (
    DAMPING,
    DELAY,
    FREQUENCY,
    MASS,
    STIFFNESS,
    Limits,
    either_sign,
    number,
    quantity,
    suggestion,
    validated,
)

SEAT = "seat"
SUSPENSION_PARAMETERS = ("damping", "stiffness", "seat_mass")  # named so in every system
WEIGHT = Limits(minimum=-1e3, maximum=1e3)
SITTING_MASS = Limits(minimum=15.0, maximum=200.0)  # kg on the seat, from a child to the heaviest
GROUPS = ("vibration", "shock")
CONFIDENCE = ("", "printed", "high", "medium", "low")
Item = TypeVar("Item")


@dataclass(frozen=True)
class Link:
    """Spring and damper between two nodes.

    Parameters
    ----------
    between : the two nodes, e.g. ``("seat", "m1")``
    stiffness : N/m, within +-1e12 (a negative value models an active element and is allowed)
    damping : N s/m, within +-1e9
    """

    between: tuple[str, str]
    stiffness: float = quantity("N/m", default=0.0, **either_sign(STIFFNESS))
    damping: float = quantity("N s/m", default=0.0, **either_sign(DAMPING))

    def __post_init__(self) -> None:
        """Check every field."""
        object.__setattr__(self, "between", node_pair(self.between, "Link.between"))
        validated(self)


@dataclass(frozen=True)
class FeedbackTerm:
    """One gain of a feedback force: `gain` times a weighted sum of node motions.

    Parameters
    ----------
    name : name of the gain, unique in its body (``"k11"``); not "damping", "stiffness" or
        "seat_mass", which name the suspension
    gain : N/m for `of` = "displacement", N s/m for `of` = "velocity"; within +-1e12
    of : "displacement" or "velocity" (absolute)
    weights : node name -> weight within +-1000; the base of the body is ``"seat"``
    """

    name: str
    gain: float = quantity("N/m or N s/m", **either_sign(STIFFNESS))
    of: Literal["displacement", "velocity"] = "displacement"
    weights: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check every field."""
        validated(self)
        if not isinstance(self.name, str) or not self.name or self.name in SUSPENSION_PARAMETERS:
            raise ModelError(
                f"FeedbackTerm.name = {self.name!r} is not allowed; it must be a text, and not one "
                f"of {SUSPENSION_PARAMETERS}, which name the suspension. Rename the gain, such as "
                "'k11'."
            )
        if self.of not in ("displacement", "velocity"):
            raise ModelError(
                f"FeedbackTerm.of = {self.of!r} of term {self.name!r} is not allowed; "
                "it must be 'displacement' or 'velocity'."
            )
        term = f"of term {self.name!r}"
        weights = {
            node: number(value, f"FeedbackTerm.weights[{node!r}] {term}", "", **WEIGHT)
            for node, value in named_numbers(self.weights, f"FeedbackTerm.weights {term}").items()
        }
        object.__setattr__(self, "weights", weights)


@dataclass(frozen=True)
class FeedbackForce:
    """Active force F_A = -sum(gain * weighted motion), +F_A on `on`, -F_A on `reaction`.

    With a `delay` in s (0 .. 10) it acts at t with its value of t - delay.
    """

    on: str
    reaction: str
    terms: tuple[FeedbackTerm, ...]
    delay: float = quantity("s", default=0.0, **DELAY)

    def __post_init__(self) -> None:
        """Check the node pair and freeze the terms."""
        node_pair((self.on, self.reaction), "FeedbackForce.on, reaction")
        terms = list_of(FeedbackTerm, self.terms, "FeedbackForce.terms")
        object.__setattr__(self, "terms", terms)
        validated(self)


@dataclass(frozen=True)
class SeatedBody:
    """Lumped-parameter model of the seated body, vertical motion, on the node ``"seat"``.

    Parameters
    ----------
    name : identifier
    masses : node name -> mass in kg, 1e-6 .. 1e6; the node ``"seat"`` may be named too: a mass that
        moves rigidly with the seat surface (0 .. 1e6); alone it is an inert load. A node name is a
        text without "-" that does not begin with "acc_" or "F_" and is not "base": outputs are
        named so.
    links : springs and dampers between nodes, in any topology
    feedback : active forces; their gains may act on absolute motions, so that the body need be
        neither translation nor velocity invariant
    title, source, posture : texts for people
    subject_mass : kg of the whole person that the model stands for, legs included, 1e-6 .. 1e6
    band : lowest and highest frequency in Hz that the model was made for
    head : node of the head; empty if the model has none
    group : "vibration", or "shock" for a model of injury by shocks, whose apparent mass is not that
        of a person
    confidence : in the numbers. "printed": in the paper that this package reproduces; "high": two
        sources agree; "medium": recalled from the literature and plausible, the original not seen;
        "low": doubtful (none of the catalogue); "": not said
    provenance : group of numbers -> where it comes from; `scaled` adds to it
    scaling : what the source says on other sitting masses; empty if it says nothing
    """

    name: str
    masses: Mapping[str, float]
    links: tuple[Link, ...]
    feedback: tuple[FeedbackForce, ...] = ()
    title: str = ""
    source: str = ""
    posture: str = ""
    subject_mass: float | None = None
    band: tuple[float, float] | None = None
    head: str = ""
    group: str = GROUPS[0]
    confidence: str = ""
    provenance: Mapping[str, str] = field(default_factory=dict)
    scaling: str = ""

    def __post_init__(self) -> None:
        """Check masses, nodes and that every mass hangs on something."""
        masses = {}
        label = f"SeatedBody({self.name!r})"
        for node, value in named_numbers(self.masses, f"{label}.masses").items():
            check_node_name(node, f"{label}.masses")
            limits = Limits(minimum=0.0, maximum=MASS["maximum"]) if node == SEAT else MASS
            masses[node] = number(value, f"{label}.masses[{node!r}]", "kg", **limits)
        if not any(masses.values()):
            raise ModelError(f"SeatedBody({self.name!r}) has no mass; name at least one.")
        object.__setattr__(self, "masses", masses)
        object.__setattr__(self, "links", list_of(Link, self.links, f"{label}.links"))
        feedback = list_of(FeedbackForce, self.feedback, f"{label}.feedback")
        object.__setattr__(self, "feedback", feedback)
        known = {SEAT, *masses}
        for link in self.links:
            self._require(known, link.between, "links")
        for force in self.feedback:
            self._require(known, (force.on, force.reaction), "feedback")
            for term in force.terms:
                self._require(known, tuple(term.weights), f"feedback term {term.name!r}")
        names = [term.name for force in self.feedback for term in force.terms]
        if len(set(names)) < len(names):
            raise ModelError(f"SeatedBody({self.name!r}).feedback uses a gain name twice: {names}.")
        self._require_connected()
        self._check_description(label)

    def _check_description(self, label: str) -> None:
        """Check what tells people about the body: who, how sure, in which band."""
        if self.subject_mass is not None:
            mass = number(self.subject_mass, f"{label}.subject_mass", "kg", **MASS)
            object.__setattr__(self, "subject_mass", mass)
        if self.band is not None:
            if not isinstance(self.band, list | tuple) or len(self.band) != 2:
                raise ModelError(
                    f"{label}.band = {self.band!r} is not allowed; it must be the lowest and the "
                    "highest frequency in Hz, such as [0.5, 20.0]."
                )
            low, high = (number(f, f"{label}.band", "Hz", **FREQUENCY) for f in self.band)
            if not low < high:
                raise ModelError(
                    f"{label}.band = {low:g} .. {high:g} Hz is not allowed; the first frequency "
                    "must be below the second. Exchange them."
                )
            object.__setattr__(self, "band", (low, high))
        if self.head:
            self._require(set(self.nodes), (self.head,), "head")
        choices = (("group", self.group, GROUPS), ("confidence", self.confidence, CONFIDENCE))
        for name, value, allowed in choices:
            if value not in allowed:
                raise ModelError(
                    f"{label}.{name} = {value!r} is not allowed; it must be one of {allowed}."
                )
        if not isinstance(self.provenance, Mapping):
            raise ModelError(
                f"{label}.provenance = {reprlib.repr(self.provenance)} is of the wrong kind; it "
                "must map groups of numbers to texts, such as {'masses': 'Table 1'}."
            )
        object.__setattr__(self, "provenance", dict(self.provenance))

    def _require(self, known: set[str], nodes: tuple[str, ...], where: str) -> None:
        for node in nodes:
            if node not in known:
                raise ModelError(
                    f"SeatedBody({self.name!r}).{where} names the unknown node {node!r}. "
                    + suggestion(node, known)
                )

    def _require_connected(self) -> None:
        reached = {SEAT}
        pairs = [link.between for link in self.links]
        pairs += [(force.on, force.reaction) for force in self.feedback]
        for _ in pairs:
            for a, b in pairs:
                if a in reached or b in reached:
                    reached |= {a, b}
        loose = sorted(set(self.masses) - reached)
        if loose:
            raise ModelError(
                f"SeatedBody({self.name!r}): no link leads from the seat to {loose}; add a Link."
            )

    @property
    def nodes(self) -> tuple[str, ...]:
        """Names of the moving masses, the seat surface apart, in the order given."""
        return tuple(node for node in self.masses if node != SEAT)

    @property
    def total_mass(self) -> float:
        """Sum of all masses in kg, that on the seat surface included."""
        return float(sum(self.masses.values()))

    @property
    def support_mass(self) -> float:
        """Mass in kg that moves rigidly with the seat surface: that of the node ``"seat"``."""
        return self.masses.get(SEAT, 0.0)

    @property
    def is_active(self) -> bool:
        """Whether the body has feedback forces."""
        return bool(self.feedback)

    def delayed(self, delay: float) -> SeatedBody:
        """The same body with all its feedback forces `delay` seconds (0 .. 10) late."""
        if not self.feedback:
            raise ModelError(
                f"SeatedBody({self.name!r}) has no feedback force that could be delayed; choose an "
                "active body, or delay the suspension with Seat(delay=...)."
            )
        late = tuple(replace(force, delay=delay) for force in self.feedback)
        return replace(self, feedback=late)

    def scaled(self, *, sitting_mass: float) -> SeatedBody:
        """The same body at another sitting mass: all masses, links and gains times one factor.

        Poles, transmissibilities and apparent mass over sitting mass do not change.

        Parameters
        ----------
        sitting_mass : what `total_mass` of the new body is to be: the mass that rests on the seat,
            kg, 15 .. 200. Of a person who sits with the feet supported it is less than the mass of
            the person.

        Returns
        -------
        SeatedBody
            Its `provenance["scaling"]` says by how much, and whether the source of the model
            defines that (`scaling`) or whether it is an assumption of this package.

        Raises
        ------
        ModelError
            A mass outside the range.

        Examples
        --------
        >>> import seatdyn as sd
        >>> light = sd.load_body("ksiazek1997_back_off").scaled(sitting_mass=40.0)
        >>> round(light.masses["m1"], 4), light.name
        (5.1412, 'ksiazek1997_back_off_40kg')
        >>> light.provenance["scaling"]
        'all masses, links and gains times 0.564972 (70.8 to 40 kg); assumed by seatdyn'
        """
        label = f"sitting_mass of SeatedBody({self.name!r})"
        new = number(sitting_mass, label, "kg", **SITTING_MASS)
        factor = new / self.total_mass
        rule = self.scaling or "assumed by seatdyn"
        note = (
            f"all masses, links and gains times {factor:.6g} "
            f"({self.total_mass:g} to {new:g} kg); {rule}"
        )
        if "scaling" in self.provenance:
            note = f"{self.provenance['scaling']}; then {note}"
        return replace(
            self,
            name=f"{self.name}_{new:g}kg",
            masses={node: factor * mass for node, mass in self.masses.items()},
            links=tuple(
                replace(link, stiffness=factor * link.stiffness, damping=factor * link.damping)
                for link in self.links
            ),
            feedback=tuple(
                replace(
                    force,
                    terms=tuple(replace(term, gain=factor * term.gain) for term in force.terms),
                )
                for force in self.feedback
            ),
            subject_mass=None if self.subject_mass is None else factor * self.subject_mass,
            provenance={**self.provenance, "scaling": note},
        )


def check_node_name(node: Any, label: str) -> None:
    """Refuse a node name that the name of an output could be mistaken for."""
    if not isinstance(node, str) or not node:
        raise ModelError(f"{label} names a node {node!r}; a name must be a text, such as 'm1'.")
    if node == "base":
        raise ModelError(
            f"{label}[{node!r}]: the name 'base' is reserved for the base under the seat; "
            "rename the node."
        )
    if "-" in node or node.startswith(("acc_", "F_")):
        raise ModelError(
            f"{label}[{node!r}]: outputs are named 'acc_...', 'F_...' and 'm2-m1', so that a node "
            "must not contain '-' or begin with 'acc_' or 'F_'; rename the node."
        )


def named_numbers(value: Any, label: str) -> dict[Any, Any]:
    """Return a dict of what must map node names to numbers."""
    if not isinstance(value, Mapping):
        raise ModelError(
            f"{label} = {reprlib.repr(value)} is of the wrong kind; it must map node names to "
            "numbers, such as {'m1': 9.1}."
        )
    return dict(value)


def list_of(kind: type[Item], values: Any, label: str) -> tuple[Item, ...]:
    """Return a tuple of what must be a list of objects of one kind."""
    items = tuple(values) if isinstance(values, Iterable) else (values,)
    if not isinstance(values, Iterable) or not all(isinstance(item, kind) for item in items):
        raise ModelError(
            f"{label} = {reprlib.repr(values)} is of the wrong kind; it must be a list of "
            f"{kind.__name__} objects."
        )
    return items


def node_pair(value: Any, label: str) -> tuple[str, str]:
    """Return a checked pair of different node names."""
    is_list = isinstance(value, list | tuple)
    if not is_list or len(value) != 2 or value[0] == value[1]:
        raise ModelError(f"{label} = {value!r} is not allowed; it must name two different nodes.")
    return (str(value[0]), str(value[1]))


def warn_above_band(body: SeatedBody, lowest: float, *, stacklevel: int) -> None:
    """Warn where all frequencies of a request, from `lowest` Hz on, lie above the body's band.

    Below its band a body is nearly rigid, and a request that only reaches beyond its band is
    common, so that neither is worth a warning.
    """
    if body.band and lowest > body.band[1]:
        warnings.warn(
            f"The body {body.name!r} was made for {body.band[0]:g} .. {body.band[1]:g} Hz; what is "
            f"asked of it begins at {lowest:g} Hz. Do not rely on what it does there.",
            BandWarning,
            stacklevel=stacklevel + 1,
        )


def list_bodies() -> list[str]:
    """Names of the bodies of the catalogue."""
    folder = resources.files("seatdyn.model") / "catalogue"
    return sorted(file.name[:-5] for file in folder.iterdir() if file.name.endswith(".toml"))


def load_body(name: str | Path) -> SeatedBody:
    """Read a body from the catalogue by name, or from a TOML file by path.

    Parameters
    ----------
    name : a name of `list_bodies()`, or the path of a file that ends in ``.toml``

    Raises
    ------
    ModelError
        Unknown name (with a suggestion), unreadable file, or a field that is missing or wrong.

    Examples
    --------
    >>> import seatdyn as sd
    >>> round(sd.load_body("ksiazek1997_back_off").total_mass, 9)
    70.8
    """
    text = str(name)
    if text.endswith(".toml"):
        path = Path(text)
        if not path.is_file():
            raise ModelError(f"Body file {text!r} does not exist.")
        content = path.read_bytes()
    else:
        if text not in list_bodies():
            raise ModelError(f"Unknown body {text!r}. {suggestion(text, list_bodies())}")
        folder = resources.files("seatdyn.model") / "catalogue"
        content = (folder / f"{text}.toml").read_bytes()
    try:
        return body_from_dict(tomllib.loads(content.decode("utf-8")))
    except ModelError:
        raise
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ModelError(f"Body file {text!r} is not valid TOML: {error}.") from None
    except KeyError as error:
        raise ModelError(
            f"Body file {text!r}: the field {error} is missing or misspelt. A body needs name, "
            "masses and links."
        ) from None
    except (TypeError, ValueError, AttributeError) as error:
        raise ModelError(
            f"Body file {text!r} has a field that is unknown or of the wrong kind: {error}."
        ) from None


def body_from_dict(data: Mapping[str, Any]) -> SeatedBody:
    """Build a `SeatedBody` from the parsed content of a catalogue file."""
    known = [item.name for item in fields(SeatedBody)]
    for key in data:
        if key not in known:
            raise ModelError(f"A body has no field {key!r}. {suggestion(key, known)}")
    required = {"name": data["name"], "masses": data["masses"]}
    links = tuple(Link(**{**link, "between": tuple(link["between"])}) for link in data["links"])
    feedback = tuple(
        FeedbackForce(
            on=force["on"],
            reaction=force["reaction"],
            terms=tuple(FeedbackTerm(**term) for term in force["terms"]),
            delay=force.get("delay", 0.0),
        )
        for force in data.get("feedback", [])
    )
    return SeatedBody(**{**data, **required, "links": links, "feedback": feedback})
