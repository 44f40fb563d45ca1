"""Where is the seat stable? A map, the exact edge, and the critical values of one parameter.

python examples/02_stability.py [FOLDER FOR THE FIGURE]
"""

import sys
from pathlib import Path

import numpy as np

import seatdyn as sd


def main(folder=None):
    seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(520.0)])
    system = sd.SeatSystem(sd.load_body("ksiazek1997_back_on"), seat)

    found = sd.critical_values(system, vary="seat_mass", low=1.0, high=100.0)
    for value, frequency in zip(found.value.values, found.frequency.values, strict=True):
        print(f"back-on is unstable below a seat mass of {value:.6f} kg ({frequency:.2f} Hz)")

    # the same number by another way: the boundary in closed form, one point
    edge = sd.stability_boundary(system, frequency=found.frequency, stiffness=[9950.0])
    print(f"closed form at that frequency: {edge.seat_mass.values[0, 0]:.6f} kg")

    # the body without backrest contact loses its stability at low damping
    off = sd.SeatSystem(sd.load_body("ksiazek1997_back_off"), seat)
    found = sd.critical_values(off, vary="damping", low=0.0, high=1000.0)
    print(f"back-off needs a damper of at least {found.value.values[0]:.4f} N s/m")

    mass, damping = np.linspace(5.0, 60.0, 300), np.linspace(0.0, 3200.0, 300)
    verdict = sd.stability_map(system, seat_mass=mass, damping=damping)
    second = sd.stability_map(system, method="poles", seat_mass=mass, damping=damping)
    differ = int((verdict.stable != second.stable).sum())
    print(f"map: {100 * float(verdict.stable.mean()):.2f} % stable; criteria differ at {differ}")
    if folder is not None:
        sd.plot(verdict, Path(folder) / "stability.png", title="back-on, 9950 N/m")


if __name__ == "__main__":
    main(*sys.argv[1:])
