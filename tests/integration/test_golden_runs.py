"""`run --update-golden` writes what later runs are held against, in the workspace alone."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from sim_action.engines import installed
from sim_action.results.results_json import Results
from sim_action.state.verdict import Verdict
from tests.integration.conftest import sim_action

SCENARIO = """\
name: burger goes round a corner
robot: {model: turtlebot3_burger}
commands:
  twist: [{linear: 0.2, for: 1 s}, {linear: 0.2, angular: 1}]
expect:
  - matches: {trace: golden/corner.csv, position: 1 cm, yaw: 2 deg, joints: {"*": 20 deg}}
  - travel: {at_least: 30 cm}
time_limit: 4 s
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / ".git").mkdir()
    (tmp_path / "corner.sim.yml").write_text(SCENARIO)
    return tmp_path


def changed(folder: Path, *pairs: tuple[str, str]) -> None:
    text = (folder / "corner.sim.yml").read_text()
    for old, new in pairs:
        assert old in text
        text = text.replace(old, new)
    (folder / "corner.sim.yml").write_text(text)


def ran(folder: Path, *arguments: str, code: int = 0) -> str:
    ended = sim_action(folder, "run", "--no-report", "corner.sim.yml", *arguments, COLUMNS="120")
    assert ended.returncode == code, ended.stdout + ended.stderr
    return ended.stdout


def matched(folder: Path) -> Verdict:
    """The verdict on the golden run."""
    [outcome] = Results.read(folder / "sim-results/results.json").outcomes
    assert outcome.expectations[0].verdict
    return outcome.expectations[0].verdict


def test_the_way_from_nothing_to_a_golden_run_and_on(folder: Path) -> None:
    missing = ran(folder, code=2)
    command = re.search(r"'sim-action (run --update-golden \S+)' writes it", missing)
    assert command, missing
    written = sim_action(folder, *command[1].split(), "-v")
    assert written.returncode == 0, written.stdout
    assert "golden/corner.csv is written from this run" in written.stdout
    assert re.search(r"wrote golden/corner.csv: \d+ rows, to \d\.\d\d s", written.stdout)
    golden = folder / "golden/corner.csv"
    before = golden.read_bytes()
    ran(folder)
    assert matched(folder).measured == pytest.approx(0, abs=2e-4)
    again = ran(folder, "--update-golden", "-v")
    assert "is unchanged: " in again
    assert golden.read_bytes() == before
    assert [path.name for path in (folder / "golden").iterdir()] == ["corner.csv"]


def test_another_way_fails_and_is_accepted_by_an_update(folder: Path) -> None:
    ran(folder, "--update-golden")
    changed(folder, ("angular: 1", "angular: -1"))
    told = r"left golden/corner.csv in heading at 1\.\d0 s, in wheel_left_joint at"
    assert re.search(told, ran(folder, code=1))
    ran(folder, "--update-golden")
    ran(folder)


UNREAD = """
  - sensor: {name: scan, reading: ranges, which: min, at_least: 0.2}
    name: free in front
    after: 0.2 s
    before: 0.6 s
sensors: [{lidar: {rays: 10, range: 3.5 m}, name: scan, link: base_scan, rate: 1 Hz}]
"""


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (("at_least: 30 cm}", "at_least: 30 m}\n    name: far"), "'far' failed"),
        (("at_least: 30 cm}\n", f"at_least: 30 cm}}{UNREAD}"), "'free in front' was not exercised"),
    ],
)
def test_a_run_that_did_not_pass_is_saved_by_force_alone(change: tuple[str, str], reason: str, folder: Path) -> None:
    changed(folder, change)
    file = folder / "golden/corner.csv"
    refused = ran(folder, "--update-golden", code=1)
    assert f"golden/corner.csv is not written, because {reason}; " in refused
    assert not matched(folder).passed
    assert not file.exists()
    ran(folder, "--update-golden", "--force", code=1)
    assert file.read_text().splitlines()[0].endswith(f"; forced although {reason}")
    # It is read all the same, and a run that passes leaves no remark.
    ran(folder, code=1)
    assert matched(folder).passed
    changed(folder, change[::-1])
    ran(folder, "--update-golden")
    assert "forced" not in file.read_text()


@pytest.mark.parametrize(
    "change",
    [
        ("at_least: 30 cm}\n", "at_least: 30 m}\n    severity: warning\n"),
        ("at_least: 30 cm}\n", f"at_least: 30 cm}}{UNREAD}unexercised: warn\n"),
    ],
)
def test_a_run_that_passed_with_a_warning_is_saved(change: tuple[str, str], folder: Path) -> None:
    changed(folder, change)
    ran(folder, "--update-golden")
    assert (folder / "golden/corner.csv").exists()


