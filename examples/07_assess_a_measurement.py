"""Assess a measured ride and set a model beside it; the file of the logger is made here.

python examples/07_assess_a_measurement.py [FOLDER]
"""

import sys
from pathlib import Path

import numpy as np

import seatdyn as sd

RATE, LENGTH, GRAVITY = 250.0, 120.0, 9.80665  # Hz, s, m/s2
AXIS = {"seat": {"z": "Seat"}, "floor": {"z": "Floor"}}


def ride(seat):
    """Accelerations of floor and seat on a backhoe loader, m/s2."""
    system = sd.SeatSystem(sd.load_body("wei1998_1b"), seat)
    motion = sd.RandomMotion(sd.seat_test_input("EM5"), LENGTH, seed=4)
    run = sd.simulate(system, motion, LENGTH - 1 / RATE, output_step=1 / RATE)
    acceleration = run.acceleration.sel(node="seat").values
    return sd.Measurement({"Floor": run.base_acceleration.values, "Seat": acceleration}, RATE)


def write_logger_file(path, record):
    """Gravity, a little noise, units of g, semicolons and decimal commas."""
    noise = np.random.default_rng(1).normal(0.0, 0.003, (2, record.samples))
    floor, seat = (1.0 + record[n] / GRAVITY + noise[i] for i, n in enumerate(("Floor", "Seat")))
    table = np.column_stack([np.arange(record.samples) / RATE, floor, seat])
    lines = [";".join(f"{x:.4f}" for x in row).replace(".", ",") for row in table]
    path.write_text("\n".join(["Time [s];Floor [g];Seat [g]", *lines]) + "\n", encoding="utf-8")


def main(folder="."):
    file = Path(folder) / "ride.csv"
    truth = ride(sd.load_seat("illustrative_suspension"))
    write_logger_file(file, truth)

    measured = sd.assess(sd.read_measurement(file), **AXIS, exposure=6 * 3600.0)
    z = measured.sel(axis="z")
    print(f"weighted r.m.s. {float(z.weighted_rms):.3f} m/s2, VDV {float(z.vdv):.2f} m/s1.75")
    print(f"A(8) of 6 h {float(z.a8):.3f} m/s2: {measured.attrs['a8_verdict']}")
    print(f"SEAT {float(z.seat_rms):.3f} (r.m.s.), {float(z.seat_vdv):.3f} (VDV)")
    same = abs(float(sd.assess(truth, **AXIS).seat_rms[0] / z.seat_rms) - 1.0) < 0.01
    print("file and motion give the same SEAT within 1 %:", same)
    model = sd.Seat(20.0, [sd.Spring(9500.0), sd.Damper(350.0)])  # friction and buffers left out
    simulated = sd.assess(ride(model), **AXIS)
    beside = sd.compare_bands(measured, simulated)
    worst = beside.band_difference.sel(axis="z", band=slice(1.0, 10.0))
    print(
        f"simulated over measured, 1 to 10 Hz: {worst.values.min():+.1f} .. {worst.max():+.1f} dB"
    )
    sd.plot(measured, Path(folder) / "assessed.png")
    sd.plot(beside, Path(folder) / "beside.png")


if __name__ == "__main__":
    main(*sys.argv[1:])
