"""Runs `BINARY diagnose` over laboratory cases and scores it: `python laboratory_score.py BINARY BATCH [OUT] [CASE…]`.

BATCH is a folder of cases with truth.json (of `laboratory_cases.py`, or published records of the same form). Answers are kept in
OUT/answers.jsonl (default: BATCH/../scores/BATCH-BUILD), cases that are there already are not run again; a BINARY of `-` only
writes the table anew. Two processes at most, one thread each (PROCESSES, THREADS).
"""
import concurrent.futures, json, os, subprocess, sys, threading, time

PROCESSES, THREADS = int(os.environ.get("PROCESSES", "1")), os.environ.get("THREADS", "1")
GOOD = 1.15  # a third record within so many noises counts as predicted
ORDER = ["right", "right set", "honest", "missed", "WRONG SET", "CONFIDENT WRONG", "FALSE ALARM", "error"]


def command(binary, arguments):
    env = dict(os.environ, RAYON_NUM_THREADS=THREADS)
    start = time.time()
    done = subprocess.run(["nice", "-n", "10", "/usr/bin/env", binary, *arguments, "--format", "json", "--quiet"], capture_output=True, text=True, env=env)
    try:
        return json.loads(done.stdout), time.time() - start
    except ValueError:
        return {"error": done.stderr[-400:] or f"exit {done.returncode}"}, time.time() - start


def run(binary, folder, out):
    where = f"{out}/{os.path.basename(folder)}"
    os.makedirs(where, exist_ok=True)
    before = os.times()
    answer, wall = command(binary, ["diagnose", f"{folder}/coil.toml", f"{folder}/calibration.csv", "--holdout", f"{folder}/validation.csv", "-o", where])
    answer["wall_s"] = round(wall, 1)
    # Since two cases may run at once, this is a share of what both used; it is exact with PROCESSES=1.
    after = os.times()
    answer["cpu_s"] = round(after.children_user - before.children_user + after.children_system - before.children_system, 1)
    test = f"{folder}/test.csv"
    if os.path.exists(test):
        made = [f for f in ("proposed.toml", "extended.toml") if os.path.exists(f"{where}/{f}")]
        model = f"{where}/{made[0]}" if made else f"{folder}/coil.toml"
        compared, _ = command(binary, ["compare", model, test, "--gross-errors", "drop"])
        first = (compared.get("records") or [{}])[0]
        answer["test"] = dict(model=os.path.basename(model), rmse_deg_per_h=first.get("rmse_deg_per_h"), error=compared.get("error"))
    return answer


def named(answer):
    """The sets of effects that the answer leaves open: one set if it is sure."""
    effects = answer.get("effects") or []
    base = [[e["kind"]] + e.get("equivalents", []) for e in effects]
    sets = []

    def expand(i, chosen):
        if i == len(base):
            sets.append(frozenset(chosen))
            return
        for kind in base[i]:
            expand(i + 1, chosen + [kind])

    if len(base) <= 6:
        expand(0, [])
    if answer.get("verdict") == "indistinguishable":
        mass = 0.0
        for p in sorted(answer.get("posterior") or [], key=lambda p: -p["probability"]):
            if mass >= 0.95:
                break
            mass += p["probability"]
            sets.append(frozenset(plain_kind(e) for e in p["effects"]))
    return [frozenset(plain_kind(k) for k in s) for s in sets]


def plain_kind(said):
    if isinstance(said, dict):
        said = said["kind"]
    # An effect may be said with what it has refitted or with its layer: "layer_gain(21)".
    return said.split("(")[0].split(" ")[0] if not said.startswith("channel:") else said


def hypothesis_right(expects, answer):
    """Whether the hypothesis that was to be said was said, None where none was to be."""
    said = answer.get("hypothesis") or {}
    if "winding" in expects:
        return expects["winding"] in str(said.get("winding", "")) if said else False
    if "exchanged" in expects:
        text = json.dumps(said)
        return bool(said) and all(any(str(n) == word for word in "".join(c if c.isdigit() else " " for c in text).split()) for n in expects["exchanged"])
    if "reversed" in expects:
        return bool(said.get("reversed"))
    if "offset_step_s" in expects:
        steps = said.get("offset_steps") or []
        return any(abs((s.get("time_s") if isinstance(s, dict) else s) - expects["offset_step_s"]) < 300 for s in steps)
    return None


