"""What trials.csv comes to: python summary.py trials.csv [more.csv …]"""

import csv
import math
import sys
from collections import defaultdict

NAMES = ["white", "flicker", "rate_random_walk", "quantisation", "ramp"]
rows = [row for path in sys.argv[1:] for row in csv.DictReader(open(path))]


def holds(row, name):
    true, low, high = (float(row[f"{name}_{end}"]) for end in ("true", "low", "high"))
    # Six printed digits.
    return low * (1 - 1e-5) <= true <= high * (1 + 1e-5)


def share(group, test):
    n, hits = len(group), sum(map(test, group))
    return f"{hits}/{n} ({100 * hits / n:.1f} %)"


def table(key, title):
    groups = defaultdict(list)
    for row in rows:
        groups[key(row)].append(row)
    print(f"\n| {title} | records | all five | " + " | ".join(NAMES) + " |")
    print("|---|---|---|" + "---|" * len(NAMES))
    for name, group in groups.items():
        each = [share(group, lambda row, n=n: holds(row, n)) for n in NAMES]
        print(f"| {name} | {len(group)} | {share(group, lambda row: all(holds(row, n) for n in NAMES))} | " + " | ".join(e.split("(")[1][:-1] for e in each) + " |")


table(lambda row: row["kind"], "kind")
table(lambda row: row["rows"] + " rows", "length")
table(lambda row: row["kind"] + ", " + row["rows"] + " rows", "kind and length")
table(lambda row: "with cycles" if row["cycles"] == "1" else "without", "thermal cycles")
table(lambda row: "all", "all")

print("\n| kind | rows | strength | true | here: mean, sd | Whittle: mean, sd | records |\n|---|---|---|---|---|---|---|")
groups = defaultdict(list)
for row in rows:
    if row["white_whittle"]:
        groups[row["kind"], row["rows"]].append(row)
for (kind, length), group in groups.items():
    for name in NAMES[:4]:
        true = float(group[0][f"{name}_true"])
        if true == 0.0:
            continue
        cells = []
        for column in (f"{name}_value", f"{name}_whittle"):
            values = [float(row[column]) for row in group]
            mean = sum(values) / len(values)
            sd = math.sqrt(sum((v - mean) ** 2 for v in values) / max(1, len(values) - 1))
            cells.append(f"{mean:.4g}, {sd:.2g}")
        print(f"| {kind} | {length} | {name} | {true:.4g} | {cells[0]} | {cells[1]} | {len(group)} |")

off = [float(row["allan_off_allantools"]) for row in rows if row["allan_off_allantools"]]
if off:
    print(f"\nAllan deviations against allantools: {len(off)} records, largest relative difference {max(off):.1e}.")
