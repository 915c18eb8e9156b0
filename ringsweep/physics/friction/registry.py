"""Registry of the friction laws: names, families and traits.

A *family* decides which solver and which code a law takes; *traits* are facts about one law. Configuration, models
and solvers read them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from ringsweep.compile import hook, lacking
from ringsweep.physics.friction import presliding
from ringsweep.physics.friction.velocity import MU_K, MU_S, SCALE, stiction_band
from ringsweep.quantities.parameters import Parameter


class SetValued(NamedTuple):
    """Family of laws that are set-valued at rest: friction takes any value up to a bound."""


class Smooth(NamedTuple):
    """Family of laws that are continuous functions of the sliding velocity."""


class Dynamic(NamedTuple):
    """Family of laws with a memory: friction depends on the deflection of bristles, or on their age."""


@dataclass(frozen=True)
class Traits:
    """Traits of a law.

    Attributes
    ----------
    family : type
        :class:`SetValued`, :class:`Smooth` or :class:`Dynamic`.
    coefficients : tuple of str
        What the law needs of each surface: friction coefficients ``mu_s``, ``mu_k`` or both, or the factor ``scale``.
    ascending : tuple of str, optional
        Names of two parameters; the first value must be less than the second.
    snaps : bool
        Whether its memory jumps at certain instants; only methods with events find these.
    state : str
        Name of the history variable that shows the state of a law with a memory.
    dead_band : bool
        Whether a contact within the stiction band keeps its speed. Then the drive must be steady.
    source : str
        What a paper that uses the law can cite.
    """

    family: type
    coefficients: tuple[str, ...] = ("mu_s", "mu_k")
    ascending: tuple[str, str] | None = None
    snaps: bool = False
    state: str = "deflection"
    dead_band: bool = False
    source: str = ""


MU_0 = Parameter("1", "friction coefficient of steady sliding at the reference velocity", lower=0.0, open_lower=True)

#: Names of the coefficients of a surface. Each may be given for both directions of sliding.
SURFACE = ("mu_s", "mu_k", "scale", "mu0")

#: Laws by the name that the configuration gives them.
LAWS: dict[str, type] = {}

#: Traits of each law.
TRAITS: dict[type, Traits] = {}


@hook
def family(law):
    """Family of a law: an instance of :class:`SetValued`, :class:`Smooth` or :class:`Dynamic`."""


@hook(optional=True)
def holds_in_band(law):
    """Whether friction in the band of the law takes any value up to the breakaway force, as in a dead band."""
    return False


@hook(absorb=True, optional=True)
def dead_band(law):
    """Sliding speed below which friction takes any value up to the breakaway force, m/s; 0 without a dead band."""
    return 0.0


def add_law(name: str, law: type, traits: Traits) -> None:
    """Register a friction law.

    Parameters
    ----------
    name : str
        Name in configurations.
    law : type
        ``NamedTuple`` of the law's parameters. If it has bristles, the hooks of :mod:`presliding` must have bodies for
        it.
    traits : Traits
        Family and other traits.

    Raises
    ------
    TypeError
        If a hook has no body for the law, or if the name is taken.
    """
    if traits.family is Dynamic and (missing := lacking(law, presliding.MEMBERS)):
        raise TypeError(
            f"friction law {name} has no {', '.join(missing)}: its family needs it, before add_law is called"
        )
    if LAWS.setdefault(name, law) is not law:
        raise TypeError(f"there is a friction law {name} already: choose another name")
    describe(law, traits)


def describe(law: type, traits: Traits) -> None:
    """Set the traits of a law that has no name of its own."""
    TRAITS[law], kind = traits, traits.family
    family.implements(law)(lambda law: kind())
    if kind is SetValued:
        holds_in_band.implements(law)(lambda law: True)
        dead_band.implements(law)(lambda law: stiction_band(law))


def family_of(law: type) -> type:
    """Family of a type of law: SetValued, Smooth or Dynamic."""
    return TRAITS[law].family


def coefficients_of(law: type) -> dict[str, Parameter]:
    """Parameters of the friction coefficients that a law needs of each surface."""
    known = {"mu_s": MU_S, "scale": SCALE, "mu0": MU_0, "mu_k": presliding.MU_K if family_of(law) is Dynamic else MU_K}
    return {name: known[name] for name in TRAITS[law].coefficients}
