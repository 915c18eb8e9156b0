"""Drives and forces by formula: what is derived from the text, and what is refused."""

import re
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.integrate import quad, solve_ivp

import ringsweep
from ringsweep.compile import take
from ringsweep.config import load
from ringsweep.errors import InputError
from ringsweep.models import batch
from ringsweep.numerics.writer import SERIES_ROWS
from ringsweep.physics import drives
from ringsweep.quantities.parameters import declared

#: Drives in the documentation.
EXAMPLES = [
    found["drive"]
    for text in re.findall(r"```yaml\n(drive:.*?)```", (Path(__file__).parents[1] / "docs/scenes.md").read_text(), re.S)
    for found in [yaml.safe_load(text)]
]

RK4 = {"method": "rk4", "steps": 400, "diagnose": False}

#: A ring that starts at t0, and turns evenly from t1 on.
START = "piecewise(t < t0, 0, t < t1, a*(t - t0)**2/2, a*(t1 - t0)*(t - (t0 + t1)/2))"

RUN_UP = "piecewise(t < t1, a*t**2/2, a*t1*(t - t1/2))"


def by(theta, **parameters):
    """Section of a drive by formula."""
    return {"law": "formula", "theta": theta, **parameters}


def ring(drive, **others):
    """A small body in a ring."""
    friction = {"law": "coulomb", "rest": {"mu_k": 0.3}, "rough": {"mu_k": 0.6}}
    return {
        **{"model": "ring-single-contact", "body": {"mass": 0.1}, "ring": {"radius": 0.2}, "zone": {"half_angle": 0.4}},
        **{"friction": friction, "drive": drive, "time": {"span": 2.0}},
        **others,
    }


def belt(drive=None, force=None, friction=None):
    """A body on a belt with a spring, under tanh friction of a width that makes it smooth."""
    smooth = {"law": "tanh", "mu_k": 0.2, "v0": 0.5}
    return {
        **{"model": "belt", "body": {"mass": 1.0}, "spring": {"stiffness": 4.0}, "friction": friction or smooth},
        **({"belt": {"velocity": 0.0}} if drive is None else {"drive": drive}),
        **({} if force is None else {"force": force}),
        "time": {"span": 6.0},
    }


def cells_of(scene, **axes):
    """Cells of a scene; `axes` are values of paths, with ``__`` in place of dots."""
    found = load({"scene": scene}).scene
    values = {path: np.array([value]) for path, value in found.values.items()}
    values |= {path.replace("__", "."): np.asarray(given, dtype=float) for path, given in axes.items()}
    count = max(map(len, values.values()))
    return batch(found.structure, {path: np.broadcast_to(value, (count,)).copy() for path, value in values.items()})


def drive_of(section, **axes):
    return cells_of(ring(section), **axes).drive


def series_of(drive, t, order=18):
    theta = np.empty(order + 1)
    drives.expand(drive, t, order, theta, np.full((SERIES_ROWS, order + 1), np.nan))
    return theta


#: Each drive of the package, and a formula for the same motion.
ALIKE = {
    "constant": ({"law": "constant", "amplitude": 2.0}, by("A*t", A=2.0)),
    "arctan": (
        {"law": "arctan", "amplitude": 2.0},
        by("A*(t*atan(t/T) - T*log(1 + (t/T)**2)/2)", A="2 rad/s", T="1 s"),
    ),
    "sinusoidal": (
        {"law": "sinusoidal", "amplitude": 0.5, "frequency": 0.7, "phase": "30 deg"},
        by("sin(2*pi*f*t + psi)*A", A="0.5 rad", f="0.7 Hz", psi="30 deg"),
    ),
    "power": ({"law": "power", "amplitude": 0.5, "exponent": 3.0}, by("A*t**3", A="0.5 rad/s^3")),
}