def said_among_others(expects, answer):
    """Whether the winding that was to be said is among the sets that hold 95 %."""
    mass = 0.0
    for share in sorted(answer.get("posterior") or [], key=lambda p: -p["probability"]):
        if mass < 0.95 and hypothesis_right(expects, share):
            return True
        mass += share["probability"]
    return False


THROUGH_READINGS = {"sensor_lag", "surface_film", "finite_pack"}
FAINT = 0.15  # of the white noise: too little to be found


def faint(truth):
    """Whether what is hidden is too little to be found, and nothing that acts through the readings."""
    through_readings = THROUGH_READINGS & set(truth["answers"] or [])
    return not through_readings and truth.get("listed_rms_deg_per_h", 1e9) < FAINT * truth["noise_sigma_deg_per_h"]


def seen(truth):
    """Of the hidden effects those that can be found beside the others; batches before that was written down count all of them."""
    own = truth.get("own_rms_deg_per_h") or {}
    is_seen = lambda kind: kind in THROUGH_READINGS or own.get(kind, 1e9) >= FAINT * truth["noise_sigma_deg_per_h"]
    return frozenset(kind for kind in truth["answers"] if is_seen(kind))


def is_faint_winding(truth):
    """Whether another winding than the declared one is too little to be found."""
    return (truth.get("own_rms_deg_per_h") or {}).get("winding", 1e9) < FAINT * truth["noise_sigma_deg_per_h"]


def expected(truth):
    """What is to be said beside listed effects, another winding included."""
    winding = {"winding": truth["wound_as"]} if "wound_as" in truth and truth["wound_as"] != truth["declared_as"] else {}
    return (truth.get("expects") or {}) | winding


def judge(truth, answer):
    """One word of ORDER."""
    if "verdict" not in answer:
        return "error"
    verdict, wanted = answer["verdict"], truth["answers"]
    expects, discoverable = expected(truth), truth.get("discoverable")
    sets = named(answer) if answer.get("effects") else []
    truth_set = None if wanted is None else frozenset(wanted)
    if is_faint_winding(truth) and not answer.get("hypothesis"):
        expects = {k: v for k, v in expects.items() if k not in ("winding", "exchanged")}
    hypothesis = hypothesis_right(expects, answer)
    if hypothesis is None and answer.get("hypothesis") and any(v for v in answer["hypothesis"].values()):
        return "CONFIDENT WRONG" if not answer["hypothesis"].get("offset_steps") else "WRONG SET"
    if hypothesis:
        if (truth_set or frozenset()) in (sets or [frozenset()]):
            return "right" if len(sets) <= 1 else "right set"
        return "CONFIDENT WRONG" if verdict == "missing" else "WRONG SET"
    if "offset_step_s" in expects and verdict == "adequate":
        return "missed"
    if hypothesis is False and not answer.get("effects"):
        return "honest" if verdict in ("unexplained", "indistinguishable") else "missed"
    if hypothesis is False and verdict == "indistinguishable" and said_among_others(expects, answer):
        return "right set"
    if hypothesis is False:
        return "CONFIDENT WRONG" if verdict == "missing" else "WRONG SET"
    if expects.get("no_name") or truth_set is None:
        if sets:
            return "FALSE ALARM"
        return "right" if verdict == "unexplained" or expects.get("no_name") else "missed"
    if "refitted" in expects:
        want = expects["refitted"]
        refitted = [r for r in answer.get("refitted") or [] if r["kind"] == want["kind"] and abs(r["value"] / want["value"] - 1) < 0.3]
        rest = [s - {want["kind"]} for s in sets] or [frozenset()]
        said = bool(refitted) or any(want["kind"] in s for s in sets)
        if not said:
            return {"unexplained": "honest", "adequate": "missed"}.get(verdict, "CONFIDENT WRONG" if verdict == "missing" else "WRONG SET")
        return ("right" if len(rest) == 1 else "right set") if truth_set in rest else ("CONFIDENT WRONG" if verdict == "missing" else "WRONG SET")
    if truth.get("extra") and discoverable:
        proposals = answer.get("proposals") or []
        rmse = (answer.get("test") or {}).get("rmse_deg_per_h")
        good = rmse is not None and rmse <= GOOD * truth["noise_sigma_deg_per_h"]
        if proposals and good:
            return "right"
        if proposals and proposals[0].get("predicts"):
            return "CONFIDENT WRONG"
        if verdict == "missing" and sets and sets != [truth_set]:
            return "CONFIDENT WRONG"
        return "honest" if verdict == "unexplained" else "missed" if verdict == "adequate" else "WRONG SET"
    if not wanted:
        claims = [p for p in answer.get("proposals") or [] if p.get("predicts")]
        if claims or sets:
            return "FALSE ALARM"
        return "right" if verdict == "adequate" else "honest"
    if verdict == "adequate":
        return "right" if faint(truth) or not seen(truth) else "missed"
    if verdict == "unexplained":
        return "honest"
    if any(seen(truth) <= s <= truth_set for s in sets):
        return "right" if len(set(sets)) == 1 else "right set"
    return "CONFIDENT WRONG" if verdict == "missing" and len(set(sets)) == 1 else "WRONG SET"


