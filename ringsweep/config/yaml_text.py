"""Configuration text as plain values, with the line of each value."""

from __future__ import annotations

import csv
import io
import json
import logging
import math
import os
import re
import stat
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from numbers import Integral, Real
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import yaml

from ringsweep.errors import InputError
from ringsweep.quantities import trailer
from ringsweep.quantities.units import LONG_INTEGER, NUMBER, show, spelled
from ringsweep.quantities.variables import written

logger = logging.getLogger("ringsweep")

#: What a configuration is read from: a YAML or a result file, or the mapping that it would hold.
Source = str | os.PathLike[str] | Mapping[str, Any]

#: Largest number of values in a configuration, with each value counted as often as it occurs.
MAX_VALUES = 1_000_000

_MAX_DEPTH = 30

# Sizes of files, in bytes. A configuration is read at some 100 kB/s.
_LARGEST_CONFIGURATION, _LARGEST_TABLE = 5_000_000, 500_000_000
_TAGS = {f"tag:yaml.org,2002:{name}" for name in ("null", "bool", "int", "float", "str", "timestamp", "map", "seq")}
# YAML gives "<<" and "=" tags of their own; here they are text.
_TAGS |= {"tag:yaml.org,2002:merge", "tag:yaml.org,2002:value"}


@dataclass
class Document:
    """A configuration as plain values.

    Attributes
    ----------
    tree : dict
        Nested dicts and lists of numbers, booleans, None and strings, as given.
    file : Path
        Its file, to whose folder file names in the configuration are relative.
    locations : dict of str to tuple
        File and line of each dotted path.
    columns : list of tuple, optional
        Axes in the place of those in the section ``sweep``; see :data:`ringsweep.config.axes.Given`. A program gives
        them, or a result file, whose coordinates have the dimensions that axes share.
    is_result : bool
        Whether it comes from a result file.
    """

    tree: dict[str, Any] = field(default_factory=dict)
    file: Path = Path("ringsweep")
    locations: dict[str, tuple[str | None, int | None]] = field(default_factory=dict)
    columns: list[tuple[Any, str, str, Any]] | None = None
    is_result: bool = False
    _count: int = 0

    @contextmanager
    def locating_errors(self) -> Iterator[None]:
        """Add file and line to errors that are raised within the block, from their path."""
        try:
            yield
        except InputError as error:
            # No line of the file is at fault for an option of a command.
            if error.file is None and not error.path.startswith("--"):
                path = error.path
                while path not in self.locations and path:
                    path = path.rpartition(".")[0]
                error.file, error.line = self.locations.get(path, (None, None))
            raise

    def plain(self, given: Any, path: str = "", depth: int = 0) -> Any:
        """What stands at a path, as plain values: a YAML node, whose lines are noted, or a value of a program."""
        self._count += 1
        if self._count > MAX_VALUES:
            problem = f"more than {MAX_VALUES} values after expanding aliases; put long columns into a CSV file"
            raise InputError(path, problem)
        if isinstance(given, yaml.Node):
            self.locations.setdefault(path, (str(self.file), given.start_mark.line + 1))
            if given.tag not in _TAGS:
                raise InputError(path, f"the tag {given.tag} is not allowed")
            if isinstance(given, yaml.ScalarNode):
                return scalar(given.value) if given.style is None else given.value
            given = given.value if isinstance(given, yaml.SequenceNode) else self._pairs(given, path)
        if depth > _MAX_DEPTH:
            raise InputError(path, "nested too deeply, or an alias within itself")
        if isinstance(given := spelled(given), Mapping):
            for key in given:
                if not isinstance(key, str):
                    raise InputError(path, f"keys are text, got {show(key)}")
            return {key: self.plain(child, _join(path, key), depth + 1) for key, child in given.items()}
        if isinstance(given, list | tuple | range) or (isinstance(given, np.ndarray) and given.ndim):
            return [self.plain(child, _join(path, i), depth + 1) for i, child in enumerate(given)]
        return _plain(given, path)

    def _pairs(self, node: yaml.Node, path: str) -> dict[str, yaml.Node]:
        found: dict[str, yaml.Node] = {}
        for key, child in node.value:
            within = _join(path, key.value) if isinstance(key, yaml.ScalarNode) else path
            self.locations[within] = str(self.file), key.start_mark.line + 1
            if within == path or key.tag not in _TAGS:
                raise InputError(within, "a key must be plain text")
            if key.value in found:
                raise InputError(within, "given twice")
            found[key.value] = child
        return found

    def inline_csv(self, name: Any, path: str, section: str, **names: str) -> dict[str, list[Any]]:
        """Columns of a CSV file by their names in its header. A unit in the header is appended to each value.

        Parameters
        ----------
        name : object
            File name as the configuration gives it.
        path : str
            Path of the file name in the configuration.
        section : str
            Path that the columns will have. Values are located as ``section.column.row``.
        **names
            Names of columns that have other names in the header.

        Raises
        ------
        InputError
            If the file cannot be read, or is no table with a header.
        """
        if not isinstance(name, str):
            raise InputError(path, f"a file name is expected, got {show(name)}")
        file = self.file.parent / name
        if self.is_result:
            # Results hold their tables, so this one was changed: it could name any file of the reader.
            logger.info("%s: read from %s", path, file)
        rows = csv.reader(io.StringIO(_read(file, _LARGEST_TABLE, path), newline=""), strict=True)

        def wrong(problem: str) -> InputError:
            return InputError(path, problem, file=str(file), line=rows.line_num or None)

        try:
            header = next(rows, [])
            if len(header) == 1 and (mark := next((mark for mark in ";\t|" if mark in header[0]), None)):
                raise wrong(f"the columns are separated by {mark!r}: separate them by commas")
            columns, units = dict[str, list[Any]](), list[str]()
            for cell in header:
                name, unit = name_and_unit(cell)
                if not name:
                    form = "a name is expected, and behind it the unit in brackets: phi (deg)"
                    raise wrong(f"column {show(cell.strip())}: {form}")
                if (name := names.get(name, name)) in columns:
                    raise wrong(f"two columns have the name {name}")
                columns[name] = []
                units.append(unit)
                self.locations[f"{section}.{name}"] = str(file), 1
            if not columns:
                raise wrong("the file is empty")
            for row in (row for row in rows if any(map(str.strip, row))):
                if len(row) != len(columns):
                    raise wrong(f"{len(row)} values under {len(columns)} columns")
                for column, unit, cell in zip(columns, units, row, strict=True):
                    self.locations[f"{section}.{column}.{len(columns[column])}"] = str(file), rows.line_num
                    columns[column].append(scalar(f"{cell.strip()} {unit}".strip()))
        except csv.Error as error:
            raise wrong(f"not a CSV file: {error}") from None
        return columns


