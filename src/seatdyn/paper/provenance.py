"""What a reproduction was made with."""

from __future__ import annotations

import platform
from datetime import UTC, datetime
from importlib.metadata import version
from typing import Any

import seatdyn
from seatdyn.analysis.steady import DEFAULT
from seatdyn.paper import cases


def provenance() -> dict[str, Any]:
    """Versions, parameters, tolerances and date."""
    return {
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "versions": {
            "seatdyn": seatdyn.__version__,
            "python": platform.python_version(),
            **{name: version(name) for name in ("numpy", "scipy", "numba", "matplotlib")},
        },
        "platform": f"{platform.system()} {platform.machine()}",
        "parameters": {
            "seat_mass_kg": cases.SEAT_MASS,
            "stiffness_N_per_m": cases.STIFFNESS,
            "damping_N_s_per_m": cases.DAMPING,
            "coulomb_slope_s_per_m": cases.SLOPE,
            "amplitude_m_per_s2_peak": cases.AMPLITUDE,
            "frequency_back_off_Hz": cases.FREQUENCY[False],
            "frequency_back_on_Hz": cases.FREQUENCY[True],
        },
        "solver": {
            "steady_state_tolerance": cases.TOLERANCE,
            "energy_residual_limit": cases.ENERGY_RESIDUAL,
            "rtol": DEFAULT.rtol,
            "method": DEFAULT.method,
        },
    }
