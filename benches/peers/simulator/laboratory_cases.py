"""Draws trial cases under laboratory conditions: `python laboratory_cases.py DIR KIND SEED [COUNT]`, KIND one of lab, other, beyond, fan, controls.

One folder a case: coil.toml, calibration.csv, validation.csv, test.csv (a third record of another kind); truth.json and README.md
beside them. `lab`: listed effects, alone and together, and controls, in chambers of several kinds with coarse sensors, gaps, spikes
and flicker. `other`: outdoor days, thermoelectric stages, starts in a ramp, wrong declared numbers, other windings, reversed coils,
offset steps, random walk, slow and irregular rows, a fan that is switched. `beyond`: effects that no catalogue lists. `fan`: more of the fan. `controls`: nothing is hidden, in every kind of chamber.
"""
import json, os, sys, tomllib
import numpy as np
from cases import COILS, HEAT, OTHER, declared_text
from laboratory import COLUMNS, drawn_chamber, record, write_record
from simulator import segments

MORE_COILS = COILS | {
    "i": (48, 90, 130, 165, 170, 0.32, 1.75e6, 1.45, 1.0e-5, 1550),
    "j": (24, 64, 40, 150, 155, 0.38, 1.65e6, 1.452, 1.05e-5, 1310),
    "k": (64, 100, 150, 110, 115, 0.30, 1.80e6, 1.45, 0.95e-5, 1550),
}
# What may be scaled so that it is seen: the words of the simulator that the rate is linear in.
LINEAR = ["stress", "mismatch", "glass_mismatch", "thermo_optic_slope", "lead_offset", "turn_mismatch", "asymmetry", "bias_per_K", "bias_rate", "bias_gradient"]


def number(x, digits=3):
    return float(f"{x:.{digits}g}")


def drawn_coil(rng):
    coil = str(rng.choice(list(MORE_COILS)))
    layers = MORE_COILS[coil][0]
    pattern = str(rng.choice(["zyl", "dip", "dip", "sym"] + ["qua", "qua"] * (layers % 4 == 0) + ["oct"] * (layers % 8 == 0) + ["hex"] * (layers % 16 == 0)))
    return coil, pattern


def drawn_logger(rng, plain=False):
    # A sensor's noise and resolution; the noise of a coarse one is often below its step.
    resolution = 0.001 if plain else float(rng.choice([0.001, 0.001, 0.005, 0.01, 0.0625, 0.1]))
    logger = dict(step_s=10.0, rate_mean_s=10.0, resolution_k=resolution, noise_k=number(max(0.004, rng.uniform(0.2, 1.0) * resolution * 0.3)))
    if not plain:
        logger |= dict(gaps=bool(rng.random() < 0.35), spikes=bool(rng.random() < 0.25))
    return logger


def drawn_gyro(rng, logger, flicker=None):
    sigma = float(rng.choice([0.06, 0.12, 0.12, 0.24])) / np.sqrt(max(logger["rate_mean_s"], 1.0))
    gyro = dict(sigma=sigma, offset=number(rng.uniform(-0.25, 0.25)))
    share = flicker if flicker is not None else float(rng.choice([0, 0, 0.15, 0.3, 0.5]))
    return gyro | (dict(flicker=share * sigma) if share else {})


