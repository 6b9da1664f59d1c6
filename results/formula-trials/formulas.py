"""The formulas of the trials: how their constants are drawn, what they are in the program's words, and how its answers are read.

A form is one of the simulator's (benches/peers/simulator/laboratory.py, TERMS) or one of FURTHER, which no batch had before. OUTSIDE
names those that the search's grammar does not hold: nothing that predicts is to be found there but by chance.
"""
import os
import re
import sys

import numpy as np

SIMULATOR = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "benches", "peers", "simulator")
sys.path.insert(0, SIMULATOR)
import laboratory  # noqa: E402
from laboratory_cases import number, term  # noqa: E402

CENTRE = {name: level for name, (level, _, _) in laboratory.COLUMNS.items()}

FURTHER = {
    "gradient_square": lambda v, p: p["gain"] * (v["T_out"] - v["T_in"]) ** 2,
    "column_saturation": lambda v, p: p["gain"] * np.tanh((v[p["column"]] - CENTRE[p["column"]]) / p["knee"]),
    "column_hysteresis": lambda v, p: p["gain"] * (laboratory.play(v[p["column"]], p["half"]) - v[p["column"]]),
    "column_product": lambda v, p: p["gain"] * v["fan_a"] * v["heater_a"],
    "decay": lambda v, p: p["gain"] * np.exp(-v["t"] / p["tau_s"]),
    "etalon": lambda v, p: p["gain"] * np.sin(2 * np.pi * (v["T_mean"] - 20.0) / p["period_k"]),
}
laboratory.TERMS.update(FURTHER)

FORMS = ["relaxation", "column_square", "hysteresis", "column_lag", "product", "softplus", "column_lag_of_size", "cubic", "saturation", "column_threshold",
         "one_sided_relaxation", "column_times_temperature", "rate_times_size", "ageing", "gradient_square", "column_saturation", "decay", "column_hysteresis",
         "column_product", "etalon"]
OUTSIDE = {"etalon"}
# They depend on the time since the record began: to say that they only describe is right.
OF_TIME = {"ageing", "decay"}


def drawn(rng, form):
    """A term with its constants drawn; its gain is set from its size."""
    if form not in FURTHER:
        return term(rng, form)
    column = str(rng.choice(["fan_a", "heater_a", "laser_ma"]))
    size = laboratory.COLUMNS[column][1]
    constants = {
        "column_saturation": dict(column=column, knee=number(size * rng.uniform(0.4, 1.0))),
        "column_hysteresis": dict(column=column, half=number(size * rng.uniform(0.4, 1.2))),
        "decay": dict(tau_s=number(rng.uniform(600, 4000))), "etalon": dict(period_k=number(rng.uniform(9, 30))),
    }.get(form, {})
    return dict(form=form, gain=1.0) | constants


def columns_of(made):
    """The columns that a term reads."""
    return ["fan_a", "heater_a"] if made["form"] == "column_product" else [made["column"]] if "column" in made else []


def declared(made):
    """The term as the program writes it: formula with parameters, and their true values."""
    p, c = made, made.get("column")
    formula, values = {
        "relaxation": ("a*(T_mean - lag(T_mean, tau_s))", dict(tau_s="tau_s")),
        "one_sided_relaxation": ("a*max(T_mean - lag(T_mean, tau_s), 0)", dict(tau_s="tau_s")),
        "hysteresis": ("a*(play(T_in, half_width) - T_in)", dict(half_width="half_k")),
        "product": ("a*mean_rate*(T_mean - 20)", {}),
        "cubic": ("a*(T_mean - 20)^3", {}),
        "rate_times_size": ("a*mean_rate*abs(mean_rate)", {}),
        "softplus": ("a*width*softplus((T_mean - at)/width)", dict(at="at_c", width="width_k")),
        "saturation": ("a*tanh(mean_rate/knee)", dict(knee="knee")),
        "ageing": ("a*ln(1 + t/tau_s)", dict(tau_s="tau_s")),
        "column_square": (f"a*{c}^2", {}),
        "column_lag": (f"a*lag({c}, tau_s)", dict(tau_s="tau_s")),
        "column_lag_of_size": (f"a*lag(abs({c}), tau_s)", dict(tau_s="tau_s")),
        "column_times_temperature": (f"a*{c}*(T_mean - 20)", {}),
        "column_threshold": (f"a*max({c} - at, 0)", dict(at="at")),
        "gradient_square": ("a*(T - T_in)^2", {}),
        "column_saturation": (f"a*tanh(({c} - {CENTRE.get(c, 0)})/knee)", dict(knee="knee")),
        "column_hysteresis": (f"a*(play({c}, half_width) - {c})", dict(half_width="half")),
        "column_product": ("a*fan_a*heater_a", {}),
        "decay": ("a*exp(-t/tau_s)", dict(tau_s="tau_s")),
        "etalon": ("a*sin(2*pi*(T_mean - 20)/period)", dict(period="period_k")),
    }[p["form"]]
    # The simulator's rates are in K/min, the program's in K/s; its cubic is of (T - 20)/30.
    factor = {"product": 60.0, "rate_times_size": 3600.0, "cubic": 30.0 ** -3}.get(p["form"], 1.0)
    true = dict(a=p["gain"] * factor) | {name: p[key] for name, key in values.items()}
    if p["form"] == "saturation":
        true["knee"] /= 60.0
    return formula, true


