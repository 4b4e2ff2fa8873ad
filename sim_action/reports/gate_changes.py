"""The changes of a gate in words, for `compare`: pass rates, margins and claims."""

from __future__ import annotations

from typing import Final

from sim_action.core.wording import counted
from sim_action.reports.formatting import quantity
from sim_action.results.gate_claims import ClaimChange
from sim_action.results.paired_comparison import CONFIDENCE, GateComparison, MarginLoss, Rate, RateChange
from sim_action.scenario.variations.gate import percent

# A smaller p-value is shown as a bound.
_SMALLEST_P: Final = 0.0001


def rate_change_text(rate: RateChange) -> str:
    """Return a text such as "the pass rate fell by 15 points (from 95 % to 80 % of 100 runs; ...; p = 0.0003)"."""
    change, found = rate.new.share - rate.old.share, rate.interval
    ends = (found.low, found.high) if change > 0 else (-found.high, -found.low)
    interval = " to ".join(_points(end) for end in ends)
    points = _points(abs(change))
    return (
        f"the pass rate {rate.direction} by {points} {'point' if points == '1' else 'points'} ({_from_to(rate)}; "
        f"{percent(CONFIDENCE)} interval {interval}; {_p_text(rate)})"
    )


def no_change_text(rate: RateChange) -> str:
    """Return a text such as "the pass rate went from 96 % to 95 % of 100 runs; ...; p = 1"."""
    low, high = (_points(end) for end in (rate.interval.low, rate.interval.high))
    return (
        f"the pass rate went {_from_to(rate)}; {percent(CONFIDENCE)} interval of the change {low} to {high} points; "
        f"{_p_text(rate)}"
    )


def _from_to(rate: RateChange) -> str:
    return f"from {percent(rate.old.share)} to {percent(rate.new.share)} of {counted(rate.new.runs, 'run')}"


def unpaired_text(gate: GateComparison) -> str:
    """Return a text such as "only 50 of 60 runs have the same draws, ..." for gates with other samples."""
    same = f"{gate.pairs} of {counted(max(gate.old.runs, gate.new.runs), 'run')} have the same draws"
    rates = f"{_rate_text(gate.old)}, now {_rate_text(gate.new)}"
    return f"{'only ' if gate.pairs else ''}{same}, so the runs are not compared; unpaired rates: {rates}"


def _rate_text(rate: Rate) -> str:
    return f"{percent(rate.share)} of {counted(rate.runs, 'run')}" if rate.runs else "no run with a verdict"


def _points(share: float) -> str:
    # Adding 0 turns a negative zero into 0.
    return f"{round(share * 100, 1) + 0.0:.1f}".removesuffix(".0")


def _p_text(rate: RateChange) -> str:
    value = f"p = {rate.p:.2g}" if rate.p >= _SMALLEST_P else f"p < {_SMALLEST_P}"
    return value if rate.tests == 1 else f"{value}, adjusted for {rate.tests} gates"


def mean_margins_text(margin: MarginLoss) -> str:
    """Return a text such as "clearance: mean margin of 100 pairs 0.4 m, now 0.1 m (95 % interval ...)"."""
    old, new = (quantity(value, margin.unit) for value in (margin.old, margin.new))
    ends = " to ".join(quantity(end, margin.unit) for end in (margin.change.low, margin.change.high))
    return (
        f"{margin.expectation}: mean margin of {counted(margin.pairs, 'pair')} {old}, now {new} "
        f"({percent(margin.confidence)} interval of the change {ends})"
    )


def claim_text(claim: ClaimChange) -> str:
    """Return a text such as "passes: at least 80 %, was at least 90 %"."""
    if claim.kind == "removed":
        return f"{claim.claim}: removed from the gate, was {claim.old}"
    key = "confidence " if claim.kind == "confidence" else ""
    return f"{claim.claim}: {key}{claim.new}, was {claim.old}"
