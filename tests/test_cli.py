"""The command line: messages, exit status and files."""

import errno
import json
import os
import re
import shlex
import signal
import subprocess
import sys
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import yaml
from belts import on_belt, with_all_parts
from jsonschema import Draft202012Validator
from rings import TYPED

import ringsweep
from ringsweep.cli import main
from ringsweep.cli.parser import build_parser
from ringsweep.config import load
from ringsweep.config.schema import schema
from ringsweep.models import MODELS, parameters
from ringsweep.models.scene import Structure
from ringsweep.physics.drives import DRIVES
from ringsweep.physics.friction import LAWS, Dynamic, family_of
from ringsweep.quantities.variables import HISTORY, OUTCOMES
from ringsweep.report import text as report
from ringsweep.solvers import METHODS
from ringsweep.storage import netcdf

ROOT = Path(__file__).parents[1]

TEXT = TYPED.replace("    zone.half_angle: [2 deg, 0.5]\n", "")

SIGNED = {"Conventions": "CF-1.11", "ringsweep_version": "0"}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "case.yaml").write_text(TEXT)
    return tmp_path


def refused(capsys, *arguments):
    """The one line that a refused command prints."""
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("ringsweep: ")
    assert err.count("\n") == 1
    assert "Traceback" not in err
    return err


LONG = "n" * 300

#: Commands that are refused, and the message.
REFUSED = [
    ("simulate case.yaml --set drive.amplitude", "--set: 'drive.amplitude' is not of the form PATH=VALUE"),
    ("run case.yaml --set friction.rest.mu_s=0", "case.yaml, line 8: scene.friction.rest.mu_k: 0.1 exceeds mu_s"),
    ("run case.yaml --set velocity=2", "scene.velocity: unknown key; did you mean `drive.velocity`?"),
    ("run case.yaml --set spring.stiffness=2", "unknown key: model belt has `spring`, this is model ring"),
    ("run case.yaml --set body.mas=1", "--set body.mas=1: scene.body.mas: unknown key; did you mean `mass`?"),
    ("run case.yaml --dry-run --json", "--dry-run: measures threads of this machine, and prints text: leave "),
    ("run case.yaml --set mass=2", "scene.mass: unknown key; did you mean `body.mass`?"),
    ("run case.yaml --set friction.rough.mu=2", "scene.friction.rough.mu: unknown key; did you mean `mu_"),
    ("run case.yaml --set 'zone.half_angle=40 mm'", "the angle of an arc is its length divided by the radius"),
    ("run case.yaml --set zone.from=2", "a zone has a center, (from + to)/2"),
    ("run case.yaml --set drive.amplitude=2", "--set drive.amplitude=2: scene.drive.amplitude: is swept here"),
    ("map case.yaml", "case.yaml: is a configuration, not a result: `ringsweep run case.yaml`"),
    ("run case.yaml -o loop.nc", "loop.nc: is a symbolic link that leads to itself"),
    *((f"{verb} nowhere.nc", "nowhere.nc: does not exist") for verb in ("map", "plot", "info")),
    *(
        (f"{verb} {LONG}.yaml", "File name too long")
        for verb in ("init", "run", "simulate", "info", "map", "plot", "verify", "animate")
    ),
]


@pytest.mark.parametrize(("line", "problem"), REFUSED)
def test_mistake_gives_one_message_and_no_file(folder, capsys, line, problem):
    (folder / "loop.nc").symlink_to("loop.nc")
    assert problem in refused(capsys, *shlex.split(line))
    assert sorted(path.name for path in folder.iterdir()) == ["case.yaml", "loop.nc"]


@pytest.mark.parametrize("verb", ["run", "simulate", "precision"])
@pytest.mark.parametrize("output", ["nowhere/out.nc", "case.yaml/out.nc", ".", "out.png"])
def test_unwritable_output_is_refused_before_any_computation(folder, capsys, verb, output):
    assert output in refused(capsys, verb, "case.yaml", "-o", output)
    assert [file.name for file in folder.iterdir()] == ["case.yaml"]


@pytest.mark.parametrize(("verb", "draws"), [("run", "map"), ("simulate", "plot")])
def test_picture_that_cannot_be_written_does_not_undo_the_dataset(folder, monkeypatch, capsys, caplog, verb, draws):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("matplotlib.figure.Figure.savefig", full)
        assert main([verb, "case.yaml", "-o", "out.nc"]) == 0
    assert "wrote out.nc\n" in capsys.readouterr().out
    (warning,) = [record.getMessage() for record in caplog.records if "not drawn" in record.getMessage()]
    assert warning == (
        f"out.png is not drawn: [Errno 28] No space left on device (draw one with ringsweep {draws} out.nc)"
    )
    assert sorted(file.name for file in folder.iterdir()) == ["case.yaml", "out.nc"]
    assert main([draws, "out.nc"]) == 0
    assert (folder / "out.png").exists()


