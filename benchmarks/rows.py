"""Rows of the table of all benchmarks: ours and a peer in the same run, with the errors of both."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path


@dataclasses.dataclass(frozen=True)
class Row:
    """One comparison.

    work : what is done
    ours, theirs : s for the work, or for one of many
    peer : who does it beside us
    error, peer_error : of the answers, as the script says; NaN where there is none
    target : of the ratio theirs / ours; NaN where none was set
    limit : how far ours is from what the machine could do, and what stands between
    """

    work: str
    ours: float
    peer: str
    theirs: float
    error: float
    peer_error: float
    target: float
    limit: str

    @property
    def ratio(self) -> float:
        """How many times faster than the peer."""
        return self.theirs / self.ours


def write(rows: list[Row], path: str | Path) -> None:
    """Write rows as JSON."""
    found = [dataclasses.asdict(row) | {"ratio": row.ratio} for row in rows]
    Path(path).write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


def read(path: Path) -> list[Row]:
    """Read rows that `write` wrote."""
    names = [field.name for field in dataclasses.fields(Row)]
    return [
        Row(**{name: row[name] for name in names})
        for row in json.loads(path.read_text(encoding="utf-8"))
    ]


def markdown(rows: list[Row]) -> str:
    """Rows as a table for people."""
    lines = [
        "| work | seatdyn (error) | peer (error) | ratio | target | from the machine's limit |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    lines += [
        f"| {row.work} | {duration(row.ours)} ({row.error:.0e}) "
        f"| {row.peer}: {duration(row.theirs)} ({row.peer_error:.0e}) | {row.ratio:.3g} "
        f"| {'none' if math.isnan(row.target) else f'{row.target:g}'}"
        f"{' **short**' if row.ratio < row.target else ''} | {row.limit} |"
        for row in rows
    ]
    return "\n".join(lines) + "\n"


def duration(seconds: float) -> str:
    """Time with a unit that fits."""
    for factor, unit in ((1.0, "s"), (1e-3, "ms"), (1e-6, "us")):
        if seconds >= factor:
            return f"{seconds / factor:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"
