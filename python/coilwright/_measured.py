"""The use cases with records: each does what the command of its name does and answers with its document."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

from . import _coilwright, _progress
from ._errors import RequestError
from ._functions import ModelLike, PathLike, model_of, optional_path, optional_pattern, result_of
from ._measured_results import (
    CompareResult,
    Comparison,
    DiagnoseResult,
    ExtendResult,
    ImproveResult,
    MetricsResult,
    TrimResult,
)
from ._model import Model, PatternLike
from ._progress import Progress
from ._record import RecordLike, record_arguments


@contextmanager
def _diagnosis_file(diagnosis: DiagnoseResult | PathLike | None) -> Iterator[str | None]:
    """A diagnosis as a file for as long as it is read."""
    if not isinstance(diagnosis, DiagnoseResult):
        yield optional_path(diagnosis)
        return
    with tempfile.TemporaryDirectory(prefix="coilwright-") as folder:
        path = os.path.join(folder, "diagnosis.json")
        with open(path, "w", encoding="utf-8") as file:
            file.write(diagnosis.to_json())
        yield path


def compare(
    model: ModelLike,
    records: RecordLike | Sequence[RecordLike],
    *,
    pattern: PatternLike | None = None,
    gross_errors: str = "keep",
    output: PathLike | None = None,
    progress: bool | Progress | None = None,
) -> CompareResult:
    """A model's prediction beside measured records, and where it fails.

    Args:
        records: one or several: records, record files, tables with named columns.
        pattern: the winding that was measured; without it, the model's own.
        gross_errors: "keep" or "drop" values that stand alone.
        output: a folder for the document, tables, pictures and the page.
    """
    with _progress.shown(progress, "compare") as at:
        answered, curves = _coilwright.compare(
            model_of(model)._handle,
            record_arguments(records),
            optional_pattern(pattern),
            gross_errors,
            optional_path(output),
            at,
        )
    result = result_of(CompareResult, answered)
    object.__setattr__(result, "curves", [Comparison(*curve) for curve in curves])
    return result


def terms_asked(terms: str | Sequence[str] | None) -> list[str] | None:
    """What a formula may be made of, as the library takes it."""
    return [terms] if isinstance(terms, str) else None if terms is None else list(terms)


def diagnose(
    model: ModelLike,
    records: RecordLike | Sequence[RecordLike],
    *,
    holdout: RecordLike | Sequence[RecordLike] | None = None,
    pattern: PatternLike | None = None,
    output: PathLike | None = None,
    experiment: bool = False,
    seed: int = 1,
    terms: str | Sequence[str] | None = None,
    progress: bool | Progress | None = None,
) -> DiagnoseResult:
    """Which piece of physics a model lacks: fits every known effect to records and says what is missing, and how sure.

    Args:
        records: records to fit.
        holdout: records that are only judged by.
        experiment: plans the profile that would tell the candidates apart (``experiment_source``).
        seed: of the profiles that the experiment is chosen from.
        terms: seeks a formula for what the listed effects leave (``proposals``): "all", or the forms and variables that it may be
            made of, such as "relaxation", "hysteresis", "T_mean" or a column's name; an empty list seeks none. Without it, as the
            command does without ``--terms``.
        output: a folder for the document, the ladder, the extended model, residuals and the page.
    """
    asked = model_of(model)
    wanted = experiment or output is not None
    with _progress.shown(progress, "diagnose") as at:
        answered, extended, source = _coilwright.diagnose(
            asked._handle,
            record_arguments(records),
            record_arguments(holdout),
            optional_pattern(pattern),
            optional_path(output),
            seed if wanted else None,
            terms_asked(terms),
            at,
        )
    result = result_of(DiagnoseResult, answered)
    model_extended = None if extended is None else Model.parse(extended, path=asked.path)
    object.__setattr__(result, "extended", model_extended)
    object.__setattr__(result, "experiment_source", source)
    return result


def extend(
    model: ModelLike,
    effect: str | None = None,
    *,
    proposal: DiagnoseResult | PathLike | None = None,
    fit: RecordLike | Sequence[RecordLike] | None = None,
    holdout: RecordLike | Sequence[RecordLike] | None = None,
    formula: str | None = None,
    parameters: Mapping[str, float] | None = None,
    pattern: PatternLike | None = None,
    output: PathLike | None = None,
) -> ExtendResult:
    """Adds an effect, or what a diagnosis proposes, to a model, fitted to records; comments and layout of the file are kept.

    Args:
        effect: its name in files, such as "strain_mismatch" or "channel:supply_v"; "custom" takes a formula.
        proposal: instead of an effect: a diagnosis that sought formulas, or its file. Its listed effects and proposed terms are added.
        fit: records to fit to; without any the effect gets its start values, and a proposal keeps those of its diagnosis.
        holdout: records to show before and after without fitting to them.
        formula: of a custom effect, in °/h.
        parameters: of the formula, with their start values.
        output: the new model file.
    """
    if (effect is None) == (proposal is None):
        raise RequestError("expected an effect or a proposal, found " + ("neither" if effect is None else "both"))
    asked = model_of(model)
    with _diagnosis_file(proposal) as proposed:
        answered, source = _coilwright.extend(
            asked._handle,
            effect or "",
            record_arguments(fit),
            record_arguments(holdout),
            formula,
            [(name, float(value)) for name, value in (parameters or {}).items()],
            optional_pattern(pattern),
            optional_path(output),
            proposed,
        )
    result = result_of(ExtendResult, answered)
    place = asked.path if output is None else os.fspath(output)
    object.__setattr__(result, "extended", Model.parse(source, path=place))
    return result


def trim(
    model: ModelLike, records: RecordLike | Sequence[RecordLike], *, pattern: PatternLike | None = None
) -> TrimResult:
    """From measured ramps what to cut at which end of the fibre: the coil's effective asymmetric length, and what is then left.

    Args:
        records: one or several with at least one ramp.
        pattern: the winding that was measured; without it, the model's own.
    """
    answered = _coilwright.trim(model_of(model)._handle, record_arguments(records), optional_pattern(pattern))
    return result_of(TrimResult, answered)


def metrics(
    records: RecordLike | Sequence[RecordLike],
    *,
    average_s: float = 10.0,
    gross_errors: str = "keep",
    output: PathLike | None = None,
) -> MetricsResult:
    """Bias, stability, Allan deviation and temperature sensitivity of records.

    Args:
        average_s: averaging time of the bias stability.
        gross_errors: "keep" or "drop" values that stand alone.
        output: a folder for the document, the pictures of the Allan deviation and the page.
    """
    answered = _coilwright.metrics(record_arguments(records), average_s, gross_errors, optional_path(output))
    return result_of(MetricsResult, answered)


def improve(
    model: ModelLike,
    records: RecordLike | Sequence[RecordLike],
    *,
    output: PathLike,
    holdout: RecordLike | Sequence[RecordLike] | None = None,
    pattern: PatternLike | None = None,
    seed: int | None = None,
    terms: str | Sequence[str] | None = None,
    progress: bool | Progress | None = None,
) -> ImproveResult:
    """The whole loop: compares and diagnoses records, extends the model, searches the next winding and writes its schedule.

    Args:
        records: of the coil as it is; the first is the one that is predicted for the new coil.
        output: the folder of all steps.
        terms: as of :func:`diagnose`.
    """
    with _progress.shown(progress, "improve") as at:
        answered = _coilwright.improve(
            model_of(model)._handle,
            record_arguments(records),
            record_arguments(holdout),
            os.fspath(output),
            optional_pattern(pattern),
            seed,
            terms_asked(terms),
            at,
        )
    return result_of(ImproveResult, answered)
