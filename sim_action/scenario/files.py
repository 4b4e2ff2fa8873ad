"""Read the scenarios of a file, each as a document of its own, before they are checked.

`extends: other.base.yml` adds the keys of another file. `scenarios:` is a list of scenarios that add to the keys of the
file.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from collections.abc import Set as AbstractSet
from itertools import count
from pathlib import Path
from typing import Final

from sim_action.core.errors import InternalError, InvalidScenario, Location, MissingScenario, Problem
from sim_action.core.field_types import is_title
from sim_action.core.files import read_at_most, similar_path
from sim_action.core.permissions import Permissions
from sim_action.core.records import replace
from sim_action.core.wording import escaped_line, shown
from sim_action.core.workspace import SUFFIXES, PathError, Workspace, file_name, name_beside, path_problem, similar_name
from sim_action.core.yaml_document import MAX_BYTES, Document, location_after, read_document
from sim_action.scenario.source import MAX_RUNS, Refused, Source
from sim_action.scenario.variations.gate import GATE

MAX_BASES: Final = 10  # the largest number of files that extend each other
MAX_SCENARIOS: Final = 1_000  # the largest number of scenarios in a file
_MAX_WRITTEN_OUT: Final = 1_000_000  # number of values; shared values count for each scenario
_NOTHING: Final = "a scenario starts with 'name:', 'robot:', 'expect:' and 'time_limit:'"


def read_file(
    path: Path, permissions: Permissions, seed: int | None = None, named_at: Location | None = None
) -> tuple[Source | Refused, ...]:
    """Return every scenario of a file with its variations, in order. A problem of one scenario refuses only that one.

    `seed` draws the variations; None takes the seed of each scenario. `named_at`: the place in a file that names
    `path`, for the message about a file that does not exist; None: the command line names it.
    """
    try:
        workspace = workspace_around(path, permissions)
        document = _whole(_read(path, named_at=named_at), workspace, (path.resolve(),))
        if "scenarios" in _keys(document):
            written: Iterable[Source | Refused] = _several(path, workspace, document)
        else:
            written = [Source(path, workspace, document, _name(document) or _called(path))]
        return numbered_runs(written, seed)
    except InvalidScenario as error:
        return (Refused(file_name(path), _called(path), None, error),)
    except Exception as error:  # noqa: BLE001 - the other files have scenarios to run
        return (Refused(file_name(path), _called(path), None, InternalError.of(error)),)


def numbered_runs(written: Iterable[Source | Refused], seed: int | None) -> tuple[Source | Refused, ...]:
    """Return all scenarios of a file with their variations, numbered."""
    return tuple(replace(scenario, number=place) for place, scenario in enumerate(_all_varied(written, seed), start=1))


def _all_varied(sources: Iterable[Source | Refused], seed: int | None) -> Iterator[Source | Refused]:
    left = MAX_RUNS
    taken: set[str] = set()
    for source in sources:
        if isinstance(source, Refused):
            yield source
            continue
        try:
            runs = _runs_of(source, seed, left)
            _refuse_twins(source, runs, taken)
        except InvalidScenario as error:
            yield source.refused(error)
        else:
            left -= len(runs)
            taken |= {run.name for run in runs}
            yield from runs


def _runs_of(source: Source, seed: int | None, left: int) -> tuple[Source, ...]:
    """Return the variations of a scenario, or itself if it has none. Raises InvalidScenario."""
    if not isinstance(source.document.data, dict) or source.document.data.keys().isdisjoint(("variations", GATE)):
        return (source,)
    from sim_action.scenario.variations.expansion import expanded  # most scenarios have no variations

    return expanded(source, seed, left)


def _refuse_twins(source: Source, runs: Iterable[Source], taken: AbstractSet[str]) -> None:
    """Raise InvalidScenario if two runs of a file have the same name."""
    for run in runs:
        if run.name in taken:
            which = "this scenario is" if run.group is None else f"a variation of '{run.group}' is"
            message = f"{which} called '{run.name}', like another run of this file; choose another name"
            raise InvalidScenario([source.document.problem(("name",), message)])


def read_only_scenario(path: Path, permissions: Permissions) -> Source:
    """Return the scenario of a file that holds exactly one. Raises InvalidScenario."""
    first, *others = read_file(path, permissions)
    if isinstance(first, Refused):
        raise first.error
    if others:
        raise InvalidScenario([Problem(Location(file_name(path)), f"holds {len(others) + 1} scenarios, not one")])
    return first


def workspace_around(path: Path, permissions: Permissions) -> Workspace:
    """Return the workspace of a scenario file, which need not exist. Raises InvalidScenario."""
    try:
        return Workspace.around(path, permissions)
    except (PathError, OSError, RuntimeError) as error:
        raise InvalidScenario([Problem(Location(file_name(path)), escaped_line(path_problem(error)))]) from None


def _several(path: Path, workspace: Workspace, document: Document) -> Iterator[Source | Refused]:
    """Yield the entries of `scenarios:`, each merged with the keys of the file. Raises InvalidScenario."""
    entries = _keys(document)["scenarios"]
    if not isinstance(entries, tuple) or not entries:
        raise InvalidScenario([document.problem(("scenarios",), f"expected a list of maps, found {shown(entries)}")])
    shared = document.without("scenarios")
    if len(entries) > MAX_SCENARIOS or len(entries) * shared.size > _MAX_WRITTEN_OUT:
        message = f"more than {MAX_SCENARIOS} scenarios, or too many shared keys; split the file"
        raise InvalidScenario([document.problem(("scenarios",), message)])
    taken: set[str] = set()
    for number, entry in enumerate(document.entries("scenarios"), start=1):
        whole = shared.merged(entry) if isinstance(entry.data, dict) else entry
        name = _name(whole) or f"{_called(path)} ({number})"
        unique = next(free for n in count(1) if (free := name if n == 1 else f"{name} ({n})") not in taken)
        taken.add(unique)
        source = Source(path, workspace, whole, unique, entry.location(()).line)
        problems = list(_entry_problems(entry, name, is_second=unique != name))
        yield source.refused(InvalidScenario(problems)) if problems else source


def _entry_problems(entry: Document, name: str, *, is_second: bool) -> Iterator[Problem]:
    if not isinstance(entry.data, dict):
        yield entry.problem((), f"expected a map of keys, found {shown(entry.data)}")
        return
    for key in ("extends", "scenarios"):
        if key in entry.data:
            yield entry.problem((key,), "is a key of the file, not of one of its scenarios")
    if is_second:
        yield entry.problem(("name",), f"a second scenario named '{name}' in this file")


def _called(path: Path) -> str:
    return Path(file_name(path)).name


def _keys(document: Document) -> dict[str, object]:
    assert isinstance(document.data, dict)  # who has read it has looked
    return document.data


def _name(document: Document) -> str | None:
    name = _keys(document).get("name") if isinstance(document.data, dict) else None
    return name if isinstance(name, str) and name and is_title(name) else None


def _whole(document: Document, workspace: Workspace, chain: tuple[Path, ...]) -> Document:
    if "extends" not in _keys(document):
        return document
    return _base(document, workspace, chain).merged(document.without("extends"))


def _base(document: Document, workspace: Workspace, chain: tuple[Path, ...]) -> Document:
    """Return the document that another one extends, as seen from that one's folder."""
    reference = _keys(document)["extends"]
    try:
        path = _base_file(reference, workspace, chain)
    except PathError as error:
        raise InvalidScenario([document.problem(("extends",), str(error))]) from None
    own = replace(workspace, directory=path.parent)
    base = _whole(_read(path, name_beside(document.file, str(reference), path)), own, (*chain, path))
    if "scenarios" in _keys(base):
        message = f"{base.file} holds several scenarios; extend a file with one scenario"
        raise InvalidScenario([document.problem(("extends",), message)])
    if path.parent == workspace.directory:
        return base
    from sim_action.scenario.extends import seen_from  # most scenarios extend no file of another folder

    return seen_from(workspace.directory, base, path.parent)


