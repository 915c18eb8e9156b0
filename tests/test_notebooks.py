"""Every notebook runs from top to bottom on any machine, and gives the kinds of output that it stores."""

import os
import re
import sys
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

FOLDER = Path(__file__).parents[1] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))

#: Grids of the notebooks, and smaller ones that the tests run in their place: text, and what replaces it.
SMALLER = {
    "01-first-map": {
        "np.geomspace(1, 10, 64)": "np.geomspace(1, 10, 16)",
        "np.linspace(0.5, 12, 64)": "np.linspace(0.5, 12, 16)",
    },
    "03-trust": {
        "np.geomspace(0.1, 10, 32)": "np.geomspace(0.1, 10, 8)",
        "np.linspace(2, 60, 32)": "np.linspace(2, 60, 8)",
        "np.geomspace(1e-6, 1e-1, 101)": "np.geomspace(1e-6, 1e-1, 26)",
        "target=1e-6, cells=16": "target=1e-3, cells=2",
    },
    "04-scratch": {
        "np.linspace(0.9, 2.8, 58)": "np.linspace(0.9, 2.8, 20)",
        "np.linspace(0.3, 3, 10)": "np.linspace(0.3, 3, 4)",
        "np.linspace(0.5, 3, 51)": "np.linspace(0.5, 3, 11)",
        "np.linspace(0, 6, 17)": "np.linspace(0, 6, 5)",
    },
    "05-your-own": {
        "np.linspace(0, 350, 36)": "np.linspace(0, 350, 12)",
        "np.linspace(0.5, 17.5, 18)": "np.linspace(0.5, 17.5, 6)",
    },
    "06-literature": {
        "np.linspace(0.52, 3, 80)": "np.linspace(0.52, 3, 20)",
        "np.linspace(0.01, 0.99, 60)": "np.linspace(0.01, 0.99, 12)",
        "np.geomspace(0.035, 1.2, 110)": "np.geomspace(0.035, 1.2, 22)",
        "np.linspace(0.02, 0.98, 65)": "np.linspace(0.02, 0.98, 13)",
    },
    "07-after-contact": {
        "np.geomspace(0.1, 10, 32), np.radians(np.linspace(2, 60, 32))": (
            "np.geomspace(0.1, 10, 8), np.radians(np.linspace(2, 60, 8))"
        ),
    },
    "08-long-run": {
        '"linspace": [0.15, 0.4, 60]': '"linspace": [0.15, 0.4, 8]',
        "np.linspace(-1.95, 1.95, 40)": "np.linspace(-1.95, 1.95, 8)",
        "np.linspace(0.025, 1.975, 40)": "np.linspace(0.025, 1.975, 8)",
        "[1, 2, 4, 8]": "[1, 2]",
    },
}

#: Text that depends on the machine or shows a problem: folders, progress bars, warnings, tracebacks.
FOREIGN = re.compile(r"""(^|[\s'"(])(/\w+/|[A-Z]:\\)|site-packages|Warning\b|it/s\]|Traceback""", re.M)


def texts(output):
    """Texts of an output; a picture has none."""
    if output.output_type == "stream":
        return [output.text]
    return [data for kind, data in output.get("data", {}).items() if kind.startswith("text/")]


def kinds(cell):
    """Names of the streams and MIME types of the data in the outputs of a cell."""
    found = {output.name for output in cell.outputs if output.output_type == "stream"}
    return found | {kind for output in cell.outputs for kind in output.get("data", {})}


#: What runs warn of: rk4 beyond its limit, and belts whose motion has not settled.
KNOWN = ("exceed the limit of stability of rk4", "not settled")


def code(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def check(notebook):
    """Check that no cell failed, shows where it ran, or wrote to stderr but for known warnings."""
    for cell in code(notebook):
        for output in cell.outputs:
            assert output.output_type != "error", output.evalue
            assert output.get("name") != "stderr" or any(text in output.text for text in KNOWN), output.text
            for text in texts(output):
                assert not FOREIGN.search(text), text


def test_folder_holds_notebooks():
    assert NOTEBOOKS


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=[path.stem for path in NOTEBOOKS])
def test_notebook_runs_and_gives_the_stored_kinds_of_output(path, tmp_path, monkeypatch):
    kept = nbformat.read(path, as_version=4)
    nbformat.validate(kept)
    check(kept)
    assert [cell.execution_count for cell in code(kept)] == list(range(1, len(code(kept)) + 1))

    # Shell commands must come from this environment, also if it is not activated.
    monkeypatch.setenv("PATH", os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]))
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    monkeypatch.setenv("JUPYTER_RUNTIME_DIR", str(tmp_path / "runtime"))
    monkeypatch.delenv("RINGSWEEP_LAWS", raising=False)
    again = nbformat.from_dict(kept)
    for cell in code(again):
        cell.outputs, cell.execution_count = [], None
    for text, smaller in SMALLER.get(path.stem, {}).items():
        (cell,) = (cell for cell in code(again) if text in cell.source)
        cell.source = cell.source.replace(text, smaller)
    where = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(again, timeout=170, kernel_name="python3", resources=where).execute()
    check(again)
    for cell, before in zip(code(again), code(kept), strict=True):
        assert kinds(cell) == kinds(before), cell.source
    left = [path.name for path in tmp_path.iterdir() if path.name not in ("ipython", "runtime")]
    assert not left, "the notebook left files behind"
