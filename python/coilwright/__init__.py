"""coilwright from Python: winding patterns of fibre-optic-gyroscope coils.

When the temperature changes, points that mirror each other about the fibre's middle warm at different rates, and the gyro reports a
rotation that is not there (the Shupe effect). Which piece of fibre lies in which layer decides how much.

>>> import coilwright as cw
>>> model = cw.Model.read("examples/paper-200m.toml")
>>> found = cw.evaluate(model, ["zyl", "qua"])
>>> zyl, qua = found.patterns
>>> zyl.worst_rate_deg_per_h > 2 * qua.worst_rate_deg_per_h
True

Functions do what the commands of their names do. A result's keys are attributes; ``to_dict()`` is the document that the command prints,
number for number. Units are in the names; arrays are NumPy's. Work is done without the interpreter's lock, Ctrl-C ends it, and
``progress=True`` shows how far it is. Every exception is a :class:`CoilwrightError`.
"""

from ._compensation import CompensatedRow, Compensator, Stream, compensate
from ._coilwright import __version__
from ._errors import CoilwrightError, Fault, FileError, ModelError, RequestError, WriteError
from ._field import Field
from ._functions import (
    check,
    effects,
    evaluate,
    exact,
    optimise,
    optimize,
    pareto,
    schedule,
    temperatures,
    tolerance,
    verify,
)
from ._further import (
    CampaignCell,
    CampaignResult,
    PageResult,
    ReproduceResult,
    WorkflowResult,
    bang_bang,
    campaign,
    campaign_cells,
    campaign_workflow,
    explore,
    report,
    reproduce,
    schema,
)
from ._measured import compare, diagnose, extend, improve, metrics, trim
from ._measured_results import (
    CompareResult,
    Comparison,
    CompensateResult,
    DiagnoseResult,
    ExtendResult,
    Finding,
    ImproveResult,
    MetricsResult,
    NoiseTerm,
    TrimResult,
)
from ._model import Model
from ._pattern import Pattern, WindingGraph, WindingStep, classic, classics
from ._plot import (
    plot_allan,
    plot_comparison,
    plot_compensation,
    plot_cross_section,
    plot_diagnosis,
    plot_field,
    plot_pareto,
    plot_patterns,
    plot_rates,
    plot_record,
    plot_tolerance,
)
from ._record import Record
from ._result import Result
from ._results import (
    Distribution,
    EvaluateResult,
    ExactResult,
    FieldEvaluateResult,
    FoundPattern,
    OptimiseResult,
    ParetoResult,
    PatternResult,
    Proof,
    Recommendation,
    ScheduleResult,
    SearchResult,
    ToleranceResult,
    VerifyResult,
    Violation,
    Windability,
)
from ._search import search_field, search_function, search_matrix, sensitivities
from ._versions import show_versions, versions

__all__ = [
    "CampaignCell",
    "CampaignResult",
    "CoilwrightError",
    "CompareResult",
    "Comparison",
    "CompensateResult",
    "CompensatedRow",
    "Compensator",
    "DiagnoseResult",
    "Distribution",
    "EvaluateResult",
    "ExactResult",
    "ExtendResult",
    "Fault",
    "Field",
    "FieldEvaluateResult",
    "FileError",
    "Finding",
    "FoundPattern",
    "ImproveResult",
    "MetricsResult",
    "Model",
    "ModelError",
    "NoiseTerm",
    "OptimiseResult",
    "PageResult",
    "ParetoResult",
    "Pattern",
    "PatternResult",
    "Proof",
    "Recommendation",
    "Record",
    "ReproduceResult",
    "RequestError",
    "Result",
    "ScheduleResult",
    "SearchResult",
    "Stream",
    "ToleranceResult",
    "TrimResult",
    "VerifyResult",
    "Violation",
    "Windability",
    "WindingGraph",
    "WindingStep",
    "WorkflowResult",
    "WriteError",
    "__version__",
    "bang_bang",
    "campaign",
    "campaign_cells",
    "campaign_workflow",
    "check",
    "classic",
    "classics",
    "compare",
    "compensate",
    "diagnose",
    "effects",
    "evaluate",
    "exact",
    "explore",
    "extend",
    "improve",
    "metrics",
    "optimise",
    "optimize",
    "pareto",
    "plot_allan",
    "plot_comparison",
    "plot_compensation",
    "plot_cross_section",
    "plot_diagnosis",
    "plot_field",
    "plot_pareto",
    "plot_patterns",
    "plot_rates",
    "plot_record",
    "plot_tolerance",
    "report",
    "reproduce",
    "schedule",
    "schema",
    "search_field",
    "search_function",
    "search_matrix",
    "sensitivities",
    "show_versions",
    "temperatures",
    "tolerance",
    "trim",
    "verify",
    "versions",
]
