"""Models: one coil, how it is heated, which physics it includes, what a search runs over."""

from __future__ import annotations

import html
import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _coilwright
from ._errors import RequestError
from ._pattern import Pattern

_TABLES = {
    "fibre": (
        "library",
        "refractive_index",
        "group_index",
        "thermo_optic_per_k",
        "thermal_expansion_per_k",
        "wavelength_nm",
        "outer_diameter_um",
    ),
    "winding": (
        "layers",
        "turns_per_layer",
        "inner_diameter_mm",
        "mean_diameter_mm",
        "radial_pitch_um",
        "axial_pitch_um",
        "layer_length",
        "length_m",
        "crossover_turns",
        "sagnac_diameter",
        "pattern",
    ),
    "thermal": (
        "conductivity_w_per_m_k",
        "volumetric_heat_capacity_j_per_m3_k",
        "diffusivity_m2_per_s",
        "cells_per_layer",
    ),
    "sensor": ("location", "rate_mean_s"),
    "search": ("windability",),
}
"""Keys that stand in one table only, so that they need not be nested."""

_NESTED = (
    "fibre",
    "winding",
    "thermal",
    "sensor",
    "profiles",
    "search",
    "tolerance",
    "production",
    "record",
    "materials",
)


def _plain(value: Any) -> Any:
    """Plain Python of NumPy's numbers and arrays, patterns and paths."""
    if isinstance(value, Pattern):
        return _named(value)
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(inner) for inner in value]
    return value


def _named(pattern: Pattern) -> str:
    """A pattern as a model file has it: by name, or as a file."""
    try:
        known = _coilwright.classic(pattern.name, pattern.layers)
    except RequestError:
        known = []
    if known == list(pattern) and pattern.end_turns == (0, 0):
        return pattern.name
    raise RequestError(
        f"pattern: a model names a classic winding or a pattern file, and {pattern.name} is neither: write it, and give the path"
    )


def _tables(keywords: Mapping[str, Any]) -> dict[str, Any]:
    """Keyword arguments as the tables of a model file."""
    tables: dict[str, Any] = {}
    flat = {key: table for table, keys in _TABLES.items() for key in keys}
    for key, value in keywords.items():
        if key in ("effects", "effect"):
            tables["effect"] = _plain(list(value) if value is not None else None)
            continue
        plain = _plain(value)
        if key in flat:
            tables.setdefault(flat[key], {})[key] = plain
        elif isinstance(plain, dict):
            tables.setdefault(key, {}).update(plain)
        elif key == "thermal_model":
            tables.setdefault("thermal", {})["model"] = plain
        else:
            tables[key] = plain
    return tables


