"""The verdicts that robots of known rates would get from gates, and the plan of a gate, for `run --plan-gate`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Final, TextIO

from sim_action.core import statistics
from sim_action.core.records import dataclass
from sim_action.core.statistics import Expected, SequentialTest
from sim_action.core.units import is_bare
from sim_action.core.wording import counted, first_of
from sim_action.reports.display import Console, shows_colours
from sim_action.reports.escaping import one_line
from sim_action.scenario.source import Refused, Source
from sim_action.scenario.variations.gate import (
    MAX_RUNS_OF_GATE,
    Gate,
    Passes,
    PlannedGate,
    Quantile,
    StopEarly,
    percent,
    percents_apart,
)

_MAX_NAMES: Final = 3
# Shares of the failures that a claim allows: robots that are worse than it, just as good, better, and much better.
_FAILURES: Final = (1.5, 1.0, 0.5, 0.1)
_INDENT: Final = "  "
_GAP: Final = 3


@dataclass(frozen=True, slots=True)
class ChanceTable:
    """The chances of gates with equal claims."""

    title: str  # the names of the gates, their number of runs and their claim
    columns: tuple[str, ...] = ()  # the true rates, such as "95 %"
    # the name of a verdict and its probability at each rate; for a test that stops early also the mean number of runs
    rows: tuple[tuple[str, ...], ...] = ()
    remarks: tuple[str, ...] = ()  # what the claims about quantiles need

    def lines(self) -> Iterator[str]:
        """Yield the table as aligned text, without its title."""
        if self.rows:
            yield from aligned((("a robot that is ... good", *self.columns), *self.rows))
        yield from self.remarks


def chance_tables(gates: Iterable[PlannedGate]) -> list[ChanceTable]:
    """Return one table for all gates with equal claims and runs, in their order."""
    alike: dict[tuple[Gate, int], list[str]] = {}
    for gate in gates:
        alike.setdefault((gate.gate, gate.runs), []).append(gate.name)
    return [_chances(gate, runs, names) for (gate, runs), names in alike.items()]


def print_chances(gates: Iterable[PlannedGate], stream: TextIO, environment: Mapping[str, str]) -> None:
    """Print the tables to a stream."""
    console = Console(stream, colourful=shows_colours(stream, environment))
    for table in chance_tables(gates):
        console.print((table.title, "bold"))
        for line in table.lines():
            console.print((f"{_INDENT}{line}", "dim"))
    stream.flush()


def claim_text(gate: Gate) -> str:
    """Return the claims of a gate, such as "at least 90 % pass with 95 % confidence"."""
    texts = [rate_claim_text(claim) for claim in (gate.passes, gate.stop_early) if claim is not None]
    return "; ".join((*texts, *map(quantile_text, gate.quantile)))


def gate_listing(scenarios: Iterable[Source | Refused]) -> list[str]:
    """Return one line for each gate of scenarios, for `run --list`."""
    gates = {
        (scenario.gate.file, scenario.gate.name): scenario.gate for scenario in scenarios if scenario.gate is not None
    }
    return [f"gate {gate.name}: {claim_text(gate.gate)}, {counted(gate.runs, 'run')}" for gate in gates.values()]


def rate_claim_text(claim: Passes | StopEarly) -> str:
    """Return a claim about the rate, such as "at least 90 % pass with 95 % confidence"."""
    sure = f"with {percent(claim.confidence)} confidence"
    if isinstance(claim, StopEarly):
        return f"{percent(claim.accept)} against {percent(claim.reject)} {sure}"
    return f"at least {percent(claim.at_least)} pass {sure}"


def quantile_text(claim: Quantile) -> str:
    """Return a claim about a quantile, such as "5 % quantile of travel.measured at least 1.4 m ..."."""
    side = claim.claim.replace("_", " ")
    bound = f"{claim.bound} (SI)" if is_bare(claim.bound) else claim.bound
    return f"{percent(claim.q)} quantile of {claim.of} {side} {bound} with {percent(claim.confidence)} confidence"


def true_rates(claim: Passes | StopEarly) -> tuple[float, ...]:
    """Return rates around a claim: 85, 90, 95 and 99 % for "at least 90 %", and for "95 % against 85 %"."""
    if isinstance(claim, StopEarly):
        rates: tuple[float, ...] = (
            claim.reject,
            (claim.reject + claim.accept) / 2,
            claim.accept,
            1 - (1 - claim.accept) / 5,
        )
    else:
        rates = tuple(max(0.0, 1 - share * (1 - claim.at_least)) for share in _FAILURES)
    return tuple(dict.fromkeys(round(rate, 12) for rate in rates))


def aligned(rows: Iterable[Sequence[str]]) -> list[str]:
    """Return rows as lines: the first column to the left, the others to the right."""
    cells = [list(row) for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return [_aligned(first, rest, widths) for first, *rest in cells]


def _aligned(first: str, rest: Sequence[str], widths: Sequence[int]) -> str:
    numbers = (cell.rjust(width + _GAP) for cell, width in zip(rest, widths[1:], strict=True))
    return first.ljust(widths[0]) + "".join(numbers)


def _chances(gate: Gate, runs: int, names: Sequence[str]) -> ChanceTable:
    called = first_of([*map(one_line, names)], _MAX_NAMES)
    remarks = tuple(_remark(claim, runs) for claim in gate.quantile)
    claim = gate.passes or gate.stop_early
    if claim is None:
        return ChanceTable(f"{called}: gate of {counted(runs, 'run')}", remarks=remarks)
    most = "at most " if isinstance(claim, StopEarly) else ""
    title = f"{called}: gate of {most}{counted(runs, 'run')}, {rate_claim_text(claim)}"
    rates = true_rates(claim)
    rows = _of_test(claim, runs, rates) if isinstance(claim, StopEarly) else _of_rate(claim, runs, rates)
    return ChanceTable(title, percents_apart(*rates), rows, remarks)


def _of_rate(claim: Passes, runs: int, rates: Sequence[float]) -> tuple[tuple[str, ...], ...]:
    chances_by_rate = [statistics.chances(rate, runs, claim.at_least, claim.confidence) for rate in rates]
    passing = statistics.passes_needed(runs, claim.at_least, claim.confidence)
    failing = statistics.passes_refuting(runs, claim.at_least, claim.confidence)
    return (
        (
            f"passes{'' if passing is None else f' ({passing} or more)'}",
            *(chance(chances.passed) for chances in chances_by_rate),
        ),
        ("inconclusive", *(chance(chances.inconclusive) for chances in chances_by_rate)),
        (
            f"fails{'' if failing is None else f' ({failing} or fewer)'}",
            *(chance(chances.failed) for chances in chances_by_rate),
        ),
    )


def _of_test(claim: StopEarly, runs: int, rates: Sequence[float]) -> tuple[tuple[str, ...], ...]:
    test = SequentialTest(claim.reject, claim.accept, claim.confidence, runs)
    expected_by_rate = [test.exact(rate) for rate in rates]
    return (
        ("passes", *(chance(expected.accepted) for expected in expected_by_rate)),
        ("inconclusive", *(chance(expected.undecided) for expected in expected_by_rate)),
        ("fails", *(chance(expected.rejected) for expected in expected_by_rate)),
        ("mean number of runs", *(f"{expected.mean_runs:.0f}" for expected in expected_by_rate)),
    )


def _remark(claim: Quantile, runs: int) -> str:
    most = values_beyond(claim, runs)
    side = "below" if claim.claim == "at_least" else "above"
    if most is None:
        return f"{quantile_text(claim)}: {counted(runs, 'run')} cannot show it"
    few = "no value" if most == 0 else f"at most {counted(most, 'value')}"
    return f"{quantile_text(claim)}: {few} of {runs} may be {side} the bound"


def values_beyond(claim: Quantile, runs: int) -> int | None:
    """Return the number of values that may lie beyond the bound of a quantile; None: so few runs cannot show it."""
    if claim.claim == "at_least":
        rank = statistics.lower_rank(runs, claim.q, claim.confidence)
        return None if rank is None else rank - 1
    rank = statistics.upper_rank(runs, claim.q, claim.confidence)
    return None if rank is None else runs - rank


def chance(probability: float) -> str:
    """Return a probability for people, such as "0.41"."""
    return f"{probability:.2f}"


_POWERS: Final = (0.8, 0.9)
_ROWS: Final = 5
_MARK: Final = ">"
_NEGLIGIBLE: Final = 1e-4  # the rest of a test that is undecided; a larger number of runs does not change its chances

Duration = Callable[[float], str]
"""A function that returns the estimated time of so many runs; empty if it is not known."""


def plan_lines(gate: PlannedGate, wish: float, duration: Duration, *, is_refused: bool = False) -> Iterator[str]:
    """Yield the plan of a gate: its claim, the chances with its runs, and those with other numbers of runs.

    Args:
        gate: the gate as it is stated.
        wish: the true rate of a robot that should pass.
        duration: the estimated time of so many runs.
        is_refused: True if its runs are too few, regardless of their results.
    """
    stated = f"{counted(gate.runs, 'run')}{', too few' if is_refused else ''}"
    yield f"{gate.name}  {gate.location}  {claim_text(gate.gate)}; {stated}"
    if not is_refused:
        (table,) = chance_tables([gate])
        yield ""
        yield from (f"  {line}" for line in table.lines())
    if gate.gate.passes is not None:
        yield from _rate_plan(gate.gate.passes, gate.runs, wish, duration)
    if gate.gate.stop_early is not None:
        yield from _test_plan(gate.gate.stop_early, gate.runs, wish, duration)
    for claim in gate.gate.quantile:
        yield from _quantile_plan(claim, gate.runs, duration)


def _rate_plan(claim: Passes, runs: int, wish: float, duration: Duration) -> Iterator[str]:
    enough = [_runs_for_power(claim, wish, power) for power in _POWERS]
    numbers = {statistics.runs_needed(claim.at_least, claim.confidence, failures) for failures in range(_ROWS)}
    numbers = {number for number in (*numbers, runs, *filter(None, enough)) if number <= MAX_RUNS_OF_GATE}
    rates = sorted({*true_rates(claim), wish})
    rows = [("runs", "may fail", *percents_apart(*rates), *_heading(duration))]
    for number in sorted(numbers):
        passing = statistics.passes_needed(number, claim.at_least, claim.confidence)
        chances = [statistics.chances(rate, number, claim.at_least, claim.confidence).passed for rate in rates]
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
    return statistics.runs_for_power(wish, claim.at_least, claim.confidence, power) if wish > claim.at_least else None


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
        expected_by_rate = [_exact(claim, number, rate) for rate in rates]
        mean = expected_by_rate[rates.index(wish)].mean_runs
        chances = (chance(expected.accepted) for expected in expected_by_rate)
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
    while (expected := _exact(claim, high, wish)).accepted < power:
        if expected.undecided < _NEGLIGIBLE or high == MAX_RUNS_OF_GATE:
            return None
        low, high = high, min(2 * high, MAX_RUNS_OF_GATE)
    return statistics.first(low + 1, high, lambda runs: _exact(claim, runs, wish).accepted >= power)


def _exact(claim: StopEarly, most: int, rate: float) -> Expected:
    return SequentialTest(claim.reject, claim.accept, claim.confidence, most).exact(rate)


def _quantile_plan(claim: Quantile, runs: int, duration: Duration) -> Iterator[str]:
    share = 1.0 - claim.q if claim.claim == "at_least" else claim.q
    numbers = {statistics.runs_needed(share, claim.confidence, beyond) for beyond in range(_ROWS)} | {runs}
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
