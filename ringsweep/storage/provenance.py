"""Provenance of results: what determines their bits, and the attributes of their files."""

from __future__ import annotations

import copy
import dataclasses
import hashlib
import json
import platform
import re
from collections.abc import Mapping
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from typing import Any

import llvmlite.binding
import numba
import numpy as np

from ringsweep.compile import SOURCES_DIGEST
from ringsweep.compile.cache import OWN_FILES
from ringsweep.config import Config, as_named
from ringsweep.errors import shortened
from ringsweep.models import model_of
from ringsweep.models.scene import ELSEWHERE, LAW
from ringsweep.physics.drives import DRIVES
from ringsweep.physics.friction import TRAITS

# Reading the metadata of a package takes milliseconds.
_version = cache(version)


@cache
def environment() -> dict[str, str]:
    """Versions that determine the bits of a result."""
    return {"ringsweep": _version("ringsweep"), "sources": SOURCES_DIGEST} | {
        name: _version(name) for name in ("numba", "llvmlite", "numpy", "scipy")
    }


@cache
def processor() -> str:
    """Processor for which kernels are compiled: its name, and a digest of its features.

    Another one may round sums of products differently, and so may the same one with a feature that is turned off.
    """
    options: Any = numba.config
    name = options.CPU_NAME or llvmlite.binding.get_host_cpu_name()
    features = options.CPU_FEATURES or llvmlite.binding.get_host_cpu_features().flatten()
    return f"{name}-{hashlib.sha256(features.encode()).hexdigest()[:8]}"


def identity(config: Config) -> dict[str, str]:
    """All that determines the bits of a sweep, by name: numbers in SI units, defaults, solver, versions.

    Units as typed, the order of keys and values that the sweep replaces do not change it.
    """
    scene, axes = config.scene, config.axes
    structure = scene.structure
    found = {
        "scene.model": structure.model,
        "scene.drive.law": structure.drive,
        "scene.zones": ", ".join(structure.arcs) or "none",
    }
    if LAW not in axes.columns:
        found[f"scene.{LAW}"] = structure.law
    curve = next((one.curve for one in scene.structures.values() if one.curve is not None), None)
    tables = {"friction": curve, "drive": structure.table, "force": structure.force, "body.load": structure.load}
    for path, table in tables.items():
        if table is not None:
            found[f"scene.{path}"] = f"a table of {len(table[0])} rows ({_digest(*table[:2])})"
            found |= {f"scene.{path}.interpolate": interpolate for interpolate in table[2:]}
    formulas = {f"friction.laws.{law}": own.own_law for law, own in scene.structures.items()}
    formulas |= {f"drive.{structure.drive_key}": structure.own_drive, "force.formula": structure.own_force}
    formulas["body.load.formula"] = structure.own_load
    found |= {f"scene.{path}": str(formula.__doc__) for path, formula in formulas.items() if formula is not None}
    for path, value in scene.values.items():
        if path not in axes.columns:
            # Numbers are the same, whichever of its two names the friction outside the zones has.
            found[f"scene.{as_named(path, ELSEWHERE[0])}"] = repr(float(value))
    asked = {"record.section": structure.section, "sweep.follow": config.follow, "sweep.refine": config.refine}
    for path, part in (asked | {"sweep.sample": config.sample, "solver": config.solver}).items():
        if part is not None:
            values = dataclasses.asdict(part).items()
            found |= {f"{path}.{key}": json.dumps(value) for key, value in values if value is not None}
    found |= {"solver": config.solver.name, "record.exponent": json.dumps(structure.exponent)}
    found["sweep"] = ", ".join(f"{name} {size}" for name, size in axes.sizes.items()) or "a single run"
    for path, (dims, column) in axes.columns.items():
        ends = " to ".join(f"{end:.6g}" if column.dtype.kind == "f" else str(end) for end in column.flat[[0, -1]])
        found[f"sweep.{path}"] = f"{column.size} values, {ends}, along {' x '.join(dims)} ({_digest(column)})"
    return found | environment()


# Digest of a column or a table, at the end of its description.
_DIGEST = re.compile(r" \([0-9a-f]{12}\)$")


