"""What one expects of a Python package: errors, interruption, progress, shown and pickled results, pictures, types, doctests."""

from __future__ import annotations

import copy
import doctest
import importlib
import os
import pickle
import signal
import subprocess
import sys
import textwrap
import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import coilwright as cw
from conftest import ROOT, run_command

PAPER = "examples/paper-200m.toml"


def test_faults_of_a_file_come_all_at_once_with_the_words_of_the_command(tmp_path: Path) -> None:
    broken = tmp_path / "broken.toml"
    text = (ROOT / PAPER).read_text(encoding="utf-8")
    broken.write_text(text.replace("layers = 12", "layers = 13").replace("[sensor]", "[sensor]\ncolour = 1"), encoding="utf-8")
    with pytest.raises(cw.FileError) as error:
        cw.Model.read(broken)
    assert str(error.value) == run_command("evaluate", broken).stderr.strip()
    assert error.value.file == str(broken) and len(error.value.faults) >= 2
    lines = {fault.line for fault in error.value.faults}
    stated = broken.read_text(encoding="utf-8").splitlines()
    assert any("layers = 13" in stated[line - 1] for line in lines if line) and "colour" in str(error.value)
    again = pickle.loads(pickle.dumps(error.value))
    assert again.faults == error.value.faults and str(again) == str(error.value)


def test_every_error_is_of_one_family_and_says_what_the_command_says(tmp_path: Path) -> None:
    for kind in (cw.FileError, cw.RequestError, cw.ModelError, cw.WriteError):
        assert issubclass(kind, cw.CoilwrightError)
    assert issubclass(cw.FileError, ValueError) and issubclass(cw.WriteError, OSError)
    cases: list[tuple[type[Exception], Any, tuple[Any, ...]]] = [
        (cw.RequestError, lambda: cw.evaluate(PAPER, "quadrupole"), ("evaluate", PAPER, "--pattern", "quadrupole")),
        (cw.RequestError, lambda: cw.evaluate(PAPER, "hex"), ("evaluate", PAPER, "--pattern", "hex")),
        (cw.RequestError, lambda: cw.tolerance(PAPER), ("tolerance", PAPER)),
        (cw.RequestError, lambda: cw.temperatures(PAPER, profile="x"), ("temperatures", PAPER, "--profile", "x")),
        (cw.FileError, lambda: cw.Model.read("nowhere.toml"), ("evaluate", "nowhere.toml")),
        (cw.FileError, lambda: cw.metrics(PAPER), ("metrics", PAPER)),
        (cw.RequestError, lambda: cw.effects("spool_mas"), ("effects", "spool_mas")),
    ]
    for kind, call, words in cases:
        with pytest.raises(kind) as error:
            call()
        done = run_command(*words)
        assert done.returncode == 2
        assert done.stderr.strip() in (str(error.value), f"error: {error.value}"), words
    blocked = tmp_path / "file"
    blocked.write_text("", encoding="utf-8")
    with pytest.raises(cw.WriteError):
        cw.Model.read(PAPER).write(blocked / "x.toml")


def test_a_model_of_keywords_names_what_is_wrong_with_it() -> None:
    with pytest.raises(cw.FileError) as error:
        cw.Model(name="x", layers=7, wavelength_nm=-1.0, thermal_model="pakc")
    text = str(error.value)
    for word in ("layers", "wavelength_nm", "pakc", "refractive_index"):
        assert word in text, text
    with pytest.raises(cw.RequestError, match="expected a number, a text"):
        cw.Model(name=object())


