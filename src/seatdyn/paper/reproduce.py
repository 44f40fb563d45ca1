"""The whole study of the paper in one call."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from seatdyn.paper.blocks import write_amplitudes, write_columns, write_linear, write_ratios
from seatdyn.paper.cases import compute_table, readings
from seatdyn.paper.claims import verify_claims
from seatdyn.paper.deviations import DEFINITIONS, TARGETS, table_statistics
from seatdyn.paper.explanations import EXPLANATIONS
from seatdyn.paper.linear_tables import LinearCell, outside_rounding, table01, table02
from seatdyn.paper.provenance import provenance
from seatdyn.paper.random_cases import RANDOM_READINGS, compute_ratios, random_provenance
from seatdyn.paper.random_claims import random_claims
from seatdyn.paper.random_tables import RANDOM_TABLES, printed_ratios
from seatdyn.paper.tables import TABLES, Array, printed_table
from seatdyn.paper.writing import OutputFolder

Progress = Callable[[float, str], None]
# Shares of the run after which each part is over, from its measured time.
LINEAR_DONE, TABLES_DONE, RANDOM_DONE, CLAIMS_DONE, FIGURES_DONE = 0.01, 0.08, 0.43, 0.65, 0.85
OWN_DONE = 0.98


def reproduce(
    out: Path, *, progress: Progress | None = None, figures: bool = True
) -> dict[str, Any]:
    """Recompute Tables 1 to 10 and Figures 2 and 4 to 31, and write them beside the print.

    Files are written whole as soon as they are finished: ``tables/table01.csv`` ...,
    ``figures/fig02.png`` and ``.svg`` ..., ``summary.json``, ``report.html``.

    Parameters
    ----------
    out : folder for the results, made where it is missing
    progress : called with the share done and what is being done
    figures : False leaves the figures out, in the report too

    Returns
    -------
    dict
        The content of ``summary.json``: table -> reading -> column group -> statistics.

    Raises
    ------
    OutputError
        The folder cannot be written to, or is full.

    Examples
    --------
    >>> from pathlib import Path
    >>> from seatdyn.paper.reproduce import reproduce
    >>> summary = reproduce(Path("reproduction"))  # doctest: +SKIP
    """
    from seatdyn.paper.presentation import report_html

    say = progress or (lambda share, message: None)
    folder = OutputFolder(out)
    say(0.0, "Tables 1 and 2")
    linear = {"table01": table01(), "table02": table02()}
    write_linear(folder, "table01", linear["table01"], "parameter")
    write_linear(folder, "table02", linear["table02"], "model")
    write_columns(folder)

    computed: dict[int, dict[str, Array]] = {}
    share = (TABLES_DONE - LINEAR_DONE) / len(TABLES)
    for k, number in enumerate(TABLES):
        computed[number] = _compute(number, say, LINEAR_DONE + k * share, share)
        write_amplitudes(folder, printed_table(number), computed[number])
    ratios: dict[int, dict[str, Array]] = {}
    share = (RANDOM_DONE - TABLES_DONE) / len(RANDOM_TABLES)
    for k, number in enumerate(RANDOM_TABLES):
        ratios[number] = _compute_ratios(number, say, TABLES_DONE + k * share, share)
        write_ratios(folder, printed_ratios(number), ratios[number])
    summary = summarise(linear, computed, ratios)
    folder.write_json("summary.json", summary)

    claims = verify_claims(
        lambda done, text: say(RANDOM_DONE + done * (CLAIMS_DONE - RANDOM_DONE), text)
    )
    claims += random_claims(ratios)
    summary["claims"] = [claim.as_dict() for claim in claims]
    folder.write_json("summary.json", summary)
    images: dict[str, bytes] = {}
    if figures:
        images = _draw(folder, computed | ratios, say)
    say(OWN_DONE, "Report")
    folder.write("report.html", report_html(summary, linear, computed, ratios, claims, images))
    say(1.0, "Done")
    return summary


def summarise(
    linear: dict[str, list[LinearCell]],
    computed: dict[int, dict[str, Array]],
    ratios: dict[int, dict[str, Array]],
) -> dict[str, Any]:
    """Statistics of all tables, as in ``summary.json``."""
    summary: dict[str, Any] = {
        "definitions": DEFINITIONS,
        "targets": {f"table{number:02d}": list(groups) for number, groups in TARGETS.items()},
        "readings": {
            f"table{number:02d}": {r.name: r.text for r in readings(printed_table(number).back_on)}
            for number in computed
        }
        | {printed_ratios(n).key: {r.name: r.text for r in RANDOM_READINGS} for n in ratios},
        "explanations": {
            f"table{number:02d}": {g: text for (n, g), text in EXPLANATIONS.items() if n == number}
            for number in computed
        },
        "provenance": provenance(),
    }
    for key, cells in linear.items():
        summary[key] = {
            "cells": len(cells),
            "within_rounding": len(cells) - len(outside_rounding(cells)),
            "outside_rounding": [
                {
                    "cell": f"{cell.row} {cell.column}",
                    "printed": float(cell.printed),
                    "computed": cell.computed,
                    "unit": cell.unit,
                }
                for cell in outside_rounding(cells)
            ],
        }
    for number, arrays in computed.items():
        table = printed_table(number)
        summary[table.key] = {name: table_statistics(table, a) for name, a in arrays.items()}
    summary["provenance"]["random"] = random_provenance(ratios)
    for number, arrays in ratios.items():
        printed = printed_ratios(number)
        summary[printed.key] = {name: printed.statistics(a[0]) for name, a in arrays.items()}
    return summary


def _compute(number: int, say: Progress, start: float, share: float) -> dict[str, Array]:
    """One table under every reading."""
    chosen = readings(printed_table(number).back_on)
    arrays = {}
    for i, reading in enumerate(chosen):

        def tell(done: float, i: int = i, name: str = reading.name) -> None:
            say(start + share * (i + done) / len(chosen), f"Table {number}, {name}")

        arrays[reading.name] = compute_table(number, reading, progress=tell)
    return arrays


def _compute_ratios(number: int, say: Progress, start: float, share: float) -> dict[str, Array]:
    """Table 9 or 10 under every reading."""
    arrays = {}
    for i, reading in enumerate(RANDOM_READINGS):

        def tell(done: float, i: int = i, name: str = reading.name) -> None:
            say(start + share * (i + done) / len(RANDOM_READINGS), f"Table {number}, {name}")

        arrays[reading.name] = compute_ratios(number, reading, progress=tell)
    return arrays


def _draw(
    folder: OutputFolder, computed: dict[int, dict[str, Array]], say: Progress
) -> dict[str, bytes]:
    """All figures to files; the PNGs also for the report."""
    from seatdyn.output.style import render
    from seatdyn.paper.figures import FIGURES
    from seatdyn.paper.figures_delay import OWN_FIGURES

    images = {}
    for k, figure in enumerate(FIGURES):
        share = CLAIMS_DONE + (FIGURES_DONE - CLAIMS_DONE) * k / len(FIGURES)
        say(share, f"Figure {figure.number}")
        png, svg = render(partial(figure.draw, computed))
        folder.write(f"figures/{figure.key}.png", png)
        folder.write(f"figures/{figure.key}.svg", svg)
        images[figure.key] = png
    for k, own in enumerate(OWN_FIGURES):
        share = FIGURES_DONE + (OWN_DONE - FIGURES_DONE) * k / len(OWN_FIGURES)
        say(share, "Reaction delay (not in print)")
        png, svg = render(own.draw)
        folder.write(f"figures/{own.key}.png", png)
        folder.write(f"figures/{own.key}.svg", svg)
        images[own.key] = png
    return images
