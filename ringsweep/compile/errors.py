"""What a user reads if code of the user's own does not compile."""

from __future__ import annotations

import re
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numba
from numba.core.errors import NumbaError

from ringsweep.compile.cache import OWN_FILES
from ringsweep.errors import InputError

_STEP = re.compile(r"Failed in nopython mode pipeline \(step: [^)]*\)\s*")
_PLACE = re.compile(r'File "([^"]+)", line (\d+):\s*(?:def (\w+))?')
_MOST = 200


@contextmanager
def readable_compile_errors() -> Iterator[None]:
    """Turn an error of Numba's within the block into one line.

    Raises
    ------
    InputError
        With the innermost cause, and the line of the innermost function of the user's own, if there are own files.
    RuntimeError
        With the innermost cause, if there are none.
    """
    try:
        yield
    except InputError:
        raise
    except Exception as error:
        if not _is_of_numba(error):
            raise
        # Numba tells the cause last, after the way to it.
        text = re.sub(r"\x1b\[[0-9;]*m", "", str(error))
        innermost = _STEP.split(text)[-1]
        cause = " ".join(innermost.strip().split("\n", 1)[0].split())[:_MOST] or type(error).__name__
        own = {path.name for path in OWN_FILES}
        places = [
            (Path(file).name, line, function)
            for part in (innermost, text)
            for file, line, function in _PLACE.findall(part)
        ]
        if not own:
            raise RuntimeError(f"ringsweep does not compile with numba {numba.__version__}: {cause}") from error
        hint = "; under rk4 numbers are vector lanes: use select in place of if" if "class 'bool'" in cause else ""
        file, line, function = next((place for place in places if place[0] in own), ("", "", ""))
        where = f"{file}, line {line}: " if file else ""
        who = f"{function}: " if function else ""
        raise InputError("RINGSWEEP_LAWS", f"does not compile: {where}{who}{cause}{hint}") from error


def _is_of_numba(error: Exception) -> bool:
    """Whether an error arose while Numba compiled: some are of its own classes, others of Python's."""
    frames = traceback.walk_tb(error.__traceback__)
    return isinstance(error, NumbaError) or any(
        frame.f_globals.get("__name__", "").startswith("numba.core.compiler") for frame, _ in frames
    )
