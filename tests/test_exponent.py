"""Growth of small disturbances on the belt: Floquet multipliers and the Lyapunov exponent."""

import numpy as np
import pytest
from belts import on_belt, with_all_parts, with_exponent
from solutions import growth

#: A body on any spring, with a damper and a force, under a set-valued law.
FORCED = on_belt(
    {"law": "tustin", "mu_s": 0.3, "mu_k": 0.3, "alpha": 1.0},
    damping=0.0, velocity=0.0, gravity=1.0, force=(1.0, 1.0, 0.0), start=(1.0, 0.0),
)  # fmt: skip

#: The friction oscillator of bSTAB without a force.
FREE = on_belt({"law": "tustin", "mu_s": 1.0, "mu_k": 0.5, "alpha": 2.0}, damping=0.1, gravity=1.0)


def run(scene, points=None, *options, **more):
    return with_exponent(with_all_parts(scene), points, *options, **more)


def test_multipliers_of_den_hartog_without_stops():
    """Between its two reversals the flow keeps areas; each reversal scales them by a+/a-, in closed form."""
    r, friction = 0.7, 0.3
    period, half = 2.0 * np.pi / r, np.pi / r
    gain = 1.0 / (1.0 - r * r)
    sine_part = -friction * np.sin(half) / (1.0 + np.cos(half))
    amplitude = np.sqrt(gain**2 - (sine_part / r) ** 2)
    after, before = (amplitude / gain - amplitude + sign * friction for sign in (1.0, -1.0))
    found = run(FORCED | {"time": {"span": 100 * period}}, {"force.frequency": [r / (2.0 * np.pi)]}, certify=True)
    assert (after / before) ** 2 == pytest.approx(0.25989715, abs=1e-8)
    assert found.certified.item() == 1
    for name in ("multiplier_1", "multiplier_2"):
        assert found[name].item() == pytest.approx(after / before, abs=1e-9) or found[name].item() == pytest.approx(
            -after / before, abs=1e-9
        )
    exponent = np.log(abs(after / before)) / period
    assert found.lyapunov.item() == pytest.approx(exponent, rel=1e-8)
    turned = [(found[f"multiplier_{k}"] * np.exp(1j * found[f"multiplier_angle_{k}"])).item() for k in (1, 2)]
    rotation = np.array([[np.cos(half), np.sin(half)], [-np.sin(half), np.cos(half)]])
    exact = np.linalg.eigvals(np.linalg.matrix_power(np.diag([1.0, after / before]) @ rotation, 2))
    np.testing.assert_allclose(turned, sorted(exact, key=lambda one: -one.imag), atol=1e-8)
    np.testing.assert_allclose(turned, [-0.4534 + 0.2331j, -0.4534 - 0.2331j], atol=1e-4)


def test_multipliers_of_a_linear_oscillator():
    """In steady slip under constant friction, only the damper takes disturbances away: exp(-c T / 2m), twice."""
    scene = FORCED | {"belt": {"velocity": 5.0}, "damper": {"coefficient": 0.1}, "time": {"span": 400.0}}
    found = run(scene, {"force.amplitude": [0.5], "force.frequency": [0.2]})
    assert found.multiplier_1.item() == pytest.approx(np.exp(-0.25), rel=1e-11)
    assert found.multiplier_2.item() == pytest.approx(np.exp(-0.25), rel=1e-11)
    assert found.lyapunov.item() == pytest.approx(-0.05, rel=1e-10)
    # Disturbances oscillate at the frequency of the free oscillator, sampled once a period of 5 s.
    turned = np.angle(np.exp(5j * np.sqrt(1.0 - 0.05**2)))
    assert abs(turned) == pytest.approx(found.multiplier_angle_1.item(), rel=1e-10)
    assert found.multiplier_angle_2.item() == -found.multiplier_angle_1.item()
    # A greater damper lets them creep back at two rates.
    creeps = run(scene | {"damper": {"coefficient": 2.5}}, {"force.amplitude": [0.5], "force.frequency": [1.0]})
    assert [creeps.multiplier_1.item(), creeps.multiplier_2.item()] == pytest.approx([np.exp(-0.5), np.exp(-2.0)])


def test_exponent_of_the_oscillator_of_ueda():
    """A smooth Duffing belt against 0.1034 1/s (Sprott, Chaos and Time-Series Analysis, 2003, A.4.5)."""
    scene = FORCED | {
        "spring": {"stiffness": 0.0, "cubic": 1.0},
        "damper": {"coefficient": 0.05},
        "friction": FORCED["friction"] | {"mu_s": 0.0, "mu_k": 0.0},
        "initial": {"x": 2.5, "velocity": 0.0},
        "time": {"span": 4000 * 2.0 * np.pi},
    }
    found = run(scene, {"force.amplitude": [7.5], "force.frequency": [1.0 / (2.0 * np.pi)]})
    assert found.lyapunov_error.item() < 0.004
    assert found.lyapunov.item() == pytest.approx(0.1034, abs=3.0 * found.lyapunov_error.item())


