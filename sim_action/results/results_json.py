"""The file `results.json`: the results of one call of sim-action, written, found and read.

A file that is read may come from anywhere, so its content is validated. Files of former versions are upgraded.
"""

from __future__ import annotations

import heapq
import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Final, Literal, NoReturn, Self, TypeVar

from pydantic import AwareDatetime, Field, ValidationError, model_validator
from pydantic_core import PydanticSerializationError

from sim_action.core.errors import ExitCode, UsageError
from sim_action.core.field_types import FrozenModel
from sim_action.core.files import read_at_most, whole_file
from sim_action.core.records import dataclass
from sim_action.core.wording import escaped_line
from sim_action.core.workspace import paths_of, unique
from sim_action.results.outcome import WORST_FIRST, NotNegative, Outcome, Status
from sim_action.scenario.selection import ranges_text
from sim_action.scenario.variations.gate import PlannedGate

MAX_SHARDS: Final = 256  # the largest number of jobs that GitHub creates from one matrix
T = TypeVar("T")
Commit = Annotated[str, Field(pattern=r"^[0-9a-f]{7,64}$")]
_Number = Annotated[int, Field(ge=1, le=MAX_SHARDS)]


class Shard(FrozenModel):
    """One part of a list of scenarios: every `count`-th scenario, beginning with number `index`.

    Attributes:
        index: the number of this part, counted from 1.
        count: the number of parts.
        total: the number of scenarios in all parts together; each variation is one.
    """

    index: _Number
    count: _Number
    total: Annotated[int, Field(ge=0)]

    @classmethod
    def parse(cls, text: str, total: int) -> Self:
        """Parse "I/N" for a list of `total` scenarios. Raises UsageError."""
        match = re.fullmatch(r"\s*([0-9]{1,3})\s*/\s*([0-9]{1,3})\s*", text)
        index, count = map(int, match.groups()) if match else (0, 0)
        if not 1 <= index <= count <= MAX_SHARDS:
            allowed = f"I/N with 1 <= I <= N <= {MAX_SHARDS}, such as 1/3"
            raise UsageError(escaped_line(f"--shard {text}: must be {allowed}"))
        return cls(index=index, count=count, total=total)

    @model_validator(mode="after")
    def _is_one_of_all(self) -> Self:
        if self.index > self.count:
            raise ValueError(f"there is no shard {self.index} of {self.count}")
        return self

    def __str__(self) -> str:
        return f"shard {self.index} of {self.count}"

    def dealt(self, scenarios: Sequence[T]) -> list[T]:
        """Return the elements of a list that belong to this part, in the order of the list."""
        return list(scenarios[self.index - 1 :: self.count])


def shards_text(indices: Iterable[int], count: int) -> str:
    """Return the name of some shards, such as "shard 2 of 3" or "shards 1-3, 5 of 9"."""
    ordered = sorted(indices)
    return f"{'shard' if len(ordered) == 1 else 'shards'} {ranges_text(ordered, ', ')} of {count}"


def balanced(scenarios: Sequence[T], durations: Sequence[float], count: int) -> list[list[T]]:
    """Divide a list into at most `count` parts of similar duration; no part is empty, each keeps the list's order.

    Elements are assigned in descending order of duration, each to the part with the smallest load so far. The
    longest part then takes at most 4/3 of the optimum (R. L. Graham, Bounds on Multiprocessing Timing Anomalies,
    1969). `durations` are in s and greater than zero.
    """
    loads = [(0.0, 0, part) for part in range(min(count, len(scenarios)))]
    parts: list[list[int]] = [[] for _ in loads]
    for place in sorted(range(len(scenarios)), key=lambda place: (-durations[place], place)):
        load, size, part = heapq.heappop(loads)
        parts[part].append(place)
        heapq.heappush(loads, (load + durations[place], size + 1, part))
    return [[scenarios[place] for place in sorted(part)] for part in parts]


RESULTS_FILE = "results.json"
MARGINS_FILE: Final = "margins.json"

MAX_OUTCOMES: Final = 50_000
"""The largest number of outcomes that are merged or compared: they take half a minute and almost 1 GB of memory."""

