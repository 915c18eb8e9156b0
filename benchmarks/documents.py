"""Fill the figures of the documents in from the kept results.

    python -m benchmarks.documents    # after a measurement with --keep

A figure stands between two comments, `<!-- NAME.KEY -->` and `<!-- / -->`: the text `KEY` of `results/NAME.json`. A
table has its own lines between them. `tests/test_documents.py` fails where a document and the results differ.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path

from benchmarks._common import RESULTS

ROOT = RESULTS.parents[1]

_FIGURE = re.compile(r"(<!-- (\w+)\.(\w+) -->)(.*?)(<!-- / -->)", re.DOTALL)


def documents() -> Iterator[Path]:
    """Documents that may have figures."""
    yield ROOT / "README.md"
    yield ROOT / "CHANGELOG.md"
    yield from sorted((ROOT / "docs").glob("*.md"))


def kept() -> dict[tuple[str, str], str]:
    """Kept figures, by name of the benchmark and of the figure."""
    files = {path.stem: json.loads(path.read_text()) for path in RESULTS.glob("*.json")}
    return {(name, key): text for name, figures in files.items() for key, text in figures.items()}


def used(text: str) -> set[tuple[str, str]]:
    """Figures that a document names."""
    return {(match[2], match[3]) for match in _FIGURE.finditer(text)}


def filled(text: str, figures: dict[tuple[str, str], str]) -> str:
    """A document with its figures.

    Raises
    ------
    KeyError
        If it names a figure that no result has.
    """

    def put(match: re.Match[str]) -> str:
        figure = figures[match[2], match[3]]
        return f"{match[1]}\n\n{figure.strip()}\n\n{match[5]}" if "\n" in figure else match[1] + figure + match[5]

    return _FIGURE.sub(put, text)


def main() -> None:
    """Write the documents that differ."""
    figures = kept()
    for path in documents():
        text = path.read_text()
        if (new := filled(text, figures)) != text:
            path.write_text(new)
            print(path.relative_to(ROOT))


if __name__ == "__main__":
    main()
