"""The action as a runner runs it: a real install from the lock file, real simulations."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
import yaml

from tests.app.test_margins import PUSHED
from tests.integration.conftest import ACTION, ASSERTION_LINE, INVALID, STUCK, TUTORIAL, counts, environment, write
from tests.integration.github import Runner
from tests.patience import PATIENCE, wait_until
from tests.soak import soaked


def test_a_pass_is_counted_and_its_results_are_where_the_outputs_say(runner: Runner) -> None:
    write(runner.workspace / "robot/straight.sim.yml", TUTORIAL)
    result = runner.run(ACTION, {"working-directory": "robot", "output-directory": "what came out"})
    assert result.exit_code == 0, result.log
    assert result.outputs["conclusion"] == "success"
    assert counts(result) == {"total": "1", "passed": "1", "failed": "0", "errors": "0"}
    assert float(result.outputs["travelled"]) >= 1.5
    assert "burger drives straight" in result.summary
    assert (result.annotations, result.exported) == ((), "")
    junit = runner.workspace / result.outputs["junit-path"]
    results = runner.workspace / result.outputs["results-path"]
    assert junit.parent == results.parent == runner.workspace / "robot/what came out"
    assert ET.parse(junit).getroot().get("failures") == "0"
    assert json.loads(results.read_text(encoding="utf-8"))["outcomes"][0]["status"] == "passed"


def test_failure_says_how_far_it_got_on_the_line_of_the_assertion(runner: Runner) -> None:
    write(runner.workspace / "my robot/stuck.sim.yml", STUCK)
    result = runner.run(ACTION, {"working-directory": "my robot"})
    assert result.exit_code == 1, result.log
    assert result.outputs["conclusion"] == "failure"
    assert counts(result) == {"total": "1", "passed": "0", "failed": "1", "errors": "0"}
    assert float(result.outputs["travelled"]) < 0.01
    [annotation] = result.annotations
    assert (annotation.level, annotation.file, annotation.line) == ("error", "my robot/stuck.sim.yml", ASSERTION_LINE)
    words = r"travelled 0\.00\d* m of 1\.5 m in 30\.0 s \(replay at 30\.00 s: report\.html#scenario=[\w%]+&t=30\)"
    assert re.fullmatch(words, annotation.message)
    assert annotation.message.partition(" (")[0] in result.summary


def test_an_invalid_scenario_is_not_forgiven_and_leaves_the_others_running(runner: Runner) -> None:
    write(runner.workspace / "invalid.sim.yml", INVALID)
    write(runner.workspace / "straight.sim.yml", TUTORIAL)
    result = runner.run(ACTION, {"fail-on-failure": "false"})
    assert result.exit_code == 2, result.log
    assert counts(result) == {"total": "2", "passed": "1", "failed": "0", "errors": "1"}
    assert result.outputs["travelled"] == ""
    [annotation] = result.annotations
    assert (annotation.file, annotation.line) == ("invalid.sim.yml", ASSERTION_LINE)
    assert "travle" in annotation.message


def test_failures_can_be_forgiven_and_reports_left_out(runner: Runner) -> None:
    write(runner.workspace / "stuck.sim.yml", STUCK.replace("30 s", "1 s"))
    inputs = {"summary": "false", "annotations": "false", "junit-path": "a/b.xml", "junit-strict": "true", "jobs": "1"}
    result = runner.run(ACTION, {**inputs, "fail-on-failure": "false"})
    assert (result.exit_code, result.outputs["conclusion"]) == (0, "failure"), result.log
    assert (result.summary, result.annotations) == ("", ())
    case = ET.parse(runner.workspace / "a/b.xml").getroot().find(".//testcase")
    assert case is not None
    assert "file" not in case.attrib


def test_the_input_margins_is_a_gate_with_reports_of_its_own(runner: Runner) -> None:
    write(runner.workspace / "push.sim.yml", f"name: push\n{PUSHED}")
    missed = runner.run(ACTION, {"margins": "friction=80%\npush"})
    assert (missed.exit_code, missed.outputs["conclusion"]) == (1, "failure"), missed.log
    assert counts(missed) == {"total": "1", "passed": "0", "failed": "1", "errors": "0"}
    folder = Path(missed.outputs["output-directory"])
    assert folder == runner.workspace / "sim-results/margins"
    assert {"margins.json", "report.html", "results.json"} <= {path.name for path in folder.iterdir()}
    assert ET.parse(missed.outputs["junit-path"]).getroot().get("failures") == "1"
    [annotation] = missed.annotations
    assert (annotation.file, annotation.line) == ("push.sim.yml", 6)
    assert annotation.message.startswith("fails already at 0.3057, 38.9 % below 0.5; 80 % below 0.5 was asked: object")
    for text in (annotation.message, "` push: ", "sim-action margins --at-least=friction=0.4 push.sim.yml"):
        assert text in missed.summary


STARTED = '"event":"started"'


@pytest.mark.parametrize("forgiving", soaked(["true", "false"], short=["true"]))
def test_cancelled_workflow_gets_its_reports(runner: Runner, forgiving: str) -> None:
    write(runner.workspace / "endless.sim.yml", STUCK.replace("30 s", "80000 s"))
    stated = yaml.safe_load((ACTION / "action.yml").read_text())["inputs"].items()
    inputs = {name: str(spec["default"]) for name, spec in stated}
    inputs |= {"scenario": "endless.sim.yml", "output-directory": "out", "fail-on-failure": forgiving}
    variables = {**os.environ, "PYTHONPATH": str(ACTION)}
    variables |= {f"INPUT_{name.upper().replace('-', '_')}": value for name, value in inputs.items()}
    command: list[str | Path] = [environment(runner.temp) / "bin/python", "-P", ACTION / "action/run.py", "run"]
    journal = runner.workspace / "out/results.jsonl"
    with subprocess.Popen(command, cwd=runner.workspace, env=variables) as process:
        wait_until(lambda: process.poll() is not None or (journal.exists() and STARTED in journal.read_text()))
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=PATIENCE) == 130
    [outcome] = json.loads((runner.workspace / "out/results.json").read_text(encoding="utf-8"))["outcomes"]
    assert outcome["failures"][0]["kind"] == "interrupted"
