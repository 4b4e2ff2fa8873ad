"""What has changed between two runs of the same scenarios, as data.

Scenarios are the same if their files and names are, or, of a file that was moved, if the name is the only one left.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final, Literal

from sim_action.core.errors import ExitCode
from sim_action.results.outcome import ExpectationOutcome, Outcome

Turn = Literal[
    "newly fails",
    "flaky",
    "gone",
    "not run",
    "not repeated",
    "fails otherwise",
    "mended",
    "new",
    "still fails",
    "still passes",
]
"""newly fails: it passed, was not run, or was not there; not repeated: it was flaky, and passed in a single run; fails
otherwise: it failed, too, but with another status."""

_FAILURES: Final[frozenset[Turn]] = frozenset({"newly fails", "flaky"})
_WARNINGS: Final[frozenset[Turn]] = frozenset({"gone", "not run", "not repeated"})

# Of the limit: a margin that loses less is as good as before.
_MIN_RELATIVE_LOSS: Final = 0.01
# s of wall time: what takes no longer than that more may have waited for a core.
_MIN_SLOWDOWN_S: Final = 0.1


@dataclass(frozen=True, slots=True)
class Thresholds:
    """What is worth a warning.

    Attributes:
        margin: a margin that is less than so many times the one before.
        speed: a real-time factor that is, likewise.
    """

    margin: float = 0.5
    speed: float = 0.5


@dataclass(frozen=True, slots=True)
class Shrunk:
    """A margin that is smaller than before, of an expectation that holds still.

    Attributes:
        old, new: in `unit`.
        old_share, new_share: of its limit; None for a limit of zero.
    """

    expectation: str
    unit: str
    old: float
    new: float
    old_share: float | None
    new_share: float | None


@dataclass(frozen=True, slots=True)
class Slower:
    """Real-time factors of the simulation loop."""

    old: float
    new: float


@dataclass(frozen=True, slots=True)
class Change:
    """One scenario, before and now.

    Attributes:
        old, new: None where it was not among the scenarios; never both.
        missed: expectations that held, and do so no longer, and that is not why the scenario newly fails.
        behaves_otherwise: whether the robot moved in another way with the same seed, on the same engine.
        processors: of the machines, if they are not alike: how fast each was then tells nothing of the scenario.
    """

    turn: Turn
    old: Outcome | None
    new: Outcome | None
    missed: tuple[ExpectationOutcome, ...] = ()
    shrunk: tuple[Shrunk, ...] = ()
    slower: Slower | None = None
    behaves_otherwise: bool = False
    processors: tuple[str, str] | None = None

    @property
    def outcome(self) -> Outcome:
        """The newest that there is of it."""
        found = self.new or self.old
        assert found is not None
        return found

    @property
    def failed(self) -> bool:
        """Whether that is what nobody wants."""
        return self.turn in _FAILURES

    @property
    def warnings(self) -> int:
        """How many things should be looked at, though it did not newly fail."""
        slower = self.slower is not None and self.processors is None
        return (self.turn in _WARNINGS) + len(self.missed) + len(self.shrunk) + slower


@dataclass(frozen=True, slots=True)
class Comparison:
    """All scenarios, those of the new run first and in its order."""

    changes: tuple[Change, ...]

    @property
    def failures(self) -> int:
        """How many scenarios newly fail, or are flaky."""
        return sum(change.failed for change in self.changes)

    @property
    def warnings(self) -> int:
        """How many things should be looked at."""
        return sum(change.warnings for change in self.changes)

    def count(self, turn: Turn) -> int:
        """How many scenarios have taken it."""
        return sum(change.turn == turn for change in self.changes)

    def exit_code(self, *, strict: bool = False) -> ExitCode:
        """What the process says to its caller; `strict`: warnings count, too."""
        bad = self.failures or (strict and self.warnings)
        return ExitCode.FAILED if bad else ExitCode.PASSED


def compared(old: Iterable[Outcome], new: Iterable[Outcome], thresholds: Thresholds | None = None) -> Comparison:
    """Holds the outcomes of one run against those of an earlier one."""
    thresholds = thresholds or Thresholds()
    return Comparison(tuple(_change(before, now, thresholds) for before, now in _paired(list(old), list(new))))


def _paired(old: Sequence[Outcome], new: Sequence[Outcome]) -> Iterator[tuple[Outcome | None, Outcome | None]]:
    """Each scenario once; of several of one file and name, the first with the first."""
    places = {key: place for place, key in enumerate(_keys(old))}
    found = [places.pop(key, None) for key in _keys(new)]
    moved = _only({place: old[place].name for place in places.values()})
    wanted = _only({place: outcome.name for place, outcome in enumerate(new) if found[place] is None})
    for name in moved.keys() & wanted.keys():
        found[wanted[name]] = moved[name]
    for outcome, place in zip(new, found, strict=True):
        yield (None if place is None else old[place]), outcome
    for place in sorted(set(range(len(old))).difference(place for place in found if place is not None)):
        yield old[place], None


def _keys(outcomes: Iterable[Outcome]) -> Iterator[tuple[str, str, int]]:
    seen = Counter[tuple[str, str]]()
    for outcome in outcomes:
        key = outcome.file, outcome.name
        yield (*key, seen[key])
        seen[key] += 1


def _only(names: dict[int, str]) -> dict[str, int]:
    """The places of names that are there once."""
    counts = Counter(names.values())
    return {name: place for place, name in names.items() if counts[name] == 1}


def _change(old: Outcome | None, new: Outcome | None, thresholds: Thresholds) -> Change:
    turn = _turn(old, new)
    if old is None or new is None:
        return Change(turn, old, new)
    pairs = list(_expectations(old, new))
    return Change(
        turn,
        old,
        new,
        missed=() if turn in _FAILURES else tuple(_missed(pairs)),
        shrunk=tuple(shrunk for pair in pairs if (shrunk := _shrunk(*pair, thresholds.margin))),
        slower=_slower(old, new, thresholds.speed),
        behaves_otherwise=_behaves_otherwise(old, new),
        processors=_processors(old, new),
    )


def _turn(old: Outcome | None, new: Outcome | None) -> Turn:
    if new is None:
        return "gone"
    if new.status == "skipped":
        return "not run"
    if new.status == "flaky":
        return "flaky"
    if new.status == "passed":
        return _turn_to_good(old, new)
    if old is None or not _is_bad(old):
        return "newly fails"
    return "still fails" if old.status == new.status else "fails otherwise"


def _turn_to_good(old: Outcome | None, new: Outcome) -> Turn:
    if old is None:
        return "new"
    if old.status == "flaky" and new.repeats is None:
        return "not repeated"
    return "mended" if _is_bad(old) else "still passes"


def _is_bad(outcome: Outcome) -> bool:
    return outcome.status not in ("passed", "skipped")


def _expectations(old: Outcome, new: Outcome) -> Iterator[tuple[ExpectationOutcome, ExpectationOutcome]]:
    """Those that ask the same, by what reports call them; of several, the first with the first."""
    waiting: dict[tuple[str, str], list[ExpectationOutcome]] = {}
    for expected in old.expectations:
        waiting.setdefault((expected.assertion, expected.name), []).append(expected)
    for expected in new.expectations:
        if before := waiting.get((expected.assertion, expected.name)):
            yield before.pop(0), expected


def _missed(pairs: Iterable[tuple[ExpectationOutcome, ExpectationOutcome]]) -> Iterator[ExpectationOutcome]:
    for old, new in pairs:
        if old.verdict.passed and not new.verdict.passed and not new.verdict.cut_off:
            yield new


def _shrunk(old: ExpectationOutcome, new: ExpectationOutcome, threshold: float) -> Shrunk | None:
    before, now = old.verdict, new.verdict
    if not (before.passed and now.passed) or now.goal or before.unit != now.unit:
        return None
    if before.margin is None or now.margin is None or now.margin >= threshold * before.margin:
        return None
    if before.margin - now.margin < _MIN_RELATIVE_LOSS * _scale(old, new):
        return None
    return Shrunk(new.name, now.unit, before.margin, now.margin, _share(old), _share(new))


def _scale(old: ExpectationOutcome, new: ExpectationOutcome) -> float:
    """What a loss is small against: the limit, or where that is zero, what was measured."""
    if new.verdict.limit:
        return abs(new.verdict.limit)
    return max(abs(one.verdict.measured or 0.0) for one in (old, new))


def _share(expected: ExpectationOutcome) -> float | None:
    margin, limit = expected.verdict.margin, expected.verdict.limit
    return None if margin is None or not limit else margin / abs(limit)


def _slower(old: Outcome, new: Outcome, threshold: float) -> Slower | None:
    before, now = old.real_time_factor, new.real_time_factor
    if not before or not now or now >= threshold * before:
        return None
    took, takes = (old.sim_time or 0.0) / before, (new.sim_time or 0.0) / now
    return Slower(before, now) if takes - took >= _MIN_SLOWDOWN_S else None


def _behaves_otherwise(old: Outcome, new: Outcome) -> bool:
    made_alike = _made_with(old) == _made_with(new)
    return made_alike and None not in (old.digest, new.digest) and old.digest != new.digest


def _made_with(outcome: Outcome) -> tuple[int | None, str | None, str | None]:
    build = outcome.provenance.engine_build if outcome.provenance else None
    return outcome.seed, outcome.engine, build


def _processors(old: Outcome, new: Outcome) -> tuple[str, str] | None:
    if old.provenance is None or new.provenance is None or old.provenance.cpu == new.provenance.cpu:
        return None
    return old.provenance.cpu, new.provenance.cpu
