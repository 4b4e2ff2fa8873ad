"""Compare the results of two runs of the same scenarios: new failures, weaker checks, smaller margins, slower runs.

Two scenarios are the same if their files and names are equal. If a file was moved, an unambiguous name is enough. The
samples of a gate are compared together, see `paired_comparison`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import Final, Literal

from sim_action.core.errors import ExitCode
from sim_action.core.records import dataclass, replace
from sim_action.results.outcome import ExpectationOutcome, Outcome
from sim_action.results.paired_comparison import (
    GateComparison,
    RunPair,
    adjusted,
    compare_gate,
    is_same_quantity,
    is_smaller_margin,
    moves_differently,
)
from sim_action.results.weaker_checks import (
    ClaimChange,
    Pair,
    WeakerCheck,
    claim_changes,
    paired_expectations,
    stricter_limits,
    surroundings_changes,
    weaker_checks,
)
from sim_action.scenario.variations.gate import Gate, PlannedGate

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
_MIN_SLOWDOWN_S: Final = 0.1  # wall time: a smaller slowdown may be caused by a busy CPU and is ignored


@dataclass(frozen=True, slots=True)
class Thresholds:
    """The thresholds for warnings."""

    margin: float = 0.5  # warn if the new margin is less than this fraction of the old one
    speed: float = 0.5  # warn if the new real-time factor is less than this fraction of the old one


@dataclass(frozen=True, slots=True)
class SmallerMargin:
    """A smaller margin of an expectation that still holds."""

    expectation: str
    unit: str
    old: float  # old, new: the margins in `unit`
    new: float
    old_share: float | None  # old_share, new_share: the margins as fractions of the limit; None for a limit of zero
    new_share: float | None


@dataclass(frozen=True, slots=True)
class Slower:
    """A slower run: the real-time factors of the simulation loop."""

    old: float
    new: float


@dataclass(frozen=True, slots=True)
class Change:
    """The comparison of one scenario."""

    kind: ChangeKind
    old: Outcome | None  # old, new: the outcomes; one of them is None if only one run has the scenario
    new: Outcome | None
    # expectations that held before and do not hold now, unless the scenario newly fails because of them
    missed: tuple[ExpectationOutcome, ...] = ()
    smaller_margins: tuple[SmallerMargin, ...] = ()
    slower: Slower | None = None
    # expectations that were removed, that only warn now, or whose limit allows more
    weaker: tuple[WeakerCheck, ...] = ()
    stricter: tuple[Pair, ...] = ()  # expectations whose limit allows less
    # the claims of a gate that demand less or more than before, and other surroundings of the expectations
    claims: tuple[ClaimChange, ...] = ()
    # the old and new names of expectations with another name and no other limit
    renamed: tuple[tuple[str, str], ...] = ()
    moves_differently: bool = False  # True if the digests differ with the same seed on the same engine build
    # the CPU models of both runs if they differ; the speeds cannot be compared then
    processors: tuple[str, str] | None = None
    gate: GateComparison | None = None  # the comparison of the runs of a gate, if this is one

    @property
    def outcome(self) -> Outcome:
        """The new outcome, or the old one if the scenario was removed."""
        outcome = self.new or self.old
        assert outcome is not None
        return outcome

    @property
    def failed(self) -> bool:
        """Return True if the scenario newly fails or is flaky, or if the pass rate of the gate fell."""
        return self.kind in _FAILURES or (self.gate is not None and self.gate.failed)

    @property
    def warnings(self) -> int:
        """The number of warnings; a new failure is not one of them."""
        slower = self.slower is not None and self.processors is None
        of_runs = 0 if self.gate is None else self.gate.warnings
        of_expectations = sum(map(len, (self.missed, self.weaker, self.smaller_margins)))
        of_claims = sum(claim.is_weaker for claim in self.claims)
        return (self.kind in _WARNINGS) + of_expectations + slower + of_runs + of_claims


@dataclass(frozen=True, slots=True)
class Comparison:
    """The comparison of two runs."""

    # first the scenarios and gates of the new run in its order, then the removed ones; no samples of gates
    changes: tuple[Change, ...]
    allow_removed: bool = False  # True if the new run may lack every scenario of the old run

    @property
    def is_empty(self) -> bool:
        """Return True if the new run has no scenario of the old run, although it must have one: nothing is compared."""
        old = [change for change in self.changes if change.old is not None and change.old.file]
        return bool(old) and not self.allow_removed and all(change.kind == "removed" for change in old)

    @property
    def failures(self) -> int:
        """The number of scenarios that newly fail or are flaky, and of gates whose pass rate fell."""
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
        return ExitCode.of_command(has_failed=bool(self.failures or self.is_empty or (strict and self.warnings)))


def compare_outcomes(
    old: Iterable[Outcome],
    new: Iterable[Outcome],
    thresholds: Thresholds | None = None,
    *,
    allow_removed: bool = False,
    gates: tuple[Iterable[PlannedGate], Iterable[PlannedGate]] = ((), ()),
) -> Comparison:
    """Compare the outcomes of a new run with an old run; `gates`: the stated gates of both, see `claims`."""
    thresholds = thresholds or Thresholds()
    alone, samples = _parted(list(old), list(new))
    changes = [_change(before, now, samples.get(_gate_key(now), ()), thresholds) for before, now in alone]
    stated, states = (dict(_by_key(planned_gates)) for planned_gates in gates)
    judged = adjusted([change.gate for change in changes])
    compared = (
        replace(
            change,
            gate=gate,
            claims=(*change.claims, *_claims(stated.get(_gate_key(change.old)), states.get(_gate_key(change.new)))),
        )
        for change, gate in zip(changes, judged, strict=True)
    )
    return Comparison(tuple(compared), allow_removed)


def _claims(old: Gate | None, new: Gate | None) -> tuple[ClaimChange, ...]:
    return () if old is None or new is None else claim_changes(old, new)


def _by_key(gates: Iterable[PlannedGate]) -> Iterator[tuple[_GateKey | None, Gate]]:
    return (((gate.file, gate.name), gate.gate) for gate in gates)


_GateKey = tuple[str, str]  # the file and the name of a gate


def _gate_key(outcome: Outcome | None) -> _GateKey | None:
    return None if outcome is None or outcome.gate is None else (outcome.file, outcome.gate)


def _parted(
    old: Sequence[Outcome], new: Sequence[Outcome]
) -> tuple[list[RunPair], dict[_GateKey | None, list[RunPair]]]:
    """Return the pairs that are compared one by one, and the samples of each gate of the new run.

    Samples whose gate has no outcome are compared one by one: the results have only a part of its runs.
    """
    gates_before, gates_now = (
        {_gate_key(outcome) for outcome in several if outcome.statistics} for several in (old, new)
    )
    pairs = list(paired_outcomes(old, new))
    same = {_gate_key(before): _gate_key(now) for before, now in pairs if before and before.statistics and now}
    alone: list[RunPair] = []
    samples: dict[_GateKey | None, list[RunPair]] = {key: [] for key in gates_now}
    for before, now in pairs:
        if now is not None and now.is_sample and (key := _gate_key(now)) in samples:
            samples[key].append((before, now))
        elif now is None and before is not None and before.is_sample and (key := _gate_key(before)) in gates_before:
            samples.get(same.get(key), []).append((before, now))
        else:
            alone.append((before, now))
    return alone, samples


def paired_outcomes(old: Sequence[Outcome], new: Sequence[Outcome]) -> Iterator[tuple[Outcome | None, Outcome | None]]:
    """Pair the outcomes of both runs; duplicates of one file and name are paired in their order."""
    places = {key: place for place, key in enumerate(_keys(old))}
    old_places = [places.pop(key, None) for key in _keys(new)]
    moved = _only({place: old[place].name for place in places.values()})
    unpaired = _only({place: outcome.name for place, outcome in enumerate(new) if old_places[place] is None})
    for name in moved.keys() & unpaired.keys():
        old_places[unpaired[name]] = moved[name]
    for outcome, place in zip(new, old_places, strict=True):
        yield (None if place is None else old[place]), outcome
    for place in sorted(set(range(len(old))).difference(place for place in old_places if place is not None)):
        yield old[place], None


def _keys(outcomes: Iterable[Outcome]) -> Iterator[tuple[str, str, int]]:
    seen = Counter[tuple[str, str]]()
    for outcome in outcomes:
        key = outcome.file, outcome.name
        yield (*key, seen[key])
        seen[key] += 1


def _only(names: dict[int, str]) -> dict[str, int]:
    counts = Counter(names.values())
    return {name: place for place, name in names.items() if counts[name] == 1}


def _change(old: Outcome | None, new: Outcome | None, samples: Sequence[RunPair], thresholds: Thresholds) -> Change:
    kind = _change_kind(old, new)
    is_gate = new is not None and new.statistics is not None
    is_comparable = is_gate and any(before is not None for before, _ in samples)
    gate = compare_gate(old, new, samples, thresholds.margin) if is_comparable and new is not None else None
    if old is None or new is None:
        return Change(kind, old, new, gate=gate, weaker=gate.weaker if gate else ())
    pairs = paired_expectations(old, new)
    # Of a gate, the stated claims are compared instead.
    weaker = () if is_gate or old.statistics else tuple(weaker_checks(old, new, pairs))
    stricter = () if is_gate else tuple(stricter_limits(old, new, pairs))
    moved = {id(check.new) for check in weaker if check.kind == "limit"} | {id(now) for _, now in stricter}
    # The margin of a gate belongs to a bound, which follows from the number of runs: its runs are compared instead.
    margins = () if is_gate else (_smaller_margin(*pair, thresholds.margin) for pair in pairs)
    return Change(
        kind,
        old,
        new,
        missed=() if kind in _FAILURES else tuple(_missed(pairs)),
        smaller_margins=tuple(smaller for smaller in margins if smaller),
        slower=_slower(old, new, thresholds.speed),
        weaker=weaker + (gate.weaker if gate else ()),
        stricter=stricter,
        claims=tuple(surroundings_changes(old, new)),
        renamed=tuple((one.name, now.name) for one, now in pairs if one.name != now.name and id(now) not in moved),
        moves_differently=bool(gate.moved) if gate else moves_differently(old, new),
        processors=_processors(old, new),
        gate=gate,
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
    if not (old.status == new.status == "passed" and is_same_quantity(old, new)):
        return None
    before, now = old.verdict.margin or 0.0, new.verdict.margin or 0.0
    if not is_smaller_margin(before, now, [(old, new)], threshold):
        return None
    return SmallerMargin(new.name, new.verdict.unit, before, now, _share(old), _share(new))


def _share(expected: ExpectationOutcome) -> float | None:
    margin, limit = expected.verdict.margin, expected.verdict.limit
    return None if margin is None or not limit else margin / abs(limit)


def _slower(old: Outcome, new: Outcome, threshold: float) -> Slower | None:
    before, now = old.real_time_factor, new.real_time_factor
    if not before or not now or now >= threshold * before:
        return None
    took, takes = (old.sim_time or 0.0) / before, (new.sim_time or 0.0) / now
    return Slower(before, now) if takes - took >= _MIN_SLOWDOWN_S else None


def _processors(old: Outcome, new: Outcome) -> tuple[str, str] | None:
    if old.provenance is None or new.provenance is None or old.provenance.cpu == new.provenance.cpu:
        return None
    return old.provenance.cpu, new.provenance.cpu