class TestDerived:
    """All that the methods need of a drive follows from its formula."""

    @pytest.mark.parametrize(("known", "formula"), ALIKE.values(), ids=list(ALIKE))
    def test_formula_of_a_drive_of_the_package_is_that_drive(self, known, formula):
        a, b = take(drive_of(known), 0), take(drive_of(formula), 0)
        for t in (1e-6, 0.3, 1.7, 20.0):
            np.testing.assert_allclose(drives.turn(b, t), drives.turn(a, t), rtol=1e-13, atol=1e-15)
            assert drives.jerk(b, t) == pytest.approx(drives.jerk(a, t), rel=1e-12, abs=1e-14)
            expected = series_of(a, t)
            # Of a polynomial, coefficients that another formula gives as rounding are zero.
            np.testing.assert_allclose(series_of(b, t), expected, rtol=1e-11, atol=1e-14 * abs(expected).max())
        assert drives.period(b) == pytest.approx(drives.period(a))

    @pytest.mark.parametrize(
        "text",
        [
            "A*exp(-t/s)*sin(w*t)",
            "A*tanh(exp(-t/s) + t/s)",
            "A*sqrt(2 + sin(w*t))/(2 + cos(w*t))",
            "A*log(1 + (t/s)**2)*atan(t/s)",
            "A*(1 + t/s)**0.3 + A*tan(w*t/9)",
            "A*(t/s)**7/(1 + (t/s)**5)",
            "A*(t/s)**9*exp(t/s)",
            "A*exp(sin(w*t)**2)",
            "A*log1p(t/s)",
            "A*tanh(t/s)",
            "+".join(f"A*sin({k}*w*t)/{k}" for k in range(1, 13)),
        ],
    )
    def test_series_and_derivatives_are_those_of_cauchys_integral(self, text):
        known = {"A": 1.3, "s": 1.7, "w": 2.1}
        numbers = {name: value for name, value in known.items() if re.search(rf"\b{name}\b", text)}
        drive = take(drive_of(by(text, **numbers)), 0)
        names = {name: getattr(np, name) for name in ("exp", "tanh", "sqrt", "sin", "cos", "tan", "log", "log1p")}
        names |= {"atan": np.arctan, **numbers}
        t, radius, points = 0.4, 0.5, 256
        circle = radius * np.exp(2j * np.pi * np.arange(points) / points)
        # The function has no singularity within the circle.
        expected = np.fft.fft(eval(text, names | {"t": t + circle})).real[:19] / points
        np.testing.assert_allclose(series_of(drive, t) * radius ** np.arange(19), expected, atol=1e-13)
        factorials = radius ** -np.arange(4.0) * [1, 1, 2, 6]
        found = [*drives.turn(drive, t), drives.jerk(drive, t)]
        np.testing.assert_allclose(found, expected[:4] * factorials, rtol=1e-11)

    @pytest.mark.slow
    def test_documented_examples_run_and_their_parameters_can_be_swept(self):
        assert len(EXAMPLES) == 2
        for drive in EXAMPLES:
            name = list(drive)[-1]
            units = declared(type(drive_of(drive)))[name].unit
            values = [drive[name], f"2 {units}"]
            found = ringsweep.sweep(ring(drive), {f"drive.{name}": values}, solver=RK4, progress=False)
            assert found.phi_end.values[0] != found.phi_end.values[1]

    def test_body_at_rest_on_a_formula_at_its_turning_point_stays_at_rest(self):
        """There the velocity of the drive is the rounding of its terms, not zero."""
        drive = take(drive_of(by("A*sin(w*t + p) + A*sin(3*w*t + q)", A=0.3, w=40.0, p="90 deg", q="270 deg")), 0)
        assert drives.turn(drive, 0.0)[1] != 0.0
        assert drives.relative_velocity(drive, 0.0) == 0.0


#: Velocities as formulas, and the places that they lead to from 0 on; V is a speed, T a time.
PLACES = {
    "V*(1 + sin(t/T)/2)": "V*(t + T*(1 - cos(t/T))/2)",
    "V*atan(t/T)": "V*(t*atan(t/T) - T*log(1 + (t/T)**2)/2)",
    "V*(1 - exp(-t/T))": "V*(t - T*(1 - exp(-t/T)))",
    "V*tanh(t/T)": "V*(t + T*(log(1 + exp(-2*t/T)) - log(2)))",
    "V*t/T*exp(-t/T)": "V*(T - (t + T)*exp(-t/T))",
    "V*(t/T)**2*cos(t/T)": "V*((t**2/T - 2*T)*sin(t/T) + 2*t*cos(t/T))",
    "piecewise(t < T, V*t/T, t < 2*T, V, V*exp(2 - t/T))": (
        "piecewise(t < T, V*t**2/T/2, t < 2*T, V*(t - T/2), V*T*(3/2 + 1 - exp(2 - t/T)))"
    ),
    "V": "V*t",
}