def test_file_that_is_no_result_is_not_replaced(folder, capsys):
    (folder / "notes.nc").write_text("mine")
    for options in ([], ["--fresh"]):
        assert "notes.nc" in refused(capsys, "run", "case.yaml", "-o", "notes.nc", *options)
    assert (folder / "notes.nc").read_text() == "mine"


def test_call_without_a_command_prints_help(capsys):
    assert main([]) == 2
    out, _ = capsys.readouterr()
    assert out.startswith("usage: ringsweep")
    assert "simulate" in out


THRESHOLD = "threshold", "case.yaml", "--path", "drive.amplitude", "--regime", "separating"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run"], "the following arguments are required: CONFIG.yaml"),
        (["run", "case.yaml", "--jobs", "0"], "argument --jobs: 0 is not allowed: a count must be at least 1"),
        (["run", "case.yaml", "--jobs", "two"], "argument --jobs: 'two' is not a number"),
        (["run", "case.yaml", "--jobs=1.5"], "argument --jobs: '1.5' is not a whole number"),
        (["plot", "run.nc", "--from", "1 m"], "argument --from: '1 m' has the wrong unit: the time is in s"),
        (["simulat", "my.yaml"], "; did you mean `simulate`?"),
        (["version"], "; did you mean `--version`?"),
        (["help"], "; did you mean `--help`?"),
        (["sweep", "my.yaml"], "; did you mean `run`?"),
        (["run", "case.yaml", "--dryrun"], "unrecognized arguments: --dryrun; did you mean --dry-run?"),
        (["map", "case.nc", "--units", "deg"], "unrecognized arguments: --units deg"),
        (["run", "case.yaml", "--set", "body.mass=1", "kg"], "arguments: kg; a value with a space needs quotes"),
        ([*THRESHOLD, "--from", "10", "rad/s"], "unrecognized arguments: rad/s; a value with a space needs quotes"),
        (["run", "case.yaml", "--set", "a=4", "b=2"], "b=2; each value has its own --set: --set b=2"),
    ],
)
def test_wrong_command_line_has_status_2_and_a_hint(capsys, arguments, message):
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    assert message in capsys.readouterr().err.splitlines()[-1]


def test_ends_in_the_wrong_order_are_told_with_their_unit(scene):
    with pytest.raises(ringsweep.InputError, match=r"1\.0472 rad/s is not greater than 5\.23599 rad/s"):
        ringsweep.threshold({"scene": scene}, "drive.amplitude", "separating", ("50 rpm", "10 rpm"))


def test_control_characters_of_a_file_and_of_a_name_are_escaped(folder, capsys):
    assert main(["run", "case.yaml", "-o", "out.nc"]) == 0
    with netcdf.open_dataset("out.nc") as result:
        crafted = result.load()
    crafted["drive_amplitude"].attrs["units"] = "\x1b[2Jrad/s"
    crafted.to_netcdf("crafted.nc")
    assert main(["info", "crafted.nc"]) == 0
    assert main(["map", "no\x1b[31m.nc"]) == 2
    out, err = capsys.readouterr()
    assert "\x1b" not in out + err
    assert "0.1 to 10 \\x1b[2Jrad/s" in out
    assert "no\\x1b[31m.nc: does not exist" in err


@pytest.mark.slow
def test_part_of_a_history_is_drawn(folder, capsys):
    assert main(["simulate", "case.yaml"]) == 0
    assert main(["plot", "case-run.nc", "--from", "1", "--to", "2000 ms", "-o", "part.png"]) == 0
    assert (folder / "part.png").stat().st_size > 1000
    capsys.readouterr()
    assert "has times from 0 to 10 s: none" in refused(capsys, "plot", "case-run.nc", "--from", "11")


def test_history_replaces_neither_the_run_that_it_continues_nor_its_scene(folder, capsys):
    (folder / "case.yaml").write_text(TEXT.replace("law: arctan", "law: constant"))
    assert main(["simulate", "case.yaml", "-q"]) == 0
    for again in (("case.yaml", "--set", "initial.from=case-run.nc"), ("case-run.nc", "-o", "./case-run.nc")):
        assert "case-run.nc: is the input" in refused(capsys, "simulate", *again)


