"""What a user reads if code of the user's own does not compile."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from numba.core.errors import NumbaError

from ringsweep.compile.cache import OWN_FILES
from ringsweep.errors import InputError

_STEP = re.compile(r"Failed in nopython mode pipeline \(step: [^)]*\)\s*")
_PLACE = re.compile(r'File "([^"]+)", line (\d+):')
_MOST = 200


@contextmanager
def readable_compile_errors() -> Iterator[None]:
    """Turn an error of Numba's within the block into one line, where there is code of the user's own to blame.

    Raises
    ------
    InputError
        With the innermost cause, and the line of the innermost file.
    """
    try:
        yield
    except NumbaError as error:
        if not OWN_FILES:
            raise
        # Numba tells the cause last, after the way to it.
        text = re.sub(r"\x1b\[[0-9;]*m", "", str(error))
        innermost = _STEP.split(text)[-1]
        cause = " ".join(innermost.split("\n", 1)[0].split())[:_MOST]
        own = {path.name for path in OWN_FILES}
        places = [(Path(name).name, line) for name, line in _PLACE.findall(innermost)]
        name, line = next((place for place in places if place[0] in own), places[0] if places else ("", ""))
        hint = "; under rk4 numbers are vector lanes: use select in place of if" if "class 'bool'" in cause else ""
        where = f"{name}, line {line}: " if name else ""
        raise InputError("RINGSWEEP_LAWS", f"does not compile: {where}{cause}{hint}") from error
