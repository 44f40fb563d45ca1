"""Two processes that compile together: who does what, and what happens if the second fails."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import numba
import pytest

import seatdyn as sd
from seatdyn.analysis.balance import balance
from seatdyn.analysis.run import Problem, Settings
from seatdyn.kernels import (
    condensed,
    dense,
    exponential,
    integrate,
    levels,
    orbit,
    plant,
    together,
)

# a kernel of two stages; each process writes down which functions it compiles, by its share
TINY = """
import os
import sys
import numpy as np
from seatdyn.kernels.jit import kernel, stage, takes
from seatdyn.kernels.shapes import REAL
from seatdyn.kernels.together import Shares

if "assist" in " ".join(sys.orig_argv) and "BROKEN" in os.environ:
    exec(os.environ["BROKEN"])

@takes(REAL)
@stage
def first(x):
    return x + 1.0

@takes(REAL)
@stage
def second(x):
    return 2.0 * x

@takes(REAL)
@kernel
def other(x):
    return x - 1.0

@kernel
def both(x):
    return first(x) * second(x)

SHARES = Shares(here=(first,), there=(second,), later=(other,))
"""
USE = """
import json, os, sys
{before}
import tiny
from seatdyn.kernels import together
together.compile_together("tiny")
{between}
value = tiny.both(3.0)
found = [f.__name__ for f in (tiny.first, tiny.second) if f.stats.cache_hits]
print(json.dumps({{"value": value, "found": found}}))
"""


@pytest.fixture
def tiny(tmp_path):
    """Runs a program with the tiny kernel, its cache below tmp_path; what it prints."""
    (tmp_path / "modules").mkdir()
    (tmp_path / "modules" / "tiny.py").write_text(TINY)

    def run(before="", between="", **extra):
        env = os.environ | {
            "SEATDYN_CACHE_DIR": str(tmp_path / "cache"),
            "PYTHONDONTWRITEBYTECODE": "1",
            # by sys.path alone: the second process must find the module there, too
            "MODULES": str(tmp_path / "modules"),
            **extra,
        }
        code = USE.format(
            before=f"sys.path.insert(0, os.environ['MODULES'])\n{before}", between=between
        )
        return subprocess.run(
            [sys.executable, "-c", code], env=env, capture_output=True, text=True, check=False
        )

    return run


def answer(done):
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    result = json.loads(done.stdout)  # and nothing else is printed
    assert result["value"] == 24.0
    return result["found"]


TWO_CORES = pytest.mark.skipif(
    len(os.sched_getaffinity(0)) < 2, reason="needs two cores to start a second process"
)
# the tiny share of the first process is over before the second one has started
PATIENT = (
    "from seatdyn.kernels import together; together.time.monotonic = iter([0.0, 60.0]).__next__"
)


@TWO_CORES
def test_the_second_process_does_its_share(tiny):
    assert answer(tiny(before=PATIENT)) == ["second"]
    # afterwards all is in the cache, and nobody starts a process
    assert answer(tiny(before="import subprocess; subprocess.Popen = None")) == []


@TWO_CORES
@pytest.mark.parametrize("how", ["raise ImportError", "os.kill(os.getpid(), 9)"])
def test_without_the_second_process_the_first_does_all(tiny, how):
    assert answer(tiny(before=PATIENT, BROKEN=how)) == []


@TWO_CORES
def test_a_second_process_that_hangs_is_not_waited_for(tiny):
    begin = time.monotonic()
    assert answer(tiny(BROKEN="import time; time.sleep(600)")) == []
    assert time.monotonic() - begin < 60.0


def test_no_second_process_where_none_can_be(monkeypatch, tmp_path):
    """No cache to exchange code through, one core, or no Python to start."""
    started = []
    monkeypatch.setattr(together, "_start", started.append)
    monkeypatch.setattr(together, "cache_directory", lambda: tmp_path)
    alone = together.compile_together.__wrapped__
    for owner, name, value in (
        (together, "cache_directory", lambda: None),
        (os, "sched_getaffinity", lambda _: {0}),
        (sys, "frozen", True),
        (sys, "executable", "/usr/bin/blender"),
        (sys, "executable", None),
    ):
        with monkeypatch.context() as one:
            one.setattr(owner, name, value, raising=False)
            alone("tiny")
    assert started == []
    assert list(tmp_path.iterdir()) == []


@TWO_CORES
def test_an_interrupted_start_is_done_over(tiny):
    stop = "together._compile = lambda _: (_ for _ in ()).throw(KeyboardInterrupt)"
    interrupted = tiny(before=f"from seatdyn.kernels import together\n{stop}")
    assert "KeyboardInterrupt" in interrupted.stderr
    assert answer(tiny(before=PATIENT)) == ["second"]


@TWO_CORES
def test_the_second_process_ends_with_the_first(tiny, tmp_path):
    """Even with one that is killed; the second one hangs in its share and holds a file open."""
    hang = f"open({str(tmp_path / 'pid')!r}, 'w').write(str(os.getpid())); import threading, time; "
    hang += "from seatdyn.kernels import together; together._compile = lambda _: time.sleep(600)"
    kill = (
        f"import time\nwhile not os.path.exists({str(tmp_path / 'pid')!r}): time.sleep(0.1)\n"
        "time.sleep(2.0); os.kill(os.getpid(), 9)"
    )
    assert tiny(between=kill, BROKEN=hang).returncode == -9
    pid = int((tmp_path / "pid").read_text())
    for _ in range(100):
        state = Path(f"/proc/{pid}/stat")
        if not state.exists() or state.read_text().rpartition(")")[2].split()[0] == "Z":
            return
        time.sleep(0.1)
    pytest.fail("the second process goes on")


def test_declared_types_are_those_of_a_run():
    seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.CoulombFriction(50.0)])
    system = sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat)
    problem = Problem.make(system, sd.Sine(1.55, amplitude=0.8857).lower(), Settings())
    assert numba.typeof(problem.plant) == plant.PLANT
    assert numba.typeof(problem.ladder) == exponential.LADDER
    run = problem.run(0.0, 0.1, problem.start([0.0] * (2 * problem.plant.linear.shape[0])))
    run.at(run.record[:, 0])
    assert dense.sample.signatures == [dense.sample.arguments]
    found = balance(system, sd.Sine(1.55, amplitude=0.8857), 1e-4)
    assert numba.typeof(found.problem) == condensed.CONDENSED
    assert numba.typeof(found.work) == condensed.WORK
    assert numba.typeof(found.look) == orbit.LOOK
    found.floquet()
    found.start()
    for function in levels.SHARES.later:
        assert function.signatures == [function.arguments]


@pytest.mark.slow
@TWO_CORES
@pytest.mark.parametrize(
    ("method", "module"), [("time", integrate.__name__), ("hb", levels.__name__)]
)
def test_a_run_needs_what_was_compiled_for_it(tmp_path, method, module):
    """Each stage is compiled once, for its declared types: here, or there and found here."""
    code = f"""
import json, seatdyn as sd
seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.QuadraticDamper(100.0)])
system = sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat)
sd.steady_state(system, sd.Sine(1.55, amplitude=0.8857), method={method!r})
from {module} import SHARES
print(json.dumps([
    [(f.__name__, list(map(str, f.signatures)) == [str(f.arguments)],
      sum(f.stats.cache_hits.values()), sum(f.stats.cache_misses.values())) for f in share]
    for share in SHARES
]))
"""
    env = os.environ | {"SEATDYN_CACHE_DIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", code], env=env, capture_output=True, text=True, check=True
    )
    here, there, later = json.loads(done.stdout)
    for name, as_declared, hits, misses in here:
        assert (name, as_declared, hits + misses) == (name, True, 1)
    for name, as_declared, hits, misses in there:
        assert (name, as_declared, hits, misses) == (name, True, 1, 0)
    assert later[0][2:] == [1, 0]  # not all of the rest is needed here


@pytest.mark.parametrize("shares", [integrate.SHARES, levels.SHARES])
def test_shares_name_every_stage_once(shares):
    names = [function.__name__ for share in shares for function in share]
    assert len(set(names)) == len(names)
