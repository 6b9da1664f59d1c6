"""Campaigns, publications, pages, templates and schemas: what the commands of their names leave."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

import coilwright as cw
from conftest import answered, run_command

PAPER = "examples/paper-200m.toml"


def files_of(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file() and p.name[0] != "."}


@pytest.fixture
def grid(tmp_path: Path, small: cw.Model) -> Path:
    small.write(tmp_path / "small.toml")
    path = tmp_path / "grid.toml"
    words = 'name = "grid"\nmodels = ["small.toml"]\nclasses = ["standard", "any"]\nseeds = [1, 2]\nrounds = 1\nmoves_per_restart = 100\n'
    path.write_text(words, encoding="utf-8")
    return path


def test_campaign(tmp_path: Path, grid: Path) -> None:
    listed = cw.campaign(grid)
    assert listed.to_dict() == answered("campaign", grid, "--list") and len(listed.missing) == 4 and not listed
    whole = cw.campaign(grid, tmp_path / "ours")
    assert whole.to_dict() == answered("campaign", grid, "-o", tmp_path / "theirs")
    assert files_of(tmp_path / "ours") == files_of(tmp_path / "theirs") and whole and whole.searched == 4
    # In parts: a cell, a share, the table too early, the rest.
    parts = tmp_path / "parts"
    one = cw.campaign(grid, parts, cells=listed.cells[2].id)
    assert [cell.id for cell in one.cells] == [listed.cells[2].id] and one.searched == 1 and one
    early = cw.campaign(grid, parts, merge=True)
    assert len(early.missing) == 3 and early.searched == 0 and any("missing" in note for note in early.notes)
    for index in (1, 2):
        assert cw.campaign(grid, parts, shard=(index, 2))
    assert sum(cell.done for cell in cw.campaign_cells(grid, parts).cells) == 4
    assert cw.campaign(grid, parts, merge=True) and files_of(parts) == files_of(tmp_path / "ours")
    assert [row["windability"] for row in whole._rows()] == [cell.class_ for cell in listed.cells]
    with pytest.raises(cw.RequestError, match="no cell of this campaign"):
        cw.campaign(grid, parts, cells=["0123"])
    with pytest.raises(cw.RequestError, match="1 ≤ i ≤ n"):
        cw.campaign(grid, parts, shard=(3, 2))


def test_a_workflow_calls_the_command_that_is_installed(tmp_path: Path, grid: Path) -> None:
    for engine in ("snakemake", "slurm"):
        ours = cw.campaign_workflow(grid, engine, tmp_path / "flow", job_time_s=1.0)
        emitted = files_of(tmp_path / "flow")
        words = ("campaign", grid, "--emit", engine, "-o", tmp_path / "flow", "--job-time", "1s")
        assert ours.to_dict() == answered(*words) and ours.parts >= 1
        assert files_of(tmp_path / "flow") == emitted
    program = json.loads((tmp_path / "flow" / "config.json").read_text(encoding="utf-8"))["program"]
    assert os.access(program, os.X_OK) and Path(program).stem == "coilwright"
    with pytest.raises(cw.RequestError, match="snakemake or slurm"):
        cw.campaign_workflow(grid, "make", tmp_path / "flow")


def test_reproduce(tmp_path: Path) -> None:
    for publication in ("yan1998", "thesis2021"):
        ours = cw.reproduce(publication, output=tmp_path / "folder")
        kept = files_of(tmp_path / "folder")
        assert ours.to_dict() == answered("reproduce", publication, "-o", tmp_path / "folder")
        assert kept and files_of(tmp_path / "folder") == kept
    assert cw.reproduce("yan1998").files == []
    with pytest.raises(cw.RequestError, match="yan1998 or thesis2021"):
        cw.reproduce("yan1999")


def test_report_and_explore(tmp_path: Path, small: cw.Model) -> None:
    cw.metrics("examples/chamber-day-2.csv", output=tmp_path / "day")
    ours = cw.report(tmp_path / "day", output=tmp_path / "ours.html")
    theirs = answered("report", tmp_path / "day", "-o", tmp_path / "theirs.html")
    assert (tmp_path / "ours.html").read_bytes() == (tmp_path / "theirs.html").read_bytes()
    assert ours.bytes == theirs["bytes"] and ours.path == str(tmp_path / "ours.html")
    small.write(tmp_path / "small.toml")
    page = cw.explore(tmp_path / "small.toml", ["dip"], output=tmp_path / "ours.html")
    answered("explore", tmp_path / "small.toml", "dip", "-o", tmp_path / "theirs.html")
    assert (tmp_path / "ours.html").read_bytes() == (tmp_path / "theirs.html").read_bytes()
    assert page.bytes == len((tmp_path / "ours.html").read_bytes())
    with pytest.raises(cw.CoilwrightError):
        cw.report(tmp_path / "nowhere")


def test_bang_bang(tmp_path: Path) -> None:
    ours = cw.bang_bang(PAPER, ["qua", "dip"], output=tmp_path / "ours.toml")
    done = run_command("evaluate", PAPER, "--pattern", "qua", "--pattern", "dip", "--bang-bang", tmp_path / "theirs.toml")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "ours.toml").read_bytes() == (tmp_path / "theirs.toml").read_bytes()
    # What is listed attains what is guaranteed.
    found = cw.evaluate(ours, "dip").patterns[0]
    assert found.worst_profile == "bang-bang-dip"
    assert found.guaranteed_worst_rate_deg_per_h is not None
    assert found.worst_rate_deg_per_h == pytest.approx(found.guaranteed_worst_rate_deg_per_h, rel=1e-3)


def test_templates_and_schemas(tmp_path: Path) -> None:
    run_command("new", tmp_path / "my-coil")
    assert cw.Model.template("my-coil").source == (tmp_path / "my-coil.toml").read_text(encoding="utf-8")
    for kind in ("model", "campaign", "compensation"):
        assert cw.schema(kind) == answered("schema", kind)["schema"]
    with pytest.raises(cw.RequestError, match="found \"coil\""):
        cw.schema("coil")
