"""Fixtures: the paper's rig, its figures, batches of cells and runs."""

import signal
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType, SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import settings
from xdist.scheduler import LoadScopeScheduling

from ringsweep.config import load, reading
from ringsweep.models import MODELS, batch, parameters
from ringsweep.models.scene import Structure
from ringsweep.runs import task_sizes
from ringsweep.solvers.rk4 import RK4

settings.register_profile("ringsweep", deadline=None, derandomize=True)
settings.load_profile("ringsweep")


def pytest_configure(config: pytest.Config) -> None:
    """Let tests interrupt themselves: a shell starts processes in the background with interrupts ignored."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Let the tasks of each test begin with one cell, whatever ran before it."""
    task_sizes._known.clear()


class ByFile(LoadScopeScheduling):
    """Runs the tests of a file in one process, since they share kernels and fixtures; but each notebook on its own.

    The groups of ``--dist loadgroup`` have no effect from pytest 9.2 on: xdist 3.8 writes them where pytest no longer
    reads.
    """

    def _split_scope(self, nodeid: str) -> str:
        file = nodeid.split("::")[0]
        return nodeid if file.endswith("test_notebooks.py") else file


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> ByFile:
    """Scheduler of the processes."""
    # Newer versions of xdist would begin with the files of most tests. In the order of names the notebooks come when
    # most of their kernels are compiled, and the files at the end are short, so that no process waits for another.
    config.option.loadscopereorder = False
    return ByFile(config, log)


#: Values of the rig by path, with the friction of Figs. 29 and 30.
RIG: Mapping[str, float] = MappingProxyType(
    {
        "body.mass": 0.076,
        "body.inertia": 4.47e-5,
        "body.half_distance": 0.025,
        "body.ball_radius": 0.010,
        "ring.radius": 0.043378,
        "friction.rough.mu_s": 0.5,
        "friction.rough.mu_k": 0.3,
        "friction.rest.mu_s": 0.2,
        "friction.rest.mu_k": 0.1,
        "friction.alpha": 1e5,
        "friction.v0": 2e-6,
        "zone.half_angle": np.radians(15.0),
        "drive.amplitude": 0.0,
        "drive.exponent": 1.1,
        "time.span": 1.0,
    }
)


class Figure(NamedTuple):
    """Setting of one of the paper's figures: drive, changes of the rig's values, number of steps."""

    drive: str
    changes: dict[str, float]
    steps: int


def _figure(drive: str, steps: int, span: float, rough: tuple, rest: tuple, alpha: float, v0: float, **more: float):
    changes = {"time.span": span, "friction.alpha": alpha, "friction.v0": v0}
    for place, (mu_s, mu_k) in {"rough": rough, "rest": rest}.items():
        changes |= {f"friction.{place}.mu_s": mu_s, f"friction.{place}.mu_k": mu_k}
    return Figure(drive, changes | {name.replace("__", "."): value for name, value in more.items()}, steps)


FIGURES: Mapping[int, Figure] = MappingProxyType(
    {
        25: _figure("arctan", 15000, 10, (0.5, 0.3), (0.3, 0.1), 100, 0.2, drive__amplitude=0.2),
        26: _figure("arctan", 15000, 10, (0.5, 0.3), (0.2, 0.1), 100, 2e-5, drive__amplitude=0.2),
        27: _figure("arctan", 15000, 10, (0.5, 0.3), (0.2, 0.1), 1e4, 0.2, drive__amplitude=0.2),
        28: _figure("arctan", 15000, 10, (0.5, 0.3), (0.2, 0.1), 1e4, 2e-6, drive__amplitude=0.2),
        29: _figure("arctan", 5000, 10, (0.5, 0.3), (0.2, 0.1), 1e5, 2e-6, drive__amplitude=2),
        30: _figure("arctan", 15000, 8, (0.5, 0.3), (0.2, 0.1), 1e5, 2e-6, drive__amplitude=10),
        31: _figure(
            "power", 5000, 2, (0.5, 0.4), (0.2, 0.1), 1e5, 2e-6, drive__amplitude=20, zone__half_angle=np.pi / 2
        ),
        32: _figure("arctan", 5000, 1, (0.2, 0.15), (0.15, 0.1), 1e5, 2e-6, initial__omega=16),
        33: _figure("arctan", 5000, 1, (0.2, 0.15), (0.15, 0.1), 1e5, 2e-6, initial__omega=100),
    }
)


