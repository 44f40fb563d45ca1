"""Run every benchmark, one after the other, and write one table as Markdown and JSON.

    python benchmarks/table.py [--out DIR]

Every script of this folder with a peer takes `--rows FILE` and writes its comparisons there. One
that fails, for instance because its peer cannot be installed, is named, and the others go on.
"""

from __future__ import annotations

import argparse
import platform
import subprocess
import sys
import tempfile
from pathlib import Path

from rows import markdown, read, write

HERE = Path(__file__).parent
COMPARES = 'add_argument("--rows"'


def main() -> int:
    """Run all; the exit code counts the scripts that failed."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", type=Path, default=HERE / "results", metavar="DIR")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    others = [p for p in sorted(HERE.glob("*.py")) if p != Path(__file__)]
    scripts = [p for p in others if COMPARES in p.read_text(encoding="utf-8")]
    rows, failed = [], []
    with tempfile.TemporaryDirectory() as folder:
        for script in scripts:
            print(f"== {script.name}", flush=True)
            file = Path(folder) / f"{script.stem}.json"
            done = subprocess.run([sys.executable, script, "--rows", file], check=False)
            if done.returncode == 0 and file.exists():
                rows += read(file)
            else:
                failed.append(script.name)
    text = f"Measured on {platform.machine()}, Python {platform.python_version()}.\n\n"
    text += markdown(rows) + "".join(f"\n`{name}` did not run to its end.\n" for name in failed)
    (options.out / "table.md").write_text(text, encoding="utf-8")
    write(rows, options.out / "table.json")
    print(text)
    return len(failed)


if __name__ == "__main__":
    sys.exit(main())
