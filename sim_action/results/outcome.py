"""The result of running one scenario: status, verdicts of its expectations, failures, measurements and files."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, Self, get_args

from pydantic import Field, JsonValue

from sim_action.core.errors import ExitCode, InternalError, InvalidScenario, Location, MissingScenario, Problem
from sim_action.core.field_types import FrozenModel
from sim_action.core.provenance import Provenance
from sim_action.core.wording import escaped_line
from sim_action.scenario.model import Severity, Unexercised
from sim_action.scenario.selection import Unmatched
from sim_action.scenario.source import Refused, Source, Variation
from sim_action.state.timeline import MAX_TIME_MARKS, TimeMark
from sim_action.state.verdict import Verdict, VerdictStatus
from sim_action.world.claims import AuditWarning

if TYPE_CHECKING:
    from sim_action.assertions import Assertion
    from sim_action.scenario.model import Expectation, Scenario

Count = Annotated[int, Field(ge=0)]
Share = Annotated[float, Field(ge=0, le=1)]


class GateStatistics(FrozenModel):
    """The counts of a gate.

    Attributes:
        planned: the number of runs of the gate.
        runs: the number of runs that were counted; less than planned if a sequential test decided before.
        passed, failed: the runs with these verdicts.
        errors: the runs without a verdict, flaky ones included.
        not_exercised: the runs in which an expectation was never judged.
        rate: the share of passed runs.
        lower, upper: the bounds of the true rate, each one-sided at `confidence`; None after a sequential test, whose
            runs have no such bounds.
        decision: the result of a sequential test; None for a fixed number of runs, or if it did not decide.
    """

    planned: Count
    runs: Count
    passed: Count
    failed: Count
    errors: Count
    not_exercised: Count
    rate: Share
    confidence: Share
    lower: Share | None = None
    upper: Share | None = None
    decision: Literal["accepted", "rejected"] | None = None

    @property
    def without_verdict(self) -> int:
        """The number of counted runs that neither passed nor failed."""
        return self.errors + self.not_exercised


Status = Literal["error", "failed", "flaky", "inconclusive", "not_exercised", "passed", "skipped"]
"""The status of a scenario, the worst first; every status before "passed" gives exit code 1 or worse.

- error: there is no verdict; `Outcome.failures` gives the reasons.
- failed: at least one expectation with severity "error" did not hold, or a strict run has a warning.
- flaky: repeated runs gave different results.
- inconclusive: the runs of a gate neither show nor refute what it claims, or a repetition for the numerical confidence
  could change the verdict.
- not_exercised: nothing failed, but at least one expectation with severity "error" was never judged.
- passed: every expectation with severity "error" was judged and held.
- skipped: the scenario was not run, because another one had failed or its gate was decided. It stands outside the
  order.
