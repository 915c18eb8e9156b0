"""Reading of configurations, and the messages about errors in them."""

import contextlib
import json
import math
import os
from functools import partial
from itertools import pairwise
from pathlib import Path
from threading import Thread

import numpy as np
import pint
import pytest
import rings
import xarray as xr
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator
from refusals import refused
from rings import TYPED as TEXT

import ringsweep
from ringsweep.config import load, with_values
from ringsweep.config.axes import read_axis
from ringsweep.config.schema import _number, schema
from ringsweep.errors import InputError, nearest_name
from ringsweep.quantities.parameters import Parameter, declared
from ringsweep.quantities.quantity import cf_units
from ringsweep.quantities.units import quantity
from ringsweep.quantities.variables import Variable
from ringsweep.runs.fit import _ranges
from ringsweep.solvers.rk4 import RK4
from ringsweep.storage import netcdf

CONFIGS = Path(__file__).parents[1] / "configs"

SCENE = yaml.safe_load(TEXT)["scene"]
SOLVER = {"method": "rk4", "steps": 1000}


edited = partial(rings.edited, SCENE)
refusal = partial(refused, None)


def read_scene(scene):
    return load({"scene": scene}).scene


def read_axes(scene, axes):
    return load({"scene": scene}, axes=axes).axes


@pytest.fixture
def write(tmp_path):
    def to_file(text, name="case.yaml"):
        file = tmp_path / name
        file.write_text(text, encoding="utf-8")
        return file

    return to_file


@pytest.fixture
def told(caplog):
    """Messages of a call that is made twice in one process."""

    def messages(call, *arguments):
        caplog.clear()
        for _ in range(2):
            call(*arguments)
        return caplog.messages

    return messages


def test_example_is_read_in_si_units_and_its_json_source_reads_the_same(write):
    config = load(write(TEXT))
    assert config.name == "case"
    expected = {"body.inertia": 4.47e-5, "ring.radius": 0.043378, "zone.half_angle": math.radians(15), "gravity": 9.81}
    assert {path: config.scene.values[path] for path in expected} == pytest.approx(expected)
    assert config.scene.values["friction.alpha"] == 1e5
    assert config.solver.steps == 1000
    assert config.axes.sizes == {"drive_amplitude": 5, "zone_half_angle": 2}
    dims, values = config.axes.columns["zone.half_angle"]
    assert dims == ("zone_half_angle",)
    np.testing.assert_allclose(values, [math.radians(2), 0.5])
    again = load(json.loads(json.dumps(config.source)))
    assert (again.scene.values, again.source, again.axes.sizes) == (
        *(config.scene.values, config.source, config.axes.sizes),
    )


#: Numbers with units as text, the unit of a parameter, and the number in that; then those that pint writes too.
TEXTS = [
    *(("4.47e-5 kg m^2", "kg m^2", 4.47e-5), ("15deg", "rad", math.pi / 12), ("3 rad s-1", "rad/s", 3.0)),
    *(("30 %", "1", 0.3), ("-1.5", "m", -1.5), (np.float32(0.5), "m", 0.5)),
]
QUANTITIES = [
    *(("4.47e-5 kg*m**2", "kg m^2", 4.47e-5), ("447 g cm^2", "kg m^2", 4.47e-5), ("43.378 mm", "m", 0.043378)),
    *(("20 rpm", "rad/s", 20 * 2 * math.pi / 60), ("90 deg", "rad", math.pi / 2), ("5 kHz", "Hz", 5000.0)),
    *(("3 N/mm**3", "N/m^3", 3e9), ("0.5 kg*cm**2", "kg m^2", 5e-5), ("2e-6 m/s", "m/s", 2e-6)),
]


@pytest.mark.parametrize(("text", "unit", "expected"), TEXTS + QUANTITIES)
def test_units_are_converted(text, unit, expected):
    assert quantity(text, Parameter(unit, "something"), "path") == pytest.approx(expected)


class TestPint:
    """A quantity of pint is converted as its text would be, whatever its registry and the registry's format."""

    REGISTRIES = pint.UnitRegistry(), pint.UnitRegistry()
    # Old versions of pint have no formatter.
    getattr(REGISTRIES[1], "formatter", REGISTRIES[1]).default_format = "~P"

    @pytest.mark.parametrize("registry", REGISTRIES, ids=["plain", "abbreviated"])
    @pytest.mark.parametrize(
        ("text", "unit", "expected"),
        [
            *QUANTITIES,
            *(("30 percent", "1", 0.3), ("36 km/hour", "m/s", 10.0), ("1 chain", "m", 20.1168402)),
            ("2 force_pound", "N", 8.896443230521),
        ],
    )
    def test_quantity_is_converted_to_the_unit_of_the_parameter(self, registry, text, unit, expected):
        assert quantity(registry(text), Parameter(unit, "something"), "path") == pytest.approx(expected, rel=1e-8)

    @pytest.mark.parametrize(
        ("text", "unit"),
        [("5 Hz", "rad/s"), ("30 rpm", "Hz"), ("3 m", "kg"), ("0.3 dimensionless", "rad"), ("1 N**0.5", "N")],
    )
    def test_quantity_of_another_dimension_is_refused(self, text, unit):
        """Pint itself takes the first two for the same dimension."""
        problem = refusal(quantity, self.REGISTRIES[0](text), Parameter(unit, "something"), "path").problem
        assert "wrong unit" in problem or "not a known unit" in problem

    def test_quantities_make_axes_like_texts(self):
        u = self.REGISTRIES[0]
        expected = read_axes(SCENE, {"drive.amplitude": ["20 rpm", "40 rpm"]}).columns["drive.amplitude"][1]
        speeds = [20, 40] * u("rpm")
        arrays = [xr.DataArray(found, dims="case") for found in (speeds, np.array(list(speeds), dtype=object))]
        for axis in (speeds, list(speeds), (20 * u.rpm, "40 rpm"), *arrays):
            dims, values = read_axes(SCENE, {"drive.amplitude": axis}).columns["drive.amplitude"]
            assert dims == (("case",) if isinstance(axis, xr.DataArray) else ("drive_amplitude",))
            np.testing.assert_array_equal(values, expected)
        refusal(read_axes, SCENE, {"drive.amplitude": [20, 40] * u.Hz})
        refusal(read_axes, SCENE, {"drive.amplitude": 20 * u.rpm})

    def test_quantities_in_a_scene_are_stored_as_text(self, write):
        u = self.REGISTRIES[1]
        source = load(write(TEXT)).source
        source["scene"]["zone"]["half_angle"] = 15 * u.deg
        source["sweep"] = {"grid": {"drive.amplitude": [20, 40] * u("rpm")}}
        found = load(source)
        assert found.scene.values["zone.half_angle"] == math.radians(15)
        assert found.axes.columns["drive.amplitude"][1].tolist() == pytest.approx([2.0943951, 4.1887902])
        again = load(json.loads(json.dumps(found.source)))
        assert again.scene.values == found.scene.values


