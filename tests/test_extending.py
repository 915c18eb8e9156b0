"""The examples of docs/extending.md run, and do what the page claims."""

import os
import re
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest
import yaml
from matplotlib.figure import Figure
from refusals import refused

import ringsweep
from ringsweep.compile import SOURCES_DIGEST

DOCS = Path(__file__).parents[1] / "docs"
PAGE = (DOCS / "extending.md").read_text(encoding="utf-8")

#: Example files of the page, by name.
FILES = {path.name: path.read_text(encoding="utf-8") for path in sorted((DOCS / "examples").glob("my_*.py"))}

#: The picture of the page. It is no file of RINGSWEEP_LAWS.
PICTURE = FILES.pop("my_reactions.py")

#: The scene of the body on a disc, and the law in Python.
(ON_DISC,) = (yaml.safe_load(text) for text in re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL))
(IN_PYTHON,) = re.findall(r"```python\n(import ringsweep\n.*?)```", PAGE, re.DOTALL)

#: Beginning of the scripts below.
RUN = """
import numpy as np, ringsweep
from scipy import optimize
from ringsweep.errors import InputError

def run(scene, solver="auto"):
    return ringsweep.simulate(scene, solver=solver)

belt = {"model": "belt", "body": {"mass": 1.0}, "spring": {"stiffness": 2.0}, "belt": {"velocity": 0.1},
        "time": {"span": 30.0}}
disc = {"model": "disc", "body": {"mass": 0.1}, "ring": {"radius": 0.2}, "disc": {"slope": "40 deg"},
        "friction": {"law": "coulomb", "rest": {"mu_k": 0.3}}, "time": {"span": 20.0}}
# A drive that does not move, so that scenes with and without motion of the disc share kernels.
still = {"law": "run-up", "amplitude": 0.0, "tau": 1.0}
# Angular frequency of the body on its spring, rad/s.
w = np.sqrt(2.0)
"""


#: What the page says of the drag of the air.
DRAG = [
    ("K1*N1 - ", "K1*N1 - drag*radius*omega - "),
    ("    pull: Leaf\n", "    pull: Leaf\n    drag: Leaf\n"),
    ('{"disc.slope": slope}', '{"disc.slope": slope, "disc.drag": Parameter("N s/m", "drag of the air")}'),
    ("press, pull)\n", 'press, pull, values["disc.drag"])\n'),
    ('name = "disc"', 'name = "disc-in-air"'),
]


def files_in(folder, changes=()):
    """Write the example files to a folder and return their paths. A change is ``(name, old text, new text)``."""
    paths = []
    for name, text in FILES.items():
        for changed, old, new in changes:
            if changed == name:
                assert old in text
                text = text.replace(old, new)
        paths.append(folder / name)
        paths[-1].write_text(text, encoding="utf-8")
    return paths


def in_a_process(script, paths, cache, package_folder=Path(__file__).parents[1]):
    """Run a script in a new process, with own files and with a cache of its own."""
    environment = {
        **os.environ,
        "RINGSWEEP_LAWS": os.pathsep.join(map(str, paths)),
        "NUMBA_CACHE_DIR": str(cache),
        "PYTHONPATH": str(package_folder),
    }
    script = RUN + textwrap.dedent(script)
    # Elsewhere than in the checkout, whose package Python would find first.
    return subprocess.run(
        [sys.executable, "-c", script], env=environment, cwd=cache.parent, capture_output=True, text=True, check=False
    )


def test_page_names_every_example_file_and_quotes_the_disc_as_it_is():
    assert {f"examples/{name}" for name in (*FILES, "my_reactions.py")} <= set(re.findall(r"\((.*?)\)", PAGE))
    (quoted,) = re.findall(r"```python\n(@ring.body.*?)```", PAGE, re.DOTALL)
    assert quoted in FILES["my_disc.py"]


