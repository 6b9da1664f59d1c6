"""The worst rate errors of windings on a record's true coil, by means of its own: radial finite volumes, exact in time.

    python judge.py RECORD COIL.toml FILM NAME=PATTERN.toml…

RECORD: d-mismatch, e-sensor or f-two (what is hidden in it, as its simulator states). FILM: at the outside, in W/(m² K). Prints for each
winding the worst rate over 400 profiles of four ramps of 1500 s within 1 °C/min that no search saw, that of the coil alone, without
what is outside it, and the coil's guaranteed worst rate. Needs NumPy; nothing of coilwright is used.
"""
import sys
import tomllib

import numpy as np

CELLS = 4
RATE_K_PER_S = 1.0 / 60.0
PROFILES, PIECES, DURATION_S = 400, 4, 6000.0
DEG_PER_H = np.degrees(1.0) * 3600.0
HIDDEN = {
    "d-mismatch": {"mismatch": 0.004},
    "e-sensor": {},
    "f-two": {"stress": 0.06, "bias_deg_per_h_per_k": 0.004},
}


def read(path):
    with open(path, "rb") as file:
        return tomllib.load(file)


class Coil:
    def __init__(self, model, film, hidden):
        w, t = model["winding"], model["thermal"]
        self.layers, pitch = w["layers"], 1e-6 * w.get("radial_pitch_um", model["fibre"]["outer_diameter_um"])
        bore = 0.5e-3 * w["inner_diameter_mm"]
        centre = bore + (np.arange(self.layers) + 0.5) * pitch
        self.lengths = w["turns_per_layer"] * 2 * np.pi * centre
        whole = self.lengths.sum()
        diameter = 2 * (centre * self.lengths).sum() / whole
        stress = 1.0 / centre**2
        stress -= (stress * self.lengths).sum() / whole
        path = 1.0 + hidden.get("stress", 0.0) * stress / np.abs(stress).max()
        fibre = model["fibre"]
        self.factor = fibre["refractive_index"] * fibre["thermo_optic_per_k"] * path / (whole * diameter) * DEG_PER_H
        self.mismatch, self.bias = hidden.get("mismatch", 0.0), hidden.get("bias_deg_per_h_per_k", 0.0)
        edges = bore + np.arange(self.layers * CELLS + 1) * pitch / CELLS
        k, c = t["conductivity_w_per_m_k"], t["volumetric_heat_capacity_j_per_m3_k"]
        heat = c * np.pi * (edges[1:] ** 2 - edges[:-1] ** 2)
        middle = 0.5 * (edges[1:] + edges[:-1])
        between = 2 * np.pi * k / np.log(middle[1:] / middle[:-1])
        outside = 1.0 / (np.log(edges[-1] / middle[-1]) / (2 * np.pi * k) + 1.0 / (2 * np.pi * edges[-1] * film))
        n = len(heat)
        matrix = np.zeros((n, n))
        for i, g in enumerate(between):
            matrix[i, i] -= g
            matrix[i + 1, i + 1] -= g
            matrix[i, i + 1] += g
            matrix[i + 1, i] += g
        matrix[-1, -1] -= outside
        root = np.sqrt(heat)
        self.values, vectors = np.linalg.eigh(matrix / np.outer(root, root))
        self.modes = vectors.T @ root  # of a uniform temperature
        shape = (vectors / root[:, None]).reshape(self.layers, CELLS, n)
        areas = heat.reshape(self.layers, CELLS)
        self.mean = (shape * (areas / areas.sum(1, keepdims=True))[:, :, None]).sum(1)
        self.share = heat.reshape(self.layers, CELLS).sum(1) / heat.sum()

    def weights(self, segments):
        order = np.argsort(segments)
        ends = np.concatenate([[0.0], np.cumsum(self.lengths[order])])
        whole = ends[-1]
        weights = np.zeros(self.layers)
        for place, layer in enumerate(order):
            a, b = ends[place], ends[place + 1]
            cut = min(max(0.5 * whole, a), b)
            square = lambda z: z * z - whole * z
            first, second = square(cut) - square(a), square(b) - square(cut)
            weights[layer] = first * (1 - 0.5 * self.mismatch) + second * (1 + 0.5 * self.mismatch)
        return weights * self.factor

    def rates(self, pieces):
        """Times, rates of the layers and temperatures over 20 °C of all layers' mean, along ramps (K/s, s)."""
        # Deviation from the drive: d' = A d - r, so every mode relaxes towards r m / lambda.
        state, drive = np.zeros(len(self.values)), 0.0
        rates, mean = [], []
        for ramp, duration in pieces:
            end = ramp * self.modes / self.values
            # Fine behind a break, then wider apart.
            times = np.concatenate([[0.0], np.geomspace(0.02, duration, 160)])
            decay = np.exp(np.outer(times, self.values))
            modes = end + decay * (state - end)
            slope = decay * (self.values * (state - end))
            rates.append(slope @ self.mean.T + ramp)
            mean.append((modes @ self.mean.T) @ self.share + drive + ramp * times)
            state, drive = modes[-1], drive + ramp * duration
        return np.concatenate(rates), np.concatenate(mean)


def main():
    record, model, film, *named = sys.argv[1:]
    coil = Coil(read(model), float(film), HIDDEN[record])
    patterns = {}
    for pair in named:
        name, path = pair.split("=", 1)
        patterns[name] = coil.weights(np.array(read(path)["segments"]))
    weights = np.array(list(patterns.values()))
    random = np.random.default_rng(20261123)
    worst, alone = np.zeros(len(weights)), np.zeros(len(weights))
    for _ in range(PROFILES):
        ramps = random.uniform(-RATE_K_PER_S, RATE_K_PER_S, PIECES)
        rates, mean = coil.rates([(ramp, DURATION_S / PIECES) for ramp in ramps])
        errors = rates @ weights.T
        alone = np.maximum(alone, np.abs(errors).max(0))
        worst = np.maximum(worst, np.abs(errors + coil.bias * mean[:, None]).max(0))
    times = np.concatenate([[0.0], np.geomspace(1e-3, 1e6, 20000)])
    step = np.exp(np.outer(times, coil.values)) * (-coil.modes)
    response = (step @ coil.mean.T + 1.0) @ weights.T * RATE_K_PER_S
    bound = np.abs(response[0]) + np.abs(np.diff(response, axis=0)).sum(0)
    print("winding worst coil_alone guaranteed_coil_alone [deg/h]")
    for name, *numbers in sorted(zip(patterns, worst, alone, bound), key=lambda row: row[1]):
        print(name, *(f"{v:.5f}" for v in numbers))


if __name__ == "__main__":
    main()
