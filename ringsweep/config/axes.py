"""Axes of a sweep: the section ``sweep`` of a configuration, or the axes given in Python."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ringsweep.config.own import laws_with
from ringsweep.config.reading import MAX_VALUES, Document, check_keys, read_values, section_of, suggestion
from ringsweep.config.scene import sweepable
from ringsweep.errors import InputError, nearest_name
from ringsweep.models import MODELS, batch
from ringsweep.models.scene import LAW, Scene, Structure
from ringsweep.quantities.parameters import Key, Parameter
from ringsweep.quantities.trailer import MAX_CELLS
from ringsweep.quantities.units import is_plain, is_quantity, other_unit, quantity, show, spelled
from ringsweep.quantities.variables import OUTCOMES

COUNT = Parameter("1", "number of values", lower=1, upper=MAX_VALUES, whole=True)

_SPACINGS: dict[str, Any] = {"linspace": np.linspace, "geomspace": np.geomspace}

# Cells that are checked at once: many zones over many points must not fill the memory.
_CELLS_AT_ONCE = 4096

#: Dimensions of a swept path, and its values: numbers in SI units or names of friction laws, in the shape of these.
Column = tuple[tuple[str, ...], NDArray[Any]]

#: Index of each of some cells along each dimension, by name of the dimension.
Indices = Mapping[str, NDArray[np.intp]]

#: A swept path, its place in the configuration (for messages), the path or word that names its dimension, and what is
#: given: values, a spacing, or a DataArray, which has dimensions of its own.
Given = tuple[Any, str, str, Any]


@dataclass(frozen=True)
class Axes:
    """Dimensions and values of everything that a sweep varies.

    Attributes
    ----------
    sizes : dict of str to int
        Length of each dimension, in order.
    columns : dict of str to tuple
        Dimensions and values of each swept path. The values are numbers in SI units or names of friction laws; their
        shape matches the dimensions.
    """

    sizes: dict[str, int] = field(default_factory=dict)
    columns: dict[str, Column] = field(default_factory=dict)


def sweep_section(doc: Document) -> dict[str, Any]:
    """The axes in the section ``sweep``, with the contents of CSV files; empty if there is no such section."""
    if "sweep" not in doc.tree:
        return {}
    section = section_of(doc.tree, "sweep", "")
    check_keys(section, ("grid", "points", "follow", "refine", "sample"), "sweep")
    if isinstance(section.get("points"), str):
        section["points"] = doc.inline_csv(section["points"], "sweep.points", "sweep.points")
    if isinstance(sample := section.get("sample"), dict) and isinstance(sample.get("of"), dict):
        _inline_samples(doc, sample["of"])
    # A program may run a scene without axes, and so does the file of its result.
    if not section and doc.columns is None:
        raise InputError("sweep", "empty: give grid, points or sample, or leave sweep out")
    sweep = {key: columns for key, columns in section.items() if key not in ("refine", "follow")}
    for key in sweep:
        if not section_of(sweep, key, "sweep."):
            raise InputError(f"sweep.{key}", "empty: name at least one path, or leave it out")
    return sweep


def _inline_samples(doc: Document, of: dict[str, Any]) -> None:
    """Put the contents of the CSV files of a sample in the place of their names."""
    for key, given in of.items():
        if not isinstance(given, dict) or "file" not in given:
            continue
        where = f"sweep.sample.of.{key}"
        if len(given) > 1:
            raise InputError(f"{where}.file", "stands alone: the rows of the file are the values")
        columns = doc.inline_csv(given["file"], f"{where}.file", f"{where}.values")
        for path in paths_of(key):
            if path not in columns:
                raise InputError(f"{where}.file", f"the file has no column {path}" + suggestion(path, columns))
        of[key] = {"values": {path: columns[path] for path in paths_of(key)}}


def columns_of(sweep: dict[str, Any]) -> list[Given]:
    """Columns of the axes in the section ``sweep``."""
    found = [(path, f"sweep.points.{path}", "point", given) for path, given in sweep.get("points", {}).items()]
    for key, given in sweep.get("grid", {}).items():
        paths = paths_of(key)
        found += [(path, f"sweep.grid.{key}", paths[0], given) for path in paths]
    return found


def swept_paths(sweep: dict[str, Any], columns: Iterable[Given] | None = None) -> dict[str, str]:
    """Every path that the section ``sweep`` varies, or columns in its place, with its place in the configuration."""
    of = sweep.get("sample", {}).get("of")
    found = {path: f"sweep.sample.of.{key}" for key in (of if isinstance(of, dict) else ()) for path in paths_of(key)}
    return found | {path: where for path, where, *_ in (columns_of(sweep) if columns is None else columns)}


def paths_of(key: Any) -> list[Any]:
    """Paths of an axis of a grid, or of a sample: those that vary together are separated by commas."""
    return [path.strip() for path in key.split(",")] if isinstance(key, str) else [key]


def swept_parameter(known: Mapping[str, Parameter | Key], path: object, where: str) -> Parameter | Key:
    """The parameter at a swept path, which must be one of the known paths."""
    if not isinstance(path, str) or path not in known:
        raise InputError(where, "the scene has no such number to vary" + laws_with(path) + suggestion(path, known))
    return known[path]


def dimension(path: str) -> str:
    """Name that a path has in datasets."""
    return path.replace(".", "_")


def read_data_array(given: Any, parameter: Parameter | Key, where: str) -> Column:
    """Dimensions and values of a DataArray, converted from its ``units``, or from those of pint's quantities in it."""
    dims = tuple(map(str, given.dims))
    if not dims:
        raise InputError(where, "a DataArray without dimensions varies nothing")
    unit = str(given.attrs.get("units", "1"))
    # The values of quantities would be stripped of their units.
    flat: Any = given.data.ravel() if is_quantity(given.data) else given.values.ravel()
    if unit != "1" and given.dtype.kind in "iuf" and not is_quantity(flat):
        flat = [f"{value!r} {unit}" for value in flat.tolist()]
    return dims, read_values(flat, parameter, where, MAX_CELLS).reshape(given.shape)


