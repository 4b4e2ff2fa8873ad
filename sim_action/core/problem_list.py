"""What is wrong with one scenario file, collected: all of it is told at once."""

from __future__ import annotations

from collections.abc import Iterator

from sim_action.core.errors import InvalidScenario
from sim_action.core.location import Problem
from sim_action.core.yaml_document import Document, KeyPath

# The keys that lead to a problem in a scenario, and its message.
SpecProblem = tuple[tuple[str | int, ...], str]
SpecProblems = Iterator[SpecProblem]


class ProblemList:
    """Problems at places of a document, each of them once."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._problems: dict[tuple[KeyPath, str], Problem] = {}

    def __bool__(self) -> bool:
        return bool(self._problems)

    def note(self, path: KeyPath, message: str) -> None:
        """Something is wrong at the keys that lead to it."""
        self._problems.setdefault((path, message), self._document.problem(path, message))

    def note_all(self, path: KeyPath, problems: SpecProblems) -> None:
        """Problems of a part of the document, which `path` leads to."""
        for below, message in problems:
            self.note((*path, *below), message)

    def note_elsewhere(self, problem: Problem) -> None:
        """Something is wrong in another file, where it has to be mended."""
        self._problems.setdefault(((problem.location.file,), str(problem)), problem)

    def has_below(self, path: KeyPath) -> bool:
        """Whether something is wrong further down the same way."""
        return any(len(noted) > len(path) and noted[: len(path)] == path for noted, _ in self._problems)

    def error(self) -> InvalidScenario:
        """All of it, those of the document first, in the order of its lines."""
        return InvalidScenario(sorted(self._problems.values(), key=self._place))

    def _place(self, problem: Problem) -> tuple[bool, int, int]:
        where = problem.location
        return where.file != self._document.file, where.line or 0, where.column or 0