def test_run_takes_values_from_the_command_line(folder):
    assert main(["run", "case.yaml", "--set", "time.span=2 s", "--set", "solver.steps=500", "-o", "short.nc"]) == 0
    configuration = json.loads(netcdf.load("short.nc").attrs["configuration"])
    assert configuration["scene"]["time"]["span"] == "2 s"
    assert configuration["solver"]["steps"] == 500


@pytest.mark.slow
def test_plot_draws_runs_and_precision_and_names_the_command_for_sweeps(folder, capsys, caplog):
    assert main(["simulate", "case.yaml"]) == 0
    assert "not certified" in capsys.readouterr().out.splitlines()[0]
    assert "limit of stability of rk4" in caplog.text
    history = "ringsweep: case-run.nc: is the time history of one run, not a sweep; ringsweep plot"
    assert refused(capsys, "map", "case-run.nc").startswith(history)
    Path("case-run.png").unlink()
    assert main(["plot", "case-run.nc"]) == 0
    assert main(["plot", "case-run.nc", "--kind", "phase", "-o", "portrait.svg"]) == 0
    assert capsys.readouterr().out == "wrote case-run.png\nwrote portrait.svg\n"
    assert Path("case-run.png").exists()
    assert Path("portrait.svg").exists()
    assert "there is no belt to draw" in refused(capsys, "plot", "case-run.nc", "--kind", "friction")
    assert "one friction law" in refused(capsys, "plot", "case-run.nc", "--law", "coulomb")
    assert main(["run", "case.yaml", "-q"]) == 0
    assert "ringsweep map case.nc draws it" in refused(capsys, "plot", "case.nc")
    work = {"time_per_run": ("contender", [1e-4, 1e-3]), "error_end": (("contender", "cell"), [[1e-3], [1e-6]])}
    netcdf.save(
        xr.Dataset(work, {"method": ("contender", ["rk4", "rk4"])}, netcdf.load("case-run.nc").attrs), "work.nc"
    )
    assert main(["plot", "work.nc"]) == 0
    assert "wrote work.png" in capsys.readouterr().out
    assert "--kind phase: is not for errors against run time" in refused(capsys, "plot", "work.nc", "--kind", "phase")


@pytest.mark.parametrize(
    ("error", "status", "message"),
    [
        (KeyboardInterrupt(), 130, "interrupted"),
        (KeyboardInterrupt(signal.SIGTERM), 143, "interrupted"),
        (OSError("disk\nfull"), 1, "OSError: disk full"),
        (OSError(errno.ENOSPC, "No space left on device"), 1, "No space left on device"),
        (OSError(errno.EIO, "Input/output error", "out.nc"), 1, "out.nc: Input/output error"),
    ],
)
def test_unexpected_error_and_interrupt_are_reported_in_one_line(monkeypatch, capsys, error, status, message):
    def fail(path):
        raise error

    monkeypatch.setattr("ringsweep.storage.netcdf.check", fail)
    assert main(["info", "out.nc"]) == status
    assert capsys.readouterr().err == f"ringsweep: {message}\n"


@pytest.mark.parametrize(("span", "status"), [("20 s", 0), ("2000 s", 1)])
@pytest.mark.parametrize("verb", ["run", "simulate"])
def test_status_is_1_if_every_run_has_failed(folder, capsys, verb, span, status):
    belt = on_belt({"law": "stiction", "mu_s": 0.15, "mu_k": 0.1}, 2.0, velocity=0.1, span=span)
    few = {"method": "auto", "max_steps": 1000}
    (folder / "belt.yaml").write_text(yaml.safe_dump({"scene": with_all_parts(belt), "solver": few}))
    assert main([verb, "belt.yaml", "-o", "out.nc"]) == status
    assert ("failed" in capsys.readouterr().out) == status
    assert (folder / "out.nc").exists()
    if verb == "run":
        assert main([verb, "belt.yaml", "-o", "out.nc"]) == status


