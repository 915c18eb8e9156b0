"""Bodies that are declared by their balances, against solutions that do not use what is derived from them."""

import math
from collections import namedtuple
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, reject
from hypothesis import strategies as st
from refusals import refused
from solutions import rod

from ringsweep.models.ring import SingleContactRing
from ringsweep.models.scene import Structure
from ringsweep.physics import contact, ring

ENERGY = "mass*radius*(0.5*radius*omega**2 - pull*cos_phi)"


ALONG = "mass*radius*phi_dd = K1*N1 + K2*N2 - mass*pull*sin_phi"


def declared(name: str, fields: str, *balances: str) -> Any:
    """A body with a mass, a radius, gravity, a load and a pull, and further fields."""
    names = f"mass radius gravity press pull {fields} constants"
    # typing.NamedTuple takes no defaults where it is called.
    made = namedtuple(name, names, defaults=((),))  # noqa: PYI024
    return ring.body(balances=balances, energy=ENERGY)(made)


#: A body on two feet, whose friction acts at heights of their own below the centre of mass.
OnFeet = declared(
    "OnFeet", "half height_1 height_2",
    "N1 + N2 = mass*press", "half*(N1 - N2) = -(height_1*K1*N1 + height_2*K2*N2)", ALONG,
)  # fmt: skip

#: Two shoes of a brake: friction of each one presses the other one on.
Brake = declared("Brake", "onto_1 onto_2", "N1 = mass*press + onto_1*K2*N2", "N2 = mass*press + onto_2*K1*N1", ALONG)

#: A body on one contact, whose friction presses it on or lifts it.
Sledge = declared("Sledge", "lift", "N1 = mass*press + lift*K1*N1", "mass*radius*phi_dd = K1*N1 - mass*pull*sin_phi")


FIELDS = [(name, Any) for name in ring.TwoContacts._fields if name != "constants"]

#: The body of the ring, whose last balance is that of the moments about the centre of mass.
AboutCentre = NamedTuple("AboutCentre", [*FIELDS, ("constants", tuple[Any, ...])])

#: The body of the ring, one of whose balances has the other sign, with a field in place of a 1.
Turned = NamedTuple("Turned", [*FIELDS, ("sign", Any), ("constants", tuple[Any, ...])])

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


def of_feet(body: Any, K1: float, K2: float) -> list[list[float]]:
    """Factors of N1 and N2, and constant terms, of the two balances without acceleration."""
    at_1, at_2 = body.half + body.height_1 * K1, -body.half + body.height_2 * K2
    return [[1.0, 1.0, -body.mass * body.press], [at_1, at_2, 0.0]]


def of_brake(body: Any, K1: float, K2: float) -> list[list[float]]:
    """As :func:`of_feet`."""
    load = -body.mass * body.press
    return [[1.0, -body.onto_1 * K2, load], [-body.onto_2 * K1, 1.0, load]]


def brake(onto_1: float, onto_2: float) -> Any:
    """A brake of 1 kg."""
    return ring.completed(Brake(1.0, 1.0, 9.81, 10.0, 5.0, onto_1, onto_2))


class Held(NamedTuple):
    """A state of stick: saturation, 1; reactions, N; whether more friction slows the body down more, without a jam."""

    kappa: float
    N1: float
    N2: float
    stable: bool


def held_states(body: Any, balances: Any, m1: float, m2: float, needed: float) -> list[Held]:
    """All states of stick that need this friction, N: with K_i = -kappa m_i the balances are linear in N1, N2 and 1."""

    def matrix(kappa: float) -> np.ndarray:
        return np.array([*balances(body, -kappa * m1, -kappa * m2), [kappa * m1, kappa * m2, needed]])

    def pull(kappa: float) -> float:
        rows = matrix(kappa)
        return float(-rows[2, :2] @ np.linalg.solve(rows[:2, :2], -rows[:2, 2]))

    samples = np.array([-1.0, 0.0, 1.0])
    values = [np.linalg.det(matrix(kappa)) for kappa in samples]
    found = []
    for kappa in np.roots(np.polyfit(samples, values, 2)):
        if abs(kappa.imag) < 1e-12 and abs(kappa.real) <= 1.0:
            kappa = kappa.real
            rows = matrix(kappa)
            whole = np.linalg.det(rows[:2, :2]) / np.linalg.det(matrix(0.0)[:2, :2])
            if abs(whole) <= 1e-6:
                reject()
            N1, N2 = np.linalg.solve(rows[:2, :2], -rows[:2, 2])
            if min(N1, N2) > 0.0:
                found.append(Held(kappa, N1, N2, whole > 0.0 and pull(kappa + 1e-7) < pull(kappa - 1e-7)))
    return found


