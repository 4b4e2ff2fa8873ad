"""Runs one action as a step of a job would, without a workflow around it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from tests.integration.github.commands import Annotation
from tests.integration.github.composite import Action, run_composite
from tests.integration.github.machine import Machine, github_context
from tests.integration.github.provided import use
from tests.integration.github.results import StepResult
from tests.integration.github.steps import Use
from tests.integration.github.stores import CacheStore
from tests.integration.github.values import Known, Value


@dataclass(frozen=True, slots=True)
class ActionResult:
    """What a job gets to see of the action."""

    exit_code: int  # of the first step that failed and was not forgiven
    steps: tuple[str, ...]  # the names of the steps that ran
    outputs: Mapping[str, str]
    annotations: tuple[Annotation, ...]
    summary: str
    log: str
    exported: str  # what was written to GITHUB_ENV and GITHUB_PATH, for later steps of the job
    step_results: tuple[StepResult, ...]  # of all steps, by the order they have in the action


@dataclass(frozen=True, slots=True)
class Runner:
    """A machine that runs actions."""

    workspace: Path
    temp: Path  # RUNNER_TEMP; what one action leaves there, the next one in the job finds
    os: str = "Linux"
    arch: str = "X64"
    event_name: str = "push"
    variables: Mapping[str, str] = field(default_factory=dict)  # what the job has in its environment
    cache: CacheStore | None = None  # without one, nothing is found and nothing is saved
    event: Mapping[str, Value] = field(default_factory=dict)

    def run(self, action_path: Path, inputs: Mapping[str, str] | None = None) -> ActionResult:
        """Runs an action with the inputs of its `with:`. Raises UnsupportedFeature."""
        machine = self._machine()
        asked = Use(machine, str(action_path), inputs or {}, {}, {})
        steps, outputs = run_composite(Action(action_path), machine, use, asked)
        record = machine.record
        return ActionResult(
            exit_code=steps.exit_code,
            steps=tuple(step.name for step in steps.results if step.outcome != "skipped"),
            outputs=outputs,
            annotations=tuple(record.annotations),
            summary=record.summary,
            log=record.log,
            exported=record.exported,
            step_results=tuple(steps.results),
        )

    def _machine(self) -> Machine:
        github = github_context(self.event_name, self.event)
        return Machine(
            workspace=self.workspace,
            temp=self.temp,
            github=Known({**github, "workspace": str(self.workspace)}),
            os=self.os,
            arch=self.arch,
            environment=dict(self.variables),
            cache=self.cache,
        )
