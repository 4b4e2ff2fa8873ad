"""Keys of runs: two runs with equal keys have equal outcomes, times apart. `run --resume` takes over such outcomes.

A key is a digest of everything that an outcome may depend on: the files of the workspace as git sees them, the files
that the scenario names, the scenario, options, installed software, and the environment of user code. A run has no key
if a part is not known: without git, it is unknown what the code of a scenario may read.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import sys
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from functools import cached_property
from pathlib import Path
from typing import Final

from sim_action.core.errors import UsageError
from sim_action.core.git_tree import FileDigests, GitError, GitListing, GitTree, beginning_ns
from sim_action.core.permissions import Permissions
from sim_action.core.provenance import cpu_model
from sim_action.core.records import dataclass, field, replace
from sim_action.core.version import PACKAGE_FOLDER
from sim_action.core.wording import counted, escaped_line
from sim_action.core.workspace import PathError, Workspace
from sim_action.engines import ENGINES
from sim_action.results.artifacts import RunFiles, stored_file
from sim_action.results.journal import JOURNAL_FILE, Planned, Record, Recorded, read_journal
from sim_action.results.journal_seal import distrusted, key_file
from sim_action.results.outcome import Outcome, Status
from sim_action.results.results_json import is_inconsistent
from sim_action.runner.child_outcome import engine_provenance
from sim_action.runner.outcome_assembly import OutcomeAssembly
from sim_action.scenario.child_environment import compared_variables
from sim_action.scenario.model import LoadedScenario
from sim_action.scenario.watched_files import MAX_FILES, NamedFiles

_VERSION: Final = 2

_PARTS: Final = (
    "scenarios, or their seeds and engines",
    "files of the workspace",
    "files that scenarios name",
    "options",
    "sim-action",
    "Python or its packages",
    "the machine",
    "the engine",
    "environment variables",
)
"""The parts of a key in words, in their order. A key ends with the beginnings of their digests."""

_SHORT_DIGITS: Final = 8

_NATIVE_VARIABLES: Final = (
    *("LD_*", "DYLD_*", "OMP_*", "OPENBLAS_*", "MKL_*", "NPY_*", "PYTHON*"),
    *(pattern for engine in ENGINES.values() for pattern in engine.environment),
)
"""Environment variables that may change a run without user code."""

_UNRELATED: Final = frozenset({"__pycache__", "app", "cli", "reports", "ros"})
"""Folders of sim-action's source that no outcome with a key depends on; nodes of ROS are processes."""


@dataclass(frozen=True, slots=True)
class RunOptions:
    """The options of the command line that change a run or its files."""

    permissions: Permissions
    repeat: int = 1
    formats: Sequence[str] = ()
    replays: bool = True


