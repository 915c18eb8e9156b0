"""What a sweep needs is told before it runs, and a sweep that cannot fit is refused."""

from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from ringsweep import cli
from ringsweep.config import load
from ringsweep.quantities.flags import FAILED
from ringsweep.runs import needs
from ringsweep.runs.cells import TaskResult
from ringsweep.runs.executors import Execution
from ringsweep.runs.plans import plan_of
from ringsweep.runs.sweep import write
from ringsweep.runs.task_sizes import TaskSizes
from ringsweep.storage.checkpoint import Checkpoint


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
    assert lines["time"].startswith("about ")
    assert lines["time"].endswith(" on 1 threads, once the kernels are compiled")
    assert list(lines) == ["cells", "memory", "disk", "time"]
    assert [path.name for path in tmp_path.iterdir()] == ["a.yaml"]


@pytest.mark.parametrize("n", [4, 48])
def test_size_of_the_file_is_the_one_told(sweep, tmp_path, capsys, n):
    assert cli.main(["run", sweep(n), "--dry-run"]) == 0
    number, unit = capsys.readouterr().out.split("runs, then ")[1].split(";")[0].split()
    assert cli.main(["run", "a.yaml"]) == 0
    told = float(number) * {"kB": 1e3, "MB": 1e6}[unit]
    assert (tmp_path / "a.nc").stat().st_size == pytest.approx(told, rel=0.25)


def test_hundred_million_cells_are_told_at_once(sweep, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=10**12))
    monkeypatch.setattr(needs, "memory_of_machine", lambda: 1e11)
    assert cli.main(["run", sweep(10_000), "--dry-run"]) == 0
    out = capsys.readouterr().out
    assert "cells: 100000000" in out
    assert "memory: some 3.73 GB of 100 GB" in out
    assert cli.main(["run", sweep(1_000_000), "--dry-run"]) == 2
    assert "1e+12 cells: at most 1e+08" in capsys.readouterr().err


def test_dry_run_counts_the_cells_that_are_done(sweep, capsys, monkeypatch):
    def told(*options):
        assert cli.main(["run", *options, "--dry-run"]) == 0
        return capsys.readouterr().out.splitlines()[0]

    assert cli.main(["run", sweep(3), "-q", "-o", "old.nc"]) == 0
    assert told("a.yaml", "-o", "old.nc").endswith("; 9 of them are done")
    assert told("a.yaml", "-o", "new.nc", "--reuse", "old.nc").endswith("; 9 of them are done")
    assert told(sweep(5), "-o", "new.nc", "--reuse", "old.nc").endswith("; 9 of them are done")
    put = Checkpoint.put

    def stop(self, *cells):
        put(self, *cells)
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Checkpoint, "put", stop)
        patch.setattr(TaskSizes, "next", lambda self, left: 4)
        assert cli.main(["run", "a.yaml"]) == 130
    assert told("a.yaml").endswith("; 4 of them are done")
    assert told(sweep(4)) == "cells: 16 (drive_amplitude 4, zone_half_angle 4)"


def test_dry_run_of_a_refined_sweep_tells_upper_bounds(sweep, capsys):
    assert cli.main(["run", sweep(8), "--dry-run", "--refine"]) == 0
    assert capsys.readouterr().out.count("at most") == 4


@pytest.mark.parametrize("dry", [True, False])
@pytest.mark.parametrize("lack", ["disk", "memory"])
def test_sweep_that_does_not_fit_is_refused_before_its_first_cell(sweep, tmp_path, monkeypatch, capsys, dry, lack):
    if lack == "disk":
        monkeypatch.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=1000))
        message = f" kB on the disk, and 1 kB are free in {tmp_path}"
    else:
        monkeypatch.setattr(needs, "memory_of_machine", lambda: 1e6)
        message = "the grid needs 300 MB of memory, and this machine has 1 MB"
    monkeypatch.setattr("ringsweep.runs.grid.compute_task", None)
    monkeypatch.setattr(needs, "compute_task", None)
    assert cli.main(["run", sweep(8), *["--dry-run"] * dry]) == 2
    assert message in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["a.yaml"]


