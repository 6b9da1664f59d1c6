"""Compares the simulator with published calibration records: `python verify.py RECORDS_DIR` (folders and truth.json)."""
import csv, json, sys, tomllib
import numpy as np
from simulator import calibration_air, simulate

root = sys.argv[1]
for name, truth in json.load(open(f"{root}/truth.json")).items():
    declared = tomllib.load(open(f"{root}/{name}/coil.toml", "rb"))
    rows = np.array(list(csv.reader(open(f"{root}/{name}/calibration.csv")))[1:], float)
    _, mine, clean = simulate(declared, truth["hidden"], calibration_air()[: int(rows[-1, 0]) + 1], 1, 0.0, 0.0, temperature_sigma=0.0)
    error = rows[:, 2] - clean[: len(rows)]
    error = error - error.mean()
    temperature = rows[:, 1] - mine[: len(rows), 1]
    sigma = truth["noise_sigma_deg_per_h"]
    print(f"{name}: rate rms/noise {error.std() / sigma:.4f} (chance ±{1/np.sqrt(2*len(rows)):.3f}), lag-1 correlation "
          f"{np.corrcoef(error[1:], error[:-1])[0, 1]:+.3f}, temperature rms {temperature.std() * 1e3:.3f} mK, mean {temperature.mean()*1e3:+.3f} mK")
