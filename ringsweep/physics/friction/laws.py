"""Friction laws of the sliding velocity, each written as one formula.

Set-valued laws hold a contact at rest with any force up to ``mu_s``; smooth laws vanish at v = 0.

Nothing here runs in kernels: :mod:`velocity` writes the code from the
:class:`ringsweep.physics.friction.velocity.Expression` of a law.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

from ringsweep.numerics.expressions import SPEED, add, multiply, negative, number, switch, symbol, symbols_of
from ringsweep.physics import PAPER
from ringsweep.physics.definitions import Definitions
from ringsweep.physics.friction.formula import COEFFICIENTS, FormulaError, Threshold, read_expression, read_formula
from ringsweep.physics.friction.registry import SetValued, Smooth, Traits, add_law, describe
from ringsweep.physics.friction.velocity import EXPRESSIONS, MOST_PRODUCTS, PIECE, Expression, series_products
from ringsweep.physics.friction.ways import SIGNED
from ringsweep.quantities.parameters import Leaf, Parameter


@dataclass(frozen=True)
class Definition:
    """What a user writes to define a law.

    Attributes
    ----------
    mu : str
        Formula of the friction coefficient.
    at_rest : str, optional
        ``mu_s`` or ``mu_k`` for a set-valued law: the coefficient up to which friction holds at rest.
    """

    mu: str
    at_rest: str | None = None


def _make(name: str, doc: str, expression: Expression, qualified: str | None = None) -> type:
    """Type of the law: a ``NamedTuple`` of its parameters and of the numbers that follow from them."""
    hidden = ["slope_at_rest", "slope_beyond"]
    if expression.has_edges:
        hidden.append("pieces" if expression.tabulated else "edges")
    if expression.thresholds:
        hidden += ["thresholds", *["thresholds_back"] * expression.signed]
    if expression.has_band:
        hidden += ["band", "in_band"]
    fields: list[Any] = [(field, Annotated[Leaf, p]) for field, p in expression.parameters.items()]
    found: Any = NamedTuple(name, [*fields, *((field, Any) for field in hidden)])  # type: ignore[misc]
    found.__doc__, found.__module__, found.__qualname__ = doc, __name__, qualified or name
    EXPRESSIONS[found] = expression
    law: type = found
    return law


# ---- the laws of the package ------------------------------------------------------------------


def _law(
    name: str,
    doc: str,
    mu: str,
    *,
    at_rest: str | None = None,
    band: str | None = None,
    ascending: tuple[str, str] | None = None,
    source: str = "",
    **parameters: Parameter,
) -> type:
    """Define a law and register it under its name."""
    formula = read_formula(mu)
    used = symbols_of(formula.mu)
    set_valued = at_rest is not None
    expression = Expression(
        formula.mu, tuple(formula.thresholds), set_valued, None if band is None else read_expression(band), parameters
    )
    law = _make(name.title().replace("-", ""), doc, expression)
    globals()[law.__name__] = law
    add_law(
        name,
        law,
        Traits(
            SetValued if set_valued else Smooth,
            coefficients=_coefficients_among(used, at_rest),
            ascending=ascending,
            dead_band=set_valued and band is not None,
            source=source,
        ),
    )
    return law


def _coefficients_among(used: list[str], at_rest: str | None) -> tuple[str, ...]:
    """Coefficients of the surface, ``mu_s`` or ``mu_k``, that a formula uses or that hold a body at rest."""
    return tuple(name for name in COEFFICIENTS if name in used or name == at_rest)


_ALPHA = Parameter("s/m", "decay of friction with sliding speed", lower=0.0)
_V0 = Parameter("m/s", "half-width of the stiction band", lower=0.0, open_lower=True)
_V1 = Parameter("m/s", "sliding speed from which friction is kinetic", lower=0.0, open_lower=True)
_V_S = Parameter("m/s", "Stribeck velocity", lower=0.0, open_lower=True)

Coulomb = _law(
    "coulomb",
    """Amontons-Coulomb friction: :math:`\\mu_k` against the motion (the paper's Eqs. 25-26).""",
    mu="mu_k",
    at_rest="mu_k",
    source="C. A. Coulomb, Théorie des machines simples, Bachelier, Paris (1821)",
)

Stiction = _law(
    "stiction",
    """Coulomb friction with stiction: up to :math:`\\mu_s` at rest, :math:`\\mu_k` in motion.""",
    mu="mu_k",
    at_rest="mu_s",
    source="C. A. Coulomb, Théorie des machines simples, Bachelier, Paris (1821)",
)

