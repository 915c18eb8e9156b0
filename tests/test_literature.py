"""Numbers that others have published for oscillators with dry friction; more of them in test_forces."""

import numpy as np
import pytest
import xarray as xr

import ringsweep


def oscillator(span, **changes):
    """Den Hartog's oscillator: a mass on a spring under Coulomb friction and a harmonic force; all numbers are 1."""
    return {
        "model": "belt",
        "body": {"mass": 1.0},
        "spring": {"stiffness": 1.0},
        "belt": {"velocity": 0.0},
        "gravity": 1.0,
        "friction": {"law": "coulomb", "mu_k": 0.5},
        "force": {"amplitude": 1.0, "frequency": 0.2, "phase": "90 deg"},
        "time": {"span": span},
    } | changes


#: F_s/(1 + delta |v|) on a belt, in a code for optimal control of systems with implicit switches (Bock, Kirches, Meyer,
#: Potschka). The last three numbers were computed with SciPy.
LEINE = {"x_max": 1.133944669704, "period": 12.0010312948, "slip": 4.2959995255, "stick_from": -0.5410063539}


@pytest.mark.parametrize("law", ["hyperbolic", "formula"])
def test_stick_slip_under_leines_hyperbola(law):
    friction = {"law": law, "mu_s": 1.0, "mu_k": 0.0, "delta": "3 s/m"}
    if law == "formula":
        friction |= {"mu": "mu_s/(1 + delta*v)", "at_rest": "mu_s"}
        del friction["mu_k"]
    scene = oscillator(100.0, belt={"velocity": 0.2}, friction=friction)
    del scene["force"]
    run = ringsweep.sweep(scene, {})
    assert run.certified == 1
    assert ringsweep.words(run.regime) == "stick-slip"
    assert float(run.x_max) == pytest.approx(LEINE["x_max"], abs=1e-8)
    assert float(run.period) == pytest.approx(LEINE["period"], abs=1e-8)
    assert float(run.period * (1 - run.stick_share)) == pytest.approx(LEINE["slip"], abs=1e-8)
    history = ringsweep.simulate(scene)
    begins = np.flatnonzero((history.mode.values[1:] == 0) & (history.mode.values[:-1] != 0)) + 1
    np.testing.assert_allclose(history.x.values[begins], LEINE["stick_from"], atol=1e-8)


#: Ratio of frequencies, and ratio of friction to force below which the motion has no stops (Den Hartog, Trans. ASME 53,
#: 1931).
LIMIT = {0.8: 0.817406, 0.9: 0.819650, 1.25: 0.698821, 1.5: 0.646579, 2.0: 0.596285, 3.0: 0.5625}


def test_den_hartogs_limit_of_motion_without_stops():
    ratios, limits = np.array(list(LIMIT)), np.array(list(LIMIT.values()))
    for shift, stops in ((-1e-5, False), (1e-5, True)):
        axes = {
            "friction.mu_k": xr.DataArray(limits + shift, dims="case"),
            "force.frequency": xr.DataArray(ratios / (2 * np.pi), dims="case"),
        }
        run = ringsweep.sweep(oscillator(1500.0), axes)
        assert (run.settled == 1).all()
        assert ((run.stops_per_cycle > 0) == stops).all()


def test_steady_motions_have_the_numbers_of_stops_that_hong_and_liu_found():
    """0, 1, 2, 4, 6, 8, 10, 12 and 14 stops in a cycle (Hong and Liu 2000)."""
    ratios = np.array([0.035, 0.04, 0.05, 0.07, 0.1, 0.2, 0.25, 0.5, 1.2])
    axes = {"force.frequency": ratios / (2 * np.pi), "friction.mu_k": np.linspace(0.02, 0.8, 79)}
    run = ringsweep.sweep(oscillator(800.0), axes)
    trusted = run.stops_per_cycle.values[(run.settled == 1) & (run.certified == 1)]
    assert {0, 1, 2, 4, 6, 8, 10, 12, 14} <= set(trusted.tolist())