_MAX_BYTES: Final = 64_000_000
_MAX_TEXT: Final = 200_000  # the most characters of a text, more than any run writes: shards may come from anyone
_FIRST_VERSION: Final = 1
_VERSION: Final = 5
_FORMER_ENDS: Final = {
    "broken": "expectation failed",
    "nobody left": "controllers finished",
    "test over": "test finished",
    "nodes gone": "nodes finished",
}
"""The values of `end` in version 1 -> those since version 2."""


class Results(FrozenModel):
    """The results of one call of `sim-action`; `results.json` is this object as JSON.

    Attributes:
        version: the version of the format. Version 5 added gates and the status "inconclusive".
            Version 4 added `measurements`, which were expectations without a limit
            before. Version 3 added the status "not_exercised" and `judged` of a verdict.
            Version 1 also named some values of `end` and the key `selected` differently.
        sim_action: the version of sim-action; after `merge`, every version that the shards used.
        started_at: the start time of the call; after `merge`, the start time of the first shard; null in older results.
        commit: the commit that a CI service names; null elsewhere, and in older results.
        wall_time: the wall time in s of the call; after `merge`, the wall time of the slowest shard.
        shard: the part of the list of scenarios that these results cover; null if they cover the whole list.
        selected: true if the call selected scenarios inside files by number; no scenario may be left then.
        gates: the gates of these results; a part of the list has runs of a gate, and `merge` judges it.
        merged: true if `sim-action merge` wrote this file.
    """

    version: Literal[5] = 5
    sim_action: str
    python: str
    platform: str
    started_at: AwareDatetime | None = None
    commit: Commit | None = None
    wall_time: NotNegative
    shard: Shard | None = None
    selected: bool = False
    merged: bool = False
    gates: tuple[PlannedGate, ...] = ()
    outcomes: tuple[Outcome, ...]

    @property
    def runs(self) -> tuple[Outcome, ...]:
        """The outcomes of scenarios and samples, without gates, which follow from them."""
        return tuple(outcome for outcome in self.outcomes if outcome.statistics is None)

    @property
    def verdicts(self) -> tuple[Outcome, ...]:
        """The outcomes that count: scenarios and gates, without the runs that a gate judges."""
        return tuple(outcome for outcome in self.outcomes if not outcome.is_sample)

    @property
    def total(self) -> int:
        """The number of scenarios and gates."""
        return len(self.verdicts)

    def count(self, status: Status) -> int:
        """Return the number of scenarios and gates with a status."""
        return sum(outcome.status == status for outcome in self.verdicts)

    @property
    def exit_code(self) -> ExitCode:
        """The exit code of the call. A shard without scenarios passes if the list of all shards has some."""
        has_scenarios = self.selected or bool(self.shard and self.shard.total)
        return ExitCode.of_command((outcome.exit_code for outcome in self.outcomes), has_scenarios=has_scenarios)

    @property
    def conclusion(self) -> Literal["success", "failure", "cancelled"]:
        """The conclusion of the call, with GitHub's name for the conclusion of a job."""
        if self.exit_code is ExitCode.INTERRUPTED:
            return "cancelled"
        return "success" if self.exit_code is ExitCode.PASSED else "failure"

    @property
    def travelled(self) -> float | None:
        """The distance in m that the robot travelled, if there is exactly one scenario."""
        return self.verdicts[0].travelled if self.total == 1 else None

    @property
    def real_time_factor(self) -> float | None:
        """The sim time of all runs divided by the wall time of the call; None if not all are known, or nothing ran."""
        if any(outcome.call[1:2] == ("margins",) for outcome in self.outcomes):
            return None  # only the nominal run of a search is an outcome
        sim_time = sum(outcome.simulated for outcome in self.outcomes if outcome.statistics is None)
        return sim_time / self.wall_time if sim_time and self.wall_time > 0 else None

    def worst_first(self) -> list[Outcome]:
        """Return the outcomes that count, the worst status first, otherwise in call order."""
        return sorted(self.verdicts, key=lambda outcome: WORST_FIRST.index(outcome.display_status))

    def write(self, folder: Path) -> Path:
        """Write `results.json` into an existing folder and return its path."""
        path = folder / RESULTS_FILE
        with whole_file(path) as file:
            file.writelines(self.parts())
        return path

    def parts(self) -> Iterator[bytes]:
        """Yield the file in parts, as `model_dump_json(indent=2)` would write it."""
        head = _json(self.model_copy(update={"outcomes": ()}))
        beginning = head.removesuffix("[]\n}")
        if not self.outcomes or beginning == head:
            yield f"{_json(self)}\n".encode(errors="replace")
            return
        yield f"{beginning}[".encode(errors="replace")
        for number, outcome in enumerate(self.outcomes):
            text = f"\n{_json(outcome)}".replace("\n", "\n    ")
            yield f"{',' if number else ''}{text}".encode(errors="replace")
        yield b"\n  ]\n}\n"

    @classmethod
    def read(cls, path: Path) -> Results:
        """Read a `results.json` of this or a former format version. Raises UsageError if the file is not valid."""
        try:
            if (data := read_at_most(path, _MAX_BYTES)) is not None:
                results = cls._parsed(data)
                if (place := _place_of_long_text(data)) is None:
                    return results
                reason = f"{place}: the text has more than {_MAX_TEXT} characters"
            else:
                reason = f"it is larger than {_MAX_BYTES / 1e6:g} MB"
        except OSError as error:
            reason = error.strerror or str(error)
        except ValidationError as error:
            reason = _first_problem(error)
        raise UsageError(escaped_line(f"{path} is not a valid results file: {reason}"))

    @classmethod
    def _parsed(cls, data: bytes) -> Results:
        try:
            return cls.model_validate_json(data)
        except ValidationError:
            if (upgraded := _upgraded(data)) is None:
                raise
            return cls.model_validate_json(upgraded)


