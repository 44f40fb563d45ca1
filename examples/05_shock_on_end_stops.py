"""A shock drives the seat into its end stops: time run, impact forces, energy balance.

python examples/05_shock_on_end_stops.py [FOLDER FOR THE FIGURE]
"""

import sys
from pathlib import Path

import seatdyn as sd


def main(folder=None):
    shock = sd.HalfSineShock(30.0, 0.05)
    print(f"the pulse alone would leave {shock.velocity_change:.4f} m/s; it is compensated:")
    for note, value in shock.notes.items():
        print(f"  {note} = {value:.3f}")
    x, v = float(shock.displacement(2.0)), float(shock.velocity(2.0))
    print(f"  base at 2 s: {x:.1e} m, {v:.1e} m/s")

    stop = sd.EndStop(60e3, bump_clearance=0.03, rebound_clearance=0.03, damping=300.0)
    for title, stops in (("without stops", []), ("with stops", [stop])):
        seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(260.0), *stops])
        system = sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat)
        run = sd.simulate(system, shock, duration=3.0)
        travel = 1e3 * run.relative_displacement.sel(pair="seat-base")  # mm
        peak = abs(run.acceleration.sel(node="seat")).max()
        print(
            f"{title}: travel {float(travel.min()):.1f} .. {float(travel.max()):.1f} mm,"
            f" seat acceleration up to {float(peak):.1f} m/s2, {run.attrs['events']} events,"
            f" status {run.attrs['status']}, energy residual {run.attrs['energy_residual']:.0e}"
        )
        if folder is not None:
            sd.plot(run, Path(folder) / f"shock_{title.replace(' ', '_')}.png", title=title)


if __name__ == "__main__":
    main(*sys.argv[1:])