CLOSED = {
    "nothing is read": ("<&-", "out.nc", 0),
    "errors have nowhere to go": ("2>&-", "out.nc", 0),
    "output has nowhere to go": (">&-", "out.nc", 0),
    "neither has": ("<&- >&- 2>&-", "out.nc", 0),
    "output is full": (">/dev/full", "out.nc", 1),
    "errors are full": ("2>/dev/full", "no.nc", 2),
}


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a shell and /dev/full")
@pytest.mark.parametrize(("redirection", "file", "status"), CLOSED.values(), ids=CLOSED)
def test_status_does_not_depend_on_closed_streams(folder, redirection, file, status):
    netcdf.save(xr.Dataset({"t_end": ("cell", np.zeros(2))}, attrs=SIGNED), "out.nc")
    command = f"{shlex.quote(sys.executable)} -m ringsweep verify {file} {redirection}"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, check=False)
    assert done.returncode == status
    assert "Exception" not in done.stderr
    assert "Traceback" not in done.stderr
    if redirection == ">/dev/full":
        assert done.stderr == "ringsweep: the output cannot be written: No space left on device\n"
    assert netcdf.check("out.nc")


ENVIRONMENTS = {
    "MPLBACKEND=nonsense": ("map", "matplotlib cannot be loaded (Key backend: 'nonsense'"),
    "NUMBA_NUM_THREADS=0": ("run", "): is one of its environment variables wrong?"),
    "NUMBA_DISABLE_JIT=1": ("run", "NUMBA_DISABLE_JIT: is set, but ringsweep runs compiled code only: unset it"),
}


