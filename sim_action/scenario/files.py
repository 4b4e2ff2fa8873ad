"""From a file to the scenarios that are written in it, each a document of its own, before anybody looks what they say.

`extends: other.base.yml` puts a file on top of another; `scenarios:` is a list of what each scenario of a file adds to
the keys beside it.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from collections.abc import Set as AbstractSet
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Final

from sim_action.core.discovery import file_name
from sim_action.core.errors import Fault, InvalidScenario, Location, Problem
from sim_action.core.field_types import is_plain_name
from sim_action.core.files import read_at_most
from sim_action.core.messages import escaped_line, nearest, shown
from sim_action.core.workspace import PathError, Permissions, Workspace
from sim_action.core.yaml_document import MAX_BYTES, Document, location_after, read_document
from sim_action.scenario.extends import entries_of, merged, seen_from, without
from sim_action.scenario.source import Refused, Source
from sim_action.scenario.variations import MAX_RUNS, expanded

MAX_BASES: Final = 10
"""How many files may stand behind one."""

MAX_SCENARIOS: Final = 1_000
"""How many a file may hold."""

# Of values, what they share counted for each.
_MAX_WRITTEN_OUT: Final = 1_000_000

_NOTHING: Final = "a scenario begins with 'name:', 'robot:', 'expect:', 'time_limit:'"


def read_file(path: Path, permissions: Permissions, seed: int | None = None) -> tuple[Source | Refused, ...]:
    """Every scenario of a file with its variations, in order; what is wrong with one of them is told of that one.

    `seed`: of what variations draw; None: as each scenario says.
    """
    try:
        workspace = _workspace(path, permissions)
        document = _whole(_read(path), workspace, (path.resolve(),))
        if "scenarios" in _keys(document):
            written: Iterable[Source | Refused] = _several(path, workspace, document)
        else:
            written = [Source(path, workspace, document, _name(document) or _called(path))]
        return tuple(replace(each, number=place) for place, each in enumerate(_all_varied(written, seed), start=1))
    except InvalidScenario as error:
        return (Refused(file_name(path), _called(path), None, error),)
    except Exception as error:  # noqa: BLE001 - the other files have scenarios to run
        return (Refused(file_name(path), _called(path), None, Fault.of(error)),)


def _all_varied(sources: Iterable[Source | Refused], seed: int | None) -> Iterator[Source | Refused]:
    left = MAX_RUNS
    taken: set[str] = set()
    for source in sources:
        if isinstance(source, Refused):
            yield source
            continue
        try:
            runs = expanded(source, seed, left)
            _refuse_twins(source, runs, taken)
        except InvalidScenario as error:
            yield source.refused(error)
        else:
            left -= len(runs)
            taken |= {run.name for run in runs}
            yield from runs


def _refuse_twins(source: Source, runs: Iterable[Source], taken: AbstractSet[str]) -> None:
    """Raises InvalidScenario: a name is what tells runs of a file apart, and what runs one of them again."""
    for run in runs:
        if run.name in taken:
            which = "this scenario is" if run.group is None else f"a variation of '{run.group}' is"
            message = f"{which} called '{run.name}', as is another run of this file; choose another name"
            raise InvalidScenario([source.document.problem(("name",), message)])


def read_only_scenario(path: Path, permissions: Permissions) -> Source:
    """The scenario of a file that holds no other. Raises InvalidScenario."""
    first, *others = read_file(path, permissions)
    if isinstance(first, Refused):
        raise first.error
    if others:
        raise InvalidScenario([Problem(Location(file_name(path)), f"holds {len(others) + 1} scenarios, not one")])
    return first


def _workspace(path: Path, permissions: Permissions) -> Workspace:
    try:
        return Workspace.around(path, allow_outside=permissions.outside, updates_golden=permissions.updates_golden)
    except (PathError, OSError, RuntimeError) as error:
        raise InvalidScenario([Problem(Location(file_name(path)), escaped_line(str(error)))]) from None


def _several(path: Path, workspace: Workspace, document: Document) -> Iterator[Source | Refused]:
    """The entries of `scenarios:`, each on top of what stands beside that. Raises InvalidScenario."""
    entries = _keys(document)["scenarios"]
    if not isinstance(entries, tuple) or not entries:
        raise InvalidScenario([document.problem(("scenarios",), f"expected a list of maps, found {shown(entries)}")])
    shared = without(document, "scenarios")
    if len(entries) > MAX_SCENARIOS or len(entries) * shared.size > _MAX_WRITTEN_OUT:
        message = f"more than {MAX_SCENARIOS} scenarios, or too much beside them; make several files of it"
        raise InvalidScenario([document.problem(("scenarios",), message)])
    taken: set[str] = set()
    for number, entry in enumerate(entries_of(document, "scenarios"), start=1):
        whole = merged(shared, entry) if isinstance(entry.data, dict) else entry
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
            yield entry.problem((key,), "belongs to a whole file, not to one of its scenarios")
    if is_second:
        yield entry.problem(("name",), f"a second scenario named '{name}' in this file")


def _called(path: Path) -> str:
    """What is to be said for a name, where there is none but the file's."""
    return Path(file_name(path)).name


