"""The version is the same everywhere, and a release is prepared by one command."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import tools.release.__main__ as release
from sim_action import __version__
from sim_action.cli import init
from tools.release.__main__ import ReleaseError, cut, moving_tag, notes, problems, read_version, sections

VERSION_FILE = "sim_action/core/version.py"

CHANGES = """\
# Changelog

A release is a tag such as v0.1.0; `v0` moves.

## Unreleased

### Changed

- A.

### Added

- B.

### Changed

- C.
"""
OLDER = "\n## 0.8.0 (2026-01-02)\n\nThe text of 0.8.0, with `v7`.\n"
PAGES = {
    VERSION_FILE: '"""Doc."""\n\n__version__ = "0.9.0"\n',
    "README.md": "uses: sim-action/sim-action@v0\nor `v0`, or sim-action/sim-action@<commit> # v0.9.0\n",
    "matrix/action.yml": "description: sim-action/sim-action/matrix@v0\n",
    "examples/.pre-commit-config.yaml": "- repo: https://github.com/sim-action/sim-action\n  rev: v0.9.0\n",
    "docs/docker.md": "docker run ghcr.io/sim-action/sim-action:0 run .\n",
    "Dockerfile": "RUN pip install sim-action==0.9.0\n",
    "plugins/a/pyproject.toml": 'name = "pytest-sim-action"\nversion = "0.9.0"\ndependencies = ["sim-action>=0.9.0"]\n',
    "other/pyproject.toml": 'name = "other"\nversion = "7"\n',
    "docs/other.md": "uses: actions/checkout@v7\nuses: octocat/sim-action@v7\npip install not-sim-actions==3\n",
    "tests/test_a.py": "# sim-action/sim-action@v7",
    ".venv/a.md": "sim-action/sim-action@v7",
}


@pytest.fixture
def root(tmp_path: Path) -> Path:
    for name, text in (PAGES | {"CHANGELOG.md": CHANGES + OLDER.replace("0.8.0", "0.9.0")}).items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    return tmp_path


def write(root: Path, name: str, text: str) -> None:
    (root / name).write_text(text, encoding="utf-8")


def found(root: Path, tag: str | None = None) -> list[str]:
    return [str(problem) for problem in problems(root, tag)]


def test_this_repository_agrees_on_its_version() -> None:
    assert found(release.ROOT) == []
    assert read_version() == __version__
    workflow = init.files("")[".github/workflows/simulation.yml"]
    assert re.findall(r"sim-action/sim-action@(\S+)", workflow) == [moving_tag(__version__)]


@pytest.mark.parametrize(("version", "tag"), [("0.9.0", "v0"), ("0.10.3", "v0"), ("1.0.0", "v1"), ("12.3.4", "v12")])
def test_the_tag_that_moves_has_the_first_number(version: str, tag: str) -> None:
    assert moving_tag(version) == tag


@pytest.mark.parametrize(
    ("name", "change", "line", "expected"),
    [
        ("README.md", ("action@v0", "action@v1"), 1, "v1 must be v0"),
        ("README.md", ("`v0`", "`v1`"), 2, "v1 must be v0"),
        ("README.md", ("# v0.9.0", "# v0.9.1"), 2, "v0.9.1 must be v0.9.0"),
        ("README.md", ("action@v0", "action/rostest@v0.9.0"), 1, "v0.9.0 must be v0"),
        ("matrix/action.yml", ("@v0", "@v2"), 1, "v2 must be v0"),
        ("examples/.pre-commit-config.yaml", ("v0.9.0", "v0.1.0"), 2, "v0.1.0 must be v0.9.0"),
        ("docs/docker.md", (":0", ":0.9.0"), 1, "0.9.0 must be 0"),
        ("Dockerfile", ("==0.9.0", "==0.8.0"), 1, "0.8.0 must be 0.9.0"),
        ("plugins/a/pyproject.toml", ('version = "0.9.0"', 'version = "0.9"'), 2, "0.9 must be 0.9.0"),
        ("plugins/a/pyproject.toml", (">=0.9.0", ">=0.8.0"), 3, "0.8.0 must be 0.9.0"),
        ("CHANGELOG.md", ("`v0`", "`v1`"), 3, "v1 must be v0"),
    ],
)
def test_each_disagreement_has_a_line(root: Path, name: str, change: tuple[str, str], line: int, expected: str) -> None:
    text = (root / name).read_text(encoding="utf-8")
    assert found(root) == []
    write(root, name, text.replace(*change, 1))
    assert found(root) == [f'{name}:{line}: {expected}, because __version__ is "0.9.0"']


def test_the_newest_section_of_the_changelog_has_the_version(root: Path) -> None:
    write(root, "CHANGELOG.md", CHANGES + OLDER)
    assert found(root) == ['CHANGELOG.md:19: the newest version is 0.8.0, but __version__ is "0.9.0"']
    write(root, "CHANGELOG.md", CHANGES)
    assert found(root) == []
    write(root, "CHANGELOG.md", "# Changelog\n")
    assert found(root) == ['CHANGELOG.md:1: there is neither a section "Unreleased" nor one for 0.9.0']


def test_a_tag_needs_its_version_its_section_and_nothing_unreleased(root: Path) -> None:
    assert found(root, "v0.9.1")[0] == f'{VERSION_FILE}:3: __version__ is "0.9.0", but the tag is v0.9.1'
    remedy = "run: python -m tools.release cut 0.9.0"
    assert found(root, "v0.9.0") == [f'CHANGELOG.md:5: "Unreleased" is not empty; {remedy}']
    write(root, "CHANGELOG.md", "# Changelog\n")
    assert f"CHANGELOG.md:1: there is no section for 0.9.0; {remedy}" in found(root, "v0.9.0")
    write(root, "CHANGELOG.md", "## 0.9.0 (2026-11-30)\n")
    assert found(root, "v0.9.0") == [f"CHANGELOG.md:1: CHANGELOG.md has no text for 0.9.0; {remedy}"]


def test_cut_makes_everything_agree_on_the_new_version(root: Path) -> None:
    write(root, "CHANGELOG.md", CHANGES + OLDER)
    assert found(root)
    changed = cut(root, "1.0.0", "2026-11-30")
    assert set(changed) == PAGES.keys() - {"docs/other.md", "other/pyproject.toml", "tests/test_a.py", ".venv/a.md"} | {
        "CHANGELOG.md"
    }
    assert found(root, "v1.0.0") == []
    assert read_version(root) == "1.0.0"
    for name in ("docs/other.md", "tests/test_a.py", ".venv/a.md"):
        assert (root / name).read_text(encoding="utf-8") == PAGES[name]
    changelog = (root / "CHANGELOG.md").read_text(encoding="utf-8")
    assert changelog.endswith(OLDER)
    assert [section.name for section in sections(changelog)] == ["Unreleased", "1.0.0", "0.8.0"]
    assert "## 1.0.0 (2026-11-30)\n" in changelog


def test_cut_refuses_an_old_version_and_nothing_to_release(root: Path) -> None:
    before = (root / "CHANGELOG.md").read_text(encoding="utf-8")
    for version in ("0.9.0", "0.8.9"):
        with pytest.raises(ReleaseError, match=f"CHANGELOG.md:19: 0.9.0 is not older than {version}"):
            cut(root, version, "2026-11-30")
    assert (root / "CHANGELOG.md").read_text(encoding="utf-8") == before
    cut(root, "0.10.0", "2026-11-30")
    with pytest.raises(ReleaseError, match='nothing under "## Unreleased"'):
        cut(root, "0.11.0", "2026-11-30")


def test_this_changelog_can_be_cut(tmp_path: Path) -> None:
    changelog = (release.ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    unreleased = next(section for section in sections(changelog) if section.name == "Unreleased").text
    if not unreleased:  # as right after a release
        unreleased = "### Added\n\n- Something.\n"
        changelog = changelog.replace("## Unreleased\n", f"## Unreleased\n\n{unreleased}", 1)
    (tmp_path / VERSION_FILE).parent.mkdir(parents=True)
    write(tmp_path, VERSION_FILE, (release.ROOT / VERSION_FILE).read_text(encoding="utf-8"))
    write(tmp_path, "CHANGELOG.md", changelog)
    major = int(__version__.partition(".")[0])
    cut(tmp_path, f"{major + 1}.0.0", "2026-11-30")
    assert found(tmp_path, f"v{major + 1}.0.0") == []
    released = notes((tmp_path / "CHANGELOG.md").read_text(encoding="utf-8"), f"{major + 1}.0.0")
    assert re.findall(r"\]\((?!https://)[^)]*\)", released) == []
    assert len(re.findall("^- ", released, re.MULTILINE)) == len(re.findall("^- ", unreleased, re.MULTILINE))
