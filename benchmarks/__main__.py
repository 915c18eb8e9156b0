"""Run the benchmarks one after the other, each in a process of its own.

    python -m benchmarks                        # all: an hour and a quarter on two cores
    python -m benchmarks --quick                # less of everything
    python -m benchmarks --only speed scaling   # these
    python -m benchmarks --keep                 # replace the results that the documents show

Reports are written to `benchmark-results/`. A report that is there already, of the same sources, is not measured again,
so an interrupted command goes on where it stopped. The attacks of `benchmarks.hostile` measure nothing and are not
among them.
"""

from __future__ import annotations

import subprocess
import sys
import time

from benchmarks._common import command, folder_of, stamp

#: Commands in their order. `brute_force` alone, without a count, takes an hour for more scenes.
COMMANDS = (
    "speed",
    "work_precision",
    "stability",
    "certificates",
    "errors",
    "first_page",
    "scenes",
    "scaling",
    "sizes",
    "refine",
    "fits",
    "probabilities",
    "diagram",
    "long_runs",
    "brute_force --count 4000",
    "brute_force --families impact --count 1500",
)
NAMES = list(dict.fromkeys(command.split()[0] for command in COMMANDS))


def main() -> int:
    """Run what is missing; the exit status is 1 if a benchmark failed."""
    parser = command(__doc__)
    parser.add_argument("--only", nargs="+", metavar="NAME", choices=NAMES, help=", ".join(NAMES))
    given = parser.parse_args()
    folder, failed = folder_of(given), list[str]()
    quick, kept = ["--quick"] if given.quick else [], ["--keep"] if given.keep else []
    for words in map(str.split, COMMANDS):
        name, *options = words
        if name not in (given.only or NAMES):
            continue
        # Quick measurements choose their amount themselves.
        options = [*(options[: options.index("--count")] if quick and "--count" in options else options), *quick]
        mark = stamp(name, options)
        if any(mark in report.read_text() for report in folder.glob("*.md")):
            print(f"{' '.join(words)}: measured on these sources already", flush=True)
            continue
        begin = time.monotonic()
        print(f"{' '.join(words)}: begins", flush=True)
        if subprocess.run([sys.executable, "-m", f"benchmarks.{name}", *options, *kept], check=False).returncode:
            failed.append(" ".join(words))
        print(f"{' '.join(words)}: {time.monotonic() - begin:.0f} s", flush=True)
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
