"""Systems that many tests use."""

from __future__ import annotations

import csv
import signal
from pathlib import Path

import pytest

import seatdyn as sd

ORACLE = Path(__file__).parent / "oracle" / "data"
OFF, ON = "ksiazek1997_back_off", "ksiazek1997_back_on"
OUTPUTS = [
    *("acc_m1", "acc_m2", "acc_seat", "m1", "m2", "seat", "m2-m1", "m1-seat", "m2-seat"),
    *("F_damper", "F_linear", "F_spring", "F_damper+nonlinear", "F_nonlinear"),
]


def paper_system(*elements, body=OFF, mass=35.0, k=9950.0, c=260.0):
    """The paper's seat with further suspension elements."""
    seat = sd.Seat(mass, [sd.Spring(k), sd.Damper(c), *elements])
    return sd.SeatSystem(sd.load_body(body), seat)


def oscillator(*elements, mass=1.0):
    """One mass on suspension elements: a seat with an inert load."""
    body = sd.SeatedBody("inert", {"seat": mass / 2}, ())
    return sd.SeatSystem(body, sd.Seat(mass / 2, elements))


def amplitude_after(system, sine, periods):
    """Amplitude of the suspension travel in the last of so many periods from rest."""
    period = 1.0 / sine.frequency
    long = sd.simulate(system, sine, periods * period, output_step=period / 500)
    last = long.relative_displacement.sel(pair="seat-base").values[-501:]
    return (last.max() - last.min()) / 2


def oracle_rows(name):
    """Parameter and the 14 amplitudes of each row of an oracle table."""
    with (ORACLE / f"{name}.csv").open() as lines:
        rows = list(csv.reader(lines))[1:]
    return [(float(row[0]), [float(cell) for cell in row[1:15]]) for row in rows]


@pytest.fixture(scope="session")
def sine():
    """The paper's excitation as it has to be read, back-off."""
    return sd.Sine(1.55, amplitude=0.8857)


def listen():
    """For a new process: a shell lets what it starts in the background ignore Ctrl-C; undo that."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