def test_only_cells_that_are_still_to_be_computed_need_room_on_the_disk(sweep, tmp_path, monkeypatch):
    config = load(sweep(8))
    room = 64 * plan_of(config).bytes_of_cell()
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
    room = 63 * plan_of(config).bytes_of_cell()
    assert write(config, tmp_path / "a.nc", Execution(progress=False))


@pytest.fixture
def each_takes(monkeypatch):
    """Function that lets each run that is measured take some seconds for a share of its span."""

    def take(seconds, share=1.0):
        def compute(config, layout, positions):
            assert getattr(config.solver, "steps", 1000) == getattr(config.solver, "max_steps", 1000) == 1000
            regime, span = FAILED if share < 1.0 else 0, config.scene.values["time.span"]
            ended = {"regime": np.full(len(positions), regime), "t_end": np.full(len(positions), share * span)}
            return TaskResult(positions, ended, seconds * len(positions), {}, "")

        monkeypatch.setattr(needs, "compute_task", compute)

    return take


@pytest.mark.parametrize(("n", "time"), [(8, "2.1 min"), (244, "33 h")])
def test_time_is_that_of_the_measured_cells_shared_among_threads(sweep, tmp_path, each_takes, n, time):
    each_takes(6.0)
    assert f"time: about {time} on 3 threads" in needs.describe(load(sweep(n)), tmp_path / "a.nc", 3)


@pytest.mark.parametrize("solver", [{"method": "auto", "max_steps": 10**9}, {"method": "rk4", "steps": 10**7}])
def test_time_of_long_cells_follows_from_their_first_steps(sweep, tmp_path, each_takes, solver):
    """A thousand steps reach a ten-thousandth of the span."""
    each_takes(0.05, 1e-4 if "max_steps" in solver else 1.0)
    assert "time: about 4.4 h on 2 threads" in needs.describe(load(sweep(8, solver=solver)), tmp_path / "a.nc", 2)


def test_time_of_a_sampled_sweep_is_that_of_all_its_runs(sweep, tmp_path, each_takes):
    sample = {"n": 64, "of": {"friction.rest.mu_k": {"uniform": [0.05, 0.1]}}}
    config = load({"scene": load(sweep(2)).source["scene"], "sweep": {"sample": sample}})
    each_takes(2.0)
    told = needs.describe(config, tmp_path / "a.nc", 1)
    assert "cells: 1; 64 runs in each" in told
    assert "time: about 2.1 min on 1 threads" in told


def test_numbers_at_the_edge_of_a_double_give_a_file_without_a_picture(scene, tmp_path, monkeypatch, caplog):
    """Bounds overflow 32 bits, and degrees overflow a double. NumPy's warnings are errors in these tests."""
    monkeypatch.chdir(tmp_path)
    grid = {"initial.phi": [-1e308, 0.1]}
    (tmp_path / "a.yaml").write_text(yaml.safe_dump({"scene": scene, "sweep": {"grid": grid}}))
    assert cli.main(["run", "a.yaml"]) == 0
    assert "a.png is not drawn: values of initial_phi are too large to be drawn" in caplog.text
    assert (tmp_path / "a.nc").exists()


#: Most bytes that `run --refine --jobs 1` took, with the picture, by side of the map (stiction, 10 s).
PEAKS = {512: 354e6, 1024: 465e6, 2048: 505e6, 4096: 892e6}


@pytest.mark.parametrize("side", PEAKS)
def test_memory_that_is_told_is_what_a_refined_map_took(sweep, side):
    assert 0.95 < needs.memory_needed(plan_of(load(sweep(side), refine=True)), False) / PEAKS[side] < 1.25
