"""The action as a runner runs it: a real install from the lock file, real simulations."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import time
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET
from xml.sax.saxutils import quoteattr

import pytest
import yaml

from tests.integration.conftest import IMPOSTOR, write
from tests.integration.github import (
    ActionResult,
    CacheStore,
    Runner,
    base_python,
)

ACTION = Path(__file__).parent.parent.parent
TUTORIAL = (ACTION / "examples/turtlebot3/straight_line.sim.yml").read_text(encoding="utf-8")
STUCK = TUTORIAL.replace("linear: 1.0", "linear: 0.0")
INVALID = TUTORIAL.replace("travel:", "travle:")
ASSERTION_LINE = next(number for number, line in enumerate(TUTORIAL.splitlines(), 1) if "travel:" in line)

HOSTILE = [
    "$(touch pwned)",
    "'; touch pwned #",
    '"; touch pwned #',
    "`touch pwned`",
    "${{ github.token }}",
    "--help",
    "::set-output name=conclusion::forged",
    "##[error]forged",
    "spaces  in it, and \u00fcn\u00efc\u00f6d\u00e9 \U0001f916",
    "<script>alert(1)</script>&amp;",
]
CHOICES = ["junit-strict", "jobs", "shard", "summary", "annotations", "fail-on-failure", "cache", "allow-scripts"]
HOSTILE_CHOICES = [
    "$(touch pwned)",
    "'; touch pwned #",
    "true\n::error::forged\n##[error]forged",
    "${{ github.token }}",
]
CHATTER = "::error::forged\n##[error]forged\n::set-output name=conclusion::forged\n::stop-commands::forged\n"

BOX = """\
<robot name="box">
  <link name="base">
    <inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <collision><geometry><box size="1 1 1"/></geometry></collision>
  </link>
