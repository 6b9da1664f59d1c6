"""Campaigns, publications, pages, schemas: what is neither the design nor the measurement of one coil."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from typing import Any

from . import _coilwright, _command, _progress
from ._functions import ModelLike, PathLike, model_of, optional_path, result_of
from ._model import Model, PatternLike, pattern_arguments
from ._progress import Progress
from ._result import Result, flat


class CampaignCell(Result):
    """A cell of a campaign: a search, a block of built coils, or a gyro."""

    __slots__ = ()
    id: str
    kind: str
    model: str | None
    layers: int | None
    objective: str | None
    seed: int | None
    coils: list[int] | None
    gyro: str | None
    done: bool
    estimated_s: float

    @property
    def class_(self) -> str | None:
        """The class of patterns that is searched."""
        found: str | None = self._data.get("class")
        return found


class CampaignResult(Result):
    """What became of a campaign, or of a part of it; true if nothing is missing.

    The table is the campaign's own: of searches, of built coils, or of its cells.
    """

    __slots__ = ()
    campaign: str
    cells: list[CampaignCell]
    searched: int
    missing: list[str]
    failed: list[str]
    results: list[Result]
    built_coils: list[Result]
    fleet: Result | None

    _parts = {"cells": CampaignCell}
    _columns = ("model", "layers", "windability", "class", "objective", "seed", "coils", "gyro", "worst_rate_deg_per_h", "done")

    def __bool__(self) -> bool:
        return not self._data["missing"]

    def _headline(self) -> str:
        data = self._data
        return f"{data['campaign']}, {len(data['cells'])} cells, {len(data['missing'])} missing"

    def _rows(self) -> list[dict[str, Any]]:
        rows = self._data.get("results") or self._data["cells"]
        return [flat(row) for row in rows]


class WorkflowResult(CampaignResult):
    """A campaign as a workflow of an engine."""

    __slots__ = ()
    engine: str
    parts: int
    files: list[str]


class ReproduceResult(Result):
    """A publication's results beside the computed ones, with every discrepancy named."""

    __slots__ = ()
    publication: str
    errata: list[Result]
    files: list[str]

    def _headline(self) -> str:
        return str(self._data["publication"])

    def _rows(self) -> list[dict[str, Any]]:
        tables = (value for key, value in self._data.items() if key != "errata" and value and isinstance(value, list))
        return next(([flat(row) for row in table] for table in tables if isinstance(table[0], dict)), [flat(self._data)])


class PageResult(Result):
    """A page that was written."""

    __slots__ = ()
    bytes: int

    @property
    def path(self) -> str:
        """Where it stands."""
        return str(self._data.get("report", self._data.get("page")))

    def _headline(self) -> str:
        return self.path


def campaign(
    file: PathLike,
    output: PathLike | None = None,
    *,
    cells: str | Sequence[str] = (),
    shard: tuple[int, int] | None = None,
    merge: bool = False,
    checkpoint_every_s: float | None = None,
    progress: bool | Progress | None = None,
) -> CampaignResult:
    """A grid of searches, a million built coils, or the gyros of a fleet. What is done already is not computed again.

    Args:
        file: the campaign file.
        output: the folder of the cells' results and, once nothing is missing, of table, page and pictures. Without it nothing is
            computed: the cells are listed with identifiers and what each takes.
        cells: only the cells of these identifiers.
        shard: (i, n) for only the i-th of n parts that cost about the same, counted from 1.
        merge: computes nothing, but writes the table.
        checkpoint_every_s: a long search keeps its state when the last one is older than this; 10 without it.

    >>> import coilwright as cw
    >>> listed = cw.campaign("examples/campaigns/layers.toml")
    >>> len(listed.cells), bool(listed), listed.cells[0].class_
    (8, False, 'standard')
    """
    ids = [cells] if isinstance(cells, str) else list(cells)
    with _progress.shown(progress, "campaign") as at:
        answered = _coilwright.campaign(
            os.fspath(file), optional_path(output), ids, shard, merge, False, checkpoint_every_s, at
        )
    return result_of(CampaignResult, answered)


def campaign_cells(file: PathLike, output: PathLike | None = None) -> CampaignResult:
    """The cells of a campaign with their identifiers, what each takes on one thread, and, of a folder, which are done."""
    answered = _coilwright.campaign(os.fspath(file), optional_path(output), [], None, False, True, None, None)
    return result_of(CampaignResult, answered)


def campaign_workflow(
    file: PathLike, engine: str, output: PathLike, *, job_time_s: float = 600.0, threads: int = 1
) -> WorkflowResult:
    """Writes a workflow that runs a campaign on an engine.

    Args:
        engine: "snakemake" or "slurm".
        output: the workflow's folder; the results come into ``results`` there.
        job_time_s: what a job should take; cells are grouped accordingly.
        threads: of each job.
    """
    answered = _coilwright.campaign_workflow(
        os.fspath(file), engine, os.fspath(output), _command.program(), job_time_s, threads
    )
    return result_of(WorkflowResult, answered)


def reproduce(publication: str, *, output: PathLike | None = None) -> ReproduceResult:
    """A publication's results, as printed beside as computed, with every discrepancy named.

    Args:
        publication: "yan1998" or "thesis2021".
        output: a folder for tables and pictures; without it nothing is written.
    """
    return result_of(ReproduceResult, _coilwright.reproduce(publication, optional_path(output)))


def report(folder: PathLike, *, output: PathLike | None = None) -> PageResult:
    """One self-contained page about a search, a comparison, a diagnosis or measures.

    Args:
        folder: what :func:`optimise`, :func:`compare`, :func:`diagnose` or :func:`metrics` left as ``output``.
        output: the page; without it, ``report.html`` in the folder.
    """
    return result_of(PageResult, _coilwright.report(os.fspath(folder), optional_path(output)))


def explore(
    model: ModelLike, patterns: PatternLike | Sequence[Any] | None = None, *, output: PathLike = "explorer.html"
) -> PageResult:
    """One self-contained page that holds the model, in which layers are moved by hand; it needs a browser and nothing else.

    Args:
        patterns: windings to begin with, the first of them shown; the model's own comes after them.
        output: the page.
    """
    answered = _coilwright.explore(model_of(model)._handle, pattern_arguments(patterns), os.fspath(output))
    return result_of(PageResult, answered)


def bang_bang(
    model: ModelLike, patterns: PatternLike | Sequence[Any] | None = None, *, output: PathLike | None = None
) -> Model:
    """A copy of the model in which the profiles that attain the guaranteed worst cases are listed, one a pattern: between the
    steepest rise and the steepest fall, as each pattern likes it least.

    Args:
        patterns: as of :func:`evaluate`.
        output: the new model file.

    >>> import coilwright as cw
    >>> listed = cw.bang_bang("examples/paper-200m.toml", "qua")
    >>> listed.profiles[:2]
    ['paper', 'bang-bang-qua']
    """
    asked = model_of(model)
    source = _coilwright.bang_bang(asked._handle, pattern_arguments(patterns), optional_path(output))
    return Model.parse(source, path=asked.path if output is None else os.fspath(output))


def schema(kind: str) -> dict[str, Any]:
    """The JSON Schema of a file format: "model", "pattern", "record", "schedule", "campaign" or "compensation"."""
    found: dict[str, Any] = json.loads(_coilwright.schema(kind))["schema"]
    return found
