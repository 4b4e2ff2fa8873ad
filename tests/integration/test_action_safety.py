"""What strangers can write into inputs, names, models and scripts stays text."""

from __future__ import annotations

import itertools
import json
import re
from dataclasses import replace
from xml.etree import ElementTree as ET
from xml.sax.saxutils import quoteattr

import pytest

from tests.integration.conftest import ACTION, BOX, IMPOSTOR, SCRIPTED, STUCK, TUTORIAL, counts, write
from tests.integration.github import ActionResult, Runner
from tests.soak import soaked

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
FLAGS = ["junit-strict", "seed", "jobs", "shard", "summary", "annotations", "fail-on-failure", "cache", "allow-scripts"]
HOSTILE_CHOICES = [*HOSTILE[:2], "true\n::error::forged\n##[error]forged", HOSTILE[4]]
CHATTER = "::error::forged\n##[error]forged\n::set-output name=conclusion::forged\n::stop-commands::forged\n"


ALL_HOSTILE = "/".join([HOSTILE[5], *HOSTILE[:5], *HOSTILE[6:]])
ALL_CHOICES = dict(zip(FLAGS, itertools.cycle(HOSTILE_CHOICES), strict=False))
HOSTILE_BY_CHOICE = [{name: text} for name, text in itertools.product(FLAGS, HOSTILE_CHOICES)]


@pytest.mark.parametrize("text", soaked([ALL_HOSTILE, *HOSTILE], short=[ALL_HOSTILE]))
def test_paths_are_paths_whatever_is_in_them(runner: Runner, text: str) -> None:
    write(runner.workspace / text / "straight.sim.yml", TUTORIAL)
    as_folder = runner.run(ACTION, folders(text))
    assert as_folder.exit_code == 0, as_folder.log
    assert as_folder.outputs["junit-path"] == str(runner.workspace / text / text / "junit.xml")
    assert (runner.workspace / text / text / "out/results.json").is_file()
    assert_harmless(as_folder, runner)


def folders(text: str) -> dict[str, str]:
    """Inputs that name folders and files."""
    return {"working-directory": text, "output-directory": f"{text}/out", "junit-path": f"{text}/junit.xml"}


ALL_SCENARIOS = {"scenario": "\n".join(HOSTILE)}
MISSING = [ALL_SCENARIOS, *({"scenario": text} for text in HOSTILE)]
MISSING += [folders(text) for text in (ALL_HOSTILE, *HOSTILE)]


@pytest.mark.parametrize("inputs", soaked(MISSING, short=[ALL_SCENARIOS, folders(ALL_HOSTILE)]))
def test_missing_scenarios_and_folders_are_paths_whatever_is_in_them(runner: Runner, inputs: dict[str, str]) -> None:
    write(runner.workspace / "straight.sim.yml", TUTORIAL)
    result = runner.run(ACTION, inputs)
    assert result.exit_code in ({2, 5} if "scenario" in inputs else {2}), result.log
    assert_harmless(result, runner)


@pytest.mark.parametrize("choices", soaked([ALL_CHOICES, *HOSTILE_BY_CHOICE], short=[ALL_CHOICES]))
def test_choices_are_refused_and_not_executed(runner: Runner, choices: dict[str, str]) -> None:
    write(runner.workspace / "straight.sim.yml", TUTORIAL)
    result = runner.run(ACTION, choices)
    assert result.exit_code != 0
    assert not list(runner.workspace.rglob("results.json"))
    assert_harmless(result, runner)


def assert_harmless(result: ActionResult, runner: Runner) -> None:
    """Nothing was executed, no command was injected, no output forged."""
    assert not list(runner.workspace.rglob("pwned"))
    assert "Usage: sim-action [OPTIONS]" not in result.log
    assert "##[" not in result.log
    assert "forged" not in {annotation.message for annotation in result.annotations}
    assert result.outputs.get("conclusion", "") in {"", "success", "failure"}


