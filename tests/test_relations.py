"""Relations between runs that hold for all parameters: symmetry, scales, equivalent scenes, limits.

The scenes are random. Runs without a certificate are left out, and must be few. No reference solution is needed.
"""

import numpy as np
import pytest
from solutions import solve
from tiers import mostly_slow

from ringsweep.quantities.flags import SEPARATING
from ringsweep.solvers.event import Auto

COUNT = 1000
KINDS = ("regime", "motion")
PLACES = ("rough", "rest")


def draw(rng, count=COUNT, high=0.4):
    """Random values by path: friction, a zone, a drive and a launch; some with very low or high friction."""
    values = {
        "zone.center": rng.uniform(-np.pi, np.pi, count),
        "zone.half_angle": rng.choice([0.0, np.pi, 0.01, 1.0], count, p=[0.05, 0.05, 0.1, 0.8]),
        "drive.amplitude": rng.choice([-1, 1], count) * 10 ** rng.uniform(-1, 1.2, count),
        "initial.phi": rng.choice([0.0, 0.5, 1.0], count, p=[0.5, 0.4, 0.1]) * rng.uniform(-np.pi, np.pi, count),
        "initial.omega": rng.choice([0.0, 1.0], count) * rng.uniform(-40, 40, count),
        "time.span": rng.uniform(0.3, 2.0, count),
    }
    values["zone.half_angle"] *= np.where(values["zone.half_angle"] == 1.0, rng.uniform(0.05, 3.0, count), 1.0)
    level = rng.choice([0.02, 1.0, 3.0], count, p=[0.15, 0.75, 0.1])
    for place in PLACES:
        kinetic = rng.uniform(0.02, high, count) * level
        values[f"friction.{place}.mu_k"] = kinetic
        values[f"friction.{place}.mu_s"] = kinetic + rng.choice([0.0, 1.0], count) * rng.uniform(0, 0.3, count) * level
    return values


def both_certified(first, second):
    """Whether both runs of each cell are certified, which must be so for nearly all cells."""
    certified = (first.certified == 1) & (second.certified == 1)
    assert certified.mean() > 0.98
    return certified


def assert_alike(first, second, cells, atol=1e-6, **signs):
    for name in KINDS:
        np.testing.assert_array_equal(getattr(first, name)[cells], getattr(second, name)[cells], err_msg=name)
    for name in ("t_end", "phi_end", "omega_end"):
        a, b = getattr(first, name)[cells], signs.get(name, 1.0) * getattr(second, name)[cells]
        # A few long runs may amplify the tolerance by more.
        difference = np.abs(a - b) / (1.0 + np.abs(a))
        assert np.quantile(difference, 0.995) < atol, name


@pytest.fixture(params=mostly_slow(["stiction", "bengisu-akay"], ("stiction",)))
def scenes(request, cells):
    """Batch under a set-valued or a smooth law, driven by the arctan law."""
    law = request.param
    rng = np.random.default_rng(1)
    of_law = {} if law == "stiction" else {"friction.alpha": 10 ** rng.uniform(0, 5, COUNT)}
    if law != "stiction":
        of_law["friction.v0"] = 10 ** rng.uniform(-6, -0.5, COUNT)

    def build(values, **more):
        count = len(next(iter(values.values())))
        return cells(
            {path: column[:count] for path, column in of_law.items()} | values, law=law, drive="arctan", **more
        )

    return build


class TestMirror:
    """In the mirror image left and right are exchanged, and so are the contacts."""

    def test_mirrored_scene_gives_the_mirrored_run(self, scenes):
        values = draw(np.random.default_rng(21))
        # One tenth of the bodies are launched with contact 2 on an edge of the zone, and not at rest.
        edge = values["zone.center"] + values["zone.half_angle"] - np.arcsin(0.025 / 0.033378)
        on_edge = (np.arange(COUNT) % 10 == 0) & (values["initial.omega"] != 0.0)
        values["initial.phi"] = np.where(on_edge, edge, values["initial.phi"])
        odd = ("zone.center", "drive.amplitude", "initial.phi", "initial.omega")
        first = solve(Auto(), scenes(values))
        second = solve(Auto(), scenes(values | {path: -values[path] for path in odd}))
        cells = both_certified(first, second)
        assert_alike(first, second, cells, phi_end=-1.0, omega_end=-1.0)
        mirrored = np.array([0.0, 2.0, 1.0, 3.0])[second.separating_contact.astype(int)]
        np.testing.assert_array_equal(first.separating_contact[cells], mirrored[cells])
        assert {0, 1, 2, 3} == set(first.separating_contact)


