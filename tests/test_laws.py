"""Friction laws of the sliding velocity: formulas of each law, and properties of all laws."""

import os
import subprocess
import sys
from itertools import pairwise
from math import exp, inf, log, nextafter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ringsweep.physics.friction.coulomb import Coulomb, Karnopp, Stiction, Tustin
from ringsweep.physics.friction.regularised import BengisuAkay, PiecewiseCubic, PiecewiseLinear, Threlfall

from ringsweep.compile import SOURCES_DIGEST, take
from ringsweep.config import load
from ringsweep.errors import InputError
from ringsweep.physics.friction import LAWS, Dynamic, family_of
from ringsweep.physics.friction.velocity import (
    BAND,
    KINETIC,
    STRIBECK,
    basis_at,
    basis_factor,
    basis_term,
    faster,
    friction_terms,
    piece,
    region_at,
    region_bounds,
    slower,
    stiction_band,
    weights,
    weights_in,
)

MU_S, MU_K = 0.5, 0.3


def made(law, *columns):
    """Law of one cell, made in the same way as in a sweep."""
    return take(getattr(law, "of", law)(*(np.array([value]) for value in columns)), 0)


def powers(low, high):
    """Numbers that are uniformly distributed over orders of magnitude."""
    return st.floats(log(low), log(high)).map(exp)


widths = powers(1e-9, 1.0)
alphas = powers(1e-3, 1e9)

threlfall = st.builds(lambda v0: made(Threlfall, v0), widths)
linear = st.builds(lambda v0, share: made(PiecewiseLinear, v0, v0 * (1 + share)), widths, powers(1e-6, 1e3))
cubic = st.builds(lambda v0, share: made(PiecewiseCubic, v0, v0 * (1 + share)), widths, powers(1e-6, 1e3))
bengisu_akay = st.builds(lambda alpha, v0: made(BengisuAkay, alpha, v0), st.just(0.0) | alphas, widths)
tustin = st.builds(lambda alpha: made(Tustin, alpha), st.just(0.0) | alphas)
karnopp = st.builds(lambda band: made(Karnopp, band), widths)
constant = st.sampled_from([Coulomb(), Stiction()])

# One law of each kind together, so that no random choice omits a law.
smooth = st.tuples(threlfall, linear, cubic, bengisu_akay)
every = st.tuples(threlfall, linear, cubic, bengisu_akay, tustin, karnopp, constant)


def pieces(law):
    """Pieces of a law from the slowest to the fastest, by region."""
    found = {region: piece(law, region) for region in (BAND, STRIBECK, KINETIC)}
    return {region: p for region, p in found.items() if p.low < p.high}


def width_of(p):
    """Interval of the sliding speed in which the weights of a piece change, m/s."""
    ends = [length for length in (p.high - p.low, 1 / p.decay if p.decay else inf) if length < inf]
    return min(ends, default=1.0)


def mu(law, speed):
    """Friction coefficient of a law."""
    w_s, w_k, _, _ = weights(law, speed)
    return w_s * MU_S + w_k * MU_K


def series_of_friction(p, mu_s, mu_k, x):
    """Series of the friction coefficient in a region, from the series of the speed above its lower bound."""
    q_0, factor_0 = basis_at(p, x[0])
    mu_0, by_x, by_q, by_cube = friction_terms(p, mu_s, mu_k, x[0])
    q, factors, found = [q_0], [factor_0], [mu_0]
    for k in range(1, len(x)):
        inner = sum(j * x[j] * factors[k - j] for j in range(1, k))
        q.append(basis_term(p, k, factor_0, x[k], inner))
        factors.append(basis_factor(p, x[k], q[k]))
        found.append(by_x * x[k] + by_q * q[k] + by_cube * sum(x[j] * q[k - j] for j in range(1, k)))
    return found


def slope(law, speed, region=None):
    """Slope of the friction coefficient, s/m; by the formula of a region if one is given."""
    _, _, dw_s, dw_k = weights(law, speed) if region is None else weights_in(law, region, speed)
    return dw_s * MU_S + dw_k * MU_K