def read_axis(given: Any, parameter: Parameter | Key, where: str) -> NDArray[Any]:
    """Values from a list, from ``{linspace: [first, last, count]}`` or from ``{geomspace: ...}``."""
    if not isinstance(given, dict):
        return read_values(given, parameter, where)
    if isinstance(parameter, Key):
        raise InputError(where, f"a list of names is expected, got {show(given)}")
    if len(given) != 1 or next(iter(given)) not in _SPACINGS:
        wrong = next((key for key in given if key not in _SPACINGS), None)
        near = "geomspace" if wrong in ("logspace", "log", "geom") else wrong and nearest_name(wrong, _SPACINGS)
        hint = f"; did you mean `{near}`, from the first value to the last?" if near else ""
        raise InputError(where, f"a list of values, linspace or geomspace is expected, got {show(given)}{hint}")
    ((kind, bounds),) = given.items()
    where = f"{where}.{kind}"
    if not isinstance(bounds, list) or len(bounds) != 3:
        raise InputError(where, f"[first, last, count] is expected, got {show(bounds)}")
    first, last = (quantity(bound, parameter, f"{where}.{i}") for i, bound in enumerate(bounds[:2]))
    for end, other in (bounds[:2], bounds[1::-1]):
        unit = other_unit(spelled(other), parameter)
        # Zero is the same in all units.
        if unit and is_plain(end) and float(end) != 0.0:
            raise InputError(where, f"{show(end)} has no unit, but the other end is in {unit}: give both a unit")
    count = int(quantity(bounds[2], COUNT, f"{where}.2"))
    if kind == "geomspace" and min(first, last) <= 0.0:
        raise InputError(where, f"both ends of geomspace must be greater than 0, got {first:g} and {last:g}")
    with np.errstate(over="ignore", invalid="ignore"):
        return read_values(_SPACINGS[kind](first, last, count), parameter, where)


