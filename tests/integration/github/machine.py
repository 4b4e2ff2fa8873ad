"""The machine that a job runs on, and what the job has left there so far."""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from tests.integration.github.commands import Annotation, escaped, parse_annotations
from tests.integration.github.expressions import evaluate_value
from tests.integration.github.permissions import DEFAULT, Permissions
from tests.integration.github.stores import ArtifactStore, CacheStore
from tests.integration.github.values import Known, Value

# A runner starts from its machine's environment; what belongs to a run around these tests is not part of that.
_FOREIGN: Final = ("GITHUB_", "RUNNER_", "ACTIONS_", "INPUT_", "PYTHON", "PYTEST_", "COV_", "VIRTUAL_ENV")
_SUMMARY_LIMIT: Final = 1024 * 1024
REPOSITORY: Final = "octocat/robots"
_SHA: Final = "0123456789abcdef0123456789abcdef01234567"
_RUN_IDS: Final = itertools.count(1)


@dataclass(frozen=True, slots=True)
class Run:
    """The number of a workflow run, and its attempt, which counts from 1: "Re-run jobs" starts another one."""

    number: int = field(default_factory=lambda: next(_RUN_IDS))
    attempt: int = 1


@dataclass(frozen=True, slots=True)
class Report:
    """What a third party's reporter was asked to report."""

    reporter: str  # the action's name
    inputs: Mapping[str, str]
    files: tuple[Path, ...]  # of JUnit XML, which it found
    tests: int
    failures: int
    errors: int


@dataclass(slots=True)
class Record:
    """What people get to see of a job."""

    log: str = ""
    summary: str = ""
    exported: str = ""
    annotations: list[Annotation] = field(default_factory=list)
    reports: list[Report] = field(default_factory=list)

    def hear(self, text: str) -> None:
        """Takes in what a step has printed."""
        self.log += text
        self.annotations += parse_annotations(text)

    def complain(self, message: str, level: str = "error") -> None:
        """What the runner itself, or an action that is not run here, has to say."""
        self.hear(f"::{level}::{escaped(message)}\n")

    def summarise(self, text: str) -> None:
        """Takes in the summary of a step; one that is too long is dropped whole."""
        size = len(text.encode())
        if size > _SUMMARY_LIMIT:
            self.complain(f"$GITHUB_STEP_SUMMARY upload aborted, supports content up to 1024k, got {size // 1024}k")
        else:
            self.summary += text


@dataclass(slots=True)
class Machine:
    """A runner during one job."""

    workspace: Path
    temp: Path
    github: Known  # the context of that name
    os: str = "Linux"
    arch: str = "X64"
    # what steps find in it: the job's own, and what steps have written to GITHUB_ENV
    environment: dict[str, str] = field(default_factory=dict)
    path: list[str] = field(default_factory=list)  # what goes before PATH, from GITHUB_PATH
    cache: CacheStore | None = None
    artifacts: ArtifactStore | None = None
    origin: Path | None = None  # the repository that a checkout fetches from
    permissions: Permissions = field(default_factory=lambda: DEFAULT)
    deadline: float | None = None  # when the job is out of time, by the monotonic clock
    record: Record = field(default_factory=Record)

    @property
    def contexts(self) -> dict[str, Value]:
        """The contexts that are the same for all steps."""
        runner = Known(os=self.os, arch=self.arch, temp=str(self.temp), name="runner", environment="github-hosted")
        return {"runner": runner}

    @property
    def home(self) -> Path:
        """The home folder, which is new in each job unless the job names another."""
        return Path(self.environment.get("HOME") or self.temp / "home")

    @property
    def is_for_fork(self) -> bool:
        """Whether this is the pull request of another repository."""
        return is_for_fork(self.github)

    @property
    def out_of_time(self) -> bool:
        """Whether the job has taken longer than it may."""
        return self.deadline is not None and time.monotonic() >= self.deadline

    def variables(self, given: Mapping[str, str], github: Mapping[str, Value]) -> dict[str, str]:
        """The environment of a process. What the runner says itself stands, whatever a job or step was given."""
        inherited = {name: value for name, value in os.environ.items() if not name.startswith(_FOREIGN)}
        # pip and the cache of meshes find their files although the home folder is new.
        real = {f"XDG_{kind.upper()}_HOME": str(Path.home() / f".{kind}") for kind in ("cache", "config")}
        variables = {**real, **inherited, "HOME": str(self.home), "CI": "true", **self.environment, **given}
        if self.path:
            variables["PATH"] = os.pathsep.join([*reversed(self.path), variables.get("PATH", os.defpath)])
        texts = {name: value for name, value in github.items() if isinstance(value, str)}
        said = {f"GITHUB_{name.upper()}": value for name, value in texts.items()}
        runner = {"RUNNER_OS": self.os, "RUNNER_ARCH": self.arch, "RUNNER_TEMP": str(self.temp)}
        return {**variables, **said, **runner, "GITHUB_ACTIONS": "true", "RUNNER_ENVIRONMENT": "github-hosted"}


def is_for_fork(github: Mapping[str, Value]) -> bool:
    """Whether the context speaks of a pull request from another repository; its token may not write."""
    wanted = evaluate_value("${{ github.event.pull_request.head.repo.full_name }}", {"github": github})
    return github["event_name"] == "pull_request" and wanted not in {None, github["repository"]}


def github_context(
    event_name: str,
    event: Mapping[str, Value],
    *,
    sha: str | None = None,
    run: Run | None = None,
    repository: str = REPOSITORY,
) -> Known:
    """The context `github` before there is a job, for the main branch or for the pull request 1."""
    run = run or Run()
    owner, _, _ = repository.partition("/")
    merge = {"ref": "refs/pull/1/merge", "ref_name": "1/merge"} if event_name == "pull_request" else {}
    branches = {"head_ref": "change", "base_ref": "main"} if event_name.startswith("pull_request") else {}
    numbers = {"run_id": str(run.number), "run_number": str(run.number), "run_attempt": str(run.attempt)}
    names = {"repository": repository, "repository_owner": owner, "actor": owner, "triggering_actor": owner}
    return Known(
        {
            "event_name": event_name,
            "event": event,
            "workspace": "",
            "sha": sha or _SHA,
            "workflow": "",
            "job": "",
            "ref": "refs/heads/main",
            "ref_name": "main",
            "ref_type": "branch",
            "head_ref": "",
            "base_ref": "",
            "server_url": "https://github.com",
            "api_url": "https://api.github.com",
            **numbers,
            **names,
            **merge,
            **branches,
        }
    )
