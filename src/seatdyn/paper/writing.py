"""Files of the reproduction: written whole or not at all."""

from __future__ import annotations

import csv
import io
import json
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from seatdyn.disk import write_whole
from seatdyn.errors import OutputError


class OutputFolder:
    """A folder that files are put into; a run that is cut off leaves whole files only.

    Raises
    ------
    OutputError
        The folder cannot be made or written to; found out at once, before anything is computed.
    """

    def __init__(self, path: Path) -> None:
        """Make the folder and try it."""
        self.path = Path(path)
        self._make(self.path)

    def write(self, name: str, content: bytes | str) -> Path:
        """Put a file at `name` below the folder, over an older one, by renaming a finished one."""
        target = self.path / name
        self._make(target.parent)
        write_whole(target, content.encode("utf-8") if isinstance(content, str) else content)
        return target

    def write_csv(self, name: str, header: Sequence[str], rows: Iterable[Sequence[object]]) -> Path:
        """Put a CSV file."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)
        return self.write(name, text.getvalue())

    def write_json(self, name: str, content: dict[str, Any]) -> Path:
        """Put a JSON file, strict: NaN and infinity are a bug."""
        text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False)
        return self.write(name, text + "\n")

    @staticmethod
    def _make(folder: Path) -> None:
        """Make a folder where it is missing, and try whether files can be put there."""
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=folder):
                pass
        except OSError as error:
            raise OutputError(
                f"Cannot write to {str(folder)!r}: {error.strerror or error}. Choose a folder "
                "that can be written to, with --out."
            ) from None
