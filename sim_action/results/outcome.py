"""Outcomes: what became of each scenario."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field

from sim_action.core.errors import ExitCode, Fault, InvalidScenario, Location, Problem
from sim_action.core.field_types import FrozenModel
from sim_action.core.messages import escaped_line
from sim_action.core.provenance import Provenance
from sim_action.scenario.model import Severity
from sim_action.scenario.source import Refused, Varied
from sim_action.state.verdict import Verdict

Status = Literal["passed", "failed", "flaky", "error", "skipped"]
"""failed: an assertion did not hold; flaky: of several runs, not all were the same; error: there is no verdict;
skipped: it was not run, as another had failed."""

FailureKind = Literal[
    "invalid",
    "engine",
    "unstable",
    "script",
    "crash",
    "wall limit",
    "memory",
    "interrupted",
    "internal",
    "missing",
    "flaky",
]
"""missing: somebody should have run it, and there is nothing to show for it."""

NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class Failure(FrozenModel):
    """Why a scenario has no verdict.

    Attributes:
        title: a word or two, such as "invalid scenario" or "SIGSEGV".
        location: what has to be mended, where that is known.
        details: the last words of the process, or the way through a script that led to its error, for people.
        time: s of sim time at which it is to be seen, where that is known: of what is flaky, when runs parted.
    """

    kind: FailureKind
    title: str
    message: str
    location: Location | None = None
    details: str = ""
    time: float | None = None

    @classmethod
    def of_fault(cls, fault: Fault) -> Self:
        """A fault of ours."""
        return cls(kind="internal", title="internal error", message=str(fault), details=fault.details)


class Diagnostic(FrozenModel):
    """Something that the engine said while it loaded or ran."""

    level: Literal["warning", "error", "note"]
    message: str


class ExpectationOutcome(FrozenModel):
    """One expectation and its verdict; line and column are those of the assertion in the scenario file."""

    name: str
    assertion: str
    severity: Severity
    location: Location
    verdict: Verdict

    @property
    def failed(self) -> bool:
        """Whether it makes the scenario fail."""
        return not self.verdict.passed and self.severity == "error"

    @property
    def warned(self) -> bool:
        """Whether it did not hold, and that is but a warning."""
        return not self.verdict.passed and self.severity == "warning"


class Repeats(FrozenModel):
    """How often one scenario was run, each time in a fresh interpreter.

    Attributes:
        count: runs.
        agreed: how many of them were the same, in what the robot did and how it was judged.
        digests: how many different digests they had.
    """

    count: Annotated[int, Field(ge=2)]
    agreed: Annotated[int, Field(ge=1)]
    digests: Annotated[int, Field(ge=0)]


class Outcome(FrozenModel):
    """What became of one scenario.

    Attributes:
        name: of the scenario; of its file, if it could not be read.
        file: as it was named on the command line or found below it; empty if it is not of one file.
        line: of the file, where the scenario begins in one that holds several.
        number: its place among all that the file holds, variations counted, from 1.
        group: of a variation, the name of the scenario that is varied.
        variation: the values that make it this one, exactly.
        failures: why there is no verdict; empty unless `status` is "error" or "flaky".
        end: why the run was over.
        sim_time: s at which the run was over.
        wall_time: s that the process took, loading included; of several runs, all of them.
        real_time_factor: sim time over wall time of the simulation loop alone.
        travelled: m between the robot's first and last place on the ground plane.
        seed: of what was drawn at random.
        digest: SHA-256 over the state at every physics step.
        repeats: of a scenario that was run several times, and whose first run this is, or the first that others agree
            with.
        provenance: what it was made with.
        notes: what was assumed or noticed.
        diagnostics: what the engine said.
        output: what the user's own code printed, its end.
        trace: path of the stored trace, seen from the results file.
        replay: path of the stored replay, likewise.
        recordings: paths of what was recorded of it for other tools, likewise.
        call: the words of the command line that runs it again; empty: it is a scenario, and `sim-action run` does.
    """

    name: str
    file: str
    line: Annotated[int, Field(ge=1)] | None = None
    number: Annotated[int, Field(ge=1)] | None = None
    group: str | None = None
    variation: tuple[Varied, ...] = ()
    status: Status
    expectations: tuple[ExpectationOutcome, ...] = ()
    failures: tuple[Failure, ...] = ()
    end: str | None = None
    sim_time: NotNegative | None = None
    wall_time: NotNegative = 0.0
    real_time_factor: NotNegative | None = None
    travelled: NotNegative | None = None
    seed: int | None = None
    digest: str | None = None
    repeats: Repeats | None = None
    engine: str | None = None
    provenance: Provenance | None = None
    notes: tuple[str, ...] = ()
    diagnostics: tuple[Diagnostic, ...] = ()
    output: str = ""
    trace: str | None = None
    replay: str | None = None
    recordings: tuple[str, ...] = ()
    call: tuple[str, ...] = ()

    @property
    def simulated(self) -> float:
        """Sim time in s of all its runs."""
        return (self.sim_time or 0.0) * (self.repeats.count if self.repeats else 1)

    @property
    def causes_first(self) -> tuple[ExpectationOutcome, ...]:
        """All expectations in their order, but those last that another one has cut off."""
        return tuple(sorted(self.expectations, key=lambda expected: expected.verdict.cut_off))

    @property
    def has_verdict(self) -> bool:
        """Whether its expectations were judged, and the judgement can be believed."""
        return self.status in ("passed", "failed")

    @property
    def exit_code(self) -> ExitCode:
        """What this outcome alone would make of the process."""
        kinds = {failure.kind for failure in self.failures}
        if "interrupted" in kinds:
            return ExitCode.INTERRUPTED
        if "internal" in kinds:
            return ExitCode.INTERNAL
        if kinds & {"invalid", "missing"}:
            return ExitCode.INVALID
        return ExitCode.PASSED if self.status == "passed" else ExitCode.FAILED

    @property
    def location(self) -> Location | None:
        """Its file, if it is of one, and its line in that."""
        return Location(self.file, self.line) if self.file else None

    @classmethod
    def of_invalid(cls, file: str, error: InvalidScenario) -> Outcome:
        """The outcome of a file that is no valid scenario."""
        failures = tuple(
            Failure(kind="invalid", title="invalid scenario", message=problem.message, location=problem.location)
            for problem in error.problems
        )
        return cls(name=Path(file).name, file=file, status="error", failures=failures)

    @classmethod
    def of_refused(cls, refused: Refused) -> Outcome:
        """The outcome of a scenario that cannot be run."""
        if isinstance(refused.error, Fault):
            failure = Failure.of_fault(refused.error)
            outcome = cls(name=refused.name, file=refused.file, status="error", failures=(failure,))
        else:
            outcome = cls.of_invalid(refused.file, refused.error)
        told = ("name", "line", "number", "group", "variation")
        return outcome.model_copy(update={key: getattr(refused, key) for key in told})

    @classmethod
    def of_nothing(cls, pattern: str) -> Outcome:
        """The outcome of what was named and holds no scenario: a test that was asked for and is not there."""
        name = escaped_line(pattern)
        problem = Problem(Location(name), "no scenario is there; correct the path or leave it out")
        return cls.of_invalid(name, InvalidScenario([problem]))
