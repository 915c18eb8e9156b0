"""Registry of the friction laws: names, families and traits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from ringsweep.compile import hook, lacking
from ringsweep.physics.friction import presliding, velocity
from ringsweep.quantities.parameters import Parameter


class SetValued(NamedTuple):
    """Family of laws that are set-valued at rest: friction takes any value up to a bound."""


class Smooth(NamedTuple):
    """Family of laws that are continuous functions of the sliding velocity."""


class Dynamic(NamedTuple):
    """Family of laws with a memory: friction depends on the deflection of bristles."""


@dataclass(frozen=True)
class Traits:
    """Traits of a law.

    Attributes
    ----------
    family : type
        :class:`SetValued`, :class:`Smooth` or :class:`Dynamic`.
    static : bool
        Whether the law has a static coefficient beside the kinetic one.
    ascending : tuple of str, optional
        Names of two parameters; the first value must be less than the second.
    snaps : bool
        Whether its memory jumps at certain instants; only methods with events find these.
    dead_band : bool
        Whether a contact within the stiction band keeps its speed. Then the drive must be steady.
    """

    family: type
    static: bool = True
    ascending: tuple[str, str] | None = None
    snaps: bool = False
    dead_band: bool = False


#: Laws by the name that the configuration gives them.
LAWS: dict[str, type] = {}

#: Traits of each law.
TRAITS: dict[type, Traits] = {}

# Functions that every law of a family must have.
_NEEDED: dict[type, tuple[Any, ...]] = {
    SetValued: velocity.MEMBERS,
    Smooth: velocity.MEMBERS,
    Dynamic: presliding.MEMBERS,
}


@hook
def family(law):
    """Family of a law: an instance of :class:`SetValued`, :class:`Smooth` or :class:`Dynamic`."""


def _set_valued(law):
    return SetValued()


def _smooth(law):
    return Smooth()


def _dynamic(law):
    return Dynamic()


_FAMILY_BODIES: dict[type, Any] = {SetValued: _set_valued, Smooth: _smooth, Dynamic: _dynamic}


def add_law(name: str, law: type, traits: Traits) -> None:
    """Register a friction law.

    Parameters
    ----------
    name : str
        Name in configurations.
    law : type
        ``NamedTuple`` of the law's parameters. The hooks of its family must have bodies for it.
    traits : Traits
        Family and other traits.

    Raises
    ------
    TypeError
        If a hook of the family has no body for the law, or if the name is taken.
    """
    if missing := lacking(law, _NEEDED[traits.family]):
        raise TypeError(
            f"friction law {name} has no {', '.join(missing)}: its family needs it, before add_law is called"
        )
    if LAWS.setdefault(name, law) is not law:
        raise TypeError(f"there is a friction law {name} already: choose another name")
    TRAITS[law] = traits
    family.implements(law)(_FAMILY_BODIES[traits.family])


def family_of(law: type) -> type:
    """Family of a type of law: SetValued, Smooth or Dynamic."""
    return TRAITS[law].family


def coefficients_of(law: type) -> dict[str, Parameter]:
    """Parameters of the friction coefficients that a law needs of each surface."""
    mu_k = presliding.MU_K if family_of(law) is Dynamic else velocity.MU_K
    return {"mu_s": velocity.MU_S, "mu_k": mu_k} if TRAITS[law].static else {"mu_k": mu_k}
