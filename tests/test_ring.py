"""Equations of the ring: balances, symmetries, limits; and compiled functions against plain formulas."""

from math import cos, radians, sin
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from solutions import ball, rod

from ringsweep.compile import take
from ringsweep.physics import ring
from ringsweep.physics.ring import acceleration, reactions

angles = st.floats(-20.0, 20.0)
friction_ratios = st.floats(-1.2, 1.2)
#: Centripetal acceleration divided by g.
lifts = st.floats(0.0, 100.0)


@st.composite
def two_contacts(draw):
    """Bodies of any size that fit into the ring."""
    radius, beta = draw(st.floats(0.01, 10.0)), draw(st.floats(0.1, 1.5))
    mass, gravity = draw(st.floats(1e-3, 1e3)), draw(st.floats(0.1, 30.0))
    xi = radius * (1.0 - draw(st.floats(0.0, 0.7))) * cos(beta)
    inertia = mass * xi * xi * draw(st.floats(0.0, 3.0))
    return rod(mass, inertia, radius, xi, sin(beta), cos(beta), gravity)


@st.composite
def states(draw):
    """Body, K1, K2, angle and angular velocity, not close to jamming."""
    body = draw(two_contacts())
    K1, K2, phi = draw(friction_ratios), draw(friction_ratios), draw(angles)
    omega = (draw(lifts) * body.gravity / body.radius) ** 0.5
    _, determinant = acceleration(body, K1, K2, (sin(phi), cos(phi), omega))
    assume(abs(determinant) > 0.05 * body.mass * body.xi**2)
    return body, K1, K2, phi, omega


def motion(body, K1, K2, phi, omega):
    """Angular acceleration and reactions."""
    epsilon = acceleration(body, K1, K2, (sin(phi), cos(phi), omega))[0]
    return epsilon, *reactions(body, K1, K2, (sin(phi), cos(phi), omega))


def force_scale(body, omega, epsilon, *normals):
    """Size of the terms in a balance of forces, N."""
    return body.mass * (body.gravity + body.radius * (omega**2 + abs(epsilon))) + sum(map(abs, normals))


def solution(body, K1, K2, phi, omega):
    """Angular acceleration and reactions from the balances as they are declared, solved as linear equations."""
    texts = ring.equations_of(type(body)).texts
    known = {**body._asdict(), "sin_phi": sin(phi), "cos_phi": cos(phi), "omega": omega, "K1": K1, "K2": K2}

    def errors(unknowns):
        names = known | dict(zip(("phi_dd", "N1", "N2"), unknowns, strict=True))
        sides = ([eval(side, {}, names) for side in text.split("=")] for text in texts)
        return np.array([left - right for left, right in sides])

    size = len(texts)
    base = errors(np.zeros(3))
    matrix = np.array([errors(unit) - base for unit in np.eye(3)[:size]]).T
    return np.linalg.solve(matrix, -base)


class TestDeclaredBalances:
    @given(states(), st.floats(-1e-3, 1e-3))
    def test_audit_sees_a_wrong_reaction(self, state, share):
        body, K1, K2, phi, omega = state
        epsilon, N1, N2 = motion(*state)
        at = sin(phi), cos(phi), omega
        assert ring.imbalance(body, K1, K2, N1, N2, epsilon, at) < 1e-24
        wrong = share * (abs(N1) + abs(N2))
        assert ring.imbalance(body, K1, K2, N1 + wrong, N2, epsilon, at) >= 1e-4 * share**2

    @pytest.mark.parametrize(
        ("balances", "message"),
        [
            (("mass*gravty*cos_phi = N1", "mass*radius*phi_dd = K1*N1"), "gravty is not known; did you mean gravity?"),
            (("mass*gravity = N1*N1", "mass*radius*phi_dd = K1*N1"), "a balance is a sum of multiples"),
            (("mass*gravity = 0", "mass*radius*phi_dd = K1*N1"), "do not determine"),
            (("mass*gravity = sqrt(N1)", "mass*radius*phi_dd = K1*N1"), "sqrt is not known"),
            (("mass/radius = N1", "mass*radius*phi_dd = K1*N1"), "only sums, .* such as a quotient"),
            (("mass*gravity - N1", "mass*radius*phi_dd = K1*N1"), "an equation, with one `=`"),
            (("mass*radius*phi_dd = K1*N1", "mass*gravity = N1"), "has no phi_dd: the last balance"),
            ("N1 = mass*gravity", "balances is one text"),
            (("mass*gravity = N1",), "1 in number: give two .* is a comma missing"),
        ],
    )
    def test_wrong_balance_is_told_with_its_text(self, balances, message):
        with pytest.raises(TypeError, match=f"OneContact: .*{message}"):
            ring.body(balances=balances, energy="0")(ring.OneContact)


