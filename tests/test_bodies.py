"""Bodies that are declared by their balances, against solutions that do not use what is derived from them."""

from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from solutions import rod

from ringsweep.models.ring import SingleContactRing
from ringsweep.models.scene import Structure
from ringsweep.physics import contact, ring

ENERGY = "mass*radius*(0.5*radius*omega**2 - pull*cos_phi)"


class OnFeet(NamedTuple):
    """A body on two feet, whose friction acts at heights of their own below the centre of mass."""

    mass: Any
    radius: Any
    gravity: Any
    press: Any
    pull: Any
    half: Any
    height_1: Any
    height_2: Any
    constants: tuple[Any, ...] = ()


ring.body(
    balances=(
        "N1 + N2 = mass*press",
        "half*(N1 - N2) = -(height_1*K1*N1 + height_2*K2*N2)",
        "mass*radius*phi_dd = K1*N1 + K2*N2 - mass*pull*sin_phi",
    ),
    energy=ENERGY,
)(OnFeet)


class Sledge(NamedTuple):
    """A body on one contact, whose friction presses it on or lifts it."""

    mass: Any
    radius: Any
    gravity: Any
    press: Any
    pull: Any
    lift: Any
    constants: tuple[Any, ...] = ()


ring.body(
    balances=("N1 = mass*press + lift*K1*N1", "mass*radius*phi_dd = K1*N1 - mass*pull*sin_phi"),
    energy=ENERGY,
)(Sledge)


class Turned(NamedTuple):
    """The body of the ring, one of whose balances has the other sign, with a field in place of a 1."""

    mass: Any
    inertia: Any
    radius: Any
    xi: Any
    beta: Any
    sin_beta: Any
    cos_beta: Any
    gravity: Any
    sign: Any
    constants: tuple[Any, ...] = ()


ring.body(
    balances=(
        "sign*(-mass*xi*omega**2) = sign*(mass*gravity*cos_phi - (N1 + N2)*cos_beta + (K1*N1 - K2*N2)*sin_beta)",
        "mass*xi*phi_dd = -mass*gravity*sin_phi + (N1 - N2)*sin_beta + (K1*N1 + K2*N2)*cos_beta",
        "(inertia + mass*xi**2)*phi_dd = -mass*gravity*xi*sin_phi + radius*(K1*N1 + K2*N2)",
    ),
    energy="0.5*(inertia + mass*xi**2)*omega**2 - mass*gravity*xi*cos_phi",
)(Turned)


def feet(height_1: float, height_2: float) -> Any:
    """A body of 1 kg on feet that are 1 m apart."""
    return ring.completed(OnFeet(1.0, 1.0, 9.81, 10.0, 5.0, 0.5, height_1, height_2))


def held_states(body: Any, m1: float, m2: float, phi: float, epsilon: float) -> list[tuple[float, float, float]]:
    """Saturation and reactions of all states of stick, by the roots of the determinant of the balances.

    With K_i = -kappa m_i the balances are linear in N1, N2 and 1.
    """

    def balances(kappa: float) -> np.ndarray:
        at_1, at_2 = body.half - body.height_1 * kappa * m1, -body.half - body.height_2 * kappa * m2
        inertia = body.mass * (body.radius * epsilon + body.pull * np.sin(phi))
        return np.array([[1.0, 1.0, -body.mass * body.press], [at_1, at_2, 0.0], [kappa * m1, kappa * m2, inertia]])

    samples = np.array([-1.0, 0.0, 1.0])
    values = [np.linalg.det(balances(kappa)) for kappa in samples]
    found = []
    for kappa in np.roots(np.polyfit(samples, values, 2)):
        if abs(kappa.imag) < 1e-12 and abs(kappa.real) <= 1.0:
            rows = balances(kappa.real)
            N1, N2 = np.linalg.solve(rows[:2, :2], -rows[:2, 2])
            if min(N1, N2) > 0.0:
                found.append((kappa.real, N1, N2))
    return found


coefficients = st.floats(0.01, 1.5)


