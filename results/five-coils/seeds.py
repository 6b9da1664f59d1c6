"""The recommended pattern against the best classic on profiles that no search saw: 20 profile seeds on five coils.

    python seeds.py COILWRIGHT c12,c16,c24,c32,c48 20 OUT.jsonl

Each model's profiles are drawn with seeds 1 to N. Both patterns are judged on 2 048 profiles of seed 987654321 (the program's own unseen ones have
other seeds) and by the guaranteed rate.
"""
import json
import os
import subprocess
import sys
import tempfile

from coils import C, model

UNSEEN_SEED, UNSEEN = 987654321, 2048
CLASSICS = {"zyl", "sym", "sym-text", "dip", "qua", "oct", "hex"}


def asked(program, *arguments):
    ran = subprocess.run([program, *arguments, "--format", "json", "--quiet"], capture_output=True, text=True)
    if ran.returncode not in (0, 1):
        sys.exit(f"{arguments}: {ran.stderr[-1500:]}")
    return json.loads(ran.stdout)


def judged(program, path, patterns):
    named = [argument for pattern in patterns for argument in ("--pattern", pattern)]
    return {row["name"]: row for row in asked(program, "evaluate", path, *named)["patterns"]}


def main():
    program, names, count, out = sys.argv[1:]
    folder = tempfile.mkdtemp()
    for name in names.split(","):
        unseen = os.path.join(folder, f"{name}-unseen.toml")
        model(name, UNSEEN_SEED, unseen)
        text = open(unseen).read().replace("count = 64", f"count = {UNSEEN}")
        open(unseen, "w").write(text)
        classics = {k: v for k, v in judged(program, unseen, []).items() if v["windability"]["class"] == "standard"}
        best = min(classics.values(), key=lambda row: row["worst_rate_deg_per_h"])
        for seed in range(1, int(count) + 1):
            path = os.path.join(folder, f"{name}-{seed}.toml")
            model(name, seed, path)
            answer = asked(program, "optimise", path)
            recommended = answer["recommendation"]
            pattern = os.path.join(folder, "recommended.toml")
            layers = len(recommended["segments"])
            segments = ", ".join(str(s) for s in recommended["segments"])
            open(pattern, "w").write(f'name = "recommended"\nlayers = {layers}\nsegments = [{segments}]\n')
            row = judged(program, unseen, [pattern])["recommended"]
            searched = min(answer["baselines"] + [answer["best"]], key=lambda b: b["worst_rate_deg_per_h"])["name"]
            line = dict(
                coil=name, seed=seed, recommended=recommended["pattern"], best_on_searched=searched, best_classic=best["name"],
                unseen_deg_per_h=row["worst_rate_deg_per_h"], classic_unseen_deg_per_h=best["worst_rate_deg_per_h"],
                guaranteed_deg_per_h=row["guaranteed_worst_rate_deg_per_h"],
                classic_guaranteed_deg_per_h=best["guaranteed_worst_rate_deg_per_h"],
                is_classic=recommended["pattern"] in CLASSICS,
            )
            line["over_classic"] = line["unseen_deg_per_h"] / line["classic_unseen_deg_per_h"] - 1
            with open(out, "a") as file:
                file.write(json.dumps(line) + "\n")


if __name__ == "__main__":
    main()
