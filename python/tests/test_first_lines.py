"""Twenty lines that a new user tries, from the book's page alone: they are taken from it and must work the first time."""

from __future__ import annotations

import contextlib
import io
import re
from pathlib import Path
from typing import Any

import pytest

from conftest import ROOT

PAGE = ROOT / "docs" / "src" / "python.md"


def blocks() -> list[str]:
    """The page's Python blocks, in order."""
    return re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)


def test_the_lines_of_the_page_work_one_after_the_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("pandas")
    pytest.importorskip("matplotlib").use("Agg")
    (tmp_path / "examples" / "campaigns").mkdir(parents=True)
    for name in ("paper-200m.toml", "chamber-coil.toml", "chamber-day-1.csv", "chamber-day-2.csv", "campaigns/layers.toml"):
        (tmp_path / "examples" / name).write_bytes((ROOT / "examples" / name).read_bytes())
    monkeypatch.chdir(tmp_path)
    space: dict[str, Any] = {}
    lines = 0
    for number, block in enumerate(blocks()):
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            exec(compile(block, f"python.md, block {number + 1}", "exec"), space)
        lines += sum(1 for line in block.splitlines() if line.strip() and not line.strip().startswith("#"))
        # What the page says a line prints is what it prints.
        claimed = re.findall(r"^print\(.*?\)\s+# (.+)$", block, flags=re.MULTILINE)
        printed = said.getvalue().splitlines()
        for claim in claimed:
            assert claim in printed, (number + 1, claim, printed)
    assert lines >= 20 and len(blocks()) >= 6
