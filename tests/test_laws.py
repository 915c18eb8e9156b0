"""Friction laws of the sliding velocity: published formulas of each law, and properties of all laws."""

import os
import subprocess
import sys
from math import exp, inf, log, nextafter
from typing import Any, NamedTuple

import numpy as np
import pytest
from belts import on_belt
from hypothesis import given, settings
from hypothesis import strategies as st
from solutions import made

from ringsweep.config import load
from ringsweep.errors import InputError
from ringsweep.numerics.series import ORDER
from ringsweep.physics.friction import LAWS, Dynamic, SetValued, Smooth, family_of
from ringsweep.physics.friction.laws import Definition, define
from ringsweep.physics.friction.velocity import (
    begin_series,
    friction_at,
    friction_in,
    no_products,
    region_at,
    region_bounds,
    series_term,
    shorten_for_decay,
    stiction_band,
)

MU_S, MU_K = 0.5, 0.3


def powers(low, high):
    """Numbers that are uniformly distributed over orders of magnitude."""
    return st.floats(log(low), log(high)).map(exp)


class Published(NamedTuple):
    """A law: its formula as published, which takes complex speeds, and strategies of its parameters."""

    family: type
    mu: Any
    parameters: dict[str, Any]
    #: Speed within which friction changes much.
    length: Any


widths, alphas, shares = powers(1e-9, 1.0), powers(1e-3, 1e9), powers(1e-3, 1e3)


def threlfall(v, mu_s, mu_k, v0):
    return mu_k * (1 - np.exp(-3 * v / v0)) / (1 - exp(-3)) if v.real < v0 else mu_k


def piecewise_linear(v, mu_s, mu_k, v0, v1):
    fall = mu_s + (mu_k - mu_s) * (v - v0) / (v1 - v0)
    return mu_s * v / v0 if v.real < v0 else fall if v.real < v1 else mu_k


def step(x):
    """Cubic with slope zero at both ends, from 0 to 1."""
    return x * x * (3 - 2 * x)


def piecewise_cubic(v, mu_s, mu_k, v0, v1):
    # The rise is the upper half of a step.
    rise, fall = 2 * step(0.5 + 0.5 * v / v0) - 1, step((v - v0) / (v1 - v0))
    return mu_s * rise if v.real < v0 else mu_s + (mu_k - mu_s) * fall if v.real < v1 else mu_k


def bengisu_akay(v, mu_s, mu_k, alpha, v0):
    inside = mu_s * (1 - (1 - v / v0) ** 2)
    return inside if v.real < v0 else mu_k * (1 + (mu_s / mu_k - 1) * np.exp(-alpha * (v - v0)))


def brown_mcphee(v, mu_s, mu_k, v_t):
    return mu_k * np.tanh(4 * v / v_t) + (mu_s - mu_k) * (v / v_t) / (0.25 * (v / v_t) ** 2 + 0.75) ** 2


