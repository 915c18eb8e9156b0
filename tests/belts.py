"""Belts of one kind: tests whose claims do not depend on the parts of a belt share one kernel for each law."""

import numpy as np

import ringsweep


def on_belt(
    friction, stiffness=1.0, *, mass=1.0, cubic=None, damping=None, velocity=None, gravity=None, force=None,
    start=None, span=None,
):  # fmt: skip
    """Scene of a body on a belt, from its numbers (SI).

    A force is its amplitude, frequency and, if it has one, phase; a start is a displacement, or displacement and
    velocity. What is not given is left out.
    """
    spring = {"stiffness": stiffness} | ({} if cubic is None else {"cubic": cubic})
    found = {"model": "belt", "body": {"mass": mass}, "spring": spring, "friction": friction}
    parts = {"damper": ("coefficient", damping), "belt": ("velocity", velocity), "time": ("span", span)}
    found |= {part: {name: value} for part, (name, value) in parts.items() if value is not None}
    if gravity is not None:
        found["gravity"] = gravity
    if force is not None:
        found["force"] = dict(zip(("amplitude", "frequency", "phase"), force, strict=False))
    if start is not None:
        found["initial"] = dict(zip(("x", "velocity"), start, strict=False))
    return found


def with_all_parts(scene):
    """A scene on a belt of constant velocity, with cubic spring, damper and force; those that it lacks are 0."""
    spring, damper = {"cubic": 0.0} | scene["spring"], {"coefficient": 0.0} | scene.get("damper", {})
    # A force without a frequency has no period, and leaves the motion a free one.
    force = {"amplitude": 0.0, "frequency": 0.0} | scene.get("force", {})
    return scene | {"spring": spring, "damper": damper, "force": force}


def outcome(scene, solver=None, **options):
    """Outcomes of one run."""
    method = {"method": "auto"} | (solver or {}) | options
    return ringsweep.sweep(scene, {"time.span": [scene["time"]["span"]]}, solver=method, progress=False).isel(
        time_span=0
    )


def with_exponent(scene, points=None, exponent=True, certify=False):
    """Outcomes with the largest Lyapunov exponent; `points` are columns of values by path."""
    config = {"scene": scene, "record": {"exponent": exponent}, "solver": {"method": "auto", "certify": certify}}
    if points is not None:
        config["sweep"] = {"points": {path: np.asarray(column).tolist() for path, column in points.items()}}
    return ringsweep.run(config, jobs=1, progress=False)