class Model:
    """A model: what a model file states, understood.

    Keyword arguments are the keys of a model file. A key that stands in one table only may be given by itself; the others as
    dictionaries: ``fibre``, ``winding``, ``thermal``, ``sensor``, ``profiles``, ``search``, ``tolerance``, ``production``,
    ``record``, ``materials``; ``effects`` is a list of dictionaries, each with its ``kind``; ``thermal_model`` is ``thermal.model``.
    The number's units are in the keys, as in a file.

    >>> import coilwright as cw
    >>> model = cw.Model(
    ...     name="a small coil",
    ...     refractive_index=1.45, thermo_optic_per_k=1e-5, wavelength_nm=1550.0, outer_diameter_um=165.0,
    ...     layers=12, turns_per_layer=60, inner_diameter_mm=80.0, layer_length="actual", pattern="qua",
    ...     thermal_model="pack", conductivity_w_per_m_k=0.35, volumetric_heat_capacity_j_per_m3_k=1.7e6,
    ...     profiles={"max_rate_c_per_h": 60.0, "count": 16, "segments": 3, "duration_s": 1800.0, "seed": 1},
    ... )
    >>> model.layers, round(model.length_m, 1)
    (12, 185.4)
    >>> model.copy(layers=16).layers
    16

    Raises:
        FileError: all faults at once, each with its line and key.
    """

    __slots__ = ("_handle",)
    _handle: _coilwright.ModelHandle

    def __init__(self, **keywords: Any) -> None:
        self._handle = _coilwright.ModelHandle.of_tables(_tables(keywords), "model.toml")

    @classmethod
    def _of(cls, handle: _coilwright.ModelHandle) -> Model:
        model = cls.__new__(cls)
        model._handle = handle
        return model

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Model:
        """Reads a model file.

        Raises:
            FileError: all faults of the file at once, with line, key, what was expected and found, and what to do.
        """
        return cls._of(_coilwright.read_model(os.fspath(path)))

    @classmethod
    def parse(cls, source: str, *, path: str | os.PathLike[str] = "model.toml") -> Model:
        """Of the text of a model file; ``path`` names it in faults and places relative pattern files."""
        return cls._of(_coilwright.ModelHandle.parsed(source, os.fspath(path)))

    @classmethod
    def template(cls, name: str) -> Model:
        """The model that the command ``new`` writes to start from: ``source`` explains every key."""
        return cls.parse(_coilwright.template(name), path=f"{name}.toml")

    def copy(self, **changes: Any) -> Model:
        """The same model with some keys changed, as keyword arguments of :class:`Model`; a key that is None goes.

        Comments and the rest of the file stay as they are.
        """
        return Model._of(self._handle.changed(_tables(changes)))

    def with_profiles(self, path: str | os.PathLike[str]) -> Model:
        """The same model over the profiles of another file, such as a next experiment."""
        return Model._of(self._handle.with_profiles(os.fspath(path)))

    def write(self, path: str | os.PathLike[str]) -> None:
        """Writes the model file, whole or not at all.

        Raises:
            WriteError: a file that cannot be written.
        """
        self._handle.write(os.fspath(path))

    @property
    def source(self) -> str:
        """The text of the model file."""
        return self._handle.source

    @property
    def path(self) -> str:
        """Where it was read, or "model.toml"."""
        return self._handle.path

    @property
    def name(self) -> str:
        """The coil's name."""
        return self._handle.name

    @property
    def layers(self) -> int:
        """Number of layers."""
        return self._handle.layers

    @property
    def length_m(self) -> float:
        """Length of the fibre."""
        return self._handle.length_m

    @property
    def mean_diameter_m(self) -> float:
        """Mean diameter of the pack."""
        return self._handle.mean_diameter_m

    @property
    def layer_lengths_m(self) -> npt.NDArray[np.float64]:
        """Fibre in each layer, innermost first."""
        return self._handle.layer_lengths_m

    @property
    def pattern(self) -> Pattern | None:
        """The declared winding."""
        found = self._handle.pattern
        return None if found is None else Pattern(found[1], name=found[0], end_turns=found[2])

    @property
    def effects(self) -> list[str]:
        """The kinds of the declared effects."""
        return self._handle.effects

    @property
    def profiles(self) -> list[str]:
        """The names of the profiles that a search runs over: the listed ones, then the sampled ones."""
        return self._handle.profiles

    @property
    def advice(self) -> list[str]:
        """What a reader of results should know of it, though it is no fault; odd values among it."""
        return self._handle.advice

    def to_dict(self) -> dict[str, Any]:
        """Every table and key of the file as plain Python."""
        return self._handle.tables()

    def __eq__(self, other: object) -> bool:
        """Models are equal if their texts are."""
        return isinstance(other, Model) and self.source == other.source

    def __hash__(self) -> int:
        return hash(self.source)

    def __reduce__(self) -> tuple[Any, ...]:
        return (_restored, (self.source, self.path))

    def __repr__(self) -> str:
        with_effects = f", effects={self.effects}" if self.effects else ""
        return (
            f"Model({self.name!r}, {self.layers} layers, {self.length_m:.2f} m, "
            f"mean diameter {1e3 * self.mean_diameter_m:.2f} mm{with_effects})"
        )

    def _repr_html_(self) -> str:
        rows = [
            ("layers", str(self.layers)),
            ("fibre", f"{self.length_m:.2f} m"),
            ("mean diameter", f"{1e3 * self.mean_diameter_m:.2f} mm"),
            ("pattern", self.pattern.name if self.pattern else "–"),
            ("effects", ", ".join(self.effects) or "–"),
            ("profiles", str(len(self.profiles))),
        ]
        body = "".join(f"<tr><th>{html.escape(n)}</th><td>{html.escape(v)}</td></tr>" for n, v in rows)
        return f"<div><strong>{html.escape(self.name)}</strong><table>{body}</table></div>"


def _restored(source: str, path: str) -> Model:
    return Model.parse(source, path=path)


PatternLike = Pattern | str | os.PathLike[str] | Sequence[int] | npt.NDArray[np.int64]
"""A pattern, its classic name, the path of a pattern file, or its segments."""


def pattern_argument(stated: PatternLike) -> str | tuple[str, list[int], tuple[int, int]]:
    """As the extension module takes it."""
    if isinstance(stated, str):
        return stated
    if isinstance(stated, os.PathLike):
        return os.fspath(stated)
    pattern = stated if isinstance(stated, Pattern) else Pattern(stated)
    return (pattern.name, pattern.segments.tolist(), pattern.end_turns)


def pattern_arguments(stated: PatternLike | Sequence[Any] | None) -> list[str | tuple[str, list[int], tuple[int, int]]]:
    """One pattern or several."""
    if stated is None:
        return []
    if isinstance(stated, (Pattern, str, os.PathLike)):
        return [pattern_argument(stated)]
    entries: list[Any] = list(stated)
    if entries and all(isinstance(entry, (int, np.integer)) for entry in entries):
        return [pattern_argument(entries)]
    return [pattern_argument(entry) for entry in entries]
