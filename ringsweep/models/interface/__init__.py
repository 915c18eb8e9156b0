"""What solvers need of a model: families of functions, with a body for each type of scene.

A scene is one cell of a batch, a ``NamedTuple`` of numbers; its type decides the bodies. A state is a tuple of floats.

- :mod:`recorder`: what is remembered of a run, and its outcome. All solvers need it.
- :mod:`constant_step`: rates, and what ends a run. ``rk4`` needs it.
- :mod:`modes`: the modes of a piecewise-smooth system, and how one follows another. ``event`` and ``implicit`` need it.
- :mod:`series`: power series within a mode. ``event`` needs it, and ``implicit`` under laws without bristles.
- :mod:`implicit`: the equations for implicit steps. ``implicit`` needs it.
- :mod:`audit`: whether a run obeys its law. The certificates of ``event`` and ``implicit`` need it.

``docs/extending.md`` shows how a model is written.
"""
