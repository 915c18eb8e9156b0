"""Attack ringsweep, and print what held.

    python -m benchmarks.hostile                     # all parts, about an hour
    python -m benchmarks.hostile files --count 100   # one part, less of it
    python -m benchmarks.hostile --short             # a few of each: seconds

Each part counts what it tried. What must hold: no number is lost or changed in silence, no traceback is shown, and
nothing is left behind that the next run does not remove. What breaks it is printed with the seed that repeats it, and
the exit status is 1.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks._common import machine, markdown
from benchmarks.hostile.attack import Report
from benchmarks.hostile.configurations import configurations
from benchmarks.hostile.faults import faults
from benchmarks.hostile.files import damaged_files
from benchmarks.hostile.kills import kills
from benchmarks.hostile.writers import writers

SEED = 20241121


#: Each part: its attack, which gets a folder, a count and a seed, and its counts, long and short.
PARTS: dict[str, tuple[Callable[[Path, int, int], Report], int, int]] = {
    "configurations": (configurations, 10_000, 20),
    "files": (damaged_files, 1000, 4),
    "faults": (faults, 100_000, 4),
    "writers": (writers, 100, 1),
    "kills": (kills, 500, 3),
}


def main() -> int:
    """Run parts and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"{', '.join(PARTS)} (default: all)")
    parser.add_argument("--count", type=int, help="number of attempts of each part")
    parser.add_argument("--short", action="store_true", help="a few attempts of each part")
    parser.add_argument("--seed", type=int, default=SEED)
    arguments = parser.parse_args()
    if unknown := set(arguments.parts) - set(PARTS):
        parser.error(f"no such part: {', '.join(sorted(unknown))}")
    rows, broken = [], []
    about = machine()
    for name in arguments.parts or PARTS:
        attack, many, few = PARTS[name]
        count = arguments.count or (few if arguments.short else many)
        begin = time.monotonic()
        with tempfile.TemporaryDirectory(prefix="hostile-") as folder:
            # The folder of a part lies in another one, where it can leave what must be looked at.
            work = Path(folder) / name
            work.mkdir()
            report = attack(work, count, arguments.seed)
        broken += report.broken
        print(f"{name}: {report.counts.total()} in {time.monotonic() - begin:.0f} s", flush=True)
        rows += [[name, outcome, str(times)] for outcome, times in sorted(report.counts.items())]
    print(f"\n{about}\nseed {arguments.seed}\n")
    print(markdown(["part", "outcome", "times"], rows))
    print("\n".join(["what did not hold:", *broken]) if broken else "everything held")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
