"""The result of `sim-action prove`: which expectations notice a fault of the system, as `proof.json` has it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from sim_action.core.errors import ExitCode, Location
from sim_action.core.field_types import FrozenModel
from sim_action.results.outcome import NotNegative
from sim_action.scenario.model import Severity
from sim_action.scenario.source import Variation

MutantStatus = Literal["noticed", "survived", "no effect", "could not run"]
"""The result of a mutant.

- noticed: the scenario did not pass, because an expectation that passed before failed or was not exercised.
- survived: the run was another one, and the scenario passed as before.
- no effect: the robot moved the same, bit for bit, and every verdict was the same; it counts for nothing.
- could not run: there is no verdict, such as after a crash; it counts for nothing.
"""

Finding = Literal["notices", "checks nothing", "unknown"]
"""The finding on an expectation.

- notices: it noticed at least one mutant.
- checks nothing: mutants changed the run, and it noticed none of them.
- unknown: no mutant changed the run, the expectation did not pass without a mutant either, or it noticed none of the
  mutants that ran, and others were left out or had not ended when the call was interrupted.
"""


class PathChange(FrozenModel):
    """The greatest change of the robot's motion by a mutant.

    Attributes:
        text: the change in words.
        distance: of the base from its place in the original run at the same time, in m.
        angle: of the orientation of the base from that in the original run at the same time, in rad.
        joint: the joint that moved most differently, if the base stays where it is; or empty.
        joint_change: the difference of its position, in rad, or m if prismatic.
    """

    text: str
    distance: NotNegative
    angle: NotNegative
    joint: str = ""
    joint_change: NotNegative = 0.0


class MutantResult(FrozenModel):
    """The run of one mutant.

    Attributes:
        name: the kind and the subject, such as "motor-off:wheel_left_joint".
        words: the fault in words.
        noticed_by: the places of the expectations that noticed it, from 0 on: they passed before, and failed now.
        not_exercised: the places of the expectations that passed before, and were not exercised now.
        reason: the reason why there is no verdict; or empty.
        digest: of the run; null if there is none.
        change: the change of the motion, of a mutant that survived; null if it is small.
        suggestion: an expectation that passes in the original run and fails with this mutant, as YAML; or empty.
    """

    name: str
    words: str
    status: MutantStatus
    noticed_by: tuple[int, ...] = ()
    not_exercised: tuple[int, ...] = ()
    reason: str = ""
    digest: str | None = None
    change: PathChange | None = None
    suggestion: str = ""


class ProvenExpectation(FrozenModel):
    """An expectation, and the mutants that it noticed.

    Attributes:
        location: its place in the scenario file.
        passed: True if it passed in the original run; a warning need not.
        noticed: the names of the mutants that it noticed.
        missed: the names of the mutants that moved the robot another way, and that only other expectations noticed.
        not_exercised: the names of the mutants in whose runs it was not exercised; they count for nothing else.
        changed: the number of mutants that it noticed, and of the other ones that moved the robot another way.
        sensitivity: the distance of the measured value from the limit, as a share of the limit, in the original run;
            null without a limit, and for goals, which end at their limit. It is information only.
    """

    name: str
    assertion: str
    severity: Severity
    location: Location
    finding: Finding
    passed: bool = True
    noticed: tuple[str, ...] = ()
    missed: tuple[str, ...] = ()
    not_exercised: tuple[str, ...] = ()
    changed: Annotated[int, Field(ge=0)] = 0
    sensitivity: NotNegative | None = None


class ProvenScenario(FrozenModel):
    """A scenario and its mutants.

    Attributes:
        name, file, line, variation: as in results.json; of a scenario with variations, only the first one is proven.
        reason: the reason why the scenario was not mutated, such as a failed expectation; empty if it was.
        location: the place of this reason; null if there is none.
        exit_code: of the original run.
        left_out: the number of mutants that did not run, because the call named others, or because of its budget.
        unfinished: the number of mutants that had not ended when the call was interrupted.
    """

    name: str
    file: str
    line: Annotated[int, Field(ge=1)] | None = None
    variation: Variation = ()
    reason: str = ""
    location: Location | None = None
    exit_code: Annotated[int, Field(ge=0)] = 0
    expectations: tuple[ProvenExpectation, ...] = ()
    mutants: tuple[MutantResult, ...] = ()
    left_out: Annotated[int, Field(ge=0)] = 0
    unfinished: Annotated[int, Field(ge=0)] = 0

    @property
    def is_proven(self) -> bool:
        """True if the scenario passed, so that it was mutated."""
        return not self.reason

    @property
    def is_refused(self) -> bool:
        """True if it is invalid or missing, or met an internal error: the call fails in any case."""
        return self.exit_code in (ExitCode.INVALID, ExitCode.INTERNAL)

    @property
    def useless(self) -> tuple[ProvenExpectation, ...]:
        """The expectations that check nothing here."""
        return tuple(expectation for expectation in self.expectations if expectation.finding == "checks nothing")

    @property
    def unproven(self) -> tuple[ProvenExpectation, ...]:
        """The expectations that have noticed nothing: they check nothing, or are unknown."""
        return tuple(expectation for expectation in self.expectations if expectation.finding != "notices")

    @property
    def survivors(self) -> tuple[MutantResult, ...]:
        """The mutants that moved the robot another way, and that nothing noticed."""
        return tuple(mutant for mutant in self.mutants if mutant.status == "survived" and mutant.change is not None)

    def with_status(self, *statuses: MutantStatus) -> tuple[MutantResult, ...]:
        """Return the mutants with one of some results."""
        return tuple(mutant for mutant in self.mutants if mutant.status in statuses)


class Proof(FrozenModel):
    """The result of one call of `sim-action prove`; the file of `--json` is this object as JSON.

    Attributes:
        version: the version of the format.
        sim_action: the version of sim-action.
        runs: the number of runs, with the original ones.
        wall_time: the wall time in s of the call.
        interrupted: True if the call was interrupted; the findings cover the runs that had ended.
    """

    version: Literal[1] = 1
    sim_action: str
    runs: Annotated[int, Field(ge=0)]
    wall_time: NotNegative
    interrupted: bool = False
    scenarios: tuple[ProvenScenario, ...]

    @property
    def useless(self) -> int:
        """The number of expectations that check nothing."""
        return sum(len(scenario.useless) for scenario in self.scenarios)

    @property
    def survivors(self) -> int:
        """The number of mutants that moved the robot another way, and that nothing noticed."""
        return sum(len(scenario.survivors) for scenario in self.scenarios)

    @property
    def all_notice(self) -> bool:
        """True if there are scenarios, all of them have mutants, and every expectation has noticed something."""
        proven = all(scenario.is_proven and not scenario.unproven for scenario in self.scenarios)
        return bool(self.scenarios) and proven

    def exit_code(self, *, strict: bool) -> ExitCode:
        """Return the exit code; with `strict`, an expectation that has noticed nothing fails, and a bad scenario."""
        return ExitCode.of_command(
            (scenario.exit_code for scenario in self.scenarios if scenario.exit_code != ExitCode.FAILED),
            is_interrupted=self.interrupted,
            has_scenarios=bool(self.scenarios),
            has_failed=strict and bool(self.scenarios) and not self.all_notice,
        )
