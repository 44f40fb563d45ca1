"""HTML reports: one file with everything in it."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from typing import Any


def data_uri(png: bytes) -> str:
    """PNG as an address that holds the picture itself."""
    return "data:image/png;base64," + base64.b64encode(png).decode("ascii")


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
