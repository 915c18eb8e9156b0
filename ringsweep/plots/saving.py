"""Figures to files."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ringsweep.errors import InputError
from ringsweep.storage.files import replacing

#: Suffixes of the files that `save` writes.
SUFFIXES = (".pdf", ".png", ".svg")


def save(figure: Figure | Axes, path: str | os.PathLike[str]) -> None:
    """Write a figure to a file. If writing fails, an older file of that name stays as it was.

    Parameters
    ----------
    figure : matplotlib.figure.Figure or matplotlib.axes.Axes
        Figure to write, or axes in it.
    path : path-like
        File to write or replace. Its suffix, one of `SUFFIXES`, decides the format.

    Raises
    ------
    InputError
        If the suffix is unknown or `path` cannot be written.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> save(Figure(), "my.txt")
    Traceback (most recent call last):
    ringsweep.errors.InputError: my.txt: pictures end in .pdf, .png, .svg, not in '.txt'
    """
    suffix = suffix_of(path, SUFFIXES, "pictures")
    with replacing(path) as temporary:
        whole: Any = figure.get_figure(root=True) if isinstance(figure, Axes) else figure
        dots = matplotlib.rcParams["savefig.dpi"]
        whole.savefig(temporary, dpi=150 if dots == "figure" else dots, format=suffix[1:])


def suffix_of(path: str | os.PathLike[str], allowed: tuple[str, ...], what: str) -> str:
    """Suffix of a file in lower case; raises `InputError` if it is not allowed for `what`."""
    suffix = Path(path).suffix.lower()
    if suffix not in allowed:
        raise InputError(str(path), f"{what} end in {', '.join(allowed)}, not in {suffix or 'nothing'!r}")
    return suffix