@pytest.mark.skipif(sys.platform == "win32", reason="signals of this kind are not Windows'")
@pytest.mark.parametrize(
    "call",
    [
        "cw.optimise('examples/coil-998m.toml', windability='any', budget_s=120)",
        "cw.exact('examples/coil-998m.toml', windability='any', budget_s=120)",
        "cw.search_function(lambda p: float(p[0]), 24, patience=10**9)",
        "cw.diagnose('examples/chamber-coil.toml', ['examples/chamber-day-1.csv', 'examples/chamber-day-2.csv'])",
    ],
)
def test_ctrl_c_ends_long_work(call: str) -> None:
    # A shell that starts the tests in the background has the interrupt ignored by all that come after it.
    heeded = "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"
    program = f"{heeded}import coilwright as cw\nprint('ready', flush=True)\n{call}\n"
    process = subprocess.Popen(
        [sys.executable, "-c", program], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None and process.stdout.readline() == "ready\n"
    time.sleep(1.0)
    if process.poll() is not None:
        pytest.skip("the work was over before it could be interrupted")
    process.send_signal(signal.SIGINT)
    try:
        _, said = process.communicate(timeout=60)
    finally:
        process.kill()
    assert "KeyboardInterrupt" in said and process.returncode != 0, said


def test_progress_is_told_to_a_callback_and_an_error_in_it_ends_the_work() -> None:
    seen: list[tuple[float, str]] = []
    a = np.random.default_rng(1).normal(size=(1024, 24))
    cw.search_matrix(a, windability="any", budget_s=0.7, patience=10**6, progress=lambda share, words: seen.append((share, words)))
    assert seen and all(0 <= share <= 1 for share, _ in seen) and "best" in seen[-1][1]
    assert [share for share, _ in seen] == sorted(share for share, _ in seen)

    def broken(share: float, words: str) -> None:
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        cw.search_matrix(a, windability="any", budget_s=30.0, patience=10**6, progress=broken)


def test_progress_by_tqdm(capfd: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("tqdm")
    a = np.random.default_rng(1).normal(size=(1024, 24))
    cw.search_matrix(a, windability="any", budget_s=0.5, patience=10**6, progress=True)
    assert "search" in capfd.readouterr().err


def test_results_show_themselves_and_survive_copies_and_pickles() -> None:
    found = cw.evaluate(PAPER, ["qua", "dip"])
    text, page = repr(found), found._repr_html_()
    assert text.startswith("EvaluateResult: paper 200 m") and "qua" in text and "worst_rate_deg_per_h" in text
    assert "<table>" in page and "<script" not in page
    again = pickle.loads(pickle.dumps(found))
    assert again == found and type(again) is cw.EvaluateResult and copy.deepcopy(found) == found
    assert found.patterns[0].windability.reels == found["patterns"][0]["windability"]["reels"]
    assert dict(found).keys() == found.keys() and "patterns" in dir(found)
    with pytest.raises(AttributeError, match="did you mean patterns"):
        found.pattern  # noqa: B018
    with pytest.raises(AttributeError, match="read only"):
        found.model = "x"  # type: ignore[misc]
    changed = found.to_dict()
    changed["patterns"].clear()
    assert len(found.patterns) == 2
    assert any("note" in note for note in found.notes) or found.notes == []
    rates = cw.evaluate(PAPER, "qua", field=cw.temperatures(PAPER, rows=9))
    assert len(pickle.loads(pickle.dumps(rates)).rates_deg_per_h[0]) == 9


def test_text_from_outside_is_no_markup() -> None:
    model = cw.Model.read(PAPER).copy(name="<b>x</b>")
    for page in (model._repr_html_(), cw.evaluate(model, "qua")._repr_html_(), cw.Pattern([1, 2], name="<b>")._repr_html_()):
        assert "<b>" not in page and "&lt;b&gt;" in page


def test_every_picture_draws_into_given_axes_and_into_its_own(tmp_path: Path, small: cw.Model) -> None:
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    coil, day = "examples/chamber-coil.toml", "examples/chamber-day-1.csv"
    record = cw.Record.read(day)
    field = cw.temperatures(small, rows=40)
    searched = cw.optimise(small, rounds=1, moves_per_restart=200)
    under_field = cw.evaluate(small, ["qua", "dip"], field=field)
    pictures: list[tuple[Any, tuple[Any, ...]]] = [
        (cw.plot_patterns, (cw.evaluate(PAPER),)),
        (cw.plot_patterns, (searched,)),
        (cw.plot_cross_section, (cw.classic("qua", 16),)),
        (cw.plot_field, (field,)),
        (partial(cw.plot_field, from_mean=True), (field,)),
        (cw.plot_record, (record,)),
        (cw.plot_comparison, (cw.compare(coil, record),)),
        (cw.plot_tolerance, (cw.tolerance(small),)),
        (cw.plot_pareto, (cw.pareto(small, rounds=1, most_captive=0),)),
        (cw.plot_allan, (cw.metrics(record),)),
        (cw.plot_compensation, (cw.compensate(coil, record, fit=record, method="regression"), record)),
        (cw.plot_rates, (under_field, field)),
    ]
    for draw, arguments in pictures:
        figure, given = plt.subplots()
        assert draw(*arguments, ax=given) is given
        assert given.has_data(), draw
        own = draw(*arguments)
        assert own is not given and (own.get_xlabel() or own.get_ylabel())
        own.figure.savefig(tmp_path / "picture.png")
        plt.close("all")


def test_only_numpy_is_needed() -> None:
    program = textwrap.dedent(
        """
        import sys
        class Refuse:
            def find_spec(self, name, path=None, target=None):
                if name.split(".")[0] in ("pandas", "polars", "pyarrow", "xarray", "matplotlib", "tqdm"):
                    raise ImportError(name)
        sys.meta_path.insert(0, Refuse())
        import coilwright as cw
        cw.show_versions()
        print(cw.evaluate("examples/paper-200m.toml", "qua", progress=True))
        try:
            cw.plot_cross_section(cw.classic("qua", 8))
        except ImportError as error:
            assert "pip install matplotlib" in str(error)
        else:
            raise SystemExit("drawn without matplotlib")
        """
    )
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, encoding="utf-8")
    assert done.returncode == 0, done.stderr
    assert "numpy" in done.stdout and "qua" in done.stdout


def test_the_command_is_the_program(tmp_path: Path) -> None:
    assert run_command("--version").stdout.strip() == f"coilwright {cw.__version__}"
    assert "Usage" in run_command("--help").stdout
    wrong = run_command("evaluate")
    assert wrong.returncode == 2 and "MODEL" in wrong.stderr
    assert run_command("verify", PAPER, "nowhere").returncode == 2
    assert run_command("new", tmp_path / "new.toml").returncode == 0
    assert cw.Model.read(tmp_path / "new.toml").layers > 0


def test_examples_in_docstrings_hold() -> None:
    names = [path.stem for path in Path(cw.__file__).parent.glob("_*.py") if path.stem != "__main__"]
    tried = 0
    for name in names:
        module = cw if name == "__init__" else importlib.import_module(f"coilwright.{name}")
        found = doctest.testmod(module, optionflags=doctest.NORMALIZE_WHITESPACE)
        assert found.failed == 0, module
        tried += found.attempted
    assert tried >= 20


def test_types_hold_in_the_package_and_in_a_user_s_program() -> None:
    pytest.importorskip("mypy")
    config = str(ROOT / "python" / "pyproject.toml")
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--config-file", config, "-p", "coilwright"],
        cwd=ROOT / "python" if Path(cw.__file__).parent == ROOT / "python" / "coilwright" else ROOT / "python" / "tests",
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    program = ROOT / "python" / "examples" / "coil_to_recommendation.py"
    # Built in place, the package is not among those that are installed.
    place = {**os.environ, "MYPYPATH": str(ROOT / "python")} if "site-packages" not in cw.__file__ else None
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--config-file", config, str(program)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        env=place,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_stubs_name_what_the_module_has() -> None:
    import ast

    from coilwright import _coilwright

    stub = ast.parse((Path(cw.__file__).parent / "_coilwright.pyi").read_text(encoding="utf-8"))
    named = {n.name for n in stub.body if isinstance(n, (ast.FunctionDef, ast.ClassDef))}
    named |= {n.target.id for n in stub.body if isinstance(n, ast.AnnAssign) and isinstance(n.target, ast.Name)}
    has = {name for name in dir(_coilwright) if not name.startswith("__")} | {"__version__"}
    assert named == has
    for node in stub.body:
        if isinstance(node, ast.ClassDef):
            members = {n.name for n in node.body if isinstance(n, ast.FunctionDef)}
            members |= {n.target.id for n in node.body if isinstance(n, ast.AnnAssign) and isinstance(n.target, ast.Name)}
            ours = {name for name in dir(getattr(_coilwright, node.name)) if not name.startswith("__")}
            assert members == ours, node.name


def test_versions_are_shown(capsys: pytest.CaptureFixture[str]) -> None:
    cw.show_versions()
    text = capsys.readouterr().out
    assert f"coilwright   {cw.__version__}" in text and "numpy" in text
