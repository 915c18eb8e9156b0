"""Configuration text as plain values with the line of each; sections, names and lists of these, and their errors."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import logging
import math
import os
import re
import stat
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache
from numbers import Integral, Real
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import yaml
from numpy.typing import NDArray

from ringsweep.errors import InputError, nearest_name
from ringsweep.quantities import trailer
from ringsweep.quantities.parameters import Key, Parameter, declared
from ringsweep.quantities.units import LONG_INTEGER, NUMBER, check_unit, quantity, show, spelled
from ringsweep.quantities.variables import common_unit, written

logger = logging.getLogger("ringsweep")

#: What a configuration is read from: a YAML or a result file, or the mapping that it would hold.
Source = str | os.PathLike[str] | Mapping[str, Any]

#: Largest number of values on an axis, in a table, and in a configuration, with each as often as it occurs.
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


@cache
def warn_once(message: str, *arguments: Any) -> None:
    """Warn once per process: one command reads its configuration several times."""
    logger.warning(message, *arguments)


def suggestion(word: object, known: Iterable[str]) -> str:
    """End of a message about an unknown name: the nearest known name, and all known names."""
    names = list(dict.fromkeys(known))
    near = nearest_name(word, names)
    rest = "" if len(names) <= 40 else f", ... ({len(names)} in all)"
    return (f"; did you mean `{near}`?" if near else "") + f" (known: {', '.join(names[:40])}{rest})"


def check_keys(section: Iterable[Any], known: Iterable[str], path: str, problem: str = "unknown key") -> None:
    """Refuse keys of a section that are not known; `path` is that of the section."""
    for key in section:
        if key not in known:
            raise InputError(f"{path}.{key}", problem + suggestion(key, known))


def one_of(given: Any, known: Iterable[str], path: str, problem: str) -> str:
    """The name given, which must be a known one; else it has this problem, such as ``"is not a method"``."""
    if not isinstance(given, str) or given not in known:
        raise InputError(path, f"{show(given)} {problem}" + suggestion(given, known))
    return given


def missing(path: str, parameter: Parameter) -> str:
    """Message about a missing value: what it means, its unit and an example."""
    examples = {"rad": "15 deg", "m": "10 mm", "1": "0.2", "": "1"}
    unit = f", in {parameter.unit}" if parameter.unit not in ("", "1") else ""
    example = "5000" if parameter.whole else examples.get(parameter.unit, f"1 {parameter.unit}")
    return f"missing: {parameter.long_name}{unit} (for example `{path.rpartition('.')[2]}: {example}`)"


def read_values(given: Any, parameter: Parameter | Key, where: str, most: int = MAX_VALUES) -> NDArray[Any]:
    """Quantities or names from a sequence, shape ``(n,)``.

    Raises
    ------
    InputError
        If `given` is no such sequence, has more than `most` values, or one of its values is wrong.
    """
    given = spelled(given)
    if hasattr(given, "__array__"):
        given = np.asarray(given)
        if given.ndim != 1 or given.dtype.kind not in "iufOU":
            what = "names" if isinstance(parameter, Key) else "numbers"
            raise InputError(where, f"a list of {what} is expected, got shape {given.shape} of {given.dtype}")
    elif not isinstance(given, Sequence) or isinstance(given, str | bytes):
        raise InputError(where, f"a list of values is expected, got {show(given)}")
    # Of a part, since the length of a range may overflow.
    if (count := len(given[: most + 1])) > most or not count:
        raise InputError(where, f"more than {most} values are too many" if count else "empty: give at least one value")
    if isinstance(given, np.ndarray):
        ends = (given.min(), given.max()) if given.dtype.kind == "f" else (np.nan,)
        if isinstance(parameter, Parameter) and not parameter.whole and all(map(parameter.allows, ends)):
            return given.astype(float)
        given = given.tolist()
    if isinstance(parameter, Key):
        names, what = parameter.names, parameter.long_name
        return np.array([_registered(name, names, f"{where}.{i}", what) for i, name in enumerate(given)])
    try:
        return np.array([quantity(value, parameter, f"{where}.{i}") for i, value in enumerate(given)])
    except InputError:
        # A column has its unit in its header.
        if len(given) > 1 and (unit := common_unit(given)):
            check_unit(unit, parameter, where)
        raise


def _registered(given: object, known: Iterable[str], path: str, what: str) -> str:
    """The name of a part of the package, or of one that a user's own file defines."""
    own = ", and no file that the environment variable RINGSWEEP_LAWS names defines it"
    return one_of(given, known, path, f"is not a {what}" + (own if nearest_name(given, known) is None else ""))


#: What a section may hold under each of its keys. Reader and schema follow from it.
Keys = Mapping[str, Parameter | Key]


def keys_of(cls: Any) -> dict[str, Parameter | Key]:
    """Keys of a section from the fields of a dataclass: what their annotations declare, and flags of a method."""
    found, notes = dict[str, Parameter | Key](), declared(cls)
    for one in dataclasses.fields(cls):
        default: Any = None if one.default is dataclasses.MISSING else one.default
        if one.init and (one.name in notes or isinstance(default, bool)):
            found[one.name] = replace(notes.get(one.name, Key("whether the answer is checked")), default=default)
    return found


def read_keys(given: Any, keys: Keys | type, where: str) -> dict[str, Any]:
    """Values of a section by key, or by field of a dataclass; None where one is left out that has no default.

    Raises
    ------
    InputError
        If `given` is no section, has an unknown key or a wrong value, or lacks a key that must be given.
    """
    section, keys = section_of({where: given}, where, ""), keys_of(keys) if isinstance(keys, type) else keys
    check_keys(section, keys, where)
    found: dict[str, Any] = {}
    for name, key in keys.items():
        path, value = f"{where}.{name}", section.get(name, key.default)
        if name not in section and value is None:
            if isinstance(key, Parameter) and not key.optional:
                raise InputError(path, missing(name, key))
            if isinstance(key, Key) and key.example:
                raise InputError(path, f"missing: {key.long_name} (for example `{name}: {key.example}`)")
        elif isinstance(key, Parameter):
            number = quantity(value, key, path)
            value = int(number) if key.whole else number
        elif key.names:
            value = one_of(value, key.names, path, f"is no {key.long_name}")
        elif isinstance(key.default, bool) and not isinstance(value, bool):
            raise InputError(path, f"true or false is expected, got {show(value)}")
        found[name] = value
    return found


def section_of(parent: dict[str, Any], key: str, prefix: str) -> dict[str, Any]:
    """The section under `key`; `prefix` is the path of `parent` with a dot, for messages."""
    if key not in parent:
        raise InputError(f"{prefix}{key}", "missing")
    if not isinstance(parent[key], dict):
        raise InputError(f"{prefix}{key}", f"a section with keys is expected, got {show(parent[key])}")
    return parent[key]


def choose(registry: Mapping[str, Any], section: dict[str, Any], path: str, what: str) -> str:
    """The name under the last key of `path`, which must be a name of the registry."""
    key = path.rpartition(".")[2]
    if key not in section:
        raise InputError(path, f"missing: name a {what}: {', '.join(registry)}")
    return _registered(section[key], registry, path, what)
