"""What a person types wrongly: each mistake is told in one line with its place, before any run."""

import re
from pathlib import Path
from typing import Any

import pytest
from belts import on_belt
from refusals import refused
from test_belt_pair import STICTION, coupled
from test_belt_zones import with_zones
from test_functions_of_time import by, ring
from test_impact import BODY
from test_load_in_time import braked
from test_rate_and_state import dragged
from test_ring_long_run import RIG, ROCKING
from test_section import BRISTLES, FORCED
from test_steady import launched
from test_stops import KARNOPP, between
from test_two_way_friction import by_formula, conveyor, two_way

import ringsweep
from ringsweep import InputError
from ringsweep.config import load

BELT: dict[str, Any] = on_belt({"law": "stiction", "mu_s": 0.15, "mu_k": 0.05}, 2.0, velocity=0.1, span=7.0)
SAMPLE: dict[str, Any] = {"n": 256, "of": {"friction.mu_s": {"normal": [0.15, "10 %"]}}}
GOOD = {"t": [0.1, 0.2, 0.3, 0.4], "x": [0.01, 0.02, 0.03, 0.04]}
FILES = {
    "other.csv": "mu_s,other\n0.1,0.2\n0.2,0.3\n",
    "hole.csv": "friction.mu_s\n0.1\nnan\n",
    "empty.csv": "",
    "gap.csv": "t,x\n0.1,0.2\n0.2,nan\n0.3,0.2\n",
    "angle.csv": "t,phi (deg)\n0.1,0.2\n",
    "mass.csv": "t,x (kg)\n0.1,0.2\n0.2,0.2\n0.3,1\n",
}


