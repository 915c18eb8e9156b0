"""Friction laws by formula and by table: what is read, what is refused, and how the laws move a body."""

import json
import math
import os
import re
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
import refusals
from belts import on_belt
from hypothesis import assume, example, given, reject, settings
from hypothesis import strategies as st
from rings import course, rubs, shape
from scipy.integrate import solve_ivp
from solutions import cell_of, made, motion

import ringsweep
from ringsweep.config import load, own
from ringsweep.errors import InputError
from ringsweep.numerics.expressions import derivative, evaluate
from ringsweep.physics.friction.formula import FormulaError, read_formula
from ringsweep.physics.friction.laws import Definition, define
from ringsweep.physics.friction.velocity import EXPRESSIONS, friction_at, region_at, region_bounds, stiction_band
from ringsweep.quantities.flags import FAILED

LEINE = {"law": "formula", "mu": "mu_s/(1 + delta*v)", "at_rest": "mu_s", "mu_s": 1.0, "delta": "3 s/m"}


def belt(friction, velocity=0.2, span=30.0, **more):
    """A mass on a belt, with unit mass, stiffness and weight."""
    return on_belt(friction, velocity=velocity, gravity=1.0, span=span) | more


def formula(mu, at_rest="mu_s", **parameters):
    """Section `friction` of a formula; without parameters called mu_s or mu_k it gets 0.4 and 0.25."""
    given = {"law": "formula", "mu": mu, "mu_s": 0.4, "mu_k": 0.25} | parameters
    return given | ({"at_rest": at_rest} if at_rest else {})


def outcome(scene, method="auto"):
    return ringsweep.simulate(scene, solver=method)


def refused(friction):
    """What is said about a section `friction` that is refused."""
    return str(refusals.refused(None, load, {"scene": belt(friction)}))


# ---- the grammar ------------------------------------------------------------------------------

#: Atoms without a unit; w is a speed.
VALUES = {"mu_s": 0.4, "mu_k": 0.25, "a": 1.7, "w": 0.6}
FUNCTIONS = {"exp": math.exp, "log": math.log, "sqrt": math.sqrt, "tanh": math.tanh, "atan": math.atan}
NAMES = FUNCTIONS | {"pi": math.pi, "piecewise": lambda below, one, other: one if below else other}


def _grown(inner):
    exponents = st.sampled_from(["2", "3", "-1", "0", "0.5", "1.5", "a", "-a", "(1 - a)"])
    conditions = st.sampled_from(["v < w", "v >= w", "w > v"])
    return st.one_of(
        st.tuples(inner, st.sampled_from("+-*/"), inner).map("({0[0]} {0[1]} {0[2]})".format),
        st.tuples(st.sampled_from(sorted(FUNCTIONS)), inner).map("{0[0]}({0[1]})".format),
        st.tuples(inner, exponents).map("({0[0]})**{0[1]}".format),
        inner.map("(-{})".format),
        st.tuples(conditions, inner, inner).map("piecewise({0[0]}, {0[1]}, {0[2]})".format),
    )


numbers = st.floats(0.1, 9.0).map(lambda x: repr(round(x, 3)))
texts = st.recursive(st.sampled_from(["(v/w)", "mu_s", "mu_k", "a", "pi", "(w/w)"]) | numbers, _grown, max_leaves=8)


def value_of(text, v, more=1.0):
    """Value by Python, with all parameters times `more`; what is no number of a usual size is no example."""
    try:
        found = eval(text, NAMES | {name: more * value for name, value in VALUES.items()} | {"v": v})
    except (ArithmeticError, ValueError):
        reject()
    assume(isinstance(found, float) and abs(found) < 1e4)
    return found


def thresholds_of(found):
    """Speeds of the switches; exponentials that have decayed are not cut off."""
    values = [math.inf] * len(found.thresholds)
    for k, threshold in enumerate(found.thresholds):
        if threshold.kind == "given":
            values[k] = float(evaluate(threshold.at, 0.0, VALUES))
        if threshold.kind == "head":
            values[k] = 0.0
    return values


#: Texts that are no formulas, with two spaces and more between them.
NO_FORMULAS = re.split(
    r"  +|\n",
    """
mu_s.real  mu_s.__class__  (lambda x: x)(mu_s)  [mu_s for v in (1, 2)][0]  {mu_s}  mu_s if v else mu_k  mu_s and mu_k
(x := mu_s)  f'{mu_s}'  'mu_s'  True*mu_s  1j*mu_s  None  ...  mu_s[0]  mu_s(1)  exp(x=mu_s)  exp(*mu_s)  eval(mu_s)
sin(mu_s)  exp(mu_s, mu_k)  min(mu_s)  mu_s // mu_k  mu_s % mu_k  mu_s ^ 2  mu_s @ mu_k  ~mu_s  not mu_s  v < 1
piecewise(v < v1)  piecewise(v < v1, mu_s)  piecewise(v < v1 < 2, mu_s, mu_k)  piecewise(2*v < v1, mu_s, mu_k)
piecewise(v == v1, mu_s, mu_k)  piecewise(mu_s, mu_s, mu_k)  mu_s*  mu_s; 1  import os  (mu_s  mu_s*1e999
mu_s*_x  mu_s*law  mu_s*rest  mu_s*viscous  mu_s*\N{GREEK SMALL LETTER ALPHA}  __import__('os').system('touch touched')
""".strip(),
)
NO_FORMULAS += ["", " ", "mu_s\0", "mu_s*" + "9" * 400, "mu_s" + " + mu_s" * 400, "-" * 100 + "mu_s"]
NO_FORMULAS += [call * count + "mu_s" + ")" * count for call, count in (("(", 300), ("exp(", 70))]


