"""Every workflow to copy, and this repository's own, run as GitHub would: with the real action, on real scenarios."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from itertools import product
from pathlib import Path
from urllib.parse import parse_qs

import pytest
from junitparser import JUnitXml

from sim_action.ros.ros2.installation import PYTHON_VARIABLE
from tests.integration.conftest import ACTION, write
from tests.integration.github import CacheStore, JobResult, Run, WorkflowResult, run_workflow
from tests.ros.ros1.launches import needs_ros
from tests.ros.ros2.nodes import MOVER, needs_ros2, variables
from tests.ros.ros2.prefixes import source
from tests.soak import soaked

TEMPLATES = ACTION / "examples/workflows"
TUTORIAL = (ACTION / "examples/turtlebot3/straight_line.sim.yml").read_text(encoding="utf-8")
STUCK = TUTORIAL.replace("linear: 1.0", "linear: 0.1").replace("30 s", "2 s")
ASSERTION_LINE = next(number for number, line in enumerate(TUTORIAL.splitlines(), 1) if "travel:" in line)
FLAKY = """\
name: shaky
robot: {model: turtlebot3_burger}
commands: {script: controller.py}
expect: [{stay_within: {x: [-10, 10]}}]
duration: 0.2 s
time_limit: 1 s
"""
CONTROLLER = """\
import os

from sim_action import Twist


# Speeds that the burger comes to at 1 m/s^2: of those beyond, one run is as another.
def control(observation):
    return Twist((os.urandom(1)[0] / 2550, 0.0, 0.0), (0.0, 0.0, 0.0))
"""
REPORTERS = ["reporter-dorny", "reporter-enricomi", "reporter-mikepenz"]
FROM_FORK = {"pull_request": {"number": 7, "head": {"repo": {"full_name": "stranger/robot"}}}}
RunTemplate = Callable[..., WorkflowResult]


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """A user's repository: scenarios, and whatever workflow is to be tried."""
    for name in ("a", "b", "c", "d"):
        write(tmp_path / f"repository/simulation/{name}.sim.yml", TUTORIAL)
    return tmp_path / "repository"


@pytest.fixture
def run_template(repository: Path, tmp_path: Path, runner_temp: Path) -> RunTemplate:
    """Copies a template to where its first comment says, and runs it; `changed`: a text of it, and another instead."""

    def run(name: str, changed: tuple[str, str] = ("", ""), **options: object) -> WorkflowResult:
        template = TEMPLATES / f"{name}.yml"
        text = template.read_text(encoding="utf-8")
        target = repository / text.split(maxsplit=4)[3].rstrip(":,")
        target.parent.mkdir(parents=True, exist_ok=True)
        assert changed[0] in text
        target.write_text(text.replace(*changed), encoding="utf-8")
        folder = tmp_path / f"run {len(list(tmp_path.iterdir()))}"
        given: dict[str, object] = {"shared_temp": runner_temp, **options}
        return run_workflow(target, repository, temp=folder, **given)  # type: ignore[arg-type]  # passed on as given

    return run


def joined(result: WorkflowResult) -> list[str]:
    text = (result.artifacts / "sim-results/results.json").read_text(encoding="utf-8")
    return [outcome["file"] for outcome in json.loads(text)["outcomes"]]


def leave(repository: Path, text: str) -> None:
    """One scenario, with this text."""
    for name in "bcd":
        (repository / f"simulation/{name}.sim.yml").unlink()
    write(repository / "simulation/a.sim.yml", text)


def test_minimal(run_template: RunTemplate) -> None:
    passing = run_template("simulation")
    assert passing.conclusion == "success"
    assert "All 4 scenarios passed" in passing.jobs["simulation"].summary


def test_gate_keeps_the_results_of_failures_and_links_the_report_at_their_moment(
    run_template: RunTemplate, repository: Path
) -> None:
    write(repository / "simulation/b.sim.yml", STUCK.replace("burger drives straight", "stuck (again)"))
    result = run_template("pull-request-gate", event_name="pull_request")
    assert result.conclusion == "failure"
    assert JUnitXml.fromfile(str(result.artifacts / "sim-results/junit.xml")).failures == 1
    assert (result.artifacts / "report.html/report.html").is_file()
    [annotation] = result.jobs["simulation"].annotations
    assert (annotation.file, annotation.line) == ("simulation/b.sim.yml", ASSERTION_LINE)
    (link,) = re.findall(r"^\[Replays and plots.*\]\((\S+)\)$", result.jobs["simulation"].summary, re.MULTILINE)
    address, _, fragment = link.partition("#")
    assert address.startswith("https://github.com/")
    assert parse_qs(fragment) == {"scenario": ["stuck (again)"], "t": ["2"]}


def test_gate_tells_what_a_pull_request_changes(run_template: RunTemplate, repository: Path, tmp_path: Path) -> None:
    cache = CacheStore(tmp_path / "caches")
    write(repository / "simulation/a.sim.yml", STUCK)
    assert "newly fail" not in run_template("pull-request-gate", cache=cache).jobs["simulation"].summary
    write(repository / "simulation/b.sim.yml", STUCK)
    changed = run_template("pull-request-gate", event_name="pull_request", cache=cache).jobs["simulation"]
    assert "❌ 1 scenario newly fails" in changed.summary
    # On a busy machine, a run may be slower than before, which is a warning.
    assert re.search(r"1 newly fails,( \d+ warnings?( \([^)]*\))?,)? 1 still fails, 2 still pass", changed.summary)