class Falling(NamedTuple):
    """A particle on a race, with a field that equals a product of others."""

    mass: float
    radius: float
    gravity: float
    inertia: float
    constants: tuple[float, ...] = ()


class TestEnergy:
    """The energy of a declared body, against the work of its friction and the terms of its last balance."""

    BALANCES = "N1 = mass*gravity*cos_phi + mass*radius*omega**2", "mass*radius*phi_dd = K1*N1 - mass*gravity*sin_phi"
    WEIGHT = "- mass*gravity*radius*cos_phi"

    @pytest.mark.parametrize(
        ("last", "energy", "message"),
        [
            (BALANCES[1], f"0.5*mass*radius**2*omega**2 {WEIGHT}", None),
            (BALANCES[1], f"0.5*inertia*omega**2 {WEIGHT}", None),
            # Drag, and a force that is constant, are work that is not in the energy.
            (f"{BALANCES[1]} - gravity*radius*omega + 0.1*mass*gravity", f"0.5*inertia*omega**2 {WEIGHT}", None),
            (BALANCES[1], f"inertia*omega**2 {WEIGHT}", "another inertia"),
            (BALANCES[1].replace("K1*N1", "-K1*N1"), f"0.5*inertia*omega**2 {WEIGHT}", "a sign is wrong"),
            (BALANCES[1], "0.5*inertia*omega**2 + mass*gravity*radius*cos_phi", "the potential energy"),
            (BALANCES[1], "0.5*inertia*omega**2", "the potential energy"),
        ],
    )
    def test_energy_that_contradicts_the_last_balance_is_refused(self, last, energy, message):
        ring.body(balances=(self.BALANCES[0], last), energy=energy)(Falling)
        bodies = Falling(np.array([0.3, 2.0]), np.array([0.2, 1.5]), 9.81, np.array([0.3 * 0.2**2, 2.0 * 1.5**2]))
        if message is None:
            assert ring.completed(bodies).mass is bodies.mass
        else:
            with pytest.raises(ValueError, match=message):
                ring.completed(bodies)

    def test_field_that_a_scale_needs_is_named(self):
        with pytest.raises(TypeError, match=r"Bare: .* field radius, constants"):
            ring.body(balances=self.BALANCES, energy="0")(NamedTuple("Bare", [("mass", float), ("gravity", float)]))


@ring.body(
    balances=(
        "-mass*xi*omega**2 = mass*gravity*cos_phi - (N1 + N2)*cos_beta + (K1*N1 - K2*N2)*sin_beta + pull",
        "mass*xi*phi_dd = -mass*gravity*sin_phi + (N1 - N2)*sin_beta + (K1*N1 + K2*N2)*cos_beta - drag*omega",
        "(inertia + mass*xi**2)*phi_dd = -mass*gravity*xi*sin_phi + radius*(K1*N1 + K2*N2) - drag*xi*omega",
    ),
    energy="0.5*(inertia + mass*xi**2)*omega**2 - mass*gravity*xi*cos_phi",
)
class Dragged(NamedTuple):
    """Two contacts, drag of the air at the centre of mass, and a constant radial force."""

    mass: float
    inertia: float
    radius: float
    xi: float
    beta: float
    sin_beta: float
    cos_beta: float
    gravity: float
    drag: float
    pull: float
    constants: tuple[float, ...] = ()


