"""Python files of the user's: read as text by whoever asks, run in the scenario's own process alone."""

from __future__ import annotations

import ast
import runpy
import sys
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

from sim_action.errors import ScriptError
from sim_action.location import Location

ANYTHING: Final = "*"
"""Among the names that a script binds: it imports all names of another module."""

_MOST_BYTES: Final = 1_000_000
_MOST_REMEMBERED: Final = 16


class ScriptProblem(ValueError):
    """Why a file cannot be what it is named for, to be said after its name."""


@dataclass(frozen=True, slots=True)
class ScriptClass:
    """A class of a script; `is_plain`: all that it has stands in its body."""

    name: str
    line: int
    names: frozenset[str]
    is_plain: bool


@dataclass(frozen=True, slots=True)
class Script:
    """What can be said of a Python file without running it.

    Attributes:
        names: what it defines, imports or assigns outside its functions and classes, also in an `if` or a `try`.
        classes: those that it defines for themselves.
    """

    names: frozenset[str]
    classes: tuple[ScriptClass, ...]


def read_script(path: Path) -> Script:
    """Raises OSError, ScriptProblem."""
    with path.open("rb") as file:
        source = file.read(_MOST_BYTES + 1)
    if len(source) > _MOST_BYTES:
        raise ScriptProblem(f": a script of more than {_MOST_BYTES // 1000} kB is not read")
    found = _parsed(source)
    if isinstance(found, str):
        raise ScriptProblem(found)
    return found


# To parse a large one takes seconds, and many expectations may be of classes of the same file.
@lru_cache(maxsize=_MOST_REMEMBERED)
def _parsed(source: bytes) -> Script | str:
    """What a text defines, or why it is no Python."""
    try:
        tree = ast.parse(source)
    except SyntaxError as error:
        line = "" if error.lineno is None else f":{error.lineno}"
        return f"{line}: not valid Python: {error.msg}"
    except (ValueError, RecursionError, MemoryError) as error:
        return f": not valid Python: {error}"
    classes = (_class_of(node) for node in tree.body if isinstance(node, ast.ClassDef))
    return Script(_names_bound_in(tree.body), tuple(classes))


def _class_of(node: ast.ClassDef) -> ScriptClass:
    is_plain = not (node.bases or node.keywords or node.decorator_list)
    return ScriptClass(node.name, node.lineno, _names_bound_in(node.body), is_plain)


def _names_bound_in(body: Sequence[ast.AST]) -> frozenset[str]:
    names, waiting = set(), list(body)
    while waiting:
        match node := waiting.pop():
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                names.add(name)
                continue
            case ast.alias():
                names.add(node.asname or node.name)
            case ast.Name(ctx=ast.Store()):
                names.add(node.id)
        waiting += ast.iter_child_nodes(node)
    return frozenset(names)


def run_file(path: Path, who: str) -> dict[str, Any]:
    """What a file leaves behind when it has run; it may import its neighbours. Raises ScriptError."""
    sys.path.insert(0, str(path.parent))
    with told_at(path, who):
        return runpy.run_path(str(path))


@contextmanager
def told_at(path: Path, who: str) -> Iterator[None]:
    """Whatever the user's code raises, or exits with, is told with its line."""
    try:
        yield
    except BaseException as error:  # noqa: BLE001 - sys.exit() in a script must not end the run unseen
        raise script_error(error, path, who) from None


def script_error(error: BaseException, path: Path, who: str) -> ScriptError:
    """Says where in the user's file it happened, which is not where our own frames are; `who` raised it."""
    if isinstance(error, SyntaxError) and error.filename:
        return ScriptError(f"SyntaxError: {error.msg}", Location(error.filename, error.lineno))
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
    what = traceback.format_exception_only(error)[-1].strip()
    return ScriptError(f"{who} raised {what}", Location(str(path), lines[-1] if lines else None))