class TestScales:
    def test_mass_changes_forces_only_bit_for_bit(self, scenes):
        """With 16 times the mass and the inertia, the forces are 16 times as large, and nothing else changes."""
        values = draw(np.random.default_rng(23), 300)
        body = {"body.mass": np.full(300, 0.076), "body.inertia": np.full(300, 4.47e-5)}
        first = solve(Auto(), scenes(values | body))
        second = solve(Auto(), scenes(values | {path: 16.0 * column for path, column in body.items()}))
        for name in (*KINDS, "separating_contact", "t_end", "phi_end", "omega_end", "reversals", "steps", "certified"):
            np.testing.assert_array_equal(getattr(first, name), getattr(second, name), err_msg=name)
        np.testing.assert_array_equal(16.0 * first.normal_min_1, second.normal_min_1)

    def test_scaled_lengths_and_times_give_the_scaled_run(self, cells):
        """On a ring at rest, with four times the lengths and twice the times."""
        values = draw(np.random.default_rng(24))
        values["drive.amplitude"][:] = 0.0
        lengths = {"body.half_distance": 0.025, "body.ball_radius": 0.010, "ring.radius": 0.043378}
        small = values | {path: np.full(COUNT, x) for path, x in lengths.items()}
        large = values | {path: np.full(COUNT, 4.0 * x) for path, x in lengths.items()}
        large |= {
            "body.inertia": np.full(COUNT, 16.0 * 4.47e-5),
            "initial.omega": 0.5 * values["initial.omega"],
            "time.span": 2.0 * values["time.span"],
            "classify.epsilon_omega": np.full(COUNT, 0.5e-3),
        }
        first, second = (solve(Auto(), cells(v, law="stiction", drive="arctan")) for v in (small, large))
        certified = both_certified(first, second)
        assert_alike(first, second, certified, t_end=0.5, omega_end=2.0)
        np.testing.assert_array_equal(first.separating_contact[certified], second.separating_contact[certified])

    def test_scaled_lengths_and_times_give_the_scaled_run_under_infinite_initial_acceleration(self, cells):
        """The drive is a power law with an exponent below 2; lengths are 16 times and times 4 times as large."""
        rng = np.random.default_rng(25)
        count, exponent = 300, rng.uniform(1.05, 1.95, 300)
        values = {
            "drive.amplitude": 10 ** rng.uniform(-1.5, 1, count),
            "drive.exponent": exponent,
            "time.span": rng.uniform(0.2, 1.0, count),
            "zone.half_angle": rng.uniform(0.0, 3.0, count),
        }
        large = values | {
            "body.half_distance": np.full(count, 16 * 0.025),
            "body.ball_radius": np.full(count, 16 * 0.010),
            "ring.radius": np.full(count, 16 * 0.043378),
            "body.inertia": np.full(count, 256 * 4.47e-5),
            "drive.amplitude": values["drive.amplitude"] / 4.0**exponent,
            "time.span": 4.0 * values["time.span"],
            "classify.epsilon_omega": np.full(count, 0.25e-3),
            "friction.v0": np.full(count, 4 * 2e-6),
            "friction.alpha": np.full(count, 0.25e5),
        }
        first, second = (solve(Auto(), cells(v, drive="power")) for v in (values, large))
        certified = both_certified(first, second)
        assert_alike(first, second, certified, t_end=0.25, omega_end=4.0)
        np.testing.assert_array_equal(first.reversals[certified], second.reversals[certified])


