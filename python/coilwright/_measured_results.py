"""Results of measurement: each the document that the command of its name prints."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ._result import Result, flat
from ._results import Recommendation

if TYPE_CHECKING:
    from ._model import Model
    from ._pattern import Pattern

Array = npt.NDArray[np.float64]


class CompareResult(Result):
    """A model's prediction beside records.

    Attributes:
        curves: a :class:`Comparison` a record: measured and predicted rates as arrays.
    """

    __slots__ = ("curves",)
    model: str
    pattern: str
    verdict: str
    records: list[Result]
    curves: list[Comparison]

    _columns = (
        "file",
        "rows",
        "verdict",
        "rmse_deg_per_h",
        "noise_floor_deg_per_h",
        "nrmse_fit_percent",
        "reduced_chi_square",
        "offset_deg_per_h",
    )

    def _state(self) -> dict[str, Any]:
        return {**super()._state(), "curves": getattr(self, "curves", [])}

    def _headline(self) -> str:
        return f"{self._data['model']} with {self._data['pattern']}: {self._data['verdict']}"

    def _rows(self) -> list[dict[str, Any]]:
        return [flat(record) for record in self._data["records"]]


class Comparison:
    """A record and its prediction, row by row: arrays of one length."""

    __slots__ = ("name", "time_s", "measured_deg_per_h", "predicted_deg_per_h")

    def __init__(self, name: str, time_s: Array, measured_deg_per_h: Array, predicted_deg_per_h: Array) -> None:
        self.name = name
        self.time_s = time_s
        self.measured_deg_per_h = measured_deg_per_h
        self.predicted_deg_per_h = predicted_deg_per_h

    @property
    def residual_deg_per_h(self) -> Array:
        """Measured less predicted."""
        return self.measured_deg_per_h - self.predicted_deg_per_h

    def __repr__(self) -> str:
        return f"Comparison({self.name!r}, {self.time_s.size} rows)"


class Finding(Result):
    """An effect that a diagnosis accepts."""

    __slots__ = ()
    kind: str
    equivalents: list[str]


class DiagnoseResult(Result):
    """Which physics a model lacks, judged by records.

    Attributes:
        extended: the model with the effects that were found; None where there are none.
        experiment_source: the profile that would tell the candidates apart, as text for ``profiles=``; None if not asked for.
    """

    __slots__ = ("extended", "experiment_source")
    model: str
    verdict: str
    effects: list[Finding]
    ladder: list[Result]
    candidates: list[Result]
    noise_floor_deg_per_h: float
    posterior: list[Result]
    proposals: list[Result]
    suggested_experiment: str | None
    extended: Model | None
    experiment_source: str | None

    _parts = {"effects": Finding}
    _columns = ("effects", "rmse_deg_per_h", "holdout_rmse_deg_per_h", "reduced_chi_square", "bic")

    def _state(self) -> dict[str, Any]:
        return {**super()._state(), "extended": self.extended, "experiment_source": self.experiment_source}

    def _headline(self) -> str:
        kinds = " and ".join(effect["kind"] for effect in self._data["effects"])
        return f"{self._data['model']}: {self._data['verdict']}" + (f", {kinds}" if kinds else "")

    def _rows(self) -> list[dict[str, Any]]:
        return [flat(rung) for rung in self._data["ladder"]]


class ExtendResult(Result):
    """A model with one more effect (``effect``), or with what a diagnosis proposed (``effects``).

    Attributes:
        extended: the new model.
    """

    __slots__ = ("extended",)
    written: str
    effect: Finding
    effects: list[Finding]
    before: CompareResult
    after: CompareResult
    extended: Model

    _parts = {"effect": Finding, "effects": Finding, "before": CompareResult, "after": CompareResult}

    def _state(self) -> dict[str, Any]:
        return {**super()._state(), "extended": self.extended}

    def _headline(self) -> str:
        return " and ".join(self._kinds())

    def _kinds(self) -> list[str]:
        """What was added."""
        added = self._data["effects"] if "effects" in self._data else [self._data["effect"]]
        return [str(effect["kind"]) for effect in added]

    def _rows(self) -> list[dict[str, Any]]:
        pairs = zip(self._data["before"]["records"], self._data["after"]["records"])
        keys = ("rmse_deg_per_h", "reduced_chi_square", "verdict")
        return [
            {"file": b["file"], **{f"{when}.{k}": r[k] for k in keys for when, r in (("before", b), ("after", a))}}
            for b, a in pairs
        ] or [{"effect": kind} for kind in self._kinds()]


class CompensateResult(Result):
    """A record with the predictable part taken out of its rate.

    Attributes:
        time_s: of each row; None where a file went through line by line.
        rate_compensated_deg_per_h: of each row, NaN where nothing is known yet; None where the lines were written to a file.
        flags: by row (counted from 0), what happened to it.
        csv: the lines that the command prints, where a file was compensated without an output.
        curves: by method what is left, where all were asked for; without a record of the fitted ones, each left out in turn, one
            behind the other.
        leave_one_out: what each method leaves of each of several fitted records, fitted to the others; missing otherwise.
    """

    __slots__ = ("time_s", "rate_compensated_deg_per_h", "flags", "csv", "curves")
    model: str
    method: str
    summary: Result | None
    time_s: Array | None
    rate_compensated_deg_per_h: Array | None
    flags: dict[int, list[str]]
    csv: bytes | None
    curves: dict[str, Array]
    leave_one_out: Result

    def _state(self) -> dict[str, Any]:
        return {**super()._state(), **{name: getattr(self, name) for name in CompensateResult.__slots__}}


class TrimResult(Result):
    """What to cut at which end of the fibre."""

    __slots__ = ()
    model: str
    pattern: str
    asymmetric_length_m: Result
    is_significant: bool
    cut_m: float
    end: str
    turns_at_other_end: float
    turns_at_other_end_standard_error: float | None
    present_rate_deg_per_h: float
    predicted_rate_deg_per_h: float
    predicted_rate_standard_error_deg_per_h: float | None
    least: Result | None

    def _headline(self) -> str:
        doubt = "" if self._data["is_significant"] else ", no more than its error allows"
        return f"{self._data['model']}: cut {self._data['cut_m']:.4f} m at end {self._data['end']}{doubt}"

    def _rows(self) -> list[dict[str, Any]]:
        return [flat({k: v for k, v in self._data.items() if k not in ("schema_version", "inputs")})]


class NoiseTerm(Result):
    """One noise of a rate, with its interval."""

    __slots__ = ()
    kind: str
    value: float
    low: float
    high: float
    unit: str


class MetricsResult(Result):
    """What a gyro's data sheet says."""

    __slots__ = ()
    bias_deg_per_h: float
    bias_stability_deg_per_h: float | None
    bias_instability_deg_per_h: float | None
    angle_random_walk_deg_per_sqrt_h: float | None
    temperature_sensitivity_deg_per_h_per_c: float | None
    peak_to_peak_deg_per_h: float
    repeatability_deg_per_h: float | None
    drift_angle_deg: float
    noise: list[NoiseTerm]
    records: list[Result]

    _parts = {"noise": NoiseTerm}
    _columns = (
        "file",
        "rows",
        "bias_deg_per_h",
        "bias_stability_deg_per_h",
        "bias_instability_deg_per_h",
        "angle_random_walk_deg_per_sqrt_h",
        "temperature_sensitivity_deg_per_h_per_c",
        "peak_to_peak_deg_per_h",
    )

    def _rows(self) -> list[dict[str, Any]]:
        return [flat(record) for record in self._data["records"]]


class ImproveResult(Result):
    """From measurements to the next coil; the folder holds every step."""

    __slots__ = ()
    model: str
    measured_pattern: str
    verdict: str
    effects: list[Finding]
    recommendation: Recommendation
    predicted_gain: Result
    predicted_record: str
    page: str

    _parts = {"effects": Finding, "recommendation": Recommendation}

    @property
    def recommended(self) -> Pattern:
        """The pattern to wind next."""
        from ._pattern import Pattern

        found = self._data["recommendation"]
        return Pattern(found["segments"], name=found["pattern"])

    def _headline(self) -> str:
        return str(self._data["recommendation"]["sentence"])
