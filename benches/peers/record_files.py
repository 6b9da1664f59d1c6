"""Writes tests/data/record-files: one record as CSV, and as other programs keep it (scipy, h5py, pyarrow).

    python benches/peers/record_files.py

Needs numpy, scipy, h5py and pyarrow. The numbers are the same in every file.
"""

import csv
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from scipy.io import savemat

folder = Path(__file__).parents[2] / "tests" / "data" / "record-files"
folder.mkdir(parents=True, exist_ok=True)

random = np.random.default_rng(17)
rows = 120
time_s = 10.0 * np.arange(rows)
temperature_c = np.round(20 + 15 * np.sin(2 * np.pi * np.arange(rows) / 70) + 0.01 * random.standard_normal(rows), 3)
rate_deg_per_h = np.round(0.4 * np.cos(2 * np.pi * np.arange(rows) / 70) + 0.05 * random.standard_normal(rows), 5)
supply_mv = (5000 + random.integers(-20, 20, rows)).astype(np.int32)
columns = {"time_s": time_s, "temperature_c": temperature_c, "rate_deg_per_h": rate_deg_per_h, "supply_mv": supply_mv}

with open(folder / "plain.csv", "w", newline="") as out:
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*(column.tolist() for column in columns.values())))

# Vectors lie, as MATLAB's do that come of a:b; one stands. The rest is what a workspace holds besides.
lying = {name: column[np.newaxis, :] for name, column in columns.items()}
lying["rate_deg_per_h"] = rate_deg_per_h[:, np.newaxis]
besides = {"fs": 0.1, "note": "chamber 3", "gains": np.eye(3), "parts": np.array([[1, "x"]], dtype=object)}
savemat(folder / "packed.mat", {**lying, **besides}, do_compression=True)
# In a structure, and not packed; the temperature in hundredths, as sixteen bits.
inner = {**lying, "temperature_c": temperature_c[np.newaxis, :].astype(np.float64)}
savemat(folder / "structure.mat", {"log": inner, "fs": 0.1}, do_compression=False)


def seven_three(path):
    """What `save -v7.3` writes: an HDF5 file behind a head of 512 bytes, arrays transposed, classes as attributes."""
    with h5py.File(path, "w", userblock_size=512) as file:
        log = file.create_group("log")
        log.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, column in columns.items():
            stored = log.create_dataset(name, data=column[:, np.newaxis], chunks=(50, 1), compression="gzip", shuffle=True)
            stored.attrs["MATLAB_class"] = np.bytes_("int32" if column.dtype == np.int32 else "double")
        text = file.create_dataset("note", data=np.array([[ord(c)] for c in "chamber 3"], dtype=np.uint16))
        text.attrs["MATLAB_class"] = np.bytes_("char")
        file.create_group("#refs#").create_dataset("a", data=np.zeros((1, rows)))
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Mon Mar 02 10:00:00 2026 HDF5 schema 1.00 ."
    with open(path, "r+b") as file:
        file.write(head.ljust(116) + bytes(8) + b"\x00\x02IM")


seven_three(folder / "seven-three.mat")

with h5py.File(folder / "compound.h5", "w") as file:
    kinds = [("time_s", "f8"), ("temperature_c", "f8"), ("rate_deg_per_h", ">f8"), ("supply_mv", "i4"), ("ok", "?")]
    table = np.zeros(rows, dtype=kinds)
    for name, column in columns.items():
        table[name] = column
    table["ok"] = True
    file.create_dataset("run/log", data=table, chunks=(64,), compression="gzip")

table = pa.table({**columns, "operator": ["K. M."] * rows})
pq.write_table(table, folder / "snappy.parquet", row_group_size=50)
stamps = pa.array((1_772_445_600_000 + 1000 * time_s).astype(np.int64), pa.timestamp("ms", tz="UTC"))
pq.write_table(
    pa.table({"stamp": stamps, "temperature_c": temperature_c, "rate_deg_per_h": rate_deg_per_h, "supply_mv": supply_mv}),
    folder / "stamps.parquet",
    compression="zstd",
)
# Two cells without a value, in which a sensor failed.
broken = [None if i in (7, 60) else float(v) for i, v in enumerate(temperature_c)]
pq.write_table(pa.table({**columns, "temperature_c": broken}), folder / "gaps.parquet", compression="gzip")
