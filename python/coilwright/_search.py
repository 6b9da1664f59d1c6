"""Searches for a cost of one's own: an array of sensitivities, a temperature field, any function of the pattern."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _coilwright, _progress
from ._errors import RequestError
from ._field import Field
from ._functions import ModelLike, model_of, result_of
from ._model import PatternLike
from ._pattern import Pattern
from ._progress import Progress
from ._results import SearchResult

Array = npt.NDArray[np.float64]


def _options(
    seed: int | None,
    windability: str | None,
    objective: str | None,
    budget_s: float | None,
    rounds: int | None,
    moves: int | None,
    patience: int | None,
    target: float | None,
    restarts: int | None,
    moves_per_restart: int | None,
) -> dict[str, Any]:
    return dict(locals())


def _init(init: PatternLike | None, layers: int) -> list[int] | None:
    if init is None:
        return None
    if isinstance(init, str):
        return _coilwright.classic(init, layers)
    pattern = init if isinstance(init, Pattern) else Pattern.read(init) if isinstance(init, os.PathLike) else Pattern(init)
    return list(pattern)


def search_matrix(
    sensitivities: npt.ArrayLike,
    *,
    seed: int = 1,
    windability: str = "standard",
    constant: npt.ArrayLike | None = None,
    objective: str = "worst-rate",
    budget_s: float | None = None,
    rounds: int | None = None,
    moves: int | None = None,
    patience: int | None = None,
    target: float | None = None,
    restarts: int | None = None,
    moves_per_restart: int | None = None,
    init: PatternLike | None = None,
    progress: bool | Progress | None = None,
) -> SearchResult:
    """The pattern that makes an error small whose sensitivities are given.

    The error of pattern P at sample s is ``constant[s] + Σ_j sensitivities[s, j] (2 P(j) − 1 − N)``: linear in where along the
    fibre the segment lies that is wound in layer j, counted from its middle. The cost is the largest size over the samples
    ("worst-rate") or the root of their mean square ("rms"), in the unit of the array.

    Args:
        sensitivities: samples × layers, innermost layer first. An array of float64 whose rows lie one behind the other is read
            where it is, without a copy.
        constant: one number a sample; without it, zero.
        windability: "standard", "captive:K" or "any".
        target: a cost that is good enough.

    Raises:
        RequestError: an odd number of layers, numbers that are not finite, a class that is none.

    >>> import coilwright as cw, numpy as np
    >>> found = cw.search_matrix(np.array([[1.0, -2.0, 0.5, 1.5]]), windability="any")
    >>> p = np.array(found.pattern)
    >>> bool(np.isclose(abs((np.array([1.0, -2.0, 0.5, 1.5]) * (2 * p - 1 - 4)).sum()), found.best.cost))
    True
    """
    array = np.asarray(sensitivities)
    if array.ndim != 2:
        raise RequestError(f"sensitivities: expected samples × layers, found an array of shape {array.shape}")
    if not np.issubdtype(array.dtype, np.number) or np.issubdtype(array.dtype, np.complexfloating):
        raise RequestError(f"sensitivities: expected real numbers, found {array.dtype}")
    array = np.ascontiguousarray(array, dtype=np.float64)
    shift = None if constant is None else np.ascontiguousarray(constant, dtype=np.float64)
    if shift is not None and shift.ndim != 1:
        raise RequestError(f"constant: expected one number a sample, found an array of shape {shift.shape}")
    options = _options(
        seed, windability, objective, budget_s, rounds, moves, patience, target, restarts, moves_per_restart
    )
    with _progress.shown(progress, "search") as at:
        answered, _read_at = _coilwright.search_matrix(array, options, shift, _init(init, array.shape[1]), at)
    return result_of(SearchResult, answered)


def search_function(
    cost: Callable[[npt.NDArray[np.int64]], float],
    layers: int,
    *,
    seed: int = 1,
    windability: str = "standard",
    budget_s: float | None = None,
    rounds: int | None = None,
    moves: int | None = None,
    patience: int | None = None,
    target: float | None = None,
    restarts: int | None = None,
    moves_per_restart: int | None = None,
    init: PatternLike | None = None,
    progress: bool | Progress | None = None,
) -> SearchResult:
    """The pattern that makes a function of one's own small.

    Args:
        cost: takes P(1) … P(N) as an array, innermost layer first, and gives a finite number; the same for the same pattern. It
            is called from several threads, one at a time where the interpreter has its lock.
        layers: N, which is even.

    Raises:
        RequestError: a number of layers that no winding has, a cost that is no finite number.
        Exception: whatever the function raises ends the search and comes out as it is.

    >>> import coilwright as cw, numpy as np
    >>> found = cw.search_function(lambda p: float(np.abs(np.diff(p)).sum()), 6, windability="any")
    >>> found.best.cost
    5.0
    """
    if not callable(cost):
        raise RequestError(f"cost: expected a function of the pattern, found {type(cost).__name__}")
    options = _options(seed, windability, None, budget_s, rounds, moves, patience, target, restarts, moves_per_restart)
    with _progress.shown(progress, "search") as at:
        answered = _coilwright.search_function(cost, layers, options, _init(init, layers), at)
    return result_of(SearchResult, answered)


def search_field(
    model: ModelLike,
    field: Field,
    *,
    seed: int | None = None,
    windability: str | None = None,
    objective: str = "worst-rate",
    budget_s: float | None = None,
    rounds: int | None = None,
    moves: int | None = None,
    patience: int | None = None,
    target_deg_per_h: float | None = None,
    restarts: int | None = None,
    moves_per_restart: int | None = None,
    init: PatternLike | None = None,
    progress: bool | Progress | None = None,
) -> SearchResult:
    """The pattern with the smallest rate error of a coil under a temperature field of one's own; costs are in °/h.

    Args:
        field: of as many layers as the coil; every one of its times is a sample.
        windability, seed: without them, the model's own.
    """
    asked = model_of(model)
    options = _options(
        seed, windability, objective, budget_s, rounds, moves, patience, target_deg_per_h, restarts, moves_per_restart
    )
    with _progress.shown(progress, "search") as at:
        answered = _coilwright.search_field(asked._handle, field._handle, options, _init(init, asked.layers), at)
    return result_of(SearchResult, answered)


def sensitivities(model: ModelLike, field: Field) -> tuple[Array, Array]:
    """Sensitivities (samples × layers) and constants, in °/h, of a coil's rate error under a field: what :func:`search_matrix` takes.

    Raises:
        RequestError: an error that is not linear in the segments: layers of unequal length, halves that respond differently,
            axial gradients. :func:`search_field` searches those too.
    """
    found = _coilwright.sensitivities(model_of(model)._handle, field._handle)
    if found is None:
        raise RequestError(
            "the rate error is linear in the segments only with layers of equal length and halves that respond alike: "
            "set layer_length to \"equal\", or use search_field"
        )
    return found
