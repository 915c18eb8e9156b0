"""The command line where it meets wrong input: one message, status 2, nothing left behind."""

import json
import re
import shlex
import subprocess
import sys
from itertools import product
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator

from ringsweep import cli
from ringsweep.cli import main
from ringsweep.config import load
from ringsweep.config.schema import schema
from ringsweep.models import MODELS, parameters
from ringsweep.models.scene import Structure
from ringsweep.physics.drives import DRIVES
from ringsweep.physics.friction import LAWS
from ringsweep.quantities.variables import HISTORY, OUTCOMES
from ringsweep.solvers import METHODS

ROOT = Path(__file__).parents[1]

TEXT = """\
scene:
  model: ring
  body: {mass: 0.076 kg, inertia: 4.47e-5 kg m^2, half_distance: 25 mm, ball_radius: 10 mm}
  ring: {radius: 43.378 mm}
  friction:
    law: bengisu-akay
    rough: {mu_s: 0.5, mu_k: 0.3}
    rest: {mu_s: 0.2, mu_k: 0.1}
    alpha: 1.0e5
    v0: 2.0e-6
  zone: {half_angle: 15 deg}
  drive: {law: arctan, amplitude: 2.0}
  time: {span: 10}
solver: {method: rk4, steps: 1000}
sweep:
  grid:
    drive.amplitude: {geomspace: [0.1, 10, 5]}
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "case.yaml").write_text(TEXT)
    return tmp_path


def refused(capsys, *arguments):
    """The one line that a refused command says."""
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("ringsweep: ")
    assert err.count("\n") == 1
    assert "Traceback" not in err
    return err


WRONG = {
    "unknown key": ("{radius:", "{radus:", 4, "did you mean `radius`?"),
    "missing key": ("    v0: 2.0e-6\n", "", 5, "scene.friction.v0: missing"),
    "wrong unit": ("0.076 kg", "0.076 s", 3, "scene.body.mass"),
    "degrees taken for radians": ("15 deg", "15", 11, "was `15 deg` meant?"),
    "negative mass": ("0.076 kg", "-0.076", 3, "greater than 0 kg"),
    "kinetic beyond static": ("mu_k: 0.1", "mu_k: 0.4", 8, "0.4 exceeds mu_s"),
    "no stiction band": ("2.0e-6", "0", 10, "scene.friction.v0"),
    "ring too small": ("43.378 mm", "35 mm", 4, "scene.ring.radius"),
    "axis of nothing": ("drive.amplitude:", "drive.frequency:", 17, "sweep.grid.drive.frequency"),
    "empty axis": ("{geomspace: [0.1, 10, 5]}", "[]", 17, "empty"),
    "not a number": ("span: 10", "span: .nan", 13, "scene.time.span"),
    "infinite": ("span: 10", "span: .inf", 13, "scene.time.span"),
    "a tag": ("0.076 kg", "!!python/object/apply:os.system [ls]", 3, "tag"),
    "contradiction in a cell": (
        "drive.amplitude: {geomspace: [0.1, 10, 5]}",
        "friction.rest.mu_s: [1, 0]",
        8,
        "a cell",
    ),
}


@pytest.mark.parametrize(("old", "new", "line", "problem"), WRONG.values(), ids=WRONG)
def test_wrong_input_ends_with_one_message_and_no_file(folder, capsys, old, new, line, problem):
    (folder / "case.yaml").write_text(TEXT.replace(old, new))
    message = refused(capsys, "run", "case.yaml")
    assert f"case.yaml, line {line}: " in message
    assert problem in message
    assert [file.name for file in folder.iterdir()] == ["case.yaml"]


def test_a_yaml_bomb_is_refused(folder, capsys):
    levels = [f"x{i + 1}: &x{i + 1} [{', '.join([f'*x{i}'] * 9)}]" for i in range(9)]
    (folder / "case.yaml").write_text("\n".join(["x0: &x0 [lol]", *levels]))
    assert "aliases" in refused(capsys, "run", "case.yaml")


def test_a_table_that_runs_backwards_is_refused_with_its_own_line(folder, capsys):
    (folder / "theta.csv").write_text("t,theta\n0,0\n1,1\n0.5,2\n20,3\n")
    (folder / "case.yaml").write_text(TEXT.replace("law: arctan", "law: table, file: theta.csv"))
    assert "theta.csv, line 4: scene.drive.time.2: 0.5 s does not come after 1 s" in refused(capsys, "run", "case.yaml")


@pytest.mark.parametrize("verb", ["run", "simulate"])
@pytest.mark.parametrize("output", ["nowhere/out.nc", "case.yaml/out.nc", ".", "out.png"])
def test_an_output_that_cannot_be_written_is_refused_before_any_work(folder, capsys, verb, output):
    assert output in refused(capsys, verb, "case.yaml", "-o", output)
    assert [file.name for file in folder.iterdir()] == ["case.yaml"]


def test_a_file_that_is_no_result_is_not_replaced(folder, capsys):
    (folder / "notes.nc").write_text("mine")
    for options in ([], ["--fresh"]):
        assert "notes.nc" in refused(capsys, "run", "case.yaml", "-o", "notes.nc", *options)
    assert (folder / "notes.nc").read_text() == "mine"


def test_a_wrong_setting_is_refused_with_what_was_typed(folder, capsys):
    message = refused(capsys, "simulate", "case.yaml", "--set", "body.mas=1")
    assert "--set body.mas=1: scene.body.mas: unknown key; did you mean `mass`?" in message


def test_a_single_run_needs_a_value_for_what_is_swept(folder, capsys):
    (folder / "case.yaml").write_text(TEXT.replace(", amplitude: 2.0", ""))
    assert "--set drive.amplitude=VALUE" in refused(capsys, "simulate", "case.yaml")


@pytest.mark.parametrize("verb", ["map", "info"])
def test_a_result_that_is_not_there_is_refused(folder, capsys, verb):
    assert "nowhere.nc" in refused(capsys, verb, "nowhere.nc")


def test_no_command_at_all_is_answered_by_help(capsys):
    assert main([]) == 2
    out, _ = capsys.readouterr()
    assert out.startswith("usage: ringsweep")
    assert "simulate" in out


def test_a_value_that_wants_quotes_is_told_so(folder, capsys):
    with pytest.raises(SystemExit):
        main(["simulate", "case.yaml", "--set", "drive.amplitude=1", "rad/s"])
    assert "unrecognized arguments: rad/s; what has a space wants quotes" in capsys.readouterr().err


def test_a_run_that_is_not_certified_says_so(folder, capsys, caplog):
    assert main(["simulate", "case.yaml"]) == 0
    assert "not certified" in capsys.readouterr().out.splitlines()[0]
    assert "limit of stability of rk4" in caplog.text


def test_a_launch_that_cannot_be_is_told_from_a_run(folder, capsys, caplog):
    """At the top, at rest, the body falls off at once."""
    wrong = ["initial.phi=180 deg", "solver.method=rk4"]
    assert main(["simulate", "case.yaml", *(word for setting in wrong for word in ("--set", setting))]) == 0
    assert "separating" in capsys.readouterr().out
    assert "the run ends at t = 0" in caplog.text


def test_a_history_is_no_map_and_the_message_names_the_file(folder, capsys):
    assert main(["simulate", "case.yaml", "-q"]) == 0
    capsys.readouterr()
    assert refused(capsys, "map", "case-run.nc").startswith("ringsweep: case-run.nc: is the time history of one run")


@pytest.mark.parametrize("arguments", [["rum"], ["run"], ["run", "case.yaml", "--jobs", "0"]])
def test_a_wrong_command_line_has_status_2(capsys, arguments):
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2


@pytest.mark.parametrize(
    ("error", "status", "message"),
    [(KeyboardInterrupt(), 130, "interrupted"), (OSError("disk\nfull"), 1, "OSError: disk full")],
)
def test_any_other_end_is_told_in_one_line(monkeypatch, capsys, error, status, message):
    def fail(path):
        raise error

    monkeypatch.setattr("ringsweep.storage.netcdf.open_dataset", fail)
    assert main(["info", "out.nc"]) == status
    assert capsys.readouterr().err == f"ringsweep: {message}\n"


def test_the_schema_is_printed_as_json(capsys):
    assert main(["schema"]) == 0
    assert json.loads(capsys.readouterr().out)["title"] == "ringsweep configuration"


CONFIGS = Path(__file__).parents[1] / "configs"


def test_the_schema_that_editors_use_is_current():
    """After a change: ringsweep schema > configs/schema.json."""
    assert json.loads((CONFIGS / "schema.json").read_text()) == json.loads(json.dumps(schema()))


@pytest.mark.parametrize("path", sorted(CONFIGS.rglob("*.yaml")), ids=lambda path: path.stem)
def test_every_configuration_names_it_on_its_first_line(path):
    first = path.read_text().splitlines()[0]
    assert (path.parent / first.removeprefix("# yaml-language-server: $schema=")).resolve() == CONFIGS / "schema.json"


@pytest.mark.parametrize("model", ["ring", "belt"])
def test_a_new_configuration_is_valid_and_replaces_nothing(folder, capsys, model):
    assert main(["init", "--model", model]) == 0
    config = load("my-sweep.yaml")
    assert config.scene.structure.model == model
    assert len(config.axes.sizes) == 2
    Draft202012Validator(schema()).validate(config.source)
    capsys.readouterr()
    assert "is there already" in refused(capsys, "init", "--model", model)
    assert "*.yaml" in refused(capsys, "init", "sweep.txt")
    assert "cannot be written" in refused(capsys, "init", "nowhere/a.yaml")


def test_every_command_shows_examples_that_parse(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    verbs = re.findall(r"^    (\w+)", capsys.readouterr().out, re.M)
    assert {"init", "run", "map", "simulate", "precision", "info", "schema", "completion"} <= set(verbs)
    for verb in verbs:
        with pytest.raises(SystemExit):
            main([verb, "--help"])
        examples = re.findall(r"^  ringsweep (.+)$", capsys.readouterr().out, re.M)
        assert examples
        for example in examples:
            words = shlex.split(re.split(r"  +| >", example)[0])
            assert words[0] == verb
            cli._parser().parse_args(words)


@pytest.mark.parametrize("shell", ["bash", "zsh", "tcsh"])
def test_completion_knows_every_command(capsys, shell):
    assert main(["completion", shell]) == 0
    printed = capsys.readouterr().out
    assert "simulate" in printed
    assert "precision" in printed


def test_quiet_leaves_only_what_is_wrong(folder, capsys):
    assert main(["init", "-q"]) == 0
    assert capsys.readouterr() == ("", "")
    assert "is there already" in refused(capsys, "init", "-q")


def test_help_comes_without_the_weight_of_solvers():
    script = "import sys, ringsweep.cli as c\ntry: c.main(['--help'])\nexcept SystemExit: print('numba' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert "simulate" in done.stdout
    assert done.stdout.endswith("False\n")


@pytest.mark.parametrize("arguments", [["-q", "init"], ["init", "-q"], ["init", "new.yaml", "--quiet"]])
def test_quiet_may_be_asked_for_before_the_command_and_after_it(folder, capsys, arguments):
    assert main(arguments) == 0
    assert capsys.readouterr() == ("", "")


def test_the_pages_name_every_key_law_drive_and_number():
    """What can be typed, and what comes back, is somewhere to be read."""
    text = "".join((ROOT / "docs" / f"{name}.md").read_text() for name in ("scenes", "laws"))
    keys = {
        path
        for model, drive, arcs in product(MODELS, DRIVES, ((), ("zone",), ("zones.0",)))
        for law in MODELS[model].laws
        for path in parameters(Structure(model, law, drive, arcs))
    }
    for name in {*keys, *MODELS, *LAWS, *DRIVES, *METHODS, *OUTCOMES, *HISTORY} - {"auto"}:
        assert re.search(rf"`[^`]*\b{re.escape(name)}`", text), name
