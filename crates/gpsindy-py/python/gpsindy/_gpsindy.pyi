from collections.abc import Callable, Sequence
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Dataset",
    "FleetManifest",
    "FmuCopies",
    "MujocoCopies",
    "LogOptions",
    "Model",
    "NumericalError",
    "Online",
    "Open",
    "__version__",
    "augmented_toml",
    "author",
    "command",
    "design",
    "diagnose",
    "diagnose_paired",
    "fleet_task",
    "effects",
    "identify",
    "inspect",
    "parse_header",
    "read_effects",
    "render",
    "report_json",
    "score",
    "smooth",
    "summary",
    "write_report",
    "write_whole",
]

__version__: str

_Array = NDArray[np.float64]
_Progress = Callable[[str, int, int], object] | None
_Kind = tuple[float, int, int, list[tuple[str, str, float, float, int]]]
_Custom = tuple[str, str, str, list[tuple[str, float, float, str]]]
_Record = tuple[list[str], _Array, _Array, _Array, list[float]]

class NumericalError(RuntimeError): ...

@final
class LogOptions:
    def __new__(
        cls,
        time: str | None = None,
        run: str | None = None,
        rename: Sequence[tuple[str, str]] = ...,
        map: Sequence[tuple[str, str]] = ...,
        unit: Sequence[tuple[str, str]] = ...,
        offset: Sequence[tuple[str, str]] = ...,
        stamp: str | None = None,
        map_file: str | None = None,
    ) -> LogOptions: ...

@final
class Dataset:
    def __new__(
        cls,
        columns: Sequence[str],
        units: Sequence[str],
        names: Sequence[str],
        times: Sequence[_Array],
        values: Sequence[_Array],
    ) -> Dataset: ...
    @staticmethod
    def read_log(
        paths: Sequence[str],
        options: LogOptions,
        columns: Sequence[str] | None = None,
        controls: Sequence[str] = ...,
        linear: bool = False,
    ) -> tuple[Dataset, list[str]]: ...
    @property
    def columns(self) -> list[str]: ...
    @property
    def units(self) -> list[str]: ...
    @property
    def names(self) -> list[str]: ...
    def time(self, run: int) -> _Array: ...
    def values(self, run: int) -> _Array: ...
    def with_runs(self, indices: Sequence[int]) -> Dataset: ...
    def unwrap_angles(self, columns: Sequence[str]) -> Dataset: ...
    def __len__(self) -> int: ...

@final
class Model:
    @staticmethod
    def parse(name: str, text: str) -> Model: ...
    @staticmethod
    def read(path: str) -> Model: ...
    @staticmethod
    def from_callable(
        function: Callable[[float, _Array, _Array], Any],
        name: str,
        states: Sequence[tuple[str, str]],
        controls: Sequence[tuple[str, str]],
        kinematic: Sequence[tuple[str, str]],
        initial: Sequence[tuple[str, float]],
        vectorized: bool,
    ) -> Model: ...
    @staticmethod
    def from_stepper(
        function: Callable[..., Any],
        name: str,
        period: float,
        parts: dict[str, Any],
        several: bool,
        native: FmuCopies | MujocoCopies | None,
    ) -> Model: ...
    def simulator_inputs(self) -> list[tuple[str, str, str, float | None]]: ...
    @property
    def ports(self) -> list[tuple[str, str, str, str | None]]: ...
    @property
    def calls_simulator(self) -> bool: ...
    @property
    def name(self) -> str: ...
    @property
    def states(self) -> list[tuple[str, str, str, str | None]]: ...
    @property
    def controls(self) -> list[tuple[str, str]]: ...
    @property
    def parameters(self) -> list[tuple[str, float, str, float | None]]: ...
    @property
    def initial(self) -> list[tuple[str, float]]: ...
    @property
    def hold(self) -> str: ...
    @property
    def identification(self) -> _Record | None: ...
    def with_parameters(self, values: Sequence[tuple[str, float]]) -> Model: ...
    def to_toml(self) -> str: ...
    def to_json(self) -> str: ...
    def export(self, target: str, full_digits: bool) -> str: ...
    def write(self, path: str) -> None: ...
    def derivative(self, t: _Array, x: _Array, u: _Array) -> _Array: ...
    def simulate(
        self, initial: Sequence[float], t: _Array, u: _Array, how: tuple[str, str, float]
    ) -> tuple[_Array, _Array]: ...
    def closed_loop(
        self, initial: Sequence[float], t: _Array, controller: Callable[[float, _Array], Any], tolerance: float
    ) -> tuple[_Array, _Array, _Array]: ...
    def simulate_runs(
        self,
        data: Dataset,
        initial: Sequence[tuple[str, float]],
        span: tuple[float | None, float | None],
        how: tuple[str, str, float],
    ) -> list[tuple[str, list[float], _Array, _Array]]: ...