@pytest.mark.slow
@pytest.mark.parametrize("variable", ENVIRONMENTS)
def test_environment_that_a_library_refuses_is_told_in_one_line(folder, variable):
    command, problem = ENVIRONMENTS[variable]
    netcdf.save(xr.Dataset({"t_end": ("cell", np.zeros(2))}, attrs=SIGNED), "out.nc")
    file = "out.nc" if command == "map" else "case.yaml"
    environment = os.environ | dict([variable.split("=")])
    call = [sys.executable, "-m", "ringsweep", command, file]
    done = subprocess.run(call, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1
    assert problem in done.stderr


def crafted(change):
    """A sweep on a belt in a file that ringsweep did not write: `change` takes the dataset."""
    scene = on_belt({"law": "stiction", "mu_s": 0.15, "mu_k": 0.1}, 2.0, velocity=0.1, span=20.0)
    grid = {"belt.velocity": [0.05, 0.1], "friction.mu_s": [0.12, 0.15, 0.2]}
    names = ("regime", "t_end", "x_end", "x_max", "certified", "steps")
    numbers = np.arange(6.0).reshape(2, 3)
    axes = {"belt_velocity": "belt.velocity", "friction_mu_s": "friction.mu_s"}
    ds = xr.Dataset(
        {name: (tuple(axes), (numbers % 2).astype(OUTCOMES[name].dtype), OUTCOMES[name].attributes) for name in names},
        {dim: (dim, grid[path], {"path": path, "units": "1"}) for dim, path in axes.items()},
        SIGNED,
    )
    ds.attrs["configuration"] = json.dumps({"scene": scene, "solver": "auto", "sweep": {"grid": grid}})
    change(ds).to_netcdf("crafted.nc")


CRAFTED = {
    "configuration that is a list": lambda ds: ds.assign_attrs(configuration="[1]"),
    "configuration that is a number": lambda ds: ds.assign_attrs(configuration="5"),
    "sweep that is a number": lambda ds: ds.assign_attrs(configuration='{"scene": {}, "sweep": 1}'),
    "text in x_end": lambda ds: ds.assign(x_end=ds.x_end.astype(str)),
    "text in regime": lambda ds: ds.assign(regime=ds.regime.astype(str)),
    "no x_max": lambda ds: ds.drop_vars("x_max"),
    "no regime": lambda ds: ds.drop_vars("regime"),
    "axis without its dimension": lambda ds: ds.isel(friction_mu_s=0, drop=True),
    "no cells": lambda ds: ds.isel(friction_mu_s=slice(0, 0)),
    "numbers at the end of doubles": lambda ds: ds.assign(x_end=ds.x_end * 0.0 + 1e308),
    "flags that nobody knows": lambda ds: ds.assign(regime=ds.regime + np.int8(90)),
}


@pytest.mark.parametrize("change", CRAFTED.values(), ids=CRAFTED)
def test_crafted_file_is_drawn_or_refused_in_one_line(folder, capsys, monkeypatch, change):
    crafted(change)
    monkeypatch.setattr("ringsweep.plots.save", lambda figure, path: Path(path).touch())
    commands = [["info"], ["verify"], ["map"], ["map", "--var", "x_end"], ["map", "--var", "x_max"], ["plot"]]
    commands += [["map", "--x", "belt_velocity"], ["run", "--set", "time.span=x"], ["simulate", "--set", "time.span=x"]]
    for verb, *options in commands:
        status = main([verb, "crafted.nc", *options])
        _, message = capsys.readouterr()
        assert status in (0, 2), message
        assert message.count("\n") == (status == 2), message


CONFIGS = Path(__file__).parents[1] / "configs"


def test_schema_file_in_configs_is_what_the_command_prints(capsys):
    """To update it: ringsweep schema > configs/schema.json."""
    assert main(["schema"]) == 0
    assert json.loads((CONFIGS / "schema.json").read_text()) == json.loads(capsys.readouterr().out)


@pytest.mark.parametrize("path", sorted(CONFIGS.rglob("*.yaml")), ids=lambda path: path.stem)
def test_every_configuration_in_configs_names_the_schema_on_its_first_line(path):
    first = path.read_text().splitlines()[0]
    assert (path.parent / first.removeprefix("# yaml-language-server: $schema=")).resolve() == CONFIGS / "schema.json"


@pytest.mark.parametrize("model", MODELS)
def test_init_writes_a_valid_configuration_and_replaces_no_file(folder, capsys, model):
    assert main(["init", "--model", model]) == 0
    config = load("my-sweep.yaml")
    assert config.scene.structure.model == model
    assert len(config.axes.sizes) == 2
    Draft202012Validator(schema()).validate(config.source)
    capsys.readouterr()
    assert "exists already" in refused(capsys, "init", "--model", model)
    assert "*.yaml" in refused(capsys, "init", "sweep.txt")
    assert "does not exist" in refused(capsys, "init", "nowhere/a.yaml")
    with pytest.raises(SystemExit):
        main(["init", "--help"])
    words = " ".join(capsys.readouterr().out.split())
    assert re.search(rf"\b{model}: (a drum|two balls|a mass on a spring|two coupled masses)", words)


def test_help_tells_the_exit_status_and_its_examples_parse(capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    out = capsys.readouterr().out
    assert "2 the input is wrong; 130 stopped by Ctrl-C; 143 stopped by SIGTERM" in out
    verbs = re.findall(r"^    (\w+)", out, re.M)
    assert {"init", "run", "map", "simulate", "plot", "precision", "info", "schema", "completion"} <= set(verbs)
    for verb in verbs:
        with pytest.raises(SystemExit):
            main([verb, "--help"])
        examples = re.findall(r"^  ringsweep (.+)$", capsys.readouterr().out, re.M)
        assert examples
        for example in examples:
            words = shlex.split(re.split(r"  +| >", example)[0])
            assert words[0] == verb
            build_parser().parse_args(words)


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish", "tcsh"])
def test_completion_script_knows_the_commands(capsys, shell):
    assert main(["completion", shell]) == 0
    printed = capsys.readouterr().out
    assert "simulate" in printed
    assert "precision" in printed


def test_help_does_not_import_numba():
    script = "import sys, ringsweep.cli as c\ntry: c.main(['--help'])\nexcept SystemExit: print('numba' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert "simulate" in done.stdout
    assert done.stdout.endswith("False\n")


@pytest.mark.parametrize("arguments", [["-q", "init"], ["init", "-q"], ["init", "new.yaml", "--quiet"]])
def test_quiet_command_prints_errors_only(folder, capsys, arguments):
    assert main(arguments) == 0
    assert capsys.readouterr() == ("", "")
    assert "exists already" in refused(capsys, *arguments)


def test_documentation_names_every_key_law_drive_and_variable():
    text = "".join((ROOT / "docs" / f"{name}.md").read_text() for name in ("scenes", "laws"))
    keys = {
        path
        for model, drive, arcs in product(MODELS, DRIVES, ((), ("zone",), ("zones.0",)))
        for law in MODELS[model].laws
        # A belt refuses zones under laws with a memory.
        if not (model == "belt" and arcs and family_of(LAWS[law]) is Dynamic)
        for path in parameters(Structure(model, law, drive, arcs, elsewhere="elsewhere"))
    }
    names = {*keys, *MODELS, *LAWS, *DRIVES, *METHODS, *OUTCOMES, *HISTORY} - {"auto"}
    bounded = {name for name in OUTCOMES if f"{name}_error" in OUTCOMES} - {"lyapunov"}  # its error is no bound
    for name in names - {f"{name}_error" for name in bounded}:
        # What is said of one mass holds for both of `belt-pair`.
        said = name[:-2] if name.endswith(("_1", "_2")) and name[:-2] in names else name
        mark = "±" if said in bounded else ""
        assert re.search(rf"`[^`]*\b{re.escape(said)}`{mark}", text), name


def test_dataset_with_the_suffix_of_another_kind_of_file_is_refused(folder, capsys):
    for command in (["run", "case.yaml"], ["simulate", "case.yaml"]):
        assert "is no name of a dataset: name it *.nc" in refused(capsys, *command, "-o", "case.txt")


def test_citation_of_an_older_file_has_its_version_model_and_law(capsys):
    (old,) = (ROOT / "tests" / "data").glob("sweep-0.1.0.nc")
    assert main(["info", str(old), "--cite"]) == 0
    first, *others = capsys.readouterr().out.splitlines()
    assert first == f"ringsweep {netcdf.load(old).attrs['ringsweep_version']}"
    assert any("Alaci" in line for line in others)
    assert len(others) == 2


def test_json_of_run_and_info_has_the_counts_and_nothing_else_on_stdout(folder, capsys):
    assert main(["run", "case.yaml", "--json", "--jobs", "1"]) == 0
    out, err = capsys.readouterr()
    assert "wrote case.nc" in err
    found = json.loads(out)
    assert sum(found["counts"]["regime"].values()) == 5
    assert found["dimensions"] == {"drive_amplitude": 5}
    assert main(["info", "case.nc", "--json", "--quiet"]) == 0
    assert json.loads(capsys.readouterr().out) == found


def test_info_of_one_cell_of_a_sample_has_its_probabilities(folder, capsys):
    grid = "\n  grid: {friction.rest.mu_k: [0.05, 0.1]}\n"
    sample = "  sample: {n: 8, of: {drive.amplitude: {uniform: [0.5, 10]}}}\n"
    (folder / "case.yaml").write_text(f"{TEXT.partition(chr(10) + 'sweep:')[0]}\nsweep:{grid}{sample}")
    assert main(["run", "case.yaml", "--json", "--jobs", "1"]) == 0
    whole = json.loads(capsys.readouterr().out)
    (axis,) = whole["coordinates"].values()
    assert axis == {"units": "1", "values": [0.05, 0.1]}
    assert np.sum(list(whole["probability"].values()), axis=0) == pytest.approx(1.0)
    for k, value in enumerate(axis["values"]):
        assert main(["info", "case.nc", "--json", "--sel", f"friction.rest.mu_k={value}"]) == 0
        one = json.loads(capsys.readouterr().out)
        assert one["probability"] == {word: shares[k] for word, shares in whole["probability"].items()}
    assert main(["info", "case.nc", "--sel", "friction.rest.mu_k=0.1"]) == 0
    assert "cells: 1\n" in capsys.readouterr().out


def test_simulate_takes_a_cell_of_a_file(folder, capsys):
    assert main(["run", "case.yaml", "--jobs", "1"]) == 0
    assert main(["simulate", "case.nc", "--sel", "drive.amplitude=1", "--set", "time.span=1"]) == 0
    run, cells = netcdf.load("case-run.nc"), netcdf.load("case.nc")
    scene = json.loads(run.attrs["configuration"])["scene"]
    assert scene["drive"]["amplitude"] == cells.drive_amplitude[2]
    assert scene["time"]["span"] == 1
    capsys.readouterr()
    assert "names a cell of a result file" in refused(capsys, "simulate", "case.yaml", "--sel", "drive.amplitude=1")


def test_info_tells_what_follows_lost_contacts_and_the_greatest_loads(tmp_path, capsys):
    values = {"regime": [1, 3, 3, 3], "aftermath": [0, 1, 1, 3], "gap_max": [0.0, 1e-5, 2e-3, 0.0168]}
    values |= {"separations": [0, 3, 1, 5], "impacts": [0, 59, 4, 100]}
    values |= {"jump_max": [50.0, 60.0, 357.8, 90.0], "certified": [1, 1, 1, 0]}
    ds = xr.Dataset(
        {name: ("drive_amplitude", np.array(column), OUTCOMES[name].attributes) for name, column in values.items()},
        {"drive_amplitude": [1.0, 2.0, 3.0, 4.0]},
    )
    print(report.in_lines(ds))
    text = capsys.readouterr().out
    assert "contacts:\n  held: 1 (25.0%)\n  recovered: 2 (50.0%)\n  tumbled: 1 (25.0%)\n" in text
    counts = "losses of contact 1 to 5, median 3; impacts 4 to 100, median 59"
    assert f"  in a run that has any: {counts}\n" in text
    assert "greatest: jump_max 358 rad s-2, gap_max 0.0168 m\n" in text
