"""Pictures by matplotlib. Each draws into ``ax``, or into axes of its own, and gives back the axes."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._errors import RequestError
from ._field import Field
from ._measured_results import CompareResult, CompensateResult, DiagnoseResult, MetricsResult
from ._pattern import Pattern
from ._record import Record
from ._results import EvaluateResult, FieldEvaluateResult, OptimiseResult, ParetoResult, ToleranceResult


_FAR = 30.0
"""Rates that differ by more than this factor are shown on a logarithmic axis."""


def _axes(ax: Any) -> Any:
    if ax is not None:
        return ax
    try:
        import matplotlib.pyplot as plt
    except ImportError as error:
        raise ImportError("pictures need matplotlib: pip install matplotlib") from error
    return plt.subplots(layout="constrained")[1]


def plot_patterns(result: EvaluateResult | OptimiseResult, ax: Any = None) -> Any:
    """Worst rate errors of the patterns; a mark shows the guaranteed one. Bars, or points where a few are far above the others."""
    ax = _axes(ax)
    patterns = [*result.baselines, result.best] if isinstance(result, OptimiseResult) else result.patterns
    names = [p["name"] for p in patterns]
    rates = [p["worst_rate_deg_per_h"] for p in patterns]
    if min(rates, default=1.0) * _FAR < max(rates, default=1.0):
        ax.plot(rates, names, "o", color="#4c78a8", label="over the profiles")
        ax.set_xscale("log")
    else:
        ax.barh(names, rates, color="#4c78a8", label="over the profiles")
    bounds = [p.get("guaranteed_worst_rate_deg_per_h") for p in patterns]
    if any(bound is not None for bound in bounds):
        shown = [(n, b) for n, b in zip(names, bounds) if b is not None]
        ax.plot([b for _, b in shown], [n for n, _ in shown], "k|", markersize=14, label="guaranteed")
    ax.invert_yaxis()
    ax.set_xlabel("worst rate error [°/h]")
    ax.legend()
    return ax


def plot_cross_section(pattern: Pattern, ax: Any = None) -> Any:
    """The layers of a coil, innermost at the bottom, coloured by where along the fibre their segment lies."""
    ax = _axes(ax)
    import matplotlib

    count = pattern.layers
    colours = matplotlib.colormaps["coolwarm"]
    for layer, segment in enumerate(pattern, start=1):
        ax.barh(layer, 1.0, height=0.9, color=colours((segment - 1) / max(count - 1, 1)))
        ax.text(0.5, layer, str(segment), ha="center", va="center", fontsize=8)
    ax.set_yticks([1, *range(4, count + 1, 4)] if count > 4 else range(1, count + 1))
    ax.set_ylim(0.4, count + 0.6)
    ax.set_xlim(0, 1)
    ax.set_xticks([])
    ax.set_ylabel("layer, innermost first")
    ax.set_title(f"{pattern.name}: the segment in each layer")
    return ax


def plot_field(field: Field, ax: Any = None, *, quantity: str = "rate_c_per_h", from_mean: bool = False) -> Any:
    """What the layers do over time: ``quantity`` is "rate_c_per_h" or "temperature_c"; with ``from_mean`` what each has more than all
    have on average, which is what a winding can cancel."""
    if quantity not in ("rate_c_per_h", "temperature_c"):
        raise RequestError(f'quantity: expected "rate_c_per_h" or "temperature_c", found "{quantity}"')
    ax = _axes(ax)
    import matplotlib

    values = getattr(field, quantity)
    if from_mean:
        values = values - values.mean(axis=1, keepdims=True)
    count = field.shape[1]
    colours = matplotlib.colormaps["viridis"]
    for layer in range(count):
        label = f"layer {layer + 1}" if layer in (0, count - 1) else None
        ax.plot(field.time_s / 60, values[:, layer], color=colours(layer / max(count - 1, 1)), lw=1, label=label)
    ax.set_xlabel("time [min]")
    ax.set_ylabel(("rate [°C/h]" if quantity == "rate_c_per_h" else "temperature [°C]") + (" less the mean" if from_mean else ""))
    ax.set_title(field.name)
    ax.legend()
    return ax


def plot_record(record: Record, ax: Any = None) -> Any:
    """A record's rate, and its temperature on an axis of its own."""
    ax = _axes(ax)
    hours = record.time_s / 3600
    ax.plot(hours, record.rate_deg_per_h, ".", ms=2, color="#4c78a8")
    ax.set_xlabel("time [h]")
    ax.set_ylabel("rate [°/h]", color="#4c78a8")
    other = ax.twinx()
    other.plot(hours, record.temperature_c, color="#e45756", lw=1)
    other.set_ylabel("temperature [°C]", color="#e45756")
    ax.set_title(record.name)
    return ax


