"""Python files of the user's: read as text by whoever asks, run in the scenario's own process alone."""

from __future__ import annotations

import ast
import runpy
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from sim_action.errors import ScriptError
from sim_action.location import Location

ANYTHING: Final = "*"
"""Among the names that a script binds: it imports all names of another module."""

_MOST_BYTES: Final = 1_000_000


class ScriptProblem(ValueError):
    """Why a file cannot be what it is named for, to be said after its name."""


def read_script(path: Path) -> ast.Module:
    """Raises OSError, ScriptProblem."""
    with path.open("rb") as file:
        source = file.read(_MOST_BYTES + 1)
    if len(source) > _MOST_BYTES:
        raise ScriptProblem(f": a script of more than {_MOST_BYTES // 1000} kB is not read")
    try:
        return ast.parse(source, filename=str(path))
    except SyntaxError as error:
        line = "" if error.lineno is None else f":{error.lineno}"
        raise ScriptProblem(f"{line}: not valid Python: {error.msg}") from None
    except (ValueError, RecursionError, MemoryError) as error:
        raise ScriptProblem(f": not valid Python: {error}") from None


def names_bound_by(tree: ast.Module) -> set[str]:
    """What the module defines, imports or assigns outside its functions and classes, also in an `if` or a `try`."""
    names, waiting = set(), list[ast.AST](tree.body)
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
    return names


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
