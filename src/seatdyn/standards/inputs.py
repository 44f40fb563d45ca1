"""Base motions that standards prescribe: the classes of the seat test, and roads."""

from __future__ import annotations

from typing import NamedTuple

from seatdyn.standards.source import Constant, Grade


class InputClass(NamedTuple):
    """Acceleration density G = A HP LP of one seat test, in (m/s2)^2/Hz, one-sided.

    HP = (f/fh)^2n / (1 + (f/fh)^2n), LP = 1 / (1 + (f/fl)^2n): Butterworth filters of n poles.
    The target is the unweighted r.m.s. acceleration from LOWEST Hz to `highest`.
    """

    standard: str
    level: float  # A, (m/s2)^2/Hz
    high_pass: tuple[int, float]  # poles, Hz
    low_pass: tuple[int, float]  # poles, Hz
    highest: float  # Hz
    target: float  # m/s2 r.m.s.


INPUT_GRADE = Grade.CHECKED  # each density integrates to its target within 0.31 %
LOWEST = 0.89  # Hz, of the band of every target
LEVEL_TOLERANCE = Constant(0.05, "1", "ISO 7096:2000, of the target r.m.s.", Grade.UNCERTAIN)
DENSITY_TOLERANCE = Constant(0.1, "1", "ISO 7096:2000, of the largest density", Grade.FOUND)

ISO7096 = "ISO 7096:2000"
EN13490 = "EN 13490:2001"
ISO5007 = "ISO 5007:2003"

# One transcription generates EM7 with a target of 2.36 m/s2, but prints the density of AG1, which
# integrates to 2.255 m/s2: 2.36 is taken for a slip of 2.26.
INPUT_CLASSES = {
    "EM1": InputClass(ISO7096, 2.82, (4, 1.5), (4, 2.5), 11.22, 1.71),
    "EM2": InputClass(ISO7096, 2.72, (4, 1.5), (4, 3.0), 11.22, 2.05),
    "EM3": InputClass(ISO7096, 1.93, (4, 1.5), (4, 3.0), 11.22, 1.73),
    "EM4": InputClass(ISO7096, 0.60, (4, 1.5), (4, 3.0), 11.22, 0.96),
    "EM5": InputClass(ISO7096, 1.11, (4, 1.5), (1, 3.5), 17.78, 1.94),
    "EM6": InputClass(ISO7096, 0.79, (2, 6.5), (2, 9.0), 17.78, 1.65),
    "EM7": InputClass(ISO7096, 9.25, (8, 3.0), (8, 3.5), 11.22, 2.26),
    "EM8": InputClass(ISO7096, 1.45, (4, 3.0), (2, 3.0), 17.78, 1.05),
    "EM9": InputClass(ISO7096, 2.10, (4, 3.5), (2, 4.0), 17.78, 1.63),
    "IT1": InputClass(EN13490, 1.66, (4, 4.5), (2, 5.0), 17.78, 1.58),
    "IT2": InputClass(EN13490, 1.45, (4, 3.0), (2, 3.0), 17.78, 1.05),
    "IT3": InputClass(EN13490, 0.60, (4, 1.5), (4, 3.0), 11.22, 0.96),
    "IT4": InputClass(EN13490, 1.64, (4, 1.5), (4, 3.0), 17.78, 1.59),
    "AG1": InputClass(ISO5007, 9.25, (8, 3.0), (8, 3.5), 11.22, 2.26),
    "AG2": InputClass(ISO5007, 7.22, (8, 2.1), (8, 2.6), 11.22, 1.94),
    "AG3": InputClass(ISO5007, 5.85, (8, 1.95), (8, 2.45), 11.22, 1.74),
}

# ISO 8608: displacement density Gd(n0) (n/n0)^-2 over the wave number n in cycle/m, one-sided.
ROAD_GRADE = Grade.FOUND  # geometric means of the classes, reference wave number, usual band
ROAD_REFERENCE = 0.1  # n0, cycle/m
ROAD_BAND = (0.01, 10.0)  # cycle/m, on-road
ROAD_CLASSES = {
    "A": 16e-6,
    "B": 64e-6,
    "C": 256e-6,
    "D": 1024e-6,
    "E": 4096e-6,
    "F": 16384e-6,
    "G": 65536e-6,
    "H": 262144e-6,
}  # Gd(n0), m3