coefficients = st.floats(0.01, 1.5)
arms = st.one_of(st.sampled_from([0.0, 1e-9, 0.3]), st.floats(-3.0, 3.0))


class TestStick:
    @pytest.mark.parametrize(("made", "balances"), [(feet, of_feet), (brake, of_brake)])
    @given(arms, arms, coefficients, coefficients, st.floats(-1.5, 1.5), st.floats(-9.0, 9.0))
    def test_body_sticks_in_a_state_that_the_balances_allow(self, made, balances, a1, a2, m1, m2, phi, epsilon):
        body = made(a1, a2)
        needed = body.mass * (body.radius * epsilon + body.pull * np.sin(phi))
        kappa, reserve, N1, N2 = contact.stick(body, m1, m2, (np.sin(phi), np.cos(phi), 0.0), epsilon)
        allowed = held_states(body, balances, m1, m2, needed)
        nearly = any(abs(abs(found.kappa) - 1.0) < 1e-6 or min(found.N1, found.N2) < 1e-6 for found in allowed)
        if allowed and not nearly:
            assert reserve > 0.0
            assert min(N1, N2) > 0.0
            assert min(np.abs(np.subtract(found[:3], (kappa, N1, N2))).max() for found in allowed) < 1e-6
        if reserve > 1e-6 and min(N1, N2) > 1e-6:
            assert allowed

    @pytest.mark.parametrize(
        ("heights", "static", "phi", "epsilon"),
        [
            ((-0.635, 2.952), (1.386, 0.236), 0.27, 3.532),
            ((2.619, -0.674), (0.256, 1.317), 1.184, -8.131),
            ((1.76, -1.078), (0.419, 0.775), -0.87, -0.084),
            ((-2.676, 1.92), (0.413, 1.471), -0.071, 2.801),
        ],
    )
    def test_of_two_states_of_stick_the_body_takes_the_stable_one(self, heights, static, phi, epsilon):
        body = feet(*heights)
        allowed = held_states(body, of_feet, *static, epsilon + 5.0 * np.sin(phi))
        assert sorted(found.stable for found in allowed) == [False, True]
        (stable,) = (found for found in allowed if found.stable)
        kappa, _, N1, N2 = contact.stick(body, *static, (np.sin(phi), np.cos(phi), 0.0), epsilon)
        assert (kappa, N1, N2) == pytest.approx(stable[:3], abs=1e-6)

    def test_contacts_whose_loads_are_given_share_the_friction_in_proportion(self):
        body = brake(0.0, 0.0)
        kappa, reserve, N1, N2 = contact.stick(body, 0.4, 0.1, (0.6, 0.8, 0.0), 1.0)
        assert (kappa, reserve, N1, N2) == pytest.approx((-4.0 / 5.0, 1.0, 10.0, 10.0))


class TestDeclaration:
    def test_friction_that_does_other_work_at_one_contact_is_refused(self):
        balances = "N1 = mass*press", "N2 = mass*press", "mass*radius*phi_dd = K1*N1 + 2*K2*N2 - mass*pull*sin_phi"
        twice = ring.body(balances=balances, energy=ENERGY)(
            NamedTuple("Twice", [(name, Any) for name in Brake._fields])
        )
        with pytest.raises(ValueError, match=r"K2\*N2 does not do the work of friction"):
            ring.completed(twice(1.0, 1.0, 9.81, 10.0, 5.0, 0.0, 0.0, ()))

    def test_balances_that_do_not_determine_a_reaction_are_refused(self):
        along = "mass*radius*phi_dd = K1*N1 - mass*pull*sin_phi"
        loose = declared("Loose", "share", "share*N1 = mass*gravity", along)
        ring.completed(loose(1.0, 1.0, 9.81, 0.0, 5.0, 1e-9))
        with pytest.raises(ValueError, match="do not determine phi_dd and the reactions for these numbers"):
            ring.completed(loose(1.0, 1.0, 9.81, 0.0, 5.0, np.array([0.5, 0.0])))

    @pytest.mark.parametrize("name", ["epsilon", "F2", "one", "slope_1", "square", "omega", "K2"])
    def test_field_with_the_name_of_a_symbol_is_refused(self, name):
        cls = NamedTuple("Named", [(field, Any) for field in (*Sledge._fields, name)])
        with pytest.raises(TypeError, match=f"the field {name} needs another name"):
            ring.body(balances=("N1 = mass*gravity", "mass*radius*phi_dd = K1*N1"), energy="0.5*mass*radius*omega**2")(
                cls
            )


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


ABOUT_CENTRE = "inertia*phi_dd = -xi*sin_beta*(N1 - N2) + (radius - xi*cos_beta)*(K1*N1 + K2*N2)"


