"""Why there is no result of a test, or none that counts, as far as what a launch has left tells it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final

from sim_action.location import Location
from sim_action.messages import escaped_line
from sim_action.outcome import Failure
from sim_action.ros1.exchange import NodeRun
from sim_action.ros1.findings import Findings, TestFound
from sim_action.ros1.printed import deaths, last_exception, last_words, refused, xacro_error

_TIME_OUT: Final = re.compile(r"max time \[([\d.]+)s\] allotted for test")
_NO_NODE: Final = re.compile(r"Test node \[(\S+)/(\S+)\] does not exist or is not executable")
_NO_PACKAGE: Final = re.compile(r"Package \[(\S+)\] for test node")


def how_far(run: NodeRun | None) -> str:
    """What is known of the robot at the end."""
    if run is None:
        return "no simulation was begun"
    if run.travelled is None:
        return "no robot was spawned" if run.sim_time == 0 else f"sim time was {run.sim_time:.1f} s"
    silent = "; no node had commanded it" if run.first_command is None else ""
    return f"the robot had come {run.travelled:.2f} m at sim time {run.sim_time:.1f} s{silent}"


def time_out(test: TestFound, found: Findings) -> str | None:
    """The message of a test that was ended by a limit; None: it was not."""
    told = test.run.told if test.run else None
    if told is not None and told.end == "time limit":
        return f"not over within {told.sim_time:g} s of sim time: {how_far(told)}"
    if test.launched is not None and (limit := _TIME_OUT.search(test.launched.text)):
        return f"not over within its time-limit of {float(limit[1]):g} s of wall time: {how_far(told)}"
    if found.ending == "wall limit" and not (test.methods and test.methods.cases):
        return f"not over within the wall limit of the call: {how_far(told)}"
    return None


def cause_of(test: TestFound | None, found: Findings, where: Location | None) -> Failure:
    """Why there is no verdict on a test, or on the whole launch; `where`: its place in the launch file."""
    return next(_causes(test, found, where))


def _causes(test: TestFound | None, found: Findings, where: Location | None) -> Iterator[Failure]:
    if found.ending == "interrupted":
        yield Failure(kind="interrupted", title="interrupted", message="the call was interrupted", location=where)
    if found.ending == "output limit":
        message = "the nodes have printed more than 100 MB"
        yield _failure("crash", "output limit", message, where, found)
    if test is not None and test.launched is not None:
        yield from _of_launch(test.launched.text, where)
    run = test.run if test else next(iter(reversed(found.runs)), None)
    if run is not None and run.told is not None and run.told.failure is not None:
        yield run.told.failure
    yield from _of_file(found, where)
    yield from _of_processes(test, found, where)
    if run is not None and run.told is None and found.ending != "wall limit":
        yield _failure("crash", "simulation ended", "the node 'gazebo' has ended without a word", where, found)
    exception = last_exception(found.text)
    message = f"the last that was printed: {exception}" if exception else "nothing says why"
    far = how_far(run.told if run else None)
    yield _failure("crash", "no result", f"there is no result; {message}; {far}", where, found)


def _of_launch(text: str, where: Location | None) -> Iterator[Failure]:
    """What rostest finds out before it starts anything."""
    if found := _NO_NODE.search(text):
        package, node = found.groups()
        message = (
            f"the test '{node}' of the package '{package}' is not there, or not executable: chmod +x {node}, and "
            f"git update-index --chmod=+x {node}"
        )
        yield Failure(kind="invalid", title="no such test", message=escaped_line(message), location=where)
    if found := _NO_PACKAGE.search(text):
        message = f"there is no package '{found[1]}' in the workspace or in ROS"
        yield Failure(kind="invalid", title="no such package", message=escaped_line(message), location=where)
    if "Duplicate tests named" in text:
        message = "several tests of this file have this name; give each test-name= of its own"
        yield Failure(kind="invalid", title="a name used twice", message=message, location=where)


def _of_file(found: Findings, where: Location | None) -> Iterator[Failure]:
    if wrong := xacro_error(found.text):
        yield _failure("invalid", "xacro error", wrong, where, found)
    if wrong := refused(found.text):
        yield _failure("invalid", "launch error", wrong, where, found)


def _of_processes(test: TestFound | None, found: Findings, where: Location | None) -> Iterator[Failure]:
    dead = sorted(deaths(found.text), key=lambda death: not death.required)
    for death in dead:
        own = test is not None and death.node == test.name
        if not (death.required or own):
            continue
        exception = last_exception(found.text)
        said = f"; the last that it said: {exception}" if exception else ""
        what = "the test" if own else "a required node"
        yield _failure("script", f"{what} died", f"{death}{said}", where, found)


def _failure(kind: str, title: str, message: str, where: Location | None, found: Findings) -> Failure:
    details = last_words(found.text)
    return Failure.model_validate(
        {"kind": kind, "title": title, "message": escaped_line(message), "location": where, "details": details}
    )
