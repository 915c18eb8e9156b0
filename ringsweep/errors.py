"""Errors that a user can cause and mend."""

from __future__ import annotations


class InputError(ValueError):
    """Something in the input is wrong: what, where, and what would be right.

    Parameters
    ----------
    path : str
        Dotted path in the configuration (``scene.body.mass``), or the name of an argument or file.
    problem : str
        What is wrong and what is allowed, with the value.
    file, line : str, int, optional
        Where it stands, if it came from a file.

    Examples
    --------
    >>> import ringsweep
    >>> try:
    ...     ringsweep.run({"scene": {"model": "bealt"}})
    ... except ringsweep.InputError as error:
    ...     print(error.path, "|", error.problem)
    scene.model | 'bealt' is not a model; did you mean `belt`? (known: ring, ring-single-contact, belt)
    """

    def __init__(self, path: str, problem: str, *, file: str | None = None, line: int | None = None):
        self.path = path
        self.problem = problem
        self.file = file
        self.line = line
        super().__init__(path, problem)

    def __str__(self) -> str:
        place = ""
        if self.file is not None:
            place = f"{self.file}, line {self.line}: " if self.line is not None else f"{self.file}: "
        return f"{place}{self.path}: {self.problem}" if self.path else f"{place}{self.problem}"
