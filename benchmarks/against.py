"""The working tree against the fastest earlier tree: the same calls in turn, and which are slower.

    python -m benchmarks.against            # against the commits in best.txt: ten minutes, and more the first time
    python -m benchmarks.against COMMIT     # against another commit
    python -m benchmarks.against --only event impact    # rows whose names contain one of these

Each tree is installed in a virtual environment of its own, in `build/against`, with the same versions of what it needs.
Its calls run in one process for each tree, on one job, compiled before: `benchmarks/rows.py` lists them. Rows of
start-up are new processes. Both trees run in turn within each round.

A ratio is the time of the working tree divided by that of the other: the median over the rounds. Its interval is that
from the second smallest to the second largest of nine ratios, which holds the median in 96 of 100 cases. A row is
slower if the whole interval lies above 1.03; a row of start-up above 1.10. *A step* is the ratio of the times of a
step, for rows in which the trees take different numbers of steps. All rounds of a row are in one pair of processes, and
pairs differ by up to 4 %, which no interval shows: measure a row that is slower again, with --only.

`best.txt` names the fastest tree on its first line. A row that this tree lacks is compared with the tree on the next
line. Exit status 1: a row is slower.
"""

from __future__ import annotations

import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median
from threading import Thread
from typing import Any, NamedTuple

from benchmarks._common import command, machine, publish, shown
from benchmarks.rows import ROWS

ROOT = Path(__file__).parent.parent
FOLDER = ROOT / "build" / "against"
BEST = Path(__file__).with_name("best.txt")
CONFIG = ROOT / "configs" / "regime_map.yaml"

#: Largest ratio that is not slower: of calls, and of start-up, which may pay for a library.
LIMIT, START_UP_LIMIT = 1.03, 1.10


class Tree:
    """A tree of the package in an environment of its own, and a process that runs its calls.

    Parameters
    ----------
    commit : str or None
        A commit; None for the working tree.
    """

    def __init__(self, commit: str | None) -> None:
        self.name = "the working tree" if commit is None else commit
        self.folder = FOLDER / (commit or "work")
        self.python = self.folder / "venv" / "bin" / "python"
        self.cache = self.folder / "cache"
        self._install(commit)
        self._process: subprocess.Popen[str] | None = None

    def _install(self, commit: str | None) -> None:
        done = self.folder / "installed"
        if commit is not None and done.exists():
            return
        print(f"installing {self.name}", flush=True)
        if not self.python.exists():
            subprocess.run([sys.executable, "-m", "venv", self.folder / "venv"], check=True)
        with tempfile.TemporaryDirectory() as source:
            if commit is None:
                for name in ("pyproject.toml", "README.md", "LICENSE", "ringsweep"):
                    copy: Callable[..., Any] = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
                    copy(ROOT / name, Path(source, name))
            else:
                archive = subprocess.run(["git", "archive", commit], cwd=ROOT, check=True, stdout=subprocess.PIPE)
                subprocess.run(["tar", "-x", "-C", source], input=archive.stdout, check=True)
            pip = [self.python, "-m", "pip", "install", "--quiet"]
            if done.exists():
                subprocess.run([*pip, "--force-reinstall", "--no-deps", source], check=True)
            else:
                freeze = [sys.executable, "-m", "pip", "freeze", "--exclude", "ringsweep", "--exclude-editable"]
                held = self.folder / "versions.txt"
                held.write_bytes(subprocess.run(freeze, check=True, stdout=subprocess.PIPE).stdout)
                subprocess.run([*pip, "--constraint", held, source], check=True)
        done.touch()

    def environment(self, cache: Path | None = None) -> dict[str, str]:
        """Environment of a process of this tree, with a folder for compiled code."""
        return {**os.environ, "NUMBA_CACHE_DIR": str(cache or self.cache), "PYTHONPATH": ""}

    def ask(self, name: str, size: int) -> dict[str, Any]:
        """Seconds and steps of a call, or an error; the first call compiles it."""
        if self._process is None:
            line = [self.python, Path(__file__).with_name("rows.py")]
            self._process = subprocess.Popen(
                line, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
                env=self.environment(), cwd=self.folder,
            )  # fmt: skip
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        print(json.dumps([name, size]), file=process.stdin, flush=True)
        answer = process.stdout.readline()
        if not answer:
            self._process = None
            return {"error": "the process ended"}
        found: dict[str, Any] = json.loads(answer)
        return found

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._process.communicate()


