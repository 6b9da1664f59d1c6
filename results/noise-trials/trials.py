"""Noise strengths with stated intervals: how often the intervals hold the truth, beside allantools and a likelihood of another kind.

    python trials.py PROGRAM [--first 0] [--trials 200] [--trials-1e6 20] [--sizes 1000,10000,100000,1000000] [--kinds …] > trials.csv

Needs numpy, scipy, pyarrow and allantools. Records are of 1 Hz. White noise is N(0, sigma) a row; flicker is white noise through
(1 - z^-1)^(-1/2) (Kasdin, Proc. IEEE 83 (1995) 802) after as many rows of burn-in as the record has; the random walk is a sum. Quantisation
is the change of the error of an angle: alone, that error is drawn evenly within a step; beside white noise, the angle that the other
noises turn by is read to a whole multiple of the step, which is not much longer than a row's turn: else errors of rows would follow
each other, and be no quantisation noise in the sense of IEEE Std 952. A ramp goes through RAMP deg/h in the course of its record. With
thermal cycles the temperature goes through three sine periods of +-30 degC, read with 0.01 degC of noise, and the rate follows it: by
its value, by its change, and by its value 300 s ago.

The other likelihood is Whittle's, of the tapered periodogram of the record's differences; cycles are taken out by least squares first.
"""

import argparse
import csv
import itertools
import json
import os
import subprocess
import sys
import tempfile

import allantools
import numpy as np
import pyarrow as pa
import pyarrow.csv
from scipy.optimize import minimize
from scipy.signal import fftconvolve

# Of one row, in deg/h: white, flicker (B), step of the random walk, quantisation (of the angle, in arcsec); ramps (1 or 0).
KINDS = {
    "white": (1.0, 0.0, 0.0, 0.0, 0),
    "flicker": (0.0, 0.3, 0.0, 0.0, 0),
    "random_walk": (0.0, 0.0, 0.01, 0.0, 0),
    "white+flicker": (1.0, 0.1, 0.0, 0.0, 0),
    "white+random_walk": (1.0, 0.0, 0.003, 0.0, 0),
    "white+flicker+random_walk": (1.0, 0.1, 0.001, 0.0, 0),
    # Further kinds stand behind: a kind's place is part of its seeds.
    "quantisation": (0.0, 0.0, 0.0, 1.0, 0),
    "white+quantisation": (1.0, 0.0, 0.0, 0.4, 0),
    "white+ramp": (1.0, 0.0, 0.0, 0.0, 1),
    "all_five": (1.0, 0.1, 0.001, 0.4, 1),
}
# deg/h, from the first row to the last.
RAMP = 2.0
# What the program states, from what a row holds: N = sigma sqrt(1 s) in deg/sqrt(h), B, K = step sqrt(1/s), Q in arcsec, R in deg/h/h.
TO_STATED = {"white": 1 / 60, "flicker": 1.0, "rate_random_walk": 60.0, "quantisation": 1.0, "ramp": 3600.0}

# The other likelihood is for comparison: as many trials as show its middle and spread.
WHITTLE_TRIALS = 5


def flicker(random, n):
    weights = np.cumprod(np.concatenate([[1.0], (np.arange(1, 2 * n) - 0.5) / np.arange(1, 2 * n)]))
    return fftconvolve(random.standard_normal(2 * n), weights)[n : 2 * n]


def record(random, n, kind, cycles):
    white, pink, walk, quantisation, ramps = KINDS[kind]
    rate = white * random.standard_normal(n)
    if pink:
        rate = rate + pink * flicker(random, n)
    if walk:
        rate = rate + walk * np.cumsum(random.standard_normal(n))
    time = np.arange(n, dtype=float)
    if quantisation:
        # 1 deg/h for 1 s is 1 arcsec. A step q leaves an error of q/sqrt(12). Of a turn that is not random the error is not either:
        # there it is drawn.
        step = np.sqrt(12) * quantisation
        angle = np.concatenate([[0.0], np.cumsum(rate)]) + step * random.random()
        error = step * np.floor(angle / step + 0.5) - angle if white else step * (random.random(n + 1) - 0.5)
        rate = rate + np.diff(error)
    if ramps:
        rate = rate + RAMP / n * time
    course = lambda t: 20 + (30 * np.sin(2 * np.pi * 3 * t / n) if cycles else 0 * t)
    temperature = course(time)
    thermal = 0.02 * (temperature - 20) + 20 * np.gradient(temperature) - 0.01 * (course(time - 300) - 20)
    read = temperature + 0.01 * random.standard_normal(n)
    return time, read, rate + thermal, course


def program(path, binary):
    answer = subprocess.run([binary, "metrics", path, "--format", "json"], capture_output=True, check=True)
    return json.loads(answer.stdout)["records"][0]


