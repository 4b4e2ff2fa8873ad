"""Which tests reach a place of the source, in whatever process: one run of the suite answers for many places.

A copy of the sources is given a probe before each place. A probe writes the name of the running test into the file of
its place; children of a test have the name in their environment, too.
"""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path
from typing import Final

from tests.mutations import Mutant

_MODULE: Final = "sim_action/reached.py"
_PROBES: Final = """
import os

_seen, _open, _write, _close = set(), os.open, os.write, os.close

def mark(place):
    test = os.environ.get("PYTEST_CURRENT_TEST", "")
    if (place, test) not in _seen:
        _seen.add((place, test))
        try:
            file = _open(f"{FOLDER}/{place}", os.O_WRONLY | os.O_APPEND | os.O_CREAT)
            _write(file, f"{test}\\n".encode())
            _close(file)
        except OSError:
            pass
"""
_DURATION: Final = re.compile(r"^([\d.]+)s (?:setup|call|teardown) +(\S.*?) *$", re.MULTILINE)
_Function = ast.FunctionDef | ast.AsyncFunctionDef


def with_probes(source: str, places: Iterable[tuple[int, int]]) -> str:
    """Return a source that marks places, each a number and an offset in bytes.

    A place outside of functions is used by any function of the module; without one, by who imports it.
    """
    tree, lines = ast.parse(source), source.splitlines(keepends=True)
    probes: dict[int, set[int]] = defaultdict(set)
    for number, offset in places:
        line = source.encode()[:offset].count(b"\n") + 1
        column = offset - (source.encode().rfind(b"\n", 0, offset) + 1)
        for before in _lines_before(tree, (line, column), lines):
            probes[before].add(number)
    for line in sorted(probes, reverse=True):
        text = lines[line - 1]
        calls = "; ".join(f'__import__("sim_action.reached").reached.mark({number})' for number in sorted(probes[line]))
        lines.insert(line - 1, f"{text[: len(text) - len(text.lstrip())]}{calls}\n")
    return "".join(lines)


def _lines_before(tree: ast.Module, place: tuple[int, int], lines: Sequence[str]) -> set[int]:
    def covers(node: ast.stmt) -> bool:
        end = (node.end_lineno or node.lineno, node.end_col_offset or 0)
        return (node.lineno, node.col_offset) <= place < end

    nodes = list(ast.walk(tree))
    functions = [node for node in nodes if isinstance(node, _Function)]
    inside = [node for function in functions for start in function.body for node in ast.walk(start)]
    around = [node for node in inside if isinstance(node, ast.stmt) and covers(node) and _begins_line(node, lines)]
    if around:
        return {_first_line(max(around, key=lambda node: (node.lineno, node.col_offset)))}
    firsts = [node for function in functions for node in function.body[ast.get_docstring(function) is not None :][:1]]
    return {_first_line(node) for node in firsts if _begins_line(node, lines)} or {_first_line(tree.body[-1])}


def _begins_line(node: ast.stmt, lines: Sequence[str]) -> bool:
    """Return False for `elif`, too: it is a statement in another one."""
    line = lines[node.lineno - 1]
    return not line.encode()[: node.col_offset].strip() and not line.lstrip().startswith("elif")


def _first_line(node: ast.stmt) -> int:
    decorators: list[ast.expr] = getattr(node, "decorator_list", [])
    return min([node.lineno, *(decorator.lineno for decorator in decorators)])


def insert_probes(folder: Path, mutants: Sequence[Mutant]) -> None:
    """Change the sources of a copy, so that the place of each mutant is marked."""
    marks = folder / ".reached"
    marks.mkdir()
    (folder / _MODULE).write_text(f"FOLDER = {str(marks)!r}\n{_PROBES}", encoding="utf-8")
    for file in {mutant.file for mutant in mutants}:
        places = [(number, mutant.start) for number, mutant in enumerate(mutants) if mutant.file == file]
        text = with_probes((folder / file).read_text(encoding="utf-8"), places)
        (folder / file).write_text(text, encoding="utf-8")


def reaching(folder: Path, number: int, tests: Collection[str]) -> set[str]:
    """Return the tests that reached a place; the file of one that did in its setup, which others may share.

    An empty name stands for a place that was reached by none of the `tests`, such as the import of its module.
    """
    marks = folder / ".reached" / str(number)
    if not marks.exists():
        return set()
    lines = [line.rpartition(" (") for line in marks.read_text(encoding="utf-8").splitlines()]
    files = {test.partition("::")[0] for test, _, phase in lines if phase == "setup)" and test in tests}
    return {test if test in tests else "" for test, _, _ in lines} | files


def durations_s(printed: str) -> dict[str, float]:
    """Return the duration of each test, from what `pytest --durations 0 -vv` prints."""
    total: dict[str, float] = defaultdict(float)
    for duration, test in _DURATION.findall(printed):
        total[test] += float(duration)
    return total
