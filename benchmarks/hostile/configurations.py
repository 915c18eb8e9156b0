"""Random configurations by grammar: each is refused in one line that names the place, or runs to finite numbers.

    python -m benchmarks.hostile configurations

A configuration begins as one that runs, with one to four cells. Then up to three mutations change values, units, types,
names, formulas, tables, axes, refinement and solver, or its text. The command line runs it in this process. What must
hold: exit status 0 or 2, or 1 if every run has failed; no traceback and no warning of Python; a message is one line of
at most 2000 characters that names a path or a line; numbers of runs that did not fail are finite; nothing is left
behind but the files asked for.
"""

from __future__ import annotations

import contextlib
import copy
import io
import logging
import math
import random
import re
import time
import warnings
from collections.abc import Callable, Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
import yaml

from benchmarks.hostile.attack import Report

_VOCABULARY = yaml.safe_load(Path(__file__).with_name("vocabulary.yaml").read_text(encoding="utf-8"))

#: Scenes that run, with the paths that are swept and values for each.
KINDS: dict[str, dict[str, Any]] = _VOCABULARY["kinds"]

#: The kinds whose kernels most tests compile too.
COMMON = ("ring", "belt")

_NUMBERS = [0, -1, 1, 3, 1e-300, 5e-324, 1e300, -1e308, 1.7e308, 0.5, 1e6, 1e-9, math.nan, math.inf, 10**30, 7**6000]
_JUNK = [_NUMBERS, [*_VOCABULARY["words"], "x" * 5000], _VOCABULARY["others"]]


def random_configuration(draw: random.Random, kinds: Collection[str]) -> str:
    """Text of a configuration: one that runs, with up to three mutations."""
    kind = copy.deepcopy(KINDS[draw.choice(list(kinds))])
    scene, swept = kind["scene"], kind["swept"]
    solver: Any = {"method": "auto", "max_steps": 100_000}
    paths = draw.sample(list(swept), draw.randint(0, 2))
    tree: dict[str, Any] = {"scene": scene, "solver": solver}
    if paths:
        tree["sweep"] = {draw.choice(["grid", "grid", "points"]): {p: swept[p][: draw.randint(1, 2)] for p in paths}}
    for _ in range(draw.choice([0, 0, 1, 1, 2, 3])):
        draw.choice(_MUTATIONS)(tree, draw)
    with contextlib.suppress(ValueError):
        # Python writes no integers of thousands of digits.
        text = yaml.safe_dump(tree, sort_keys=False, allow_unicode=True)
        return _changed_text(text, draw) if draw.random() < 0.1 else text
    return yaml.safe_dump(_without_long_integers(tree), sort_keys=False).replace("LONG", "7" * 5000)


def _without_long_integers(node: Any) -> Any:
    if isinstance(node, dict):
        return {key: _without_long_integers(child) for key, child in node.items()}
    if isinstance(node, list):
        return [_without_long_integers(child) for child in node]
    return "LONG" if isinstance(node, int) and abs(node) > 10**100 else node


def _places(node: Any) -> Iterator[tuple[Any, Any]]:
    """Every container below a node with each of its keys."""
    for key, child in list(node.items() if isinstance(node, dict) else enumerate(node)):
        yield node, key
        if isinstance(child, dict | list):
            yield from _places(child)


def _place(tree: Any, draw: random.Random) -> tuple[Any, Any]:
    return draw.choice(list(_places(tree)) or [(tree, "scene")])


def _word(draw: random.Random, name: str) -> Any:
    return copy.deepcopy(draw.choice(_VOCABULARY[name]))


def _junk(draw: random.Random) -> Any:
    return copy.deepcopy(draw.choice(draw.choice(_JUNK)))


def _replace(tree: Any, draw: random.Random) -> None:
    node, key = _place(tree, draw)
    node[key] = _junk(draw)


