"""The table of the events of a run."""

import numpy as np
import pytest
from belts import on_belt

import ringsweep
from ringsweep.report.text import events_in_words

BELT = on_belt({"law": "stiction", "mu_s": 0.15, "mu_k": 0.1}, 2.0, velocity=0.1, span=20.0)


def told(run, kind):
    return run.event_time.values[ringsweep.words(run.event_kind).values == kind]


class TestEvents:
    def test_body_slips_at_static_friction_and_stops_at_the_mirrored_place(self):
        """The slip is a circle about mu_k m g / k, so that it ends as far below this centre as it began above it."""
        run = ringsweep.simulate(BELT)
        assert told(run, "breakaway")[0] == pytest.approx(0.15 * 9.81 / 2.0 / 0.1, rel=1e-12)
        stops = told(run, "stop")
        places = np.interp(stops, run.time, run.x)
        np.testing.assert_allclose(places, 2 * 0.1 * 9.81 / 2.0 - 0.15 * 9.81 / 2.0, rtol=1e-6)
        assert len(run.event_time) == 2 * len(stops) == 2 * int(run.slips)

    def test_edges_are_where_a_contact_meets_a_zone_end_and_separation_is_last(self, scene):
        run = ringsweep.simulate(scene)
        beta, half = np.arcsin(0.025 / 0.033378), np.radians(15.0)
        kinds, contacts = ringsweep.words(run.event_kind).values, run.event_contact.values
        edges = kinds == "edge"
        assert set(contacts[edges]) == {1, 2}
        for time, contact in zip(run.event_time.values[edges], contacts[edges], strict=True):
            place = np.interp(time, run.time, run.phi - run.theta) + (-beta if contact == 1 else beta)
            assert abs((place + np.pi) % (2 * np.pi) - np.pi) == pytest.approx(half, abs=1e-6)
        assert (np.diff(run.event_time) >= 0.0).all()
        assert kinds[-1] == "separation"
        assert contacts[-1] == run.separating_contact
        assert run.event_time[-1] == run.t_separation

    def test_edges_are_told_in_runs_that_go_on_too(self, scene, capsys):
        """Up to the lost contact both runs are the same; afterwards contacts that hold meet edges."""
        run = ringsweep.simulate(scene | {"impact": {"restitution": 0.5}})
        alone = ringsweep.simulate(scene)
        edges = told(run, "edge")
        np.testing.assert_allclose(edges[edges < alone.t_separation.item()], told(alone, "edge"), rtol=1e-9)
        assert edges[-1] > alone.t_separation
        assert run.separations == 1
        assert f", with 1 loss of contact and {run.impacts.item():.0f} impacts" in run.attrs["outcome"]
        print(events_in_words(run))
        hardest = int(np.argmax(run.impact_speed.values))
        assert (
            f"hardest impact: {run.impact_speed_max.item():.6g} m/s at {run.impact_time.values[hardest]:.9g} s; "
            f"greatest gap: {run.gap_max.item():.6g} m"
        ) in (printed := capsys.readouterr().out)
        # The table leaves out what happens while no contact opens or closes.
        assert " s separation contact 2\n" in printed
        assert " s edge" not in printed
        # Each change of a zone is at an edge, or while its contact is open.
        for zone, gap in ((run.zone_1, run.gap_1), (run.zone_2, run.gap_2)):
            at = np.flatnonzero(np.diff(zone.values))
            held = (gap.values[at] == 0.0) & (gap.values[at + 1] == 0.0)
            assert np.isin(run.time.values[at][held], edges).all()
