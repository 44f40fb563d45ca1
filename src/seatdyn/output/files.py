"""Results on disk: netCDF through h5netcdf, without loss, never half a file.

netCDF has no complex numbers, no None and no nested attributes. So a complex variable is written
as two real ones (``name.real``, ``name.imag``) and an attribute that netCDF cannot hold as JSON;
the attribute `seatdyn_manifest` lists both, and `load` undoes them. Other readers see plain netCDF.
"""

from __future__ import annotations

import io
import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from seatdyn.disk import write_whole
from seatdyn.errors import OutputError

if TYPE_CHECKING:
    import xarray as xr

MANIFEST = "seatdyn_manifest"
FORMAT = 1
SUFFIXES = (".nc",)
DATASET = ""  # stands for the Dataset itself among the names of variables
INT64 = range(-(2**63), 2**63)


def save(dataset: xr.Dataset, path: str | Path) -> Path:
    """Write a Dataset to a netCDF file, whole or not at all; an older file is replaced at the end.

    Parameters
    ----------
    dataset : any result of seatdyn
    path : ends in ``.nc``, in a directory that exists

    Returns
    -------
    pathlib.Path
        The file written.

    Raises
    ------
    OutputError
        A directory that is missing or not writable, another suffix, a full disk, or content that
        cannot be stored; what was there before stays as it was.

    Examples
    --------
    >>> import seatdyn as sd, tempfile, pathlib
    >>> poles = sd.poles(sd.load_body("ksiazek1997_back_off"))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = sd.save(poles, pathlib.Path(folder) / "poles.nc")
    ...     sd.load(file).identical(poles)
    True
    """
    target = writable(path, SUFFIXES)
    require_dataset(dataset)
    try:
        content = _image(_encoded(dataset))
    except (TypeError, ValueError) as error:
        raise OutputError(f"{str(target)!r} cannot hold this Dataset: {error}.") from error
    write_whole(target, content)
    return target


def load(path: str | Path) -> xr.Dataset:
    """Read a Dataset that `save` wrote, identical to what was saved.

    Parameters
    ----------
    path : a ``.nc`` file of seatdyn

    Raises
    ------
    OutputError
        No such file, not readable, or not written by seatdyn.
    """
    import xarray as xr

    source = Path(path)
    if not source.is_file():
        raise OutputError(f"{str(source)!r} does not exist or is no file; check the path.")
    try:
        # the units "s" must stay numbers, so nothing of time is decoded
        stored = xr.load_dataset(
            source, engine="h5netcdf", decode_times=False, decode_timedelta=False
        )
    except (OSError, ValueError) as error:
        raise OutputError(
            f"{str(source)!r} is not a readable netCDF-4 file: {error}. It may be incomplete."
        ) from error
    if MANIFEST not in stored.attrs:
        raise OutputError(
            f"{str(source)!r} was not written by seatdyn.save; open it with xarray.open_dataset."
        )
    manifest = json.loads(stored.attrs.pop(MANIFEST))
    if manifest["format"] > FORMAT:
        raise OutputError(
            f"{str(source)!r} has format {manifest['format']}, this version reads up to {FORMAT}; "
            "install a newer seatdyn."
        )
    return _decoded(stored, manifest)


def writable(path: str | Path, suffixes: Iterable[str]) -> Path:
    """Check, before the work is done, that a file can be written there.

    Raises
    ------
    OutputError
        Another suffix, a missing or unwritable directory, or a directory in its place.
    """
    target = Path(path)
    allowed = tuple(suffixes)
    if target.suffix.lower() not in allowed:
        raise OutputError(
            f"{str(target)!r} must end in {' or '.join(allowed)}, not in {target.suffix!r}."
        )
    folder = target.parent
    if not folder.exists():
        raise OutputError(f"The directory {str(folder)!r} does not exist; create it first.")
    if not folder.is_dir():
        raise OutputError(f"{str(folder)!r} is a file, not a directory; choose another place.")
    if target.is_dir():
        raise OutputError(f"{str(target)!r} is a directory; give the name of a file.")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise OutputError(
            f"The directory {str(folder)!r} is not writable; choose another or change its rights."
        )
    return target


def require_dataset(dataset: object) -> None:
    """Refuse what is no Dataset.

    Raises
    ------
    OutputError
        Something else.
    """
    import xarray as xr

    if not isinstance(dataset, xr.Dataset):
        raise OutputError(
            f"{type(dataset).__name__} is no xarray.Dataset; give what an analysis returned."
        )


