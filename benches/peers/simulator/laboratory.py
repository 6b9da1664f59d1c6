"""What a laboratory adds to the coil: chambers, sensors, the gyro's own noise, loggers; and effects that stand in no list.

A chamber gives the air [C] at every second, from `start_s` seconds before the record on (a record may begin in the middle of a
ramp). A logger gives stamps; a rate is the mean over `rate_mean_s` that ends at its stamp, a temperature is instantaneous.
"""
import numpy as np
from scipy.signal import lfilter
from simulator import Coil, coil_rate, follow

REST_S = 120  # seconds at rest before a record that begins at rest: the first mean needs them


def ou(rng, n, sigma, tau, dt=1.0):
    """Ornstein-Uhlenbeck noise, stationary from the first sample on."""
    a = np.exp(-dt / tau)
    kicks = sigma * np.sqrt(1.0 - a * a) * rng.standard_normal(n)
    kicks[0] = sigma * rng.standard_normal()
    return lfilter([1.0], [1.0, -a], kicks)


def ripple(rng, n, amplitude, period, wander=0.15):
    """A compressor: a cycle whose period and size wander."""
    phase = 2 * np.pi * np.cumsum(1.0 / (period * np.exp(ou(rng, n, wander, 4 * period)))) + rng.uniform(0, 2 * np.pi)
    return amplitude * (1.0 + ou(rng, n, 0.2, 6 * period)) * np.sin(phase)


def second_order(target, wn, zeta):
    """The air behind a controller; its set point is `target`."""
    dt = 1.0
    air, slope, out = target[0], 0.0, np.empty(len(target))
    for i, aim in enumerate(target):
        slope += dt * (wn * wn * (aim - air) - 2 * zeta * wn * slope)
        air += dt * slope
        out[i] = air
    return out


def knots_to_seconds(times, temps):
    return np.interp(np.arange(int(times[-1]) + 1.0), times, temps)


def cycle(rng, part):
    """Set points: a cycle over the whole range, or ramps of many rates between short soaks."""
    if part == "calibration":
        top, bottom = rng.uniform(48, 62), rng.uniform(-28, -8)
        rate = rng.uniform(0.8, 1.6) / 60.0
        times, temps = [0.0, rng.uniform(600, 1200)], [20.0, 20.0]
        for aim in (top, bottom, 20.0):
            times.append(times[-1] + abs(aim - temps[-1]) / rate)
            temps.append(aim)
            times.append(times[-1] + rng.uniform(1500, 2400))
            temps.append(aim)
    else:
        times, temps = [0.0, rng.uniform(400, 900)], [20.0, 20.0]
        for aim in list(rng.uniform(-15, 56, size=rng.integers(5, 8))) + [20.0]:
            times.append(times[-1] + max(abs(aim - temps[-1]), 2.0) / (rng.uniform(0.4, 3.0) / 60.0))
            temps.append(aim)
            times.append(times[-1] + rng.uniform(300, 1500))
            temps.append(aim)
    return knots_to_seconds(times, temps)


def controlled(rng, part, **p):
    """Second-order control with overshoot, compressor ripple, turbulence."""
    target = cycle(rng, part)
    if p.get("mid_ramp"):
        cut = int(rng.uniform(200, 600))
        start = np.interp(np.arange(1500.0 + cut), [0, 1500 - cut, 1500 + cut], [20.0, 20.0, 20.0 + rng.choice([-1, 1]) * rng.uniform(0.8, 2.0) / 60.0 * 2 * cut])
        target = np.r_[start, target - target[0] + start[-1]]
        lead = 1500
    else:
        target, lead = np.r_[np.full(REST_S, target[0]), target], REST_S
    n = len(target)
    air = second_order(target, p["wn"], p["zeta"])
    return air + ripple(rng, n, p["ripple"], p["period"]) + ou(rng, n, p["turbulence"], p["turbulence_s"]), lead


def ideal(rng, part, **p):
    """Straight lines."""
    target = cycle(rng, part)
    return np.r_[np.full(REST_S, target[0]), target], REST_S