"""

DisplayStatus = Literal["error", "failed", "flaky", "inconclusive", "not_exercised", "warned", "skipped", "passed"]
"""The status as reports show it, the worst first; "warned" is a pass with a warning."""

WORST_FIRST: Final[tuple[DisplayStatus, ...]] = get_args(DisplayStatus)
"""All statuses, in the order in which reports list scenarios."""

ExpectationStatus = Literal["failed", "inconclusive", "not_exercised", "warned", "passed"]
"""The status of an expectation, the worst first; "warned": it did not pass, but it must not fail the scenario."""

FailureKind = Literal[
    "invalid",
    "engine",
    "unstable",
    "missed contact",
    "script",
    "crash",
    "wall limit",
    "memory",
    "interrupted",
    "internal",
    "missing",
    "flaky",
]
"""The kind of a failure; "missing": a shard should have run the scenario, but left no result of it."""

NOT_FOUND: Final = "not found"  # the title of the failure of a scenario whose file or folder does not exist
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class Failure(FrozenModel):
    """The reason why a scenario has no verdict.

    Attributes:
        title: a word or two, such as "invalid scenario" or "SIGSEGV".
        location: the place to fix, if it is known.
        details: the last output of the process, or the traceback of a script, for people.
        time: the sim time in s of the failure, if known; for a flaky scenario the time at which its runs diverged.
    """

    kind: FailureKind
    title: str
    message: str
    location: Location | None = None
    details: str = ""
    time: float | None = None

    @classmethod
    def of_fault(cls, fault: InternalError) -> Self:
        """Return the failure for an error that no scenario explains."""
        return cls(kind=fault.kind, title=fault.title, message=str(fault), details=fault.details)


class Diagnostic(FrozenModel):
    """A message that the engine printed while it loaded or simulated."""

    level: Literal["warning", "error", "note"]
    message: str


class Scope(FrozenModel):
    """The keys of an expectation that say what part of a run it judges.

    Attributes:
        after, before: the window in s of sim time; `before` is None if it has no end.
        held: the time in s for which a goal must hold; None if one moment is enough.
        allowed: the names in `allow`, sorted; pairs are joined by "with".
        end: the time in s at which a window without `before` ends at the latest; None if only a goal ends the run.
        stated: what the assertion states: path of a key -> value in SI units. Empty in older results.
        since: the name of the event from which on it judges; empty without one.
    """

    after: float = 0.0
    before: float | None = None
    held: float | None = None
    allowed: tuple[str, ...] = ()
    end: float | None = None
    stated: dict[str, JsonValue] = Field(default_factory=dict)
    since: str = ""

    @classmethod
    def of(cls, expected: Expectation, scenario: Scenario) -> Self:
        """Return the scope of an expectation of a scenario."""
        before = None if math.isinf(expected.before) else expected.before
        held = expected.assertion.hold_time if expected.span is None else expected.span
        end: float | None = scenario.time_limit
        if not expected.assertion.is_goal and (
            scenario.duration is not None or any(expectation.assertion.is_goal for expectation in scenario.expect)
        ):
            end = scenario.duration
        return cls(
            # The time of an event is a result.
            after=0.0 if expected.since else expected.after,
            before=before,
            held=held,
            allowed=tuple(sorted(_allowed(expected.assertion))),
            end=end,
            stated=dict(_stated(expected.assertion)),
            since=expected.since,
        )


def _stated(assertion: Assertion, path: str = "") -> Iterator[tuple[str, JsonValue]]:
    parts = getattr(assertion, "placed_parts", ())
    for number, (_, part) in enumerate(parts):
        yield f"{path}{number}", part.key
        yield from _stated(part, f"{path}{number}.{part.key}.")
    if not parts:
        yield from flattened(assertion.model_dump(mode="json", exclude_defaults=True, exclude={"allow"}), path)


def flattened(stated: Mapping[str, JsonValue], path: str = "") -> Iterator[tuple[str, JsonValue]]:
    """Yield the path of each key below nested maps and lists, with its value; `path`: before each."""
    for key, value in stated.items():
        listed = {str(number): entry for number, entry in enumerate(value)} if isinstance(value, list) else value
        if isinstance(listed, dict):
            yield from flattened(listed, f"{path}{key}.")
        else:
            yield f"{path}{key}", value


def _allowed(assertion: Assertion) -> set[str]:
    allowed = {
        contact if isinstance(contact, str) else " with ".join(sorted(contact))
        for contact in getattr(assertion, "allow", ())
    }
    return allowed.union(*(_allowed(part) for _, part in getattr(assertion, "placed_parts", ())))


class Spread(FrozenModel):
    """The values of an expectation in one repetition, and what its change leaves open.

    Attributes:
        cause: the change of the repetition, such as "half the step".
        status: the status of its verdict; None: it has none.
        measured, margin: its values in `unit`, an SI symbol; of a goal that was met, the time and the time left, in s.
        low, high: the bounds of the margin of the run itself; None: its values cannot be compared.
        is_decided: True if the change leaves no other verdict open.
        note: a remark for people, such as an extrapolated value; or empty.
    """

    cause: str
    status: VerdictStatus | None = None
    measured: float | None = None
    margin: float | None = None
    unit: str = ""
    low: float | None = None
    high: float | None = None
    is_decided: bool = True
    note: str = ""


def repetition_name(scenario: str, cause: str) -> str:
    """Return the name of a run that is repeated with a change."""
    return f"{scenario} [{cause}]"


class Repetition(FrozenModel):
    """A run that was repeated with a change, to find the numerical confidence of verdicts.

    Attributes:
        cause: the change, such as "half the step".
        ending: the result in words.
        replay: named as `Outcome.replay`; None if there is none.
        The others are as in its outcome.
    """

    cause: str
    status: Status
    ending: str
    sim_time: NotNegative | None = None
    wall_time: NotNegative = 0.0
    engine: str | None = None
    digest: str | None = None
    replay: str | None = None


class ExpectationOutcome(FrozenModel):
    """One expectation and its verdict.

    Attributes:
        location: the place of the assertion in the scenario file.
        unexercised: "warn" if the scenario accepts that this expectation is never judged.
        inconclusive: "warn" if the scenario accepts that a repetition could change this verdict.
        spreads: what repetitions say about the margin, by cause; empty if there are none.
        scope: the part of a run that it judges; None if it is not an entry of `expect`, and in older results.
    """

    name: str
    assertion: str
    severity: Severity
    location: Location
    verdict: Verdict
    unexercised: Unexercised = "error"
    inconclusive: Unexercised = "error"
    spreads: tuple[Spread, ...] = ()
    scope: Scope | None = None

    @property
    def status(self) -> ExpectationStatus:
        """The status: the verdict, softened by the severity and by `unexercised`."""
        status = self.verdict.status
        if status == "passed":
            return "passed"
        accepted = {"not_exercised": self.unexercised, "inconclusive": self.inconclusive}.get(status)
        return "warned" if accepted == "warn" or self.severity == "warning" else status

    @property
    def display_status(self) -> DisplayStatus:
        """The status in reports: another failure is the reason where the expectation was cut off."""
        return "skipped" if self.verdict.cut_off else self.status

    @property
    def message(self) -> str:
        """The sentence of the verdict."""
        return self.verdict.message

    @property
    def failed(self) -> bool:
        """Return True if this expectation was judged and makes the scenario fail."""
        return self.status == "failed"

    @property
    def prevents_pass(self) -> bool:
        """Return True if the scenario cannot pass because of this expectation: it failed, or nothing was decided."""
        return self.status in ("failed", "inconclusive", "not_exercised")

    @property
    def warned(self) -> bool:
        """Return True if the expectation did not pass but must not make the scenario fail."""
        return self.status == "warned"


class Measurement(FrozenModel):
    """A value that a run measured for information. It has no limit, so it is neither a pass nor a failure.

    Attributes:
        name: the name in reports, such as "distance to mujoco 4.0".
        measured: the value in `unit`, an SI symbol.
        time: the sim time in s at which it was measured.
        message: one sentence for people.
        left: of the margins of a factor: the parts of its range, 0 to 1, that are left below and above its value; None:
            there is no such side.
    """

    name: str
    measured: Annotated[float, Field(allow_inf_nan=False)]
    unit: str = ""
    time: float | None = None
    message: str = ""
    left: tuple[Share | None, Share | None] | None = None


_WORSE: Final[tuple[Status, ...]] = ("failed", "inconclusive", "not_exercised")


def status_of(expectations: Iterable[ExpectationOutcome]) -> Status:
    """Return the status of a scenario that has verdicts: the worst status of its expectations."""
    statuses = {expected.status for expected in expectations}
    return next((status for status in _WORSE if status in statuses), "passed")


class Repeats(FrozenModel):
    """The repeated runs of one scenario, each in a fresh interpreter.

    Attributes:
        count: number of runs.
        agreed: number of runs with the same motion of the robot and the same verdicts.
        digests: number of different digests.
        replay: the replay of the first run that differs, named as `Outcome.replay`; None if there is none.
    """

    count: Annotated[int, Field(ge=2)]
    agreed: Annotated[int, Field(ge=1)]
    digests: Annotated[int, Field(ge=0)]
    replay: str | None = None


def _stated_by(source: Source | Refused) -> dict[str, Any]:
    stated = {name: getattr(source, name) for name in ("name", "line", "number", "group", "tags", "variation")}
    return {**stated, "gate": None if source.gate is None else source.gate.name}


class Outcome(FrozenModel):
    """The result of running one scenario.

    Attributes:
        name: the name of the scenario, or of its file if the file could not be read.
        file: the path as given on the command line or found below it; empty if the outcome belongs to no single file.
        line: the line where the scenario begins, in a file with several scenarios.
        number: the position of the scenario in its file, counted from 1; each variation counts as one.
        group: the name of the scenario that is varied, if this is a variation.
        tags: the tags of the scenario.
        variation: the exact values of this variation.
        gate: the name of the gate that judges this run together with others; the run does not count by itself.
        statistics: the counts and bounds of a gate, if this is the outcome of the gate itself.
        marks: what acted on the robot or changed its surroundings, in the order of time.
        events: name of each event -> the sim times in s at which it happened.
        actors: name of each other robot of the world -> its model.
        measurements: the values that were measured for information only; nothing judged them.
        failures: the reasons why there is no verdict; empty unless `status` is "error" or "flaky".
        end: the reason for the end of the run: "goals met", "expectation failed", "duration", "event", "time limit" or
            "controllers finished"; with ROS 1 nodes "test finished", "nodes finished", "time limit" or "failed".
        sim_time: the sim time in s at the end of the run.
        wall_time: the wall time in s of the process, loading included; the sum if the scenario was run repeatedly.
        real_time_factor: sim time divided by wall time, measured over the simulation loop alone.
        travelled: the distance in m between the first and the last position of the robot on the ground plane.
        seed: the random seed of the run.
        scenario_seed: the seed of the scenario, from which `seed` is derived, if this is one of its samples.
        surroundings: what the scenario states around its expectations: rules in `allow`, and the keys of its world
            as in `Scope.stated`; of a variation, only the rules.
        digest: the SHA-256 hash of the state at every physics step, and of the messages that nodes sent.
        motion: figures of the robot's motion, in SI units, if this is a variation: a gate compares its runs by them.
        engine: name and version of the engine that ran it, also if there is no verdict; None if none was selected.
        repeats: the repeated runs; this outcome describes the first run, or the first of the runs that agree.
        repetitions: the runs with a change that show the numerical confidence of the verdicts.
        provenance: the versions and the machine that produced the run.
        warnings: the parts of the scenario that checked nothing in this run.
        strict: True if each of its warnings makes it fail.
        notes, model_notes: assumptions and remarks; those on the robot model that every report shows.
        diagnostics: messages of the engine.
        output: the end of the text that the user's code printed.
        trace: the path of the stored trace, relative to the results file.
        replay: the path of the stored replay, relative to the results file.
        recordings: the paths of the recordings for other tools, relative to the results file.
        call: the arguments of the command that runs this outcome again; empty if `sim-action run` does.
    """

    name: str
    file: str
    line: Annotated[int, Field(ge=1)] | None = None
    number: Annotated[int, Field(ge=1)] | None = None
    group: str | None = None
    tags: tuple[str, ...] = ()
    variation: Variation = ()
    gate: str | None = None
    statistics: GateStatistics | None = None
    status: Status
    expectations: tuple[ExpectationOutcome, ...] = ()
    marks: Annotated[tuple[TimeMark, ...], Field(max_length=MAX_TIME_MARKS)] = ()
    events: dict[str, tuple[float, ...]] = Field(default_factory=dict)
    actors: dict[str, str] = Field(default_factory=dict)
    measurements: tuple[Measurement, ...] = ()
    failures: tuple[Failure, ...] = ()
    end: str | None = None
    sim_time: NotNegative | None = None
    wall_time: NotNegative = 0.0
    real_time_factor: NotNegative | None = None
    travelled: NotNegative | None = None
    seed: int | None = None
    scenario_seed: int | None = None
    surroundings: dict[str, JsonValue] = Field(default_factory=dict)
    digest: str | None = None
    motion: tuple[float, ...] = ()
    repeats: Repeats | None = None
    repetitions: tuple[Repetition, ...] = ()
    engine: str | None = None
    provenance: Provenance | None = None
    warnings: tuple[AuditWarning, ...] = ()
    strict: bool = False
    notes: tuple[str, ...] = ()
    model_notes: tuple[str, ...] = ()
    diagnostics: tuple[Diagnostic, ...] = ()
    output: str = ""
    trace: str | None = None
    replay: str | None = None
    recordings: tuple[str, ...] = ()
    call: tuple[str, ...] = ()

    @property
    def is_sample(self) -> bool:
        """Return True if a gate judges this run together with others."""
        return self.gate is not None and self.statistics is None

    @property
    def simulated(self) -> float:
        """The total sim time in s of all its runs."""
        repeated = (self.sim_time or 0.0) * (self.repeats.count if self.repeats else 1)
        return repeated + sum(repetition.sim_time or 0.0 for repetition in self.repetitions)

    @property
    def causes_first(self) -> tuple[ExpectationOutcome, ...]:
        """All expectations in file order, except that undecided (cut off) ones come last."""
        return tuple(sorted(self.expectations, key=lambda expected: expected.verdict.cut_off))

    @property
    def not_passed(self) -> tuple[ExpectationOutcome, ...]:
        """The expectations that did not pass, the worst status first; undecided (cut off) ones come last."""
        bad = [expected for expected in self.expectations if expected.status != "passed"]
        return tuple(sorted(bad, key=lambda expected: (expected.verdict.cut_off, WORST_FIRST.index(expected.status))))

    @property
    def causes(self) -> tuple[ExpectationOutcome, ...]:
        """The expectations that prevent a pass, in the order of `not_passed`, without the expectations they cut off."""
        bad = (expected for expected in self.not_passed if expected.prevents_pass)
        return tuple(expected for expected in bad if not expected.verdict.cut_off)

    def message_of(self, expected: ExpectationOutcome) -> str:
        """Return the message of an expectation, with the one that cut it off, if any."""
        message = expected.verdict.message
        cause = next(iter(self.causes), None)
        return f"cut off by {cause.name}: {message}" if cause and expected.verdict.cut_off else message

    @property
    def failing_warnings(self) -> tuple[AuditWarning, ...]:
        """The warnings that make it fail."""
        return self.warnings if self.strict else ()

    def judged_strictly(self, accepted: str) -> Self:
        """Return the outcome as if the run were strict; warnings of the rule `accepted` become notes."""
        notes = (*self.notes, *(str(warning) for warning in self.warnings if warning.rule == accepted))
        warnings = tuple(warning for warning in self.warnings if warning.rule != accepted)
        strict = self.model_copy(update={"strict": True, "warnings": warnings, "notes": notes})
        return strict if self.status == "error" else strict.model_copy(update={"status": strict.judged_status()})

    def judged_status(self, *, is_varied: bool = False) -> Status:
        """Return the status that its expectations and, if it is strict, its warnings give.

        `is_varied`: True for a variation alone: it does not know the warnings that count only if all variations have
        them.
        """
        failing = [warning for warning in self.failing_warnings if not (is_varied and warning.is_over_variations)]
        return "failed" if failing else status_of(self.expectations)

    @property
    def reasons(self) -> tuple[str, ...]:
        """The sentences that say why it did not pass, the most important first."""
        failures = (f"{failure.title}: {failure.message}" for failure in self.failures)
        return (*failures, *(expected.message for expected in self.causes), *map(str, self.failing_warnings))

    @property
    def ending(self) -> str:
        """The status with its first reason, such as "failed (travelled 1.2 m of 1.5 m)"."""
        status = "ended in an error" if self.status == "error" else self.status.replace("_", " ")
        return f"{status} ({self.reasons[0]})" if self.reasons else status

    @property
    def has_verdict(self) -> bool:
        """Return True if the expectations were judged and the judgement is reliable."""
        return self.status in ("passed", "failed", "inconclusive", "not_exercised")

    @property
    def display_status(self) -> DisplayStatus:
        """The status for display."""
        if self.status != "passed":
            return self.status
        return "warned" if self.warnings or any(expected.warned for expected in self.expectations) else "passed"

    @property
    def exit_code(self) -> ExitCode:
        """The exit code of a process with only this outcome; a sample counts by itself only if it could not run."""
        kinds = {failure.kind for failure in self.failures}
        if "interrupted" in kinds:
            return ExitCode.INTERRUPTED
        if "internal" in kinds:
            return ExitCode.INTERNAL
        if kinds & {"invalid", "missing"}:
            return ExitCode.INVALID
        return ExitCode.PASSED if self.status == "passed" or self.is_sample else ExitCode.FAILED

    @property
    def location(self) -> Location | None:
        """The file and line of the scenario; None if it belongs to no single file, or to one that does not exist."""
        missing = any(failure.title == NOT_FOUND for failure in self.failures)
        return Location(self.file, self.line) if self.file and not missing else None

    @classmethod
    def of_invalid(cls, file: str, error: InvalidScenario) -> Outcome:
        """Return the outcome for a file that is not a valid scenario."""
        missing = isinstance(error, MissingScenario)
        title = NOT_FOUND if missing else "invalid scenario"
        failures = tuple(
            Failure(
                kind="invalid",
                title=title,
                message=problem.message,
                location=None if missing and problem.location.line is None else problem.location,
            )
            for problem in error.problems
        )
        return cls(name=Path(file).name, file=file, status="error", failures=failures)

    @classmethod
    def of_refused(cls, refused: Refused) -> Outcome:
        """Return the outcome for a scenario that cannot be run."""
        if isinstance(refused.error, InternalError):
            failure = Failure.of_fault(refused.error)
            outcome = cls(name=refused.name, file=refused.file, status="error", failures=(failure,))
        else:
            outcome = cls.of_invalid(refused.file, refused.error)
        return outcome.model_copy(update=_stated_by(refused))

    @classmethod
    def of_source(cls, source: Source, *failures: Failure) -> Outcome:
        """Return the outcome of a scenario that has no verdict; `failures`: the reasons."""
        return cls(file=source.document.file, status="error", failures=failures, **_stated_by(source))

    @classmethod
    def of_nothing(cls, pattern: str) -> Outcome:
        """Return the outcome for a path or pattern on the command line that matches no scenario."""
        name = escaped_line(pattern)
        problem = Problem(Location(name), f"no scenario found at '{name}'; correct the path or remove it")
        return cls.of_invalid(name, MissingScenario([problem]))

    @classmethod
    def of_unmatched(cls, unmatched: Unmatched) -> Outcome:
        """Return the outcome for a pattern of names, or a tag, that selects no scenario."""
        failure = Failure(kind="invalid", title="nothing selected", message=escaped_line(unmatched.message))
        unreadable = cls.of_invalid("", InvalidScenario(unmatched.unreadable)).failures
        return cls(name=unmatched.name, file="", status="error", failures=(failure, *unreadable))
