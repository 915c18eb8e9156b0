"""Relations between runs that hold for all parameters: symmetry, scales, shifts of time, order.

The scenes are random. Runs without a certificate are left out, and must be few. No reference solution is needed.
"""

from dataclasses import replace

import numpy as np
import pytest
import relations
from relations import Kind
from tiers import mostly_slow

import ringsweep

#: Kinds of scenes by name. The first ones take kernels that other tests take too.
SPRING = ("spring.cubic", "damper.coefficient")
SLOPE = ("belt.incline",)
LOADS = ("friction.viscous", "body.normal_stiffness", "force.constant")
IN_STEP = {"drive.frequency": 0.5, "force.frequency": 1.0}
BROAD = {"friction.alpha": 10.0, "friction.v0": 0.2}
BOTH = ("friction.mu_s", "friction.mu_k")
BOTH_IN_ZONES = tuple(f"friction.{place}.{mu}" for place in ("rough", "rest") for mu in ("mu_s", "mu_k"))
STEPS = {"method": "rk4", "steps": 4000}
BRISTLES = ("dahl", "lugre", "elasto-plastic", "reset-integrator")
KINDS = {
    "belt": Kind("belt", "stiction", force="harmonic", parts=SPRING, span=(2, 20)),
    "belt-lugre": Kind("belt", "lugre", force="harmonic", parts=SPRING + SLOPE, span=(1, 8)),
    "ring": Kind("ring", "stiction", "arctan", arcs=1),
    "ring-smooth": Kind("ring", "bengisu-akay", "arctan", arcs=1),
    "ring-impact": Kind("ring", "stiction", "arctan", arcs=1, impact=True),
    "ring-rk4": Kind("ring", "bengisu-akay", "arctan", arcs=1, solver=STEPS, fixed=BROAD),
    "ring-dahl": Kind("ring", "dahl", "arctan", arcs=1),
    "belt-all": Kind(
        "belt", "tustin", "sinusoidal", 0, "harmonic", SPRING + LOADS + SLOPE, span=(2, 20), fixed=IN_STEP
    ),
    "belt-load": Kind("belt", "stiction", "constant", force="constant", parts=LOADS[1:], span=(2, 40)),
    "belt-no-spring": Kind("belt", "coulomb", "sinusoidal", span=(2, 20), fixed={"spring.stiffness": 0.0}),
    "belt-section": Kind("belt", "hyperbolic", force="harmonic", span=(20, 60), record={"section": {"at": "period"}}),
    "belt-clock": Kind("belt", "stiction", force="clocked", span=(2, 20)),
    "belt-smooth": Kind("belt", "bengisu-akay", force="harmonic", parts=SPRING, span=(2, 20)),
    "belt-dahl": Kind("belt", "dahl", "sinusoidal", parts=LOADS[1:2], span=(1, 8)),
    "belt-reset": Kind("belt", "reset-integrator", force="harmonic", span=(1, 8)),
    "belt-rk4": Kind("belt", "bengisu-akay", "sinusoidal", span=(1, 8), solver=STEPS, fixed=BROAD),
    "ring-zones": Kind("ring", "stiction", "sinusoidal", arcs=3),
    "ring-power": Kind("ring", "coulomb", "power"),
    "ring-clock": Kind("ring", "hyperbolic", "clocked"),
    "ring-table": Kind("ring", "gaussian-stribeck", "table"),
    "ring-implicit": Kind("ring", "brown-mcphee", solver="implicit"),
    "contact-rk4": Kind("ring-single-contact", "bengisu-akay", "sinusoidal", solver=STEPS, fixed=BROAD),
    "contact": Kind("ring-single-contact", "stiction", "sinusoidal", arcs=1),
    "contact-impact": Kind("ring-single-contact", "coulomb", "arctan", arcs=1, impact=True),
    "ring-impacts": Kind("ring", "tustin", "sinusoidal", arcs=1, impact=True),
    "ring-lugre": Kind("ring", "lugre", "sinusoidal", arcs=2),
    "belt-karnopp": Kind("belt", "karnopp", force="harmonic", parts=LOADS[:1], span=(2, 20)),
    "belt-tables": Kind("belt", "coulomb", "table", force="table", span=(2, 20)),
    "belt-tables-smooth": Kind("belt", "bengisu-akay", "table", force="table", span=(2, 20)),
    "belt-out-of-step": Kind("belt", "stiction", "sinusoidal", force="harmonic", span=(2, 20)),
    "belt-two-tones": Kind("belt", "hyperbolic", "clocked", force="two-tones", span=(2, 20)),
    "belt-power": Kind("belt", "stiction", "power", force="constant", span=(2, 20)),
    "belt-exponent": Kind("belt", "stiction", force="harmonic", span=(2, 20), record={"exponent": True}),
    "belt-torus": Kind("belt", "tustin", force="two-tones", span=(50, 100), record={"exponent": True}),
    "belt-two-way": Kind(
        "belt", "stiction", force="harmonic", parts=LOADS, span=(2, 20), two_way=BOTH, record={"exponent": True}
    ),
    "belt-two-way-smooth": Kind("belt", "bengisu-akay", force="harmonic", span=(2, 20), two_way=BOTH),
    "belt-two-way-band": Kind("belt", "karnopp", force="harmonic", span=(2, 20), two_way=BOTH),
    "belt-zones": Kind("belt", "stiction", force="harmonic", parts=("belt.period",), arcs=2, span=(2, 20)),
    "belt-zones-smooth": Kind("belt", "bengisu-akay", force="harmonic", parts=("belt.period",), arcs=1, span=(2, 20)),
    "belt-zones-bristles": Kind("belt", "lugre", force="harmonic", parts=("belt.period",), arcs=2, span=(1, 8)),
    "belt-space-bristles": Kind("belt", "reset-integrator", force="harmonic", arcs=1, span=(1, 8), frame="space"),
    "belt-space-load": Kind(
        "belt", "stiction", force="square", parts=SPRING + SLOPE, arcs=2, span=(2, 20), load=True, frame="space"
    ),
    "belt-zones-jumps": Kind(
        *("belt", "tustin", "bouncing", 1, "square", (*LOADS[:2], "belt.period")), span=(2, 9), fixed=IN_STEP, load=True
    ),
    "belt-jumps-smooth": Kind(
        "belt", "bengisu-akay", "bouncing", force="square", parts=SLOPE, span=(1, 8), two_way=BOTH, load=True
    ),
    "belt-stops-jumps": Kind(
        "belt", "stiction", "bouncing", force="square", parts=LOADS[:2], impact=True, span=(2, 20), two_way=BOTH
    ),
    "belt-load-exponent": Kind(
        "belt", "hyperbolic", force="harmonic", parts=SLOPE, span=(2, 20), record={"exponent": True}, load=True
    ),
    "belt-ruina": Kind("belt", "ruina", "sinusoidal", parts=SLOPE, span=(1, 8), load=True),
    "belt-two-way-bristles": Kind("belt", "elasto-plastic", force="harmonic", span=(1, 8), two_way=BOTH),
    "ring-two-way": Kind("ring", "stiction", "sinusoidal", arcs=1, two_way=BOTH_IN_ZONES),
    "contact-two-way-rk4": Kind(
        "ring-single-contact", "bengisu-akay", arcs=1, solver=STEPS, fixed=BROAD, two_way=BOTH_IN_ZONES
    ),
    "belt-dieterich": Kind("belt", "dieterich", force="harmonic", parts=("initial.contact_age",), span=(1, 8)),
    "belt-stops": Kind(
        *("belt", "stiction"), force="harmonic", parts=SPRING, impact=True, span=(2, 20), record={"exponent": True}
    ),
    "belt-stops-smooth": Kind("belt", "bengisu-akay", force="harmonic", parts=LOADS, impact=True, span=(2, 20)),
    "belt-stops-bristles": Kind("belt", "lugre", force="harmonic", impact=True, span=(1, 8)),
    "ring-exponent": Kind("ring", "hyperbolic", "sinusoidal", arcs=1, record={"exponent": True}),
}


