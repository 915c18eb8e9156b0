"""The folder beside a file that is written: who may use it, what is removed from it, and what a power cut leaves."""

import errno
import os
import signal
import stat
import subprocess
import sys

import numpy as np
import pytest
import yaml

import ringsweep
from ringsweep import cli
from ringsweep.errors import InputError
from ringsweep.runs.task_sizes import TaskSizes
from ringsweep.storage import files
from ringsweep.storage.checkpoint import Checkpoint, open_checkpoint
from ringsweep.storage.chunks import Layout
from ringsweep.storage.files import replacing

CELLS = {"regime": np.zeros(3, dtype="int8")}


def put_cells(target):
    """Leave finished cells beside a file, as a sweep that was stopped does."""
    with open_checkpoint(target, {"a": "b"}, Layout([72])) as checkpoint:
        checkpoint.put(np.arange(3), CELLS, "none")
    return checkpoint.folder


@pytest.fixture
def config(scene, tmp_path):
    path = tmp_path / "sweep.yaml"
    path.write_text(yaml.safe_dump({"scene": scene, "sweep": {"grid": {"drive.amplitude": [0.5, 2.0, 8.0]}}}))
    return path


@pytest.fixture
def precious(tmp_path):
    """A folder of the user with names that end as those of this package do."""
    folder = tmp_path / "precious"
    folder.mkdir()
    for name in ("letter.tmp", "data.npz", "lock"):
        (folder / name).write_text("precious")
    return folder


def assert_untouched(folder):
    assert {path.name: path.read_text() for path in folder.iterdir()} == dict.fromkeys(
        ("letter.tmp", "data.npz", "lock"), "precious"
    )


class TestForeignFolder:
    def test_link_in_place_of_the_folder_is_refused_and_its_target_stays(self, config, precious, capsys):
        target = config.with_name("out.nc")
        target.with_name("out.nc.partial").symlink_to(precious)
        for fresh in ([], ["--fresh"]):
            assert cli.main(["run", str(config), "-o", str(target), *fresh]) == 2
            assert "out.nc.partial, but it is a symbolic link: remove it" in capsys.readouterr().err
        assert_untouched(precious)

    def test_folder_of_the_user_is_refused_and_untouched(self, config, precious, capsys):
        target = config.with_name("out.nc")
        precious = precious.rename(target.with_name("out.nc.partial"))
        assert cli.main(["run", str(config), "-o", str(target), "--fresh"]) == 2
        assert "it is not of ringsweep: it holds data.npz" in capsys.readouterr().err
        assert_untouched(precious)

    @pytest.mark.parametrize("name", ["lock", "sweep.json", "0123abcd.tmp"])
    def test_link_in_the_folder_is_refused_and_its_target_is_untouched(self, tmp_path, precious, name):
        folder = put_cells(tmp_path / "out.nc")
        (folder / name).unlink(missing_ok=True)
        (folder / name).symlink_to(precious / "letter.tmp")
        with pytest.raises(InputError, match=f"{name} in it is a link or no file"):
            put_cells(tmp_path / "out.nc")
        assert_untouched(precious)

    def test_only_own_names_are_deleted_from_a_folder_of_this_package(self, tmp_path):
        folder = put_cells(tmp_path / "out.nc")
        (folder / "0123abcd.tmp").touch()
        (folder / "letter.tmp").write_text("precious")
        (folder / "data.npz").write_text("precious")
        with open_checkpoint(tmp_path / "out.nc", {"a": "b"}, Layout([72]), fresh=True):
            assert sorted(os.listdir(folder)) == ["data.npz", "letter.tmp", "lock", "sweep.json"]
        assert sorted(os.listdir(folder)) == ["data.npz", "letter.tmp"]


