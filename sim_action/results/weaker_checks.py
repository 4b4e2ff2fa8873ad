"""Compare the expectations of one scenario in two runs: removed ones, softened ones, and limits that moved."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final, Literal

from pydantic import JsonValue

from sim_action.core.records import dataclass
from sim_action.core.units import with_si_unit
from sim_action.core.wording import counted
from sim_action.results.outcome import ExpectationOutcome, Outcome, Scope
from sim_action.scenario.variations.gate import GATE, Gate, Passes, Quantile, StopEarly, percents_apart
from sim_action.state.verdict import Verdict

WeakerKind = Literal["removed", "severity", "unexercised", "inconclusive", "window", "allow", "limit", "stated"]
"""The way in which a scenario checks less than before.

- removed: the new run does not have the expectation.
- severity: it was an error if the expectation failed, and is a warning now.
- unexercised: it was an error if the expectation was never judged, and is a warning now.
- inconclusive: it was an error if a repetition could change its verdict, and is a warning now.
- window: a goal has more time, or must hold for less; an invariant is checked for less time.
- allow: it allows more names.
- limit: the new limit allows more.
- stated: it states something else, and that is not known to be stricter.
"""

Pair = tuple[ExpectationOutcome, ExpectationOutcome]  # one expectation in the old and in the new run

# The limit that they report can differ although the file did not change: it is one of several, or itself measured.
_SEVERAL_LIMITS: Final = frozenset({"all_of", "any_of", "stay_within", "joint_within", "object"})
_MEASURED_LIMITS: Final = frozenset({"not", "stl", "matches", "follow_path", "assertion", "feet_on_ground"})
_SAME_LIMIT: Final = 1e-6  # results of different versions may round a converted limit differently


@dataclass(frozen=True, slots=True)
class WeakerCheck:
    """An expectation that checks less than before; `new` is None if it was removed."""

    kind: WeakerKind
    old: ExpectationOutcome
    new: ExpectationOutcome | None = None


def paired_expectations(old: Outcome, new: Outcome) -> list[Pair]:
    """Pair the expectations with equal assertion and name, in the order of the new run; duplicates in their order.

    Of the others, two of one assertion are a pair if each run has exactly one of them: its name has changed, as the
    default name does with the limit. Claims of a gate with other names are other claims.
    """
    before: dict[tuple[str, str], list[ExpectationOutcome]] = {}
    for expected in old.expectations:
        before.setdefault((expected.assertion, expected.name), []).append(expected)
    partners: list[ExpectationOutcome | None] = []
    for expected in new.expectations:
        same = before.get((expected.assertion, expected.name))
        partners.append(same.pop(0) if same else None)
    left = _only_ones(expected for same in before.values() for expected in same)
    added = _only_ones(expected for expected, one in zip(new.expectations, partners, strict=True) if one is None)
    paired = ((one or _renamed(now, added, left), now) for one, now in zip(partners, new.expectations, strict=True))
    return [(one, now) for one, now in paired if one is not None]


def weaker_checks(old: Outcome, new: Outcome, pairs: Sequence[Pair]) -> Iterator[WeakerCheck]:
    """Yield expectations that check less in the new run, if it has verdicts; `pairs`: expectations of both runs."""
    if not new.has_verdict:
        return
    kept = {id(one) for one, _ in pairs}
    yield from (WeakerCheck("removed", one) for one in old.expectations if id(one) not in kept)
    for one, now in pairs:
        if (one.severity, now.severity) == ("error", "warning"):
            yield WeakerCheck("severity", one, now)
        if (one.unexercised, now.unexercised) == ("error", "warn"):
            yield WeakerCheck("unexercised", one, now)
        if (one.inconclusive, now.inconclusive) == ("error", "warn"):
            yield WeakerCheck("inconclusive", one, now)
        if loosened_times(one, now):
            yield WeakerCheck("window", one, now)
        if newly_allowed(one, now):
            yield WeakerCheck("allow", one, now)
        if _is_stated(old, new, one, now) and _allows_more(one.verdict, now.verdict):
            yield WeakerCheck("limit", one, now)
        elif loosened_statements(one, now):
            yield WeakerCheck("stated", one, now)


def stricter_limits(old: Outcome, new: Outcome, pairs: Iterable[Pair]) -> Iterator[Pair]:
    """Yield the expectations whose limit allows less in the new run."""
    if not new.has_verdict:
        return
    # Of several with one name, it is not known which is which.
    counts = Counter(
        (id(run), expected.assertion, expected.name) for run in (old, new) for expected in run.expectations
    )
    for one, now in pairs:
        several = counts[id(old), one.assertion, one.name] > 1 or counts[id(new), now.assertion, now.name] > 1
        if not several and _is_stated(old, new, one, now) and _allows_more(now.verdict, one.verdict):
            yield one, now


def _is_stated(old: Outcome, new: Outcome, one: ExpectationOutcome, now: ExpectationOutcome) -> bool:
    """Return True if the limit of an expectation is other than before only if the scenario states another one."""
    alike = old.digest is not None and old.digest == new.digest
    if now.assertion in _SEVERAL_LIMITS:
        # The same quantity of the same motion.
        was, measured = one.verdict.measured, now.verdict.measured
        return alike and was is not None and measured is not None and math.isclose(was, measured, rel_tol=_SAME_LIMIT)
    return alike or one.name != now.name or now.assertion not in _MEASURED_LIMITS


def loosened_times(old: ExpectationOutcome, new: ExpectationOutcome) -> dict[str, tuple[float | None, float | None]]:
    """Return the keys `after`, `before` and `for` that demand less now: key -> the old and the new time in s."""
    was, now, is_goal = old.scope, new.scope, new.verdict.goal
    if was is None or now is None or is_goal != old.verdict.goal:
        return {}
    # Older results have no end, and none is known of an invariant that lasts until the goals are met.
    is_known = was.end is not None and now.end is not None
    ends = [_end(scope, is_known=is_known) for scope in (was, now)]
    later, longer = now.after - was.after, ends[1] - ends[0] if ends[1] != ends[0] else 0.0
    loosened: dict[str, tuple[float | None, float | None]] = {}
    if (later < 0) if is_goal else (later > 0):
        loosened["after"] = was.after, now.after
    if (longer > 0) if is_goal else (longer < 0):
        stated = was.before, now.before
        if is_known:
            loosened["before" if any(stated) else "end"] = ends[0], ends[1]
        else:
            loosened["before"] = stated
    if (was.held or 0.0) > (now.held or 0.0):
        loosened["for"] = was.held, now.held
    return loosened


def _end(scope: Scope, *, is_known: bool) -> float:
    end = scope.end if scope.before is None and is_known else scope.before
    return math.inf if end is None else end


Statement = tuple[JsonValue, JsonValue]  # the values stated at a key before and now; None: nothing is stated


def loosened_statements(old: ExpectationOutcome, new: ExpectationOutcome) -> dict[str, Statement]:
    """Return the keys whose statements differ, and are not known to be stricter now."""
    if old.scope is None or new.scope is None or not (old.scope.stated and new.scope.stated):
        return {}
    return {
        key: statements
        for key, statements in _differing(old.scope.stated, new.scope.stated)
        if not _is_stricter(key, *statements)
    }


def _differing(old: Mapping[str, JsonValue], new: Mapping[str, JsonValue]) -> Iterator[tuple[str, Statement]]:
    for key in dict.fromkeys((*old, *new)):
        was, now = old.get(key), new.get(key)
        if isinstance(was, int | float) and isinstance(now, int | float):
            differs = not math.isclose(was, now, rel_tol=_SAME_LIMIT)
        else:
            differs = was != now
        if differs:
            yield key, (was, now)


_LOWER: Final = re.compile(r"(?:^|\.)(?:at_least|min_\w+|[xyz]\.0)$")
_UPPER: Final = re.compile(r"(?:^|\.)(?:at_most|max_\w+|within|tolerance|[xyz]\.1)$")


def _is_stricter(key: str, old: JsonValue, new: JsonValue) -> bool:
    """Return True if a limit demands more now, by the name of its key; a new limit does."""
    sign = 1 if _LOWER.search(key) else -1 if _UPPER.search(key) else 0
    # Of a part of a combination, the direction depends on the combination.
    if not sign or key[0].isdigit() or not isinstance(new, int | float):
        return False
    return old is None or (isinstance(old, int | float) and sign * (new - old) > 0)


def newly_allowed(old: ExpectationOutcome, new: ExpectationOutcome) -> tuple[str, ...]:
    """Return the names that are allowed now and were not before."""
    if old.scope is None or new.scope is None:
        return ()
    return tuple(name for name in new.scope.allowed if name not in old.scope.allowed)


def has_same_limit(old: Verdict, new: Verdict) -> bool:
    """Return True if two verdicts have equal limits, or both none."""
    if old.limit is None or new.limit is None:
        return old.limit is new.limit
    return old.unit == new.unit and math.isclose(old.limit, new.limit, rel_tol=_SAME_LIMIT)


def _only_ones(expectations: Iterable[ExpectationOutcome]) -> dict[str, ExpectationOutcome]:
    every = [expected for expected in expectations if expected.assertion != GATE]
    counts = Counter(expected.assertion for expected in every)
    return {expected.assertion: expected for expected in every if counts[expected.assertion] == 1}


def _renamed(
    now: ExpectationOutcome, added: dict[str, ExpectationOutcome], left: dict[str, ExpectationOutcome]
) -> ExpectationOutcome | None:
    return left.get(now.assertion) if added.get(now.assertion) is now else None


def _allows_more(old: Verdict, new: Verdict) -> bool:
    """Return True if the limit has moved to the permissive side; False if that side is not known."""
    if old.unit != new.unit or old.limit is None or new.limit is None or has_same_limit(old, new):
        return False
    sides = {side for verdict in (old, new) if (side := _side(verdict))}
    return sides == ({-1} if new.limit > old.limit else {1})


def _side(verdict: Verdict) -> int:
    """Return 1 for a lower limit, -1 for an upper one; 0 if the verdict does not show it."""
    if verdict.measured is None or verdict.limit is None or not verdict.margin:
        return 0
    above = verdict.measured - verdict.limit
    return 0 if not above else 1 if (above > 0) == (verdict.margin > 0) else -1


ClaimKind = Literal["removed", "limit", "confidence", "stated"]
"""The way in which a claim demands less, or more: the gate no longer has it, its limit moved, or its confidence.

