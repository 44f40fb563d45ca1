"""Start-up: what is imported, where compiled code goes, cold and shared caches."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import seatdyn as sd

PACKAGE = Path(sd.__file__).parent
# a small kernel: Routh's array
SMALL = (
    "import seatdyn as sd; "
    "print(sd.is_stable(sd.load_body('ksiazek1997_back_on'), method='hurwitz'), sd.__file__)"
)
STEADY = (
    *(sys.executable, "-m", "seatdyn", "steady"),
    *("--frequency", "1.55", "--amplitude", "0.8857", "--end-stop", "500", "--json"),
)
ANSWER = 4.15774597926  # m/s2, acc_seat: row gamma = 500 of oracle/data/table03_as_printed.csv


def environment(cache, **extra):
    """Environment of a child whose compiled code goes below `cache`."""
    return os.environ | {"SEATDYN_CACHE_DIR": str(cache), "PYTHONDONTWRITEBYTECODE": "1", **extra}


def child(code, **options):
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, **options
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def listing(folder):
    """Every file below a folder with its time and size."""
    return {
        str(file.relative_to(folder)): (file.stat().st_mtime_ns, file.stat().st_size)
        for file in sorted(folder.rglob("*"))
        if file.is_file()
    }


def test_import_is_light():
    heavy = ["numba", "scipy", "xarray", "matplotlib", "h5netcdf", "typer", "rich", "jinja2"]
    code = f"import sys, seatdyn; dir(seatdyn); print([m for m in {heavy} if m in sys.modules])"
    assert child(code) == "[]\n"


def test_model_needs_no_compiler():
    code = (
        "import sys, seatdyn as sd; s = sd.SeatSystem(sd.load_body('ksiazek1997_back_off'), "
        "sd.Seat(35.0, [sd.Spring(9950.0), sd.QuadraticDamper(100.0)])); sd.poles(s); "
        "print([m for m in ('numba', 'matplotlib') if m in sys.modules])"
    )
    assert child(code) == "[]\n"


def test_steady_state_loads_only_its_own_engine():
    code = (
        "import sys, seatdyn.analysis.steady; "
        "print([m for m in sys.modules if m in ('seatdyn.kernels.orbit', 'seatdyn.kernels.delay')])"
    )
    assert child(code) == "[]\n"


def test_unknown_names_are_refused():
    with pytest.raises(AttributeError, match="no attribute 'polse'"):
        _ = sd.polse


def test_works_from_a_read_only_installation(tmp_path):
    """Nothing is written below the package; the cache goes where the user says."""
    site, cache = tmp_path / "site", tmp_path / "cache"
    copy = site / "seatdyn"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    before = listing(copy)
    folders = [copy, *(f for f in copy.rglob("*") if f.is_dir())]
    for folder in folders:
        folder.chmod(0o555)
    try:
        out = child(SMALL, env=environment(cache, PYTHONPATH=str(site)))
    finally:
        for folder in folders:
            folder.chmod(0o755)
    assert out.startswith("True ")
    assert str(copy) in out
    assert listing(copy) == before
    assert any(name.endswith(".nbi") for name in listing(cache))


def test_works_where_no_cache_is_possible(tmp_path):
    """A cache directory that is a file, and no home."""
    blocked = tmp_path / "file"
    blocked.write_text("")
    env = environment(blocked, HOME=str(blocked), XDG_CACHE_HOME=str(blocked))
    assert child(SMALL, env=env).startswith("True ")


def test_second_process_does_not_compile_again(tmp_path):
    child(SMALL, env=environment(tmp_path))
    first = listing(tmp_path)
    assert first
    child(SMALL, env=environment(tmp_path))
    assert listing(tmp_path) == first


@pytest.mark.slow
def test_two_processes_on_a_cold_cache(tmp_path):
    env = environment(tmp_path)
    both = [
        subprocess.Popen(STEADY, env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for _ in range(2)
    ]
    for process in both:
        out, err = process.communicate(timeout=300)
        assert process.returncode == 0, err
        assert json.loads(out)["amplitude"]["acc_seat"] == pytest.approx(ANSWER, rel=1e-7)
    warm = listing(tmp_path)
    subprocess.run(STEADY, env=env, capture_output=True, check=True)
    assert listing(tmp_path) == warm


@pytest.mark.slow
def test_a_message_while_it_compiles(tmp_path):
    env = environment(tmp_path)
    cold = subprocess.run(STEADY, env=env, capture_output=True, text=True, check=True)
    assert "compiling the kernels" in cold.stderr
    assert json.loads(cold.stdout)["converged"]
    warm = subprocess.run(STEADY, env=env, capture_output=True, text=True, check=True)
    assert warm.stderr == ""
    assert warm.stdout == cold.stdout
