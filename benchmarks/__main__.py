"""Run the benchmarks one after the other, each in a process of its own.

    python -m benchmarks                        # all: some two hours on two cores
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

NAMES = (
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
    "brute_force",
)


def main() -> int:
    """Run what is missing; the exit status is 1 if a benchmark failed."""
    parser = command(__doc__)
    parser.add_argument("--only", nargs="+", metavar="NAME", choices=NAMES, help=", ".join(NAMES))
    given = parser.parse_args()
    folder, failed = folder_of(given), []
    options = ["--quick"] if given.quick else []
    for name in given.only or NAMES:
        report = folder / f"{name}.md"
        if report.exists() and stamp(name, options) in report.read_text():
            print(f"{name}: {report} is of these sources already", flush=True)
            continue
        begin = time.monotonic()
        print(f"{name}: begins", flush=True)
        kept = ["--keep"] if given.keep else []
        if subprocess.run([sys.executable, "-m", f"benchmarks.{name}", *options, *kept], check=False).returncode:
            failed.append(name)
        print(f"{name}: {time.monotonic() - begin:.0f} s", flush=True)
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
