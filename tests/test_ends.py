"""Ends of runs: every end is one of the body. The references solve the printed balances, or take a limit."""

import numpy as np
import pytest
import xarray as xr
from rings import course, rubs, shape
from scipy.integrate import solve_ivp
from solutions import cell_of, motion

import ringsweep

#: A body whose reactions pass D = 0 while it slides: D changes its sign, the determinant of the balances does not.
STEEP = {
    "model": "ring",
    "body": {"mass": 0.1, "inertia": 2.5e-5, "half_distance": 0.025, "ball_radius": 0.01, "beta": "16.8 deg"},
    "friction": {"law": "tustin", "alpha": 30.0, "rest": {"mu_s": 0.05, "mu_k": 0.03}},
    "zones": [{"half_angle": 0.6, "center": 0.4, "mu_s": 0.9, "mu_k": 0.4}],
    "drive": {"law": "arctan", "amplitude": 0.0},
    "initial": {"phi": 0.3, "omega": -6.0},
    "time": {"span": 1.0},
}

#: A ring that swings, with a body launched at its speed.
SWINGING = (
    shape(0.1, 2.5e-5, 0.025, 0.01, 0.05, zone=0.6)
    | rubs("stiction", rest=(0.5, 0.3), rough=(0.5, 0.3))
    | course("sinusoidal", 1.0, 2.0, phi=0.3, omega=4.0 * np.pi, span=1.0)
)

#: Swinging rings in which a reaction reaches 0 while the body sticks, and slip with both contacts closed would be
#: possible. The numbers are those of COLUMNS, then the contact.
LOST_IN_STICK = """
0.47516 2.11334e-5 0.0135276 0.00853984 0.0723432 0.909836 0.764892 1.37175 0.628595 0.270943 -0.427961 -2.89306 2.35306 -0.360913 2
0.41405 4.12926e-6 0.00528856 0.0194765 0.055813 1.40657 0.740544 0.703886 0.0550023 1.30313 0.254659 0.278437 4.26836 -0.343884 1
0.057703 1.55559e-6 0.00995635 0.0119112 0.0328379 0.708241 0.496192 0.668663 0.132834 0.485019 0.347448 -0.427438 3.78777 1.05907 2
0.494665 1.06355e-4 0.0327191 0.0248529 0.0917558 0.389787 0.298183 1.07215 0.506184 1.35514 0.58173 2.20869 2.36336 -0.198679 1
"""  # noqa: E501
COLUMNS = (
    "body.mass", "body.inertia", "body.half_distance", "body.ball_radius", "ring.radius", "friction.rest.mu_s",
    "friction.rest.mu_k", "friction.rough.mu_s", "friction.rough.mu_k", "zone.half_angle", "zone.center",
    "drive.amplitude", "drive.frequency", "initial.phi",
)  # fmt: skip


def sweep(scene, values, **solver):
    """Dataset of runs along one dimension."""
    axes = {path: xr.DataArray(column, dims="run") for path, column in values.items()}
    return ringsweep.sweep(scene, axes, progress=False, **solver)


class TestSlideThroughVanishingD:
    """Where D vanishes and the balances are not singular, the body slides on."""

    @staticmethod
    def slip(body, phi, omega):
        """Angular acceleration, both reactions, and D, from the balances of a body that slips backwards."""
        under = [abs(angle - 0.4) < 0.6 for angle in (phi - body.beta, phi + body.beta)]
        tail = np.exp(-30.0 * abs(omega) * body.radius)
        K1, K2 = (0.4 + 0.5 * tail if rough else 0.03 + 0.02 * tail for rough in under)
        D = (K1 - K2) * np.cos(2 * body.beta) + (1 + K1 * K2) * np.sin(2 * body.beta)
        return *motion(body, K1, K2) @ (omega**2, np.cos(phi), np.sin(phi)), D

    def test_body_comes_to_rest_at_all_tolerances(self):
        def stops(t, y):
            return y[1]

        stops.terminal = True
        body, options = cell_of(STEEP).body, {"rtol": 1e-11, "atol": 1e-12, "max_step": 1e-4}
        reference = solve_ivp(lambda t, y: (y[1], self.slip(body, *y)[0]), (0, 1), (0.3, -6.0), events=stops, **options)
        phi = reference.y[0]
        _, N1, N2, D = np.transpose([self.slip(body, *state) for state in reference.y.T[::10]])
        assert min(D) < 0.0 < max(D)
        assert min(*N1, *N2) > 0.0
        for solver in ("auto", {"method": "event", "rtol": 1e-11}, {"method": "event", "rtol": 1e-14}):
            found = sweep(STEEP, {"initial.omega": [-6.0]}, solver=solver)
            assert ringsweep.words(found.regime) == ["resting"]
            assert found.certified == 1
            assert found.phi_end == pytest.approx(phi[-1], abs=1e-6)


