"""Files of data loggers whose readers are packages of their own: TDMS, UFF (dataset 58), MDF.

They are optional: `pip install "seatdyn[tdms]"`, `[uff]`, `[mdf]`.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seatdyn.errors import MeasurementError
from seatdyn.signals.clock import rate_of

Array = NDArray[np.float64]

TIME_RESPONSE = 1  # function type of a dataset 58
FUNCTION = 58


class Channel(NamedTuple):
    """One channel as stored: samples in `unit`, with a rate in Hz (0 where the file has none)."""

    name: str
    samples: Array
    unit: str
    rate: float
    start: float | None


def read_channels(file: Path) -> list[Channel]:
    """All channels of a logger's file.

    Raises
    ------
    MeasurementError
        The package that reads the format is missing, the file is damaged, or has no channel.
    """
    extra, package, reader = FORMATS[file.suffix.lower()]
    source = repr(str(file))
    try:
        module = import_module(package)
    except ImportError:
        raise MeasurementError(
            f"{source} needs the package {package} to be read; install it with "
            f"`pip install 'seatdyn[{extra}]'`, or export the record as CSV."
        ) from None
    try:
        channels = reader(module, file)
    except MeasurementError:
        raise
    except Exception as error:  # each package has exceptions of its own
        raise MeasurementError(f"{source} cannot be read by {package}: {error}") from None
    if not channels:
        raise MeasurementError(f"{source} holds no channel of samples in time.")
    return _with_names_apart(channels)


def _tdms(module: Any, file: Path) -> list[Channel]:
    found = []
    for group in module.TdmsFile.read(file).groups():
        for channel in group.channels():
            if len(channel) == 0 or not np.issubdtype(channel.dtype, np.number):
                continue
            facts = channel.properties
            step = float(facts.get("wf_increment", 0.0))
            unit = str(facts.get("unit_string", ""))
            start = facts.get("wf_start_offset")
            found.append(
                Channel(
                    channel.name,
                    np.asarray(channel[:], dtype=float),
                    unit,
                    1.0 / step if step > 0.0 else 0.0,
                    None if start is None else float(start),
                )
            )
    return found


def _uff(module: Any, file: Path) -> list[Channel]:
    sets = module.UFF(str(file)).read_sets()
    found = []
    for one in sets if isinstance(sets, list) else [sets]:
        if one.get("type") != FUNCTION or one.get("func_type") != TIME_RESPONSE:
            continue
        name = str(one.get("id1", "")).strip()
        if not name or name.upper() == "NONE":
            name = f"{one['rsp_node']}:{one['rsp_dir']:+d}"
        time = np.asarray(one["x"], dtype=float)
        rate = rate_of(time, repr(str(file)), lambda i: f"sample {i + 1}")
        unit = str(one.get("ordinate_axis_units_lab", "")).strip()
        samples = np.asarray(one["data"]).real.astype(float)
        found.append(Channel(name, samples, "" if unit.upper() == "NONE" else unit, rate, time[0]))
    return found


def _mdf(module: Any, file: Path) -> list[Channel]:
    found = []
    with module.MDF(file) as content:
        for signal in content.iter_channels():
            if signal.samples.ndim != 1 or not np.issubdtype(signal.samples.dtype, np.number):
                continue
            time = np.asarray(signal.timestamps, dtype=float)
            if time.size < 2:
                continue
            rate = rate_of(time, f"{str(file)!r}, {signal.name}", lambda i: f"sample {i + 1}")
            samples = np.asarray(signal.samples, dtype=float)
            found.append(Channel(signal.name, samples, str(signal.unit), rate, float(time[0])))
    return found


def _with_names_apart(channels: list[Channel]) -> list[Channel]:
    """Number channels of equal name: "acc", "acc 2", ..."""
    seen: dict[str, int] = {}
    apart = []
    for channel in channels:
        seen[channel.name] = count = seen.get(channel.name, 0) + 1
        apart.append(channel if count == 1 else channel._replace(name=f"{channel.name} {count}"))
    return apart


# suffix -> name of the extra, package, reader
FORMATS: dict[str, tuple[str, str, Callable[[Any, Path], list[Channel]]]] = {
    ".tdms": ("tdms", "nptdms", _tdms),
    ".uff": ("uff", "pyuff", _uff),
    ".unv": ("uff", "pyuff", _uff),
    ".mf4": ("mdf", "asammdf", _mdf),
    ".mdf": ("mdf", "asammdf", _mdf),
}