GATE = """\
name: unknown floors
robot: {model: turtlebot3_burger}
commands: {twist: [{linear: 0.5}]}
expect: [{travel: {at_least: 0.1 m}}]
variations:
  commands.twist.0.linear: {uniform: [0.0, 1.0]}
gate: {passes: {at_least: 10 %, confidence: 95 %}, runs: 40}
allow: [low-gate]
time_limit: 0.5 s
"""


def test_a_pull_request_is_compared_with_its_base_on_the_same_draws(
    run_template: RunTemplate, repository: Path, tmp_path: Path
) -> None:
    leave(repository, GATE)
    base = tmp_path / "base"
    shutil.copytree(repository, base)
    write(repository / "simulation/a.sim.yml", GATE.replace("0.5 s", "0.45 s"))
    worse = run_template("pull-request-compare", event_name="pull_request", base=base)
    assert worse.conclusion == "failure"
    assert "✅ The gate passed" in worse.jobs["compare"].summary
    assert "❌ 1 pass rate fell" in worse.jobs["compare"].summary
    report = (worse.artifacts / "sim-results/report.html").read_text(encoding="utf-8")
    assert "1 pass rate fell" in report
    assert "Since the base run: " in report
    assert '"label":"base run"' in report


def test_a_pull_request_with_the_first_scenarios_is_compared_with_nothing(
    run_template: RunTemplate, tmp_path: Path
) -> None:
    write(tmp_path / "base/README.md", "A robot.\n")
    result = run_template("pull-request-compare", event_name="pull_request", base=tmp_path / "base")
    assert result.conclusion == "success", result.jobs["compare"].log


@pytest.mark.soak
def test_the_nightly_run_finds_what_is_flaky(run_template: RunTemplate, repository: Path) -> None:
    leave(repository, TUTORIAL)
    write(repository / "simulation/b.sim.yml", FLAKY)
    write(repository / "simulation/controller.py", CONTROLLER)
    result = run_template("nightly", ("repeat: 20", "repeat: 4"), event_name="workflow_dispatch")
    assert result.conclusion == "failure"
    assert "1 passed, 1 flaky" in result.jobs["repeats"].summary
    assert "4 identical runs" in result.jobs["repeats"].summary


@pytest.mark.soak
def test_the_weekly_proof_names_checks_that_check_nothing(run_template: RunTemplate, repository: Path) -> None:
    text = TUTORIAL.replace("expect:\n", "expect:\n  - max_speed: {linear: 40}\n")
    assert text != TUTORIAL
    leave(repository, text)
    result = run_template("prove", event_name="workflow_dispatch")
    assert result.conclusion == "success", result.jobs["prove"].log
    summary = result.jobs["prove"].summary
    assert "## ❌ 1 expectation checks nothing" in summary
    assert "[The mutants that nothing noticed, beside the runs without a fault](" in summary
    assert "::warning file=simulation/a.sim.yml,line=" in result.jobs["prove"].log


def test_a_second_attempt_resumes_the_first(
    run_template: RunTemplate, repository: Path, tmp_path: Path, runner_temp: Path
) -> None:
    (repository / "simulation/d.sim.yml").unlink()
    # Both attempts have the same commit. A controller that raises an error leaves no verdict, as a cancelled run does.
    write(repository / "simulation/c.sim.yml", FLAKY)
    write(repository / "simulation/controller.py", "def control(observation):\n    raise ValueError\n")
    shared = {"cache": CacheStore(tmp_path / "caches"), "work": tmp_path / "work"}
    first = run_template("resume", run=Run(5, 1), **shared)
    assert "0 of 3 scenarios taken over from the earlier run" in first.jobs["simulation"].summary
    # The packages lie elsewhere, as on the fresh machine of a second attempt.
    (tmp_path / "another temp").symlink_to(runner_temp)
    second = run_template("resume", run=Run(5, 2), shared_temp=tmp_path / "another temp", **shared)
    assert second.conclusion == "failure"
    assert "2 of 3 scenarios taken over from the earlier run" in second.jobs["simulation"].summary


@pytest.mark.soak
def test_shards_are_reported_as_one_run(run_template: RunTemplate, repository: Path) -> None:
    write(repository / "simulation/c.sim.yml", STUCK)
    whole = run_template("sharded")
    assert (whole.conclusion, whole.jobs["merge"].result) == ("failure", "failure")
    assert len(whole.jobs["shard"].runs) == 3
    assert joined(whole) == [f"simulation/{name}.sim.yml" for name in "abcd"]
    assert "1 of 4 scenarios did not pass" in whole.jobs["merge"].summary


