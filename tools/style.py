"""Check the rules of docs/contributing/style.md that a program can check: language, names, folder and module sizes.

    python -m tools.style            print each violation as `path:line: advice`; exit with 1 if there is one
    python -m tools.style FOLDER ... print the violations below folders that are not in CLEAN yet

Names are checked in the folders of NAMED; docstrings, comments and tuples in those of CLEAN. After cleaning a folder,
add it there.
"""

from __future__ import annotations

import ast
import io
import re
import sys
import tokenize
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final

import click

from sim_action.cli.main import program

ROOT: Final = Path(__file__).resolve().parents[1]
MAX_FOLDER_MODULES: Final = 25
MAX_MODULE_LINES: Final = 600

# Folders without a vague name, and folders without a violation of `wording_violations`; with the folders below them.
NAMED: Final = ("action", "sim_action", "tools/docs/generators", "tools/release")
CLEAN: Final = ("action", "sim_action", "tools/docs/generators", "tools/release")

_FOLDERS: Final = ("sim_action", "action", "tools")
_OPENING: Final = re.compile(r"(?:What|Whether|Who|Whom|Whose|Whoever|Of|Where|How|Why|That|Those)\b")
_RIDDLES: Final = re.compile(
    r"\b(?:of what|what is|those that|whatever|whoever|nobody|beside|anew|lest|tell|told|tells)\b", re.IGNORECASE
)
_PHRASES: Final = re.compile(rf"{_RIDDLES.pattern}|\b(?:that of|those of)\b", re.IGNORECASE)
_VAGUE_NAMES: Final = frozenset({"each", "found", "given", "here", "known", "there", "told", "wanted"})
_PAIRS: Final = ({"cos", "sin"}, {"min", "max"}, {"minimum", "maximum"})  # functions whose values belong together
_SEE: Final = re.compile(r"See [\w.]+\.")


def docstring_violations(name: str, source: str) -> Iterator[str]:
    """Yield the docstrings of a Python file that do not start with a verb or a noun phrase, or only refer."""
    for node in ast.walk(ast.parse(source)):
        # A string that stands alone is a docstring: of the module, class or function, or of the constant above it.
        match node:
            case ast.Expr(value=ast.Constant(value=str(text))) if match := _OPENING.match(text.lstrip()):
                yield f"{name}:{node.lineno}: start the docstring with a verb or a noun phrase, not with '{match[0]}'"
            case ast.Expr(value=ast.Constant(value=str(text))) if _SEE.fullmatch(text):
                yield f"{name}:{node.lineno}: use @override without a docstring in place of '{text}'"


def name_violations(name: str, source: str) -> Iterator[str]:
    """Yield the variables, parameters, fields and functions with vague names."""
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Name(id=word, ctx=ast.Store()) | ast.arg(arg=word) | ast.FunctionDef(name=word):
                if word.strip("_") in _VAGUE_NAMES:
                    yield f"{name}:{node.lineno}: name the thing; '{word}' can be anything"


def wording_violations(name: str, source: str) -> Iterator[str]:
    """Yield discouraged phrases in docstrings and comments, and tuples that pack unrelated values."""
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Expr(value=ast.Constant(value=str(text))):
                yield from _phrase(name, node.lineno, text)
            case ast.Assign(targets=[ast.Tuple()], value=ast.Tuple(elts=values)) if _are_unrelated(values):
                yield f"{name}:{node.lineno}: assign unrelated values one by one, not as a tuple"
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield from _phrase(name, token.start[0], token.string)


def _phrase(name: str, line: int, text: str) -> Iterator[str]:
    if match := _PHRASES.search(" ".join(text.split())):
        yield f"{name}:{line}: avoid '{match[0].lower()}' in docstrings and comments"


def _are_unrelated(values: list[ast.expr]) -> bool:
    """Return True for values that the assignment makes, not for constants, nor if one function or a pair makes all."""
    calls = (ast.unparse(value.func) if isinstance(value, ast.Call) else type(value).__name__ for value in values)
    makers = {call.rpartition(".")[2] for call in calls}
    return (
        len(makers) > 1
        and makers not in _PAIRS
        and all(isinstance(value, ast.Call | ast.Constant | ast.List | ast.Dict) for value in values)
    )


def help_violations(command: click.Command, name: str) -> Iterator[str]:
    """Yield the help texts of a command and its subcommands that are missing or contain a discouraged phrase."""
    options = (option for option in command.params if isinstance(option, click.Option))
    texts = {name: command.help, **{f"{name} {option.opts[-1]}": option.help for option in options}}
    for place, text in texts.items():
        if not text:
            yield f"{place}: write a help text"
        elif match := _OPENING.match(text) or _RIDDLES.search(text):
            yield f"{place}: avoid '{match[0]}' in the help text"
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


def is_below(name: str, folders: Iterable[str]) -> bool:
    """Return True for a path of one of the folders."""
    return any(name == folder or name.startswith(f"{folder}/") for folder in folders)


def violations(paths: Iterable[Path]) -> Iterator[str]:
    """Yield all violations in Python files of the repository and in the help texts."""
    sources = {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in paths}
    if missing := [folder for folder in _FOLDERS if not any(name.startswith(f"{folder}/") for name in sources)]:
        yield f"{', '.join(missing)}: no Python file found, nothing was checked there"
    for name, source in sources.items():
        yield from docstring_violations(name, source)
        if is_below(name, NAMED):
            yield from name_violations(name, source)
        if is_below(name, CLEAN):
            yield from wording_violations(name, source)
    yield from size_violations({name: source.count("\n") for name, source in sources.items()})
    yield from help_violations(program, "sim-action")


def main() -> int:
    """Check all files and help texts, print the violations and return the exit code."""
    if folders := sys.argv[1:]:
        paths = sorted(path for folder in folders for path in python_files(ROOT / folder))
        sources = {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in paths}
        checks = (name_violations, wording_violations)
        problems = [problem for name, text in sources.items() for check in checks for problem in check(name, text)]
    else:
        paths = sorted(path for folder in _FOLDERS for path in python_files(ROOT / folder))
        problems = list(violations(paths))
    print("\n".join(problems) or f"style: {len(paths)} files follow docs/contributing/style.md")
    return 1 if problems else 0


def python_files(folder: Path) -> Iterator[Path]:
    """Yield the Python files below a folder, without Node.js packages."""
    return (path for path in folder.rglob("*.py") if "node_modules" not in path.parts)


if __name__ == "__main__":
    sys.exit(main())
