"""Peers of the benchmarks, which share no formula with the package, agree with it."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import speed
from benchmarks.peers import in_c, with_scipy
from benchmarks.work_precision import RESTITUTION, SCENES, own


@pytest.mark.slow
@pytest.mark.parametrize("name", ["smooth", "limit"])
def test_scipy_with_events_and_restarts_agrees_with_the_package(name):
    scene = SCENES[name]
    cells = scene.cells(6)
    ours = own(scene, scene.method, cells, rtol=1e-11)()
    theirs = with_scipy.ring(scene.law, cells, "LSODA", 1e-9)()
    assert 0 < np.isfinite(ours.separation).sum() < 6
    np.testing.assert_allclose(theirs.end, ours.end, rtol=0, atol=1e-6)
    np.testing.assert_allclose(theirs.separation, ours.separation, rtol=0, atol=1e-6)


@pytest.mark.skipif(in_c.compiler() is None, reason="no C compiler")
def test_runge_kutta_in_c_agrees_with_rk4():
    scene = SCENES["smooth"]
    cells = scene.cells(4)
    ours, theirs = own(scene, "rk4", cells, steps=5000)(), in_c.ring(scene.law, cells, 5000)()
    np.testing.assert_allclose(theirs.end, ours.end, rtol=0, atol=1e-9)
    np.testing.assert_allclose(theirs.separation, ours.separation, rtol=0, atol=1e-9)


@pytest.mark.slow
@pytest.mark.skipif(not (in_c.compiler("cc") and in_c.compiler("c++")), reason="no C or C++ compiler")
def test_plain_and_vectorised_runge_kutta_agree_with_rk4():
    """In cells that fill no whole vector, and that run to the end under the smooth law."""
    law, cells, steps = SCENES["smooth"].law, speed.mild(37), 2000
    plain, vector = in_c.plain(law, cells, steps)(), in_c.vector(law, cells, steps)()
    np.testing.assert_allclose(vector.phi_end, own(SCENES["smooth"], "rk4", cells, steps=steps)().end, atol=1e-13)
    for name, values in plain._asdict().items():
        np.testing.assert_allclose(getattr(vector, name), values, rtol=0, atol=1e-13, err_msg=name)
    assert len(set(plain.reversals)) > 1


@pytest.mark.slow
@pytest.mark.skipif(in_c.compiler() is None, reason="no C compiler")
def test_moreau_jean_time_stepping_tends_to_the_package_at_first_order():
    """Impact law, mechanics and zones of the peer are its own, and it knows no events."""
    scene = SCENES["impact"]
    # Coulomb friction as stiction without a drop, whose kernel other tests compile too.
    pairs = {
        place: {"mu_s": mu["mu_k"], "mu_k": mu["mu_k"]}
        for place, mu in scene.scene["friction"].items()
        if place != "law"
    }
    scene = replace(scene, scene=scene.scene | {"friction": {"law": "stiction"} | pairs})
    cells = scene.cells(12)
    ours = own(scene, "event", cells, rtol=1e-11)()
    lost = np.isfinite(ours.separation)
    assert 3 < lost.sum() < 12
    coarse, fine = (in_c.moreau_jean(RESTITUTION, cells, steps)() for steps in (2000, 20_000))
    np.testing.assert_array_equal(np.isfinite(fine.separation), lost)
    errors = [np.median(abs(found.separation - ours.separation)[lost]) for found in (coarse, fine)]
    assert 5.0 < errors[0] / errors[1] < 20.0
    # Impacts magnify errors: after hundreds of them the end takes shorter steps than these.
    errors = [np.median(abs(found.end - ours.end)) for found in (coarse, fine)]
    assert errors[1] < min(0.01, 0.2 * errors[0])


@pytest.mark.slow
def test_table_of_speed_has_the_error_of_every_method():
    effort = speed.Effort(lanes=8, cells=2, sweep=0, steps=0.2, rounds=1)
    # Those whose kernels other tests compile too.
    contenders = [one for one in speed.contenders(effort) if one.scene in ("ring, smooth", "ring, stiction")]
    units = speed.units(effort)
    rows = speed.rows(units, contenders, effort.rounds)
    assert [row[0] for row in rows] == [one.method for one in [*units, *contenders]]
    assert all(float(row[4]) < 1e-6 for row in rows if row[5] != "-")
    assert all(row[6] == "100.0 %" for row in rows if row[2].endswith("a run"))
