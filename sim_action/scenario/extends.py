"""Documents that build on others: maps merge, lists and scalars replace, null takes a key out.

Each value keeps the place of the file that it is from, so that an error about it leads there.
"""

from __future__ import annotations

from collections.abc import Iterable

from sim_action.core.errors import Location
from sim_action.core.yaml_document import Document, KeyPath


def merged(base: Document, over: Document) -> Document:
    """Two maps of keys as one, in which `over` has the last word."""
    replaced: set[KeyPath] = set()
    data = _merged(base.data, over.data, (), replaced)
    kept = {path: place for path, place in base.marks.items() if replaced.isdisjoint(_leading_to(path))}
    return Document(over.file, data, {**kept, **over.marks})


def entries_of(document: Document, key: str) -> list[Document]:
    """The entries of a list below one of the topmost keys, each as a document of its own."""
    assert isinstance(document.data, dict)
    entries: tuple[object, ...] = document.data[key]
    marks: list[dict[KeyPath, Location]] = [{} for _ in entries]
    for path, place in document.marks.items():
        if len(path) > 1 and path[0] == key:
            assert isinstance(path[1], int)
            marks[path[1]][path[2:]] = place
    return [Document(document.file, entry, marks[index]) for index, entry in enumerate(entries)]


def without(document: Document, *keys: str) -> Document:
    """The document without some of its topmost keys."""
    assert isinstance(document.data, dict)
    return Document(
        document.file,
        {key: value for key, value in document.data.items() if key not in keys},
        {path: place for path, place in document.marks.items() if path[:1] not in {(key,) for key in keys}},
    )


def _merged(base: object, over: object, path: KeyPath, replaced: set[KeyPath]) -> object:
    if not isinstance(base, dict) or not isinstance(over, dict):
        replaced.add(path)
        return over
    values = dict(base)
    for key, value in over.items():
        if key not in base:
            values[key] = value
        elif value is None:
            replaced.add((*path, key))
            del values[key]
        else:
            values[key] = _merged(base[key], value, (*path, key), replaced)
    return values


def _leading_to(path: KeyPath) -> Iterable[KeyPath]:
    return (path[:size] for size in range(len(path) + 1))
