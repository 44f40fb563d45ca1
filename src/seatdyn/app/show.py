"""What a command says: one JSON object or tables on standard output, the rest on standard error."""

from __future__ import annotations

import json
import logging
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from seatdyn.errors import Status

if TYPE_CHECKING:
    import xarray as xr

NO_RESULT = 3
MOST_NAMED = 3  # files in a message
LARGEST_TABLE = 24  # rows for people; --json has them all


class Interrupted(Exception):
    """Ctrl-C after a part of the work was kept; the text says where it is."""


def say(message: str) -> None:
    """Print one message on standard error."""
    print(message, file=sys.stderr, flush=True)


class Messages(logging.Handler):
    """Passes on what the library logs, such as that kernels are being compiled."""

    def emit(self, record: logging.LogRecord) -> None:
        """Print the bare message."""
        say(record.getMessage())


class Written(logging.Handler):
    """Keeps the names of the files that the library says it has written."""

    def __init__(self) -> None:
        """Begin with none."""
        super().__init__(logging.INFO)
        self.files: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Add one."""
        self.files.append(record.getMessage())

    def __str__(self) -> str:
        """Name a few, count many."""
        if not self.files:
            return "nothing was finished"
        if len(self.files) > MOST_NAMED:
            return f"written before: {len(self.files)} files, the last one {self.files[-1]}"
        return f"written before: {', '.join(self.files)}"


def plain(value: Any) -> Any:
    """Turn a value into what strict JSON can hold: NaN and infinity become null."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):  # numpy arrays and scalars
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, complex):
        return {"real": plain(value.real), "imag": plain(value.imag)}
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if value is None or isinstance(value, bool | int) else str(value)


def write_json(answer: Mapping[str, Any]) -> None:
    """Write one JSON object to standard output, and nothing else."""
    sys.stdout.write(json.dumps(plain(answer), allow_nan=False) + "\n")
    sys.stdout.flush()


def write_table(title: str, columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Write a table; the first column is text, the others are numbers. Long ones are thinned."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    everything = list(rows)
    step = math.ceil(len(everything) / LARGEST_TABLE) or 1
    shown = everything[::step]
    note = f"one row in {step} of {len(everything)}; --json has all" if step > 1 else None
    table = Table(
        title=title, title_justify="left", caption=note, caption_justify="left", box=box.SIMPLE
    )
    for i, column in enumerate(columns):
        table.add_column(column, justify="right" if i else "left")
    for row in shown:
        table.add_row(*(cell(value) for value in row))
    Console(highlight=False, markup=False).print(table)


def write_line(text: str) -> None:
    """Write one line of a result for people."""
    print(text, flush=True)


def cell(value: Any) -> str:
    """Text of one number or word in a table."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}" if math.isfinite(value) else "-"
    return "-" if value is None else str(value)


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[..., None]]:
    """Give a callable (share done, message) that draws a bar where standard error is a terminal."""
    if not sys.stderr.isatty():
        yield lambda share, message="": None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=1.0)

        def report(share: float, message: str = "") -> None:
            bar.update(task, completed=share, description=message or title)

        yield report


def finish(status: str, message: str = "") -> None:
    """Leave with exit code 3 where there is no valid result."""
    if not Status(status).valid:
        say(f"status {status}: {message or Status(status).message}")
        raise typer.Exit(NO_RESULT)


def left_out(data: xr.Dataset) -> list[str]:
    """Names of the non-linear elements that a linear analysis left out; people are told."""
    names: list[str] = json.loads(data.attrs["ignored"])
    if names:
        say(f"left out, non-linear: {', '.join(names)} (or use --linearise tangent)")
    return names


def plot_target(path: Path | None) -> None:
    """Refuse a place that cannot be written before the work, not after it."""
    if path is not None:
        from seatdyn.output.figures import SUFFIXES
        from seatdyn.output.files import writable

        writable(path, SUFFIXES)


def report_target(path: Path | None) -> None:
    """The same for a report."""
    if path is not None:
        from seatdyn.output.files import writable

        writable(path, (".html",))


def draw(data: xr.Dataset, path: Path | None) -> None:
    """Draw the result where that was asked for."""
    if path is not None:
        from seatdyn.output.figures import plot

        plot(data, path)
        say(f"wrote {path}")
