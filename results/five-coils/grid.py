"""Every objective and class on five coils with several seeds, each result as a line of JSON.

    python grid.py COILWRIGHT c12,c16,c24,c32,c48 1,2 OUT.jsonl [OBJECTIVE,…]
    python table.py OUT.jsonl
"""
import json
import os
import resource
import subprocess
import sys
import tempfile

from coils import model

TOLERANCE = """
[tolerance]
midpoint_offset_mm_sd = 20.0
mismatch_sd = 0.0005
turns_per_layer_sd = 0.3
radial_pitch_percent_sd = 1.0
film_percent_sd = 10.0
diffusivity_percent_sd = 10.0
samples = 100
limit_deg_per_h = 0.3
seed = 1
"""
OBJECTIVES = ["worst-rate", "guaranteed-rate", "rms", "pointing", "p95"]
CLASSES = ["standard", "captive:1", "any"]


def processor_s():
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime


def main():
    program, names, seeds, out = sys.argv[1:5]
    objectives = sys.argv[5].split(",") if len(sys.argv) > 5 else OBJECTIVES
    folder = tempfile.mkdtemp()
    for name in names.split(","):
        path = os.path.join(folder, f"{name}.toml")
        model(name, 1, path)
        text = open(path).read()
        tolerance = TOLERANCE if "surface_film" in text else TOLERANCE.replace("film_percent_sd = 10.0\n", "")
        open(path, "w").write(text.replace("[search]", tolerance + "\n[search]"))
        for windability in CLASSES:
            for objective in objectives:
                for seed in seeds.split(","):
                    before_s = processor_s()
                    asked = ["--windability", windability, "--objective", objective, "--seed", seed, "--format", "json"]
                    ran = subprocess.run([program, "optimise", path, *asked], capture_output=True, text=True)
                    if ran.returncode not in (0, 1):
                        sys.exit(f"{asked}: {ran.stderr[-1500:]}")
                    answer = json.loads(ran.stdout)
                    row = {k: v for k, v in answer["best"].items() if isinstance(v, (int, float))}
                    row.update(coil=name, cls=windability, obj=objective, seed=int(seed))
                    row.update(segments=answer["best"]["segments"], gain=answer["improvement_over_qua"])
                    row.update(resolution=answer.get("rate_resolution") or answer.get("pointing_resolution"))
                    row.update(by=answer["best_found"]["by"], rounds=answer["rounds"], stopped=answer["stopped_by"])
                    row.update(cpu=processor_s() - before_s)
                    with open(out, "a") as file:
                        file.write(json.dumps(row) + "\n")


if __name__ == "__main__":
    main()
