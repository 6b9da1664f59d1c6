"""Results: the document that the command of the same name prints, its keys as attributes."""

from __future__ import annotations

import copy
import difflib
import html
import json
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from ._model import Model
    from ._pattern import Pattern

Array = npt.NDArray[np.float64]


class Result(Mapping[str, Any]):
    """A document: its keys are attributes and items, what lies inside are results again.

    Two results are equal if their documents are. ``to_dict()`` is the command's JSON document, number for number.
    """

    __slots__ = ("_data", "notes")

    _data: dict[str, Any]
    notes: list[str]
    """What was said on the way: defaults that were taken, odd values, files that were written."""

    _parts: ClassVar[Mapping[str, type[Result]]] = {}
    _columns: ClassVar[tuple[str, ...]] = ()

    def __init__(self, data: Mapping[str, Any], notes: list[str] | None = None) -> None:
        object.__setattr__(self, "_data", dict(data))
        object.__setattr__(self, "notes", list(notes or []))

    def _wrapped(self, key: str, value: Any) -> Any:
        kind = self._parts.get(key, Result)
        if isinstance(value, dict):
            return kind(value)
        if isinstance(value, list) and value and all(isinstance(entry, dict) for entry in value):
            return [kind(entry) for entry in value]
        return copy.copy(value) if isinstance(value, list) else value

    def __getitem__(self, key: str) -> Any:
        return self._wrapped(key, self._data[key])

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        data = object.__getattribute__(self, "_data")
        if name in data:
            return self._wrapped(name, data[name])
        near = difflib.get_close_matches(name, [str(key) for key in data], n=1)
        hint = f": did you mean {near[0]}?" if near else f": it has {', '.join(map(str, data))}"
        raise AttributeError(f"{type(self).__name__} has no {name}{hint}")

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"{type(self).__name__} is read only")

    def __iter__(self) -> Iterator[str]:
        return iter(self._data)

    def __len__(self) -> int:
        return len(self._data)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *(key for key in self._data if key.isidentifier())})

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Result) and self._data == other._data

    __hash__ = None  # type: ignore[assignment]

    def _state(self) -> dict[str, Any]:
        """What there is besides the document, for pickles."""
        return {"notes": self.notes}

    def __reduce__(self) -> tuple[Any, ...]:
        return (_restored, (type(self), self._data, self._state()))

    def __copy__(self) -> Result:
        return self

    def __deepcopy__(self, memo: dict[int, Any]) -> Result:
        return self

    def to_dict(self) -> dict[str, Any]:
        """The document as plain Python, as ``coilwright … --format json`` prints it."""
        return copy.deepcopy(self._data)

    def to_json(self, *, indent: int | None = 2) -> str:
        """The document as JSON text."""
        return json.dumps(self._data, indent=indent, ensure_ascii=False)

    def _rows(self) -> list[dict[str, Any]]:
        """The document's table, one flat dictionary a row."""
        return [_flat(self._data)]

    def to_pandas(self) -> Any:
        """The result's table as a :class:`pandas.DataFrame`, one row an entry; nested keys are joined by a point."""
        import pandas

        return pandas.DataFrame(self._rows())

    def to_polars(self) -> Any:
        """The result's table as a :class:`polars.DataFrame`, one row an entry; nested keys are joined by a point."""
        import polars

        return polars.DataFrame(self._rows(), infer_schema_length=None)

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        """The result's table through the Arrow C stream interface, for any library that speaks it; needs pyarrow."""
        import pyarrow

        return pyarrow.Table.from_pylist(self._rows()).__arrow_c_stream__(requested_schema)

    def _headline(self) -> str:
        return str(self._data.get("model", ""))

    def _table(self) -> tuple[list[str], list[list[str]]]:
        rows = self._rows()
        columns = [c for c in self._columns if any(c in row for row in rows)] or [
            key for key, value in (rows[0] if rows else {}).items() if not isinstance(value, (list, dict))
        ]
        return columns, [[_shown(row.get(column)) for column in columns] for row in rows]

    def __repr__(self) -> str:
        header, rows = self._table()
        title = f"{type(self).__name__}: {self._headline()}".rstrip(": ")
        if len(rows) == 1 and not self._columns:
            width = max((len(name) for name in header), default=0)
            lines = [f"  {name:<{width}}  {cell}" for name, cell in zip(header, rows[0])]
        else:
            widths = [max(len(cell) for cell in column) for column in zip(header, *rows)]
            lines = ["  " + "  ".join(cell.ljust(w) for cell, w in zip(line, widths)).rstrip() for line in [header, *rows]]
        return "\n".join([title, *lines])

    def _repr_html_(self) -> str:
        header, rows = self._table()
        if len(rows) == 1 and not self._columns:
            body = "".join(f"<tr><th>{html.escape(n)}</th><td>{html.escape(c)}</td></tr>" for n, c in zip(header, rows[0]))
        else:
            head = "".join(f"<th>{html.escape(cell)}</th>" for cell in header)
            body = f"<tr>{head}</tr>" + "".join(
                "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows
            )
        title = html.escape(f"{type(self).__name__}: {self._headline()}".rstrip(": "))
        return f"<div><strong>{title}</strong><table>{body}</table></div>"