@pytest.mark.parametrize(
    ("text", "unit", "problem"),
    [
        ("15 mm", "kg", "wrong unit"),
        ("5 Hz", "rad/s", "wrong unit"),
        ("30 rpm", "Hz", "a frequency counts cycles: 60 rpm, or 2 pi rad/s, is 1 Hz"),
        ("60 deg/s", "rad", "an angle is wanted, not its rate"),
        ("15 mm", "rad", "the angle of an arc is its length divided by the radius"),
        ("15 deg", "1", "wrong unit"),
        ("3 bananas", "m", "not a known unit"),
        ("3 m", "banana", "something is declared in 'banana', no known unit"),
        ("3 m^9^9^9", "m", "not a known unit"),
        ("3 rad", "", "takes a plain number"),
        ("0,1 m/s", "m/s", "a decimal point, not a comma"),
        ("ten", "m", "is not a number"),
        ("1 m\n2", "m", "is not a known unit"),
        ("nan", "m", "not finite"),
        ("-.inf", "m", "not finite"),
        (10**400, "m", "not finite"),
        ([1], "m", "is not a number"),
    ],
)
def test_value_without_a_number_or_with_a_wrong_unit_is_refused(text, unit, problem):
    assert problem in refusal(quantity, text, Parameter(unit, "something"), "path").problem


AMPLITUDES = "drive.amplitude: {geomspace: [0.1, 10, 5]}"
BAD_LINES = {
    "unknown key": ("ring: {radius:", "ring: {radus:", "scene.ring.radus", 4, "did you mean `radius`?"),
    "unknown section": ("  time:", "  tme:", "scene.tme", 16, "did you mean `time`?"),
    "missing key": ("    v0: 2.0e-6\n", "", "scene.friction.v0", 5, "missing: half-width of the stiction band"),
    "wrong unit": ("0.076 kg", "0.076 m", "scene.body.mass", 3, "is in kg"),
    "degrees taken for radians": ("15 deg", "15", "scene.zone.half_angle", 12, "was `15 deg` meant?"),
    "negative mass": ("0.076 kg", "-76 g", "scene.body.mass", 3, "must be greater than 0 kg"),
    "kinetic beyond static": ("mu_k: 0.1", "mu_k: 0.4", "scene.friction.rest.mu_k", 8, "0.4 exceeds mu_s"),
    "ring too small": ("43.378 mm", "35 mm", "scene.ring.radius", 4, "too small"),
    "a section that is none": ("{span: 10}", "10", "scene.time", 16, "a section is expected"),
    "given twice": ("    alpha: 1.0e5", "    v0: 1.0e5", "scene.friction.v0", 10, "given twice"),
    "a tag": ("0.076 kg", "!!python/object:os.system x", "scene.body.mass", 3, "tag"),
    "axis of nothing": ("amplitude: {", "amplitud: {", "sweep.grid.drive.amplitud", 20, "`drive.amplitude`"),
    "axis value out of its interval": ("[2 deg, 0.5]", "[2 deg, 60]", "sweep.grid.zone.half_angle.1", 21, "60 deg"),
    "geomspace from zero": ("[0.1, 10, 5]", "[0, 10, 5]", "sweep.grid.drive.amplitude.geomspace", 20, "greater than 0"),
    "key of many levels in one": ("time: {span: 10}", "time.span: 10", "scene.time.span", 16, "unknown key"),
    "one cell": (AMPLITUDES, "friction.rest.mu_s: [0.5, 0]", "scene.friction.rest.mu_k", 8, "in a cell"),
    "decimal comma": ("0.076 kg", "0,076 kg", "scene.body.076 kg", 3, "unknown key: a comma ends a value"),
    "no file": ("law: arctan", "law: table\n    file: no.csv", "scene.drive.file", 15, "no.csv cannot be"),
}


@pytest.mark.parametrize(("old", "new", "path", "line", "problem"), BAD_LINES.values(), ids=BAD_LINES)
def test_error_in_a_configuration_names_path_line_and_remedy(write, old, new, path, line, problem):
    assert TEXT.count(old) == 1 or old in ("15 deg", "[0.1, 10, 5]")
    file = write(TEXT.replace(old, new))
    error = refusal(load, file)
    assert (error.path, error.file, error.line) == (path, str(file), line)
    assert problem in error.problem


