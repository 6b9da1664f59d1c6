"""Formulas drawn and controls, diagnosed and judged on a third record of another kind.

    python trials.py PROGRAM CASES [--seed 88001] [--terms 200] [--controls 200] [--until HH:MM]

Rows are appended to CASES/trials.csv, what is answered also to stderr.

Needs numpy and scipy. Terms and controls take turns, a case is one line: a run that is broken off is a shorter one, and goes on where it
stopped. Each case is drawn from its own seed (SEED, kind, index). What is asked of the program:

    PROGRAM diagnose coil.toml calibration.csv --holdout validation.csv -o DIR
    PROGRAM compare MODEL test.csv      of the declared model, of DIR/proposed.toml (or extended.toml), and of the truth declared

`truth` is the coil's model with the listed effects and the formula that the simulator had, with their true numbers, fitted to nothing:
what it leaves of the third record is what there is to reach. A proposal predicts if it leaves no more than 1.15 times that.
"""
import argparse
import csv
import datetime
import itertools
import json
import os
import pathlib
import re
import resource
import shutil
import subprocess
import sys
import time
import tomllib

import numpy as np

import formulas
from cases import HEAT, OTHER
from laboratory import COLUMNS, drawn_chamber, record, write_record
from laboratory_cases import drawn_gyro, number, sized, with_effects
from score import SAME

GOOD, FAINT = 1.15, 0.15
FIELDS = ["kind", "index", "case", "form", "constants", "listed", "size_noises", "listed_noises", "coil", "pattern", "chamber", "test_chamber", "step_s", "rows",
          "resolution_k", "columns", "idle", "flicker", "gaps", "verdict", "named", "formula", "predicts", "only_describes", "leading", "leading_right", "probability", "truth_probability",
          "listed_right", "likeness", "z", "declared_fitted_rms", "declared_rms", "answer_rms", "truth_rms", "truth_fitted_rms", "noise_deg_per_h", "white_found", "hypothesis", "refitted",
          "cpu_s", "wall_s", "error"]
BESIDE = ["strain_mismatch", "sensor_lag", "bias_temperature", "spool_mass", "stress_gradient"]


def logger_of(rng, columns):
    step = float(rng.choice([25.0, 30.0]))
    resolution = float(rng.choice([0.001, 0.001, 0.005, 0.01]))
    return dict(step_s=step, rate_mean_s=step, resolution_k=resolution, noise_k=number(max(0.004, rng.uniform(0.2, 1.0) * resolution * 0.3)),
                gaps=bool(rng.random() < 0.2), columns=columns)


def chambers_of(rng):
    """Of the records that are fitted and held out, and of the third: one in ten is a thermostat's."""
    first = str(rng.choice(["controlled", "stage", "thermostat"], p=[0.6, 0.3, 0.1]))
    others = [c for c in ("controlled", "stage") if c != first]
    return first, "thermostat" if first != "thermostat" and rng.random() < 0.1 else str(rng.choice(others))


def drawn_case(seed, kind, index):
    """A case of the simulator, and how many noises large what is hidden is to be."""
    rng = np.random.default_rng([seed, 0 if kind == "term" else 1, index])
    chamber, other = chambers_of(rng)
    target = float(np.exp(rng.uniform(0.0, np.log(10.0))))
    idle = int(rng.integers(0, 5))
    if kind == "term":
        made = formulas.drawn(rng, formulas.FORMS[index % len(formulas.FORMS)])
        used = formulas.columns_of(made)
        kinds = [str(rng.choice(BESIDE))] if rng.random() < 0.3 else []
        share = float(rng.choice([0, 0, 0.2]))
    else:
        made, used, kinds = None, [], []
        share = float(rng.choice([0, 0.25, 0.5]))
        if index % 5 == 3:  # a fifth lacks a listed effect
            kinds = [str(rng.choice([k for k in list(HEAT) + list(OTHER) if k != "channel:supply_v"]))]
        if index % 5 == 4:  # a fifth tempts: four columns, and flicker
            idle, share = 4, 0.5
    free = [c for c in COLUMNS if c not in used]
    columns = sorted(used + [str(c) for c in rng.choice(free, min(idle, len(free)), replace=False)])
    logger = logger_of(rng, columns)
    case = with_effects(rng, f"{kind}-{index:03d}", chamber, kinds, logger=logger, test_chamber=other, gyro=drawn_gyro(rng, logger, flicker=share))
    if made:
        case.hidden["terms"] = [made]
    return case, target, len(columns) - len(used)