class TestVelocity:
    """A drive by the formula of its velocity moves as one by the integral of it."""

    @pytest.mark.parametrize(("velocity", "theta"), PLACES.items(), ids=list(PLACES))
    def test_place_is_the_integral_of_the_velocity(self, velocity, theta):
        parameters = {"V": 0.7} | ({"T": 1.3} if "T" in velocity else {})
        by_rate = {"law": "formula", "velocity": velocity, **parameters}
        a, b = (take(drive_of(section), 0) for section in (by_rate, by(theta, **parameters)))
        assert drives.turn(a, 0.0)[0] == 0.0
        for t in (0.2, 1.3, 2.0, 4.4, 1e3):
            np.testing.assert_allclose(drives.turn(a, t), drives.turn(b, t), rtol=1e-12, atol=1e-14)
            expected = series_of(b, t)
            np.testing.assert_allclose(series_of(a, t), expected, rtol=1e-10, atol=1e-13 * abs(expected).max())
        assert drives.period(a) == pytest.approx(drives.period(b))

    def test_place_is_that_of_quadrature_where_a_velocity_rises_fast(self):
        section = {"law": "formula", "velocity": "V*(1 + tanh((t - t1)/w))/2", "V": 0.7, "t1": 1.0, "w": 0.02}
        drive = take(drive_of(section), 0)
        place, _ = quad(lambda t: drives.turn(drive, t)[1], 0.0, 1.7, points=[0.9, 1.0, 1.1], epsabs=1e-14)
        assert drives.turn(drive, 1.7)[0] == pytest.approx(place, rel=1e-13)
        assert drives.next_knot(drive, 1.5) - 1.5 > drives.next_knot(drive, 0.99) - 0.99

    def test_parameter_of_a_place_may_be_called_velocity(self):
        drive = take(drive_of(by("velocity*t", velocity=0.7)), 0)
        assert drives.turn(drive, 2.0)[:2] == (1.4, 0.7)


class TestSwitches:
    """Switches are knots: steps end there."""

    def test_min_and_max_switch_at_the_time_where_their_arguments_are_equal(self):
        ramp = take(drive_of(by(RUN_UP, a=3.0, t1=0.7)), 0)
        same = take(drive_of(by("a*min(t, t1)**2/2 + a*t1*max(t - t1, 0)", a=3.0, t1=0.7)), 0)
        mirrored = take(drive_of(by("a*t1*max(0, t - t1) - a*max(-t, -t1)*min(t1, t)/2", a=3.0, t1=0.7)), 0)
        for drive in (same, mirrored):
            assert drives.next_knot(drive, 0.0) == 0.7
            assert drives.next_knot(drive, 0.7) == np.inf
            for t in (0.2, 0.7, 1.1):
                np.testing.assert_allclose(drives.turn(drive, t), drives.turn(ramp, t), rtol=1e-14)
                np.testing.assert_allclose(series_of(drive, t), series_of(ramp, t), rtol=1e-14)

    def test_jump_is_told_if_it_is_within_the_span_of_a_cell(self):
        drive = by("a*piecewise(t < t1, 0*t, t)", a=2.0, t1=5.0)
        drive_of(drive, drive__t1=[3.0, 2.5, 4.0])
        with pytest.raises(InputError, match=r"at t = 1\.5 s"):
            drive_of(drive, drive__t1=[3.0, 1.5, 4.0])


class TestUnits:
    """Units of the parameters follow from the formula; angles are counted in rad."""

    @pytest.mark.parametrize(
        ("text", "of", "units"),
        [
            ("A*(t - tau*(1 - exp(-t/tau)))", "rad", {"A": "rad/s", "tau": "s"}),
            ("A*sin(w*t + psi)", "rad", {"A": "rad", "w": "rad/s", "psi": "rad"}),
            ("A*sin(2*pi*(f*t + rise*t**2/2))", "rad", {"A": "rad", "f": "1/s", "rise": "1/s^2"}),
            ("A*sin(w*t)/w", "rad", {"A": "rad/s", "w": "rad/s"}),
            ("pi/2*tanh(t/tau)", "rad", {"tau": "s"}),
            ("B*exp(-d*w*t)*cos(w*t)", "rad", {"B": "rad", "d": "1", "w": "rad/s"}),
            # Metres, but radians within a sine.
            ("v*t + A*sin(w*t)", "m", {"v": "m/s", "A": "m", "w": "rad/s"}),
        ],
    )
    def test_units_follow_from_that_of_the_function(self, text, of, units):
        assert {name: parameter.unit for name, parameter in declared(drives.define(text, of)).items()} == units

    def test_values_are_converted(self):
        drive = drive_of(by("A*sin(w*t) + B*sin(2*pi*f*t)", A="90 deg", w="30 rpm", B=1.0, f="2 Hz"))
        np.testing.assert_allclose([drive.A, drive.w, drive.f], [[np.pi / 2], [np.pi], [2.0]])
        moved = cells_of(belt(by("v*t + A*(1 - exp(-t/tau))", v="30 cm/s", A="3 cm", tau="200 ms"))).drive
        np.testing.assert_allclose([moved.v, moved.A, moved.tau], [[0.3], [0.03], [0.2]])