def _image(encoded: xr.Dataset) -> bytes:
    """Return the bytes of a netCDF file, made in memory: HDF5 may crash where a disk is full."""
    import h5netcdf
    import h5py

    buffer = io.BytesIO()
    with h5netcdf.File(buffer, "w") as file:
        file.dimensions = {str(name): size for name, size in encoded.sizes.items()}
        for name, variable in encoded.variables.items():
            values, attrs = variable.values, dict(variable.attrs)
            if values.dtype.kind == "b":
                values, attrs["dtype"] = values.astype("i1"), "bool"  # the convention of xarray
            if values.dtype.kind in "UO":
                values = values.astype(object)
                stored = file.create_variable(str(name), variable.dims, h5py.string_dtype())
                stored[...] = values
            else:
                stored = file.create_variable(
                    str(name), variable.dims, values.dtype, data=np.ascontiguousarray(values)
                )
            stored.attrs.update(attrs)
        file.attrs.update(encoded.attrs)
    return buffer.getvalue()


def _encoded(dataset: xr.Dataset) -> xr.Dataset:
    """Rewrite a Dataset with what netCDF has, and a manifest of what was changed."""
    import xarray as xr

    json_attrs: dict[str, list[str]] = {}
    split: list[str] = []
    variables: dict[str, xr.Variable] = {}
    for name, variable in dataset.variables.items():
        attrs, strange = _plain_attrs(variable.attrs)
        if strange:
            json_attrs[str(name)] = strange
        if variable.dtype.kind == "c":
            split.append(str(name))
            for part in ("real", "imag"):
                values = getattr(variable.values, part)
                variables[f"{name}.{part}"] = xr.Variable(variable.dims, values, attrs)
        else:
            variables[str(name)] = xr.Variable(variable.dims, variable.values, attrs)
    attrs, strange = _plain_attrs(dataset.attrs)
    if strange:
        json_attrs[DATASET] = strange
    manifest: dict[str, Any] = {
        "format": FORMAT,
        "complex": split,
        "json": json_attrs,
        "coords": [str(name) for name in dataset.coords],
        "order": [str(name) for name in dataset.variables],
    }
    encoded = xr.Dataset(variables, attrs=attrs | {MANIFEST: json.dumps(manifest)})
    return encoded.set_coords([name for name in manifest["coords"] if name in encoded.variables])


def _decoded(stored: xr.Dataset, manifest: dict[str, Any]) -> xr.Dataset:
    """Undo `_encoded`."""
    import xarray as xr

    variables: dict[str, xr.Variable] = {}
    for name in manifest["order"]:
        if name in manifest["complex"]:
            real, imag = (stored.variables[f"{name}.{part}"] for part in ("real", "imag"))
            values = np.empty(real.shape, dtype=np.result_type(real.dtype, np.complex64))
            values.real, values.imag = real.values, imag.values  # keeps signed zeros and NaN
            variable = xr.Variable(real.dims, values, real.attrs)
        else:
            variable = stored.variables[name]
        values = variable.values
        if values.dtype.kind == "O":  # strings of variable length
            values = np.array(values.tolist(), dtype=str).reshape(values.shape)
        attrs = _restored_attrs(variable.attrs, manifest["json"].get(name, []))
        variables[name] = xr.Variable(variable.dims, values, attrs)
    attrs = _restored_attrs(stored.attrs, manifest["json"].get(DATASET, []))
    return xr.Dataset(variables, attrs=attrs).set_coords(manifest["coords"])


def _plain_attrs(attrs: dict[Any, Any]) -> tuple[dict[str, Any], list[str]]:
    """Attributes that netCDF can hold, and the names of those that became JSON."""
    result: dict[str, Any] = {}
    strange: list[str] = []
    for name, value in attrs.items():
        number = isinstance(value, float) or (
            isinstance(value, int) and not isinstance(value, bool) and value in INT64
        )
        if number or (isinstance(value, str) and value):
            result[str(name)] = value
        else:
            result[str(name)] = json.dumps(_listed(value))
            strange.append(str(name))
    return result, strange


def _listed(value: Any) -> Any:
    """Return numpy scalars and arrays as numbers and lists."""
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def _restored_attrs(attrs: dict[Any, Any], strange: list[str]) -> dict[str, Any]:
    return {
        name: json.loads(value)
        if name in strange
        else (value.item() if isinstance(value, np.generic) else value)
        for name, value in attrs.items()
    }
