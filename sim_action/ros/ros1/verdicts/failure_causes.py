"""The cause of a missing or void test result, found in everything that a launch has left."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final

from sim_action.core.errors import Location
from sim_action.core.wording import escaped_line
from sim_action.results.outcome import Failure
from sim_action.ros.program_failures import signal_name
from sim_action.ros.ros1.verdicts.findings import Findings, Run, TestFindings
from sim_action.ros.ros1.verdicts.launch_output import (
    Death,
    deaths,
    last_exception,
    missing_package,
    output_tail,
    refusal,
    required_deaths,
    xacro_error,
)

LAUNCH_ERROR: Final = "launch error"
"""The title of a failure of roslaunch itself."""

_SIMULATION_NODE: Final = "gazebo"
_TIME_OUT: Final = re.compile(r"max time \[([\d.]+)s\] allotted for test")
_NO_NODE: Final = re.compile(r"Test node \[(\S+)/(\S+)\] does not exist or is not executable")
_NO_PACKAGE: Final = re.compile(r"Package \[(\S+)\] for test node")


def how_far(run: Run | None) -> str:
    """Return how far the robot moved until the end, as text."""
    if run is None or run.result is None:
        return "the simulation did not start" if run is None else "the simulation wrote no result"
    result = run.result
    if result.travelled is None:
        return "no robot was spawned"
    silent = ", and no node had sent it a command" if result.first_command is None else ""
    return f"the robot had moved {result.travelled:.2f} m at sim time {result.sim_time:.1f} s{silent}"


def time_out(test: TestFindings, found: Findings) -> str | None:
    """Return the message of a test that a limit ended; None if no limit ended it."""
    result = test.run.result if test.run else None
    if result is not None and result.end == "time limit":
        return f"did not finish within {found.sim_time_limit:g} s of sim time: {how_far(test.run)}"
    if test.launched is not None and (limit := _TIME_OUT.search(test.launched.text)):
        return f"did not finish within its time-limit of {float(limit[1]):g} s of wall time: {how_far(test.run)}"
    if found.ending == "wall limit" and not (test.methods and test.methods.cases):
        return f"did not finish within the wall limit of the call: {how_far(test.run)}"
    return None


def cause_of(test: TestFindings, found: Findings, where: Location | None) -> Failure:
    """Return the reason why a test or a whole launch has no verdict; `where`: its place in the launch file."""
    return next(_causes(test, found, where))


def _causes(test: TestFindings, found: Findings, where: Location | None) -> Iterator[Failure]:
    if found.ending == "interrupted":
        yield Failure(kind="interrupted", title="interrupted", message="the call was interrupted", location=where)
    if found.ending == "output limit":
        message = "the nodes printed more than the allowed 100 MB"
        yield _failure("crash", "output limit", message, where, found)
    if found.ending == "over" and found.exit_code is not None and found.exit_code < 0:
        message = f"the launcher was ended by {signal_name(-found.exit_code)}; {how_far(test.run)}"
        yield _failure("crash", "launcher ended", message, where, found)
    if test.launched is not None:
        yield from _of_launch(test.launched.text, where)
    run = test.run
    if run is not None and run.result is not None and run.result.failure is not None:
        yield run.result.failure
    yield from _of_file(found, where)
    if run is not None and run.result is None:
        yield from _of_simulation(found, where)
    yield from _of_processes(test, found, where)
    far = how_far(run)
    yield _failure("crash", "no result", f"the test left no result; {far}", where, found)


def _of_launch(text: str, where: Location | None) -> Iterator[Failure]:
    """Yield failures that rostest finds before it starts anything."""
    if found := _NO_NODE.search(text):
        package, node = found.groups()
        message = (
            f"the test '{node}' does not exist in the package '{package}', or is not executable: run chmod +x {node} "
            f"and git update-index --chmod=+x {node}"
        )
        yield Failure(kind="invalid", title="no such test", message=escaped_line(message), location=where)
    if found := _NO_PACKAGE.search(text):
        message = f"there is no package '{found[1]}' in the workspace or in ROS"
        yield Failure(kind="invalid", title="no such package", message=escaped_line(message), location=where)
    if "Duplicate tests named" in text:
        message = "several tests of this file have this name; give each test its own test-name"
        yield Failure(kind="invalid", title="duplicate test name", message=message, location=where)


def _of_file(found: Findings, where: Location | None) -> Iterator[Failure]:
    if wrong := xacro_error(found.text):
        yield _failure("invalid", "xacro error", wrong, where, found)
    if name := missing_package(found.text):
        message = f"the launch file needs the package '{name}', which is neither in the workspace nor in ROS"
        yield _failure("invalid", "no such package", message, where, found)
    if wrong := refusal(found.text):
        yield _failure("invalid", LAUNCH_ERROR, wrong, where, found)


def _of_simulation(found: Findings, where: Location | None) -> Iterator[Failure]:
    for death in deaths(found.text):
        if death.node == _SIMULATION_NODE:
            yield _failure("crash", "simulation ended", _described(death, found), where, found)


def _of_processes(test: TestFindings, found: Findings, where: Location | None) -> Iterator[Failure]:
    for death in required_deaths(found.text):
        message = f"{_described(death, found)}; it is required"
        yield _failure("script", "a required node died", message, where, found)
    for death in deaths(found.text):
        if death.node == test.name:
            yield _failure("script", "the test died", _described(death, found), where, found)


def _described(death: Death, found: Findings) -> str:
    exception = last_exception(found.text, death.program)
    return f"{death}: {exception}" if exception else str(death)


def _failure(kind: str, title: str, message: str, where: Location | None, found: Findings) -> Failure:
    details = output_tail(found.text)
    return Failure.model_validate(
        {"kind": kind, "title": title, "message": escaped_line(message), "location": where, "details": details}
    )
