"""Two coupled masses on a belt, each with a contact of its own."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import ringsweep
from ringsweep.models.pair.words import OF_EACH

STICTION = {"law": "stiction", "mu_s": 0.2, "mu_k": 0.1}


def coupled(coupling=1.0, masses=(1.0, 1.5), stiffness=(2.0, 3.0), **parts):
    """Scene of a pair, in SI units."""
    return {
        "model": "belt-pair",
        "body": dict(zip(("mass_1", "mass_2"), masses, strict=True)),
        "spring": dict(zip(("stiffness_1", "stiffness_2"), stiffness, strict=True)) | {"coupling": coupling},
        "belt": {"velocity": 0.1},
        "friction": STICTION,
        "time": {"span": 40.0},
    } | parts


def runs(scene, points, **solver):
    """Outcomes of a pair; `points` are columns by path."""
    config = {"scene": scene, "sweep": {"points": {path: list(map(float, p)) for path, p in points.items()}}}
    return ringsweep.run(config | {"solver": {"method": "auto"} | solver}, jobs=1, progress=False)


def random_pairs(count, seed):
    """Numbers of random pairs by path; the second mass is launched while it slides."""
    rng = np.random.default_rng(seed)
    bounds = {
        **{f"body.mass_{i}": (0.5, 2.0) for i in (1, 2)},
        **{f"spring.stiffness_{i}": (1.0, 5.0) for i in (1, 2)},
        **{f"damper.coefficient_{i}": (0.0, 0.1) for i in (1, 2)},
        **{f"initial.x_{i}": (-0.2, 0.2) for i in (1, 2)},
        **{"spring.coupling": (0.5, 3.0), "damper.coupling": (0.0, 0.2), "belt.velocity": (0.05, 0.3)},
        **{"friction.mu_k": (0.05, 0.1), "friction.mu_s": (0.1, 0.2), "initial.velocity_2": (-0.2, 0.4)},
        **{"friction.mu_k_2": (0.05, 0.1), "friction.mu_s_2": (0.1, 0.2)},
    }
    return {path: rng.uniform(*ends, count) for path, ends in bounds.items()}


def by_scipy(p, span):
    """Displacements, velocities, numbers of breakaways and times of stick of both masses, from event to event."""
    m, k, d = ([p[f"{name}_{i}"] for i in (1, 2)] for name in ("body.mass", "spring.stiffness", "damper.coefficient"))
    mu_s, mu_k = ((p[f"friction.{name}"], p[f"friction.{name}_2"]) for name in ("mu_s", "mu_k"))
    belt, c, dc = p["belt.velocity"], p["spring.coupling"], p["damper.coupling"]

    def pull(j, y):
        x, u = (y[0], y[2]), (y[1] + belt, y[3] + belt)
        return -k[j] * x[j] - d[j] * u[j] + c * (x[1 - j] - x[j]) + dc * (u[1 - j] - u[j])

    def at_rest(j, y):
        force = pull(j, y)
        return 0 if abs(force) <= mu_s[j] * m[j] * 9.81 else int(np.sign(force))

    y = np.array([p["initial.x_1"], 0.0, p["initial.x_2"], p["initial.velocity_2"] - belt])
    signs = [at_rest(0, y), int(np.sign(y[3]))]
    t, slips, stuck = 0.0, [0, 0], [0.0, 0.0]
    while t < span:

        def rates(t, y, signs=tuple(signs)):
            w = [s and (pull(j, y) - s * mu_k[j] * m[j] * 9.81) / m[j] for j, s in enumerate(signs)]
            return [y[1] + belt, w[0], y[3] + belt, w[1]]

        events, meanings = [], []
        for j, sign in enumerate(signs):
            for way in (1, -1) if sign == 0 else (0,):

                def event(t, y, j=j, way=way, sign=sign):
                    return mu_s[j] * m[j] * 9.81 - way * pull(j, y) if way else sign * y[2 * j + 1]

                event.terminal, event.direction = True, -1
                events.append(event)
                meanings.append((j, way))
        part = solve_ivp(rates, (t, span), y, "DOP853", rtol=1e-12, atol=1e-13, events=events)
        for j in range(2):
            stuck[j] += (part.t[-1] - t) * (signs[j] == 0)
        t, y = part.t[-1], part.y[:, -1].copy()
        for (j, way), times in zip(meanings, part.t_events, strict=True):
            if len(times) and way:
                signs[j], slips[j] = way, slips[j] + 1
            elif len(times):
                y[2 * j + 1] = 0.0
                signs[j] = at_rest(j, y)
    return y[::2], y[1::2] + belt, slips, stuck


def test_coupled_masses_move_as_an_integration_by_events():
    points = random_pairs(12, seed=3)
    found = runs(coupled(), points, certify=False)
    for i in range(12):
        x, u, slips, stuck = by_scipy({path: column[i] for path, column in points.items()}, 40.0)
        one = found.isel(point=i)
        for j in (1, 2):
            assert one[f"x_end_{j}"] == pytest.approx(x[j - 1], abs=1e-8)
            assert one[f"velocity_end_{j}"] == pytest.approx(u[j - 1], abs=1e-8)
            assert one[f"stick_time_{j}"] == pytest.approx(stuck[j - 1], abs=1e-7)
            # The first breakaway of a mass that has slid since its launch begins no slip after a stop.
            assert abs(int(one[f"slips_{j}"]) - slips[j - 1]) <= 1


def test_masses_without_a_coupling_move_as_two_belts():
    velocities, alone = [0.05, 0.1, 0.3], {}
    pair = runs(coupled(coupling=0.0), {"belt.velocity": velocities}, certify=False)
    for j, mass, stiffness in ((1, 1.0, 2.0), (2, 1.5, 3.0)):
        scene = {"model": "belt", "body": {"mass": mass}, "spring": {"stiffness": stiffness}}
        scene |= {"belt": {"velocity": 0.1}, "friction": STICTION, "time": {"span": 40.0}}
        alone[j] = runs(scene, {"belt.velocity": velocities}, certify=False)
        for name in OF_EACH:
            np.testing.assert_allclose(pair[f"{name}_{j}"], alone[j][name], rtol=1e-11, atol=1e-11, err_msg=name)


def test_equal_masses_move_as_one_and_do_not_feel_their_coupling():
    found = runs(coupled(masses=(1.0, 1.0), stiffness=(2.0, 2.0)), {"spring.coupling": [0.0, 1.0, 10.0]})
    assert found.certified.all()
    for name in ("x_end", "velocity_end", "x_max", "stick_time", "slips", "period"):
        np.testing.assert_allclose(found[f"{name}_1"], found[f"{name}_1"][0], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(found[f"{name}_2"], found[f"{name}_1"], rtol=1e-9, atol=1e-9)


def test_bounds_of_certified_pairs_hold():
    points = random_pairs(16, seed=7)
    found = runs(coupled(), points)
    finer = runs(coupled(), points, method="event", rtol=1e-13, certify=False)
    certified = found.certified.values == 1
    assert certified.mean() > 0.8
    for name in ("x_end", "velocity_end", "x_min", "x_max", "velocity_max", "force_max", "jump_max"):
        for j in (1, 2):
            error = np.abs(found[f"{name}_{j}"] - finer[f"{name}_{j}"]).values[certified]
            assert (error <= found[f"{name}_{j}_error"].values[certified]).all(), (name, j)


def test_a_history_of_a_pair_obeys_both_friction_laws():
    run = ringsweep.simulate(coupled(damper={"coupling": 0.1}, initial={"velocity_2": 0.3}))
    for j, weight in ((1, 9.81), (2, 1.5 * 9.81)):
        force, mode, v = run[f"friction_force_{j}"], run[f"mode_{j}"], run[f"velocity_{j}"] - 0.1
        assert (abs(force[mode == 0]) <= 0.2 * weight * (1.0 + 1e-9)).all()
        np.testing.assert_allclose(force[mode != 0], 0.1 * weight * mode[mode != 0], rtol=1e-12)
        assert (mode * v >= -1e-12).all()
        assert (abs(v[mode == 0]) <= 1e-12).all()
    kinds = run.ringsweep.words("event_kind")
    assert {("stop", 1), ("stop", 2), ("breakaway", 1), ("breakaway", 2)} <= set(
        zip(kinds.values.tolist(), run.event_contact.values.tolist(), strict=True)
    )
