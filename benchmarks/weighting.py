"""What does the frequency weighting Wk of 600 s at 1 kHz cost, and how right is it at 80 Hz?

Ours multiplies the spectrum of the record by the analogue factor. SciPy: the same analogue zeros
and poles through its own bilinear transform, as second-order sections (`bilinear_zpk`, `sosfilt`);
plain, and with the record first resampled (`resample_poly`) to as many times the rate as bring the
error below 1e-3. The error is that of the amplitude of a long sine of 80 Hz, by least squares over
its second half, against the analogue factor. One thread, warm, processor time, best of the rounds.

    python benchmarks/weighting.py [--rows FILE] [--repeat N]
"""

from __future__ import annotations

import argparse
import math
import os
import time

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[variable] = "1"

import numpy as np
from rows import Row, write
from scipy import signal

import seatdyn as sd

NAME, RATE, SECONDS, FREQUENCY = "Wk", 1000.0, 600.0, 80.0
RIGHT = 1e-3  # error at which an oversampled filter is taken
WK = sd.weighting(NAME)


def bilinear(times):
    """SciPy's filter at `times` the rate, with the record resampled there and back."""
    rate = times * RATE
    sections = signal.zpk2sos(*signal.bilinear_zpk(*WK.zpk(), rate))

    def apply(record):
        if times == 1:
            return signal.sosfilt(sections, record)
        return signal.resample_poly(
            signal.sosfilt(sections, signal.resample_poly(record, times, 1)), 1, times
        )

    return apply


def error(apply):
    """Relative error of the amplitude at 80 Hz."""
    t = np.arange(round(60.0 * RATE)) / RATE
    waves = np.exp(2j * np.pi * FREQUENCY * t)
    half = slice(t.size // 2, t.size - round(RATE))  # without the edges of a resampling
    found = 2 * np.mean(apply(waves.imag)[half] * waves.conj()[half])  # whole periods
    return abs(abs(found) / abs(WK.factor(FREQUENCY)) - 1.0)


def spent(apply, record, repeat):
    """Least processor time in s of some calls."""
    apply(record)
    times = []
    for _ in range(repeat):
        start = time.process_time()
        apply(record)
        times.append(time.process_time() - start)
    return min(times)


def main():
    """Print the table; write the rows where asked."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rows", metavar="FILE")
    parser.add_argument("--repeat", type=int, default=5)
    options = parser.parse_args()
    oversampling = next(
        times for times in (2**k for k in range(10)) if error(bilinear(times)) < RIGHT
    )
    peers = {
        "SciPy bilinear": bilinear(1),
        f"SciPy bilinear at {oversampling} times the rate": bilinear(oversampling),
    }
    record = np.random.default_rng(1).standard_normal(round(SECONDS * RATE))

    def ours(samples):
        return WK.apply(samples, RATE)

    own, own_error = spent(ours, record, options.repeat), error(ours)
    print(f"| {NAME}, {SECONDS:g} s at {RATE:g} Hz | ms | error at {FREQUENCY:g} Hz |")
    print(f"| --- | --- | --- |\n| seatdyn | {1e3 * own:.1f} | {own_error:.0e} |")
    rows = []
    for name, apply in peers.items():
        took, off = spent(apply, record, options.repeat), error(apply)
        print(f"| {name} | {1e3 * took:.1f} | {off:.0e} |")
        work = f"weighting {NAME} of {SECONDS:g} s at {RATE:g} Hz"
        limit = "two real transforms of the record"
        rows.append(Row(work, own, name, took, own_error, off, math.nan, limit))
    if options.rows:
        write(rows, options.rows)


if __name__ == "__main__":
    main()
