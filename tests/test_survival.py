"""A stopped sweep continues, and its file equals the file of a sweep that was never stopped."""

import errno
import json
import os
import re
import shutil
import signal
import threading
from contextlib import contextmanager
from functools import partial
from itertools import takewhile

import netCDF4
import numpy as np
import pytest
import xarray as xr
import yaml
from refusals import refused
from tiers import mostly_slow

import ringsweep
from benchmarks.hostile.attack import same_bits
from benchmarks.hostile.kills import POINTS, killed_at
from ringsweep import cli
from ringsweep.config import load
from ringsweep.runs.cells import compute_task
from ringsweep.runs.executors import Execution, stop_on_interrupt
from ringsweep.runs.sweep import write
from ringsweep.runs.task_sizes import TaskSizes
from ringsweep.storage import netcdf
from ringsweep.storage.checkpoint import Checkpoint, open_checkpoint
from ringsweep.storage.chunks import Layout
from ringsweep.storage.files import MANIFEST, WorkingFolder
from ringsweep.storage.provenance import differences, identity

SWEEP = {
    "grid": {"drive.amplitude": {"geomspace": [0.5, 8.0, 9]}, "zone.half_angle": {"linspace": ["5 deg", "40 deg", 8]}}
}


@pytest.fixture(scope="module")
def config(scene, tmp_path_factory):
    """Configuration file of a sweep of 72 cells."""
    path = tmp_path_factory.mktemp("never") / "sweep.yaml"
    path.write_text(yaml.safe_dump({"scene": scene, "sweep": SWEEP}, sort_keys=False))
    return path


@pytest.fixture(scope="module")
def never_stopped(config):
    """Result file of a sweep that was never stopped."""
    path = config.with_name("never.nc")
    ringsweep.run(config, path, progress=False).close()
    return path


@pytest.fixture
def small_tasks(monkeypatch):
    """Limit tasks to three cells, so that a small sweep has many tasks."""
    monkeypatch.setattr(TaskSizes, "max_cells", 3)


def test_thread_that_fails_stops_the_others_and_no_result_before_is_lost():
    stopped, found = threading.Event(), []
    tasks = takewhile(lambda _: not stopped.is_set(), (np.array([k]) for k in range(1_000_000)))

    def compute(task):
        if task[0] == 5:
            raise ValueError("the fifth task")
        return int(task[0])

    with Execution(2).open() as workers, pytest.raises(ValueError, match="the fifth task"):
        found.extend(workers.results(compute, tasks, lambda result: result, stopped))
    assert {0, 1, 2, 3, 4} <= set(found)
    assert 5 not in found
    assert len(found) < 1_000_000


class Stopped(BaseException):
    """Raised in these tests to stop a sweep."""


@contextmanager
def stopping(monkeypatch, owner, name, after):
    """Let a method raise `Stopped` after it has been called `after` times."""
    method, count = getattr(owner, name), iter(range(after))

    def stop(*args, **kwargs):
        if next(count, None) is None:
            raise Stopped
        return method(*args, **kwargs)

    with monkeypatch.context() as patch:
        patch.setattr(owner, name, stop)
        yield


@pytest.fixture
def half_done(config, tmp_path, monkeypatch, small_tasks):
    """Path of the result file of a sweep that was stopped after ten tasks."""
    target = tmp_path / "out.nc"
    with stopping(monkeypatch, Checkpoint, "put", 10), pytest.raises(Stopped):
        ringsweep.run(config, target, progress=False)
    return target


def tasks_of(target):
    return sorted(target.with_name("out.nc.partial").glob("*.npz"))


def left(target):
    """Names of all files in the folder of a file."""
    return sorted(path.name for path in target.parent.iterdir())


