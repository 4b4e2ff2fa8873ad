"""A sim-action that is killed: what was known is in the journal, and `sim-action report` makes the reports."""

from __future__ import annotations

import signal
import xml.etree.ElementTree as ET
from pathlib import Path

from sim_action.results.journal import read_journal
from sim_action.results.results_json import Results
from tests.integration.conftest import sim_action

SCENARIO = """
name: {name}
robot: {{model: turtlebot3_burger}}
commands: {commands}
expect: [{{travel: {{at_least: {distance} m}}}}]
time_limit: 2 s
"""

KILLER = f"""
import os
from pathlib import Path

def control(observation):
    # This process, its supervisor, sim-action.
    supervisor = Path(f"/proc/{{os.getppid()}}/stat").read_text()
    os.kill(int(supervisor.rpartition(")")[2].split()[1]), {int(signal.SIGKILL)})
"""


def scenario(folder: Path, name: str, commands: str = "{twist: [{linear: 0.5}]}", distance: float = 0.2) -> None:
    (folder / f"{name}.sim.yml").write_text(SCENARIO.format(name=name, commands=commands, distance=distance))


def test_the_journal_of_a_killed_call_has_every_verdict_that_was_known_and_makes_reports(tmp_path: Path) -> None:
    scenario(tmp_path, "a passes")
    scenario(tmp_path, "b fails", distance=100)
    (tmp_path / "killer.py").write_text(KILLER)
    scenario(tmp_path, "c kills", "{script: killer.py}")
    scenario(tmp_path, "d waits")
    assert sim_action(tmp_path, "run", "--jobs", "1").returncode == -signal.SIGKILL

    assert not (tmp_path / "sim-results/results.json").exists()
    recorded = read_journal(tmp_path / "sim-results")
    assert [recorded.finished[place].outcome.status for place in (0, 1)] == ["passed", "failed"]  # type: ignore[union-attr]
    assert recorded.finished.keys() == {0, 1}

    made = sim_action(tmp_path, "report")
    assert made.returncode == 130
    assert "Traceback" not in made.stderr
    results = Results.read(tmp_path / "sim-results/results.json")
    assert [outcome.status for outcome in results.outcomes] == ["passed", "failed", "error", "error"]
    messages = [outcome.failures[0].message for outcome in results.outcomes[2:]]
    assert messages == [f"sim-action ended before this scenario {how}" for how in ("ended", "started")]
    root = ET.parse(tmp_path / "sim-results/junit.xml").getroot()
    assert [(suite.get("name"), suite.get("failures"), suite.get("errors")) for suite in root.iter("testsuite")] == [
        ("a passes", "0", "0"),
        ("b fails", "1", "0"),
        ("c kills", "0", "1"),
        ("d waits", "0", "1"),
    ]
    assert (tmp_path / "sim-results/report.html").stat().st_size > 10_000
    assert "not finished" in made.stdout


def test_a_folder_without_a_journal_is_an_error_of_usage(tmp_path: Path) -> None:
    made = sim_action(tmp_path, "report", "none")
    assert made.returncode == 2
    assert made.stderr == "sim-action: none/results.jsonl is not a valid journal: no such file or directory\n"


def test_reports_of_a_finished_call_are_made_again(tmp_path: Path) -> None:
    scenario(tmp_path, "a passes")
    assert sim_action(tmp_path, "run").returncode == 0
    before = Results.read(tmp_path / "sim-results/results.json")
    for name in ("results.json", "junit.xml", "report.html"):
        (tmp_path / "sim-results" / name).unlink()
    assert sim_action(tmp_path, "report", "sim-results", "--quiet").returncode == 0
    assert Results.read(tmp_path / "sim-results/results.json") == before
    assert (tmp_path / "sim-results/junit.xml").is_file()
