"""The errors of a YAML file, collected, each with its line and column."""

from __future__ import annotations

from collections.abc import Iterator

from sim_action.core.errors import InvalidScenario, Problem
from sim_action.core.yaml_document import Document, KeyPath

# The keys that lead to a problem in a scenario, and its message.
SpecProblem = tuple[tuple[str | int, ...], str]
SpecProblems = Iterator[SpecProblem]


class ProblemList:
    """A list of problems in one document; each problem is kept once."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self._problems: dict[tuple[KeyPath, str], Problem] = {}

    def __bool__(self) -> bool:
        return bool(self._problems)

    def note(self, path: KeyPath, message: str) -> None:
        """Add a problem at the keys `path`."""
        self._problems.setdefault((path, message), self._document.problem(path, message))

    def note_all(self, path: KeyPath, problems: SpecProblems) -> None:
        """Add problems of the part of the document at `path`."""
        for below, message in problems:
            self.note((*path, *below), message)

    def note_elsewhere(self, problem: Problem) -> None:
        """Add a problem in another file."""
        self._problems.setdefault(((problem.location.file,), str(problem)), problem)

    def has_below(self, path: KeyPath) -> bool:
        """Return True if there is a problem at a place below `path`."""
        return any(len(noted) > len(path) and noted[: len(path)] == path for noted, _ in self._problems)

    def error(self) -> InvalidScenario:
        """Return all problems as one error, those of the document first, in the order of its lines."""
        return InvalidScenario(sorted(self._problems.values(), key=self._place))

    def _place(self, problem: Problem) -> tuple[bool, int, int]:
        where = problem.location
        return where.file != self._document.file, where.line or 0, where.column or 0


# Text that needs no quotes in a YAML list.
