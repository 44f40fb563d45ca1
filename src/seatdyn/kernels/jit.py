"""Compilation: one decorator for kernels, one function for user laws, one cache for both.

Compiled code is kept in a per-user directory (so that a read-only installation works), apart for
every version of the kernel sources, of numba and of Python. Writing is atomic, so several
processes may start on a cold cache at once. Set SEATDYN_CACHE_DIR to keep it elsewhere.
"""

from __future__ import annotations

import functools
import hashlib
import logging
import os
import platform
import sys
import threading
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

import numba
from numba import types
from numba.core import event

logger = logging.getLogger("seatdyn")

LAW = types.float64(types.float64, types.float64, types.CPointer(types.float64))
MEMORY_FORCE = types.float64(
    types.float64, types.float64, types.CPointer(types.float64), types.CPointer(types.float64)
)
MEMORY_RATE = types.void(*[types.float64] * 4, *[types.CPointer(types.float64)] * 3)
LANES_LAW = types.void(types.int64, *[types.CPointer(types.float64)] * 4)
COMPILE_HINT_AFTER = 1.0  # s
NOTHING: AbstractContextManager[None] = nullcontext()
TIME_ENGINE, BALANCE = 20.0, 40.0  # s that their kernels take to compile


@functools.cache
def cache_directory() -> Path | None:
    """Directory of compiled code for these sources, or None where nothing can be written."""
    digest = hashlib.sha256()
    for source in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(source.read_bytes())
    digest.update(f"{numba.__version__} {sys.version} {platform.machine()}".encode())
    name = f"kernels-{digest.hexdigest()[:16]}"
    roots = [os.environ.get("SEATDYN_CACHE_DIR"), os.environ.get("XDG_CACHE_HOME")]
    home = os.environ.get("HOME") or os.environ.get("LOCALAPPDATA")
    places = [Path(root) / "seatdyn" for root in roots if root]
    places += [Path(home) / ".cache" / "seatdyn"] if home else []
    for place in places:
        try:
            (place / name).mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(place / name, os.W_OK):
            return place / name
    return None


def _compile(make: Callable[..., Any], function: Callable[..., Any]) -> Any:
    """Decorate with the disk cache in our directory; without it where the cache is impossible."""
    directory = cache_directory()
    if directory is not None:
        config: Any = numba.config
        previous = config.CACHE_DIR
        config.CACHE_DIR = str(directory)
        try:
            return make(function, cache=True)
        except RuntimeError:  # a function without a source file, e.g. typed at a prompt
            logger.debug("no disk cache for %s", function.__qualname__)
        finally:
            config.CACHE_DIR = previous
    return make(function, cache=False)


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function that Python calls: on first use, cached on disk, without the lock."""

    def make(f: Callable[..., Any], *, cache: bool) -> Any:
        njit: Any = numba.njit  # the flag is missing from its stub; nothing calls kernels from C
        return njit(f, cache=cache, nogil=True, error_model="numpy", no_cfunc_wrapper=True)

    return _compile(make, function)


def inner(
    function: Callable[..., Any],
    *,
    forceinline: bool = False,
    allocates: bool = False,
    cache: bool = False,
) -> Any:
    """Compile a function that only kernels call: part of what is cached for them.

    It gets no wrapper for Python, which would take as long to build as the function, and it makes
    no arrays, so that nothing counts references: that would cost more than the arithmetic.
    """
    njit: Any = numba.njit  # the flags for the wrappers are missing from its stub
    return njit(
        function,
        cache=cache,
        nogil=True,
        error_model="numpy",
        forceinline=forceinline,
        _nrt=allocates,
        no_cpython_wrapper=True,
        no_cfunc_wrapper=True,
    )


def allocating(function: Callable[..., Any], *, cache: bool = False) -> Any:
    """The same for functions that make arrays."""
    return inner(function, allocates=True, cache=cache)


def stage(function: Callable[..., Any]) -> Any:
    """The same for large parts of a kernel: each kept on disk by itself (see `together`)."""
    return _compile(inner, function)


def allocating_stage(function: Callable[..., Any]) -> Any:
    """The same for parts that make arrays."""
    return _compile(allocating, function)


def takes(*arguments: types.Type) -> Callable[[Any], Any]:
    """Tell the types of a function's arguments, so that it can be compiled before it is called."""

    def tell(compiled: Any) -> Any:
        compiled.arguments = arguments
        return compiled

    return tell


def inlined(function: Callable[..., Any]) -> Any:
    """The same for small functions in inner loops: compiled straight into their callers."""
    return inner(function, forceinline=True)


def spliced(function: Callable[..., Any]) -> Any:
    """Small functions put into their callers before these are compiled: nothing of their own."""
    return numba.njit(function, inline="always", error_model="numpy")