class Case:
    """What a case is made of; `expects` is what is to be said beside listed effects."""

    def __init__(self, rng, name, chamber, answers=(), hidden=None, **more):
        self.rng, self.name, self.answers, self.hidden = rng, name, list(answers), dict(hidden or {})
        self.coil, self.pattern = more.pop("coil", None) or drawn_coil(rng)
        self.chamber = drawn_chamber(rng, chamber)
        self.logger = more.pop("logger", None) or drawn_logger(rng)
        self.gyro = more.pop("gyro", None) or drawn_gyro(rng, self.logger)
        self.expects, self.conditions = more.pop("expects", {}), [chamber] + more.pop("conditions", [])
        # Of each effect the words of the simulator that it stands in; another winding's.
        self.words = more.pop("words", None) or {kind: list(self.hidden) for kind in self.answers}
        self.extra, self.declared = more.pop("extra", []), dict(more.pop("declared", {}))
        self.test_chamber, self.discoverable = more.pop("test_chamber", None), more.pop("discoverable", None)
        assert not more, more
        for kind, cond in (("gaps", "gaps"), ("spikes", "spikes")):
            if self.logger.get(kind):
                self.conditions.append(cond)
        if self.logger["resolution_k"] > 0.02:
            self.conditions.append("coarse")
        if self.gyro.get("flicker"):
            self.conditions.append("flicker")
        if self.chamber["kind"] == "fan":
            self.chamber |= dict(film=number(rng.uniform(15, 35)), fan_factor=number(rng.choice([rng.uniform(0.35, 0.6), rng.uniform(1.6, 2.5)])))

    def model_text(self):
        c = dict(name=self.name, pattern=self.pattern, **self.declared)
        text = declared_text(c, MORE_COILS[self.coil])
        return text.replace("rate_mean_s = 10.0", f"rate_mean_s = {self.logger['rate_mean_s']}")


def effect(rng, kind):
    hidden = (HEAT | OTHER)[kind](rng)
    more = {}
    if hidden.pop("declared_half", False):
        more["declared"] = dict(declared_half=True)
    if kind == "surface_film":
        hidden["film"] = number(rng.uniform(14, 45))
    if "gain" in hidden:
        hidden = dict(channels=dict(supply_v=number(hidden["gain"] * 6)))
        more["columns"] = ["supply_v"]
    return hidden, more


def with_effects(rng, name, chamber, kinds, **extra):
    hidden, declared, words, columns = {}, {}, {}, list(extra.pop("columns", []))
    for kind in kinds:
        h, more = effect(rng, kind)
        hidden |= h
        words[kind] = list(h)
        declared |= more.get("declared", {})
        columns += more.get("columns", [])
    logger = extra.pop("logger", None) or drawn_logger(rng)
    if columns:
        logger["columns"] = columns
    conditions = ["control" if not kinds else "one effect" if len(kinds) == 1 else "several effects"]
    return Case(rng, name, chamber, kinds, hidden, words=words, logger=logger, declared=declared, conditions=conditions + extra.pop("conditions", []), **extra)


def lab(rng):
    """Listed effects and controls in closed chambers."""
    chambers = ["controlled"] * 3 + ["thermostat"]
    out = []
    for i in range(10):
        columns = [c for c in ("supply_v", "laser_ma") if rng.random() < 0.3]
        gyro = None
        logger = drawn_logger(rng)
        if i == 0:
            logger = dict(step_s=1.0, rate_mean_s=1.0, resolution_k=0.005, noise_k=0.004)
        if i in (1, 2):
            gyro = drawn_gyro(rng, logger, flicker=0.5)
        out.append(with_effects(rng, f"control-{i}", str(rng.choice(chambers)), [], columns=columns, logger=logger, gyro=gyro))
    for kind in list(HEAT) + list(OTHER):
        out.append(with_effects(rng, f"one-{kind.replace(':', '-')}", str(rng.choice(chambers)), [kind]))
    for i in range(12):
        second = str(rng.choice([k for k in OTHER if k != "channel:supply_v"]))
        first = str(rng.choice([k for k in list(HEAT) + list(OTHER) if k != second and {k, second} != {"surface_film", "sensor_lag"}]))
        kinds = [first, second]
        if i >= 9:
            kinds.append(str(rng.choice([k for k in ("bias_temperature", "strain_mismatch", "sensor_lag", "channel:supply_v") if k not in kinds and not (k == "sensor_lag" and "surface_film" in kinds)])))
        out.append(with_effects(rng, f"several-{i}", str(rng.choice(chambers)), kinds))
    logger = dict(step_s=1.0, rate_mean_s=1.0, resolution_k=0.01, noise_k=0.005)
    out.append(with_effects(rng, "one-hertz-spool", "controlled", ["spool_mass"], logger=logger, conditions=["1 s rows"]))
    return out