class TestStick:
    @given(*[st.floats(-0.6, 0.6)] * 2, coefficients, coefficients, st.floats(-1.5, 1.5), st.floats(-3.0, 3.0))
    def test_body_sticks_in_one_of_the_states_that_the_balances_allow(self, h1, h2, m1, m2, phi, epsilon):
        if abs(h1 - h2) < 1e-3:
            return
        body = feet(h1, h2)
        kappa, reserve, N1, N2 = contact.stick(body, m1, m2, (np.sin(phi), np.cos(phi), 0.0), epsilon)
        allowed = held_states(body, m1, m2, phi, epsilon)
        nearly = any(abs(abs(found[0]) - 1.0) < 1e-6 or min(found[1:]) < 1e-6 for found in allowed)
        if allowed and not nearly:
            assert reserve > 0.0
            assert min(N1, N2) > 0.0
            assert min(np.abs(np.subtract(found, (kappa, N1, N2))).max() for found in allowed) < 1e-6
        if reserve > 1e-6 and min(N1, N2) > 1e-6:
            assert allowed

    def test_heights_that_agree_only_in_their_numbers_are_refused(self):
        with pytest.raises(ValueError, match="enters the balances in the same way"):
            feet(0.3, 0.3)

    def test_friction_whose_share_the_balances_leave_open_is_refused(self):
        balances = "N1 = mass*press", "N2 = mass*press", "mass*radius*phi_dd = K1*N1 + 2*K2*N2 - mass*pull*sin_phi"
        with pytest.raises(TypeError, match="share its friction"):
            ring.body(balances=balances, energy=ENERGY)(OnFeet)


class TestOneContact:
    @given(st.floats(-8.0, 8.0), st.floats(-1.5, 1.5), st.floats(-4.0, 4.0))
    def test_contact_opens_only_where_the_body_does_not_press(self, press, K, lift):
        # The reaction is press/(1 - lift K). Where friction turns its sign, the body jams and cannot leave.
        body = ring.completed(Sledge(1.0, 1.0, 9.81, press, 0.0, lift))
        if min(abs(press), abs(1.0 - lift * K)) < 1e-9:
            return
        jams = press > 0.0 and lift * K > 1.0
        opens = press < 0.0 and lift * K < 1.0
        found = contact.sliding(body, K, 0.0, (0.0, 1.0, 1.0))
        if press > 0.0:
            assert found == (contact.IMPOSSIBLE if jams else contact.CLOSED)
        elif opens:
            assert found == contact.OPEN_1


class TestSign:
    @pytest.mark.parametrize("sign", [1.0, -1.0, -0.37])
    def test_balance_may_be_multiplied_by_a_number(self, sign):
        body = rod(0.076, 4.47e-5, 0.0434, 0.0225, 0.74, 0.67, 9.81)
        turned = ring.completed(Turned(*body[:8], sign))
        at = 0.3, 0.95, 2.0
        for K1, K2 in ((0.0, 0.0), (0.4, 0.1), (-2.0, 2.0), (5.0, -5.0)):
            (one, determinant), (other, theirs) = (
                ring.acceleration(body, K1, K2, at),
                ring.acceleration(turned, K1, K2, at),
            )
            assert other == pytest.approx(one, rel=1e-12)
            assert theirs == pytest.approx(abs(sign) * determinant, rel=1e-12)
            assert ring.reactions(turned, K1, K2, at) == pytest.approx(ring.reactions(body, K1, K2, at), rel=1e-12)
        assert contact.stick(turned, 0.4, 0.2, at, 0.0) == pytest.approx(
            contact.stick(body, 0.4, 0.2, at, 0.0), rel=1e-9
        )


class TestOpening:
    def test_body_on_two_contacts_must_say_which_one_opens(self):
        class Feet(SingleContactRing):
            name, body_type, contacts = "feet", OnFeet, 2

        with pytest.raises(TypeError, match=r"model feet: OnFeet has no contact\.opening"):
            Feet().required(Structure("feet", "coulomb"))
