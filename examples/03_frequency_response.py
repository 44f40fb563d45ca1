"""Transmissibility, apparent mass, and the bands where an active body drives its seat.

python examples/03_frequency_response.py [FOLDER FOR THE FIGURE]
"""

import sys
from pathlib import Path

import numpy as np

import seatdyn as sd

BODIES = ("ksiazek1997_back_off", "ksiazek1997_back_on")


def main(folder=None):
    frequency = np.geomspace(0.1, 40.0, 800)
    seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(260.0)])
    for name in BODIES:
        body = sd.load_body(name)
        response = sd.frequency_response(sd.SeatSystem(body, seat), frequency=frequency)
        size = abs(response.transmissibility.sel(node="seat"))
        peak = int(np.argmax(size.values))
        print(f"{name}: seat/base is largest, {size.values[peak]:.3f}, at {frequency[peak]:.3f} Hz")
        static = sd.frequency_response(body, frequency=[1e-4]).apparent_mass.item().real
        print(f"  apparent mass at zero frequency {static:.3f} kg, mass {body.total_mass:.1f} kg")
        bands = sd.active_bands(body)
        for low, high in zip(bands.low.values, bands.high.values, strict=True):
            print(f"  the body feeds power into the seat from {low:.3f} to {high:.3f} Hz")
        if folder is not None:
            sd.plot(response, Path(folder) / f"response_{body.posture}.png", title=name)


if __name__ == "__main__":
    main(*sys.argv[1:])
