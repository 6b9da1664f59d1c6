"""What Python costs: a search over an array beside the same search in Rust, and a million rows of a record through a compensator.

    pip install ./python && python python/benches/speed.py

Both searches run in one process, in turns, so that whatever else the machine does meets both; the best of each is its speed. On a
machine that does other things besides, processor time says more than the clock: both are printed.
"""

from __future__ import annotations

import json
import os
import platform
import time
from pathlib import Path

import numpy as np

import coilwright as cw
from coilwright import _coilwright
from coilwright._search import _options

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
SAMPLES, LAYERS = 8192, 24
ROWS = 1_000_000
TURNS = 5


class Watch:
    """The clock's and the processors' seconds, the best of several turns each."""

    def __init__(self) -> None:
        self.clock_s = self.processor_s = float("inf")

    def __enter__(self) -> None:
        self._begun = time.perf_counter(), time.process_time()

    def __exit__(self, *_: object) -> None:
        self.clock_s = min(self.clock_s, time.perf_counter() - self._begun[0])
        self.processor_s = min(self.processor_s, time.process_time() - self._begun[1])

    def __str__(self) -> str:
        return f"{self.clock_s:.3f} s ({self.processor_s:.3f} s of processor time)"


def search() -> None:
    """8192 samples of 24 layers, as a user calls it and with nothing of Python around it."""
    sensitivities = np.random.default_rng(2).normal(size=(SAMPLES, LAYERS))
    restarts, moves = 4, 1_000_000
    options = _options(1, "any", "worst-rate", None, 1, None, 1, None, restarts, moves)
    ours, theirs = Watch(), Watch()
    for _ in range(TURNS):
        with ours:
            found = cw.search_matrix(
                sensitivities, seed=1, windability="any", rounds=1, patience=1, restarts=restarts, moves_per_restart=moves
            )
        with theirs:
            _, document = _coilwright.time_search_matrix(sensitivities, options)
        assert json.loads(document)["found"] == [f.to_dict() for f in found.found]
    ratio = ours.processor_s / theirs.processor_s
    print(f"search, {SAMPLES} x {LAYERS}: {ours} from Python, {theirs} in Rust, ratio {ratio:.3f}")


def compensation() -> None:
    """A million rows as arrays."""
    model = cw.Model.read(EXAMPLES / "chamber-coil.toml")
    complete = cw.extend(model, "finite_pack").extended
    day_1 = cw.Record.read(EXAMPLES / "chamber-day-1.csv")
    t = np.arange(ROWS) * 1.0
    record = cw.Record(time_s=t, temperature_c=25 + 10 * np.sin(t / 7000), rate_deg_per_h=0.1 * np.cos(t / 7000))
    for method, used in (("regression", model), ("piecewise", model), ("physical", complete)):
        compensator = cw.Compensator(used, fit=day_1, method=method)
        watch = Watch()
        for _ in range(TURNS):
            with watch:
                found = compensator(record)
        assert found.rate_compensated_deg_per_h is not None and found.rate_compensated_deg_per_h.size == ROWS
        print(f"compensate, {ROWS} rows, {method}: {watch}")


if __name__ == "__main__":
    print(f"coilwright {cw.__version__}, Python {platform.python_version()}, {os.cpu_count()} processors, {platform.machine()}")
    if not _coilwright.optimised:
        print("built without optimisation: these figures say nothing")
    search()
    compensation()
