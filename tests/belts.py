"""Belts of one kind: tests whose claims do not depend on the parts of a belt share one kernel for each law."""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator

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


def by_scipy(scene, rtol=1e-12, max_step=np.inf):
    """Motion under stiction or Tustin's law, by SciPy from event to event; mass and weight are 1.

    Returns the parts, each with its direction of slip, which is 0 in stick. A state is displacement and sliding
    velocity. The second event of a part is a greatest displacement.
    """
    spring, law, v_belt = {"cubic": 0.0} | scene["spring"], scene["friction"], scene["belt"]["velocity"]
    damping = scene.get("damper", {"coefficient": 0.0})["coefficient"]
    force = {"frequency": 0.0, "phase": 0.0, "constant": 0.0} | scene["force"]
    table = PchipInterpolator(force["time"], force["force"]) if "time" in force else None

    def pull(t, x, v):
        push = table(t) if table else np.sin(2.0 * np.pi * force["frequency"] * t + force["phase"])
        elastic = spring["stiffness"] * x + spring["cubic"] * x**3
        return force["amplitude"] * push + force["constant"] - elastic - damping * (v + v_belt)

    def friction(v):
        drop = (law["mu_s"] - law["mu_k"]) * np.exp(-law["alpha"] * abs(v)) if "alpha" in law else 0.0
        return law["mu_k"] + drop

    def holds(t, y):
        return law["mu_s"] - abs(pull(t, y[0], 0.0))

    def turns(t, y):
        return y[1] + v_belt

    turns.direction = -1
    parts, t, end = [], 0.0, scene["time"]["span"]
    y = scene["initial"]["x"], scene["initial"]["velocity"] - v_belt
    while t < end:
        sticks = y[1] == 0.0 and holds(t, y) > 1e-9
        sign = 0.0 if sticks else np.sign(y[1] or pull(t, y[0], 0.0))

        def rates(t, y, sign=sign):
            return y[1] + v_belt, pull(t, *y) - sign * friction(y[1]) if sign else 0.0

        def ends(t, y, sign=sign):
            return sign * y[1] if sign else holds(t, y)

        ends.terminal, ends.direction = True, -1
        options = {"rtol": rtol, "atol": 0.1 * rtol, "max_step": max_step, "dense_output": True}
        part = solve_ivp(rates, (t, end), y, "DOP853", events=(ends, turns), **options)
        parts.append((part, sign))
        t, y = part.t[-1], (part.y[0, -1], 0.0 if part.status == 1 else part.y[1, -1])
    return parts


def states_at(parts, times):
    """States at some times of a motion by SciPy, of shape ``(times, 2)``."""
    return np.array([next(part.sol(t) for part, _ in parts if t <= part.t[-1]) for t in times])
