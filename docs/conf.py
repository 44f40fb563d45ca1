"""Settings of Sphinx."""

import importlib.metadata
import re

project = "seatdyn"
author = "The seatdyn developers"
copyright = author
release = importlib.metadata.version("seatdyn")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.mathjax"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["_build"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3

autodoc_typehints = "none"
autodoc_default_options = {"members": False}
autoclass_content = "class"
napoleon_numpy_docstring = True
napoleon_google_docstring = False

html_theme = "alabaster"
html_theme_options = {"description": "the seated body on its suspension", "page_width": "1100px"}
html_sidebars = {"**": ["about.html", "searchbox.html", "navigation.html"]}


def plain_text(app, what, name, obj, options, lines):
    """Keep |v| and acc_ in a docstring as they are; they are marks of reStructuredText."""
    lines[:] = [
        re.sub(r"(?<=[A-Za-z])_(?![\w`])", r"\_", line.replace("|", r"\|")) for line in lines
    ]


def setup(app):
    """Register it, before napoleon."""
    app.connect("autodoc-process-docstring", plain_text, priority=400)