def _scale(tree: Any, draw: random.Random) -> None:
    numbers = [(node, key) for node, key in _places(tree) if isinstance(node[key], int | float)]
    for node, key in draw.sample(numbers, min(len(numbers), 2)):
        with contextlib.suppress(OverflowError):
            node[key] = node[key] * 10.0 ** draw.uniform(-3.0, 3.0) * draw.choice([1.0, 1.0, 1.0, -1.0])


def _respell(tree: Any, draw: random.Random) -> None:
    node, key = _place(tree, draw)
    if isinstance(node[key], int | float) and not isinstance(node[key], bool) and abs(node[key]) < 1e300:
        node[key] = f"{node[key]} {_word(draw, 'units')}"


def _misspell(tree: Any, draw: random.Random) -> None:
    node, key = _place(tree, draw)
    if isinstance(node, dict) and isinstance(key, str) and key:
        i = draw.randrange(len(key))
        node[draw.choice([key[:i] + key[i + 1 :], key[:i] + key[i] * 2 + key[i + 1 :], key.upper()])] = node.pop(key)


def _remove(tree: Any, draw: random.Random) -> None:
    node, key = _place(tree, draw)
    del node[key]


def _add(tree: Any, draw: random.Random) -> None:
    sections = [node for node, _ in _places(tree) if isinstance(node, dict)] or [tree]
    draw.choice(sections)[_word(draw, "keys")] = _junk(draw)


def _resolve(tree: Any, draw: random.Random) -> None:
    tree["solver"] = _word(draw, "solvers")


def _resweep(tree: Any, draw: random.Random) -> None:
    sweep = tree.setdefault("sweep", {})
    if not isinstance(sweep, dict):
        return
    if draw.random() < 0.3:
        sweep["refine"] = _word(draw, "refinements")
    grid = sweep.setdefault("grid", {})
    if isinstance(grid, dict):
        path = draw.choice([*grid, *_VOCABULARY["paths"]])
        grid[path] = draw.choice([_word(draw, "spacings"), _junk(draw)])


def _reformulate(tree: Any, draw: random.Random) -> None:
    friction = tree.get("scene", {}).get("friction") if isinstance(tree.get("scene"), dict) else None
    if not isinstance(friction, dict) or "at_rest" not in friction:
        return
    tokens = " ".join(_word(draw, "tokens") for _ in range(draw.randint(1, 9)))
    friction["mu"] = draw.choice([*_VOCABULARY["formulas"], tokens, f"mu_k*({tokens})"])
    friction["at_rest"] = draw.choice(["mu_s", "mu_s", "mu_k", None, "v", 3])


_MUTATIONS: tuple[Callable[[Any, random.Random], None], ...] = (
    _replace, _scale, _scale, _respell, _misspell, _remove, _add, _resolve, _resweep, _reformulate,
)  # fmt: skip


def _changed_text(text: str, draw: random.Random) -> str:
    i = draw.randrange(len(text))
    piece = _word(draw, "pieces")
    return text[:i] + piece + text[i + draw.randint(0, 5) :]


def configurations(folder: Path, count: int, seed: int, kinds: Collection[str] = tuple(KINDS)) -> Report:
    """Run random configurations.

    Parameters
    ----------
    folder : Path
        An empty folder.
    count, seed : int
        Number of configurations; number `k` of a seed is the same for every count.
    kinds : collection of str
        Names in :data:`KINDS`: fewer kinds compile less.

    Returns
    -------
    Report
    """
    report = Report()
    slowest = 0.0
    for number in range(count):
        draw = random.Random(f"{seed} {number}")
        text = random_configuration(draw, kinds)
        config, target = folder / "a.yaml", folder / "a.nc"
        config.write_bytes(text.encode("utf-8", "surrogatepass"))
        verb = draw.choices(["run", "simulate", "dry-run"], [18, 1, 1])[0]
        command = [verb if verb != "dry-run" else "run", str(config), "-o", str(target)]
        command += ["--dry-run"] if verb == "dry-run" else []
        began = time.monotonic()
        status, output, problems = _call(command)
        slowest = max(slowest, time.monotonic() - began)
        problems += _wrong(status, output, target, wrote=verb != "dry-run")
        left = {path.name for path in folder.iterdir()} - {"a.yaml", "a.nc", "a.png"}
        problems += [f"left behind: {', '.join(sorted(left))}"] if left else []
        outcome = f"{verb}: exit status {status}"
        if verb == "run" and status < 2 and not problems:
            outcome = "run: some cells failed" if _failed(target).any() else "run: all cells have a regime"
        problem = problems and f"configurations, seed {seed}, number {number}: {'; '.join(problems)}"
        report.add(outcome, problem or "")
        if problem:
            (folder.parent / f"hostile-{seed}-{number}.yaml").write_bytes(config.read_bytes())
        for path in folder.iterdir():
            path.unlink()
    print(f"the slowest took {slowest:.1f} s", flush=True)
    return report


