"""A scene: its model, friction law and drive, and their numbers.

The *structure* of a scene decides which code is compiled. A sweep varies the *values*: numbers by dotted path.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from ringsweep.errors import InputError
from ringsweep.physics.drives import DRIVES, FORMULAS
from ringsweep.physics.friction import LAWS
from ringsweep.physics.friction.velocity import EXPRESSIONS
from ringsweep.quantities.parameters import Key, Parameter

Values = Mapping[str, NDArray[np.float64]]

#: Path of the friction law: the only path without a number that a sweep can vary.
LAW = "friction.law"

#: Keys of ``friction`` under which the coefficients outside the zones may stand; both have one meaning.
ELSEWHERE = "elsewhere", "rest"

#: Keys of a friction coefficient that depends on the direction of sliding.
WAYS = "forward", "backward"


#: Values of ``friction.frame``: where the zones of a belt lie.
FRAMES = {"belt": "the zones move with the belt, and repeat with belt.period", "space": "the zones stand in space"}


_OWN_PERIOD = Parameter(
    "s", "time between two points, where force and drive have no period", 0.0, open_lower=True, optional=True
)

#: Values of ``record.section.at``.
INSTANTS = {"period": "the end of each period of force or drive", "turn": "each maximum of x, on the belt"}


@dataclass(frozen=True)
class Section:
    """Points of a motion that a run keeps.

    Attributes
    ----------
    at : str
        ``period`` (of drive or force) or ``turn`` (maxima of the displacement).
    keep : int
        Number of points: the last ones of the run.
    deflections : bool
        Whether a point holds the deflection of bristles: true if a law of the sweep has them.
    period : float, optional
        Time between two points, s, where neither force nor drive has a period.
    """

    at: Annotated[str, Key("instant of a section", INSTANTS, example="period")]
    deflections: bool
    keep: Annotated[int, Parameter("1", "number of points, the last of a run", 1, 16384)] = 64
    period: Annotated[float | None, _OWN_PERIOD] = None


@dataclass(frozen=True)
class Structure:
    """The parts of a scene that are not numbers.

    Attributes
    ----------
    model, law, drive : str
        Names of the model, the friction law and the drive.
    arcs : tuple of str
        Paths of the zones: ``()``, ``("zone",)`` or ``("zones.0", "zones.1", ...)``.
    table : tuple, optional
        Times (s) and angles (rad) of a drive from a table, each of shape ``(samples,)``, and its interpolation.
    own_law : type, optional
        Type of the friction law if the configuration defines it.
    curve : tuple of ndarray, optional
        Sliding speeds (m/s) and friction coefficients of a law from a table, each of shape ``(points,)``.
    force : tuple, optional
        Times (s) and forces (N) of a force from a table, each of shape ``(samples,)``, and its interpolation.
    load : tuple, optional
        The same of a normal load from a table, N.
    own_drive, own_force, own_load : type, optional
        Types of the drive, of the force on the body and of its normal load if they are defined by formulas.
    impact : bool
        Whether a run goes on after a contact is lost, or a belt has stops.
    steady : bool
        Whether the body is launched at steady slip, see :mod:`ringsweep.models.belt.model`.
    exponent : bool
        Whether the record of a run holds its exponent and multipliers.
    section : Section, optional
        Points that a run keeps.
    elsewhere : str
        Which of :data:`ELSEWHERE` the configuration has.
    frame : str
        Which of :data:`FRAMES` the zones of a belt have.
    two_way : tuple of str
        Paths of the friction coefficients that are given for both directions, under :data:`WAYS`.
    """

    model: str
    law: str
    drive: str = "none"
    arcs: tuple[str, ...] = ()
    table: tuple[NDArray[np.float64], NDArray[np.float64], str] | None = None
    own_law: type | None = None
    curve: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
    force: tuple[NDArray[np.float64], NDArray[np.float64], str] | None = None
    load: tuple[NDArray[np.float64], NDArray[np.float64], str] | None = None
    own_drive: type | None = None
    own_force: type | None = None
    own_load: type | None = None
    impact: bool = False
    steady: bool = False
    exponent: bool = False
    section: Section | None = None
    elsewhere: str = "rest"
    frame: str = "belt"
    two_way: tuple[str, ...] = ()

    @property
    def law_type(self) -> type:
        """Type of the friction law."""
        return self.own_law or LAWS[self.law]

    @property
    def by_direction(self) -> tuple[str, ...]:
        """Paths of what makes friction depend on the direction of sliding; empty if it does not."""
        expression = EXPRESSIONS.get(self.law_type)
        return (*self.two_way, LAW) if expression is not None and expression.signed else self.two_way

    @property
    def drive_type(self) -> type:
        """Type of the drive."""
        return self.own_drive or DRIVES[self.drive]

    @property
    def drive_key(self) -> str:
        """Key of ``drive`` that has its formula."""
        return "velocity" if self.own_drive is not None and FORMULAS[self.own_drive].by_rate else "theta"


@dataclass(frozen=True)
class Scene:
    """The scene of a configuration.

    Attributes
    ----------
    structures : dict of str to Structure
        Structures by the name of the friction law. There are several if a sweep varies the law; they differ in nothing
        else.
    values : mapping of str to float
        Values in SI units, by dotted path, with the parameters of all friction laws.
    source : mapping
        The scene as the configuration has it.
    """

    structures: dict[str, Structure]
    values: Mapping[str, float]
    source: Mapping[str, Any] = field(default_factory=dict)

    @property
    def structure(self) -> Structure:
        """The structure; the first one if a sweep varies the friction law."""
        return next(iter(self.structures.values()))


def require(allowed: Any, path: str, values: Any, problem: str) -> None:
    """Raise an `InputError` unless all `values` are allowed.

    Parameters
    ----------
    allowed : bool or ndarray of bool
        Whether each value is allowed.
    path : str
        Path of the values in the scene.
    values : float or ndarray
    problem : str
        Message; ``{}`` stands for the first value that is not allowed.

    Raises
    ------
    InputError
    """
    allowed, values = np.broadcast_arrays(np.atleast_1d(allowed), np.atleast_1d(values))
    if not allowed.all():
        raise InputError(f"scene.{path}", problem.format(f"{values[~allowed][0]:.6g}"))