def fingerprint(identity: Mapping[str, str]) -> str:
    """Digest of an identity: equal for sweeps that give the same bits."""
    return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()


def differences(old: Mapping[str, str], new: Mapping[str, str]) -> str:
    """Differences between two identities in words, without digests."""
    names = [name for name in {**environment(), **new, **old} if old.get(name) != new.get(name)]
    if {"ringsweep", "sources"} <= set(names):
        names.remove("sources")
    words = (_difference(name, old.get(name, "absent"), new.get(name, "absent")) for name in names)
    return shortened("; ".join(words), 500)


def _difference(name: str, *values: str) -> str:
    if name == "sources":
        # The version stays the same in a checkout.
        return "the source code of ringsweep has changed"
    old, new = (shortened(_DIGEST.sub("", value), 100) for value in values)
    return f"{name} was {old}, is {new}" if old != new else f"{name} has other values ({new})"


def attributes(config: Config) -> dict[str, Any]:
    """Attributes of a result. They are enough to compute it again."""
    model = model_of(config.scene.structure)
    versions = {"python": platform.python_version(), **environment(), "xarray": _version("xarray")}
    digest = versions.pop("sources")
    methods = {law: config.solver.resolved(structure) for law, structure in config.scene.structures.items()}
    options = {law: {"method": method.name, **dataclasses.asdict(method)} for law, method in methods.items()}
    source = f"ringsweep {_version('ringsweep')}"
    now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    return {
        "Conventions": "CF-1.11",
        "title": f"ringsweep: {model.doc}",
        "source": source,
        "history": f"{now} computed by {source}",
        "references": references(config),
        "comment": "angles are in radians; a number is missing (NaN) where the run has none, for example no separation",
        "ringsweep_version": _version("ringsweep"),
        "ringsweep_sources": digest,
        "fingerprint": fingerprint(identity(config)),
        "versions": json.dumps(versions),
        "platform": f"{platform.system()} {platform.machine()}",
        "processors": processor(),
        **({"own_files": ", ".join(own)} if (own := _own_files(config)) else {}),
        "method": config.solver.name,
        "solver": json.dumps(options if len(options) > 1 else next(iter(options.values()))),
        "configuration": json.dumps({**config.source, "scene": _with_defaults(config)}),
        "date_created": now,
    }


def _own_files(config: Config) -> list[str]:
    """Names of the user's files that define the model, a law, the drive or the method of a configuration."""
    scene = config.scene
    used = [type(config.solver), type(model_of(scene.structure)), DRIVES.get(scene.structure.drive)]
    used += [structure.law_type for structure in scene.structures.values()]
    return sorted(path.name for path in OWN_FILES if path.stem in {getattr(one, "__module__", "") for one in used})


def references(config: Config, of: str | None = None) -> str:
    """What a paper that uses a result of a version can cite: software, model and friction laws, a line each."""
    laws = (TRAITS[structure.law_type].source for structure in config.scene.structures.values())
    cited = f"ringsweep {of or _version('ringsweep')}", model_of(config.scene.structure).reference, *laws
    return "\n".join(dict.fromkeys(filter(None, cited)))


def _with_defaults(config: Config) -> dict[str, Any]:
    """The scene as the configuration has it, with the default of each number that it leaves out."""
    scene: dict[str, Any] = copy.deepcopy(config.source["scene"])
    for path, value in config.scene.values.items():
        if path in config.axes.columns:
            continue
        *sections, name = path.split(".")
        section: Any = scene
        for key in sections:
            section = section[int(key)] if isinstance(section, list) else section.setdefault(key, {})
        section.setdefault(name, value)
    return scene


def _digest(*arrays: Any) -> str:
    digest = hashlib.sha256()
    for array in map(np.asarray, arrays):
        # Names as a list: equal names must have equal digests, whatever the width of their array.
        numeric = array.dtype.kind in "fiu"
        digest.update(array.astype("<f8").tobytes() if numeric else json.dumps(array.tolist()).encode())
    return digest.hexdigest()[:12]