def _place_of_long_text(data: bytes) -> str | None:
    """Return the path of a text longer than any run writes, in valid JSON; None if there is none."""
    # Whole texts are compared only if there is so much between two quotes.
    unescaped = data.replace(rb"\\", b"x").replace(rb"\"", b"x")
    if max(map(len, unescaped.split(b'"'))) <= _MAX_TEXT:
        return None
    values: list[tuple[str, Any]] = [("", json.loads(data))]
    while values:
        path, value = values.pop()
        if isinstance(value, str) and len(value) > _MAX_TEXT:
            return path
        if isinstance(value, list | dict):
            below = value.items() if isinstance(value, dict) else enumerate(value)
            for key, part in below:
                inner = f"{path}.{key}" if path else f"{key}"
                values += [(inner, part), (path, key)]
    return None


def write_json(model: FrozenModel, path: Path) -> None:
    """Write a model as JSON into a file, as a whole. Raise OSError."""
    with whole_file(path) as file:
        file.write(f"{_json(model)}\n".encode(errors="replace"))


def _json(model: FrozenModel) -> str:
    try:
        return model.model_dump_json(indent=2)
    except PydanticSerializationError:
        # A text of user code contains half of a surrogate pair, which UTF-8 and JSON do not have.
        return json.dumps(model.model_dump(mode="json"), indent=2, ensure_ascii=False)


def _upgraded(data: bytes) -> str | None:
    """Return the text of a file of a former version as this one; None if it is not of a former version."""
    try:
        document: Any = json.loads(data)
    except (ValueError, RecursionError):
        return None
    if not isinstance(document, dict) or document.get("version") not in range(_FIRST_VERSION, _VERSION):
        return None
    document["version"] = _VERSION
    if "some" in document:
        document["selected"] = document.pop("some")
    outcomes = document.get("outcomes")
    for outcome in outcomes if isinstance(outcomes, list) else []:
        if isinstance(outcome, dict):
            if isinstance(end := outcome.get("end"), str):
                outcome["end"] = _FORMER_ENDS.get(end, end)
            _set_measurements_apart(outcome)
    return json.dumps(document)


def _set_measurements_apart(outcome: dict[str, Any]) -> None:
    """Move the differences of two engines without a limit from the expectations of a former version."""
    expectations = outcome.get("expectations")
    if not isinstance(expectations, list):
        return
    measurements = [expectation for expectation in expectations if _is_measurement(expectation)]
    if measurements:
        outcome["expectations"] = [expectation for expectation in expectations if not _is_measurement(expectation)]
        outcome["measurements"] = [
            {"name": measurement.get("name"), **{key: measurement["verdict"].get(key) for key in _MEASURED}}
            for measurement in measurements
        ]


