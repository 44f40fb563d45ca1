"""Files on disk: written whole or not at all."""

from __future__ import annotations

import logging
import os
from pathlib import Path

from seatdyn.errors import OutputError

_log = logging.getLogger("seatdyn.disk")


def write_whole(target: Path, content: bytes) -> None:
    """Write a file beside its place, then rename it into it; log at INFO that it is there.

    Raises
    ------
    OutputError
        The disk is full or the place not writable; an older file stays as it was.
    """
    part = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        try:
            part.write_bytes(content)
            part.replace(target)
        finally:
            part.unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(
            f"{str(target)!r} was not written: {error.strerror or error}. What was there before "
            "is unchanged; free some space, or choose a place where you may write."
        ) from error
    _log.info("%s", target)
