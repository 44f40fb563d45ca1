"""A simulated record beside a measured one, band by band."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

import seatdyn
from seatdyn.errors import RequestError, Status

if TYPE_CHECKING:
    import xarray as xr


def compare_bands(measured: xr.Dataset, simulated: xr.Dataset) -> xr.Dataset:
    """Third-octave levels of a simulation beside those of a measurement.

    Parameters
    ----------
    measured, simulated : results of `assess` with a common axis

    Returns
    -------
    xarray.Dataset
        Over `axis` and `band`: `measured_band_rms`, `simulated_band_rms` in m/s2 and
        `band_difference` in dB, positive where the simulation is larger; where both have a floor,
        `measured_isolation` and `simulated_isolation`, seat over floor in the band, and
        `isolation_difference` in dB.

    Raises
    ------
    RequestError
        Something else than two results of `assess`, or no common axis.

    Examples
    --------
    >>> import numpy as np, seatdyn as sd
    >>> noise = np.random.default_rng(1).standard_normal(30_000)
    >>> one, two = (sd.assess(sd.Measurement({"z": k * noise}, 500.0)) for k in (1.0, 2.0))
    >>> print(sd.compare_bands(one, two).band_difference.sel(axis="z").values[:3].round(2))
    [6.02 6.02 6.02]
    """
    import xarray as xr

    pair = {"measured": measured, "simulated": simulated}
    for name, given in pair.items():
        if not isinstance(given, xr.Dataset) or "band_rms" not in given:
            raise RequestError(f"{name} must be a result of `assess`.")
    axes = [axis for axis in measured.axis.values if axis in simulated.axis.values]
    if not axes:
        raise RequestError(
            f"measured has axes {measured.axis.values.tolist()}, simulated "
            f"{simulated.axis.values.tolist()}; they must share one."
        )
    level = {name: given.band_rms.sel(axis=axes) for name, given in pair.items()}
    data = {f"{name}_band_rms": (level[name], "m/s2") for name in pair}
    data["band_difference"] = (20.0 * np.log10(level["simulated"] / level["measured"]), "dB")
    if all("floor_band_rms" in given for given in pair.values()):
        ratio = {
            name: level[name] / given.floor_band_rms.sel(axis=axes) for name, given in pair.items()
        }
        data |= {f"{name}_isolation": (ratio[name], "1") for name in pair}
        data["isolation_difference"] = (
            20.0 * np.log10(ratio["simulated"] / ratio["measured"]),
            "dB",
        )
    attrs = {
        "status": Status.OK.value,
        "seatdyn_version": seatdyn.__version__,
        **{f"{name}_source": given.attrs.get("source", "") for name, given in pair.items()},
    }
    labelled = {
        name: values.assign_attrs(units=unit, long_name=name.replace("_", " "))
        for name, (values, unit) in data.items()
    }
    return xr.Dataset(labelled, attrs=attrs)
