"""Runs `BINARY diagnose` over trial cases and scores it: `python score.py CASES_DIR BINARY OUT_DIR [CASE...]`.

Answers are kept in OUT_DIR/answers.jsonl; cases that are there already are not run again. OUT_DIR/table.md is written anew.
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


def main():
    cases, binary, out, wanted = sys.argv[1], sys.argv[2], sys.argv[3], sys.argv[4:]
    os.makedirs(out, exist_ok=True)
    file = f"{out}/answers.jsonl"
    truths = json.load(open(f"{cases}/truth.json"))
    answers = {}
    if os.path.exists(file):
        answers = {a["case"]: a for a in map(json.loads, open(file))}
    for name in wanted or truths:
        if name not in answers:
            answers[name] = dict(run(binary, f"{cases}/{name}"), case=name)
            with open(file, "a") as f:
                f.write(json.dumps(answers[name]) + "\n")
        rows = ["| case | hidden | rms/noise | answer | judged | worst parameter [s.e.] | validation RMSE/noise | cpu s |", "|---|---|---|---|---|---|---|---|"]
        counts = {}
        for case in (c for c in truths if c in answers):
            truth, answer = truths[case], answers[case]
            word, worst, ratio = judge(truth, answer)
            counts[word] = counts.get(word, 0) + 1
            said = answer["verdict"] + (": " + "; ".join("/".join([e["kind"]] + e["equivalents"]) for e in answer["effects"]) if answer["effects"] else "")
            hidden = " + ".join(truth["answers"] + ([truth["outside"] + " (outside)"] if truth.get("outside") else [])) or "nothing"
            sizes = truth["noise_sigma_deg_per_h"]
            rows.append(f"| {case} | {hidden} | {truth['hidden_rms']['calibration'] / sizes:.2f} | {said} | {word} | {worst:.1f} | {ratio:.3f} | {answer['cpu_s']} |")
        summary = ", ".join(f"{k}: {v}" for k, v in sorted(counts.items()))
        open(f"{out}/table.md", "w").write(f"{len(rows) - 2} cases; {summary}\n\n" + "\n".join(rows) + "\n")
        print(name, judge(truths[name], answers[name]), answers[name]["verdict"], [[e["kind"]] + e["equivalents"] for e in answers[name]["effects"]], answers[name]["cpu_s"], answers[name]["wall_s"], answers[name]["most_mb"], answers[name].get("error", ""), flush=True)


if __name__ == "__main__":
    main()