def _call(command: list[str]) -> tuple[int, str, list[str]]:
    """Exit status, what the command line printed, and what it should not have done."""
    from ringsweep import cli, plots

    output = io.StringIO()
    handler = logging.StreamHandler(output)
    saved, plots.save = plots.save, _save_nothing
    logging.getLogger("ringsweep").addHandler(handler)
    status, problems = -1, []
    try:
        with (
            contextlib.redirect_stdout(io.StringIO()),
            contextlib.redirect_stderr(output),
            warnings.catch_warnings(record=True) as warned,
        ):
            warnings.simplefilter("always")
            status = cli.main(command)
        problems = [f"{one.category.__name__}: {one.message} ({one.filename}:{one.lineno})" for one in warned[:3]]
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        problems = [f"{type(error).__name__}: {str(error)[:300]}"]
    finally:
        plots.save = saved
        logging.getLogger("ringsweep").removeHandler(handler)
    return status, output.getvalue(), problems


def _save_nothing(figure: Any, path: Path) -> None:
    # Pictures take longer than runs.
    Path(path).touch()


def _wrong(status: int, output: str, target: Path, *, wrote: bool) -> list[str]:
    """What does not hold after a command."""
    if "Traceback" in output:
        return [f"traceback: {output[-800:]}"]
    message = output.strip().rpartition("\n")[2]
    if status == 2:
        named = re.search(r"scene|solver|sweep|line \d+|a\.yaml", message)
        return [f"no place is named: {message}"] * (not named) + (
            [f"{len(message)} characters: {message[:200]}"] if len(message) > 2000 else []
        )
    if status == 1 and wrote and target.exists() and _failed(target).all():
        status = 0
    if status:
        return [f"exit status {status}: {message[:500]}"]
    if target.exists() != wrote:
        return ["the file is missing" if wrote else "a dry run wrote a file"]
    return _not_finite(target) if wrote else []


def _not_finite(target: Path) -> list[str]:
    """Variables of a result that hold no finite number although their run did not fail."""
    with xr.open_dataset(target, decode_times=False) as found:
        good = found["regime"].values != _flag(found["regime"], "failed")
        if "origin" in found:
            good &= found["origin"].values != _flag(found["origin"], "inferred")
        problems = []
        for name, variable in found.data_vars.items():
            if variable.dtype.kind != "f" or "time" in variable.dims:
                continue
            values = variable.values[good] if variable.shape == good.shape else variable.values
            missing = name in _VOCABULARY["may_be_missing"] or str(name).endswith("_error")
            unbounded = name == "stiffness" or str(name).endswith("_error")
            if (np.isinf(values).any() and not unbounded) or (np.isnan(values).any() and not missing):
                problems.append(f"{name} is not finite in a cell that did not fail")
        return problems


def _failed(target: Path) -> xr.DataArray:
    with xr.open_dataset(target, decode_times=False) as found:
        return (found["regime"] == _flag(found["regime"], "failed")).load()


def _flag(variable: xr.DataArray, meaning: str) -> int:
    meanings = str(variable.attrs["flag_meanings"]).split()
    return int(np.atleast_1d(variable.attrs["flag_values"])[meanings.index(meaning)])
