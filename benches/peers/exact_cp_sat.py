#!/usr/bin/env python3
"""The best permutation over given samples, by OR-Tools CP-SAT.

Usage: exact_cp_sat.py SAMPLES.csv [SECONDS]     pip install ortools

SAMPLES.csv comes from `coilwright exact MODEL --windability any --samples SAMPLES.csv`: one sample a line, a constant and
one coefficient a layer in degrees per hour, so that the rate error is constant + sum_j a_j (2 P(j) - 1 - N). Minimised is the
largest size over all samples. Coefficients are rounded to a millionth of the largest, which CP-SAT needs; the value printed is
computed from the unrounded ones. Two workers. Where no sample has a constant, mirror images are cut as in coilwright.
"""

import csv
import sys
import time

import ortools
from ortools.sat.python import cp_model


def main():
    with open(sys.argv[1]) as file:
        rows = [[float(v) for v in row] for row in list(csv.reader(file))[1:]]
    seconds = float(sys.argv[2]) if len(sys.argv) > 2 else 600.0
    layers = len(rows[0]) - 1
    scale = 1e6 / max(abs(v) for row in rows for v in row[1:])
    model = cp_model.CpModel()
    place = [model.new_int_var(1, layers, f"p{j}") for j in range(layers)]
    model.add_all_different(place)
    if all(row[0] == 0.0 for row in rows):
        model.add(place[-1] <= layers // 2)
    bound = int(sum(abs(v) for v in rows[0]) * scale * layers) + 1
    bound = max(bound, max(int(sum(abs(v) for v in row) * scale * layers) for row in rows) + 1)
    worst = model.new_int_var(0, bound, "worst")
    for constant, *coefficients in rows:
        terms = [round(a * scale) for a in coefficients]
        rate = round(constant * scale) + sum(a * (2 * p - 1 - layers) for a, p in zip(terms, place))
        model.add(rate <= worst)
        model.add(rate >= -worst)
    model.minimize(worst)
    solver = cp_model.CpSolver()
    solver.parameters.num_workers = 2
    solver.parameters.max_time_in_seconds = seconds
    started = time.perf_counter()
    status = solver.solve(model)
    took = time.perf_counter() - started
    found = [solver.value(p) for p in place]
    exact = max(abs(c + sum(a * (2 * p - 1 - layers) for a, p in zip(cs, found))) for c, *cs in rows)
    print(f"CP-SAT {ortools.__version__}: {solver.status_name(status)}, N = {layers}, {len(rows)} samples, {took:.2f} s")
    print(f"worst {exact:.6f} deg/h, lower bound {solver.best_objective_bound / scale:.6f} deg/h, {found}")


main()
