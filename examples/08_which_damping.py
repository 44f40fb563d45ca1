"""Which damping gives the lowest SEAT factor: light and heavy, with end stops, active bodies.

python examples/08_which_damping.py [FOLDER]
"""

import sys
import warnings
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import seatdyn as sd

DAMPINGS = np.array([300.0, 600.0, 1000.0, 1500.0, 2500.0, 4000.0])  # N s/m
# the active bodies are scaled to a sitting mass as this package assumes: poles unchanged
BODIES = ("fairley1989", "ksiazek1997_back_off", "ksiazek1997_back_on")
STOPS = sd.ContactStop(1e6, bump_clearance=0.04, rebound_clearance=0.04, damping=0.5)
COLOURS, TICKS = {"light": "C0", "heavy": "C1"}, (0.8, 1, 1.5, 2, 3, 4)


def draw(ax, tests, name, kind, stops):
    """SEAT factors and upper ends of their intervals; a cross where there is none."""
    names = (f"seat_{kind}", f"seat_{kind}_high")
    value, high = np.array([[t[n].sel(occupant=name) for n in names] for t in tests]).T
    look = {"fmt": "s-"} if stops else {"fmt": "o:", "mfc": "white"}
    look |= {"color": COLOURS[name], "label": f"{name}, {'with' if stops else 'without'} stops"}
    ax.errorbar(DAMPINGS, value, high - value, capsize=3, **look)
    none = DAMPINGS[np.isnan(value)]
    ax.plot(none, np.full(none.size, 0.72 if stops else 0.68), "x", color=COLOURS[name])
    return value, high


def main(folder="."):
    warnings.simplefilter("ignore", sd.SeatdynWarning)  # bodies that drive the seat are marked
    figure = Figure(figsize=(10, 6.5), dpi=120, layout="constrained")
    grid = figure.subplots(2, 3, sharex=True, sharey=True)
    print("body                  stops  occupant  lowest SEAT  at N s/m  none at")
    for (upper, lower), body in zip(grid.T, BODIES, strict=True):
        for stops in ((), (STOPS,)):
            seats = [sd.Seat(20.0, [sd.Spring(9500.0), sd.Damper(c), *stops]) for c in DAMPINGS]
            tests = [sd.seat_test(s, "EM3", body=body, duration=60.0) for s in seats]
            for name in COLOURS:
                draw(lower, tests, name, "vdv", stops)
                value, high = draw(upper, tests, name, "rms", stops)
                best, none = np.nanargmin(value), DAMPINGS[np.isnan(value)].astype(int)
                text = f"{value[best]:.3f}+-{high[best] - value[best]:.3f} {DAMPINGS[best]:9g} "
                print(f"{body:22}{'yes' if stops else 'no':7}{name:10}{text}", *none)
        upper.set(title=body, xscale="log", yscale="log", ylim=(0.65, 5.0))
        lower.set(xlabel="damping [N s/m]", xticks=DAMPINGS, xticklabels=DAMPINGS.astype(int))
    for ax, kind in zip(grid.flat, ("r.m.s.",) * 3 + ("VDV",) * 3, strict=True):
        ax.set(ylabel=f"SEAT factor, {kind} (x: none)", yticks=TICKS, yticklabels=TICKS)
        ax.minorticks_off()
    grid[0, 0].legend(fontsize="small")
    figure.savefig(Path(folder) / "which_damping.png")


if __name__ == "__main__":
    main(*sys.argv[1:])