@pytest.fixture(autouse=True)
def nothing_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files with faults in the working directory, and no runs."""
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    monkeypatch.chdir(tmp_path)
    for module in ("ringsweep.runs.thresholds.compute", "ringsweep.runs.fit.batch"):
        monkeypatch.setattr(module, lambda *_args, **_options: pytest.fail("a mistake is told before the first run"))


def located(call: Any, path: str, words: str) -> None:
    error = refused(re.escape(words), call)
    assert error.path.startswith(path)


TWO_ENDS = "between: the two ends of an interval are expected, such as (0.5, 8)"
WORDS = "is not a regime of this scene (known: stick-slip, oscillatory, sliding, sticking, riding, failed, "

# The keys of `sweep.sample`: what is changed, the path of the mistake, and words of its line.
OF = "sweep.sample.of.friction.mu_s"
SAMPLES: list[tuple[dict[str, Any], str, str]] = [
    ({"n": 1000}, "sweep.sample.n", "give 1024"),
    ({"n": 100, "method": "random"}, "sweep.sample.n", "give 96"),
    ({"method": "halton"}, "sweep.sample.method", "sobol"),
    ({"of": {"body.mass": {"uniform": "1 kg ± 5"}}}, "sweep.sample.of.body.mass.uniform", "the tolerance has no unit"),
    ({"of": {"body.mass": {"uniform": "1 kg ± 5 s"}}}, "sweep.sample.of.body.mass.uniform", "is in kg"),
    ({"of": {"body.mass": {"uniform": "10 %"}}}, "sweep.sample.of.body.mass.uniform", "or 0.1 ± 10 % is expected"),
    ({"of": {"body.mass": {"uniform": "0 ± 10 %"}}}, "sweep.sample.of.body.mass.uniform", "give the tolerance itself"),
    ({"sensitivity": "yes"}, "sweep.sample.sensitivity", "a section with keys is expected, got 'yes'"),
    ({"of": {}}, "sweep.sample.of", "paths and distributions"),
    *(
        ({"of": {"body.mass": {kind: numbers}}}, "sweep.sample.of.body.mass", f"draws {wrong} kg, but mass of the body")
        for kind, numbers, wrong in (
            ("normal", [1e308, 1e308], "-inf"),
            ("lognormal", [1e-320, 0.1], "nan"),
            ("uniform", [-1e308, 1e308], "inf"),
        )
    ),
    ({"of": {"friction.mus": {"normal": [1, 1]}}}, "sweep.sample.of.friction.mus", "did you mean `friction.mu_s`"),
    ({"of": {"friction.law": {"values": ["coulomb"]}}}, "sweep.sample.of.friction.law", "axis of sweep.grid"),
    ({"of": {"friction.mu_s": 0.3}}, "sweep.sample.of.friction.mu_s", "a distribution is expected"),
    ({"of": {"friction.mu_s": {}}}, "sweep.sample.of.friction.mu_s", "got none"),
    ({"of": {"friction.mu_s": {"normal": [1, 2], "uniform": [1, 2]}}}, "sweep.sample.of.friction.mu_s", "one dist"),
    ({"of": {"friction.mu_s": {"normal": [0.15, 0]}}}, "sweep.sample.of.friction.mu_s.normal.1", "greater than 0"),
    ({"of": {"body.mass": {"normal": [1, "3 mm"]}}}, "sweep.sample.of.body.mass.normal.1", "wrong unit"),
    ({"of": {"initial.x": {"normal": [0, "10 %"]}}}, "sweep.sample.of.initial.x.normal.1", "a mean of 0"),
    ({"of": {"friction.mu_s": {"uniform": [0.3, 0.2]}}}, "sweep.sample.of.friction.mu_s.uniform", "less than the"),
    ({"of": {"body.mass": {"triangular": [1, 3, 2]}}}, "sweep.sample.of.body.mass.triangular", "a mode between"),
    ({"of": {"body.mass": {"lognormal": [-1, 2]}}}, "sweep.sample.of.body.mass.lognormal", "greater than 0"),
    ({"of": {"friction.mu_s": {"over": "mu_s", "uniform": [1, 2]}}}, "sweep.sample.of.friction.mu_s.over", "itself"),
    ({"of": {"friction.mu_s": {"over": "body.mass", "uniform": [1, 2]}}}, "sweep.sample.of.friction.mu_s.over", "unit"),
    (
        {"of": {f"friction.{a}": {"over": b, "uniform": [1, 2]} for a, b in (("mu_s", "mu_k"), ("mu_k", "mu_s"))}},
        *("sweep.sample.of.friction.mu_s.over", "itself drawn over"),
    ),
    ({"of": {"friction.mu_s, friction.mu_k": {"normal": [1, 2]}}}, "sweep.sample.of.friction.mu_s, f", "need rows"),
    ({"of": {"friction.mu_s": {"values": []}}}, "sweep.sample.of.friction.mu_s.values", "empty"),
    ({"of": {"friction.mu_s": {"file": "no.csv"}}}, "sweep.sample.of.friction.mu_s.file", "No such file"),
    ({"quantiles": {"t_separation": [0.5]}}, "sweep.sample.quantiles.t_separation", "no number of this model"),
    ({"quantiles": [0.5]}, "sweep.sample.quantiles", "lists of levels"),
    ({"survival": {"linspace": [0, 1]}}, "sweep.sample.survival.linspace", "count"),
    ({"of": {"friction.mu_s": {"norml": [0.15, 0.01]}}}, f"{OF}.norml", "did you mean `normal`"),
    ({"of": {"friction.mu_s": {"normal": {"mean": 0.15, "sd": 0.01}}}}, f"{OF}.normal", "[mean, standard deviation]"),
    ({"of": {"friction.mu_s": "normal(0.15, 0.01)"}}, OF, "or `{normal: [0.3, 10 %]}` if 10 % is a standard deviation"),
    ({"of": {"friction.mu_s": {"truncnormal": [0.15, 0.01, 0.2, 0.1]}}}, f"{OF}.truncnormal", "less than the last"),
    ({"of": {"friction.mu_s": {"file": "other.csv"}}}, f"{OF}.file", "no column friction.mu_s (known: mu_s, other)"),
    ({"of": {"friction.mu_s": {"file": "hole.csv"}}}, OF, "hole.csv, line 3: "),
    ({"of": {"friction.mu_s": {"file": "empty.csv"}}}, OF, "the file is empty"),
    (
        {"of": {"friction.mu_s": {"over": "mu_j", "uniform": [1, 2]}}},
        f"{OF}.over",
        "no such number to vary; did you mean `fric",
    ),
    ({"of": {"body.mass": {"normal": [1, 0.5]}}}, "sweep.sample.of.body.mass", "normal(1, 0.5) has probability 0.023"),
    (
        {"of": {"friction.mu_k": {"uniform": [0.1, 0.2]}}},
        "scene.friction.mu_k",
        "not all points of the sample are allowed",
    ),
    ({"sensitivity": {"off": ["x_end"]}}, "sweep.sample.sensitivity.off", "did you mean `of`"),
    ({"sensitivity": {"of": "x_end"}}, "sweep.sample.sensitivity.of", "a list of variables is expected, got 'x_end'"),
    ({"sensitivity": {"of": ["x_ned"]}}, "sweep.sample.sensitivity.of.0", "did you mean `x_end`"),
    ({"sensitivity": {"of": ["first_slip"]}}, "sweep.sample.sensitivity.of.0", "by survival: [1 s]"),
]

# Path, interval, further arguments, and the start of the line.
THRESHOLDS: list[tuple[str, Any, dict[str, Any], str]] = [
    ("friction.mu", (0.1, 0.2), {}, "path: the scene has no such number to vary; did you mean"),
    ("friction.alpha", (1.0, 2.0), {}, "path: the scene has no such number to vary: law tustin or bengisu-akay has it"),
    ("friction.law", (0.1, 0.2), {}, "path: friction.law is no number that varies continuously"),
    ("friction.mu_s", None, {}, "from: the configuration does not sweep friction.mu_s: say where to look, by --from"),
    ("friction.mu_s", (0.3, 0.2), {}, "to: 0.2 is not greater than 0.3"),
    ("friction.mu_s", (0.01, 0.4), {}, "from: friction.mu_s = 0.01 is not allowed: scene.friction.mu_k: 0.05"),
    *(("friction.mu_s", ends, {}, f"{TWO_ENDS}, got {ends!r}") for ends in ((0.12,), 3, "0.2 to 0.4")),
    ("friction.mu_s", (0.12, 0.4), {"regime": "rideing"}, "not a regime of this scene; did you mean `riding`"),
    *(
        ("friction.mu_s", (0.12, 0.4), {"regime": word}, f"regime: {word!r} {WORDS}")
        for word in ("jammed", "separating", "tumbled")
    ),
    # The load may fall to zero: the word is allowed, the interval is not.
    ("body.normal_stiffness", (2, 1), {"regime": "separating"}, "to: 1 N/m is not greater than 2 N/m"),
    ("friction.mu_s", (0.12, 0.4), {"tolerance": -1}, "tolerance: -1 is not allowed"),
    ("friction.mu_s", (0.12, 0.4), {"scan": 1}, "scan: 1 is not allowed: number of runs must be at least 2"),
]

# The same with a sample: its distributions, the grid, the regime.
UNCERTAIN: list[tuple[dict[str, Any], Any, str, str, str]] = [
    ({"friction.mu_s": {"uniform": [0.2, 0.3]}}, None, "riding", "path", "friction.mu_s is uncertain itself"),
    ({"friction.mu_k": {"over": "mu_s", "uniform": [0.5, 0.6]}}, None, "riding", "path", "is drawn over friction.mu_s"),
    ({"body.mass": {"uniform": [1, 2]}}, {"belt.velocity": [0.1, 0.2]}, "riding", "sweep", "also varies belt.velocity"),
    ({"body.mass": {"uniform": [1, 2]}}, None, "rideing", "regime", "of this scene; did you mean `riding`?"),
]

# Data, paths, options, the start of the line.
FITS: list[tuple[Any, Any, dict[str, Any], str]] = [
    (GOOD, "", {}, "vary: paths are expected, such as friction.rough.mu_k, got {}"),
    (GOOD, "friction.mu", {}, "did you mean `friction.mu_"),
    (GOOD, "friction.law", {}, "no number that varies continuously"),
    (GOOD, "time.span", {}, "no influence on a measured history"),
    (GOOD, "friction.mu_k=0.1", {}, "vary.friction.mu_k: the two ends of an interval are expected"),
    (GOOD, "friction.mu_k=0.2..0.1", {}, "0.1 is not greater than 0.2"),
    (GOOD, "spring.cubic", {}, "spring.cubic=LOW..HIGH"),
    (GOOD, "friction.mu_k=0.2..0.3, friction.mu_s=0.01..0.1", {}, "mu_s"),
    (GOOD, "friction.mu_k", {"start": 0}, "start: 0 is not allowed"),
    (GOOD, "friction.mu_k", {"noise": 0}, "noise: 0 m is not allowed"),
    (
        GOOD | {"t": [1.7e9 + k for k in range(len(GOOD["t"]))]},
        "friction.mu_k",
        {},
        "data.t: begins at 1.7e+09 s, after time.span, ",
    ),
    (GOOD, "friction.mu_k", {"noise": "1 deg"}, "noise: "),
    (7, "friction.mu_k", {}, "data: a CSV file, a mapping or a DataFrame is expected"),
    ("nowhere.csv", "friction.mu_k", {}, "data: nowhere.csv cannot be read: No such file"),
    ({"x": [1.0]}, "friction.mu_k", {}, "data: two columns are expected, t and a quantity such as phi or x, got x"),
    (GOOD | {"velocity": [0.0]}, "friction.mu_k", {}, "got t, x, velocity"),
    ({"t": GOOD["t"], "phi": GOOD["x"]}, "friction.mu_k", {}, "data.phi: 'phi' is no quantity of the history"),
    ({"t": GOOD["t"], "x": [0.1]}, "friction.mu_k", {}, "data.x: 1 values for 4 times"),
    ({"t": [0.1, 0.3, 0.2], "x": [0, 0, 0]}, "friction.mu_k", {}, "data.t.2: 0.2 s does not come after 0.3 s"),
    ({"t": [-0.1, 0.3], "x": [0, 0]}, "friction.mu_k", {}, "data.t.0: -0.1 s is not allowed"),
    ({"t": [0.0], "x": [0.0]}, "friction.mu_k", {}, "1 measurements are too few for 1 numbers"),
    ({"t": [], "x": []}, "friction.mu_k", {}, "data.t: empty"),
    (
        GOOD,
        "friction.mu_k=0.2..0.3",
        {},
        "vary: starts at {'friction.mu_k': 0.25}: scene.friction.mu_k: 0.25 exceeds mu_s",
    ),
    ("gap.csv", "friction.mu_k", {}, "gap.csv, line 3: data.x.1: 'nan' is not finite"),
    ("angle.csv", "friction.mu_k", {}, "angle.csv, line 1: data.phi: 'phi' is no quantity of the history"),
    ("mass.csv", "friction.mu_k", {}, "mass.csv, line 1: data.x: the unit 'kg' does not fit"),
    ("empty.csv", "friction.mu_k", {}, "the file is empty"),
]


@pytest.mark.parametrize(("changed", "path", "words"), SAMPLES, ids=[f"{p}-{k}" for k, (_, p, _) in enumerate(SAMPLES)])
def test_mistake_in_a_sample(changed: dict[str, Any], path: str, words: str) -> None:
    located(lambda: load({"scene": BELT, "sweep": {"sample": SAMPLE | changed}}), path, words)


@pytest.mark.parametrize(("vary", "between", "others", "words"), THRESHOLDS)
def test_mistake_in_a_threshold(vary: str, between: Any, others: dict[str, Any], words: str) -> None:
    given = {"regime": "riding", "between": between} | others
    located(lambda: ringsweep.threshold(BELT, vary, **given), "", words)


@pytest.mark.parametrize(("of", "grid", "regime", "path", "words"), UNCERTAIN)
def test_mistake_in_an_uncertain_threshold(of: dict[str, Any], grid: Any, regime: str, path: str, words: str) -> None:
    sweep = {"sample": {"n": 32, "of": of}} | ({"grid": grid} if grid else {})
    given = {"scene": BELT, "sweep": sweep}
    located(lambda: ringsweep.threshold(given, "friction.mu_s", regime, (0.12, 0.4)), path, words)


@pytest.mark.parametrize(("data", "vary", "options", "words"), FITS)
def test_mistake_in_a_fit(data: Any, vary: Any, options: dict[str, Any], words: str) -> None:
    located(lambda: ringsweep.fit(BELT, data, vary, **options), "", words)


def test_plain_end_of_an_interval_beside_another_unit_is_told(caplog: pytest.LogCaptureFixture) -> None:
    belt = BELT | {"spring": {"stiffness": "2 N/m"}, "body": {"mass": "900 g"}}
    calls = [
        lambda: ringsweep.threshold(belt, "body.mass", "riding", ("800", "700")),
        lambda: ringsweep.fit(belt, GOOD, "body.mass=800..700"),
        lambda: ringsweep.threshold(belt, "spring.stiffness", "riding", ("2", "1")),
        lambda: ringsweep.threshold(belt, "body.mass", "riding", (800, 700)),
    ]
    for call in calls:
        with caplog.at_level("WARNING"), pytest.raises(InputError):
            call()
    cures = [record.getMessage().rpartition("; ")[2] for record in caplog.records]
    assert cures == [
        *('was `--from "800 g"` meant?', 'was `--to "700 g"` meant?'),
        *('was `--vary "body.mass=800 g..HIGH"` meant?', 'was `--vary "body.mass=LOW..700 g"` meant?'),
    ]


POWER = {"drive": {"law": "power", "amplitude": "2 m", "exponent": 1.1}, "belt": None}
TURN, PERIODS = {"at": "turn"}, {"at": "period"}
EXPONENT = {"exponent": True}
RK4 = {"method": "rk4", "steps": 1000}
GRID = {"grid": {"belt.velocity": [0.1, 0.2, 0.3]}}
SPANS = {"grid": {"time.span": [1.0, 2.0]}, "follow": "time.span"}
SIDEWAYS = {"axis": "belt.velocity", "direction": "sideways"}
EVEN, ARCTAN = ({"law": law, "amplitude": 1.0} for law in ("constant", "arctan"))
LUGRE = {"law": "lugre", "sigma0": 2000.0, "sigma1": 5.0, "sigma2": 0.0, "v_s": 0.01}
BRISTLE = {"law": "bristle", "mu_k": 0.3, "sigma0": 100.0}
FORMULA = {"law": "formula"}
IN_TIME = {"formula": "A*sin(w*t)", "w": 1}
TIMES, FORCES = {"time": [0.0, 1.0, 2.0, 20.0]}, {"force": [1.0] * 4}
MU = {"mu_s": 0.3, "mu_k": 0.1}

#: Sound configurations.
PLAIN: dict[str, Any] = {"scene": BELT}
ZONES: dict[str, Any] = {"scene": with_zones([(0.3, 0.1, 0.5, 0.4)], (0.2, 0.1))}
ZONED = ZONES["scene"]["friction"]
LOAD: dict[str, Any] = {"scene": braked(IN_TIME | {"A": 1})}
FLOOR: dict[str, Any] = {"scene": conveyor(STICTION)}
AGEING: dict[str, Any] = {"scene": dragged("dieterich", 1e-3, 1.0, span=1.0)}
SECTION: dict[str, Any] = {"scene": FORCED, "record": {"section": PERIODS}}
STOPS: dict[str, Any] = {"scene": between(-1.0, 1.0, mu_k=0.1, span=1.0)}
STEADY: dict[str, Any] = {"scene": launched({"law": "coulomb", "mu_k": 0.3})}
PAIR: dict[str, Any] = {"scene": coupled()}
IMPACT: dict[str, Any] = {"scene": BODY}
ROCKS: dict[str, Any] = {"scene": RIG, "record": {"section": PERIODS}}
ROUND: dict[str, Any] = {"scene": ring(by("A*t", A=1.0))}
BALL: dict[str, Any] = {"scene": ROCKING, "sweep": SPANS}

# A sound configuration, the sections that replace those of its scene or beside it (None leaves one out), and the line.
CONFIGURATIONS: list[tuple[dict[str, Any], dict[str, Any], str]] = [
    *(
        (PLAIN, {"sweep": {"grid": {"body.mass": axis}}}, f"sweep.grid.body.mass{said}")
        for axis, said in (
            ({"logspace": [1, 2, 3]}, ": ; did you mean `geomspace`, from the"),
            ({"linspce": [1, 2, 3]}, ": ; did you mean `linspace`, from the"),
            ({"linspace": [5, "6 g", 8]}, ".linspace: in g: give both a unit"),
        )
    ),
    (PLAIN, {"scene": BELT | {"solver": RK4}}, "scene.solver: the section `solver` stands beside `scene`, not in it"),
    (PLAIN, POWER, "scene.drive.amplitude: its unit is m/s^p with the exponent p, so write 2 for 2 m/s^p"),
    (PLAIN, {"sweep": {"sample": SAMPLE, "grid": {"friction.mu_s": [0.1, 0.2]}}}, f"{OF}: one place only"),
    (PLAIN, {"sweep": GRID | {"refine": {"strid": 8}}}, "sweep.refine.strid: did you mean `stride`"),
    (PLAIN, {"sweep": GRID | {"refine": {"stride": 0}}}, "sweep.refine.stride: at least 1"),
    (PLAIN, {"sweep": GRID | {"refine": {"audit": 2}}}, "sweep.refine.audit: at most 1"),
    (PLAIN, {"sweep": GRID | {"refine": 3}}, "sweep.refine: a section with keys"),
    (PLAIN, {"sweep": GRID | {"follow": "belt.velocty"}}, "sweep.follow: did you mean"),
    (PLAIN, {"sweep": GRID | {"follow": SIDEWAYS}}, "sweep.follow.direction: both"),
    (PLAIN, {"sweep": GRID | {"follow": {"axes": 1}}}, "sweep.follow.axes: did you mean"),
    (PLAIN, {"sweep": GRID | {"follow": "belt.velocity", "refine": True}}, "sweep.refine: follow"),
    (PLAIN, {"sweep": SPANS, "friction": BRISTLE}, "sweep.follow: more than a deflection"),
    (PLAIN, {"sweep": SPANS, "belt": None, "drive": ARCTAN}, "sweep.follow: no phase"),
    (PLAIN, {"initial": {"x": 1.0, "from": "a.nc"}}, "scene.initial.x: leave one out"),
    ({"scene": BRISTLES}, {"initial": {"deflection": 1.0}}, "scene.initial.deflection: up to 0.0015 m"),
    (PLAIN, {"initial": {"from": "no.nc"}}, "scene.initial.from: no.nc"),
    (PLAIN, {"force": {"amplitude": 1.0}}, "scene.force.frequency: missing: a force with amplitude needs it"),
    (PLAIN, {"force": {"phase": 1.0, "frequency": 1.0}}, "scene.force.amplitude: missing"),
    (PLAIN, {"force": {"amplitude": "1 m", "frequency": 1.0}}, "scene.force.amplitude: wrong unit"),
    (PLAIN, {"force": {"amplitude": 1.0, "frequency": -1.0}}, "scene.force.frequency: at least 0"),
    (PLAIN, {"force": {"law": "harmonic"}}, "scene.force.law: unknown key"),
    (PLAIN, {"force": 3.0}, "scene.force: a section is expected"),
    (PLAIN, {"force": TIMES}, "scene.force.force: missing"),
    (PLAIN, {"force": FORCES | {"time": [0, 1, 2, 3]}}, "scene.time.span: 7 s is longer than the table of the force"),
    (PLAIN, {"force": TIMES | {"force": [1.0] * 3}}, "scene.force.force: 3 values, but time has 4"),
    (PLAIN, {"force": TIMES | FORCES | {"frequency": 1.0}}, "scene.force.frequency: cannot stand beside"),
    (PLAIN, {"force": {"file": "no.csv"}}, "scene.force.file: no.csv"),
    (PLAIN, {"force": TIMES | FORCES | {"interpolate": "spline"}}, "scene.force.interpolate: 'spline' is no interpol"),
    (PLAIN, {"force": {"amplitude": 1, "frequency": 1, "interpolate": "linear"}}, "scene.force.time: missing: a table"),
    (PLAIN, {"force": IN_TIME | {"A": 1, "amplitude": 1.0}}, "scene.force.amplitude: cannot stand beside"),
    (PLAIN, {"force": IN_TIME | TIMES | FORCES}, "scene.force.time: cannot stand beside"),
    (PLAIN, {"force": IN_TIME | {"interpolate": "linear"}}, "scene.force.interpolate: cannot stand beside"),
    (PLAIN, {"force": {"formula": "A*floor(sin(t))", "A": 1}}, "scene.force.formula: floor takes a straight line in t"),
    (ZONES, {"belt": {"velocity": 0.0}}, "scene.belt.period: missing"),
    (ZONES, {"belt": {"velocity": 0.0, "period": 0.1}}, "scene.zones.0.half_length: 0.1 m is longer than half of belt"),
    (ZONES, {"friction": ZONED | KARNOPP}, "scene.zones.0: not available with law karnopp"),
    (ZONES, {"friction": ZONED | {"frame": "body"}}, "scene.friction.frame: is no frame of zones"),
    (ZONES, {"zones": [{"from": 0.1, "to": 0.2}]}, "scene.zones.0.from: half_length"),
    (ZONES, {"initial": {"steady": "slip"}}, "scene.initial.steady: not available with zones"),
    *(
        (LOAD, {"body": {"mass": 1.0, "load": load}}, f"scene.{said}")
        for load, said in (
            ("5 N", "body.load: a section is expected"),
            (IN_TIME, "body.load.A: missing"),
            ({"formula": "A*floor(t)"}, "body.load.formula: units do not fit in t"),
            ({"formula": "A*t", "A": 1, "file": "load.csv"}, "body.load.file: cannot stand beside a formula"),
            ({"time": [0, 1], "load": [1, 2]}, "time.span: table of the body.load, which ends at 1 s"),
            ({"time": [0, 10], "load": [1]}, "body.load.load: 1 values, but time has 2"),
            ({"amplitude": 2.0}, "body.load.time: missing: a table needs a file"),
        )
    ),
    *(
        (FLOOR, {"friction": friction}, f"scene.friction.{said}")
        for friction, said in (
            ({"law": "stiction", "mu_s": {"forward": 0.3}, "mu_k": 0.1}, "mu_s.backward: missing"),
            ({"law": "stiction", "mu_s": {"up": 0.3}, "mu_k": 0.1}, "mu_s.up: unknown key"),
            (two_way((0.3, 0.2), (0.1, 0.2)), "mu_k.backward: 0.2 exceeds mu_s"),
            (BRISTLE | {"mu_k": {"forward": 0.3, "backward": 0.2}}, "mu_k: not available with law bristle"),
            (by_formula("mu_k*piecewise(direction > 1, 1, 2)", **MU), "mu: such as v < v1, or is direction > 0"),
            (by_formula("mu_k*(1 + direction*v)", **MU), "mu: units do not fit"),
            (by_formula("mu_k*(4 - direction)", **MU), "law: it begins to slip with friction 0.5, more than"),
            (by_formula("mu_k", **MU, direction=1.0), "direction: unknown key"),
        )
    ),
    (AGEING, {"friction": AGEING["scene"]["friction"] | {"a": 0.0}}, "scene.friction.a: 0 is not allowed"),
    (AGEING, {"initial": {"contact_age": "-1 s"}}, "scene.initial.contact_age: must be greater than 0 s"),
    (
        AGEING,
        {"model": "ring-single-contact"},
        "scene.friction.law: is not a friction law of model ring-single-contact",
    ),
    (SECTION, {"record": {"section": {"keep": 3}}}, "record.section.at: missing: instant of a section"),
    (SECTION, {"record": {"section": {"at": "periods"}}}, "record.section.at: 'periods' is no instant of a section"),
    (SECTION, {"record": {"section": TURN | {"kept": 3}}}, "record.section.kept: unknown key; did you mean `keep`?"),
    (SECTION, {"record": {"section": TURN | {"keep": 0}}}, "record.section.keep: 0 is not allowed"),
    (SECTION, {"record": {"section": "turn"}}, "record.section: a section with keys is expected"),
    (SECTION, {"force": None}, "record.section.at: neither force nor drive has a period"),
    (SECTION, {"record": {"section": TURN | {"period": 2.0}}}, "record.section.period: belongs to `at: period`"),
    (SECTION, {"record": {"section": PERIODS | {"period": 2.0}}}, "record.section.period: force or drive have"),
    (SECTION, {"record": {"section": PERIODS | {"period": 0.0}}}, "record.section.period: 0 s is not allowed"),
    (SECTION, {"solver": RK4}, "solver.method: rk4 locates no instants for record.section"),
    (SECTION, {"sweep": GRID | {"refine": True}}, "sweep.refine: cannot stand beside record.section"),
    (
        SECTION,
        {"sweep": {"sample": SAMPLE | {"of": {"body.mass": {"uniform": [1, 2]}}}}},
        "sweep.sample: cannot stand beside record.section",
    ),
    (SECTION, {"solver": RK4, "record": EXPONENT}, "solver.method: rk4 locates no events"),
    (SECTION, {"record": {"exponent": "yes"}}, "record.exponent: true or false is expected"),
    (SECTION, {"record": {"exponents": True}}, "record.exponents: unknown key; did you mean `exponent`?"),
    (SECTION, {"friction": BRISTLE, "record": EXPONENT}, "record.exponent: friction law bristle has none"),
    (STOPS, {"stops": {"restitution": 0.5}}, "scene.stops: low or high is missing"),
    (STOPS, {"stops": {"low": 0.3, "high": 0.1, "restitution": 0.5}}, "scene.stops.low: not below stops.high"),
    (STOPS, {"stops": {"high": -0.1, "restitution": 0.5}}, "scene.initial.x: 0 m is above stops.high"),
    (STOPS, {"stops": {"high": 0.1}}, "scene.stops.restitution: missing"),
    (STOPS, {"stops": {"high": 0.1, "restitution": 1.5}}, "scene.stops.restitution: 1.5"),
    (STOPS, {"solver": RK4}, "solver.method: does not rebound from stops"),
    (STOPS, {"friction": KARNOPP | {"dead_band": 0.6}}, "scene.friction.dead_band: less than the speed of the belt"),
    (STEADY, {"belt": {"velocity": 0.0}}, "scene.initial.steady: a belt at 0 m/s does not slide along"),
    (STEADY, {"initial": {"steady": "stick"}}, "scene.initial.steady: 'stick' is no steady motion (known: slip)"),
    *(
        (STEADY, {"initial": {"steady": "slip", name: 1}}, f"scene.initial.{name}: cannot stand beside initial.steady")
        for name in ("x", "velocity", "contact_age")
    ),
    (STEADY, {"body": LOAD["scene"]["body"]}, "scene.initial.steady: a normal load that does not"),
    (STEADY, {"spring": {"stiffness": 0.0}}, "scene.initial.steady: the spring cannot hold the body against 2.943 N"),
    (STEADY, {"spring": {"stiffness": 20.0, "cubic": -1e5}}, "scene.initial.steady: cannot hold the body"),
    (
        STEADY,
        {"body": {"mass": 1.0, "normal_stiffness": -1e3}, "force": {"constant": 1e3}},
        "scene.initial.steady: normal load would be -",
    ),
    (STEADY, {"belt": None, "drive": ARCTAN}, "scene.initial.steady: needs a belt of constant velocity"),
    (STEADY, {"friction": KARNOPP | {"dead_band": 0.2}}, "scene.initial.steady: a belt at 0.2 m/s does not"),
    (STEADY, {"friction": BRISTLE}, "scene.initial.steady: bristles of friction law bristle have no st"),
    (STEADY, {"sweep": GRID | {"follow": "belt.velocity"}}, "sweep.follow: cannot stand beside initial.steady"),
    (PAIR, {"friction": KARNOPP}, "scene.friction.law: is not a friction law of model belt-pair"),
    (PAIR, {"friction": STICTION | {"mu_k_2": 0.3}}, "scene.friction.mu_k_2: 0.3 exceeds the static"),
    (PAIR, {"friction": two_way((0.3, 0.2), (0.2, 0.1))}, "scene.friction.mu_s: is two numbers"),
    (PAIR, {"force": {"constant": 1.0}}, "scene.force: unknown key"),
    (PAIR, {"stops": {"high": 1.0}}, "scene.stops: unknown key"),
    (PAIR, {"zone": {"half_length": 1.0}}, "scene.zone: unknown key"),
    (PAIR, {"body": {"mass_1": 1.0}}, "scene.body.mass_2: missing"),
    (PAIR, {"solver": RK4}, "scene.model: which solver rk4 needs"),
    (PAIR, {"solver": {"method": "implicit"}}, "solver.method: implicit does not take friction law stiction"),
    (PAIR, {"record": EXPONENT}, "record.exponent: model belt-pair has none"),
    (PAIR, {"record": {"section": TURN}}, "record.section: model belt-pair has none"),
    (IMPACT, {"solver": RK4}, "solver.method: rk4 does not go on after a contact is lost"),
    (IMPACT, {"friction": BODY["friction"] | LUGRE}, "scene.impact: bristles, which have no state in an impact"),
    (IMPACT, {"impact": {"restitution": 1.5}}, "scene.impact.restitution: must be at least 0 and at most 1"),
    (IMPACT, {"impact": {}}, "scene.impact.restitution: missing"),
    (IMPACT, {"drive": by("A*abs(sin(w*t))", A=3.0, w=8.0)}, "scene.drive.theta: the angular velocity jumps"),
    (IMPACT, {"body": BODY["body"] | {"inertia": 0}}, "scene.body.inertia: cannot turn on one contact"),
    (IMPACT, {"friction": by_formula("mu_k*direction", rough=MU, rest=MU)}, "scene.friction.law: cannot depend on the"),
    (IMPACT, {"initial": {"steady": "slip"}}, "scene.initial.steady: unknown key"),
    (ROCKS, {"record": {"section": TURN}}, "record.section.at: 'turn' is no instant of a section"),
    (ROCKS, {"drive": EVEN, "record": EXPONENT}, "record.exponent: neither force nor drive has a period"),
    (ROCKS, {"impact": {"restitution": 0.5}}, "record.section: cannot stand beside scene.impact"),
    (ROCKS, {"friction": RIG["friction"] | LUGRE, "record": EXPONENT}, "record.exponent: law lugre has none on a ring"),
    *(
        (ROUND, {"drive": drive}, f"scene.drive.{said}")
        for drive, said in (
            (FORMULA | {"velocity": "V*sin(t*t/T/T)", "V": 1, "T": 1}, "velocity: its integral is not known: known"),
            (FORMULA | {"velocity": "V*log(1 + t/T)", "V": 1, "T": 1}, "velocity: ; give theta"),
            (FORMULA | {"velocity": "V*sign(sin(w*t))", "V": 1, "w": 1}, "velocity: a triangle wave"),
            (FORMULA | {"velocity": "velocity*sin(w*t)", "w": 1}, "velocity: is the formula: give its parameter"),
            (by("A*t", A=1, velocity="V*t", V=1), "velocity: cannot stand beside theta"),
            (FORMULA | {"velocity": "V*sin(w*t)", "V": "1 rad", "w": 1}, "V: has the wrong unit"),
            (FORMULA | {"velocity": 2.0}, "velocity: 2.0: a formula is a text"),
            (by("piecewise(t < t1, a*t, 3*a*t/2)", a=2.0, t1=1.0), "theta: jumps from 2 rad to 3 rad at t = 1 s"),
            (by("A*sign(cos(w*t))", A=2.0, w=2.0), "theta: the angle jumps from 2 rad to -2 rad at t = 0.785398 s"),
            (by("A*(t/T - floor(t/T))", A=2.0, T=0.9), "theta: the angle jumps from 2 rad to 0 rad at t = 0.9 s"),
            (by("A*max(sin(w*t), t/T)", A=2.0, w=5e4, T=9.0), "theta: the times of its switches are not found: within"),
            (by("A*floor(2*sin(w*t))", A=2.0, w=1.0), "theta: floor takes a straight line in t, such as floor(t/T)"),
            (by("A*floor(sin(t))", A=2.0), "theta: floor takes a straight line in t, such as floor(t/T)"),
            (by("A*t*floor(A/A)", A=2.0), "theta: floor of an expression without t: write the number itself"),
            (by("A*t**1.5", A=2.0), "theta: 'A*t**1.5': its first derivative is no finite number at t = 0 s"),
            (by("A*log(t/T)", A=2.0, T=1.0), "theta: 'A*log(t/T)': the formula is no finite number at t = 0 s"),
            (by("A*t", A="2 s"), "A: '2 s' has the wrong unit: parameter A of the drive is in rad/s"),
            (by("A*t + B*exp(t)", A=1.0, B=1.0), "theta: units do not fit in t: s and 1 (t is in s)"),
            (by("A*t", A=1.0, tau=1.0), "tau: unknown key"),
            (by("A*t"), "A: missing: parameter A of the drive, in rad/s"),
            (by("A*sine(t)", A=1.0), "theta: sine is not a known function (allowed: numbers, t, names of parameters"),
            (by("A*t^2", A=1.0), "theta: powers are written **"),
            (by("A*theta", A=1.0), "theta: theta cannot be the name of a parameter"),
            (by("A", A=1.0), "theta: it must depend on t"),
            (by(3.0), "theta: a formula is a text such as A*sin(w*t), got float"),
            (FORMULA, "theta: missing: the formula of the motion"),
            (by("A*piecewise(A < 1, t, 0)", A=1.0), "theta: a condition compares t with a parameter, such as t < t1"),
        )
    ),
    (BALL, {"impact": {"restitution": 0.5}}, "sweep.follow: leave impact out"),
    (BALL, {"friction": ROCKING["friction"] | LUGRE}, "sweep.follow: choose another law"),
]


@pytest.mark.parametrize(("sound", "changed", "said"), CONFIGURATIONS)
def test_mistake_in_a_configuration(sound: dict[str, Any], changed: dict[str, Any], said: str) -> None:
    config = sound | {key: part for key, part in changed.items() if key in ("scene", "record", "solver", "sweep")}
    scene = config["scene"] | {key: part for key, part in changed.items() if key not in config}
    config["scene"] = {key: part for key, part in scene.items() if part is not None}
    path, _, words = said.partition(": ")
    assert refused(re.escape(words), ringsweep.run, config, jobs=1, progress=False).path == path