def test_shards_that_are_lost_are_missed(run_template: RunTemplate) -> None:
    lost = {"plan": JobResult("failure"), "shard": JobResult("skipped")}
    result = run_template("sharded", done=lost)
    assert result.jobs["merge"].result == "failure"
    assert joined(result) == [f"simulation/{name}.sim.yml" for name in "abcd"]
    assert "4 of 4 scenarios did not pass" in result.jobs["merge"].summary


@pytest.mark.parametrize(
    ("name", "from_fork"),
    soaked(product(REPORTERS, [False, True]), short=zip(REPORTERS, [False, True, False], strict=True)),
)
def test_reporters_get_the_results(name: str, from_fork: bool, run_template: RunTemplate, repository: Path) -> None:
    write(repository / "simulation/b.sim.yml", STUCK)
    event = FROM_FORK if from_fork else {}
    result = run_template(name, event_name="pull_request" if from_fork else "push", event=event)
    [report] = result.reports
    assert [JUnitXml.fromfile(str(file)).failures for file in report.files] == [1]
    # What a token that may only read can do; the third sees by itself which it has.
    without_writing = {"reporter-dorny": "use-actions-summary", "reporter-mikepenz": "annotate_only"}
    if name in without_writing:
        assert report.inputs[without_writing[name]] == ("true" if from_fork else "false")


def test_reusable_workflow_hands_back_what_came_of_it(run_template: RunTemplate, repository: Path) -> None:
    shutil.copytree(TEMPLATES, repository / ".github/workflows")
    write(repository / "simulation/b.sim.yml", STUCK)
    result = run_template("reusable-caller")
    assert result.conclusion == "failure"
    assert "simulation ended as failure, 1 failed, 0 not exercised, 0 without a verdict" in result.jobs["follow-up"].log


@pytest.mark.soak
@needs_ros
def test_rostest(run_template: RunTemplate, repository: Path) -> None:
    package = repository / "catkin_ws/src/my_turtlebot_sim"
    shutil.copytree(ACTION / "examples/ros1/src/robot_driver", package)
    (package / "mover.test").rename(package / "my_turtlebot_sim.test")
    for file in ("package.xml", "my_turtlebot_sim.test", "test_mover.py"):
        text = (package / file).read_text(encoding="utf-8")
        (package / file).write_text(text.replace("robot_driver", "my_turtlebot_sim"), encoding="utf-8")
    result = run_template("ros1")
    assert result.conclusion == "success", result.jobs["rostest"].log
    assert joined(result) == ["catkin_ws/src/my_turtlebot_sim/my_turtlebot_sim.test"]


@needs_ros2
def test_nodes_of_ros_2(run_template: RunTemplate, repository: Path) -> None:
    """The wheels are on the machine, so that they are not installed again."""
    package = source(repository / "ros2_ws")
    write(package / "my_robot/mover.py", MOVER)
    for scenario in repository.glob("simulation/*.sim.yml"):
        scenario.unlink()
    text = TUTORIAL[: TUTORIAL.index("commands:")].replace("burger drives straight", "by a node")
    nodes = "commands: {ros2: {nodes: [my_robot/mover]}}\nexpect: [{travel: {at_least: 0.5 m}}]\ntime_limit: 5 s\n"
    write(repository / "ros2_ws/tests/drive.sim.yml", text + nodes)
    result = run_template("ros2", variables={PYTHON_VARIABLE: variables()[PYTHON_VARIABLE]})
    assert result.conclusion == "success", result.jobs["simulation"].log
    assert "ROS 2: jazzy in " in result.jobs["simulation"].log


def test_every_template_is_tried() -> None:
    tried = {"simulation", "pull-request-gate", "nightly", "sharded", "resume", *REPORTERS, "ros1", "ros2"}
    tried |= {"prove", "pull-request-compare", "reusable", "reusable-caller"}
    assert {path.stem for path in TEMPLATES.glob("*.yml")} == tried


OWN_WORKFLOW = ACTION / ".github/workflows/ci.yml"
# This run of the tests is what the jobs `lint` and `test` would run.
RUNS_ALREADY = {"lint": JobResult("success"), "test": JobResult("success")}


@pytest.mark.soak
def test_all_examples_pass_in_every_job_of_this_repositorys_own_workflow(tmp_path: Path, runner_temp: Path) -> None:
    result = run_workflow(OWN_WORKFLOW, ACTION, temp=tmp_path, shared_temp=runner_temp, done=RUNS_ALREADY)
    assert failed_jobs(result) == {}
    assert len(result.jobs["runners"].runs) == 6


def failed_jobs(result: WorkflowResult) -> dict[str, str]:
    return {name: job.log for name, job in result.jobs.items() if job.result != "success"}


@pytest.mark.parametrize("result", soaked(["failure", "skipped", "cancelled"], short=["skipped"]))
def test_gate_of_this_repository_lets_no_failure_through(result: str, tmp_path: Path, runner_temp: Path) -> None:
    names = {"lint", "test", "runners", "must-pass", "must-fail", "paths", "plan", "shard", "merge"}
    done = {name: JobResult("success") for name in names} | {"paths": JobResult(result)}
    ran = run_workflow(OWN_WORKFLOW, ACTION, temp=tmp_path, shared_temp=runner_temp, done=done)
    assert ran.conclusion == "failure"
