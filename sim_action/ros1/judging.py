"""From what a launch has left to outcomes: one for each test, with an expectation for each of its methods."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from sim_action.location import Location
from sim_action.messages import escaped_line
from sim_action.outcome import ExpectationOutcome, Outcome
from sim_action.ros1.causes import cause_of, how_far, time_out
from sim_action.ros1.findings import Findings, TestFound
from sim_action.ros1.printed import deaths, last_words
from sim_action.ros1.request import RosRequest
from sim_action.ros1.result_xml import Case
from sim_action.ros1.traceback_text import first_line, location_in
from sim_action.verdict import Verdict

_ASSERTION: Final = "rostest"
_LAUNCH: Final = "roslaunch"


@dataclass(frozen=True, slots=True)
class Judge:
    """What outcomes of a call have in common; `file`: the launch file, as reports call it."""

    request: RosRequest
    file: str
    wall_time: float

    def outcomes(self, found: Findings) -> Iterator[Outcome]:
        """Of each test; of a file without any, of what became of its launch."""
        if self.request.program == "roslaunch":
            yield self._launch(found)
        elif not found.tests:
            yield self._no_test(found)
        for test in found.tests if self.request.program == "rostest" else ():
            yield self._test(test, found)

    def _test(self, test: TestFound, found: Findings) -> Outcome:
        where = Location(self.file, test.tag.line if test.tag else None)
        expectations = tuple(self._expectations(test, found, where))
        is_over = expectations and (found.ending != "interrupted")
        failed = any(expected.failed for expected in expectations)
        run_failed = test.run is not None and test.run.told is not None and test.run.told.end == "failed"
        if not is_over or (run_failed and failed):
            about: dict[str, Any] = {"status": "error", "failures": (cause_of(test, found, where),)}
        else:
            about = {"status": "failed" if failed else "passed", "expectations": expectations}
        printed = "\n".join(filter(None, (test.methods.output if test.methods else "", last_words(found.text))))
        return self._outcome(f"{self.request.package}/{test.name}", test, where.line, {**about, "output": printed})

    def _expectations(self, test: TestFound, found: Findings, where: Location) -> Iterator[ExpectationOutcome]:
        late = time_out(test, found)
        cases = test.methods.cases if test.methods else ()
        for case in cases:
            yield self._expectation(case, test, where, late)
        if not cases and late is not None:
            yield _expected(test.name, where, Verdict(passed=False, message=late))

    def _expectation(self, case: Case, test: TestFound, where: Location, late: str | None) -> ExpectationOutcome:
        told = test.run.told if test.run else None
        time = told.sim_time if told else None
        if case.problem is None:
            return _expected(case.name, where, Verdict(passed=True, time=time, message="passed"))
        place = location_in(case.text, self.request.workspace) or where
        said = late or f"{first_line(case.type, case.text)}; {how_far(told)}"
        return _expected(case.name, place, Verdict(passed=False, time=time, message=escaped_line(said)))

    def _launch(self, found: Findings) -> Outcome:
        """Passed: it ran to its limit, or until all nodes had ended, and none of them by an error."""
        run = found.runs[-1] if found.runs else None
        test = TestFound(Path(self.file).name, None, None, None, run)
        where = Location(self.file)
        dead = [str(death) for death in deaths(found.text)]
        told = run.told if run else None
        is_whole = told is not None and told.end != "failed" and found.ending == "over"
        if dead or not is_whole:
            about: dict[str, Any] = {"status": "error", "failures": (cause_of(test, found, where),)}
        if is_whole:
            message = "; ".join(dead) or f"no node has died: {how_far(told)}"
            verdict = Verdict(passed=not dead, time=told.sim_time if told else None, message=escaped_line(message))
            expected = ExpectationOutcome(
                name="nodes live", assertion=_LAUNCH, severity="error", location=where, verdict=verdict
            )
            about = {"status": "passed" if verdict.passed else "failed", "expectations": (expected,)}
        about["output"] = last_words(found.text)
        return self._outcome(f"{self.request.package}/{test.name}", test, None, about)

    def _no_test(self, found: Findings) -> Outcome:
        name = f"{self.request.package}/{Path(self.file).name}"
        test = TestFound(name, None, None, None, found.runs[-1] if found.runs else None)
        failure = cause_of(None, found, Location(self.file))
        if found.exit_code == 0:
            message = "the file has no <test>; write one, or use sim-action roslaunch"
            failure = failure.model_copy(update={"kind": "invalid", "title": "no test", "message": message})
        return self._outcome(name, test, None, {"status": "error", "failures": (failure,)})

    def _outcome(self, name: str, test: TestFound, line: int | None, about: dict[str, Any]) -> Outcome:
        told = test.run.told if test.run else None
        measured: dict[str, Any] = {}
        if told is not None:
            kept = ("sim_time", "real_time_factor", "travelled", "digest", "engine", "notes")
            measured = {key: getattr(told, key) for key in kept} | {"end": told.end}
            if not told.in_step:
                measured["notes"] = (*told.notes, "lock-step was lost: the run is not deterministic")
        return Outcome(
            name=name,
            file=self.file,
            line=line,
            seed=self.request.seed,
            wall_time=self.wall_time,
            call=self.request.words,
            **measured,
            **about,
        )


def _expected(name: str, where: Location, verdict: Verdict) -> ExpectationOutcome:
    return ExpectationOutcome(
        name=name or "unnamed", assertion=_ASSERTION, severity="error", location=where, verdict=verdict
    )