@pytest.fixture(autouse=True)
def each_test_is_warned() -> None:
    """A warning that an earlier test of this process has met is given again."""
    reading.warn_once.cache_clear()


@pytest.fixture(scope="session")
def scene() -> dict[str, Any]:
    """Scene of the paper's Fig. 29 with stiction in place of Bengisu-Akay friction, for 4 s."""
    given = dict(load(Path(__file__).parents[1] / "configs" / "regime_map.yaml").source["scene"])
    friction = {"law": "stiction", "rough": given["friction"]["rough"], "rest": given["friction"]["elsewhere"]}
    return given | {"friction": friction, "time": {"span": "4 s"}}


@pytest.fixture(scope="session")
def figure() -> Callable[[int], Figure]:
    """Function that returns the setting of a figure by its number."""
    return FIGURES.__getitem__


@pytest.fixture(scope="session")
def cells() -> Callable[..., Any]:
    """Function that returns a batch of the rig with `changes` by path; arrays make several cells.

    A ring at rest has a drive with amplitude 0, so that no other kernel is compiled.
    """

    def build(
        changes: Mapping[str, Any] | None = None,
        *,
        model: str = "ring",
        law: str = "bengisu-akay",
        drive: str = "arctan",
        arcs: tuple[str, ...] = ("zone",),
    ) -> Any:
        structure = Structure(model, law, drive, arcs)
        known = parameters(structure)
        values = {path: RIG.get(path, parameter.default) for path, parameter in known.items()} | dict(changes or {})
        assert values.keys() == known.keys(), "a change that the scene does not know"
        given = {path: value for path, value in values.items() if value is not None}
        columns = np.broadcast_arrays(*(np.atleast_1d(np.asarray(value, dtype=float)) for value in given.values()))
        return batch(structure, {path: column.copy() for path, column in zip(given, columns, strict=True)})

    return build


@pytest.fixture(scope="session")
def setting(cells: Callable[..., Any]) -> Callable[..., Any]:
    """Function that returns a batch of a figure's setting with `changes`; double underscores stand for dots."""

    def build(number: int, law: str = "bengisu-akay", **changes: float) -> Any:
        drive, values, _ = FIGURES[number]
        values = values | {path.replace("__", "."): value for path, value in changes.items()}
        known = parameters(Structure("ring", law, drive, ("zone",)))
        return cells({path: value for path, value in values.items() if path in known}, law=law, drive=drive)

    return build


@pytest.fixture(scope="session")
def run() -> Callable[..., Any]:
    """Function that returns the outcomes of a batch by RK4: one array for each outcome, and the fields of `Result`."""
    names = MODELS["ring"].outcomes

    def integrate(batch: Any, steps: int, *, certify: bool = False) -> Any:
        result = RK4(steps, certify).run(batch, names)
        return SimpleNamespace(**vars(result), **dict(zip(names, result.rows.T, strict=True)))

    return integrate


@pytest.fixture(scope="session")
def history() -> Callable[..., Any]:
    """Function that returns the history of the first cell of a batch by RK4, one array for each variable."""

    def integrate(batch: Any, steps: int, law: str = "bengisu-akay") -> Any:
        names = MODELS["ring"].history(Structure("ring", law))
        t, rows = RK4(steps).history(batch, steps, len(names))
        return SimpleNamespace(t=t, **dict(zip(names, rows.T, strict=True)))

    return integrate
