"""Check the rules of docs/contributing/style.md that a program can check: language, folder sizes, module lengths.

Usage: `python -m tools.style`. It prints each violation as `path:line: advice` and exits with 1 if there is one.
"""

from __future__ import annotations

import ast
import re
import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final

import click

from sim_action.cli.main import program

ROOT: Final = Path(__file__).resolve().parents[1]
MAX_FOLDER_MODULES: Final = 25
MAX_MODULE_LINES: Final = 600

_FOLDERS: Final = ("sim_action", "action", "tools")
_OPENING: Final = re.compile(r"(?:What|Whether|Who|Whom|Whose|Whoever|Of|Where|How|Why|That|Those)\b")
_RIDDLES: Final = re.compile(
    r"\b(?:of what|what is|those that|whatever|whoever|nobody|beside|anew|lest|tell|told|tells)\b", re.IGNORECASE
)


def docstring_violations(name: str, source: str) -> Iterator[str]:
    """Yield the docstrings of a Python file that do not start with a verb or a noun phrase."""
    for node in ast.walk(ast.parse(source)):
        # A string that stands alone is a docstring: of the module, class or function, or of the constant above it.
        match node:
            case ast.Expr(value=ast.Constant(value=str(text))) if found := _OPENING.match(text.lstrip()):
                yield f"{name}:{node.lineno}: start the docstring with a verb or a noun phrase, not with '{found[0]}'"


def help_violations(command: click.Command, name: str) -> Iterator[str]:
    """Yield the help texts of a command and its subcommands that are missing or contain a discouraged phrase."""
    options = (each for each in command.params if isinstance(each, click.Option))
    texts = {name: command.help, **{f"{name} {option.opts[-1]}": option.help for option in options}}
    for place, text in texts.items():
        if not text:
            yield f"{place}: write a help text"
        elif found := _OPENING.match(text) or _RIDDLES.search(text):
            yield f"{place}: avoid '{found[0]}' in the help text"
    if isinstance(command, click.Group):
        for below, subcommand in command.commands.items():
            yield from help_violations(subcommand, f"{name} {below}")


def size_violations(lines: dict[str, int]) -> Iterator[str]:
    """Yield too long modules and too large folders; `lines`: path of a module -> number of its lines."""
    for name, count in lines.items():
        if count > MAX_MODULE_LINES:
            yield f"{name}:1: {count} lines; a module has at most {MAX_MODULE_LINES}"
    for folder, count in Counter(name.rpartition("/")[0] for name in lines).items():
        if count > MAX_FOLDER_MODULES:
            yield f"{folder}: {count} modules; a folder has at most {MAX_FOLDER_MODULES}"


def violations(paths: Iterable[Path]) -> Iterator[str]:
    """Yield all violations in Python files of the repository and in the help texts."""
    sources = {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in paths}
    if missing := [folder for folder in _FOLDERS if not any(name.startswith(f"{folder}/") for name in sources)]:
        yield f"{', '.join(missing)}: no Python file found, nothing was checked there"
    for name, source in sources.items():
        yield from docstring_violations(name, source)
    yield from size_violations({name: source.count("\n") for name, source in sources.items()})
    yield from help_violations(program, "sim-action")


def main() -> int:
    """Check all files and help texts, print the violations and return the exit code."""
    paths = sorted(path for folder in _FOLDERS for path in (ROOT / folder).rglob("*.py"))
    found = list(violations(paths))
    print("\n".join(found) or f"style: {len(paths)} files and all help texts follow docs/contributing/style.md")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
