"""What solvers need of a model: families of functions, with one body for each type of scene.

A scene is one cell of a batch, a ``NamedTuple`` of numbers. Its type decides which bodies run. A state is a tuple of
floats.

- :mod:`recorder`: the record of a run, and the outcome of the run. All solvers need it.
- :mod:`constant_step`: rates, and what ends a run. ``rk4`` needs it.
- :mod:`modes`: the modes of a piecewise-smooth system, and which mode follows another. ``event`` and ``implicit`` need
  it.
- :mod:`series`: power series within a mode. ``event`` needs it, and ``implicit`` for laws without bristles.
- :mod:`implicit`: the equations for implicit steps. ``implicit`` needs it.
- :mod:`audit`: whether a run obeys its friction law. The certificates of ``event`` and ``implicit`` need it.

``docs/extending.md`` shows how to write a model.
"""
