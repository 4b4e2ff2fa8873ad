"""Replace the values of variables that the caller passes to code of the repository (`--pass-env`) by *** in results.

An outcome gets its texts from code of the repository, which may print or return its whole environment. This is the one
place between that code and all reports.
"""

from __future__ import annotations

import gzip
import json
import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Self, TypeVar

from sim_action.core.child_environment import missing_variable
from sim_action.core.field_types import FrozenModel
from sim_action.core.files import whole_file
from sim_action.results.outcome import ExpectationOutcome, Failure, Outcome

Model = TypeVar("Model", bound=FrozenModel)

STARS: Final = "***"

_MAX_REPLAY_BYTES: Final = 500_000_000

MIN_CHARS: Final = 4
"""Shorter values are left: their text is everywhere."""


@dataclass(frozen=True, slots=True)
class Mask:
    """The values to replace, and the names of the variables that code of the repository sees in addition.

    Attributes:
        names: the names that the caller passes.
        pattern: matches every value; None: there is none.
    """

    names: tuple[str, ...] = ()
    pattern: re.Pattern[str] | None = None

    @classmethod
    def of(cls, environment: Mapping[str, str], names: tuple[str, ...]) -> Self:
        """Return the mask of a call that passes the variables with these names."""
        texts = {text for name in names if name in environment for text in _forms(environment[name])}
        longest_first = sorted(texts, key=lambda text: (-len(text), text))
        return cls(names, re.compile("|".join(map(re.escape, longest_first))) if texts else None)

    def text(self, text: str) -> str:
        """Return a text without the values."""
        return text if self.pattern is None else self.pattern.sub(STARS, text)

    def outcome(self, outcome: Outcome, *, names: bool = False, states: bool = True) -> Outcome:
        """Return an outcome without the values, and with hints at variables that code asked for and did not see.

        Args:
            outcome: the outcome as code of the repository may have written it.
            names: True if that code also chose the names in it.
            states: True if a scenario could state the variable with `environment:`.
        """
        hinted = tuple(self._hinted(each, states=states) for each in outcome.failures)
        judged = tuple(self._judged_with_hint(each, states=states) for each in outcome.expectations)
        outcome = outcome.model_copy(update={"failures": hinted, "expectations": judged})
        if self.pattern is None:
            return outcome
        return outcome.model_copy(
            update={
                "name": self.text(outcome.name) if names else outcome.name,
                "expectations": tuple(self._expectation(each, names=names) for each in outcome.expectations),
                "failures": tuple(map(self._failure, outcome.failures)),
                "notes": tuple(map(self.text, outcome.notes)),
                "warnings": tuple(_changed(each, message=self.text(each.message)) for each in outcome.warnings),
                "diagnostics": tuple(_changed(each, message=self.text(each.message)) for each in outcome.diagnostics),
                "output": self.text(outcome.output),
            }
        )

    def replay(self, path: Path) -> None:
        """Remove the values from a stored replay, in which names of links and marks stand. A bad file is left."""
        if self.pattern is None:
            return
        with suppress(OSError, EOFError, ValueError):
            with gzip.open(path) as file:
                text = file.read(_MAX_REPLAY_BYTES).decode("utf-8")
            if (masked := self.text(text)) != text:
                with whole_file(path) as written:
                    written.write(gzip.compress(masked.encode("utf-8"), mtime=0))

    def _expectation(self, expected: ExpectationOutcome, *, names: bool) -> ExpectationOutcome:
        verdict = expected.verdict
        masked = replace(verdict, message=self.text(verdict.message), unit=self.text(verdict.unit))
        return _changed(expected, name=self.text(expected.name) if names else expected.name, verdict=masked)

    def _failure(self, failure: Failure) -> Failure:
        place = failure.location and replace(failure.location, file=self.text(failure.location.file))
        details = self.text(failure.details)
        return _changed(failure, message=self.text(failure.message), details=details, location=place)

    def _hinted(self, failure: Failure, *, states: bool) -> Failure:
        hint = self._hint((failure.message, failure.details), states=states)
        return failure if hint is None else _changed(failure, message=f"{failure.message}; {hint}")

    def _judged_with_hint(self, expected: ExpectationOutcome, *, states: bool) -> ExpectationOutcome:
        verdict = expected.verdict
        hint = None if verdict.passed else self._hint((verdict.message,), states=states)
        if hint is None:
            return expected
        return _changed(expected, verdict=replace(verdict, message=f"{verdict.message}; {hint}"))

    def _hint(self, texts: Iterable[str], *, states: bool) -> str | None:
        missing = next((name for text in texts if (name := missing_variable(text, self.names)) is not None), None)
        if missing is None:
            return None
        stated = ", or set it with 'environment:' in the scenario" if states else ""
        return (
            f"the variable {missing} exists, but code of the repository does not see it: pass it with "
            f"--pass-env {missing} (input pass-env of the action){stated}"
        )


def _changed(model: Model, **changes: object) -> Model:
    return model.model_copy(update=changes)


def _forms(value: str) -> set[str]:
    """Return a value, each of its lines, and their escaped forms, without those that are too short."""
    lines = {value, value.strip(), *map(str.strip, value.splitlines())}
    forms = {form for line in lines for form in (line, json.dumps(line)[1:-1], repr(line)[1:-1])}
    return {form for form in forms if len(form) >= MIN_CHARS}