class RunKeys:
    """The keys of the runs of one call.

    Create it before anything is read and before the first child process: a file that changes later has no known
    content. git starts at once, so that it works while scenarios are read.
    """

    def __init__(self, scenario_files: Iterable[Path], options: RunOptions, outputs: Collection[Path]) -> None:
        """Start.

        `scenario_files`, `options`: files and options of the call; `outputs`: the output folder, and files that reports
        are written to; they do not count.
        """
        files = list(scenario_files)
        self._digests = FileDigests(beginning_ns(files))
        self._options = options
        self._outputs = list(filter(None, map(_real, outputs)))
        self._named = NamedFiles()
        self._trees: dict[Path, GitTree | str] = {}
        self._builds: dict[str, str | None] = {}
        # Variations name the same files.
        self._contents: dict[tuple[Path, frozenset[Path]], list[tuple[str, str]] | None] = {}
        roots = _roots(files, options.permissions)
        self._listings = {} if options.permissions.updates_golden else {root: GitListing(root) for root in roots}

    def close(self) -> None:
        """End every git that is still running."""
        for listing in self._listings.values():
            listing.close()

    def of(self, loaded: LoadedScenario, inputs: Iterable[str] | None = ()) -> str | None:
        """Return the key of a run whose code has read these paths; None: its outcome may depend on something else."""
        if self._options.permissions.updates_golden or inputs is None:
            return None
        try:
            return self._digest(loaded) if all(self._knows(loaded, path) for path in inputs) else None
        except (OSError, ValueError):  # a NUL in a name
            return None

    def _digest(self, loaded: LoadedScenario) -> str | None:
        runs_code = loaded.scenario.runs_user_code
        tree = self._tree(loaded.workspace.root)
        if runs_code and not isinstance(tree, GitTree):
            return None
        # The contents of the files of a scenario, without those in `tree`; None if one is not known.
        root, named = loaded.workspace.root, self._named.of(loaded.source)
        if (root, named) not in self._contents:
            self._contents[root, named] = self._contents_of(named, tree, root)
        files = self._contents[root, named]
        if files is None:
            return None
        if loaded.scenario.backend not in self._builds:
            self._builds[loaded.scenario.backend] = engine_provenance(loaded.scenario.backend).engine_build
        parts = [
            _scenario(loaded),
            tree.digest if isinstance(tree, GitTree) else None,
            files,
            *self._call,
            self._builds[loaded.scenario.backend],
            self._of_user_code if runs_code else self._of_native_code,
        ]
        short = ".".join(_digest_of(part)[:_SHORT_DIGITS] for part in parts)
        return f"{_digest_of([_VERSION, parts])}:{short}"

    def prepare(self) -> None:
        """Read everything that the keys of several runs share."""
        for root in self._listings:
            self._tree(root)
        _ = self._call

    def unknown(self, loaded: LoadedScenario) -> str | None:
        """Return the reason why the files of the workspace are not known; None if they are."""
        tree = self._tree(loaded.workspace.root)
        return tree if isinstance(tree, str) else None

    def _knows(self, loaded: LoadedScenario, name: str) -> bool:
        tree = self._tree(loaded.workspace.root)
        path = Path(os.path.realpath(name))
        return _is_in(path, tree) or path in self._named.of(loaded.source)

    def _tree(self, root: Path) -> GitTree | str:
        """Return the files of a workspace, or the reason why they are not known."""
        if root not in self._trees:
            try:
                listing = self._listings.get(root) or GitListing(root)
                self._trees[root] = listing.tree(self._digests, self._outputs)
            except GitError as error:
                self._trees[root] = str(error)
        return self._trees[root]

    def _contents_of(self, named: frozenset[Path], tree: GitTree | str, root: Path) -> list[tuple[str, str]] | None:
        if len(named) >= MAX_FILES:
            return None
        contents: list[tuple[str, str]] = []
        for path in sorted(named):
            content = "in the workspace" if _is_in(path, tree) else self._digests.of(path)
            if content is None:
                return None
            contents.append((os.path.relpath(path, root), content))
        return contents

    @cached_property
    def _call(self) -> tuple[str, ...]:
        """The digests of the parts that all runs of the call share."""
        options = self._options
        # A virtual environment may lie in another folder each time; its packages are compared.
        python = [sys.version, sys.flags.optimize, os.path.realpath(sys.executable)]
        parts: tuple[object, ...] = (
            [asdict(options.permissions), options.repeat, sorted(options.formats), options.replays],
            source_digest(PACKAGE_FOLDER),
            [python, _packages()],
            [sys.platform, platform.machine(), *platform.libc_ver(), cpu_model()],
        )
        return tuple(map(_digest_of, parts))

    @cached_property
    def _of_user_code(self) -> str:
        names = self._options.permissions.pass_env
        return _digest_of([os.cpu_count(), compared_variables(os.environ, names)])

    @cached_property
    def _of_native_code(self) -> str:
        return _digest_of({name: os.environ[name] for name in sorted(os.environ) if _matches(name, _NATIVE_VARIABLES)})


def _is_in(path: Path, tree: GitTree | str) -> bool:
    return isinstance(tree, GitTree) and tree.holds(path)