def exchanged(rng, coil, pattern):
    layers = MORE_COILS[coil][0]
    seg = segments(pattern, layers)
    j = int(rng.integers(1, layers - 1))
    seg[j - 1], seg[j] = seg[j], seg[j - 1]
    return [j, j + 1], [int(s) for s in seg]


def other(rng):
    """What a chamber and a logger may do otherwise, wrong numbers, wrong windings."""
    out = []
    sixty = lambda: dict(step_s=60.0, rate_mean_s=60.0, resolution_k=float(rng.choice([0.01, 0.0625, 0.1])), noise_k=0.01)
    scaled = ["strain_mismatch", "bias_temperature", "sensor_lag", "spool_mass", "stress_gradient", "thermo_optic_temperature"]
    pick = lambda: [str(rng.choice(scaled))]
    for i in range(4):
        out.append(with_effects(rng, f"outdoors-{i}", "outdoors", pick() if i % 2 else [], logger=sixty(), conditions=["60 s rows"]))
    for i in range(4):
        out.append(with_effects(rng, f"stage-{i}", "stage", pick() if i else [], logger=drawn_logger(rng, plain=i < 2)))
    for i in range(3):
        out.append(with_effects(rng, f"mid-ramp-{i}", "mid_ramp", pick() if i else []))
    for i in range(3):
        true = number(rng.uniform(14, 40))
        wrong = number(true * rng.choice([rng.uniform(0.6, 0.82), rng.uniform(1.22, 1.8)]))
        kinds = pick() if i == 2 else []
        if kinds == ["sensor_lag"]:
            kinds = ["strain_mismatch"]
        case = with_effects(rng, f"film-{i}", "controlled", kinds, conditions=["wrong film"], expects=dict(refitted=dict(kind="surface_film", parameter="film_w_per_m2_k", value=true)))
        case.hidden["film"] = true
        case.declared["ambient_film"] = wrong
        out.append(case)
    for kind, key in (("thermo_optic", "thermo_optic_factor"), ("diffusivity", "conductivity_factor"), ("diffusivity", "heat_capacity_factor")):
        value = number(rng.choice([rng.uniform(0.8, 0.9), rng.uniform(1.1, 1.2)]))
        out.append(Case(rng, f"wrong-{key.replace('_factor', '').replace('_', '-')}", str(rng.choice(["controlled", "stage"])), [kind], {key: value}, conditions=["wrong number"]))
    for i in range(2):
        case = with_effects(rng, f"offset-step-{i}", "controlled", pick() if i else [], conditions=["offset step"])
        when, size = int(rng.uniform(3000, 9000)), number(rng.choice([-1, 1]) * rng.uniform(1.5, 4) * case.gyro["sigma"])
        case.gyro["steps"] = dict(calibration=[[when, size]])
        case.expects = dict(offset_step_s=when)
        out.append(case)
    for i in range(2):
        case = with_effects(rng, f"random-walk-{i}", "controlled", [], conditions=["random walk"], expects=dict(no_name=True))
        case.gyro["walk"] = number(rng.uniform(0.6, 2.0) * case.gyro["sigma"])
        out.append(case)
    for i in range(2):
        out.append(with_effects(rng, f"sixty-{i}", "controlled", pick() if i else [], logger=sixty(), conditions=["60 s rows"]))
    for i in range(3):
        logger = drawn_logger(rng) | dict(jitter=float(rng.choice([0.2, 0.45])))
        out.append(with_effects(rng, f"irregular-{i}", str(rng.choice(["controlled", "stage"])), pick() if i else [], logger=logger, conditions=["irregular rows"]))
    for i in range(3):
        coil, pattern = drawn_coil(rng)
        pair, seg = exchanged(rng, coil, pattern)
        out.append(Case(rng, f"exchanged-{i}", "controlled", [], dict(wound_segments=seg), coil=(coil, pattern), conditions=["layers exchanged"], expects=dict(exchanged=pair)))
    for i in range(2):
        out.append(with_effects(rng, f"reversed-{i}", str(rng.choice(["controlled", "stage"])), pick() if i else [], conditions=["reversed"], expects=dict(reversed=True)))
        out[-1].hidden["reversed"] = True
    for i in range(2):
        coil, _ = drawn_coil(rng)
        layers = MORE_COILS[coil][0]
        names = ["zyl", "sym", "dip"] + ["qua"] * (layers % 4 == 0) + ["oct"] * (layers % 8 == 0)
        said, true = (str(x) for x in rng.choice(names, 2, replace=False))
        out.append(Case(rng, f"wound-{i}", "controlled", [], dict(wound_as=true), coil=(coil, said), conditions=["other winding"], expects=dict(winding=true)))
    for i in range(3):
        out.append(with_effects(rng, f"fan-{i}", "fan", pick() if i else [], conditions=["fan switched"]))
    return out