def stage(rng, part, **p):
    """A thermoelectric stage: steps, each approached exponentially, some through a second, faster lag; hardly any ripple."""
    span = 15500 if part == "calibration" else 13000
    target = np.full(REST_S + span, 20.0)
    at = REST_S + int(rng.uniform(500, 1100))
    while at < len(target) - 900:
        hold = int(rng.uniform(400, 1700))
        target[at:] = np.clip(target[at] + rng.choice([-1, 1]) * rng.uniform(2, 24), -18, 58)
        at += hold
    air = follow(1.0 / p["stage_s"], target / p["stage_s"])
    if p["second_s"]:
        air = follow(1.0 / p["second_s"], air / p["second_s"])
    return air + ou(rng, len(air), p["turbulence"], p["turbulence_s"]), REST_S


def outdoors(rng, part, **p):
    """A day or more in the open: sun, clouds, gusts."""
    lead = 7200
    n = lead + int(p["days"] * 86400 * (1.0 if part == "calibration" else 0.8))
    t = np.arange(n)
    hour = 2 * np.pi * (t / 86400.0 + rng.uniform(0, 1))
    air = rng.uniform(5, 22) + rng.uniform(6, 12) * (np.sin(hour) + 0.25 * np.sin(2 * hour + rng.uniform(0, 6)))
    sun = np.clip(np.sin(hour), 0, None) * (1.0 + 0.7 * np.tanh(2 * ou(rng, n, 1.0, 2400.0)))
    return air + 3.0 * sun + ou(rng, n, 0.5, 900.0) + ou(rng, n, p["turbulence"], p["turbulence_s"]), lead


def thermostat(rng, part, **p):
    """On and off about a set point that follows the cycle: a saw of varying period."""
    target = cycle(rng, part)
    target = np.r_[np.full(REST_S, target[0]), target]
    air, heat, out, on = target[0], 0.0, np.empty(len(target)), 1.0
    gusts = ou(rng, len(target), 1.0, 60.0)
    for i, aim in enumerate(target):
        if air > aim + p["band"]:
            on = -1.0
        elif air < aim - p["band"]:
            on = 1.0
        heat += (p["power"] * on * (1.0 + 0.15 * gusts[i]) - heat) / 40.0
        air += heat
        out[i] = air
    return out + ou(rng, len(out), p["turbulence"], p["turbulence_s"]), REST_S


def drawn_chamber(rng, kind):
    """A chamber of a kind, its constants drawn."""
    p = dict(turbulence=float(rng.uniform(0.01, 0.06)), turbulence_s=float(rng.uniform(20, 70)))
    if kind in ("controlled", "mid_ramp", "fan"):
        p |= dict(wn=float(1.0 / rng.uniform(80, 160)), zeta=float(rng.uniform(0.4, 0.95)), ripple=float(rng.uniform(0.04, 0.22)),
                  period=float(rng.uniform(100, 320)), mid_ramp=kind == "mid_ramp")
    if kind == "stage":
        p |= dict(stage_s=float(rng.uniform(25, 180)), turbulence=float(rng.uniform(0.001, 0.01)), second_s=float(rng.choice([0, 0, 8])))
    if kind == "outdoors":
        p |= dict(days=1.1, turbulence=float(rng.uniform(0.05, 0.25)), turbulence_s=float(rng.uniform(30, 120)))
    if kind == "thermostat":
        p |= dict(band=float(rng.uniform(0.1, 0.35)), power=float(rng.uniform(0.06, 0.09)))
    return dict(kind=kind, **{k: (round(v, 5) if isinstance(v, float) else v) for k, v in p.items()})


COURSES = dict(controlled=controlled, mid_ramp=controlled, fan=controlled, stage=stage, outdoors=outdoors, thermostat=thermostat, ideal=ideal)


def air_of(rng, chamber, part):
    p = {k: v for k, v in chamber.items() if k != "kind"}
    return COURSES[chamber["kind"]](rng, part, **p)


