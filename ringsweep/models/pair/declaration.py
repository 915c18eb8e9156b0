"""Two masses on a belt as a model: its parameters and its cells.

Nothing here runs in kernels; see :mod:`ringsweep.models.belt.model`.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from ringsweep.errors import InputError
from ringsweep.models.belt import Belt
from ringsweep.models.model import Model
from ringsweep.models.pair.words import OF_EACH
from ringsweep.models.parts import GRAVITY, MASS, SPAN
from ringsweep.models.scene import Structure, Values, require
from ringsweep.physics import friction, pair
from ringsweep.quantities.parameters import Parameter, declared
from ringsweep.quantities.variables import Variable

_MASSES = "1", "2"


class BeltPair(Model):
    """Two masses on a belt, coupled by a spring and a damper."""

    name: ClassVar[str] = "belt-pair"
    doc: ClassVar[str] = "two coupled masses on a moving belt"
    outcomes: ClassVar[tuple[str, ...]] = (
        *("regime", "motion", "t_end", "settled"),
        *(f"{name}_{i}" for i in _MASSES for name in OF_EACH),
    )
    place: ClassVar[str] = "x_1"
    place_end: ClassVar[str] = "x_end_1"
    drive_unit: ClassVar[str] = "m"
    own_variables: ClassVar[dict[str, Variable]] = {
        f"jump_max_{i}": Variable("m/s^2", f"largest jump of the acceleration of mass {i}") for i in _MASSES
    }

    def regimes(self, paths: Collection[str]) -> tuple[str, ...]:
        """Regimes that runs can have."""
        return Belt().regimes(())

    def takes(self, law: type) -> bool:
        """Laws whose friction in slip is constant."""
        return law in (friction.LAWS["coulomb"], friction.LAWS["stiction"])

    def scene_type(self, structure: Structure) -> type:
        """``BeltPair``."""
        return pair.BeltPair

    def history(self, structure: Structure) -> tuple[str, ...]:
        """Names of the history variables, in the order of their columns."""
        return tuple(f"{name}_{i}" for i in _MASSES for name in ("x", "velocity", "friction_force", "mode"))

    def parameters(self, structure: Structure) -> dict[str, Parameter]:
        """Parameters of a scene of this structure, by path."""
        if structure.two_way:
            problem = f"is two numbers; the masses of model {self.name} take one for both directions of sliding"
            raise InputError(f"scene.{structure.two_way[0]}", problem)
        of_belt = Belt().parameters(replace(structure, model=Belt.name))
        found = {f"body.mass_{i}": replace(MASS, long_name=f"mass {i}") for i in _MASSES}
        for i in _MASSES:
            about = f"stiffness of the spring from mass {i} to the wall, 0 without one"
            found[f"spring.stiffness_{i}"] = Parameter("N/m", about, lower=0.0)
        about = "stiffness of the spring between the masses"
        found["spring.coupling"] = Parameter("N/m", about, lower=0.0)
        for i in _MASSES:
            about = f"coefficient of the damper from mass {i} to the wall (default: 0)"
            found[f"damper.coefficient_{i}"] = Parameter("N s/m", about, lower=0.0, default=0.0)
        about = "coefficient of the damper between the masses (default: 0)"
        found["damper.coupling"] = Parameter("N s/m", about, lower=0.0, default=0.0)
        found["belt.velocity"] = of_belt["belt.velocity"]
        for name, p in friction.coefficients_of(structure.law_type).items():
            found[f"friction.{name}"] = p
            about = f"{p.long_name} of mass 2 (default: that of mass 1)"
            found[f"friction.{name}_2"] = replace(p, long_name=about, default=None, optional=True)
        found |= {f"drive.{name}": of_belt[f"drive.{name}"] for name in declared(structure.drive_type)}
        for i in _MASSES:
            about = f"velocity of mass {i} at the start (default: that of the belt)"
            found[f"initial.x_{i}"] = Parameter("m", f"displacement of mass {i} at the start", default=0.0)
            found[f"initial.velocity_{i}"] = Parameter("m/s", about, optional=True)
        return found | {"time.span": SPAN, "gravity": GRAVITY}

    def build(self, structure: Structure, values: Values) -> pair.BeltPair:
        """Cells that kernels run over; see :meth:`ringsweep.models.model.Model.build`."""
        first, second = (_alone(structure, values, i) for i in _MASSES)
        body = pair.Pair(
            *(values[f"{of}_{i}"] for of in ("body.mass", "spring.stiffness", "damper.coefficient") for i in _MASSES),
            *(values[path] for path in ("spring.coupling", "damper.coupling", "gravity")),
        )
        return pair.BeltPair(body, first, second, first.law, first.drive, first.span)


def _alone(structure: Structure, values: Values, i: str) -> Any:
    """Cells of one mass if the other one followed it without inertia and friction, on its spring."""
    shared = {path: v for path, v in values.items() if path.partition(".")[0] in ("belt", "drive", "time", "gravity")}
    own = {
        f"{of}.{name}": f"{of}.{name}_{i}" for of, name in (("body", "mass"), ("initial", "x"), ("initial", "velocity"))
    }
    found = shared | {path: values[of_mass] for path, of_mass in own.items() if of_mass in values}
    coupling, other = values["spring.coupling"], values["spring.stiffness_1" if i == "2" else "spring.stiffness_2"]
    both = coupling + other
    # Two springs in a row. A stiff one between the masses leaves the slow swing of both.
    in_a_row = coupling * np.divide(other, both, out=np.zeros_like(both), where=both > 0.0)
    found["spring.stiffness"] = values[f"spring.stiffness_{i}"] + in_a_row
    names = friction.coefficients_of(structure.law_type)
    for path in (f"friction.{name}" for name in names):
        found[path] = values.get(f"{path}_{i}", values[path])
    if i == "2" and len(names) == 2:
        mu_s, mu_k = found["friction.mu_s"], found["friction.mu_k"]
        require(mu_s >= mu_k, "friction.mu_k_2", mu_k, "{} exceeds the static friction coefficient of mass 2")
    return Belt().build(replace(structure, model=Belt.name), found)
