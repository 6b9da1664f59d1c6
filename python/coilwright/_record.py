"""Records: what was measured, as arrays."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from . import _coilwright
from ._errors import RequestError

if TYPE_CHECKING:
    from ._model import Model

Array = npt.NDArray[np.float64]

_ZERO_C_IN_K = 273.15
_DEG_PER_H = 180.0 / np.pi * 3600.0

_NEEDED = ("time_s", "temperature_c", "rate_deg_per_h")
_OPTIONAL = ("temperature_inner_c", "temperature_ambient_c")


def _column(name: str, values: Any) -> Array:
    array = np.asarray(values)
    if array.ndim != 1 or not (np.issubdtype(array.dtype, np.number) or array.dtype == bool):
        raise RequestError(f"{name}: expected a row of numbers, found an array of {array.dtype}, {array.shape}")
    return np.ascontiguousarray(array, dtype=np.float64)


class Record:
    """One record of a gyro at rest in a temperature chamber: columns of one length, times that increase.

    Arrays in SI units (``time_s``, ``temperature_k``, ``rate_rad_per_s`` and further columns) look at the record's own memory:
    nothing is copied, and they are read-only. Those in °C and °/h are converted once and kept.

    >>> import coilwright as cw, numpy as np
    >>> t = np.arange(0.0, 600.0, 10.0)
    >>> record = cw.Record(time_s=t, temperature_c=20 + t / 60, rate_deg_per_h=0.1 * np.sin(t), supply_v=5 + 0 * t)
    >>> len(record), record.interval_s, record.channel_names
    (60, 10.0, ['supply_v'])

    Raises:
        RequestError: columns of unequal length, times that do not increase, numbers that are not finite.
    """

    __slots__ = ("_handle", "_converted")
    _handle: _coilwright.RecordHandle
    _converted: dict[str, Array]

    def __init__(
        self,
        *,
        time_s: npt.ArrayLike,
        temperature_c: npt.ArrayLike,
        rate_deg_per_h: npt.ArrayLike,
        temperature_inner_c: npt.ArrayLike | None = None,
        temperature_ambient_c: npt.ArrayLike | None = None,
        name: str = "record",
        **channels: npt.ArrayLike,
    ) -> None:
        self._handle = _coilwright.record_of(
            name,
            _column("time_s", time_s),
            _column("temperature_c", temperature_c),
            _column("rate_deg_per_h", rate_deg_per_h),
            None if temperature_inner_c is None else _column("temperature_inner_c", temperature_inner_c),
            None if temperature_ambient_c is None else _column("temperature_ambient_c", temperature_ambient_c),
            [(key, _column(key, values)) for key, values in channels.items()],
        )
        self._converted = {}

    @classmethod
    def _of(cls, handle: _coilwright.RecordHandle) -> Record:
        record = cls.__new__(cls)
        record._handle = handle
        record._converted = {}
        return record

    @classmethod
    def read(
        cls,
        path: str | os.PathLike[str],
        *,
        model: Model | None = None,
        columns: str | Mapping[str, str] | None = None,
        bad_rows: str | None = None,
        average_rows: int | None = None,
    ) -> Record:
        """Reads a record file (CSV).

        Args:
            model: whose ``[record]`` table says how its records are to be read.
            columns: which column is which, ``"time=Zeit:min,temperature=T1"`` or ``{"time": "Zeit:min", "temperature": "T1"}``.
            bad_rows: "refuse" or "skip" rows that lack a number or go back in time.
            average_rows: so many rows become one.

        Raises:
            FileError: all faults of the file at once, with line and column.
        """
        if isinstance(columns, Mapping):
            columns = ",".join(f"{role}={target}" for role, target in columns.items())
        handle = None if model is None else model._handle
        return cls._of(_coilwright.read_record(os.fspath(path), handle, columns, bad_rows, average_rows))

    @classmethod
    def from_frame(cls, frame: Any, *, name: str = "record") -> Record:
        """Of a table whose columns are named as in a record file: a mapping of arrays, a pandas or polars frame, a pyarrow table,
        or whatever speaks the Arrow C stream interface.

        ``time_s``, ``temperature_c`` and ``rate_deg_per_h`` are needed; ``temperature_inner_c`` and ``temperature_ambient_c`` are
        known; every other numeric column is a further channel.
        """
        table = _columns_of(frame)
        missing = [column for column in _NEEDED if column not in table]
        if missing:
            raise RequestError(f"the table lacks {', '.join(missing)}: found {', '.join(map(str, table)) or 'no columns'}")
        known = {column: table.pop(column) for column in (*_NEEDED, *_OPTIONAL) if column in table}
        numeric = {key: values for key, values in table.items() if np.issubdtype(np.asarray(values).dtype, np.number)}
        return cls(name=name, **known, **numeric)

    @property
    def name(self) -> str:
        """Its name: of a file, the file's."""
        return self._handle.name

    @property
    def file(self) -> str:
        """The file it was read from, or its name."""
        return self._handle.file

    @property
    def interval_s(self) -> float:
        """The usual interval between rows: the median."""
        return self._handle.interval_s

    @property
    def time_s(self) -> Array:
        """Times, which increase strictly."""
        return self._handle.time_s

    @property
    def temperature_k(self) -> Array:
        """What the sensor showed."""
        return self._handle.temperature_k

    @property
    def rate_rad_per_s(self) -> Array:
        """What the gyro showed."""
        return self._handle.rate_rad_per_s

    @property
    def temperature_c(self) -> Array:
        """What the sensor showed."""
        return self._once("temperature_c", self.temperature_k, _celsius)

    @property
    def rate_deg_per_h(self) -> Array:
        """What the gyro showed."""
        return self._once("rate_deg_per_h", self.rate_rad_per_s, _deg_per_h)

    @property
    def temperature_inner_c(self) -> Array | None:
        """The bore's temperature, where it was measured."""
        found = self._handle.inner_k
        return None if found is None else self._once("temperature_inner_c", found, _celsius)

    @property
    def temperature_ambient_c(self) -> Array | None:
        """The air's temperature, where it was measured."""
        found = self._handle.ambient_k
        return None if found is None else self._once("temperature_ambient_c", found, _celsius)

    @property
    def channel_names(self) -> list[str]:
        """Further columns."""
        return self._handle.channel_names

    def channel(self, name: str) -> Array:
        """A further column."""
        found = self._handle.channel(name)
        if found is None:
            raise RequestError(f"the record has no column {name}: it has {', '.join(self.channel_names) or 'no further ones'}")
        return found

    @property
    def remarks(self) -> list[str]:
        """What was assumed or looked odd while it was read."""
        return self._handle.remarks

    @property
    def skipped_rows(self) -> int:
        """Rows that were skipped while it was read."""
        return self._handle.skipped_rows

    def gaps(self) -> list[tuple[int, float]]:
        """The rows behind a gap, counted from 0, and its length in seconds."""
        return self._handle.gaps()

    def gross_errors(self) -> list[tuple[int, str]]:
        """Single values that do not belong to their neighbours: row, counted from 0, and column."""
        return self._handle.gross_errors()

    def _once(self, name: str, si: Array, convert: Any) -> Array:
        if name not in self._converted:
            array: Array = convert(si)
            array.flags.writeable = False
            self._converted[name] = array
        return self._converted[name]

    def to_dict(self) -> dict[str, Array]:
        """Its columns under their names in files."""
        columns = {"time_s": self.time_s, "temperature_c": self.temperature_c, "rate_deg_per_h": self.rate_deg_per_h}
        for name in _OPTIONAL:
            if (found := getattr(self, name)) is not None:
                columns[name] = found
        return {**columns, **{name: self.channel(name) for name in self.channel_names}}

    def to_pandas(self) -> Any:
        """As a :class:`pandas.DataFrame`."""
        import pandas

        return pandas.DataFrame(self.to_dict())

    def to_polars(self) -> Any:
        """As a :class:`polars.DataFrame`."""
        import polars

        return polars.DataFrame(self.to_dict())

    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object:
        """The Arrow C stream interface: any library that speaks it takes a record as it is. Nothing is copied."""
        return _coilwright.arrow_stream(list(self.to_dict().items()))

    def __len__(self) -> int:
        return self._handle.rows

    def __eq__(self, other: object) -> bool:
        """Records are equal if all their columns are."""
        if not isinstance(other, Record):
            return NotImplemented
        ours, theirs = self._si(), other._si()
        return list(ours) == list(theirs) and all(
            np.array_equal(ours[key], theirs[key], equal_nan=True) for key in ours
        )

    __hash__ = None  # type: ignore[assignment]

    def _si(self) -> dict[str, Array]:
        columns = {"time_s": self.time_s, "temperature": self.temperature_k, "rate": self.rate_rad_per_s}
        for name, found in (("inner", self._handle.inner_k), ("ambient", self._handle.ambient_k)):
            if found is not None:
                columns[name] = found
        return {**columns, **{f"channel:{name}": self.channel(name) for name in self.channel_names}}

    def __reduce__(self) -> tuple[Any, ...]:
        return (_restored, (self.name, {key: np.array(values) for key, values in self._si().items()}))

    def __repr__(self) -> str:
        low, high = self.temperature_c.min(), self.temperature_c.max()
        further = f", {', '.join(self.channel_names)}" if self.channel_names else ""
        return (
            f"Record({self.name!r}, {len(self)} rows every {self.interval_s:g} s, "
            f"{low:.2f} to {high:.2f} °C, mean {self.rate_deg_per_h.mean():.4g} °/h{further})"
        )

    def _repr_html_(self) -> str:
        import html

        head = "".join(f"<th>{html.escape(name)}</th>" for name in self.to_dict())
        columns = list(self.to_dict().values())
        rows = [*range(min(3, len(self))), *range(max(3, len(self) - 2), len(self))]
        body = "".join("<tr>" + "".join(f"<td>{c[i]:.6g}</td>" for c in columns) + "</tr>" for i in rows)
        return f"<div><strong>{html.escape(repr(self))}</strong><table><tr>{head}</tr>{body}</table></div>"


