"""A body with a head, a measured damper and a force law of one's own; saved and loaded again.

python examples/06_own_body_and_element.py [FOLDER FOR THE FIGURE]
"""

import math
import sys
import tempfile
from pathlib import Path

import seatdyn as sd


@sd.force_law({"k": "N/m", "edge": "m"}, kinks_at={"displacement": ["edge", "-edge"]})
def bumper(d, v, p):
    """Rubber that is touched at +-edge and stiffens with the square of its compression."""
    touched = max(abs(d) - p[1], 0.0)
    return math.copysign(p[0] * touched * (1.0 + touched / p[1]), d)


def main(folder=None):
    body = sd.SeatedBody(
        name="with_head",
        masses={"pelvis": 45.0, "head": 5.5},
        links=(
            sd.Link(("seat", "pelvis"), stiffness=60e3, damping=1500.0),
            sd.Link(("pelvis", "head"), stiffness=30e3, damping=250.0),
        ),
    )
    measured = sd.TableDamper(
        velocity=(-0.6, -0.3, -0.1, 0.0, 0.1, 0.3, 0.6),
        force=(-120.0, -90.0, -50.0, 0.0, 80.0, 170.0, 260.0),
        label="damper 3, cold",
    )
    seat = sd.Seat(25.0, [sd.Spring(6000.0), measured, bumper(k=20e3, edge=0.03)])
    system = sd.SeatSystem(body, seat)
    print("natural frequencies in Hz:", sd.poles(system).f0.values.round(3).tolist())

    sweep = sd.Sweep(0.5, 8.0, duration=20.0, amplitude=1.5, spacing="logarithmic")
    run = sd.simulate(system, sweep, duration=22.0, output_step=5e-3)
    peaks = abs(run.acceleration).max("time")
    for node in run.node.values:
        print(f"largest acceleration of {node}: {float(peaks.sel(node=node)):.3f} m/s2")
    with tempfile.TemporaryDirectory() as place:
        again = sd.load(sd.save(run, Path(place) / "run.nc"))
    print("loaded result is identical:", again.identical(run))
    if folder is not None:
        sd.plot(run, Path(folder) / "sweep.png", title="sweep 0.5 to 8 Hz")


if __name__ == "__main__":
    main(*sys.argv[1:])
