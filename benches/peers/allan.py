#!/usr/bin/env python3
"""Writes tests/data/allan: seeded noise and its overlapping Allan deviation by allantools, the outside reference of
tests/validation/allan.rs.

    python3 -m pip install numpy allantools
    python3 benches/peers/allan.py [PHASE.DAT]

PHASE.DAT (1001 points of phase) is allantools' own test vector, distributed with Stable32; without it only the noises are
written."""

import pathlib
import sys

import allantools
import numpy as np

FOLDER = pathlib.Path(__file__).resolve().parents[2] / "tests" / "data" / "allan"
INTERVAL_S = 0.5
COUNT = 2048
FACTORS = [1, 2, 3, 5, 8, 16, 31, 64, 128, 200, 256, 400, 512, 680]


def flicker(random):
    """Noise with a spectrum of 1/f, by shaping white noise in the frequency domain."""
    spectrum = np.fft.rfft(random.standard_normal(COUNT))
    frequency = np.fft.rfftfreq(COUNT, INTERVAL_S)
    spectrum[1:] /= np.sqrt(frequency[1:])
    spectrum[0] = 0.0
    return np.fft.irfft(spectrum, COUNT)


def write(name, rates, interval_s, factors):
    taus, deviations, _, pairs = allantools.oadev(
        rates, rate=1.0 / interval_s, data_type="freq", taus=[m * interval_s for m in factors])
    with open(FOLDER / f"{name}.csv", "w", encoding="ascii") as file:
        file.write(f"# allantools {allantools.__version__}, numpy {np.__version__}, interval {interval_s} s\n")
        file.write("# lines 'rate,VALUE' then 'deviation,TAU_S,VALUE,PAIRS'\n")
        for rate in rates:
            file.write(f"rate,{float(rate)!r}\n")
        for row in zip(taus, deviations, pairs):
            file.write(f"deviation,{float(row[0])!r},{float(row[1])!r},{int(row[2])}\n")


def main():
    FOLDER.mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng(20261121)
    write("white", random.standard_normal(COUNT) + 3.0, INTERVAL_S, FACTORS)
    write("flicker", flicker(random), INTERVAL_S, FACTORS)
    write("random_walk", np.cumsum(random.standard_normal(COUNT)) * 0.1, INTERVAL_S, FACTORS)
    if len(sys.argv) > 1:
        phase = np.loadtxt(sys.argv[1], comments="#")
        write("stable32_phase", np.diff(phase), 1.0, [1, 2, 4, 8, 16, 32, 64, 128, 256])


if __name__ == "__main__":
    main()
