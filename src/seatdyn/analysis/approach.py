"""How far a motion still is from the one that repeats itself, told by its changes per period.

A seat that dry friction holds for most of the time may come to its end more slowly than by any
constant share a period: each slip is as the square of the way left to where the seat would be held
for ever, so that n periods leave 1/n of it. One over the root of a slip grows by the same amount
every period then, and that tells the way left. The seat is led on by half of it, again and again;
Newton's method could not help, as the period map has a corner where a slip vanishes.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from seatdyn.analysis.run import Problem, Run

Array = NDArray[np.float64]
P = TypeVar("P", bound=Problem)
CREEPING = 0.5  # ratio of two changes above which what friction holds is led to where it creeps
LED, SURE = 0.5, 0.1  # share of the way left; standard error of that, as a share, where it is known
FEWEST = 6  # moves that it is known from
CREEPS = 0.999  # multiplier from which on what slips is taken to creep
JITTER = 1e-2  # change over one period, relative, that may be the error of the steps,
LONG = 128  # after so many periods
SHARPER, FINEST = 1e-2, 1e-12  # rtol in its place, as a share, and at least
UNKNOWN = 32  # periods after which what creeps does so too slowly to tell how far,
EVEN = 0.9  # with moves that fall no lower than to this share in the second half of them


class Approach:
    """What the changes of a motion from period to period, all relative, say about its end.

    changes, moves : largest change of the state, and of the displacements alone, per period
    """

    def __init__(self) -> None:
        """Nothing is known yet."""
        self._ahead, self._pace = 0.0, np.nan  # of what was led on: way left at most, rate of then
        self._reaches: list[float] = []  # way left at most over the root of a move, each time
        self._slips = False
        self.forget()

    def forget(self) -> None:
        """Begin again, at another motion than the last one."""
        self.changes, self.moves = [np.nan], [np.nan]
        self._rate, self._left, self._remaining = np.nan, np.inf, np.inf
        self._known = False

    def see(self, change: Array, run: Run) -> None:
        """Take the changes (p,) over one more period, `run`, displacements first."""
        problem = run.problem
        self.changes.append(float(change.max()))
        self.moves.append(float(change[: problem.system.linear.size].max()))
        rate, pace = (
            last[-1] / last[-2] if last[-2] > 0.0 else 1.0 for last in (self.changes, self.moves)
        )
        self._slips = run.slips
        if self._slips and pace > CREEPING and self.moves[-1] > problem.settings.rtol:
            self._rate = pace
            self._left, known = way_left(self.moves)
            self._known = known and way_left(self.changes)[1]  # or something else still rings
            self._remaining = self._left * self.moves[-1]
        else:
            self._rate, self._known = rate, False
            self._remaining = rate / (1.0 - rate) * self.changes[-1] if rate < 1.0 else np.inf

    @property
    def was_led(self) -> bool:
        """Whether it was led on."""
        return bool(self._reaches)

    @property
    def _unknown(self) -> bool:
        """Whether what was led on moves too evenly since then to tell how far it still is."""
        return self.was_led and (not self._slips or (self._long_ago and not self._falls))

    @property
    def _long_ago(self) -> bool:
        """Whether it was led so long ago that its moves since then tell all that they can."""
        return len(self.moves) > UNKNOWN

    @property
    def _falls(self) -> bool:
        """Whether its moves fall, by a share each period, other than those of what creeps."""
        return self.moves[-1] < EVEN * self.moves[-UNKNOWN // 2]

    @property
    def rate(self) -> float:
        """What the change over a period is of that over the one before, as far as known."""
        return self._pace if self._unknown else self._rate

    @property
    def error(self) -> float:
        """How far the motion still is from its end."""
        if self._unknown:
            # the last of them is known worst: the smaller a move, the less it changes
            return max(self._ahead, max(self._reaches[-2:]) * math.sqrt(self.moves[-1]))
        return max(self._remaining, 0.0 if self._long_ago and self._falls else self._ahead)

    def is_over(self, tolerance: float) -> bool:
        """Whether the motion is as near to its end as asked for, or as can be told."""
        return self.changes[-1] <= tolerance and (self._unknown or self.error <= tolerance)

    def stalls(self) -> bool:
        """Whether it has long been near its end, so that what is left may be what the steps leave.

        True seldom, so that it can be asked after every period.
        """
        seen = len(self.changes) - 1
        return seen % LONG == 0 and max(self.changes[-LONG // 2 :]) < JITTER

    def lead(self) -> float:
        """How many of its last changes it is to be led on, 0 if none; it is forgotten then."""
        if not self._known:
            return 0.0
        share = LED * self._left
        farthest = self._remaining / (1.0 - 2.0 * SURE)
        self._ahead = farthest - LED * self._remaining
        self._reaches.append(farthest / math.sqrt(self.moves[-1]))
        self._pace = (self._left / (self._left + 1.0)) ** 2
        self.forget()
        return share


def sharper(problem: P) -> P:
    """The same problem with a far smaller error of the steps."""
    rtol = max(SHARPER * problem.settings.rtol, FINEST)
    return replace(problem, settings=replace(problem.settings, rtol=rtol))


def way_left(moves: list[float]) -> tuple[float, bool]:
    """What is left to go, in last moves, and whether that is known well enough.

    moves : not a number first; each is as the square of the way left
    """
    count = max(2 * (len(moves) - 1) // 3, FEWEST)  # those before may still be another motion's
    if len(moves) <= count:
        return np.inf, False
    values = 1.0 / np.sqrt(moves[-count:])
    place = np.arange(count) - 0.5 * (count - 1)
    spread = float(place @ place)
    growth = float(place @ values) / spread
    rest = values - values.mean() - growth * place
    uncertain = math.sqrt(float(rest @ rest) / (count - 2) / spread)
    if growth <= 0.0:
        return np.inf, False
    return float(values[-1]) / growth - 1.0, uncertain <= SURE * growth


def most_multiplier(run: Run) -> float:
    """Largest multiplier that the differences of a period map may have of a motion found by it.

    Where a slip vanishes they miss the corner of the map, and are as near to one as they are small.
    """
    return CREEPS if run.slips else 1.0