def _digest_of(parts: object) -> str:
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def _matches(name: str, patterns: Iterable[str]) -> bool:
    return any(
        name.startswith(pattern.removesuffix("*")) if pattern.endswith("*") else name == pattern for pattern in patterns
    )


def _real(path: Path) -> Path | None:
    """Return the path without links; None if no file can have this path."""
    try:
        return Path(os.path.realpath(path))
    except (OSError, ValueError):  # a NUL in it
        return None


def _roots(files: Iterable[Path], permissions: Permissions) -> list[Path]:
    """Return the workspaces of scenario files."""
    by_folder = {path.absolute().parent: path for path in files}
    roots: dict[Path, None] = {}
    for path in by_folder.values():
        try:
            roots[Workspace.around(path, permissions).root] = None
        except (PathError, OSError, RuntimeError):
            continue
    return list(roots)


def _scenario(loaded: LoadedScenario) -> list[object]:
    """Return everything of a scenario that is not in its files: values of variations, seeds and options."""
    scenario, source = loaded.scenario, loaded.source
    return [
        *(source.document.data, source.document.file, source.line, source.number, source.group, source.scenario_seed),
        [(varied.key, varied.value) for varied in source.variation],
        *(scenario.name, scenario.backend, scenario.seed, scenario.unexercised, scenario.trace.rate),
        *(scenario.confidence, loaded.repetition, loaded.compared, loaded.strict),
        None if loaded.mutation is None else loaded.mutation.mass,
        # The workspace may lie in another folder each time.
        *(os.path.relpath(place, loaded.workspace.root) for place in (loaded.workspace.directory, Path.cwd())),
    ]


def source_digest(folder: Path) -> str:
    """Return a digest of the files of sim-action that a run may depend on."""
    digest = hashlib.sha256()
    _add_source(os.fspath(folder), "", digest)
    return digest.hexdigest()


def _add_source(folder: str, name: str, digest: hashlib._Hash) -> None:
    """Add all files in a folder, which has this name, to a digest. There are hundreds: a Path for each takes longer."""
    with os.scandir(folder) as entries:
        ordered = sorted(entries, key=lambda entry: entry.name)
    for entry in ordered:
        if entry.is_dir():
            if entry.name not in _UNRELATED:
                _add_source(entry.path, f"{name}{entry.name}/", digest)
            continue
        # An editor may have left a link to nothing.
        with suppress(OSError):
            descriptor = os.open(entry.path, os.O_RDONLY | getattr(os, "O_BINARY", 0))
            try:
                content = os.read(descriptor, entry.stat().st_size)
            finally:
                os.close(descriptor)
            digest.update(f"{name}{entry.name} {len(content)}\n".encode())
            digest.update(content)


def _packages() -> list[tuple[str, str]]:
    return sorted(set(_distributions()))


def _distributions() -> Iterator[tuple[str, str]]:
    for folder in map(Path, sys.path):
        try:
            metadata_paths = [path for path in folder.iterdir() if path.suffix in (".dist-info", ".egg-info")]
        except OSError:
            continue
        for path in metadata_paths:
            try:
                yield path.name, hashlib.sha256((path / "RECORD").read_bytes()).hexdigest()
            except OSError:
                yield path.name, ""


_NONE_TAKEN: Final = "no verdict of the earlier run is taken over"
_KEYLESS: Final = (
    "no verdict of the earlier run is taken over: its journal does not say which files and options they depend on"
)
_UNSEALED: Final = (
    "without a valid seal; the scenarios run again, because another user or program may have written the journal, or "
    "the key in the cache folder was lost"
)
_FINAL: Final[frozenset[Status]] = frozenset({"passed", "failed", "inconclusive", "not_exercised", "flaky"})