</robot>
"""
SCRIPTED = """\
name: box stands still
robot: {model: box.urdf}
commands: {script: controller.py}
expect: [{travel: {at_least: 1 m}}]
time_limit: 1 s
"""


@pytest.fixture
def runner(tmp_path: Path, runner_temp: Path) -> Runner:
    workspace = tmp_path / "work space"
    workspace.mkdir()
    return Runner(workspace, runner_temp)


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
def test_paths_are_paths_whatever_is_in_them(runner: Runner, text: str) -> None:
    write(runner.workspace / "straight.sim.yml", TUTORIAL)
    as_scenario = runner.run(ACTION, {"scenario": text})
    assert as_scenario.exit_code in {2, 5}, as_scenario.log
    assert_harmless(as_scenario, runner)
    folders = {"working-directory": text, "output-directory": f"{text}/out", "junit-path": f"{text}/junit.xml"}
    as_missing_folder = runner.run(ACTION, folders)
    assert as_missing_folder.exit_code == 2
    assert_harmless(as_missing_folder, runner)
    write(runner.workspace / text / "straight.sim.yml", TUTORIAL)
    as_folder = runner.run(ACTION, folders)
    assert as_folder.exit_code == 0, as_folder.log
    assert as_folder.outputs["junit-path"] == str(runner.workspace / text / text / "junit.xml")
    assert (runner.workspace / text / text / "out/results.json").is_file()
    assert_harmless(as_folder, runner)


@pytest.mark.parametrize("text", HOSTILE_CHOICES)
@pytest.mark.parametrize("name", CHOICES)
def test_choices_are_refused_and_not_executed(runner: Runner, name: str, text: str) -> None:
    write(runner.workspace / "straight.sim.yml", TUTORIAL)
    result = runner.run(ACTION, {name: text})
    assert result.exit_code != 0
    assert not list(runner.workspace.rglob("results.json"))
    assert_harmless(result, runner)


def assert_harmless(result: ActionResult, runner: Runner) -> None:
    """Nothing was executed, no command was injected, no output forged."""
    assert not list(runner.workspace.rglob("pwned"))
    assert "Usage: sim-action [OPTIONS]" not in result.log
    assert "##[" not in result.log
    assert "forged" not in {annotation.message for annotation in result.annotations}
    assert result.outputs["conclusion"] in {"", "success", "failure"}


def test_names_of_strangers_are_nothing_but_names(runner: Runner) -> None:
    model = BOX.replace("base", quoteattr("::error::forged ##[error]forged $(touch pwned)")[1:-1])
    write(runner.workspace / "box.urdf", model)
    write(runner.workspace / "controller.py", f"def control(observation):\n    print({CHATTER!r})\n    return None\n")
    for number, text in enumerate([*HOSTILE, "::error::forged", "::stop-commands::forged"]):
        folder = runner.workspace / text / "below"
        write(folder / f"{text}.sim.yml", STUCK.replace("30 s", "1 s"))
        write(folder / "named.sim.yml", TUTORIAL.replace("burger drives straight", json.dumps(f"{text}|{number}")))
    write(runner.workspace / "box.sim.yml", SCRIPTED)
    result = runner.run(ACTION)
    assert result.exit_code == 2, result.log
    assert counts(result)["passed"] == "0"
    assert len(result.annotations) == 10
    assert all(annotation.file for annotation in result.annotations[:-1])
    assert "more" in result.annotations[-1].message
    assert result.outputs["conclusion"] == "failure"
    assert_harmless(result, runner)
    assert "<script" not in result.summary
    junit = ET.parse(result.outputs["junit-path"]).getroot()
    assert junit.get("tests") == str(len(list(junit.iter("testcase"))))


@pytest.mark.parametrize("event", ["pull_request_target", "workflow_run"])
def test_scripts_of_strangers_wait_for_permission(runner: Runner, event: str) -> None:
    write(runner.workspace / "box.urdf", BOX)
    write(runner.workspace / "controller.py", "def control(observation):\n    open('pwned', 'w').close()\n")
    write(runner.workspace / "box.sim.yml", SCRIPTED)
    privileged = replace(runner, event_name=event)
    refused = privileged.run(ACTION)
    assert refused.exit_code == 2
    assert event in refused.annotations[0].message
    assert (refused.annotations[0].file, refused.annotations[0].line) == ("box.sim.yml", 3)
    assert not (runner.workspace / "pwned").exists()
    assert runner.run(ACTION, {"allow-scripts": "false"}).exit_code == 2
    assert privileged.run(ACTION, {"allow-scripts": "true"}).exit_code == 1
    assert (runner.workspace / "pwned").exists()


def test_reports_that_are_not_wanted(runner: Runner) -> None:
    write(runner.workspace / "stuck.sim.yml", STUCK.replace("30 s", "1 s"))
    inputs = {"summary": "false", "annotations": "false", "junit-path": "a/b.xml", "junit-strict": "true", "jobs": "1"}
    result = runner.run(ACTION, inputs)
    assert (result.exit_code, result.summary, result.annotations) == (1, "", ())
    case = ET.parse(runner.workspace / "a/b.xml").getroot().find(".//testcase")
    assert case is not None
    assert "file" not in case.attrib


def test_set_up_time_is_told(runner: Runner) -> None:
    result = runner.run(ACTION)
    assert re.search(r"^Set-up took \d+ s: Python \d+ s, install \d+ s, cache \d+ s$", result.log, re.MULTILINE)


def test_crash_of_a_scenario_is_an_error_of_its_own(runner: Runner) -> None:
    write(runner.workspace / "box.urdf", BOX)
    write(runner.workspace / "controller.py", "import os\n\ndef control(observation):\n    os.abort()\n")
    write(runner.workspace / "box.sim.yml", SCRIPTED)
    write(runner.workspace / "straight.sim.yml", TUTORIAL)
    result = runner.run(ACTION)
    assert result.exit_code == 1
    assert counts(result) == {"total": "2", "passed": "1", "failed": "0", "errors": "1"}
    assert "SIGABRT" in result.annotations[0].message
    assert float(result.outputs["duration"]) > 0
    assert float(result.outputs["real-time-factor"]) > 0


def test_modules_of_the_caller_do_not_stand_in_for_ours(runner: Runner) -> None:
    for name in ("click", "yaml", "sim_action", "sitecustomize"):
        write(runner.workspace / f"{name}.py", IMPOSTOR)
    write(runner.workspace / "straight.sim.yml", TUTORIAL)
    variables = {"PYTHONPATH": str(runner.workspace), "PYTHONHOME": str(runner.workspace)}
    result = Runner(runner.workspace, runner.temp, variables=variables).run(ACTION)
    assert result.exit_code == 0, result.log
    assert not (runner.workspace / "pwned").exists()


def test_second_use_in_a_job_installs_nothing(runner: Runner) -> None:
    configuration = environment(runner.temp) / "pyvenv.cfg"
    made = configuration.stat().st_mtime_ns
    runner.run(ACTION)
    assert configuration.stat().st_mtime_ns == made


def test_package_with_another_hash_is_refused(tmp_path: Path) -> None:
    action = action_with_lock(tmp_path / "action", f"click==8.1.8 --hash=sha256:{'0' * 64}\n")
    result = Runner(tmp_path, tmp_path).run(action)
    assert result.exit_code != 0
    assert result.steps[-1] == "Install dependencies"
    assert "DO NOT MATCH THE HASHES" in result.log
    assert "could not be installed" in result.annotations[0].message
    assert not list(tmp_path.glob("sim-action-*/requirements.lock"))


def action_with_lock(folder: Path, lock: str) -> Path:
    shutil.copytree(ACTION / "action", folder / "action")
    shutil.copy(ACTION / "action.yml", folder)
    write(folder / "requirements.lock", lock)
    return folder


def environment(temp: Path) -> Path:
    """Where the action has installed what simulates."""
    [marker] = temp.glob("sim-action-*/requirements.lock")
    return marker.parent


def test_wheels_are_kept_between_runs_and_checked_like_all_others(tmp_path: Path) -> None:
    # One small wheel without dependencies stands for all of them.
    lock = re.search(
        r"^mdurl==.*(?:\n +--hash.*)+", (ACTION / "requirements.lock").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert lock
    action = action_with_lock(tmp_path / "action", f"{lock[0]}\n")
    cache = CacheStore(tmp_path / "cache")

    def steps_on(machine: str, event: str = "push") -> tuple[str, ...]:
        temp = tmp_path / machine
        temp.mkdir()
        result = Runner(tmp_path, temp, event_name=event, cache=cache).run(action)
        assert list(temp.glob("sim-action-*/lib/python3.11/site-packages/mdurl")), result.log
        return result.steps

    assert "Restore wheels" not in steps_on("privileged", "pull_request_target")
    assert "Save wheels" not in steps_on("privileged too", "workflow_run")
    assert "Save wheels" in steps_on("first")
    assert "Save wheels" not in steps_on("second")
    [wheel] = (tmp_path / "cache").rglob("*.whl")
    wheel.write_bytes(b"poison")
    assert "Save wheels" in steps_on("third")


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
    inputs = {
        name: str(spec["default"])
        for name, spec in yaml.safe_load((ACTION / "action.yml").read_text())["inputs"].items()
    }
    inputs |= {"scenario": "endless.sim.yml", "output-directory": "out", "fail-on-failure": forgiving}
    variables = {
        **os.environ,
        "TMPDIR": str(scratch),
        "PYTHONPATH": str(ACTION),
        **{f"INPUT_{name.upper().replace('-', '_')}": value for name, value in inputs.items()},
    }
    command: list[str | Path] = [environment(runner.temp) / "bin/python", "-P", ACTION / "action/run.py", "run"]
    with subprocess.Popen(command, cwd=runner.workspace, env=variables) as process:
        wait_until_it_runs(process, scratch)
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=30) == 130
    [outcome] = json.loads((runner.workspace / "out/results.json").read_text(encoding="utf-8"))["outcomes"]
    assert outcome["failures"][0]["kind"] == "interrupted"


def wait_until_it_runs(process: subprocess.Popen[bytes], scratch: Path) -> None:
    while not list(scratch.rglob("output.txt")):
        assert process.poll() is None
        time.sleep(0.05)


def test_base_python_is_what_the_action_asks_for() -> None:
    version = subprocess.run([base_python(), "--version"], capture_output=True, text=True, check=True).stdout
    assert version.startswith("Python 3.11.")