def effect_table(made):
    formula, values = declared(made)
    inside = ", ".join(f"{k} = {v!r}" for k, v in values.items())
    return f'\n[[effect]]\nkind = "custom"\nformula = "{formula}"\nparameters = {{ {inside} }}\n'


N = r"-?[0-9.]+(?:e[-+]?[0-9]+)?"
TEMPERATURE, RATE, SHIFTED = r"(?:T_mean|T_in|T)", r"(?:mean_rate|dT_dt)", r"\((?:T_mean|T_in|T) - 20\)"
GRADIENT = r"\(T - T_in\)"


def shapes(made):
    """Patterns of a formula in numbers: with the same variables, and of the same form with another temperature, rate or gradient."""
    c = re.escape(made.get("column", ""))
    # A column may be counted from its mean.
    of = rf"(?:{c}|\({c} [-+] {N}\))"
    either = rf"(?:{RATE}|{GRADIENT})"
    exact, alike = {
        "relaxation": (rf"{N}\*\(T_mean - lag\(T_mean, {N}\)\)", rf"{N}\*\(({TEMPERATURE}) - lag\(\1, {N}\)\)"),
        "one_sided_relaxation": (rf"{N}\*max\(T_mean - lag\(T_mean, {N}\), 0\)", rf"{N}\*max\(({TEMPERATURE}) - lag\(\1, {N}\), 0\)"),
        "hysteresis": (rf"{N}\*\(play\(T_in, {N}\) - T_in\)", rf"{N}\*\(play\(({TEMPERATURE}), {N}\) - \1\)"),
        "product": (rf"{N}\*mean_rate\*\(T_mean - 20\)", rf"{N}\*{either}\*{SHIFTED}"),
        "cubic": (rf"{N}\*\(T_mean - 20\)\^3", rf"{N}\*{SHIFTED}\^3"),
        "rate_times_size": (rf"{N}\*mean_rate\*abs\(mean_rate\)", rf"{N}\*({either})\*abs\(\(?\1\)?\)"),
        "softplus": (rf"{N}\*{N}\*softplus\(\(T_mean - {N}\)/{N}\)", rf"{N}\*(?:{N}\*softplus\(\({TEMPERATURE} - {N}\)/{N}\)|max\({TEMPERATURE} - {N}, 0\))"),
        "saturation": (rf"{N}\*tanh\(mean_rate/{N}\)", rf"{N}\*tanh\({either}/{N}\)"),
        "ageing": (rf"{N}\*ln\(1 \+ t/{N}\)",) * 2,
        "column_square": (rf"{N}\*{c}\^2",) * 2,
        "column_lag": (rf"{N}\*lag\({c}, {N}\)",) * 2,
        "column_lag_of_size": (rf"{N}\*lag\(abs\({of}\), {N}\)",) * 2,
        "column_times_temperature": (rf"{N}\*{c}\*\(T_mean - 20\)", rf"{N}\*{c}\*{SHIFTED}"),
        "column_threshold": (rf"{N}\*max\({c} - {N}, 0\)", rf"{N}\*(?:max\({c} - {N}, 0\)|{N}\*softplus\(\({c} - {N}\)/{N}\))"),
        "gradient_square": (rf"{N}\*{GRADIENT}\^2", rf"{N}\*{either}\^2"),
        "column_saturation": (rf"{N}\*tanh\({of}/{N}\)",) * 2,
        "column_hysteresis": (rf"{N}\*\(play\({c}, {N}\) - {c}\)",) * 2,
        "column_product": (rf"{N}\*(?:fan_a\*heater_a|heater_a\*fan_a)",) * 2,
        "decay": (rf"{N}\*exp\(-t/{N}\)",) * 2,
        "etalon": (r"(?!)", r"(?!)"),
    }[made["form"]]
    return exact, alike


def likeness(made, formula):
    """`same` (form and variables), `alike` (the form, of another temperature, rate or gradient; a threshold for a softening and the reverse) or `other`."""
    exact, alike = shapes(made)
    if re.fullmatch(exact, formula):
        return "same"
    return "alike" if re.fullmatch(alike, formula) else "other"


def is_formula(said):
    """Whether a member of a set is a formula and not a listed effect's name."""
    return bool(re.match(N + r"\*", said)) or bool(re.fullmatch(N, said))
