"""The rooms of the package: imports go one way, and a stranger can count the rooms. Names of tests are short."""

import ast
import re
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "ringsweep"

#: Rooms from the lowest to the highest; a room imports from itself and from rooms below it.
ROOMS = (
    "errors",
    "quantities",
    "statistics",
    "compile",
    "numerics",
    "physics",
    "models",
    "solvers",
    "config",
    "storage",
    "runs",
    "plots",
    "report",
    "accessor",
    "cli",
)


def imported_rooms(source):
    """Rooms that a file imports, also within functions."""
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "ringsweep":
            parts = node.module.split(".")
            yield from [parts[1]] if len(parts) > 1 else [alias.name for alias in node.names]
        elif isinstance(node, ast.Import):
            yield from (name.name.split(".")[1] for name in node.names if name.name.startswith("ringsweep."))


def test_package_has_these_rooms_and_no_more():
    found = {path.stem for path in PACKAGE.iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()}
    assert found - {"__init__", "__main__"} == set(ROOMS)


@pytest.mark.parametrize("room", ROOMS)
def test_room_imports_no_room_above_it(room):
    files = sorted((PACKAGE / room).rglob("*.py")) or [PACKAGE / f"{room}.py"]
    below = ROOMS[: ROOMS.index(room) + 1]
    upwards = {
        f"{path.relative_to(PACKAGE)} imports {name}"
        for path in files
        for name in imported_rooms(path)
        if name not in below
    }
    assert not upwards


def test_physics_knows_no_files_and_no_solver_knows_a_particular_model():
    forbidden = {"physics": ("storage", "runs", "config"), "solvers": ("models.ring", "models.belt")}
    for room, names in forbidden.items():
        for path in (PACKAGE / room).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            assert not [name for name in names if f"from ringsweep.{name}" in text], path


def test_names_of_tests_have_at_most_70_letters():
    for path in Path(__file__).parent.rglob("*.py"):
        names = re.findall(r"def (test_\w+)", path.read_text(encoding="utf-8"))
        assert not [name for name in names if len(name) > 70], path