def test_every_law_of_the_velocity_is_tested():
    tested = {Threlfall, PiecewiseLinear, PiecewiseCubic, BengisuAkay, Tustin, Karnopp, Coulomb, Stiction}
    assert {law for law in LAWS.values() if family_of(law) is not Dynamic} == tested


class TestRegions:
    @given(every)
    def test_regions_cover_all_speeds_without_overlap(self, laws):
        for law in laws:
            found = list(pieces(law).values())
            assert found[0].low == 0.0
            assert found[-1].high == inf
            for one, other in pairwise(found):
                assert one.high == other.low

    @given(every, st.floats(0.0, 3.0))
    def test_region_at_a_speed_has_bounds_around_it(self, laws, relative):
        for law in laws:
            for p in pieces(law).values():
                speed = p.low + relative * width_of(p)
                low, high = region_bounds(law, region_at(law, speed))
                assert low <= speed < high

    @given(every)
    def test_bound_belongs_to_the_region_above_it(self, laws):
        for law in laws:
            for below, above in pairwise(pieces(law)):
                edge = piece(law, above).low
                assert region_at(law, edge) == above
                assert region_at(law, nextafter(edge, 0.0)) == below

    @given(every)
    def test_faster_and_slower_regions_are_neighbours(self, laws):
        for law in laws:
            for below, above in pairwise(pieces(law)):
                assert faster(law, below) == above
                assert slower(law, above) == below

    @given(widths)
    def test_stiction_band_of_a_law_is_its_parameter_or_zero(self, v0):
        for law in (Threlfall(v0), PiecewiseLinear(v0, 2 * v0), PiecewiseCubic(v0, 2 * v0), Karnopp(v0)):
            assert stiction_band(law) == v0
        assert stiction_band(made(BengisuAkay, 10.0, v0)) == v0
        for law in (Coulomb(), Stiction(), made(Tustin, 1 / v0)):
            assert stiction_band(law) == 0.0


class TestWeights:
    @given(smooth)
    def test_weights_of_a_smooth_law_are_continuous(self, laws):
        """At the end of a tail they may jump by what changes the sliding velocity by 1e-17 m/s, or by rounding."""
        for law in laws:
            for below, above in pairwise(pieces(law)):
                edge = piece(law, above).low
                jump = max(1.1e-17 * piece(law, below).decay, 1e-14)
                one, other = weights_in(law, below, edge), weights_in(law, above, edge)
                # Where a piece is steep, rounding of the edge changes the weights.
                jump += np.spacing(edge) * max(map(abs, one[2:] + other[2:]))
                assert other[:2] == pytest.approx(one[:2], abs=jump)

    @given(cubic)
    def test_slopes_of_piecewise_cubic_are_zero_where_regions_meet(self, law):
        for below, above in pairwise(pieces(law)):
            edge = piece(law, above).low
            for region in (below, above):
                p = piece(law, region)
                spread = 1e-13 + 10 * np.spacing(edge) / width_of(p)
                assert weights_in(law, region, edge)[2:] == pytest.approx((0.0, 0.0), abs=spread / width_of(p))

    @given(every, st.floats(0.0, 1.0, exclude_max=True))
    def test_friction_lies_between_zero_and_mu_s_and_above_mu_k_outside_the_band(self, laws, relative):
        for law in laws:
            for region, p in pieces(law).items():
                speed = p.low + relative * (p.high - p.low if p.high < inf else 1.0)
                w_s, w_k, _, _ = weights(law, speed)
                rounding = 1e-14 + 10 * np.spacing(speed) / width_of(p)
                assert -rounding <= w_s <= 1 + rounding
                assert -rounding <= w_k <= 1 + rounding
                assert 0.0 <= mu(law, speed) <= MU_S * (1 + rounding)
                if region != BAND:
                    assert w_s + w_k == pytest.approx(1.0, abs=rounding)

    @given(every, st.floats(0.0, 1.0))
    def test_slopes_of_weights_are_their_derivatives(self, laws, relative):
        for law in laws:
            for region, p in pieces(law).items():
                length = width_of(p)
                speed = p.low + relative * length
                after, before = speed + 1e-5 * length, speed - 1e-5 * length
                _, _, *slopes = weights_in(law, region, speed)
                ahead, behind = weights_in(law, region, after), weights_in(law, region, before)
                spread = (1e-8 + 1e6 * np.spacing(p.low) / length) / length
                for k in range(2):
                    assert slopes[k] == pytest.approx((ahead[k] - behind[k]) / (after - before), abs=spread)

    @given(every, st.floats(0.0, 1.0), st.lists(st.floats(-1.0, 1.0), min_size=8, max_size=8))
    def test_series_of_weights_equals_weights_of_the_series_of_the_speed(self, laws, relative, coefficients):
        for law in laws:
            for region, p in pieces(law).items():
                length, s = width_of(p), 0.02
                x = length * np.array([relative, *coefficients])
                static, kinetic = series_of_friction(p, 1.0, 0.0, x), series_of_friction(p, 0.0, 1.0, x)
                now = p.low + np.polynomial.polynomial.polyval(s, x)
                spread = 1e-11 + 10 * np.spacing(p.low) / length
                w_s, w_k, _, _ = weights_in(law, region, now)
                assert np.polynomial.polynomial.polyval(s, static) == pytest.approx(w_s, abs=spread)
                assert np.polynomial.polynomial.polyval(s, kinetic) == pytest.approx(w_k, abs=spread)