class TestLastBalance:
    OTHERS = (
        "-mass*xi*omega**2 = mass*gravity*cos_phi - (N1 + N2)*cos_beta + (K1*N1 - K2*N2)*sin_beta",
        "mass*xi*phi_dd = -mass*gravity*sin_phi + (N1 - N2)*sin_beta + (K1*N1 + K2*N2)*cos_beta",
    )
    KINETIC = "0.5*(inertia + mass*xi**2)*omega**2 - mass*gravity*xi*cos_phi"
    RIG = 0.076, 4.47e-5, 0.0434, 0.0225, 0.74, float(np.sin(0.74)), float(np.cos(0.74)), 9.81

    def test_moments_may_be_taken_about_another_point(self):
        ring.body(balances=(*self.OTHERS, ABOUT_CENTRE), energy=self.KINETIC)(AboutCentre)
        one, other = ring.completed(ring.TwoContacts(*self.RIG)), ring.completed(AboutCentre(*self.RIG, ()))
        at = 0.3, 0.95, 2.0
        for K1, K2 in ((0.0, 0.0), (0.4, 0.1), (-0.7, 0.3)):
            assert ring.acceleration(other, K1, K2, at)[0] == pytest.approx(ring.acceleration(one, K1, K2, at)[0])
            assert ring.power(other, K1, K2, *ring.reactions(one, K1, K2, at), at) == pytest.approx(
                ring.power(one, K1, K2, *ring.reactions(one, K1, K2, at), at)
            )
        assert contact.stick(other, 0.4, 0.2, at, 0.0) == pytest.approx(contact.stick(one, 0.4, 0.2, at, 0.0))

    @pytest.mark.parametrize(
        ("last", "energy", "message"),
        [
            (f"{ABOUT_CENTRE} + 0.1*radius*N1", KINETIC, "the work of friction|do not follow from the potential"),
            (ABOUT_CENTRE.replace("radius - xi", "radius + xi"), KINETIC, "the work of friction"),
            (ABOUT_CENTRE, KINETIC.replace("xi*cos_phi", "radius*cos_phi"), "do not follow from the potential energy"),
        ],
    )
    def test_reaction_that_does_work_is_refused(self, last, energy, message):
        ring.body(balances=(*self.OTHERS, last), energy=energy)(AboutCentre)
        with pytest.raises(ValueError, match=message):
            ring.completed(AboutCentre(*self.RIG, ()))

    def test_contact_without_friction_is_refused(self):
        balances = "N1 = mass*press", "N2 = mass*press", "mass*radius*phi_dd = K2*N2 - mass*pull*sin_phi"
        with pytest.raises(TypeError, match=r"K1\*N1 is in no balance"):
            ring.body(balances=balances, energy=ENERGY)(Brake)


class TestSign:
    @pytest.mark.parametrize("sign", [1.0, -1.0, -0.37])
    def test_balance_may_be_multiplied_by_a_number(self, sign):
        body = rod(0.076, 4.47e-5, 0.0434, 0.0225, 0.74, 0.67, 9.81)
        turned = ring.completed(Turned(*body[:8], sign, ()))
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


class TestModel:
    """A model whose body is declared, and mistakes in it."""

    @staticmethod
    def cells(made):
        class OnSledge(SingleContactRing):
            name, body_type = "sledge", Sledge

            def build_body(self, values):
                return made(values)

        model = OnSledge()
        structure = Structure("sledge", "coulomb", "arctan")
        known = model.parameters(structure)
        return model.build(structure, {path: np.full(2, p.default or 1.0) for path, p in known.items()})

    def test_field_may_be_one_number_for_all_cells(self):
        body = self.cells(lambda values: Sledge(values["body.mass"], values["ring.radius"], 9.81, 10.0, 5.0, 0)).body
        assert all(np.shape(field) == (2,) for field in body[:6])

    @pytest.mark.parametrize("wrong", [lambda values: Sledge(1.0), lambda values: math.cos(values["gravity"])])
    def test_body_that_cannot_be_built_is_told(self, wrong):
        refused(r"sledge: build_body fails with TypeError: .* use NumPy", self.cells, wrong)

    def test_contacts_are_those_of_the_balances(self):
        class OnShoes(SingleContactRing):
            name, body_type = "shoes", Brake

        assert OnShoes.contacts == 2
        assert not OnShoes.absent
        with pytest.raises(TypeError, match=r"body_type Held is not declared by ring.body"):

            class Wrong(SingleContactRing):
                name, body_type = "wrong", Held


class TestOpening:
    def test_body_on_two_contacts_must_say_which_one_opens(self):
        class Feet(SingleContactRing):
            name, body_type = "feet", OnFeet

        with pytest.raises(TypeError, match=r"model feet: OnFeet has no contact\.opening"):
            Feet().required(Structure("feet", "coulomb"))
