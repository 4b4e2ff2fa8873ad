"""The dotted keys of variations, such as `world.objects.wall.pose.x`: where they lead, and values placed there.

A step into a list is the name of an entry or its index from 0. A key or name that contains dots counts as a whole.
"""

from __future__ import annotations

from collections.abc import Sequence

from sim_action.core.wording import did_you_mean, shown
from sim_action.core.yaml_document import KeyPath


class NoSuchKey(Exception):
    """A dotted key that leads nowhere."""


def resolved(data: object, written: str) -> KeyPath:
    """Return the path of keys and indices of a dotted key. Its last steps need not exist yet. Raises NoSuchKey."""
    steps = written.split(".")
    if not all(steps):
        raise NoSuchKey("a key is a path of keys with dots, such as robot.pose.yaw")
    path: KeyPath = ()
    while steps:
        if isinstance(data, dict):
            taken = next((size for size in range(len(steps), 1, -1) if ".".join(steps[:size]) in data), 1)
            step: str | int = ".".join(steps[:taken])
            data, steps = data.get(step), steps[taken:]
        elif isinstance(data, tuple):
            step, taken = _entry(data, steps, path)
            data, steps = data[step], steps[taken:]
        elif data is None:
            step, steps = steps[0], steps[1:]
        else:
            raise NoSuchKey(f"{_dotted(path)} is {shown(data)}, and has no key '{steps[0]}'")
        path = (*path, step)
    return path


def placed(data: object, path: KeyPath, value: object) -> tuple[object, list[KeyPath]]:
    """Return a copy of the data with a value at `path`, and the paths that are new in it."""
    new, made = _placed(data, path, value)
    return new, [path[:size] for size in range(len(path) - made, len(path) + 1)]


def _placed(data: object, path: KeyPath, value: object) -> tuple[object, int]:
    """Return a copy of the data with the value, and the number of new steps above it."""
    if not path:
        return value, 0
    step = path[0]
    if isinstance(data, tuple):
        assert isinstance(step, int)
        entry, made = _placed(data[step], path[1:], value)
        return (*data[:step], entry, *data[step + 1 :]), made
    values = data if isinstance(data, dict) else {}
    entry, made = _placed(values.get(step), path[1:], value)
    return {**values, step: entry}, made if step in values or len(path) == 1 else len(path) - 1


def _entry(entries: tuple[object, ...], steps: Sequence[str], path: KeyPath) -> tuple[int, int]:
    """Return the index of a list entry and the number of steps that form its name."""
    names = [entry.get("name") if isinstance(entry, dict) else None for entry in entries]
    for size in range(len(steps), 0, -1):
        if (name := ".".join(steps[:size])) in names:
            return names.index(name), size
    return _index(names, steps[0], path), 1


def _index(names: Sequence[object], step: str, path: KeyPath) -> int:
    if step.isdecimal() and step.isascii() and int(step) < len(names):
        return int(step)
    known = [name for name in names if isinstance(name, str)]
    numbers = f"one of its {len(names)} entries by number, from 0" if names else "it is empty"
    hint = did_you_mean(step, known) if known else ""
    raise NoSuchKey(f"{_dotted(path)} is a list without '{step}'{hint}; {numbers}")


def _dotted(path: KeyPath) -> str:
    return ".".join(map(str, path))
