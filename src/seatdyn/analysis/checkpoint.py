"""Finished blocks of an ensemble on disk, so that an interrupted run loses nothing."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from seatdyn.errors import OutputError, RequestError

Array = NDArray[np.float64]


class Checkpoint:
    """One file, replaced as a whole after every block."""

    def __init__(self, path: str | Path, identity: str) -> None:
        """Keep where it is and what it has to belong to."""
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
        except (OSError, ValueError, KeyError) as error:
            raise RequestError(
                f"checkpoint = {str(self.path)!r} cannot be read: {error}. Remove it, or name "
                "another file."
            ) from None
        if identity != self.identity:
            raise RequestError(
                f"checkpoint = {str(self.path)!r} belongs to another request: {identity}; this one "
                f"is {self.identity}. Remove it, or name another file."
            )
        return list(blocks)

    def write(self, blocks: list[Array]) -> None:
        """Put all blocks there."""
        new = self.path.with_name(f"{self.path.name}.{os.getpid()}.part")
        try:
            with new.open("wb") as stream:
                np.savez(stream, identity=np.array(self.identity), blocks=np.array(blocks))
            new.replace(self.path)
        except OSError as error:
            new.unlink(missing_ok=True)
            raise OutputError(
                f"The checkpoint {str(self.path)!r} cannot be written: {error.strerror}. What was "
                "there is unchanged; free some space or name another place."
            ) from None