_MEASURED: Final = ("measured", "unit", "time", "message")


def _is_measurement(expectation: Any) -> bool:
    """Return True for a difference of two engines without a limit, in a former version of the format."""
    if not isinstance(expectation, dict) or expectation.get("assertion") != "agreement":
        return False
    verdict = expectation.get("verdict")
    return isinstance(verdict, dict) and verdict.get("limit") is None and verdict.get("measured") is not None


def _first_problem(error: ValidationError) -> str:
    """Return the place and message of the first error; invalid keys are not repeated, since anyone may choose them."""
    details, more = error.errors(include_url=False)[0], error.error_count() - 1
    steps = [str(step) for step in details["loc"] if isinstance(step, int) or step.isidentifier()]
    if steps == ["version"] and type(version := details["input"]) is int:
        return f"its format version is {version}, and this sim-action reads {_FIRST_VERSION} to {_VERSION}"
    text = ": ".join(part for part in (".".join(steps), details["msg"]) if part)
    return f"{text} (and {more} more)" if more else text


@dataclass(frozen=True, slots=True)
class ResultsFile:
    """A results file and its content."""

    path: Path
    results: Results


def find_all(patterns: Iterable[str]) -> dict[str, list[Path]]:
    """Return the results files for each pattern: file, folder (recursively), or glob. Raises UsageError."""
    return {pattern: list(_matches(pattern)) for pattern in patterns}


def read_all(
    paths: Mapping[str, Iterable[Path]], most: int = MAX_OUTCOMES, lost: dict[Path, str] | None = None
) -> list[ResultsFile]:
    """Read each file once. Raises UsageError if a file is not valid, or if there are too many outcomes in total.

    If `lost` is given, it receives the reasons of files that are not valid, unless none is valid.
    """
    files: list[ResultsFile] = []
    count = 0
    for path in unique(paths):
        try:
            results = Results.read(path)
            for outcome in results.outcomes:
                if is_inconsistent(outcome):
                    _reject(
                        f"{path} is not a valid results file: the status of '{outcome.file}' contradicts its failures "
                        "or expectations"
                    )
        except UsageError as error:
            if lost is None:
                raise
            lost[path] = str(error)
            continue
        count += len(results.outcomes)
        if count > most:
            _reject(f"{path}: this file brings the number of outcomes to {count}; at most {most} are allowed")
        files.append(ResultsFile(path, results))
    if lost and not files:
        raise UsageError(next(iter(lost.values())))
    return files


def _matches(pattern: str) -> Iterator[Path]:
    for path in paths_of(pattern):
        if os.path.isdir(path):  # noqa: PTH112 - a name that is too long is no folder
            yield from _below(path)
        elif os.path.lexists(path) and (path == Path(pattern) or path.suffix == ".json"):
            # The results next to margins have them, too.
            yield path.with_name(RESULTS_FILE) if path.name == MARGINS_FILE else path


def _below(folder: Path) -> Iterator[Path]:
    for parent, folders, files in os.walk(folder, onerror=_raise_unreadable):
        folders.sort()
        path = Path(parent, RESULTS_FILE)
        if RESULTS_FILE in files:
            if path.is_symlink():
                _reject(f"{path} is a link, and links inside folders are not followed; name the file itself")
            yield path


def _raise_unreadable(error: OSError) -> NoReturn:
    _reject(f"cannot read the folder {error.filename}: {error.strerror}")


def is_inconsistent(outcome: Outcome) -> bool:
    """Return True for an error without a reason, a pass without expectations or with a failed one, and the like."""
    if outcome.status in ("error", "flaky"):
        return not outcome.failures
    if outcome.status == "skipped":
        return bool(outcome.failures or outcome.expectations)
    return bool(outcome.failures) or not outcome.expectations or outcome.status != outcome.judged_status()


def _reject(message: str) -> NoReturn:
    raise UsageError(escaped_line(message))
