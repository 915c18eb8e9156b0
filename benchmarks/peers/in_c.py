"""The ring in C by hand, compiled at run time: `rk4.c`, `plain.c`, `vector.cpp`, and `moreau_jean.c` for impacts.

`rk4.c` is Runge-Kutta 4 in scalar C with the account of the package. `plain.c` is the method as the paper has it, and
`vector.cpp` is the method as fast as we can make it; both have the account that :class:`Account` lists. `moreau_jean.c`
is the time stepping of the codes for nonsmooth mechanics, such as Siconos.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.peers.physics import (
    BALL,
    GRAVITY,
    HALF_DISTANCE,
    INERTIA,
    MASS,
    RADIUS,
    REST,
    ROUGH,
    SPAN,
    Cell,
    Found,
    Law,
)

FLAGS = ("-O3", "-march=native", "-ffast-math")
PLAIN_FLAGS = ("-O3", "-march=native")
#: The rounding to integers of `vector.cpp` would not survive the rest of -ffast-math. The last two interleave groups.
VECTOR_FLAGS = (
    *PLAIN_FLAGS, "-fno-math-errno", "-fno-trapping-math", "-fno-signed-zeros", "-ffinite-math-only",
    "-fschedule-insns", "-fsched-pressure",
)  # fmt: skip
#: Angular velocity below which a reversal does not count; the package has the same value.
_EPSILON_OMEGA = 1e-3
#: Number of columns of the outcomes of `rk4.c`, and the columns used here.
_COLUMNS, _T_END, _PHI_END, _CONTACT = 14, 0, 1, 3


class Account(NamedTuple):
    """Account of runs by `plain.c` and `vector.cpp`, one value for each cell."""

    phi_end: Any
    omega_end: Any
    normal_min_1: Any
    normal_min_2: Any
    reversals: Any


class _ImpactScene(ctypes.Structure):
    """`scene_t` of moreau_jean.c."""

    _fields_ = [
        (name, ctypes.c_double)
        for name in (
            "mass", "inertia", "half_distance", "ball_radius", "radius", "gravity", "rough", "rest", "restitution",
        )
    ]  # fmt: skip


class _Scene(ctypes.Structure):
    """`scene_t` of rk4.c; that of plain.c and vector.cpp lacks the last member."""

    _fields_ = [
        (name, ctypes.c_double)
        for name in (
            "mass", "inertia", "half_distance", "ball_radius", "radius", "gravity",
            "rough_s", "rough_k", "rest_s", "rest_k", "alpha", "v0", "epsilon_omega",
        )
    ]  # fmt: skip


def compiler(name: str = "cc") -> str | None:
    """First line of `cc --version`, or None if there is no compiler; `c++` likewise."""
    found = shutil.which(name)
    if found is None:
        return None
    return subprocess.run([found, "--version"], check=True, capture_output=True, text=True).stdout.splitlines()[0]


@cache
def _library(name: str, flags: tuple[str, ...]) -> Any:
    """The function `run` of a source file."""
    source = Path(__file__).with_name(name)
    command = "c++" if source.suffix == ".cpp" else "cc"
    with tempfile.TemporaryDirectory() as directory:
        target = Path(directory) / "library.so"
        compiled = target.with_suffix(".o")
        subprocess.run([command, *flags, "-fPIC", "-c", str(source), "-o", str(compiled)], check=True)
        # Linked without -ffast-math, which would make the whole process flush denormal numbers to zero.
        subprocess.run([command, "-shared", str(compiled), "-o", str(target), "-lm"], check=True)
        run = ctypes.CDLL(str(target)).run
    vector = np.ctypeslib.ndpointer(dtype=np.float64, flags="C_CONTIGUOUS")
    scene = _ImpactScene if name == "moreau_jean.c" else _Scene
    run.argtypes = [
        ctypes.c_int64, vector, vector, ctypes.POINTER(scene), ctypes.c_int64, ctypes.c_double, vector,
    ]  # fmt: skip
    return run


def _arguments(scene: ctypes.Structure, cells: Sequence[Cell], steps: int) -> tuple[Any, ...]:
    """Arguments of the function `run` before the last."""
    amplitudes, half_angles = (np.array(column) for column in zip(*cells, strict=True))
    return len(cells), amplitudes, half_angles, scene, steps, SPAN


def _under(law: Law) -> _Scene:
    return _Scene(MASS, INERTIA, HALF_DISTANCE, BALL, RADIUS, GRAVITY, *ROUGH, *REST, *law, _EPSILON_OMEGA)


def ring(law: Law, cells: Sequence[Cell], steps: int) -> Callable[[], Found]:
    """Function that runs cells of the ring with `steps` steps of `rk4.c`."""
    run, given = _library("rk4.c", FLAGS), _arguments(_under(law), cells, steps)
    run.restype = ctypes.c_int64

    def call() -> Found:
        out = np.empty((len(cells), _COLUMNS))
        if run(*given, out) != _COLUMNS:
            raise MemoryError("rk4.c found no memory for the table of the drive")
        return Found(out[:, _PHI_END], np.where(out[:, _CONTACT] > 0.0, out[:, _T_END], np.nan))

    return call


def moreau_jean(restitution: float, cells: Sequence[Cell], steps: int) -> Callable[[], Found]:
    """Function that runs cells of the ring with `moreau_jean.c`: Coulomb's law with mu_s, impacts of lost contacts."""
    run = _library("moreau_jean.c", PLAIN_FLAGS)
    scene = _ImpactScene(MASS, INERTIA, HALF_DISTANCE, BALL, RADIUS, GRAVITY, ROUGH[0], REST[0], restitution)
    given = _arguments(scene, cells, steps)
    run.restype = None

    def call() -> Found:
        out = np.empty((len(cells), len(Found._fields)))
        run(*given, out)
        return Found(*out.T)

    return call


def plain(law: Law, cells: Sequence[Cell], steps: int) -> Callable[[], Account]:
    """Function that runs cells of the ring with `steps` steps of `plain.c`."""
    return _accounts(_library("plain.c", PLAIN_FLAGS), law, cells, steps)


def vector(law: Law, cells: Sequence[Cell], steps: int) -> Callable[[], Account]:
    """Function that runs cells of the ring with `steps` steps of `vector.cpp`."""
    return _accounts(_library("vector.cpp", VECTOR_FLAGS), law, cells, steps)


def _accounts(run: Any, law: Law, cells: Sequence[Cell], steps: int) -> Callable[[], Account]:
    given = _arguments(_under(law), cells, steps)
    run.restype = None

    def call() -> Account:
        out = np.empty((len(cells), len(Account._fields)))
        run(*given, out)
        return Account(*out.T)

    return call
