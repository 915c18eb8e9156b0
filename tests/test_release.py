"""What a release says of itself is the same everywhere."""

import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest
import yaml

from ringsweep import cli
from ringsweep.config import load
from ringsweep.physics import PAPER
from ringsweep.physics.friction import LAWS, TRAITS

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_citation_has_the_version_and_the_license_of_the_package():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == PROJECT["version"]
    assert citation["license"] == PROJECT["license"]


def test_changelog_has_the_version_of_the_package_or_announces_it():
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"## [{PROJECT['version']}]" in changelog or f"contents of {PROJECT['version']}" in changelog


def test_every_citation_of_the_paper_is_in_its_list_and_vice_versa():
    text, listed = ((ROOT / "paper" / name).read_text(encoding="utf-8") for name in ("paper.md", "paper.bib"))
    cited = set(re.findall(r"@([a-z]+)", text.partition("# Summary")[2]))
    assert cited == set(re.findall(r"^@\w+\{(\w+),", listed, flags=re.MULTILINE))


def test_release_is_refused_until_one_command_fills_the_project_address(tmp_path):
    names = ("pyproject.toml", "CITATION.cff", ".ci/release")
    (tmp_path / ".ci").mkdir()
    for name in names:
        shutil.copy(ROOT / name, tmp_path / name)

    def release(*address):
        return subprocess.run([tmp_path / ".ci/release", *address], capture_output=True, text=True, check=False)

    refused = release()
    assert refused.returncode == 2
    assert "the project has no address yet" in refused.stderr
    assert release("ftp://a b").returncode == 2
    assert release("https://host.example/owner/ringsweep").returncode == 0
    filled = [(tmp_path / name).read_text(encoding="utf-8") for name in names[:2]]
    assert not any("placeholder.invalid" in text for text in filled)
    assert 'Issues = "https://host.example/owner/ringsweep/issues"' in filled[0]
    assert "repository-code: https://host.example/owner/ringsweep\n" in filled[1]


@pytest.mark.parametrize("file", sorted((ROOT / "tests/data").glob("*.nc")), ids=lambda file: file.name)
def test_kept_file_of_an_earlier_version_is_read(file, tmp_path, capsys):
    """Nine cells of a ring under stiction; the file has no seal, since it is older."""
    assert cli.main(["info", str(file)]) == 0
    assert "separating: 5 (55.6%)" in capsys.readouterr().out
    assert cli.main(["verify", str(file)]) == 2
    assert "no seal: another program or an older version wrote it" in capsys.readouterr().err
    assert cli.main(["map", str(file), "-o", str(tmp_path / "map.png")]) == 0
    config = load(file)
    assert config.axes.sizes == {"drive_amplitude": 3, "zone_half_angle": 3}
    assert config.scene.values["friction.rough.mu_s"] == 0.5


@pytest.mark.parametrize("law", LAWS)
def test_source_of_a_law_is_on_the_page_of_references(law):
    rows = (ROOT / "docs/references.md").read_text(encoding="utf-8").splitlines()
    (row,) = (row for row in rows if row.startswith("|") and f"`{law}`" in row)
    source = TRAITS[LAWS[law]].source
    if source == PAPER:
        assert "the paper" in row
    elif source:
        author, year = source.partition(",")[0].removesuffix(" et al."), re.search(r"\((\d{4})\)", source)
        assert author in row
        assert year[1] in row
