"""Winding patterns: which piece of fibre lies in which layer."""

from __future__ import annotations

import html
import json
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, overload

import numpy as np
import numpy.typing as npt

from . import _coilwright
from ._results import Windability


@dataclass(frozen=True)
class WindingStep:
    """The state after one layer has been wound."""

    layer: int
    """Counted from 1, innermost first."""
    segment: int
    """The piece of fibre that was wound, counted from 1 at end A."""
    reels: int
    """Runs of fibre still unwound; each hangs on a reel."""
    captive: int
    """Those of them whose two ends are both on the coil."""
    climb: int
    """Largest climb of the crossovers that this step completes; 0 if it completes none."""
    joined_low: int | None
    """How many layers away the wound layer is that the segment's low end is joined to."""
    joined_high: int | None
    """The same of its high end."""


@dataclass(frozen=True)
class WindingGraph:
    """The fibre's continuity drawn over the layers."""

    steps: tuple[WindingStep, ...]
    captive_run: str | None
    """The first run of fibre that is captive, in words."""
    crossovers: tuple[tuple[int, int], ...]
    """The layers, counted from 1, that segment k and segment k + 1 lie in."""


class Pattern(Sequence[int]):
    """Which segment of the fibre lies in which layer: P(1) … P(N), innermost layer first, counted from 1.

    A pattern is always a permutation of 1 … N for an even N, and never changes. ``end_turns`` are whole turns more (or, below zero,
    fewer) than whole layers at end A and at end B of the fibre; those above zero lie on the outermost layer, where the other end
    leaves room for them.

    >>> import coilwright as cw
    >>> p = cw.Pattern([2, 3, 4, 1])
    >>> len(p), p[0], list(p.reversed())
    (4, 2, [3, 2, 1, 4])
    >>> p.windability().reels
    2
    """

    __slots__ = ("_end_turns", "_segments", "name")

    name: str
    """The name under which results show it."""

    def __init__(
        self, segments: Iterable[int], *, name: str | None = None, end_turns: tuple[int, int] = (0, 0)
    ) -> None:
        whole = np.asarray(segments if isinstance(segments, np.ndarray) else list(segments))
        if whole.ndim != 1 or not (np.issubdtype(whole.dtype, np.integer) or not whole.size):
            from ._errors import RequestError

            raise RequestError(f"segments: expected a row of whole numbers, found an array of {whole.dtype}, {whole.shape}")
        if whole.size and whole.min() < 0:
            from ._errors import RequestError

            raise RequestError(f"segments: expected numbers from 1, found {whole.min()}")
        array = whole.astype(np.int64)
        ends = (int(end_turns[0]), int(end_turns[1]))
        _coilwright.check_pattern(array.tolist(), ends)
        array.flags.writeable = False
        object.__setattr__(self, "_segments", array)
        object.__setattr__(self, "_end_turns", ends)
        object.__setattr__(self, "name", name if name is not None else f"pattern-{array.size}")

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError("a pattern never changes")

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Pattern:
        """Reads a pattern file.

        Raises:
            FileError: all faults of the file at once.
        """
        name, segments, end_turns = _coilwright.read_pattern(os.fspath(path))
        return cls(segments, name=name, end_turns=end_turns)

    def write(self, path: str | os.PathLike[str], *, comments: Sequence[str] = ()) -> None:
        """Writes a pattern file, whole or not at all; comments stand at its head."""
        _coilwright.print_pattern(
            os.fspath(path), self.name, self.segments.tolist(), self.end_turns, list(comments)
        )

    @property
    def segments(self) -> npt.NDArray[np.int64]:
        """P(j), innermost layer first: a read-only array, the same one each time."""
        array: npt.NDArray[np.int64] = object.__getattribute__(self, "_segments")
        return array

    @property
    def end_turns(self) -> tuple[int, int]:
        """Turns more or fewer than whole layers at end A and at end B."""
        ends: tuple[int, int] = object.__getattribute__(self, "_end_turns")
        return ends

    @property
    def layers(self) -> int:
        """N."""
        return int(self.segments.size)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> npt.NDArray[Any]:
        array = self.segments
        if dtype is not None and np.dtype(dtype) != array.dtype:
            return array.astype(dtype)
        return array.copy() if copy else array

    def layers_by_segment(self) -> npt.NDArray[np.int64]:
        """The layer, counted from 1, of each segment: the inverse permutation."""
        return np.argsort(self.segments) + 1

    def reversed(self) -> Pattern:
        """The fibre counted from its other end: N + 1 − P(j)."""
        return Pattern(self.layers + 1 - self.segments, name=self.name, end_turns=self.end_turns[::-1])

    def windability(self) -> Windability:
        """What it asks of the winding shop: class, reels, captive runs, largest climb."""
        return Windability(json.loads(_coilwright.windability(self.segments.tolist(), self.end_turns)))

    def winding_graph(self) -> WindingGraph:
        """The winding step by step, and the crossovers."""
        steps, captive_run = _coilwright.winding_graph(self.segments.tolist(), self.end_turns)
        layers = self.layers_by_segment().tolist()
        wound = [(i + 1, int(s)) for i, s in enumerate(self.segments)]
        # What is added at an end is wound last, on the outermost layer.
        if self.end_turns[0] > 0:
            wound.append((self.layers, 1))
            layers.insert(0, self.layers)
        if self.end_turns[1] > 0:
            wound.append((self.layers, self.layers))
            layers.append(self.layers)
        return WindingGraph(
            tuple(WindingStep(layer, segment, *step) for (layer, segment), step in zip(wound, steps)),
            captive_run,
            tuple(zip(layers, layers[1:])),
        )

    def __len__(self) -> int:
        return self.layers

    def __iter__(self) -> Iterator[int]:
        return iter(self.segments.tolist())

    @overload
    def __getitem__(self, index: int) -> int: ...
    @overload
    def __getitem__(self, index: slice) -> list[int]: ...
    def __getitem__(self, index: int | slice) -> int | list[int]:
        found = self.segments[index]
        return found.tolist() if isinstance(index, slice) else int(found)

    def __eq__(self, other: object) -> bool:
        """Patterns are equal if their segments and ends are, whatever they are called."""
        return (
            isinstance(other, Pattern)
            and np.array_equal(self.segments, other.segments)
            and self.end_turns == other.end_turns
        )

    def __hash__(self) -> int:
        return hash((self.segments.tobytes(), self.end_turns))

    def __reduce__(self) -> tuple[Any, ...]:
        return (_restored, (self.segments.tolist(), self.name, self.end_turns))

    def __repr__(self) -> str:
        ends = "" if self.end_turns == (0, 0) else f", end_turns={self.end_turns}"
        return f"Pattern({self.segments.tolist()}, name={self.name!r}{ends})"

    def _repr_html_(self) -> str:
        found = self.windability()
        cells = "".join(
            f'<td style="background:{"#cfe3f7" if 2 * s <= self.layers else "#f7dccf"}">{s}</td>' for s in self
        )
        return (
            f"<div><strong>{html.escape(self.name)}</strong>, class {html.escape(str(found['class']))}, "
            f"{found.reels} reels, climbs {found.max_climb}<table><tr><th>innermost layer first</th>{cells}</tr></table></div>"
        )


def _restored(segments: list[int], name: str, end_turns: tuple[int, int] = (0, 0)) -> Pattern:
    return Pattern(segments, name=name, end_turns=end_turns)


def classic(name: str, layers: int) -> Pattern:
    """A classic winding: zyl, sym, sym-text, dip, qua, oct or hex.

    >>> import coilwright as cw
    >>> list(cw.classic("qua", 4))
    [2, 3, 4, 1]

    Raises:
        RequestError: a name that is none, or a layer count that the winding has not; it says which are near.
    """
    return Pattern(_coilwright.classic(name, layers), name=name)


def classics(layers: int) -> dict[str, Pattern]:
    """All classic windings of a layer count, by name.

    >>> import coilwright as cw
    >>> sorted(cw.classics(8))
    ['dip', 'oct', 'qua', 'sym', 'sym-text', 'zyl']
    """
    found = json.loads(_coilwright.classics(layers))["patterns"]
    return {one["name"]: Pattern(one["segments"], name=one["name"]) for one in found}
