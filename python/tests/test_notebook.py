"""The script and the notebook are one text; both run, and the pictures show something."""

from __future__ import annotations

import base64
import importlib
import io
import runpy
import sys
from typing import Any

import pytest

from conftest import ROOT

EXAMPLES = ROOT / "python" / "examples"


def test_the_script_runs_and_holds_what_it_claims(monkeypatch: pytest.MonkeyPatch) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    pytest.importorskip("pandas")
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    drawn = []
    monkeypatch.setattr(plt, "show", lambda: (drawn.extend(plt.get_fignums()), plt.close("all")))
    names = runpy.run_path(str(EXAMPLES / "coil_to_recommendation.py"))
    assert len(drawn) >= 8
    assert names["proof"].proof.status == "optimal" and names["diagnosis"].verdict != "adequate"
    assert names["found"].best.worst_rate_deg_per_h < 0.9 * min(
        p.worst_rate_deg_per_h for p in names["classics"].patterns if p.name == "qua"
    )


def maker() -> Any:
    """The program that makes the notebook."""
    sys.path.insert(0, str(EXAMPLES))
    try:
        return importlib.import_module("make_notebook")
    finally:
        sys.path.remove(str(EXAMPLES))


def pictures_of(notebook: Any) -> list[str]:
    """The pictures that its cells show."""
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert not any(output.output_type == "error" for output in outputs)
    return [output["data"]["image/png"] for output in outputs if "image/png" in output.get("data", {})]


def test_the_kept_notebook_is_the_script_s() -> None:
    nbformat = pytest.importorskip("nbformat")
    kept = nbformat.read(EXAMPLES / "coil_to_recommendation.ipynb", as_version=4)
    made = maker().notebook()
    assert [c.source for c in kept.cells] == [c.source for c in made.cells], "run python/examples/make_notebook.py"
    # It may be kept without output; what it shows is no error.
    for picture in pictures_of(kept):
        check_picture(base64.b64decode(picture))


def check_picture(png: bytes) -> None:
    matplotlib_image = pytest.importorskip("matplotlib.image")
    pixels = matplotlib_image.imread(io.BytesIO(png))[..., :3]
    assert pixels.shape[0] > 150 and pixels.shape[1] > 200
    # Neither blank nor all ink.
    ink = float((pixels.min(axis=-1) < 0.9).mean())
    assert 0.005 < ink < 0.9, ink


def test_the_notebook_runs_afresh_and_its_pictures_show_something() -> None:
    pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    program = maker()
    made = program.executed(program.notebook(), ROOT)
    pictures = pictures_of(made)
    assert len(pictures) >= 8
    for picture in pictures:
        check_picture(base64.b64decode(picture))
    outputs = [output for cell in made.cells for output in cell.get("outputs", [])]
    assert any("text/html" in output.get("data", {}) for output in outputs)
