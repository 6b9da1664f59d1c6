"""Tables of the trials, Markdown on stdout. Needs numpy and scipy (for the forms).

    python summary.py trials.csv [peers.csv]
    python summary.py short trials.csv fresh.csv      both batches in one table
    python summary.py pairs trials.csv again.csv      the same cases with two builds
"""
import csv
import json
import sys
from collections import Counter, defaultdict

import numpy as np

from formulas import FORMS, OF_TIME, OUTSIDE

GOOD = 1.15
OUTCOMES = ["right", "right formula, other listed effects", "another formula", "listed effects instead", "unexplained", "missed", "error"]
PEERS = ["ridge", "boosting", "pysindy", "gplearn"]


def value(row, key):
    return float(row[key]) if row.get(key) else float("nan")


def outcome(row):
    """What came of a case with a term, in one word of OUTCOMES."""
    if row["error"]:
        return "error"
    if row["formula"]:
        if row["likeness"] == "other":
            return "another formula"
        return "right" if row["listed_right"] != "wrong" else "right formula, other listed effects"
    if row["named"]:
        return "listed effects instead"
    return "missed" if row["verdict"] == "adequate" else "unexplained"


def predicted(row, key="answer_rms"):
    return value(row, key) <= GOOD * value(row, "truth_rms")


def to_predict(row):
    """Whether the declared model leaves more than a prediction may."""
    return not predicted(row, "declared_rms")


def removed(row, key="answer_rms"):
    """The part of the power of what is hidden that is gone from the third record."""
    declared, truth = value(row, "declared_rms") ** 2, value(row, "truth_rms") ** 2
    return (declared - value(row, key) ** 2) / (declared - truth)


def share(hits, of):
    return f"{hits} of {of}" + (f" ({100 * hits / of:.0f} %)" if of else "")


def table(heads, lines):
    print("| " + " | ".join(heads) + " |\n" + "|---" * len(heads) + "|")
    for line in lines:
        print("| " + " | ".join(str(c) for c in line) + " |")
    print()


def terms_table(name, groups):
    lines = []
    for group, rows in groups:
        if not rows:
            continue
        asked = [r for r in rows if to_predict(r)]
        right = Counter(outcome(r) for r in rows)
        proposed = [r for r in rows if r["formula"]]
        lines.append([group, len(rows), share(sum(predicted(r) for r in rows), len(rows)), share(sum(predicted(r) for r in asked), len(asked)),
                      share(sum(r["likeness"] in ("same", "alike") for r in rows), len(rows)), sum(r["likeness"] == "same" for r in rows), len(proposed)]
                     + [right[o] for o in OUTCOMES])
    table([name, "cases", "predicted", "of those with something to predict", "form right", "variables too", "a formula"] + OUTCOMES, lines)


def by(rows, key, order=None):
    groups = defaultdict(list)
    for row in rows:
        groups[key(row)].append(row)
    return [(g, groups[g]) for g in (order or sorted(groups)) if g in groups]


def size_of(row):
    size = value(row, "size_noises")
    return "1 to 2 noises" if size < 2 else "2 to 4 noises" if size < 4 else "4 to 10 noises"


def depth_of(row):
    """How large the term is beside what the true model leaves of the fitted record, unseen air and all."""
    ratio = value(row, "size_noises") * value(row, "noise_deg_per_h") / value(row, "truth_fitted_rms")
    return "below 0.3 of what the truth leaves" if ratio < 0.3 else "0.3 to 1" if ratio < 1 else "1 to 3" if ratio < 3 else "above 3"


