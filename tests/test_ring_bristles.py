"""The ring under the Dahl law, against Coulomb friction and against its own balances."""

import numpy as np
import pytest
from solutions import solve

from ringsweep.compile import take
from ringsweep.physics.friction.bristles import NEARLY
from ringsweep.quantities.flags import JAMMED, OSCILLATORY, REVOLVING, SEPARATING
from ringsweep.solvers.event import Event, Implicit

EXACT = Implicit(rtol=1e-9, certify=False)
LIMIT = Event(rtol=1e-14, certify=False)

#: A launch on a ring at rest: the body slides onto the zone, back, and sticks.
LAUNCH = {
    "initial.omega": 16.0,
    "friction.rough.mu_k": 0.15,
    "friction.rest.mu_k": 0.1,
    "zone.half_angle": 0.8,
    "time.span": 0.5,
}
#: A launch so fast that the body revolves and separates.
FAST = {"initial.omega": 100.0, "friction.rough.mu_k": 0.15, "friction.rest.mu_k": 0.1}
#: Stick-slip on a ring that runs up, up to a separation.
DRIVEN_OFF = {"drive.amplitude": 10.0, "time.span": 8.0}
#: A ring with a zone that is so rough that the body jams on it.
ROUGH = {"friction.rough.mu_k": 1.9, "friction.rest.mu_k": 0.2, "zone.half_angle": 1.0}
#: Stiffness of bristles that a constant step resolves, 1/m.
MILD = 3e3


@pytest.fixture
def dahl(cells):
    """Batch under the Dahl law; without an amplitude of the drive the ring is at rest."""

    def build(values, sigma0, **changes):
        changes = {path.replace("__", "."): value for path, value in changes.items()}
        return cells({**values, "friction.sigma0": sigma0, **changes}, law="dahl", drive="arctan")

    return build


@pytest.fixture
def rigid(cells):
    """Batch under Coulomb friction: stiction with equal static and kinetic coefficients."""

    def build(values):
        place = {"friction.rough": 0.3, "friction.rest": 0.1}
        pairs = {f"{path}.mu_{kind}": values.get(f"{path}.mu_k", mu) for path, mu in place.items() for kind in "sk"}
        return cells({**values, **pairs}, law="stiction", drive="arctan")

    return build


@pytest.fixture
def launched(dahl, history):
    batch = dahl(LAUNCH, MILD)
    return take(batch, 0), history(batch, 100_000, "dahl")


def order(x, error):
    return np.polyfit(np.log(x), np.log(error), 1)[0]


class TestLimit:
    """With increasing stiffness the Dahl law tends to Coulomb friction."""

    def test_sliding_differs_from_coulomb_in_first_order_of_the_compliance(self, dahl, rigid):
        """Beyond an edge the traction changes over a distance proportional to 1/sigma0."""
        sigma0 = 10.0 ** np.arange(3, 8)
        exact, found = solve(LIMIT, rigid(FAST)), solve(EXACT, dahl(FAST, sigma0))
        assert (found.regime == exact.regime).all()
        assert (found.motion == exact.motion).all()
        assert (found.separating_contact == exact.separating_contact).all()
        assert order(sigma0, abs(found.t_separation - exact.t_separation)) == pytest.approx(-1.0, abs=0.02)
        assert order(sigma0, abs(found.phi_end - exact.phi_end)) == pytest.approx(-1.0, abs=0.02)


class TestEnergy:
    """On a ring at rest friction dissipates energy."""

    def test_energy_of_body_and_bristles_never_grows(self, launched):
        scene, run = launched
        body = scene.body
        energy = 0.5 * (body.inertia + body.mass * body.xi**2) * run.omega**2
        energy = energy - body.mass * body.gravity * body.xi * np.cos(run.phi)
        total = energy.copy()
        for normal, z in ((run.normal_1, run.deflection_1), (run.normal_2, run.deflection_2)):
            change = 0.5 * (normal[1:] + normal[:-1]) * 0.5 * scene.law.sigma0 * np.diff(z**2)
            total[1:] += np.cumsum(change)
        dissipated = total[0] - total[-1]
        assert np.diff(total).max() < 1e-10 * dissipated
        assert dissipated > 0.1 * (energy.max() - energy.min())


class TestZones:
    """At an edge the coefficient of friction jumps, but the deflections do not."""

    def test_traction_tends_exponentially_to_the_coefficient_beyond_an_edge(self, launched):
        """The length of the transition is the steady deflection. The step over the edge is left out."""
        scene, run = launched
        (entry,) = np.flatnonzero(np.diff(run.zone_1) != 0)[:1]
        assert run.omega[entry] > 0.0
        # Contact 1 is at phi - beta, and the edge is at minus the half-angle of the zone.
        distance = scene.body.radius * (run.phi - (scene.body.beta - LAUNCH["zone.half_angle"]))
        after = slice(entry + 1, entry + 1 + np.argmax(distance[entry + 1 :] > 10 * 0.15 / MILD))
        traction = MILD * run.deflection_1[after]
        assert MILD * run.deflection_1[entry] == pytest.approx(0.1, rel=1e-9)
        np.testing.assert_allclose(traction, 0.15 - 0.05 * np.exp(-distance[after] * MILD / 0.15), atol=1e-3)
        assert traction[-1] == pytest.approx(0.15, abs=1e-4)
        np.testing.assert_allclose(MILD * run.deflection_2[after], 0.1, rtol=1e-9)

    def test_body_counts_as_stuck_while_both_contacts_do(self, launched):
        """A contact counts as stuck below 99.9 % of the deflection of steady sliding."""
        _, run = launched
        side = np.where(run.omega >= 0.0, 1.0, -1.0)
        held = [
            side * MILD * z / np.where(zone == 1, 0.15, 0.1) < NEARLY
            for z, zone in ((run.deflection_1, run.zone_1), (run.deflection_2, run.zone_2))
        ]
        assert (held[0] != held[1]).any()
        np.testing.assert_array_equal(run.mode == 0, held[0] & held[1])


class TestEnds:
    """Ends of runs agree with those under Coulomb friction."""

    def test_separating_contact_is_that_of_the_limit(self, dahl, rigid):
        exact, found = solve(LIMIT, rigid(DRIVEN_OFF)), solve(EXACT, dahl(DRIVEN_OFF, 1e6))
        assert (found.regime, found.motion, found.separating_contact) == (SEPARATING, OSCILLATORY, 2)
        assert found.t_separation == found.t_end == pytest.approx(exact.t_separation, abs=1e-5)
        assert found.normal_min_2 == 0.0
        fast = solve(EXACT, dahl(FAST, 1e5))
        assert (fast.regime, fast.motion, fast.separating_contact) == (SEPARATING, REVOLVING, 2)

    def test_body_launched_on_a_rough_arc_is_jammed_at_launch(self, dahl, rigid):
        values = {**ROUGH, "initial.phi": 1.0, "initial.omega": -20.0}
        for found in (solve(LIMIT, rigid(values)), solve(EXACT, dahl(values, 1e5))):
            assert (found.regime, found.t_end, found.separating_contact) == (JAMMED, 0.0, 0)

    def test_body_sliding_onto_a_rough_arc_jams_at_the_instant_of_the_limit(self, dahl, rigid):
        values = {**ROUGH, "initial.omega": 30.0, "zone.center": 2.0}
        exact, found = solve(LIMIT, rigid(values)), solve(Implicit(), dahl(values, 1e5))
        assert exact.regime == found.regime == JAMMED
        assert found.t_end == pytest.approx(exact.t_end, abs=1e-4)
