"""Where a result comes from: what determines its bits, and what its file says about it."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import platform
from collections.abc import Mapping
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from typing import Any

import llvmlite.binding
import numpy as np

from ringsweep.compile import SOURCES_DIGEST
from ringsweep.config import Config
from ringsweep.models import MODELS
from ringsweep.models.scene import LAW


@cache
def environment() -> dict[str, str]:
    """Versions that decide the bits of a result."""
    return {"ringsweep": version("ringsweep"), "sources": SOURCES_DIGEST} | {
        name: version(name) for name in ("numba", "llvmlite", "numpy", "scipy")
    }


@cache
def processor() -> str:
    """Name of the processor that kernels are compiled for; another may round sums of products otherwise."""
    return str(llvmlite.binding.get_host_cpu_name())


def identity(config: Config) -> dict[str, str]:
    """All that decides the bits of a sweep, by name: numbers in SI units, defaults filled in, versions.

    What does not decide them (units as typed, the order of keys, values that a sweep replaces) leaves it as it is.
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
    if structure.table is not None:
        found["scene.drive"] = f"a table of {len(structure.table[0])} samples ({_digest(*structure.table)})"
    found |= {f"scene.{path}": repr(float(value)) for path, value in scene.values.items() if path not in axes.columns}
    found["sweep"] = ", ".join(f"{name} {size}" for name, size in axes.sizes.items()) or "a single run"
    for path, (dims, column) in axes.columns.items():
        ends = " to ".join(f"{end:.6g}" if column.dtype.kind == "f" else str(end) for end in column.flat[[0, -1]])
        found[f"sweep.{path}"] = f"{column.size} values, {ends}, along {' x '.join(dims)} ({_digest(column)})"
    return found | {"solver": repr(config.solver)} | environment()


# Differences that are told one by one.
_MOST = 4


def fingerprint(identity: Mapping[str, str]) -> str:
    """A digest of an identity, the same for all that give the same bits."""
    return hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()


def differences(old: Mapping[str, str], new: Mapping[str, str]) -> str:
    """In words, what of an identity is not as it was."""
    names = [name for name in {**new, **old} if old.get(name) != new.get(name)]
    if "sources" in names:
        # Versions of a checkout stay while its sources change.
        names = [name for name in names if name != "ringsweep"]
    words = [f"{name} was {_short(old.get(name))}, is {_short(new.get(name))}" for name in names[:_MOST]]
    return "; ".join(words + [f"and {len(names) - _MOST} more"] * (len(names) > _MOST))


def attributes(config: Config) -> dict[str, Any]:
    """Attributes of a file, from which its contents can be computed again."""
    model = MODELS[config.scene.structure.model]
    versions = {"python": platform.python_version(), **environment(), "xarray": version("xarray")}
    digest = versions.pop("sources")
    methods = {law: config.solver.resolved(structure) for law, structure in config.scene.structures.items()}
    options = {law: {"method": method.name, **dataclasses.asdict(method)} for law, method in methods.items()}
    return {
        "Conventions": "CF-1.11",
        "title": f"ringsweep: {model.doc}",
        "source": f"ringsweep {version('ringsweep')}",
        "ringsweep_version": version("ringsweep"),
        "ringsweep_sources": digest,
        "fingerprint": fingerprint(identity(config)),
        "versions": json.dumps(versions),
        "platform": f"{platform.system()} {platform.machine()}",
        "processors": processor(),
        "method": config.solver.name,
        "solver": json.dumps(options if len(options) > 1 else next(iter(options.values()))),
        "configuration": json.dumps(config.source, sort_keys=True),
        "date_created": datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
    }


def _digest(*arrays: Any) -> str:
    digest = hashlib.sha256()
    for array in arrays:
        # Texts are digested as such: their width in an array says nothing.
        digest.update(json.dumps(np.asarray(array).tolist()).encode())
    return digest.hexdigest()[:12]


def _short(value: str | None) -> str:
    if value is None:
        return "absent"
    return value if len(value) <= 100 else f"{value[:97]}..."