#: Claims of the page, each with a script that checks it.
CLAIMS = {
    "the law of Python with a very small v1 is stiction": f"""
{textwrap.indent(IN_PYTHON, " " * 8)}
        along, across = 9.81 * np.sin(np.radians(40.0)), 9.81 * np.cos(np.radians(40.0))
        breakaway = np.arcsin(0.15 * across / along)
        friction = {{"law": "weakening", "rest": {{"mu_s": 0.15, "mu_k": 0.1}}, "v1": 1e-9}}
        scene = {{**disc, "friction": friction, "drive": still, "time": {{"span": 0.3}}}}
        held, slid = (
            run({{**scene, "initial": {{"phi": phi, "omega": 0.0}}}}, "event")
            for phi in (breakaway - 1e-6, breakaway + 1e-6)
        )
        assert held["phi_end"] == held["phi"][0]
        assert slid["certified"] == 1 and slid["omega_end"] < -0.1
        begin, end = slid["phi"][0], slid["phi_end"]
        energy = 0.1 * slid["omega_end"] ** 2 - along * (np.cos(end) - np.cos(begin))
        assert abs(energy - 0.1 * across * (end - begin)) < 1e-6, energy.item()
    """,
    "a body under stiff bristles moves as under coulomb": """
        hard = {**belt, "time": {"span": 5.0}, "initial": {"x": 1.0, "velocity": 0.0}}
        # The body swings about mu_k m g / k until it has the speed of the belt. Then it sticks.
        t = (np.pi + np.arcsin(0.1 / (0.5095 * w))) / w
        known = 0.4905 + 0.5095 * np.cos(w * t) + 0.1 * (5.0 - t)
        soft, stiff = (
            abs(run({**hard, "friction": {"law": "dahl-ductile", "mu_k": 0.1, "sigma0": sigma0}})["x_end"] - known)
            for sigma0 in (1e3, 1e5)
        )
        assert stiff < 0.1 * soft < 0.01, (soft.item(), stiff.item())
    """,
    "the formula of the run-up moves the ring as its functions would": """
        known = {"law": "run-up", "amplitude": 2.0, "tau": 1.0}
        drives = known, {"law": "formula", "theta": "A*(t - tau*(1 - exp(-t/tau)))", "A": 2.0, "tau": 1.0}
        friction = {"law": "formula", "mu": "mu_k*v/sqrt(v**2 + v0**2)", "rest": {"mu_k": 0.1}, "v0": 0.01}
        smooth = {**disc, "friction": friction}
        ends = [run({**smooth, "drive": d}, {"method": "rk4", "steps": 4000})["phi_end"] for d in drives]
        assert abs(ends[0] - ends[1]) < 1e-9, ends
    """,
    "drag of the air is one more term of a balance": """
        scene = {**disc, "model": "disc-in-air", "disc": {"slope": 0.0, "drag": 0.1}, "time": {"span": 1.0}}
        scene |= {"friction": {"law": "coulomb", "rest": {"mu_k": 0.0}}, "initial": {"phi": 0.0, "omega": 3.0}}
        assert abs(run(scene, "event")["omega_end"] - 3.0 * np.exp(-1.0)) < 1e-9
    """,
    "the scene of the page is a scene of the disc": f"""
        from ringsweep.config import load
        assert load({{"scene": {ON_DISC["scene"]}}}).scene.structure.model == "disc"
    """,
    "a brake without servo action moves as one contact, and servo action opens a shoe": """
        friction = {"law": "weakening", "rest": {"mu_s": 0.4, "mu_k": 0.3}, "v1": 1.0}
        scene = {**disc, "friction": friction, "drive": {"law": "run-up", "amplitude": 0.5, "tau": 1.0}}
        scene |= {"initial": {"phi": 0.1, "omega": 3.0}, "time": {"span": 2.0}}
        weight, slope = 0.1 * 9.81, np.radians(40.0)
        brake = {**scene, "model": "brake", "gravity": 9.81 * np.sin(slope)}
        del brake["disc"]
        shoes = {"force": weight * np.cos(slope) / 2.0, "onto_1": 0.0, "onto_2": 0.0, "apart": 0.3}
        one, two = run(scene, "event"), run({**brake, "shoes": shoes}, "event")
        assert one["certified"] == two["certified"] == 1
        assert 0.1 < one["stick_time"] < 1.9
        for name in ("phi_end", "omega_end", "stick_time"):
            assert abs(one[name] - two[name]) < 1e-9, (name, one[name].item(), two[name].item())
        # The body turns with the drum until the friction that holds it is -force/onto_1: shoe 1 is lifted there. Both
        # states of stick meet there, too.
        turning = {"drive": {"law": "run-up", "amplitude": -0.5, "tau": 1.0}, "initial": {"phi": 0.0, "omega": 0.0}}
        turning |= {"friction": friction | {"rest": {"mu_s": 0.6, "mu_k": 0.5}}, "gravity": 9.81}
        def excess(t):
            angle = -0.5 * (t - 1.0 + np.exp(-t))
            return weight * np.sin(angle) - 0.1 * 0.2 * 0.5 * np.exp(-t) + 0.5
        end = optimize.brentq(excess, 0.0, 2.0, xtol=1e-14)
        shoes = {"force": 1.0, "onto_1": 2.0, "onto_2": 0.5, "apart": 0.3}
        found = run({**brake, **turning, "shoes": shoes}, "event")
        assert ringsweep.words(found["regime"]) == "separating" and found["separating_contact"] == 1
        assert found["certified"] == 1 and abs(found["t_end"] - end) < 1e-9, (found["t_end"].item(), end)
    """,
    "the method heun has order two": """
        initial = {"x": 0.5, "velocity": 0.0}
        scene = {**belt, "friction": {"law": "coulomb", "mu_k": 0.1}, "initial": initial, "time": {"span": 2.0}}
        # The body never has the speed of the belt: friction is constant.
        exact = 0.4905 + 0.0095 * np.cos(2.0 * w)
        coarse, fine = (run(scene, {"method": "heun", "steps": n})["x_end"] - exact for n in (200, 400))
        assert 3.8 < coarse / fine < 4.2, (coarse.item(), fine.item())
    """,
    "kernels and results with own files have another key than those without": f"""
        from ringsweep.compile import SOURCES_DIGEST
        assert SOURCES_DIGEST != {SOURCES_DIGEST!r}
    """,
    "a result names the files of what it used": """
        still_disc = {"friction": {"law": "weakening", "rest": {"mu_s": 0.15, "mu_k": 0.1}, "v1": 1.0}, "drive": still}
        exact = run({**disc, **still_disc, "time": {"span": 0.1}}, "event")
        assert exact.attrs["own_files"] == "my_disc.py, my_run_up.py", exact.attrs
        plain = run({**belt, "friction": {"law": "coulomb", "mu_k": 0.1}}, {"method": "heun", "steps": 20})
        assert plain.attrs["own_files"] == "my_heun.py"
    """,
}


