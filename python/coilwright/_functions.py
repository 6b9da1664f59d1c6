"""The use cases of design: each does what the command of its name does and answers with its document."""

from __future__ import annotations

import json
import logging
import os
from collections.abc import Sequence
from typing import Any, TypeVar

from . import _coilwright, _progress
from ._field import Field
from ._measured_results import DiagnoseResult
from ._model import Model, PatternLike, pattern_argument, pattern_arguments
from ._progress import Progress
from ._record import RecordLike, record_argument
from ._result import Result
from ._results import (
    EvaluateResult,
    ExactResult,
    FieldEvaluateResult,
    OptimiseResult,
    ParetoResult,
    ScheduleResult,
    ToleranceResult,
    VerifyResult,
)

_log = logging.getLogger("coilwright")

R = TypeVar("R", bound=Result)

PathLike = str | os.PathLike[str]
ModelLike = Model | str | os.PathLike[str]
"""A model, or the path of a model file."""


def model_of(stated: ModelLike) -> Model:
    return stated if isinstance(stated, Model) else Model.read(stated)


def result_of(kind: type[R], answered: tuple[str, list[str]]) -> R:
    """A document as a result; what was said on the way goes to the logger ``coilwright`` too."""
    text, notes = answered
    for note in notes:
        _log.info("%s", note.removeprefix("note: "))
    return kind(json.loads(text), notes)


def optional_pattern(pattern: PatternLike | None) -> Any:
    return None if pattern is None else pattern_argument(pattern)


def optional_path(path: PathLike | None) -> str | None:
    return None if path is None else os.fspath(path)


def _diagnosis_text(diagnosis: DiagnoseResult | PathLike | None) -> str | None:
    if diagnosis is None:
        return None
    if isinstance(diagnosis, DiagnoseResult):
        return diagnosis.to_json()
    with open(diagnosis, encoding="utf-8") as file:
        return file.read()


def evaluate(
    model: ModelLike,
    patterns: PatternLike | Sequence[Any] | None = None,
    *,
    profiles: PathLike | None = None,
    field: Field | None = None,
    progress: bool | Progress | None = None,
) -> EvaluateResult:
    """Worst rate error of windings over the model's profiles, or under a temperature field of one's own.

    Args:
        model: a :class:`Model` or a model file.
        patterns: one or several: patterns, classic names, pattern files, segments. Without it, the model's own and all classics
            that fit.
        profiles: a file with a ``[profiles]`` table, used instead of the model's.
        field: temperatures that were computed elsewhere; the result then has ``rates_deg_per_h`` over the field's times.

    Raises:
        RequestError: a name that is none, a pattern of another layer count.
        ModelError: a model that cannot be solved.

    >>> import coilwright as cw
    >>> result = cw.evaluate("examples/paper-200m.toml", ["qua", "dip"])
    >>> [p.name for p in result.patterns]
    ['qua', 'dip']
    """
    asked = model_of(model)
    if profiles is not None:
        asked = asked.with_profiles(profiles)
    if field is not None:
        answered, rates = _coilwright.evaluate_field(asked._handle, field._handle, pattern_arguments(patterns))
        result = result_of(FieldEvaluateResult, answered)
        object.__setattr__(result, "rates_deg_per_h", rates)
        return result
    with _progress.shown(progress, "evaluate") as at:
        return result_of(EvaluateResult, _coilwright.evaluate(asked._handle, pattern_arguments(patterns), at))


def optimise(
    model: ModelLike,
    *,
    seed: int | None = None,
    windability: str | None = None,
    objective: str | None = None,
    budget_s: float | None = None,
    rounds: int | None = None,
    moves: int | None = None,
    patience: int | None = None,
    target_deg_per_h: float | None = None,
    restarts: int | None = None,
    moves_per_restart: int | None = None,
    init: PatternLike | None = None,
    compare_with: PatternLike | None = None,
    prove_s: float | None = None,
    cutting_planes: bool = False,
    trim_turns: int = 0,
    split_layer: bool = False,
    diagnosis: DiagnoseResult | PathLike | None = None,
    output: PathLike | None = None,
    progress: bool | Progress | None = None,
) -> OptimiseResult:
    """Searches the winding pattern with the smallest error. The same seed gives the same answer, unless a clock ends the search.

    Args:
        seed: of everything random; without it, the model's own.
        windability: "standard", "captive:K" or "any"; without it, the model's own.
        objective: "worst-rate", "worst-phase", "rms", "guaranteed-rate", "p95" or "pointing"; without it, the model's own.
        budget_s: ends after this time.
        rounds, moves, patience, target_deg_per_h: further rules; the first that fires ends the search.
        restarts, moves_per_restart: effort of a round.
        init: a pattern to begin with.
        compare_with: a former pattern, or the folder of a search.
        prove_s: tries for so long to prove that the best pattern is the best of its class.
        cutting_planes: lets the worst admissible profiles of what is found join the searched ones.
        trim_turns: chooses up to so many whole turns that are left off at an end of the fibre.
        split_layer: lets the outermost layer be split between the two ends of the fibre.
        diagnosis: the diagnosis that the model comes from, or its file: every set of explanations counts by its probability.
        output: a folder for the run's results, as ``optimise -o`` leaves it.
        progress: True for a bar, or a callable that takes the share done and words.

    Raises:
        RequestError: a class, an objective or a pattern that is none.
        KeyboardInterrupt: on Ctrl-C, at once.
    """
    options = {
        "seed": seed,
        "windability": windability,
        "objective": objective,
        "budget_s": budget_s,
        "rounds": rounds,
        "moves": moves,
        "patience": patience,
        "target": target_deg_per_h,
        "restarts": restarts,
        "moves_per_restart": moves_per_restart,
    }
    with _progress.shown(progress, "optimise") as at:
        answered = _coilwright.optimise(
            model_of(model)._handle,
            options,
            optional_pattern(init),
            optional_pattern(compare_with),
            prove_s,
            optional_path(output),
            cutting_planes,
            _diagnosis_text(diagnosis),
            (trim_turns, split_layer),
            at,
        )
    return result_of(OptimiseResult, answered)


