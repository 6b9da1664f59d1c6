"""Compensation as a batch and as a stream."""

from __future__ import annotations

import csv
import pickle
from pathlib import Path

import numpy as np
import pytest

import coilwright as cw
from conftest import ROOT

COIL = "examples/chamber-coil.toml"


def columns_of(path: str) -> dict[str, np.ndarray]:
    """As the file states them: the way through another unit and back would cost a rounding."""
    with (ROOT / path).open(encoding="utf-8") as file:
        rows = csv.DictReader(line for line in file if not line.startswith("#"))
        table = [{name: float(value) for name, value in row.items()} for row in rows]
    return {name: np.array([row[name] for row in table]) for name in ("time_s", "temperature_c", "rate_deg_per_h")}


@pytest.mark.parametrize("method", ["physical", "piecewise", "regression", "learned"])
def test_a_stream_gives_the_batch_s_numbers_to_the_last_bit(day_1: cw.Record, method: str) -> None:
    columns = columns_of("examples/chamber-day-2.csv")
    record = cw.Record(**columns)
    compensator = cw.Compensator(COIL, fit=day_1, method=method)
    batch = compensator(record)
    stream = compensator.stream()
    rows = [row for values in zip(*columns.values()) for row in stream.push(*map(float, values))]
    assert len(rows) < len(record) or stream.delay_rows <= 1
    rows += stream.finish()
    assert [row.number for row in rows] == list(range(len(record)))
    streamed = np.array([np.nan if r.rate_compensated_deg_per_h is None else r.rate_compensated_deg_per_h for r in rows])
    assert batch.rate_compensated_deg_per_h is not None and np.isfinite(streamed).sum() > 100
    assert streamed.tobytes() == batch.rate_compensated_deg_per_h.tobytes()
    assert {r.number: r.flags for r in rows if r.flags} == batch.flags
    assert compensator.delay_rows(record.interval_s) == stream.delay_rows or stream.delay_rows == 0
    with pytest.raises(cw.RequestError, match="ended"):
        stream.push(1e9, 20.0, 0.0)


def pushed(record: cw.Record, i: int) -> tuple[float, float, float]:
    return float(record.time_s[i]), float(record.temperature_c[i]), float(record.rate_deg_per_h[i])


def test_drop_outs_of_a_stream_are_flagged_and_no_row_is_lost(day_1: cw.Record) -> None:
    stream = cw.Compensator(COIL, fit=day_1, method="piecewise").stream()
    rows = []
    for i in range(200):
        time_s, temperature, rate = pushed(day_1, i)
        rows += stream.push(time_s, None if i == 100 else temperature, float("nan") if i == 120 else rate)
    rows += stream.finish()
    assert len(rows) == 200
    assert rows[100].flags == ["temperature_held"] and "rate_held" in rows[120].flags


def test_rows_as_mappings_go_through_a_stream(day_1: cw.Record) -> None:
    table = day_1.to_dict()
    rows = ({name: float(values[i]) for name, values in table.items()} for i in range(50))
    found = list(cw.Compensator(COIL, fit=day_1, method="regression").stream().run(rows))
    assert len(found) == 50
    with pytest.raises(cw.RequestError, match="reads no column vibration"):
        cw.Compensator(COIL, fit=day_1, method="regression").stream().push(0.0, 20.0, 0.1, vibration=1.0)


def test_compensation_takes_the_predictable_part_out(day_1: cw.Record) -> None:
    found = cw.compensate(COIL, cw.Record.read("examples/chamber-day-2.csv"), fit=day_1, method="regression")
    assert found.summary is not None
    assert found.summary.compensated_deviation_deg_per_h < found.summary.rate_deviation_deg_per_h
    again = pickle.loads(pickle.dumps(found))
    assert np.array_equal(again.rate_compensated_deg_per_h, found.rate_compensated_deg_per_h, equal_nan=True)


def test_a_compensator_is_exported_and_pickled(day_1: cw.Record, tmp_path: Path) -> None:
    complete = cw.extend(COIL, "finite_pack").extended
    compensator = cw.Compensator(complete, fit=day_1)
    equation = compensator.difference_equation()
    assert equation["schema_version"] == 1
    compensator.export(tmp_path / "embedded")
    assert (tmp_path / "embedded.json").is_file() and "#" in (tmp_path / "embedded.h").read_text(encoding="utf-8")
    again = pickle.loads(pickle.dumps(compensator))
    day_2 = cw.Record.read("examples/chamber-day-2.csv")
    assert np.array_equal(again(day_2).rate_compensated_deg_per_h, compensator(day_2).rate_compensated_deg_per_h)
    assert "physical" in repr(compensator)


def test_what_needs_a_record_says_so() -> None:
    with pytest.raises(cw.ModelError, match="needs a record"):
        cw.Compensator(COIL, method="piecewise")
    with pytest.raises(cw.RequestError, match="expected one of physical"):
        cw.Compensator(COIL, method="magic")


def test_many_rows_go_through_and_each_depends_on_those_before_it_only(day_1: cw.Record) -> None:
    # How fast a million go, python/benches/speed.py says.
    rows = 100_000
    t = np.arange(rows) * 1.0
    columns = {"time_s": t, "temperature_c": 25 + 10 * np.sin(t / 7000), "rate_deg_per_h": 0.1 * np.cos(t / 7000)}
    compensator = cw.Compensator(COIL, fit=day_1, method="regression")
    whole = compensator(cw.Record(**columns)).rate_compensated_deg_per_h
    half = compensator(cw.Record(**{name: values[: rows // 2] for name, values in columns.items()})).rate_compensated_deg_per_h
    assert whole is not None and half is not None and whole.size == rows
    assert np.array_equal(whole[: rows // 2 - 100], half[:-100], equal_nan=True)


def test_each_of_several_records_is_left_out_in_turn(day_1: cw.Record) -> None:
    day_2 = cw.Record.read("examples/chamber-day-2.csv")
    found = cw.compensate(COIL, fit=[day_1, day_2], all_methods=True)
    methods = {method.method: method for method in found.leave_one_out.methods}
    assert list(methods) == ["physical", "piecewise", "regression", "learned"]
    # Leaving one of two out is fitting to the other.
    alone = cw.compensate(COIL, day_2, fit=day_1, all_methods=True)
    for method in alone.methods:
        assert methods[method.method].records[1].rms_deg_per_h == method.rms_deg_per_h
    assert found.curves["regression"].size == len(day_1) + len(day_2)
    with pytest.raises(cw.RequestError, match="record"):
        cw.compensate(COIL, fit=[day_1, day_2])
    both = cw.Compensator(COIL, fit=[day_1, day_2], method="regression")
    assert both(day_2).rate_compensated_deg_per_h is not None
