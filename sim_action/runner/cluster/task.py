"""Runs as data: what a worker needs for them, and what comes back. A worker runs them in other processes."""

from __future__ import annotations

import json
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, Final, Self

from sim_action.core.files import open_regular
from sim_action.core.permissions import Permissions
from sim_action.core.process import Interruption
from sim_action.core.provenance import cpu_model, installed_version
from sim_action.core.records import dataclass, replace
from sim_action.core.version import PACKAGE_FOLDER, __version__
from sim_action.engines import ENGINES
from sim_action.results.journal import Event, RunEnded
from sim_action.results.outcome import Outcome
from sim_action.runner.child_outcome import engine_provenance
from sim_action.runner.cluster.workspace_archive import Copied
from sim_action.runner.job import Job
from sim_action.runner.process_pool import Pool, PoolOptions, warm_up
from sim_action.runner.run_keys import source_digest
from sim_action.runner.run_plan import Runs
from sim_action.scenario.loading import Libraries, load_all, shared
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.mutation import Mutation
from sim_action.scenario.source import Refused, Source

_DIGITS: Final = 12


@dataclass(frozen=True, slots=True)
class Software:
    """The versions that must or should be equal on the caller's machine and on all workers."""

    sim_action: str
    source: str  # a digest of sim-action's own files
    python: str
    # each engine that is needed, and the version of its package; None: it is not installed
    engines: tuple[tuple[str, str | None], ...]
    numpy: str  # numpy, processor: they change the last digits of numbers
    processor: str

    def differences(self, caller: Software) -> Iterator[str]:
        """Yield what a worker with this software has in another version than the machine of the caller."""
        ours = dict(caller.engines)
        pairs = [("Python", self.python, caller.python), ("sim-action", self.sim_action, caller.sim_action)]
        pairs += [(engine, version or "missing", ours[engine] or "missing") for engine, version in self.engines]
        for name, actual, expected in pairs:
            if actual != expected:
                yield f"{name} is {actual}, here {expected}"
        if self.sim_action == caller.sim_action and self.source != caller.source:
            yield f"the files of sim-action have the digest {self.source}, here {caller.source}"

    def roundings(self, caller: Software) -> Iterator[str]:
        """Yield what may let a worker with this software round otherwise than the machine of the caller."""
        pairs = [("numpy", self.numpy, caller.numpy), ("the processor", self.processor, caller.processor)]
        for name, actual, expected in pairs:
            if actual != expected:
                yield f"{name} is {actual}, here {expected}"


@cache
def software(engines: tuple[str, ...]) -> Software:
    """Return the software of this process, with these engines."""
    return Software(
        __version__,
        source_digest(PACKAGE_FOLDER)[:_DIGITS],
        ".".join(map(str, sys.version_info[:2])),
        tuple((engine, installed_version(ENGINES[engine].distribution)) for engine in engines),
        installed_version("numpy") or "missing",
        cpu_model(),
    )


@dataclass(frozen=True, slots=True)
class Output:
    """The files that runs write; the attributes are as in `Runs`."""

    replays: bool
    formats: tuple[str, ...]
    repeat: int


@dataclass(frozen=True, slots=True)
class Run:
    """One run."""

    index: int  # its index among all runs of the call
    source: Source  # the scenario as the caller's machine reads it
    changed: tuple[tuple[str, Any], ...]  # the keys of the scenario that options have changed, and their values
    compared: bool  # compared, strict: as in `LoadedScenario`
    strict: bool
    mutation: Mutation | None = None  # as in `LoadedScenario`; a run whose confidence is found has one without a fault

    @classmethod
    def of(cls, index: int, loaded: LoadedScenario) -> Self:
        """Return a run of a scenario."""
        scenario, source = loaded.scenario, loaded.source
        changed = {"name": scenario.name, "backend": scenario.backend, "seed": scenario.seed}
        changed |= {"unexercised": scenario.unexercised, "trace": scenario.trace}
        if loaded.repetition:
            changed |= {"physics": scenario.physics, "robot": scenario.robot}
        absolute = replace(source, path=source.path.absolute())
        return cls(index, absolute, tuple(changed.items()), loaded.compared, loaded.strict, loaded.mutation)