@pytest.fixture(scope="module", params=mostly_slow(KINDS, tuple(KINDS)[:7]))
def drawn(request):
    """Cells of a kind, and their outcomes."""
    run = relations.random_scenes(KINDS[request.param], 100, np.random.default_rng(48))
    return run, run.outcomes()


class TestRandomScenes:
    """What a mirror image, other units, another clock and another order make of random scenes of all features."""

    @staticmethod
    def assert_alike(first, second):
        assert relations.differing(first, second) == {}
        # Where a run is close to another regime, rounding may decide whether it is too close.
        assert (first.certified != second.certified).mean() <= 0.01
        assert first.certified.mean() > 0.9

    @pytest.mark.parametrize(
        "scales", [{"mass": 0.37, "length": 1.7, "time": 0.71}, {"length": 3e-6}, {"time": 4e-5}, {"time": 3e4}]
    )
    def test_outcomes_do_not_depend_on_the_units_of_mass_length_and_time(self, drawn, scales):
        run, first = drawn
        # The clock of one drive counts seconds. A ring by another has an infinite acceleration at launch: reactions and
        # jumps are those of an instant 1e-14 s later, whatever the clock.
        if run.kind.drive in ("arctan", "power"):
            scales = {name: scale for name, scale in scales.items() if name != "time"}
        if scales:
            second = relations.in_units(run, **scales).outcomes()
            self.assert_alike(first, relations.in_first_units(second, scales))

    def test_contacts_that_chatter_in_turn_rebound_as_often_in_any_units(self):
        """Their last hops are as high as a length is rounded that is compared with the radius."""
        run = relations.random_scenes(KINDS["ring-impact"], 400, rng := np.random.default_rng(1001))
        run.numbers["impact.restitution"] = rng.uniform(0.5, 0.97, 400)
        first = run.outcomes()
        for scale in (10.0, 1e-3):
            second = relations.in_units(run, length=scale).outcomes()
            counts = (ds.impacts.values[relations.sure(first, second)] for ds in (first, second))
            np.testing.assert_array_equal(*counts)

    def test_launch_that_either_contact_could_carry_alone_ends_at_once(self):
        """Neither is chosen, and without both one of them would close again."""
        run = relations.random_scenes(KINDS["ring-impact"], 12_000, rng := np.random.default_rng(1))
        numbers = run.numbers | {"initial.omega": np.zeros(12_000), "time.span": np.full(12_000, 1e-3)}
        numbers |= {path: 3.0 * column for path, column in numbers.items() if "mu_" in path}
        numbers["drive.amplitude"] = numbers["drive.amplitude"] * rng.choice([10.0, 100.0], 12_000)
        found = relations.Run(run.kind, numbers, run.scene).outcomes(solver={"method": "auto", "certify": False})
        assert not (ringsweep.words(found.regime) == "failed").any()
        assert (found.separating_contact[found.t_end == 0.0] == 3).any()

    @pytest.mark.slow
    def test_time_of_stick_on_bristles_does_not_depend_on_the_resolution(self):
        """The guard of stick is the least of four, and has corners within long steps."""
        run = relations.random_scenes(KINDS["ring-lugre"], 300, np.random.default_rng(48))
        first, second = run.outcomes(), run.outcomes(solver={"method": "implicit", "rtol": 1e-10})
        assert (
            (abs(first.stick_time - second.stick_time) <= 1e-4 * second.t_end)
            .values[relations.sure(first, second)]
            .all()
        )

    @pytest.mark.slow
    def test_exponent_that_is_zero_is_known_to_its_rounding(self):
        found = relations.random_scenes(KINDS["ring-exponent"], 100, np.random.default_rng(48)).outcomes()
        zero = abs(found.lyapunov) < 1e-12
        assert 10 < zero.sum() < 100
        assert not (found.lyapunov_error.values[zero] == 0.0).any()

    @pytest.mark.slow
    def test_exponent_on_bristles_is_known_to_its_bound(self):
        """The scatter of its growth does not show the errors of implicit steps."""
        kind = replace(KINDS["belt-lugre"], parts=(), record={"exponent": True}, span=(2, 8), load=True)
        run = relations.random_scenes(kind, 100, np.random.default_rng(48))
        first, second = run.outcomes(), run.outcomes(solver={"method": "implicit", "rtol": 1e-10})
        bound = first.lyapunov_error + second.lyapunov_error
        assert (abs(first.lyapunov - second.lyapunov) <= bound).values[relations.sure(first, second)].mean() > 0.98

    @pytest.mark.parametrize("scales", [{"mass": 2.0**50}, {"length": 2.0**-20}, {"time": 2.0**-15}])
    def test_units_that_are_powers_of_two_change_no_bit(self, drawn, scales):
        run, first = drawn
        if "time" in scales and run.kind.drive in ("arctan", "power"):
            pytest.skip("the clock of the drive counts seconds")
        if "time" in scales and not (run.kind.law in BRISTLES or run.kind.solver == STEPS):
            pytest.skip("the length of a step of a series is the exponential of a logarithm")
        if "length" in scales and ("spring.cubic" in run.numbers or run.kind.law == "gaussian-stribeck"):
            pytest.skip("a unit of error is a cube root, or speeds are isolated between powers of ten")
        if "length" in scales and run.kind.record == {"exponent": True}:
            pytest.skip("the pivots of the variational equation compare angles with velocities")
        if "mass" in scales and run.kind == KINDS["ring-impacts"]:
            pytest.skip("before a jam a coefficient of a reaction exceeds the range of a double in these units")
        second = relations.in_units(run, **scales).outcomes()
        assert relations.unequal(first, relations.in_first_units(second, scales)) == {}

    def test_mirror_image_has_the_mirrored_outcomes(self, drawn):
        run, first = drawn
        self.assert_alike(first, relations.mirror_of(relations.mirrored(run).outcomes()))

    def test_whole_periods_of_the_forcing_later_the_outcomes_are_the_same(self, drawn):
        run, first = drawn
        for turns in (1, 9):
            shifted = relations.later(run, turns)
            if shifted.numbers.keys() & {"drive.frequency", "force.frequency"}:
                self.assert_alike(first, shifted.outcomes())

    def test_order_of_the_cells_and_number_of_jobs_change_no_bit(self, drawn):
        run, first = drawn
        order = np.random.default_rng(1).permutation(len(first.cell))
        second = relations.in_order(run, order).outcomes(jobs=2)
        assert relations.unequal(first, second.isel(cell=np.argsort(order))) == {}