class TestContinuation:
    @pytest.mark.parametrize("point", mostly_slow(POINTS, ("after a rename",)))
    def test_killed_sweep_continues_to_the_same_bits(self, config, never_stopped, tmp_path, point):
        target = tmp_path / "out.nc"
        arguments = ["run", str(config), "-o", str(target)]
        assert killed_at(point, min(2, POINTS[point]), arguments).returncode == -9
        assert target.with_name("out.nc.partial").exists()
        assert cli.main(arguments) == 0
        assert same_bits(target, never_stopped)
        assert left(target) == ["out.nc", "out.png"]

    def test_finished_tasks_are_not_computed_again(self, config, half_done, monkeypatch, caplog):
        assert len(tasks_of(half_done)) == 10
        put, computed = Checkpoint.put, []
        monkeypatch.setattr(Checkpoint, "put", lambda self, p, *rest: (computed.extend(p), put(self, p, *rest)))
        with caplog.at_level("INFO", logger="ringsweep"):
            ringsweep.run(config, half_done, progress=False).close()
        assert f"going on: {72 - len(computed)} of 72 cells are done" in caplog.text
        assert 0 < len(computed) < 72

    def test_interrupted_sweep_reports_how_to_continue(
        self, config, tmp_path, monkeypatch, capsys, caplog, small_tasks
    ):
        put = Checkpoint.put

        def interrupted(*arguments):
            put(*arguments)
            signal.raise_signal(signal.SIGINT)

        monkeypatch.setattr(Checkpoint, "put", interrupted)
        assert cli.main(["run", str(config), "-o", str(tmp_path / "out.nc")]) == 130
        message = capsys.readouterr().err
        assert message.count("\n") == 1
        assert "stopping when" in caplog.text
        assert "interrupted" in message
        assert "cells are kept in" in message
        assert "the same command goes on" in message

    # An interrupt between opening a file and its block leaves the file to the garbage collector.
    @pytest.mark.slow
    @pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
    @pytest.mark.parametrize("jobs", ["1", "2"])
    def test_second_interrupt_does_not_wait_for_the_task_under_way(
        self, config, never_stopped, tmp_path, monkeypatch, capsys, caplog, small_tasks, number, jobs
    ):
        """The first one is answered at once, also while compiled code runs. What is finished is kept."""
        done, ended, events = iter(range(6)), threading.Event(), []

        @contextmanager
        def watched():
            with stop_on_interrupt() as stopped:
                events.append(stopped)
                yield stopped

        def endless(*arguments):
            if (count := next(done, None)) is None or count == 5:
                if count == 5:
                    os.kill(os.getpid(), number)
                    events[0].wait(60.0)
                    os.kill(os.getpid(), number)
                ended.wait(60.0)
                raise SystemExit
            return compute_task(*arguments)

        target = tmp_path / "out.nc"
        command = ["run", str(config), "-o", str(target), "--jobs", jobs]
        with monkeypatch.context() as patch:
            patch.setattr("ringsweep.runs.sweep.stop_on_interrupt", watched)
            patch.setattr("ringsweep.runs.grid.compute_task", endless)
            assert cli.main(command) == 128 + number
        ended.set()
        assert "done (Ctrl-C again: stop now" in caplog.text
        assert "interrupted" in capsys.readouterr().err
        # The other thread may not have finished its task.
        assert len(tasks_of(target)) >= 6 - int(jobs)
        assert cli.main(command) == 0
        assert same_bits(target, never_stopped)

    @pytest.mark.parametrize("call", ["sweep", "simulate", "precision"])
    def test_interrupt_ends_at_once_what_keeps_nothing(self, scene, monkeypatch, call):
        ended = threading.Event()

        def endless(*arguments):
            os.kill(os.getpid(), signal.SIGINT)
            ended.wait(60.0)
            raise SystemExit

        monkeypatch.setattr("ringsweep.solvers.event.Auto.run", endless)
        monkeypatch.setattr("ringsweep.solvers.event.Event.run", endless)
        calls = {"sweep": partial(ringsweep.sweep, axes={}), "simulate": ringsweep.simulate}
        with pytest.raises(KeyboardInterrupt):
            calls.get(call, lambda scene: ringsweep.precision({"scene": scene}))(scene)
        ended.set()

    def test_sweep_continues_after_a_change_that_does_not_affect_its_bits(self, scene, half_done, never_stopped):
        """Units as typed, the order of keys, and the value of a swept path may change."""
        scene = dict(reversed(scene.items())) | {"drive": {"amplitude": "3 rad/s", "law": "arctan"}}
        grid = {"drive.amplitude": SWEEP["grid"]["drive.amplitude"]}
        grid["zone.half_angle"] = {"linspace": [np.radians(5), np.radians(40), 8]}
        ringsweep.run({"sweep": {"grid": grid}, "scene": scene}, half_done, progress=False).close()
        assert same_bits(half_done, never_stopped)


