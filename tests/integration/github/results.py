"""What became of steps, jobs and workflows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from tests.integration.github.commands import Annotation
from tests.integration.github.machine import Report
from tests.integration.github.values import Value


@dataclass(frozen=True, slots=True)
class StepResult:
    """What became of a step."""

    name: str
    id: str
    outcome: str  # success, failure, cancelled or skipped
    conclusion: str  # the same, after `continue-on-error`
    outputs: Mapping[str, str] = field(default_factory=dict)
    exit_code: int = 0  # 1 for a failure that has none of its own


@dataclass(frozen=True, slots=True)
class JobRun:
    """What became of one job, or of one combination of its matrix."""

    name: str
    result: str  # success, failure, cancelled or skipped
    matrix: Mapping[str, Value] = field(default_factory=dict)
    steps: tuple[StepResult, ...] = ()
    outputs: Mapping[str, str] = field(default_factory=dict)
    annotations: tuple[Annotation, ...] = ()
    summary: str = ""
    log: str = ""
    reports: tuple[Report, ...] = ()
    workspace: Path = Path()
    temp: Path = Path()


@dataclass(frozen=True, slots=True)
class JobResult:
    """What became of a job, as `needs` says it."""

    result: str
    outputs: Mapping[str, str] = field(default_factory=dict)
    # one; or one for each combination of the matrix, and for each job of a called workflow
    runs: tuple[JobRun, ...] = ()

    @property
    def steps(self) -> tuple[StepResult, ...]:
        """Of all runs."""
        return tuple(step for run in self.runs for step in run.steps)

    @property
    def annotations(self) -> tuple[Annotation, ...]:
        """Of all runs."""
        return tuple(annotation for run in self.runs for annotation in run.annotations)

    @property
    def summary(self) -> str:
        """Of all runs."""
        return "".join(run.summary for run in self.runs)

    @property
    def log(self) -> str:
        """Of all runs."""
        return "".join(f"[{run.name}: {run.result}]\n{run.log}" for run in self.runs)


@dataclass(frozen=True, slots=True)
class WorkflowResult:
    """What became of a workflow."""

    conclusion: str
    jobs: Mapping[str, JobResult]
    artifacts: Path  # a folder with a folder for each

    @property
    def runs(self) -> tuple[JobRun, ...]:
        """Of all jobs."""
        return tuple(run for job in self.jobs.values() for run in job.runs)

    @property
    def reports(self) -> tuple[Report, ...]:
        """What reporters were asked to report."""
        return tuple(report for run in self.runs for report in run.reports)

    @property
    def log(self) -> str:
        """Of all jobs."""
        return "".join(job.log for job in self.jobs.values())
