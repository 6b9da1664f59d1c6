#!/usr/bin/env python3
"""The best permutation over given samples, by HiGHS as a mixed-integer linear program.

Usage: exact_highs.py SAMPLES.csv [SECONDS]     pip install highspy scipy

The same file and objective as exact_cp_sat.py: binaries x[j, p] of an assignment, a continuous worst case above every sample's
size. Mirror images are cut in the same way.
"""

import csv
import sys
import time

import highspy
import numpy as np


def main():
    with open(sys.argv[1]) as file:
        rows = [[float(v) for v in row] for row in list(csv.reader(file))[1:]]
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 600.0
    layers = len(rows[0]) - 1
    solver = highspy.Highs()
    solver.setOptionValue("output_flag", False)
    solver.setOptionValue("time_limit", seconds)
    solver.setOptionValue("threads", 2)
    solver.setOptionValue("mip_rel_gap", 1e-6)
    mirrored = all(row[0] == 0.0 for row in rows)
    place = np.array([[solver.addBinary() for _ in range(layers)] for _ in range(layers)])
    worst = solver.addVariable(lb=0.0)
    for k in range(layers):
        solver.addConstr(sum(place[k, p] for p in range(layers)) == 1)
        solver.addConstr(sum(place[j, k] for j in range(layers)) == 1)
    if mirrored:
        solver.addConstr(sum(place[layers - 1, p] for p in range(layers // 2)) == 1)
    for constant, *coefficients in rows:
        rate = sum(
            coefficients[j] * (2 * p + 1 - layers) * place[j, p] for j in range(layers) for p in range(layers)
        )
        solver.addConstr(rate - worst <= -constant)
        solver.addConstr(rate + worst >= -constant)
    started = time.perf_counter()
    solver.minimize(worst)
    took = time.perf_counter() - started
    values = np.array([[solver.val(place[j, p]) for p in range(layers)] for j in range(layers)])
    found = [int(np.argmax(values[j])) + 1 for j in range(layers)]
    exact = max(abs(c + sum(a * (2 * p - 1 - layers) for a, p in zip(cs, found))) for c, *cs in rows)
    status = solver.modelStatusToString(solver.getModelStatus())
    print(f"HiGHS {solver.version()}: {status}, N = {layers}, {len(rows)} samples, {took:.2f} s")
    print(f"worst {exact:.6f} deg/h, lower bound {solver.getInfo().mip_dual_bound:.6f} deg/h, {found}")


main()
