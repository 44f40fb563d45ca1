"""A statement about how the paper must be read, and what became of it."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any, Literal

Verdict = Literal["confirmed", "refined", "not confirmed", "open"]


@dataclass(frozen=True)
class Claim:
    """One statement.

    key : name in the summary
    claim : what is said
    found : what this run gives
    verdict : how the two agree; "open" where the cause is not known
    numbers : what `found` is made of
    """

    key: str
    claim: str
    found: str
    verdict: Verdict
    numbers: dict[str, Any] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """The claim as plain data."""
        return asdict(self)
