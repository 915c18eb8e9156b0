"""Every notebook runs from top to bottom, elsewhere too, and shows what a reader sees."""

import os
import re
import sys
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

FOLDER = Path(__file__).parents[1] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))

#: What only one machine would say: its folders, its times, its warnings.
FOREIGN = re.compile(r"""(^|[\s'"(])(/\w+/|[A-Z]:\\)|site-packages|Warning\b|it/s\]|Traceback""", re.M)


def texts(output):
    """Every text of an output; pictures have none."""
    if output.output_type == "stream":
        return [output.text]
    return [data for kind, data in output.get("data", {}).items() if kind.startswith("text/")]


def kinds(cell):
    """What a cell shows: streams once each, and data by their kinds."""
    found = {output.name for output in cell.outputs if output.output_type == "stream"}
    return found | {kind for output in cell.outputs for kind in output.get("data", {})}


def code(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def check(notebook):
    """No cell fails, grumbles, or tells where it ran."""
    for cell in code(notebook):
        for output in cell.outputs:
            assert output.output_type != "error", output.evalue
            assert output.get("name") != "stderr", output.text
            for text in texts(output):
                assert not FOREIGN.search(text), text


def test_there_are_notebooks():
    assert NOTEBOOKS


@pytest.mark.parametrize("path", NOTEBOOKS, ids=[path.stem for path in NOTEBOOKS])
def test_a_notebook_shows_again_what_it_shows(path, tmp_path, monkeypatch):
    kept = nbformat.read(path, as_version=4)
    nbformat.validate(kept)
    check(kept)
    assert [cell.execution_count for cell in code(kept)] == list(range(1, len(code(kept)) + 1))

    # Commands are those of this environment, whether or not it is activated.
    monkeypatch.setenv("PATH", os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]))
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    monkeypatch.setenv("JUPYTER_RUNTIME_DIR", str(tmp_path / "runtime"))
    monkeypatch.delenv("RINGSWEEP_LAWS", raising=False)
    again = nbformat.from_dict(kept)
    for cell in code(again):
        cell.outputs, cell.execution_count = [], None
    where = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(again, timeout=170, kernel_name="python3", resources=where).execute()
    check(again)
    for cell, before in zip(code(again), code(kept), strict=True):
        assert kinds(cell) == kinds(before), cell.source
    assert not [left for left in tmp_path.iterdir() if left.name not in ("ipython", "runtime")], "left behind"
