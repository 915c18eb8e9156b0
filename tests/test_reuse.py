"""Cells that an earlier sweep holds are taken from there, and no others are."""

import numpy as np
import pytest

import ringsweep
from ringsweep import cli
from ringsweep.errors import InputError
from ringsweep.storage import netcdf
from ringsweep.storage.partial import Partial

AMPLITUDES, WIDTHS = np.linspace(0.5, 4.5, 5), np.radians([10.0, 20.0, 30.0])
COARSE = {"drive.amplitude": AMPLITUDES, "zone.half_angle": WIDTHS}


@pytest.fixture(scope="module")
def earlier(scene, tmp_path_factory):
    """File of a sweep of 5 x 3 cells."""
    path = tmp_path_factory.mktemp("earlier") / "coarse.nc"
    ringsweep.sweep(scene, COARSE, path, progress=False).close()
    return path


@pytest.fixture
def computed(monkeypatch):
    """How many cells were handed over at a time, computed or taken."""
    counts = []
    put = Partial.put
    monkeypatch.setattr(Partial, "put", lambda self, p, *rest: (counts.append(len(p)), put(self, p, *rest)))
    return counts


def taken(scene, axes, earlier, tmp_path, caplog, **options):
    """How many cells of a sweep are taken from the earlier file; the sweep must be what it is without."""
    with caplog.at_level("INFO", logger="ringsweep"):
        found = ringsweep.sweep(scene, axes, tmp_path / "new.nc", reuse=earlier, progress=False, **options)
    alone = ringsweep.sweep(scene, {name: found[name.replace(".", "_")].values for name in axes}, progress=False)
    for name in alone.data_vars:
        assert found[name].values.tobytes() == alone[name].values.tobytes(), name
    found.close()
    (line,) = [record.getMessage() for record in caplog.records if "taken from" in record.getMessage()]
    return int(line.split()[0])


def test_a_finer_grid_takes_the_cells_that_it_shares(scene, earlier, tmp_path, caplog):
    finer = {"drive.amplitude": np.linspace(0.5, 4.5, 9), "zone.half_angle": WIDTHS}
    assert taken(scene, finer, earlier, tmp_path, caplog) == 15


def test_a_wider_grid_does_in_whatever_order(scene, earlier, tmp_path, caplog):
    wider = {"zone.half_angle": [np.radians(25.0), *WIDTHS[::-1]], "drive.amplitude": [9.0, *AMPLITUDES[1:]]}
    assert taken(scene, wider, earlier, tmp_path, caplog) == 12


def test_a_grid_with_a_further_axis_does_where_that_has_the_value_of_the_scene(scene, earlier, tmp_path, caplog):
    further = {"drive.amplitude": AMPLITUDES[:2], "initial.omega": [0.0, 1.0], "zone.half_angle": WIDTHS}
    assert taken(scene, further, earlier, tmp_path, caplog) == 6


def test_a_line_through_the_earlier_grid_does(scene, earlier, tmp_path, caplog):
    along = scene | {"zone": {"half_angle": WIDTHS[1]}}
    assert taken(along, {"drive.amplitude": AMPLITUDES}, earlier, tmp_path, caplog) == 5


def test_values_that_differ_by_rounding_are_those_of_the_earlier_file(scene, earlier, tmp_path):
    """Else two spacings of one axis would share hardly a cell; the file then says which values they are."""
    nudged = AMPLITUDES * (1.0 + 4e-16)
    assert (nudged != AMPLITUDES).any()
    found = ringsweep.sweep(
        scene, COARSE | {"drive.amplitude": nudged}, tmp_path / "new.nc", reuse=earlier, progress=False
    )
    np.testing.assert_array_equal(found["drive_amplitude"], AMPLITUDES)
    found.close()
    again = ringsweep.run(tmp_path / "new.nc", progress=False)
    np.testing.assert_array_equal(again["drive_amplitude"], AMPLITUDES)


def test_points_take_cells_of_a_grid_and_a_grid_those_of_points(scene, earlier, tmp_path, caplog):
    points = {"drive.amplitude": [0.5, 1.5, 1.6], "zone.half_angle": [*WIDTHS[:2], WIDTHS[2]]}
    config = {"scene": scene, "sweep": {"points": points}}
    with caplog.at_level("INFO", logger="ringsweep"):
        ringsweep.run(config, tmp_path / "points.nc", reuse=earlier, progress=False).close()
        ringsweep.sweep(scene, COARSE, tmp_path / "grid.nc", reuse=tmp_path / "points.nc", progress=False).close()
    lines = [record.getMessage() for record in caplog.records if "taken from" in record.getMessage()]
    assert [line.split(" cells")[0] for line in lines] == ["2 of 3", "2 of 15"]


def test_a_sweep_through_laws_does_whatever_only_the_others_need(scene, earlier, tmp_path, caplog):
    laws = scene | {"friction": scene["friction"] | {"alpha": 1e3}}
    axes = COARSE | {"friction.law": ["stiction", "coulomb"]}
    assert taken(laws, axes, earlier, tmp_path, caplog) == 15


def test_one_law_takes_its_cells_of_a_sweep_through_laws(scene, tmp_path, caplog):
    friction = {"friction": scene["friction"] | {"alpha": 1e3}}
    axes = {"drive.amplitude": AMPLITUDES, "friction.law": ["coulomb", "stiction"], "friction.alpha": [1e3, 2e3]}
    with pytest.raises(InputError, match="no such number"):
        ringsweep.sweep(scene | friction, axes, progress=False)
    ringsweep.sweep(
        scene, {"friction.law": ["coulomb", "stiction"], **COARSE}, tmp_path / "l.nc", progress=False
    ).close()
    assert taken(scene, COARSE, tmp_path / "l.nc", tmp_path, caplog) == 15


def test_nothing_is_computed_that_the_file_holds(scene, earlier, tmp_path, computed):
    ringsweep.sweep(scene, COARSE, tmp_path / "new.nc", reuse=earlier, progress=False).close()
    assert computed == [15]


@pytest.mark.parametrize(
    ("change", "solver", "problem"),
    [
        ({"time": {"span": "5 s"}}, "auto", "scene.time.span was 4.0, is 5.0"),
        ({"drive": {"law": "constant", "amplitude": 1.0}}, "auto", "scene.drive.law was arctan, is constant"),
        ({}, {"method": "event", "rtol": 1e-8}, "solver was"),
    ],
)
def test_a_file_of_another_scene_or_solver_is_refused_by_what_differs(scene, earlier, change, solver, problem):
    with pytest.raises(InputError, match="has no cell of this sweep") as refusal:
        ringsweep.sweep(scene | change, COARSE, solver=solver, reuse=earlier, progress=False)
    assert problem in str(refusal.value)


def test_a_file_of_another_version_is_refused(scene, earlier, tmp_path, monkeypatch):
    from ringsweep.runs import reuse

    known = reuse.identity
    monkeypatch.setattr(reuse, "identity", lambda config: known(config) | {"sources": "others"})
    with pytest.raises(InputError, match="another version"):
        ringsweep.sweep(scene, COARSE, reuse=earlier, progress=False)


def test_a_history_is_refused(scene, tmp_path, earlier, capsys):
    netcdf.save(ringsweep.simulate(scene), tmp_path / "history.nc")
    output = ["-o", str(tmp_path / "new.nc")]
    assert cli.main(["run", str(earlier), *output, "--reuse", str(tmp_path / "history.nc")]) == 2
    assert "history.nc: holds no sweep whose cells could be reused" in capsys.readouterr().err