def of_terms(rows):
    print(f"## Terms: {len(rows)} cases\n")
    within = [r for r in rows if r["form"] not in OUTSIDE]
    terms_table("", [("all", rows), ("forms of the grammar", within), ("of these not of time alone", [r for r in within if r["form"] not in OF_TIME])])
    terms_table("form", by(rows, lambda r: r["form"], FORMS))
    terms_table("size", by(within, size_of))
    terms_table("size", by(within, depth_of, ["below 0.3 of what the truth leaves", "0.3 to 1", "1 to 3", "above 3"]))
    terms_table("listed effect beside", by(within, lambda r: r["listed"] or "none"))
    terms_table("columns that do nothing", by(within, lambda r: r["idle"]))
    terms_table("winding", by(within, lambda r: r["pattern"]))
    terms_table("chamber", by(within, lambda r: r["chamber"]))
    terms_table("flicker", by(within, lambda r: "none" if value(r, "flicker") == 0 else "0.2 of the white noise"))
    parts = [removed(r) for r in within if to_predict(r)]
    quarters = np.percentile(parts, [10, 25, 50, 75, 90])
    print(f"Part of what is hidden that is gone from the third record, of the power, where there is something to predict: 10 % {quarters[0]:.3f}, quarter {quarters[1]:.3f}, "
          f"median {quarters[2]:.3f}, three quarters {quarters[3]:.3f}.\n")
    claims = [r for r in rows if r["formula"] and r["predicts"] == "1"]
    print(f"Said to predict: {len(claims)}; predict: {share(sum(predicted(r) for r in claims), len(claims))}; within 1.15 or nine tenths gone: "
          f"{share(sum(predicted(r) or removed(r) > 0.9 for r in claims), len(claims))}. Said only to describe: {sum(r['predicts'] == '0' for r in rows)}.\n")


def of_numbers(rows):
    """Groups of numbers against their errors; `z` of a row holds (found - true)/error and the relative error by name."""
    groups = defaultdict(list)
    for row in rows:
        for name, (z, relative) in json.loads(row["z"] or "{}").items():
            if "." in name:
                groups["listed effects"].append((z, relative))
            else:
                groups["gain" if name == "a" else name].append((z, relative))
                groups["formulas, all numbers"].append((z, relative))
                groups[f"of {row['form']}"].append((z, relative))
    lines = []
    for name, found in sorted(groups.items(), key=lambda g: (g[0].startswith("of "), g[0])):
        z, relative = np.abs([f[0] for f in found]), np.abs([f[1] for f in found])
        lines.append([name, len(found)] + [f"{100 * np.mean(z < k):.0f} %" for k in (1, 2, 3)] + [f"{np.median(z):.2f}", f"{z.max():.1f}", f"{100 * np.median(relative):.1f} %",
                     f"{100 * np.mean(relative < 0.1):.0f} %"])
    table(["", "numbers", "within 1 error", "within 2", "within 3", "median", "largest", "median of the relative error", "within 10 %"], lines)
    print("(Within 1, 2, 3 errors of a normal distribution: 68 %, 95 %, 99.7 %; median 0.67.)\n")


def of_controls(rows):
    print(f"## Controls: {len(rows)} cases\n")

    def kind(row):
        if row["listed"]:
            return "a listed effect missing"
        return "nothing missing, four columns and flicker of half the white noise" if row["index"] and int(row["index"]) % 5 == 4 else "nothing missing"

    lines = []
    groups = by(rows, kind)
    groups.append(("all with nothing missing", [r for r in rows if not r["listed"]]))
    groups.append(("all", rows))
    for group, of in groups:
        lines.append([group, len(of), share(sum(bool(r["formula"]) for r in of), len(of)), sum(r["predicts"] == "1" for r in of), share(sum(bool(r["named"]) for r in of), len(of)),
                      sum(r["verdict"] == "adequate" for r in of), sum(r["verdict"] == "unexplained" for r in of), sum(bool(r["error"]) for r in of)])
    table(["", "cases", "a formula proposed", "said to predict", "listed effects named", "adequate", "unexplained", "error"], lines)
    lacking = [r for r in rows if r["listed"]]
    found = Counter("right" if r["listed_right"] == "right" else "right in a set" if r["listed_right"] == "in a set" else "formula" if r["formula"] else r["verdict"] if not r["named"]
                    else "others named" for r in lacking)
    print("Of those that lack a listed effect: " + ", ".join(f"{k} {v}" for k, v in found.most_common()) + ".\n")
    for row in rows:
        row["conditions"] = f"{row['pattern']}, {row['chamber']}"
    table(["nothing missing: winding group and chamber", "cases", "listed effects named", "a formula"],
          [[g, len(of), sum(bool(r["named"]) for r in of), sum(bool(r["formula"]) for r in of)]
           for g, of in by([r for r in rows if not r["listed"]], lambda r: ("zyl, sym" if r["pattern"] in ("zyl", "sym") else "dip" if r["pattern"] == "dip" else "qua, oct, hex") + ", " + r["chamber"])])


