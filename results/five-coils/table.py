"""How far each search of grid.py is above the best that any search of its coil knows: of its class or a narrower one, under any objective.

    python table.py OUT.jsonl

The rms is known only of searches for it (as QUA's over the pattern's), P95 only of those for P95; the other three of every pattern found.
"""
import json
import sys
from collections import defaultdict

CLASSES = ["standard", "captive:1", "any"]
KEYS = {
    "worst-rate": "worst_rate_deg_per_h",
    "guaranteed-rate": "guaranteed_worst_rate_deg_per_h",
    "pointing": "worst_pointing_error_deg",
    "p95": "p95_rate_deg_per_h",
}


def value(row, objective):
    if objective == "rms":
        return 1.0 / row["gain"] if row["obj"] == "rms" else None
    found = row.get(KEYS[objective])
    return None if found is None else abs(found)


def main():
    rows = [json.loads(line) for path in sys.argv[1:] for line in open(path)]
    best = defaultdict(lambda: float("inf"))
    for row in rows:
        for objective in [*KEYS, "rms"]:
            found = value(row, objective)
            for windability in CLASSES[CLASSES.index(row["cls"]) :] if found is not None else []:
                key = (row["coil"], windability, objective)
                best[key] = min(best[key], found)
    cells = defaultdict(list)
    for row in rows:
        key = (row["coil"], row["cls"], row["obj"])
        cells[key].append((value(row, row["obj"]) / best[key] - 1.0, row["cpu"], row["by"]))
    print("| coil | class | objective | seeds | best known | largest excess | processor time, s | found by |")
    print("|---|---|---|---|---|---|---|---|")
    for key, found in cells.items():
        shown = f"{best[key]:.5g}" + (" of QUA's" if key[2] == "rms" else "")
        by = ", ".join(sorted({by for _, _, by in found}))
        excess, cpu_s = max(e for e, _, _ in found), max(s for _, s, _ in found)
        print(f"| {' | '.join(key)} | {len(found)} | {shown} | {100 * excess:.4f} % | {cpu_s:.1f} | {by} |")
    print(f"\n{len(rows)} searches, at most {100 * max(e for found in cells.values() for e, _, _ in found):.4f} % above the best known.")


if __name__ == "__main__":
    main()
