"""What a person types wrongly about samples, thresholds and fits: each mistake is told in one line, before any run."""

import re
from pathlib import Path
from typing import Any

import pytest
from belts import on_belt
from refusals import refused

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


def test_path_that_is_sampled_and_swept() -> None:
    sweep = {"sample": SAMPLE, "grid": {"friction.mu_s": [0.1, 0.2]}}
    located(lambda: load({"scene": BELT, "sweep": sweep}), "sweep.sample.of.friction.mu_s", "one place only")


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


@pytest.mark.parametrize(
    ("changed", "grid", "path", "words"),
    [
        ({}, {"body.mass": {"logspace": [1, 2, 3]}}, "sweep.grid.body.mass", "; did you mean `geomspace`, from the"),
        ({}, {"body.mass": {"linspce": [1, 2, 3]}}, "sweep.grid.body.mass", "; did you mean `linspace`, from the"),
        ({}, {"body.mass": {"linspace": [5, "6 g", 8]}}, "sweep.grid.body.mass.linspace", "in g: give both a unit"),
        ({"solver": {"method": "auto"}}, {}, "scene.solver", "the section `solver` stands beside `scene`, not in it"),
        (POWER, {}, "scene.drive.amplitude", "its unit is m/s^p with the exponent p, so write 2 for 2 m/s^p"),
    ],
)
def test_mistake_in_a_configuration(changed: dict[str, Any], grid: Any, path: str, words: str) -> None:
    scene = {key: value for key, value in (BELT | changed).items() if value is not None}
    located(lambda: load({"scene": scene} | ({"sweep": {"grid": grid}} if grid else {})), path, words)