def of_stated(rows):
    print("## Stated probabilities\n")
    print("The leading set's probability against how often it is right: its listed effects are those that were hidden and its formula has the form that was hidden (`strict`: and the same "
          "variables). Where the leading set only says that something is left (`unexplained`), it asserts nothing and is counted apart.\n")
    bins = [(0.99, 1.01), (0.95, 0.99), (0.8, 0.95), (0.5, 0.8), (0.0, 0.5)]
    groups = [("all", rows), ("terms", [r for r in rows if r["kind"] == "term"]), ("terms alone", [r for r in rows if r["kind"] == "term" and not r["listed"]]),
              ("terms alone, at least 0.3 of what the truth leaves", [r for r in rows if r["kind"] == "term" and not r["listed"] and not depth_of(r).startswith("below")]),
              ("terms beside a listed effect", [r for r in rows if r["kind"] == "term" and r["listed"]]),
              ("controls, nothing missing", [r for r in rows if r["kind"] == "control" and not r["listed"]]),
              ("controls, a listed effect missing", [r for r in rows if r["kind"] == "control" and r["listed"]])]
    lines = []
    for name, of in groups:
        of = [r for r in of if r["probability"] and not r["error"]]
        says = [r for r in of if r["leading_right"] != "none"]
        for low, high in [(0.95, 1.01)] + bins:
            there = [r for r in says if low <= value(r, "probability") < high]
            if there:
                right = sum(r["leading_right"] in ("right", "alike") for r in there)
                lines.append([name, f"{low} to {min(high, 1.0)}", len(there), f"{np.mean([value(r, 'probability') for r in there]):.3f}", share(right, len(there)),
                              sum(r["leading_right"] == "right" for r in there)])
        lines.append([name, "unexplained", len(of) - len(says), "", "", ""])
    table(["cases", "stated", "how many", "mean stated", "right", "strict"], lines)
    held = [r for r in rows if r["probability"] and r["leading_right"] != "none"]
    print(f"The truth holds at least 5 % of the posterior in {share(sum(value(r, 'truth_probability') >= 0.05 for r in held), len(held))} of those that assert something.\n")


def of_failures(rows):
    print("## What went wrong\n")
    lines = []
    for row in rows:
        term = row["kind"] == "term"
        wrong = row["leading_right"] == "wrong"
        ratio = value(row, "answer_rms") / value(row, "truth_rms") if row.get("truth_rms") else float("nan")
        if row["error"]:
            why = "command failed"
        elif not term and not row["listed"] and (row["named"] or row["formula"]):
            why = "false alarm"
        elif term and row["verdict"] == "adequate":
            why = "missed"
        elif wrong and value(row, "probability") >= 0.95:
            why = "confident and wrong"
        elif term and row["formula"] and row["predicts"] == "1" and not predicted(row):
            why = "said to predict, does not"
        elif term and row["likeness"] == "same" and any(abs(z) > 5 for k, (z, _) in json.loads(row["z"] or "{}").items() if "." not in k):
            why = "right formula, a number more than five errors off"
        elif term and row["formula"] and row["likeness"] == "other":
            why = "another formula"
        elif term and not row["formula"] and row["named"]:
            why = "listed effects instead"
        elif term and not row["formula"] and row["form"] not in OUTSIDE and to_predict(row):
            why = "nothing proposed"
        elif wrong and not term and row["listed"] and row["listed_right"] == "wrong":
            why = "another listed effect"
        else:
            continue
        hidden = " + ".join(x for x in (row["listed"], f"{row['form']} {row['constants']}" if term else "") if x) or "nothing"
        size = " / ".join(f"{value(row, k):.1f}" for k in ("listed_noises", "size_noises"))
        conditions = f"{row['pattern']}, {row['chamber']}" + (f", {row['columns'].count(' ') + 1} columns" if row["columns"] else "") + (", flicker" if value(row, "flicker") else "")
        lines.append((why, row["case"], hidden, size, conditions, (row["leading"] or row["named"] or row["verdict"]) + (f" {row['error']}" if row["error"] else ""), row["probability"],
                      "" if np.isnan(ratio) else f"{ratio:.2f}"))
    order = ["command failed", "false alarm", "confident and wrong", "said to predict, does not", "right formula, a number more than five errors off", "another formula",
             "listed effects instead", "nothing proposed", "missed", "another listed effect"]
    count = Counter(line[0] for line in lines)
    table(["kind", "cases"], [[k, count[k]] for k in order if count[k]])
    table(["what", "case", "hidden", "noises: listed / unlisted", "winding, chamber", "leading answer", "stated", "left of the third record, over what the truth leaves"],
          [[str(c).replace("|", "\\|") for c in line] for line in sorted(lines, key=lambda l: (order.index(l[0]), l[1]))])


