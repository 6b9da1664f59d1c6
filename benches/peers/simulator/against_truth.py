"""Would anybody have found it? `python against_truth.py CASES_DIR BINARY OUT_DIR` compares, for the cases of OUT_DIR that were
not answered rightly, the answer's χ² with that of the truth, declared at its true size and fitted to nothing but the offset.

Where the truth explains the records no better than the answer, these records do not hold what would tell them apart.
"""
import json, os, subprocess, sys, tempfile

from score import SAME, judge

# Choices and parameters that score.py has no need of.
CHOICES = {"flange": ("axial_gradient", "flange"), "lead": ("midpoint_offset", "lead")}
FURTHER = {
    "glass_transition": ("glass_transition", "transition_c"), "glass_width": ("glass_transition", "width_k"),
}
NOT_EQUIVALENT_BY = 12.0


def declared(folder, truth):
    """The coil's model file with what was hidden; None where a hidden thing is no table of the model's."""
    tables = {}
    for key, value in truth["hidden"].items():
        kind, name = SAME.get(key) or FURTHER.get(key) or CHOICES.get(key) or (None, None)
        if kind is None:
            return None
        tables.setdefault(kind, {})[name] = value
    for channel, gain in (truth.get("gains") or {}).items():
        tables[f"channel:{channel}"] = {"gain_deg_per_h_per_unit": gain}
    if set(tables) != set(truth["answers"]):
        return None
    text = open(f"{folder}/coil.toml").read()
    for kind, values in tables.items():
        rows = [f"{name} = {json.dumps(value)}" for name, value in values.items()]
        text += f'\n[[effect]]\nkind = "{kind}"\n' + "\n".join(rows) + "\n"
    return text


def chi_squares(answer, rung, rows, parameters):
    """Of the fitted records and of those held out."""
    of = answer["ladder"][rung]
    return of["reduced_chi_square"] * (rows[0] - parameters - 1), of["holdout_reduced_chi_square"] * (rows[1] - 1)


def main():
    cases, binary, out = sys.argv[1:4]
    truths = json.load(open(f"{cases}/truth.json"))
    print("| case | hidden | judged | χ² of the answer less that of the truth: fitted | held out | |\n|---|---|---|---|---|---|")
    for answer in map(json.loads, open(f"{out}/answers.jsonl")):
        name = answer["case"]
        truth = truths[name]
        word = judge(truth, answer)[0]
        if word.startswith("right") or not answer["ladder"]:
            continue
        folder = f"{cases}/{name}"
        text = declared(folder, truth)
        said = "the truth is no table of the model's"
        apart = ["", ""]
        if text is not None:
            with tempfile.TemporaryDirectory() as scratch:
                open(f"{scratch}/coil.toml", "w").write(text)
                command = [binary, "diagnose", f"{scratch}/coil.toml", f"{folder}/calibration.csv", "--holdout", f"{folder}/validation.csv", "--format", "json", "--quiet"]
                done = subprocess.run(command, capture_output=True, text=True)
            if done.returncode != 0:
                sys.exit(f"{name}: {done.stderr}")
            rows = [sum(1 for line in open(f"{folder}/{r}.csv") if line[:1].isdigit()) for r in ("calibration", "validation")]
            parameters = sum(sum(1 for p in e["parameters"].values() if p["standard_error"]) for e in answer["effects"])
            own = chi_squares(answer, -1, rows, parameters)
            true = chi_squares(json.loads(done.stdout), 0, rows, 0)
            apart = [f"{a - b:+.1f}" for a, b in zip(own, true)]
            told = sum(own) - sum(true) > NOT_EQUIVALENT_BY
            said = "could be told" if told else "the truth explains no more"
        print(f"| {name} | {' + '.join(truth['answers'])} | {word} | {apart[0]} | {apart[1]} | {said} |", flush=True)


if __name__ == "__main__":
    main()