@pytest.mark.parametrize(
    ("content", "problem"),
    [
        (b"", "is empty"),
        (b"- 1\n", "holds no mapping"),
        (b"a: 1\n---\nb: 2\n", "document"),
        (b"scene: {a: [1, 2\n", "not valid YAML"),
        (b'scene: "\\UFFFFFFFF"\n', "not valid YAML"),
        (b"\xff\xfe\x00", "UTF-8"),
        (b"scene: \x00\n", "not valid YAML"),
        (b"scene: &a {b: *a}\n", "alias within itself"),
        (b"[" * 5000, "nested too deeply"),
        (b"scnee: {}\n", "did you mean `scene`?"),
        (b"? [1, 2]\n: 3\n", "a key must be plain text"),
        (b"{}\n", "missing"),
        (
            b"a: &a [x, x, x, x, x, x, x, x, x, x]\n"
            + b"".join(f"{q}: &{q} [{', '.join([f'*{p}'] * 10)}]\n".encode() for p, q in pairwise("abcdef")),
            "after expanding aliases",
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_text_that_is_no_configuration_is_refused(tmp_path, content, problem):
    file = tmp_path / "bad.yaml"
    file.write_bytes(content)
    error = refusal(load, file)
    assert error.file == str(file)
    assert problem in error.problem


@pytest.mark.parametrize("kind", ["pipe", "device", "folder", "endless"])
@pytest.mark.parametrize("table", [False, True])
def test_only_regular_files_of_a_bounded_size_are_read(tmp_path, kind, table):
    """Reading a pipe would never end, and reading a device would fill the memory."""
    file = tmp_path / "given"
    if kind == "pipe":
        os.mkfifo(file)
    elif kind == "folder":
        file.mkdir()
    elif kind == "endless":
        # It has holes in place of bytes.
        file.touch()
        os.truncate(file, 10**12)
    else:
        file = Path("/dev/zero")
    config = {"scene": edited(drive={"law": "table", "file": str(file)})} if table else file
    refused = []
    reader = Thread(target=lambda: refused.append(refusal(load, config)), daemon=True)
    reader.start()
    reader.join(60.0)
    (error,) = refused
    assert "cannot be read: " + ("it is larger than " if kind == "endless" else "a folder, a pipe or a device") in (
        error.problem
    )


class TestLimits:
    def test_shared_lists_count_as_often_as_they_occur_but_not_in_themselves(self):
        shared = [0.0] * 1000
        for _ in range(2):
            shared = [shared] * 1000
        for section in (shared, {"a": tuple(shared)}, range(10**9), range(10**30), np.broadcast_to(1.0, 10**9)):
            assert "more than 1000000 values" in refusal(load, {"scene": section}).problem
        inner = []
        inner.append(inner)
        assert "nested too deeply" in refusal(load, {"scene": inner}).problem

    @pytest.mark.parametrize(
        "wrong",
        ["x" * 10**5, 10**5000, [[[["x" * 90] * 9] * 9] * 9] * 9, {"x" * 10**5: 1}, {"a": {"b": "y" * 10**5}}],
        ids=["text", "integer", "lists", "key", "mapping"],
    )
    def test_no_message_about_a_long_value_is_long(self, wrong):
        for scene in (
            edited(drive__amplitude=wrong),
            edited(drive=wrong),
            edited(friction__law=wrong),
            edited(friction={"law": "formula", "mu": wrong}),
            edited(friction={"law": wrong, "laws": wrong}),
            edited(zones=wrong),
            edited(model=wrong),
            edited(drive={"law": "table", "file": wrong}),
        ):
            assert len(str(refusal(load, {"scene": scene}))) < 2000
            assert len(str(refusal(load, {"scene": SCENE, "solver": wrong, "sweep": wrong}))) < 2000
        error = refusal(load, {"scene": edited(drive__amplitude="two" * 1000)})
        assert "'twotwotwo" in error.problem
        assert "(3000 characters)" in error.problem


@pytest.mark.parametrize("name", ["nowhere.yaml", ".", "nul\0.yaml"])
def test_file_that_cannot_be_read_is_refused(tmp_path, name):
    assert "cannot be read" in refusal(load, f"{tmp_path}/{name}").problem


def test_swept_value_may_be_missing_from_the_scene_but_not_in_a_single_run(write):
    file = write(TEXT.replace("    amplitude: 2.0\n", ""))
    assert "drive.amplitude" not in load(file).scene.values
    assert "--set drive.amplitude=VALUE" in refusal(with_values, file).problem
    assert with_values(file, ["drive.amplitude=3"]).scene.values["drive.amplitude"] == 3.0


def test_settings_change_scene_and_solver_and_drop_the_sweep(write):
    config = with_values(write(TEXT), ["zone.half_angle = 20 deg", "solver.steps=50", "classify.epsilon_omega=0.1"])
    assert config.scene.values["zone.half_angle"] == pytest.approx(math.radians(20))
    assert config.scene.values["classify.epsilon_omega"] == 0.1
    assert config.solver.steps == 50
    assert not config.axes.sizes
    assert "sweep" not in config.source


@pytest.mark.parametrize(
    ("setting", "problem"),
    [
        ("drive.amplitude", "PATH=VALUE"),
        ("drive.amplitud=3", "did you mean `amplitude`?"),
        ("body.mass=-1", "greater than 0"),
        ("body.mass.kg=1", "cannot be set"),
        ("zones.3.mu_s=1", "list of zones"),
        ("scene=1", "a section with keys"),
    ],
)
def test_wrong_setting_is_refused(write, setting, problem):
    assert problem in str(refusal(with_values, write(TEXT), [setting]))


ROCKING = {"law": "sinusoidal", "amplitude": "60 deg", "frequency": "2 Hz"}


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"ring__radius": "43.378 mm"}, None),
        ({"ring__radius": 1.0}, None),
        ({"ring__radius": 43.378}, "scene.ring.radius is 43.378 m and scene.body.ball_radius is 0.01 m: is a unit"),
        ({"drive": ROCKING | {"amplitude": 60}}, "scene.drive.amplitude is 60 rad, 9.55 turns: is a unit missing?"),
        ({"drive": ROCKING | {"amplitude": "60 rad"}}, None),
        ({"drive": ROCKING | {"amplitude": "3600 deg"}}, None),
        ({"drive": ROCKING | {"amplitude": 6.0}}, None),
    ],
)
def test_number_whose_unit_may_be_missing_gives_one_warning(told, changes, text):
    found = told(load, {"scene": edited(**changes)})
    assert len(found) == (text is not None)
    assert all(text in message for message in found)


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("drive.amplitude=1", "1 rad, where the configuration says '60 deg'; was `--set \"{} deg\"` meant?"),
        ("ring.radius=0.05", "0.05 m, where the configuration says '50 mm'; was `--set \"{} mm\"` meant?"),
        *((setting, "") for setting in ("drive.amplitude=60 deg", "drive.amplitude=1 rad", "drive.amplitude=0")),
        *((setting, "") for setting in ("drive.frequency=3", "body.mass=0.08")),
        # A program gives numbers in SI units.
        (("drive.amplitude", 1.5), ""),
    ],
)
def test_plain_number_in_the_place_of_another_unit_is_told(told, setting, message):
    scene = edited(drive=ROCKING, ring__radius="50 mm")
    lines = [f"--set {setting} is taken as {message.format(setting)}"] if message else []
    assert told(with_values, {"scene": scene}, [setting]) == lines


