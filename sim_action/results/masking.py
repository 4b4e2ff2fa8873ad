"""Replace the values of variables that the caller passes to code of the repository (`--pass-env`) by *** in results.

An outcome gets its texts from code of the repository, which may print or return its whole environment. This is the one
place between that code and all reports.
"""

from __future__ import annotations

import gzip
import json
import re
from collections.abc import Collection, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, Self, TypeVar

from sim_action.core.field_types import FrozenModel
from sim_action.core.files import whole_file
from sim_action.core.records import dataclass, replace
from sim_action.results.outcome import ExpectationOutcome, Failure, Outcome
from sim_action.scenario.child_environment import missing_variable, unset_variable

Model = TypeVar("Model", bound=FrozenModel)
STARS: Final = "***"

# Numbers and words of the format are no texts of code.
_NAMES_IN_REPLAYS: Final = frozenset({"name", "robot", "unit", "joint_names"})
_MAX_REPLAY_BYTES: Final = 500_000_000
MIN_CHARS: Final = 4  # shorter values are left: their text is everywhere


@dataclass(frozen=True, slots=True)
class Mask:
    """The values to replace, and the names of the variables that code of the repository sees in addition."""

    names: tuple[str, ...] = ()  # the names that the caller passes
    pattern: re.Pattern[str] | None = None  # matches every value; None: there is none

    @classmethod
    def of(cls, environment: Mapping[str, str], names: tuple[str, ...]) -> Self:
        """Return the mask of a call that passes the variables with these names."""
        texts = {text for name in names if name in environment for text in _forms(environment[name])}
        longest_first = sorted(texts, key=lambda text: (-len(text), text))
        return cls(names, re.compile("|".join(map(re.escape, longest_first))) if texts else None)

    def text(self, text: str) -> str:
        """Return a text without the values."""
        return text if self.pattern is None else self.pattern.sub(STARS, text)

    def message(self, text: str) -> str:
        """Return an error of a command without the values, with a hint at a variable that code did not see."""
        hint = self._hint((text,), states=False)
        return self.text(text if hint is None else f"{text}; {hint}")

    def outcome(self, outcome: Outcome, *, names: bool = False, states: bool = True) -> Outcome:
        """Return an outcome without the values, and with hints at variables that code asked for and did not see.

        `outcome`: the outcome as code of the repository may have written it; `names`: True if that code also chose the
        names in it; `states`: True if a scenario could state the variable with `environment:`.
        """
        hinted = tuple(self._hinted(failure, states=states) for failure in outcome.failures)
        judged = tuple(self._judged_with_hint(expected, states=states) for expected in outcome.expectations)
        pairs = zip((*hinted, *judged), (*outcome.failures, *outcome.expectations), strict=True)
        if any(new is not old for new, old in pairs):
            outcome = outcome.model_copy(update={"failures": hinted, "expectations": judged})
        if self.pattern is None:
            return outcome
        return outcome.model_copy(
            update={
                "name": self.text(outcome.name) if names else outcome.name,
                "expectations": tuple(self._expectation(expected, names=names) for expected in outcome.expectations),
                "failures": tuple(map(self._failure, outcome.failures)),
                "marks": tuple(replace(mark, words=self.text(mark.words)) for mark in outcome.marks),
                "notes": tuple(map(self.text, outcome.notes)),
                "model_notes": tuple(map(self.text, outcome.model_notes)),
                "warnings": tuple(
                    _changed(warning, message=self.text(warning.message)) for warning in outcome.warnings
                ),
                "diagnostics": tuple(
                    _changed(diagnostic, message=self.text(diagnostic.message)) for diagnostic in outcome.diagnostics
                ),
                "output": self.text(outcome.output),
            }
        )

    def replay(self, path: Path) -> None:
        """Remove the values from the names in a stored replay, such as link names. A bad file is left."""
        if self.pattern is None:
            return
        with suppress(OSError, EOFError, ValueError, RecursionError):
            with gzip.open(path) as file:
                data = json.loads(file.read(_MAX_REPLAY_BYTES))
            if (masked := self.values(data, _NAMES_IN_REPLAYS)) != data:
                with whole_file(path) as written:
                    written.write(gzip.compress(json.dumps(masked, separators=(",", ":")).encode(), mtime=0))

    def values(self, data: Any, keys: Collection[str] | None = None, key: str = "") -> Any:
        """Return JSON data without the values in its texts; `keys`: the keys that may hold them, None: all."""
        match data:
            case str():
                return self.text(data) if keys is None or key in keys else data
            case list():
                return [self.values(part, keys, key) for part in data]
            case dict():
                return {name: self.values(part, keys, name) for name, part in data.items()}
        return data

    def _expectation(self, expected: ExpectationOutcome, *, names: bool) -> ExpectationOutcome:
        name = self.text(expected.name) if names else expected.name
        return _changed(expected, name=name, verdict=expected.verdict.with_texts(self.text))

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

    def _hint(self, texts: Collection[str], *, states: bool) -> str | None:
        unset = next((name for text in texts if (name := unset_variable(text, self.names)) is not None), None)
        if unset is not None:
            return (
                f"--pass-env (input pass-env of the action) names the variable {unset}, but it is not set; "
                "set it before sim-action starts, on GitHub with 'env:' of the step"
            )
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
    lines = {value, value.strip(), *map(str.strip, value.splitlines())}
    forms = {form for line in lines for form in (line, *_escaped(line))}
    return {form for form in forms if len(form) >= MIN_CHARS}


def _escaped(text: str) -> tuple[str, ...]:
    return json.dumps(text)[1:-1], json.dumps(text, ensure_ascii=False)[1:-1], repr(text)[1:-1]