class TestLaunch:
    """Bodies released from rest, some of which lose a contact at once."""

    @staticmethod
    def released(name):
        """Cells of a kind, which differ from those of another kind by the friction law alone."""
        run, kind = relations.random_scenes(KINDS["ring"], 1000, np.random.default_rng(48)), KINDS[name]
        own = relations.random_scenes(kind, 1000, np.random.default_rng(48)).numbers
        numbers = own | {path: column for path, column in run.numbers.items() if path in own}
        numbers |= {"drive.amplitude": 10.0 * numbers["drive.amplitude"], "initial.omega": np.zeros(1000)}
        return relations.Run(kind, numbers | {"time.span": np.full(1000, 1e-9)}, kind.scene)

    def test_reactions_at_launch_are_those_of_the_mirror_image(self):
        run = self.released("ring")
        found, mirrored = run.outcomes(), relations.mirror_of(relations.mirrored(run).outcomes())
        assert (found.t_end == 0.0).sum() > 50
        assert relations.differing(found, mirrored) == {}
        cell = np.flatnonzero((found.t_end == 0.0) & (found.normal_max_2 > 0.0))[0]
        history = ringsweep.simulate(relations.placed(run, cell))
        assert (history.normal_1.item(), history.normal_2.item()) == (0.0, found.normal_max_2[cell])

    @pytest.mark.parametrize(
        ("name", "same"),
        mostly_slow(
            [("ring", "ring-impact"), ("ring-smooth", "ring-rk4"), ("ring-smooth", "ring-dahl")],
            [("ring", "ring-impact")],
        ),
    )
    def test_contact_that_is_not_lost_at_launch_carries_the_body_alone(self, name, same):
        """As in the pivot with which a run goes on. Under laws without friction at rest it does not matter which."""
        found, other = self.released(name).outcomes(), self.released(same).outcomes()
        lost = (found.separating_contact > 0).values
        assert lost.sum() > 50
        np.testing.assert_array_equal(found.separating_contact[lost], other.separating_contact[lost])
        for least, greatest in (("normal_min_1", "normal_max_1"), ("normal_min_2", "normal_max_2")):
            np.testing.assert_array_equal(found[least][lost], found[greatest][lost])
            np.testing.assert_allclose(found[greatest][lost], other[greatest][lost], rtol=1e-6)


