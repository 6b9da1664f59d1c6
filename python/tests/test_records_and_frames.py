"""Records and fields: arrays that look at the library's memory, and tables of other libraries."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest

import coilwright as cw
from coilwright import _coilwright


def synthetic(**channels: Any) -> cw.Record:
    t = np.arange(0.0, 3000.0, 10.0)
    return cw.Record(
        time_s=t,
        temperature_c=20 + 5 * np.sin(t / 800),
        rate_deg_per_h=0.2 * np.cos(t / 800) + 0.01 * np.sin(t),
        name="synthetic",
        **channels,
    )


def test_the_arrays_of_a_record_look_at_its_memory(day_1: cw.Record) -> None:
    first, second = day_1.time_s, day_1.time_s
    assert first.ctypes.data == second.ctypes.data == day_1._handle.address
    assert not first.flags.writeable and not first.flags.owndata and first.dtype == np.float64
    assert np.shares_memory(day_1.temperature_k, day_1.temperature_k)
    # The memory outlives the record.
    values = day_1.rate_rad_per_s
    total = values.sum()
    del day_1
    assert values.sum() == total


def test_the_arrays_of_a_field_look_at_its_memory(paper: cw.Model) -> None:
    field = cw.temperatures(paper, profile="paper", rows=50)
    assert field.temperature_k.ctypes.data == field.temperature_k.ctypes.data
    assert not field.temperature_k.flags.owndata and not field.rate_k_per_s.flags.writeable
    assert field.temperature_k.shape == (50, 12) == field.shape


def test_a_record_holds_what_it_was_made_of(day_1: cw.Record) -> None:
    record = synthetic(supply_v=np.full(300, 5), temperature_ambient_c=np.full(300, 21.0))
    assert record.channel_names == ["supply_v"] and record.channel("supply_v").tolist() == [5.0] * 300
    np.testing.assert_allclose(record.temperature_c, 20 + 5 * np.sin(record.time_s / 800), rtol=0, atol=1e-12)
    assert record.temperature_ambient_c is not None and record.temperature_inner_c is None
    assert record.temperature_c is record.temperature_c
    again = pickle.loads(pickle.dumps(record))
    assert again == record and again.name == "synthetic"
    assert "512 rows" in repr(day_1) or f"{len(day_1)} rows" in repr(day_1)
    assert "<table>" in day_1._repr_html_()
    with pytest.raises(cw.RequestError, match="no column vibration"):
        record.channel("vibration")


def test_records_know_other_columns_and_units(tmp_path: Any) -> None:
    path = tmp_path / "log.csv"
    rows = "\n".join(f"{i};{20 + i / 10:.2f};{i % 3}" for i in range(20)).replace(".", ",")
    path.write_text("Zeit;T1;Omega\n" + rows + "\n", encoding="utf-8")
    by_text = cw.Record.read(path, columns="time=Zeit:min,temperature=T1:degC,rate=Omega:deg_per_s")
    by_dict = cw.Record.read(path, columns={"time": "Zeit:min", "temperature": "T1:degC", "rate": "Omega:deg_per_s"})
    assert by_text == by_dict
    assert by_text.time_s[1] == 60.0 and by_text.rate_deg_per_h[1] == pytest.approx(3600.0)
    halved = cw.Record.read(path, columns=by_columns(), average_rows=2)
    assert len(halved) == 10


def by_columns() -> str:
    return "time=Zeit:min,temperature=T1:degC,rate=Omega:deg_per_s"


def test_wrong_columns_are_refused() -> None:
    t = np.arange(10.0)
    with pytest.raises(cw.RequestError, match="temperature_c has 9 values where time_s has 10"):
        cw.Record(time_s=t, temperature_c=t[:9], rate_deg_per_h=t)
    with pytest.raises(cw.RequestError, match="must increase strictly, row 2"):
        cw.Record(time_s=t[::-1], temperature_c=t, rate_deg_per_h=t)
    with pytest.raises(cw.RequestError, match="no finite number"):
        cw.Record(time_s=t, temperature_c=np.where(t > 5, np.nan, t), rate_deg_per_h=t)
    with pytest.raises(cw.RequestError, match="expected a row of numbers"):
        cw.Record(time_s=t, temperature_c=["x"] * 10, rate_deg_per_h=t)
    with pytest.raises(cw.RequestError, match="lacks rate_deg_per_h"):
        cw.Record.from_frame({"time_s": t, "temperature_c": t})


def test_pandas_there_and_back() -> None:
    pandas = pytest.importorskip("pandas")
    record = synthetic(supply_v=np.linspace(5, 6, 300))
    frame = record.to_pandas()
    assert list(frame.columns) == ["time_s", "temperature_c", "rate_deg_per_h", "supply_v"]
    back = cw.Record.from_frame(frame.assign(note="x"), name="synthetic")
    assert back.channel_names == ["supply_v"]
    np.testing.assert_allclose(back.temperature_k, record.temperature_k, rtol=1e-15)
    ours = cw.metrics(frame)  # tables are taken wherever records are
    assert ours.records[0].rows == 300
    table = cw.evaluate("examples/paper-200m.toml").to_pandas()
    assert isinstance(table, pandas.DataFrame) and "windability.reels" in table.columns


def test_polars_there_and_back() -> None:
    polars = pytest.importorskip("polars")
    record = synthetic()
    frame = record.to_polars()
    assert frame.shape == (300, 3)
    np.testing.assert_allclose(cw.Record.from_frame(frame).rate_rad_per_s, record.rate_rad_per_s, rtol=1e-15)
    # By the Arrow interface alone, both ways.
    by_arrow = polars.DataFrame(record)
    assert by_arrow.equals(frame)
    columns = dict(_coilwright.arrow_columns(frame.__arrow_c_stream__()))
    assert np.array_equal(columns["time_s"], record.time_s)
    result = cw.evaluate("examples/paper-200m.toml").to_polars()
    assert result.height == len(cw.evaluate("examples/paper-200m.toml").patterns)


def test_arrow_takes_what_is_there_and_marks_what_is_missing() -> None:
    pyarrow = pytest.importorskip("pyarrow")
    table = pyarrow.table(
        {"time_s": [0, 1, 2, 3], "x": pyarrow.array([1.5, None, 3.5, 4.5]), "word": ["a", "b", "c", "d"]}
    )
    columns = dict(_coilwright.arrow_columns(table.slice(1, 3).__arrow_c_stream__()))
    assert list(columns) == ["time_s", "x"] and columns["time_s"].tolist() == [1.0, 2.0, 3.0]
    assert np.isnan(columns["x"][0]) and columns["x"][1:].tolist() == [3.5, 4.5]
    record = synthetic()
    taken = pyarrow.table(record)
    assert taken.num_rows == 300 and taken.column("time_s").to_numpy().tolist() == record.time_s.tolist()
    # Without a copy: Arrow's buffer is the record's own memory.
    address = taken.column("time_s").chunk(0).buffers()[1].address
    assert address == record._handle.address
    with pytest.raises(cw.RequestError, match="read already"):
        capsule = record.__arrow_c_stream__()
        pyarrow.RecordBatchReader._import_from_c_capsule(capsule)
        _coilwright.arrow_columns(capsule)


def test_xarray_there_and_back(paper: cw.Model) -> None:
    xarray = pytest.importorskip("xarray")
    field = cw.temperatures(paper, profile="paper", rows=20)
    dataset = field.to_xarray()
    assert isinstance(dataset, xarray.Dataset) and dataset.sizes == {"time_s": 20, "layer": 12}
    back = cw.Field.from_xarray(dataset)
    np.testing.assert_allclose(back.temperature_k, field.temperature_k, rtol=1e-14)
    np.testing.assert_allclose(back.rate_k_per_s, field.rate_k_per_s, rtol=1e-12)


def test_a_field_of_ones_own_gives_the_rates_of_the_same_field_solved_here(small: cw.Model) -> None:
    solved = cw.temperatures(small, rows=400)
    own = cw.Field(
        time_s=solved.time_s,
        temperature_c=solved.temperature_c,
        rate_c_per_h=solved.rate_c_per_h,
        ambient_c=solved.ambient_c,
    )
    ours, theirs = (cw.evaluate(small, ["qua", "dip"], field=f) for f in (own, solved))
    for a, b in zip(ours.rates_deg_per_h, theirs.rates_deg_per_h):  # type: ignore[attr-defined]
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-12)
    # Never above the worst case over all times and profiles.
    worst = cw.evaluate(small, ["qua", "dip"])
    for under_field, over_all in zip(theirs.patterns, worst.patterns):
        assert 0 < under_field.worst_rate_deg_per_h <= over_all.worst_rate_deg_per_h * (1 + 1e-9)
    assert pickle.loads(pickle.dumps(solved)) == solved
    with pytest.raises(cw.RequestError, match="8 layers, found 6"):
        cw.evaluate(small, field=cw.Field(time_s=[0, 1, 2], temperature_c=np.zeros((3, 6))))
    without_rates = cw.Field(time_s=solved.time_s, temperature_c=solved.temperature_c)
    inside = slice(20, -20)
    np.testing.assert_allclose(
        without_rates.rate_c_per_h[inside].max(), solved.rate_c_per_h[inside].max(), rtol=0.05
    )