class TestPermissions:
    @pytest.fixture(autouse=True)
    def usual_umask(self):
        before = os.umask(0o022)
        yield
        os.umask(before)

    def test_cells_and_new_file_are_as_private_as_the_file_that_is_replaced(self, config):
        target = config.with_name("out.nc")
        ringsweep.run(config, target, progress=False).close()
        assert stat.S_IMODE(target.stat().st_mode) == 0o644
        target.chmod(0o600)
        with open_checkpoint(target, {"a": "b"}, Layout([72])) as checkpoint:
            assert stat.S_IMODE(checkpoint.folder.stat().st_mode) == 0o700
        ringsweep.run(config, target, fresh=True, progress=False).close()
        assert stat.S_IMODE(target.stat().st_mode) == 0o600

    def test_folder_of_an_earlier_run_becomes_as_private_as_the_file(self, tmp_path):
        target = tmp_path / "out.nc"
        folder = put_cells(target)
        assert stat.S_IMODE(folder.stat().st_mode) == 0o755
        target.touch()
        target.chmod(0o640)
        put_cells(target)
        assert stat.S_IMODE(folder.stat().st_mode) == 0o750


class TestKilledWriter:
    def test_next_writer_removes_what_a_killed_one_left(self, tmp_path):
        target = tmp_path / "run.nc"
        program = (
            "import os, sys\n"
            "from ringsweep.storage.files import replacing\n"
            "with replacing(sys.argv[1]) as temporary:\n"
            "    temporary.write_bytes(b'half a fi')\n"
            f"    os.kill(os.getpid(), {signal.SIGKILL})\n"
        )
        assert subprocess.run([sys.executable, "-c", program, str(target)], check=False).returncode == -signal.SIGKILL
        (left,) = (tmp_path / "run.nc.partial").glob("*.tmp.nc")
        with replacing(target) as temporary:
            assert not left.exists()
            temporary.write_bytes(b"whole")
        assert os.listdir(tmp_path) == ["run.nc"]

    def test_file_of_a_living_writer_is_not_removed(self, tmp_path, monkeypatch):
        monkeypatch.setattr(files, "_PATIENCE", 0.0)
        with replacing(tmp_path / "run.nc") as temporary:
            temporary.write_bytes(b"first")
            with pytest.raises(InputError, match="another ringsweep"), replacing(tmp_path / "run.nc"):
                pass
        assert (tmp_path / "run.nc").read_bytes() == b"first"
        assert os.listdir(tmp_path) == ["run.nc"]

    def test_history_beside_unfinished_cells_keeps_them(self, tmp_path):
        folder = put_cells(tmp_path / "out.nc")
        before = sorted(os.listdir(folder))
        with replacing(tmp_path / "out.nc") as temporary:
            temporary.touch()
        assert sorted(os.listdir(folder)) == before


def refusing(number):
    """A lock that a file system refuses with an error of this number."""

    def lock(descriptor):
        raise OSError(number, os.strerror(number))

    return lock


class TestLocks:
    @pytest.mark.parametrize("number", [errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP])
    def test_file_system_without_locks_is_told_and_used(self, tmp_path, monkeypatch, caplog, number):
        monkeypatch.setattr(files, "_lock", refusing(number))
        with replacing(tmp_path / "run.nc") as temporary:
            temporary.touch()
        assert os.listdir(tmp_path) == ["run.nc"]
        assert "this file system has no locks" in caplog.text

    @pytest.mark.parametrize("number", [errno.EACCES, errno.EAGAIN])
    def test_lock_of_another_process_is_told(self, tmp_path, monkeypatch, number):
        monkeypatch.setattr(files, "_lock", refusing(number))
        with pytest.raises(InputError, match="another ringsweep"), files.working_folder(tmp_path / "run.nc"):
            pass

    @pytest.mark.parametrize("content", ["", "4", "1234\nanother-machine\n"])
    def test_file_of_a_lock_that_nobody_holds_locks_nothing(self, tmp_path, content):
        folder = tmp_path / "run.nc.partial"
        folder.mkdir()
        (folder / "lock").write_text(content)
        with replacing(tmp_path / "run.nc") as temporary:
            temporary.touch()
        assert os.listdir(tmp_path) == ["run.nc"]

    def test_lock_that_another_process_removes_meanwhile_is_taken_again(self, tmp_path, monkeypatch):
        lock, removals = files._lock, iter([True])

        def late(descriptor):
            if next(removals, False):
                (tmp_path / "run.nc.partial" / "lock").unlink()
            lock(descriptor)

        monkeypatch.setattr(files, "_lock", late)
        with files.working_folder(tmp_path / "run.nc") as folder:
            assert folder.is_own()