def _keys(document: Document) -> dict[str, object]:
    assert isinstance(document.data, dict)  # who has read it has looked
    return document.data


def _name(document: Document) -> str | None:
    """As far as it has one that reports can show."""
    name = _keys(document).get("name") if isinstance(document.data, dict) else None
    return name if isinstance(name, str) and name and is_plain_name(name) else None


def _whole(document: Document, workspace: Workspace, chain: tuple[Path, ...]) -> Document:
    """With everything that the files say that it extends; `chain`: the way here. Raises InvalidScenario."""
    if "extends" not in _keys(document):
        return document
    return merged(_base(document, workspace, chain), without(document, "extends"))


def _base(document: Document, workspace: Workspace, chain: tuple[Path, ...]) -> Document:
    """What a document extends, as it would be written beside it."""
    reference = _keys(document)["extends"]
    try:
        path = _found(reference, workspace, chain)
    except PathError as error:
        raise InvalidScenario([document.problem(("extends",), str(error))]) from None
    own = replace(workspace, directory=path.parent)
    base = _whole(_read(path, _named(document.file, str(reference), path)), own, (*chain, path))
    if "scenarios" in _keys(base):
        message = f"{base.file} holds several scenarios; extend a file of one, or of what they share"
        raise InvalidScenario([document.problem(("extends",), message)])
    return seen_from(workspace.directory, base, path.parent)


def _found(reference: object, workspace: Workspace, chain: tuple[Path, ...]) -> Path:
    """Raises PathError."""
    if not isinstance(reference, str):
        raise PathError(f"expected the path of one file, found {shown(reference)}")
    try:
        path = workspace.file(reference)
    except PathError as error:
        raise PathError(f"{error}{_near(workspace.directory / reference)}") from None
    if path in chain:
        circle = " -> ".join(step.name for step in (*chain[chain.index(path) :], path))
        raise PathError(f"goes in a circle: {circle}")
    if len(chain) > MAX_BASES:
        raise PathError(f"more than {MAX_BASES} files extend each other")
    return path


def _near(path: Path) -> str:
    """A hint at a file beside one that is not there."""
    try:
        names = [file.name for file in path.parent.iterdir() if file.suffix in (".yml", ".yaml")]
    except (OSError, ValueError):
        return ""
    near = nearest(path.name, names)
    return "" if near in (None, path.name) else f"; did you mean '{near}'?"


def _named(file: str, reference: str, path: Path) -> str:
    """How messages call a base: as it is seen from where the scenario's own name is."""
    as_written = Path(file).parent / reference
    plain = Path(os.path.normpath(as_written))
    return file_name(plain if plain.resolve() == path else as_written)


def _read(path: Path, name: str | None = None) -> Document:
    """Raises InvalidScenario."""
    name = name or file_name(path)
    document = read_document(name, _text(path, name))
    if not isinstance(document.data, dict):
        what = "the file is empty" if document.data is None else "the file holds no map of keys"
        raise InvalidScenario([document.problem((), f"{what}; {_NOTHING}")])
    return document


def _text(path: Path, name: str) -> str:
    where = Location(name)
    try:
        data = read_at_most(path, MAX_BYTES)
    except OSError as error:
        raise InvalidScenario([Problem(where, f"cannot be read: {error.strerror}")]) from None
    if data is None:
        message = f"a scenario of more than {MAX_BYTES // 1000} kB is not read; is this the right file?"
        raise InvalidScenario([Problem(where, message)])
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        where = location_after(name, data[: error.start].decode("utf-8"))
        message = f"the byte 0x{data[error.start]:02x} is not UTF-8 text; save the file as UTF-8"
        raise InvalidScenario([Problem(where, message)]) from None