class TestShiftOfTime:
    def test_run_continued_from_its_middle_ends_in_the_same_state(self, cells):
        """On a ring at rest, a run launched from the state in the middle of the span."""
        values = draw(np.random.default_rng(26))
        values["drive.amplitude"][:] = 0.0
        whole = solve(Auto(), cells(values, law="stiction", drive="arctan"))
        half = solve(Auto(), cells(values | {"time.span": 0.5 * values["time.span"]}, law="stiction", drive="arctan"))
        rest = {"initial.phi": half.phi_end, "initial.omega": half.omega_end, "time.span": 0.5 * values["time.span"]}
        rest = solve(Auto(), cells(values | rest, law="stiction", drive="arctan"))
        continued = (half.t_end == 0.5 * values["time.span"]) & (whole.certified == 1) & (rest.certified == 1)
        assert continued.mean() > 0.4
        np.testing.assert_allclose(whole.phi_end[continued], rest.phi_end[continued], atol=1e-6)
        separating = [(found.regime == SEPARATING)[continued] for found in (whole, rest)]
        np.testing.assert_array_equal(*separating)


class TestEquivalentScenes:
    """Scenes that are described in two ways."""

    def test_arc_with_the_coefficients_of_the_rest_changes_nothing(self, scenes):
        values = draw(np.random.default_rng(27))
        values |= {f"friction.rough.{name}": values[f"friction.rest.{name}"] for name in ("mu_s", "mu_k")}
        first, second = (solve(Auto(), scenes(values | {"zone.half_angle": x * np.ones(COUNT)})) for x in (0.0, 0.7))
        assert_alike(first, second, both_certified(first, second))

    @staticmethod
    def with_arcs(values, arcs):
        """Values with the zone replaced by other zones, each a pair ``(center, half_angle)``."""
        changed = {path: x for path, x in values.items() if not path.startswith(("zone.", "friction.rough."))}
        for k, (center, half_angle) in enumerate(arcs):
            changed |= {f"zones.{k}.center": center, f"zones.{k}.half_angle": half_angle}
            changed |= {f"zones.{k}.{name}": values[f"friction.rough.{name}"] for name in ("mu_s", "mu_k")}
        return changed

    def test_two_adjacent_arcs_equal_one_arc(self, scenes):
        values = draw(np.random.default_rng(28))
        center, half = values["zone.center"], 0.25 * values["zone.half_angle"]
        arcs = [(center - 2 * half, 2 * half), (center + 2 * half, 2 * half)]
        first = solve(Auto(), scenes(values))
        second = solve(Auto(), scenes(self.with_arcs(values, arcs), arcs=("zones.0", "zones.1")))
        assert_alike(first, second, both_certified(first, second))

    def test_order_of_disjoint_arcs_changes_no_bit(self, scenes):
        values = draw(np.random.default_rng(29), 300)
        center, half = values["zone.center"], np.minimum(values["zone.half_angle"], 0.7)
        arcs = [(center, half), (center + 2.0, half), (center - 2.0, half)]
        names = ("zones.0", "zones.1", "zones.2")
        first, second = (
            solve(Auto(), scenes(self.with_arcs(values, order), arcs=names)) for order in (arcs, arcs[::-1])
        )
        np.testing.assert_array_equal(first.rows, second.rows)


class TestLimits:
    @pytest.mark.slow
    def test_two_contacts_that_approach_each_other_tend_to_one_contact(self, cells):
        """For a point mass, the difference tends to zero with the angle between the contacts."""
        rng = np.random.default_rng(30)
        count = 200
        values = {path: column for path, column in draw(rng, count, 0.3).items() if path != "drive.amplitude"}
        values |= {"drive.amplitude": rng.uniform(-3.0, 3.0, count), "ring.radius": np.full(count, 0.05)}
        # Two contacts close together on different surfaces jam.
        values["zone.half_angle"][:] = 0.0
        first = solve(Auto(), cells(values, model="ring-single-contact", law="stiction", drive="arctan"))
        difference = []
        for half_distance in (1e-4, 1e-5):
            point = {"body.half_distance": half_distance, "body.ball_radius": 0.0, "body.inertia": 0.0}
            two = solve(Auto(), cells(values | point, law="stiction", drive="arctan"))
            agree = (first.regime == two.regime) & (first.certified == 1) & (two.certified == 1)
            difference.append(np.abs(first.phi_end - two.phi_end)[agree])
            assert agree.mean() > 0.9
        medians = [np.median(a[a > 0.0]) for a in difference]
        assert medians[1] < 0.2 * medians[0] < 1e-3
