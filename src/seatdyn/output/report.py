"""HTML reports: one file with everything in it."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from seatdyn.disk import write_whole
from seatdyn.output.files import writable

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def data_uri(png: bytes) -> str:
    """PNG as an address that holds the picture itself."""
    return "data:image/png;base64," + base64.b64encode(png).decode("ascii")


def figure_png(figure: Figure) -> bytes:
    """Picture of a figure."""
    picture = io.BytesIO()
    figure.savefig(picture, format="png")
    return picture.getvalue()


def write_page(template: str, context: Mapping[str, Any], path: str | Path) -> Path:
    """Fill a template and write it as one file that ends in ``.html``."""
    target = writable(path, (".html",))
    write_whole(target, render_report(template, context).encode("utf-8"))
    return target


def render_report(template: str, context: Mapping[str, Any]) -> str:
    """Fill a template of `output/templates`; a name missing from the context is an error."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("seatdyn.output", "templates"),
        undefined=StrictUndefined,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["data_uri"] = data_uri
    return environment.get_template(template).render(**context)
