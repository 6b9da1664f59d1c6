#!/usr/bin/env python3
"""A winding pack in FiPy, the outside reference for coilwright's temperature field, and the ratio of run times.

    python3 -m venv peer && peer/bin/pip install fipy==4.0.3 numpy scipy
    cargo build --release
    peer/bin/python benches/peers/fipy_pack.py [target/release/coilwright]

The case: 40 layers with a film to the air and a spool behind a contact, a ramp of 60 °C/h for 900 s and a soak. FiPy gets a
cylindrical grid with CELLS cells a layer, one more cell for the spool, and backward Euler steps; two step sizes are
extrapolated to zero. The layer rates of both programs go through the same weights of QUA and ZYL."""

import json
import os
import pathlib
import resource
import subprocess
import sys
import tempfile
import time

os.environ.setdefault("FIPY_SOLVERS", "scipy")
import fipy
import numpy as np

LAYERS, TURNS, BORE, PITCH, AXIAL = 40, 50, 0.04, 165e-6, 170e-6
K, RHO_C, FILM, CAPACITY, CONTACT = 0.35, 1.7e6, 20.0, 4000.0, 300.0
RATE, RAMP_S, END_S, CELLS, SPACING_S = 60.0 / 3600.0, 900.0, 1800.0, 2, 5.0
N_INDEX, DN_DT = 1.45, 1.0e-5

MODEL = f"""name = "peer"
[fibre]
refractive_index = {N_INDEX}
thermo_optic_per_k = {DN_DT}
wavelength_nm = 1550.0
outer_diameter_um = 165.0
[winding]
layers = {LAYERS}
turns_per_layer = {TURNS}
inner_diameter_mm = {2e3 * BORE}
axial_pitch_um = {1e6 * AXIAL}
layer_length = "actual"
[thermal]
model = "pack"
conductivity_w_per_m_k = {K}
volumetric_heat_capacity_j_per_m3_k = {RHO_C}
[sensor]
location = "ambient"
[[effect]]
kind = "surface_film"
film_w_per_m2_k = {FILM}
[[effect]]
kind = "spool_mass"
heat_capacity_j_per_m2_k = {CAPACITY}
contact_w_per_m2_k = {CONTACT}
[profiles]
max_rate_c_per_h = 60.0
count = 0
[[profiles.ramp]]
name = "ramp"
pieces = [{{ rate_c_per_h = 60.0, duration_s = {RAMP_S} }}, {{ rate_c_per_h = 0.0, duration_s = {END_S - RAMP_S} }}]
"""


def air(time_s):
    return RATE * np.minimum(time_s, RAMP_S)


def fipy_layers(step_s):
    """Layer temperatures every SPACING_S, and the processor's seconds in the loop."""
    width, spool_width = PITCH / CELLS, 1e-3
    widths = np.array([spool_width] + [width] * (LAYERS * CELLS))
    mesh = fipy.CylindricalGrid1D(dr=widths, origin=(BORE - spool_width,))
    volumes = mesh.cellVolumes
    radii = mesh.faceCenters.value[0]
    # Volumes per radian: the spool's cell holds CAPACITY per area of the bore.
    heat = np.full(len(widths), RHO_C)
    heat[0] = CAPACITY * BORE / volumes[0]
    coefficient = np.full(len(radii), K)
    coefficient[0] = 0.0
    at_bore = 1
    distance = 0.5 * (spool_width + width)
    coefficient[at_bore] = distance / (1.0 / CONTACT + 0.5 * width / K)
    coefficient[-1] = 0.0
    film = 1.0 / (1.0 / FILM + 0.5 * width / K) * radii[-1] / volumes[-1]
    last = np.zeros(len(widths))
    last[-1] = film
    temperature = fipy.CellVariable(mesh=mesh, value=0.0)
    outside = fipy.Variable(value=0.0)
    outer = fipy.CellVariable(mesh=mesh, value=last)
    equation = fipy.TransientTerm(coeff=fipy.CellVariable(mesh=mesh, value=heat)) == fipy.DiffusionTerm(
        coeff=fipy.FaceVariable(mesh=mesh, value=coefficient)) + outer * outside - fipy.ImplicitSourceTerm(coeff=outer)
    shares = volumes[1:].reshape(LAYERS, CELLS)
    rows, every = [np.zeros(LAYERS)], round(SPACING_S / step_s)
    started = time.process_time()
    for step in range(1, round(END_S / step_s) + 1):
        outside.setValue(air(step * step_s))
        equation.solve(var=temperature, dt=step_s)
        if step % every == 0:
            cells = temperature.value[1:].reshape(LAYERS, CELLS)
            rows.append((cells * shares).sum(axis=1) / shares.sum(axis=1))
    return np.array(rows), time.process_time() - started