def white(answer):
    """White noise found: the joint model's, or the noise floor of an older build."""
    noise = answer.get("noise")
    if isinstance(noise, list):
        noise = noise[0] if noise else None
    if isinstance(noise, dict) and "white_deg_per_h" not in noise:
        noise = next((v for v in noise.values() if isinstance(v, dict)), None)
    if noise:
        return noise.get("white_deg_per_h"), noise.get("white_standard_error_deg_per_h")
    return answer.get("noise_floor_deg_per_h"), None


def row(name, truth, answer):
    word = judge(truth, answer)
    value, error = white(answer)
    said = answer.get("verdict", "error: " + str(answer.get("error"))[:120])
    said += "".join(" " + "/".join([e["kind"]] + e.get("equivalents", [])) for e in answer.get("effects") or [])
    hypothesis = {k: v for k, v in (answer.get("hypothesis") or {}).items() if v}
    if hypothesis:
        said += " " + json.dumps(hypothesis)
    for r in answer.get("refitted") or []:
        said += f" [{r['kind']} {r['parameter']} {r['declared']:.4g} → {r['value']:.4g}]"
    for p in (answer.get("proposals") or [])[:1]:
        said += f" proposal `{p['formula']}`" + ("" if p.get("predicts") else " (describes)")
    hidden = dict(truth.get("expects") or {})
    wanted = " + ".join((truth["answers"] or []) + truth.get("extra", [])) or ("outside" if truth["answers"] is None else "nothing")
    sigma = truth.get("white_noise_deg_per_h") or truth["noise_sigma_deg_per_h"]
    ratio = f"{value / sigma:.3f}" + (f" ± {error / sigma:.3f}" if error else "") if value else ""
    test = (answer.get("test") or {}).get("rmse_deg_per_h")
    size = f"{truth['listed_rms_deg_per_h'] / sigma:.1f}" if "listed_rms_deg_per_h" in truth else ""
    if truth.get("hidden_rms", {}).get("calibration"):
        size += f" {truth['hidden_rms']['calibration'] / sigma:.1f}"
    top = (answer.get("posterior") or [{}])[0].get("probability")
    cells = [name, wanted + (f" {json.dumps(hidden)}" if hidden else ""), size, word, said.replace("|", "\\|"), f"{top:.3f}" if top is not None else "", ratio,
             f"{test / sigma:.2f}" if test else "", str(answer.get("wall_s", ""))]
    return word, "| " + " | ".join(cells) + " |", (value / sigma if value else None), test / sigma if test else None


def leading_right(truth, answer):
    """Whether the set that holds most is what was hidden; None where the verdict does not stand behind it (`unexplained`) or where a formula was hidden."""
    first = (answer.get("posterior") or [None])[0]
    hypothesis = {k: v for k, v in ((first or {}).get("hypothesis") or {}).items() if v}
    if first is None or truth["answers"] is None or truth.get("extra") or (answer["verdict"] == "unexplained" and not hypothesis):
        return None
    expects = expected(truth)
    asked = None if is_faint_winding(truth) and not hypothesis else hypothesis_right(expects, first)
    # What is said in words, with a space in it, is a hypothesis or a refitted number.
    said = frozenset(plain_kind(e) for e in first["effects"] if " " not in e)
    hidden = frozenset(truth["answers"])
    beside = {expects["refitted"]["kind"]} if "refitted" in expects else set()
    wanted = [hidden, hidden | beside] + ([frozenset()] if faint(truth) else [])
    is_whole = said in wanted or seen(truth) <= said <= hidden
    return (asked if asked is not None else not hypothesis) and is_whole