class TestCheckpoint:
    def test_checkpoint_of_another_sweep_is_refused_with_the_difference(self, config, half_done, capsys):
        text = config.read_text().replace("mu_k: 0.3", "mu_k: 0.31")
        other = half_done.with_name("other.yaml")
        other.write_text(text)
        before = tasks_of(half_done)
        assert cli.main(["run", str(other), "-o", str(half_done)]) == 2
        message = capsys.readouterr().err
        assert "scene.friction.rough.mu_k was 0.3, is 0.31" in message
        assert "--fresh" in message
        assert tasks_of(half_done) == before

    def test_checkpoint_of_another_version_is_refused(self, config, half_done, monkeypatch):
        now = identity(load(config)) | {"numba": "99.0"}
        monkeypatch.setattr("ringsweep.runs.sweep.identity", lambda _: now)
        refused(r"numba was .*, is 99\.0", ringsweep.run, config, half_done, progress=False)

    def test_fresh_discards_the_checkpoint(self, config, half_done, never_stopped):
        damaged = tasks_of(half_done)[0]
        damaged.write_bytes(b"")
        ringsweep.run(config, half_done, fresh=True, progress=False).close()
        assert same_bits(half_done, never_stopped)

    @pytest.mark.parametrize("damage", ["truncated", "empty", "one bit", "directory", "of another sweep", "no archive"])
    def test_damaged_or_foreign_task_file_is_computed_again(self, config, half_done, never_stopped, caplog, damage):
        path = tasks_of(half_done)[4]
        content = bytearray(path.read_bytes())
        if damage == "of another sweep":
            with open_checkpoint(half_done.with_name("b.nc"), {"a": "b"}, Layout([72])) as others:
                others.put(np.arange(3), {"regime": np.zeros(3, dtype="int8")}, "none")
                path = path.with_name(next(iter(others.files)).name)
                shutil.copy(next(iter(others.files)), path)
        else:
            with np.load(path) as members:
                content[content.index(members["cells"].tobytes())] ^= 4
            changed = bytearray(path.read_bytes())
            # The directory of an archive, which has the names of its members, has no checksum.
            changed[changed.rindex(b"cells.npy")] ^= 1
            cut = {
                "truncated": content[:-200],
                "empty": b"",
                "one bit": content,
                "directory": changed,
                "no archive": b"a",
            }
            path.write_bytes(cut[damage])
        ringsweep.run(config, half_done, progress=False).close()
        assert f"{path} is {'not of this sweep' if damage == 'of another sweep' else 'damaged'}" in caplog.text
        assert "the cells are computed again" in caplog.text
        assert same_bits(half_done, never_stopped)

    @pytest.mark.slow
    @pytest.mark.parametrize("text", ["", "[1]", "5", "null", '{"scene.model": 1}', "\xff"])
    def test_sweep_continues_with_a_damaged_manifest(self, config, half_done, never_stopped, text):
        half_done.with_name("out.nc.partial").joinpath("sweep.json").write_bytes(text.encode("latin-1"))
        ringsweep.run(config, half_done, progress=False).close()
        assert same_bits(half_done, never_stopped)

    def test_task_files_that_vanish_before_the_merge_are_computed_again(
        self, config, half_done, never_stopped, monkeypatch, caplog
    ):
        merge = netcdf.save

        def vanish(*arguments, **options):
            monkeypatch.setattr(netcdf, "save", merge)
            for path in tasks_of(half_done)[:3]:
                path.unlink()
            merge(*arguments, **options)

        monkeypatch.setattr(netcdf, "save", vanish)
        ringsweep.run(config, half_done, progress=False).close()
        assert "the missing cells are computed again" in caplog.text
        assert same_bits(half_done, never_stopped)

    def test_second_process_on_the_same_output_is_refused(self, config, tmp_path, capsys):
        target = tmp_path / "out.nc"
        loaded = load(config)
        with open_checkpoint(target, identity(loaded), Layout([9, 8])):
            assert cli.main(["run", str(config), "-o", str(target)]) == 2
        assert "another ringsweep is computing it" in capsys.readouterr().err
        assert left(target) == []

    def test_finished_sweep_is_neither_computed_again_nor_replaced_by_another(self, config, never_stopped, tmp_path):
        target = tmp_path / "out.nc"
        shutil.copy(never_stopped, target)
        assert not write(load(config), target, Execution(progress=False))
        other = load(config, ["time.span=3 s"])
        with pytest.raises(ringsweep.InputError, match=r"another sweep: scene\.time\.span was 4\.0, is 3\.0.*--fresh"):
            write(other, target, Execution(progress=False))
        assert same_bits(target, never_stopped)
        assert write(other, target, Execution(progress=False), fresh=True)
        assert float(netcdf.load(target).t_end.max()) <= 3.0

    def test_damaged_file_does_not_count_as_a_finished_sweep(self, config, tmp_path, monkeypatch, capsys):
        """Damage to the compressed values of a large file, which opening it does not read."""
        target = tmp_path / "out.nc"
        monkeypatch.setattr(netcdf, "COMPRESSED_FROM", 1)
        command = ["run", str(config), "-o", str(target)]
        assert cli.main(command) == 0
        with netCDF4.Dataset(target, "r+") as file:
            file["phi_end"][0, 0] += 1e-9
        assert cli.main(command) == 2
        out, message = capsys.readouterr()
        assert "already" not in out
        assert "out.nc: no seal: another program or an older version wrote it" in message
        assert message.endswith("--fresh (in Python fresh=True) computes it again\n")
        assert cli.main([*command, "--fresh"]) == 0
        assert netcdf.check(target)

    def test_sweep_begun_with_fresh_goes_on_beside_the_one_that_it_replaces(
        self, config, half_done, never_stopped, caplog
    ):
        """Without --fresh, as the message of the interruption says."""
        ringsweep.run({"scene": load(config).source["scene"]}, half_done.with_name("b.nc"), progress=False).close()
        half_done.with_name("b.nc").rename(half_done)
        ringsweep.run(config, half_done, progress=False).close()
        assert "out.nc is replaced when this sweep is done" in caplog.text
        assert same_bits(half_done, never_stopped)

    def test_finished_sweep_is_told_beside_cells_of_the_sweep_replacing_it(
        self, config, half_done, never_stopped, capsys
    ):
        kept = tasks_of(half_done)
        other = yaml.safe_load(config.read_text()) | {"solver": {"method": "event", "max_steps": 5000}}
        other = config.with_name("other.yaml"), yaml.safe_dump(other)
        other[0].write_text(other[1])
        ringsweep.run(other[0], half_done.with_name("b.nc"), progress=False).close()
        half_done.with_name("b.nc").rename(half_done)
        assert cli.main(["run", str(other[0]), "-o", str(half_done)]) == 0
        assert "already" in capsys.readouterr().out
        assert tasks_of(half_done) == kept
        half_done.unlink()
        assert cli.main(["run", str(other[0]), "-o", str(half_done)]) == 2
        assert "out.nc.partial: holds finished cells of another sweep" in capsys.readouterr().err

    def test_differences_are_told_without_digests(self, config):
        one = load(config)
        other = load({**one.source, "sweep": {"grid": {"drive.amplitude": {"linspace": [0.5, 8.0, 9]}}}})
        same_ends = load({**one.source, "sweep": {"grid": {"drive.amplitude": {"geomspace": [0.5, 8.0, 9]}}}})
        told = differences(identity(one) | {"sources": "0" * 64}, identity(other))
        assert "the source code of ringsweep has changed" in told
        told += differences(identity(other), identity(same_ends))
        assert "sweep.drive.amplitude has other values (9 values, 0.5 to 8" in told
        assert not re.search(r"\([0-9a-f]{12}\)|[0-9a-f]{32}", told)


