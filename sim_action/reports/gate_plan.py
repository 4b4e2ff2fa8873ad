"""The plan of a gate: how many runs it takes until a robot of a wished rate passes, for `run --plan-gate`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final

from sim_action.core.statistics import binomial
from sim_action.core.statistics.sequential import Expected, SequentialTest
from sim_action.core.wording import counted
from sim_action.reports.gate_chances import (
    aligned,
    chance,
    chance_tables,
    claim_text,
    quantile_text,
    true_rates,
    values_beyond,
)
from sim_action.scenario.variations.gate import (
    MAX_RUNS_OF_GATE,
    Passes,
    PlannedGate,
    Quantile,
    StopEarly,
    percent,
    percents_apart,
)

_POWERS: Final = (0.8, 0.9)
_ROWS: Final = 5
_MARK: Final = ">"
# The rest of a test that is undecided; a larger number of runs does not change its chances.
_NEGLIGIBLE: Final = 1e-4

Duration = Callable[[float], str]
"""A function that returns the estimated time of so many runs; empty if it is not known."""


def plan_lines(gate: PlannedGate, wish: float, duration: Duration, *, is_refused: bool = False) -> Iterator[str]:
    """Yield the plan of a gate: its claim, the chances with its runs, and those with other numbers of runs.

    Args:
        gate: the gate as it is stated.
        wish: the true rate of a robot that should pass.
        duration: the estimated time of so many runs.
        is_refused: True if its runs are too few, whatever they give.
    """
    stated = f"{counted(gate.runs, 'run')}{', too few' if is_refused else ''}"
    yield f"{gate.name}  {gate.location}  {claim_text(gate.gate)}; {stated}"
    if not is_refused:
        (told,) = chance_tables([gate])
        yield ""
        yield from (f"  {line}" for line in told.lines())
    if gate.gate.passes is not None:
        yield from _rate_plan(gate.gate.passes, gate.runs, wish, duration)
    if gate.gate.stop_early is not None:
        yield from _test_plan(gate.gate.stop_early, gate.runs, wish, duration)
    for claim in gate.gate.quantile:
        yield from _quantile_plan(claim, gate.runs, duration)


def _rate_plan(claim: Passes, runs: int, wish: float, duration: Duration) -> Iterator[str]:
    enough = [_runs_for_power(claim, wish, power) for power in _POWERS]
    numbers = {binomial.runs_needed(claim.at_least, claim.confidence, failures) for failures in range(_ROWS)}
    numbers = {number for number in (*numbers, runs, *filter(None, enough)) if number <= MAX_RUNS_OF_GATE}
    rates = sorted({*true_rates(claim), wish})
    rows = [("runs", "may fail", *percents_apart(*rates), *_heading(duration))]
    for number in sorted(numbers):
        passing = binomial.passes_needed(number, claim.at_least, claim.confidence)
        chances = [binomial.chances(rate, number, claim.at_least, claim.confidence).passed for rate in rates]
        failing = "-" if passing is None else str(number - passing)
        rows.append((_marked(number, runs), failing, *map(chance, chances), *_cell(duration(number))))
    yield ""
    yield "  probability to pass, by the number of runs and the true rate:"
    yield from (f"  {line}" for line in aligned(rows))
    yield ""
    if wish <= claim.at_least:
        good = f"  A robot that is {percent(wish)} good"
        yield f"{good} is no better than the claim; no number of runs lets it pass reliably."
        return
    for power, least in zip(_POWERS, enough, strict=True):
        yield f"  {_advice(wish, power, least, duration)}"


def _runs_for_power(claim: Passes, wish: float, power: float) -> int | None:
    return binomial.runs_for_power(wish, claim.at_least, claim.confidence, power) if wish > claim.at_least else None


def _advice(wish: float, power: float, number: int | None, duration: Duration) -> str:
    robot = f"A robot that is {percent(wish)} good"
    if number is None:
        return f"{robot} does not pass with P = {power} at any number of runs up to {MAX_RUNS_OF_GATE:,}."
    took = f", about {duration(number)}" if duration(number) else ""
    return f"{robot} passes with P >= {power} at {counted(number, 'run')}{took}."


def _test_plan(claim: StopEarly, runs: int, wish: float, duration: Duration) -> Iterator[str]:
    enough = [_most_for_power(claim, wish, power) for power in _POWERS]
    numbers = {claim.least_runs * 2**step for step in range(_ROWS)}
    numbers = {number for number in (*numbers, runs, *filter(None, enough)) if number <= MAX_RUNS_OF_GATE}
    rates = sorted({*true_rates(claim), wish})
    rows = [("at most", *percents_apart(*rates), "mean runs", *_heading(duration))]
    for number in sorted(numbers):
        found = [_exact(claim, number, rate) for rate in rates]
        mean = found[rates.index(wish)].mean_runs
        chances = (chance(each.accepted) for each in found)
        rows.append((_marked(number, runs), *chances, f"{mean:.0f}", *_cell(duration(mean))))
    yield ""
    yield f"  probability to pass, by the largest number of runs and the true rate; mean runs at {percent(wish)}:"
    yield from (f"  {line}" for line in aligned(rows))
    yield ""
    for power, number in zip(_POWERS, enough, strict=True):
        if number is None:
            yield f"  {_advice(wish, power, None, duration)}"
            continue
        mean = _exact(claim, number, wish).mean_runs
        took = f", about {duration(mean)}" if duration(mean) else ""
        robot = f"A robot that is {percent(wish)} good passes with P >= {power}"
        yield f"  {robot} at a limit of {counted(number, 'run')}; it stops after {mean:.0f} on average{took}."


def _most_for_power(claim: StopEarly, wish: float, power: float) -> int | None:
    """Return the least limit of runs at which a robot passes with a probability, or None if no limit does."""
    low, high = claim.least_runs - 1, claim.least_runs
    while (found := _exact(claim, high, wish)).accepted < power:
        if found.undecided < _NEGLIGIBLE or high == MAX_RUNS_OF_GATE:
            return None
        low, high = high, min(2 * high, MAX_RUNS_OF_GATE)
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if _exact(claim, middle, wish).accepted >= power else (middle, high)
    return high


def _exact(claim: StopEarly, most: int, rate: float) -> Expected:
    return SequentialTest(claim.reject, claim.accept, claim.confidence, most).exact(rate)


def _quantile_plan(claim: Quantile, runs: int, duration: Duration) -> Iterator[str]:
    share = 1.0 - claim.q if claim.claim == "at_least" else claim.q
    numbers = {binomial.runs_needed(share, claim.confidence, beyond) for beyond in range(_ROWS)} | {runs}
    side = "below" if claim.claim == "at_least" else "above"
    rows = [("runs", f"values {side}", *_heading(duration))]
    for number in sorted(number for number in numbers if number <= MAX_RUNS_OF_GATE):
        beyond = values_beyond(claim, number)
        rows.append((_marked(number, runs), "-" if beyond is None else str(beyond), *_cell(duration(number))))
    yield ""
    yield f"  {quantile_text(claim)}: the number of values that may lie {side} the bound:"
    yield from (f"  {line}" for line in aligned(rows))


def _marked(number: int, stated: int) -> str:
    return f"{_MARK if number == stated else ' '} {number:>6}"


def _heading(duration: Duration) -> tuple[str, ...]:
    return ("time",) if duration(1) else ()


def _cell(text: str) -> tuple[str, ...]:
    return (text,) if text else ()