def _base_file(reference: object, workspace: Workspace, chain: tuple[Path, ...]) -> Path:
    """Return the path of a base file. Raises PathError."""
    if not isinstance(reference, str):
        raise PathError(f"expected the path of one file, found {shown(reference)}")
    try:
        path = workspace.file(reference)
    except PathError as error:
        near = similar_name(workspace.directory / reference, (".yml", ".yaml"))
        raise PathError(f"{error}{near}") from None
    if path in chain:
        circle = " -> ".join(step.name for step in (*chain[chain.index(path) :], path))
        raise PathError(f"the files extend each other in a circle: {circle}")
    if len(chain) > MAX_BASES:
        raise PathError(f"more than {MAX_BASES} files extend each other")
    return path


def _read(path: Path, name: str | None = None, named_at: Location | None = None) -> Document:
    """Read the document of a file. Raises InvalidScenario."""
    name = name or file_name(path)
    document = read_document(name, _text(path, name, named_at))
    if not isinstance(document.data, dict):
        what = "the file is empty" if document.data is None else "the file is not a map of keys"
        raise InvalidScenario([document.problem((), f"{what}; {_NOTHING}")])
    return document


def _text(path: Path, name: str, named_at: Location | None) -> str:
    where = Location(name)
    try:
        data = read_at_most(path, MAX_BYTES)
    except (FileNotFoundError, NotADirectoryError):
        place = "" if named_at else " on the command line, or in the input of the action"
        hint = similar_path(path, SUFFIXES)
        message = f"there is no file or folder '{name}'{f'{hint} Correct' if hint else '; correct'} the path{place}"
        raise MissingScenario([Problem(named_at or where, escaped_line(message))]) from None
    except OSError as error:
        raise InvalidScenario([Problem(where, f"cannot be read: {error.strerror}")]) from None
    if data is None:
        message = f"a scenario of more than {MAX_BYTES // 1000} kB cannot be read; check that this is the right file"
        raise InvalidScenario([Problem(where, message)])
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        where = location_after(name, data[: error.start].decode("utf-8"))
        message = f"the byte 0x{data[error.start]:02x} is not UTF-8 text; save the file as UTF-8"
        raise InvalidScenario([Problem(where, message)]) from None
