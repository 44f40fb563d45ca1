"""Influence of quadratic damping, dry friction and a jumping force on the steady state.

The excitation is that of the paper's Tables 3, 5 and 7. See docs/reading-the-paper.md.

python examples/04_steady_state.py [FOLDER FOR THE FIGURE]
"""

import sys
from pathlib import Path

import seatdyn as sd

ELEMENTS = {
    "linear": [],
    "quadratic, 100 N s2/m2": [sd.QuadraticDamper(100.0)],
    "quadratic, 1000 N s2/m2": [sd.QuadraticDamper(1000.0)],
    "friction, 10 N": [sd.CoulombFriction(10.0)],
    "friction, 50 N": [sd.CoulombFriction(50.0)],
    "jump, 1000 N/m": [sd.PiecewiseSpring(1000.0, 0.02, 0.01)],
    "end stop, 50 kN/m": [sd.EndStop(50e3, 0.03, 0.03, damping=200.0)],
}


def main(folder=None):
    body = sd.load_body("ksiazek1997_back_off")
    sine = sd.Sine(1.55, amplitude=0.8857)
    print(f"{'element':24} seat m/s2  travel mm  friction or stop N  energy residual")
    for name, elements in ELEMENTS.items():
        seat = sd.Seat(35.0, [sd.Spring(9950.0), sd.Damper(260.0), *elements])
        state = sd.steady_state(sd.SeatSystem(body, seat), sine)
        value = state.amplitude.sel(output=["acc_seat", "seat-base", "F_nonlinear"]).values
        assert state.attrs["status"] == "converged"
        print(
            f"{name:24} {value[0]:9.4f}  {1e3 * value[1]:9.3f}  {value[2]:18.3f}"
            f"  {state.attrs['energy_residual']:15.0e}"
        )
        if folder is not None and name.startswith("friction, 50"):
            sd.plot(state, Path(folder) / "steady_friction.png", title=name)


if __name__ == "__main__":
    main(*sys.argv[1:])
