"""Run the benchmarks one after the other, each in a process of its own.

    python -m benchmarks                        # all: an hour on two cores
    python -m benchmarks --quick                # less of everything, one benchmark on each core: times mean little
    python -m benchmarks --only speed sizes     # these
    python -m benchmarks --keep                 # replace the results that the documents show

Reports are written to `benchmark-results/`. A report that is there already, of the same sources, is not measured again,
so an interrupted command goes on where it stopped. The attacks of `benchmarks.hostile` measure nothing and are not
among them.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import LifoQueue

from benchmarks._common import CORE, command, cores, folder_of, stamp

#: Commands in their order. `brute_force` alone, without a count, takes an hour for more scenes.
COMMANDS = (
    "speed",
    "work_precision",
    "stability",
    "errors",
    "first_page",
    "scenes",
    "sizes",
    "refine",
    "probabilities",
    "long_runs",
    "brute_force --count 4000",
    "brute_force --families impact --count 1500",
)
NAMES = list(dict.fromkeys(command.split()[0] for command in COMMANDS))


def run(words: list[str], options: list[str], folder: Path, free: LifoQueue[int]) -> bool:
    """Run a benchmark, given with its options, unless its report is there; whether it succeeded.

    It pins what it times on one core to the next of those that are `free`.
    """
    mark = stamp(words[0], words[1:])
    if any(mark in report.read_text() for report in folder.glob("*.md")):
        print(f"{' '.join(words)}: measured on these sources already", flush=True)
        return True
    core, begin = free.get(), time.monotonic()
    print(f"{' '.join(words)}: begins", flush=True)
    line = [sys.executable, "-m", f"benchmarks.{words[0]}", *words[1:], *options]
    succeeded = subprocess.run(line, env=os.environ | {CORE: str(core)}, check=False).returncode == 0
    free.put(core)
    print(f"{' '.join(words)}: {time.monotonic() - begin:.0f} s", flush=True)
    return succeeded


def main() -> int:
    """Run what is missing; the exit status is 1 if a benchmark failed."""
    parser = command(__doc__)
    parser.add_argument("--only", nargs="+", metavar="NAME", choices=NAMES, help=", ".join(NAMES))
    given = parser.parse_args()
    asked = [words for words in map(str.split, COMMANDS) if words[0] in (given.only or NAMES)]
    if given.quick:
        # Quick measurements choose their amount themselves.
        asked = [[*(words[: words.index("--count")] if "--count" in words else words), "--quick"] for words in asked]
    folder, free = folder_of(given), LifoQueue[int]()
    for core in reversed(cores()):
        free.put(core)
    with ThreadPoolExecutor(len(cores()) if given.quick else 1) as pool:
        done = list(pool.map(lambda words: run(words, ["--keep"] if given.keep else [], folder, free), asked))
    if failed := [" ".join(words) for words, succeeded in zip(asked, done, strict=True) if not succeeded]:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