def write_case(folder, seed, kind, index):
    """Writes a case's model and three records; what was hidden."""
    case, target, idle = drawn_case(seed, kind, index)
    os.makedirs(folder, exist_ok=True)
    text = case.model_text()
    open(f"{folder}/coil.toml", "w").write(text)
    declared, base = tomllib.loads(text), 100 * (1000 * seed + 2 * index + (kind == "control"))
    sized(case, declared, base, target)
    quiet = dict(case.gyro, sigma=0.0, flicker=0.0)
    kept = {k: v for k, v in case.hidden.items() if k in ("film", "films")}
    rows = 0
    for n, part in enumerate(("calibration", "validation", "test")):
        chamber = drawn_chamber(case.rng, case.test_chamber) if part == "test" else case.chamber
        course = "calibration" if n == 0 else "validation"
        header, data, plain, beyond = record(declared, case.hidden, chamber, case.logger, case.gyro, course, base + n)
        write_record(f"{folder}/{part}.csv", header, data)
        if n == 0:
            rows, unlisted = len(data), beyond.std()
            listed = (plain - record(declared, kept, chamber, case.logger, quiet, course, base)[2]).std()
    sigma = case.gyro["sigma"]
    truth = dict(kind=kind, index=index, seed=seed, listed=case.answers, hidden=case.hidden, columns=case.logger["columns"], idle=idle, coil=case.coil,
                 pattern=case.pattern, chamber=case.chamber, test_chamber=case.test_chamber, logger=case.logger, gyro=case.gyro, noise_deg_per_h=sigma,
                 size_noises=number(unlisted / sigma), listed_noises=number(listed / sigma), rows=rows)
    json.dump(truth, open(f"{folder}/truth.json", "w"), indent=1)
    open(f"{folder}/truth.toml", "w").write(text + true_effects(truth))
    return truth


def true_effects(truth):
    """What was hidden, as tables of the model file; empty where a listed effect is no table of it."""
    tables = {}
    for key, value in truth["hidden"].items():
        if key in SAME:
            kind, name = SAME[key]
            tables.setdefault(kind, {})[name] = value
    text = "".join(f'\n[[effect]]\nkind = "{kind}"\n' + "".join(f"{k} = {v!r}\n" for k, v in values.items()) for kind, values in tables.items())
    return text + "".join(formulas.effect_table(t) for t in truth["hidden"].get("terms", []))


def command(program, arguments):
    """The answer of a command, with the processor time it took."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.time()
    done = subprocess.run([program, *arguments, "--format", "json", "--quiet"], capture_output=True, text=True, env=dict(os.environ, RAYON_NUM_THREADS="1"))
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    try:
        answer = json.loads(done.stdout)
    except ValueError:
        answer = {"error": f"exit {done.returncode}: {done.stderr.strip()[-300:]}"}
    return answer, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, time.time() - start


def left(program, model, records, out=None):
    """What a model leaves of records [deg/h], offsets fitted; nothing where the command fails."""
    answer, _, _ = command(program, ["compare", model, *records, *(["-o", out] if out else [])])
    return [r["rmse_deg_per_h"] for r in answer["records"]] if "records" in answer else [None] * len(records)


def kinds_of(members):
    """Listed effects of a set, without what was refitted or which layer."""
    return sorted(m if m.startswith("channel:") else m.split("(")[0].split(" ")[0] for m in members if not formulas.is_formula(m))


def wanted(truth):
    """The sets of listed effects that are right: what was hidden; without it too where that is less than FAINT of the white noise and not seen in the readings."""
    faint = truth["listed_noises"] < FAINT and not {"sensor_lag", "surface_film", "finite_pack"} & set(truth["listed"])
    return [sorted(truth["listed"])] + ([[]] if faint else [])


def is_true(truth, members):
    """Whether a set of listed effects and formulas is what was hidden; the formula's form may be of another temperature or rate."""
    said = [m for m in members if formulas.is_formula(m)]
    made = truth["hidden"].get("terms", [])
    return kinds_of(members) in wanted(truth) and len(said) == len(made) and all(formulas.likeness(t, f) != "other" for t, f in zip(made, said))