@functools.cache
def compiled_law(function: Callable[..., Any], name: str, signature: Any = LAW) -> Any:
    """Compile a force law F(d, v, p) to a C function; `address` of the result is its address."""
    from seatdyn.errors import ModelError
    from seatdyn.kernels.laws import arctangent

    _jitable(arctangent)  # laws call it

    def make(f: Callable[..., Any], *, cache: bool) -> Any:
        return numba.cfunc(signature, cache=cache, error_model="numpy")(f)

    try:
        return _compile(make, function)
    except numba.core.errors.NumbaError as error:
        reason = str(error).strip().splitlines()[-1]
        raise ModelError(
            f"The force law {name!r} cannot be compiled: {reason} "
            "Use numbers, the math module and plain control flow only."
        ) from None


@functools.cache
def _jitable(function: Callable[..., Any]) -> Callable[..., Any]:
    """Let compiled code call a plain function, which stays plain for Python."""
    from numba.extending import register_jitable

    plain: Callable[..., Any] = register_jitable(function)
    return plain


@functools.cache
def levered(
    function: Callable[[float, float, Any], float],
    lever: Callable[[float, Any, int], tuple[float, float]],
    count: int,
) -> Callable[[float, float, Any], float]:
    """Force law r f(D, r v) of a law f with `count` parameters behind a lever (D, r) = g(d)."""
    behind, path = _jitable(function), _jitable(lever)

    def law(d: float, v: float, p: Any) -> float:
        travel, ratio = path(d, p, count)
        return float(ratio * behind(travel, ratio * v, p))

    return law


@functools.cache
def shifted(
    function: Callable[[float, float, Any], float], count: int
) -> Callable[[float, float, Any], float]:
    """Force law f(d + p[n], v) - p[n+1] of a law f with n = `count` parameters."""
    plain = _jitable(function)

    def law(d: float, v: float, p: Any) -> float:
        return float(plain(d + p[count], v, p) - p[count + 1])

    return law


@functools.cache
def _over_lanes(function: Callable[[float, float, Any], float]) -> Callable[..., None]:
    """Add the forces of a law at `count` pairs d, v to `force`.

    Were the count known, the loop would be unrolled, and its vectors lost.
    """
    plain = _jitable(function)

    def law(count: int, d: Any, v: Any, p: Any, force: Any) -> None:
        for lane in range(count):
            force[lane] += plain(d[lane], v[lane], p)

    # the disk cache looks for changes where the law is written, not here
    place = function.__code__
    law.__code__ = law.__code__.replace(
        co_filename=place.co_filename, co_firstlineno=place.co_firstlineno
    )
    law.__module__ = function.__module__
    return law


@functools.cache
def _over_rows(function: Callable[[float, float, Any], float]) -> Callable[..., None]:
    """The same for members with parameters of their own: number i of all, then i + 1, ..."""
    plain, carray = _jitable(function), numba.carray  # type: ignore[attr-defined]

    def law(count: int, d: Any, v: Any, p: Any, force: Any) -> None:
        table = carray(p, (1, count))  # as many lines as there are parameters
        for member in range(count):
            force[member] += plain(d[member], v[member], table[:, member])

    place = function.__code__
    law.__code__ = law.__code__.replace(
        co_filename=place.co_filename, co_firstlineno=place.co_firstlineno
    )
    law.__module__ = function.__module__
    return law


def law_address(function: Callable[..., Any], name: str, signature: Any = LAW) -> int:
    """Address of the compiled force law."""
    return int(compiled_law(function, name, signature).address)


def lanes_law_address(function: Callable[[float, float, Any], float], name: str) -> int:
    """Address of the compiled law that adds the forces of many members at once."""
    return law_address(_over_lanes(function), name, LANES_LAW)


def rows_law_address(function: Callable[[float, float, Any], float], name: str) -> int:
    """Address of the compiled law that adds the forces of many members, see `_over_rows`."""
    return law_address(_over_rows(function), f"{name} of rows", LANES_LAW)


def notice_for(compiled: Any, about: float = TIME_ENGINE) -> AbstractContextManager[Any]:
    """Return a `CompileNotice` where a kernel is still to be compiled, else nothing to wait for."""
    return NOTHING if compiled.overloads else CompileNotice(about)


class CompileNotice(event.Listener):
    """Says through the log, once, that kernels are being compiled, if that takes noticeable time.

    about : s that it takes where nothing else runs

    >>> with CompileNotice():
    ...     pass
    """

    _said = False

    def __init__(self, about: float = TIME_ENGINE) -> None:
        """Keep what to say."""
        self.about = about

    def __enter__(self) -> None:
        """Listen; loading code from the cache is no event."""
        self._timer: threading.Timer | None = None
        event.register("numba:compile", self)

    def on_start(self, _: event.Event) -> None:
        """Start the clock with the first function."""
        if self._timer is None and not CompileNotice._said:
            self._timer = threading.Timer(COMPILE_HINT_AFTER, self._say)
            self._timer.daemon = True
            self._timer.start()

    def on_end(self, _: event.Event) -> None:
        """Go on: the next function may follow."""

    def __exit__(self, *_: object) -> None:
        """Stop the clock."""
        event.unregister("numba:compile", self)
        if self._timer is not None:
            self._timer.cancel()

    def _say(self) -> None:
        CompileNotice._said = True
        logger.warning("compiling the kernels (once per installation, about %g s) ...", self.about)
