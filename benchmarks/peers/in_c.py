"""`rk4.c`, Runge-Kutta 4 in scalar C, compiled at run time."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

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
#: Angular velocity below which a reversal does not count; the package has the same value.
_EPSILON_OMEGA = 1e-3
#: Number of columns of the outcomes of `rk4.c`, and the columns used here.
_COLUMNS, _T_END, _PHI_END, _CONTACT = 14, 0, 1, 3


class _Scene(ctypes.Structure):
    """`scene_t` of rk4.c."""

    _fields_ = [
        (name, ctypes.c_double)
        for name in (
            "mass", "inertia", "half_distance", "ball_radius", "radius", "gravity",
            "rough_s", "rough_k", "rest_s", "rest_k", "alpha", "v0", "epsilon_omega",
        )
    ]  # fmt: skip


def compiler() -> str | None:
    """First line of `cc --version`, or None if there is no compiler."""
    found = shutil.which("cc")
    if found is None:
        return None
    return subprocess.run([found, "--version"], check=True, capture_output=True, text=True).stdout.splitlines()[0]


@cache
def _library() -> Any:
    source = Path(__file__).with_name("rk4.c")
    with tempfile.TemporaryDirectory() as directory:
        target = Path(directory) / "rk4.so"
        compiled = target.with_suffix(".o")
        subprocess.run(["cc", *FLAGS, "-fPIC", "-c", str(source), "-o", str(compiled)], check=True)
        # Linked without -ffast-math, which would make the whole process flush denormal numbers to zero.
        subprocess.run(["cc", "-shared", str(compiled), "-o", str(target), "-lm"], check=True)
        run = ctypes.CDLL(str(target)).run
    vector = np.ctypeslib.ndpointer(dtype=np.float64, flags="C_CONTIGUOUS")
    run.restype = ctypes.c_int64
    run.argtypes = [
        ctypes.c_int64, vector, vector, ctypes.POINTER(_Scene), ctypes.c_int64, ctypes.c_double, vector,
    ]  # fmt: skip
    return run


def ring(law: Law, cells: Sequence[Cell], steps: int) -> Callable[[], Found]:
    """Function that runs cells of the ring with `steps` steps."""
    run = _library()
    amplitudes, half_angles = (np.array(column) for column in zip(*cells, strict=True))
    scene = _Scene(MASS, INERTIA, HALF_DISTANCE, BALL, RADIUS, GRAVITY, *ROUGH, *REST, *law, _EPSILON_OMEGA)

    def call() -> Found:
        out = np.empty((len(cells), _COLUMNS))
        if run(len(cells), amplitudes, half_angles, ctypes.byref(scene), steps, SPAN, out) != _COLUMNS:
            raise MemoryError("rk4.c found no memory for the table of the drive")
        return Found(out[:, _PHI_END], np.where(out[:, _CONTACT] > 0.0, out[:, _T_END], np.nan))

    return call