class Row(NamedTuple):
    """A row of the table: its name, what is compared, and times in each round, s, new and old."""

    name: str
    old: str
    new_seconds: list[float]
    old_seconds: list[float]
    limit: float
    steps: float
    """Steps of the new tree for each step of the old one."""

    @property
    def ratios(self) -> list[float]:
        """Ratio in each round, in ascending order."""
        return sorted(new / old for new, old in zip(self.new_seconds, self.old_seconds, strict=True))

    @property
    def interval(self) -> tuple[float, float]:
        """Interval of the median ratio."""
        beyond = 1 if len(self.ratios) >= 5 else 0
        return self.ratios[beyond], self.ratios[-1 - beyond]

    @property
    def slower(self) -> bool:
        """Whether the new tree is slower beyond the scatter."""
        return self.interval[0] > self.limit

    def cells(self) -> list[str]:
        """Texts of the table."""
        low, high = self.interval
        step = f"{median(self.ratios) / self.steps:.2f}" if abs(self.steps - 1.0) > 0.005 else ""
        return [
            self.name, self.old, f"{1e3 * median(self.old_seconds):.4g} ms", f"{1e3 * median(self.new_seconds):.4g} ms",
            f"{median(self.ratios):.2f}", f"{low:.2f} to {high:.2f}", step, "slower" if self.slower else "",
        ]  # fmt: skip


HEADER = ["row", "against", "old", "new", "new / old", "interval", "a step", ""]


# ---- calls ------------------------------------------------------------------------------------


def calls(new: Tree, others: Sequence[Tree], names: Sequence[str], rounds: int, quick: bool) -> Iterator[Row]:
    """Rows of calls, each against the first of the other trees that has it."""
    for name in names:
        sizes = ROWS[name][1][:1] if quick else ROWS[name][1]
        old = _compiled(new, others, name, sizes)
        if old is None:
            print(f"{name}: no earlier tree has it", flush=True)
            continue
        before: Row | None = None
        for size in sizes:
            times: tuple[list[float], list[float]] = ([], [])
            steps = [0.0, 0.0]
            for k in range(rounds):
                for i in (0, 1) if k % 2 else (1, 0):
                    answer = (new, old)[i].ask(name, size)
                    if "error" in answer:
                        raise SystemExit(f"{(new, old)[i].name}: {name}, {size} cells: {answer['error']}")
                    times[i].append(answer["seconds"])
                    steps[i] = answer["steps"] or 1.0
            label = name if len(ROWS[name][1]) == 1 else f"{name}, {size} cells"
            row = Row(label, old.name, *times, LIMIT, steps[0] / steps[1])
            yield row
            if before is not None and size == sizes[-1]:
                more = [
                    [(a - b) / (size - sizes[-2]) for a, b in zip(large, small, strict=True)]
                    for large, small in zip(row[2:4], before[2:4], strict=True)
                ]
                yield Row(f"{name}, one more cell", old.name, *more, LIMIT, row.steps)
            before = row


def _compiled(new: Tree, others: Sequence[Tree], name: str, sizes: Sequence[int]) -> Tree | None:
    """The first of the other trees that has a row, after it is compiled in both."""

    def compile_all(tree: Tree) -> bool:
        return all("error" not in tree.ask(name, size) for size in sizes)

    # Both compile at the same time.
    beside = Thread(target=compile_all, args=(new,))
    beside.start()
    found = next((tree for tree in others if compile_all(tree)), None)
    beside.join()
    return found


