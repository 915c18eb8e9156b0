"""Build the API reference as HTML from the docstrings: `python docs/api.py [FOLDER]`, after `pip install '.[docs]'`."""

import sys
import warnings
from pathlib import Path

import pdoc

import ringsweep

# Modules with public names.
MODULES = ("ringsweep", "ringsweep.plots", "ringsweep.quantities.variables")


def build(folder: Path) -> None:
    """Write the pages to a folder; a warning about a docstring is an error."""
    for module in (ringsweep, ringsweep.plots):
        for name in module.__all__:
            # Public names are imported on first access, and pdoc does not access them.
            setattr(module, name, getattr(module, name))
    pdoc.render.configure(docformat="numpy", math=True, search=False)
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        # In a clone a folder has the name of the package. pdoc takes the installed package, and warns of the folder.
        warnings.filterwarnings("ignore", "'ringsweep' may refer to", RuntimeWarning)
        pdoc.pdoc(*MODULES, output_directory=folder)


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "api")
    build(target)
    print(f"wrote {target / 'index.html'}")
