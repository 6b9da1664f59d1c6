"""A thermal-chamber measurement of a fibre coil, simulated without any of coilwright's code.

Axisymmetric finite volumes (four cells a layer; 2-D only where a flange is heated), steps of 1 s, true layer radii and
lengths, a film to the chamber's air. Linear fields are stepped mode by mode with the exact exponential; a conductivity
that depends on temperature is stepped with an L-stable SDIRK2. A rate is the mean over the 10 s that end at its stamp; a
temperature is instantaneous, of the outermost layer's mean, with white noise and a resolution of 1 mK.
"""
import numpy as np
from scipy.linalg import eigh, solve_banded
from scipy.signal import lfilter

CELLS, AXIAL_CELLS = 4, 24
FILM = 25.0  # W/(m2 K)
DEG_PER_H = np.degrees(1.0) * 3600.0
WORDS = {"dip": "AB", "qua": "ABBA", "oct": "ABBABAAB", "hex": "ABBABAABBAABABBA"}


def segments(name, n):
    """Segment of each layer, innermost first."""
    h = n // 2
    if name == "zyl":
        return np.arange(1, n + 1)
    if name == "sym":
        return np.r_[np.arange(h, 0, -1), np.arange(n, h, -1)]
    word, a, b, out = WORDS[name], h, h + 1, []
    assert n % len(word) == 0
    for j in range(n):
        if word[j % len(word)] == "A":
            out.append(a)
            a -= 1
        else:
            out.append(b)
            b += 1
    return np.array(out)