class TestFullDisk:
    @pytest.mark.parametrize("name", ["fsync", "replace"])
    def test_full_disk_gives_one_message_and_no_incomplete_file(
        self, config, never_stopped, tmp_path, monkeypatch, capsys, name
    ):
        target = tmp_path / "out.nc"
        calls = iter(range(5))
        function = getattr(os, name)

        def full(*args, **kwargs):
            if next(calls, None) is None:
                raise OSError(errno.ENOSPC, "No space left on device")
            return function(*args, **kwargs)

        with monkeypatch.context() as patch:
            patch.setattr(TaskSizes, "max_cells", 3)
            patch.setattr(f"os.{name}", full)
            assert cli.main(["run", str(config), "-o", str(target)]) == 1
        message = capsys.readouterr().err.splitlines()[-1]
        assert "No space left on device" in message
        assert "out.nc.partial" in message
        assert "the same command goes on" in message
        assert left(target) == ["out.nc.partial"]
        assert not list(target.with_name("out.nc.partial").glob("*.tmp"))
        assert cli.main(["run", str(config), "-o", str(target)]) == 0
        assert same_bits(target, never_stopped)


class TestOnlyTask:
    """A sweep of one task writes its cells once."""

    def test_cells_of_the_only_task_are_in_no_file_but_that_of_the_sweep(self, scene, tmp_path, monkeypatch):
        write, written = WorkingFolder.write, []
        monkeypatch.setattr(WorkingFolder, "write", lambda self, *file: (written.append(file[0]), write(self, *file)))
        found = ringsweep.run({"scene": scene}, tmp_path / "one.nc", progress=False)
        assert written == [MANIFEST]
        assert found.regime.item() == ringsweep.run({"scene": scene}, progress=False).regime.item()

    def test_only_task_is_kept_if_the_file_of_the_sweep_cannot_be_written(self, scene, tmp_path, monkeypatch):
        target = tmp_path / "out.nc"
        with stopping(monkeypatch, netcdf, "save", 0), pytest.raises(Stopped) as stopped:
            ringsweep.run({"scene": scene}, target, progress=False)
        assert "1 of 1 cells are kept" in stopped.value.__notes__[0]
        assert len(tasks_of(target)) == 1
        monkeypatch.setattr(Checkpoint, "put", lambda *_: pytest.fail("computed again"))
        ringsweep.run({"scene": scene}, target, progress=False).close()
        assert left(target) == ["out.nc"]


