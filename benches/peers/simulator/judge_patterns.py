"""Judges winding patterns on the simulator's own coil: `python judge_patterns.py CASE TRUTH.json PATTERN…`

CASE is a folder with coil.toml, PATTERN a classic's name or a pattern file of coilwright. Printed is the worst rate [deg/h]
of each pattern over ramps of the chamber's air within 60 C/h (96 profiles of 4 ramps in 6000 s, and the bang-bang ones under
which these patterns are worst), with everything that the coil has and its model file lacks; biases that no pattern changes
are left out.
"""
import json, os, sys, tomllib
import numpy as np
from simulator import Coil, DEG_PER_H, linear_field, segments  # noqa: F401

MAX = 60.0 / 3600.0  # C/s
case, truth = sys.argv[1], json.load(open(sys.argv[2]))
declared = tomllib.load(open(f"{case}/coil.toml", "rb"))
hidden = truth[os.path.basename(case.rstrip("/"))]["hidden"]
n = declared["winding"]["layers"]


def load(stated):
    if os.path.exists(stated):
        found = tomllib.load(open(stated, "rb"))
        return stated, np.array(found["segments"])
    return stated, segments(stated, n)


patterns = [load(p) for p in sys.argv[3:]]


def coil_of(seg):
    return Coil(declared, {**hidden, "wound_segments": list(map(int, seg))})


base = coil_of(patterns[0][1])


def rates(air):
    layers, _ = linear_field(base, air, hidden)
    return np.diff(layers, axis=0)


def omega(coil, rate):
    kappa = np.full(coil.n_layers, coil.kappa)
    if "stress" in hidden:
        share = coil.length / coil.total
        shape = coil.radius ** -2.0
        shape = shape - shape @ share
        kappa = kappa * (1.0 + hidden["stress"] * shape / np.abs(shape).max())
    m = hidden.get("mismatch", 0.0)
    weight = kappa * ((1.0 - 0.5 * m) * coil.half_a + (1.0 + 0.5 * m) * coil.half_b)
    return coil.scale * (rate @ weight)


rng = np.random.default_rng(20261122)
profiles = []
for _ in range(96):
    ends = np.sort(rng.uniform(0, 6000, 3))
    knots = np.r_[0.0, ends, 6000.0]
    temps = np.r_[20.0, 20.0 + np.cumsum(np.diff(knots) * rng.uniform(-MAX, MAX, 4))]
    profiles.append(np.interp(np.arange(6001.0), knots, temps))
step = rates(20.0 + MAX * np.arange(6001.0))
coils = [coil_of(seg) for _, seg in patterns]
for coil in coils:
    g = omega(coil, step)
    sign = np.sign(np.diff(g, prepend=0.0))[::-1]
    profiles.append(20.0 + np.r_[0.0, np.cumsum(sign * MAX)])
worst = np.zeros(len(coils))
for air in profiles:
    rate = rates(air)
    worst = np.maximum(worst, [np.abs(omega(coil, rate)).max() for coil in coils])
least = worst.min()
for (name, _), w in sorted(zip(patterns, worst), key=lambda p: p[1]):
    print(f"{w:10.5f} deg/h  {w / least:8.4f} of the best  {name}")
