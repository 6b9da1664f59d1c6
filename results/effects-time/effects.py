"""Processor time of a search with one further effect at its start, over the time without it.

    python effects.py COILWRIGHT OUT.jsonl [KIND...]

The coil is c32 of ../five-coils (behind a film of 25 W/(m²K)) without its strain mismatch; 64 profiles, standard budget, seed 1.
"""
import json
import os
import resource
import subprocess
import sys
import tempfile

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "five-coils"))
from coils import film, model

# Where a start changes nothing or is of no coil that is built, what is used instead.
CHOSEN = {"layer_gap": {"above_layer": 8, "conductance_w_per_m2_k": 500.0}, "layer_gain": {"layer": 8, "change": 0.05}}
LEFT_OUT = {"finite_pack": "the pack is one already", "surface_film": "it is there", "sensor_lag": "no profile has a sensor",
            "thermal_stress": "the materials of a model file"}


def seconds(program, path):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    ran = subprocess.run([program, "optimise", path, "--format", "json", "--quiet"], capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if ran.returncode not in (0, 1):
        return None, None, ran.stderr.strip().splitlines()[-1]
    answer = json.loads(ran.stdout)
    return after.ru_utime - before.ru_utime, answer["rounds"], None


def main():
    program, out, *asked = sys.argv[1:]
    known = json.loads(subprocess.run([program, "effects", "--format", "json"], capture_output=True, text=True).stdout)
    folder = tempfile.mkdtemp()
    rows = [("none", None)] + [(e["kind"], e) for e in known["effects"] if e["kind"] not in LEFT_OUT]
    for kind, effect in rows:
        if asked and kind not in asked or ":" in kind or kind == "custom":
            continue
        text = film(25)
        if effect:
            chosen = CHOSEN.get(kind) or {p["key"]: p["start"] for p in effect["parameters"] if p.get("default") is None}
            text += f'[[effect]]\nkind = "{kind}"\n' + "".join(f"{k} = {v}\n" for k, v in chosen.items())
            text += "".join(f'{c["key"]} = "{c["options"][0]}"\n' for c in effect["choices"])
        path = os.path.join(folder, f"{kind}.toml")
        model("c32", 1, path, effects=text)
        time_s, rounds, error = seconds(program, path)
        row = dict(effect=kind, processor_s=time_s, rounds=rounds, error=error)
        print(row, flush=True)
        with open(out, "a") as file:
            file.write(json.dumps(row) + "\n")


if __name__ == "__main__":
    main()