def weights(segments):
    """n κ w_j/(L D) in °/h per K/s."""
    radii = BORE + (np.arange(LAYERS) + 0.5) * PITCH
    lengths = 2.0 * np.pi * radii * TURNS
    total, start, out = lengths.sum(), 0.0, np.zeros(LAYERS)
    for layer in np.argsort(segments):
        end = start + lengths[layer]
        out[layer] = lengths[layer] * (start + end - total)
        start = end
    diameter = 2.0 * BORE + LAYERS * PITCH
    return out * N_INDEX * DN_DT / (total * diameter) * 180.0 / np.pi * 3600.0


def qua():
    low, high, segments = LAYERS // 2, LAYERS // 2 + 1, []
    for letter in "ABBA" * (LAYERS // 4):
        if letter == "A":
            segments.append(low)
            low -= 1
        else:
            segments.append(high)
            high += 1
    return np.array(segments)


def coilwright(program):
    """Layer temperatures every SPACING_S, and the processor's seconds of the whole program."""
    with tempfile.TemporaryDirectory() as folder:
        model = pathlib.Path(folder) / "peer.toml"
        model.write_text(MODEL, encoding="utf-8")
        rows = round(END_S / SPACING_S) + 1
        command = [program, "temperatures", str(model), "--rows", str(rows), "--format", "json", "--quiet"]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        answer = subprocess.run(command, check=True, capture_output=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    document = json.loads(answer.stdout)
    return np.array(document["temperatures_c"]) - 20.0, seconds


def main():
    program = sys.argv[1] if len(sys.argv) > 1 else "target/release/coilwright"
    ours, our_seconds = min((coilwright(program) for _ in range(5)), key=lambda pair: pair[1])
    results = {step: fipy_layers(step) for step in (1.0, 0.5)}
    coarse, fine = results[1.0][0], results[0.5][0]
    extrapolated = 2.0 * fine - coarse
    print(f"fipy {fipy.__version__}, numpy {np.__version__}; {LAYERS} layers, {END_S:.0f} s")
    for name, segments in (("qua", qua()), ("zyl", np.arange(1, LAYERS + 1))):
        gains = weights(segments)
        # Mean rate over each spacing, as a logger would see it.
        error = lambda layers: np.diff(layers, axis=0) @ gains / SPACING_S
        peak = np.abs(error(ours)).max()
        share = lambda layers: np.abs(error(layers) - error(ours)).max() / peak * 100.0
        print(f"{name}: peak {peak:.6f} °/h; largest difference in % of it: steps of 1 s {share(coarse):.4f}, "
              f"0.5 s {share(fine):.4f}, extrapolated {share(extrapolated):.4f}")
    print(f"processor times: FiPy 1 s steps {results[1.0][1]:.2f} s, 0.5 s steps {results[0.5][1]:.2f} s (time loops only); "
          f"coilwright {our_seconds:.4f} s (the whole program, with its start and its JSON)")
    print(f"ratio: {results[1.0][1] / our_seconds:.0f} (FiPy 1 s), {results[0.5][1] / our_seconds:.0f} (FiPy 0.5 s)")


if __name__ == "__main__":
    main()
