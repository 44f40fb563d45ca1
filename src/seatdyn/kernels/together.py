"""A cold start on two cores: two processes compile the stages of a kernel, each its share.

The first process that needs the kernel on a cold cache starts a second one. Code goes from one to
the other through the cache alone: whatever the second process fails to do, the first one does
itself, only later.
"""

from __future__ import annotations

import atexit
import functools
import importlib
import os
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import IO, Any, NamedTuple

from seatdyn.kernels.jit import cache_directory


class Shares(NamedTuple):
    """Who compiles what; every function tells the types of its arguments (`takes`).

    A module whose kernel is compiled together has them as `SHARES`. A function comes after those
    that it calls; one that both shares call comes early in `here`, so that `there` finds it done.
    """

    here: tuple[Any, ...]
    there: tuple[Any, ...]
    later: tuple[Any, ...] = ()  # by the second process while the first compiles the kernel itself


@functools.cache
def compile_together(name: str) -> None:
    """Compile the `SHARES` of module `name`, unless some process has begun to before."""
    directory = cache_directory()
    if directory is None or not _can_start():
        return
    mark = directory / f"{name}.begun"
    try:
        mark.touch(exist_ok=False)
        helper = _start(name)
    except OSError:
        return
    atexit.register(_end, helper)
    begin = time.monotonic()
    try:
        _compile(_shares(name).here)
        assert helper.stdout is not None
        done = threading.Thread(target=helper.stdout.readline, daemon=True)
        done.start()
        # if it needs twice our time, we do without: what is not in the cache is compiled here
        done.join(time.monotonic() - begin)
    except BaseException:
        mark.unlink(missing_ok=True)
        raise


def assist(name: str) -> None:
    """Compile the other share; this is what the second process does."""
    threading.Thread(target=_leave_with_parent, args=(sys.stdin,), daemon=True).start()
    shares = _shares(name)
    _compile(shares.there)
    print("done", flush=True)
    _compile(shares.later)


def _shares(name: str) -> Shares:
    shares: Shares = importlib.import_module(name).SHARES
    return shares


def _compile(functions: tuple[Any, ...]) -> None:
    for function in functions:
        function.compile(function.arguments)


def _can_start() -> bool:
    """Whether there is a core for a second process, and a Python to run it."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    # a frozen program, or one that Python is embedded in, would start itself once more
    is_python = Path(sys.executable or "").name.lower().startswith("python")
    return (cores or 1) > 1 and is_python and not getattr(sys, "frozen", False)


def _start(name: str) -> subprocess.Popen[bytes]:
    """Start the second process; it finds modules where this one does, and shows nothing."""
    code = f"import sys; sys.path[:] = {sys.path!r}; import {__name__} as t; t.assist({name!r})"
    return subprocess.Popen(
        [sys.executable, "-c", code],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )


def _end(helper: subprocess.Popen[bytes]) -> None:
    """Leave no process behind; what it has finished is in the cache."""
    helper.kill()
    helper.wait()


def _leave_with_parent(pipe: IO[str]) -> None:
    """End this process when the parent, however it ends, lets go of the pipe."""
    pipe.read()
    os._exit(0)
