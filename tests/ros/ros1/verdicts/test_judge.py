"""Outcomes of launches and tests from their findings, without ROS."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from sim_action.core.errors import Location
from sim_action.results.outcome import Failure, Outcome
from sim_action.ros.launches import LaunchRequest, Program
from sim_action.ros.result_files import Case, Suite
from sim_action.ros.ros1.launch.launch_process import Ending
from sim_action.ros.ros1.launch_request import SimulationResult
from sim_action.ros.ros1.verdicts import findings, judge
from sim_action.ros.ros1.verdicts.findings import Findings, LaunchTag, LaunchTags, Run
from sim_action.ros.ros1.verdicts.judge import AbsentNodes, Judge, _with_callbacks
from sim_action.ros.ros1.verdicts.launch_output import CallbackError
from sim_action.world.world_files.losses import Loss
from tests.ros.ros1.launches import package

WORLD = LaunchTag("arg", {"name": "world_name", "value": "$(find p)/no.world"}, Location("a.launch", 2))
LOSS = Loss(message="<actor> is not simulated", location=Location("a.world", 5))
ABSENT = "ERROR: cannot launch node of type [nowhere/no.py]: nowhere\n"
ERROR = "ERROR: cannot launch node of type [{}]: {}\n"
PLACE = Location("a.launch", 3)
looks_for_ros = pytest.mark.process  # ROS is looked for with its own Python


def judged(
    program: Program = "roslaunch",
    *,
    text: str = "",
    allows_losses: bool = False,
    ending: Ending = "over",
    suite: Suite | None = None,
    callbacks: tuple[CallbackError, ...] = (),
    **more: Any,
) -> Outcome:
    result = SimulationResult.model_validate({"end": "time limit", "sim_time": 1.0, "travelled": 0.5, **more})
    run = Run(Path("1"), result)
    tests = (findings.TestFindings("t", methods=suite, run=run, callbacks=callbacks),) if program == "rostest" else ()
    found = Findings(ending, 0, tests, (run,), text)
    request = LaunchRequest(program, "p", "a.launch", allows_losses=allows_losses)
    ((outcome, _),) = Judge(request, LaunchTags("a.launch", (WORLD,)), 1.0).outcomes(found)
    return outcome


HELD = Suite((Case("test_it"),))
BOTH: list[tuple[Program, Suite | None]] = [("roslaunch", None), ("rostest", HELD)]


@pytest.mark.parametrize("suite", [None, Suite((Case("test_it", "error", "KeyboardInterrupt"),))])
def test_the_wall_limit_is_an_error_and_no_verdict(suite: Suite | None) -> None:
    outcome = judged("rostest", suite=suite, ending="wall limit", end="nodes finished")
    (failure,) = outcome.failures
    assert (outcome.status, failure.kind) == ("error", "wall limit")
    assert "the robot had moved 0.50 m at sim time 1.0 s" in failure.message
    assert "raise --wall-limit" in failure.message


def test_a_test_beyond_its_limit_of_sim_time_fails() -> None:
    outcome = judged("rostest", end="time limit", sim_time=2.0, sim_time_limit=2.0)
    (expected,) = outcome.expectations
    assert outcome.status == "failed"
    assert "did not finish within 2 s of sim time: the robot had moved 0.50 m" in expected.verdict.message


@pytest.mark.parametrize(
    ("node", "exception", "status"),
    [
        ("t", "AssertionError: 0.21 not less than 0.2", "failed"),
        ("ns-t", "AssertionError", "failed"),
        ("t", "ValueError: 'burger' is not in list", "passed"),
        ("driver", "AssertionError: no plan", "passed"),
    ],
)
def test_an_assertion_of_the_test_that_fails_in_a_callback_fails_it(node: str, exception: str, status: str) -> None:
    outcome = judged("rostest", suite=HELD, callbacks=(CallbackError(node, exception, PLACE, 50),))
    assert outcome.status == status
    if status == "failed":
        (failed,) = outcome.causes
        assert (failed.name, failed.location) == ("callbacks", PLACE)
        assert f"raised 50 times: {exception}" in failed.verdict.message


DIED = "[it-3] process has died [pid 9, exit code 1, cmd p/dies.py __name:=it].\nValueError: no map\n"
DIED_WINDOW = "[it-3] process has died [pid 9, exit code -6, cmd /opt/ros/noetic/lib/rviz/rviz __name:=it].\n"


@pytest.mark.parametrize(
    ("text", "first_command", "allows_losses", "status", "rules"),
    [
        (DIED, None, False, "error", []),
        (DIED, None, True, "passed", ["node-failed"]),
        (DIED, 0.5, False, "passed", ["node-failed"]),
        (DIED_WINDOW, None, False, "passed", []),
        ("[it-3] process has finished cleanly\n", None, False, "passed", []),
    ],
)
def test_a_test_whose_only_driver_died_is_an_error_and_other_deaths_are_warnings(
    text: str, first_command: float | None, allows_losses: bool, status: str, rules: list[str]
) -> None:
    outcome = judged("rostest", text=text, suite=HELD, allows_losses=allows_losses, first_command=first_command)
    messages = [*(failure.message for failure in outcome.failures), *map(str, outcome.warnings)]
    assert (outcome.status, [warning.rule for warning in outcome.warnings]) == (status, rules)
    assert all("the node 'it' ended with exit code 1" in message for message in messages)


def test_an_error_of_the_test_in_its_own_callback_is_a_warning() -> None:
    raised = CallbackError("t", "ValueError: 'burger' is not in list", PLACE, 50)
    outcome = judged("rostest", suite=HELD, callbacks=(raised,))
    assert [(warning.rule, warning.location) for warning in outcome.warnings] == [("node-failed", PLACE)]


@pytest.mark.parametrize(("allows_losses", "status"), [(False, "not_exercised"), (True, "passed")])
def test_a_topic_without_a_publisher_is_not_exercised(allows_losses: bool, status: str) -> None:
    outcome = judged("rostest", suite=Suite(HELD.cases, unpublished=("/scan",)), allows_losses=allows_losses)
    assert (outcome.status, outcome.expectations[-1].name) == (status, "/scan")
    assert "'/scan', which no node published" in outcome.expectations[-1].verdict.message


@pytest.mark.parametrize(("program", "suite"), BOTH)
def test_a_loss_is_an_error_unless_it_is_allowed_and_a_finding_is_a_warning(
    program: Program, suite: Suite | None
) -> None:
    lost = judged(program, suite=suite, losses=(LOSS,))
    (failure,) = lost.failures
    assert (lost.status, lost.exit_code, lost.expectations) == ("error", 2, ())
    assert (failure.title, failure.location and failure.location.line) == ("not simulated", 5)
    assert "--allow-losses" in failure.message
    allowed = judged(program, suite=suite, losses=(LOSS,), allows_losses=True)
    (kept,), (warning,) = allowed.expectations, allowed.warnings
    assert (allowed.status, allowed.exit_code) == ("passed", 0)
    assert (kept.verdict.passed, warning.message, warning.location) == (True, LOSS.message, LOSS.location)
    still = judged(program, suite=suite, claims={"never-moved": "it never moved"})
    (warning,) = still.warnings
    assert (still.status, still.exit_code) == ("passed", 0)
    assert (str(warning), warning.location.file) == ("it never moved [never-moved]", "a.launch")


@pytest.mark.process
@pytest.mark.parametrize(("program", "suite"), BOTH)
def test_a_node_that_was_not_started_is_a_loss(program: Program, suite: Suite | None) -> None:
    assert judged(program, suite=suite, text=ABSENT).status == "error"
    assert judged(program, suite=suite, text=ABSENT, allows_losses=True).status == "passed"


def test_a_run_that_stopped_for_its_losses_names_each_once() -> None:
    failure = Failure(kind="invalid", title="not simulated", message="parts are missing")
    outcome = judged(end="failed", failure=failure, losses=(LOSS,))
    assert [each.message.split(";")[0] for each in outcome.failures] == [LOSS.message]


def test_a_missing_world_has_the_place_that_names_it() -> None:
    failure = Failure(kind="invalid", title="no such world", message="the world file '/ws/no.world' does not exist")
    outcome = judged(end="failed", failure=failure, missing_world="/ws/no.world", travelled=None)
    (found,) = outcome.failures
    assert (outcome.status, outcome.exit_code) == ("error", 2)
    assert found.location == Location("a.launch", 2)


@pytest.mark.parametrize("suite", [None, Suite(())])
def test_a_test_without_a_method_does_not_pass(suite: Suite | None) -> None:
    outcome = judged("rostest", suite=suite, end="test finished")
    assert (outcome.status, outcome.exit_code) == ("error", 1)
    assert "no" in outcome.failures[0].title


def test_a_test_that_passes_without_its_simulation_does_not_pass() -> None:
    failure = Failure(kind="invalid", title="the simulation cannot start", message="no such link")
    outcome = judged("rostest", suite=HELD, end="failed", failure=failure)
    assert (outcome.status, outcome.exit_code) == ("error", 2)


PASSED, SKIPPED = Case("test_a"), Case("test_b", "skipped", "pytest.skip", "no lidar")


def test_skipped_cases_are_not_exercised_or_a_warning_beside_others() -> None:
    def judged_cases(*cases: Case) -> Outcome:
        return judged("rostest", suite=Suite(cases))

    skipped, some = judged_cases(SKIPPED), judged_cases(PASSED, SKIPPED)
    assert skipped.status == "not_exercised"
    why = "never checked: the test skipped this case (no lidar); let it run, or remove it"
    assert skipped.expectations[0].verdict.message == why
    assert (some.status, some.display_status) == ("passed", "warned")
    assert [expected.status for expected in some.expectations] == ["passed", "warned"]
    failed = judged_cases(PASSED, SKIPPED, Case("test_c", "failure", "AssertionError", "0 != 1"))
    assert (failed.status, judged_cases(PASSED).display_status) == ("failed", "passed")


def test_a_failure_names_three_callbacks_that_raised() -> None:
    raised = tuple(CallbackError("/node", f"Error: {number}", None, 1) for number in range(4))
    said = _with_callbacks("0 != 1", findings.TestFindings("t", callbacks=raised))
    assert said == "; ".join(("0 != 1", *map(str, raised[:3])))


def absent(folder: Path, text: str, **given: str) -> AbsentNodes:
    tag = LaunchTag("node", {"pkg": "pkg", "type": "no.py", "name": "driver", **given}, PLACE)
    return AbsentNodes.of(text, LaunchTags("a.launch", (tag,)), folder)


@looks_for_ros
def test_a_required_node_that_does_not_exist_is_an_invalid_launch(tmp_path: Path) -> None:
    package(tmp_path, "pkg", {"now.py": ""})
    found = absent(tmp_path, ERROR.format("pkg/no.py", "Cannot locate node"), required="true")
    (failure,) = found.failures
    assert (failure.kind, failure.location, found.losses) == ("invalid", PLACE, ())
    assert failure.message == (
        "the node 'driver' (pkg/no.py) was not started: the package 'pkg' has no node 'no.py'; "
        "did you mean 'now.py'? (allowed: now.py); add the file, or correct its name; the node is required"
    )


@pytest.mark.parametrize("required", ["false", "0", ""])
@looks_for_ros
def test_another_node_is_a_loss_where_it_is_known_to_stand(required: str, tmp_path: Path) -> None:
    package(tmp_path, "pkg", {"no.py": ""}).joinpath("no.py").chmod(0o644)
    text = ERROR.format("pkg/no.py", "Cannot locate node") + ERROR.format("elsewhere/x", "elsewhere")
    found = absent(tmp_path, text, required=required)
    here, elsewhere = found.losses
    assert (here.location, elsewhere.location, found.failures) == (PLACE, Location("a.launch"), ())
    assert "'no.py' of 'pkg' is not executable; run chmod +x no.py" in here.message
    assert "elsewhere" in elsewhere.message


@looks_for_ros
def test_a_program_for_a_person_that_is_not_installed_is_no_loss(tmp_path: Path) -> None:
    names = ("rviz", "rqt_robot_steering", "image_view", "teleop_twist_keyboard", "turtlebot3_teleop")
    text = "".join(ERROR.format(f"{name}/{name}", name) for name in names)
    assert absent(tmp_path, f"{text}process[driver-1]: started with pid [7]\n") == AbsentNodes()


def test_every_window_has_a_reason() -> None:
    for pattern, reason in judge.WINDOW_PACKAGES.items():
        assert re.compile(pattern)
        assert reason