Tustin = _law(
    "tustin",
    """Friction that decays with the speed (Tustin, J. IEE 94, 1947): Bengisu-Akay friction with a vanishing band.""",
    mu="mu_k + (mu_s - mu_k)*exp(-alpha*v)",
    at_rest="mu_s",
    alpha=_ALPHA,
    source="A. Tustin, Journal of the IEE 94 (1947)",
)

GaussianStribeck = _law(
    "gaussian-stribeck",
    """Stribeck curve with a Gaussian decay (Armstrong-Helouvry, Control of Machines with Friction, 1991).""",
    mu="mu_k + (mu_s - mu_k)*exp(-(v/v_s)**2)",
    at_rest="mu_s",
    v_s=_V_S,
    source="B. Armstrong-Hélouvry, Control of Machines with Friction, Kluwer (1991)",
)

Hyperbolic = _law(
    "hyperbolic",
    """Friction that falls along a hyperbola (Leine et al., Nonlinear Dynamics 16, 1998, with mu_k = 0).""",
    mu="mu_k + (mu_s - mu_k)/(1 + delta*v)",
    at_rest="mu_s",
    delta=Parameter("s/m", "decay of friction with sliding speed", lower=0.0),
    source="R. I. Leine et al., Nonlinear Dynamics 16 (1998), doi:10.1023/A:1008289604683",
)

Karnopp = _law(
    "karnopp",
    """Stiction with a dead band (Karnopp, J. Dyn. Syst. Meas. Control 107, 1985; the paper's Fig. 4).

    .. math::

        F = \\operatorname{sgn}(F_e)\\, \\min(|F_e|, \\mu_s F_N) \\quad (|v| \\le D_v), \\qquad
        F = \\mu_k F_N \\operatorname{sgn} v \\quad (|v| > D_v)

    with :math:`F_e` the force that friction must balance. Within the band the sliding velocity is zero: only the
    momentum that is left, or that builds up after breakaway, has a speed v.
    """,
    mu="piecewise(v < dead_band, mu_s, mu_k)",
    at_rest="mu_s",
    band="dead_band",
    dead_band=Parameter("m/s", "half-width of the dead band D_v", lower=0.0, open_lower=True),
    source="D. Karnopp, Journal of Dynamic Systems, Measurement, and Control 107 (1985), doi:10.1115/1.3140698",
)

Threlfall = _law(
    "threlfall",
    """Coulomb friction regularised by an exponential (Threlfall, Mech. Mach. Theory 13, 1978).

    The denominator, often rounded to 0.95, makes the law continuous.
    """,
    mu="piecewise(v < v0, mu_k*(1 - exp(-3*v/v0))/(1 - exp(-3)), mu_k)",
    band="v0",
    v0=_V0,
    source="D. C. Threlfall, Mechanism and Machine Theory 13, 475-483 (1978)",
)

PiecewiseLinear = _law(
    "piecewise-linear",
    """Stiction regularised by straight lines (the paper's Fig. 5).""",
    mu="piecewise(v < v0, mu_s*v/v0, v < v1, mu_s - (mu_s - mu_k)*(v - v0)/(v1 - v0), mu_k)",
    band="v0",
    ascending=("v0", "v1"),
    v0=_V0,
    v1=_V1,
    source=PAPER,
)

PiecewiseCubic = _law(
    "piecewise-cubic",
    """Stiction regularised by cubics with a continuous slope (the paper's Fig. 6; STEP of multibody codes).""",
    mu="piecewise(v < v0, mu_s*(v/v0)*(3 - (v/v0)**2)/2,"
    " v < v1, mu_s - (mu_s - mu_k)*((v - v0)/(v1 - v0))**2*(3 - 2*(v - v0)/(v1 - v0)), mu_k)",
    band="v0",
    ascending=("v0", "v1"),
    v0=_V0,
    v1=_V1,
    source=PAPER,
)

BengisuAkay = _law(
    "bengisu-akay",
    """Bengisu-Akay friction: a parabola up to v0, an exponential tail above (the paper's Eqs. 23-24).""",
    mu="piecewise(v < v0, mu_s*(v/v0)*(2 - v/v0), mu_k + (mu_s - mu_k)*exp(-alpha*(v - v0)))",
    band="v0",
    alpha=_ALPHA,
    v0=_V0,
    source="M. T. Bengisu, A. Akay, Journal of Sound and Vibration 171, 557-570 (1994)",
)

Tanh = _law(
    "tanh",
    """Smooth Coulomb friction: a hyperbolic tangent of the sliding velocity.""",
    mu="mu_k*tanh(v/v0)",
    band="3*v0",
    v0=Parameter("m/s", "speed at which friction reaches 76 % of kinetic friction", lower=0.0, open_lower=True),
)

