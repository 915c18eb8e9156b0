"""Friction laws by formula and by table: what is read, what is refused, and how the laws move a body."""

import json
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator
from solutions import made

import ringsweep
from ringsweep.config import load
from ringsweep.errors import InputError
from ringsweep.models import batch
from ringsweep.numerics.expressions import evaluate
from ringsweep.physics.friction.formula import FormulaError, read_formula
from ringsweep.physics.friction.laws import Definition, define
from ringsweep.physics.friction.velocity import (
    EXPRESSIONS,
    friction_at,
    region_at,
    region_bounds,
    stiction_band,
    varies,
)
from ringsweep.quantities.variables import FAILED

LEINE = {"law": "formula", "mu": "mu_s/(1 + delta*v)", "at_rest": "mu_s", "mu_s": 1.0, "delta": "3 s/m"}


def belt(friction, velocity=0.2, span=30.0, **more):
    """A mass on a belt, with unit mass, stiffness and weight."""
    return {
        "model": "belt",
        "body": {"mass": 1.0},
        "spring": {"stiffness": 1.0},
        "belt": {"velocity": velocity},
        "friction": friction,
        "gravity": 1.0,
        "time": {"span": span},
        **more,
    }


def formula(mu, at_rest="mu_s", **parameters):
    """Section `friction` of a formula; without parameters called mu_s or mu_k it gets 0.4 and 0.25."""
    given = {"law": "formula", "mu": mu, "mu_s": 0.4, "mu_k": 0.25} | parameters
    return given | ({"at_rest": at_rest} if at_rest else {})


def outcome(scene, method="auto"):
    return ringsweep.simulate(scene, solver=method)


def refused(friction):
    """What is said about a section `friction` that is refused."""
    with pytest.raises(InputError) as caught:
        load({"scene": belt(friction)})
    assert "\n" not in str(caught.value)
    return str(caught.value)


# ---- the grammar ------------------------------------------------------------------------------

#: Atoms without a unit; w is a speed.
VALUES = {"mu_s": 0.4, "mu_k": 0.25, "a": 1.7, "w": 0.6}
BINARY = {"+": lambda x, y: x + y, "-": lambda x, y: x - y, "*": lambda x, y: x * y, "/": lambda x, y: x / y}
FUNCTIONS = {"exp": math.exp, "log": math.log, "sqrt": math.sqrt, "tanh": math.tanh, "atan": math.atan}


def _grown(inner):
    exponents = st.sampled_from(["2", "3", "-1", "0", "0.5", "1.5", "a", "-a", "(1 - a)"])
    return st.one_of(
        st.tuples(st.sampled_from(sorted(BINARY)), inner, inner),
        st.tuples(st.sampled_from(sorted(FUNCTIONS)), inner),
        st.tuples(st.just("**"), inner, exponents),
        st.tuples(st.just("u-"), inner),
        st.tuples(st.just("piecewise"), st.sampled_from(["v < w", "v >= w", "w > v"]), inner, inner),
    )


numbers = st.floats(0.1, 9.0).map(lambda x: repr(round(x, 3)))
trees = st.recursive(st.sampled_from(["(v/w)", "mu_s", "mu_k", "a", "pi", "(w/w)"]) | numbers, _grown, max_leaves=8)


def text_of(tree):
    if isinstance(tree, str):
        return tree
    kind, *parts = tree
    if kind == "**":
        return f"({text_of(parts[0])})**{parts[1]}"
    if kind == "piecewise":
        return f"piecewise({parts[0]}, {text_of(parts[1])}, {text_of(parts[2])})"
    if kind == "u-":
        return f"(-{text_of(parts[0])})"
    if kind in FUNCTIONS:
        return f"{kind}({text_of(parts[0])})"
    return f"({text_of(parts[0])} {kind} {text_of(parts[1])})"


