"""Sweeps on other workers than threads: those of a Dask scheduler, and those that the user names to joblib."""

import logging
import multiprocessing
import os
import signal
import subprocess
import sys

import dask
import joblib
import numpy as np
import pytest
import yaml
from distributed import LocalCluster
from joblib.externals.loky.process_executor import TerminatedWorkerError
from tiers import mostly_slow

import ringsweep
from benchmarks.hostile.attack import same_bits
from ringsweep import cli
from ringsweep.runs.executors import Execution
from ringsweep.runs.task_sizes import TaskSizes
from ringsweep.storage.checkpoint import Checkpoint

# Killed workers leave resources open, and Python warns of them.
pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.fixture(scope="module")
def cluster():
    """A scheduler and two worker processes on the loopback address."""
    with LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=logging.CRITICAL
    ) as cluster:
        yield cluster


@pytest.mark.slow
def test_task_of_a_killed_worker_is_computed_by_another(cluster, scene, by_threads, tmp_path, monkeypatch):
    axes, path = by_threads
    monkeypatch.setattr(TaskSizes, "max_cells", 4)
    put, killed = Checkpoint.put, []

    def kill_one(self, *rest):
        put(self, *rest)
        if len(self.files) == 5:
            killed.append(next(iter(cluster.workers.values())).pid)
            os.kill(killed[0], signal.SIGKILL)

    monkeypatch.setattr(Checkpoint, "put", kill_one)
    ringsweep.sweep(scene, axes, tmp_path / "dask.nc", scheduler=cluster.scheduler_address, progress=False).close()
    assert killed
    assert same_bits(path, tmp_path / "dask.nc")


@pytest.fixture(scope="module")
def by_threads(scene, tmp_path_factory):
    """Axes of a sweep of 120 cells, and its result file by threads."""
    axes = {"drive.amplitude": np.geomspace(0.5, 8.0, 12), "zone.half_angle": np.radians(np.linspace(5.0, 40.0, 10))}
    path = tmp_path_factory.mktemp("threads") / "threads.nc"
    ringsweep.sweep(scene, axes, path, progress=False).close()
    return axes, path


@pytest.mark.parametrize("backend", mostly_slow(["loky", "threading"], ("threading",)))
def test_workers_that_joblib_is_told_to_use_give_the_same_bits(scene, by_threads, tmp_path, monkeypatch, backend):
    axes, path = by_threads
    monkeypatch.setattr(TaskSizes, "max_cells", 4)
    monkeypatch.setattr("ringsweep.runs.grid.compute_task", _named_by_process())
    put, processes = Checkpoint.put, set()

    def noted(self, positions, columns, process):
        processes.add(process)
        put(self, positions, columns, process)

    monkeypatch.setattr(Checkpoint, "put", noted)
    with joblib.parallel_config(backend=backend, n_jobs=2):
        ringsweep.sweep(scene, axes, tmp_path / "out.nc", progress=False).close()
    assert (str(os.getpid()) in processes) == (backend == "threading")
    assert same_bits(path, tmp_path / "out.nc")


def _named_by_process():
    """A function that computes a task and tells its process in place of its processor. Loky sends it by value."""

    def named(*arguments):
        import os
        from dataclasses import replace

        from ringsweep.runs.cells import compute_task

        return replace(compute_task(*arguments), processor=str(os.getpid()))

    return named


@pytest.mark.slow
def test_tasks_of_killed_processes_are_computed_when_the_sweep_goes_on(scene, by_threads, tmp_path, monkeypatch):
    axes, path = by_threads
    monkeypatch.setattr(TaskSizes, "max_cells", 4)
    put = Checkpoint.put

    def kill_all(self, *rest):
        put(self, *rest)
        # Early, and all of them: those that are left might finish all tasks before the death of one is noticed.
        if len(self.files) == 1:
            for child in multiprocessing.active_children():
                if child.name.startswith("LokyProcess"):
                    os.kill(child.pid, signal.SIGKILL)

    target = tmp_path / "out.nc"
    with joblib.parallel_config(backend="loky", n_jobs=2):
        with monkeypatch.context() as patch:
            patch.setattr(Checkpoint, "put", kill_all)
            with pytest.raises(TerminatedWorkerError) as caught:
                ringsweep.sweep(scene, axes, target, progress=False)
        assert "cells are kept in" in caught.value.__notes__[0]
        ringsweep.sweep(scene, axes, target, progress=False).close()
    assert same_bits(path, target)


@pytest.mark.parametrize(
    ("given", "own", "workers"), [({}, None, joblib.cpu_count()), ({"n_jobs": 3}, None, 3), ({"n_jobs": 3}, 2, 2)]
)
@pytest.mark.parametrize("backend", [{}, {"backend": "threading"}, {"backend": "loky"}])
def test_number_of_workers_comes_from_the_call_then_joblib_then_the_cores(backend, given, own, workers):
    with joblib.parallel_config(**backend, **given), Execution(own).open() as local:
        assert local.concurrency() == workers


