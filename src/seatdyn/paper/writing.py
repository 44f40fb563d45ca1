"""Files of the reproduction: written whole or not at all."""

from __future__ import annotations

import csv
import io
import json
import os
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

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
        self.write(".writable", b"")
        (self.path / ".writable").unlink(missing_ok=True)

    def write(self, name: str, content: bytes | str) -> Path:
        """Put a file at `name` below the folder, over an older one, by renaming a finished one."""
        target = self.path / name
        data = content.encode("utf-8") if isinstance(content, str) else content
        temporary = None
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
            with os.fdopen(handle, "wb") as file:
                file.write(data)
            mask = os.umask(0)
            os.umask(mask)
            Path(temporary).chmod(0o666 & ~mask)  # mkstemp makes files for their owner only
            Path(temporary).replace(target)
        except OSError as error:
            if temporary is not None:
                Path(temporary).unlink(missing_ok=True)
            raise OutputError(
                f"Cannot write {str(target)!r}: {error.strerror or error}. Choose a folder that "
                "can be written to and has room, with --out."
            ) from None
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