def test_axis_of_a_file_with_angles_of_many_turns_gives_a_warning(told, write):
    rocking = TEXT.replace("law: arctan", "law: sinusoidal\n    frequency: 1")
    (found,) = told(load, write(rocking.replace("geomspace: [0.1, 10, 5]", "linspace: [10, 60, 5]")))
    assert "scene.drive.amplitude is 60 rad" in found


NEAR = "`amplitude`? (known: law", "`mu_k`? (known: mu_k"


@pytest.mark.parametrize(
    ("changes", "path", "hint"),
    [
        ({"drive": {"law": "constant", "speed": 1}}, "drive.speed", f"; did you mean {NEAR[0]}, amplitude)"),
        ({"drive": {"law": "sinusoidal", "rate": 1}}, "drive.rate", " (known: law, amplitude, frequency, phase)"),
        (
            {"drive": {"law": "formula", "theta": "A*t", "A": 1, "fil": 2}},
            "drive.fil",
            " (known: law, theta, velocity, A)",
        ),
        ({"friction": {"law": "coulomb", "rough": {"mu": 1}}}, "friction.rough.mu", f"; did you mean {NEAR[1]})"),
    ],
)
def test_an_unknown_key_lists_the_keys_of_the_law_that_is_given_only(changes, path, hint):
    error = refusal(read_scene, SCENE | changes)
    assert (error.path, error.problem) == (f"scene.{path}", f"unknown key{hint}")


@pytest.mark.parametrize(
    "config",
    [
        {"scene": SCENE | {"model": "my-disc"}},
        {"scene": SCENE | {"friction": {"law": "weakening", "v1": 1}}},
        {"scene": SCENE | {"drive": {"law": "my-run-up"}}},
        {"scene": SCENE, "solver": "heun"},
        {"scene": SCENE, "sweep": {"grid": {"friction.law": ["coulomb", "weakening"]}}},
    ],
)
def test_an_unknown_name_is_told_where_files_of_ones_own_are_named(config):
    assert "no file that the environment variable RINGSWEEP_LAWS names defines it" in refusal(load, config).problem


def test_a_number_under_mu_is_no_formula_where_another_law_is_named():
    error = refusal(read_scene, SCENE | {"friction": {"law": "stiction", "mu": 0.3}})
    assert (error.path, error.problem[:8]) == ("scene.friction.elsewhere.mu_s", "missing:")


@pytest.mark.parametrize("in_scene", ["elsewhere", "rest"])
@pytest.mark.parametrize("typed", ["elsewhere", "rest"])
class TestFrictionElsewhereHasTwoNames:
    def test_an_axis_keeps_the_name_that_was_typed(self, in_scene, typed, write):
        text = TEXT.replace("    rest:", f"    {in_scene}:").replace("drive.amplitude:", f"friction.{typed}.mu_k:")
        config = load(write(text.replace("[0.1, 10, 5]", "[0.1, 0.2, 5]")))
        assert list(config.axes.sizes) == [f"friction_{typed}_mu_k", "zone_half_angle"]
        assert load(config.source).axes.sizes == config.axes.sizes
        axes = {f"friction.{typed}.mu_k": [0.05, 0.1]}
        assert read_axes(yaml.safe_load(text)["scene"], axes).sizes == {f"friction_{typed}_mu_k": 2}

    def test_a_setting_changes_the_one_value(self, in_scene, typed, write):
        text = TEXT.replace("    rest:", f"    {in_scene}:")
        config = with_values(write(text), [f"friction.{typed}.mu_k=0.05"])
        assert config.scene.values[f"friction.{in_scene}.mu_k"] == 0.05
        assert f"friction.{in_scene}.mu_s" in refusal(with_values, write(text), [f"friction.{typed}.mu_s=a"]).path

    def test_a_fit_and_a_threshold_find_the_value(self, in_scene, typed, write):
        config, path = write(TEXT.replace("    rest:", f"    {in_scene}:")), f"friction.{typed}.mu_k"
        assert _ranges(load(config), f"{path}=0.1..0.2") == {f"friction.{in_scene}.mu_k": (0.1, 0.2)}
        problem = refusal(ringsweep.threshold, config, path, "separating", (0.2, 0.1)).problem
        assert problem == "0.1 is not greater than 0.2, where the interval begins"