def binned(power, s):
    """Single lines at first, then means over a fiftieth of an octave."""
    edges, at = list(range(0, min(200, len(s)))), min(200, len(s))
    while at < len(s):
        edges.append(at)
        at += max(1, at // 70)
    counts = np.diff(edges + [len(s)])
    return np.add.reduceat(power, edges) / counts, np.add.reduceat(s, edges) / counts, counts


def whittle(time, rate, cycles, course):
    n = len(rate)
    if cycles:
        columns = np.stack([np.ones(n), course(time), np.gradient(course(time)), course(time - 300)], axis=1)
        rate = rate - columns @ np.linalg.lstsq(columns, rate, rcond=None)[0]
    change = np.diff(rate)
    taper = np.hanning(len(change))
    power = np.abs(np.fft.rfft((change - change.mean()) * taper)[1:-1]) ** 2 / np.sum(taper**2)
    s = 2 * np.sin(np.pi * np.fft.rfftfreq(len(change))[1:-1])
    power, s, counts = binned(power, s)
    scale = np.var(change)

    parts = np.stack([s**2, s, np.ones_like(s), s**4])

    def cost(p):
        v = np.exp(np.clip(p, -60, 20)) * scale
        spectrum = v @ parts
        slope = parts @ (counts * (1 - power / spectrum) / spectrum) * v
        return np.sum(counts * (np.log(spectrum) + power / spectrum)), slope

    starts = ([-1, -20, -20, -20], [-1, -5, -10, -5], [-20, -1, -10, -20], [-20, -20, 0, -20], [-20, -20, -20, -1], [-2, -5, -10, -2])
    best = min((minimize(cost, start, jac=True, method="L-BFGS-B") for start in starts), key=lambda found: found.fun)
    v = np.sqrt(np.exp(np.clip(best.x, -60, 20)) * scale)
    return {"white": v[0] / 60, "flicker": v[1], "rate_random_walk": v[2] * 60, "quantisation": v[3]}


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("program")
    arguments.add_argument("--first", type=int, default=0, help="the trial to begin with, where others were run before")
    arguments.add_argument("--trials", type=int, default=200)
    arguments.add_argument("--trials-1e6", type=int, default=20, dest="large")
    arguments.add_argument("--sizes", default="1000,10000,100000,1000000")
    arguments.add_argument("--kinds", default=",".join(KINDS))
    wish = arguments.parse_args()
    out = csv.writer(sys.stdout, lineterminator="\n")
    names = ["white", "flicker", "rate_random_walk", "quantisation", "ramp"]
    head = ["kind", "rows", "cycles", "trial"]
    head += [f"{n}_{e}" for n in names for e in ("true", "value", "low", "high")]
    head += [f"{n}_whittle" for n in names[:4]] + ["allan_off_allantools"]
    out.writerow(head)
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "record.csv")
        sizes = [int(rows) for rows in wish.sizes.split(",")]
        # All kinds and lengths advance together: a run that is broken off is as good as a shorter one.
        for trial in range(wish.first, max(wish.trials, wish.large)):
            for rows, kind, cycles in itertools.product(sizes, wish.kinds.split(","), (0, 1)):
                if trial >= (wish.large if rows >= 1_000_000 else wish.trials):
                    continue
                random = np.random.default_rng([rows, list(KINDS).index(kind), cycles, trial])
                time, temperature, rate, course = record(random, rows, kind, cycles)
                table = pa.table({"time_s": time, "temperature_c": temperature, "rate_deg_per_h": rate})
                pyarrow.csv.write_csv(table, path)
                found = program(path, wish.program)
                noises = {noise["kind"]: noise for noise in found["noise"]}
                truth = dict(zip(names, KINDS[kind]))
                truth["ramp"] *= RAMP / rows
                line = [kind, rows, cycles, trial]
                for name in names:
                    noise = noises[name]
                    true = truth.get(name, 0.0) * TO_STATED.get(name, 0.0)
                    line += [f"{v:.6g}" for v in (true, noise["value"], noise["low"], noise["high"])]
                other = whittle(time, rate, cycles, course) if trial < WHITTLE_TRIALS else None
                line += [f"{other[n]:.6g}" if other else "" for n in names[:4]]
                off = ""
                if trial == 0:
                    points = found["allan"]
                    taus = [p["tau_s"] for p in points]
                    _, deviation, _, _ = allantools.oadev(rate, rate=1.0, data_type="freq", taus=taus)
                    theirs = [p["deviation_deg_per_h"] for p in points][: len(deviation)]
                    off = f"{np.max(np.abs(np.array(theirs) / deviation - 1)):.2g}"
                out.writerow(line + [off])
                sys.stdout.flush()


main()
