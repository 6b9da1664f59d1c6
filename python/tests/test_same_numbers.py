"""Every shared function answers with the command's document, number for number, on the same files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import coilwright as cw
from conftest import answered, run_command

PAPER = "examples/paper-200m.toml"
COIL = "examples/chamber-coil.toml"
DAY_1, DAY_2 = "examples/chamber-day-1.csv", "examples/chamber-day-2.csv"


def without_clock(document: dict[str, Any]) -> dict[str, Any]:
    """Without what the clock says."""
    clocked = {"seconds", "evaluations_per_s"}
    return {
        key: without_clock(value) if isinstance(value, dict) else value
        for key, value in document.items()
        if key not in clocked
    }


def test_evaluate() -> None:
    assert cw.evaluate(PAPER, ["qua", "dip"]).to_dict() == answered("evaluate", PAPER, "--pattern", "qua", "--pattern", "dip")
    assert cw.evaluate(PAPER).to_dict() == answered("evaluate", PAPER)


def test_optimise() -> None:
    ours = cw.optimise(PAPER, seed=3, rounds=2, moves_per_restart=1000).to_dict()
    theirs = answered("optimise", PAPER, "--seed", 3, "--rounds", 2, "--moves-per-restart", 1000)
    assert without_clock(ours) == without_clock(theirs)


def test_optimise_leaves_the_folder_that_the_command_leaves(tmp_path: Path) -> None:
    cw.optimise(PAPER, rounds=1, moves_per_restart=500, output=tmp_path / "ours")
    done = run_command("optimise", PAPER, "--rounds", 1, "--moves-per-restart", 500, "-o", tmp_path / "theirs")
    assert done.returncode == 0, done.stderr
    names = {p.name for p in (tmp_path / "theirs").iterdir()}
    assert {p.name for p in (tmp_path / "ours").iterdir()} == names
    for name in names - {"report.html"}:
        assert (tmp_path / "ours" / name).read_bytes() == (tmp_path / "theirs" / name).read_bytes(), name


def test_exact() -> None:
    ours, theirs = cw.exact(PAPER).to_dict(), answered("exact", PAPER)
    assert without_clock(ours) == without_clock(theirs)
    assert ours["proof"]["status"] == "optimal"


def test_pareto(tmp_path: Path, small: cw.Model) -> None:
    small.write(tmp_path / "small.toml")
    ours = cw.pareto(tmp_path / "small.toml", rounds=1, most_captive=0).to_dict()
    assert ours == answered("pareto", tmp_path / "small.toml", "--rounds", 1, "--most-captive", 0)


def test_tolerance(tmp_path: Path, small: cw.Model) -> None:
    small.write(tmp_path / "small.toml")
    ours = cw.tolerance(tmp_path / "small.toml", ["dip"], seed=5, limit_deg_per_h=0.5).to_dict()
    theirs = answered("tolerance", tmp_path / "small.toml", "--pattern", "dip", "--seed", 5, "--limit", 0.5)
    assert ours == theirs


def test_schedule_and_verify(tmp_path: Path) -> None:
    ours = cw.schedule(PAPER, "qua", output=tmp_path)
    assert ours.to_dict() == answered("schedule", PAPER, "--pattern", "qua")
    path = tmp_path / "schedule.json"
    verified = cw.verify(PAPER, path)
    assert verified and verified.to_dict() == answered("verify", PAPER, path)
    assert cw.verify(PAPER, ours).violations == []
    # What is wrong is found, by both in the same words.
    path.write_text(path.read_text(encoding="utf-8").replace('"turns"', '"turnz"', 1), encoding="utf-8")
    misspelt = cw.verify(PAPER, path)
    assert "turnz" in str(misspelt.violations[0]) and misspelt.to_dict() == answered("verify", PAPER, path, code=1)
    with pytest.raises(cw.FileError) as error:
        cw.verify(PAPER, tmp_path / "nowhere.json")
    assert str(error.value) == run_command("verify", PAPER, tmp_path / "nowhere.json").stderr.strip()
    csv = tmp_path / "schedule.csv"
    lines = csv.read_text(encoding="utf-8").splitlines()
    csv.write_text("\n".join([lines[0], lines[2], lines[1], *lines[3:]]) + "\n", encoding="utf-8")
    wrong = cw.verify(PAPER, csv)
    assert not wrong and wrong.to_dict() == answered("verify", PAPER, csv, code=1)


def test_compare() -> None:
    ours = cw.compare(COIL, [DAY_1, DAY_2])
    assert ours.to_dict() == answered("compare", COIL, DAY_1, DAY_2)
    curve = ours.curves[0]
    rmse = np.sqrt(np.mean(curve.residual_deg_per_h**2))
    assert rmse == pytest.approx(ours.records[0].rmse_deg_per_h, rel=0.2)


def test_diagnose(thinned: list[str]) -> None:
    day_1, day_2 = thinned
    ours = cw.diagnose(COIL, day_1, holdout=day_2)
    assert ours.to_dict() == answered("diagnose", COIL, day_1, "--holdout", day_2)
    assert ours.extended is not None and ours.extended.effects == [e.kind for e in ours.effects]


def test_extend(tmp_path: Path) -> None:
    path = tmp_path / "ours.toml"
    ours = cw.extend(COIL, "finite_pack", fit=DAY_1, holdout=DAY_2, output=path)
    theirs = answered("extend", COIL, "--effect", "finite_pack", "--fit", DAY_1, "--holdout", DAY_2, "-o", tmp_path / "theirs.toml")
    assert {**ours.to_dict(), "written": ""} == {**theirs, "written": ""}
    assert path.read_text(encoding="utf-8") == (tmp_path / "theirs.toml").read_text(encoding="utf-8") == ours.extended.source


def test_what_a_diagnosis_proposes_extends_a_model(tmp_path: Path) -> None:
    fan, days = "examples/fan-coil.toml", [f"examples/fan-day-{day}.csv" for day in (1, 2, 3)]
    found = cw.diagnose(fan, days[0], terms=["lagged_size", "fan_a"])
    assert found.to_dict() == answered("diagnose", fan, days[0], "--terms", "lagged_size,fan_a")
    assert found.proposals and found.proposals[0].terms
    kept = tmp_path / "diagnosis.json"
    kept.write_text(found.to_json(), encoding="utf-8")
    ours = cw.extend(fan, proposal=found, holdout=days[2])
    words = ("extend", fan, "--proposal", kept, "--holdout", days[2], "-o", tmp_path / "theirs.toml")
    assert {**ours.to_dict(), "written": ""} == {**answered(*words), "written": ""}
    assert ours.extended.source == (tmp_path / "theirs.toml").read_text(encoding="utf-8")
    assert cw.extend(fan, proposal=kept, holdout=days[2]) == ours and "custom" in repr(ours)
    for wrong in ({}, {"effect": "spool_mass", "proposal": kept}):
        with pytest.raises(cw.RequestError, match="expected an effect or a proposal"):
            cw.extend(fan, **wrong)  # type: ignore[arg-type]


def test_trim() -> None:
    ours = cw.trim(COIL, DAY_1)
    assert ours.to_dict() == answered("trim", COIL, DAY_1)
    assert ours.end in ("A", "B") and f"cut {ours.cut_m:.4f} m" in repr(ours)


def test_temperatures() -> None:
    assert cw.temperatures(PAPER, profile="paper", rows=11).to_dict() == answered(
        "temperatures", PAPER, "--profile", "paper", "--rows", 11
    )
    assert cw.temperatures(COIL, DAY_2).to_dict() == answered("temperatures", COIL, DAY_2)


def test_compensate(tmp_path: Path) -> None:
    ours = cw.compensate("examples/chamber-coil.toml", DAY_2, fit=DAY_1, method="regression")
    words = ("compensate", COIL, DAY_2, "--fit", DAY_1, "--method", "regression")
    assert ours.csv is not None and ours.csv.decode("utf-8") == run_command(*words).stdout
    assert ours.to_dict() == answered(*words)
    # The same record as arrays: all digits of what is worked out from all rows, and those that the command prints of each.
    held = cw.compensate(COIL, cw.Record.read(DAY_2), fit=cw.Record.read(DAY_1), method="regression")
    assert held.to_dict() == ours.to_dict()
    assert held.rate_compensated_deg_per_h is not None and ours.rate_compensated_deg_per_h is not None
    printed = [line.split(",")[-2] for line in ours.csv.decode("utf-8").splitlines() if line[:1].isdigit()]
    assert [f"{rate:.8f}" for rate in held.rate_compensated_deg_per_h] == printed
    assert held.flags == ours.flags
    written = tmp_path / "out.csv"
    cw.compensate(COIL, DAY_2, fit=DAY_1, method="regression", output=written)
    assert written.read_bytes() == ours.csv


def test_a_stream_gives_the_lines_that_the_command_prints() -> None:
    words = ("compensate", COIL, DAY_2, "--fit", DAY_1, "--method", "regression")
    theirs = [line.split(",") for line in run_command(*words).stdout.splitlines() if not line.startswith("#")][1:]
    stream = cw.Compensator(COIL, fit=DAY_1, method="regression").stream()
    rows = [row for line in theirs for row in stream.push(*map(float, line[:3]))] + stream.finish()
    assert [f"{row.rate_compensated_deg_per_h:.8f}" for row in rows] == [line[-2] for line in theirs]
    assert ["|".join(row.flags) for row in rows] == [line[-1] for line in theirs]


def test_compensate_by_all_methods() -> None:
    ours = cw.compensate(COIL, DAY_2, fit=DAY_1, all_methods=True)
    assert ours.to_dict() == answered("compensate", COIL, DAY_2, "--fit", DAY_1, "--all-methods")
    assert list(ours.curves)[0] == "before" and len(ours.curves) >= 3


def test_metrics() -> None:
    ours = cw.metrics([DAY_1, DAY_2], average_s=100.0)
    assert ours.to_dict() == answered("metrics", DAY_1, DAY_2, "--average", 100)
    held = cw.metrics([cw.Record.read(DAY_1), cw.Record.read(DAY_2)], average_s=100.0)
    assert held.to_dict() == ours.to_dict()


def test_improve(tmp_path: Path, thinned: list[str]) -> None:
    coil = tmp_path / "coil.toml"
    cw.Model.read(COIL).copy(profiles={"count": 2, "segments": 2, "duration_s": 600.0}).write(coil)
    ours = cw.improve(coil, thinned[0], output=tmp_path / "next", seed=2)
    theirs = answered("improve", coil, thinned[0], "-o", tmp_path / "next-2", "--seed", 2)
    text = ours.to_json().replace(str(tmp_path / "next"), "F")
    assert text == cw.Result(theirs).to_json().replace(str(tmp_path / "next-2"), "F")
    for name in ("design.toml", "predicted-record.csv", "search/best.toml", "schedule/schedule.csv"):
        assert (tmp_path / "next" / name).read_bytes() == (tmp_path / "next-2" / name).read_bytes(), name


def test_patterns_effects_and_check(tmp_path: Path) -> None:
    theirs = answered("patterns", "--layers", 12)["patterns"]
    assert {p["name"]: p["segments"] for p in theirs} == {n: list(p) for n, p in cw.classics(12).items()}
    assert [p["windability"] for p in theirs] == [p.windability().to_dict() for p in cw.classics(12).values()]
    assert [e.to_dict() for e in cw.effects()] == answered("effects")["effects"]
    broken = tmp_path / "broken.toml"
    broken.write_text("name = 'x'\nlayers = 7\n", encoding="utf-8")
    theirs = answered("check", broken, code=2)
    assert {"schema_version": 1, **cw.check(broken).to_dict()} == theirs and len(theirs["faults"]) >= 3