def test_both_names_of_friction_elsewhere_at_once_are_one_error(write):
    both = TEXT.replace("    rest:", "    elsewhere: {mu_s: 0.2, mu_k: 0.1}\n    rest:")
    error = refusal(load, write(both))
    assert (error.path, error.line) == ("scene.friction.rest", 9)
    assert error.problem == "is another name of friction.elsewhere: keep one of them"
    axes = {"friction.rest.mu_k": [0.1], "friction.elsewhere.mu_s": [0.2], 1: [0.3]}
    assert refusal(read_axes, SCENE, axes).problem == error.problem


def test_each_unused_parameter_of_another_law_gives_one_warning(told):
    found = told(read_scene, edited(friction__law="coulomb"))
    unused = ["friction.alpha", "friction.rest.mu_s", "friction.rough.mu_s", "friction.v0"]
    assert sorted(message.split()[0] for message in found) == [f"scene.{path}" for path in unused]
    scene = read_scene(edited(friction__law="coulomb"))
    assert "friction.alpha" not in scene.values
    assert "friction.rest.mu_k" in refusal(read_axes, dict(scene.source), {"friction.rest.mu_s": [0.1]}).problem


def test_list_of_arcs_replaces_the_zone_and_without_a_drive_the_ring_rests():
    arcs = [{"center": f"{i} deg", "half_angle": "0.5 deg", "mu_s": 0.5, "mu_k": 0.3} for i in range(0, 200, 2)]
    scene = read_scene(edited(zone=None, friction__rough=None, zones=arcs))
    assert scene.structure.arcs == tuple(f"zones.{i}" for i in range(100))
    assert scene.values["zones.99.center"] == pytest.approx(math.radians(198))
    assert read_axes(dict(scene.source), {"zones.1.mu_s": [0.4, 0.5]}).sizes == {"zones_1_mu_s": 2}
    assert read_scene(edited(drive=None)).structure.drive == "none"


@pytest.mark.parametrize(
    ("changes", "path", "problem"),
    [
        ({"zones": [{"half_angle": 0.1, "mu_s": 0.5, "mu_k": 0.3}]}, "scene.zone", "beside zones"),
        ({"zone": None, "zones": []}, "scene.zones", "list of zones"),
        ({"zone": None, "zones": [{"mu_s": 0.5}], "friction__rough": None}, "scene.zones.0.mu_k", "missing"),
        ({"zone": None}, "scene.friction.rough.mu_s", "no zone"),
        ({"friction__rough": None}, "scene.friction.rough.mu_s", "missing"),
        ({"friction": None}, "scene.friction", "missing"),
        ({"model": None}, "scene.model", "missing: name a model"),
        ({"model": ["ring"]}, "scene.model", "is not a model"),
        ({"ring": None}, "scene.ring.radius", "body.beta"),
        ({"body__beta": 48.504}, "scene.body.beta", "beyond pi/2"),
        ({"body__beta": 0.5}, "scene.body.beta", "contradicts"),
        ({"drive": "arctan"}, "scene.drive", "section"),
        ({"drive": {"law": "table", "file": 3}}, "scene.drive.file", "file name"),
        ({"initial__phi": {"deg": 3}}, "scene.initial.phi", "is not a number"),
    ],
)
def test_wrong_scene_is_refused(changes, path, problem):
    error = refusal(read_scene, edited(**changes))
    assert error.path == path
    assert problem in error.problem


def table(write, rows, header="t (s), theta (rad)"):
    file = write("\n".join([header, *rows, ""]), "theta.csv")
    return edited(drive={"law": "table", "file": str(file)}, time__span=0.3), file


ROWS = ["-0.1, 0", "0.1, 0.5", "", "0.2, 0.8", "0.4, 0.9"]


def test_table_of_a_drive_replaces_its_file_name_in_the_source(write):
    scene, file = table(write, ROWS)
    first = read_scene(scene)
    file.unlink()
    assert first.source["drive"] == {
        "law": "table",
        "time": ["-0.1 s", "0.1 s", "0.2 s", "0.4 s"],
        "theta": ["0 rad", "0.5 rad", "0.8 rad", "0.9 rad"],
    }
    again = read_scene(first.source)
    np.testing.assert_equal(again.structure.table, first.structure.table)
    assert again.values["drive.amplitude"] == 1.0


def test_units_in_the_header_of_a_table_are_converted(write):
    scene, _ = table(write, ["0, 0", "100, 30", "200, 60", "400, 90"], header="time (ms), theta (deg)")
    times, angles, _ = read_scene(scene).structure.table
    np.testing.assert_allclose(times, [0, 0.1, 0.2, 0.4])
    np.testing.assert_allclose(angles, np.radians([0, 30, 60, 90]))


