"""The action as a runner runs it: a real install from the lock file, real simulations."""

from __future__ import annotations

import fcntl
import json
import os
import re
import shutil
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from tests.integration.action_executor import (
    ActionResult,
    Annotation,
    Runner,
    UnsupportedFeature,
    base_python,
    evaluate,
    parse_annotations,
    parse_outputs,
)

ACTION = Path(__file__).parent.parent.parent
TUTORIAL = (ACTION / "examples/turtlebot3/straight_line.sim.yml").read_text(encoding="utf-8")
STUCK = TUTORIAL.replace("linear: 1.0", "linear: 0.0")
INVALID = TUTORIAL.replace("travel:", "travle:")
ASSERTION_LINE = next(number for number, line in enumerate(TUTORIAL.splitlines(), 1) if "travel:" in line)

HOSTILE = ["$(touch pwned)", "'; touch pwned #", '"; touch pwned #', "`touch pwned`", "${{ github.token }}", "--help"]
# What a module does when it stands in for one of ours.
IMPOSTOR = "open('pwned', 'w').close()\nraise SystemExit('an impostor was imported')\n"


@pytest.fixture(scope="session")
def runner_temp(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Iterator[Path]:
    """A RUNNER_TEMP in which the action has been once, shared by all workers of the session, removed by the last."""
    session = tmp_path_factory.getbasetemp()
    session = session if worker_id == "master" else session.parent
    temp, users = session / "runner temp", session / "runner-temp-users"
    with locked(session / "runner-temp-lock"):
        others = users.read_text() if users.exists() else ""
        if not others:
            temp.mkdir(exist_ok=True)
            install_among_impostors(temp, session / "impostors")
        users.write_text(others + "+")
    yield temp
    with locked(session / "runner-temp-lock"):
        users.write_text(users.read_text()[:-1])
        if not users.read_text():
            shutil.rmtree(temp)


@contextmanager
def locked(path: Path) -> Iterator[None]:
    with path.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def install_among_impostors(temp: Path, folder: Path) -> None:
    for name in ("pip", "venv", "ensurepip", "sitecustomize", "click", "sim_action"):
        write(folder / f"{name}.py", IMPOSTOR)
    runner = Runner(folder, temp, variables={"PYTHONPATH": str(folder), "PYTHONHOME": str(folder)})
    result = runner.run(ACTION)
    assert result.exit_code == 5, result.log
    assert not (folder / "pwned").exists()


@pytest.fixture
def runner(tmp_path: Path, runner_temp: Path) -> Runner:
    workspace = tmp_path / "work space"
    workspace.mkdir()
    return Runner(workspace, runner_temp)


def write(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def counts(result: ActionResult) -> dict[str, str]:
    return {name: result.outputs[name] for name in ("total", "passed", "failed", "errors")}


def test_tutorial_passes(runner: Runner) -> None:
    write(runner.workspace / "robot/straight.sim.yml", TUTORIAL)
    result = runner.run(ACTION)
    assert result.exit_code == 0, result.log
    assert result.outputs["conclusion"] == "success"
    assert counts(result) == {"total": "1", "passed": "1", "failed": "0", "errors": "0"}
    assert float(result.outputs["travelled"]) >= 1.5
    assert "burger drives straight" in result.summary
    assert result.annotations == ()


def test_results_are_where_the_outputs_say(runner: Runner) -> None:
    write(runner.workspace / "robot/straight.sim.yml", TUTORIAL)
    result = runner.run(ACTION, {"working-directory": "robot", "output-directory": "what came out"})
    junit = runner.workspace / result.outputs["junit-path"]
    results = runner.workspace / result.outputs["results-path"]
    assert junit.parent == results.parent == runner.workspace / "robot/what came out"
    assert ET.parse(junit).getroot().get("failures") == "0"
    assert json.loads(results.read_text(encoding="utf-8"))["outcomes"][0]["status"] == "passed"


def test_callers_environment_is_left_alone(runner: Runner) -> None:
    write(runner.workspace / "straight.sim.yml", TUTORIAL)
    assert runner.run(ACTION).exported == ""


def test_failure_says_how_far_it_got_on_the_line_of_the_assertion(runner: Runner) -> None:
    write(runner.workspace / "robot/stuck.sim.yml", STUCK)
    result = runner.run(ACTION)
    assert result.exit_code == 1, result.log
    assert result.outputs["conclusion"] == "failure"
    assert counts(result) == {"total": "1", "passed": "0", "failed": "1", "errors": "0"}
    assert float(result.outputs["travelled"]) < 0.01
    [annotation] = result.annotations
    assert (annotation.level, annotation.file, annotation.line) == ("error", "robot/stuck.sim.yml", ASSERTION_LINE)
    assert re.fullmatch(r"travelled 0\.00\d* m of 1\.5 m in 30\.0 s", annotation.message)
    assert annotation.message in result.summary


def test_failures_can_be_forgiven(runner: Runner) -> None:
    write(runner.workspace / "stuck.sim.yml", STUCK)
    result = runner.run(ACTION, {"fail-on-failure": "false"})
    assert result.exit_code == 0, result.log
    assert result.outputs["conclusion"] == "failure"


@pytest.mark.parametrize(("scenario", "exit_code"), [(INVALID, 2), (None, 5)], ids=["invalid", "none"])
def test_nothing_else_is_forgiven(runner: Runner, scenario: str | None, exit_code: int) -> None:
    if scenario:
        write(runner.workspace / "invalid.sim.yml", scenario)
    assert runner.run(ACTION, {"fail-on-failure": "false"}).exit_code == exit_code


def test_fail_on_failure_is_true_or_false(runner: Runner) -> None:
    result = runner.run(ACTION, {"fail-on-failure": "never"})
    assert result.exit_code == 2
    assert "fail-on-failure must be true or false" in result.annotations[0].message


def test_invalid_scenario_leaves_the_others_running(runner: Runner) -> None:
    write(runner.workspace / "invalid.sim.yml", INVALID)
    write(runner.workspace / "straight.sim.yml", TUTORIAL)
    result = runner.run(ACTION)
    assert result.exit_code == 2, result.log
    assert counts(result) == {"total": "2", "passed": "1", "failed": "0", "errors": "1"}
    assert result.outputs["travelled"] == ""
    [annotation] = result.annotations
    assert (annotation.file, annotation.line) == ("invalid.sim.yml", ASSERTION_LINE)
    assert "travle" in annotation.message


def test_no_scenario_is_no_success(runner: Runner) -> None:
    result = runner.run(ACTION)
    assert result.exit_code == 5
    assert result.outputs["total"] == "0"


def test_paths_of_annotations_start_at_the_workspace(runner: Runner) -> None:
    write(runner.workspace / "my robot/stuck.sim.yml", STUCK)
    result = runner.run(ACTION, {"working-directory": "my robot"})
    assert result.annotations[0].file == "my robot/stuck.sim.yml"


def test_scenario_takes_a_path_folder_or_glob_per_line(runner: Runner) -> None:
    for name in (
        "one path.sim.yml",
        "a folder/a.sim.yml",
        "globs/b 1.sim.yml",
        "globs/b 2.sim.yml",
        "not named.sim.yml",
    ):
        write(runner.workspace / name, TUTORIAL)
    result = runner.run(ACTION, {"scenario": "one path.sim.yml\n\n  a folder\nglobs/b *.sim.yml\n"})
    assert result.exit_code == 0, result.log
    assert result.outputs["total"] == "4"


@pytest.mark.parametrize("text", HOSTILE)
def test_inputs_are_never_executed(runner: Runner, text: str) -> None:
    write(runner.workspace / "straight.sim.yml", TUTORIAL)
    as_scenario = runner.run(ACTION, {"scenario": text})
    as_folder = runner.run(ACTION, {"scenario": "straight.sim.yml", "output-directory": text})
    as_choice = runner.run(ACTION, {"fail-on-failure": text})
    assert (as_scenario.exit_code, as_folder.exit_code, as_choice.exit_code) == (2, 0, 2), as_scenario.log
    assert (runner.workspace / text / "results.json").is_file()
    assert "Usage:" not in as_scenario.log
    assert not list(runner.workspace.rglob("pwned"))


def test_modules_of_the_caller_do_not_stand_in_for_ours(runner: Runner) -> None:
    for name in ("click", "yaml", "sim_action", "sitecustomize"):
        write(runner.workspace / f"{name}.py", IMPOSTOR)
    write(runner.workspace / "straight.sim.yml", TUTORIAL)
    variables = {"PYTHONPATH": str(runner.workspace), "PYTHONHOME": str(runner.workspace)}
    result = Runner(runner.workspace, runner.temp, variables=variables).run(ACTION)
    assert result.exit_code == 0, result.log
    assert not (runner.workspace / "pwned").exists()


def test_second_use_in_a_job_installs_nothing(runner: Runner) -> None:
    made = (runner.temp / "sim-action/pyvenv.cfg").stat().st_mtime_ns
    runner.run(ACTION)
    assert (runner.temp / "sim-action/pyvenv.cfg").stat().st_mtime_ns == made


def test_package_with_another_hash_is_refused(tmp_path: Path) -> None:
    action = tmp_path / "action"
    write(action / "requirements.lock", f"click==8.1.8 --hash=sha256:{'0' * 64}\n")
    write(action / "action.yml", (ACTION / "action.yml").read_text(encoding="utf-8"))
    shutil.copytree(ACTION / "action", action / "action")
    result = Runner(tmp_path, tmp_path).run(action)
    assert result.exit_code != 0
    assert result.steps[-1] == "Install dependencies"
    assert "DO NOT MATCH THE HASHES" in result.log
    assert not (tmp_path / "sim-action/requirements.lock").exists()


@pytest.mark.parametrize(("system", "arch"), [("Windows", "X64"), ("macOS", "ARM64"), ("Linux", "ARM64")])
def test_other_machines_are_told_what_to_do_before_anything_is_installed(
    tmp_path: Path, system: str, arch: str
) -> None:
    result = Runner(tmp_path, tmp_path, os=system, arch=arch).run(ACTION)
    assert result.exit_code == 2
    assert result.steps == ("Check the runner",)
    [annotation] = result.annotations
    assert f"{system} {arch}" in annotation.message
    assert "ubuntu-latest" in annotation.message


@pytest.mark.parametrize("forgiving", ["true", "false"])
def test_cancelled_workflow_gets_its_reports(runner: Runner, forgiving: str) -> None:
    endless = STUCK.replace("30 s", "80000 s")
    write(runner.workspace / "endless.sim.yml", endless)
    scratch = write(runner.workspace / "scratch/empty", "").parent
    environment = {
        **os.environ,
        "TMPDIR": str(scratch),
        "GITHUB_ACTION_PATH": str(ACTION),
        "RUNNER_TEMP": str(runner.temp),
        "INPUT_SCENARIO": "endless.sim.yml",
        "INPUT_OUTPUT_DIRECTORY": "out",
        "INPUT_FAIL_ON_FAILURE": forgiving,
    }
    with subprocess.Popen(["bash", ACTION / "action/run.sh"], cwd=runner.workspace, env=environment) as process:
        wait_until_it_runs(process, scratch)
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=30) == 130
    [outcome] = json.loads((runner.workspace / "out/results.json").read_text(encoding="utf-8"))["outcomes"]
    assert outcome["failures"][0]["kind"] == "interrupted"


def wait_until_it_runs(process: subprocess.Popen[bytes], scratch: Path) -> None:
    while not list(scratch.rglob("output.txt")):
        assert process.poll() is None
        time.sleep(0.05)


def test_executor_stops_at_a_failing_step_and_hands_outputs_on(tmp_path: Path) -> None:
    action = """
      inputs: {}
      outputs:
        answer: {value: "${{ steps.first.outputs.answer }}"}
        missing: {value: "${{ steps.last.outputs.answer }}"}
      runs:
        using: composite
        steps:
          - {name: first, id: first, shell: bash, run: 'echo answer=42 >> "$GITHUB_OUTPUT"; false | true; exit 3'}
          - {name: last, id: last, shell: bash, run: exit 0}
    """
    write(tmp_path / "action.yml", action)
    result = Runner(tmp_path, tmp_path).run(tmp_path)
    assert (result.exit_code, result.steps) == (1, ("first",))
    assert result.outputs == {"answer": "42", "missing": ""}


@pytest.mark.parametrize("text", ["${{ github.token }}", "${{ inputs.a || 'b' }}", "${{ steps.x.outputs.y"])
def test_executor_refuses_expressions_that_it_does_not_know(text: str) -> None:
    with pytest.raises(UnsupportedFeature):
        evaluate(text, {"inputs.a": "a"})


def test_executor_evaluates_once() -> None:
    assert evaluate("<${{ inputs.a }}>", {"inputs.a": "${{ inputs.a }}"}) == "<${{ inputs.a }}>"


def test_executor_reads_outputs_and_annotations() -> None:
    assert parse_outputs("a=1=2\nb<<END\nx\ny=z\nEND\n") == {"a": "1=2", "b": "x\ny=z"}
    log = "::stop-commands::t\n::error::no\n::t::\n::error file=a%2Cb.yml,line=3,title=x::50%25%0Aoff\n"
    assert parse_annotations(log) == (Annotation("error", "50%\noff", "a,b.yml", 3),)


def test_base_python_is_what_the_action_asks_for() -> None:
    version = subprocess.run([base_python(), "--version"], capture_output=True, text=True, check=True).stdout
    assert version.startswith("Python 3.11.")