def controls(rng):
    """Nothing is hidden: half of them in closed chambers, half where a chamber, a logger or a gyro does otherwise."""
    sixty = lambda: dict(step_s=60.0, rate_mean_s=60.0, resolution_k=float(rng.choice([0.01, 0.0625, 0.1])), noise_k=0.01)
    out = []
    for i in range(200):
        columns = [c for c in ("supply_v", "laser_ma") if rng.random() < 0.3]
        chamber = str(rng.choice(["controlled"] * 3 + ["thermostat"])) if i % 2 else str(rng.choice(["stage", "stage", "mid_ramp", "outdoors", "controlled"]))
        logger = sixty() if chamber == "outdoors" else drawn_logger(rng)
        if i % 10 == 8:
            logger |= dict(jitter=float(rng.choice([0.2, 0.45])))
        out.append(with_effects(rng, f"control-{i:03d}", chamber, [], columns=columns, logger=logger, gyro=drawn_gyro(rng, logger, flicker=0.5 if i % 4 == 3 else None)))
    return out


def fan(rng):
    """A fan is switched, and the film with it: sensors on the pack, sensors in the air behind a film that the model declares."""
    out = []
    for i in range(12):
        kinds = [str(rng.choice(["strain_mismatch", "bias_temperature", "spool_mass", "stress_gradient"]))] if i % 3 == 2 else []
        in_air = i % 2 == 1
        case = with_effects(rng, f"fan-{'air' if in_air else 'pack'}-{i}", "fan", kinds, conditions=["fan switched"] + ["sensor in the air"] * in_air)
        case.test_chamber = str(rng.choice(["fan", "controlled"]))
        if in_air:
            case.declared["ambient_film"] = case.chamber["film"]
            case.hidden["film"] = case.chamber["film"]
        out.append(case)
    return out


def term(rng, form):
    """A term with its constants drawn; its gain is set later, from its size."""
    tau = number(np.exp(rng.uniform(np.log(250), np.log(3000))))
    column = str(rng.choice(["fan_a", "heater_a", "laser_ma"]))
    level, size, _ = COLUMNS[column]
    made = dict(form=form, gain=1.0)
    made |= {
        "relaxation": dict(tau_s=tau), "one_sided_relaxation": dict(tau_s=tau), "hysteresis": dict(half_k=number(rng.uniform(2, 8))),
        "softplus": dict(at_c=number(rng.uniform(20, 45)), width_k=number(rng.uniform(1, 4))), "saturation": dict(knee=number(rng.uniform(0.2, 0.6))),
        "ageing": dict(tau_s=number(rng.uniform(300, 2500))), "column_square": dict(column="heater_a" if rng.random() < 0.5 else "fan_a"),
        "column_lag": dict(column=column, tau_s=number(rng.uniform(100, 900))), "column_lag_of_size": dict(column="fan_a", tau_s=number(rng.uniform(100, 900))),
        "column_times_temperature": dict(column="fan_a"), "column_threshold": dict(column="fan_a", at=number(rng.uniform(0.2, 1.0))),
        "not_logged_cycle": dict(period_s=number(rng.uniform(2500, 9000))),
    }.get(form, {})
    return made


