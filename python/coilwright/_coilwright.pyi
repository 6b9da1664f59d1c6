from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Answered = tuple[str, list[str]]
PatternArgument = str | tuple[str, list[int], tuple[int, int]]
RecordArgument = str | RecordHandle
Progress = Callable[[float, str], object] | None

__version__: str
threads: int
optimised: bool

def command(words: Sequence[str]) -> int: ...
def arrow_stream(columns: list[tuple[str, Array]]) -> object: ...
def arrow_columns(capsule: object) -> list[tuple[str, Array]]: ...

class ModelHandle:
    source: str
    path: str
    name: str
    layers: int
    length_m: float
    mean_diameter_m: float
    layer_lengths_m: Array
    pattern: tuple[str, list[int], tuple[int, int]] | None
    effects: list[str]
    profiles: list[str]
    windability: str
    objective: str
    seed: int
    advice: list[str]
    @staticmethod
    def parsed(source: str, path: str) -> ModelHandle: ...
    @staticmethod
    def of_tables(tables: dict[str, Any], path: str) -> ModelHandle: ...
    def changed(self, tables: dict[str, Any]) -> ModelHandle: ...
    def moved(self, path: str) -> ModelHandle: ...
    def with_profiles(self, path: str) -> ModelHandle: ...
    def write(self, path: str) -> None: ...
    def tables(self) -> dict[str, Any]: ...

def read_model(path: str) -> ModelHandle: ...
def check_model(path: str) -> str: ...
def effects(kinds: list[str]) -> str: ...
def check_pattern(segments: list[int], end_turns: tuple[int, int]) -> None: ...
def classic(name: str, layers: int) -> list[int]: ...
def classics(layers: int) -> str: ...
def windability(segments: list[int], end_turns: tuple[int, int]) -> str: ...
def winding_graph(
    segments: list[int], end_turns: tuple[int, int]
) -> tuple[list[tuple[int, int, int, int | None, int | None]], str | None]: ...
def read_pattern(path: str) -> tuple[str, list[int], tuple[int, int]]: ...
def print_pattern(
    path: str, name: str, segments: list[int], end_turns: tuple[int, int], comments: list[str]
) -> None: ...

class RecordHandle:
    name: str
    file: str
    sha256: str | None
    rows: int
    interval_s: float
    skipped_rows: int
    remarks: list[str]
    time_s: Array
    temperature_k: Array
    rate_rad_per_s: Array
    inner_k: Array | None
    ambient_k: Array | None
    channel_names: list[str]
    address: int
    def channel(self, name: str) -> Array | None: ...
    def gaps(self) -> list[tuple[int, float]]: ...
    def gross_errors(self) -> list[tuple[int, str]]: ...

def read_record(
    path: str,
    model: ModelHandle | None = None,
    columns: str | None = None,
    bad_rows: str | None = None,
    average_rows: int | None = None,
    compensated: bool = False,
) -> RecordHandle: ...
def record_of(
    name: str,
    time_s: Array,
    temperature: Array,
    rate: Array,
    inner: Array | None = None,
    ambient: Array | None = None,
    channels: list[tuple[str, Array]] = ...,
    si: bool = False,
) -> RecordHandle: ...

class FieldHandle:
    model: str
    name: str
    layers: int
    time_s: Array
    temperature_k: Array
    rate_k_per_s: Array
    ambient_k: Array
    ambient_rate_k_per_s: Array
    axial_moment_k: Array
    axial_moment_rate_k_per_s: Array
    def document(self) -> str: ...