# ---- start-up ---------------------------------------------------------------------------------


def start_up(new: Tree, old: Tree, only: Sequence[str], rounds: int) -> Iterator[Row]:
    """Rows of new processes: wall-clock time, and CPU seconds of the first cell with nothing compiled before."""
    # Earlier trees know only the older name of this section.
    config = FOLDER / CONFIG.name
    config.write_text(CONFIG.read_text().replace("elsewhere:", "rest:"))
    rows: dict[str, tuple[list[str], int]] = {
        "import": (["-c", "import ringsweep; ringsweep.sweep"], rounds),
        "--help": (["-m", "ringsweep", "--help"], rounds),
        "README's first command, warm": (["-m", "ringsweep", "run", str(config), "--fresh"], min(rounds, 5)),
        "first cell, nothing compiled": (["-c", FIRST_CELL], min(rounds, 3)),
    }  # fmt: skip
    for name, (options, count) in rows.items():
        if not any(word in name for word in only):
            continue
        cold = "nothing compiled" in name
        times: tuple[list[float], list[float]] = ([], [])
        for k in range(count + (not cold)):
            for i in (0, 1) if k % 2 else (1, 0):
                seconds = _process_seconds((new, old)[i], options, cold)
                # The first round of a warm row compiles.
                if cold or k > 0:
                    times[i].append(seconds)
        yield Row(name, old.name, *times, LIMIT if cold else START_UP_LIMIT, 1.0)


#: The first cell of the default map, in CPU seconds.
FIRST_CELL = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
import rows
rows.SWEEPS["implicit, default map"].call(1)
"""


def _process_seconds(tree: Tree, options: Sequence[str], cold: bool) -> float:
    """Wall-clock time of a new process of a tree, or its CPU time if nothing is compiled before, s."""
    with tempfile.TemporaryDirectory() as folder:
        cache = Path(folder, "cache") if cold else None
        begin, cpu = time.perf_counter(), _cpu_of_children()
        subprocess.run(
            [tree.python, *options], cwd=folder, env=tree.environment(cache), check=True,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        return _cpu_of_children() - cpu if cold else time.perf_counter() - begin


def _cpu_of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


# ---- the command ------------------------------------------------------------------------------


def best() -> list[str]:
    """Commits of `best.txt`."""
    lines = (line.partition("#")[0].strip() for line in BEST.read_text().splitlines())
    return [line for line in lines if line]


@contextmanager
def trees(commits: Sequence[str]) -> Iterator[tuple[Tree, list[Tree]]]:
    """The working tree and others, installed."""
    with ExitStack() as stack:
        found = [Tree(commit) for commit in (None, *commits)]
        for tree in found:
            stack.callback(tree.close)
        yield found[0], found[1:]


def main() -> int:
    """Measure, print, write; the exit status is 1 if a row is slower."""
    parser = command(__doc__)
    parser.add_argument("commit", nargs="?", help="commit to compare with (default: those in best.txt)")
    parser.add_argument("--only", nargs="+", metavar="WORD", default=[""], help="rows whose names contain one of these")
    given = parser.parse_args()
    where = machine()
    print(where)
    rounds = 3 if given.quick else 9
    names = [name for name in ROWS if any(word in name for word in given.only)]
    found: list[Row] = []
    with trees([given.commit] if given.commit else best()) as (new, others):
        measured = [calls(new, others, names, rounds, given.quick), start_up(new, others[0], given.only, rounds)]
        for rows in measured:
            for row in rows:
                print("  ".join(row.cells()), flush=True)
                found.append(row)
    rows_found = shown("Against the fastest tree", HEADER, [row.cells() for row in found])
    slower = [row.name for row in found if row.slower]
    print(f"\nslower beyond the scatter: {'; '.join(slower) or 'none'}")
    publish(given, "against", "Against the fastest tree", where, rows_found)
    return 1 if slower else 0


if __name__ == "__main__":
    sys.exit(main())
