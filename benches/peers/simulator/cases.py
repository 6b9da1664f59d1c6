"""Writes the trial cases: `python cases.py DIR [NAME...]`, or drawn ones: `python cases.py DIR --fresh SEED COUNT`.

One folder a case: coil.toml, calibration.csv, validation.csv; truth.json beside them.
"""
import json, os, sys
import numpy as np
from simulator import calibration_air, simulate, validation_air, write_record

COILS = {  # layers, turns, bore diameter mm, radial and axial pitch um, k, rho c, n, dn/dT, wavelength nm
    "a": (24, 50, 80, 165, 170, 0.35, 1.70e6, 1.45, 1.0e-5, 1550),
    "b": (12, 71, 72, 250, 255, 0.33, 1.22e6, 1.447, 1.35e-5, 1300),
    "c": (36, 60, 100, 165, 170, 0.35, 1.70e6, 1.45, 1.0e-5, 1550),
    "d": (16, 40, 60, 165, 170, 0.30, 1.80e6, 1.45, 1.0e-5, 1550),
    "e": (40, 80, 120, 180, 185, 0.40, 1.60e6, 1.46, 0.9e-5, 1550),
    "f": (32, 64, 90, 170, 175, 0.33, 1.75e6, 1.45, 1.0e-5, 1550),
    "g": (20, 45, 50, 200, 205, 0.25, 1.90e6, 1.452, 1.1e-5, 1310),
    "h": (28, 55, 85, 135, 140, 0.35, 1.70e6, 1.45, 1.0e-5, 1550),
}
SUPPLY = {"name": "supply_v", "kind": "supply"}
NOISE = {"name": "noise_v", "kind": "noise"}
WALK = {"name": "laser_ma", "kind": "walk"}
WARM = {"name": "board_v", "kind": "warm"}


def case(name, coil, pattern, answers, hidden=None, noise=0.12, channels=(), **extra):
    return dict(name=name, coil=coil, pattern=pattern, answers=answers, hidden=hidden or {}, noise=noise, channels=list(channels), **extra)