def build_axes(scene: Scene, columns: Iterable[Given]) -> Axes:
    """Axes from columns, in their order.

    Raises
    ------
    InputError
        If a path is none of the scene, a value is wrong, or the columns contradict each other, repeat a value, or make
        too many cells.
    """
    known, found = sweepable(scene), Axes()
    for path, where, along, given in columns:
        parameter = swept_parameter(known, path, where)
        if hasattr(given, "dims"):
            dims, values = read_data_array(given, parameter, where)
        else:
            dims, values = (dimension(along),), read_axis(given, parameter, where)
        if path in found.columns:
            also = "a column of sweep.points" if "point" in found.columns[path][0] else "on this or another axis"
            raise InputError(where, f"also {also}: a path can vary in one place only")
        for dim, size in zip(dims, values.shape, strict=True):
            if dim in OUTCOMES:
                raise InputError(where, f"the dimension {dim} has the name of a variable of the result")
            if found.sizes.setdefault(dim, size) != size:
                raise InputError(where, f"{size} values along {dim}, where others have {found.sizes[dim]}")
        found.columns[path] = dims, values
        if dims == (dimension(path),):
            _, first = np.unique(values, return_index=True)
            if len(first) < len(values):
                repeated = np.setdiff1d(np.arange(len(values)), first)[0]
                raise InputError(f"{where}.{repeated}", f"{show(values[repeated].item())} stands twice on this axis")
    total = math.prod(found.sizes.values())
    if total > MAX_CELLS:
        sizes = " x ".join(map(str, found.sizes.values()))
        raise InputError("sweep", f"{sizes} makes {total:.3g} cells: at most {MAX_CELLS:.3g} fit into one sweep")
    for path, (dims, _) in found.columns.items():
        name = dimension(path)
        if name in found.sizes and dims != (name,):
            problem = f"the dimension {name} has the name of this path, but the path has other dimensions: rename it"
            raise InputError(path, problem)
    return found


def values_at(scene: Scene, axes: Axes, indices: Indices, count: int) -> dict[str, NDArray[np.float64]]:
    """Values of every numeric path in `count` cells, each of shape ``(count,)``."""
    values = {path: np.full(count, value) for path, value in scene.values.items()}
    for path, (dims, column) in axes.columns.items():
        if path != LAW:
            values[path] = np.ascontiguousarray(column[tuple(indices[dim] for dim in dims)], dtype=float)
    return values


def by_law(
    scene: Scene, axes: Axes, indices: Indices, count: int
) -> Iterator[tuple[Structure, NDArray[np.intp], dict[str, NDArray[np.float64]]]]:
    """Which of `count` cells have each friction law, and their values: a batch has one law, as kernels have."""
    dims, names = axes.columns.get(LAW, ((), np.array(scene.structure.law)))
    laws = np.broadcast_to(names[tuple(indices[dim] for dim in dims)], count)
    for law, structure in scene.structures.items():
        own = np.flatnonzero(laws == law)
        if len(own):
            here = {dim: along[own] for dim, along in indices.items()}
            yield structure, own, values_at(scene, axes, here, len(own))


def check_consistency(scene: Scene, axes: Axes) -> None:
    """Let the model look for contradictions between values, in all cells of a sweep.

    Raises
    ------
    InputError
        If values contradict each other, such as a ring too small for its body; or if a section is asked for at each
        period, and no cell has one.
    """
    # Each condition is monotone in each value, so the two extremes of a grid axis decide for the whole axis.
    checked = []
    for dim, size in axes.sizes.items():
        along = [values for dims, values in axes.columns.values() if dim in dims]
        monotone = len(along) == 1 and along[0].ndim == 1 and along[0].dtype.kind == "f"
        checked.append(np.unique([along[0].argmin(), along[0].argmax()]) if monotone else np.arange(size))
    shape = (1, *map(len, checked))
    total = math.prod(shape)
    section, able = scene.structure.section, MODELS[scene.structure.model].sections
    # Without a section at turns, a motion without a period has no cycles.
    needed = section.at == "period" if section is not None else scene.structure.exponent and "turn" not in able
    periodic = not needed
    for start in range(0, total, _CELLS_AT_ONCE):
        flat = np.arange(start, min(start + _CELLS_AT_ONCE, total))
        numbers = np.unravel_index(flat, shape)[1:]
        indices = {dim: along[number] for dim, along, number in zip(axes.sizes, checked, numbers, strict=True)}
        for structure, _, values in by_law(scene, axes, indices, len(flat)):
            try:
                made = batch(structure, values)
            except InputError as error:
                if any(path.rpartition(".")[2] in str(error) for path in axes.columns):
                    error.problem += " (in a cell of the sweep)"
                raise
            periodic = periodic or bool(np.isfinite(made.forcing_period).any())
    if not periodic:
        others = "give one, or state it by `period`" + (", or take `turn`" if "turn" in able else "")
        where = "record.section.at" if section is not None else "record.exponent"
        raise InputError(where, f"neither force nor drive has a period: {others}")
