"""Compilation: fallbacks on Numba's public interfaces, and the digest of sources in the key of the cache."""

import ast
import os
import shutil
from pathlib import Path
from types import FunctionType
from typing import NamedTuple

import numba
import numpy as np
import pytest
from numba.core import caching
from numba.core.codegen import JITCPUCodegen
from numba.core.errors import NumbaError, UnsupportedBytecodeError

import ringsweep
from ringsweep.compile import cache, feature, numba_private, readable_compile_errors, take
from ringsweep.compile.cache import IN_KERNELS, sources_digest
from ringsweep.errors import InputError

PACKAGE = Path(ringsweep.__file__).parent


@pytest.fixture
def package(tmp_path):
    """Copy of the package's sources."""
    return shutil.copytree(PACKAGE, tmp_path / "ringsweep", ignore=shutil.ignore_patterns("__pycache__", "*.nb*"))


def edited(path):
    """Append a comment to a file."""
    path.write_text(path.read_text(encoding="utf-8") + "\n# An edit.\n", encoding="utf-8")


class Spring(NamedTuple):
    stiffness: float


def test_an_array_that_stands_in_a_batch_twice_stays_one_in_some_cells():
    stiffness = np.arange(6.0).reshape(3, 2)
    one, (other,) = take((Spring(stiffness), (Spring(stiffness),)), np.array([0, 2]))
    assert one.stiffness is other.stiffness
    np.testing.assert_array_equal(one.stiffness, stiffness[[0, 2]])


class Rope(NamedTuple):
    length: float


@feature("-x", of=Spring)
def pull(part, x):
    return -part.stiffness * x


@feature("_WITHOUT", absorb=True)
def pull_if_there(part, x):
    return -part.stiffness * x


_WITHOUT = 0.0


@pytest.mark.parametrize(
    ("call", "part", "expected"),
    [(pull, Spring(3.0), -6.0), (pull, Rope(1.0), -2.0), (pull_if_there, Spring(3.0), -6.0), (pull_if_there, (), 0.0)],
)
def test_formula_of_a_feature_is_not_compiled_where_it_is_missing(call, part, expected):
    """Neither a rope nor an empty tuple has a stiffness: a kernel with the formula would not compile."""
    in_kernel = numba.njit(lambda part, x: call(part, x))
    assert call(part, 2.0) == in_kernel(part, 2.0) == expected


@pytest.mark.parametrize(
    ("results", "kernels", "files"),
    [
        (False, False, ("plots/maps.py", "cli/entry.py", "config/axes.py", "storage/netcdf.py")),
        (True, False, ("quantities/variables.py", "quantities/units.py", "quantities/quantity.py")),
        (True, True, ("quantities/flags.py", "quantities/parameters.py", "numerics/series.py", "solvers/rk4.py")),
        (True, True, ("compile/options.py", "models/model.py", "physics/drives.py")),
    ],
    ids=["neither", "results", "kernels", "more kernels"],
)
def test_edit_changes_the_digests_of_what_depends_on_it(package, results, kernels, files):
    """An edit of names and units keeps the compiled kernels, and one of pictures or files keeps the results too."""
    for name in files:
        before = sources_digest(package), sources_digest(package, places=IN_KERNELS)
        edited(package / name)
        after = sources_digest(package), sources_digest(package, places=IN_KERNELS)
        assert [one != other for one, other in zip(before, after, strict=True)] == [results, kernels], name


def test_kernels_take_nothing_but_flags_and_declarations_from_quantities():
    """Names, units and messages are no numbers of a kernel."""
    declarations = {"Key", "Leaf", "MASSES", "OUTCOMES", "Parameter", "Variable", "declared", "show"}
    for folder in ("compile", "numerics", "physics", "models", "solvers"):
        for path in (PACKAGE / folder).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Import):
                    assert not any(name.name.startswith("ringsweep.quantities") for name in node.names), path
                if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("ringsweep.quantities"):
                    taken = {name.name for name in node.names}
                    assert node.module == "ringsweep.quantities.flags" or taken <= declarations, path


def test_pipe_in_place_of_an_own_file_is_refused_before_it_is_waited_for(package, tmp_path):
    os.mkfifo(tmp_path / "own.py")
    with pytest.raises(InputError, match=r"own\.py is not a file"):
        sources_digest(package, [tmp_path / "own.py"])


@pytest.mark.parametrize("text", ["", "# A law."])
def test_own_file_changes_the_digest_of_sources_by_its_content(package, tmp_path, text):
    own = tmp_path / "own.py"
    own.write_text("# Another law.")
    other = sources_digest(package, [own])
    own.write_text(text)
    assert sources_digest(package, [own]) != other


@pytest.mark.parametrize("error", [NumbaError("a\n" * 5000), UnsupportedBytecodeError("op code\n" * 5000)])
def test_failure_of_numba_in_the_package_itself_is_told_in_short(error, monkeypatch):
    def failing():
        raise error

    # Numba also raises errors that are not of its own class.
    failing = FunctionType(failing.__code__, {"__name__": "numba.core.compiler"}, closure=failing.__closure__)
    message = r"^ringsweep does not compile with numba [0-9.]+: (a|op code)$"
    with pytest.raises(RuntimeError, match=message), readable_compile_errors():
        failing()