def _restored(kind: type[Result], data: dict[str, Any], state: dict[str, Any]) -> Result:
    result = kind.__new__(kind)
    object.__setattr__(result, "_data", data)
    for name, value in state.items():
        object.__setattr__(result, name, value)
    return result


def _flat(data: Mapping[str, Any], lead: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in data.items():
        if isinstance(value, dict):
            flat.update(_flat(value, f"{lead}{key}."))
        else:
            flat[lead + key] = value
    return flat


def _shown(value: Any) -> str:
    if value is None:
        return "–"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        text = " ".join(_shown(entry) for entry in value[:12] if not isinstance(entry, (dict, list)))
        return text + (" …" if len(value) > 12 else "")
    return str(value)


class Windability(Result):
    """What a pattern asks of the winding shop."""

    __slots__ = ()
    class_: str
    reels: int
    captive: int
    max_climb: int

    def __getattr__(self, name: str) -> Any:
        # "class" is a word of the language.
        return super().__getattr__("class" if name == "class_" else name)


class PatternResult(Result):
    """A pattern with its worst case."""

    __slots__ = ()
    name: str
    segments: list[int]
    worst_rate_deg_per_h: float
    worst_phase_rad: float
    worst_profile: str
    worst_time_s: float
    guaranteed_worst_rate_deg_per_h: float | None
    grid_margin_deg_per_h: float | None
    worst_pointing_error_deg: float | None
    guaranteed_pointing_error_deg: float | None
    windability: Windability

    _parts = {"windability": Windability}

    @property
    def pattern(self) -> Pattern:
        """The pattern itself."""
        from ._pattern import Pattern

        return Pattern(self._data["segments"], name=self._data["name"])

    def _headline(self) -> str:
        return str(self._data.get("name", ""))


class Proof(Result):
    """What was proved about a pattern: "optimal", "gap" or "none", and the bound that no pattern is below."""

    __slots__ = ()
    status: str
    lower_bound_deg_per_h: float | None
    grid_margin_deg_per_h: float | None


_PATTERN_COLUMNS = (
    "name",
    "worst_rate_deg_per_h",
    "guaranteed_worst_rate_deg_per_h",
    "p95_rate_deg_per_h",
    "worst_profile",
    "worst_time_s",
    "windability.class",
    "windability.reels",
    "windability.max_climb",
)


class EvaluateResult(Result):
    """Worst rate errors of windings."""

    __slots__ = ()
    model: str
    patterns: list[PatternResult]

    _parts = {"patterns": PatternResult}
    _columns = _PATTERN_COLUMNS

    def _rows(self) -> list[dict[str, Any]]:
        return [_flat(pattern) for pattern in self._data["patterns"]]


class FieldEvaluateResult(EvaluateResult):
    """Rate errors of windings under a temperature field.

    Attributes:
        rates_deg_per_h: one array a pattern, at the field's times.
    """

    __slots__ = ("rates_deg_per_h",)
    rates_deg_per_h: list[Array]
    field: str

    def _state(self) -> dict[str, Any]:
        return {**super()._state(), "rates_deg_per_h": self.rates_deg_per_h}


class Recommendation(Result):
    """What to wind, in one sentence with its reasons."""

    __slots__ = ()
    pattern: str
    segments: list[int]
    sentence: str
    reasons: list[str]


class OptimiseResult(Result):
    """What a search found."""

    __slots__ = ()
    model: str
    objective: str
    windability: str
    seed: int
    best: PatternResult
    baselines: list[PatternResult]
    improvement_over_qua: float | None
    statement: str
    recommendation: Recommendation | None
    proof: Proof
    evaluations: int
    rounds: int
    stopped_by: str
    reproducible: bool

    _parts = {
        "best": PatternResult,
        "baselines": PatternResult,
        "proof": Proof,
        "recommendation": Recommendation,
        "compared_with": PatternResult,
    }
    _columns = _PATTERN_COLUMNS

    @property
    def pattern(self) -> Pattern:
        """The best pattern."""
        return self.best.pattern

    @property
    def recommended(self) -> Pattern:
        """The pattern to wind: judged on what was not searched, it need not be the best on what was."""
        from ._pattern import Pattern

        found = self._data["recommendation"]
        return Pattern(found["segments"], name=found["pattern"]) if found else self.pattern

    def _headline(self) -> str:
        found = self._data.get("recommendation")
        return str(found["sentence"] if found else self._data.get("statement", ""))

    def _rows(self) -> list[dict[str, Any]]:
        return [_flat(pattern) for pattern in [*self._data["baselines"], self._data["best"]]]


class ExactResult(Result):
    """The best winding of a class with a proof."""

    __slots__ = ()
    model: str
    windability: str
    objective: str
    best: PatternResult
    best_objective_deg_per_h: float
    proof: Proof
    nodes: int
    judged: int
    rows: int
    seconds: float

    _parts = {"best": PatternResult, "proof": Proof}

    @property
    def pattern(self) -> Pattern:
        """The best pattern."""
        return self.best.pattern


class ParetoResult(Result):
    """The front of error against windability and robustness."""

    __slots__ = ()
    model: str
    seed: int
    points: list[PatternResult]

    _parts = {"points": PatternResult}
    _columns = (
        "name",
        "worst_rate_deg_per_h",
        "p95_rate_deg_per_h",
        "windability.captive",
        "windability.max_climb",
        "long_crossovers",
    )

    def _rows(self) -> list[dict[str, Any]]:
        return [_flat(point) for point in self._data["points"]]


class Distribution(Result):
    """The worst cases of coils built imperfectly, for one pattern."""

    __slots__ = ()
    name: str
    nominal_deg_per_h: float
    median_deg_per_h: float
    p95_deg_per_h: float
    p99_deg_per_h: float

    @property
    def yield_share(self) -> float | None:
        """The share of coils within the limit; None without a limit. The document's key is ``yield``."""
        value = self._data["yield"]
        return None if value is None else float(value)


class ToleranceResult(Result):
    """What windings are worth when they are built imperfectly."""

    __slots__ = ()
    model: str
    samples: int
    seed: int
    measure: str
    limit_deg_per_h: float | None
    patterns: list[Distribution]

    _parts = {"patterns": Distribution}
    _columns = ("name", "nominal_deg_per_h", "median_deg_per_h", "p95_deg_per_h", "p99_deg_per_h", "yield")

    def _rows(self) -> list[dict[str, Any]]:
        return [_flat(pattern) for pattern in self._data["patterns"]]


class ScheduleResult(Result):
    """The order of work at the winding machine; ``steps`` has one entry a layer."""

    __slots__ = ()
    model: str
    pattern: str
    segments: list[int]
    length_m: float
    steps: list[Result]
    reels: list[Result]
    worst_rate_deg_per_h: float

    _columns = (
        "step", "layer", "half", "segment", "supply_reel", "direction", "turns", "fibre_from_m", "fibre_to_m",
        "length_m", "radius_mm", "climb", "cumulative_m",
    )  # fmt: skip

    def _rows(self) -> list[dict[str, Any]]:
        return [_flat(step) for step in self._data["steps"]]


class Violation(Result):
    """Something in a claim that is not so."""

    __slots__ = ()
    row: int | None
    field: str
    expected: str
    found: str
    remedy: str
    message: str


class VerifyResult(Result):
    """Whether a schedule is right for a coil; true if nothing is violated."""

    __slots__ = ()
    model: str
    schedule: str
    checks: int
    rate_check: str
    violations: list[Violation]

    _parts = {"violations": Violation}

    def __bool__(self) -> bool:
        return not self._data["violations"]


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
        return [_flat(record) for record in self._data["records"]]


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
        return [_flat(rung) for rung in self._data["ladder"]]


class ExtendResult(Result):
    """A model with one more effect.

    Attributes:
        extended: the new model.
    """

    __slots__ = ("extended",)
    written: str
    effect: Finding
    before: CompareResult
    after: CompareResult
    extended: Model

    _parts = {"effect": Finding, "before": CompareResult, "after": CompareResult}

    def _state(self) -> dict[str, Any]:
        return {**super()._state(), "extended": self.extended}

    def _headline(self) -> str:
        return str(self._data["effect"]["kind"])

    def _rows(self) -> list[dict[str, Any]]:
        pairs = zip(self._data["before"]["records"], self._data["after"]["records"])
        keys = ("rmse_deg_per_h", "reduced_chi_square", "verdict")
        return [
            {"file": b["file"], **{f"{when}.{k}": r[k] for k in keys for when, r in (("before", b), ("after", a))}}
            for b, a in pairs
        ] or [{"effect": self._data["effect"]["kind"]}]


class CompensateResult(Result):
    """A record with the predictable part taken out of its rate.

    Attributes:
        time_s: of each row; None where a file went through line by line.
        rate_compensated_deg_per_h: of each row, NaN where nothing is known yet; None where the lines were written to a file.
        flags: by row (counted from 0), what happened to it.
        csv: the lines that the command prints, where a file was compensated without an output.
        curves: by method what is left, where all were asked for.
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

    def _state(self) -> dict[str, Any]:
        return {**super()._state(), **{name: getattr(self, name) for name in CompensateResult.__slots__}}


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
        return [_flat(record) for record in self._data["records"]]


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


class FoundPattern(Result):
    """A pattern that a search for a cost of one's own found."""

    __slots__ = ()
    cost: float
    segments: list[int]

    @property
    def pattern(self) -> Pattern:
        """The pattern itself."""
        from ._pattern import Pattern

        return Pattern(self._data["segments"])


class SearchResult(Result):
    """What a search for a cost of one's own found; ``found`` is best first."""

    __slots__ = ()
    windability: str
    seed: int
    best: FoundPattern
    found: list[FoundPattern]
    evaluations: int
    evaluations_per_s: float
    seconds: float
    rounds: int
    stopped_by: str

    _parts = {"best": FoundPattern, "found": FoundPattern}
    _columns = ("cost", "segments")

    @property
    def pattern(self) -> Pattern:
        """The best pattern."""
        return self.best.pattern

    def _headline(self) -> str:
        return f"{self._data['evaluations']} moves judged, ended by: {self._data['stopped_by']}"

    def _rows(self) -> list[dict[str, Any]]:
        return list(self._data["found"])
