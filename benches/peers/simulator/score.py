"""Runs `BINARY diagnose` over trial cases and scores it: `python score.py CASES_DIR BINARY OUT_DIR [CASE...]`.

A CASE that begins with @ names a file with one case a line; a BINARY of `-` runs nothing and writes the table anew. Answers
are kept in OUT_DIR/answers.jsonl; cases that are there already are not run again. Each case runs on one thread.
"""
import json, os, resource, subprocess, sys, time

# The simulator's words and the catalogue's, where a parameter has the same meaning.
SAME = {
    "spool_capacity": ("spool_mass", "heat_capacity_j_per_m2_k"), "spool_contact": ("spool_mass", "contact_w_per_m2_k"),
    "sensor_lag": ("sensor_lag", "lag_s"), "heater_power": ("self_heating", "power_w_per_m2"), "heater_tau": ("self_heating", "time_constant_s"),
    "flange_film": ("axial_gradient", "film_w_per_m2_k"), "conductivity_slope": ("conductivity_temperature", "slope_per_k"),
    "stress": ("stress_gradient", "strength"), "mismatch": ("strain_mismatch", "mismatch"),
    "glass_mismatch": ("glass_transition", "mismatch"), "thermo_optic_slope": ("thermo_optic_temperature", "slope_per_k"),
    "lead_offset": ("midpoint_offset", "offset_m"), "turn_mismatch": ("turn_mismatch", "turns"),
    "asymmetry": ("heating_cooling_asymmetry", "gain"), "bias_per_K": ("bias_temperature", "linear_deg_per_h_per_k"),
    "bias_per_K2": ("bias_temperature", "quadratic_deg_per_h_per_k2"), "bias_rate": ("bias_temperature_rate", "gain_deg_per_h_s_per_k"),
    "bias_gradient": ("bias_gradient_rate", "gain_deg_per_h_s_per_k"), "conductivity_factor": ("diffusivity", "factor"),
    "thermo_optic_factor": ("thermo_optic", "factor"),
}


