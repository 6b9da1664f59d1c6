"""Files that are a user's own: no function writes over what it reads."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

import coilwright as cw
from conftest import ROOT

EXAMPLES = ROOT / "examples"


@pytest.fixture
def folder(tmp_path: Path, small: cw.Model, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Models, records and a pattern under the names of results."""
    small.write(tmp_path / "model.toml")
    for name in ("extended.toml", "schedule.csv", "qua.toml"):
        small.write(tmp_path / name)
    for name in ("day-1.csv", "record-1.csv", "allan-1.svg", "summary.csv"):
        shutil.copy(EXAMPLES / "chamber-day-1.csv", tmp_path / name)
    shutil.copy(EXAMPLES / "chamber-coil.toml", tmp_path / "coil.toml")
    cw.classic("qua", small.layers).write(tmp_path / "best.toml")
    fleet = 'kind = "metrics"\nname = "f"\n[[gyro]]\nname = "1"\nrecords = ["summary.csv"]\n'
    (tmp_path / "fleet.toml").write_text(fleet, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def kept(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir()) if path.is_file()}


CALLS: list[tuple[str, Callable[[], object]]] = [
    ("record-1.csv", lambda: cw.compare("coil.toml", "record-1.csv", output=".")),
    ("record-1.csv", lambda: cw.compare("coil.toml", cw.Record.read("record-1.csv"), output=".")),
    ("extended.toml", lambda: cw.diagnose("extended.toml", "day-1.csv", output=".")),
    ("allan-1.svg", lambda: cw.metrics("allan-1.svg", output=".")),
    ("extended.toml", lambda: cw.improve("extended.toml", "day-1.csv", output=".")),
    ("model.toml", lambda: cw.optimise("model.toml", rounds=1, output=".")),
    ("best.toml", lambda: cw.optimise("qua.toml", rounds=1, init="best.toml", output=".")),
    ("qua.toml", lambda: cw.pareto("qua.toml", rounds=1, most_captive=0, output=".")),
    ("schedule.csv", lambda: cw.schedule("schedule.csv", "qua", output=".")),
    ("summary.csv", lambda: cw.campaign("fleet.toml", output=".")),
    ("coil.toml", lambda: cw.extend("coil.toml", "finite_pack", output="coil.toml")),
    ("day-1.csv", lambda: cw.extend("coil.toml", "finite_pack", fit="day-1.csv", output="./day-1.csv")),
    ("day-1.csv", lambda: cw.compensate("coil.toml", "day-1.csv", fit="record-1.csv", method="regression", output="day-1.csv")),
    ("record-1.csv", lambda: cw.compensate("coil.toml", "day-1.csv", fit="record-1.csv", method="regression", output="record-1.csv")),
    ("model.toml", lambda: cw.explore("model.toml", output="model.toml")),
    ("model.toml", lambda: cw.bang_bang("model.toml", "qua", output="model.toml")),
]


@pytest.mark.parametrize(("named", "call"), CALLS, ids=[f"{i}-{name}" for i, (name, _) in enumerate(CALLS)])
def test_no_result_takes_the_place_of_what_the_call_reads(folder: Path, named: str, call: Callable[[], object]) -> None:
    before = kept(folder)
    with pytest.raises(cw.WriteError, match="is read here") as refused:
        call()
    assert named in str(refused.value)
    assert kept(folder) == before


def test_a_page_does_not_take_the_place_of_what_it_is_made_of(folder: Path) -> None:
    cw.metrics("day-1.csv", output="day")
    before = kept(folder / "day")
    with pytest.raises(cw.WriteError, match="is read here"):
        cw.report("day", output="day/metrics.json")
    assert kept(folder / "day") == before
    assert cw.report("day").bytes > 0