def value_of(tree, v):
    """Value by Python's floats; numbers that are too large or too small for a comparison are no examples."""
    names = VALUES | {"v": v, "pi": math.pi}
    if isinstance(tree, str):
        found = eval(tree, {}, names)
    else:
        kind, *parts = tree
        if kind == "piecewise":
            below = eval(parts[0], {}, names)
            return value_of(parts[1] if below else parts[2], v)
        inner = [value_of(part, v) for part in parts[: 1 if kind == "**" else 2]]
        if kind == "**":
            exponent = eval(parts[1], {}, names)
            assume(inner[0] > 0.01 or (inner[0] != 0.0 and abs(inner[0]) > 0.01 and exponent in (2, 3, -1, 0)))
            found = inner[0] ** exponent
        elif kind in FUNCTIONS:
            assume(abs(inner[0]) < 20.0 and (kind not in ("log", "sqrt") or inner[0] > 0.01))
            found = FUNCTIONS[kind](inner[0])
        elif kind == "u-":
            found = -inner[0]
        else:
            assume(kind != "/" or abs(inner[1]) > 0.01)
            found = BINARY[kind](*inner)
    assume(abs(found) < 1e4)
    return found


def thresholds_of(found):
    """Speeds of the switches; exponentials that have decayed are not cut off."""
    values = [math.inf] * len(found.thresholds)
    for k, threshold in enumerate(found.thresholds):
        if threshold.kind == "given":
            values[k] = float(evaluate(threshold.at, 0.0, VALUES))
    return values


