"""Regime maps of dry-friction systems whose friction coefficient jumps."""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ringsweep.config.own import friction_law as friction_law
    from ringsweep.errors import InputError as InputError
    from ringsweep.quantities.variables import words as words
    from ringsweep.runs.attractors import attractors as attractors
    from ringsweep.runs.boundaries import boundary as boundary
    from ringsweep.runs.fit import fit as fit
    from ringsweep.runs.precision import precision as precision
    from ringsweep.runs.simulate import simulate as simulate
    from ringsweep.runs.sweep import run as run
    from ringsweep.runs.sweep import sweep as sweep
    from ringsweep.runs.thresholds import threshold as threshold
    from ringsweep.storage.netcdf import verify as verify

_MODULES = {
    "run": "runs.sweep",
    "sweep": "runs.sweep",
    "simulate": "runs.simulate",
    "precision": "runs.precision",
    "attractors": "runs.attractors",
    "boundary": "runs.boundaries",
    "threshold": "runs.thresholds",
    "fit": "runs.fit",
    "friction_law": "config.own",
    "verify": "storage.netcdf",
    "words": "quantities.variables",
    "InputError": "errors",
}

__all__ = sorted(_MODULES)


def __getattr__(name: str) -> Any:
    # Numba and Matplotlib are slow to import: `ringsweep --help` and errors in the input should not wait for them.
    if name == "__version__":
        from importlib.metadata import version

        return version("ringsweep")
    if name == "plots":
        return import_module("ringsweep.plots")
    if name in _MODULES:
        if name != "InputError":
            import_module("ringsweep.accessor")
        return getattr(import_module(f"ringsweep.{_MODULES[name]}"), name)
    raise AttributeError(f"module 'ringsweep' has no attribute {name!r}")


class _AfterXarray:
    """Adds ``ds.ringsweep`` to datasets once somebody imports xarray, which is slow to import too."""

    def find_spec(self, fullname: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        if fullname != "xarray":
            return None
        sys.meta_path.remove(self)
        spec = find_spec(fullname)
        if spec is not None and spec.loader is not None:
            load = spec.loader.exec_module

            def load_and_register(module: Any) -> None:
                load(module)
                import_module("ringsweep.accessor")

            spec.loader.exec_module = load_and_register  # type: ignore[method-assign]
        return spec


if "xarray" in sys.modules:
    import_module("ringsweep.accessor")
else:
    sys.meta_path.insert(0, _AfterXarray())


def __dir__() -> list[str]:
    return [*__all__, "plots", "__version__"]
