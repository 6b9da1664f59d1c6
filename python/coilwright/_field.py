"""Temperature fields: what the layers do, solved here or computed elsewhere."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _coilwright
from ._errors import RequestError

Array = npt.NDArray[np.float64]


def _grid(name: str, values: npt.ArrayLike, shape: tuple[int, int] | None) -> Array:
    array = np.ascontiguousarray(values, dtype=np.float64)
    if array.ndim != 2 or (shape is not None and array.shape != shape):
        expected = "(times, layers)" if shape is None else str(shape)
        raise RequestError(f"{name}: expected an array of shape {expected}, found {array.shape}")
    return array


class Field:
    """Temperatures and their rates in every layer over time: rows are times, columns layers, innermost first.

    One that was computed elsewhere, by finite elements say, is made of arrays; without rates they are the differences of the
    temperatures (second order, :func:`numpy.gradient`), and without an ambient temperature that of the outermost layer.

    >>> import coilwright as cw, numpy as np
    >>> t = np.linspace(0.0, 600.0, 61)
    >>> layers = 20.0 + np.outer(t / 600, np.linspace(0.8, 1.0, 12))
    >>> field = cw.Field(time_s=t, temperature_c=layers)
    >>> field.shape, round(float(field.rate_c_per_h[0, -1]), 6)
    ((61, 12), 6.0)
    """

    __slots__ = ("_handle",)
    _handle: _coilwright.FieldHandle

    def __init__(
        self,
        *,
        time_s: npt.ArrayLike,
        temperature_c: npt.ArrayLike,
        rate_c_per_h: npt.ArrayLike | None = None,
        ambient_c: npt.ArrayLike | None = None,
        name: str = "field",
    ) -> None:
        times = np.ascontiguousarray(time_s, dtype=np.float64)
        if times.ndim != 1:
            raise RequestError(f"time_s: expected a row of numbers, found shape {times.shape}")
        temperature = _grid("temperature_c", temperature_c, None)
        if temperature.shape[0] != times.size:
            raise RequestError(f"temperature_c: expected {times.size} rows, one a time, found {temperature.shape[0]}")
        if rate_c_per_h is None:
            if times.size < 3:
                raise RequestError("rate_c_per_h: needed where there are fewer than three times")
            rate = np.gradient(temperature, times / 3600.0, axis=0, edge_order=2)
        else:
            rate = _grid("rate_c_per_h", rate_c_per_h, (temperature.shape[0], temperature.shape[1]))
        ambient = np.ascontiguousarray(temperature[:, -1] if ambient_c is None else ambient_c, dtype=np.float64)
        if ambient.shape != times.shape:
            raise RequestError(f"ambient_c: expected {times.size} numbers, found shape {ambient.shape}")
        if ambient_c is None:
            ambient_rate = np.ascontiguousarray(rate[:, -1])
        elif times.size < 3:
            ambient_rate = np.zeros_like(ambient)
        else:
            ambient_rate = np.gradient(ambient, times / 3600.0, edge_order=2)
        rate = np.ascontiguousarray(rate)
        self._handle = _coilwright.field_of(name, times, temperature, rate, ambient, ambient_rate)

    @classmethod
    def _of(cls, handle: _coilwright.FieldHandle) -> Field:
        field = cls.__new__(cls)
        field._handle = handle
        return field

    @property
    def name(self) -> str:
        """The profile's or the record's name, or one's own."""
        return self._handle.name

    @property
    def shape(self) -> tuple[int, int]:
        """Times and layers."""
        return (int(self.time_s.size), self._handle.layers)

    @property
    def time_s(self) -> Array:
        """Times: a view, not a copy."""
        return self._handle.time_s

    @property
    def temperature_k(self) -> Array:
        """Temperatures, times × layers: a view, not a copy."""
        return self._handle.temperature_k

    @property
    def rate_k_per_s(self) -> Array:
        """Rates of the temperatures, times × layers: a view, not a copy."""
        return self._handle.rate_k_per_s

    @property
    def ambient_k(self) -> Array:
        """The air's temperature: a view, not a copy."""
        return self._handle.ambient_k

    @property
    def temperature_c(self) -> Array:
        """Temperatures, times × layers."""
        return self.temperature_k - 273.15

    @property
    def rate_c_per_h(self) -> Array:
        """Rates of the temperatures, times × layers."""
        return self.rate_k_per_s * 3600.0

    @property
    def ambient_c(self) -> Array:
        """The air's temperature."""
        return self.ambient_k - 273.15

    def to_dict(self) -> dict[str, Any]:
        """The document that ``coilwright temperatures --format json`` prints."""
        document: dict[str, Any] = json.loads(self._handle.document())
        return document

    def to_xarray(self) -> Any:
        """As a :class:`xarray.Dataset` over ``time_s`` and ``layer`` (from 1, innermost first)."""
        import xarray

        layers = np.arange(1, self.shape[1] + 1)
        over = ("time_s", "layer")
        return xarray.Dataset(
            {
                "temperature_c": (over, self.temperature_c, {"units": "degC"}),
                "rate_c_per_h": (over, self.rate_c_per_h, {"units": "degC h-1"}),
                "ambient_c": ("time_s", self.ambient_c, {"units": "degC"}),
            },
            coords={"time_s": ("time_s", self.time_s, {"units": "s"}), "layer": layers},
            attrs={"name": self.name},
        )

    @classmethod
    def from_xarray(cls, dataset: Any) -> Field:
        """Of a :class:`xarray.Dataset` as :meth:`to_xarray` makes it; ``rate_c_per_h`` and ``ambient_c`` may be absent."""
        ordered = dataset.transpose("time_s", "layer", missing_dims="ignore")
        further = {key: ordered[key].values for key in ("rate_c_per_h", "ambient_c") if key in ordered}
        return cls(
            time_s=ordered["time_s"].values,
            temperature_c=ordered["temperature_c"].values,
            name=str(dataset.attrs.get("name", "field")),
            **further,
        )

    def to_pandas(self) -> Any:
        """The temperatures as a :class:`pandas.DataFrame`, one column a layer."""
        import pandas

        return pandas.DataFrame(
            self.temperature_c,
            index=pandas.Index(self.time_s, name="time_s"),
            columns=[f"layer_{layer}_c" for layer in range(1, self.shape[1] + 1)],
        )

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Field):
            return NotImplemented
        return all(np.array_equal(a, b) for a, b in zip(self._state()[1:], other._state()[1:]))

    __hash__ = None  # type: ignore[assignment]

    def _state(self) -> tuple[Any, ...]:
        handle = self._handle
        arrays = [
            np.array(values)
            for values in (
                handle.time_s,
                handle.temperature_k,
                handle.rate_k_per_s,
                handle.ambient_k,
                handle.ambient_rate_k_per_s,
                handle.axial_moment_k,
                handle.axial_moment_rate_k_per_s,
            )
        ]
        return (self.name, *arrays)

    def __reduce__(self) -> tuple[Any, ...]:
        return (_restored, self._state())

    def __repr__(self) -> str:
        times, layers = self.shape
        span = f"{self.time_s[0]:g} to {self.time_s[-1]:g} s"
        return f"Field({self.name!r}, {times} times from {span}, {layers} layers)"


def _restored(name: str, *arrays: Array) -> Field:
    time, temperature, rate, ambient, ambient_rate, moment, moment_rate = arrays
    handle = _coilwright.field_of(name, time, temperature, rate, ambient, ambient_rate, moment, moment_rate, True)
    return Field._of(handle)