def stamps_of(rng, logger, span):
    """The logger's stamps [s]: regular, or each interval drawn."""
    step = logger["step_s"]
    if logger.get("jitter"):
        t = np.cumsum(np.r_[0.0, np.round(step * rng.uniform(1 - logger["jitter"], 1 + logger["jitter"], int(span / step * 1.5)), 1)])
        return t[t <= span]
    return np.arange(0, span + 1e-9, step)


def play(x, half):
    state, out = x[0], np.empty(len(x))
    for i, v in enumerate(x):
        state = min(max(state, v - half), v + half)
        out[i] = state
    return out


def lag(x, tau):
    return follow(1.0 / tau, x / tau, start=x[0])


def softplus(x):
    return np.logaddexp(0.0, x)


# Terms that no catalogue lists; v has t, T_mean, T_in, T_out [C], rate [K/min] and the columns, at every second of the record.
TERMS = {
    "relaxation": lambda v, p: p["gain"] * (v["T_mean"] - lag(v["T_mean"], p["tau_s"])),
    "one_sided_relaxation": lambda v, p: p["gain"] * np.maximum(v["T_mean"] - lag(v["T_mean"], p["tau_s"]), 0.0),
    "hysteresis": lambda v, p: p["gain"] * (play(v["T_in"], p["half_k"]) - v["T_in"]),
    "product": lambda v, p: p["gain"] * v["rate"] * (v["T_mean"] - 20.0),
    "cubic": lambda v, p: p["gain"] * ((v["T_mean"] - 20.0) / 30.0) ** 3,
    "rate_times_size": lambda v, p: p["gain"] * v["rate"] * np.abs(v["rate"]),
    "softplus": lambda v, p: p["gain"] * p["width_k"] * softplus((v["T_mean"] - p["at_c"]) / p["width_k"]),
    "saturation": lambda v, p: p["gain"] * np.tanh(v["rate"] / p["knee"]),
    "ageing": lambda v, p: p["gain"] * np.log1p(v["t"] / p["tau_s"]),
    "column_square": lambda v, p: p["gain"] * v[p["column"]] ** 2,
    "column_lag": lambda v, p: p["gain"] * lag(v[p["column"]], p["tau_s"]),
    "column_lag_of_size": lambda v, p: p["gain"] * lag(np.abs(v[p["column"]]), p["tau_s"]),
    "column_times_temperature": lambda v, p: p["gain"] * v[p["column"]] * (v["T_mean"] - 20.0),
    "column_threshold": lambda v, p: p["gain"] * np.maximum(v[p["column"]] - p["at"], 0.0),
    "not_logged_cycle": lambda v, p: p["gain"] * np.sin(2 * np.pi * v["t"] / p["period_s"] + v["phase"]),
}
COLUMNS = {  # level, deviation, correlation time [s]
    "fan_a": (0.0, 1.0, 500.0), "heater_a": (0.9, 0.3, 300.0), "humidity_pct": (40.0, 9.0, 4500.0), "supply_v": (5.0, 0.04, 900.0),
    "pressure_hpa": (1011.0, 0.9, 2500.0), "laser_ma": (60.0, 0.5, 1500.0),
}


def columns_of(rng, names, n):
    out = {}
    for name in names:
        level, size, tau = COLUMNS[name]
        x = ou(rng, n, 1.0, tau) + 0.2 * ou(rng, n, 1.0, tau / 8)
        out[name] = level + size * x
    return out


def flicker(rng, n, rms, dt):
    """1/f noise as a sum of first-order noises, one an octave and a half."""
    taus = np.geomspace(15.0, 15000.0, 8)
    return sum(ou(rng, n, rms / np.sqrt(len(taus)), tau, dt) for tau in taus)


