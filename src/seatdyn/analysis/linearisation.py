"""Statistical linearisation: every element as the spring and damper nearest to it on average.

The response is assumed Gaussian. Then the levels of travel and speed across each element give an
equivalent spring and damper (`gaussian.equivalent`), these give the levels again, and so on until
nothing changes; asymmetric laws shift the mean as well. It is quick and never exact: the levels of
a Duffing oscillator come out 0.7 to 6 % low, those of a mass on dry friction 11 % low.
"""

from __future__ import annotations

import json
import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from seatdyn.analysis.covariance import in_frequency
from seatdyn.analysis.gaussian import Equivalent, equivalent
from seatdyn.analysis.gaussian_states import Joint, StateEquivalent, equivalent_states
from seatdyn.analysis.linear import labelled
from seatdyn.analysis.linear_map import channel_elements, linear_map
from seatdyn.analysis.outputs import incidence, output_table, unique_names
from seatdyn.analysis.random_linear import NOTE, check_request, is_settling, levels, output_coords
from seatdyn.errors import ExtrapolationWarning, RequestError, Status
from seatdyn.model.system import SeatSystem
from seatdyn.signals.spectrum import Spectrum
from seatdyn.units import number

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]
FIRST_GUESSES = (1.0, 0.25, 4.0, 0.06, 16.0, 64.0)  # travel and speed over those of the base
DIFFERENCE = 1e-5  # of logarithms and of the mean over the travel, for derivatives
LARGEST_STEP = 1.0
HALVINGS = 12
ROUNDING = 1e-12  # of the r.m.s. force: a smaller mean is none
OUTSIDE = 1e-2  # probability outside a measured table that is worth a warning


def statistical_linearisation(
    system: SeatSystem,
    spectrum: Spectrum,
    *,
    tolerance: float = 1e-9,
    max_iterations: int = 50,
) -> xr.Dataset:
    """Stationary response by equivalent springs and dampers, with a Gaussian motion assumed.

    Parameters
    ----------
    system : SeatSystem; elements with states of their own and delays are allowed, not both
    spectrum : Spectrum of the base acceleration
    tolerance : largest relative difference between the levels that the equivalents were made for
        and those that they lead to
    max_iterations : after which the status is "not_converged"

    Returns
    -------
    xarray.Dataset
        Over `output` (names as in `steady_state`, unit in `output_unit`): `rms`, `mean` and
        `deviation`, the r.m.s. about the mean; `rate_rms` of the time derivative, `upcrossings` of
        the mean in Hz. Over `element`
        (non-linear ones): `stiffness` in N/m, `damping` in N s/m and `mean_force` in N of its
        equivalent; `force_rms` in N, of its own law; `travel_rms`, `travel_mean` in m and
        `speed_rms` in m/s across it. Attributes: status ("converged", "not_converged",
        "unstable"), iterations, change. Unless converged the numbers are NaN.

    Raises
    ------
    RequestError
        No SeatSystem, no spectrum, delays beside elements with states of their own, or mean forces
        that nothing holds.

    Examples
    --------
    >>> import seatdyn as sd
    >>> seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.QuadraticDamper(1500.0)])
    >>> system = sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat)
    >>> found = sd.statistical_linearisation(system, sd.seat_test_input("EM3"))
    >>> found.attrs["status"]
    'converged'
    """
    check_request(system, spectrum)
    tolerance = number(tolerance, "tolerance", "", above=0.0, error=RequestError)
    most = round(number(max_iterations, "max_iterations", "", minimum=1.0, error=RequestError))
    search = Search(system, spectrum)
    status = search.solve(tolerance, most)
    if status is Status.CONVERGED:
        _warn_extrapolation(search)
    return _dataset(search, status)