@dataclass(frozen=True, slots=True)
class TakenOver:
    """The outcomes that a call takes over."""

    # final outcomes, and outcomes of single repetitions, with their places in this call
    records: tuple[Record, ...] = ()
    files: frozenset[str] = frozenset()  # the names of their files, relative to the output folder
    remarks: tuple[str, ...] = ()  # for the user, the reason why nothing or not everything is taken over

    @property
    def finals(self) -> int:
        """The number of final outcomes."""
        return sum(record.event == "finished" for record in self.records)

    def runs(self, repeat: int) -> int:
        """Return the number of runs that need no process; `repeat`: the number of runs for each final outcome."""
        finals = (record.outcome for record in self.records if record.event == "finished")
        repetitions = sum(len(outcome.repetitions) for outcome in finals if outcome is not None)
        return repetitions + sum(repeat if record.event == "finished" else 1 for record in self.records)

    @property
    def not_passed(self) -> bool:
        """True if an outcome has not passed."""
        return any(record.outcome is not None and record.outcome.status != "passed" for record in self.records)


def trusted_journal(folder: Path) -> Recorded:
    """Return the journal of the earlier call in an output folder. Raise UsageError if nothing can be taken over."""
    if not (folder / JOURNAL_FILE).is_file():
        raise UsageError(f"there is no earlier run to resume: {folder} has no {JOURNAL_FILE}")
    for path in (folder / JOURNAL_FILE, key_file()):
        if path is not None and (reason := distrusted(path)) is not None:
            raise UsageError(escaped_line(f"no verdict is taken over: {path} {reason}"))
    try:
        return read_journal(folder, sealed=True)
    except UsageError as error:
        raise UsageError(f"there is no earlier run to resume: {error}") from None


def take_over(
    folder: Path,
    planned: Sequence[Planned],
    runs: Sequence[LoadedScenario],
    assembly: OutcomeAssembly,
    *,
    files: Sequence[RunFiles],
    keys: RunKeys,
) -> TakenOver:
    """Return the outcomes of the earlier call in the output folder that this call can take over.

    Args:
        folder: the output folder, locked by this call.
        planned: the outcomes of this call.
        runs: the runs of this call, each once.
        assembly: knows the places of the runs.
        files: the files of all runs of this call: of all first repetitions, of all second ones, and so on.
        keys: gives the keys of the runs.
    """
    try:
        recorded = trusted_journal(folder)
    except UsageError as error:
        return TakenOver(remarks=(str(error),))
    search = _Search(folder, planned, runs, assembly, files, keys, _by_key(recorded))
    records = [record for places in assembly.scenarios for record in search.records(places)]
    remarks = tuple(dict.fromkeys(search.reasons))
    if recorded.unsealed:
        remarks += (f"{counted(recorded.unsealed, 'verdict')} of the earlier run {_UNSEALED}",)
    if not records and not remarks and any(record.event == "finished" for record in recorded.records):
        remarks = (f"{_NONE_TAKEN}: {search.difference(recorded)}" if search.earlier else _KEYLESS,)
    return TakenOver(tuple(records), frozenset(search.kept), remarks)


def changed_parts(records: Iterable[Record], keys: Mapping[tuple[str, str], str]) -> str:
    """Return what has changed since records of an earlier call, in words; empty: nothing.

    `keys`: file and name of a scenario -> its key in this call; empty: it has none.
    """
    changed: set[str] = set()
    for record in records:
        key = "" if record.outcome is None else keys.get((record.outcome.file, record.outcome.name), "")
        if key and record.key is not None:
            pairs = zip(_PARTS, _short(key), _short(record.key), strict=False)
            changed.update(name for name, new, old in pairs if new != old)
    names = ", ".join(name for name in _PARTS if name in changed)
    return names and f"since then, these have changed: {names}"


_Key = tuple[str, int | None]  # the key of a run, and the number of the repetition; None for a final outcome


def _short(key: str) -> list[str]:
    return key.partition(":")[2].split(".")


def _by_key(recorded: Recorded) -> dict[_Key, Record]:
    return {
        (record.key, record.turn if record.event == "run" else None): record
        for record in recorded.records
        if record.key is not None and record.event in ("run", "finished")
    }