class TestThrelfall:
    @given(widths)
    def test_threlfall_rises_from_zero_to_mu_k_at_v0_and_stays(self, v0):
        law = Threlfall(v0)
        assert mu(law, 0.0) == pytest.approx(0.0, abs=1e-16)
        for times in (1.0, 1.5, 1e6):
            assert mu(law, times * v0) == MU_K
        assert mu(law, nextafter(v0, 0.0)) == pytest.approx(MU_K, rel=1e-14)

    @given(widths)
    def test_slope_of_threlfall_decays_by_exp_minus_3_in_the_band(self, v0):
        """At rest the slope is 3/(1 - e^-3) times that of the secant."""
        assert slope(Threlfall(v0), 0.0) == pytest.approx(3 / (1 - exp(-3)) * MU_K / v0, rel=1e-14)
        left = slope(Threlfall(v0), v0, BAND) / slope(Threlfall(v0), 0.0)
        assert left == pytest.approx(exp(-3), rel=1e-13)

    @given(widths, st.floats(0.0, 1.0))
    def test_threlfall_is_the_published_formula(self, v0, relative):
        """With the denominator 0.95, as it is often printed, the formula differs by up to 3 parts in 10,000."""
        exact = MU_K * (1 - exp(-3 * relative)) / (1 - exp(-3))
        assert mu(Threlfall(v0), relative * v0) == pytest.approx(exact, rel=1e-13, abs=1e-15)
        assert exact == pytest.approx(MU_K * (1 - exp(-3 * relative)) / 0.95, rel=3e-4)

    def test_threlfall_has_no_static_friction(self):
        assert {weights(Threlfall(0.1), speed)[0] for speed in np.linspace(0, 0.3, 50)} == {0.0}


class TestPiecewiseLinear:
    @given(widths, powers(1e-3, 1e3))
    def test_piecewise_linear_goes_through_its_corners_by_straight_lines(self, v0, share):
        v1 = v0 * (1 + share)
        law = PiecewiseLinear(v0, v1)
        assert mu(law, 0.0) == 0.0
        assert mu(law, v0 / 2) == pytest.approx(MU_S / 2, rel=1e-14)
        assert mu(law, v0) == MU_S
        assert mu(law, (v0 + v1) / 2) == pytest.approx((MU_S + MU_K) / 2, rel=1e-12)
        assert mu(law, v1) == mu(law, 1e6 * v1) == MU_K
        assert slope(law, v0 / 3) == pytest.approx(MU_S / v0, rel=1e-14)
        assert slope(law, (v0 + v1) / 2) == pytest.approx((MU_K - MU_S) / (v1 - v0), rel=1e-12)
        assert slope(law, v1) == 0.0


