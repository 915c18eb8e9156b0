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


def functions_of_the_core():
    """Functions, classes and methods of the rooms that kernels are made of, by file; not those within functions."""
    for room in ROOMS[ROOMS.index("compile") : ROOMS.index("solvers") + 1]:
        for path in (PACKAGE / room).rglob("*.py"):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            classes = [node for node in tree.body if isinstance(node, ast.ClassDef)]
            for node in (*tree.body, *(part for one in classes for part in one.body)):
                if isinstance(node, ast.FunctionDef | ast.ClassDef):
                    yield str(path.relative_to(PACKAGE)), node


def test_each_function_of_the_core_says_what_it_does():
    assert not [f"{path}: {node.name}" for path, node in functions_of_the_core() if not ast.get_docstring(node)]


def test_no_two_functions_that_implement_hooks_have_one_name():
    """A stack trace and a search show the name alone: it says of which model the function is."""
    names = [
        node.name
        for _, node in functions_of_the_core()
        if any(ast.unparse(decorator).partition("(")[0].endswith(".implements") for decorator in node.decorator_list)
    ]
    assert not {name for name in names if names.count(name) > 1}