class TestGrammar:
    @settings(max_examples=300)
    @given(texts, st.floats(0.0, 2.0))
    @example("(mu_k - a)**2", 0.3)
    @example("(v/w)/(mu_s*exp(v/w))", 0.6)
    def test_formula_has_the_value_that_arithmetic_gives(self, text, v):
        expected = value_of(text, v)
        # Rounding must not decide on it.
        assume(abs(value_of(text, v, 1.0 + 1e-10) - expected) < 1e-8)
        found = read_formula(text)
        value = float(evaluate(found.mu, v, VALUES, thresholds_of(found)))
        assert value == pytest.approx(expected, rel=1e-9, abs=1e-9)

    @pytest.mark.parametrize(
        ("text", "expected"),
        [
            ("mu_s - mu_k - 0.1", 0.05),
            ("mu_s/2/2", 0.1),
            ("-mu_s**2", -0.16),
            ("2**3**2*mu_k", 128.0),
            ("mu_s**-1", 2.5),
            ("1e-1*mu_s + .5*mu_k", 0.165),
            (" mu_s\n + mu_k ", 0.65),
            ("mu_s \N{MINUS SIGN} mu_k", 0.15),
            ("piecewise(v < w, mu_s, v < 2*w, mu_k, 1)", 0.25),
            ("piecewise(v > w, mu_s, mu_k)", 0.4),
        ],
    )
    def test_precedence_is_that_of_arithmetic(self, text, expected):
        found = read_formula(text)
        value = float(evaluate(found.mu, 1.0, VALUES, thresholds_of(found)))
        assert value == pytest.approx(expected, rel=1e-15)

    @pytest.mark.parametrize("text", NO_FORMULAS)
    def test_text_that_is_no_formula_is_refused_and_never_run(self, text, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        with pytest.raises(FormulaError) as caught:
            read_formula(text)
        assert "\n" not in str(caught.value)
        assert refused(formula(text)).startswith("scene.friction.mu: ")
        assert not list(tmp_path.iterdir())


FALLING = "mu_s/(1 + delta*v)"

OVERFLOWS = "*10**10**10", "*exp(exp(exp(exp(10))))", "/0", "*log(0)"
NO_COEFFICIENTS = "alpha", 0.4, True, ["mu_s"]


def named(name, definition):
    """Section of a law of the section laws."""
    return {"law": "mine", "mu_k": 0.1, "laws": {name: definition}}


#: Sections `friction`, each with the start of its message, or words of it after three dots.
REFUSED = [
    *((formula(given), "mu: a formula such as ") for given in (3, None, ["mu_s"], {"a": 1}, True)),
    # A number without a finite value.
    *((formula(f"mu_s{tail}"), "law: friction law formula: at rest it gives ") for tail in OVERFLOWS),
    (formula("0.3"), "...uses neither mu_s nor mu_k"),
    (formula("0.3*exp(-v/w)", w=1.0), "...Multiply the formula by one of them"),
    ({"law": "formula", "mu_s": 0.4}, "mu: missing: the formula of the friction coefficient"),
    (LEINE | {"delta": "3 m/s"}, "delta: '3 m/s' has the wrong unit: parameter delta of the friction law is in s/m"),
    (
        {key: LEINE[key] for key in ("law", "mu", "at_rest", "mu_s")},
        "delta: missing: parameter delta of the friction law, in s/m",
    ),
    (LEINE | {"detla": 3}, "detla: unknown key; did you mean `delta`?"),
    # The keys of this law, not of all laws.
    (LEINE | {"extra": 3}, "...(known: law, laws, mu, at_rest, frame, mu_s, delta, viscous, elsewhere, rough)"),
    (formula("mu_s/(1 + V/w)", w=1), "V: missing"),
    (formula("mu_s/(1 + V/w)", w=1), "...did you mean `v` in the formula, the sliding speed?"),
    # Friction at rest.
    (formula(FALLING, None, delta=3.0), "at_rest: "),
    (formula(FALLING, None, delta=3.0), "...must vanish at v = 0, where it is 0.4: give `at_rest: mu_s`"),
    ({"law": "mine", "laws": {"mine": {"mu": FALLING}}, "mu_s": 0.4, "delta": 3.0}, "laws.mine.at_rest: "),
    (formula("2*mu_s"), "...begins to slip with friction 0.8, more than the 0.4"),
    (formula("mu_s", "mu_k"), "at_rest: "),
    *((formula("mu_s", given), f"at_rest: {given!r}: at_rest can only be mu_s or mu_k") for given in NO_COEFFICIENTS),
    *((formula(f"mu_k*{root}", None, w=1.0), "...no power series there") for root in ("sqrt(v/w)", "(v/w)**1.5")),
    (formula("mu_k*(v/w)**p", None, w=1.0, p=0.7), "...no power series there"),
    # A jump up.
    (formula("piecewise(v < w, mu_k, mu_s)", w=0.2), "...friction jumps up from 0.25 to 0.4 at v = 0.2 m/s: a body"),
    (formula("piecewise(v < w, mu_k, mu_s)", w=0.2), "...Write a steep ramp"),
    # A name that is taken, and wrong keys, of a law of the section laws.
    (named("lugre", {"mu": "mu_k", "at_rest": "mu_k"}), "...cannot be the name of a law"),
    (named("mine", {"at_rest": "mu_k"}), "laws.mine.mu: missing: friction coefficient as a formula"),
    (named("mine", {"mu": "mu_k", "at_rst": "mu_k"}), "...did you mean `at_rest`?"),
    (named("mine", "mu_k"), "...a section with keys is expected"),
]


@pytest.mark.parametrize(("section", "message"), REFUSED)
def test_wrong_law_by_formula_is_refused_with_path_and_cause(section, message):
    found = refused(section)
    assert message[3:] in found if message.startswith("...") else found.startswith(f"scene.friction.{message}")


class TestUnits:
    @pytest.mark.parametrize(
        ("text", "units"),
        [
            ("mu_s/(1 + delta*v)", {"delta": "s/m"}),
            ("mu_k + (mu_s - mu_k)*exp(-(v/v_s)**2)", {"v_s": "m/s"}),
            ("mu_s*exp(-(b*v)**2/2)", {"b": "s/m"}),
            ("mu_s*exp(-c*v**2)", {"c": "s^2/m^2"}),
            ("mu_s*sqrt(1 + c*v*v)/(1 + d*c*v**3)", {"c": "s^2/m^2", "d": "s/m"}),
            ("piecewise(v < v1, mu_s, mu_k*(1 + n))", {"v1": "m/s", "n": "1"}),
            ("mu_s*(1 + v/w)**(-p)", {"w": "m/s", "p": "1"}),
            ("min(mu_s, mu_k*v/w)", {"w": "m/s"}),
            ("mu_s*a", {"a": "1"}),
            ("mu_s*exp(-v*x/y)", {"x": "", "y": ""}),
        ],
    )
    def test_units_of_parameters_follow_from_the_formula(self, text, units):
        assert read_formula(text).units == units

    def test_a_condition_is_one_where_it_holds_and_else_zero(self):
        factor, written = (read_formula(f"mu_k*{text}*v/w") for text in ("(v < w)", "piecewise(v < w, 1, 0)"))
        assert factor == written

    def test_parameter_in_its_unit_or_in_another_of_its_kind_is_converted(self):
        for delta in ("3 s/m", 3, "0.003 s/mm"):
            values = load({"scene": belt(LEINE | {"delta": delta})}).scene.values
            assert values["friction.delta"] == pytest.approx(3.0)

    @pytest.mark.parametrize(
        ("text", "problem"),
        [
            ("mu_s/(1 + v)", "units do not fit in 1 + v: 1 and m/s"),
            ("mu_s*exp(-v)", "units do not fit in -v: m/s and 1"),
            ("mu_s/(1 + d*v) + d*mu_s", "1 and s/m"),
            ("mu_s + v/w + v*w", "units do not fit"),
            ("piecewise(v < mu_s, mu_s, mu_k)", "units do not fit in v < mu_s: m/s and 1"),
            ("mu_s*v**(v/w)", "units do not fit in v: m/s and 1"),
            ("v*mu_s", "units do not fit in the friction coefficient"),
        ],
    )
    def test_units_that_contradict_each_other_are_named(self, text, problem):
        assert problem in refused(formula(text))


# ---- values and regions -----------------------------------------------------------------------


class TestRest:
    def test_law_that_is_negative_from_rest_on_has_no_friction(self):
        law = made(define(Definition("-mu_k*tanh(v/w)")), w=0.1)
        assert friction_at(law, 0.0, (0.5, 0.3))[0] == 0.0
        assert math.isnan(friction_at(law, 1e-6, (0.5, 0.3))[0])


class TestRegions:
    def test_minimum_and_maximum_switch_where_the_two_are_equal(self):
        law = made(define(Definition("min(mu_s*v/w, mu_k)")), w=0.1)
        crossing = 0.1 * 0.3 / 0.5
        assert friction_at(law, 0.5 * crossing, (0.5, 0.3)) == pytest.approx((0.15, 5.0), rel=1e-14)
        assert friction_at(law, 2.0 * crossing, (0.5, 0.3)) == (0.3, 0.0)
        assert min(abs(law.thresholds - crossing)) < 1e-15
        assert stiction_band(law) == pytest.approx(crossing, rel=1e-15)
        law = made(define(Definition("max(0.1*mu_s, mu_k, mu_s - mu_s*v/w)", "mu_s")), w=0.1)
        assert friction_at(law, 0.03, (0.5, 0.3)) == pytest.approx((0.35, -5.0), rel=1e-13)
        assert friction_at(law, 0.05, (0.5, 0.3)) == (0.3, 0.0)

    def test_regions_of_a_piecewise_law_end_at_its_speeds(self):
        cls = define(Definition("piecewise(v < v1, mu_s, v < 3*v1, mu_k, mu_s/2)", "mu_s"))
        law = made(cls, v1=0.1)
        assert region_bounds(law, region_at(law, 0.05)) == (0.0, 0.1)
        assert region_bounds(law, region_at(law, 0.2)) == (0.1, 0.1 * 3)
        found = [friction_at(law, v, (0.5, 0.3))[0] for v in (0.0, 0.0999, 0.1, 0.31, 9.0)]
        assert found == [0.5, 0.5, 0.3, 0.25, 0.25]

    def test_switch_that_differs_by_zone_is_refused(self):
        cls = define(Definition("min(mu_s, mu_k + mu_k*v/w)", "mu_s"))
        with pytest.raises(FormulaError, match="differ by zone"):
            made(cls, [(0.5, 0.3), (0.5, 0.1)], w=0.1)

    def test_friction_ends_where_it_would_be_negative_or_no_number(self):
        law = made(define(Definition("mu_s - mu_k*v/w", "mu_s")), w=1.0)
        assert law.thresholds[-3] == pytest.approx(0.5 / 0.3, rel=1e-11)
        assert math.isnan(friction_at(law, 1.7, (0.5, 0.3))[0])
        law = made(define(Definition("mu_s*sqrt(1 - v/w)", "mu_s")), w=1.0)
        assert law.thresholds[-3] == pytest.approx(1.0, rel=1e-11)
        assert math.isnan(friction_at(law, 1.01, (0.5, 0.3))[0])
        # At a pole.
        law = made(define(Definition("mu_s/(1 + v/w)/(1 - v/w)**2/2", "mu_s")), w=1.0)
        assert law.thresholds[-3] == pytest.approx(1.0, rel=1e-14)
        assert law.thresholds[-3] < 1.0 < law.thresholds[-2]


# Features of friction around a speed c, of width w, with height 1.
FEATURES = (
    "exp(-((v - {c})/{w})**2)",
    "1/(1 + ((v - {c})/{w})**2)",
    "max(0, 1 - abs(v - {c})/{w})",
    "max(0, 1 - ((v - {c})/{w})**2)",
    "0.5*(1 + tanh((v - {c})/{w}))",
    "exp(-abs(v - {c})/{w})",
)

NUMPY = {"exp": np.exp, "abs": np.abs, "tanh": np.tanh, "max": np.maximum}

features = st.lists(
    st.tuples(
        st.sampled_from(FEATURES),
        st.floats(-1.6, 0.8),
        st.floats(math.log(1e-2), math.log(3.0)).map(math.exp),
        st.floats(math.log(1e-6), math.log(0.3)).map(math.exp),
    ),
    min_size=1,
    max_size=3,
)


def featured(drawn):
    """Factor on friction with some features, its parameters, and 1e5 speeds, most of them around the features."""
    text, parameters = "(1", {}
    speeds = [np.geomspace(1e-9, 1e6, 20_000), np.linspace(1e-4, 4.0, 20_000)]
    for i, (feature, height, c, w) in enumerate(drawn):
        text += f" + {height!r}*" + feature.format(c=f"c{i}", w=f"w{i}")
        parameters |= {f"c{i}": c, f"w{i}": w}
        far = np.geomspace(6.0, 1e4, 1000)
        speeds.append(c + w * np.concatenate([-far, np.linspace(-6.0, 6.0, 18_000), far]))
    speeds = np.unique(np.concatenate(speeds))
    return text + ")", parameters, speeds[speeds > 0.0]


@pytest.mark.slow
class TestNoFeatureIsMissed:
    """Laws with bumps, dips, kinks and steps at any speed, against 1e5 samples of each."""

    @settings(max_examples=60)
    @given(features, st.booleans())
    @example([(FEATURES[0], -1.5, 0.31, 0.005)], False)
    @example([(FEATURES[1], -1.5, 0.31, 1e-6)], False)
    def test_switches_and_bounds_of_validity_are_where_samples_say(self, drawn, limited):
        factor, parameters, v = featured(drawn)
        text = f"0.5*mu_s*{factor}"
        text = f"max(0.1*mu_k, {text})" if limited else text
        sampled = np.broadcast_to(eval(text, NUMPY, parameters | {"mu_s": 0.5, "mu_k": 0.3, "v": v}), v.shape)
        cls, problem = define(Definition(text, "mu_s")), ""
        try:
            law = made(cls, **parameters)
        except FormulaError as error:
            problem = str(error)
        if problem:
            # Only what has many switches, or is negative at rest or too often, is refused.
            said = ("more than three times", "in several intervals", "at rest it gives", "begins to slip")
            assert any(words in problem for words in said), (text, problem)
            return
        values = {name: np.float64(value) for name, value in parameters.items()} | {"mu_s": 0.5, "mu_k": 0.3}
        found = evaluate(EXPRESSIONS[cls].mu, v, values, list(law.thresholds))
        finite = law.edges[np.isfinite(law.edges)]
        clear = (abs(v[:, None] - finite) > 1e-10 * (1.0 + v[:, None])).all(axis=1)
        assert np.isnan(found[clear & (sampled < -1e-11)]).all(), text
        valid = clear & (sampled >= 0.0)
        np.testing.assert_allclose(found[valid], sampled[valid], atol=1e-8, err_msg=text)

    @settings(max_examples=25)
    @given(features, st.floats(math.log(1e-4), math.log(0.1)).map(math.exp))
    def test_band_and_steepest_slope_are_those_of_samples(self, drawn, w):
        factor, parameters, v = featured([(shape, 0.3 * height, c, w) for shape, height, c, w in drawn])
        cls = define(Definition(f"0.5*mu_s*{factor}*tanh(v/w)"))
        law = made(cls, w=w, **parameters)
        values = {name: np.float64(value) for name, value in parameters.items()} | {"mu_s": 0.5, "mu_k": 0.3, "w": w}
        slope = derivative(EXPRESSIONS[cls].mu)
        v = np.unique(np.concatenate([[0.0], v, law.edges[np.isfinite(law.edges)]]))
        found = evaluate(slope, v, values, list(law.thresholds))
        steepest = np.maximum.accumulate(found)
        below = v < law.band * (1 - 1e-9)
        assert (found[below] > 0.01 * steepest[below] * (1 - 1e-6)).all()
        at = np.searchsorted(v, law.band)
        assert found[at] <= 0.01 * steepest[at] * (1 + 1e-6)
        assert found[0] == law.slope_at_rest
        beyond = abs(found[at:]).max()
        assert beyond * (1 - 1e-9) <= law.slope_beyond <= 1.02 * beyond


class TestNegativeFriction:
    def test_interval_holds_for_the_surface_with_the_widest(self):
        cls = define(Definition("mu_k - mu_s*exp(-((v - vb)/w)**2)", "mu_s"))
        law = made(cls, [(0.5, 0.3), (0.5, 0.1)], vb=0.31, w=0.005)
        half = 0.005 * math.sqrt(math.log(5.0))
        assert law.thresholds[-3:-1] == pytest.approx((0.31 - half, 0.31 + half), rel=1e-10)

    def test_law_that_is_negative_in_three_intervals_is_refused(self):
        dips = " - ".join(f"1.5*mu_s*exp(-((v - {c}*w)/(0.01*w))**2)" for c in (1, 2, 3))
        with pytest.raises(FormulaError, match="in several intervals"):
            made(define(Definition(f"mu_s - {dips}", "mu_s")), w=0.1)


class TestJumps:
    def test_jump_that_is_upward_on_one_surface_only_is_refused(self):
        cls = define(Definition("piecewise(v < w, 0.3*(mu_s/mu_s), mu_k)", "mu_s"))
        assert made(cls, [(0.5, 0.3), (0.5, 0.1)], w=0.1)
        with pytest.raises(FormulaError, match=r"jumps up from 0\.3 to 0\.4"):
            made(cls, [(0.5, 0.3), (0.5, 0.4)], w=0.1)

    def test_jump_that_is_upward_in_one_cell_of_a_sweep_is_refused(self):
        scene = belt(formula("mu_k*piecewise(v < w, 1, a)", w=0.2, a=1.0))
        with pytest.raises(InputError, match=r"jumps up from 0\.25 to 0\.3 "):
            ringsweep.sweep(scene, {"friction.a": [0.8, 1.0, 1.2]}, progress=False)


# ---- motion -----------------------------------------------------------------------------------

RING = shape(0.076, 4.47e-5, 0.025, 0.01, 0.043378, zone="15 deg") | course("arctan", 2.0, span=2.0)


def on_ring(friction):
    """Two contacts on a ring with a zone."""
    pairs = rubs(friction["law"], rest=(0.2, 0.1), rough=(0.5, 0.3))["friction"]
    return RING | {"friction": friction | pairs}


#: A law of the package, and the formula and parameters of the same law.
TWINS = {
    "tustin": ("mu_k + (mu_s - mu_k)*exp(-alpha*v)", "mu_s", {"alpha": 20.0}),
    "bengisu-akay": (
        "piecewise(v < v0, mu_s*(v/v0)*(2 - v/v0), mu_k + (mu_s - mu_k)*exp(-alpha*(v - v0)))",
        None,
        {"alpha": 20.0, "v0": 0.01},
    ),
}


def distance(one, other, names):
    return max(float(abs(one[name] - other[name])) for name in names)


@pytest.mark.parametrize(
    ("laws", "message"),
    [
        (["stiction", "formula"], "scene.friction.mu: missing: the formula of the friction coefficient"),
        (["stiction", "table"], "scene.friction.v: missing: a table needs a file, or the lists v and mu"),
        (3, "sweep.grid.friction.law: a list of values is expected, got 3"),
        (["tabel"], "did you mean `table`?"),
    ],
)
def test_sweep_over_laws_that_nothing_defines_is_refused(laws, message):
    scene = belt({"law": "stiction", "mu_s": 0.4, "mu_k": 0.3})
    error = refusals.refused(None, load, {"scene": scene, "sweep": {"grid": {"friction.law": laws}}})
    assert message in str(error)


def angle_of_rest(mu, points):
    """Angle at which a body of the ring comes to rest, launched at 10 rad/s, by an integration over the sliding speed.

    The speeds `points`, m/s, are where friction changes: the steps follow from them, not from the time.
    """
    body = cell_of(launched({"law": "stiction"})).body

    def rates(v, y):
        phi, omega = y[0], v / body.radius
        K = -mu(v)
        epsilon = motion(body, K, K)[0] @ [omega**2, math.cos(phi), math.sin(phi)]
        return [omega / (body.radius * epsilon)]

    speeds, phi = sorted({10.0 * body.radius, *points, 0.0}, reverse=True), 0.0
    for high, low in pairwise(v for v in speeds if v <= 10.0 * body.radius):
        solved = solve_ivp(
            rates, (high, low), [phi], method="DOP853", rtol=1e-13, atol=1e-15, max_step=(high - low) / 8
        )
        phi = solved.y[0, -1]
    return phi


def launched(friction):
    """A ring at rest with one surface, and a body that is launched at 10 rad/s and comes to rest."""
    pairs = rubs(friction["law"], rest=(0.6, 0.1), rough=(0.6, 0.1))["friction"]
    return RING | course("none", phi=0.0, omega=10.0, span=1.0) | {"friction": friction | pairs}


@pytest.mark.slow
class TestNarrowFeatures:
    """A body passes a narrow feature of friction; the answer is that of an integration which is told where it is."""

    #: Three shapes of a peak, of which a run has one: a corner, a Gaussian, and one with long tails.
    PEAKS = "mu_k + a*max(0, 1 - 2*((v - vb)/w)**2) + b*exp(-((v - vb)/w)**2) + c/(1 + ((v - vb)/w)**2)"

    @pytest.mark.parametrize(
        ("weights", "shape", "w"),
        [
            ({"a": 0.5}, lambda x: max(0.1, 0.6 - x * x), 0.02),
            ({"b": 0.5}, lambda x: 0.1 + 0.5 * math.exp(-x * x), 1e-4),
            ({"c": 0.05}, lambda x: 0.1 * (1 + 0.5 / (1 + x * x)), 1e-6),
        ],
    )
    def test_body_passes_a_narrow_peak_of_friction(self, weights, shape, w):
        vb = 0.3
        friction = {"law": "formula", "mu": self.PEAKS, "at_rest": "mu_s", "vb": vb, "w": w, "a": 0, "b": 0, "c": 0}
        found = outcome(launched(friction | weights))
        far = w * np.concatenate([np.linspace(0.0, 8.0, 65), np.geomspace(10.0, 1e5, 30), [math.sqrt(0.5)]])
        points = [v for v in (*(vb - far), *(vb + far)) if v > 0.0]
        expected = angle_of_rest(lambda v: shape((v - vb) / w), points)
        assert found["certified"] == 1
        assert float(abs(found["phi_end"] - expected)) < float(found["phi_end_error"]) + 1e-11
        # What is far from the peak costs few steps.
        assert found["steps"] < 500

    def test_run_of_constant_steps_that_leap_over_a_peak_is_not_certified(self):
        text = "max(mu_k, mu_s - ((v - vb)/w)**2)"
        friction = {"law": "formula", "mu": text, "at_rest": "mu_s", "vb": 0.3, "w": 0.002}
        found = outcome(launched(friction) | {"time": {"span": 0.05}}, {"method": "rk4", "steps": 10})
        assert found["certified"] == 0


@pytest.mark.slow
class TestMotion:
    @pytest.mark.parametrize("method", ["event", {"method": "rk4", "steps": 2000}])
    def test_run_fails_if_and_only_if_it_meets_a_speed_without_friction(self, method):
        """The body at rest on a belt at 0.01 m/s breaks loose and slips faster than the first formula allows."""
        found = outcome(belt(formula("mu_s*sqrt(1 - v/w)", w=0.05), velocity=0.01, span=60.0), method)
        assert found["regime"] == FAILED
        assert found["t_end"] < 60.0
        assert found["certified"] == 0
        found = outcome(belt(formula("mu_s*sqrt(1 - v/w)", w=50.0), velocity=0.01, span=60.0), method)
        assert found["regime"] != FAILED

    def test_laws_of_the_section_laws_are_swept_by_name(self):
        mu, at_rest, _ = TWINS["tustin"]
        laws = {"one": {"mu": LEINE["mu"], "at_rest": "mu_s"}, "other": {"mu": mu, "at_rest": at_rest}}
        friction = {"laws": laws, "mu_s": 0.4, "mu_k": 0.25, "delta": 3.0, "alpha": 3.0}
        found = ringsweep.sweep(belt(friction), {"friction.law": ["one", "other", "tustin"]})
        one, other, tustin = found["x_max"].values
        assert one == ringsweep.sweep(belt(LEINE | {"mu_s": 0.4}), {})["x_max"].item()
        assert other == pytest.approx(tustin, abs=1e-10)
        assert abs(one - other) > 1e-4


# ---- laws of a session ------------------------------------------------------------------------


def in_a_process(script, folder):
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])}
    return subprocess.run(
        [sys.executable, "-c", script], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


class TestLawsOfASession:
    @pytest.fixture(autouse=True)
    def no_law_outlives_its_test(self):
        with patch.dict(own.LAWS), patch.dict(own._REGISTERED):
            yield

    @pytest.mark.slow
    def test_law_is_usable_at_once_and_can_be_replaced(self):
        """As when a cell of a notebook is edited and run again."""
        first, second = {"mu_s": 0.4, "delta": 3.0}, {"mu_s": 0.4, "mu_k": 0.25, "alpha": 3.0}
        found = []
        for text, numbers in ((LEINE["mu"], first), (TWINS["tustin"][0], second), (LEINE["mu"], first)):
            ringsweep.friction_law("of-session", mu=text, at_rest="mu_s")
            found.append(ringsweep.sweep(belt({"law": "of-session", **numbers}), {}))
        one, other, again = (run["x_max"].item() for run in found)
        assert one == again
        assert abs(one - other) > 1e-3
        # No run takes results of another formula for its own.
        assert found[0].attrs["fingerprint"] == found[2].attrs["fingerprint"] != found[1].attrs["fingerprint"]

    @pytest.mark.slow
    def test_file_contains_the_law_and_another_process_repeats_the_run_from_it(self, tmp_path):
        ringsweep.friction_law("of-file", mu="mu_s/(1 + delta*v)", at_rest="mu_s")
        scene = belt({"law": "of-file", "mu_s": 0.4, "delta": 3.0})
        swept = ringsweep.sweep(scene, {"friction.delta": [1.0, 3.0]})
        assert swept["friction_delta"].attrs["units"] == "s m-1"
        stored = json.loads(swept.attrs["configuration"])["scene"]["friction"]
        assert stored["laws"] == {"of-file": {"mu": "mu_s/(1 + delta*v)", "at_rest": "mu_s"}}
        swept.to_netcdf(tmp_path / "run.nc")
        script = """
import json, ringsweep, xarray as xr
old = xr.open_dataset("run.nc")
new = ringsweep.run(json.loads(old.attrs["configuration"]))
print(bool((new["x_max"] == old["x_max"]).all()), new.attrs["fingerprint"] == old.attrs["fingerprint"])
"""
        done = in_a_process(script, tmp_path)
        assert done.stdout == "True True\n", done.stderr[-2000:]

    @pytest.mark.parametrize("name", ["lugre", "coulomb", "table", "formula", "", 3])
    def test_name_of_another_law_is_refused(self, name):
        with pytest.raises(InputError, match=r"friction_law: .* cannot be the name of a law"):
            ringsweep.friction_law(name, mu="mu_k", at_rest="mu_k")

    def test_wrong_formula_is_refused_and_leaves_the_law_as_it_was(self):
        ringsweep.friction_law("of-session", mu="mu_s/(1 + delta*v)", at_rest="mu_s")
        with pytest.raises(InputError, match=r"friction_law\.mu: .*units do not fit"):
            ringsweep.friction_law("of-session", mu="mu_s/(1 + v)", at_rest="mu_s")
        assert load({"scene": belt({"law": "of-session", "mu_s": 0.4, "delta": 3.0})})


# ---- tables -----------------------------------------------------------------------------------

SPEEDS = np.concatenate([[0.0], np.geomspace(1e-3, 3.0, 60)])


def table(v=SPEEDS, mu=None, **more):
    mu = 0.4 / (1 + 3 * np.asarray(v, dtype=float)) if mu is None else mu
    return {"law": "table", "v": list(map(float, v)), "mu": list(map(float, mu)), **more}


class TestTable:
    def test_friction_is_monotone_between_the_data_and_constant_beyond(self):
        mu = np.array([0.5, 0.3, 0.29, 0.29, 0.4, 0.41])
        v = np.array([0.0, 0.1, 0.2, 0.5, 0.6, 3.0])
        law = cell_of(belt(table(v, mu), span=1.0)).law
        for low, high, a, b in zip(v, v[1:], mu, mu[1:], strict=False):
            inside = np.array([friction_at(law, x, (0.5, 1.0))[0] for x in np.linspace(low, high, 101)])
            assert inside[0] == pytest.approx(a)
            assert (np.sign(b - a) * np.diff(inside) >= -1e-15).all()
        assert friction_at(law, 3.0, (0.5, 1.0)) == friction_at(law, 1e6, (0.5, 1.0)) == (0.41, 0.0)

    @pytest.mark.slow
    def test_table_is_scaled_by_zone(self):
        _, _, parameters = TWINS["tustin"]
        sampled = 0.5 + 0.5 * np.exp(-parameters["alpha"] * SPEEDS)
        given = {**table(mu=0.2 * sampled), "rest": {"scale": 1.0}}
        found = outcome(RING | {"friction": {**given, "rough": {"scale": 2.0}}})
        even = outcome(RING | {"friction": {**given, "rough": {"scale": 1.0}}})
        twin = {"law": "tustin", **parameters}
        surfaces = {"rough": {"mu_s": 0.4, "mu_k": 0.2}, "rest": {"mu_s": 0.2, "mu_k": 0.1}}
        known = outcome(RING | {"friction": twin | surfaces})
        assert found["regime"] == known["regime"]
        assert distance(found, known, ("phi_end",)) < 1e-3
        assert distance(found, even, ("phi_end",)) > 1e-2

    @pytest.mark.slow
    def test_table_is_set_valued_if_and_only_if_friction_at_rest_is_not_zero(self):
        """At rest on a belt that stands still, with the spring pulling: one law holds, the other creeps."""
        still = {"initial": {"x": 0.2, "velocity": 0.0}}
        holds = outcome(belt(table(), velocity=0.0, span=5.0, **still))
        assert float(abs(holds["x_end"] - 0.2)) == 0.0
        rising = table([0.0, 0.1, 1.0], [0.0, 0.4, 0.3])
        assert outcome(belt(rising, velocity=0.0, span=5.0, **still))["x_end"] < 0.199

    @pytest.mark.parametrize(
        ("friction", "problem"),
        [
            ({"law": "table"}, "scene.friction.v: missing: a table needs a file, or the lists v and mu"),
            (table([0, 1], [0.4]), "scene.friction.mu: 1 values, but v has 2"),
            (table([0], [0.4]), "scene.friction.v: 1 rows are too few"),
            (table([0, 1, 1], [0.4, 0.3, 0.2]), "scene.friction.v.2: 1 m/s does not come after 1 m/s"),
            (table([0.1, 1], [0.4, 0.3]), "scene.friction.v.0: the table begins at 0.1 m/s"),
            (table([0, 1], [0.4, -0.3]), "scene.friction.mu.1: "),
            (table([0, 1], [0.4, math.nan]), "scene.friction.mu.1: "),
            (table([0, math.inf], [0.4, 0.3]), "scene.friction.v.1: "),
            (table([0, 1], [0, 0]), "scene.friction.mu: all coefficients are 0"),
            ({"law": "table", "v": [0, 1], "mu": "mu_k"}, "scene.friction.mu"),
            ({"law": "table", "v": 0, "mu": [0.4]}, "scene.friction.v"),
            ({**table(), "file": "a.csv"}, "scene.friction.file: give a file, or v and mu, not both"),
        ],
    )
    def test_wrong_table_is_refused_by_row(self, friction, problem):
        assert refused(friction).startswith(problem)

    @pytest.mark.parametrize(
        ("text", "problem"),
        [
            ("v;mu\n0;0.4\n1;0.3\n", "the columns are separated by ';': separate them by commas"),
            ("v,mu\n0,0.4\n1,x\n", "mu_v.csv"),
            ("v,mu\n0,0.4\n1\n", "mu_v.csv"),
            ("v,mu\n", "mu_v.csv"),
            ("", "mu_v.csv"),
            ("v (m/s)\tmu\n0\t0.4\n1\t0.3\n", "the columns are separated by '\\t'"),
            ("0,0.4\n1,0.3\n", "columns v, mu are expected"),
            ("V,mu,extra\n0,0.4,1\n1,0.3,1\n", "got V, mu, extra; did you mean `v` by V?"),
        ],
    )
    def test_wrong_file_of_a_table_is_refused(self, tmp_path, text, problem):
        (tmp_path / "mu_v.csv").write_text(text)
        assert problem in refused({"law": "table", "file": str(tmp_path / "mu_v.csv")})