CASES = [
    # Nothing is missing.
    case("control-dip-a", "a", "dip", []),
    case("control-zyl-e", "e", "zyl", []),
    case("control-qua-c", "c", "qua", [], channels=[SUPPLY]),
    case("control-oct-f", "f", "oct", []),
    case("control-sym-g", "g", "sym", []),
    case("control-dip-d-loud", "d", "dip", [], noise=0.6),
    case("control-zyl-b", "b", "zyl", [], noise=0.24),
    case("control-zyl-h-quiet", "h", "zyl", [], noise=0.06),
    case("control-qua-d-noise", "d", "qua", [], channels=[NOISE]),
    case("control-dip-c-walk", "c", "dip", [], channels=[WALK]),
    case("control-sym-a-warm", "a", "sym", [], channels=[WARM]),
    case("control-dip-f-three", "f", "dip", [], channels=[NOISE, WALK, WARM], noise=0.24),
    case("control-zyl-c-quiet", "c", "zyl", [], noise=0.06),
    case("control-film-a", "a", "dip", [], ambient_film=25.0),
    # Single effects, from clear to faint.
    case("half-dip-a", "a", "dip", ["finite_pack"], declared_half=True),
    case("half-qua-c", "c", "qua", ["finite_pack"], declared_half=True),
    case("half-sym-g", "g", "sym", ["finite_pack"], declared_half=True, noise=0.24),
    case("half-zyl-d", "d", "zyl", ["finite_pack"], declared_half=True, noise=0.6),
    case("spool-zyl-f", "f", "zyl", ["spool_mass"], dict(spool_capacity=3000.0, spool_contact=250.0)),
    case("spool-dip-c", "c", "dip", ["spool_mass"], dict(spool_capacity=9000.0, spool_contact=600.0)),
    case("spool-sym-d", "d", "sym", ["spool_mass"], dict(spool_capacity=2000.0, spool_contact=150.0), noise=0.24),
    case("spool-qua-a", "a", "qua", ["spool_mass"], dict(spool_capacity=7000.0, spool_contact=500.0), noise=0.06),
    case("film-dip-a", "a", "dip", ["surface_film"], dict(sensor_in_air=True)),
    case("film-zyl-g", "g", "zyl", ["surface_film"], dict(sensor_in_air=True), noise=0.24),
    case("film-qua-f", "f", "qua", ["surface_film"], dict(sensor_in_air=True)),
    case("film-missing-sym-c", "c", "sym", ["surface_film"], {}, ambient=True),
    case("lag-dip-e", "e", "dip", ["sensor_lag"], dict(sensor_lag=60.0)),
    case("lag-sym-a", "a", "sym", ["sensor_lag"], dict(sensor_lag=20.0)),
    case("lag-qua-c", "c", "qua", ["sensor_lag"], dict(sensor_lag=120.0)),
    case("lag-zyl-h", "h", "zyl", ["sensor_lag"], dict(sensor_lag=10.0)),
    case("heat-zyl-a", "a", "zyl", ["self_heating"], dict(heater_power=120.0, heater_tau=900.0)),
    case("heat-dip-f", "f", "dip", ["self_heating"], dict(heater_power=200.0, heater_tau=400.0)),
    case("heat-sym-c", "c", "sym", ["self_heating"], dict(heater_power=60.0, heater_tau=1800.0)),
    case("axial-qua-a", "a", "qua", ["axial_gradient"], dict(flange_film=30.0, flange="first")),
    case("axial-dip-d", "d", "dip", ["axial_gradient"], dict(flange_film=60.0, flange="second")),
    case("axial-zyl-f", "f", "zyl", ["axial_gradient"], dict(flange_film=15.0, flange="first")),
    case("kT-zyl-c", "c", "zyl", ["conductivity_temperature"], dict(conductivity_slope=0.003)),
    case("kT-dip-e", "e", "dip", ["conductivity_temperature"], dict(conductivity_slope=-0.002)),
    case("stress-dip-a", "a", "dip", ["stress_gradient"], dict(stress=0.05)),
    case("stress-zyl-f", "f", "zyl", ["stress_gradient"], dict(stress=0.04)),
    case("stress-sym-g", "g", "sym", ["stress_gradient"], dict(stress=-0.03), noise=0.24),
    case("mismatch-qua-f", "f", "qua", ["strain_mismatch"], dict(mismatch=0.003)),
    case("mismatch-oct-d", "d", "oct", ["strain_mismatch"], dict(mismatch=0.008)),
    case("mismatch-zyl-a", "a", "zyl", ["strain_mismatch"], dict(mismatch=-0.004)),
    case("mismatch-dip-c-faint", "c", "dip", ["strain_mismatch"], dict(mismatch=0.0007)),
    case("glass-qua-c", "c", "qua", ["glass_transition"], dict(glass_mismatch=0.005, glass_transition=15.0, glass_width=4.0)),
    case("glass-dip-a", "a", "dip", ["glass_transition"], dict(glass_mismatch=-0.006, glass_transition=35.0, glass_width=6.0)),
    case("toT-zyl-a", "a", "zyl", ["thermo_optic_temperature"], dict(thermo_optic_slope=0.003)),
    case("toT-dip-e", "e", "dip", ["thermo_optic_temperature"], dict(thermo_optic_slope=0.004)),
    case("lead-iso-qua-f", "f", "qua", ["midpoint_offset"], dict(lead_offset=0.4, lead="isothermal")),
    case("lead-air-dip-c", "c", "dip", ["midpoint_offset"], dict(lead_offset=-0.8, lead="ambient")),
    case("lead-air-oct-f", "f", "oct", ["midpoint_offset"], dict(lead_offset=0.5, lead="ambient")),
    case("turns-dip-a", "a", "dip", ["turn_mismatch"], dict(turn_mismatch=1.0)),
    case("turns-zyl-c", "c", "zyl", ["turn_mismatch"], dict(turn_mismatch=2.0)),
    case("turns-qua-d", "d", "qua", ["turn_mismatch"], dict(turn_mismatch=1.0)),
    case("asym-zyl-f", "f", "zyl", ["heating_cooling_asymmetry"], dict(asymmetry=0.05)),
    case("asym-dip-e", "e", "dip", ["heating_cooling_asymmetry"], dict(asymmetry=0.04)),
    case("biasT-qua-a", "a", "qua", ["bias_temperature"], dict(bias_per_K=0.004)),
    case("biasT-sym-c-quad", "c", "sym", ["bias_temperature"], dict(bias_per_K=-0.002, bias_per_K2=0.00008)),
    case("biasT-dip-f-faint", "f", "dip", ["bias_temperature"], dict(bias_per_K=0.0004)),
    case("biasrate-qua-c", "c", "qua", ["bias_temperature_rate"], dict(bias_rate=15.0)),
    case("biasrate-zyl-d", "d", "zyl", ["bias_temperature_rate"], dict(bias_rate=-10.0)),
    case("biasgrad-oct-f", "f", "oct", ["bias_gradient_rate"], dict(bias_gradient=40.0)),
    case("biasgrad-dip-c", "c", "dip", ["bias_gradient_rate"], dict(bias_gradient=-60.0)),
    case("channel-dip-a", "a", "dip", ["channel:supply_v"], {}, channels=[dict(SUPPLY, gain=0.4)]),
    case("channel-zyl-f-among", "f", "zyl", ["channel:laser_ma"], {}, channels=[NOISE, dict(WALK, gain=0.3), SUPPLY]),
    # Wrong declared parameters.
    case("factor-k-zyl-a", "a", "zyl", ["diffusivity"], dict(conductivity_factor=1.3)),
    case("factor-k-dip-e", "e", "dip", ["diffusivity"], dict(conductivity_factor=0.75)),
    case("factor-k-sym-c", "c", "sym", ["diffusivity"], dict(conductivity_factor=1.3), noise=0.24),
    case("factor-to-zyl-f", "f", "zyl", ["thermo_optic"], dict(thermo_optic_factor=1.1)),
    case("factor-to-dip-c", "c", "dip", ["thermo_optic"], dict(thermo_optic_factor=1.1)),
    # Pairs.
    case("two-spool-mismatch", "f", "dip", ["spool_mass", "strain_mismatch"], dict(spool_capacity=5000.0, spool_contact=400.0, mismatch=0.003)),
    case("two-spool-bias", "a", "zyl", ["spool_mass", "bias_temperature"], dict(spool_capacity=4000.0, spool_contact=300.0, bias_per_K=0.003)),
    case("two-mismatch-bias", "c", "qua", ["strain_mismatch", "bias_temperature"], dict(mismatch=0.003, bias_per_K=0.003)),
    case("two-lag-mismatch", "e", "zyl", ["sensor_lag", "strain_mismatch"], dict(sensor_lag=40.0, mismatch=0.004)),
    case("two-half-mismatch", "b", "zyl", ["finite_pack", "strain_mismatch"], dict(mismatch=0.02), declared_half=True, noise=0.24),
    case("two-half-bias", "c", "dip", ["finite_pack", "bias_temperature"], dict(bias_per_K=0.004), declared_half=True),
    case("two-stress-toT", "f", "sym", ["stress_gradient", "thermo_optic_temperature"], dict(stress=0.05, thermo_optic_slope=0.002)),
    case("two-k-channel", "a", "zyl", ["diffusivity", "channel:supply_v"], dict(conductivity_factor=1.3), channels=[dict(SUPPLY, gain=0.3), WALK]),
    case("two-lead-bias", "f", "qua", ["midpoint_offset", "bias_temperature"], dict(lead_offset=0.6, lead="ambient", bias_per_K=-0.003)),
    case("two-turns-lag", "c", "dip", ["turn_mismatch", "sensor_lag"], dict(turn_mismatch=1.0, sensor_lag=30.0)),
    case("two-to-bias", "e", "zyl", ["thermo_optic", "bias_temperature"], dict(thermo_optic_factor=1.1, bias_per_K=0.004)),
    case("two-heat-mismatch", "c", "sym", ["self_heating", "strain_mismatch"], dict(heater_power=80.0, heater_tau=1200.0, mismatch=0.003)),
    # Outside the catalogue.
    case("out-sine-fast", "a", "dip", [], dict(sine_amplitude=0.08, sine_period=870.0), outside="sinusoid"),
    case("out-sine-slow", "c", "qua", [], dict(sine_amplitude=0.1, sine_period=4300.0), outside="sinusoid"),
    case("out-sine-slower", "f", "zyl", [], dict(sine_amplitude=0.08, sine_period=9100.0), outside="sinusoid"),
    case("out-square", "f", "sym", [], dict(square_amplitude=0.06, square_period=2600.0), outside="square"),
    case("out-ageing", "e", "dip", [], dict(ageing_amplitude=0.25, ageing_tau=4000.0), outside="exponential"),
    case("out-ageing-fast", "a", "zyl", [], dict(ageing_amplitude=0.4, ageing_tau=700.0), outside="exponential"),
    case("out-drift", "d", "qua", [], dict(drift_per_h=0.05), outside="drift"),
    case("out-humidity", "a", "sym", [], dict(humidity_gain=0.004, humidity_tau=5000.0), outside="slow_state"),
    case("out-hysteresis", "c", "dip", [], dict(hysteresis_gain=0.02, hysteresis_width=12.0), outside="hysteresis"),
    case("out-etalon", "f", "qua", [], dict(temperature_sine=0.07, temperature_sine_period=17.0), outside="etalon"),
    case("out-jump", "a", "qua", [], dict(jump_size=0.12, jump_at=9000.0), outside="jump"),
    case("out-square-rate", "c", "zyl", [], dict(rate_square=0.1), outside="rate_square"),
    case("out-sine-and-mismatch", "c", "qua", ["strain_mismatch"], dict(mismatch=0.004, sine_amplitude=0.1, sine_period=1500.0), outside="sinusoid"),
]