class Search:
    """The fixed point of the levels and means that the elements feel.

    Levels make gains, and gains make levels: Newton's method on the difference, with derivatives
    by differences, never into an equivalent system that is unstable. A place holds for every
    channel the logarithms of travel and speed and the mean travel over its level, then the place
    of every non-linear element with states (`gaussian_states.Joint`).
    """

    def __init__(self, system: SeatSystem, spectrum: Spectrum) -> None:
        """Start from rest."""
        self.system, self.spectrum = system, spectrum
        self.elements = channel_elements(system)
        self.channel = [j for j, channel in enumerate(system.channels) for _ in channel.elements]
        self.joints = {
            i: Joint(element)
            for i, element in enumerate(system.memory_elements)
            if not element.is_linear
        }
        self.spread = np.zeros((len(system.channels), 2))  # r.m.s. travel and speed of a channel
        self.travel = np.zeros(len(system.channels))  # mean, m
        self.equivalents: list[Equivalent] = []
        self.with_states: dict[int, StateEquivalent] = {}
        self.felt: dict[int, tuple[Array, Array]] = {}  # standard deviations and means
        self.matrices = linear_map(system)
        self.mean = np.zeros(len(self.matrices.balance))  # of the states
        self.iterations, self.change = 0, np.inf

    def solve(self, tolerance: float, most: int) -> Status:
        """Iterate until the levels stay."""
        if not self.elements and not self.joints:
            self.change = 0.0
            return Status.CONVERGED if is_settling(self.matrices) else Status.UNSTABLE
        place, miss = self._begin()
        if miss is None:
            return Status.UNSTABLE
        for self.iterations in range(1, most + 1):
            self.change = float(np.max(np.abs(miss)))
            if self.change <= tolerance:
                self._miss(place)
                return Status.CONVERGED
            following = self._newton(place, miss)
            if following is None:
                break
            place, miss = following
        return Status.NOT_CONVERGED

    def _begin(self) -> tuple[Array, Array | None]:
        """Begin with a motion like that of the base, or another with which the system is stable."""
        spectrum = self.spectrum
        base = (
            spectrum.displacement_rms(),
            spectrum.velocity_rms(),
            spectrum.acceleration_rms(),
        )
        channels = np.tile([*np.log(base[:2]), 0.0], (len(self.spread), 1))
        for guess in FIRST_GUESSES:
            start = channels + np.array([np.log(guess), np.log(guess), 0.0])
            parts = [joint.stretched(joint.begin(base), guess) for joint in self.joints.values()]
            place = np.concatenate([start.ravel(), *parts])
            miss = self._miss(place)
            if miss is not None:
                return place, miss
        return place, None

    def _miss(self, place: Array) -> Array | None:
        """What levels and means lead to, less themselves, as a place.

        None where the equivalent system is unstable.
        """
        levels = place[: 3 * len(self.spread)].reshape(-1, 3)
        self.spread = np.exp(levels[:, :2])
        self.travel = levels[:, 2] * self.spread[:, 0]
        self.equivalents = [
            equivalent(element, *self.spread[j], mean=self.travel[j])
            for element, j in zip(self.elements, self.channel, strict=True)
        ]
        begin = levels.size
        for i, joint in self.joints.items():
            decoded = joint.decode(place[begin : begin + joint.size])
            if decoded is None:
                return None
            sigma, mean, factor = decoded
            self.felt[i] = sigma, mean
            self.with_states[i] = equivalent_states(joint.element, mean, factor)
            begin += joint.size
        gains = [(e.stiffness, e.damping) for e in self.equivalents]
        forms = [
            self.with_states[i].form if i in self.joints else element.linearised()
            for i, element in enumerate(self.system.memory_elements)
        ]
        self.matrices = linear_map(self.system, gains, memory=forms)
        return self._difference(place) if is_settling(self.matrices) else None

    def _difference(self, place: Array) -> Array:
        """The same of a stable equivalent system."""
        m, size = self.matrices, len(self.matrices.balance)
        joints = [(m.memory[i], joint) for i, joint in self.joints.items()]
        rows = [m.across.reshape(-1, size), *(f[0][j.variables] for f, j in joints)]
        base = [m.across_base.reshape(-1, 3), *(f[1][j.variables] for f, j in joints)]
        seen = m.system.seen(np.concatenate(rows), np.concatenate(base))
        covariance = in_frequency(seen, self.spectrum).covariance
        self.mean = self._balance()
        channels = np.empty((len(self.spread), 3))
        count = 2 * len(channels)
        channels[:, :2] = np.log(np.diagonal(covariance)[:count]).reshape(-1, 2) / 2
        channels[:, 2] = m.across[:, 0] @ self.mean / self.spread[:, 0]
        parts = [channels.ravel()]
        for (i, joint), (felt, _) in zip(self.joints.items(), joints, strict=True):
            end = count + len(joint.variables)
            mean = felt[0][joint.variables] @ self.mean
            part = covariance[count:end, count:end]
            parts.append(joint.encode(part, mean, self.felt[i][0]))
            count = end
        return np.concatenate(parts) - place

    def _balance(self) -> Array:
        """Mean of the states at which mean forces and rates, linear about the mean, balance."""
        n, m = self.system.linear.size, self.matrices
        push = np.zeros(len(m.forces))
        rates = np.zeros(len(m.balance))
        for k, (e, j) in enumerate(zip(self.equivalents, self.channel, strict=True)):
            mean = e.mean if abs(e.mean) > ROUNDING * e.rms else 0.0
            push[k] = e.stiffness * self.travel[j] - mean
        own = 2 * n
        for i, element in enumerate(self.system.memory_elements):
            if i in self.joints:
                found, form = self.with_states[i], self.with_states[i].form
                about = np.zeros(4 + len(found.rates))
                about[self.joints[i].variables] = self.felt[i][1]
                held = found.mean if abs(found.mean) > ROUNDING * found.rms else 0.0
                push[len(self.equivalents) + i] = form.k * about[0] + form.c @ about[4:] - held
                steady = found.rates - form.b * about[0] - form.a @ about[4:]
                rates[own : own + len(steady)] = steady
            own += len(element.states)
        force = self._pulls().T @ push
        if not np.any(force) and not np.any(rates):
            return rates
        rates[n : 2 * n] = np.linalg.solve(self.system.linear.mass, force)
        try:
            return np.asarray(-np.linalg.solve(m.balance, rates))
        except np.linalg.LinAlgError:
            raise RequestError(
                "The elements push to one side on average and no spring holds the seat there. "
                "Give it a Spring."
            ) from None

    def _pulls(self) -> Array:
        """Rows over the free nodes, second minus first, of all elements with a law, (e, N)."""
        elements = (*self.elements, *self.system.memory_elements)
        rows = [incidence(self.system, element.between)[:-1] for element in elements]
        return np.array(rows)

    def _newton(self, place: Array, miss: Array) -> tuple[Array, Array] | None:
        """A shortened Newton step to where less is missed, or None if there is none."""
        slopes = np.empty((place.size, place.size))
        for i in range(place.size):
            for step in (DIFFERENCE, -DIFFERENCE):
                near = place.copy()
                near[i] += step
                there = self._miss(near)
                if there is not None:
                    slopes[:, i] = (there - miss) / step
                    break
            else:
                return None
        newton = np.linalg.lstsq(slopes, -miss, rcond=None)[0]
        size = np.linalg.norm(miss)
        for direction in (newton, miss):
            share = min(1.0, LARGEST_STEP / float(np.max(np.abs(direction))))
            for _ in range(HALVINGS):
                there = self._miss(place + share * direction)
                if there is not None and np.linalg.norm(there) < (1.0 - 1e-3 * share) * size:
                    return place + share * direction, there
                share /= 2
        return None


