"""What a sweep needs is told before it runs, and a sweep that cannot fit is refused."""

from threading import Event
from time import monotonic
from types import SimpleNamespace

import numpy as np
import pytest
import yaml

import ringsweep
from ringsweep import cli
from ringsweep.config import load, with_refine
from ringsweep.errors import InputError
from ringsweep.quantities.variables import INFERRED
from ringsweep.runs import plan
from ringsweep.runs.cells import TaskResult
from ringsweep.runs.executors import Execution
from ringsweep.runs.refined import KnownLabels, decide
from ringsweep.runs.sweep import write
from ringsweep.storage.checkpoint import Checkpoint
from ringsweep.storage.chunks import Layout


@pytest.fixture
def sweep(scene, tmp_path, monkeypatch):
    """Function that writes a configuration with `n` x `n` cells and returns its path."""
    monkeypatch.chdir(tmp_path)

    def to_file(n, **more):
        axis = {"linspace": [0.1, 0.5, n]}
        grid = {"drive.amplitude": axis, "zone.half_angle": axis}
        (tmp_path / "a.yaml").write_text(yaml.safe_dump({"scene": scene, "sweep": {"grid": grid}, **more}))
        return "a.yaml"

    return to_file


def test_dry_run_tells_cells_memory_disk_and_time_and_writes_nothing(sweep, tmp_path, capsys):
    assert cli.main(["run", sweep(8), "--dry-run", "--jobs", "1"]) == 0
    lines = dict(line.partition(": ")[::2] for line in capsys.readouterr().out.splitlines())
    assert lines["cells"] == "64 (drive_amplitude 8, zone_half_angle 8)"
    assert lines["memory"].startswith("some 300 MB of ")
    assert "while it runs, then" in lines["disk"]
    assert "on 1 threads" in lines["time"]
    assert "cells spread over the grid" in lines["time"]
    assert "nothing was written" in lines
    assert [path.name for path in tmp_path.iterdir()] == ["a.yaml"]


@pytest.mark.parametrize("n", [4, 48])
def test_size_of_the_file_is_the_one_told(sweep, tmp_path, capsys, n):
    assert cli.main(["run", sweep(n), "--dry-run"]) == 0
    number, unit = capsys.readouterr().out.split("runs, then ")[1].split(";")[0].split()
    assert cli.main(["run", "a.yaml"]) == 0
    told = float(number) * {"kB": 1e3, "MB": 1e6}[unit]
    assert (tmp_path / "a.nc").stat().st_size == pytest.approx(told, rel=0.25)


def test_hundred_million_cells_are_told_at_once(sweep, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(plan, "_MOST", 100)
    monkeypatch.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=10**12))
    monkeypatch.setattr(plan, "memory_of_machine", lambda: 1e11)
    assert cli.main(["run", sweep(10_000), "--dry-run"]) == 0
    out = capsys.readouterr().out
    assert "cells: 100000000" in out
    assert "memory: some 3.73 GB of 100 GB" in out
    assert cli.main(["run", sweep(1_000_000), "--dry-run"]) == 2
    assert "1e+12 cells: at most 1e+08" in capsys.readouterr().err


def test_dry_run_counts_the_cells_that_an_earlier_sweep_has(sweep, capsys):
    assert cli.main(["run", sweep(3), "-q", "-o", "old.nc"]) == 0
    assert cli.main(["run", sweep(5), "--dry-run", "--reuse", "old.nc"]) == 0
    assert "reuse: 9 of them are taken from old.nc" in capsys.readouterr().out
    assert cli.main(["run", sweep(3), "--dry-run", "--reuse", "old.nc"]) == 0
    assert "time: hardly any: no cell is run" in capsys.readouterr().out


def test_dry_run_of_a_refined_sweep_tells_upper_bounds(sweep, capsys):
    assert cli.main(["run", sweep(8), "--dry-run", "--refine"]) == 0
    said = capsys.readouterr().out
    assert said.count("at most") == 4
    assert "are expected to be run" in said.splitlines()[0]