optimize = optimise


def exact(
    model: ModelLike,
    *,
    windability: str | None = None,
    objective: str | None = None,
    budget_s: float = 60.0,
    patterns: PatternLike | Sequence[Any] | None = None,
    seed: int | None = None,
    progress: bool | Progress | None = None,
) -> ExactResult:
    """The best winding of a class with a proof, or a lower bound on what any winding can reach.

    Args:
        windability: "standard", "captive:K" or "any"; without it, the model's own.
        objective: "worst-rate", "rms", "guaranteed-rate" or "pointing"; without it, "worst-rate".
        budget_s: gives up after this time, with the bound reached until then.
        patterns: patterns to begin with, besides the classics and what a short search finds.
    """
    with _progress.shown(progress, "exact") as at:
        answered = _coilwright.exact(
            model_of(model)._handle, pattern_arguments(patterns), windability, objective, budget_s, seed, at
        )
    return result_of(ExactResult, answered)


def pareto(
    model: ModelLike,
    *,
    seed: int | None = None,
    most_captive: int = 2,
    rounds: int = 3,
    output: PathLike | None = None,
    progress: bool | Progress | None = None,
) -> ParetoResult:
    """The front of worst-case error against windability and, where the model has tolerances, robustness.

    Args:
        most_captive: the most captive reels that are tried one by one; any number is tried besides.
        rounds: rounds of restarts a class.
        output: a folder for the table, the pictures and one pattern file a point; an interrupted front goes on from it.
    """
    with _progress.shown(progress, "pareto") as at:
        answered = _coilwright.pareto(model_of(model)._handle, seed, most_captive, rounds, optional_path(output), at)
    return result_of(ParetoResult, answered)


def tolerance(
    model: ModelLike,
    patterns: PatternLike | Sequence[Any] | None = None,
    *,
    samples: int | None = None,
    seed: int | None = None,
    limit_deg_per_h: float | None = None,
    progress: bool | Progress | None = None,
) -> ToleranceResult:
    """Monte Carlo of the worst case under the spreads of the model's ``[tolerance]``.

    Args:
        patterns: without it, the model's own and all classics; QUA always joins where it fits.
        samples: coils to draw.
        limit_deg_per_h: a coil whose worst case is larger is scrap.
    """
    with _progress.shown(progress, "tolerance") as at:
        answered = _coilwright.tolerance(
            model_of(model)._handle, pattern_arguments(patterns), samples, seed, limit_deg_per_h, at
        )
    return result_of(ToleranceResult, answered)


def schedule(
    model: ModelLike, pattern: PatternLike | None = None, *, output: PathLike | None = None
) -> ScheduleResult:
    """The winding of a coil step by step, from the inside out.

    Args:
        pattern: without it, the model's own.
        output: a folder for the schedule, the traveller, the winder's program and the cross-section.
    """
    answered = _coilwright.schedule(model_of(model)._handle, optional_pattern(pattern), optional_path(output))
    return result_of(ScheduleResult, answered)


def verify(model: ModelLike, schedule: PathLike | ScheduleResult) -> VerifyResult:
    """Checks a schedule, a traveller or a machine program with code of its own; the result is true if nothing is violated.

    Args:
        schedule: a file (JSON, CSV, HTML or G-code), or what :func:`schedule` answered.
    """
    handle = model_of(model)._handle
    if isinstance(schedule, ScheduleResult):
        return result_of(VerifyResult, _coilwright.verify(handle, "schedule.json", schedule.to_json()))
    return result_of(VerifyResult, _coilwright.verify(handle, os.fspath(schedule)))


def temperatures(
    model: ModelLike,
    record: RecordLike | None = None,
    *,
    profile: str | None = None,
    profiles: PathLike | None = None,
    rows: int = 601,
) -> Field:
    """Temperature and rate of every layer under a profile of the model, or under a record.

    Args:
        record: a record whose temperature drives the pack; without it, a profile.
        profile: its name; without it, the model's first.
        profiles: a file with a ``[profiles]`` table, used instead of the model's.
        rows: of the answer for a profile, evenly spaced; a record's rows are its own.
    """
    asked = model_of(model)
    if profiles is not None:
        asked = asked.with_profiles(profiles)
    taken = None if record is None else record_argument(record)
    handle, notes = _coilwright.temperatures(asked._handle, taken, profile, rows)
    for note in notes:
        _log.info("%s", note.removeprefix("note: "))
    return Field._of(handle)


def check(path: PathLike) -> Result:
    """All faults of a model file at once, without raising: ``faults`` and ``advice``."""
    return Result(json.loads(_coilwright.check_model(os.fspath(path))))


def effects(*kinds: str) -> list[Result]:
    """The effects that a model can declare, with equations, parameters, bounds and sources; all, or those named."""
    return [Result(effect) for effect in json.loads(_coilwright.effects(list(kinds)))["effects"]]