"stated" is for statements of the scenario around its expectations: rules in `allow`, and its world.
"""


@dataclass(frozen=True, slots=True)
class ClaimChange:
    """A claim that demands less now, or more."""

    kind: ClaimKind
    claim: str  # the key of the claim, such as "passes" or "quantile of travel.measured"
    old: str  # old, new: the demand before and now, such as "at least 95 %"; `new` is empty if the claim was removed
    new: str = ""
    is_weaker: bool = True  # True if it demands less now


def claim_changes(old: Gate, new: Gate) -> tuple[ClaimChange, ...]:
    """Return the claims that demand less in the new gate, then the claims that demand more; `runs` is no claim."""
    stricter = (
        ClaimChange(change.kind, change.claim, change.new, change.old, is_weaker=False)
        for change in _weaker(new, old)
        if change.kind != "removed"
    )
    return *_weaker(old, new), *stricter


def surroundings_changes(old: Outcome, new: Outcome) -> Iterator[ClaimChange]:
    """Yield the changes around the expectations; only additions to the world and removed rules are no weakening."""
    if not (old.has_verdict and new.has_verdict and _is_recorded(old) and _is_recorded(new)):
        return
    groups: dict[str, list[tuple[str, Statement]]] = {}
    for key, statements in _differing(old.surroundings, new.surroundings):
        groups.setdefault(".".join(key.split(".")[:_DEPTH]), []).append((key, statements))
    for name, differing in groups.items():
        before, now = (
            ", ".join(
                f"{key.removeprefix(name).lstrip('.')} {values[side]}".strip()
                for key, values in differing
                if values[side] is not None
            )
            for side in (0, 1)
        )
        is_new = not any(key.startswith(name) for key in old.surroundings)
        is_weaker = is_new if name.startswith("allow.") else not is_new
        yield ClaimChange("stated", name, before or "not stated", now or "not stated", is_weaker=is_weaker)


_DEPTH: Final = 3  # number of keys that name a part of the world, such as `world.objects.wall`


def _is_recorded(outcome: Outcome) -> bool:
    """Return True if the version that wrote an outcome recorded what scenarios state."""
    return any(expected.scope is not None and expected.scope.end is not None for expected in outcome.expectations)


def _weaker(old: Gate, new: Gate) -> Iterator[ClaimChange]:
    was, now = old.passes or old.stop_early, new.passes or new.stop_early
    if was is not None:
        yield from _weaker_rate(was, now)
    for quantile in old.quantile:
        yield from _weaker_quantile(quantile, new.quantile)
    if new.errors.at_most > old.errors.at_most:
        before, after = (f"at most {counted(gate.errors.at_most, 'run')} without a verdict" for gate in (old, new))
        yield ClaimChange("limit", "errors", before, after)


def _weaker_rate(old: Passes | StopEarly, new: Passes | StopEarly | None) -> Iterator[ClaimChange]:
    """Yield the changes of the claim about the rate; `at_least` of `passes` compares with `reject` of `stop_early`."""
    key = _key(old)
    if new is None:
        yield ClaimChange("removed", key, _rate_text(old))
        return
    is_accepted_earlier = isinstance(old, StopEarly) and isinstance(new, StopEarly) and new.accept < old.accept
    if _excluded(new) < _excluded(old) or is_accepted_earlier:
        same_digits = percents_apart(*_rates(old), *_rates(new))
        before, now = _rate_text(old, same_digits), _rate_text(new, same_digits[len(_rates(old)) :])
        yield ClaimChange("limit", key, before, now if type(new) is type(old) else f"{_key(new)} {now}")
    yield from _less_confidence(key, old.confidence, new.confidence)


def _excluded(claim: Passes | StopEarly) -> float:
    return claim.at_least if isinstance(claim, Passes) else claim.reject


def _key(claim: Passes | StopEarly) -> str:
    return "passes" if isinstance(claim, Passes) else "stop_early"


def _rate_text(claim: Passes | StopEarly, rates: Sequence[str] = ()) -> str:
    first, *second = rates or percents_apart(*_rates(claim))
    return f"at least {first}" if isinstance(claim, Passes) else f"reject {first}, accept {second[0]}"


def _rates(claim: Passes | StopEarly) -> tuple[float, ...]:
    return (claim.at_least,) if isinstance(claim, Passes) else (claim.reject, claim.accept)


def _less_confidence(key: str, old: float, new: float) -> Iterator[ClaimChange]:
    if new < old:
        before, now = percents_apart(old, new)
        yield ClaimChange("confidence", key, before, now)


def _weaker_quantile(old: Quantile, others: Sequence[Quantile]) -> Iterator[ClaimChange]:
    changes = [tuple(_changes_of_quantile(old, other)) for other in others if _is_comparable(old, other)]
    removed = ClaimChange("removed", f"quantile of {old.of}", _quantile_text(old))
    yield from min(changes, key=len, default=(removed,))


def _changes_of_quantile(old: Quantile, new: Quantile) -> Iterator[ClaimChange]:
    key = f"quantile of {old.of}"
    sign = 1.0 if old.claim == "at_least" else -1.0
    (was, _), (now, _) = with_si_unit(old.bound), with_si_unit(new.bound)
    # At least L in 95 % of the runs is a bound of the 5 % quantile, at most L in 95 % one of the 95 % quantile.
    if sign * now < sign * was or sign * new.q > sign * old.q:
        yield ClaimChange("limit", key, _quantile_text(old), _quantile_text(new))
    yield from _less_confidence(key, old.confidence, new.confidence)


def _is_comparable(old: Quantile, new: Quantile) -> bool:
    # A number without a unit has the unit of the measured value.
    units = {with_si_unit(claim.bound)[1] for claim in (old, new)} - {""}
    return (old.of, old.claim) == (new.of, new.claim) and len(units) < 2


def _quantile_text(claim: Quantile) -> str:
    return f"{percents_apart(claim.q)[0]} quantile {claim.claim.replace('_', ' ')} {claim.bound}"