#: Kinds under laws that a constant step resolves in most cells.
RESOLVED = (
    *("belt-smooth", "belt-lugre", "belt-zones-smooth", "belt-zones-bristles", "belt-two-way-smooth"),
    *("belt-jumps-smooth", "belt-tables-smooth", "belt-dahl", "ring-smooth", "ring-dahl"),
)

#: Numbers of a run that hang on no instant of its steps.
ENDS = {f"{name}_{at}" for name in ("x", "velocity", "phi", "omega") for at in ("end", "min", "max")} | {"t_separation"}


@pytest.mark.slow
@pytest.mark.parametrize("name", RESOLVED)
def test_constant_steps_end_where_located_steps_do(name):
    run = relations.random_scenes(KINDS[name], 40, np.random.default_rng(48))
    first, second = run.outcomes(), run.outcomes(solver={"method": "rk4", "steps": 40_000})
    assert relations.sure(first, second).sum() > 20
    ends = ENDS if KINDS[name].law in BRISTLES else ENDS | {"regime", "motion"}
    assert not relations.differing(first, second).keys() & ends


class TestSweeps:
    """The way in which cells are swept does not matter."""

    def test_order_of_the_axes_changes_no_bit(self):
        run = relations.random_scenes(KINDS["ring"], 5, np.random.default_rng(3))
        axes = {path: run.numbers[path] for path in ("drive.amplitude", "zone.half_angle")}
        scene = relations.placed(run, 0, *axes)
        first, second = (
            ringsweep.sweep(scene, dict(given), progress=False) for given in (axes.items(), [*axes.items()][::-1])
        )
        assert first.regime.dims == second.regime.dims[::-1]
        for name, data in first.data_vars.items():
            np.testing.assert_array_equal(data, second[name].transpose(*data.dims), err_msg=name)

    @pytest.mark.parametrize("relation", ["units", "mirror", "later"])
    def test_cells_that_follow_each_other_obey_the_relations_too(self, relation):
        kind = replace(KINDS["belt"], span=(20, 40), fixed={"spring.cubic": 2.0, "force.amplitude": 3.0})
        run, path = relations.random_scenes(kind, 3, np.random.default_rng(4)), "force.frequency"
        scales = {"mass": 0.37, "length": 1.7, "time": 0.71} if relation == "units" else {}
        other = relations.in_units(run, **scales)
        other = {"mirror": relations.mirrored(run), "later": relations.later(run, 5)}.get(relation, other)
        found = []
        for given in (run, other):
            frequencies = np.linspace(0.2, 0.5, 7) * given.numbers[path][0] / run.numbers[path][0]
            ds = ringsweep.sweep(
                relations.placed(given, 0, path), {path: frequencies}, follow=path, jobs=1, progress=False
            )
            found.append(ds.rename(force_frequency="cell").drop_vars("cell"))
        first, second = found
        second = relations.mirror_of(second) if relation == "mirror" else relations.in_first_units(second, scales)
        assert relations.differing(first, second) == {}

    def test_probabilities_do_not_depend_on_the_units(self):
        run = relations.random_scenes(KINDS["belt"], 1, np.random.default_rng(5))
        found = []
        for scales in ({}, {"mass": 0.37, "length": 1.7, "time": 0.71}):
            given = relations.in_units(run, **scales)
            uncertain = ("spring.stiffness", "force.amplitude", "friction.mu_s")
            ends = {path: sorted(float(given.numbers[path][0]) * share for share in (1.0, 6.0)) for path in uncertain}
            of = {path: {"uniform": pair} for path, pair in ends.items()}
            scene = relations.placed(given, 0, *uncertain)
            sample = {"n": 128, "seed": 1, "of": of}
            found.append(ringsweep.run({"scene": scene, "sweep": {"sample": sample}}, jobs=1, progress=False))
        np.testing.assert_array_equal(found[0].probability, found[1].probability)
        assert ((found[0].probability > 0.0) & (found[0].probability < 1.0)).any()
