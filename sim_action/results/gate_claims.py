"""Compare the claims that a gate states in two results: those that demand less now, and those that demand more.

The stated gates are compared, not their verdicts: a verdict does not show the confidence of each claim.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal

from sim_action.core.records import dataclass
from sim_action.core.units import with_si_unit
from sim_action.core.wording import counted
from sim_action.scenario.variations.gate import Gate, Passes, Quantile, StopEarly, percents_apart

ClaimKind = Literal["removed", "limit", "confidence"]
"""The way in which a claim demands less, or more: the gate no longer has it, its limit moved, or its confidence."""


@dataclass(frozen=True, slots=True)
class ClaimChange:
    """A claim that demands less now, or more.

    Attributes:
        claim: the key of the claim, such as "passes" or "quantile of travel.measured".
        old, new: the demand before and now, such as "at least 95 %"; `new` is empty if the claim was removed.
        is_weaker: True if it demands less now.
    """

    kind: ClaimKind
    claim: str
    old: str
    new: str = ""
    is_weaker: bool = True


def claim_changes(old: Gate, new: Gate) -> tuple[ClaimChange, ...]:
    """Return the claims that demand less in the new gate, then those that demand more; `runs` is no claim."""
    stricter = (
        ClaimChange(each.kind, each.claim, each.new, each.old, is_weaker=False)
        for each in _weaker(new, old)
        if each.kind != "removed"
    )
    return *_weaker(old, new), *stricter


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
    """Yield the changes of the claim about the rate.

    `passes` and `stop_early` are comparable: a robot of the rate `at_least`, or `reject`, passes equally seldom.
    """
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
    changes = [tuple(_changes_of_quantile(old, each)) for each in others if _is_comparable(old, each)]
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
    # A number without a unit is in that of the measured value.
    units = {with_si_unit(claim.bound)[1] for claim in (old, new)} - {""}
    return (old.of, old.claim) == (new.of, new.claim) and len(units) < 2


def _quantile_text(claim: Quantile) -> str:
    return f"{percents_apart(claim.q)[0]} quantile {claim.claim.replace('_', ' ')} {claim.bound}"
