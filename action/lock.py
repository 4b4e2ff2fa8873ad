"""Lock files: the packages of an installation, each with its version and the hashes of its wheels."""

from __future__ import annotations

import ast
import hashlib
import operator
import platform
import re
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

# Only these have a lock file of their own: a workflow cannot name other packages.
EXTRAS: Final = ("mcap", "policy", "rosbags", "video")
ENGINES: Final = {"pybullet": "pybullet", "mujoco": "mujoco-core"}
"""Engine, which is also its Python module -> its package."""

_ENTRY: Final = re.compile(r"^[^\s#].*(?:\n[ \t].*)*", re.MULTILINE)
_FIRST_LINE: Final = re.compile(r"([\w.-]+)==([\w.!+]+)(?:\s*;\s*([^\\\n]+))?")
_COMPARISONS: Final = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}


class LockError(Exception):
    """A lock file, or a choice of lock files, that cannot be used."""


@dataclass(frozen=True)
class Entry:
    """A package of a lock file.

    Attributes:
        name: in its normalized form, such as "typing-extensions".
        marker: the systems that need the package; empty: all of them.
        hashes: the SHA-256 of each of its wheels, in hexadecimal.
        text: the lines of the lock file.
    """

    name: str
    version: str
    marker: str
    hashes: frozenset[str]
    text: str

    def holds(self, system: Mapping[str, str]) -> bool:
        """Return True if the system needs the package. `system`: the variables of markers."""
        return not self.marker or _holds(ast.parse(self.marker, mode="eval").body, system)


def this_system() -> dict[str, str]:
    """Return the variables of markers for the interpreter that runs this."""
    return {
        "sys_platform": sys.platform,
        "platform_machine": platform.machine(),
        "python_full_version": ".".join(map(str, sys.version_info[:3])),
    }


def entries(text: str) -> tuple[Entry, ...]:
    """Return the packages of a lock file. Raises LockError."""
    return tuple(map(_entry, _ENTRY.findall(text)))


def entries_here(locks: Iterable[Path]) -> tuple[Entry, ...]:
    """Return the packages of several lock files that this system needs, each once. Raises LockError."""
    system = this_system()
    packages = (entry for lock in locks for entry in entries(lock.read_text(encoding="utf-8")))
    return tuple(dict.fromkeys(entry for entry in packages if entry.holds(system)))


def chosen_locks(lock: Path, extras: str) -> list[Path]:
    """Return the lock files of extras, next to `lock`; without extras, `lock`. Raises LockError."""
    names = sorted(set(re.split(r"[\s,]+", extras)) - {""})
    if not set(names) <= set(EXTRAS):
        unknown = ", ".join(repr(name) for name in names if name not in EXTRAS)
        raise LockError(f"the input extras must be empty, or some of {', '.join(EXTRAS)}; found {unknown}")
    return [lock.with_name(f"{lock.stem}-{name}{lock.suffix}") for name in names] or [lock]


def text_of(packages: Iterable[Entry]) -> str:
    """Return a lock file of these packages."""
    return "".join(f"{entry.text}\n" for entry in packages)


def digest(packages: Iterable[Entry]) -> str:
    """Return the SHA-256 of the lock file of these packages."""
    return hashlib.sha256(text_of(packages).encode()).hexdigest()


def engines_of(packages: Iterable[Entry]) -> tuple[str, ...]:
    """Return the engines among packages."""
    names = {entry.name for entry in packages}
    return tuple(engine for engine, package in ENGINES.items() if package in names)


def without_engines(packages: Iterable[Entry], left_out: Iterable[str]) -> tuple[Entry, ...]:
    """Return the packages without some engines."""
    names = {ENGINES[engine] for engine in left_out}
    return tuple(entry for entry in packages if entry.name not in names)


def normalized(name: str) -> str:
    """Return the name of a package in the form that lock files use."""
    return re.sub(r"[-_.]+", "-", name).lower()


def wheels_of(folder: Path) -> dict[tuple[str, str], list[Path]]:
    """Return the wheels in a folder by their name and version; a folder that cannot be read has none."""
    by_name: dict[tuple[str, str], list[Path]] = {}
    try:
        wheels = sorted(folder.glob("*.whl"))
    except OSError:
        return {}
    for wheel in wheels:
        name, _, rest = wheel.name.partition("-")
        by_name.setdefault((normalized(name), rest.partition("-")[0]), []).append(wheel)
    return by_name


def _entry(text: str) -> Entry:
    first = _FIRST_LINE.match(text)
    if first is None:
        raise LockError(f"a line of the lock file is no package with a version: {text.splitlines()[0]}")
    name, version, marker = first.groups()
    hashes = re.findall(r"--hash=sha256:([0-9a-f]{64})\b", text)
    return Entry(normalized(name), version, (marker or "").strip(), frozenset(hashes), text.rstrip())


def _holds(node: ast.expr, system: Mapping[str, str]) -> bool:
    match node:
        case ast.BoolOp(op=ast.And(), values=parts):
            return all(_holds(part, system) for part in parts)
        case ast.BoolOp(op=ast.Or(), values=parts):
            return any(_holds(part, system) for part in parts)
        case ast.Compare(left=ast.Name(id=name), ops=[comparison], comparators=[ast.Constant(value=str(wanted))]):
            compare = _COMPARISONS.get(type(comparison))
            if compare is not None and name in system:
                return bool(compare(_comparable(name, system[name]), _comparable(name, wanted)))
    raise LockError(f"the lock file has a marker that is not known: {ast.unparse(node)}")


def _comparable(variable: str, value: str) -> tuple[int, ...] | str:
    return tuple(map(int, value.split("."))) if variable == "python_full_version" else value
