"""Finished blocks of an ensemble on disk, so that an interrupted run loses nothing."""

from __future__ import annotations

import io
import json
import zipfile
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seatdyn.disk import write_whole
from seatdyn.errors import RequestError

Array = NDArray[np.float64]

LONGEST_SHOWN = 160  # characters of a value in a message


class Checkpoint:
    """One file, replaced as a whole after every block."""

    def __init__(self, path: str | Path, identity: str) -> None:
        """Keep where it is and what it has to belong to, a JSON object."""
        self.path = Path(path)
        self.identity = identity
        if self.path.suffix != ".npz":
            raise RequestError(
                f"checkpoint = {str(path)!r} is not allowed; its name must end in .npz."
            )

    def read(self) -> list[Array]:
        """Moments (s, 5, L) of the blocks that are there, none where there is no file."""
        if not self.path.exists():
            return []
        try:
            with np.load(self.path, allow_pickle=False) as stored:
                identity, blocks = str(stored["identity"]), stored["blocks"]
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile, zlib.error) as error:
            raise RequestError(
                f"checkpoint = {str(self.path)!r} cannot be read: {error}. Remove it, or name "
                "another file."
            ) from None
        if identity != self.identity:
            raise RequestError(
                f"checkpoint = {str(self.path)!r} belongs to another request: "
                f"{_difference(identity, self.identity)}. Remove it, or name another file."
            )
        return list(blocks)

    def write(self, blocks: list[Array]) -> None:
        """Put all blocks there."""
        content = io.BytesIO()
        np.savez(content, identity=np.array(self.identity), blocks=np.array(blocks))
        write_whole(self.path, content.getvalue())


def _difference(stored: str, asked: str) -> str:
    """What two requests do not share; a long text, such as a system, by name only."""
    before, now = json.loads(stored), json.loads(asked)
    differs = []
    for name, value in now.items():
        old = before.get(name)
        if old != value:
            short = max(len(str(old)), len(str(value))) <= LONGEST_SHOWN
            differs.append(f"{name} was {old}, is {value}" if short else f"another {name}")
    return "; ".join(differs)