class TestPiecewiseCubic:
    @given(widths, powers(1e-3, 1e3))
    def test_piecewise_cubic_has_its_characteristic_values(self, v0, share):
        v1 = v0 * (1 + share)
        law = PiecewiseCubic(v0, v1)
        assert mu(law, 0.0) == 0.0
        assert mu(law, v0 / 2) == pytest.approx(11 / 16 * MU_S, rel=1e-14)
        assert mu(law, v0) == MU_S
        assert mu(law, (v0 + v1) / 2) == pytest.approx((MU_S + MU_K) / 2, rel=1e-12)
        assert mu(law, v1) == mu(law, 1e6 * v1) == MU_K
        assert slope(law, 0.0) == pytest.approx(1.5 * MU_S / v0, rel=1e-14)
        assert slope(law, (v0 + v1) / 2) == pytest.approx(1.5 * (MU_K - MU_S) / (v1 - v0), rel=1e-12)
        assert slope(law, v1) == 0.0

    @given(widths, powers(1e-3, 1e3), st.floats(0.0, 1.0))
    def test_piecewise_cubic_is_the_papers_formula(self, v0, share, relative):
        v1 = v0 * (1 + share)
        law = PiecewiseCubic(v0, v1)
        rise, fall = weights_in(law, BAND, relative * v0), weights_in(law, STRIBECK, v0 + relative * (v1 - v0))
        step = relative**2 * (3 - 2 * relative)
        assert rise[:2] == pytest.approx((relative * (3 - relative**2) / 2, 0.0), abs=1e-14)
        assert fall[:2] == pytest.approx((1 - step, step), abs=1e-11)


class TestBengisuAkay:
    @given(alphas, powers(1e-6, 1.0))
    def test_bengisu_akay_has_its_characteristic_values(self, alpha, v0):
        law = made(BengisuAkay, alpha, v0)
        assert mu(law, v0 / 2) == pytest.approx(0.75 * MU_S, rel=1e-14)
        assert mu(law, v0) == MU_S
        half = v0 + log(2) / alpha
        assert mu(law, half) == pytest.approx((MU_S + MU_K) / 2, abs=1e-13 + alpha * np.spacing(half))
        assert mu(law, law.end) == mu(law, 2 * law.end) == MU_K
        assert slope(law, 0.0) == pytest.approx(2 * MU_S / v0, rel=1e-14)
        assert slope(law, v0, BAND) == pytest.approx(0.0, abs=1e-14 / v0)
        assert slope(law, v0) == pytest.approx(alpha * (MU_K - MU_S), rel=1e-14)

    @given(bengisu_akay, st.floats(0.0, 3.0))
    def test_bengisu_akay_is_the_papers_formula(self, law, relative):
        speed = relative * law.v0
        inside = MU_S * (1 - (1 - speed / law.v0) ** 2)
        outside = MU_K * (1 + (MU_S / MU_K - 1) * exp(-law.alpha * max(speed - law.v0, 0.0)))
        assert mu(law, speed) == pytest.approx(inside if speed < law.v0 else outside, rel=1e-12, abs=1e-15)

    @given(bengisu_akay, st.floats(0.0, 3.0), st.floats(0.0, 3.0))
    def test_bengisu_akay_rises_in_the_band_and_falls_outside(self, law, one, other):
        slow, fast = sorted((one * law.v0, other * law.v0))
        assert mu(law, min(slow, law.v0)) <= mu(law, min(fast, law.v0)) <= MU_S
        assert MU_K <= mu(law, max(fast, law.v0)) <= mu(law, max(slow, law.v0))

    @given(st.floats(1e-3, 3.0))
    def test_bengisu_akay_tends_to_coulomb_for_a_narrow_band(self, speed):
        assert weights(made(BengisuAkay, 1e5, 2e-6), speed) == pytest.approx(weights(Coulomb(), speed), abs=1e-12)