class TestGrammar:
    @settings(max_examples=300)
    @given(trees, st.floats(0.0, 2.0))
    @example(("**", ("-", "mu_k", "a"), "2"), 0.3)
    @example(("/", "(v/w)", ("*", "mu_s", ("exp", "(v/w)"))), 0.6)
    def test_formula_has_the_value_that_arithmetic_gives(self, tree, v):
        expected = value_of(tree, v)
        found = read_formula(text_of(tree))
        value = float(evaluate(found.mu, v, VALUES, thresholds_of(found)))
        assert value == pytest.approx(expected, rel=1e-9, abs=1e-9), text_of(tree)

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

    @pytest.mark.parametrize(
        "text",
        [
            "__import__('os').system('touch touched')",
            "mu_s.real",
            "mu_s.__class__",
            "(lambda x: x)(mu_s)",
            "[mu_s for v in (1, 2)][0]",
            "{mu_s}",
            "mu_s if v else mu_k",
            "mu_s and mu_k",
            "(x := mu_s)",
            "f'{mu_s}'",
            "'mu_s'",
            "True*mu_s",
            "1j*mu_s",
            "None",
            "...",
            "mu_s[0]",
            "mu_s(1)",
            "exp(x=mu_s)",
            "exp(*mu_s)",
            "eval(mu_s)",
            "sin(mu_s)",
            "exp(mu_s, mu_k)",
            "min(mu_s)",
            "mu_s // mu_k",
            "mu_s % mu_k",
            "mu_s ^ 2",
            "mu_s @ mu_k",
            "~mu_s",
            "not mu_s",
            "v < 1",
            "piecewise(v < v1)",
            "piecewise(v < v1, mu_s)",
            "piecewise(v < v1 < 2, mu_s, mu_k)",
            "piecewise(2*v < v1, mu_s, mu_k)",
            "piecewise(v == v1, mu_s, mu_k)",
            "piecewise(mu_s, mu_s, mu_k)",
            "mu_s*",
            "mu_s; 1",
            "import os",
            "(mu_s",
            "",
            " ",
            "mu_s\0",
            "mu_s*1e999",
            "mu_s*" + "9" * 400,
            "(" * 300 + "mu_s" + ")" * 300,
            "-" * 100 + "mu_s",
            "exp(" * 70 + "mu_s" + ")" * 70,
            "mu_s" + " + mu_s" * 400,
            "mu_s*_x",
            "mu_s*law",
            "mu_s*rest",
            "mu_s*viscous",
            "mu_s*\N{GREEK SMALL LETTER ALPHA}",
        ],
    )
    def test_text_that_is_no_formula_is_refused_and_never_run(self, text, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        with pytest.raises(FormulaError) as caught:
            read_formula(text)
        assert "\n" not in str(caught.value)
        assert refused(formula(text)).startswith("scene.friction.mu: ")
        assert not list(tmp_path.iterdir())

    @pytest.mark.parametrize("text", ["mu_s*10**10**10", "mu_s*exp(exp(exp(exp(10))))", "mu_s/0", "mu_s*log(0)"])
    def test_number_without_finite_value_is_refused(self, text):
        assert refused(formula(text)).startswith("scene.friction.law: friction law formula: at rest it gives ")

    @pytest.mark.parametrize("given", [3, None, ["mu_s"], {"a": 1}, True])
    def test_formula_that_is_no_text_is_refused(self, given):
        assert refused(formula(given)).startswith("scene.friction.mu: a formula such as ")

    def test_formula_without_a_coefficient_of_the_surface_is_refused(self):
        assert "uses neither mu_s nor mu_k" in refused(formula("0.3"))

    def test_law_formula_without_a_formula_is_refused(self):
        assert refused({"law": "formula", "mu_s": 0.4}) == (
            "scene.friction.mu: missing: the formula of the friction coefficient"
        )


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

    def test_parameter_in_its_unit_or_in_another_of_its_kind_is_converted(self):
        for delta in ("3 s/m", 3, "0.003 s/mm"):
            values = load({"scene": belt(LEINE | {"delta": delta})}).scene.values
            assert values["friction.delta"] == pytest.approx(3.0)

    def test_parameter_of_another_unit_is_refused_with_its_path(self):
        assert refused(LEINE | {"delta": "3 m/s"}) == (
            "scene.friction.delta: '3 m/s' has the wrong unit: parameter delta of the friction law is in s/m"
        )

    def test_parameter_that_is_missing_is_named_with_its_unit(self):
        friction = {key: value for key, value in LEINE.items() if key != "delta"}
        assert "scene.friction.delta: missing" in refused(friction)
        assert "s/m" in refused(friction)

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

    def test_unknown_parameter_is_refused_with_a_suggestion(self):
        assert "did you mean `delta`?" in refused(LEINE | {"detla": 3})

    def test_unknown_key_is_compared_with_the_keys_of_this_law(self):
        message = refused(LEINE | {"extra": 3})
        assert "(known: law, laws, mu, at_rest, mu_s, delta, viscous)" in message

    def test_parameter_that_differs_from_a_name_of_the_formula_in_its_capital_is_questioned(self):
        message = refused(formula("mu_s/(1 + V/w)", w="1 m/s"))
        assert message.startswith("scene.friction.V: missing")
        assert "did you mean `v` in the formula, the sliding speed?" in message

    def test_formula_without_a_coefficient_of_the_surface_is_refused_with_an_example(self):
        assert "Multiply the formula by one of them" in refused(formula("0.3*exp(-v/w)", w=1.0))


# ---- values and regions -----------------------------------------------------------------------


class TestRest:
    def test_law_without_at_rest_that_does_not_vanish_at_rest_is_refused(self):
        message = refused(formula("mu_s/(1 + delta*v)", None, delta=3.0))
        assert "without at_rest friction must vanish at v = 0, where it is 0.4: give `at_rest: mu_s`" in message

    def test_missing_at_rest_is_named_at_its_place(self):
        assert refused(formula("mu_s/(1 + delta*v)", None, delta=3.0)).startswith("scene.friction.at_rest: ")
        own = {"law": "mine", "laws": {"mine": {"mu": "mu_s/(1 + delta*v)"}}, "mu_s": 0.4, "delta": 3.0}
        assert refused(own).startswith("scene.friction.laws.mine.at_rest: ")

    def test_law_that_breaks_away_with_more_than_it_holds_is_refused(self):
        assert "begins to slip with friction 0.8, more than the 0.4" in refused(formula("2*mu_s"))

    def test_law_held_by_mu_k_whose_formula_uses_mu_s_is_refused(self):
        assert refused(formula("mu_s", "mu_k")).startswith("scene.friction.at_rest: ")

    @pytest.mark.parametrize("at_rest", ["alpha", 0.4, True, ["mu_s"]])
    def test_at_rest_can_only_be_a_coefficient_of_the_surface(self, at_rest):
        message = f"scene.friction.at_rest: {at_rest!r}: at_rest can only be mu_s or mu_k"
        assert refused(formula("mu_s", at_rest)).startswith(message)

    @pytest.mark.parametrize("text", ["mu_k*sqrt(v/w)", "mu_k*(v/w)**p", "mu_k*(v/w)**1.5"])
    def test_root_of_the_speed_at_rest_is_refused(self, text):
        assert "no power series there" in refused(formula(text, None, w=1.0) | ({"p": 0.7} if "p" in text else {}))

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
        assert stiction_band(law) == pytest.approx(crossing, rel=0.1)
        law = made(define(Definition("max(mu_k, mu_s - mu_s*v/w)", "mu_s")), w=0.1)
        assert friction_at(law, 0.03, (0.5, 0.3)) == pytest.approx((0.35, -5.0), rel=1e-13)
        assert friction_at(law, 0.05, (0.5, 0.3)) == (0.3, 0.0)

    @settings(max_examples=60)
    @given(st.floats(0.01, 1.0), st.floats(0.01, 1.0), st.floats(0.0, 3.0))
    def test_abs_min_and_max_are_those_of_numbers(self, w, u, v):
        surfaces = (0.5, 0.3)
        for text, known in [
            ("mu_s/(1 + abs(v - w)/u)*0.1", lambda: 0.05 / (1 + abs(v - w) / u)),
            ("min(mu_s, mu_k + mu_k*v/w, mu_s*2/(1 + v/u))", lambda: min(0.5, 0.3 + 0.3 * v / w, 1.0 / (1 + v / u))),
            (
                "max(mu_s - mu_s*v/w, mu_k*exp(-v/u), 0.1*mu_s)",
                lambda: max(0.5 - 0.5 * v / w, 0.3 * math.exp(-v / u), 0.05),
            ),
        ]:
            cls = define(Definition(text, "mu_s"))
            law = made(cls, **{name: {"w": w, "u": u}[name] for name in EXPRESSIONS[cls].parameters})
            assert friction_at(law, v, surfaces)[0] == pytest.approx(known(), rel=1e-9, abs=1e-12)

    def test_regions_of_a_piecewise_law_end_at_its_speeds(self):
        cls = define(Definition("piecewise(v < v1, mu_s, v < 3*v1, mu_k, mu_s/2)", "mu_s"))
        law = made(cls, v1=0.1)
        assert region_bounds(law, region_at(law, 0.05)) == (0.0, 0.1)
        assert region_bounds(law, region_at(law, 0.2)) == (0.1, 0.1 * 3)
        assert [friction_at(law, v, (0.5, 0.3))[0] for v in (0.0, 0.0999, 0.1, 0.31, 9.0)] == [
            0.5,
            0.5,
            0.3,
            0.25,
            0.25,
        ]

    def test_switch_that_differs_by_zone_is_refused(self):
        cls = define(Definition("min(mu_s, mu_k + mu_k*v/w)", "mu_s"))
        with pytest.raises(FormulaError, match="differ by zone"):
            made(cls, [(0.5, 0.3), (0.5, 0.1)], w=0.1)

    def test_friction_ends_where_it_would_be_negative_or_no_number(self):
        law = made(define(Definition("mu_s - mu_k*v/w", "mu_s")), w=1.0)
        assert law.thresholds[-1] == pytest.approx(0.5 / 0.3, rel=1e-11)
        assert math.isnan(friction_at(law, 1.7, (0.5, 0.3))[0])
        law = made(define(Definition("mu_s*sqrt(1 - v/w)", "mu_s")), w=1.0)
        assert law.thresholds[-1] == pytest.approx(1.0, rel=1e-14)
        assert math.isnan(friction_at(law, 1.01, (0.5, 0.3))[0])
        # Before a pole.
        law = made(define(Definition("mu_s/(1 + v/w)/(1 - v/w)**2/2", "mu_s")), w=1.0)
        assert 0.8 < law.thresholds[-1] <= 1.0

    def test_law_of_steps_does_not_vary_within_a_region(self):
        law = made(define(Definition("mu_k + (mu_s - mu_k)*piecewise(v < w, 1, v < 2*w, 0.5, v/w)", "mu_s")), w=0.1)
        assert [varies(law, region_at(law, v)) for v in (0.05, 0.15, 0.25)] == [False, False, True]
        law = made(define(Definition("mu_k + (mu_s - mu_k)*piecewise(v < w, 1, v < 2*w, 0.5, 0.3)", "mu_s")), w=0.1)
        assert [varies(law, region_at(law, v)) for v in (0.05, 0.15, 0.25)] == [False, False, False]


# ---- motion -----------------------------------------------------------------------------------

RING = {
    "model": "ring",
    "body": {"mass": 0.076, "inertia": 4.47e-5, "half_distance": 0.025, "ball_radius": 0.01},
    "ring": {"radius": 0.043378},
    "zone": {"half_angle": "15 deg"},
    "drive": {"law": "arctan", "amplitude": 2.0},
    "time": {"span": 2.0},
}


def on_ring(friction):
    """Two contacts on a ring with a zone."""
    surfaces = {"rough": {"mu_s": 0.5, "mu_k": 0.3}, "rest": {"mu_s": 0.2, "mu_k": 0.1}}
    return RING | {"friction": friction | surfaces}


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
    with pytest.raises(InputError) as refusal:
        load({"scene": scene, "sweep": {"grid": {"friction.law": laws}}})
    assert message in str(refusal.value)


class TestMotion:
    @pytest.mark.parametrize(
        ("law", "method", "build"),
        [
            ("tustin", "event", "belt"),
            ("tustin", {"method": "rk4", "steps": 20000}, "belt"),
            ("bengisu-akay", "implicit", "ring"),
        ],
    )
    def test_formula_moves_a_body_as_the_law_of_the_package_does(self, law, method, build):
        mu, at_rest, parameters = TWINS[law]
        definition = {"law": "formula", "mu": mu} | ({"at_rest": at_rest} if at_rest else {})
        make, names = (belt, ("x_end", "x_max")) if build == "belt" else (on_ring, ("phi_end", "phi_max"))
        pair = {"mu_s": 0.4, "mu_k": 0.25} if build == "belt" else {}
        twin = outcome(make(definition | parameters | pair), method)
        known = outcome(make({"law": law} | parameters | pair), method)
        assert twin["regime"] == known["regime"]
        assert distance(twin, known, names) < 1e-9

    @pytest.mark.parametrize(
        ("text", "method"),
        [
            ("mu_s - mu_k*v/w", "event"),
            ("mu_s - mu_k*v/w", {"method": "rk4", "steps": 2000}),
            ("mu_s*sqrt(1 - v/w)", "event"),
        ],
    )
    def test_run_that_meets_a_speed_without_friction_fails(self, text, method):
        """The body at rest on a belt at 0.01 m/s breaks loose and slips faster than the formula allows."""
        found = outcome(belt(formula(text, w=0.05), velocity=0.01, span=60.0), method)
        assert found["regime"] == FAILED
        assert found["t_end"] < 60.0
        assert found["certified"] == 0

    def test_run_that_does_not_meet_such_a_speed_does_not_fail(self):
        found = outcome(belt(formula("mu_s - mu_k*v/w", w=50.0), velocity=0.01, span=60.0))
        assert found["regime"] != FAILED

    def test_parameter_of_a_formula_is_swept_like_any_other(self):
        swept = ringsweep.sweep(belt(LEINE), {"friction.delta": [1.0, 3.0]})
        assert swept["friction_delta"].attrs["units"] == "s m-1"
        for delta in (1.0, 3.0):
            alone = ringsweep.sweep(belt(LEINE | {"delta": delta}), {})
            assert swept["x_max"].sel(friction_delta=delta).item() == alone["x_max"].item()
        assert swept["x_max"][0] != swept["x_max"][1]

    def test_laws_of_the_section_laws_are_swept_by_name(self):
        mu, at_rest, _ = TWINS["tustin"]
        friction = {
            "laws": {"one": {"mu": LEINE["mu"], "at_rest": "mu_s"}, "other": {"mu": mu, "at_rest": at_rest}},
            "mu_s": 0.4,
            "mu_k": 0.25,
            "delta": 3.0,
            "alpha": 3.0,
        }
        found = ringsweep.sweep(belt(friction), {"friction.law": ["one", "other", "tustin"]})
        one, other, tustin = found["x_max"].values
        assert one == ringsweep.sweep(belt(LEINE | {"mu_s": 0.4}), {})["x_max"].item()
        assert other == pytest.approx(tustin, abs=1e-10)
        assert abs(one - other) > 1e-4

    def test_law_of_the_section_laws_with_a_taken_name_or_a_wrong_key_is_refused(self):
        for name, section, problem in [
            ("lugre", {"mu": "mu_k", "at_rest": "mu_k"}, "cannot be the name of a law"),
            ("mine", {"at_rest": "mu_k"}, "a section with the key mu is expected"),
            ("mine", {"mu": "mu_k", "at_rst": "mu_k"}, "did you mean `at_rest`?"),
            ("mine", "mu_k", "a section with the key mu is expected"),
        ]:
            friction = {"law": "mine", "mu_k": 0.1, "laws": {name: section}}
            assert problem in refused(friction)


# ---- laws of a session ------------------------------------------------------------------------


def in_a_process(script, folder):
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])}
    return subprocess.run(
        [sys.executable, "-c", script], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


class TestLawsOfASession:
    def test_law_is_usable_at_once_and_can_be_replaced(self):
        """As when a cell of a notebook is edited and run again."""
        scene = belt({"law": "of-session", "mu_s": 0.4, "delta": 3.0})
        found = []
        for text in ("mu_s/(1 + delta*v)", "mu_s/(1 + delta*v)**2", "mu_s/(1 + delta*v)"):
            ringsweep.friction_law("of-session", mu=text, at_rest="mu_s")
            found.append(ringsweep.sweep(scene, {}))
        one, other, again = (run["x_max"].item() for run in found)
        assert one == again
        assert abs(one - other) > 1e-3
        # No run takes results of another formula for its own.
        assert found[0].attrs["fingerprint"] == found[2].attrs["fingerprint"] != found[1].attrs["fingerprint"]

    def test_file_contains_the_law_and_another_process_repeats_the_run_from_it(self, tmp_path):
        ringsweep.friction_law("of-file", mu="mu_s/(1 + delta*v)", at_rest="mu_s")
        scene = belt({"law": "of-file", "mu_s": 0.4, "delta": 3.0})
        swept = ringsweep.sweep(scene, {"friction.delta": [1.0, 3.0]})
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
    def test_table_of_a_formula_moves_a_body_as_the_formula_does(self):
        found = outcome(belt(table()))
        known = outcome(belt(LEINE | {"mu_s": 0.4}))
        assert found["certified"] == 1
        assert found["regime"] == known["regime"]
        v = np.linspace(0.0, 0.5, 20001)
        off = np.abs(PchipInterpolator(SPEEDS, 0.4 / (1 + 3 * SPEEDS))(v) - 0.4 / (1 + 3 * v)).max()
        assert float(abs(found["x_max"] - known["x_max"])) < 20 * off

    @pytest.mark.parametrize("method", ["event", {"method": "rk4", "steps": 40000}])
    def test_methods_agree_on_a_table(self, method):
        assert distance(outcome(belt(table(), span=5.0), method), outcome(belt(table(), span=5.0)), ["x_end"]) < 1e-3

    def test_friction_is_monotone_between_the_data_and_constant_beyond(self):
        mu = np.array([0.5, 0.3, 0.29, 0.29, 0.4, 0.41])
        v = np.array([0.0, 0.1, 0.2, 0.5, 0.6, 3.0])
        config = load({"scene": belt(table(v, mu), span=1.0)})
        structure = config.scene.structure
        law = batch(structure, {path: np.array([value]) for path, value in config.scene.values.items()}).law
        law = type(law)(*(field[0] for field in law))
        for low, high, a, b in zip(v, v[1:], mu, mu[1:], strict=False):
            inside = np.array([friction_at(law, x, (0.5, 1.0))[0] for x in np.linspace(low, high, 101)])
            assert inside[0] == pytest.approx(a)
            assert (np.sign(b - a) * np.diff(inside) >= -1e-15).all()
        assert friction_at(law, 3.0, (0.5, 1.0)) == friction_at(law, 1e6, (0.5, 1.0)) == (0.41, 0.0)

    def test_table_scaled_by_two_is_the_table_with_doubled_friction(self):
        one = outcome(belt(table(scale=2.0)))
        other = outcome(belt(table(mu=0.8 / (1 + 3 * SPEEDS))))
        assert distance(one, other, ("x_end", "x_max")) < 1e-10

    def test_table_is_scaled_by_zone(self):
        mu, at_rest, parameters = TWINS["tustin"]
        sampled = 0.5 + 0.5 * np.exp(-parameters["alpha"] * SPEEDS)
        given = {**table(mu=0.2 * sampled), "rest": {"scale": 1.0}}
        found = outcome(RING | {"friction": {**given, "rough": {"scale": 2.0}}})
        even = outcome(RING | {"friction": {**given, "rough": {"scale": 1.0}}})
        twin = {"law": "formula", "mu": mu, "at_rest": at_rest, **parameters}
        surfaces = {"rough": {"mu_s": 0.4, "mu_k": 0.2}, "rest": {"mu_s": 0.2, "mu_k": 0.1}}
        known = outcome(RING | {"friction": twin | surfaces})
        assert found["regime"] == known["regime"]
        assert distance(found, known, ("phi_end",)) < 1e-3
        assert distance(found, even, ("phi_end",)) > 1e-2

    def test_table_is_set_valued_if_and_only_if_friction_at_rest_is_not_zero(self):
        """At rest on a belt that stands still, with the spring pulling: one law holds, the other creeps."""
        still = {"initial": {"x": 0.2, "velocity": 0.0}}
        holds = outcome(belt(table(), velocity=0.0, span=5.0, **still))
        assert float(abs(holds["x_end"] - 0.2)) == 0.0
        rising = table([0.0, 0.1, 1.0], [0.0, 0.4, 0.3])
        assert outcome(belt(rising, velocity=0.0, span=5.0, **still))["x_end"] < 0.199

    def test_table_from_a_file_stands_in_the_stored_configuration(self, tmp_path):
        (tmp_path / "mu_v.csv").write_text("v,mu\n0,0.4\n0.1,0.3\n1,0.25\n")
        config = {"scene": belt({"law": "table", "file": str(tmp_path / "mu_v.csv")})}
        found = ringsweep.run(config)
        stored = json.loads(found.attrs["configuration"])["scene"]["friction"]
        defaults = {"scale": 1.0, "viscous": 0.0}
        assert stored == {"law": "table", "v": [0.0, 0.1, 1.0], "mu": [0.4, 0.3, 0.25]} | defaults
        assert isinstance(found, xr.Dataset)

    @pytest.mark.parametrize(
        ("friction", "problem"),
        [
            ({"law": "table"}, "scene.friction.v: missing: a table needs a file, or the lists v and mu"),
            (table([0, 1], [0.4]), "scene.friction.mu: 1 coefficients for 2 speeds"),
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