@dataclass()
class _Search:
    """Searches the records of the earlier call."""

    folder: Path
    planned: Sequence[Planned]
    runs: Sequence[LoadedScenario]
    assembly: OutcomeAssembly
    files: Sequence[RunFiles]
    keys: RunKeys
    earlier: Mapping[_Key, Record]
    kept: set[str] = field(default_factory=set)  # the names of the files of outcomes that were found
    reasons: list[str] = field(default_factory=list)  # the reasons why the files of a workspace are not known

    def __post_init__(self) -> None:
        # The run itself comes before its repetitions.
        self._indices: dict[int, int] = {}
        for index, place in enumerate(self.assembly.places):
            self._indices.setdefault(place, index)

    def records(self, places: range) -> Iterator[Record]:
        """Yield the records for one scenario: all of its final outcomes, or else outcomes of single repetitions."""
        runs = [self.runs[self._indices[place]] for place in places]
        keys = [self.keys.of(run) for run in runs]
        if None in keys and (reason := self.keys.unknown(runs[0])):
            self.reasons.append(f"verdicts of user code are not taken over: {reason}")
        finals = [self._final(place, key) for place, key in zip(places, keys, strict=True)]
        # The outcome of one engine may report on the others.
        if all(finals):
            yield from filter(None, finals)
            for place, final in zip(places, finals, strict=True):
                self._keep(place, range(1, self.assembly.repeat + 1))
                if final is not None and final.outcome is not None:
                    self.kept.update(repetition.replay for repetition in final.outcome.repetitions if repetition.replay)
        elif not self.assembly.is_compared(places[0]) and self.assembly.repeat > 1:
            for turn in range(1, self.assembly.repeat + 1):
                if record := self._of_turn(places[0], turn, keys[0]):
                    yield record
                    self._keep(places[0], [turn])

    def difference(self, recorded: Recorded) -> str:
        """Return what has changed since the earlier call, in words."""
        keys: dict[tuple[str, str], str] = {}
        for place, index in self._indices.items():
            keys[self.planned[place].file, self.planned[place].name] = self.keys.of(self.runs[index]) or ""
        changed = changed_parts(recorded.records, keys)
        return changed or "it has none of these scenarios, or files of its runs are missing"

    def _final(self, place: int, key: str | None) -> Record | None:
        record = self.earlier.get((key, None)) if key is not None else None
        if record is None or record.outcome is None or not self._is_of(place, record.outcome):
            return None
        turns = range(1, self.assembly.repeat + 1)
        if not any(self._names(record.outcome, self._files(place, turn)) for turn in turns):
            return None
        traces = [self._files(place, turn).trace for turn in turns]
        # The traces of two runs that differ show the difference.
        if record.outcome.status == "flaky" and sum(map(self._exists, traces)) < 2:
            return None
        return replace(record, place=place)

    def _of_turn(self, place: int, turn: int, key: str | None) -> Record | None:
        record = self.earlier.get((key, turn)) if key is not None else None
        if record is None or record.outcome is None or not self._is_of(place, record.outcome):
            return None
        if record.outcome.status == "flaky" or not self._names(record.outcome, self._files(place, turn)):
            return None
        return replace(record, place=place)

    def _is_of(self, place: int, outcome: Outcome) -> bool:
        is_final = outcome.status in _FINAL and not is_inconsistent(outcome)
        return is_final and Planned.of(outcome) == self.planned[place]

    def _files(self, place: int, turn: int) -> RunFiles:
        return self.files[(turn - 1) * len(self.runs) + self._indices[place]]

    def _names(self, outcome: Outcome, files: RunFiles) -> bool:
        named = [outcome.trace, *([outcome.replay] if outcome.replay else []), *outcome.recordings]
        return named == [self._name(path) for path in files] and all(map(self._exists, files))

    def _exists(self, path: Path) -> bool:
        file = stored_file(self.folder, self._name(path))
        return file is not None and file.stat().st_size > 0

    def _keep(self, place: int, turns: Sequence[int]) -> None:
        self.kept.update(self._name(path) for turn in turns for path in self._files(place, turn))

    def _name(self, path: Path) -> str:
        return path.relative_to(self.folder).as_posix()