def name_and_unit(header: str) -> tuple[str, str]:
    """Name and unit of a column, from a header such as ``phi (deg)``; both empty if it is none."""
    match = re.fullmatch(r"([^\s(\[]+)\s*(?:[(\[](.*)[)\]])?", header.strip())
    return (match[1], match[2] or "") if match else ("", "")


def read(config: Source) -> Document:
    """Read a configuration from a YAML file, from a result file or from a mapping.

    Raises
    ------
    InputError
        If it is no YAML mapping of plain values, or a result file without a configuration.
    """
    if isinstance(config, Mapping):
        doc = Document()
        doc.tree = doc.plain(config)
        return doc
    if not isinstance(config, str | os.PathLike):
        raise InputError("config", f"a path or a mapping is expected, got {show(config)}")
    if is_result(file := Path(config)):
        return _read_result(file)
    text, doc = _read(file, _LARGEST_CONFIGURATION), Document(file=file)
    try:
        node = yaml.compose(text, Loader=yaml.SafeLoader)
    # On escapes of characters that do not exist PyYAML raises ValueError or OverflowError.
    except (yaml.YAMLError, ValueError, OverflowError, RecursionError) as error:
        mark, problem = getattr(error, "problem_mark", None), getattr(error, "problem", None) or str(error)
        problem = "nested too deeply" if isinstance(error, RecursionError) else problem
        line = None if mark is None else mark.line + 1
        raise InputError("", f"not valid YAML: {' '.join(problem.split())}", file=str(file), line=line) from None
    if not isinstance(node, yaml.MappingNode):
        found = "is empty" if node is None else "holds no mapping"
        raise InputError("", f"{found}: a configuration has the sections scene, solver and sweep", file=str(file))
    with doc.locating_errors():
        doc.tree = doc.plain(node)
    return doc


