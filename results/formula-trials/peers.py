"""What a user could take instead, on the same records: `python peers.py CASES [--follow] [--until HH:MM] [--only ridge,boosting]`; rows go to CASES/peers.csv.

Needs numpy, scikit-learn, pysindy and gplearn. For each case with a term that trials.py has done: what the declared model leaves of the
fitted record (`compare`) is learned, what it leaves of the held-out record chooses the strength of regularisation, both together are
learned again, and what is left of the third record is judged by what the true model leaves of it, as the program is.

ridge     ridge regression over lagged features: temperature, its rate and all columns at 0 ... 64 rows before
boosting  gradient boosting over the same
pysindy   sequentially thresholded least squares (STLSQ) over cubic polynomials of temperature, its rate, two lags of it, and all columns
gplearn   genetic programming over the same variables with +, -, *, abs, max, tanh
"""
import argparse
import csv
import datetime
import os
import sys
import time
import warnings

import numpy as np

from trials import instant

PEERS = ["ridge", "boosting", "pysindy", "gplearn"]
BACK = [0, 1, 2, 4, 8, 16, 32, 64]
RECORDS = ["calibration", "validation", "test"]


def lag(x, times, tau):
    out = np.empty_like(x)
    out[0] = x[0]
    for i in range(1, len(x)):
        keep = np.exp(-(times[i] - times[i - 1]) / tau)
        out[i] = keep * out[i - 1] + (1 - keep) * 0.5 * (x[i] + x[i - 1])
    return out


def load(folder):
    """For each record: variables at its rows, and what the declared model leaves of it."""
    out = []
    for place, name in enumerate(RECORDS, 1):
        raw = np.genfromtxt(f"{folder}/{name}.csv", delimiter=",", names=True)
        left = np.genfromtxt(f"{folder}/declared/record-{place}.csv", delimiter=",", names=True, usecols=range(6))
        row = np.searchsorted(raw["time_s"], left["time_s"])
        times, temperature = left["time_s"], left["temperature_c"] - 20.0
        v = {"T": temperature, "dT_dt": left["temperature_rate_c_per_min"]}
        v |= {c: raw[c][row] for c in raw.dtype.names[3:]}
        y = left["residual_deg_per_h"]
        out.append((times, v, y - np.nanmean(y)))
    return out


def lagged(times, v):
    return np.column_stack([np.r_[np.full(b, x[0]), x[:len(x) - b]] for x in v.values() for b in BACK])


def static(times, v):
    return np.column_stack(list(v.values()) + [lag(v["T"], times, tau) for tau in (300.0, 1500.0)])


def standardised(parts):
    middle, spread = parts[0].mean(0), parts[0].std(0)
    return [(p - middle) / np.where(spread > 0, spread, 1.0) for p in parts]


def off(y, said):
    """What is left, offset taken off."""
    rest = y - said
    return float(np.sqrt(np.mean((rest - rest.mean()) ** 2)))


def chosen(make, x, y):
    """The strength that does best on the held-out record, then learned from both."""
    scores = []
    for strength in make.strengths:
        try:
            scores.append((off(y[1], make(strength, x[0], y[0])(x[1])), strength))
        except Exception as failure:  # a peer's own failure is its answer
            print(f"  {make.__name__} {strength}: {failure}", file=sys.stderr)
    return make(min(scores)[1], np.vstack(x[:2]), np.concatenate(y[:2]))


def ridge(alpha, x, y):
    from sklearn.linear_model import Ridge
    return Ridge(alpha=alpha).fit(x, y).predict


def boosting(rounds, x, y):
    from sklearn.ensemble import HistGradientBoostingRegressor
    return HistGradientBoostingRegressor(max_iter=rounds, learning_rate=0.08, max_leaf_nodes=15, early_stopping=False, random_state=1).fit(x, y).predict


def pysindy(threshold, x, y):
    import pysindy as ps
    library = ps.PolynomialLibrary(degree=3)
    theta = np.asarray(library.fit_transform(x))
    scale = np.maximum(np.abs(theta).std(0), 1e-9)
    scale[theta.std(0) == 0] = 1.0
    optimiser = ps.STLSQ(threshold=threshold * y.std(), alpha=0.05)
    optimiser.fit(theta / scale, y[:, None])
    weights = np.ravel(optimiser.coef_)
    return lambda new: (np.asarray(library.transform(new)) / scale) @ weights


def gplearn(parsimony, x, y):
    from gplearn.functions import make_function
    from gplearn.genetic import SymbolicRegressor
    tanh = make_function(function=np.tanh, name="tanh", arity=1)
    said = SymbolicRegressor(population_size=800, generations=15, function_set=("add", "sub", "mul", "abs", "max", tanh), metric="mse", parsimony_coefficient=parsimony,
                             const_range=(-3.0, 3.0), random_state=1).fit(x, y / y.std())
    return lambda new: said.predict(new) * y.std()


ridge.strengths, boosting.strengths, pysindy.strengths, gplearn.strengths = [1.0, 10.0, 100.0, 1000.0], [20, 60, 200], [0.03, 0.1, 0.3], [0.002]


def judged(folder, row, peers):
    records = load(folder)
    y = [r[2] for r in records]
    good = [np.isfinite(v) for v in y]
    out = {}
    for peer in peers:
        start = time.process_time()
        features = lagged if peer in ("ridge", "boosting") else static
        x = standardised([features(t, v)[g] for (t, v, _), g in zip(records, good)])
        said = chosen(globals()[peer], x, [v[g] for v, g in zip(y, good)])
        out[f"{peer}_rms"] = round(off(y[2][good[2]], said(x[2])), 6)
        out[f"{peer}_s"] = round(time.process_time() - start, 2)
    return out


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases")
    parser.add_argument("--follow", action="store_true", help="wait for cases that are still to be done")
    parser.add_argument("--until", help="begin no case after this time, UTC, HH:MM")
    parser.add_argument("--only", default=",".join(PEERS))
    given = parser.parse_args()
    warnings.filterwarnings("ignore")
    peers, end = given.only.split(","), instant(given.until)
    file, fields = f"{given.cases}/peers.csv", ["case", "form", "truth_rms"] + [f"{p}_{k}" for p in PEERS for k in ("rms", "s")]
    done = {r["case"] for r in csv.DictReader(open(file))} if os.path.exists(file) else set()
    with open(file, "a", newline="") as f:
        rows = csv.DictWriter(f, fields)
        if not done:
            rows.writeheader()
        while True:
            todo = [r for r in csv.DictReader(open(f"{given.cases}/trials.csv")) if r["kind"] == "term" and r["case"] not in done and r["truth_rms"]]
            for row in todo:
                if datetime.datetime.now(datetime.timezone.utc) >= end:
                    return
                said = dict(case=row["case"], form=row["form"], truth_rms=row["truth_rms"]) | judged(f"{given.cases}/{row['case']}", row, peers)
                rows.writerow(said)
                f.flush()
                done.add(row["case"])
                print(said, file=sys.stderr, flush=True)
            if not todo:
                if not given.follow or datetime.datetime.now(datetime.timezone.utc) >= end:
                    return
                time.sleep(20)


if __name__ == "__main__":
    main()