class TestDerivedFunctions:
    """What follows from the balances agrees, for a body whose balances have every kind of term."""

    @given(states(), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
    def test_forms_of_the_solution_agree(self, state, drag, pull):
        simple, K1, K2, phi, omega = state
        weight = simple.mass * simple.gravity
        size = weight * (1.0 + omega**2 * simple.radius / simple.gravity)
        body = ring.completed(Dragged(*simple[:8], drag * size / (1.0 + abs(omega)), pull * weight))
        at = sin(phi), cos(phi), omega
        epsilon, N1, N2 = motion(body, K1, K2, phi, omega)
        scale = force_scale(body, omega, epsilon, N1, N2) + size
        moment = scale * body.radius
        np.testing.assert_allclose(
            solution(body, K1, K2, phi, omega) * [body.mass * body.radius, 1, 1],
            np.array([epsilon, N1, N2]) * [body.mass * body.radius, 1, 1],
            rtol=0,
            atol=1e-9 * scale,
        )
        basis = 1.0, *at, omega**2
        for row, expected in zip(ring.slip_balance(body, K1, K2), (epsilon, N1, N2), strict=True):
            terms = np.multiply(row[:5], basis)
            assert abs(terms.sum() - expected) <= 1e-11 * np.abs(terms).sum()
        found = ring.held(body, 1.0, at, omega**2, epsilon, K2 * N2)
        np.testing.assert_allclose(found, (N1, N2, K1 * N1), rtol=0, atol=1e-9 * scale)
        _, determinant = acceleration(body, K1, K2, at)
        assert ring.determinant_terms(body, 1.0, K1, K2, K1 * K2) == pytest.approx(determinant, rel=1e-12)
        inertia = body.inertia + body.mass * body.xi**2
        rate = inertia * omega * epsilon + weight * body.xi * sin(phi) * omega
        assert abs(ring.power(body, K1, K2, N1, N2, at) - rate) < 1e-9 * moment * (1 + abs(omega))
        by_phi, by_omega = ring.acceleration_gradient(body, K1, K2, at)
        tiny = 1e-30j
        assert by_omega == pytest.approx(acceleration(body, K1, K2, (*at[:2], omega + tiny))[0].imag / 1e-30, rel=1e-9)
        turned = at[0] + tiny * at[1], at[1] - tiny * at[0]
        assert by_phi == pytest.approx(acceleration(body, K1, K2, (*turned, omega))[0].imag / 1e-30, rel=1e-9)
        gain = acceleration(body, tiny, tiny, at)[0].imag / 1e-30
        assert ring.friction_gain(body, at) == pytest.approx(gain, rel=1e-9, abs=1e-9)


class TestOneContact:
    @given(friction_ratios, angles, st.floats(-50.0, 50.0))
    def test_one_contact_is_the_limit_of_two_close_contacts(self, K, phi, omega):
        M, R, g = 0.3, 0.2, 9.81
        epsilon, N, _ = motion(ball(M, R, g), K, K, phi, omega)
        scale = g + R * omega**2
        gaps = []
        for beta in (1e-3, 1e-4, 1e-5):
            close = rod(M, 0.0, R, R * cos(beta), sin(beta), cos(beta), g)
            epsilon_2, N1, N2 = motion(close, K, K, phi, omega)
            gaps.append((abs(epsilon_2 - epsilon) * R + abs(N1 + N2 - N) / M) / scale)
        assert gaps[0] < 1e-2
        assert gaps[2] < 1e-8


class TestGeometry:
    """Geometry of the paper's rig. The paper gives beta, but not the radius of the ring."""

    def test_radius_and_beta_give_the_same_body(self, cells):
        from_radius = take(cells().body, 0)
        from_beta = take(cells({"ring.radius": None, "body.beta": radians(48.504)}).body, 0)
        assert np.degrees(from_radius.beta) == pytest.approx(48.504, abs=1e-3)
        assert from_radius.xi == pytest.approx(0.022115, abs=1e-6)
        for one, other in zip(from_beta, from_radius, strict=True):
            np.testing.assert_allclose(one, other, rtol=2e-4)

    def test_centre_of_mass_lies_beside_the_line_of_the_balls(self, cells):
        on_line, beside = take(cells().body, 0), take(cells({"body.center_offset": 0.005}).body, 0)
        assert beside.xi == pytest.approx(on_line.xi + 0.005)
        assert (beside.radius, beside.beta) == (on_line.radius, on_line.beta)
        # Without friction it is a longer pendulum.
        M, J, xi, g = beside.mass, beside.inertia, beside.xi, beside.gravity
        assert motion(beside, 0.0, 0.0, 1.0, 2.0)[0] == pytest.approx(-M * g * xi / (J + M * xi**2) * sin(1.0))