def _means(search: Search) -> Array:
    """Mean of every output: the system at rest at its mean, with the mean forces."""
    n, m = search.system.linear.size, search.matrices
    force = m.forces @ search.mean
    count = len(search.equivalents)
    force[:count] = [item.mean for item in search.equivalents]
    for i, item in search.with_states.items():
        force[count + i] = item.mean
    rest = np.zeros(n)
    past = [np.zeros(2), search.mean[:n], rest] * len(search.system.delays)
    at_mean = np.concatenate([np.zeros(3), search.mean[:n], rest, rest, force, *past])
    return np.asarray(output_table(search.system)[1] @ at_mean)


def _dataset(search: Search, status: Status) -> xr.Dataset:
    system, m, items = search.system, search.matrices, search.equivalents
    done = status is Status.CONVERGED
    found = in_frequency(m.system, search.spectrum) if done else None
    means = _means(search) if done else np.full(len(m.names), np.nan)
    variables: dict[str, Any] = levels(found, len(m.names))
    deviation = variables["rms"][1]
    variables["deviation"] = (("output",), deviation, NOTE, "r.m.s. about the mean")
    variables["mean"] = (("output",), means, NOTE, "mean")
    variables["rms"] = (("output",), np.hypot(deviation, means), NOTE, "r.m.s.")

    def per_element(values: Any, unit: str, text: str) -> Any:
        shown = np.asarray(values, dtype=float) if done else np.full(len(search.elements), np.nan)
        return (("element",), shown, unit, text)

    spread = search.spread[search.channel].reshape(-1, 2)
    variables |= {
        "stiffness": per_element([e.stiffness for e in items], "N/m", "equivalent stiffness"),
        "damping": per_element([e.damping for e in items], "N s/m", "equivalent damping"),
        "mean_force": per_element([e.mean for e in items], "N", "mean force"),
        "force_rms": per_element([e.rms for e in items], "N", "r.m.s. of the law about its mean"),
        "travel_rms": per_element(spread[:, 0], "m", "r.m.s. displacement across"),
        "speed_rms": per_element(spread[:, 1], "m/s", "r.m.s. velocity across"),
        "travel_mean": per_element(search.travel[search.channel], "m", "mean displacement"),
    }
    coords = output_coords(m.names) | {"element": unique_names(search.elements)}
    request = {"function": "statistical_linearisation"}
    attributes = {
        "status": str(status),
        "message": status.message,
        "iterations": search.iterations,
        "change": search.change,
        "inputs": json.dumps({"system": repr(system), "spectrum": repr(search.spectrum)}),
    }
    return labelled(variables, coords, replace(system.linear, ignored=()), request, **attributes)


def _warn_extrapolation(search: Search) -> None:
    """Warn for every measured table that the motion leaves now and then, naming it."""
    for element, j in zip(search.elements, search.channel, strict=True):
        limits = element.lower().limits
        if limits is None:
            continue
        variable, low, high = limits
        on_velocity = variable == "velocity"
        mean = 0.0 if on_velocity else float(search.travel[j])
        sigma = search.spread[j, int(on_velocity)]
        outside = ndtr((low - mean) / sigma) + ndtr((mean - high) / sigma)
        if outside > OUTSIDE:
            warnings.warn(
                f"The table of {element.name} covers {variable} {low:.4g} .. {high:.4g}; the "
                f"motion is outside for {100 * outside:.2g} % of the time and the table was "
                "extrapolated. Measure further, or mistrust the result.",
                ExtrapolationWarning,
                stacklevel=3,
            )