class TestResultFile:
    def test_file_equals_the_sweep_in_memory(self, config, never_stopped):
        undated = {"date_created": "", "history": ""}
        in_memory = ringsweep.run(config, progress=False)
        xr.testing.assert_identical(netcdf.load(never_stopped).assign_attrs(undated), in_memory.assign_attrs(undated))

    def test_file_is_enough_to_repeat_its_sweep(self, never_stopped, tmp_path, monkeypatch, capsys):
        monkeypatch.chdir(tmp_path)
        again = tmp_path / "again.nc"
        assert cli.main(["run", str(never_stopped), "-o", str(again)]) == 0
        assert same_bits(again, never_stopped)
        attributes = netcdf.load(again).attrs
        for name in ("versions", "platform", "processors", "solver", "configuration", "date_created"):
            assert attributes[name]
        solver = json.loads(attributes["solver"])
        assert solver["method"] == "event"
        assert solver["rtol"] == 1e-10
        assert cli.main(["run", str(again)]) == 0
        assert "holds this sweep already" in capsys.readouterr().out

    def test_file_with_shared_dimensions_is_repeated_with_them(self, scene, tmp_path, caplog):
        """A configuration cannot name shared dimensions; the coordinates of the file do."""
        axes = {
            "drive.amplitude": xr.DataArray([[0.5, 1.0], [2.0, 8.0]], dims=("i", "j")),
            "body.mass": xr.DataArray([0.05, 0.06], dims="j"),
            "friction.law": ["tustin", "stiction"],
        }
        scene = scene | {"friction": scene["friction"] | {"alpha": 10.0}}
        one, two = tmp_path / "one.nc", tmp_path / "two.nc"
        ringsweep.sweep(scene, axes, one, progress=False).close()
        ringsweep.run(one, two, progress=False).close()
        assert same_bits(one, two)
        assert not write(load(two), one, Execution(progress=False))
        assert "replaced" not in caplog.text
