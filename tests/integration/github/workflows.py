"""Runs workflows: their jobs one after the other, each when those that it needs are done."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from tests.integration.github import jobs, permissions
from tests.integration.github.checkout import commit
from tests.integration.github.documents import load, mapping, one_or_more, sequence
from tests.integration.github.errors import UnsupportedFeature
from tests.integration.github.expressions import Status, evaluate, evaluate_value, holds
from tests.integration.github.jobs import Job, Shared, run_job
from tests.integration.github.machine import Run, github_context
from tests.integration.github.permissions import Permissions, declared, limit
from tests.integration.github.results import JobResult, JobRun, WorkflowResult
from tests.integration.github.stores import ArtifactStore, CacheStore
from tests.integration.github.triggers import resolved_inputs, trigger
from tests.integration.github.values import Known, Value, is_array, to_text

_KEYS: Final = frozenset({"name", "on", "permissions", "concurrency", "jobs"})
_CALLER_KEYS: Final = frozenset({"name", "needs", "if", "uses", "with"})
_MOST_JOBS: Final = 256
_STRATEGY_KEYS: Final = frozenset({"matrix", "fail-fast"})


def run_workflow(
    file: Path,
    repository: Path,
    *,
    temp: Path,
    event_name: str = "push",
    event: Mapping[str, Value] | None = None,
    cache: CacheStore | None = None,
    shared_temp: Path | None = None,
    variables: Mapping[str, str] | None = None,
    done: Mapping[str, JobResult] | None = None,
    run: Run | None = None,
    work: Path | None = None,
    base: Path | None = None,
) -> WorkflowResult:
    """Runs a workflow file on an event. Raises UnsupportedFeature.

    Args:
        repository: what a checkout gives.
        temp: a folder of its own, for all that comes up.
        cache: of the repository; left out, it is empty.
        shared_temp: RUNNER_TEMP of all jobs; left out, each job has a fresh one as it should.
        variables: in the environment of all jobs.
        done: jobs that are not run, because this is what became of them.
        run: its number and attempt; left out, it has a new number.
        work: the parent of the workspace of all jobs; left out, each job has a workspace of its own.
        base: what the commit before gives, such as the base of a pull request; left out, there is none.
    """
    origin = temp / "origin"
    files = [file, *(repository / ".github/workflows").glob("*.y*ml")]
    # Without a checkout, nothing finds out that there is no such commit.
    is_needed = any("actions/checkout@" in one.read_text(encoding="utf-8") for one in files)
    sha = commit(repository, origin, base) if is_needed else None
    shared = Shared(
        repository=repository,
        origin=origin,
        work=work,
        folder=temp / "jobs",
        cache=cache or CacheStore(temp / "caches"),
        artifacts=ArtifactStore(temp / "artifacts"),
        temp=shared_temp,
        variables=variables or {},
    )
    github = github_context(event_name, event or {}, sha=sha, run=run)
    workflow = _workflow(shared, file, github, event_name, given={})
    workflow.results.update(done or {})
    workflow.run()
    return WorkflowResult(workflow.conclusion, workflow.results, shared.artifacts.folder)


@dataclass(slots=True)
class _Workflow:
    """A workflow, and how far it has come."""

    shared: Shared
    document: Mapping[str, Value]
    started_by: Mapping[str, Value]  # what its `on` says of the event
    github: Known
    inputs: Mapping[str, Value]
    granted: Permissions | None  # what it may do at most; None for one that was not called
    results: dict[str, JobResult] = field(default_factory=dict)

    @property
    def jobs(self) -> Mapping[str, Mapping[str, Value]]:
        return {name: mapping(job, f"jobs.{name}") for name, job in mapping(self.document["jobs"], "jobs").items()}

    @property
    def conclusion(self) -> str:
        results = {job.result for job in self.results.values()}
        return next((result for result in ("failure", "cancelled", "success") if result in results), "skipped")

    def run(self) -> None:
        _check_concurrency(self.document, {"github": self.github, "inputs": self.inputs})
        if unknown := self.results.keys() - self.jobs.keys():
            raise UnsupportedFeature(f"jobs that are not there: {', '.join(sorted(unknown))}")
        waiting = {name: job for name, job in self.jobs.items() if name not in self.results}
        while waiting:
            ready = next((name for name, job in waiting.items() if set(_needs(job)) <= self.results.keys()), None)
            if ready is None:
                raise UnsupportedFeature(f"jobs that need each other, or what is not there: {', '.join(waiting)}")
            self.results[ready] = self._result(ready, waiting.pop(ready))

    def outputs(self) -> dict[str, str]:
        """They are handed on although a job failed."""
        job_contexts = {name: Known(result=job.result, outputs=job.outputs) for name, job in self.results.items()}
        contexts = {"github": self.github, "inputs": self.inputs, "jobs": Known(job_contexts)}
        specs = mapping(self.started_by.get("outputs"), "outputs").items()
        return {name: evaluate(to_text(mapping(spec, name)["value"]), contexts) for name, spec in specs}

    def _result(self, name: str, job: Mapping[str, Value]) -> JobResult:
        mapping(job, f"jobs.{name}", _CALLER_KEYS if "uses" in job else jobs.KEYS)
        contexts = self._contexts(job)
        if not holds(job.get("if"), contexts, self._status(job)):
            return JobResult("skipped", runs=(JobRun(to_text(job.get("name", name)), "skipped"),))
        outcomes = [*self._outcomes(name, job, contexts)]
        return JobResult(
            result=_joined([outcome.result for outcome in outcomes]),
            outputs=_merged(outcome.outputs for outcome in outcomes),
            runs=tuple(run for outcome in outcomes for run in outcome.runs),
        )

    def _contexts(self, job: Mapping[str, Value]) -> dict[str, Value]:
        needs = {name: self.results[name] for name in _needs(job)}
        known = {name: Known(result=need.result, outputs=need.outputs) for name, need in needs.items()}
        return {"github": self.github, "inputs": self.inputs, "needs": Known(known)}

    def _status(self, job: Mapping[str, Value]) -> Status:
        results = {self.results[name].result for name in self._ancestors(job)}
        # A job that was cancelled is no workflow that was.
        return Status(success=results <= {"success"}, failure="failure" in results)

    def _ancestors(self, job: Mapping[str, Value]) -> set[str]:
        needs = set(_needs(job))
        return needs.union(*(self._ancestors(self.jobs[name]) for name in needs))

    def _outcomes(self, name: str, document: Mapping[str, Value], contexts: Mapping[str, Value]) -> Iterator[JobResult]:
        for combination in _combinations(_evaluated(document.get("strategy"), contexts)):
            yield self._outcome(self._job(name, document, {**contexts, "matrix": combination}))

    def _job(self, name: str, document: Mapping[str, Value], contexts: Mapping[str, Value]) -> Job:
        otherwise = permissions.DEFAULT if self.granted is None else self.granted
        asked = declared(document.get("permissions"), declared(self.document.get("permissions"), otherwise))
        granted = asked if self.granted is None else limit(asked, self.granted)
        return Job(name, document, contexts, granted)

    def _outcome(self, job: Job) -> JobResult:
        if "uses" in job.document:
            return self._called(job)
        run = run_job(self.shared, job)
        return JobResult(run.result, run.outputs, (run,))

    def _called(self, job: Job) -> JobResult:
        file = _callee(to_text(job.document["uses"]), self.shared.repository)
        given = mapping(_evaluated(job.document.get("with"), job.contexts), "with")
        granted = job.permissions
        workflow = _workflow(self.shared, file, self.github, "workflow_call", given=given, granted=granted)
        workflow.run()
        runs = tuple(run for result in workflow.results.values() for run in result.runs)
        named = tuple(replace(run, name=f"{job.name} / {run.name}") for run in runs)
        return JobResult(workflow.conclusion, workflow.outputs(), named)


def _workflow(
    shared: Shared,
    file: Path,
    github: Known,
    event_name: str,
    *,
    given: Mapping[str, Value],
    granted: Permissions | None = None,
) -> _Workflow:
    document = mapping(load(file), file.name, _KEYS)
    started_by = trigger(document.get("on"), event_name)
    name = to_text(github["workflow"]) or to_text(document.get("name", f".github/workflows/{file.name}"))
    known = Known({**github, "workflow": name})
    # On another event there are no inputs, and each is null.
    inputs = resolved_inputs(started_by.get("inputs"), given, known) if event_name == "workflow_call" else {}
    return _Workflow(shared, document, started_by, known, inputs, granted)


def _callee(uses: str, repository: Path) -> Path:
    if not uses.startswith("./.github/workflows/"):
        raise UnsupportedFeature(f"uses: {uses}")
    return repository / uses


def _combinations(strategy: Value) -> list[Mapping[str, Value]]:
    """One mapping a job. Raises UnsupportedFeature for a matrix that is more than a list of what it includes."""
    if strategy is None:
        return [{}]
    checked = mapping(strategy, "strategy", _STRATEGY_KEYS)
    if checked.get("fail-fast") is not False:
        raise UnsupportedFeature("a matrix that may fail fast")
    included = mapping(checked.get("matrix"), "matrix", {"include"}).get("include", [])
    jobs = [mapping(entry, "include") for entry in sequence(included, "include")]
    if not 0 < len(jobs) <= _MOST_JOBS:
        raise UnsupportedFeature(f"a matrix of {len(jobs)} jobs")
    return jobs


def _needs(job: Mapping[str, Value]) -> list[str]:
    return one_or_more(job.get("needs"))


def _evaluated(value: Value, contexts: Mapping[str, Value]) -> Value:
    if isinstance(value, str):
        return evaluate_value(value, contexts)
    if isinstance(value, Mapping):
        return {name: _evaluated(member, contexts) for name, member in value.items()}
    return [_evaluated(item, contexts) for item in value] if is_array(value) else value


def _check_concurrency(document: Mapping[str, Value], contexts: Mapping[str, Value]) -> None:
    """Jobs here never meet, but what is said of it must be right."""
    said = _evaluated(document.get("concurrency"), contexts)
    if said is not None and not isinstance(said, str):
        mapping(said, "concurrency", {"group", "cancel-in-progress"})


def _joined(results: Sequence[str]) -> str:
    return next((result for result in ("failure", "cancelled", "skipped") if result in results), "success")


def _merged(outputs: Iterable[Mapping[str, str]]) -> dict[str, str]:
    """The last combination of a matrix that said something has its way."""
    merged: dict[str, str] = {}
    for some in outputs:
        merged.update({name: value for name, value in some.items() if value or name not in merged})
    return merged