class TestTustin:
    @given(alphas, st.floats(0.0, 30.0))
    def test_tustin_decays_from_mu_s_at_rest_to_mu_k(self, alpha, x):
        law = made(Tustin, alpha)
        assert mu(law, 0.0) == MU_S
        if x / alpha < law.end:
            assert mu(law, x / alpha) == pytest.approx(MU_K + (MU_S - MU_K) * exp(-x), rel=1e-13)
        assert mu(law, law.end) == mu(law, 2 * law.end) == MU_K

    @given(powers(1.0, 1e9), powers(1e-6, 1.0), st.floats(0.0, 30.0))
    def test_tustin_equals_the_tail_of_bengisu_akay(self, alpha, v0, x):
        one, other = made(Tustin, alpha), made(BengisuAkay, alpha, v0)
        # Rounding of the speed changes the exponent and the weights by as much, the slopes by alpha times as much.
        off = 1e-12 + 2 * alpha * np.spacing(v0 + x / alpha)
        found, known = weights_in(one, STRIBECK, x / alpha), weights_in(other, STRIBECK, v0 + x / alpha)
        for a, b, unit in zip(found, known, (1.0, 1.0, alpha, alpha), strict=True):
            assert a == pytest.approx(b, rel=1e-12, abs=off * unit)


class TestTailWithoutDecay:
    @given(widths, powers(1e-9, 1e9))
    def test_tail_with_alpha_zero_stays_at_mu_s(self, v0, times):
        law = made(BengisuAkay, 0.0, v0)
        assert law.end == inf
        assert weights(law, v0 * (1 + times)) == (1.0, 0.0, 0.0, 0.0)
        assert weights(made(Tustin, 0.0), times) == (1.0, 0.0, 0.0, 0.0)
        assert KINETIC not in pieces(law)

    @given(alphas)
    def test_tail_with_small_alpha_falls_linearly_in_alpha(self, alpha):
        fall = MU_S - mu(made(Tustin, alpha), 1e-4 / alpha)
        assert fall == pytest.approx(1e-4 * (MU_S - MU_K), rel=1e-4)


class TestEndOfATail:
    @given(powers(1.0, 1e9), st.just(0.0) | powers(1e-6, 1.0))
    def test_rest_of_a_tail_beyond_its_end_changes_the_velocity_by_1e_17(self, alpha, low):
        """The integral of the tail from its end on is at most 1e-17 m/s, and not much less."""
        length = (made(BengisuAkay, alpha, low).end if low else made(Tustin, alpha).end) - low
        rounding = 1 + 3 * alpha * np.spacing(low)
        assert 1e-18 < exp(-alpha * length) / alpha < 1.1e-17 * rounding


class TestSetValued:
    @given(powers(1e-12, 1e6))
    def test_friction_of_coulomb_and_stiction_does_not_depend_on_the_speed(self, speed):
        for law in (Coulomb(), Stiction()):
            assert weights(law, speed) == (0.0, 1.0, 0.0, 0.0)

    @given(widths, st.floats(0.0, 3.0))
    def test_karnopp_has_mu_s_in_the_dead_band_and_mu_k_outside(self, band, relative):
        expected = (1.0, 0.0, 0.0, 0.0) if relative * band < band else (0.0, 1.0, 0.0, 0.0)
        assert weights(Karnopp(band), relative * band) == expected


def scene(law, **parameters):
    """A belt scene with parameters of its friction law."""
    return {
        "model": "belt",
        "body": {"mass": 1.0},
        "spring": {"stiffness": 2.0},
        "belt": {"velocity": 0.1},
        "friction": {"law": law, "mu_s": MU_S, "mu_k": MU_K, **parameters},
        "time": {"span": 1.0},
    }


