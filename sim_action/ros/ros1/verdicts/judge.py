"""Outcomes of a launch: one for each test, with an expectation for each of its methods.

The cause of a missing or void result is found in everything that a launch has left. roslaunch prints an error for a
node that it could not start, and goes on without it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePath
from typing import Any, Final

from sim_action.core.errors import Location
from sim_action.core.provenance import Provenance, provenance
from sim_action.core.records import dataclass
from sim_action.core.version import __version__
from sim_action.core.wording import escaped_line
from sim_action.engines import ENGINES
from sim_action.results.outcome import ExpectationOutcome, Failure, Outcome, status_of
from sim_action.robot.documents.xml_document import shown_file
from sim_action.ros.launches import ALLOW_LOSSES, LaunchRequest
from sim_action.ros.program_failures import exception_line, signal_name, traceback_location
from sim_action.ros.result_files import Case, expectation, expectation_of
from sim_action.ros.ros1.command_source.file_problems import Packages, program_problem
from sim_action.ros.ros1.launch_request import TITLE, loss_failures, loss_warnings
from sim_action.ros.ros1.verdicts.findings import Findings, LaunchTags, Run, TestFindings
from sim_action.ros.ros1.verdicts.launch_output import (
    Death,
    NotLaunched,
    deaths,
    last_exception,
    missing_package,
    nodes_not_launched,
    output_tail,
    refusal,
    required_deaths,
    xacro_error,
)
from sim_action.state.verdict import Judged, Verdict
from sim_action.world.claims import NODE_FAILED, AuditWarning
from sim_action.world.world_files.losses import Loss

_MAX_CALLBACKS: Final = 3
_MAX_NODES: Final = 20
_RESULT_FIELDS: Final = ("end", "sim_time", "real_time_factor", "travelled", "digest", "engine", "notes")
LAUNCH_ERROR: Final = "launch error"  # the title of a failure of roslaunch itself
_SIMULATION_NODE: Final = "gazebo"
_TIME_OUT: Final = re.compile(r"max time \[([\d.]+)s\] allotted for test")
_NO_NODE: Final = re.compile(r"Test node \[(\S+)/(\S+)\] does not exist or is not executable")
_NO_PACKAGE: Final = re.compile(r"Package \[(\S+)\] for test node")
_FALSE: Final = frozenset({"", "false", "0"})

WINDOW_PACKAGES: Final[Mapping[str, str]] = {
    "rviz": "it draws what others publish",
    "rqt_.*": "it draws what others publish, or sends what a person types",
    "plotjuggler.*": "it draws what others publish",
    "image_view": "it shows images to a person",
    "joint_state_publisher_gui": "it sends what a person sets",
    "(.*_)?teleop(_.*)?": "it sends what a person types",
}
"""Package of a program with a window, as a regular expression -> the reason why its absence is not a loss."""


@dataclass(frozen=True, slots=True)
class Judge:
    """The data that all outcomes of a call share; `tags`: of the launch file."""

    request: LaunchRequest
    tags: LaunchTags
    wall_time: float

    def outcomes(self, findings: Findings) -> list[tuple[Outcome, Run | None]]:
        """Return the outcome and the run of each test, or of the whole launch if there is no test."""
        if self.request.program == "rostest" and findings.tests:
            judged = [(self._test(test, findings), test) for test in findings.tests]
        else:
            run = findings.runs[-1] if findings.runs else None
            whole = TestFindings(PurePath(self.tags.file).name, run=run, callbacks=findings.callbacks)
            judge = self._launch if self.request.program == "roslaunch" else self._no_test
            judged = [(judge(whole, findings), whole)]
        absent = AbsentNodes.of(findings.text, self.tags, self.request.workspace)
        return [(self._with_losses(outcome, test.run, absent), test.run) for outcome, test in judged]

    def _with_losses(self, outcome: Outcome, run: Run | None, absent: AbsentNodes) -> Outcome:
        """Return an outcome with all that was not launched or simulated: errors, or warnings if allowed."""
        result = run.result if run else None
        losses = (*absent.losses, *map(_with_shown_place, result.losses if result else ()))
        refused = (*absent.failures, *(() if self.request.allows_losses else loss_failures(losses)))
        if refused:
            # rostest stops at the first node that cannot be started.
            titles = {TITLE, LAUNCH_ERROR} if absent.failures or absent.losses else {TITLE}
            others = tuple(failure for failure in outcome.failures if failure.title not in titles)
            failures = (*refused, *others)
            return outcome.model_copy(update={"status": "error", "failures": failures, "expectations": ()})
        if outcome.status == "error":
            return outcome
        where = Location(self.tags.file)
        claims = result.claims if result else {}
        audited = (AuditWarning(rule=rule, message=message, location=where) for rule, message in claims.items())
        return outcome.model_copy(update={"warnings": (*outcome.warnings, *loss_warnings(losses, where), *audited)})

    def _test(self, test: TestFindings, findings: Findings) -> Outcome:
        where = Location(self.tags.file, test.tag.line if test.tag else None)
        expectations = (*_accepting_skips(self._expectations(test, findings, where)), *self._unpublished(test, where))
        failed = any(expected.failed for expected in expectations)
        dead = [death for death in deaths(findings.text) if death.node not in (test.name, _SIMULATION_NODE)]
        failed_nodes = [_described(death, findings) for death in dead if not _is_window(death)]
        has_command = test.run is None or test.run.result is None or test.run.result.first_command is not None
        printed = "\n".join(filter(None, (test.methods.output if test.methods else "", output_tail(findings.text))))
        has_written = test.methods is not None and findings.ending == "over" and not _has_failed(test.run)
        if has_written and not expectations:
            rule = "the names of its methods must begin with 'test', and its setUpClass must not raise"
            message = escaped_line(f"the test '{test.name}' ran no method: {rule}")
            failure = Failure(kind="script", title="no test ran", message=message, location=where)
            about: dict[str, Any] = {"status": "error", "failures": (failure,)}
        elif (
            not expectations
            or findings.ending == "interrupted"
            or (failed and (_has_failed(test.run) or _is_cut(test, findings)))
            or _is_invalid(test.run)
        ):
            about = {"status": "error", "failures": (cause_of(test, findings, where),)}
        elif failed_nodes and not failed and not has_command and not self.request.allows_losses:
            message = (
                f"{failed_nodes[0]}; the robot received no command in the whole test; to run without it: {ALLOW_LOSSES}"
            )
            about = {"status": "error", "failures": (_failure("script", "a node died", message, where, findings),)}
        else:
            own = (raised for raised in test.callbacks if raised.is_of(test.name) and not raised.is_assertion)
            noted = [(text, where) for text in failed_nodes] + [(str(raised), raised.location) for raised in own]
            warnings = (
                AuditWarning(rule=NODE_FAILED, message=escaped_line(text), location=place or where)
                for text, place in noted[:_MAX_NODES]
            )
            about = {"status": status_of(expectations), "expectations": expectations, "warnings": tuple(warnings)}
        return self._outcome(test, {**about, "line": where.line, "output": printed})

    def _expectations(self, test: TestFindings, findings: Findings, where: Location) -> Iterator[ExpectationOutcome]:
        late = time_out(test)
        cases = test.methods.cases if test.methods else ()
        for case in cases:
            yield self._expectation(case, test, where, late)
        if not cases and late is not None:
            verdict = Verdict(passed=False, time=_sim_time(test.run), message=_with_callbacks(late, test))
            yield expectation(test.name, "rostest", _place(test) or where, verdict)

        # rospy goes on after a callback that raised, so methods may hold although an assertion of the test does not.
        own = [error for error in test.callbacks if error.is_assertion and error.is_of(test.name)] if cases else []
        if own:
            verdict = Verdict(passed=False, time=_sim_time(test.run), message="; ".join(map(str, own[:_MAX_CALLBACKS])))
            yield expectation("callbacks", "rostest", own[0].location or where, verdict)

    def _unpublished(self, test: TestFindings, where: Location) -> Iterator[ExpectationOutcome]:
        """Yield an expectation for each topic that the test listened to and that no node published."""
        for topic in test.methods.unpublished if test.methods else ():
            message = f"never checked: the test listens to '{topic}', which no node published"
            verdict = Verdict(False, message=escaped_line(message), judged=Judged())
            expected = expectation(topic, "rostest", where, verdict)
            yield expected.model_copy(update={"unexercised": "warn"}) if self.request.allows_losses else expected

    def _expectation(self, case: Case, test: TestFindings, where: Location, late: str | None) -> ExpectationOutcome:
        time = _sim_time(test.run)
        if case.problem in (None, "skipped"):
            return expectation_of(case, "rostest", where, time)
        place = traceback_location(case.text, self.request.workspace) or _place(test) or where
        said = late or f"{exception_line(case.type, case.text)}; {how_far(test.run)}"
        return expectation_of(case, "rostest", place, time, _with_callbacks(said, test))

    def _launch(self, whole: TestFindings, findings: Findings) -> Outcome:
        """Return the outcome of roslaunch: passed if it ran to its limit, or all nodes ended without an error."""
        where, run = Location(self.tags.file), whole.run
        is_simulated = run is not None and run.result is not None and run.result.travelled is not None
        if not is_simulated or _has_failed(run) or findings.ending != "over":
            failures = (cause_of(whole, findings, where),)
            return self._outcome(whole, {"status": "error", "failures": failures, "output": output_tail(findings.text)})
        dead = "; ".join(str(death) for death in deaths(findings.text) if not _is_window(death))
        verdict = Verdict(passed=not dead, time=_sim_time(run), message=escaped_line(dead or how_far(run)))
        about = {
            "status": "failed" if dead else "passed",
            "expectations": (expectation("nodes live", "roslaunch", where, verdict),),
            "output": output_tail(findings.text),
        }
        return self._outcome(whole, about)

    def _no_test(self, whole: TestFindings, findings: Findings) -> Outcome:
        failure = cause_of(whole, findings, Location(self.tags.file))
        if findings.exit_code == 0:
            message = "the file has no <test>; add one, or use sim-action roslaunch"
            failure = failure.model_copy(update={"kind": "invalid", "title": "no test", "message": message})
        return self._outcome(whole, {"status": "error", "failures": (failure,)})

    def _outcome(self, test: TestFindings, about: dict[str, Any]) -> Outcome:
        result = test.run.result if test.run else None
        measured = {key: getattr(result, key) for key in _RESULT_FIELDS} if result else {}
        if result and result.missing_world and (failures := about.get("failures")):
            # Only the launch file says where the world is named.
            path = Path(result.missing_world)
            place = self.tags.world(result.missing_world)
            message = failures[0].message.replace(str(path), shown_file(path))
            about["failures"] = (failures[0].model_copy(update={"location": place, "message": message}),)
        measured["notes"] = (*measured.get("notes", ()), *map(str, test.callbacks))
        return Outcome(
            name=f"{self.request.package}/{test.name}",
            file=self.tags.file,
            seed=self.request.seed,
            wall_time=self.wall_time,
            call=self.request.words,
            provenance=_provenance(result.engine) if result else None,
            **measured,
            **about,
        )


def _with_shown_place(loss: Loss) -> Loss:
    """Return a loss with its file as reports show it; the node runs in another folder."""
    place = loss.location
    if place is None:
        return loss
    shown = Location(shown_file(Path(place.file).resolve()), place.line, place.column)
    return loss.model_copy(update={"location": shown})


def _with_callbacks(said: str, test: TestFindings) -> str:
    return "; ".join((said, *map(str, test.callbacks[:_MAX_CALLBACKS])))


def _place(test: TestFindings) -> Location | None:
    return test.callbacks[0].location if test.callbacks else None


def _provenance(engine: str | None) -> Provenance | None:
    row = ENGINES.get((engine or "").partition(" ")[0].lower())
    return provenance(row.distribution, __version__) if row else None


def _has_failed(run: Run | None) -> bool:
    return run is not None and (run.result is None or run.result.end == "failed")


def _is_cut(test: TestFindings, findings: Findings) -> bool:
    """Return True if the wall limit has ended this test, which says nothing about its robot."""
    return findings.ending == "wall limit" and (not findings.runs or test.run == findings.runs[-1])


def _is_invalid(run: Run | None) -> bool:
    failure = run.result.failure if run and run.result else None
    return failure is not None and failure.kind == "invalid"


def _sim_time(run: Run | None) -> float | None:
    return run.result.sim_time if run and run.result else None


def _accepting_skips(expectations: Iterable[ExpectationOutcome]) -> tuple[ExpectationOutcome, ...]:
    """Return the expectations of a test; skipped cases are warnings, unless the test skipped all of them."""
    outcomes = tuple(expectations)
    if all(expected.verdict.status == "not_exercised" for expected in outcomes):
        return outcomes
    return tuple(expected.model_copy(update={"unexercised": "warn"}) for expected in outcomes)


def how_far(run: Run | None) -> str:
    """Return how far the robot moved until the end, as text."""
    if run is None or run.result is None:
        return "the simulation did not start" if run is None else "the simulation wrote no result"
    result = run.result
    if result.travelled is None:
        return "no robot was spawned"
    silent = ", and no node had sent it a command" if result.first_command is None else ""
    return f"the robot had moved {result.travelled:.2f} m at sim time {result.sim_time:.1f} s{silent}"


def time_out(test: TestFindings) -> str | None:
    """Return the message of a test that a limit ended; None if no limit ended it."""
    result = test.run.result if test.run else None
    if result is not None and result.end == "time limit":
        return f"did not finish within {result.sim_time_limit or result.sim_time:g} s of sim time: {how_far(test.run)}"
    if test.launched is not None and (limit := _TIME_OUT.search(test.launched.text)):
        return f"did not finish within its time-limit of {float(limit[1]):g} s of wall time: {how_far(test.run)}"
    return None


def cause_of(test: TestFindings, findings: Findings, where: Location | None) -> Failure:
    """Return the reason why a test or a whole launch has no verdict; `where`: its place in the launch file."""
    return next(_causes(test, findings, where))


def _causes(test: TestFindings, findings: Findings, where: Location | None) -> Iterator[Failure]:
    if findings.ending == "interrupted":
        yield Failure(kind="interrupted", title="interrupted", message="the call was interrupted", location=where)
    if findings.ending == "wall limit":
        message = (
            f"the call was still running at its wall limit: {how_far(test.run)}; look what the nodes wait for, or "
            "raise --wall-limit"
        )
        yield _failure("wall limit", "wall limit", message, where, findings)
    if findings.ending == "output limit":
        message = "the nodes printed more than the allowed 100 MB"
        yield _failure("crash", "output limit", message, where, findings)
    if findings.ending == "over" and findings.exit_code is not None and findings.exit_code < 0:
        message = f"the launcher was ended by {signal_name(-findings.exit_code)}; {how_far(test.run)}"
        yield _failure("crash", "launcher ended", message, where, findings)
    if test.launched is not None:
        yield from _of_launch(test.launched.text, where)
    run = test.run
    if run is not None and run.result is not None and run.result.failure is not None:
        yield run.result.failure
    yield from _of_file(findings, where)
    if run is not None and run.result is None:
        for death in deaths(findings.text):
            if death.node == _SIMULATION_NODE:
                yield _failure("crash", "simulation ended", _described(death, findings), where, findings)
    yield from _of_processes(test, findings, where)
    far = how_far(run)
    yield _failure("crash", "no result", f"the test left no result; {far}", where, findings)


def _of_launch(text: str, where: Location | None) -> Iterator[Failure]:
    """Yield failures that rostest finds before it starts anything."""
    if match := _NO_NODE.search(text):
        package, node = match.groups()
        message = (
            f"the test '{node}' does not exist in the package '{package}', or is not executable: run chmod +x {node} "
            f"and git update-index --chmod=+x {node}"
        )
        yield Failure(kind="invalid", title="no such test", message=escaped_line(message), location=where)
    if match := _NO_PACKAGE.search(text):
        message = f"there is no package '{match[1]}' in the workspace or in ROS"
        yield Failure(kind="invalid", title="no such package", message=escaped_line(message), location=where)
    if "Duplicate tests named" in text:
        message = "several tests of this file have this name; give each test its own test-name"
        yield Failure(kind="invalid", title="duplicate test name", message=message, location=where)


def _of_file(findings: Findings, where: Location | None) -> Iterator[Failure]:
    if wrong := xacro_error(findings.text):
        yield _failure("invalid", "xacro error", wrong, where, findings)
    if name := missing_package(findings.text):
        message = f"the launch file needs the package '{name}', which is neither in the workspace nor in ROS"
        yield _failure("invalid", "no such package", message, where, findings)
    if wrong := refusal(findings.text):
        yield _failure("invalid", LAUNCH_ERROR, wrong, where, findings)


def _of_processes(test: TestFindings, findings: Findings, where: Location | None) -> Iterator[Failure]:
    for death in required_deaths(findings.text):
        message = f"{_described(death, findings)}; it is required"
        yield _failure("script", "a required node died", message, where, findings)
    for death in deaths(findings.text):
        if death.node == test.name:
            yield _failure("script", "the test died", _described(death, findings), where, findings)


def _described(death: Death, findings: Findings) -> str:
    exception = last_exception(findings.text, death.program)
    return f"{death}: {exception}" if exception else str(death)


def _failure(kind: str, title: str, message: str, where: Location | None, findings: Findings) -> Failure:
    details = output_tail(findings.text)
    return Failure.model_validate(
        {"kind": kind, "title": title, "message": escaped_line(message), "location": where, "details": details}
    )


@dataclass(frozen=True, slots=True)
class AbsentNodes:
    """The nodes that were not started: failures for required ones, which are errors in any case, and losses."""

    failures: tuple[Failure, ...] = ()
    losses: tuple[Loss, ...] = ()

    @classmethod
    def of(cls, text: str, tags: LaunchTags, workspace: Path) -> AbsentNodes:
        """Return the nodes that the output of a launch reports."""
        nodes = [node for node in nodes_not_launched(text) if not _has_window(node.package)]
        if not nodes:
            return cls()
        packages = Packages.around(workspace.resolve())
        failures = list[Failure]()
        losses = list[Loss]()
        for node in nodes:
            tag = tags.node(node.package, node.program)
            place = tag.place if tag else Location(tags.file)
            message = _message(node, tag.attributes.get("name", node.program) if tag else node.program, packages)
            if tag and tag.attributes.get("required", "").strip().lower() not in _FALSE:
                message = f"{message}; the node is required"
                failures.append(Failure(kind="invalid", title="no such node", message=message, location=place))
            else:
                losses.append(Loss(message=message, location=place))
        return cls(tuple(failures), tuple(losses))


def _is_window(death: Death) -> bool:
    return any(map(_has_window, PurePath(death.program).parts))


def _has_window(package: str) -> bool:
    return any(re.fullmatch(pattern, package) for pattern in WINDOW_PACKAGES)


def _message(node: NotLaunched, name: str, packages: Packages) -> str:
    reason = packages.missing_message(node.package) or program_problem(node.package, node.program, packages)
    return escaped_line(f"the node '{name}' ({node.package}/{node.program}) was not started: {reason or node.reason}")