def test_full_disk_leaves_no_part_of_a_first_configuration(tmp_path, monkeypatch, capsys):
    def full(path, text, **_):
        path.write_bytes(text.encode()[:10])
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("pathlib.Path.write_text", full)
    monkeypatch.chdir(tmp_path)
    assert cli.main(["init", "my.yaml"]) == 2
    assert "my.yaml: cannot be written: No space left on device" in capsys.readouterr().err
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("method", ["put", "chunks"])
def test_folder_that_is_deleted_while_a_sweep_runs_is_named_as_the_cause(config, monkeypatch, capsys, method):
    target = config.with_name("out.nc")
    own = getattr(Checkpoint, method)

    def delete(self, *arguments):
        for path in self.folder.iterdir():
            path.unlink()
        self.folder.rmdir()
        return own(self, *arguments)

    with monkeypatch.context() as patch:
        patch.setattr(Checkpoint, method, delete)
        assert cli.main(["run", str(config), "-o", str(target)]) == 1
    message = capsys.readouterr().err
    assert "out.nc.partial was deleted while this process used it" in message
    assert "is the disk full" not in message
    assert cli.main(["run", str(config), "-o", str(target)]) == 0


def test_names_are_on_the_disk_before_what_relies_on_them(config, monkeypatch):
    """A power cut must not undo the renaming of a task file, nor that of the result before the task files are gone."""
    monkeypatch.setattr(TaskSizes, "next", lambda self, left: 2)
    ringsweep.run(config, config.with_name("compiled.nc"), progress=False).close()
    done = []

    def record(name, shown):
        call = getattr(os, name)

        def recording(path, *others):
            if isinstance(path, int) or os.path.exists(path):
                done.append(shown(path, *others))
            return call(path, *others)

        monkeypatch.setattr(os, name, recording)

    def kind(path):
        name = os.path.basename(path)
        return name if name.startswith(("out.nc", "sweep.json")) else "folder" if name == config.parent.name else "it"

    record("fsync", lambda file: f"flush {kind(os.readlink(f'/proc/self/fd/{file}'))}")
    record("replace", lambda old, new: f"rename to {kind(new)}")
    record("unlink", lambda path: f"delete {kind(path)}")
    ringsweep.run(config, config.with_name("out.nc"), progress=False).close()
    deleted = [step for step in done if step.startswith("delete")]
    assert done[: -len(deleted)] == [
        "flush folder",
        *("flush it", "rename to sweep.json", "flush out.nc.partial"),
        *(2 * ["flush it", "rename to it", "flush out.nc.partial"]),
        *("flush it", "rename to out.nc", "flush folder"),
    ]
    assert sorted(deleted) == ["delete it", "delete it", "delete it", "delete sweep.json"]


@pytest.mark.slow
@pytest.mark.parametrize("command", ["run", "simulate"])
def test_name_that_the_locale_cannot_write_is_told_before_the_first_cell(config, command):
    bare = {name: value for name, value in os.environ.items() if not name.startswith(("LC_", "LANG"))}
    found = subprocess.run(
        [sys.executable, "-m", "ringsweep", "--verbose", command, str(config), "-o", str(config.with_name("méta.nc"))],
        env=bare | {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
        capture_output=True,
        check=False,
    )
    (line,) = found.stderr.decode().splitlines()
    assert found.returncode == 2
    assert r"m\xe9ta.nc: the name" in line
    assert "set LC_ALL=C.UTF-8 or PYTHONUTF8=1" in line
    assert os.listdir(config.parent) == ["sweep.yaml"]


def test_name_with_control_characters_is_refused_and_shown_escaped():
    with pytest.raises(InputError) as refused:
        files.check_writable("red\x1b[31m\nx.nc")
    assert str(refused.value) == r"red\x1b[31m\nx.nc: the name has control characters: choose another one"
