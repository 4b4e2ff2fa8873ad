"""Runs one job of a workflow on a machine of its own."""

from __future__ import annotations

import itertools
import shutil
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from tests.integration.github.documents import mapping, sequence
from tests.integration.github.errors import UnsupportedFeature
from tests.integration.github.expressions import evaluate
from tests.integration.github.machine import Machine, is_for_fork
from tests.integration.github.permissions import Permissions
from tests.integration.github.provided import use
from tests.integration.github.results import JobRun
from tests.integration.github.steps import Steps
from tests.integration.github.stores import ArtifactStore, CacheStore
from tests.integration.github.values import Known, Value, to_text

KEYS: Final = frozenset(
    {"name", "needs", "if", "strategy", "runs-on", "timeout-minutes", "env", "outputs", "permissions", "steps"}
)
_X64: Final = {"ubuntu-latest", "ubuntu-24.04", "ubuntu-22.04"}
_MACHINES: Final[Mapping[str, tuple[str, str]]] = {
    **dict.fromkeys(_X64, ("Linux", "X64")),
    "ubuntu-24.04-arm": ("Linux", "ARM64"),
    **dict.fromkeys(("macos-latest", "macos-15"), ("macOS", "ARM64")),
    "macos-15-intel": ("macOS", "X64"),
    **dict.fromkeys(("windows-latest", "windows-2025"), ("Windows", "X64")),
}


@dataclass(frozen=True, slots=True)
class Shared:
    """What the jobs of a workflow run have in common."""

    repository: Path
    origin: Path  # the repository that a checkout fetches from
    folder: Path  # where each job gets a folder of its own
    # the parent of the workspace and of RUNNER_TEMP, which are then the same in all jobs, and fresh in each; None: they
    # are in the folder of the job
    work: Path | None
    cache: CacheStore
    artifacts: ArtifactStore
    temp: Path | None  # RUNNER_TEMP of all jobs, which GitHub never has; None gives each its own
    variables: Mapping[str, str]  # in the environment of all jobs, before what the workflow says
    numbers: Iterator[int] = field(default_factory=lambda: itertools.count(1))


@dataclass(frozen=True, slots=True)
class Job:
    """A job that is about to run."""

    identity: str
    document: Mapping[str, Value]
    contexts: Mapping[str, Value]  # github, inputs, needs and matrix
    permissions: Permissions  # that it was given

    @property
    def name(self) -> str:
        """As people see it."""
        matrix = mapping(self.contexts["matrix"], "matrix")
        values = ", ".join(to_text(value) for value in matrix.values() if not isinstance(value, Mapping | list))
        otherwise = f"{self.identity} ({values})" if values else self.identity
        return evaluate(to_text(self.document.get("name", otherwise)), self.contexts)


def run_job(shared: Shared, job: Job) -> JobRun:
    """Runs a job in a fresh workspace. Raises UnsupportedFeature."""
    machine = _machine(shared, job)
    steps = Steps(
        machine=machine,
        steps=sequence(job.document.get("steps"), f"jobs.{job.identity}.steps"),
        contexts={**job.contexts, "github": machine.github},
        use=use,
        is_job=True,
    )
    steps.run()
    return _job_run(job, steps)


def _job_run(job: Job, steps: Steps) -> JobRun:
    machine, record = steps.machine, steps.machine.record
    contexts = steps.all_contexts()
    outputs = mapping(job.document.get("outputs"), "outputs")
    return JobRun(
        name=job.name,
        result=steps.status,
        matrix=mapping(job.contexts["matrix"], "matrix"),
        steps=tuple(steps.results),
        outputs={name: evaluate(to_text(output), contexts) for name, output in outputs.items()},
        annotations=tuple(record.annotations),
        summary=record.summary,
        log=record.log,
        reports=tuple(record.reports),
        workspace=machine.workspace,
        temp=machine.temp,
    )


def _machine(shared: Shared, job: Job) -> Machine:
    github = mapping(job.contexts["github"], "github")
    folder = shared.folder / f"{next(shared.numbers):02d}-{job.identity}"
    workspace, temp = folder / "workspace", folder / "temp"
    if shared.work:
        shutil.rmtree(shared.work, ignore_errors=True)
        # As there: /home/runner/work/robots/robots and /home/runner/work/_temp.
        name = to_text(github["repository"]).rpartition("/")[2]
        workspace, temp = shared.work / name / name, shared.work / "_temp"
    temp = shared.temp or temp
    for fresh in (workspace, temp):
        fresh.mkdir(parents=True, exist_ok=True)
    system, architecture = _system(job)
    return Machine(
        workspace=workspace,
        temp=temp,
        github=Known({**github, "workspace": str(workspace), "job": job.identity}),
        os=system,
        arch=architecture,
        environment=_environment(shared, job),
        cache=shared.cache,
        artifacts=shared.artifacts,
        origin=shared.origin,
        permissions=_token_permissions(job),
        deadline=_deadline(job),
    )


def _environment(shared: Shared, job: Job) -> dict[str, str]:
    own = mapping(job.document.get("env"), "env")
    return {**shared.variables, **{name: evaluate(to_text(value), job.contexts) for name, value in own.items()}}


def _deadline(job: Job) -> float | None:
    minutes = job.document.get("timeout-minutes")
    if minutes is None:
        return None
    if not isinstance(minutes, int | float):
        raise UnsupportedFeature(f"timeout-minutes: {minutes}")
    return time.monotonic() + minutes * 60


def _token_permissions(job: Job) -> Permissions:
    if not is_for_fork(mapping(job.contexts["github"], "github")):
        return job.permissions
    return {scope: "read" if level == "write" else level for scope, level in job.permissions.items()}


def _system(job: Job) -> tuple[str, str]:
    label = evaluate(to_text(job.document.get("runs-on")), job.contexts)
    if label not in _MACHINES:
        raise UnsupportedFeature(f"runs-on: {label}")
    return _MACHINES[label]