def record(declared, hidden, chamber, logger, gyro, part, seed):
    """One record: header, rows, and the rate without noise at the rows with and without the terms beyond the catalogue."""
    rng = np.random.default_rng(seed)
    coil = Coil(declared, hidden)
    air, lead = air_of(rng, chamber, part)
    if chamber["kind"] == "fan":
        film, at = chamber["film"], [float(x) for x in np.sort(rng.uniform(0.15, 0.9, 3)) * (len(air) - lead)]
        hidden = dict(hidden, films=[(0, film)] + [(t, film * (chamber["fan_factor"] if i % 2 == 0 else 1.0)) for i, t in enumerate(at)])
    layers, rate, omega = coil_rate(coil, hidden, air, lead)
    share = coil.length / coil.total
    names = logger.get("columns", [])
    n = len(air)
    columns = columns_of(rng, names, n)
    mid = lambda x: 0.5 * (x[1:] + x[:-1])
    v = dict(t=np.arange(n - lead - 1) + 0.5, T_mean=mid(layers @ share)[lead:], T_in=mid(layers[:, 0])[lead:], T_out=mid(layers[:, -1])[lead:],
             rate=(rate @ share)[lead:] * 60.0, phase=rng.uniform(0, 2 * np.pi))
    v |= {k: mid(c)[lead:] for k, c in columns.items()}
    extra = np.zeros(len(omega))
    for term in hidden.get("terms", []):
        said = TERMS[term["form"]](v, term)
        extra[lead:] += said
        extra[:lead] += said[0]
    for name, gain in hidden.get("channels", {}).items():
        omega = omega + gain * mid(columns[name] - COLUMNS[name][0])

    stamps = stamps_of(rng, logger, n - 1 - lead)
    mean = max(float(declared["sensor"]["rate_mean_s"]), 1.0)
    grid, at = np.arange(n) - lead, stamps

    def logged(x):
        total = np.r_[0.0, np.cumsum(x)]
        low = np.interp(at - mean, grid, total)
        return (np.interp(at, grid, total) - low) / mean

    plain, beyond = logged(omega), logged(extra)
    outer = layers[:, -1]
    seen = air if hidden.get("sensor_in_air") or declared["sensor"]["location"] == "ambient" else outer
    if "sensor_lag" in hidden:
        seen = follow(1.0 / hidden["sensor_lag"], seen / hidden["sensor_lag"])
    step = logger["resolution_k"]
    reading = np.interp(at, grid, seen) + logger["noise_k"] * rng.standard_normal(len(at))
    reading = np.round(reading / step) * step
    dt = logger["step_s"]
    noisy = plain + beyond + gyro["offset"] + gyro["sigma"] * rng.standard_normal(len(at))
    if gyro.get("flicker"):
        noisy += flicker(rng, len(at), gyro["flicker"], dt)
    if gyro.get("walk"):
        noisy += gyro["walk"] * np.cumsum(rng.standard_normal(len(at))) * np.sqrt(dt / 3600.0)
    for when, size in gyro.get("steps", {}).get(part, []):
        noisy[at > when] += size
    data = np.column_stack([at, reading, noisy] + [np.interp(at, grid, columns[k]) for k in names])
    if logger.get("spikes"):
        k = rng.integers(5, 15)
        data[rng.choice(np.arange(20, len(at)), k, replace=False), 1] = 85.0
        rows = rng.choice(np.arange(20, len(at)), k, replace=False)
        data[rows, 2] += rng.choice([-1, 1], k) * rng.uniform(20, 200, k) * gyro["sigma"]
    if logger.get("gaps"):
        keep = rng.random(len(at)) > 0.02
        for _ in range(2):
            first = int(rng.uniform(0.1, 0.9) * len(at))
            keep[first:first + int(rng.uniform(200, 700) / dt)] = False
        keep[0] = True
        data = data[keep]
    return ["time_s", "temperature_c", "rate_deg_per_h"] + list(names), data, plain, beyond


def write_record(path, header, rows):
    with open(path, "w") as f:
        f.write(",".join(header) + "\n")
        for r in rows:
            f.write("%.1f,%.4f,%.5f" % (r[0], r[1], r[2]) + "".join(",%.4f" % v for v in r[3:]) + "\n")