class Coil:
    """The coil as it is (declared values with the hidden errors applied)."""

    def __init__(self, declared, hidden):
        f, w, t = declared["fibre"], declared["winding"], declared["thermal"]
        self.n_layers, pitch = w["layers"], w["radial_pitch_um"] * 1e-6
        self.pitch, self.bore = pitch, w["inner_diameter_mm"] * 5e-4
        self.radius = self.bore + (np.arange(self.n_layers) + 0.5) * pitch
        turns = np.full(self.n_layers, float(w["turns_per_layer"]))
        turns[1::2] -= hidden.get("turn_mismatch", 0.0)
        self.height = w["axial_pitch_um"] * 1e-6 * turns.max()
        self.length = 2 * np.pi * self.radius * turns
        self.total = self.length.sum()
        self.diameter = 2 * (self.bore + self.n_layers * pitch / 2)
        self.index = f["refractive_index"]
        self.kappa = f["thermo_optic_per_k"] * hidden.get("thermo_optic_factor", 1.0)
        self.k = t["conductivity_w_per_m_k"] * hidden.get("conductivity_factor", 1.0)
        self.c = t["volumetric_heat_capacity_j_per_m3_k"]
        self.c *= hidden.get("heat_capacity_factor", 1.0)
        seg = np.array(hidden["wound_segments"]) if "wound_segments" in hidden else segments(hidden.get("wound_as", w["pattern"]), self.n_layers)
        # Integrals of (2z - L) dz over each layer's part in either half of the fibre.
        self.half_a, self.half_b = np.zeros(self.n_layers), np.zeros(self.n_layers)
        self.direction = np.zeros(self.n_layers)
        first = seg[0]
        outward = first == 1 or (first != self.n_layers and first > self.n_layers // 2)
        z, mid = 0.0, self.total / 2
        for layer in np.argsort(seg):
            a, b = z, z + self.length[layer]
            m = min(max(mid, a), b)
            self.half_a[layer] = (m * m - a * a) - self.total * (m - a)
            self.half_b[layer] = (b * b - m * m) - self.total * (b - m)
            same = (seg[layer] - first) % 2 == 0
            self.direction[layer] = 1.0 if outward == same else -1.0
            z = b
        self.scale = self.index / (self.total * self.diameter) * DEG_PER_H  # deg/h per m2 of kappa * rate


def radial(coil, film, spool=None, gap=None):
    """Capacities, conductances between neighbours, conductances to the air, layer averages; all per radian and metre.

    `gap` is a layer (1 innermost) and the conductance [W/(m2 K)] of the contact above it."""
    n = coil.n_layers * CELLS
    edge = coil.bore + np.arange(n + 1) * coil.pitch / CELLS
    centre = 0.5 * (edge[1:] + edge[:-1])
    cap = coil.c * 0.5 * (edge[1:] ** 2 - edge[:-1] ** 2)
    link = coil.k / np.log(centre[1:] / centre[:-1])
    if gap:
        below = gap[0] * CELLS
        link[below - 1] = 1.0 / (1.0 / link[below - 1] + 1.0 / (gap[1] * edge[below]))
    air = np.zeros(n)
    air[-1] = 1.0 / (np.log(edge[-1] / centre[-1]) / coil.k + 1.0 / (film * edge[-1]))
    mean = np.zeros((coil.n_layers, n))
    for j in range(coil.n_layers):
        part = cap[j * CELLS:(j + 1) * CELLS]
        mean[j, j * CELLS:(j + 1) * CELLS] = part / part.sum()
    bore = np.zeros(n)
    bore[0] = edge[0]
    if spool:
        heat, contact, mount = spool
        cap = np.r_[heat * edge[0], cap]
        link = np.r_[1.0 / (np.log(centre[0] / edge[0]) / coil.k + 1.0 / (contact * edge[0])), link]
        air = np.r_[mount * edge[0], air]
        mean = np.hstack([np.zeros((coil.n_layers, 1)), mean])
        bore = np.r_[edge[0], np.zeros(n)]
    return cap, link, air, mean, bore


def modes(cap, link, air):
    n = len(cap)
    op = np.diag(air.copy())
    i = np.arange(n - 1)
    op[i, i] += link
    op[i + 1, i + 1] += link
    op[i, i + 1] -= link
    op[i + 1, i] -= link
    root = np.sqrt(cap)
    rate, vec = eigh(op / np.outer(root, root))
    return rate, vec / root[:, None], vec.T / root[None, :]  # T = right q, q' = -rate q + left f


def follow(rate, u, dt=1.0, start=None):
    """q' = -rate q + u(t), u linear between samples, in equilibrium at first unless a start is given."""
    e = np.exp(-rate * dt)
    phi1 = -np.expm1(-rate * dt) / rate
    phi2 = (dt - phi1) / (rate * dt)
    drive = np.r_[0.0, (phi1 - phi2) * u[:-1] + phi2 * u[1:]]
    drive[0] = u[0] / rate if start is None else start
    return lfilter([1.0], [1.0, -e], drive)


def linear_field(coil, air, hidden, start_s=0):
    """Layer means (and axial moments of temperature, or None) at every second; the record's time 0 is at `start_s`."""
    spool = gap = None
    if "spool_capacity" in hidden:
        spool = (hidden["spool_capacity"], hidden["spool_contact"], hidden.get("spool_mount", 0.0))
    if "gap_above" in hidden:
        gap = (hidden["gap_above"], hidden["gap_conductance"])
    if "films" in hidden:
        return switched_field(coil, air, hidden["films"], start_s, spool, gap), None
    cap, link, to_air, mean, bore = radial(coil, hidden.get("film", FILM), spool, gap)
    rate, right, left = modes(cap, link, to_air)
    t = np.maximum(np.arange(len(air), dtype=float) - start_s, 0.0)
    lay = mean @ right
    if "flange_film" not in hidden:
        gain, heat = left @ to_air, left @ bore
        flux = None
        if "heater_power" in hidden:
            flux = hidden["heater_power"] * -np.expm1(-t / hidden["heater_tau"])
        q = np.empty((len(rate), len(air)))
        for m in range(len(rate)):
            u = gain[m] * air
            if flux is not None:
                u = u + heat[m] * flux
            q[m] = follow(rate[m], u)
        return (lay @ q).T, None
    # One flange with a film to the air: the operator is a sum of a radial and an axial one.
    nz, dz = AXIAL_CELLS, coil.height / AXIAL_CELLS
    az = np.zeros(nz)
    at = 0 if hidden.get("flange", "first") == "first" else nz - 1
    az[at] = 1.0 / (0.5 * dz / coil.k + 1.0 / hidden["flange_film"])
    zrate, zright, zleft = modes(np.full(nz, coil.c * dz), np.full(nz - 1, coil.k / dz), az)
    zeta = (np.arange(nz) + 0.5) / nz - 0.5
    gain_r, one_r = left @ to_air, left @ cap
    gain_z, one_z = zleft @ az, zleft @ np.full(nz, coil.c * dz)
    mean_t, moment_t = np.zeros((coil.n_layers, len(air))), np.zeros((coil.n_layers, len(air)))
    for b in range(nz):
        q = np.empty((len(rate), len(air)))
        for a in range(len(rate)):
            strength = gain_r[a] * one_z[b] + one_r[a] * gain_z[b]
            q[a] = follow(rate[a] + zrate[b], strength * air)
        layer = lay @ q
        mean_t += layer * zright[:, b].mean()
        moment_t += layer * (zright[:, b] * zeta).mean()
    return mean_t.T, moment_t.T


def switched_field(coil, air, films, start_s, spool=None, gap=None):
    """Layer means at every second where a fan changes the film: `films` holds (time [s], film) from then on, the first at 0."""
    ends = [min(max(int(t) + start_s, 0), len(air) - 1) for t, _ in films[1:]] + [len(air) - 1]
    parts, first, state = [], 0, None
    for (_, film), last in zip(films, ends):
        cap, link, to_air, mean, _ = radial(coil, film, spool, gap)
        rate, right, left = modes(cap, link, to_air)
        gain = left @ to_air
        start = None if state is None else left @ (cap * state)
        u = air[first:last + 1]
        q = np.array([follow(rate[m], gain[m] * u, start=None if start is None else start[m]) for m in range(len(rate))])
        state = right @ q[:, -1]
        parts.append(((mean @ right) @ q).T[0 if first == 0 else 1:])
        first = last
    return np.vstack(parts)


def nonlinear_field(coil, air, slope):
    """k = k0 (1 + slope (T - 20)): SDIRK2 (L-stable), k taken at the extrapolated middle of the step."""
    cap, link, to_air, mean, _ = radial(coil, FILM)
    n, g = len(cap), 1.0 - np.sqrt(0.5)
    edge_r = coil.bore + coil.n_layers * coil.pitch
    shell = 1.0 / (to_air[-1]) - 1.0 / (FILM * edge_r)  # conductive part of the last resistance, for k0
    temp = np.full(n, air[0])
    before = temp.copy()
    out = np.empty((len(air), coil.n_layers))
    out[0] = mean @ temp
    band = np.zeros((3, n))
    for i in range(1, len(air)):
        guess = 1.5 * temp - 0.5 * before
        factor = 1.0 + slope * (0.5 * (guess[1:] + guess[:-1]) - 20.0)
        c = link * factor
        e = 1.0 / (shell / (1.0 + slope * (guess[-1] - 20.0)) + 1.0 / (FILM * edge_r))
        diag = np.zeros(n)
        diag[:-1] += c
        diag[1:] += c
        diag[-1] += e
        band[0, 1:] = -g * c / cap[:-1]
        band[2, :-1] = -g * c / cap[1:]
        band[1] = 1.0 + g * diag / cap

        def slope_of(state, a):
            d = -diag * state
            d[:-1] += c * state[1:]
            d[1:] += c * state[:-1]
            d[-1] += e * a
            return d / cap

        def stage(base, a):
            rhs = slope_of(base, a)
            return solve_banded((1, 1), band, rhs, check_finite=False)

        a0, a1 = air[i - 1], air[i]
        k1 = stage(temp, a0 + g * (a1 - a0))
        k2 = stage(temp + (1.0 - g) * k1, a1)
        before, temp = temp, temp + (1.0 - g) * k1 + g * k2
        out[i] = mean @ temp
    return out, None


def coil_rate(coil, hidden, air, start_s=0):
    """Layers at every second (seconds x layers), their rate and the coil's rate [deg/h] over each second, and the effects' bias."""
    if "conductivity_slope" in hidden:
        layers, moment = nonlinear_field(coil, air, hidden["conductivity_slope"])
    else:
        layers, moment = linear_field(coil, air, hidden, start_s)
    mid = 0.5 * (layers[1:] + layers[:-1])
    rate = np.diff(layers, axis=0)
    share = coil.length / coil.total
    pack, pack_rate = mid @ share, rate @ share
    kappa = np.full(mid.shape, coil.kappa)
    if "thermo_optic_slope" in hidden:
        kappa = kappa * (1.0 + hidden["thermo_optic_slope"] * (mid - 20.0))
    if "stress" in hidden:
        shape = coil.radius ** -2.0
        shape = shape - shape @ share
        kappa = kappa * (1.0 + hidden["stress"] * shape / np.abs(shape).max())
    if "gain_layer" in hidden:
        kappa = kappa.copy()
        kappa[:, hidden["gain_layer"] - 1] *= 1.0 + hidden["gain_change"]
    differ = np.zeros(mid.shape)
    if "mismatch" in hidden:
        differ = differ + hidden["mismatch"]
    if "glass_mismatch" in hidden:
        differ = differ + hidden["glass_mismatch"] / (1.0 + np.exp((mid - hidden["glass_transition"]) / hidden["glass_width"]))
    omega = coil.scale * np.sum(
        kappa * rate * ((1.0 - 0.5 * differ) * coil.half_a + (1.0 + 0.5 * differ) * coil.half_b), axis=1)
    if moment is not None:
        omega += coil.scale * np.sum(kappa * np.diff(moment, axis=0) * 2.0 * coil.direction * coil.length ** 2, axis=1)
    air_rate = np.diff(air)
    if "lead_offset" in hidden:
        # Surplus 2d at end A: the coil sits 2d further along a fibre of L + 2d.
        extra = 2.0 * hidden["lead_offset"]
        lead_rate = air_rate if hidden.get("lead", "ambient") == "ambient" else 0.0 * air_rate
        omega += coil.scale * extra * coil.kappa * ((rate @ coil.length) - lead_rate * coil.total)
    if "asymmetry" in hidden:
        omega *= 1.0 + hidden["asymmetry"] * np.sign(pack_rate)
    if hidden.get("reversed"):
        omega = -omega
    warm = pack - 20.0
    omega += hidden.get("bias_per_K", 0.0) * warm + hidden.get("bias_per_K2", 0.0) * warm ** 2
    omega += hidden.get("bias_rate", 0.0) * pack_rate
    omega += hidden.get("bias_gradient", 0.0) * (rate[:, -1] - rate[:, 0])
    return layers, rate, omega


def simulate(declared, hidden, air, seed, sigma, offset, channels=(), temperature_sigma=0.004):
    """One record: header and rows. `air` holds the chamber's temperature [C] at every second from 0 on."""
    rng = np.random.default_rng(seed)
    coil = Coil(declared, hidden)
    layers, rate, omega = coil_rate(coil, hidden, air)
    share = coil.length / coil.total
    pack, pack_rate = 0.5 * (layers[1:] + layers[:-1]) @ share, rate @ share
    t = np.arange(1, len(air)) - 0.5
    omega += outside_catalogue(hidden, t, pack, pack_rate)

    stamps = np.arange(0, len(air), 10)
    total = np.r_[0.0, np.cumsum(omega)]
    clean = np.empty(len(stamps))
    clean[1:] = (total[stamps[1:]] - total[stamps[1:] - 10]) / 10.0
    # Before the record the pack is at rest; only what does not need heat is there already.
    clean[0] = hidden.get("bias_per_K", 0.0) * (air[0] - 20.0) + outside_catalogue(hidden, t[:1], pack[:1], 0.0 * pack[:1])[0]
    outer = layers[:, -1]
    seen = air if hidden.get("sensor_in_air") or declared["sensor"]["location"] == "ambient" else outer
    if "sensor_lag" in hidden:
        seen = follow(1.0 / hidden["sensor_lag"], seen / hidden["sensor_lag"])
    header, columns = ["time_s", "temperature_c", "rate_deg_per_h"], []
    for channel in channels:
        values = make_channel(channel, stamps.astype(float), outer[stamps], rng)
        clean = clean + channel.get("gain", 0.0) * values
        header.append(channel["name"])
        columns.append(values)
    reading = np.round(seen[stamps] + temperature_sigma * rng.standard_normal(len(stamps)), 3)
    noisy = clean + offset + sigma * rng.standard_normal(len(stamps))
    if hidden.get("jump_size"):
        noisy[stamps > hidden["jump_at"]] += hidden["jump_size"]
    return header, np.column_stack([stamps, reading, noisy] + columns), clean


def outside_catalogue(hidden, t, pack, pack_rate):
    """Rates that no effect of the catalogue describes."""
    out = np.zeros(len(t))
    if "sine_amplitude" in hidden:
        out += hidden["sine_amplitude"] * np.sin(2 * np.pi * t / hidden["sine_period"] + hidden.get("sine_phase", 0.7))
    if "square_amplitude" in hidden:
        out += hidden["square_amplitude"] * np.sign(np.sin(2 * np.pi * t / hidden["square_period"]))
    if "ageing_amplitude" in hidden:
        out += hidden["ageing_amplitude"] * -np.expm1(-t / hidden["ageing_tau"])
    if "drift_per_h" in hidden:
        out += hidden["drift_per_h"] * t / 3600.0
    if "humidity_gain" in hidden and len(t) > 1:
        # A slow state, far slower than the pack, driven by temperature (moisture in the potting).
        out += hidden["humidity_gain"] * (follow(1.0 / hidden["humidity_tau"], pack / hidden["humidity_tau"]) - 20.0)
    if "hysteresis_gain" in hidden and len(t) > 1:
        half, state, play = 0.5 * hidden["hysteresis_width"], pack[0], np.empty(len(pack))
        for i, v in enumerate(pack):
            state = min(max(state, v - half), v + half)
            play[i] = state
        out += hidden["hysteresis_gain"] * (play - pack)
    if "rate_square" in hidden:
        out += hidden["rate_square"] * (pack_rate * 60.0) ** 2
    if "temperature_sine" in hidden:
        # An etalon: the bias goes up and down with temperature.
        out += hidden["temperature_sine"] * np.sin(2 * np.pi * (pack - 20.0) / hidden["temperature_sine_period"])
    return out


def make_channel(channel, t, outer, rng):
    kind = channel["kind"]
    n = len(t)
    if kind == "supply":
        return 0.1 * np.sin(2 * np.pi * t / 1130.0) + 0.12 * np.sin(2 * np.pi * t / 5100.0 + 1.1) + 0.1 * np.exp(-t / 9000.0)
    if kind == "noise":
        return channel.get("size", 1.0) * rng.standard_normal(n)
    if kind == "walk":
        return channel.get("size", 0.02) * np.cumsum(rng.standard_normal(n))
    if kind == "warm":
        return 5.0 + 0.02 * outer + 0.01 * rng.standard_normal(n)
    raise ValueError(kind)


def calibration_air():
    """-20 ... 60 C at 1 C/min with soaks of 45 min."""
    knots = np.array([0, 2700, 5100, 7800, 12600, 15300, 17700, 20400.0])
    return np.interp(np.arange(20411.0), knots, [20, 20, 60, 60, -20, -20, 20, 20])


def validation_air(seed):
    """Ramps of many rates between soaks, with a slow sine on top that begins smoothly."""
    rng = np.random.default_rng(seed)
    times, temps = [0.0, 900.0], [20.0, 20.0]
    for _ in range(rng.integers(6, 10)):
        for _ in range(60):
            rate = rng.uniform(0.3, 3.0) / 60.0 * rng.choice([-1, 1])
            change = rng.uniform(5.0, 35.0) * np.sign(rate)
            if -22.0 < temps[-1] + change < 55.0:
                break
        times.append(times[-1] + round(change / rate))
        temps.append(temps[-1] + change)
        times.append(times[-1] + float(rng.integers(60, 220)) * 10 * rng.choice([0.2, 1.0]) // 1)
        temps.append(temps[-1])
    end = int(times[-1] // 10 * 10) + 1
    t = np.arange(float(end))
    sine = rng.uniform(0.8, 2.5) * (1 - np.exp(-(t / 1500.0) ** 2)) * np.sin(2 * np.pi * t / rng.uniform(3500.0, 7000.0))
    return np.interp(t, times, temps) + sine


def write_record(path, header, rows):
    with open(path, "w") as f:
        f.write(",".join(header) + "\n")
        for r in rows:
            f.write("%.1f,%.3f,%.5f" % (r[0], r[1], r[2]) + "".join(",%.4f" % v for v in r[3:]) + "\n")
