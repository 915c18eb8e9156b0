"""What a model offers to the solvers: the whole of what a solver knows of it.

A scene is one cell of a batch; its type decides the bodies. A state is a tuple of floats. An
inspection is the model's own account of a state: rates, reactions, distance from the end of its
validity.
"""

from __future__ import annotations

from ringsweep.compile import absorbed_hook, hook


@hook
def launch(scene):
    """State at t = 0."""


@absorbed_hook
def rates(scene, now, y, drive_at, drive_rate):
    """Time derivative of the state `y` while the drive is at `drive_at` and moves at `drive_rate`.

    `now` is the inspection of the state at which the step began.
    """


@absorbed_hook
def inspect(scene, y, drive_at, drive_rate):
    """Inspection of the state `y`; its field ``rates`` is the time derivative."""


@hook
def lanes(scene):
    """How many runs of such a scene stand side by side in the kernel of a constant step: `Several` or `Single`."""


@absorbed_hook
def holds(scene, now):
    """Whether the model still holds in an inspected state; where not, :func:`verdict` says why."""


@hook
def verdict(scene, before, now):
    """How the run stands after passing from inspection `before` to `now`.

    Returns
    -------
    tuple
        ``(status, fraction)``: a status of :mod:`ringsweep.models.ring.record`, and the fraction of the step
        after which it was reached.
    """


@absorbed_hook
def stiffness(scene, before, now, h):
    """Largest magnitude of the eigenvalue times `h` that a step of `h` seconds met."""


@absorbed_hook
def slack(scene, before, now):
    """How far from its end the model stayed within a step between two inspections, bounded from below; in its own unit.

    A guard that turns between two instants has changed by more than four times its dip in the step before or after.
    """


@absorbed_hook
def stride(scene, now, h):
    """Share of the narrowest segment of the surface that the body slides across in a step of `h` seconds."""


@hook
def falls(scene, before, now, h):
    """How fast the guard fell that ended a run in a step of `h` seconds between two inspections, its unit times 1/s."""


@hook
def begin(scene, y, now):
    """Record of a run at its launch."""


@absorbed_hook
def observe(scene, record, y, before, now, t, h):
    """Record after a step of `h` seconds to the state `y` at time `t`."""


@hook
def conclude(scene, record, status, t, y):
    """Outcome of a run: a tuple of floats, one for each of the model's outcomes."""


@hook
def describe(scene, y, drive_at, drive_rate):
    """One row of a time history: a tuple of floats, one for each of the model's history variables."""


@hook
def enter(scene, t, y):
    """Status and mode of the piecewise-smooth system in the state `y` at time `t`."""


@hook
def embark(scene):
    """Time at which the run begins, and the state there in the coordinates of the piecewise-smooth system."""


@hook
def stiff_start(scene, mode, t, y):
    """Record of a run that begins in the state `y`, for laws without series."""


@hook
def rows(scene):
    """Number of rows of the series, and the first row that is a guard."""


@hook
def start(scene, c):
    """Record of a run whose first series is `c`."""


@hook
def finish(scene, record, status, t, y):
    """Outcome of a run in the coordinates of the piecewise-smooth system."""


@hook
def expand(scene, mode, t, y, tolerance, c):
    """Power series about `(t, y)` within a mode.

    Parameters
    ----------
    scene, mode : NamedTuple
    t : float
        Time, s.
    y : tuple of float
        State.
    tolerance : float
        Error allowed to a step, in units of the state.
    c : ndarray of shape ``(rows, columns)``
        Filled with the series; the last rows, one for each guard, are positive while the mode holds.

    Returns
    -------
    float
        Step over which the series meets the tolerance, s.
    """


@hook
def land(scene, mode, c, t, s):
    """State at time `t`, the step `s` after the series `c` began."""


@hook
def drift(scene, mode, c, s):
    """Time derivative of the state, the step `s` after the series `c` began."""


@hook
def switch(scene, mode, guard, t, y):
    """Status and mode after the guard of that index has reached zero in the state `y`, and that state."""