BrownMcphee = _law(
    "brown-mcphee",
    """Stribeck friction without a jump (Brown and McPhee, J. Comput. Nonlinear Dyn. 11, 2016; no viscous part).""",
    mu="mu_k*tanh(4*v/v_t) + (mu_s - mu_k)*(v/v_t)/((v/(2*v_t))**2 + 3/4)**2",
    band="v_t",
    v_t=Parameter("m/s", "speed of the greatest friction", lower=0.0, open_lower=True),
    source="P. Brown, J. McPhee, Journal of Computational and Nonlinear Dynamics 11 (2016), doi:10.1115/1.4033658",
)

Andersson = _law(
    "andersson",
    """Stribeck friction times a hyperbolic tangent (Andersson et al., Tribology Int. 40, 2007; with exponent 2).""",
    mu="(mu_k + (mu_s - mu_k)*exp(-(v/v_s)**2))*tanh(k_t*v)",
    v_s=_V_S,
    k_t=Parameter("s/m", "steepness of the law at rest", lower=0.0, open_lower=True),
    source="S. Andersson et al., Tribology International 40, 580-587 (2007)",
)


def _tabulated(name: str, doc: str, *, set_valued: bool) -> type:
    """Type of a law by table: a cubic of the speed in each piece, times ``mu_k``."""
    knot, *c = (symbol(f"piece {j}") for j in range(PIECE))
    x = add(SPEED, negative(knot))
    cubic = c[3]
    for coefficient in reversed(c[:3]):
        cubic = add(coefficient, multiply(x, cubic))
    law = _make(name, doc, Expression(multiply(symbol("mu_k"), cubic), (), set_valued, None, {}, tabulated=True))
    describe(law, Traits(SetValued if set_valued else Smooth, coefficients=("scale",)))
    return law


Table = _tabulated(
    "Table",
    """Measured friction that is set-valued at rest, up to its value at v = 0.

    A monotone cubic through each pair of points (Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5, 1984), times the
    factor ``scale`` of the surface; constant beyond the last point. ``pieces``, of shape ``(cells, points, 5)``, has a
    row for each cubic: its lower bound, m/s, and its coefficients from the lowest power up.
    """,
    set_valued=True,
)

SmoothTable = _tabulated(
    "SmoothTable", """Measured friction that vanishes at v = 0; see :class:`Table`.""", set_valued=False
)


# ---- laws of users ----------------------------------------------------------------------------


def define(definition: Definition) -> type:
    """Type of the law that a formula defines.

    Raises
    ------
    FormulaError
        If something in the formula is wrong.
    """
    return _DEFINITIONS.type_of(definition.mu, definition.at_rest)


def _law_by_formula(name: str, qualified: str, mu: str, at_rest: str | None) -> type:
    """Type of a law by the formula `mu`; `qualified` is its name in kernels.

    Raises
    ------
    FormulaError
        If the formula uses no coefficient of the surface, if `at_rest` contradicts it, or if it is too long.
    """
    formula = read_formula(mu)
    used = symbols_of(formula.mu)
    if not any(name in used for name in COEFFICIENTS):
        raise FormulaError(
            "it uses neither mu_s nor mu_k, the friction coefficients of the surface. Multiply the formula by one of "
            "them, and give the friction coefficient there: mu_k*(...), mu_k: 0.3"
        )
    if at_rest not in (None, *COEFFICIENTS):
        raise FormulaError("at_rest can only be mu_s or mu_k, which have values for each surface", "at_rest")
    if at_rest == "mu_k" and "mu_s" in used:
        raise FormulaError("the formula uses mu_s, which is never less than mu_k: write at_rest: mu_s", "at_rest")
    # Friction that turns negative or is no number ends a run.
    bounds, nowhere = len(formula.thresholds), number(float("nan"))
    checked = switch(bounds, formula.mu, switch(bounds + 1, nowhere, switch(bounds + 2, formula.mu, nowhere)))
    valid = (Threshold(None, formula.mu, order, "valid") for order in range(3))
    parameters = {
        name: Parameter(unit, f"parameter {name} of the friction law") for name, unit in formula.units.items()
    }
    thresholds, signed = (*formula.thresholds, *valid), formula.signed
    expression = Expression(checked, thresholds, at_rest is not None, None, parameters, signed=signed)
    if series_products(expression) > MOST_PRODUCTS:
        raise FormulaError(f"it is too long: more than {MOST_PRODUCTS} products of varying factors")
    law = _make(name, f"mu = {mu}" + (f", up to {at_rest} at rest" if at_rest else ""), expression, qualified=qualified)
    if signed:
        SIGNED.add(law)
    describe(law, Traits(SetValued if at_rest else Smooth, coefficients=_coefficients_among(used, at_rest)))
    return law


_DEFINITIONS = Definitions(__name__, _law_by_formula)

__getattr__ = _DEFINITIONS.find
