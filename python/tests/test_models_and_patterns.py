"""Models: read, made, changed, written. Patterns: made, named, wound."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

import coilwright as cw


def test_a_model_of_keywords_is_the_model_of_the_file_with_the_same_keys(paper: cw.Model, tmp_path: Path) -> None:
    made = cw.Model(**{("effects" if key == "effect" else key): value for key, value in paper.to_dict().items()})
    assert made.to_dict() == paper.to_dict()
    assert cw.evaluate(made).to_dict() == cw.evaluate(paper).to_dict()
    made.write(tmp_path / "made.toml")
    assert cw.Model.read(tmp_path / "made.toml").to_dict() == paper.to_dict()


def test_keys_need_no_table_where_they_stand_in_one_only(small: cw.Model) -> None:
    tables = small.to_dict()
    assert tables["fibre"]["wavelength_nm"] == 1550.0 and tables["winding"]["layers"] == 8
    assert tables["effect"] == [{"kind": "surface_film", "film_w_per_m2_k": 15.0}]
    assert small.effects == ["surface_film"] and small.pattern == cw.classic("qua", 8)
    nested = cw.Model(**{("effects" if key == "effect" else key): value for key, value in tables.items()})
    assert nested.to_dict() == tables


def test_a_copy_changes_what_it_is_told_and_keeps_comments_and_all_else(paper: cw.Model) -> None:
    changed = paper.copy(layers=np.int64(16), thermal={"diffusivity_m2_per_s": np.float64(3e-7)}, pattern="dip")
    assert (changed.layers, paper.layers) == (16, 12)
    assert "# the paper's Eq. (4) leaves it out" in changed.source
    assert changed.pattern == cw.classic("dip", 16)
    expected = paper.to_dict()
    expected["winding"] |= {"layers": 16, "pattern": "dip"}
    expected["thermal"]["diffusivity_m2_per_s"] = 3e-7
    assert changed.to_dict() == expected
    without = changed.copy(pattern=None)
    assert without.pattern is None and "pattern" not in without.to_dict()["winding"]
    assert paper.copy(pattern=cw.classic("dip", 12)).pattern == cw.classic("dip", 12)
    with pytest.raises(cw.RequestError, match="write it, and give the path"):
        paper.copy(pattern=cw.Pattern(list(range(1, 13)), name="mine"))
    with_effect = paper.copy(effects=[{"kind": "strain_mismatch", "mismatch": 0.004}])
    assert with_effect.effects == ["strain_mismatch"] and with_effect.copy(effects=None).effects == []


def test_a_model_shows_itself_and_survives_a_pickle(paper: cw.Model) -> None:
    again = pickle.loads(pickle.dumps(paper))
    assert again == paper and hash(again) == hash(paper) and again.path == paper.path
    assert "paper 200 m" in repr(paper) and "12 layers" in repr(paper) and "<table>" in paper._repr_html_()
    assert paper.layer_lengths_m.sum() == pytest.approx(200.0) and paper.length_m == pytest.approx(200.0)
    assert paper.profiles[0] == "paper" and len(paper.profiles) == 65


def test_patterns_are_arrays_that_never_change() -> None:
    p = cw.Pattern(np.array([1, 4, 3, 2]), name="mine")
    assert isinstance(p.segments, np.ndarray) and p.segments is p.segments
    assert np.asarray(p) is p.segments and np.array(p, dtype=float).dtype == float
    with pytest.raises(ValueError):
        p.segments[0] = 2
    with pytest.raises(AttributeError):
        p.name = "yours"  # type: ignore[misc]
    same = cw.Pattern([1, 4, 3, 2])
    assert p == same and hash(p) == hash(same) and p != [1, 4, 3, 2] and p != cw.classic("qua", 4)
    assert (p[0], p[-1], p[1:3], len(p), 4 in p) == (1, 2, [4, 3], 4, True)
    assert pickle.loads(pickle.dumps(p)).name == "mine"
    assert p.layers_by_segment().tolist() == [1, 4, 3, 2]
    assert eval(repr(p), {"Pattern": cw.Pattern}) == p and "mine" in p._repr_html_()


@pytest.mark.parametrize("wrong", [[1, 2, 3], [1, 1, 2, 2], [0, 1, 2, 3], [1.5, 2.0], [[1, 2]], [], [-1, 2], [1, 10**12]])
def test_what_is_no_pattern_is_refused(wrong: list[int]) -> None:
    with pytest.raises(cw.RequestError):
        cw.Pattern(wrong)


def test_the_winding_graph_tells_how_a_coil_is_wound() -> None:
    for name, pattern in cw.classics(16).items():
        graph, asked = pattern.winding_graph(), pattern.windability()
        assert max(step.reels for step in graph.steps) == asked.reels, name
        assert max(step.captive for step in graph.steps) == asked.captive, name
        climbs = [abs(a - b) for a, b in graph.crossovers]
        assert max(climbs) == asked.max_climb == max(step.climb for step in graph.steps), name
        assert [step.segment for step in graph.steps] == list(pattern)
        assert (graph.captive_run is None) == (asked.captive == 0), name
        assert asked.class_ == asked["class"]


def test_a_pattern_file_is_read_as_it_was_written(tmp_path: Path) -> None:
    pattern = cw.Pattern([2, 1, 4, 3], name="four")
    pattern.write(tmp_path / "p.toml", comments=["by hand"])
    again = cw.Pattern.read(tmp_path / "p.toml")
    assert again == pattern and again.name == "four"
    assert "# by hand" in (tmp_path / "p.toml").read_text(encoding="utf-8")


def test_turns_at_the_ends_are_part_of_a_pattern(tmp_path: Path) -> None:
    shared = cw.Pattern(cw.classic("qua", 8).segments, name="shared", end_turns=(-3, 2))
    assert shared != cw.classic("qua", 8) and shared.reversed().end_turns == (2, -3)
    assert pickle.loads(pickle.dumps(shared)) == shared
    shared.write(tmp_path / "shared.toml")
    assert cw.Pattern.read(tmp_path / "shared.toml") == shared
    steps = shared.winding_graph().steps
    assert len(steps) == 9 and steps[-1].layer == 8 and steps[-1].segment == 8
    with pytest.raises(cw.RequestError, match="outermost layer"):
        cw.Pattern(shared.segments, end_turns=(2, -3))
