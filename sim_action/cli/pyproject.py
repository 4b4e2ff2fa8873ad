"""Default options of the command line from `[tool.sim-action]` in pyproject.toml.

A stranger's pull request can change this file. It must not allow more than a scenario may do: run, read or write.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any, Final

from sim_action.cli import SUBCOMMANDS
from sim_action.core.errors import Location, UsageError
from sim_action.core.files import read_at_most
from sim_action.core.wording import escaped_line
from sim_action.core.workspace import Workspace, file_name, is_of_git
from sim_action.core.yaml_document import Document, KeyPath

if TYPE_CHECKING:
    from sim_action.cli.pyproject_keys import Defaults

FILE: Final = "pyproject.toml"
TABLE: Final = ("tool", "sim-action")
_MAX_BYTES: Final = 1_000_000
_MAX_PROBLEMS: Final = 100
_HEADER: Final = re.compile(r"\s*\[\s*tool\s*\.\s*[\"']?sim-action[\"']?\s*\]")
# Matches every way to write the table. Parsing a long file for nothing takes a tenth of the time to check a scenario.
_MENTION: Final = re.compile(r"\btool\b\W*sim-action|\[\W*tool\W*\]|^\W*tool\W*=|\\u", re.MULTILINE | re.IGNORECASE)
_KEY: Final = re.compile(r"\s*[\"']?([A-Za-z0-9_-]+)[\"']?\s*=")
# tomllib needs quadratic time for a dotted key: a minute for 20,000 steps.
_ENDLESS_KEY: Final = re.compile(r"(?:[\"']?[A-Za-z0-9_-]++[\"']?\s*+\.\s*+){100}")


def default_map(subcommand: str | None, working_folder: Path) -> dict[str, dict[str, Any]]:
    """Return the defaults of a subcommand that is called in `working_folder`, by click's names of its options.

    In addition, `paths_location`: the place of the key `paths`, if it is stated.

    Raises UsageError for an invalid table.
    """
    options = SUBCOMMANDS[subcommand].keys if subcommand else ()
    nearest = _nearest(working_folder) if options else None
    if not subcommand or not options or nearest is None:
        return {}
    path, document = nearest
    defaults = _validated(document, path.parent)
    stated = {name: value for name in options if (value := getattr(defaults, name)) is not None}
    for name in ("output_dir", "junit", "paths"):
        if name in stated:
            stated[name] = _seen_from(working_folder, path.parent, stated[name])
    if "paths" in stated:
        stated["paths_location"] = document.location(("paths",))
    return {subcommand: stated}


def _nearest(working_folder: Path) -> tuple[Path, Document] | None:
    """Return the nearest pyproject.toml with such a table, from `working_folder` upwards within the workspace."""
    root = Workspace.around(working_folder.resolve() / "a scenario").root
    for folder in (working_folder.resolve(), *working_folder.resolve().parents):
        path = folder / FILE
        document = _read(path) if path.is_file() and path.resolve().is_relative_to(root) else None
        if document is not None:
            return path, document
        if folder == root:
            break
    return None


def _read(path: Path) -> Document | None:
    """Return the table of a file, or None if it has none. Raises UsageError."""
    name = file_name(Path(os.path.relpath(path)))
    try:
        if (data := read_at_most(path, _MAX_BYTES)) is None:
            raise UsageError(f"{name} cannot be read: it is larger than {_MAX_BYTES // 1_000_000} MB")
        text = data.decode("utf-8", errors="replace")
        if TABLE[1] not in text or not _MENTION.search(text):
            return None
        if _ENDLESS_KEY.search(text):
            raise UsageError(f"{name} cannot be read: it has a key of more than 100 steps")
        import tomllib

        table: Any = tomllib.loads(text)
    except OSError as error:
        raise UsageError(f"{name} cannot be read: {error.strerror}") from None
    except RecursionError:
        raise UsageError(f"{name} cannot be read: its lists or tables are nested too deeply") from None
    except ValueError as error:
        if type(error) is ValueError:  # Python reads no longer integers
            most = sys.get_int_max_str_digits()
            message = f"{name} cannot be read: it has a number of more than {most} digits; shorten it"
            raise UsageError(message) from None
        raise UsageError(f"{name} is not valid TOML: {escaped_line(str(error))}") from None
    for step in TABLE:
        table = table.get(step) if isinstance(table, dict) else None
    return None if table is None else Document(name, table, dict(_marks(name, text)))


def _marks(name: str, text: str) -> Iterator[tuple[KeyPath, Location]]:
    """Yield the locations of the keys, if the table is written in the usual way."""
    inside = False
    for number, line in enumerate(text.split("\n"), start=1):
        if line.lstrip().startswith("["):
            inside = bool(_HEADER.match(line))
            if inside:
                yield (), Location(name, number, 1)
        elif inside and (key := _KEY.match(line)):
            yield (key[1],), Location(name, number, key.start(1) + 1)


def _validated(document: Document, folder: Path) -> Defaults:
    """Raises UsageError."""
    from pydantic import ValidationError

    from sim_action.cli.pyproject_keys import Defaults, key_problem
    from sim_action.core.field_types import spec_errors

    data = document.data
    if isinstance(data, dict):
        data = {key: tuple(value) if isinstance(value, list) else value for key, value in data.items()}
    try:
        defaults = Defaults.model_validate(data)
    except ValidationError as error:
        errors = spec_errors(Defaults, data, error)
        problems = [document.problem(path, key_problem(path, message)) for path, message in errors]
    else:
        problems = [document.problem((key,), message) for key, message in _out_of_bounds(defaults, folder)]
        if not problems:
            return defaults
    more = len(problems) - _MAX_PROBLEMS
    lines = [
        *map(str, problems[:_MAX_PROBLEMS]),
        *([f"{document.file}: and {more:,} more problems"] if more > 0 else []),
    ]
    raise UsageError("\n".join(lines))


def _out_of_bounds(defaults: Defaults, folder: Path) -> Iterator[tuple[str, str]]:
    """Yield a problem for each path outside the folder of the file. Only the command line may name such paths."""
    named = {"output-dir": (defaults.output_dir,), "junit": (defaults.junit,), "paths": defaults.paths or ()}
    for key, names in named.items():
        for name in filter(None, names):
            if not _is_below(folder, name):
                yield key, f"{name!r} must be below the folder of {FILE}; only the command line may name other folders"


def _is_below(folder: Path, name: str) -> bool:
    """Return True if a path is below a folder. Symbolic links are followed."""
    try:
        resolved = (folder / name).resolve()
    except (OSError, ValueError, RuntimeError):  # too long, a NUL in it, links in a circle
        return False
    named = PurePath(name)
    return (
        name.isprintable()
        and resolved.is_relative_to(folder.resolve())
        and ".." not in named.parts
        and not is_of_git(named)
        and not is_of_git(resolved)
    )


def _seen_from(working_folder: Path, folder: Path, names: Any) -> Any:
    if isinstance(names, tuple):
        return tuple(_seen_from(working_folder, folder, name) for name in names)
    return (
        names
        if folder == working_folder.resolve()
        else Path(os.path.relpath(folder / names, working_folder.resolve())).as_posix()
    )
