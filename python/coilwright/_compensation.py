"""Compensation: the predictable part of a rate taken out, of whole records and row by row."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _coilwright
from ._errors import RequestError
from ._functions import ModelLike, PathLike, _log, model_of, result_of
from ._measured_results import CompensateResult
from ._model import PatternLike, pattern_argument
from ._record import Record, RecordLike, record_argument, record_arguments

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class CompensatedRow:
    """A row on its way out."""

    number: int
    """As it came in, counted from 0."""
    rate_compensated_deg_per_h: float | None
    """None where nothing is known yet."""
    flags: list[str] = field(default_factory=list)
    """malformed, clock_back, gap, temperature_held, channel_held, rate_held, rate_rejected."""


class Stream:
    """A compensator at work, row by row, in bounded memory; rows come out in order, ``delay_rows`` later."""

    def __init__(self, handle: _coilwright.StreamHandle, channels: list[str]) -> None:
        self._handle = handle
        self._channels = channels
        self._number = 0

    @property
    def delay_rows(self) -> int:
        """By how many rows the output follows the input; known after the first few."""
        return self._handle.delay_rows

    def push(
        self,
        time_s: float,
        temperature_c: float | None,
        rate_deg_per_h: float | None,
        *,
        temperature_inner_c: float | None = None,
        **channels: float | None,
    ) -> list[CompensatedRow]:
        """A row in, None or NaN for a drop-out; the rows that are ready come out."""
        if unknown := sorted(set(channels) - set(self._channels)):
            raise RequestError(f"the model reads no column {unknown[0]}: it reads {', '.join(self._channels) or 'none'}")
        number, self._number = self._number, self._number + 1
        further = [None if (v := channels.get(name)) is None or v != v else float(v) for name in self._channels]
        ready = self._handle.push(number, time_s, temperature_c, rate_deg_per_h, temperature_inner_c, further)
        return [CompensatedRow(*row) for row in ready]

    def finish(self) -> list[CompensatedRow]:
        """The rows that are left; the stream has then ended."""
        return [CompensatedRow(*row) for row in self._handle.finish()]

    def run(self, rows: Iterable[Mapping[str, float | None]]) -> Iterator[CompensatedRow]:
        """Rows as mappings with the names of a record file in, compensated rows out, to the end."""
        for row in rows:
            further = {name: row.get(name) for name in self._channels}
            yield from self.push(
                float(row["time_s"]),  # type: ignore[arg-type]
                row.get("temperature_c"),
                row.get("rate_deg_per_h"),
                temperature_inner_c=row.get("temperature_inner_c"),
                **further,
            )
        yield from self.finish()


class Compensator:
    """A compensator, ready for any record of the same gyro.

    Args:
        model: a :class:`Model` or a model file.
        fit: the record that film, noise, delay and offset (or the lines, or the regression) are fitted to, or several of one gyro.
        method: "physical" (the model's own physics), "piecewise", "regression" or "learned"; all but the first need ``fit``.
        pattern: without it, the model's own.
        linear: one difference equation of fixed gains.
        delay_s: looks so far ahead; without it, as far as the fitted record says is worth it.

    Raises:
        ModelError: a model that no compensator can hold, a record that says nothing.
    """

    def __init__(
        self,
        model: ModelLike,
        *,
        fit: RecordLike | Sequence[RecordLike] | None = None,
        method: str = "physical",
        pattern: PatternLike | None = None,
        linear: bool = False,
        delay_s: float | None = None,
    ) -> None:
        asked = model_of(model)
        taken = record_arguments(fit)
        stated = None if pattern is None else pattern_argument(pattern)
        self._handle, self.notes = _coilwright.compensator(asked._handle, method, taken, stated, linear, delay_s)
        self._made_of = (asked, fit, method, pattern, linear, delay_s)
        for note in self.notes:
            _log.info("%s", note.removeprefix("note: "))

    @property
    def method(self) -> str:
        """How it compensates."""
        return self._handle.method

    @property
    def channel_names(self) -> list[str]:
        """Further columns that it reads."""
        return self._handle.channel_names

    def delay_rows(self, interval_s: float) -> int:
        """By how many rows of this interval the output follows the input."""
        return self._handle.delay_rows(interval_s)

    def __call__(self, record: RecordLike, *, output: PathLike | None = None) -> CompensateResult:
        """Compensates a record, or a record file line by line as the command does.

        Args:
            output: where the lines of a record file go; without it they come back in ``csv``.
        """
        if isinstance(record, (str, os.PathLike)):
            place = None if output is None else os.fspath(output)
            answered, lines = _coilwright.compensate_file(self._handle, os.fspath(record), place)
            result = result_of(CompensateResult, answered)
            times, rates, flags = (None, None, {}) if lines is None else _of_lines(lines)
            return _filled(result, times, rates, flags, lines)
        if output is not None:
            raise RequestError("output: lines are written for record files only; a record's rates come back as an array")
        held = record if isinstance(record, Record) else Record.from_frame(record)
        rates, flagged, answered = self._handle.batch(held._handle)
        return _filled(result_of(CompensateResult, answered), held.time_s, rates, dict(flagged), None)

    def stream(self) -> Stream:
        """Begins a stream of rows."""
        return Stream(self._handle.stream(), self.channel_names)

    def difference_equation(self, interval_s: float | None = None) -> dict[str, Any]:
        """The compensator as a difference equation, as ``compensate --export`` writes it to JSON."""
        equation: dict[str, Any] = json.loads(self._handle.difference_equation(interval_s)[0])
        return equation

    def export(self, prefix: PathLike, interval_s: float | None = None) -> None:
        """Writes the compensator for an embedded target as PREFIX.json and PREFIX.h, as ``compensate --export`` does."""
        stem = os.fspath(prefix)
        self._handle.export(stem + ".json", stem + ".h", interval_s)

    def __reduce__(self) -> tuple[Any, ...]:
        # What it is made of says it all: the same fit gives the same compensator.
        return (_restored, self._made_of)

    def __repr__(self) -> str:
        return f"Compensator({self._made_of[0].name!r}, method={self.method!r})"


def _restored(
    model: ModelLike,
    fit: RecordLike | Sequence[RecordLike] | None,
    method: str,
    pattern: PatternLike | None,
    linear: bool,
    delay_s: float | None,
) -> Compensator:
    return Compensator(model, fit=fit, method=method, pattern=pattern, linear=linear, delay_s=delay_s)


def _filled(
    result: CompensateResult, times: Array | None, rates: Array | None, flags: dict[int, list[str]], csv: bytes | None
) -> CompensateResult:
    for name, value in (
        ("time_s", times),
        ("rate_compensated_deg_per_h", rates),
        ("flags", flags),
        ("csv", csv),
        ("curves", {}),
    ):
        object.__setattr__(result, name, value)
    return result


def _of_lines(lines: bytes) -> tuple[Array | None, Array, dict[int, list[str]]]:
    """Compensated rates and flags of the lines that the command prints."""
    rates: list[float] = []
    flags: dict[int, list[str]] = {}
    separator = ","
    header_seen = False
    units_may_follow = False
    for line in lines.decode("utf-8", "replace").splitlines():
        if not line or line.startswith("#"):
            continue
        if not header_seen:
            header_seen = units_may_follow = True
            separator = line[: -len("flags")][-1]
            continue
        _, rate, flagged = line.rsplit(separator, 2)
        if units_may_follow and rate == "deg_per_h":
            # The row of units that the record has below its names.
            units_may_follow = False
            continue
        units_may_follow = False
        if flagged:
            flags[len(rates)] = flagged.split("|")
        rates.append(float(rate) if rate else float("nan"))
    return None, np.array(rates), flags


def compensate(
    model: ModelLike,
    record: RecordLike | None = None,
    *,
    fit: RecordLike | Sequence[RecordLike] | None = None,
    method: str = "physical",
    pattern: PatternLike | None = None,
    linear: bool = False,
    delay_s: float | None = None,
    all_methods: bool = False,
    output: PathLike | None = None,
) -> CompensateResult:
    """Takes the predictable part out of a record's rate.

    A record file goes through line by line, as through the command: ``csv`` holds what it prints. A :class:`Record` or a table
    comes back as an array. With ``all_methods`` every method is fitted to ``fit`` and tried on the record: ``curves`` holds what
    each leaves, ``methods`` how well each does. With several records to fit to, ``leave_one_out`` says what each method leaves of each
    of them, fitted to the others; ``record`` is then not needed.

    Args:
        model, fit, method, pattern, linear, delay_s: as of :class:`Compensator`.
        output: where the lines of a record file go.
    """
    if all_methods:
        if fit is None:
            raise RequestError("all_methods: needs a record to fit to: give fit")
        stated = None if pattern is None else pattern_argument(pattern)
        answered, curves = _coilwright.compensate_all(
            model_of(model)._handle, record_arguments(fit), None if record is None else record_argument(record), stated
        )
        result = _filled(result_of(CompensateResult, answered), None, None, {}, None)
        object.__setattr__(result, "curves", dict(curves))
        return result
    if record is None:
        raise RequestError("record: needed unless all_methods is set and several records are given to fit to")
    made = Compensator(model, fit=fit, method=method, pattern=pattern, linear=linear, delay_s=delay_s)
    return made(record, output=output)