def test_dry_run_estimates_how_many_cells_of_a_refined_map_are_run(sweep):
    """Of a known map, a disc, decisions ask for about as many cells as the measured ones let expect."""
    side, draw = 256, np.random.default_rng(1)
    config = with_refine(load(sweep(side)), True)
    layout = Layout((side, side))

    def columns(positions):
        row, column = layout.indices(positions)
        inside = np.hypot(row - 100, column - 130) < 60
        return {"regime": inside.astype(np.int8), "certified": np.ones(len(positions), dtype=np.int8)}

    labels = KnownLabels(config, layout.total)
    found = decide(config, layout, labels, lambda positions: labels.put(positions, columns(positions)))
    truth = np.count_nonzero(found.origin != INFERRED)
    measured = draw.permutation(layout.total)[:2000]
    expected = plan.expected_cells(config, layout, [TaskResult(measured, columns(measured), 1.0, {}, "")])
    assert expected == pytest.approx(truth, rel=0.4)
    assert truth < 0.2 * layout.total
    assert not plan.expected_cells(load("a.yaml"), layout, [TaskResult(measured, columns(measured), 1.0, {}, "")])


@pytest.mark.parametrize("dry", [True, False])
@pytest.mark.parametrize("lack", ["disk", "memory"])
def test_sweep_that_does_not_fit_is_refused_before_its_first_cell(sweep, tmp_path, monkeypatch, capsys, dry, lack):
    if lack == "disk":
        monkeypatch.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=1000))
        message = f" kB on the disk, and 1 kB are free in {tmp_path}"
    else:
        monkeypatch.setattr(plan, "memory_of_machine", lambda: 1e6)
        message = "the grid needs 300 MB of memory, and this machine has 1 MB"
    monkeypatch.setattr("ringsweep.runs.sweep.compute_task", None)
    monkeypatch.setattr(plan, "compute_task", None)
    assert cli.main(["run", sweep(8), *["--dry-run"] * dry]) == 2
    assert message in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["a.yaml"]


def test_sweep_in_memory_that_does_not_fit_is_refused(scene, monkeypatch):
    monkeypatch.setattr(plan, "memory_of_machine", lambda: 300e6)
    with pytest.raises(InputError, match="of memory, and this machine has"):
        ringsweep.sweep(scene, {"drive.amplitude": [1.0]}, progress=False)


def test_only_cells_that_are_still_to_be_computed_need_room_on_the_disk(sweep, tmp_path, monkeypatch):
    config = load(sweep(8))
    room = 64 * plan.bytes_of_cell(config)
    monkeypatch.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=room))
    put = Checkpoint.put

    def full(*arguments):
        nonlocal room
        if room:
            put(*arguments)
        room = 0
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(Checkpoint, "put", full)
        with pytest.raises(OSError, match="No space"):
            write(config, tmp_path / "a.nc", Execution(progress=False))
    room = 63 * plan.bytes_of_cell(config)
    assert write(config, tmp_path / "a.nc", Execution(progress=False))


@pytest.mark.parametrize("solver", ["auto", {"method": "event", "certify": False}])
def test_columns_take_no_more_bytes_than_planned(scene, solver):
    config = {"scene": scene, "solver": solver, "sweep": {"grid": {"drive.amplitude": [0.5, 2.0]}}}
    found = ringsweep.run(config, progress=False)
    bytes_of_cell = plan.bytes_of_cell(load(config))
    taken = sum(variable.dtype.itemsize for variable in found.data_vars.values())
    assert taken <= bytes_of_cell <= taken + 8


def test_time_is_that_of_the_measured_cells_shared_among_threads(sweep, tmp_path, monkeypatch):
    def compute(config, layout, positions):
        return TaskResult(positions, {}, 6.0 * len(positions), {}, "")

    monkeypatch.setattr(plan, "compute_task", compute)
    assert "time: about 2.1 min on 3 threads" in plan.describe(load(sweep(8)), tmp_path / "a.nc", 3)
    assert "time: about 33 h on 3 threads" in plan.describe(load(sweep(244)), tmp_path / "a.nc", 3)