PUBLISHED = {
    "coulomb": Published(SetValued, lambda v, mu_s, mu_k: mu_k, {}, lambda: 1.0),
    "stiction": Published(SetValued, lambda v, mu_s, mu_k: mu_k, {}, lambda: 1.0),
    "tustin": Published(
        SetValued,
        lambda v, mu_s, mu_k, alpha: mu_k + (mu_s - mu_k) * np.exp(-alpha * v),
        {"alpha": st.just(0.0) | alphas},
        lambda alpha: 1 / alpha if alpha else 1.0,
    ),
    "gaussian-stribeck": Published(
        SetValued,
        lambda v, mu_s, mu_k, v_s: mu_k + (mu_s - mu_k) * np.exp(-(v * v) / v_s**2),
        {"v_s": widths},
        lambda v_s: v_s,
    ),
    "hyperbolic": Published(
        SetValued,
        lambda v, mu_s, mu_k, delta: mu_k + (mu_s - mu_k) / (1 + delta * v),
        {"delta": st.just(0.0) | alphas},
        lambda delta: 1 / delta if delta else 1.0,
    ),
    "karnopp": Published(
        SetValued,
        lambda v, mu_s, mu_k, dead_band: mu_s if v.real < dead_band else mu_k,
        {"dead_band": widths},
        lambda dead_band: dead_band,
    ),
    "threlfall": Published(Smooth, threlfall, {"v0": widths}, lambda v0: v0),
    "piecewise-linear": Published(
        Smooth, piecewise_linear, {"v0": widths, "v1": shares}, lambda v0, v1: min(v0, v1 - v0)
    ),
    "piecewise-cubic": Published(
        Smooth, piecewise_cubic, {"v0": widths, "v1": shares}, lambda v0, v1: min(v0, v1 - v0)
    ),
    "bengisu-akay": Published(
        Smooth,
        bengisu_akay,
        {"alpha": st.just(0.0) | alphas, "v0": widths},
        lambda alpha, v0: min(v0, 1 / alpha) if alpha else v0,
    ),
    "tanh": Published(Smooth, lambda v, mu_s, mu_k, v0: mu_k * np.tanh(v / v0), {"v0": widths}, lambda v0: v0),
    "brown-mcphee": Published(Smooth, brown_mcphee, {"v_t": widths}, lambda v_t: v_t / 8),
    "andersson": Published(
        Smooth,
        lambda v, mu_s, mu_k, v_s, k_t: (mu_k + (mu_s - mu_k) * np.exp(-((v / v_s) ** 2))) * np.tanh(k_t * v),
        {"v_s": widths, "k_t": powers(1.0, 1e9)},
        lambda v_s, k_t: min(v_s, 1 / k_t),
    ),
}


class Drawn(NamedTuple):
    """A law with parameters."""

    name: str
    law: Any
    length: float
    parameters: dict[str, float]

    def mu(self, speed, mu_s=MU_S, mu_k=MU_K):
        """Friction coefficient by the published formula."""
        return PUBLISHED[self.name].mu(speed, mu_s, mu_k, **self.parameters)


def drawn(name):
    """Strategy of a law with parameters."""
    known = PUBLISHED[name]

    def build(parameters):
        if "v1" in parameters:
            parameters = parameters | {"v1": parameters["v0"] * (1 + parameters["v1"])}
        return Drawn(name, made(LAWS[name], **parameters), known.length(**parameters), parameters)

    return st.fixed_dictionaries(known.parameters).map(build)


# One law of each kind together, so that no random choice omits a law.
smooth = st.tuples(*(drawn(name) for name, law in PUBLISHED.items() if law.family is Smooth))
every = st.tuples(*(drawn(name) for name in PUBLISHED))
some = settings(max_examples=30)


def regions(law):
    """Regions of a law from the slowest to the fastest, with their bounds."""
    region, found = region_at(law, 0.0), {}
    while not found or found[region - 1][1] < inf:
        found[region] = region_bounds(law, region)
        region += 1
    return found


def mu(law, speed, mu_s=MU_S, mu_k=MU_K):
    """Friction coefficient of a law."""
    return friction_at(law, speed, (mu_s, mu_k))[0]


def slope(law, speed):
    """Slope of the friction coefficient, s/m."""
    return friction_at(law, speed, (MU_S, MU_K))[1]


def series_of_friction(law, region, surfaces, x):
    """Series of the friction coefficient at each contact, from the series of the speed."""
    mu_0, begun, _ = begin_series(law, region, x[0], surfaces)
    products = len(no_products(law, surfaces))
    lefts, rights, found = np.zeros((len(x), products)), np.zeros((len(x), products)), [mu_0]
    for k in range(1, len(x)):
        inner = (lefts[1:k] * rights[k - 1 : 0 : -1]).sum(axis=0)
        mu_k, lefts[k], rights[k] = series_term(law, region, k, x[k], inner, begun, surfaces)
        found.append(mu_k)
    return np.array(found).T