@hook
def impasse(scene, mode, t, y):
    """Status of a run that finds no way on from the state `y`: jammed if that is on the brink of a jam, else broken."""


@hook
def watch(scene, record, mode, c, t, s, work):
    """Record after a step of length `s` from time `t` along the series `c`, extremes within it included."""


@hook
def sample(scene, mode, c, t, s):
    """One row of a time history at time `t`, the step `s` after the series `c` began."""


@hook
def onward(mode):
    """The mode after its first step, when no guard is zero any more for its having been entered."""


@hook
def creeps(scene, mode):
    """Whether the mode is one that can want implicit steps."""


@hook
def is_stiff(scene, mode, y, line):
    """Whether, linearised, the mode relaxes so fast, compared with its own motion, that it wants an implicit step."""


@hook
def to_stiff(scene, force, y):
    """State in the coordinates of the implicit method, in which nothing large cancels, under a :func:`forcing`."""


@hook
def from_stiff(scene, force, x):
    """State from the coordinates of the implicit method, under a :func:`forcing`."""


@hook
def forcing(scene, t):
    """What :func:`stiff_rates` needs of the time `t`."""


@hook
def stiff_rates(scene, mode, force, x):
    """Time derivative of the state in the coordinates of the implicit method, under a :func:`forcing`."""


@hook
def linearise(scene, mode, t, x):
    """Time derivative, Jacobian and partial derivative by time of :func:`stiff_rates`.

    The state is place, velocity and the deflection of each bristle, if there are any.

    Returns
    -------
    tuple
        ``(rates, core, bristles, drift)``: the Jacobian of place and velocity, row by row; for each bristle the
        derivative of the acceleration by its deflection, and of its rate by the velocity and by its deflection.
    """


@hook
def stiff_scales(scene, tolerance, x):
    """Error allowed to each component of the state `x` in the coordinates of the implicit method.

    With bristles one number more: that allowed to the acceleration.
    """


@hook
def stiff_view(scene, mode, t, x):
    """Guards of the mode, positive while it holds; place, velocity, acceleration and what :func:`stiff_watch` needs."""


@hook
def stiff_near(scene, motion):
    """How near to zero each guard is watched closely, whatever it does over a step; `motion` is that of a view."""


@hook
def stiff_motion(scene, t, x, line):
    """Velocity and acceleration of the body where it is linearised: at their zeros place and velocity are extreme."""


@hook
def stiff_watch(scene, record, mode, view, t, duration):
    """Record after `duration` seconds in the mode to a state at time `t` of which this is the view."""


@hook
def stiff_sample(scene, mode, t, x):
    """One row of a time history."""


@hook
def breach(scene, mode, force, y, rates, s, tolerance):
    """How far a state, and the rate at which it changes, break the law of the scene; from its formulas alone.

    Parameters
    ----------
    scene, mode : NamedTuple
    force : tuple of float
        The :func:`forcing` there.
    y, rates : tuple of float
        State of the piecewise-smooth system within a step, and its time derivative.
    s : float
        Length of the step, s.
    tolerance : float
        Error allowed to a step of the series.

    Returns
    -------
    tuple of float
        ``(breach, power)``: the largest violation of the friction law, of the balances and of the signs of reactions,
        measured by what the error allowed to a step makes of it; and the power of friction on the body, W.
    """


@hook
def energy(scene, force, y):
    """Mechanical energy of a state of the piecewise-smooth system, under a :func:`forcing`, J."""


@hook
def undecided(batch, rows, witness, fall):
    """Which runs of a batch hang, in their kind, by less than two resolutions differ; outside kernels.

    Parameters
    ----------
    batch : NamedTuple
        Scenes, whose type decides.
    rows, witness : ndarray of shape ``(cells, outcomes)``
        What the runs came to at both resolutions.
    fall : ndarray of shape ``(cells,)``
        How fast the guard fell by which each run ended, its unit times 1/s.

    Returns
    -------
    ndarray of bool, shape ``(cells,)``
    """