@pytest.mark.parametrize(
    ("rows", "header", "line", "problem"),
    [
        ([*ROWS, "0.3, 1"], "t, theta", 7, "does not come after"),
        (["0, 0", "0.1, x", "0.2, 0", "0.4, 0"], "t, theta", 3, "is not a number"),
        (["0, 0", "0.1, nan", "0.2, 0", "0.4, 0"], "t, theta", 3, "not finite"),
        (["0, 0", "0.1", "0.2, 0", "0.4, 0"], "t, theta", 3, "1 values under 2 columns"),
        (["0.1, 0", "0.2, 0", "0.3, 0", "0.4, 0"], "t, theta", 2, "begins at 0.1 s"),
        (ROWS[:3], "t, theta", None, "too few"),
        (ROWS, "t, phi", None, "columns t, theta"),
        (ROWS, "t (s), theta (V)", 1, "the unit 'V' does not fit: angle of the drive is in rad"),
        (ROWS, "t, theta deg", 1, "column 'theta deg': a name is expected, and behind it the unit in brackets"),
        (ROWS, "t, t", 1, "two columns have the name t"),
    ],
)
def test_error_in_a_table_names_its_line(write, rows, header, line, problem):
    scene, file = table(write, rows, header)
    error = refusal(load, {"scene": scene, "solver": SOLVER})
    assert problem in error.problem
    if line is not None:
        assert (error.file, error.line) == (str(file), line)


def test_table_shorter_than_the_run_is_refused(write):
    scene, _ = table(write, ROWS)
    scene["time"]["span"] = 1
    assert "table of the drive" in refusal(read_scene, scene).problem


def test_points_share_one_dimension_and_combine_with_a_grid(write):
    write("drive.amplitude, ring.radius\n1, 50 mm\n2, 0.06\n3, 70 mm\n", "cells.csv")
    config = load(write(TEXT.replace("    drive.amplitude: {geomspace: [0.1, 10, 5]}\n", "") + "  points: cells.csv\n"))
    assert config.axes.sizes == {"point": 3, "zone_half_angle": 2}
    dims, radii = config.axes.columns["ring.radius"]
    assert dims == ("point",)
    np.testing.assert_allclose(radii, [0.05, 0.06, 0.07])
    assert load(json.loads(json.dumps(config.source))).axes.sizes == config.axes.sizes
    assert "one place only" in refusal(load, write(TEXT + "  points: cells.csv\n")).problem
    file = write("drive.amplitude, ring.radius\n1, 50 mm\n2, 60 deg\n", "cells.csv")
    error = refusal(load, write(TEXT.split("  grid:")[0] + "  points: cells.csv\n"))
    assert (error.file, error.line, error.path) == (str(file), 3, "sweep.points.ring.radius.1")


def test_comma_joined_paths_vary_together_along_the_dimension_of_the_first():
    arcs = [{"center": centre, "half_angle": "10 deg", "mu_s": 0.5, "mu_k": 0.3} for centre in (0.0, 3.0)]
    scene = {name: part for name, part in SCENE.items() if name != "zone"} | {"zones": arcs}
    scene["friction"] = {name: value for name, value in SCENE["friction"].items() if name != "rough"}
    grid = {"zones.0.half_angle, zones.1.half_angle": ["10 deg", "20 deg"], "drive.amplitude": [1.0, 2.0, 3.0]}
    config = load({"scene": scene, "sweep": {"grid": grid}})
    assert config.axes.sizes == {"zones_0_half_angle": 2, "drive_amplitude": 3}
    for k in range(2):
        dims, values = config.axes.columns[f"zones.{k}.half_angle"]
        assert dims == ("zones_0_half_angle",)
        np.testing.assert_allclose(values, np.radians([10.0, 20.0]))
    Draft202012Validator(schema()).validate(config.source)
    for zone, problem in ((0, "one place only"), (2, "no such number")):
        grid = {f"zones.0.half_angle, zones.{zone}.half_angle": [0.1]}
        assert problem in refusal(load, {"scene": scene, "sweep": {"grid": grid}}).problem


def test_sequences_make_grid_axes_and_dataarrays_share_dimensions():
    axes = read_axes(
        edited(ring=None),
        {
            "drive.amplitude": np.linspace(1, 2, 3),
            "zone.half_angle": xr.DataArray([10.0, 20.0], dims="case", attrs={"units": "deg"}),
            "ring.radius": xr.DataArray([[0.05, 0.06, 0.07], [0.06, 0.07, 0.08]], dims=("case", "other")),
        },
    )
    assert axes.sizes == {"drive_amplitude": 3, "case": 2, "other": 3}
    np.testing.assert_allclose(axes.columns["zone.half_angle"][1], np.radians([10, 20]))
    assert axes.columns["ring.radius"][0] == ("case", "other")


SWEPT = "drive.amplitude", "ring.radius"