# What may be drawn: kinds, and a function from a random generator to what is hidden. Heat paths cannot be combined.
def signed(rng, low, high):
    return float(f"{rng.choice([-1, 1]) * rng.uniform(low, high):.3g}")


def within(rng, low, high):
    return float(f"{rng.uniform(low, high):.3g}")


HEAT = {
    "spool_mass": lambda r: dict(spool_capacity=within(r, 1500, 9000), spool_contact=within(r, 150, 700)),
    "self_heating": lambda r: dict(heater_power=within(r, 40, 250), heater_tau=within(r, 300, 2000)),
    "axial_gradient": lambda r: dict(flange_film=within(r, 10, 80), flange=str(r.choice(["first", "second"]))),
    "conductivity_temperature": lambda r: dict(conductivity_slope=signed(r, 0.0015, 0.004)),
    "diffusivity": lambda r: dict(conductivity_factor=float(r.choice([within(r, 0.7, 0.9), within(r, 1.1, 1.4)]))),
    "finite_pack": lambda r: dict(declared_half=True),
    "surface_film": lambda r: dict(sensor_in_air=True),
}
OTHER = {
    "sensor_lag": lambda r: dict(sensor_lag=within(r, 8, 100)),
    "stress_gradient": lambda r: dict(stress=signed(r, 0.01, 0.06)),
    "strain_mismatch": lambda r: dict(mismatch=signed(r, 0.001, 0.008)),
    "glass_transition": lambda r: dict(glass_mismatch=signed(r, 0.002, 0.007), glass_transition=within(r, 0, 45), glass_width=within(r, 3, 8)),
    "thermo_optic_temperature": lambda r: dict(thermo_optic_slope=signed(r, 0.0015, 0.005)),
    "midpoint_offset": lambda r: dict(lead_offset=signed(r, 0.2, 1.0), lead=str(r.choice(["isothermal", "ambient"]))),
    "turn_mismatch": lambda r: dict(turn_mismatch=signed(r, 0.7, 2.5)),
    "heating_cooling_asymmetry": lambda r: dict(asymmetry=signed(r, 0.015, 0.06)),
    "bias_temperature": lambda r: dict(bias_per_K=signed(r, 0.0008, 0.005)),
    "bias_temperature_rate": lambda r: dict(bias_rate=signed(r, 5, 20)),
    "bias_gradient_rate": lambda r: dict(bias_gradient=signed(r, 20, 70)),
    "thermo_optic": lambda r: dict(thermo_optic_factor=float(r.choice([within(r, 0.85, 0.95), within(r, 1.05, 1.15)]))),
    "channel:supply_v": lambda r: dict(gain=within(r, 0.15, 0.5)),
}
OUTSIDE = {
    "sinusoid": lambda r: dict(sine_amplitude=within(r, 0.06, 0.15), sine_period=within(r, 500, 9000)),
    "square": lambda r: dict(square_amplitude=within(r, 0.05, 0.12), square_period=within(r, 1500, 4000)),
    "exponential": lambda r: dict(ageing_amplitude=within(r, 0.2, 0.5), ageing_tau=within(r, 600, 5000)),
    "hysteresis": lambda r: dict(hysteresis_gain=within(r, 0.015, 0.03), hysteresis_width=within(r, 8, 15)),
    "etalon": lambda r: dict(temperature_sine=within(r, 0.05, 0.1), temperature_sine_period=within(r, 10, 20)),
}


