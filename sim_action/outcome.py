"""Outcomes: what became of each scenario, and of all of them; `results.json` is read and written here."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Final, Literal, Self

from pydantic import Field, ValidationError

from sim_action.errors import ExitCode, Fault, InvalidScenario, UsageError
from sim_action.location import Location, Problem
from sim_action.messages import escaped_line
from sim_action.provenance import Provenance
from sim_action.quantities import FrozenModel
from sim_action.regular_files import read_at_most
from sim_action.scenario import Severity
from sim_action.sharding import Shard
from sim_action.source import Refused, Varied
from sim_action.verdict import Verdict
from sim_action.whole_files import whole_file

RESULTS_FILE = "results.json"

_MOST_BYTES: Final = 64_000_000

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
    """

    kind: FailureKind
    title: str
    message: str
    location: Location | None = None
    details: str = ""

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


class Results(FrozenModel):
    """Everything that one call of `sim-action` found out; `results.json` is this, as JSON.

    Attributes:
        sim_action: version; of shards that were not alike, each that there was.
        wall_time: s that the call took; of shards that were joined, what the longest took.
        shard: which part of a list of scenarios this is of; left out: of all.
        some: whether the call named scenarios of files by their numbers, of which none may be left to tell of.
        merged: whether `sim-action merge` has written this, from the results of others.
    """

    version: Literal[1] = 1
    sim_action: str
    python: str
    platform: str
    wall_time: NotNegative
    shard: Shard | None = None
    some: bool = False
    merged: bool = False
    outcomes: tuple[Outcome, ...]

    @property
    def total(self) -> int:
        """How many scenarios there were."""
        return len(self.outcomes)

    def count(self, status: Status) -> int:
        """How many scenarios have a status."""
        return sum(outcome.status == status for outcome in self.outcomes)

    @property
    def exit_code(self) -> ExitCode:
        """The worst of all outcomes: 130, 3, 2, 1, 0; a shard without any is not to blame if others have some."""
        part = self.some or (self.shard and self.shard.total)
        of_nothing = ExitCode.PASSED if part else ExitCode.NO_SCENARIO
        return max((outcome.exit_code for outcome in self.outcomes), default=of_nothing)

    @property
    def conclusion(self) -> Literal["success", "failure", "cancelled"]:
        """In GitHub's words."""
        if self.exit_code is ExitCode.INTERRUPTED:
            return "cancelled"
        return "success" if self.exit_code is ExitCode.PASSED else "failure"

    @property
    def travelled(self) -> float | None:
        """m, if there was exactly one scenario."""
        return self.outcomes[0].travelled if self.total == 1 else None

    @property
    def real_time_factor(self) -> float | None:
        """Sim time of everything that was simulated over the wall time that it all took."""
        sim_time = sum(outcome.simulated for outcome in self.outcomes)
        return sim_time / self.wall_time if sim_time and self.wall_time > 0 else None

    def worst_first(self) -> list[Outcome]:
        """Errors, then failures, then warnings, then what was not run, then the rest, each in the order of the call."""
        return sorted(self.outcomes, key=_badness)

    def write(self, folder: Path) -> Path:
        """Writes `results.json` into a folder that exists; returns its path."""
        path = folder / RESULTS_FILE
        with whole_file(path) as file:
            file.write((self.model_dump_json(indent=2) + "\n").encode())
        return path

    @classmethod
    def read(cls, path: Path) -> Results:
        """Reads a `results.json`, which may be a stranger's. Raises UsageError."""
        try:
            if (data := read_at_most(path, _MOST_BYTES)) is not None:
                return cls.model_validate_json(data)
            reason = f"it is larger than {_MOST_BYTES / 1e6:g} MB"
        except OSError as error:
            reason = error.strerror or str(error)
        except ValidationError as error:
            reason = _first_finding(error)
        raise UsageError(escaped_line(f"{path} is no results file: {reason}"))


def _first_finding(error: ValidationError) -> str:
    """Where and what; keys that a stranger made up are not repeated."""
    details, more = error.errors(include_url=False, include_input=False)[0], error.error_count() - 1
    steps = [str(step) for step in details["loc"] if isinstance(step, int) or step.isidentifier()]
    told = ": ".join(part for part in (".".join(steps), details["msg"]) if part)
    return f"{told} (and {more} more)" if more else told


def _badness(outcome: Outcome) -> int:
    if outcome.status != "passed":
        return {"error": 0, "flaky": 1, "failed": 2, "skipped": 4}[outcome.status]
    return 3 if any(expectation.warned for expectation in outcome.expectations) else 5