@pytest.mark.slow
def test_examples_do_what_the_page_claims(tmp_path):
    """All claims in one process, so that each kernel is compiled once."""
    script = "".join(f"\n# {claim}\n{textwrap.dedent(body)}" for claim, body in CLAIMS.items())
    in_air = FILES["my_disc.py"]
    for old, new in DRAG:
        assert old in in_air
        in_air = in_air.replace(old, new)
    (tmp_path / "my_disc_in_air.py").write_text(in_air, encoding="utf-8")
    paths = [*files_in(tmp_path), tmp_path / "my_disc_in_air.py"]
    done = in_a_process(script, paths, tmp_path / "cache")
    assert done.returncode == 0, done.stderr[-2000:]


#: Changes that make an example incomplete, and what is said of each.
INCOMPLETE = [
    ("my_dahl.py", "@region_guard.implements(Ductile)", "", "friction law dahl-ductile has no presliding.region_guard"),
    ("my_run_up.py", "@jerk.implements(RunUp)", "", "drive run-up has no drives.jerk"),
    ("my_disc.py", "@ring.body(", "_ = dict(", "model disc: body_type OnDisc is not declared by ring.body"),
    ("my_disc.py", "K1*N1 - ", "K1*N2 - ", "N2 is not known"),
    ("my_disc.py", "K1*N1 - ", "K1 - ", "a balance is a sum of multiples of"),
    ("my_brake.py", "@contact.opening.implements(Shoes)", "", "model brake: Shoes has no contact.opening"),
    ("my_brake.py", 'offset="apart"', 'offset="appart"', "Shoes: offset names the field appart, which does not exist"),
    ("my_dahl.py", '"dahl-ductile"', '"lugre"', "there is a friction law lugre already"),
    ("my_run_up.py", "_jerk(drive, t)", "_jerk(drive)", "the arguments of jerk are"),
]