@pytest.mark.parametrize(
    ("axes", "problem"),
    [
        ({"drive.amplitud": [1]}, "did you mean `drive.amplitude`?"),
        ({"drive.amplitude": []}, "empty"),
        ({"drive.amplitude": [1, math.inf]}, "not finite"),
        ({"drive.amplitude": 3.0}, "list of values"),
        ({"drive.amplitude": "123"}, "list of values"),
        ({"drive.amplitude": np.ones((2, 2))}, "list of numbers"),
        ({"drive.amplitude": [[1, 2], [3, 4]]}, "is not a number"),
        ({"drive.amplitude": xr.DataArray(1.0)}, "without dimensions"),
        ({"drive.amplitude": xr.DataArray([1.0], dims="regime")}, "name of a variable"),
        ({path: xr.DataArray(np.ones(k), dims="p") for k, path in enumerate(SWEPT, 1)}, "2 values along p"),
        ({"friction.rough.mu_k": [0.1, 0.7]}, "exceeds mu_s"),
        ({3: [1]}, "no such number"),
        ({"drive.amplitude": range(10**9)}, "more than 1000000 values"),
        ({"drive.amplitude": np.broadcast_to(1.0, 10**9)}, "more than 1000000 values"),
        ({"drive.amplitude": xr.DataArray(np.broadcast_to(1.0, 10**9), dims="p")}, "more than 100000000 values"),
    ],
)
def test_wrong_axes_are_refused(axes, problem):
    assert problem in refusal(read_axes, SCENE, axes).problem


def test_solver_is_read_with_its_options():
    config = load({"scene": SCENE, "solver": {"method": "rk4", "steps": 10, "certify": False}})
    assert (config.solver.steps, config.solver.certify) == (10, False)
    assert load({"scene": SCENE, "solver": {"method": "implicit", "rtol": 1e-8}}).solver.rtol == 1e-8
    for solver, problem in (
        ("rk4", "missing: steps over the span of time (for example `steps: 5000`)"),
        ({"method": "rk4", "steps": 10, "certify": "yes"}, "true or false"),
    ):
        assert problem in refusal(load, {"scene": SCENE, "solver": solver}).problem


def test_what_a_program_puts_into_a_file_is_no_fault_of_the_file(write):
    file = write(TEXT)
    for part in ({"axes": {"drive.amplitud": [1]}}, {"solver": {"method": "rk5"}}, {"follow": "nothing"}):
        assert refusal(load, file, **part).file is None
    assert refusal(load, write(TEXT.replace("mass: 0.076", "mass: -1")), axes={"drive.amplitude": [1]}).line == 3


@pytest.mark.parametrize("solver", [3, ["rk4"]])
def test_sweep_names_a_solver_that_is_none(solver):
    found = refusal(ringsweep.sweep, SCENE, {}, solver=solver)
    assert found.path == "solver"
    assert "a section with keys is expected" in found.problem


def own_law(friction, swept):
    """Configuration with a law that the package does not have, and a sweep of one of its parameters."""
    rest = {"scale": 1.0} if friction["law"] == "table" else {"mu_s": 0.4, "mu_k": 0.3}
    rest = {"mu_k": 0.3} if "laws" in friction else {"mu_s": 0.4} if "at_rest" in friction else rest
    scene = edited(zone=None, friction={**friction, "rest": rest})
    return {"scene": scene, "sweep": {"grid": {swept: [1, 2]}}}


def test_schema_is_valid_and_accepts_valid_configurations(write):
    Draft202012Validator.check_schema(schema())
    validator = Draft202012Validator(schema())
    scene, _ = table(write, ROWS)
    arcs = [{"half_angle": 0.1, "mu_s": 0.5, "mu_k": 0.3}]
    for config in (
        load(write(TEXT)).source,
        {"scene": scene, "solver": SOLVER},
        {"scene": dict(read_scene(scene).source), "solver": SOLVER},
        {"scene": edited(zone=None, zones=arcs, friction__rough=None), "solver": SOLVER},
        {"scene": SCENE, "solver": SOLVER, "sweep": {"points": {"drive.amplitude": [1, "2"]}}},
        own_law({"law": "formula", "mu": "mu_s/(1 + delta*v)", "at_rest": "mu_s", "delta": "3 s/m"}, "friction.delta"),
        own_law({"law": "leine", "laws": {"leine": {"mu": "mu_k/(1 + d*v)", "at_rest": "mu_k"}}, "d": 3}, "friction.d"),
        own_law({"law": "table", "v": [0, "1 m/s"], "mu": [0.4, 0.3]}, "friction.rest.scale"),
    ):
        load(config)
        validator.validate(config)


@pytest.mark.parametrize("file", sorted(CONFIGS.rglob("*.yaml")), ids=lambda file: file.stem)
def test_every_configuration_in_configs_satisfies_the_schema(file):
    Draft202012Validator(schema()).validate(load(file).source)


@pytest.mark.parametrize(
    "changes", [{"body__mas": 1}, {"friction__law": 3}, {"body__mass": -1}, {"zones": []}, {"body": 3}]
)
def test_schema_refuses_wrong_keys_names_and_types(changes):
    assert not Draft202012Validator(schema()).is_valid({"scene": edited(**changes)})


def accepted_or_refused(call, *arguments):
    with contextlib.suppress(InputError):
        call(*arguments)


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.text(max_size=60)
    | st.text("{}[]:,-&*a!|>'\"%#? \n\t1", max_size=60)
    | st.just(TEXT).flatmap(
        lambda text: st.tuples(st.integers(0, len(text)), st.integers(0, 30), st.text(max_size=5)).map(
            lambda cut: text[: cut[0]] + cut[2] + text[cut[0] + cut[1] :]
        )
    )
)
def test_random_text_never_crashes_the_reader(tmp_path, text):
    file = tmp_path / "any.yaml"
    file.write_bytes(text.encode("utf-8", "surrogatepass"))
    accepted_or_refused(load, file)