def temperatures(
    model: ModelHandle, record: RecordArgument | None = None, profile: str | None = None, rows: int = 601
) -> tuple[FieldHandle, list[str]]: ...
def field_of(
    name: str,
    time_s: Array,
    temperature: Array,
    rate: Array,
    ambient: Array,
    ambient_rate: Array,
    moment_k: Array | None = None,
    moment_rate: Array | None = None,
    si: bool = False,
) -> FieldHandle: ...
def evaluate_field(
    model: ModelHandle, field: FieldHandle, patterns: list[PatternArgument]
) -> tuple[Answered, list[Array]]: ...
def sensitivities(model: ModelHandle, field: FieldHandle) -> tuple[Array, Array] | None: ...
def evaluate(model: ModelHandle, patterns: list[PatternArgument], progress: Progress = None) -> Answered: ...
def tolerance(
    model: ModelHandle,
    patterns: list[PatternArgument],
    samples: int | None = None,
    seed: int | None = None,
    limit_deg_per_h: float | None = None,
    progress: Progress = None,
) -> Answered: ...
def schedule(model: ModelHandle, pattern: PatternArgument | None = None, output: str | None = None) -> Answered: ...
def verify(model: ModelHandle, path: str, source: str | None = None) -> Answered: ...
def compare(
    model: ModelHandle,
    records: list[RecordArgument],
    pattern: PatternArgument | None = None,
    gross: str = "keep",
    output: str | None = None,
    progress: Progress = None,
) -> tuple[Answered, list[tuple[str, Array, Array, Array]]]: ...
def diagnose(
    model: ModelHandle,
    records: list[RecordArgument],
    holdout: list[RecordArgument],
    pattern: PatternArgument | None = None,
    output: str | None = None,
    experiment_seed: int | None = None,
    terms: list[str] | None = None,
    progress: Progress = None,
) -> tuple[Answered, str | None, str | None]: ...
def extend(
    model: ModelHandle,
    effect: str,
    fit: list[RecordArgument],
    holdout: list[RecordArgument],
    formula: str | None = None,
    parameters: list[tuple[str, float]] = ...,
    pattern: PatternArgument | None = None,
    output: str | None = None,
    proposal: str | None = None,
) -> tuple[Answered, str]: ...
def trim(
    model: ModelHandle, records: list[RecordArgument], pattern: PatternArgument | None = None
) -> Answered: ...
def metrics(
    records: list[RecordArgument], average_s: float, gross: str = "keep", output: str | None = None
) -> Answered: ...
def improve(
    model: ModelHandle,
    records: list[RecordArgument],
    holdout: list[RecordArgument],
    output: str,
    pattern: PatternArgument | None = None,
    seed: int | None = None,
    terms: list[str] | None = None,
    progress: Progress = None,
) -> Answered: ...
def optimise(
    model: ModelHandle,
    options: dict[str, Any],
    init: PatternArgument | None = None,
    compare_with: PatternArgument | None = None,
    prove_s: float | None = None,
    output: str | None = None,
    cutting_planes: bool = False,
    diagnosis: str | None = None,
    ends: tuple[int, bool] = (0, False),
    progress: Progress = None,
) -> Answered: ...
def exact(
    model: ModelHandle,
    patterns: list[PatternArgument],
    windability: str | None = None,
    objective: str | None = None,
    budget_s: float | None = None,
    seed: int | None = None,
    progress: Progress = None,
) -> Answered: ...
def pareto(
    model: ModelHandle,
    seed: int | None = None,
    most_captive: int | None = None,
    rounds: int | None = None,
    output: str | None = None,
    progress: Progress = None,
) -> Answered: ...
def search_matrix(
    sensitivities: Array,
    options: dict[str, Any],
    constant: Array | None = None,
    init: list[int] | None = None,
    progress: Progress = None,
) -> tuple[Answered, int]: ...
def time_search_matrix(sensitivities: Array, options: dict[str, Any]) -> tuple[float, str]: ...
def search_field(
    model: ModelHandle,
    field: FieldHandle,
    options: dict[str, Any],
    init: list[int] | None = None,
    progress: Progress = None,
) -> Answered: ...
def search_function(
    cost: Callable[[npt.NDArray[np.int64]], float],
    layers: int,
    options: dict[str, Any],
    init: list[int] | None = None,
    progress: Progress = None,
) -> Answered: ...

class CompensatorHandle:
    method: str
    channel_names: list[str]
    def delay_rows(self, interval_s: float) -> int: ...
    def batch(self, record: RecordHandle) -> tuple[Array, list[tuple[int, list[str]]], Answered]: ...
    def difference_equation(self, interval_s: float | None = None) -> tuple[str, str]: ...
    def export(self, json: str, header: str, interval_s: float | None = None) -> None: ...
    def stream(self) -> StreamHandle: ...

class StreamHandle:
    delay_rows: int
    def push(
        self,
        number: int,
        time_s: float,
        temperature_c: float | None = None,
        rate_deg_per_h: float | None = None,
        inner_c: float | None = None,
        channels: list[float | None] = ...,
    ) -> list[tuple[int, float | None, list[str]]]: ...
    def finish(self) -> list[tuple[int, float | None, list[str]]]: ...

def compensator(
    model: ModelHandle,
    method: str,
    fit: list[RecordArgument] = ...,
    pattern: PatternArgument | None = None,
    linear: bool = False,
    delay_s: float | None = None,
) -> tuple[CompensatorHandle, list[str]]: ...
def compensate_file(
    handle: CompensatorHandle, path: str, output: str | None = None
) -> tuple[Answered, bytes | None]: ...
def compensate_all(
    model: ModelHandle,
    fit: list[RecordArgument],
    record: RecordArgument | None = None,
    pattern: PatternArgument | None = None,
) -> tuple[Answered, list[tuple[str, Array]]]: ...

def campaign(
    campaign: str,
    output: str | None = None,
    cells: list[str] = ...,
    shard: tuple[int, int] | None = None,
    merges: bool = False,
    lists: bool = False,
    checkpoint_every_s: float | None = None,
    progress: Progress = None,
) -> Answered: ...
def campaign_workflow(
    campaign: str, engine: str, output: str, program: str, job_time_s: float, threads: int
) -> Answered: ...
def reproduce(publication: str, output: str | None = None) -> Answered: ...
def report(folder: str, output: str | None = None) -> Answered: ...
def explore(model: ModelHandle, patterns: list[PatternArgument], output: str) -> Answered: ...
def bang_bang(model: ModelHandle, patterns: list[PatternArgument], output: str | None = None) -> str: ...
def schema(kind: str) -> str: ...
def template(name: str) -> str: ...
