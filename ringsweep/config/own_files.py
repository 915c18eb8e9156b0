"""Python files of the user's own friction laws, drives, models and methods, named by ``RINGSWEEP_LAWS``."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterable
from pathlib import Path

from ringsweep.errors import InputError


def load_own_files(paths: Iterable[Path]) -> None:
    """Run files that register laws, drives, models or methods.

    Raises
    ------
    InputError
        If a file has the name of a module, or raises an error.
    """
    for path in paths:
        # Compiled code that is loaded from disk finds its types by the name of their module.
        spec = importlib.util.spec_from_file_location(path.stem, path)
        if spec is None or spec.loader is None or path.stem in sys.modules:
            raise InputError("RINGSWEEP_LAWS", f"{path} must be a Python file with a name that no module has")
        sys.modules[path.stem] = module = importlib.util.module_from_spec(spec)
        try:
            spec.loader.exec_module(module)
        except Exception as error:
            del sys.modules[path.stem]
            raise InputError("RINGSWEEP_LAWS", f"{path}: {type(error).__name__}: {error}") from error