@pytest.mark.parametrize(
    ("ready", "message"), [(1, "time: more than 32 s on 2 threads"), (0, "time: not known: the fi")]
)
def test_cells_that_take_longer_than_the_measurement_are_not_waited_for(sweep, tmp_path, monkeypatch, ready, message):
    ended, quick = Event(), iter(range(ready))

    def compute(config, layout, positions):
        if next(quick, None) is None:
            ended.wait(60.0)
        return TaskResult(positions, {}, None, {}, "")

    monkeypatch.setattr(plan, "compute_task", compute)
    monkeypatch.setattr(plan, "_FIRST", 0.5)
    found = plan.describe(load(sweep(8)), tmp_path / "a.nc", 2)
    ended.set()
    assert message in found


def test_time_of_long_cells_follows_from_their_first_steps(sweep, tmp_path, monkeypatch):
    ended = Event()

    def compute(config, layout, positions):
        if config.solver.max_steps > 1000:
            ended.wait(60.0)
        reached = np.full(len(positions), 1e-4 * config.scene.values["time.span"])
        return TaskResult(positions, {"t_end": reached}, 0.05 * len(positions), {}, "")

    monkeypatch.setattr(plan, "compute_task", compute)
    found = plan.describe(load(sweep(8, solver={"method": "auto", "max_steps": 10**9})), tmp_path / "a.nc", 2)
    ended.set()
    assert "time: about 4.4 h on 2 threads, once the kernels are compiled (from 1000 steps of a cell" in found


@pytest.mark.parametrize(
    ("solver", "limit"), [({"method": "auto"}, "max_steps"), ({"method": "rk4", "steps": 10**9}, "steps")]
)
def test_long_cells_are_not_waited_for_while_their_kernels_are_compiled(sweep, tmp_path, monkeypatch, solver, limit):
    ended, limits = Event(), []

    def compute(config, layout, positions):
        limits.append(most := getattr(config.solver, limit))
        if most > 1e6:
            ended.wait(60.0)
        return TaskResult(positions, {}, None, {}, "")

    monkeypatch.setattr(plan, "compute_task", compute)
    began = monotonic()
    found = plan.describe(load(sweep(8, solver=solver)), tmp_path / "a.nc", 2)
    took = monotonic() - began
    ended.set()
    assert "time: more than 32 s on 2 threads" in found
    assert took < 20.0
    # A thread of the test before may still be running, with its own limit.
    assert min(limits) <= 1000


def test_numbers_at_the_edge_of_a_double_give_a_file_without_a_picture(scene, tmp_path, monkeypatch, caplog):
    """Bounds overflow 32 bits, and degrees overflow a double. NumPy's warnings are errors in these tests."""
    monkeypatch.chdir(tmp_path)
    grid = {"initial.phi": [-1e308, 0.1]}
    (tmp_path / "a.yaml").write_text(yaml.safe_dump({"scene": scene, "sweep": {"grid": grid}}))
    assert cli.main(["run", "a.yaml"]) == 0
    assert "a.png is not drawn: values of initial_phi are too large to be drawn" in caplog.text
    assert (tmp_path / "a.nc").exists()


def test_dry_run_measures_no_workers_of_dask(sweep, capsys):
    arguments = ["--dry-run", "--backend", "dask", "--scheduler", "tcp://127.0.0.1:1"]
    assert cli.main(["run", sweep(8), *arguments]) == 2
    assert "--dry-run" in capsys.readouterr().err


#: Most bytes that `run --refine --jobs 1` took, with the picture, by side of the map (stiction, 10 s).
PEAKS = {512: 354e6, 1024: 465e6, 2048: 505e6, 4096: 892e6}


@pytest.mark.parametrize("side", PEAKS)
def test_memory_that_is_told_is_what_a_refined_map_took(sweep, side):
    assert 0.95 < plan.memory_needed(with_refine(load(sweep(side)), True), False) / PEAKS[side] < 1.25