def test_a_run_without_an_end_writes_nothing(folder: Path) -> None:
    changed(folder, ("commands:\n", "commands:\n  script: broken.py\n"), ("  twist: [{linear: 0.2", "  #"))
    (folder / "broken.py").write_text("def control(observation):\n    return 1 / 0\n")
    ran(folder, "--update-golden", code=1)
    assert not (folder / "golden").exists()


def test_the_file_holds_the_window_of_its_expectation_which_has_more_than_one_row_unless_allowed(folder: Path) -> None:
    golden = folder / "golden/corner.csv"
    changed(folder, ("20 deg}}", "20 deg}}\n    after: 0.5 s\n    before: 502 ms"))
    refused = ran(folder, "--update-golden", code=2)
    assert "golden/corner.csv has one row, at 0.5 s, so it compares no motion" in refused
    assert "[single-row-golden]" in refused
    assert not golden.exists()
    changed(folder, ("time_limit", "allow: [single-row-golden]\ntime_limit"))
    for end, times in (("502 ms", ["0.500"]), ("1 s", ["0.500", "0.600", "0.700", "0.800", "0.900", "1.000"])):
        changed(folder, ("502 ms", end))
        ran(folder, "--update-golden")
        assert [line.partition(",")[0] for line in golden.read_text().splitlines()[2:]] == times
        ran(folder)


def test_two_runs_do_not_write_the_same_file(folder: Path) -> None:
    varied = ("time_limit", "variations: {seed: [1, 2]}\ntime_limit")
    changed(folder, varied)
    refused = ran(folder, "--update-golden", code=2)
    assert "golden/corner.csv would be written 2 times, by 'burger goes round a corner[seed=1]'" in refused
    assert "corner.sim.yml:6:5" in refused
    assert not (folder / "golden").exists()
    ran(folder, "--update-golden", "--only", "*seed=1?")
    ran(folder)
    changed(folder, ("corner.csv", "corner-$variation.csv"))
    ran(folder, "--update-golden")
    written = sorted(path.name for path in (folder / "golden").iterdir())
    assert written == ["corner-seed=1.csv", "corner-seed=2.csv", "corner.csv"]
    ran(folder)


@pytest.mark.skipif(len(installed()) < 2, reason="takes two engines")
def test_engines_share_a_file_that_any_of_them_writes(folder: Path) -> None:
    assert "would be written 2 times" in ran(folder, "--update-golden", "--backend", "all", code=2)
    for engine in ("mujoco", installed()[0]):
        ran(folder, "--update-golden", "--backend", engine)
        ran(folder, "--backend", "all")


@pytest.mark.parametrize("name", ["../out.csv", ".git/hooks/out.csv"])
def test_nothing_is_written_outside_the_workspace(name: str, folder: Path) -> None:
    changed(folder, ("golden/corner.csv", name))
    for allowed in ((), ("--allow-outside",)):
        assert "is outside the workspace" in ran(folder, "--update-golden", *allowed, code=2)
    assert not list(folder.parent.glob("out.csv"))
    assert not list((folder / ".git").rglob("*.csv"))


@pytest.mark.parametrize("link", ["golden", "golden/corner.csv"])
def test_nothing_is_written_through_a_link(link: str, folder: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    (elsewhere / "corner.csv").write_text("mine")
    (folder / link).parent.mkdir(exist_ok=True)
    (folder / link).symlink_to(elsewhere if link == "golden" else elsewhere / "corner.csv")
    assert "is a link; remove it" in ran(folder, "--update-golden", code=2)
    assert [path.read_text() for path in elsewhere.iterdir()] == ["mine"]


def test_a_damaged_file_is_an_invalid_scenario_with_its_line(folder: Path) -> None:
    ran(folder, "--update-golden")
    path = folder / "golden/corner.csv"
    lines = path.read_text().splitlines()
    path.write_text("\n".join([*lines[:8], lines[8][:-20], *lines[9:]]))
    told = ran(folder, code=2)
    assert "golden/corner.csv:9: expected 7 numbers, found" in told
    assert "corner.sim.yml:6:15" in told
    assert sim_action(folder, "validate", "corner.sim.yml").returncode == 2


def test_a_file_that_another_scenario_extends_is_found_beside_it(folder: Path) -> None:
    ran(folder, "--update-golden")
    (folder / "deep").mkdir()
    (folder / "deep/other.sim.yml").write_text("extends: ../corner.sim.yml\nname: another\n")
    found = sim_action(folder, "run", "deep/other.sim.yml")
    assert found.returncode == 0, found.stdout