class TestReactionVanishesInStick:
    @pytest.mark.slow
    def test_contact_opens_at_the_limit_of_laws_with_an_ever_narrower_band(self):
        *rows, contacts = np.loadtxt(LOST_IN_STICK.split("\n"), unpack=True)
        values = dict(zip(COLUMNS, rows, strict=True))
        values["initial.omega"] = 2 * np.pi * values["drive.frequency"] * values["drive.amplitude"]
        found = sweep(SWINGING, values)
        assert (ringsweep.words(found.regime) == "separating").all()
        assert (found.certified == 1).all()
        np.testing.assert_array_equal(found.separating_contact, contacts)
        friction = SWINGING["friction"] | {"law": "bengisu-akay", "v0": 1e-3, "alpha": 1e4}
        late = []
        for v0 in (1e-3, 1e-4, 1e-5, 1e-6):
            narrow = {"friction.v0": np.full(4, v0), "friction.alpha": np.full(4, 10 / v0)}
            smooth = sweep(SWINGING | {"friction": friction}, values | narrow)
            np.testing.assert_array_equal(smooth.separating_contact, contacts)
            late.append(smooth.t_separation - found.t_separation)
        np.testing.assert_allclose(np.divide(late[:-1], late[1:]), 10.0, rtol=0.03)


@pytest.mark.slow
class TestLaunchOnIce:
    ICE = SWINGING | rubs("stiction", rest=(0.0, 0.0), rough=(0.0, 0.0))

    def test_body_stays_on_both_contacts_or_loses_one_at_launch(self):
        """Without friction the ring does not matter: reactions at launch are those of a pendulum."""
        phi = np.linspace(-3.0, 3.0, 61)
        found = sweep(self.ICE, {"initial.phi": phi})
        beta, reach = np.arcsin(0.025 / 0.04), 0.04
        xi, omega = reach * np.cos(beta), 4 * np.pi
        # Without friction the radial and the tangential balance give sum and difference of the reactions.
        epsilon = -0.1 * 9.81 * xi * np.sin(phi) / (2.5e-5 + 0.1 * xi**2)
        total = (9.81 * np.cos(phi) + xi * omega**2) / np.cos(beta)
        difference = (9.81 * np.sin(phi) + xi * epsilon) / np.sin(beta)
        negative = 1 * (total + difference < 0.0) + 2 * (total - difference < 0.0)
        assert (found.certified == 1).all()
        np.testing.assert_array_equal(found.t_separation == 0.0, negative > 0)
        for contact in (1, 2):
            assert (found.separating_contact[negative == contact] == contact).all()
            assert (negative == contact).any()

    def test_body_passes_through_rest_where_the_ring_is_briefly_as_fast(self):
        """At phi = 0 neither accelerates at launch; then the ring slows down, and the body does so by its weight."""
        found = sweep(self.ICE, {"initial.phi": [0.0]})
        assert ringsweep.words(found.regime) == ["oscillatory"]
        assert found.certified == 1


@pytest.mark.slow
def test_stick_ends_where_no_saturation_holds_the_body_any_more():
    """Both roots of the equation of stick meet before friction is used up: then the body slides."""
    values = dict(zip(COLUMNS, [[value] for value in (
        0.036032, 6.66431e-5, 0.0383382, 0.0130053, 0.0584018, 0.830153, 0.189356, 0.837428, 0.467534, 0.896514,
        0.921873, -0.54566, 4.26123, 0.812057,
    )], strict=True))  # fmt: skip
    values["initial.omega"] = [2 * np.pi * 4.26123 * -0.54566]
    found = sweep(SWINGING, values)
    assert ringsweep.words(found.regime) == ["separating"]
    assert (found.certified, found.separating_contact) == (1, 2)
    assert 0.13 < found.stick_time < found.t_end - 0.01