def z_scores(truth, answer):
    """(found - true)/error of each number of a formula of the right form and variables, and of listed effects that were hidden."""
    z = {}
    made, proposals = truth["hidden"].get("terms", []), answer.get("proposals") or []
    if made and proposals and len(proposals[0]["terms"]) == 1 and formulas.likeness(made[0], proposals[0]["formula"]) == "same":
        _, true = formulas.declared(made[0])
        for name, found in proposals[0]["terms"][0]["parameters"].items():
            if name in true and found["standard_error"]:
                z[name] = [round((found["value"] - true[name]) / found["standard_error"], 3), round(found["value"] / true[name] - 1.0, 4)]
    for key, (kind, name) in SAME.items():
        for effect in answer.get("effects") or []:
            found = effect["parameters"].get(name)
            if key in truth["hidden"] and effect["kind"] == kind and found and found["standard_error"]:
                z[f"{kind}.{name}"] = [round((found["value"] - truth["hidden"][key]) / found["standard_error"], 3), round(found["value"] / truth["hidden"][key] - 1.0, 4)]
    return z


def said(truth, answer):
    """What was drawn and what was answered, as a row's fields."""
    proposals, made = answer.get("proposals") or [], truth["hidden"].get("terms", [])
    posterior = answer.get("posterior") or []
    formula = proposals[0]["formula"] if proposals else ""
    named = ["/".join([e["kind"]] + e.get("equivalents", [])) for e in answer.get("effects") or []]
    leading = posterior[0]["effects"] if posterior else []
    noise = answer.get("noise") or []
    return dict(
        kind=truth["kind"], index=truth["index"], case=f"{truth['kind']}-{truth['index']:03d}", form=made[0]["form"] if made else "", constants=json.dumps({k: v for k, v in made[0].items() if k != "form"}) if made else "",
        listed="+".join(truth["listed"]), size_noises=truth["size_noises"], listed_noises=truth["listed_noises"], coil=truth["coil"], pattern=truth["pattern"],
        chamber=truth["chamber"]["kind"], test_chamber=truth["test_chamber"], step_s=truth["logger"]["step_s"], rows=truth["rows"], resolution_k=truth["logger"]["resolution_k"],
        columns=" ".join(truth["columns"]), idle=truth["idle"], flicker=round(truth["gyro"].get("flicker", 0.0) / truth["noise_deg_per_h"], 3), gaps=int(truth["logger"]["gaps"]),
        verdict=answer.get("verdict", "error"), named="+".join(named), formula=formula, predicts=int(proposals[0]["predicts"]) if proposals else "",
        only_describes=(proposals[0].get("only_describes") or "") if proposals else "", leading=" & ".join(leading), leading_right="wrong" if any((answer.get("hypothesis") or {}).values()) else judged(truth, leading),
        probability=round(posterior[0]["probability"], 5) if posterior else "",
        truth_probability=round(sum(p["probability"] for p in posterior if is_true(truth, [str(e) for e in p["effects"]])), 5),
        listed_right=listed(truth, [n.split("/") for n in named]),
        likeness=formulas.likeness(made[0], formula) if made and formula else "", z=json.dumps(z_scores(truth, answer)),
        noise_deg_per_h=round(truth["noise_deg_per_h"], 6), white_found=round(noise[0]["white_deg_per_h"], 6) if noise else "",
        hypothesis=re.sub(r'"[^"]*/', '"', json.dumps({k: v for k, v in (answer.get("hypothesis") or {}).items() if v})) if answer.get("hypothesis") else "",
        refitted=" ".join(f"{r['kind']}.{r['parameter']}" for r in answer.get("refitted") or []), error=answer.get("error", ""))


def listed(truth, named):
    """Whether the listed effects that are named are those that were hidden: `right`, `in a set` of equals, or `wrong`."""
    if not any(kinds_of(choice) in wanted(truth) for choice in itertools.product(*named)):
        return "wrong"
    return "in a set" if any(len(n) > 1 for n in named) else "right"


def judged(truth, members):
    """The leading set: `right`, right but for another temperature or rate (`alike`), `wrong`, or `none` where it only says that something is left."""
    if any("wander" in m for m in members):
        return "none"
    if not is_true(truth, members):
        return "wrong"
    formulas_said = [m for m in members if formulas.is_formula(m)]
    made = truth["hidden"].get("terms", [])
    return "right" if all(formulas.likeness(t, f) == "same" for t, f in zip(made, formulas_said)) else "alike"


