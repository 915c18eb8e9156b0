"""Calls that `benchmarks.against` times in two trees of the package: only what the public interface has had all along.

    python benchmarks/rows.py    # reads rows from standard input; answers with seconds and steps

This file is run by the Python of the tree that it times, and imports nothing of its own tree.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from math import ceil, radians
from typing import Any, NamedTuple

import numpy as np

#: Least time of a measurement, s: a call that is shorter is repeated.
SHORTEST = 0.1

#: The ring of the paper's Fig. 29 (SI units), without its friction law.
RING: dict[str, Any] = {
    "model": "ring",
    "body": {"mass": 0.076, "inertia": 4.47e-5, "half_distance": 0.025, "ball_radius": 0.01},
    "ring": {"radius": 0.043378},
    "zone": {"half_angle": radians(15.0)},
    "drive": {"law": "arctan", "amplitude": 2.0},
    "initial": {"phi": 0.0, "omega": 0.0},
    "time": {"span": 10.0},
}
ZONES = {"rough": {"mu_s": 0.5, "mu_k": 0.3}, "rest": {"mu_s": 0.2, "mu_k": 0.1}}
_BELT: dict[str, Any] = {
    "model": "belt",
    "body": {"mass": 1.0},
    "spring": {"stiffness": 2.0},
    "belt": {"velocity": 0.1},
    "time": {"span": 20.0},
}
_COEFFICIENTS = {"mu_s": 0.15, "mu_k": 0.1}
_FORCED = _BELT | {
    "belt": {"velocity": 0.0},
    "damper": {"coefficient": 0.1},
    "friction": {"law": "stiction", "mu_s": 0.06, "mu_k": 0.05},
    "force": {"amplitude": 1.0, "frequency": 0.2},
    "time": {"span": 500.0},
}


def ring(law: str, **numbers: float) -> dict[str, Any]:
    """Ring of the paper's Fig. 29 under a friction law."""
    return RING | {"friction": {"law": law, **numbers, **ZONES}}


def belt(law: str, **numbers: float) -> dict[str, Any]:
    """Belt of the paper under a friction law."""
    return _BELT | {"friction": {"law": law, **numbers, **_COEFFICIENTS}}


STICTION = ring("stiction")
STIFF = ring("bengisu-akay", alpha=1e5, v0=2e-6)
SMOOTH, SMOOTH_BELT = (scene("bengisu-akay", alpha=100.0, v0=0.01) for scene in (ring, belt))


class Sweep(NamedTuple):
    """Sweeps of one kind, of several sizes.

    Attributes
    ----------
    scene : dict
    sizes : tuple of int
        Cells of each sweep, squares of integers.
    axes : tuple of tuple
        Path, first and last value of each axis; values are in geometric progression.
    options : dict
        Further arguments of ``ringsweep.sweep``.
    """

    scene: dict[str, Any]
    sizes: tuple[int, ...]
    axes: tuple[tuple[str, float, float], ...] = (("drive.amplitude", 0.1, 10.0), ("zone.half_angle", 0.035, 1.05))
    options: dict[str, Any] = {}  # noqa: RUF012

    def call(self, size: int) -> Any:
        """Run the sweep, on one job."""
        import ringsweep

        side = round(size**0.5)
        axes = {path: np.geomspace(low, high, side) for path, low, high in self.axes}
        return ringsweep.sweep(self.scene, axes, jobs=1, progress=False, **self.options)


_ON_BELT = (("belt.velocity", 0.05, 0.5), ("friction.mu_s", 0.11, 0.2))
_BY_FORCE = (("force.frequency", 0.1, 0.4), ("force.amplitude", 0.8, 2.0))


def _rk4(steps: int) -> dict[str, Any]:
    return {"solver": {"method": "rk4", "steps": steps, "certify": False}}


