"""Results of design: each the document that the command of its name prints."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ._result import Result, flat

if TYPE_CHECKING:
    from ._pattern import Pattern

Array = npt.NDArray[np.float64]


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

        ends = (self._data.get("end_a_turns", 0), self._data.get("end_b_turns", 0))
        return Pattern(self._data["segments"], name=self._data["name"], end_turns=ends)

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
        return [flat(pattern) for pattern in self._data["patterns"]]


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
    weighed_by: str
    reasons: list[str]


class Ends(Result):
    """The best with turns of its own at the ends of the fibre, beside the same order of whole layers."""

    __slots__ = ()
    most_left_off_turns: int
    shares_outermost_layer: bool
    best: PatternResult
    best_objective_deg_per_h: float
    whole_layers: str
    whole_layers_objective_deg_per_h: float
    statement: str

    _parts = {"best": PatternResult}


class OptimiseResult(Result):
    """What a search found.

    ``ends`` is there where turns at the ends were to be chosen (``trim_turns``, ``split_layer``).
    """

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
        "ends": Ends,
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
        return [flat(pattern) for pattern in [*self._data["baselines"], self._data["best"]]]


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
        return [flat(point) for point in self._data["points"]]


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
        return [flat(pattern) for pattern in self._data["patterns"]]


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
        return [flat(step) for step in self._data["steps"]]


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
