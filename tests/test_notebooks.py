"""Every notebook runs from top to bottom on any machine, and gives the outputs that it stores."""

import os
import re
import sys
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

FOLDER = Path(__file__).parents[1] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))

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


#: Run times, and steps of `rk4` across a band that they never meet, are those of the machine.
OF_THE_MACHINE = re.compile("measured|printed step")

NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def numbers(cell):
    """Numbers in the printed text and in the tables of a cell."""
    plain = [output.get("text", "") if output.get("name") == "stdout" else "" for output in cell.outputs]
    plain += [output.get("data", {}).get("text/plain", "") for output in cell.outputs]
    return [float(number) for number in NUMBER.findall("\n".join(plain))]


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
def test_notebook_runs_and_gives_the_stored_outputs(path, tmp_path, monkeypatch):
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
    where = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(again, timeout=900, kernel_name="python3", resources=where).execute()
    check(again)
    for cell, before in zip(code(again), code(kept), strict=True):
        assert kinds(cell) == kinds(before), cell.source
        if not OF_THE_MACHINE.search(cell.source):
            # Digits that are rounding differ between processors.
            assert numbers(cell) == pytest.approx(numbers(before), rel=0.02, abs=1e-3), cell.source
    left = [path.name for path in tmp_path.iterdir() if path.name not in ("ipython", "runtime")]
    assert not left, "the notebook left files behind"