class TestPeriods:
    """A formula of sines and cosines with a common period has it."""

    @pytest.mark.parametrize(
        ("text", "period"),
        [
            ("A*sin(w*t) + B*cos(3*w*t + p)", np.pi),
            ("A*sin(2*w*t) + B*cos(3*w*t)", np.pi),
            ("A*sin(w*t)**2*cos(w*t)", np.pi),
            ("v*t + A*sin(w*t)", np.pi),
            ("A*sin(w*t) + B*sin(sqrt(2)*w*t)", np.inf),
            ("A*sin(w*t) + Z*sin(sqrt(2)*w*t)", np.pi),
            ("A*exp(-w*t)*sin(w*t)", np.inf),
            ("A*sin(w*t + k*t**2)", np.inf),
            ("v*t", 0.0),
            ("Z*sin(w*t)", 0.0),
            ("A*sin(w*t)*max(t, t1)**2", np.inf),
        ],
    )
    def test_period_of_the_velocity(self, text, period):
        law = drives.define(text, "m")
        values = {"A": 1.0, "B": 2.0, "w": 2.0, "p": 0.3, "v": 0.7, "k": 0.1, "Z": 0.0, "t1": 5.0}
        knots = {"knots": np.array([[[[0.0, 5.0], [0.0, -np.inf]]]]), "held": 1, "least": 1} if "max" in text else {}
        drive = law(**{name: np.array([values[name]]) for name in declared(law)}, **knots)
        assert np.broadcast_to(drives.period(drive), (1,)) == pytest.approx(period)

    def test_belt_is_classified_by_the_common_period_of_drive_and_force(self):
        drive = by("v*t + A*sin(2*pi*f*t)", v=0.1, A=0.01, f=0.75)
        # A force with a trend does not repeat, though its rate does.
        for trend, q, period in (("", {}, 4.0), ("q*t + ", {"q": 0.1}, np.inf)):
            force = {"formula": f"{trend}P*sin(2*pi*g*t)", "P": 1.0, "g": 0.5, **q}
            assert cells_of(belt(drive, force)).forcing_period == pytest.approx(period)


class TestForces:
    @pytest.mark.slow
    def test_chirp_of_belt_and_force_moves_a_body_as_scipy_says(self):
        chirp = {"A": "5 cm", "f": "0.3 Hz", "k": "0.2 Hz/s"}
        force = {"formula": "P*exp(-t/tau)*sin(w*t)", "P": "2 N", "tau": "3 s", "w": "4 rad/s", "constant": "0.5 N"}
        viscous = {"law": "coulomb", "mu_k": 0.0, "viscous": "3 kg/s"}
        run = ringsweep.simulate(belt(by("A*sin(2*pi*(f*t + k*t**2/2))", **chirp), force, viscous), samples=60)

        def rates(t, y):
            rate = 2 * np.pi * (0.3 + 0.2 * t)
            v_belt = 0.05 * rate * np.cos(2 * np.pi * (0.3 * t + 0.1 * t * t))
            push = 2.0 * np.exp(-t / 3.0) * np.sin(4.0 * t) + 0.5
            return y[1], push - 4.0 * y[0] - 3.0 * (y[1] - v_belt)

        start = [0.0, 0.05 * 2 * np.pi * 0.3]
        exact = solve_ivp(rates, (0.0, 6.0), start, method="DOP853", rtol=1e-12, atol=1e-13, dense_output=True)
        assert run.certified == 1
        np.testing.assert_allclose([run.x, run.velocity], exact.sol(run.time.values), atol=1e-8)

    def test_formula_stands_beside_no_other_force_but_a_constant(self):
        force = {"formula": "P*sin(w*t)", "P": 1.0, "w": 1.0, "constant": 2.0}
        assert cells_of(belt(force=force)).drive.constant == 2.0
