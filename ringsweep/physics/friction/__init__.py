"""Friction laws, one file to a family: to add a law is to add a class, its formula and its name to one of them.

Every law gives a coefficient of friction, the force per unit of the normal load whatever that is, so that one
law serves the belt under its weight and the ring under reactions that vary.
"""

import importlib.util
import sys
from typing import Any

from ringsweep.compile.cache import OWN_LAWS
from ringsweep.errors import InputError
from ringsweep.physics.friction import bristles, coulomb, regularised
from ringsweep.physics.friction.velocity import MU_K, MU_S
from ringsweep.quantities.parameters import Parameter

for _path in OWN_LAWS:
    # By its name in `sys.modules` a law is found again when compiled code is loaded.
    _spec = importlib.util.spec_from_file_location(_path.stem, _path)
    if _spec is None or _spec.loader is None or _path.stem in sys.modules:
        raise InputError("RINGSWEEP_LAWS", f"{_path} is no file of Python with a name of its own")
    sys.modules[_path.stem] = _module = importlib.util.module_from_spec(_spec)
    _spec.loader.exec_module(_module)

#: Laws whose friction at rest is whatever holds the contact, up to a bound.
SET_VALUED: tuple[type, ...] = tuple(coulomb.LAWS.values())

#: Laws whose friction is a continuous function of the sliding velocity.
SMOOTH: tuple[type, ...] = tuple(regularised.LAWS.values())

#: Laws with a memory: their friction depends on the deflection of bristles.
DYNAMIC: tuple[type, ...] = tuple(bristles.LAWS.values())

#: Laws by the name that the configuration gives them.
LAWS: dict[str, type] = coulomb.LAWS | regularised.LAWS | bristles.LAWS

#: Laws that know no static friction.
WITHOUT_STATIC: set[type] = {*coulomb.WITHOUT_STATIC, *regularised.WITHOUT_STATIC, *bristles.WITHOUT_STATIC}

#: Laws whose memory changes in jumps, at instants that only a method with events meets.
WITH_SNAPS: set[type] = {*bristles.WITH_SNAPS}

#: Parameters of a law of which the first must be less than the second.
ASCENDING: dict[Any, tuple[str, str]] = regularised.ASCENDING


def coefficients_of(law: type) -> dict[str, Parameter]:
    """Coefficients that a law needs of each surface."""
    mu_k = bristles.MU_K if law in DYNAMIC else MU_K
    return {"mu_k": mu_k} if law in WITHOUT_STATIC else {"mu_s": MU_S, "mu_k": mu_k}