def of_peers(rows, peers):
    of = {r["case"]: r for r in csv.DictReader(open(peers))}
    both = [dict(r, **{f"{p}_rms": of[r["case"]][f"{p}_rms"] for p in PEERS}) for r in rows if r["case"] in of and r["formula"] + r["verdict"]]
    print(f"## What a user could take instead: {len(both)} of the cases with a term\n")
    groups = [("all", both), ("something to predict", [r for r in both if to_predict(r)]), ("of these a form of the grammar", [r for r in both if to_predict(r) and r["form"] not in OUTSIDE]),
              ("of these alone", [r for r in both if to_predict(r) and r["form"] not in OUTSIDE and not r["listed"]])]
    lines = []
    for name, key in [("coilwright", "answer_rms")] + [(p, f"{p}_rms") for p in PEERS] + [("nothing (the declared model)", "declared_rms")]:
        asked = [r for r in both if to_predict(r)]
        lines.append([name] + [share(sum(predicted(r, key) for r in g), len(g)) for _, g in groups] + [f"{np.median([removed(r, key) for r in asked]):.2f}"])
    table(["predicted within 1.15 of the truth"] + [n for n, _ in groups] + ["median part gone"], lines)
    times = {p: np.median([float(of[r["case"]][f"{p}_s"]) for r in both if of[r["case"]][f"{p}_s"]]) for p in PEERS}
    print("Median processor time: " + ", ".join(f"{p} {t:.1f} s" for p, t in times.items()) + f"; coilwright {np.median([value(r, 'cpu_s') for r in both]):.1f} s.\n")


def of_pairs(before, after):
    """The same cases diagnosed by two builds."""
    old = {r["case"]: r for r in csv.DictReader(open(before))}
    words, lines = {"right": "right", "alike": "right, of another temperature or rate", "wrong": "wrong", "none": "only that something is left"}, []
    new = list(csv.DictReader(open(after)))
    for row in new:
        was = old[row["case"]]

        def shown(r):
            said = (r["leading"] or r["verdict"]).replace("|", "\\|")
            ratio = f", {value(r, 'answer_rms') / value(r, 'truth_rms'):.2f}" if r["truth_rms"] and r["answer_rms"] else ""
            worst = max((abs(z) for z, _ in json.loads(r["z"] or "{}").values()), default=float("nan"))
            return f"{words[r['leading_right']]}: {said} ({float(r['probability'] or 'nan'):.3f}{ratio}" + ("" if np.isnan(worst) else f", {worst:.1f} errors") + ")"
        hidden = " + ".join(x for x in (was["listed"], f"{was['form']} {was['constants']}" if was["form"] else "") if x) or "nothing"
        lines.append([row["case"], hidden, shown(was), shown(row)])
    good = lambda rows: sum(r["leading_right"] in ("right", "alike") for r in rows)  # noqa: E731
    bold = lambda rows: sum(r["leading_right"] == "wrong" and value(r, "probability") >= 0.95 for r in rows)  # noqa: E731
    asked = [r for r in new if r["kind"] == "term" and to_predict(r)]
    print(f"{len(new)} cases: the leading set right in {good([old[r['case']] for r in new])} before and {good(new)} after; wrong at 0.95 or more in {bold([old[r['case']] for r in new])} and {bold(new)}; "
          f"predicted, of {len(asked)} with something to predict, {sum(predicted(old[r['case']]) for r in asked)} and {sum(predicted(r) for r in asked)}.\n")
    table(["case", "hidden", "before: leading set (stated, left of the third record over what the truth leaves, worst number)", "after"], sorted(lines))