def changed(package, diff):
    """Apply the changes that the page shows to a copy of the package."""
    for section in re.split(r"^--- ", diff, flags=re.MULTILINE)[1:]:
        name, _, hunks = section.partition("\n")
        path = package.parent / name
        text = path.read_text(encoding="utf-8")
        for hunk in hunks.split("@@\n"):
            lines = hunk.splitlines(keepends=True)
            old, new = ("".join(line[1:] for line in lines if line[0] in kept) for kept in (" -", " +"))
            assert text.count(old) == 1, f"{name} does not have, once: {old}"
            text = text.replace(old, new)
        path.write_text(text, encoding="utf-8")


@pytest.mark.slow
def test_outcome_of_the_page_is_stored_and_drawn(tmp_path):
    """A body that swings without friction travels twice the width of a swing in each period."""
    package = tmp_path / "ringsweep"
    shutil.copytree(Path(__file__).parents[1] / "ringsweep", package, ignore=shutil.ignore_patterns("__pycache__"))
    (diff,) = re.findall(r"```diff\n(.*?)```", PAGE, re.DOTALL)
    changed(package, diff)
    script = """
        from scipy.special import ellipk
        widths = np.array([0.5, 1.0])
        periods = 4.0 * np.sqrt(0.2 / 9.81) * ellipk(np.sin(widths / 2) ** 2)
        scene = {"model": "ring-single-contact", "body": {"mass": 0.1}, "ring": {"radius": 0.2},
                 "friction": {"law": "coulomb", "rest": {"mu_k": 0.0}}, "time": {"span": 1.0}}
        points = {"initial.phi": ("case", widths), "time.span": ("case", 2.0 * periods)}
        import xarray as xr
        axes = {path: xr.DataArray(values, dims=dim) for path, (dim, values) in points.items()}
        found = ringsweep.sweep(scene, axes, "swings.nc", solver="event")
        assert found["travel"].attrs["units"] == "rad"
        assert np.allclose(found["travel"], 8.0 * widths, rtol=1e-3), found["travel"].values
        from ringsweep.cli import main
        raise SystemExit(main(["map", "swings.nc", "--var", "travel", "-o", "swings.png"]))
    """
    (tmp_path / "cache").mkdir()
    done = in_a_process(script, [], tmp_path / "cache", tmp_path)
    assert done.returncode == 0, done.stderr[-2000:]
    assert (tmp_path / "swings.png").stat().st_size > 0


def test_picture_of_the_page_shows_the_reactions_of_the_run(scene):
    run = ringsweep.simulate(scene)
    found = {}
    exec(PICTURE, found)
    ax = found["reactions"](run, ax=Figure().add_subplot())
    assert ax.get_xlabel().startswith("normal reaction at contact 1")
    drawn = np.concatenate([line.get_xydata() for line in ax.lines])
    drawn = drawn[np.isfinite(drawn).all(axis=1)]
    for reaction, column in zip((run.normal_1.values, run.normal_2.values), drawn.T, strict=True):
        assert set(column) == set(reaction)
    refused("has no", found["reactions"], run.drop_vars("normal_2"), ax=Figure().add_subplot())


@pytest.mark.slow
def test_incomplete_file_is_refused_in_one_line_that_names_what_is_missing(tmp_path):
    paths = []
    for number, (name, old, new, _) in enumerate(INCOMPLETE):
        folder = tmp_path / str(number)
        folder.mkdir()
        paths += [path for path in files_in(folder, [(name, old, new)]) if path.name == name]
    script = f"""
        from pathlib import Path
        from ringsweep.config.own import load_own_files
        for path in {list(map(str, paths))}:
            try:
                load_own_files([Path(path)])
            except InputError as error:
                print(error)
    """
    done = in_a_process(script, [], tmp_path / "cache")
    lines = done.stdout.splitlines()
    assert len(lines) == len(INCOMPLETE), done.stderr[-2000:]
    for line, path, (*_, message) in zip(lines, paths, INCOMPLETE, strict=True):
        assert line.startswith(f"RINGSWEEP_LAWS: {path}: ")
        assert message in line


