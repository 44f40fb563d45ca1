"""Springs and dampers from measured tables, interpolated without overshoot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seatdyn.errors import ModelError
from seatdyn.kernels import laws
from seatdyn.model.elements import Law, NonlinearElement
from seatdyn.units import FORCE, LENGTH, SPEED

SMALLEST_TABLE = 2
LARGEST = {"displacement": LENGTH, "velocity": SPEED, "force": FORCE}
UNITS = {"displacement": "m", "velocity": "m/s", "force": "N"}
STEEPEST = 1e12  # N/m or N s/m


@dataclass(frozen=True)
class TableElement(NonlinearElement):
    """Base of both table elements: a checked table and its monotone cubic interpolant.

    Between the points a piecewise cubic Hermite polynomial is used whose slopes keep the data
    monotone (Fritsch and Carlson 1980); outside, the law goes on along its end slope and the
    analysis warns, naming the table.
    """

    def _law(self, variable: str, x: object, force: object) -> Law:
        from scipy.interpolate import PchipInterpolator

        x_points = self._points(variable, x)
        f_points = self._points("force", force)
        if x_points.shape != f_points.shape:
            raise ModelError(
                f"{self.name}: {variable} has {x_points.size} points and force {f_points.size}; "
                "give one force for each."
            )
        steps = np.diff(x_points)
        if np.any(steps <= 0.0):
            row = int(np.argmax(steps <= 0.0)) + 1
            raise ModelError(
                f"{self.name}.{variable} must increase from point to point, but point {row} "
                f"({x_points[row]:g}) does not exceed point {row - 1} ({x_points[row - 1]:g}). "
                "Sort the table and average repeated points."
            )
        steep = np.abs(np.diff(f_points)) > STEEPEST * steps
        if np.any(steep):
            row = int(np.argmax(steep)) + 1
            raise ModelError(
                f"{self.name}.{variable}: points {row - 1} and {row} ({x_points[row - 1]:g} and "
                f"{x_points[row]:g} {UNITS[variable]}) make a slope above {STEEPEST:g}; "
                "average them."
            )
        slopes = PchipInterpolator(x_points, f_points).derivative()(x_points)
        over = float(variable == "velocity")
        parameters = (over, float(x_points.size), *x_points, *f_points, *slopes)
        limits = (variable, float(x_points[0]), float(x_points[-1]))
        return Law(laws.table, tuple(float(p) for p in parameters), limits=limits)

    def _points(self, name: str, values: object) -> np.ndarray:
        try:
            points = np.asarray(values, dtype=float).ravel()
        except (TypeError, ValueError):
            raise ModelError(f"{self.name}.{name} must be a list of numbers.") from None
        if points.size < SMALLEST_TABLE:
            raise ModelError(f"{self.name}.{name} has {points.size} points; give at least two.")
        if not np.all(np.isfinite(points)):
            row = int(np.argmin(np.isfinite(points)))
            raise ModelError(
                f"{self.name}.{name}[{row}] = {points[row]} is not finite; remove or repair it."
            )
        most = LARGEST[name]["maximum"]
        if np.any(np.abs(points) > most):
            row = int(np.argmax(np.abs(points) > most))
            raise ModelError(
                f"{self.name}.{name}[{row}] = {points[row]:g} {UNITS[name]} is not allowed; it "
                f"must be a number in {-most:g} .. {most:g} {UNITS[name]}. Check the unit."
            )
        return points

    def _slope_at_zero(self) -> float:
        law = self.lower()
        x, f, slopes = np.reshape(law.parameters[2:], (3, -1))
        if not x[0] < 0.0 < x[-1]:
            return float(slopes[0] if x[0] >= 0.0 else slopes[-1])
        from scipy.interpolate import CubicHermiteSpline

        return float(CubicHermiteSpline(x, f, slopes).derivative()(0.0))


@dataclass(frozen=True)
class TableSpring(TableElement):
    """Spring from a measured table of force over displacement.

    Parameters
    ----------
    displacement : m, within +-1000, strictly increasing, at least two points
    force : N, within +-1e9, positive in tension, as many points
    """

    displacement: tuple[float, ...] = ()
    force: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        """Check the table at once, not at the first run."""
        super().__post_init__()
        object.__setattr__(self, "displacement", tuple(np.ravel(self.displacement)))
        object.__setattr__(self, "force", tuple(np.ravel(self.force)))
        self.lower()

    def lower(self) -> Law:
        """The law on d."""
        return self._law("displacement", self.displacement, self.force)

    def tangent(self) -> tuple[float, float]:
        """Slope of the interpolant at d = 0."""
        return (self._slope_at_zero(), 0.0)


@dataclass(frozen=True)
class TableDamper(TableElement):
    """Damper from a measured table of force over relative velocity.

    Parameters
    ----------
    velocity : m/s, within +-1e4, strictly increasing, at least two points; negative in bump
    force : N, within +-1e9, positive in tension, as many points
    """

    velocity: tuple[float, ...] = ()
    force: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        """Check the table at once, not at the first run."""
        super().__post_init__()
        object.__setattr__(self, "velocity", tuple(np.ravel(self.velocity)))
        object.__setattr__(self, "force", tuple(np.ravel(self.force)))
        self.lower()

    def lower(self) -> Law:
        """The law on v."""
        return self._law("velocity", self.velocity, self.force)

    def tangent(self) -> tuple[float, float]:
        """Slope of the interpolant at v = 0."""
        return (0.0, self._slope_at_zero())
