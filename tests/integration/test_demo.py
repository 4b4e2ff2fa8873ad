"""The folder examples/demo/ as a repository of its own: green, and red with its patch for the right reason."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
import yaml

from sim_action.engines import installed
from tests.integration.conftest import ACTION, outcomes, sim_action
from tests.integration.github import WorkflowResult, run_workflow
from tests.integration.release_steps import git

DEMO = ACTION / "examples/demo"
WORKFLOW = ".github/workflows/simulation.yml"
STEP = "      - uses: sim-action/sim-action@v0\n        id: simulation\n"
MAX_PICTURE_BYTES = 150_000
# A bug for each expectation: scenario, expectation, text of the controller, text instead.
BUGS = [
    ("drive_to_dock", "reach", "push(right) - push(left)", "push(left) - push(right)"),
    ("drive_to_dock", "clearance", "return 2.5 *", "return 0.8 *"),
    ("drive_to_dock", "max_speed", "TOP_SPEED = 0.5", "TOP_SPEED = 0.7"),
    ("give_way", "stops_before", "STOP = 0.45", "STOP = 0.7"),
    ("give_way", "clearance", "STOP = 0.45", "STOP = 0.1"),
    ("give_way", "no_collision", "linear=speed, angular=max(-1.2, min(1.2, turn))", "linear=0.4, angular=0.3"),
    ("give_way", "reach", "distance < ARRIVED", "distance < 0.5"),
]


def copied(target: Path) -> Path:
    return shutil.copytree(DEMO, target, ignore=shutil.ignore_patterns("sim-results", "__pycache__"))


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    folder = copied(tmp_path / "scout")
    git(folder, "init", "--quiet")
    git(folder, "add", ".")
    git(folder, "commit", "--quiet", "--message", "Add the demo")
    return folder


def on_all_engines(repository: Path, temp: Path, runner_temp: Path) -> WorkflowResult:
    """The result of the workflow on a pull request; the only change is that the scenarios run on every engine."""
    text = (repository / WORKFLOW).read_text(encoding="utf-8")
    assert text.count(STEP) == 1
    workflow = temp.with_suffix(".yml")
    workflow.write_text(text.replace(STEP, f"{STEP}        with:\n          backend: all\n"), encoding="utf-8")
    return run_workflow(workflow, repository, temp=temp, shared_temp=runner_temp, event_name="pull_request")


@pytest.mark.soak
def test_the_demo_is_green_red_with_its_patch_and_as_before_without_it(
    repository: Path, tmp_path: Path, runner_temp: Path
) -> None:
    green = on_all_engines(repository, tmp_path / "green", runner_temp)
    assert green.conclusion == "success", green.log
    [report] = green.reports
    assert (report.reporter, report.failures, report.errors) == ("EnricoMi/publish-unit-test-result-action", 0, 0)
    git(repository, "am", "--quiet", "turn-red.patch")
    red = on_all_engines(repository, tmp_path / "red", runner_temp)
    assert (red.conclusion, red.jobs["comment"].result) == ("failure", "success")
    lines = (repository / "simulation/drive_to_dock.sim.yml").read_text(encoding="utf-8").splitlines()
    line = next(number for number, text in enumerate(lines, 1) if "- reach:" in text)
    errors = [annotation for annotation in red.jobs["simulation"].annotations if annotation.level == "error"]
    places = [(error.file, error.line) for error in errors]
    assert places == len(installed()) * [("simulation/drive_to_dock.sim.yml", line)]
    assert all(re.search(r"came no closer than 3\.\d+ m to \(4, 0\) in 15\.0 s", error.message) for error in errors)
    assert [report.failures for report in red.reports] == [len(installed())]
    assert (red.artifacts / "report.html/report.html").is_file()
    assert re.search(r"^\[Replays and plots of all scenarios\]\(https://", red.jobs["simulation"].summary, re.MULTILINE)
    git(repository, "revert", "--no-edit", "HEAD")
    assert git(repository, "rev-parse", "HEAD^{tree}") == git(repository, "rev-parse", "HEAD~2^{tree}")


def test_each_expectation_of_the_demo_can_fail(tmp_path: Path) -> None:
    for number, (scenario, _, old, new) in enumerate(BUGS):
        folder = copied(tmp_path / f"{number}")
        [other] = {"drive_to_dock", "give_way"} - {scenario}
        (folder / f"simulation/{other}.sim.yml").unlink()
        controller = (folder / "robot/navigate.py").read_text(encoding="utf-8")
        assert controller.count(old) == 1
        (folder / "robot/navigate.py").write_text(controller.replace(old, new), encoding="utf-8")
    sim_action(tmp_path, "run", ".")
    # A goal that another failure cut off has not failed by itself.
    failed = {
        (int(outcome["file"].partition("/")[0]), expectation["assertion"])
        for outcome in outcomes(tmp_path)
        for expectation in outcome["expectations"]
        if expectation["verdict"] and not expectation["verdict"]["passed"] and not expectation["verdict"]["cut_off"]
    }
    missed = [bug for number, bug in enumerate(BUGS) if (number, bug[1]) not in failed]
    assert missed == [], failed


def test_every_expectation_of_the_demo_has_a_bug() -> None:
    texts = {path.name.partition(".")[0]: path.read_text("utf-8") for path in DEMO.glob("simulation/*.sim.yml")}
    expected = {name: yaml.safe_load(text)["expect"] for name, text in texts.items()}
    keys = {(name, each if isinstance(each, str) else next(iter(each))) for name in expected for each in expected[name]}
    assert {(scenario, key) for scenario, key, _, _ in BUGS} == keys


def test_the_pictures_are_small_and_shown() -> None:
    pictures = {f"images/{path.name}": path.stat().st_size for path in DEMO.glob("images/*")}
    assert {name: size for name, size in pictures.items() if size > MAX_PICTURE_BYTES} == {}
    readme = (DEMO / "README.md").read_text(encoding="utf-8")
    assert set(re.findall(r"images/[\w.-]+", readme)) == set(pictures)