def drawn(seed, count):
    """Cases with coil, pattern, noise, columns and what is hidden all drawn."""
    rng = np.random.default_rng(seed)
    cases = []
    for i in range(count):
        coil = str(rng.choice(list(COILS)))
        layers = COILS[coil][0]
        pattern = str(rng.choice(["zyl", "dip", "sym"] + ["qua"] * (layers % 4 == 0) + ["oct"] * (layers % 8 == 0)))
        kinds, outside, hidden, extra = [], None, {}, {}
        what = rng.random()
        if what < 0.15:
            pass
        elif what < 0.25:
            outside = str(rng.choice(list(OUTSIDE)))
            hidden = OUTSIDE[outside](rng)
        elif what < 0.75:
            kinds = [str(rng.choice(list(HEAT) + list(OTHER)))]
        else:
            second = str(rng.choice(list(OTHER)))
            kinds = [str(rng.choice([k for k in list(HEAT) + list(OTHER) if k != second and {k, second} != {"surface_film", "sensor_lag"}])), second]
        for kind in kinds:
            hidden |= (HEAT | OTHER)[kind](rng)
        channels = [dict(c) for c in (NOISE, WALK, WARM) if rng.random() < 0.25]
        if "gain" in hidden:
            channels.append(dict(SUPPLY, gain=hidden.pop("gain")))
        if hidden.pop("declared_half", False):
            extra["declared_half"] = True
        noise = float(rng.choice([0.06, 0.12, 0.12, 0.24]))
        name = f"fresh-{seed}-{i:02d}"
        cases.append(case(name, coil, pattern, kinds, hidden, noise, channels, **extra, **({"outside": outside} if outside else {})))
    return cases