def is_result(file: Path) -> bool:
    """Whether a file is of the kind of a result: it begins as HDF5 does."""
    try:
        with _opened(file) as content:
            return content.read(8) == b"\x89HDF\r\n\x1a\n"
    except (OSError, ValueError):
        return False


def _opened(file: Path) -> BinaryIO:
    """An open file; OSError if it is no regular file: reading a pipe or a device might never end."""
    if not stat.S_ISREG(file.stat().st_mode):
        raise OSError("a folder, a pipe or a device is no file to read")
    return file.open("rb")


def _read_result(file: Path) -> Document:
    """The configuration in the attributes of a result file."""
    import xarray as xr

    with trailer.opened(file, what="a result of ringsweep with a configuration") as content:
        tree = json.loads(content.getncattr("configuration"))
        if not isinstance(tree, dict):
            raise ValueError("a configuration is a mapping")
        if "from" in (written(tree, "initial") or {}):
            raise InputError("", "is damaged: a result holds its initial values")
        columns = None
        if "regime" in content.variables and not {"time", "contender", "word"} & set(content.dimensions):
            dims = content["regime"].dimensions
            swept = [variable for variable in content.variables.values() if "path" in variable.ncattrs()]
            columns = [
                (one.path, one.path, one.path, xr.Variable(one.dimensions, np.array(one[:].tolist())))
                for one in sorted(swept, key=lambda one: dims.index(one.dimensions[0]))
            ]
    doc = Document({}, file, {"": (str(file), None)}, columns, is_result=True)
    doc.tree = doc.plain(tree)
    return doc


def scalar(text: str) -> Any:
    """A plain scalar: None, a boolean, a number, or the text itself.

    YAML 1.1 reads ``1.0e5`` as text, ``010`` as eight and ``1:30`` as ninety. Here they are 100000, 10 and text.
    """
    if text in ("", "~", "null", "Null", "NULL"):
        return None
    if text in ("true", "True", "TRUE", "false", "False", "FALSE"):
        return text.lower() == "true"
    if len(text) <= 100 and NUMBER.fullmatch(text):
        number = float(text)
        if text.lstrip("+-").isdigit():
            return int(text)
        return number if math.isfinite(number) else text
    return text


def _plain(value: Any, path: str) -> str | bool | int | float | None:
    """A value that is no container."""
    if value is None or isinstance(value, str):
        return value
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, Integral):
        value = int(value)
        if abs(value) < LONG_INTEGER:
            return value
    elif isinstance(value, Real):
        return float(value)
    raise InputError(path, f"{show(value)} is no value for a configuration: give text, a number, a list or a mapping")


def _join(path: str, key: object) -> str:
    return f"{path}.{key}" if path else str(key)


def _read(file: Path, largest: int, path: str = "") -> str:
    """Text of a file that a path of a configuration names, or of the configuration itself."""
    try:
        with _opened(file) as content:
            if os.fstat(content.fileno()).st_size > largest:
                raise OSError(f"it is larger than {largest / 1e6:g} MB")
            return content.read(largest).decode("utf-8-sig")
    except (OSError, ValueError) as error:
        cause = "not a text file in UTF-8" if isinstance(error, UnicodeDecodeError) else error
        problem = f"cannot be read: {getattr(error, 'strerror', None) or cause}"
        raise InputError(path, f"{file} {problem}" if path else problem, file=None if path else str(file)) from None