def plot_comparison(result: CompareResult, ax: Any = None, *, record: int = 0) -> Any:
    """A record's rate beside the model's prediction."""
    ax = _axes(ax)
    curve = result.curves[record]
    hours = curve.time_s / 3600
    ax.plot(hours, curve.measured_deg_per_h, ".", ms=2, color="#9ecae9", label="measured")
    ax.plot(hours, curve.predicted_deg_per_h, color="#e45756", lw=1.2, label="predicted")
    ax.set_xlabel("time [h]")
    ax.set_ylabel("rate [°/h]")
    ax.set_title(f"{curve.name}: {result.records[record].verdict}")
    ax.legend()
    return ax


def plot_diagnosis(result: DiagnoseResult, ax: Any = None) -> Any:
    """The ladder of a diagnosis: what each step leaves, above the noise floor."""
    ax = _axes(ax)
    ladder = result.ladder
    names = [" + ".join(rung["effects"]) or "as declared" for rung in ladder]
    ax.plot(names, [rung["rmse_deg_per_h"] for rung in ladder], "o-", label="fitted records")
    if all(rung["holdout_rmse_deg_per_h"] is not None for rung in ladder):
        ax.plot(names, [rung["holdout_rmse_deg_per_h"] for rung in ladder], "s--", label="held out")
    ax.axhline(result.noise_floor_deg_per_h, color="0.5", ls=":", label="noise floor")
    ax.set_yscale("log")
    ax.set_ylabel("error [°/h]")
    ax.set_title(f"verdict: {result.verdict}")
    ax.tick_params(axis="x", rotation=20)
    ax.legend()
    return ax


def plot_pareto(result: ParetoResult, ax: Any = None) -> Any:
    """The front: worst rate error against the largest climb, by captive reels."""
    ax = _axes(ax)
    points = result.points
    for captive in sorted({p["windability"]["captive"] for p in points}):
        of_count = [p for p in points if p["windability"]["captive"] == captive]
        ax.plot(
            [p["windability"]["max_climb"] for p in of_count],
            [p["worst_rate_deg_per_h"] for p in of_count],
            "o",
            label=f"{captive} captive",
        )
    ax.set_yscale("log")
    ax.set_xlabel("largest climb [layers]")
    ax.set_ylabel("worst rate error [°/h]")
    ax.legend()
    return ax


def plot_tolerance(result: ToleranceResult, ax: Any = None) -> Any:
    """The worst cases of coils built imperfectly: from the median to the 99th of a hundred, and as declared."""
    ax = _axes(ax)
    for place, p in enumerate(result.patterns):
        ax.plot([p["median_deg_per_h"], p["p99_deg_per_h"]], [place, place], color="#4c78a8", lw=6, alpha=0.4)
        ax.plot(p["p95_deg_per_h"], place, "o", color="#4c78a8", label="95 of 100" if place == 0 else None)
        ax.plot(p["nominal_deg_per_h"], place, "k|", markersize=14, label="as declared" if place == 0 else None)
    ax.set_yticks(range(len(result.patterns)), [p["name"] for p in result.patterns])
    ax.invert_yaxis()
    ax.set_xscale("log")
    ax.set_xlabel("worst rate error [°/h]")
    ax.legend()
    return ax


def plot_allan(result: MetricsResult, ax: Any = None, *, record: int = 0) -> Any:
    """The Allan deviation of a record with its standard errors."""
    ax = _axes(ax)
    found = result.records[record]
    points = found["allan"]
    if not points:
        raise RequestError("the record has no stretch that is long enough for an Allan deviation")
    tau = np.array([p["tau_s"] for p in points])
    deviation = np.array([p["deviation_deg_per_h"] for p in points])
    error = np.array([p["standard_error_deg_per_h"] for p in points])
    ax.errorbar(tau, deviation, yerr=np.minimum(error, 0.99 * deviation), fmt="o-", ms=3, capsize=2)
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xlabel("averaging time [s]")
    ax.set_ylabel("Allan deviation [°/h]")
    ax.set_title(found["file"])
    return ax


def plot_compensation(result: CompensateResult, record: Record, ax: Any = None) -> Any:
    """A record's rate before and after compensation, or what every method leaves of it."""
    ax = _axes(ax)
    hours = record.time_s / 3600
    if result.curves:
        for name, rates in result.curves.items():
            ax.plot(hours, rates, lw=0.8, label=name)
    elif result.rate_compensated_deg_per_h is not None:
        ax.plot(hours, record.rate_deg_per_h, lw=0.8, label="before")
        ax.plot(hours, result.rate_compensated_deg_per_h, lw=0.8, label="after")
    else:
        raise RequestError("the result holds no rates: they were written to a file")
    ax.set_xlabel("time [h]")
    ax.set_ylabel("rate [°/h]")
    ax.legend()
    return ax


def plot_rates(result: FieldEvaluateResult, field: Field, ax: Any = None) -> Any:
    """Rate errors of windings under a temperature field."""
    ax = _axes(ax)
    for pattern, rates in zip(result.patterns, result.rates_deg_per_h):
        ax.plot(field.time_s / 60, rates, lw=1, label=pattern["name"])
    ax.set_xlabel("time [min]")
    ax.set_ylabel("rate error [°/h]")
    ax.legend()
    return ax