def in_short(file):
    """What was asked of the trials, a line a claim."""
    rows = list(csv.DictReader(open(file)))
    terms, controls = [r for r in rows if r["kind"] == "term" and r["truth_rms"]], [r for r in rows if r["kind"] == "control"]
    within = [r for r in terms if r["form"] not in OUTSIDE]
    none = [r for r in controls if not r["listed"]]
    z = [v for r in terms for name, v in json.loads(r["z"] or "{}").items() if "." not in name]

    def of(wanted, among):
        return share(sum(map(wanted, among)), len(among))

    def sure(among):
        return of(lambda r: r["leading_right"] in ("right", "alike"), [r for r in among if r["probability"] and r["leading_right"] != "none" and value(r, "probability") >= 0.95])

    return {
        "terms": len(terms), "predicted": of(predicted, terms), "predicted, of those with something to predict": of(predicted, [r for r in terms if to_predict(r)]),
        "of these a form of the grammar": of(predicted, [r for r in within if to_predict(r)]),
        "form right, of those in the grammar": of(lambda r: r["likeness"] in ("same", "alike"), within),
        "form and listed effects right, of those in the grammar": of(lambda r: outcome(r) == "right", within),
        "predict, of those said to predict": of(predicted, [r for r in terms if r["predicts"] == "1"]),
        "numbers of formulas within one, two, three stated errors (68, 95, 99.7 % of a normal distribution)":
            ", ".join(f"{100 * np.mean([abs(error) < k for error, _ in z]):.0f} %" for k in (1, 2, 3)) + f" of {len(z)}",
        "numbers of formulas within 10 %": of(lambda v: abs(v[1]) < 0.1, z),
        "controls": len(controls), "a formula proposed": of(lambda r: bool(r["formula"]), controls),
        "a listed effect named where nothing is missing": of(lambda r: bool(r["named"]), none),
        "of these in a thermoelectric stage": of(lambda r: bool(r["named"]), [r for r in none if r["chamber"] == "stage"]),
        "stated at 0.95 or more: leading set right": sure(rows), "terms alone": sure([r for r in terms if not r["listed"]]),
        "terms beside a listed effect": sure([r for r in terms if r["listed"]]), "controls, nothing missing": sure(none),
        "controls, a listed effect missing": sure([r for r in controls if r["listed"]]),
    }


def main():
    if sys.argv[1] == "short":
        columns = [in_short(file) for file in sys.argv[2:]]
        return table([""] + sys.argv[2:], [[name] + [c[name] for c in columns] for name in columns[0]])
    if sys.argv[1] == "pairs":
        return of_pairs(sys.argv[2], sys.argv[3])
    rows = list(csv.DictReader(open(sys.argv[1])))
    terms = [r for r in rows if r["kind"] == "term"]
    controls = [r for r in rows if r["kind"] == "control"]
    judged = [r for r in terms if r["truth_rms"] and r["declared_rms"]]
    if len(judged) < len(terms):
        print("Without a judgement (a command failed): " + ", ".join(r["case"] for r in terms if r not in judged) + "\n")
    of_terms(judged)
    print("## Numbers against their stated errors\n")
    of_numbers(rows)
    of_controls(controls)
    of_stated(rows)
    if len(sys.argv) > 2:
        of_peers(judged, sys.argv[2])
    of_failures(judged + [r for r in terms if r not in judged] + controls)
    cost = [value(r, "cpu_s") for r in rows]
    print(f"Processor time of a diagnosis: terms median {np.median([value(r, 'cpu_s') for r in terms]):.1f} s, controls {np.median([value(r, 'cpu_s') for r in controls]):.1f} s, most {max(cost):.1f} s; "
          f"rows a record {min(int(r['rows']) for r in rows)} to {max(int(r['rows']) for r in rows)}.\n")


if __name__ == "__main__":
    main()