def test_names_of_strangers_are_nothing_but_names(runner: Runner) -> None:
    model = BOX.replace("base", quoteattr("::error::forged ##[error]forged $(touch pwned)")[1:-1])
    write(runner.workspace / "box.urdf", model)
    write(runner.workspace / "controller.py", f"def control(observation):\n    print({CHATTER!r})\n    return None\n")
    for number, text in enumerate([*HOSTILE, "::error::forged", "::stop-commands::forged"]):
        folder, short = runner.workspace / text / "below", STUCK.replace("30 s", "1 s")
        write(folder / f"{text}.sim.yml", short)
        write(folder / "named.sim.yml", short.replace("burger drives straight", json.dumps(f"{text}|{number}")))
    write(runner.workspace / "box.sim.yml", SCRIPTED)
    result = runner.run(ACTION)
    assert result.exit_code == 2, result.log
    assert counts(result)["passed"] == "0"
    errors = [annotation for annotation in result.annotations if annotation.level == "error"]
    assert len(errors) == 10
    assert all(annotation.file for annotation in errors[:-1])
    assert "more" in errors[-1].message
    assert result.outputs["conclusion"] == "failure"
    assert_harmless(result, runner)
    # In a block of code, which is a command to be copied, text is text.
    blocks = re.compile(r"^(?P<fence>`{3,})[^`\n]*\n.*?^(?P=fence)$", re.MULTILINE | re.DOTALL)
    assert "<script" not in blocks.sub("", result.summary)
    junit = ET.parse(result.outputs["junit-path"]).getroot()
    assert junit.get("tests") == str(len(list(junit.iter("testcase"))))


EVENTS = ["pull_request_target", "workflow_run"]  # tests/core/test_permissions.py has all of them


@pytest.mark.parametrize("event", soaked(EVENTS, short=EVENTS[:1]))
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
    assert privileged.run(ACTION, {"allow-scripts": "true"}).exit_code == 1
    assert (runner.workspace / "pwned").exists()


@pytest.mark.parametrize("event", soaked(EVENTS, short=EVENTS[:1]))
def test_nodes_of_strangers_wait_for_permission(runner: Runner, event: str) -> None:
    refused = replace(runner, event_name=event).run(ACTION / "rostest", ROSTEST)
    assert refused.exit_code == 2
    assert refused.annotations[0].message.startswith("rostest runs nodes and launch files: scripts are not run on")
    assert event in refused.annotations[0].message
    refused = runner.run(ACTION / "rostest", {**ROSTEST, "allow-scripts": "false"})
    assert "allow-scripts is false" in refused.annotations[0].message


ROSTEST = {"package": "robot", "file": "a.test", "ros1": "false"}


@pytest.mark.parametrize("text", soaked(HOSTILE, short=HOSTILE[:1]))
def test_inputs_of_rostest_are_text(runner: Runner, text: str) -> None:
    inputs = {"package": text, "file": text, "arguments": text, "sim-time-limit": text}
    result = runner.run(ACTION / "rostest", {**ROSTEST, **inputs})
    assert result.exit_code == 2, result.log
    assert_harmless(result, runner)


def test_modules_of_the_caller_do_not_stand_in_for_ours(runner: Runner) -> None:
    for name in ("click", "yaml", "sim_action", "sitecustomize"):
        write(runner.workspace / f"{name}.py", IMPOSTOR)
    write(runner.workspace / "straight.sim.yml", TUTORIAL)
    variables = {"PYTHONPATH": str(runner.workspace), "PYTHONHOME": str(runner.workspace)}
    result = Runner(runner.workspace, runner.temp, variables=variables).run(ACTION)
    assert result.exit_code == 0, result.log
    assert not (runner.workspace / "pwned").exists()


@pytest.mark.parametrize("text", soaked(HOSTILE, short=HOSTILE[5:6]))
def test_inputs_of_matrix_and_merge_are_text(runner: Runner, text: str) -> None:
    write(runner.workspace / text / f"{text}.sim.yml", TUTORIAL)
    inputs = {"shards": "2", "scenario": f"{text}.sim.yml", "working-directory": text, "durations": text}
    dealt = runner.run(ACTION / "matrix", inputs)
    assert dealt.exit_code == 0, dealt.log
    assert json.loads(dealt.outputs["matrix"])["include"][0]["scenario"] == f"{text}.sim.yml"
    paths = {"results": text, "scenario": text, "output-directory": f"{text}/out", "junit-path": f"{text}/junit.xml"}
    joined = runner.run(ACTION / "merge", paths)
    assert joined.exit_code == 2
    for result in (dealt, joined):
        assert_harmless(result, runner)