@dataclass(frozen=True, slots=True)
class Task:
    """Runs that a worker takes together, one after the other."""

    runs: tuple[Run, ...]  # the runs; they are of the same workspace
    turn: int  # the number of their repetition, counted from 1
    permissions: Permissions
    working_folder: Path  # the current folder of the caller
    copied: tuple[Copied, ...]  # the workspace, and the folders of packages outside of it
    output: Output
    software: Software  # on the caller's machine

    def moved(self, path: Path, copies: Path) -> Path:
        """Return the path of a file of the caller on the worker."""
        return next((copied.moved(path, copies) for copied in self.copied if copied.holds(path)), path)

    def loaded(self, copies: Path, libraries: Libraries) -> list[LoadedScenario]:
        """Load the scenarios from the copy of their workspace. Raise InvalidScenario, InternalError."""
        scenarios: list[LoadedScenario] = []
        for run in self.runs:
            loaded = self._loaded(run, copies, libraries)
            scenarios.append(shared(loaded, scenarios[-1]) if scenarios else loaded)
        return scenarios

    def _loaded(self, run: Run, copies: Path, libraries: Libraries) -> LoadedScenario:
        source, workspace = run.source, run.source.workspace
        own_workspace = replace(
            workspace,
            directory=self.moved(workspace.directory, copies),
            root=self.moved(workspace.root, copies),
            packages=self._moved_packages(workspace.packages, copies),
        )
        permissions = replace(self.permissions, packages=self._moved_packages(self.permissions.packages, copies))
        moved = replace(source, path=self.moved(source.path, copies), workspace=own_workspace)
        [loaded] = load_all([moved], permissions, libraries)
        if isinstance(loaded, Refused):
            raise loaded.error
        scenario = loaded.scenario.model_copy(update=dict(run.changed))
        return replace(loaded, scenario=scenario, compared=run.compared, strict=run.strict, mutation=run.mutation)

    def _moved_packages(self, packages: Sequence[tuple[str, str]], copies: Path) -> tuple[tuple[str, str], ...]:
        return tuple((name, str(self.moved(Path(folder), copies))) for name, folder in packages)

    def as_of_caller(self, text: str, copies: Path) -> str:
        """Return JSON with the caller's paths instead of the worker's."""
        for copied in self.copied:
            text = text.replace(_json(str(copies / copied.digest)), _json(str(copied.anchor)))
        return text


@dataclass(frozen=True, slots=True)
class Result:
    """The result of a run: `outcome` as JSON, and files by their index in `Job.evidence`."""

    outcome: str
    files: tuple[tuple[int, bytes], ...] = ()


def run_task(
    task: Task, copies: Path, libraries: Libraries, scratch: Path, listen: Callable[[Event], None]
) -> tuple[Result, ...]:
    """Run a task in other processes and return the results. Raise InvalidScenario, SimActionError, OSError.

    Args:
        task: the task.
        copies: the folder with the copies of workspaces.
        libraries: what scenarios of the same workspace have read before.
        scratch: a folder for temporary files.
        listen: receives the events of the runs, except their outcomes, with the place in `task.runs`; if it raises an
            exception, the task ends.
    """
    scenarios = task.loaded(copies, libraries)
    own = task.copied[0]
    inside = task.working_folder.is_relative_to(own.anchor)
    current = own.moved(task.working_folder, copies) if inside else copies / own.digest
    current.mkdir(parents=True, exist_ok=True)
    folder = Path(tempfile.mkdtemp(prefix="run-", dir=scratch))
    try:
        arguments = (scenarios, str(current), folder, task.turn, task.output)
        if sys.platform == "linux":
            from sim_action.runner.warm_process import call_beside  # only where it is asked for

            results: list[Result] = call_beside(_run_here, arguments, listen, _prepare)
        else:
            # Each scenario has an interpreter of its own there.
            results = _run_here(*arguments, emit=listen)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return tuple(replace(result, outcome=task.as_of_caller(result.outcome, copies)) for result in results)


def _prepare(scenarios: Sequence[LoadedScenario], _cwd: str, _folder: Path, _turn: int, output: Output) -> None:
    """Prepare the warm process for its forks. Raises OSError, ImportError, MemoryError."""
    if output.repeat == 1 and not any(loaded.scenario.runs_user_code for loaded in scenarios):
        warm_up(scenarios, output.formats, replays=output.replays)
    for backend in {loaded.scenario.backend for loaded in scenarios}:
        engine_provenance(backend)


def _run_here(
    scenarios: Sequence[LoadedScenario],
    directory: str,
    folder: Path,
    turn: int,
    output: Output,
    *,
    emit: Callable[[Event], None],
) -> list[Result]:
    """Run one repetition of scenarios in this process, and read the files that they wrote."""
    if sys.platform == "linux":
        os.chdir(directory)
    motions = folder / "motions"
    motions.mkdir()
    others = (number for number in range(1, output.repeat + 1) if number != turn)

    def tell(event: Event) -> None:
        # The outcome follows with its files.
        if not isinstance(event, RunEnded):
            emit(event)

    runs = Runs(
        scenarios,
        folder,
        output.repeat,
        replays=output.replays,
        formats=output.formats,
        motions=motions,
        ended={(place, other) for other in others for place in range(len(scenarios))},
    )
    with Interruption() as interruption:
        outcomes = Pool(runs, tell, interruption, PoolOptions()).outcomes()
    first = (turn - 1) * len(scenarios)
    return [_result(outcomes[index], runs.job(index)) for index in range(first, first + len(scenarios))]


def _result(outcome: Outcome, job: Job) -> Result:
    files = []
    for number, path in enumerate(job.evidence):
        with suppress(OSError), open_regular(path, follow_link=False) as file:
            files.append((number, file.read()))
    return Result(outcome.model_dump_json(), tuple(files))


def _json(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)[1:-1]
