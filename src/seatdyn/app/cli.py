"""The command line: `seatdyn COMMAND ...`. It adds no physics."""

from __future__ import annotations

import gc
import logging
import os
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperGroup

import seatdyn
from seatdyn.app import curve as curves
from seatdyn.app import linear, random, response, standards
from seatdyn.app.bodies import bodies
from seatdyn.app.options import option, spread
from seatdyn.app.seat_test import seat_test
from seatdyn.app.show import (
    Interrupted,
    Messages,
    Written,
    progress_bar,
    say,
    write_line,
    write_table,
)
from seatdyn.errors import SeatdynError, SeatdynWarning

BAD_INPUT, INTERRUPTED, BROKEN_PIPE = 2, 130, 1
OBJECTS_BETWEEN_COLLECTIONS = 100_000


class Commands(TyperGroup):
    """The group of commands; turns every foreseen failure into one message and an exit code."""

    def main(self, *args: Any, **extra: Any) -> NoReturn:
        """Run, and leave with 0 (result), 2 (bad input), 3 (no valid result) or 130 (Ctrl-C)."""
        extra |= {"standalone_mode": False, "prog_name": "seatdyn"}
        code: int | None
        messages, written = Messages(logging.WARNING), Written()
        logging.getLogger("seatdyn").addHandler(messages)
        logging.getLogger("seatdyn.disk").addHandler(written)
        logging.getLogger("seatdyn.disk").setLevel(logging.INFO)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("always", SeatdynWarning)
                warnings.showwarning = _show_warning
                code = super().main(*args, **extra)
            sys.stdout.flush()
        except (SeatdynError, OSError) as error:
            if isinstance(error, BrokenPipeError):
                # the reader has gone; Python would complain again when it flushes at its end
                os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
                sys.exit(BROKEN_PIPE)
            say(f"error: {error}")
            code = BAD_INPUT
        except Interrupted as stop:
            say(f"interrupted; {stop}")
            sys.exit(INTERRUPTED)
        except (KeyboardInterrupt, typer.Abort):
            code = INTERRUPTED
        except SystemError as error:
            if not _is_interrupt(error):
                raise
            code = INTERRUPTED
        except Exception as error:
            # the class of usage errors has moved between versions of typer; its method has not
            if not hasattr(error, "format_message"):
                raise
            context = getattr(error, "ctx", None)
            usage = f" See `{context.command_path} --help`." if context else ""
            say(f"error: {error.format_message().rstrip('.')}.{usage}")
            code = BAD_INPUT
        finally:
            logging.getLogger("seatdyn").removeHandler(messages)
            logging.getLogger("seatdyn.disk").removeHandler(written)
        if code == INTERRUPTED:
            say(f"interrupted; {written}")
        sys.exit(code or 0)


app = typer.Typer(
    cls=Commands,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",
    context_settings={"help_option_names": ["-h", "--help"]},
)


def main() -> None:
    """Entry point of `seatdyn`."""
    # compiles the kernels a tenth faster and runs them as fast; read when numba is first imported
    os.environ.setdefault("NUMBA_OPT", "2")
    # what imports make stays; looking for garbage among it took a third of a short command's time
    gc.set_threshold(OBJECTS_BETWEEN_COLLECTIONS)
    try:
        app()
    finally:
        gc.freeze()  # nor is there anything to look for at the end


def _is_interrupt(error: BaseException | None) -> bool:
    """Whether Ctrl-C is behind an error: out of compiled code it comes wrapped in SystemErrors."""
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__cause__ or error.__context__
    return error is not None


def _show_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    say(f"warning: {message}")


def _version(wanted: bool) -> None:
    if wanted:
        write_line(f"seatdyn {seatdyn.__version__}")
        raise typer.Exit()


@app.callback(invoke_without_command=True)
def start(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Dynamics of the seated human body on a seat with a vibration isolation system.

    Without options a command asks about the body of the paper without backrest contact on the
    paper's seat: 35 kg, 9950 N/m, 260 N s/m. With --json it prints one JSON object. It exits with
    0 (result), 2 (bad input) or 3 (computed, but no valid result: see the status).
    """
    if context.invoked_subcommand is None:
        write_line(context.get_help())


def reproduce(
    out: Annotated[
        Path, option("--out", "Directory of the report.", panel="Output", default=True)
    ] = Path("reproduction"),
) -> None:
    """Recompute the paper's tables and figures beside its own numbers, with a report."""
    from seatdyn.paper.reproduce import reproduce as run

    with progress_bar("reproduce") as progress:
        summary = run(out, progress=progress)
    groups = ("acceleration", "displacement", "relative", "force", "nonlinear_force")
    rows = [
        (
            table,
            reading,
            *(_percent(readings[reading].get(group, {}).get("rms")) for group in groups),
        )
        for table, readings in summary.items()
        if table.startswith("table") and isinstance(readings, dict)
        for reading in ("as_printed", "consistent", "as_read")
        if reading in readings
    ]
    write_table(
        "Deviation from the printed tables, r.m.s. in %",
        ["table", "reading", *groups],
        rows,
    )
    write_line(f"report: {out / 'report.html'}")


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.3f}"


EXAMPLES: dict[Callable[..., None], str] = {
    bodies: "bodies --compare --json",
    linear.poles: "poles --seat-mass 30 --json",
    linear.zeros: "zeros --body-alone --output m1",
    linear.frf: "frf --frequency 0.5 20 400 --plot frf.png",
    linear.stability: "stability --seat-mass-range 5 60 200 --damping-range 0 500 200",
    linear.critical: "critical --vary seat-mass --range 1 100",
    linear.delay_margin: "delay-margin --delayed suspension --json",
    curves.curve: "curve --level 0.3 --level 0.6 --frequency 1 2 --quadratic 500 --plot curve.png",
    response.steady: "steady --frequency 1.55 --amplitude 0.8857 --quadratic 100",
    response.simulate: "simulate --frequency 2 --rms 0.5 --duration 10 --out run.nc",
    random.random: "random --input EM3 --duration 60 --realisations 32 --seed 1 --coulomb 50",
    seat_test: "seat-test --seat illustrative_suspension --class EM3 --report test.html",
    standards.assess: "assess ride.csv --axis z --column seat --floor-column floor --json",
    standards.weighting: "weighting Wk 1 4 16",
    reproduce: "reproduce --out reproduction",
}
for _command, _example in EXAMPLES.items():
    app.command(epilog=f"Example: seatdyn {_example}")(spread(_command))