@final
class Online:
    def __new__(cls, settings: dict[str, Any]) -> Online: ...
    def update(self, t: _Array, x: _Array, u: _Array) -> bool: ...
    def begin_run(self) -> None: ...
    @property
    def n_samples(self) -> int: ...
    @property
    def lag(self) -> int: ...
    def identification(self) -> tuple[Model, dict[str, Any]]: ...
    def estimate(self) -> tuple[_Array, _Array, _Array, _Array]: ...
    def copy(self) -> Online: ...

def parse_header(text: str) -> tuple[str, str]: ...
def write_report(folder: str, files: Sequence[tuple[str, str]]) -> None: ...
def write_whole(path: str, text: str) -> None: ...
def smooth(
    data: Dataset,
    columns: Sequence[str],
    kernel: str,
    noise: Sequence[float] | None,
    covariance: bool,
    progress: _Progress,
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]: ...
def score(
    model: Model, data: Dataset, window: float | None, hold: str, progress: _Progress
) -> tuple[_Kind, _Kind, _Kind]: ...
def identify(data: Dataset, settings: dict[str, Any], progress: _Progress) -> tuple[Model, dict[str, Any]]: ...
def author(
    data: Dataset, settings: dict[str, Any], progress: _Progress
) -> tuple[Model, float, float, float]: ...
@final
class Open:
    @staticmethod
    def parse(text: str) -> Open: ...
    def to_json(self) -> str: ...
    @property
    def labels(self) -> list[str]: ...
    @property
    def pairs(self) -> list[tuple[str, str]]: ...
    @property
    def sizes(self) -> tuple[list[str], list[float], list[list[float]]]: ...

def design(
    open: Open,
    model: Model,
    settings: dict[str, Any],
    progress: _Progress,
) -> tuple[_Array, list[str], _Array, str, list[tuple[str, str, float, float | None]], bool]: ...
def diagnose(
    model: Model,
    train: Dataset,
    holdout: Dataset | None,
    options: dict[str, Any],
    progress: _Progress,
) -> tuple[str, Model, Model, list[Model], Open]: ...
def diagnose_paired(
    simulated: Dataset,
    identify: dict[str, Any],
    train: Dataset,
    holdout: Dataset | None,
    options: dict[str, Any],
    progress: _Progress,
) -> tuple[str, Model, Model, list[Model], Open]: ...
def read_effects(path: str) -> list[_Custom]: ...
def render(report: str) -> str: ...
def report_json(report: str) -> str: ...
def augmented_toml(report: str, model: str) -> str: ...
def summary(report: str, width: int, colour: bool) -> str: ...
def effects() -> list[tuple[str, str, str, str, str, str, list[tuple[str, str]]]]: ...

def inspect(path: str, options: LogOptions, width: int) -> tuple[str, str]: ...
@final
class FleetManifest:
    def __new__(cls, path: str) -> FleetManifest: ...
    def tasks(self) -> list[str]: ...
    def compare(self, results: list[tuple[str | None, str | None]], place: Any) -> str: ...

def fleet_task(
    task: str, place: Any, options: dict[str, Any], time: str | None, run: str | None, threads: int | None
) -> tuple[str | None, str | None]: ...
@final
class FmuCopies:
    def __new__(
        cls,
        instantiate: Callable[[], Any],
        name: str,
        two: bool,
        references: dict[str, Any],
        indicators: int | None,
    ) -> FmuCopies: ...
    @property
    def cost(self) -> float: ...
    @cost.setter
    def cost(self, seconds: float) -> None: ...
    def is_long(self, steps: int) -> bool: ...
    def step(
        self, x: _Array, u: _Array, force: _Array, parameters: _Array, dt: float | _Array, count: int = 1
    ) -> _Array: ...

@final
class MujocoCopies:
    def __new__(cls, model: Any, address: int, library: Any, plan: dict[str, Any], threads: int) -> MujocoCopies: ...
    def step(
        self, x: _Array, u: _Array, force: _Array, parameters: _Array, dt: float | _Array, count: int = 1
    ) -> _Array: ...

def command(line: Sequence[str]) -> int: ...
