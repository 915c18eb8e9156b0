"""Digests of what a result file holds: from them a reader can tell whether the file is what was written.

A file has a digest for each of its attributes and variables, all in its attribute ``digest``. They cover values, types,
dimensions, and the attributes of a variable that say what its values mean. They do not cover compression, chunks, the
order of attributes, and what other programs add.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

#: Attribute that holds the digests.
ATTRIBUTE = "digest"

#: Message about a file that differs from its digests; the usual reason comes first.
ALTERED = "is a part of a result, or another program changed it, or it is damaged"

#: Attributes of a file that have no digest: every program that changes a file adds a line to its history.
FREE = ("history",)

_BYTES = 16

_MEANING = ("long_name", "units", "path", "flag_values", "flag_meanings", "ancillary_variables")


def of_attribute(value: Any) -> str:
    """Digest of an attribute of a file."""
    return _new(np.atleast_1d(value).tolist()).hexdigest()


def of_variable(variable: Any, parts: Iterable[ArrayLike] = ()) -> Any:
    """Digest of a variable of an open netCDF4 file, to which :func:`add` adds more values."""
    attributes = {name: variable.getncattr(name) for name in _MEANING if name in variable.ncattrs()}
    kind = np.dtype(variable.dtype) if variable.dtype is not str else None
    if kind is not None and kind.kind in "iu" and "_FillValue" in variable.ncattrs():
        # Readers take these values for missing ones. Among floats they are NaN already.
        attributes["_FillValue"] = variable.getncattr("_FillValue")
    plain = {name: np.atleast_1d(value).tolist() for name, value in attributes.items()}
    text = "text" if kind is None else kind.newbyteorder("<").str
    digest = _new([variable.dimensions, variable.shape, text, plain])
    for part in parts:
        add(digest, part)
    return digest


def add(digest: Any, values: ArrayLike) -> None:
    """Add values to the digest of a variable."""
    array = np.asarray(values)
    if array.dtype.kind in "OU":
        digest.update(json.dumps(array.tolist()).encode())
    else:
        digest.update(np.ascontiguousarray(array, dtype=array.dtype.newbyteorder("<")).data)


def _new(head: Any) -> Any:
    return hashlib.blake2b(json.dumps(head, sort_keys=True).encode(), digest_size=_BYTES)


@dataclass(frozen=True)
class Digests:
    """What a file records of its contents.

    Attributes
    ----------
    dimensions : dict of str to int
    attributes, variables : dict of str to str
        Digest of each by name.
    block : list of int or None
        Edges of the blocks of the grid, whose cells the digests of outcomes take block after block; None if they take
        each variable whole, as those of coordinates always do.
    """

    dimensions: dict[str, int]
    attributes: dict[str, str]
    variables: dict[str, str]
    block: list[int] | None = None

    @property
    def text(self) -> str:
        """The attribute of the file."""
        return json.dumps({"algorithm": f"blake2b, {_BYTES} bytes", **asdict(self)})

    @classmethod
    def read(cls, file: Any) -> Digests | None:
        """The digests in an open netCDF4 file; None if it has none.

        Raises
        ------
        ValueError
            If they are damaged.
        """
        if ATTRIBUTE not in file.ncattrs():
            return None
        found = json.loads(file.getncattr(ATTRIBUTE))
        try:
            digests = cls(**{field.name: found[field.name] for field in fields(cls)})
        except (KeyError, TypeError) as error:
            raise ValueError("the digests are damaged") from error
        if not digests.attributes or not digests.variables:
            raise ValueError("the digests say nothing")
        return digests

    def altered(
        self,
        file: Any,
        attributes: Iterable[str],
        variables: Iterable[str],
        blocks: Callable[[Sequence[int], list[int]], Iterable[tuple[slice, ...]]] | None = None,
    ) -> list[str]:
        """Names of the dimensions, attributes and variables, out of those given, that are not as they were written.

        Parameters
        ----------
        file : netCDF4.Dataset
            Open file. Values are read without masks and scales.
        attributes, variables : iterable of str
            What to look at.
        blocks : callable, optional
            Gives the blocks of a grid from its shape and the edges of a block; needed for outcomes.
        """
        found = {name: len(dimension) for name, dimension in file.dimensions.items()}
        # The shape of a damaged variable could be too large to read.
        if changed := [name for name, size in self.dimensions.items() if found.get(name) != size]:
            return changed
        file.set_auto_maskandscale(False)

        def variable(name: str) -> str:
            one = file.variables[name]
            regions: Iterable[Any] = [...]
            outcome = "path" not in one.ncattrs() and name not in file.dimensions
            if blocks is not None and self.block is not None and outcome:
                regions = blocks(one.shape, self.block)
            return str(of_variable(one, (one[region] for region in regions)).hexdigest())

        return [
            *_differing(self.attributes, attributes, lambda name: of_attribute(file.getncattr(name))),
            *_differing(self.variables, variables, variable),
        ]


def _differing(recorded: dict[str, str], names: Iterable[str], now: Callable[[str], str]) -> list[str]:
    differing = []
    for name in names:
        try:
            same = now(name) == recorded[name]
        except Exception:
            # A name without a digest, or a damaged file, on which the NetCDF library raises errors of many kinds.
            same = False
        if not same:
            differing.append(name)
    return differing
