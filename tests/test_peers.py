"""Peers of the benchmarks, which share no formula with the package, agree with it."""

import numpy as np
import pytest

from benchmarks.peers import in_c, with_scipy
from benchmarks.work_precision import SCENES, own


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
