"""Searches for costs of one's own."""

from __future__ import annotations

import itertools
import json
import threading
import time

import numpy as np
import pytest

import coilwright as cw
from coilwright import _coilwright
from coilwright._search import _options


def cost_of(a: np.ndarray, p: np.ndarray, constant: float | np.ndarray = 0.0) -> float:
    return float(np.abs(a @ (2 * np.asarray(p) - 1 - a.shape[1]) + constant).max())


def test_an_array_is_searched_to_the_best_of_all_patterns() -> None:
    rng = np.random.default_rng(5)
    a, constant = rng.normal(size=(7, 6)), rng.normal(size=7)
    found = cw.search_matrix(a, windability="any", constant=constant, seed=1)
    best = min(cost_of(a, np.array(p), constant) for p in itertools.permutations(range(1, 7)))
    assert found.best.cost == pytest.approx(best, rel=1e-12)
    assert cost_of(a, found.pattern.segments, constant) == pytest.approx(best, rel=1e-12)
    rms = cw.search_matrix(a, windability="any", objective="rms")
    value = np.sqrt(np.mean((a @ (2 * rms.pattern.segments - 7)) ** 2))
    assert rms.best.cost == pytest.approx(value, rel=1e-9)
    assert found.found == cw.search_matrix(a, windability="any", constant=constant, seed=1).found


def test_the_same_seed_finds_the_same_patterns_whatever_the_array_looks_like() -> None:
    rng = np.random.default_rng(1)
    a = rng.normal(size=(64, 12))
    one = cw.search_matrix(a, seed=7, rounds=2)
    for same in (np.asfortranarray(a), a.tolist(), a[::-1][::-1], np.repeat(a, 2, axis=0)[::2]):
        other = cw.search_matrix(same, seed=7, rounds=2)
        assert [f.to_dict() for f in other.found] == [f.to_dict() for f in one.found]
    assert one.windability == "standard" and one.pattern.windability().class_ == "standard"


def test_a_contiguous_array_is_read_where_it_is() -> None:
    a = np.random.default_rng(0).normal(size=(32, 8))
    options = _options(1, "standard", "worst-rate", None, 1, None, None, None, None, 100)
    _, read_at = _coilwright.search_matrix(a, options)
    assert read_at == a.ctypes.data


@pytest.mark.parametrize(
    ("array", "words"),
    [
        (np.zeros((3, 5)), "must be even"),
        (np.zeros((0, 4)), "at least one sample"),
        (np.zeros(4), "samples × layers"),
        (np.array([["a", "b"]]), "real numbers"),
        (np.array([[1.0, np.nan]]), "sample 0, layer 2 is NaN"),
        (np.array([[1.0, 2.0j]]), "real numbers"),
    ],
)
def test_what_is_no_array_of_sensitivities_is_refused(array: np.ndarray, words: str) -> None:
    with pytest.raises(cw.RequestError, match=words):
        cw.search_matrix(array)


def test_wrong_options_are_refused_in_words() -> None:
    a = np.ones((2, 4))
    for options, words in [
        ({"windability": "knotted"}, "standard, captive:K"),
        ({"objective": "p95"}, "worst-rate or rms"),
        ({"restarts": 0}, "1 to 4096"),
        ({"budget_s": -1.0}, "above zero"),
        ({"constant": [1.0]}, "one value a sample, 2, found 1"),
        ({"init": [1, 2, 3, 4, 5, 6]}, "init has 6 layers"),
    ]:
        with pytest.raises(cw.RequestError, match=words):
            cw.search_matrix(a, **options)  # type: ignore[arg-type]


def test_an_array_is_searched_as_in_rust_alone() -> None:
    # How fast, python/benches/speed.py says.
    a = np.random.default_rng(2).normal(size=(512, 24))
    found = cw.search_matrix(a, seed=1, windability="any", rounds=1, patience=1, restarts=4, moves_per_restart=5_000)
    options = _options(1, "any", "worst-rate", None, 1, None, 1, None, 4, 5_000)
    document = json.loads(_coilwright.time_search_matrix(a, options)[1])
    assert document["found"] == [f.to_dict() for f in found.found]
    assert document["evaluations"] == found.evaluations


def test_a_function_is_searched_to_the_best_of_all_patterns_and_meets_the_array() -> None:
    a = np.random.default_rng(3).normal(size=(5, 6))
    found = cw.search_function(lambda p: cost_of(a, p), 6, windability="any", seed=1)
    best = min(cost_of(a, np.array(p)) for p in itertools.permutations(range(1, 7)))
    assert found.best.cost == pytest.approx(best, rel=1e-12)
    again = cw.search_function(lambda p: cost_of(a, p), 6, windability="any", seed=1)
    assert again.found == found.found and again.evaluations == found.evaluations


def test_what_a_function_raises_comes_out_and_numbers_that_are_none_are_refused() -> None:
    def broken(p: np.ndarray) -> float:
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        cw.search_function(broken, 8)
    with pytest.raises(cw.RequestError, match="expected a finite number"):
        cw.search_function(lambda p: float("nan"), 8)
    with pytest.raises(TypeError):
        cw.search_function(lambda p: "x", 8)  # type: ignore[arg-type, return-value]
    with pytest.raises(cw.RequestError, match="must be even"):
        cw.search_function(lambda p: 0.0, 7)


def test_a_field_of_ones_own_is_searched_and_its_sensitivities_give_the_same(small: cw.Model) -> None:
    field = cw.temperatures(small.copy(effects=None, location=None), rows=300)
    coil = small.copy(effects=None, location=None)
    found = cw.search_field(coil, field, windability="any", seed=1)
    a, constant = cw.sensitivities(coil, field)
    assert a.shape == (300, 8)
    of_array = cw.search_matrix(a, constant=constant, windability="any", seed=1)
    assert of_array.best.cost == pytest.approx(found.best.cost, rel=1e-9)
    checked = cw.evaluate(coil, [found.pattern, *cw.classics(8).values()], field=field)
    assert checked.patterns[0].worst_rate_deg_per_h == pytest.approx(found.best.cost, rel=1e-9)
    assert min(p.worst_rate_deg_per_h for p in checked.patterns) == checked.patterns[0].worst_rate_deg_per_h
    uneven = coil.copy(layer_length="actual")
    with pytest.raises(cw.RequestError, match="equal length"):
        cw.sensitivities(uneven, field)
    assert cw.search_field(uneven, field, rounds=1).best.cost > 0


def test_other_threads_run_while_work_is_done() -> None:
    a = np.random.default_rng(4).normal(size=(2048, 24))
    ticks = 0
    done = threading.Event()

    def tick() -> None:
        nonlocal ticks
        while not done.is_set():
            ticks += 1
            time.sleep(0.001)

    thread = threading.Thread(target=tick)
    thread.start()
    start = time.perf_counter()
    cw.search_matrix(a, windability="any", budget_s=1.0, rounds=10_000, patience=10_000)
    seconds = time.perf_counter() - start
    done.set()
    thread.join()
    # Without the lock released there would be a handful.
    assert ticks > 20 * seconds
