"""seatdyn: dynamics of the seated human body on a seat with a vibration isolation system.

The public names are loaded on first use, so that importing one part does not load the rest.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_WHERE = {
    "seatdyn.errors": (
        "SeatdynError ModelError ExcitationError MeasurementError RequestError OutputError "
        "SeatdynWarning ExtrapolationWarning BandWarning DriftWarning MeasurementWarning Status"
    ),
    "seatdyn.model.body": "SeatedBody Link FeedbackForce FeedbackTerm load_body list_bodies",
    "seatdyn.model.elements": (
        "Spring Damper QuadraticDamper CoulombFriction PiecewiseSpring EndStop "
        "TangentPolynomialSpring PolynomialDamper AsymmetricDamper Preload"
    ),
    "seatdyn.model.friction": "StribeckFriction",
    "seatdyn.model.contact": "ContactStop hunt_crossley lankarani_nikravesh",
    "seatdyn.model.springs": "AirSpring AirSpringWithTank ThreeSpring",
    "seatdyn.model.dampers": "PowerDamper BalanceDamper",
    "seatdyn.model.magnetorheological": "BinghamDamper TanhDamper SpencerDamper",
    "seatdyn.model.hysteresis": "DahlFriction LuGreFriction BoucWen",
    "seatdyn.model.cushion": "KelvinVoigt Zener",
    "seatdyn.model.semi_active": "SemiActiveDamper MRDamper",
    "seatdyn.model.lever": "Lever ScissorLever",
    "seatdyn.model.shift": "Shifted",
    "seatdyn.model.tables": "TableSpring TableDamper",
    "seatdyn.model.custom": "force_law",
    "seatdyn.model.seat": "Seat",
    "seatdyn.model.seat_file": "load_seat list_seats save_seat",
    "seatdyn.model.system": "SeatSystem",
    "seatdyn.model.excitation": "Sine SineSum Still",
    "seatdyn.model.force": "WithForces SineForce PulseForce ConstantForce",
    "seatdyn.model.pulses": "Step HalfSineShock Sweep",
    "seatdyn.model.record": "Record read_record",
    "seatdyn.model.noise": "RandomMotion",
    "seatdyn.signals.spectrum": "SpectrumTable SpectrumFormula",
    "seatdyn.signals.narrow_band": "NarrowBand",
    "seatdyn.signals.inputs": "seat_test_input Road",
    "seatdyn.analysis.linear": "poles modes state_space",
    "seatdyn.analysis.zeros": "zeros",
    "seatdyn.analysis.receptance": "receptance",
    "seatdyn.analysis.response": "frequency_response active_bands",
    "seatdyn.analysis.compare": "compare_bodies",
    "seatdyn.analysis.occupant": "swap_occupant",
    "seatdyn.analysis.stability": "is_stable stability_map",
    "seatdyn.analysis.boundary": "stability_boundary critical_values",
    "seatdyn.analysis.delay_margin": "delay_margin",
    "seatdyn.analysis.run": "Settings",
    "seatdyn.analysis.transient": "simulate",
    "seatdyn.analysis.static": "static_equilibrium adjust_ride_height settled",
    "seatdyn.analysis.steady": "steady_state",
    "seatdyn.analysis.batch": "steady_states",
    "seatdyn.analysis.gradient": "steady_gradient",
    "seatdyn.signals.measurement": "Measurement",
    "seatdyn.signals.files": "read_measurement",
    "seatdyn.analysis.curves": "response_curve parameter_curve backbone",
    "seatdyn.analysis.lockup": "lockup_boundary",
    "seatdyn.analysis.random": "random_response rms_ratio",
    "seatdyn.analysis.seat_test": "seat_test",
    "seatdyn.analysis.damping_test": "damping_test",
    "seatdyn.standards.weighting": "Weighting weighting",
    "seatdyn.standards.metrics": "Metrics metrics",
    "seatdyn.standards.exposure": "Task daily_exposure",
    "seatdyn.standards.acceptance": "acceptance_limits",
    "seatdyn.analysis.assess": "assess",
    "seatdyn.analysis.compare_bands": "compare_bands",
    "seatdyn.analysis.linearisation": "statistical_linearisation",
    "seatdyn.output.figures": "plot",
    "seatdyn.output.files": "save load",
}
_HOME = {name: module for module, names in _WHERE.items() for name in names.split()}
__all__ = sorted([*_HOME, "__version__"])


def __getattr__(name: str) -> Any:
    """Load a public name from its module on first use."""
    if name in _HOME:
        value = getattr(import_module(_HOME[name]), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'seatdyn' has no attribute {name!r}")


def __dir__() -> list[str]:
    """Public names."""
    return __all__
