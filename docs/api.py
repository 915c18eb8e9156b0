"""The API reference as HTML, from the docstrings: `python docs/api.py [FOLDER]`, after `pip install '.[docs]'`."""

import sys
import warnings
from pathlib import Path

import pdoc

import ringsweep

# Reference pages for what users call; the rest is for those who read the code.
MODULES = ("ringsweep", "ringsweep.plots", "ringsweep.quantities.variables")


def build(folder: Path) -> None:
    """Write the pages; whatever is amiss in a docstring is an error."""
    for module in (ringsweep, ringsweep.plots):
        for name in module.__all__:
            # They are imported when first asked for, and pdoc does not ask.
            setattr(module, name, getattr(module, name))
    pdoc.render.configure(docformat="numpy", math=True, search=False)
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        # In a clone there is a folder of the same name: the installed package is the one that is meant.
        warnings.filterwarnings("ignore", "'ringsweep' may refer to", RuntimeWarning)
        pdoc.pdoc(*MODULES, output_directory=folder)


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "api")
    build(target)
    print(f"wrote {target / 'index.html'}")