@pytest.mark.slow
def test_branch_that_rk4_cannot_compile_is_told_by_file_line_and_cure(tmp_path):
    old = "    rest = 1.0 - share * z\n"
    new = old + "    if z > 0.0:\n        rest = 0.0 * rest\n"
    script = """
        friction = {"law": "dahl-ductile", "mu_k": 0.1, "sigma0": 1e3}
        try:
            run({**belt, "friction": friction}, {"method": "rk4", "steps": 10})
        except InputError as error:
            print(error)
    """
    done = in_a_process(script, files_in(tmp_path, [("my_dahl.py", old, new)]), tmp_path / "cache")
    assert done.stdout.startswith("RINGSWEEP_LAWS: does not compile: my_dahl.py, line"), done.stderr[-2000:]
    assert done.stdout.count("\n") == 1
    assert "use select in place of if" in done.stdout


#: Changes of the examples that Python takes and Numba does not, and what is told of them.
NOT_COMPILED = {
    "my_dahl.py": ("law.sigma0 / mu_k * sign\n    rest", "law.sigma / mu_k * sign\n    rest", "_bristle"),
    "my_run_up.py": ("rest = exp(-t / drive.tau)\n", "rest = exp(-t / drive.tau) * len(format('x'))\n", "_shape"),
}


@pytest.mark.slow
def test_no_message_of_numba_reaches_a_user(tmp_path):
    """A law and a drive that do not compile are told in one short line, under each method that takes them."""
    changes = [(name, old, new) for name, (old, new, _) in NOT_COMPILED.items()]
    script = """
        coulomb = {"law": "coulomb", "mu_k": 0.1}
        driven = {name: section for name, section in belt.items() if name != "belt"}
        scenes = [
            {**belt, "friction": {"law": "dahl-ductile", "mu_k": 0.1, "sigma0": 1e3}},
            {**driven, "friction": coulomb, "drive": {"law": "run-up", "amplitude": 0.1, "tau": 1.0}},
        ]
        for scene, methods in zip(scenes, (["implicit"], ["event"])):
            for method in (*methods, "auto", {"method": "rk4", "steps": 10}):
                try:
                    run(scene, method)
                except InputError as error:
                    print(error)
    """
    done = in_a_process(script, files_in(tmp_path, changes), tmp_path / "cache")
    assert done.returncode == 0, done.stderr[-2000:]
    lines = done.stdout.splitlines()
    assert len(lines) == 6
    assert "Unknown attribute 'sigma' of type Ductile" in lines[0]
    for k, (name, (_, _, function)) in enumerate(NOT_COMPILED.items()):
        for line in lines[3 * k : 3 * k + 3]:
            assert re.match(rf"RINGSWEEP_LAWS: does not compile: {name}, line \d+: {function}: ", line), line
            assert len(line) < 400


@pytest.mark.slow
def test_files_moved_into_the_package_register_what_they_hold(tmp_path):
    package = tmp_path / "ringsweep"
    shutil.copytree(Path(__file__).parents[1] / "ringsweep", package, ignore=shutil.ignore_patterns("__pycache__"))
    folders = {"my_dahl.py": "physics/friction", "my_disc.py": "models", "my_heun.py": "solvers"}
    for name, folder in folders.items():
        (package / folder / name).write_text(FILES[name], encoding="utf-8")
    script = """
        from ringsweep.config import schema
        from ringsweep.models import MODELS
        from ringsweep.physics.friction import LAWS
        from ringsweep.solvers import METHODS
        print(schema.__file__, "dahl-ductile" in LAWS, "disc" in MODELS, "heun" in METHODS)
    """
    done = in_a_process(script, [], tmp_path / "cache", tmp_path)
    assert done.stdout == f"{package / 'config' / 'schema.py'} True True True\n", done.stderr[-2000:]


@pytest.mark.slow
def test_law_of_an_imported_file_is_refused_since_edits_would_go_unnoticed(tmp_path):
    """The key of the cache of compiled code covers the package and the files of RINGSWEEP_LAWS."""
    (path,) = (path for path in files_in(tmp_path) if path.name == "my_dahl.py")
    script = f"""
        import sys
        sys.path.insert(0, {str(path.parent)!r})
        import my_dahl
        try:
            run({{**belt, "friction": {{"law": "dahl-ductile", "mu_k": 0.1, "sigma0": 100.0}}}})
        except InputError as error:
            print(error)
    """
    done = in_a_process(script, [], tmp_path / "cache")
    expected = "scene.friction.law: friction law dahl-ductile comes from the module my_dahl, whose file"
    assert done.stdout.startswith(expected), done.stderr
