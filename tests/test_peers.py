"""Peers of the benchmarks, which share no formula with the package, agree with it."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.peers import in_c
from benchmarks.work_precision import RESTITUTION, SCENES, own


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
