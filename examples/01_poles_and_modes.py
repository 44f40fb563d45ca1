"""Natural frequencies, damping ratios, modes and zeros of the paper's bodies, alone and on a seat.

python examples/01_poles_and_modes.py [FOLDER FOR THE FIGURE]
"""

import sys
from pathlib import Path

import seatdyn as sd

BODIES = ("ksiazek1997_back_off", "ksiazek1997_back_on")


def main(folder=None):
    seat = sd.Seat(mass=35.0, suspension=[sd.Spring(9950.0), sd.Damper(260.0)])
    for name in BODIES:
        body = sd.load_body(name)
        system = sd.SeatSystem(body, seat)
        for title, what in (("alone", body), ("on the seat", system)):
            poles = sd.poles(what)
            print(f"{name} {title}: {'stable' if poles.attrs['stable'] else 'unstable'}")
            for f0, fd, ratio in zip(poles.f0, poles.fd, poles.damping_ratio, strict=True):
                print(f"  f0 {f0:7.4f} Hz   fd {fd:7.4f} Hz   damping ratio {ratio:.4f}")
        for node in body.nodes:
            zeros = sd.zeros(body, output=node)
            kind = "minimum phase" if zeros.attrs["minimum_phase"] else "non-minimum phase"
            print(f"  {node}/seat of the body alone: {zeros.sizes['zero']} zeros, {kind}")
        slowest = sd.modes(system).isel(mode=0)
        shape = ", ".join(
            f"{node} {abs(slowest.shape.sel(node=node)):.3f}" for node in system.nodes
        )
        print(f"  first mode on the seat, size of each motion: {shape}")
        if folder is not None:
            sd.plot(sd.poles(system), Path(folder) / f"poles_{body.posture}.png", title=name)


if __name__ == "__main__":
    main(*sys.argv[1:])
