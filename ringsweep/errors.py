"""Errors in the input of a user."""

from __future__ import annotations

import difflib
import sys
from collections.abc import Iterable
from contextlib import suppress


def shortened(text: str, most: int) -> str:
    """A text as messages hold it: of a long one the start and the length."""
    return text if len(text) <= most else f"{text[:most]}... ({len(text)} characters)"


# Control characters but for tab and line feed, and what else turns the direction of text.
_CONTROL = {code: f"\\x{code:02x}" for code in [*range(32), *range(127, 160)] if code not in (9, 10)}
_CONTROL |= {code: f"\\u{code:04x}" for code in [*range(0x202A, 0x202F), *range(0x2066, 0x206A)]}


def escaped(text: str) -> str:
    """A text as a terminal may show it: what a file holds could clear the screen, or hide what was printed."""
    return text.translate(_CONTROL)


def print_error(message: str) -> None:
    """Print an error of a command on stderr, in one line."""
    # The exit status tells of the error too, even if the message cannot be written.
    with suppress(OSError):
        print("ringsweep:", escaped(" ".join(message.split())), file=sys.stderr, flush=True)


def nearest_name(word: object, known: Iterable[str]) -> str | None:
    """The known name that a user probably means: one that begins with the word, or the most similar one."""
    wanted, names = str(word)[:100].lower(), list(known)
    begun = sorted((name for name in names if len(wanted) > 2 and name.lower().startswith(wanted)), key=len)
    one = begun and all(name.startswith(begun[0]) for name in begun)
    near = begun[:1] if one else difflib.get_close_matches(wanted, names, n=1)
    return near[0] if near else None


class InputError(ValueError):
    """Something in the input is wrong: it says where, what, and what is allowed.

    Parameters
    ----------
    path : str
        Dotted path in the configuration (``scene.body.mass``), or the name of an argument or file.
    problem : str
        The wrong value and what is allowed.
    file, line : str, int, optional
        File and line of the wrong value, if it came from a file.

    Examples
    --------
    >>> import ringsweep
    >>> try:
    ...     ringsweep.run({"scene": {"model": "bealt"}})
    ... except ringsweep.InputError as error:
    ...     print(error.path, "|", error.problem)
    scene.model | 'bealt' is not a model; did you mean `belt`? (known: ring, ring-single-contact, belt, belt-pair)
    """

    def __init__(self, path: str, problem: str, *, file: str | None = None, line: int | None = None):
        self.path = path
        self.problem = problem
        self.file = file
        self.line = line
        super().__init__(path, problem)

    def __str__(self) -> str:
        location = ""
        if self.file is not None:
            location = shortened(self.file, 300) + (f", line {self.line}: " if self.line is not None else ": ")
        problem = shortened(self.problem, 1200)
        return f"{location}{shortened(self.path, 200)}: {problem}" if self.path else f"{location}{problem}"