@pytest.mark.parametrize("law", ["piecewise-linear", "piecewise-cubic"])
class TestOrderOfSpeeds:
    @pytest.mark.parametrize("v1", [0.1, 0.2])
    def test_v1_not_above_v0_is_refused(self, law, v1):
        with pytest.raises(InputError, match=rf"friction\.v1: {v1} m/s is not greater than friction\.v0"):
            load({"scene": scene(law, v0=0.2, v1=v1)})

    def test_v1_not_above_v0_in_one_cell_of_a_sweep_is_refused(self, law):
        with pytest.raises(InputError, match=r"friction\.v1.* is not greater than friction\.v0.*in a cell"):
            load({"scene": scene(law, v0=0.2), "sweep": {"grid": {"friction.v1": [0.5, 0.3, 0.15]}}})

    def test_v1_above_v0_is_accepted(self, law):
        found = load({"scene": scene(law, v0="1 mm/s", v1="2 mm/s")})
        assert (found.scene.values["friction.v0"], found.scene.values["friction.v1"]) == (1e-3, 2e-3)


#: A file with a user's own friction law.
OWN = """
from typing import Annotated, NamedTuple
from ringsweep.numerics.functions import select
from ringsweep.quantities.parameters import Leaf
from ringsweep.physics.friction import Smooth, Traits, add_law
from ringsweep.physics.friction.regularised import V0
from ringsweep.physics.friction.velocity import BAND, KINETIC, ONE, STRIBECK, ZERO, Piece, absent, piece, stiction_band


class Ramp(NamedTuple):
    v0: Annotated[Leaf, V0]


@piece.implements(Ramp)
def _ramp(law, region):
    if region == STRIBECK:
        return absent()
    if region == KINETIC:
        return Piece(law.v0, float("inf"), 0.0, ZERO, ONE)
    return Piece(0.0, law.v0, 0.0, ZERO, (0.0, 1.0 / law.v0, 0.0, 0.0))


@stiction_band.implements(Ramp)
def _band(law):
    return law.v0


add_law("ramp", Ramp, Traits(Smooth))
"""

#: A script that uses this law and prints one of its weights and the digest of the sources.
USE = """
from ringsweep.config import load
from ringsweep.compile import SOURCES_DIGEST
from ringsweep.physics.friction import LAWS, Smooth, family_of
from ringsweep.physics.friction.velocity import weights
from ringsweep.solvers.event import Auto
scene = {"model": "belt", "body": {"mass": 1}, "spring": {"stiffness": 2}, "belt": {"velocity": 0.1},
         "friction": {"law": "ramp", "mu_s": 0.2, "mu_k": 0.1, "v0": "1 cm/s"}, "time": {"span": 1}}
structure = load({"scene": scene}).scene.structure
law = LAWS[structure.law]
assert family_of(law) is Smooth and Auto().resolved(structure).name == "implicit"
print(weights(law(0.01), 0.005)[1], SOURCES_DIGEST)
"""


def in_a_process(script, **environment):
    environment = {**os.environ, **environment}
    return subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=False)


class TestOwnLaws:
    def test_file_named_by_ringsweep_laws_adds_a_law(self, tmp_path):
        (tmp_path / "my_law.py").write_text(OWN)
        done = in_a_process(USE, RINGSWEEP_LAWS=str(tmp_path / "my_law.py"))
        assert done.stdout.startswith("0.5 "), done.stderr
        # Kernels and results with the file have another key than those without it.
        assert SOURCES_DIGEST not in done.stdout

    @pytest.mark.parametrize("name", ["nowhere.py", "json.py"])
    def test_unusable_file_in_ringsweep_laws_is_refused_in_one_line(self, tmp_path, name):
        if name == "json.py":
            (tmp_path / name).write_text(OWN)
        (tmp_path / "a.yaml").write_text("scene: {}")
        script = f"from ringsweep.cli import main; raise SystemExit(main(['run', {str(tmp_path / 'a.yaml')!r}]))"
        done = in_a_process(script, RINGSWEEP_LAWS=str(tmp_path / name))
        assert done.returncode == 2
        assert done.stderr.count("\n") == 1
        assert "RINGSWEEP_LAWS" in done.stderr