def test_backend_that_keeps_its_results_until_the_end_is_refused(scene):
    with (
        joblib.parallel_config(backend="multiprocessing", n_jobs=2),
        pytest.raises(ringsweep.InputError, match="MultiprocessingBackend returns results only at the end"),
    ):
        ringsweep.sweep(scene, {"drive.amplitude": [1.0]}, progress=False)


#: A scheduler with one worker, in one process.
ALONE = """
from distributed import LocalCluster
from joblib.externals.loky.process_executor import TerminatedWorkerError
cluster = LocalCluster(n_workers=1, threads_per_worker=1, processes=False, protocol="tcp", dashboard_address=None)
print(cluster.scheduler_address, flush=True)
input()
"""


@pytest.mark.slow
def test_killed_scheduler_is_told_in_one_line_and_what_is_finished_is_kept(scene, tmp_path, monkeypatch, capsys):
    axes = {"drive.amplitude": [0.5, 1.0, 2.0, 4.0], "zone.half_angle": [0.1, 0.2, 0.3, 0.4]}
    ringsweep.sweep(scene, axes, tmp_path / "threads.nc", progress=False).close()
    config = tmp_path / "sweep.yaml"
    config.write_text(yaml.safe_dump({"scene": scene, "sweep": {"grid": axes}}))
    monkeypatch.setattr(TaskSizes, "max_cells", 1)
    put = Checkpoint.put

    def kill_scheduler(self, *rest):
        put(self, *rest)
        if len(self.files) == 3:
            process.kill()
            process.wait()

    command = ["run", str(config), "-o", str(tmp_path / "dask.nc")]
    with subprocess.Popen([sys.executable, "-c", ALONE], stdin=-1, stdout=-1, stderr=-1, text=True) as process:
        address = process.stdout.readline().strip()
        with monkeypatch.context() as patch:
            patch.setattr(Checkpoint, "put", kill_scheduler)
            assert cli.main([*command, "--backend", "dask", "--scheduler", address]) == 1
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert "the connection to the Dask scheduler is lost; " in message
    assert "of 16 cells are kept in" in message
    assert cli.main(command) == 0
    assert same_bits(tmp_path / "threads.nc", tmp_path / "dask.nc")


@pytest.mark.slow
def test_worker_of_another_version_is_refused(cluster, scene, monkeypatch):
    monkeypatch.setattr("ringsweep.runs.sweep.environment", lambda: {"numba": "99.0"})
    with pytest.raises(ringsweep.InputError, match=r"a worker has other versions.*numba was 99\.0"):
        ringsweep.sweep(scene, {"drive.amplitude": [1.0]}, scheduler=cluster.scheduler_address, progress=False)


def test_interrupt_while_waiting_for_a_worker_stops_the_sweep(scene, tmp_path, monkeypatch):
    with LocalCluster(n_workers=0, dashboard_address=None, silence_logs=logging.CRITICAL) as empty:
        looks = iter(range(3))

        def none_yet(workers):
            if next(looks, None) == 2:
                signal.raise_signal(signal.SIGINT)
            return 0

        monkeypatch.setattr("ringsweep.runs.dask.Workers.concurrency", none_yet)
        with pytest.raises(KeyboardInterrupt):
            ringsweep.sweep(scene, {"drive.amplitude": [1.0]}, scheduler=empty.scheduler_address, progress=False)


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        (
            ["--scheduler", "http://127.0.0.1:1"],
            "no Dask scheduler answers at 'http://127.0.0.1:1': give tcp://HOST:PORT",
        ),
        (["--scheduler", "inproc://x"], "give tcp://HOST:PORT"),
        (["--backend", "dask"], "--scheduler ADDRESS"),
        (["--backend", "threads", "--scheduler", "tcp://127.0.0.1:1"], "--backend dask"),
        (["--scheduler", "tcp://127.0.0.1:1"], "no Dask scheduler answers at 'tcp://127.0.0.1:1'"),
        (["--scheduler", "tcp://127.0.0.1:1", "--jobs", "2"], "--jobs"),
    ],
)
def test_wrong_options_for_dask_are_refused_in_one_line(scene, tmp_path, monkeypatch, capsys, options, problem):
    monkeypatch.setattr("ringsweep.runs.dask._TIMEOUT", 0.5)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.yaml").write_text(yaml.safe_dump({"scene": scene}))
    assert cli.main(["run", "a.yaml", *options]) == 2
    message = capsys.readouterr().err
    assert problem in message
    assert message.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["a.yaml"]


@pytest.mark.slow
def test_workers_that_die_with_their_cells_are_told_with_the_likely_cure(scene, monkeypatch):
    monkeypatch.setattr("ringsweep.runs.dask._run_task", lambda *_: __import__("os")._exit(1))
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        LocalCluster(1, threads_per_worker=1, dashboard_address=None, silence_logs=logging.CRITICAL) as alone,
        pytest.raises(ringsweep.InputError, match=r"several workers died .* limit of memory .*--memory-limit 2GB"),
    ):
        ringsweep.sweep(scene, {"drive.amplitude": [1.0]}, scheduler=alone.scheduler_address, progress=False)
