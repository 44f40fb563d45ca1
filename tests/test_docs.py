"""What the documentation says is true: examples, code blocks, doctests, names, import rule."""

from __future__ import annotations

import ast
import contextlib
import doctest
import importlib
import io
import pkgutil
import re
import runpy
import shlex
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

import seatdyn as sd
from seatdyn.app.cli import app

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "seatdyn"
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
PAGES = (
    "README.md",
    "docs/tutorial.md",
    "docs/howto.md",
    "docs/steady_states.md",
    "docs/random.md",
    "docs/seat-test.md",
    "docs/elements.md",
    "docs/bodies.md",
    "docs/standards.md",
    "docs/cli.md",
)
MODULES = sorted(
    module.name
    for module in pkgutil.walk_packages([str(SOURCE)], "seatdyn.")
    if not module.name.endswith("__main__")
)
LONGEST_FILE, LONGEST_EXAMPLE = 600, 60
FENCE = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
COUNTED = re.compile(r"\d+(?= (?:steps|periods))")  # how much work a run was may change
NUMBER = re.compile(r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?$")

# One number or phrase of each example that another test or the theory vouches for.
PRINTED = {
    "01_poles_and_modes": "f0  1.5464 Hz",
    "02_stability": "29.449049 kg",
    "03_frequency_response": "61.663 kg",
    "04_steady_state": "friction, 50 N              1.7666",
    "05_shock_on_end_stops": "with stops",
    "06_own_body_and_element": "loaded result is identical: True",
    "07_assess_a_measurement": "the same SEAT within 1 %: True",
    # light and heavy, closed form in tests/test_seat_test.py; the active body on a light seat
    "08_which_damping": "heavy     0.932+-0.003      4000  300 600 1000 1500 2500",
}
LONG = ("08_which_damping",)


# ---------------------------------------------------------------- examples and pages


def test_every_example_is_known():
    assert [file.stem for file in EXAMPLES] == list(PRINTED)


@pytest.mark.parametrize(
    "file",
    [pytest.param(file, marks=pytest.mark.slow if file.stem in LONG else ()) for file in EXAMPLES],
    ids=lambda file: file.stem,
)
def test_example(file, tmp_path, monkeypatch, capsys):
    assert len(file.read_text(encoding="utf-8").splitlines()) < LONGEST_EXAMPLE
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", [str(file), str(tmp_path)])
    runpy.run_path(str(file), run_name="__main__")
    assert PRINTED[file.stem] in capsys.readouterr().out
    pictures = list(tmp_path.glob("*.png"))
    assert pictures
    assert all(picture.stat().st_size > 10_000 for picture in pictures)


def same(shown, got):
    """Whether words agree, and numbers to one unit of the last digit shown."""
    left, right = (COUNTED.sub("some", text).split() for text in (shown, got))
    return len(left) == len(right) and all(map(alike, left, right))


def alike(a, b):
    """Whether two words agree; of a number like 3e-11, rounding noise, only the look counts."""
    if a == b:
        return True
    marks = "()[],;:%"
    a, b = a.strip(marks), b.strip(marks)
    if not (NUMBER.match(a) and NUMBER.match(b)):
        return False
    if "e-" in a and "e-" in b and max(float(a), float(b)) < 1e-6:
        return True
    digits = len(a.partition(".")[2])
    # long numbers differ in their last digits from one machine to another
    return abs(float(a) - float(b)) <= max(1.01 * 10.0**-digits, 1e-9 * abs(float(a)))


def test_comparison_of_outputs_can_fail():
    assert same("at 1.5464 Hz, 3e-11", "at 1.5465 Hz, 2e-12")
    assert not same("at 1.5464 Hz", "at 1.5474 Hz")
    assert not same("stable", "unstable")


@pytest.mark.parametrize("page", PAGES)
def test_page_runs_and_shows_what_comes_out(page, tmp_path, monkeypatch):
    """Python blocks run in one namespace; a following text block is their output."""
    monkeypatch.chdir(tmp_path)
    namespace = {"__name__": "page"}
    blocks = FENCE.findall((ROOT / page).read_text(encoding="utf-8"))
    ran, printed = 0, None
    for language, body in blocks:
        if language == "python":
            out = io.StringIO()
            with contextlib.redirect_stdout(out):
                exec(compile(body, f"{page}, block {ran + 1}", "exec"), namespace)
            printed, ran = out.getvalue(), ran + 1
        elif language == "text":
            assert printed is not None, f"{page}: output without a block before it:\n{body}"
            assert same(body, printed), f"{page} shows\n{body}\nbut the block prints\n{printed}"
            printed = None
        elif language == "console":
            command, _, shown = body.partition("\n")
            assert command.startswith("$ seatdyn "), command
            result = CliRunner().invoke(app, shlex.split(command)[2:])
            assert result.exit_code in (0, 2, 3), result.output
            if shown:
                assert same(shown, result.output), f"{page}: {command}\n{result.output}"
            ran += 1
    assert ran > 0


# ---------------------------------------------------------------- docstrings and names


@pytest.mark.parametrize("name", MODULES)
def test_doctests(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    module = importlib.import_module(name)
    assert module.__doc__
    assert doctest.testmod(module).failed == 0


def test_every_public_name_is_described():
    text = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    mentioned = set(re.findall(r"[A-Za-z_]\w*", text))
    for name in sd.__all__:
        if name == "__version__":
            continue
        assert (getattr(sd, name).__doc__ or "").strip(), f"{name} has no docstring"
        assert name in mentioned, f"{name} is missing in docs/api.md"


# ---------------------------------------------------------------- the house

# Who may import whom, at the top of a file and inside functions.
BELOW = {
    "errors": (),
    "units": ("errors",),
    "disk": ("errors",),
    "kernels": ("units", "errors"),
    "standards": ("units", "errors"),
    "signals": ("standards", "units", "errors"),
    "model": (
        "kernels.laws",
        "kernels.memory_laws",
        "signals",
        "standards",
        "units",
        "disk",
        "errors",
    ),
    "analysis": ("model", "kernels", "signals", "standards", "units", "disk", "errors"),
    "output": ("analysis", "model", "kernels", "signals", "standards", "units", "disk", "errors"),
    "paper": ("output", "analysis", "model", "kernels", "signals", "units", "disk", "errors"),
    "app": (
        *("paper", "output", "analysis", "model", "kernels", "signals", "standards"),
        *("units", "disk", "errors"),
    ),
}
LAZILY = {"model": ("kernels.jit",)}  # inside functions: user laws are compiled on first use
HEAVY = ("numba", "xarray", "matplotlib", "h5netcdf", "rich", "typer")
FREE = ("app",)  # may import typer at the top


def imports(tree):
    """Every import of a file: name, whether at the top, whether for types only."""
    typing_only = {
        inner
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        for inner in ast.walk(node)
    }
    top = set(tree.body)
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative import"
            base = str(node.module)
            names = [f"{base}.{a.name}" if base == "seatdyn" else base for a in node.names]
            if base == "seatdyn.kernels":
                names = [f"{base}.{a.name}" for a in node.names]
        else:
            continue
        for name in names:
            yield name, node in top, node in typing_only


FILES = sorted(SOURCE.rglob("*.py"))


@pytest.mark.parametrize("file", FILES, ids=lambda f: f.relative_to(SOURCE).as_posix())
def test_imports_run_one_way(file):
    place = file.relative_to(SOURCE).with_suffix("").parts
    part = place[0]
    tree = ast.parse(file.read_text(encoding="utf-8"))
    assert len(file.read_text(encoding="utf-8").splitlines()) <= LONGEST_FILE
    for name, at_top, for_types in imports(tree):
        if not name.startswith("seatdyn"):
            heavy = name.partition(".")[0] in HEAVY and at_top and part not in FREE
            numba_in_kernels = part == "kernels" and name.startswith("numba")
            assert not heavy or numba_in_kernels, f"{name} at the top of {file.name}"
            continue
        inside = name.removeprefix("seatdyn").removeprefix(".")
        if part in ("__init__", "__main__") or inside in ("", "__version__") or for_types:
            continue
        allowed = (part, *BELOW[part], *(() if at_top else LAZILY.get(part, ())))
        fits = any(inside == a or inside.startswith(a + ".") for a in allowed)
        assert fits, f"{part} must not import {name}"
