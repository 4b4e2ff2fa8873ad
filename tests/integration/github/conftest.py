"""Repositories with a workflow or an action in them, and what becomes of it."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeAlias

import pytest

from tests.integration.github import ActionResult, CacheStore, JobResult, Runner, WorkflowResult, run_workflow

CHECKOUT = "actions/checkout@3d3c42e5aac5ba805825da76410c181273ba90b1"

Act: TypeAlias = Callable[..., ActionResult]
Perform: TypeAlias = Callable[..., WorkflowResult]


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    folder = tmp_path / "repository"
    (folder / ".github/workflows").mkdir(parents=True)
    return folder


@pytest.fixture
def caches(tmp_path: Path) -> CacheStore:
    return CacheStore(tmp_path / "caches")


@pytest.fixture
def act(tmp_path: Path) -> Act:
    """Runs an action that is written down."""
    workspace, temp = tmp_path / "work space", tmp_path / "runner temp"

    def run(action: str, inputs: Mapping[str, str] | None = None, **runner: Any) -> ActionResult:
        for folder in (tmp_path / "action", workspace, temp):
            folder.mkdir(exist_ok=True)
        (tmp_path / "action/action.yml").write_text(action, encoding="utf-8")
        return Runner(workspace, temp, **runner).run(tmp_path / "action", inputs)

    return run


@pytest.fixture
def perform(repository: Path, tmp_path_factory: pytest.TempPathFactory, caches: CacheStore) -> Perform:
    """Runs a workflow that is written down."""

    def run(workflow: str, **options: Any) -> WorkflowResult:
        file = repository / ".github/workflows/main.yml"
        file.write_text(workflow, encoding="utf-8")
        return run_workflow(file, repository, **{"temp": tmp_path_factory.mktemp("run"), "cache": caches, **options})

    return run


def uses(action: str, inputs: Mapping[str, str] | None = None, identity: str = "it") -> str:
    """A step of a workflow; what is JSON is YAML."""
    return f"      - {{uses: {action}, id: {identity}, with: {json.dumps(inputs or {})}}}\n"


def run(script: str) -> str:
    """A step of a workflow."""
    return f"      - run: {json.dumps(script)}\n"


def run_job(perform: Perform, *steps: str) -> JobResult:
    """What becomes of a job with these steps."""
    text = f"on: push\njobs:\n  a:\n    runs-on: ubuntu-latest\n    steps:\n{''.join(steps)}"
    return perform(text).jobs["a"]


def printed(result: JobResult) -> str:
    """What the only run of a job has printed."""
    [only] = result.runs
    return only.log


def workflow(jobs: str, head: str = "on: push") -> str:
    """A workflow with jobs."""
    return f"{head}\njobs:\n{jobs}"


def job(identity: str, script: str = "true", /, **keys: str) -> str:
    """A job with one script, and with these keys."""
    more = "".join(f"    {key.replace('_', '-')}: {value}\n" for key, value in keys.items())
    return f"  {identity}:\n    runs-on: ubuntu-latest\n{more}    steps:\n      - run: {script}\n"


def results(result: WorkflowResult) -> dict[str, str]:
    """What became of each job."""
    return {name: job.result for name, job in result.jobs.items()}