def test_every_law_of_the_velocity_is_tested():
    # Other tests of the process may have defined laws of their own.
    own = {name for name, law in LAWS.items() if law.__qualname__.startswith("formula_")}
    assert {name for name, law in LAWS.items() if family_of(law) is not Dynamic} - own == set(PUBLISHED)
    for name, known in PUBLISHED.items():
        assert family_of(LAWS[name]) is known.family


class TestPublishedFormula:
    """At the end of a tail friction may jump by what changes the sliding velocity by 1e-17 m/s."""

    @some
    @given(every, st.floats(0.0, 30.0))
    def test_friction_is_the_published_formula(self, laws, relative):
        for found in laws:
            speed = relative * found.length
            # Rounding of the speed.
            off = 1e-15 + 1e-17 / found.length + 20 * np.spacing(speed) / found.length
            assert mu(found.law, speed) == pytest.approx(found.mu(speed).real, rel=1e-13, abs=off), found

    @some
    @given(every, st.floats(0.0, 30.0))
    def test_slope_is_the_derivative_of_the_published_formula(self, laws, relative):
        for found in laws:
            speed = relative * found.length
            exact = np.imag(found.mu(speed + 1e-30j * found.length)) / 1e-30
            off = 1e-13 + 1e-17 / found.length + 200 * np.spacing(speed) / found.length
            assert found.length * slope(found.law, speed) == pytest.approx(exact, rel=1e-12, abs=off), found

    @some
    @given(every, st.floats(0.0, 3.0), st.lists(st.floats(-1.0, 1.0), min_size=8, max_size=8))
    def test_series_of_friction_is_friction_at_the_moved_speed(self, laws, relative, coefficients):
        for found in laws:
            x = np.zeros(ORDER + 1)
            x[:9] = found.length * np.array([relative, *coefficients])
            s, surfaces = 0.03, (MU_S, MU_K, 0.2, 0.1)
            region = region_at(found.law, x[0])
            series = series_of_friction(found.law, region, surfaces, x)
            now = np.polynomial.polynomial.polyval(s, x)
            expected = friction_in(found.law, region, now, surfaces)[:2]
            off = 1e-13 + 20 * np.spacing(now) / found.length
            assert np.polynomial.polynomial.polyval(s, series.T) == pytest.approx(expected, abs=off), found


@pytest.mark.parametrize(
    "text",
    ["exp(-v/w)", "log(2 + v/w)", "sqrt(1 + v/w)", "tanh(v/w - 1)/9", "atan(2*(v/w - 1))/9", "(1 + v/w)**-0.3"],
)
def test_series_of_a_function_is_that_function_at_the_moved_speed(text):
    law = made(define(Definition(f"mu_k*(1 + {text})/2", at_rest="mu_s")), w=0.7)
    moving = np.array([0.2, 0.3, -0.1, 0.05] + [0.0] * (ORDER - 3))
    coefficients = series_of_friction(law, region_at(law, 0.2), (MU_S, MU_K), moving)
    for s in (0.05, 0.1):
        speed = np.polyval(moving[::-1], s)
        assert np.polyval(coefficients[0, ::-1], s) == pytest.approx(mu(law, speed), rel=1e-13)


class TestRegions:
    @some
    @given(every, st.floats(0.0, 100.0))
    def test_regions_part_all_speeds_and_the_stiction_band_from_slip(self, laws, relative):
        for found in laws:
            low, high = region_bounds(found.law, region_at(found.law, relative * found.length))
            assert low <= relative * found.length < high
            numbers, bounds = zip(*regions(found.law).items(), strict=True)
            assert (bounds[0][0], bounds[-1][1]) == (0.0, inf)
            for region, (low, high), (next_low, _) in zip(numbers, bounds, (*bounds[1:], (inf, inf)), strict=True):
                assert low < high == next_low
                assert (region < 0) == (high <= stiction_band(found.law))
                if high < inf:
                    assert region_at(found.law, high) == region + 1
                    assert region_at(found.law, nextafter(high, 0.0)) == region

    @some
    @given(every)
    def test_stiction_band_is_a_parameter_or_zero(self, laws):
        for name, law, _, parameters in laws:
            width = next((parameters[key] for key in ("v0", "v_t", "dead_band") if key in parameters), 0.0)
            if name != "andersson":
                assert stiction_band(law) == (3 * width if name == "tanh" else width), name