def declared_text(c, coil):
    layers, turns, bore, radial, axial, k, rc, n, dndt, wave = coil
    location = "ambient" if c.get("ambient") or c.get("ambient_film") else "outer_layer"
    text = f"""name = "{c['name']}"

[fibre]
refractive_index = {n}
thermo_optic_per_k = {dndt}
wavelength_nm = {wave}
outer_diameter_um = {radial}

[winding]
layers = {layers}
turns_per_layer = {turns}
inner_diameter_mm = {bore}
radial_pitch_um = {radial}
axial_pitch_um = {axial}
layer_length = "actual"
pattern = "{c['pattern']}"

[thermal]
model = "{'half_space' if c.get('declared_half') else 'pack'}"
conductivity_w_per_m_k = {k}
volumetric_heat_capacity_j_per_m3_k = {rc}

[sensor]
location = "{location}"
rate_mean_s = 10.0
"""
    if c.get("ambient_film"):
        text += f'\n[[effect]]\nkind = "surface_film"\nfilm_w_per_m2_k = {c["ambient_film"]}\n'
    return text


def main():
    import tomllib
    root, wanted, first, cases = sys.argv[1], sys.argv[2:], 0, CASES
    if wanted[:1] == ["--fresh"]:
        first, cases, wanted = 100 * int(wanted[1]), drawn(int(wanted[1]), int(wanted[2])), []
    os.makedirs(root, exist_ok=True)
    file = f"{root}/truth.json"
    truth = json.load(open(file)) if os.path.exists(file) else {}
    for number, c in enumerate(cases, first):
        if wanted and c["name"] not in wanted:
            continue
        folder = f"{root}/{c['name']}"
        os.makedirs(folder, exist_ok=True)
        text = declared_text(c, COILS[c["coil"]])
        open(f"{folder}/coil.toml", "w").write(text)
        declared = tomllib.loads(text)
        rng = np.random.default_rng(1000 + number)
        offset, sigma = round(rng.uniform(-0.25, 0.25), 3), c["noise"] / np.sqrt(10.0)
        rms = {}
        for part, air in (("calibration", calibration_air()), ("validation", validation_air(2000 + number))):
            seed = 10 * number + (part == "validation")
            header, rows, clean = simulate(declared, c["hidden"], air, seed, sigma, offset, c["channels"])
            plain = [{k: v for k, v in ch.items() if k != "gain"} for ch in c["channels"]]
            _, _, without = simulate(declared, {}, air, seed, 0.0, 0.0, plain)
            rms[part] = float((clean - without).std())
            write_record(f"{folder}/{part}.csv", header, rows)
        truth[c["name"]] = dict(answers=c["answers"], hidden={k: v for k, v in c["hidden"].items()}, offset_deg_per_h=offset,
                                noise_sigma_deg_per_h=sigma, hidden_rms=rms, outside=c.get("outside"),
                                gains={ch["name"]: ch["gain"] for ch in c["channels"] if "gain" in ch})
        print(c["name"], {k: round(v / sigma, 2) for k, v in rms.items()}, len(rows), flush=True)
        json.dump(truth, open(file, "w"), indent=1)


if __name__ == "__main__":
    main()