def run(binary, folder):
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.time()
    command = ["nice", "-n", "10", binary, "diagnose", f"{folder}/coil.toml", f"{folder}/calibration.csv", "--holdout", f"{folder}/validation.csv", "--format", "json", "--quiet"]
    done = subprocess.run(command, capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    try:
        answer = json.loads(done.stdout)
    except ValueError:
        answer = {"verdict": "error", "error": done.stderr[-300:], "effects": [], "ladder": []}
    answer["cpu_s"] = round(after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime, 1)
    answer["wall_s"] = round(time.time() - start, 1)
    answer["most_mb"] = after.ru_maxrss // 1024
    return answer


def judge(truth, answer):
    """The judgement, the worst parameter's error in standard errors, and validation RMSE over the noise."""
    wanted, outside = truth["answers"], truth.get("outside")
    named = [[e["kind"]] + e["equivalents"] for e in answer["effects"]]
    ratio = answer["ladder"][-1]["holdout_rmse_deg_per_h"] / truth["noise_sigma_deg_per_h"] if answer["ladder"] else float("nan")
    worst = 0.0
    if outside:
        word = {"unexplained": "right: unexplained", "adequate": "missed"}.get(answer["verdict"], "WRONG NAME")
    elif not wanted:
        word = "right: adequate" if answer["verdict"] == "adequate" else "FALSE ALARM"
    elif answer["verdict"] == "adequate":
        word = "missed"
    elif answer["verdict"] in ("unexplained", "error"):
        word = answer["verdict"]
    else:
        rest, sets = list(wanted), 0
        for kinds in named:
            hit = next((k for k in rest if k in kinds), None)
            if hit:
                rest.remove(hit)
                sets += len(kinds) > 1
        extra = len(named) > len(wanted)
        word = ("right: in a set" if sets else "right: named") if not rest and not extra and all(len(k) <= 3 for k in named) else "WRONG"
        for key, value in list(truth["hidden"].items()) + [("gain", g) for g in (truth.get("gains") or {}).values()]:
            kind, name = SAME.get(key, (None, None))
            for e in answer["effects"]:
                p = e["parameters"].get(name) if e["kind"] == kind else None
                if p and p["standard_error"]:
                    worst = max(worst, abs(p["value"] - value) / p["standard_error"])
    return word, worst, ratio


def kind_of(truth):
    if truth.get("outside"):
        return "outside the catalogue"
    return {0: "controls", 1: "one effect"}.get(len(truth["answers"]), "two effects")


def values(truth, answer):
    """Fitted values beside the true ones, where they mean the same."""
    said = []
    for key, value in list(truth["hidden"].items()) + [("gain", g) for g in (truth.get("gains") or {}).values()]:
        kind, name = SAME.get(key, ("channel", "gain_deg_per_h_per_unit") if key == "gain" else (None, None))
        for e in answer["effects"]:
            p = e["parameters"].get(name) if e["kind"].split(":")[0] == kind else None
            if p:
                error = f" ± {p['standard_error']:.2g}" if p["standard_error"] else ""
                said.append(f"{name} {p['value']:.4g}{error} ({value:g})")
    return "; ".join(said)


def write_table(truths, answers, file):
    rows = ["| case | hidden | rms/noise | answer | judged | value (truth) | worst parameter [s.e.] | validation RMSE/noise | CPU s | build |"]
    rows.append("|---" * 10 + "|")
    counts = {}
    for case in (c for c in truths if c in answers):
        truth, answer = truths[case], answers[case]
        word, worst, ratio = judge(truth, answer)
        of_kind = counts.setdefault(kind_of(truth), {})
        of_kind[word] = of_kind.get(word, 0) + 1
        said = answer["verdict"] + (": " + "; ".join("/".join([e["kind"]] + e["equivalents"]) for e in answer["effects"]) if answer["effects"] else "")
        hidden = " + ".join(truth["answers"] + ([truth["outside"] + " (outside)"] if truth.get("outside") else [])) or "nothing"
        size = truth["hidden_rms"]["calibration"] / truth["noise_sigma_deg_per_h"]
        error = f"{worst:.1f}" if worst else ""
        rows.append(f"| {case} | {hidden} | {size:.2f} | {said} | {word} | {values(truth, answer)} | {error} | {ratio:.3f} | {answer['cpu_s']} | {answer.get('build', '')} |")
    summary = ["| | cases | " + " | ".join(w for w in WORDS) + " |", "|---" * (len(WORDS) + 2) + "|"]
    for kind, of_kind in counts.items():
        summary.append(f"| {kind} | {sum(of_kind.values())} | " + " | ".join(str(of_kind.get(w, 0)) for w in WORDS) + " |")
    open(file, "w").write("\n".join(summary) + "\n\n" + "\n".join(rows) + "\n")


WORDS = ["right: adequate", "right: named", "right: in a set", "right: unexplained", "missed", "unexplained", "WRONG", "WRONG NAME", "FALSE ALARM", "error"]


def main():
    cases, binary, out, wanted = sys.argv[1], sys.argv[2], sys.argv[3], sys.argv[4:]
    os.makedirs(out, exist_ok=True)
    os.environ["RAYON_NUM_THREADS"] = "1"
    wanted = [c for w in wanted for c in (open(w[1:]).read().split() if w.startswith("@") else [w])]
    file = f"{out}/answers.jsonl"
    truths = json.load(open(f"{cases}/truth.json"))
    answers = {}
    if os.path.exists(file):
        answers = {a["case"]: a for a in map(json.loads, open(file))}
    for name in [] if binary == "-" else wanted or truths:
        if name not in answers:
            answers[name] = dict(run(binary, f"{cases}/{name}"), case=name)
            with open(file, "a") as f:
                f.write(json.dumps(answers[name]) + "\n")
            write_table(truths, answers, f"{out}/table.md")
            a = answers[name]
            print(name, judge(truths[name], a), a["verdict"], [[e["kind"]] + e["equivalents"] for e in a["effects"]], a["cpu_s"], a["most_mb"], a.get("error", ""), flush=True)
    write_table(truths, answers, f"{out}/table.md")


if __name__ == "__main__":
    main()