@given(alphas)
def test_tail_that_does_not_fall_never_ends(alpha):
    for law in (made(LAWS["tustin"], alpha=0.0), made(LAWS["bengisu-akay"], alpha=0.0, v0=1 / alpha)):
        assert friction_at(law, 2 / alpha, (MU_S, MU_K)) == (MU_S, 0.0)
        assert law.thresholds[-1] == inf


@given(powers(1.0, 1e9), st.just(0.0) | powers(1e-6, 1.0), st.integers(-40, 6))
def test_rest_of_a_tail_changes_the_velocity_by_a_rounding_of_the_motion(alpha, low, octave):
    """Its integral from its end on is 1e-16 of the speed of the motion, unless it is below rounding of friction."""
    motion = 2.0**octave
    of_law = {"alpha": alpha, "v0": low} if low else {"alpha": alpha}
    law = made(LAWS["bengisu-akay" if low else "tustin"], motion=motion, **of_law)
    rest, rounding = exp(-alpha * (law.thresholds[-1] - low)), 1 + 3 * alpha * np.spacing(low)
    assert rest < max(1.1e-16 * motion * alpha * rounding, 4.3e-18)
    assert rest > 1e-17 * min(motion * alpha, 0.1)


def scene(law, **parameters):
    """A belt scene with parameters of its friction law."""
    return on_belt({"law": law, "mu_s": MU_S, "mu_k": MU_K, **parameters}, 2.0, velocity=0.1, span=1.0)


@pytest.mark.parametrize("law", ["piecewise-linear", "piecewise-cubic"])
@pytest.mark.parametrize(
    ("v1", "swept", "message"), [(0.1, None, ""), (0.2, None, ""), (None, [0.5, 0.3, 0.15], ".*in a cell")]
)
def test_v1_not_above_v0_is_refused(law, v1, swept, message):
    of_law = {"v0": 0.2} | ({} if v1 is None else {"v1": v1})
    sweep = {"sweep": {"grid": {"friction.v1": swept}}} if swept else {}
    with pytest.raises(InputError, match=rf"friction\.v1: {v1 or ''}.* is not greater than friction\.v0{message}"):
        load({"scene": scene(law, **of_law)} | sweep)


@pytest.mark.parametrize("name", ["nowhere.py", "json.py"])
def test_unusable_file_in_ringsweep_laws_is_refused_in_one_line(tmp_path, name):
    if name == "json.py":
        (tmp_path / name).write_text("from ringsweep.physics.friction import add_law\n")
    (tmp_path / "a.yaml").write_text("scene: {}")
    script = f"from ringsweep.cli import main; raise SystemExit(main(['run', {str(tmp_path / 'a.yaml')!r}]))"
    environment = {**os.environ, "RINGSWEEP_LAWS": str(tmp_path / name)}
    done = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "RINGSWEEP_LAWS" in done.stderr


@given(st.tuples(powers(1e-3, 1e3), powers(1e-6, 1e6), powers(1e-6, 1e6)))
def test_step_ends_where_an_exponential_may_have_changed_by_its_most(drawn):
    """Any one power of the time has all of the bound; a few of them together may have half as much again."""
    sharpness, *rates = drawn
    for first, second in ((1, 2), (2, 1), (3, 16), (5, 6)):
        v, numbers = np.zeros(ORDER + 1), np.arange(ORDER + 1)
        v[[first, second]] = rates[0], -rates[1]
        h = shorten_for_decay(sharpness, v, 1e10)
        assert 8.0 * (1.0 - 1e-12) <= sharpness * (abs(v) * h**numbers).sum() <= 12.0
        v[second] = 0.0
        h = shorten_for_decay(sharpness, v, 1e10)
        assert sharpness * rates[0] * h**first == pytest.approx(8.0)
