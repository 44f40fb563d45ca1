"""Measurement files: CSV and other text, WAV, MATLAB; UFF, TDMS and MDF where their packages are.

A file larger than `LARGEST_FILE` is refused before it is read. Text is read block by block, so that
memory holds the channels asked for and little else.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from seatdyn.errors import MeasurementError
from seatdyn.signals.clock import rate_of, require_rate
from seatdyn.signals.loggers import FORMATS, read_channels
from seatdyn.signals.measurement import MOST_SAMPLES, UNITS, Measurement
from seatdyn.signals.text import find_layout, read_columns
from seatdyn.units import RATE, number, suggestion

Array = NDArray[np.float64]
Unit = Literal["m/s2", "g"]
Column = str | int

LARGEST_FILE = 512 * 2**20  # bytes
MEGABYTE = 2**20
TIME_NAMES = ("time", "t", "zeit", "temps", "sec", "seconds", "timestamp", "time_s", "x_time")
TIME_UNITS = {"": 1.0, "s": 1.0, "sec": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}
SPELLINGS = {"m/s2": "m/s2", "m/s²": "m/s2", "m/s^2": "m/s2", "ms-2": "m/s2", "m/s/s": "m/s2",
             "g": "g"}  # fmt: skip
RATE_NAMES = ("fs", "rate", "samplerate", "sample_rate", "sampling_rate", "f_s")


class Raw(NamedTuple):
    """Channels as a file has them: in `unit`, where the file says one."""

    channels: dict[str, Array]
    rate: float
    start: float | None
    unit: str


def read_measurement(
    path: str | Path,
    columns: Sequence[Column] | None = None,
    *,
    unit: Unit | None = None,
    rate: float | None = None,
    time: Column | None = None,
    full_scale: float | None = None,
) -> Measurement:
    """Read accelerations from a measurement file.

    Parameters
    ----------
    path : ``.csv``, ``.txt``, ``.dat`` or ``.tsv``: text with any separator, with or without a
        header; ``.wav``; ``.mat`` (up to version 7); ``.uff``, ``.unv``, ``.tdms``, ``.mf4`` with
        the packages of ``seatdyn[uff]``, ``[tdms]``, ``[mdf]``
    columns : channels to read, by name or by number from 1; all but time without it
    unit : "m/s2" or "g" that the file is in; without it what the file says, else m/s2
    rate : samples per second, Hz, for a file without time
    time : column of the instants, by name or number; without it a column called time, t, ..., or
        in a file without header and `rate` the first column, if it increases throughout
    full_scale : acceleration, in `unit`, of the largest number of a WAV file of integers

    Returns
    -------
    Measurement
        In m/s2.

    Raises
    ------
    MeasurementError
        A file that is missing, empty, too large, cut off or of another format; a cell that is no
        number; an unknown column; gaps, two rates, time that runs backwards; two units.

    Examples
    --------
    >>> import pathlib, tempfile, seatdyn as sd
    >>> rows = "".join(f"{0.01 * i:.2f};0,{i:02d}\\n" for i in range(50))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "ride.csv"
    ...     _ = file.write_text("Time [s];Seat [g]\\n" + rows.replace(".", ","))
    ...     record = sd.read_measurement(file)
    >>> print(record, f"{record['Seat'][10]:.4f} m/s2")
    Measurement(Seat; 0.5 s at 100 Hz) 0.9807 m/s2
    """
    file, source = Path(path), str(path)
    if unit is not None and unit not in UNITS:
        raise MeasurementError(f"unit = {unit!r} is not allowed; it must be one of {list(UNITS)}.")
    if rate is not None:
        rate = number(rate, "rate", "Hz", **RATE, error=MeasurementError)
    _require_readable(file, source)
    suffix = file.suffix.lower()
    raw = READERS.get(suffix, _read_text)(
        file, columns, rate=rate, time=time, full_scale=full_scale
    )
    if unit is not None and raw.unit and raw.unit != unit:
        raise MeasurementError(
            f"{source!r} says that it is in {raw.unit}, but the unit {unit} was given. Leave the "
            "unit out, or correct the file."
        )
    stored = unit or raw.unit or "m/s2"
    channels = {name: UNITS[stored] * samples for name, samples in raw.channels.items()}
    return Measurement(channels, raw.rate, raw.start, source, stored)


def _require_readable(file: Path, source: str) -> None:
    if not file.is_file():
        raise MeasurementError(f"{source!r} does not exist or is no file; check the path.")
    size = file.stat().st_size
    if size == 0:
        raise MeasurementError(f"{source!r} is empty (0 bytes); was the measurement stored?")
    if size > LARGEST_FILE:
        raise MeasurementError(
            f"{source!r} has {size / MEGABYTE:.0f} MB; at most {LARGEST_FILE / MEGABYTE:.0f} MB "
            "are read. Cut it into shorter records, or keep only the channels and the rate that "
            "are needed (500 Hz will do)."
        )


# ---------------------------------------------------------------- text


def _read_text(
    file: Path,
    columns: Sequence[Column] | None,
    *,
    rate: float | None,
    time: Column | None,
    full_scale: float | None,
) -> Raw:
    source = repr(str(file))
    _no_full_scale(full_scale, source)
    layout = find_layout(file)
    clock = layout.index(time, source) if time is not None else _time_column(layout.names)
    if columns is None:
        wanted = [i for i, number in enumerate(layout.numeric) if number and i != clock]
    else:
        wanted = [layout.index(column, source) for column in columns]
    if not wanted:
        raise MeasurementError(f"{source} has no channel beside the time column.")
    if clock in wanted:
        raise MeasurementError(
            f"{source}: column {layout.names[clock]!r} is the time, and no acceleration; choose "
            "another column."
        )
    guess = clock is None and rate is None and not layout.has_header and len(layout.names) > 1
    if guess:
        clock, wanted = 0, [i for i in wanted if i != 0] or wanted
    used = wanted if clock is None else [*wanted, clock]
    data = read_columns(file, layout, used, MOST_SAMPLES)
    values = data.values
    if guess and np.any(np.diff(values[:, -1]) <= 0.0):
        clock = None  # accelerations fall, too
    start = None
    if clock is not None:
        factor = TIME_UNITS.get(layout.units[clock].lower())
        if factor is None:
            raise MeasurementError(
                f"{source}: the time column is in {layout.units[clock]!r}; it must be in s or ms."
            )
        instants = factor * values[:, -1]
        found = rate_of(instants, source, data.line)
        if rate is not None:
            require_rate(rate, found, source)
        rate, start = found, float(instants[0])
    if rate is None:
        raise MeasurementError(
            f"{source} has no time column that could be recognised (columns "
            f"{', '.join(layout.names)}); give the rate in Hz, or name the column of the time."
        )
    units = {_unit(layout.units[i], layout.names[i], source) for i in wanted} - {""}
    if len(units) > 1:
        raise MeasurementError(
            f"{source} has channels in m/s2 and others in g; read them one at a time."
        )
    channels = {layout.names[i]: values[:, k] for k, i in enumerate(wanted)}
    return Raw(channels, rate, start, "".join(units))


def _time_column(names: Sequence[str]) -> int | None:
    lowered = [name.lower() for name in names]
    return next((lowered.index(known) for known in TIME_NAMES if known in lowered), None)


def _unit(written: str, name: str, source: str) -> str:
    """Unit of a channel as the file writes it; one that is no acceleration is refused."""
    text = written.strip().lower()
    if text in ("", "-"):
        return ""
    if text not in SPELLINGS:
        raise MeasurementError(
            f"{source}: channel {name!r} is in {written!r}, which is not an acceleration in m/s2 "
            "or g. Convert it, or choose another column."
        )
    return SPELLINGS[text]


# ---------------------------------------------------------------- binary


def _read_wav(
    file: Path,
    columns: Sequence[Column] | None,
    *,
    rate: float | None,
    time: Column | None,
    full_scale: float | None,
) -> Raw:
    """Channels "1", "2", ...; integers need the acceleration of full scale."""
    from scipy.io import wavfile

    source = repr(str(file))
    _no_time(time, source)
    try:
        with warnings.catch_warnings(record=True) as notes:
            warnings.simplefilter("always", wavfile.WavFileWarning)
            found, data = wavfile.read(file)
    except Exception as error:  # scipy raises many kinds for a damaged file
        raise MeasurementError(f"{source} is not a readable WAV file: {_text(error)}.") from None
    # other notes are about chunks that hold no samples
    if any("EOF" in str(note.message) for note in notes) or data.size == 0:
        raise MeasurementError(f"{source} is cut off; copy it again from the recorder.")
    if rate is not None:
        require_rate(rate, found, source)
    table = data.reshape(data.shape[0], -1)
    if np.issubdtype(table.dtype, np.integer):
        if full_scale is None:
            raise MeasurementError(
                f"{source} holds integers ({table.dtype}); give full_scale, the acceleration of "
                "the largest of them, from the calibration of the recorder."
            )
        limits = np.iinfo(table.dtype)
        middle = 128.0 if table.dtype == np.uint8 else 0.0
        scale = full_scale / (limits.max - middle + 1.0)
    else:
        middle, scale = 0.0, 1.0 if full_scale is None else full_scale
    names = [str(i) for i in range(1, table.shape[1] + 1)]
    chosen = _choose(names, columns, source)
    channels = {name: (table[:, names.index(name)] - middle) * scale for name in chosen}
    return Raw(channels, float(found), None, "")


def _read_mat(
    file: Path,
    columns: Sequence[Column] | None,
    *,
    rate: float | None,
    time: Column | None,
    full_scale: float | None,
) -> Raw:
    """Every vector is a channel, a matrix has one a column, "name_1", "name_2", ...

    Without `columns` the longest ones are read; a file may hold results beside them.
    """
    from scipy.io import loadmat

    source = repr(str(file))
    _no_full_scale(full_scale, source)
    try:
        content = loadmat(file)
    except NotImplementedError:
        raise MeasurementError(
            f"{source} is a MATLAB file of version 7.3; store it with save(..., '-v7')."
        ) from None
    except Exception as error:  # scipy raises many kinds for a damaged file
        raise MeasurementError(f"{source} is not a readable MATLAB file: {_text(error)}.") from None
    arrays = {
        name: np.asarray(value, dtype=float)
        for name, value in content.items()
        if not name.startswith("__") and getattr(value, "dtype", np.dtype("O")).kind in "iuf"
    }
    numbers = {n: float(a.item()) for n, a in arrays.items() if a.size == 1}
    vectors: dict[str, Array] = {}
    for name, array in arrays.items():
        if array.size > 1 and array.ndim == 2:
            table = array.T if array.shape[0] < array.shape[1] else array
            single = table.shape[1] == 1
            vectors |= {
                name if single else f"{name}_{i}": column for i, column in enumerate(table.T, 1)
            }
    if not vectors:
        raise MeasurementError(f"{source} holds no vector of numbers (variables {list(content)}).")
    names = list(vectors)
    clock = _choose(names, [time], source)[0] if time is not None else None
    if clock is None:
        place = _time_column(names)
        clock = None if place is None else names[place]
    start = None
    stated = next((v for n, v in numbers.items() if n.lower() in RATE_NAMES), None)
    if rate is None and stated is not None:
        rate = number(stated, f"{source}: rate", "Hz", **RATE, error=MeasurementError)
    if clock is not None:
        instants = vectors.pop(clock)
        found = rate_of(instants, source, lambda i: f"sample {i + 1}")
        if rate is not None:
            require_rate(rate, found, source)
        rate, start = found, float(instants[0])
    if rate is None:
        raise MeasurementError(
            f"{source} has neither a vector of time nor a rate such as fs (variables "
            f"{', '.join(arrays)}); give the rate in Hz."
        )
    longest = max((v.size for v in vectors.values()), default=0)
    full = [name for name, v in vectors.items() if v.size == longest]
    chosen = full if columns is None else _choose(list(vectors), columns, source)
    return Raw({name: vectors[name] for name in chosen}, rate, start, "")


def _read_logger(
    file: Path,
    columns: Sequence[Column] | None,
    *,
    rate: float | None,
    time: Column | None,
    full_scale: float | None,
) -> Raw:
    """Channels of TDMS, UFF and MDF files; those that are read must share one clock."""
    source = repr(str(file))
    _no_full_scale(full_scale, source)
    _no_time(time, source)
    every = {channel.name: channel for channel in read_channels(file)}
    chosen = [every[name] for name in _choose(list(every), columns, source)]
    clocks = {(c.rate, c.start) for c in chosen}
    if len(clocks) > 1:
        rates = ", ".join(f"{c.name} {c.rate:.6g} Hz from {c.start or 0.0:.6g} s" for c in chosen)
        raise MeasurementError(
            f"{source} has channels with different clocks: {rates}. Read those that belong "
            "together, or resample them."
        )
    ((found, start),) = clocks
    if found > 0.0 and rate is not None:
        require_rate(rate, found, source)
    if found == 0.0 and rate is None:
        raise MeasurementError(f"{source} does not say how fast it was sampled; give the rate.")
    units = {_unit(c.unit, c.name, source) for c in chosen} - {""}
    if len(units) > 1:
        raise MeasurementError(
            f"{source} has channels in m/s2 and others in g; read one at a time."
        )
    return Raw(
        {c.name: c.samples for c in chosen}, found or float(rate or 0.0), start, "".join(units)
    )


def _text(error: Exception) -> str:
    return str(error).rstrip(".") or type(error).__name__


def _choose(names: list[str], columns: Sequence[Column] | None, source: str) -> list[str]:
    """Names of the channels asked for, each by name or number from 1."""
    if columns is None:
        return names
    chosen = []
    for column in columns:
        text = str(column)
        if text not in names and text.isdigit() and 1 <= int(text) <= len(names):
            text = names[int(text) - 1]
        if text not in names:
            raise MeasurementError(f"{source} has no channel {text!r}. {suggestion(text, names)}")
        chosen.append(text)
    return chosen


def _no_time(time: Column | None, source: str) -> None:
    if time is not None:
        raise MeasurementError(f"{source} has a rate and no column {time!r} of time; leave it out.")


def _no_full_scale(full_scale: float | None, source: str) -> None:
    if full_scale is not None:
        raise MeasurementError(f"full_scale is for WAV files only; {source} is none.")


READERS: dict[str, Callable[..., Raw]] = {
    ".wav": _read_wav,
    ".mat": _read_mat,
    **dict.fromkeys(FORMATS, _read_logger),
}
