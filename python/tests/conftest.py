"""What the tests share: the repository's examples, and the command line as a subprocess."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import coilwright as cw

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"


def run_command(*words: object, cwd: Path | None = None, **options: Any) -> subprocess.CompletedProcess[str]:
    """The command as the wheel installs it."""
    return subprocess.run(
        [sys.executable, "-m", "coilwright", *map(str, words)],
        capture_output=True,
        text=True,
        encoding="utf-8",
        cwd=cwd or ROOT,
        timeout=900,
        **options,
    )


def answered(*words: object, code: int = 0, cwd: Path | None = None) -> dict[str, Any]:
    """The command's document."""
    done = run_command(*words, "--format", "json", cwd=cwd)
    assert done.returncode == code, done.stderr
    document: dict[str, Any] = json.loads(done.stdout)
    return document


@pytest.fixture(autouse=True)
def at_the_root(monkeypatch: pytest.MonkeyPatch) -> None:
    """Paths in documents are as they were stated: both sides state them from the repository's root."""
    monkeypatch.chdir(ROOT)


@pytest.fixture
def paper() -> cw.Model:
    return cw.Model.read("examples/paper-200m.toml")


@pytest.fixture
def chamber() -> cw.Model:
    return cw.Model.read("examples/chamber-coil.toml")


@pytest.fixture
def day_1() -> cw.Record:
    return cw.Record.read("examples/chamber-day-1.csv")


@pytest.fixture
def thinned(tmp_path: Path) -> list[str]:
    """Every third row of the chamber's days: what takes a diagnosis twice stays short."""
    places = []
    for day in (1, 2):
        lines = (EXAMPLES / f"chamber-day-{day}.csv").read_text(encoding="utf-8").splitlines()
        path = tmp_path / f"day-{day}.csv"
        path.write_text("\n".join([*lines[:2], *lines[2::3]]) + "\n", encoding="utf-8")
        places.append(str(path))
    return places


@pytest.fixture
def small() -> cw.Model:
    """A coil that is searched in no time, with spreads."""
    return cw.Model(
        name="small coil",
        refractive_index=1.45,
        thermo_optic_per_k=1e-5,
        wavelength_nm=1550.0,
        outer_diameter_um=165.0,
        layers=8,
        turns_per_layer=40,
        inner_diameter_mm=60.0,
        layer_length="equal",
        pattern="qua",
        thermal_model="pack",
        conductivity_w_per_m_k=0.35,
        volumetric_heat_capacity_j_per_m3_k=1.7e6,
        effects=[{"kind": "surface_film", "film_w_per_m2_k": 15.0}],
        location="ambient",
        profiles={"max_rate_c_per_h": 60.0, "count": 6, "segments": 3, "duration_s": 1200.0, "seed": 1},
        tolerance={"turns_per_layer_sd": 0.3, "samples": 16, "seed": 3},
    )


def pytest_report_header() -> str:
    return f"coilwright {cw.__version__} from {os.path.dirname(cw.__file__)}"