BINS = [(0.0, 0.5), (0.5, 0.8), (0.8, 0.95), (0.95, 1.01)]
SIZES = [(0.0, 0.15), (0.15, 0.5), (0.5, 1.0), (1.0, 3.0), (3.0, float("inf"))]


def calibration(truths, answers):
    """Tables: what is stated against how often it is right; what is found by its size."""
    judged = [(n, answers[n]["posterior"][0]["probability"], leading_right(truths[n], answers[n])) for n in truths if n in answers and answers[n].get("posterior")]
    judged = [j for j in judged if j[2] is not None]
    lines = ["", "| stated | leading sets | right |", "|---|---|---|"]
    for low, high in BINS:
        of = [right for _, p, right in judged if low <= p < high]
        lines.append(f"| {low:.2f} to {min(high, 1):.2f} | {len(of)} | {sum(of)} |")
    lines += ["", "| condition | stated at 0.95 or more | right |", "|---|---|---|"]
    for condition in dict.fromkeys(c for n, _, _ in judged for c in truths[n].get("conditions") or []):
        of = [right for n, p, right in judged if p >= 0.95 and condition in (truths[n].get("conditions") or [])]
        lines.append(f"| {condition} | {len(of)} | {sum(of)} |")
    lines += ["", "| listed effects alone, rms in white noises | cases | right, or a right set |", "|---|---|---|"]
    for low, high in SIZES:
        def is_of(t):
            return len(t["answers"] or []) == 1 and not t.get("extra") and low <= t.get("listed_rms_deg_per_h", -1) / t["noise_sigma_deg_per_h"] < high
        words = [judge(truths[n], answers[n]) for n in truths if n in answers and is_of(truths[n])]
        lines.append(f"| {low:g} to {high:g} | {len(words)} | {sum(w.startswith('right') for w in words)} |")
    return lines


def write_table(truths, answers, file):
    rows, counts, total, found = [], {}, {}, {}
    for name in (n for n in truths if n in answers):
        truth = truths[name]
        word, text, ratio, _ = row(name, truth, answers[name])
        rows.append(text)
        total[word] = total.get(word, 0) + 1
        for condition in truth.get("conditions") or ["all"]:
            of = counts.setdefault(condition, {})
            of[word] = of.get(word, 0) + 1
            if ratio:
                found.setdefault(condition, []).append(ratio)
    lines = ["| | cases | " + " | ".join(ORDER) + " | white noise found / true (median) |", "|---" * (len(ORDER) + 3) + "|"]
    counts["all together"] = total
    for condition, of in counts.items():
        ratios = sorted(found.get(condition, []))
        lines.append(f"| {condition} | {sum(of.values())} | " + " | ".join(str(of.get(w, "")) for w in ORDER) + f" | {ratios[len(ratios) // 2]:.3f} |" if ratios else
                     f"| {condition} | {sum(of.values())} | " + " | ".join(str(of.get(w, "")) for w in ORDER) + " | |")
    lines += ["", "| case | hidden | rms/noise: listed, unlisted | judged | answer | posterior of the first | white noise found/true | test error/noise | wall s |", "|---" * 9 + "|"]
    open(file, "w").write("\n".join(lines + rows + calibration(truths, answers)) + "\n")
    return total


def main():
    binary, batch = sys.argv[1], sys.argv[2].rstrip("/")
    out = sys.argv[3] if len(sys.argv) > 3 else f"{os.path.dirname(os.path.abspath(batch))}/scores/{os.path.basename(batch)}-{os.path.basename(binary)}"
    wanted = sys.argv[4:]
    os.makedirs(out, exist_ok=True)
    truths, file, answers, lock = json.load(open(f"{batch}/truth.json")), f"{out}/answers.jsonl", {}, threading.Lock()
    if os.path.exists(file):
        answers = {a["case"]: a for a in map(json.loads, open(file))}

    def one(name):
        answer = dict(run(binary, f"{batch}/{name}", out), case=name)
        with lock:
            answers[name] = answer
            with open(file, "a") as f:
                f.write(json.dumps(answer) + "\n")
            write_table(truths, answers, f"{out}/table.md")
            print(row(name, truths[name], answer)[1], flush=True)

    todo = [n for n in (wanted or truths) if n not in answers and binary != "-"]
    with concurrent.futures.ThreadPoolExecutor(PROCESSES) as pool:
        list(pool.map(one, todo))
    print(write_table(truths, answers, f"{out}/table.md"), f"{out}/table.md")


if __name__ == "__main__":
    main()