@settings(max_examples=300, deadline=None)
@given(st.text(max_size=12) | st.from_regex(r"[0-9]{1,2} ?[a-zA-Zµ°%^*/·0-9 -]{0,8}", fullmatch=True))
def test_random_text_never_crashes_the_conversion_of_units(text):
    accepted_or_refused(quantity, text, Parameter("m/s", "speed"), "path")
    accepted_or_refused(quantity, text, Parameter("1", "ratio"), "path")


@pytest.mark.parametrize(
    ("unit", "expected"),
    [
        *(("m/s^2", "m s-2"), ("kg*m**2", "kg m2"), ("N s/m", "N s m-1"), ("1/m", "m-1"), ("Hz", "Hz")),
        *(("rad s-1", "rad s-1"), ("1", "1"), ("", "1")),
    ],
)
def test_units_of_files_have_the_spelling_of_cf(unit, expected):
    assert cf_units(unit) == expected
    assert Parameter(unit, "something").attributes["units"] == expected
    assert Variable(unit, "something").attributes["units"] == expected


def test_value_in_the_spelling_of_cf_is_not_rounded():
    for value in np.random.default_rng(0).uniform(-1e3, 1e3, 100).tolist():
        assert quantity(f"{value!r} rad s-1", Parameter("rad/s", "speed"), "path") == value
        assert quantity(f"{value!r} rad/s", Parameter("rad s-1", "speed"), "path") == value


def test_units_in_the_schema_and_in_messages_are_everyday_ones():
    assert "angular velocity of the body at launch, rad/s" in json.dumps(schema())
    assert "must be greater than 0 m/s" in refusal(read_scene, edited(friction__v0=0.0)).problem


def test_whole_parameter_refuses_fractions_and_is_an_integer_in_the_schema():
    whole = Parameter("1", "seed", default=0.0, whole=True)
    assert declared(RK4)["steps"].whole
    assert quantity("3", whole, "path") == 3.0
    assert "2.5 is not a whole number: seed must be one" in refusal(quantity, 2.5, whole, "path").problem
    assert read_axis({"linspace": [0, 9, 4]}, whole, "axis").tolist() == [0.0, 3.0, 6.0, 9.0]
    error = refusal(read_axis, {"linspace": [0, 9, 3]}, whole, "axis")
    assert "4.5 is not a whole number: seed must be one" in error.problem
    assert _number(whole)["anyOf"][0]["type"] == "integer"
    assert _number(Parameter("1", "seed"))["anyOf"][0]["type"] == "number"


def test_scene_in_the_place_of_a_configuration_is_refused_with_a_hint():
    assert refusal(load, SCENE).problem == "unknown section: it belongs under `scene`"


@pytest.mark.parametrize(
    ("section", "table", "path"),
    [
        ("friction", {"law": "table", "v": [0, 5e-324, 1], "mu": [0.3, 0.2, 0.1]}, "scene.friction.mu.1"),
        ("friction", {"law": "table", "v": [0, 0.1, 1e308], "mu": [0.3, 0.2, 0.1]}, "scene.friction.mu.2"),
        ("drive", {"law": "table", "time": [0, 1e-308, 0.1, 9], "theta": [0, 1, 2, 3]}, "scene.drive.theta.1"),
        ("drive", {"law": "table", "time": [0, 1, 2, 9], "theta": [0, 1e308, -1e308, 0]}, "scene.drive.theta.1"),
        ("drive", {"law": "table", "time": [0, 1, 2, 9], "theta": [0, 1, 2, 1e308]}, "scene.drive.theta.3"),
        ("friction", {"law": "table", "v": [0, 0.1, 2], "mu": [0.3, 0.2, 1e308]}, "scene.friction.mu.2"),
    ],
)
def test_table_whose_curve_overflows_is_refused_with_its_row(section, table, path):
    belt = {"model": "belt", "body": {"mass": 1.0}, "spring": {"stiffness": 2.0}, "time": {"span": 1.0}}
    others = {"friction": {"law": "coulomb", "mu_k": 0.1}} if section == "drive" else {"belt": {"velocity": 0.1}}
    error = refusal(load, {"scene": {**belt, **others, section: table}})
    assert "is too steep or too far" in error.problem
    assert error.path == path


def test_beginning_of_a_name_means_the_shortest_that_all_others_continue():
    assert nearest_name("t_sep", ["t_end", "t_separation", "t_separation_error"]) == "t_separation"
    assert nearest_name("phi_e", ["t_end", "phi_end_error", "phi_end"]) == "phi_end"


def test_result_of_a_sweep_without_axes_is_a_configuration_again(tmp_path):
    configuration = json.dumps({"scene": SCENE, "sweep": {}})
    xr.Dataset({"regime": 1}, attrs={"configuration": configuration}).to_netcdf(tmp_path / "one.nc")
    assert load(tmp_path / "one.nc").axes.sizes == {}
    assert refusal(load, {"scene": SCENE, "sweep": {}}).problem.startswith("empty")


def test_table_that_a_changed_result_names_is_read_with_its_name_told(write, tmp_path, caplog):
    scene, file = table(write, ROWS)
    ds = ringsweep.sweep(scene, {"zone.half_angle": [0.1]}, solver={"method": "rk4", "steps": 10}, progress=False)
    configuration = json.loads(ds.attrs["configuration"])
    configuration["scene"]["drive"] = {"law": "table", "file": str(file)}
    ds.attrs["configuration"] = json.dumps(configuration)
    netcdf.save(ds, tmp_path / "changed.nc")
    with caplog.at_level("INFO", "ringsweep"):
        load(tmp_path / "changed.nc")
    assert f"scene.drive.file: read from {file}" in caplog.messages