def test_errors_of_python_are_not_taken_for_those_of_numba():
    with pytest.raises(ZeroDivisionError), readable_compile_errors():
        raise ZeroDivisionError


class TestCacheOnDisk:
    @pytest.fixture
    def folder(self, tmp_path, monkeypatch, caplog):
        """An empty cache, and a process that has told nothing of its cache yet."""
        caplog.set_level("INFO", logger="ringsweep")
        monkeypatch.setattr(caching.config, "CACHE_DIR", str(tmp_path))
        for told in (cache._announce_compilation, numba_private._warn_of_no_cache):
            told.cache_clear()
        return tmp_path

    @staticmethod
    def doubled():
        """What a kernel returns that is new in each call, as in a new process."""

        def double(x):
            return 2.0 * x

        return cache.kernel(double)(np.float64(21.0))

    @staticmethod
    def again(caplog):
        """Whether something is compiled from here on, as a function."""
        cache._announce_compilation.cache_clear()
        caplog.clear()
        return lambda: [message.partition(" ")[0] for message in caplog.messages] == ["compiling"]

    @pytest.mark.parametrize("damage", ["truncated", "empty", "one bit", "other content"])
    def test_damaged_file_is_compiled_again_and_replaced(self, folder, caplog, damage):
        self.doubled()
        (file,) = folder.rglob("*.nbc")
        content = bytearray(file.read_bytes())
        content[len(content) // 2] ^= 1
        file.write_bytes({"truncated": content[:40], "empty": b"", "one bit": content}.get(damage, b"cos\nsystem\n."))
        compiled = self.again(caplog)
        assert self.doubled() == 42.0
        assert compiled()
        compiled = self.again(caplog)
        assert self.doubled() == 42.0
        assert not compiled()

    def test_code_of_another_kernel_is_compiled_again(self, folder, caplog):
        """Whoever copies files of a cache may give one the name of another."""

        def kernels():
            def double(x):
                return 2.0 * x

            def triple(x):
                return 3.0 * x

            return [cache.kernel(function)(np.float64(2.0)) for function in (double, triple)]

        assert kernels() == [4.0, 6.0]
        one, other = sorted(folder.rglob("*.nbc"))
        other.write_bytes(one.read_bytes())
        compiled = self.again(caplog)
        assert kernels() == [4.0, 6.0]
        assert compiled()

    @pytest.mark.parametrize(
        ("owner", "name", "value"),
        [
            (cache, "_KERNELS_DIGEST", "f" * 64),
            (JITCPUCodegen, "magic_tuple", lambda codegen: ("x86_64", "any", "-fma")),
        ],
        ids=["sources", "processor"],
    )
    def test_code_of_other_sources_or_processors_is_kept_beside(self, folder, caplog, monkeypatch, owner, name, value):
        self.doubled()
        monkeypatch.setattr(owner, name, value)
        compiled = self.again(caplog)
        assert self.doubled() == 42.0
        assert compiled()
        assert len(list(folder.rglob("*.nbc"))) == 2

    def test_code_of_other_sources_is_removed_after_a_day(self, folder, monkeypatch):
        self.doubled()
        (old,) = folder.rglob("*.nbc")
        os.utime(old, (0, 0))
        own = old.with_name("mine.nbi")
        own.touch()
        monkeypatch.setattr(cache, "_KERNELS_DIGEST", "f" * 64)
        self.doubled()
        assert not old.exists()
        assert own.exists(), "it is not old"

    def test_file_that_cannot_be_read_is_compiled_again(self, folder, caplog, monkeypatch):
        """Another user may own it."""
        self.doubled()

        def refused(path):
            raise PermissionError(13, "Permission denied")

        monkeypatch.setattr(Path, "read_bytes", refused)
        compiled = self.again(caplog)
        assert self.doubled() == 42.0
        assert compiled()

    def test_cache_that_takes_no_file_is_told_once(self, folder, caplog, monkeypatch):
        def refused(*arguments):
            raise OSError(28, "No space left on device")

        monkeypatch.setattr(os, "replace", refused)
        assert self.doubled() == self.doubled() == 42.0
        assert [message.partition(" ")[0] for message in caplog.messages] == ["compiling", "compiled"]
        assert "No space left on device): each process compiles its own" in caplog.text
        assert not list(folder.rglob("*.nb*"))

    def test_compilation_without_a_writable_folder_is_announced(self, folder, caplog, monkeypatch):
        def refused(locator):
            raise PermissionError(13, "Permission denied")

        monkeypatch.setattr(caching._CacheLocator, "ensure_cache_path", refused)
        assert self.doubled() == 42.0
        assert [message.partition(" ")[0] for message in caplog.messages] == ["compiling", "compiled"]
        assert "NUMBA_CACHE_DIR" in caplog.text
