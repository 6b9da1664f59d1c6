"""A document as a result: its keys as attributes, shown as a table."""

from __future__ import annotations

import copy
import difflib
import html
import json
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar


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
        return [flat(self._data)]

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


def flat(data: Mapping[str, Any], lead: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in data.items():
        if isinstance(value, dict):
            found.update(flat(value, f"{lead}{key}."))
        else:
            found[lead + key] = value
    return found


def _shown(value: Any) -> str:
    if value is None:
        return "–"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        text = " ".join(_shown(entry) for entry in value[:12] if not isinstance(entry, (dict, list)))
        return text + (" …" if len(value) > 12 else "")
    return str(value)