def beyond(rng):
    """Effects that no catalogue lists, alone and beside a listed one; and controls."""
    forms = ["relaxation", "one_sided_relaxation", "hysteresis", "product", "cubic", "rate_times_size", "softplus", "saturation", "ageing",
             "column_square", "column_lag", "column_lag_of_size", "column_times_temperature", "column_threshold"]
    beside = ["strain_mismatch", "sensor_lag", "bias_temperature", "spool_mass"]
    plan = [(f, []) for f in forms] + [(str(rng.choice(forms)), [str(rng.choice(beside))]) for _ in range(5)]
    out, idle = [], ["humidity_pct", "supply_v", "pressure_hpa"]
    for i, (form, kinds) in enumerate(plan):
        made = term(rng, form)
        columns = sorted({c for c in idle if rng.random() < 0.35} | ({made["column"]} if "column" in made else set()))
        case = with_effects(rng, f"term-{i:02d}-{form.replace('_', '-')}", "controlled", kinds, columns=columns, logger=drawn_logger(rng, plain=True), extra=[form],
                            discoverable=True, test_chamber=str(rng.choice(["stage", "thermostat"])), gyro=drawn_gyro(rng, dict(rate_mean_s=10.0), flicker=float(rng.choice([0, 0, 0.2]))))
        case.hidden["terms"] = [made]
        out.append(case)
    for i in range(5):
        coil, pattern = drawn_coil(rng)
        layers = MORE_COILS[coil][0]
        if i < 3:
            kind, hidden = "layer_gain", dict(gain_layer=int(rng.integers(2, layers)), gain_change=number(rng.choice([-1, 1]) * rng.uniform(0.05, 0.12)))
        else:
            kind, hidden = "layer_gap", dict(gap_above=int(rng.integers(layers // 3, layers - 2)), gap_conductance=number(rng.uniform(120, 500)))
        out.append(Case(rng, f"layer-{i}", "controlled", [kind], hidden, coil=(coil, pattern), logger=drawn_logger(rng, plain=True), discoverable=True, test_chamber="stage", conditions=["layer"]))
    for i in range(10):
        columns = sorted(str(c) for c in rng.choice(list(COLUMNS), int(rng.integers(0, 5)), replace=False))
        made = term(rng, "not_logged_cycle") if i >= 7 else None
        case = with_effects(rng, f"control-{i}", "controlled", [], columns=columns, logger=drawn_logger(rng, plain=True), discoverable=False, test_chamber="stage",
                            extra=["not_logged_cycle"] if made else [], gyro=drawn_gyro(rng, dict(rate_mean_s=10.0), flicker=float(rng.choice([0, 0.25, 0.5]))))
        if made:
            case.hidden["terms"] = [made]
            case.expects = dict(no_name=True)
        out.append(case)
    return out


def sized(case, declared, seed, target):
    """Scales what is hidden so that its share of the calibration record is `target` noises, and says how much it is."""
    def share():
        quiet = dict(case.gyro, sigma=0.0, flicker=0.0, walk=0.0, steps={})
        _, _, plain, beyond = record(declared, case.hidden, case.chamber, case.logger, quiet, "calibration", seed)
        keep = {k: v for k, v in case.hidden.items() if k in ("film", "films")}
        _, _, without, _ = record(declared, keep, case.chamber, case.logger, quiet, "calibration", seed)
        return (plain - without).std() / case.gyro["sigma"], beyond.std() / case.gyro["sigma"]

    listed, beyond = share()
    if case.hidden.get("terms"):
        term = case.hidden["terms"][0]
        term["gain"] = number(case.rng.choice([-1, 1]) * target / max(beyond, 1e-12))
    scalable = [k for k in LINEAR if k in case.hidden]
    if scalable and not (1.0 < listed < 12.0):
        for k in scalable:
            case.hidden[k] = number(case.hidden[k] * np.clip(target / max(listed, 1e-12), 0.1, 4.0))
    return case


def write(root, kind, seed, cases):
    os.makedirs(root, exist_ok=True)
    truth = {}
    for i, case in enumerate(cases):
        folder = f"{root}/{case.name}"
        os.makedirs(folder, exist_ok=True)
        text = case.model_text()
        open(f"{folder}/coil.toml", "w").write(text)
        declared = tomllib.loads(text)
        base = 1000 * seed + 10 * i
        sized(case, declared, base, float(np.exp(case.rng.uniform(np.log(1.5), np.log(7.0)))))
        size, signal, rows_of = {}, {}, {}
        for n, part in enumerate(("calibration", "validation", "test")):
            chamber, hidden = case.chamber, case.hidden
            if part == "test":
                other_kind = case.test_chamber or ("controlled" if chamber["kind"] == "stage" else "stage")
                chamber = drawn_chamber(case.rng, other_kind)
                chamber |= {k: case.chamber[k] for k in ("film", "fan_factor") if other_kind == "fan"}
            header, rows, plain, beyond = record(declared, hidden, chamber, case.logger, case.gyro, part if part == "calibration" else "validation", base + n)
            write_record(f"{folder}/{part}.csv", header, rows)
            signal[part], size[part], rows_of[part] = number(float(plain.std()), 4), number(float(beyond.std()), 4), len(rows)
            if part == "calibration":
                keep = {k: v for k, v in hidden.items() if k in ("film", "films")}
                quiet = dict(case.gyro, sigma=0.0, flicker=0.0, walk=0.0, steps={})
                without = record(declared, keep, chamber, case.logger, quiet, part, base)[2]
                listed = number(float((plain - without).std()), 4)
                own = {}
                for item, words in (case.words | {"winding": ["wound_as", "wound_segments"]}).items():
                    if not set(words) & set(hidden):
                        continue
                    less = {k: v for k, v in hidden.items() if k not in words or k in keep}
                    own[item] = number(float((plain - record(declared, less, chamber, case.logger, quiet, part, base)[2]).std()), 4)
        truth[case.name] = dict(answers=case.answers, hidden=case.hidden, expects=case.expects, extra=case.extra, catalogue=case.answers, discoverable=case.discoverable,
                                columns=case.logger.get("columns", []), wound_as=case.hidden.get("wound_as", case.pattern), declared_as=case.pattern, chamber=case.chamber,
                                logger={k: v for k, v in case.logger.items() if k != "columns"}, gyro=case.gyro, conditions=case.conditions,
                                white_noise_deg_per_h=case.gyro["sigma"], noise_sigma_deg_per_h=case.gyro["sigma"], signal_rms_deg_per_h=signal, hidden_rms=size,
                                listed_rms_deg_per_h=listed, own_rms_deg_per_h=own, rows=rows_of)
        print(case.name, case.answers or "-", case.extra or "", f"{listed / case.gyro['sigma']:.2f} {size['calibration'] / case.gyro['sigma']:.2f}", rows_of, flush=True)
        json.dump(truth, open(f"{root}/truth.json", "w"), indent=1)
    open(f"{root}/README.md", "w").write(f"Drawn by `laboratory_cases.py DIR {kind} {seed}`.\n\n{__doc__}")


def main():
    root, kind, seed = sys.argv[1], sys.argv[2], int(sys.argv[3])
    rng = np.random.default_rng(seed)
    cases = dict(lab=lab, other=other, beyond=beyond, fan=fan, controls=controls)[kind](rng)
    write(root, kind, seed, cases[:int(sys.argv[4])] if len(sys.argv) > 4 else cases)


if __name__ == "__main__":
    main()
