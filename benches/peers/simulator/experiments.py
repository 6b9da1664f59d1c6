"""Carries out the experiments that `BINARY diagnose --experiment` proposes: `python experiments.py CASES_DIR BINARY OUT_DIR SEEDS CASE...`.

For each case: the profile is written from the records at hand; the truth is simulated SEEDS times with the profile as the
chamber's air; each record is diagnosed alone, the first two also together with the records at hand. The table compares by
how much χ² the rivals were expected to be refused with what was found. Answers are kept in OUT_DIR/CASE.json; cases that are there are not
run again.
"""
import json, os, subprocess, sys
import numpy as np
from cases import CASES
from simulator import simulate, write_record

TOGETHER = 2
QUIET = ["--format", "json", "--quiet"]


def diagnose(binary, *arguments):
    done = subprocess.run(["nice", "-n", "15", binary, "diagnose", *arguments, *QUIET], capture_output=True, text=True)
    if not done.stdout:
        raise RuntimeError(done.stderr[-300:])
    return json.loads(done.stdout)


def air_of(experiment):
    """The chamber's temperature at every second."""
    time, value, knots, values = 0.0, 20.0, [0.0], [20.0]
    for piece in experiment["pieces"]:
        time += piece["duration_s"]
        value += piece["rate_c_per_h"] * piece["duration_s"] / 3600.0
        knots.append(time)
        values.append(value)
    return np.interp(np.arange(int(time) + 1.0), knots, values)


def with_others(source, answer):
    """The declared model with the effects that are not in question, as fitted."""
    open_one = next((e for e in answer["effects"] if e["equivalents"]), answer["effects"][0])
    for effect in answer["effects"]:
        if effect is not open_one:
            source += f'\n[[effect]]\nkind = "{effect["kind"]}"\n'
            source += "".join(f"{key} = {p['value']!r}\n" for key, p in effect["parameters"].items())
            source += "".join(f'{key} = "{word}"\n' for key, word in effect["choices"].items())
    return source


def carry_out(case, cases_dir, binary, out, seeds):
    folder = f"{cases_dir}/{case['name']}"
    truth = json.load(open(f"{cases_dir}/truth.json"))[case["name"]]
    records = [f"{folder}/calibration.csv", "--holdout", f"{folder}/validation.csv"]
    first = diagnose(binary, f"{folder}/coil.toml", *records, "--experiment", f"{out}/{case['name']}.toml")
    experiment = first.get("experiment")
    if not experiment:
        return dict(case=case["name"], verdict=first["verdict"], experiment=None)
    import tomllib
    source = open(f"{folder}/coil.toml").read()
    declared, air = tomllib.loads(source), air_of(experiment)
    coil, record = f"{out}/{case['name']}.coil.toml", f"{out}/{case['name']}.csv"
    open(coil, "w").write(with_others(source, first))
    kinds = sorted({d[k] for s in experiment["separations"] for d in s["directions"] for k in ("truth", "refused")} - {"the declared model"})
    runs = []
    for seed in range(seeds):
        # The logger's stamps do not fall on the profile's kinks.
        later = np.r_[np.full(1 + 2 * (seed % 5), air[0]), air]
        header, rows, _ = simulate(declared, case["hidden"], later, 7000 + seed, truth["noise_sigma_deg_per_h"], truth["offset_deg_per_h"], case["channels"])
        write_record(record, header, rows)
        alone = diagnose(binary, coil, record)
        less = {c["kind"]: c["chi_square_less"] for c in alone["candidates"]}
        both = diagnose(binary, f"{folder}/coil.toml", records[0], record, *records[1:]) if seed < TOGETHER else None
        runs.append(dict(
            seed=seed, less={k: less.get(k) for k in kinds}, verdict_alone=alone["verdict"],
            alone=[[e["kind"]] + e["equivalents"] for e in alone["effects"]],
            together=both and [[e["kind"]] + e["equivalents"] for e in both["effects"]]))
        print(case["name"], runs[-1], flush=True)
    return dict(case=case["name"], answers=case["answers"], verdict=first["verdict"], experiment=experiment, rows=len(air) // 10, runs=runs,
                named=[[e["kind"]] + e["equivalents"] for e in first["effects"]])


def table(answers):
    rows = ["| case | truth | rival | expected χ² | chance ± | found, run by run | mean found | told apart? expected (needed) | answer with the records |"]
    rows.append("|---" * 9 + "|")
    for a in answers:
        if not a["experiment"]:
            continue
        directions = [d for s in a["experiment"]["separations"] for d in s["directions"]]
        said = [(d, next(s for s in a["experiment"]["separations"] if d in s["directions"])) for d in directions]
        for d, s in said:
            if d["truth"] not in a["answers"] and d["refused"] != "the declared model":
                continue
            # A rival that was not worth a fit is listed with 0.
            of = lambda r, kind: 0.0 if kind == "the declared model" else r["less"][kind] if abs(r["less"][kind] or 0.0) > 1e-3 else float("nan")
            found = [of(r, d["truth"]) - of(r, d["refused"]) for r in a["runs"]]
            found = [f for f in found if f == f]
            expected = d["expected_chi_square_alone"]
            answer = "; ".join(", ".join("/".join(k) for k in r["together"]) for r in a["runs"] if r["together"])
            rows.append(f"| `{a['case']}` | {d['truth']} | {d['refused']} | {expected:.1f} | {2 * max(expected, 0.0) ** 0.5:.1f} | {', '.join(f'{f:.1f}' for f in found)} | {np.mean(found):.1f} ± {np.std(found, ddof=1) / len(found) ** 0.5 if len(found) > 1 else 0.0:.1f} | {s['told_apart']}, {d['chance']:.2f} ({d['needed_chi_square_with_records']:.0f}) | {answer} |")
    return "\n".join(rows) + "\n"


def main():
    cases_dir, binary, out, seeds, wanted = sys.argv[1], sys.argv[2], sys.argv[3], int(sys.argv[4]), sys.argv[5:]
    os.makedirs(out, exist_ok=True)
    by_name = {c["name"]: c for c in CASES}
    for name in wanted:
        file = f"{out}/{name}.json"
        if not os.path.exists(file):
            json.dump(carry_out(by_name[name], cases_dir, binary, out, seeds), open(file, "w"), indent=1)
    answers = [json.load(open(f"{out}/{name}.json")) for name in wanted]
    open(f"{out}/table.md", "w").write(table(answers))
    print(table(answers))


if __name__ == "__main__":
    main()