def _celsius(kelvin: Array) -> Array:
    return kelvin - _ZERO_C_IN_K


def _deg_per_h(rad_per_s: Array) -> Array:
    return rad_per_s * _DEG_PER_H


def _restored(name: str, si: dict[str, Array]) -> Record:
    channels = [(key.removeprefix("channel:"), values) for key, values in si.items() if key.startswith("channel:")]
    handle = _coilwright.record_of(
        name, si["time_s"], si["temperature"], si["rate"], si.get("inner"), si.get("ambient"), channels, True
    )
    return Record._of(handle)


def _columns_of(frame: Any) -> dict[str, Any]:
    """A table's columns as arrays, whatever library it is of."""
    if isinstance(frame, Mapping):
        return dict(frame)
    columns = getattr(frame, "columns", None)
    if columns is not None and hasattr(frame, "__getitem__") and hasattr(frame, "shape"):
        # pandas, polars: their own way to NumPy copies least.
        return {str(name): frame[name].to_numpy() for name in columns}
    if hasattr(frame, "__arrow_c_stream__"):
        return dict(_coilwright.arrow_columns(frame.__arrow_c_stream__()))
    raise RequestError(f"expected a table with named columns, found {type(frame).__name__}")


RecordLike = Record | str | os.PathLike[str]
"""A record, or the path of a record file, which is then read as the model's ``[record]`` says."""


def record_argument(stated: Any) -> Any:
    """As the extension module takes it."""
    if isinstance(stated, Record):
        return stated._handle
    if isinstance(stated, (str, os.PathLike)):
        return os.fspath(stated)
    return Record.from_frame(stated)._handle


def record_arguments(stated: RecordLike | Sequence[RecordLike] | None) -> list[Any]:
    """One record or several."""
    if stated is None:
        return []
    if isinstance(stated, (list, tuple)):
        return [record_argument(one) for one in stated]
    return [record_argument(stated)]
