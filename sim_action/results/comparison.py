"""Compare the results of two runs of the same scenarios: new failures, weaker checks, smaller margins, slower runs.

Two scenarios are the same if their files and names are equal. If a file was moved, an unambiguous name is enough.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import Final, Literal

from sim_action.core.errors import ExitCode
from sim_action.core.records import dataclass
from sim_action.results.outcome import ExpectationOutcome, Outcome
from sim_action.results.weaker_checks import Pair, WeakerCheck, has_same_limit, paired_expectations, weaker_checks

ChangeKind = Literal[
    "newly fails",
    "flaky",
    "removed",
    "not run",
    "not repeated",
    "fails differently",
    "fixed",
    "new",
    "still fails",
    "still passes",
]
"""The change of one scenario between the old and the new run.

- newly fails: it fails or is not exercised now; before, it passed, was skipped or did not exist.
- flaky: its repeated runs differ now.
- removed: it exists in the old run only.
- not run: it is skipped now.
- not repeated: it was flaky, and passed now in a single run.
- fails differently: it failed before with another status.
- fixed: it passes now, and failed or was not exercised before.
- new: it passes and exists in the new run only.
"""

_FAILURES: Final[frozenset[ChangeKind]] = frozenset({"newly fails", "flaky"})
_WARNINGS: Final[frozenset[ChangeKind]] = frozenset({"removed", "not run", "not repeated"})

# As a fraction of the limit: a smaller loss of margin is ignored.
_MIN_RELATIVE_LOSS: Final = 0.01
# Wall time: a smaller slowdown may be caused by a busy CPU and is ignored.
_MIN_SLOWDOWN_S: Final = 0.1


@dataclass(frozen=True, slots=True)
class Thresholds:
    """The thresholds for warnings.

    Attributes:
        margin: warn if the new margin is less than this fraction of the old one.
        speed: warn if the new real-time factor is less than this fraction of the old one.
    """

    margin: float = 0.5
    speed: float = 0.5


@dataclass(frozen=True, slots=True)
class SmallerMargin:
    """A smaller margin of an expectation that still holds.

    Attributes:
        old, new: the margins in `unit`.
        old_share, new_share: the margins as fractions of the limit; None for a limit of zero.
    """

    expectation: str
    unit: str
    old: float
    new: float
    old_share: float | None
    new_share: float | None


@dataclass(frozen=True, slots=True)
class Slower:
    """A slower run: the real-time factors of the simulation loop."""

    old: float
    new: float


@dataclass(frozen=True, slots=True)
class Change:
    """The comparison of one scenario.

    Attributes:
        old, new: the outcomes; one of them is None if only one run has the scenario.
        missed: expectations that held before and do not hold now, unless the scenario newly fails because of them.
        weaker: expectations that were removed, that only warn now, or whose limit allows more.
        renamed: the old and new names of expectations with another name; their limits do not allow more.
        moves_differently: True if the digests differ with the same seed on the same engine build.
        processors: the CPU models of both runs if they differ; the speeds cannot be compared then.
    """

    kind: ChangeKind
    old: Outcome | None
    new: Outcome | None
    missed: tuple[ExpectationOutcome, ...] = ()
    smaller_margins: tuple[SmallerMargin, ...] = ()
    slower: Slower | None = None
    weaker: tuple[WeakerCheck, ...] = ()
    renamed: tuple[tuple[str, str], ...] = ()
    moves_differently: bool = False
    processors: tuple[str, str] | None = None

    @property
    def outcome(self) -> Outcome:
        """The new outcome, or the old one if the scenario was removed."""
        found = self.new or self.old
        assert found is not None
        return found

    @property
    def failed(self) -> bool:
        """Return True if the scenario newly fails or is flaky."""
        return self.kind in _FAILURES

    @property
    def warnings(self) -> int:
        """The number of warnings; a new failure is not one of them."""
        slower = self.slower is not None and self.processors is None
        return (self.kind in _WARNINGS) + sum(map(len, (self.missed, self.weaker, self.smaller_margins))) + slower


@dataclass(frozen=True, slots=True)
class Comparison:
    """The comparison of two runs.

    Attributes:
        changes: first the scenarios of the new run in its order, then the removed ones.
        allow_removed: True if the new run may lack every scenario of the old run.
    """

    changes: tuple[Change, ...]
    allow_removed: bool = False

    @property
    def is_empty(self) -> bool:
        """Return True if the new run has no scenario of the old run, although it must have one: nothing is compared."""
        old = [change for change in self.changes if change.old is not None and change.old.file]
        return bool(old) and not self.allow_removed and all(change.kind == "removed" for change in old)

    @property
    def failures(self) -> int:
        """The number of scenarios that newly fail or are flaky."""
        return sum(change.failed for change in self.changes)

    @property
    def warnings(self) -> int:
        """The number of warnings of all scenarios."""
        return sum(change.warnings for change in self.changes)

    def count(self, kind: ChangeKind) -> int:
        """Return the number of scenarios with a change of this kind."""
        return sum(change.kind == kind for change in self.changes)

    def exit_code(self, *, strict: bool = False) -> ExitCode:
        """Return the exit code of the process; with `strict`, warnings make it fail, too."""
        bad = self.failures or self.is_empty or (strict and self.warnings)
        return ExitCode.FAILED if bad else ExitCode.PASSED


def compare_outcomes(
    old: Iterable[Outcome],
    new: Iterable[Outcome],
    thresholds: Thresholds | None = None,
    *,
    allow_removed: bool = False,
) -> Comparison:
    """Compare the outcomes of a new run with those of an old one."""
    thresholds = thresholds or Thresholds()
    pairs = _paired(list(old), list(new))
    return Comparison(tuple(_change(before, now, thresholds) for before, now in pairs), allow_removed)


def _paired(old: Sequence[Outcome], new: Sequence[Outcome]) -> Iterator[tuple[Outcome | None, Outcome | None]]:
    """Pair the outcomes of both runs; duplicates of one file and name are paired in their order."""
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
    """Return name -> place for the names that occur exactly once."""
    counts = Counter(names.values())
    return {name: place for place, name in names.items() if counts[name] == 1}


def _change(old: Outcome | None, new: Outcome | None, thresholds: Thresholds) -> Change:
    kind = _change_kind(old, new)
    if old is None or new is None:
        return Change(kind, old, new)
    pairs = paired_expectations(old, new)
    weaker = tuple(weaker_checks(old, new, pairs))
    looser = {id(each.new) for each in weaker if each.kind == "limit"}
    return Change(
        kind,
        old,
        new,
        missed=() if kind in _FAILURES else tuple(_missed(pairs)),
        smaller_margins=tuple(smaller for pair in pairs if (smaller := _smaller_margin(*pair, thresholds.margin))),
        slower=_slower(old, new, thresholds.speed),
        weaker=weaker,
        renamed=tuple((one.name, now.name) for one, now in pairs if one.name != now.name and id(now) not in looser),
        moves_differently=_moves_differently(old, new),
        processors=_processors(old, new),
    )


def _change_kind(old: Outcome | None, new: Outcome | None) -> ChangeKind:
    if new is None:
        return "removed"
    if new.status == "skipped":
        return "not run"
    if new.status == "flaky":
        return "flaky"
    if new.status == "passed":
        return _kind_of_pass(old, new)
    if old is None or not _is_bad(old):
        return "newly fails"
    return "still fails" if old.status == new.status else "fails differently"


def _kind_of_pass(old: Outcome | None, new: Outcome) -> ChangeKind:
    if old is None:
        return "new"
    if old.status == "flaky" and new.repeats is None:
        return "not repeated"
    return "fixed" if _is_bad(old) else "still passes"


def _is_bad(outcome: Outcome) -> bool:
    return outcome.status not in ("passed", "skipped")


def _missed(pairs: Iterable[Pair]) -> Iterator[ExpectationOutcome]:
    for old, new in pairs:
        if old.status == "passed" and new.status != "passed" and not new.verdict.cut_off:
            yield new


def _smaller_margin(old: ExpectationOutcome, new: ExpectationOutcome, threshold: float) -> SmallerMargin | None:
    before, now = old.verdict, new.verdict
    if not (old.status == new.status == "passed") or now.goal or before.unit != now.unit:
        return None
    # The margin to a new limit is another quantity, unless the user keeps the name.
    if old.name != new.name and not has_same_limit(before, now):
        return None
    if before.margin is None or now.margin is None or now.margin >= threshold * before.margin:
        return None
    if before.margin - now.margin < _MIN_RELATIVE_LOSS * _scale(old, new):
        return None
    return SmallerMargin(new.name, now.unit, before.margin, now.margin, _share(old), _share(new))


def _scale(old: ExpectationOutcome, new: ExpectationOutcome) -> float:
    """Return the limit, or the measured value for a limit of zero, as the scale of a loss of margin."""
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


def _moves_differently(old: Outcome, new: Outcome) -> bool:
    made_alike = _made_with(old) == _made_with(new)
    return made_alike and None not in (old.digest, new.digest) and old.digest != new.digest


def _made_with(outcome: Outcome) -> tuple[int | None, str | None, str | None]:
    build = outcome.provenance.engine_build if outcome.provenance else None
    return outcome.seed, outcome.engine, build


def _processors(old: Outcome, new: Outcome) -> tuple[str, str] | None:
    if old.provenance is None or new.provenance is None or old.provenance.cpu == new.provenance.cpu:
        return None
    return old.provenance.cpu, new.provenance.cpu