@pytest.mark.slow
@pytest.mark.parametrize("stops", [{}, {"stops": {"low": -1.0, "high": 1.2, "restitution": 0.7}}])
def test_exponent_is_that_of_two_neighbouring_runs(stops):
    """Pairs of runs, brought together again after each period, in random cells with and without stops."""
    cells, periods = 20, 120
    rng = np.random.default_rng(30)
    period = 2.0 * np.pi / rng.uniform(0.3, 2.5, cells)
    speed = rng.uniform(0.05, 0.6, cells) * (rng.random(cells) < 0.8)
    points = {
        "belt.velocity": speed,
        "spring.stiffness": rng.uniform(0.5, 1.5, cells),
        "spring.cubic": rng.uniform(0.0, 2.0, cells),
        "damper.coefficient": rng.uniform(0.0, 0.05, cells),
        "force.amplitude": rng.uniform(0.1, 1.5, cells),
        "force.frequency": 1.0 / period,
        "initial.x": rng.uniform(-1.0, 1.0, cells),
        "initial.velocity": speed + rng.normal(0.0, 0.3, cells),
    }
    scene = FORCED | {"friction": {"law": "tustin", "mu_s": 0.4, "mu_k": 0.2, "alpha": 2.0}} | stops
    found = run(scene, points | {"time.span": periods * period})

    one_period, names = points | {"time.span": period}, ("x", "velocity")
    used = growth(lambda both: run(scene, both), one_period, names, 2.0 * np.pi / period, periods, 1e-7)[periods // 4 :]
    scatter = np.hypot(used.std(axis=0) / np.sqrt(len(used)), found.lyapunov_error.values * period)
    assert (np.abs(found.lyapunov.values * period - used.mean(axis=0)) <= 3.0 * scatter + 0.02).all()
    assert 0 < (found.stick_time.values == 0.0).sum() < cells
    # The exponent of a periodic motion is the logarithm of its multiplier.
    periodic = np.isfinite(found.multiplier_1.values)
    of_multiplier = np.log(found.multiplier_1.values) / found.period.values
    difference = np.abs(found.lyapunov.values - of_multiplier)[periodic] * period[periodic]
    assert periodic.sum() >= 15
    assert (difference <= 3.0 * (found.lyapunov_error.values * period)[periodic] + 0.02).all()


def test_stick_erases_the_past_of_a_free_motion():
    """It breaks loose at one place: of two disturbances one is a shift in time, the other is gone."""
    found = run(FREE | {"belt": {"velocity": 1.0}, "initial": {"x": 2.0, "velocity": 0.0}, "time": {"span": 200.0}})
    assert found.stick_share.item() > 0.1
    assert found.multiplier_1.item() == pytest.approx(1.0, abs=1e-9)
    assert found.multiplier_2.item() == 0.0
    assert found.lyapunov.item() == -np.inf


def test_steady_sliding_loses_its_stability_at_half_the_logarithm_of_ten():
    """Near steady sliding disturbances grow like exp(-(0.1 - exp(-2 v)) t / 2)."""
    speed = np.array([1.2, 1.5, 3.0])
    points = {
        "belt.velocity": speed,
        "initial.x": 0.5 + 0.5 * np.exp(-2.0 * speed) + 1e-6,
        "initial.velocity": np.zeros(3),
    }
    found = run(FREE | {"time": {"span": 500.0}}, points)
    exact = -0.5 * (0.1 - np.exp(-2.0 * speed))
    assert np.sign(exact).tolist() == [-1.0, -1.0, -1.0]
    np.testing.assert_allclose(found.lyapunov, exact, atol=1e-3)
    slower = run(FREE | {"time": {"span": 200.0}}, {**points, "belt.velocity": speed - 0.1})
    assert np.sign(slower.lyapunov.values).tolist() == [1.0, -1.0, -1.0]


@pytest.mark.slow
def test_friction_that_falls_steeply_has_the_exponent_of_neighbouring_runs():
    """A step through the fall of friction holds many times in which a disturbance grows by a factor of e."""
    scene = on_belt(
        {"law": "tustin", "mu_s": 0.208922, "mu_k": 0.0993472, "alpha": 1e6},
        22.8094,
        mass=0.432273,
        cubic=441.366,
        velocity=0.0,
        force=(1.49253, 0.446578, -2.48131),
        start=(0.1, 0.0),
    )
    found = run(scene | {"time": {"span": 100 / 0.446578}}, {"initial.x": [0.1]})

    start = {"initial.x": [0.1], "initial.velocity": [0.0], "time.span": [1 / 0.446578]}
    weight = 2.0 * np.pi * 0.446578
    used = growth(lambda both: run(scene, both, False), start, ("x", "velocity"), weight, 60, 1e-8)[20:]
    assert found.lyapunov.item() / 0.446578 == pytest.approx(np.mean(used), abs=0.03)


def test_the_record_changes_no_other_outcome():
    scene = FORCED | {"time": {"span": "30 s"}, "belt": {"velocity": 0.1}}
    plain, asked = (run(scene, {"force.frequency": [0.1, 0.2]}, exponent) for exponent in (False, True))
    added = set(asked.data_vars) - set(plain.data_vars)
    angles = {f"multiplier{of}_{k}" for of in ("", "_angle") for k in (1, 2)}
    assert added == {"lyapunov", "lyapunov_error", *angles}
    assert asked.drop_vars(added).equals(plain)