SWEEPS = {
    "event, ring": Sweep(STICTION, (64, 4096, 16384)),
    "event, belt": Sweep(belt("stiction"), (64, 1024, 16384), _ON_BELT),
    "event, forced belt": Sweep(_FORCED, (64, 256, 1024), _BY_FORCE),
    "implicit, smooth": Sweep(SMOOTH, (64, 1024, 4096)),
    "implicit, smooth belt": Sweep(SMOOTH_BELT, (64, 1024, 4096), _ON_BELT),
    "implicit, default map": Sweep(STIFF, (64, 576, 2304)),
    "implicit, LuGre belt": Sweep(
        belt("lugre", sigma0=1e5, sigma1=316.2, sigma2=0.4, v_s=1e-3), (16, 64, 256), _ON_BELT
    ),
    "implicit, ring with bristles": Sweep(ring("lugre", sigma0=1e3, sigma1=30.0, sigma2=0.1, v_s=1e-2), (16, 64, 256)),
    "rk4, ring": Sweep(SMOOTH, (64, 1024, 4096), options=_rk4(1000)),
    "rk4, belt": Sweep(SMOOTH_BELT, (64, 1024, 16384), _ON_BELT, _rk4(1000)),
    "refined, event": Sweep(STICTION, (4096, 36864), options={"refine": True}),
    "refined, default map": Sweep(STIFF, (4096, 16384), options={"refine": True}),
    "impact": Sweep(STICTION | {"impact": {"restitution": 0.5}}, (64, 256, 1024)),
    "exponent": Sweep(_FORCED, (16, 64, 256), _BY_FORCE, {"record": {"exponent": True}}),
    "section": Sweep(_FORCED, (16, 64, 256), _BY_FORCE, {"record": {"section": {"at": "period", "keep": 64}}}),
}


def _sample(size: int) -> Any:
    import ringsweep

    drawn = {"friction.rest.mu_k": {"normal": [0.1, 0.01]}, "zone.half_angle": {"uniform": [0.17, 0.35]}}
    sweep = {"sample": {"n": size, "of": drawn}}
    return ringsweep.run({"scene": STICTION, "sweep": sweep}, jobs=1, progress=False)


def _simulate(size: int) -> Any:
    import ringsweep

    return ringsweep.simulate(STICTION)


def _threshold(size: int) -> Any:
    import ringsweep

    return ringsweep.threshold({"scene": STICTION}, "drive.amplitude", "separating", between=(0.1, 10.0), jobs=1)


#: Calls by name, with their sizes.
ROWS: dict[str, tuple[Callable[[int], Any], tuple[int, ...]]] = {
    **{name: (sweep.call, sweep.sizes) for name, sweep in SWEEPS.items()},
    "sample": (_sample, (64, 1024, 16384)),
    "simulate": (_simulate, (1,)),
    "threshold": (_threshold, (1,)),
}


def serve() -> None:
    """Answer each line, a row and a size in JSON, with seconds of a call and steps of all its cells, or an error.

    The first call of a row compiles it, and is not timed.
    """
    answers, sys.stdout = sys.stdout, sys.stderr
    repeats: dict[tuple[str, int], int] = {}
    for line in sys.stdin:
        name, size = json.loads(line)
        call = ROWS[name][0]
        try:
            if (name, size) not in repeats:
                call(size)
                begin = time.perf_counter()
                call(size)
                repeats[name, size] = ceil(SHORTEST / (time.perf_counter() - begin))
            count = repeats[name, size]
            begin = time.perf_counter()
            for _ in range(count):
                found = call(size)
            seconds = (time.perf_counter() - begin) / count
            steps = float(found.steps.sum()) if "steps" in found else None
            answer: dict[str, Any] = {"seconds": seconds, "steps": steps}
        except Exception as error:
            # An older tree lacks the feature.
            answer = {"error": f"{type(error).__name__}: {error}"}
        print(json.dumps(answer), file=answers, flush=True)


if __name__ == "__main__":
    serve()