def trial(program, root, seed, kind, index):
    """One case: drawn, diagnosed, judged; a row of FIELDS."""
    folder = f"{root}/{kind}-{index:03d}"
    truth = write_case(folder, seed, kind, index)
    shutil.rmtree(f"{folder}/out", ignore_errors=True)
    answer, cpu, wall = command(program, ["diagnose", f"{folder}/coil.toml", f"{folder}/calibration.csv", "--holdout", f"{folder}/validation.csv", "-o", f"{folder}/out"])
    json.dump(answer, open(f"{folder}/answer.json", "w"))
    proposals = answer.get("proposals") or []
    records = [f"{folder}/{part}.csv" for part in ("calibration", "validation", "test")]
    made = truth["hidden"].get("terms", [])
    row = {}
    if made or proposals or truth["listed"] or answer.get("effects"):
        models = [f"{folder}/out/{m}" for m in ("proposed.toml", "extended.toml") if os.path.exists(f"{folder}/out/{m}")]
        row["declared_fitted_rms"], _, row["declared_rms"] = left(program, f"{folder}/coil.toml", records, f"{folder}/declared")
        row["answer_rms"] = left(program, models[0], records[2:])[0] if models else row["declared_rms"]
        for made_of in ("report.html", "before-after-1.svg", "before-after-2.svg"):
            pathlib.Path(f"{folder}/out/{made_of}").unlink(missing_ok=True)
        if made or all(SAME.get(k) for k in truth["hidden"]):
            row["truth_fitted_rms"], row["truth_rms"] = left(program, f"{folder}/truth.toml", [records[0], records[2]])
    row |= said(truth, answer) | dict(cpu_s=round(cpu, 1), wall_s=round(wall, 1))
    return row


def again(cases, file):
    """Writes the rows anew from the answers that are kept; what commands took and left stays."""
    old = list(csv.DictReader(open(file)))
    with open(file, "w", newline="") as f:
        rows = csv.DictWriter(f, FIELDS)
        rows.writeheader()
        for row in old:
            truth, answer = (json.load(open(f"{cases}/{row['case']}/{name}.json")) for name in ("truth", "answer"))
            rows.writerow({k: v for k, v in row.items() if k in FIELDS} | said(truth, answer))


def instant(text):
    """The next HH:MM, UTC; never where nothing is said."""
    now = datetime.datetime.now(datetime.timezone.utc)
    if not text:
        return now + datetime.timedelta(days=1000)
    hour, minute = map(int, text.split(":"))
    end = now.replace(hour=hour, minute=minute, second=0)
    return end + datetime.timedelta(days=end < now)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("cases")
    parser.add_argument("--seed", type=int, default=88001)
    parser.add_argument("--terms", type=int, default=200)
    parser.add_argument("--controls", type=int, default=200)
    parser.add_argument("--until", help="begin no case after this time, UTC, HH:MM")
    parser.add_argument("--only", default="", help="names of cases, with commas between them")
    parser.add_argument("--again", action="store_true", help="judge the answers that are kept once more, and run nothing")
    given = parser.parse_args()
    os.makedirs(given.cases, exist_ok=True)
    file = f"{given.cases}/trials.csv"
    if given.again:
        return again(given.cases, file)
    done = {r["case"] for r in csv.DictReader(open(file))} if os.path.exists(file) else set()
    end = instant(given.until)
    with open(file, "a", newline="") as f:
        rows = csv.DictWriter(f, FIELDS)
        if not done:
            rows.writeheader()
        for index in range(max(given.terms, given.controls)):
            for kind, most in (("term", given.terms), ("control", given.controls)):
                name = f"{kind}-{index:03d}"
                if index >= most or name in done or (given.only and name not in given.only.split(",")):
                    continue
                if datetime.datetime.now(datetime.timezone.utc) >= end:
                    return
                row = trial(given.program, given.cases, given.seed, kind, index)
                rows.writerow(row)
                f.flush()
                ratio = f"{row['answer_rms'] / row['truth_rms']:.3f}" if row.get("answer_rms") and row.get("truth_rms") else ""
                print(row["case"], row["form"], row["listed"], row["size_noises"], "|", row["verdict"], row["named"], row["formula"], row["probability"], row["likeness"], ratio,
                      f"{row['cpu_s']} s", row["error"], file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
