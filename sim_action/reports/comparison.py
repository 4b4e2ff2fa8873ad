"""The report of `sim-action compare`: a row for each change, the worst first, for a terminal or as Markdown."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from typing import Final, Literal, TextIO, get_args

from pydantic import JsonValue

from sim_action.core import units
from sim_action.core.wording import counted, first_of, shown
from sim_action.reports.display import STATUS_DISPLAYS, open_console
from sim_action.reports.formatting import first_reason, measurements, moment, quantity, speed_text
from sim_action.reports.github.markdown import fitting, markdown_row, markdown_rows, paragraphs
from sim_action.reports.table import Row, Table
from sim_action.results import weaker_checks
from sim_action.results.comparison import Change, ChangeKind, Comparison, SmallerMargin
from sim_action.results.outcome import ExpectationOutcome, Outcome
from sim_action.results.output_folder import COMPARED
from sim_action.results.paired_comparison import CONFIDENCE, GateComparison, MarginLoss, Rate, RateChange
from sim_action.scenario.variations.gate import GATE, percent

Look = Literal["failed", "warned", "information", "passed"]  # the status of a change, the worst first

_LOOKS: Final[dict[ChangeKind, Look]] = {
    "newly fails": "failed",
    "flaky": "failed",
    "not run": "warned",
    "removed": "warned",
    "not repeated": "warned",
    "fails differently": "information",
    "still fails": "information",
    "fixed": "passed",
    "new": "passed",
}
_WEAKER: Final[dict[weaker_checks.WeakerKind, str]] = {
    "removed": "no longer checked",
    "severity": "only a warning now",
    "unexercised": "only a warning now",
    "inconclusive": "only a warning now",
    "window": "weaker window",
    "allow": "allows more",
    "limit": "weaker limit",
    "stated": "states something else",
}
_CLAIMS: Final[dict[tuple[weaker_checks.ClaimKind, bool], tuple[Look, str]]] = {
    ("removed", True): ("warned", "no longer checked"),
    ("limit", True): ("warned", "weaker limit"),
    ("confidence", True): ("warned", "less confidence"),
    ("limit", False): ("information", "stricter limit"),
    ("stated", True): ("warned", "states something else"),
    ("stated", False): ("information", "states something else"),
    ("confidence", False): ("information", "more confidence"),
}
"""The looks and names of the changes of a gate's claims, by kind and `is_weaker`."""
_MAX_KINDS: Final = 3


def rows(comparison: Comparison) -> list[Row]:
    """Return the changes, the worst first, otherwise in the order of the runs; unchanged passes have no row."""
    every = [row for change in comparison.changes for row in rows_of(change)]
    return sorted(every, key=lambda row: (get_args(Look).index(row.status), row.kind == "moves differently"))


def _row(look: Look, kind: str, outcome: Outcome, detail: str) -> Row:
    """Return one change of one scenario; `detail`: the reason, or the values before and now, or empty."""
    return Row(look, outcome.name, detail, kind=kind, location=outcome.location, stands_out=True)


def _table(shown: Sequence[Row]) -> Table:
    return Table("Scenario", tuple(shown), message="What happened", kind="Change")


def headline(comparison: Comparison) -> str:
    """Return the counts of all changes, such as "1 newly fails, 2 warnings (slower), 1 fixed, 12 still pass"."""
    warnings = comparison.warnings
    kinds = f" ({_warning_kinds(comparison)})" if warnings else ""
    named = (
        (comparison.count("newly fails"), "newly fails", "newly fail"),
        (comparison.count("flaky"), "flaky", "flaky"),
        (_rates(comparison, "fell"), "pass rate fell", "pass rates fell"),
        (warnings, f"warning{kinds}", f"warnings{kinds}"),
        (comparison.count("fails differently"), "fails differently", "fail differently"),
        (comparison.count("still fails"), "still fails", "still fail"),
        (comparison.count("fixed"), "fixed", "fixed"),
        (_rates(comparison, "rose"), "pass rate rose", "pass rates rose"),
        (comparison.count("new"), "new", "new"),
        (comparison.count("still passes"), "still passes", "still pass"),
    )
    counts = [f"{count} {one if count == 1 else several}" for count, one, several in named if count]
    return ", ".join(counts) or "no scenarios"


def _warning_kinds(comparison: Comparison) -> str:
    kinds = dict.fromkeys(row.kind for row in rows(comparison) if row.status == "warned")
    return first_of(kinds, _MAX_KINDS)


def _rates(comparison: Comparison, direction: Literal["fell", "rose"]) -> int:
    gates = (change.gate for change in comparison.changes)
    return sum(gate is not None and gate.rate is not None and gate.rate.direction == direction for gate in gates)


NOTHING_COMPARED: Final = (
    "every scenario of the old run was removed, so nothing was compared; check the new results, or allow it with "
    "--allow-removed"
)


def rows_of(change: Change) -> Iterator[Row]:
    """Yield the rows of one scenario or gate."""
    if look := _LOOKS.get(change.kind):
        yield _row(look, change.kind, change.outcome, _detail(change))
    if change.gate is not None:
        yield from _rows_of_runs(change.gate, change.outcome)
    for missed in change.missed:
        what = "no longer checked" if missed.verdict.status == "not_exercised" else "no longer holds"
        yield _row("warned", what, change.outcome, f"{missed.name}: {missed.verdict.message}")
    for weaker in change.weaker:
        yield _row("warned", _WEAKER[weaker.kind], change.outcome, _weaker_text(weaker))
    yield from (_row_of_claim(claim, change.outcome) for claim in change.claims)
    for smaller in change.smaller_margins:
        yield _row("warned", "margin shrinks", change.outcome, _margins_text(smaller))
    elsewhere = "" if change.processors is None else " (different CPUs: before {}, now {})".format(*change.processors)
    if slower := change.slower:
        speeds = f"{speed_text(slower.old)}, now {speed_text(slower.new)}{elsewhere}"
        yield _row("information" if elsewhere else "warned", "slower", change.outcome, speeds)
    for was, now in change.stricter:
        # A default name has the limit.
        is_known = now.name == was.name or quantity(was.verdict.limit, was.verdict.unit) in was.name
        names = now.name if is_known else f"{now.name}; was: {was.name}"
        yield _row("information", "stricter limit", change.outcome, f"{names}; {limits_text(was, now)}")
    for old, new in change.renamed:
        yield _row("information", "check renamed", change.outcome, f"{new}; was: {old}")
    # If the verdict changed, a different motion is expected.
    rate_changed = change.gate is not None and change.gate.rate is not None and change.gate.rate.direction is not None
    if change.moves_differently and change.kind in ("still passes", "still fails") and not rate_changed:
        share = f"{change.gate.moved} of {counted(change.gate.pairs, 'pair')} have a " if change.gate else ""
        detail = f"{share}different digest with the same seed on the same engine{elsewhere}"
        yield _row("information", "moves differently", change.outcome, detail)


def _row_of_claim(claim: weaker_checks.ClaimChange, outcome: Outcome) -> Row:
    look, what = _CLAIMS[claim.kind, claim.is_weaker]
    return _row(look, what, outcome, claim_text(claim))


def _rows_of_runs(gate: GateComparison, outcome: Outcome) -> Iterator[Row]:
    """Yield the rows of the runs of a gate, without rows of weaker checks."""
    if not gate.same_draws:
        yield _row("warned", "samples differ", outcome, unpaired_text(gate))
    if rate := gate.rate:
        if rate.direction is not None:
            look: Look = "failed" if rate.direction == "fell" else "passed"
            yield _row(look, f"pass rate {rate.direction}", outcome, rate_change_text(rate))
        elif rate.worse or rate.better:
            yield _row("information", "no change shown", outcome, no_change_text(rate))
    for margin in gate.margins:
        yield _row("warned", "margins shrink", outcome, mean_margins_text(margin))
    if gate.left_out:
        detail = f"{gate.left_out} of {gate.left_out + gate.pairs} samples: no verdict before or now"
        yield _row("information", "not compared", outcome, detail)


def _detail(change: Change) -> str:
    """Return the reason of the failure now or before, or the former status."""
    if change.kind == "fixed" and change.old is not None:
        word = _word(change.old) if change.old.status == "not_exercised" else "failed"
        return f"{word} before: {first_reason(change.old)}"
    if change.kind == "not repeated":
        return "was flaky before, passed now in a single run"
    if change.kind in ("removed", "not run"):
        return "" if change.old is None else f"was: {_word(change.old)}"
    reason = first_reason(change.outcome).removeprefix(f"{change.kind}: ")
    if change.kind == "fails differently" and change.old:
        return f"was: {_word(change.old)}; {reason}"
    parts = (reason, before_text(change) if change.kind == "newly fails" else "")
    return "; ".join(filter(None, parts))


def _word(outcome: Outcome | None) -> str:
    return "" if outcome is None else STATUS_DISPLAYS[outcome.status].word


def before_text(change: Change) -> str:
    """Return when a goal that failed came true before, or what was measured; empty without a margin (yes or no)."""
    failed = next(iter(change.outcome.causes), None)
    pairs = (
        () if change.old is None or failed is None else weaker_checks.paired_expectations(change.old, change.outcome)
    )
    held = next((was for was, now in pairs if now is failed and was.status == "passed"), None)
    if failed is None or held is None or not held.verdict.margin:
        return ""
    name = "" if held.name == failed.name else f" ({held.name})"
    # The margin of a goal that came true says little.
    measured = f"came true at {moment(held.verdict.time)}" if held.verdict.goal else measurements(held.verdict)
    # The margin of a gate belongs to a bound, not to the measured rate.
    return f"before{name}: {held.verdict.message if held.assertion == GATE else measured}"


def _weaker_text(weaker: weaker_checks.WeakerCheck) -> str:
    """Return a text such as "clearance: limit 0.1 m, was 0.3 m"."""
    old, new = weaker.old, weaker.new
    if new is None:
        return f"{old.name}: removed from the scenario"
    if weaker.kind in ("severity", "unexercised", "inconclusive"):
        return f"{new.name}: {weaker.kind} {getattr(new, weaker.kind)}, was {getattr(old, weaker.kind)}"
    if weaker.kind == "window":
        times = (
            f"{_time(key, now)}, was {_time('', was)}"
            for key, (was, now) in weaker_checks.loosened_times(old, new).items()
        )
        return f"{new.name}: {'; '.join(times)}"
    if weaker.kind == "allow":
        return f"{new.name}: allow has {', '.join(weaker_checks.newly_allowed(old, new))} now"
    if weaker.kind == "stated":
        statements = weaker_checks.loosened_statements(old, new).items()
        return f"{new.name}: " + "; ".join(f"{key} {_said(now)}, was {_said(was)}" for key, (was, now) in statements)
    return f"{new.name}: {limits_text(old, new)}"


def _said(value: JsonValue) -> str:
    return "not stated" if value is None else shown(value)


def limits_text(old: ExpectationOutcome, new: ExpectationOutcome) -> str:
    """Return a text such as "limit 0.1 m, was 0.3 m" for an expectation whose limit moved."""
    before, now = old.verdict, new.verdict
    assert before.limit is not None, "the limit moved"
    assert now.limit is not None, "the limit moved"
    limit, was = units.display_apart(now.limit, before.limit, now.unit)
    return f"limit {limit}, was {was}"


def _time(key: str, time: float | None) -> str:
    if time is None:
        return f"no {key}".rstrip() if key else "none"
    return f"{key} {units.display(time, 's')}".lstrip()


def _margins_text(smaller: SmallerMargin) -> str:
    """Return a text such as "clearance: margin 0.4 m (27% of its limit), now 0.1 m (7%)"."""
    old, new = (quantity(value, smaller.unit) for value in (smaller.old, smaller.new))
    of_old = "" if smaller.old_share is None else f" ({smaller.old_share:.0%} of its limit)"
    of_new = "" if smaller.new_share is None else f" ({smaller.new_share:.0%})"
    return f"{smaller.expectation}: margin {old}{of_old}, now {new}{of_new}"


_MAX_TERMINAL_ROWS: Final = 200


def print_comparison(comparison: Comparison, environment: Mapping[str, str], stream: TextIO | None = None) -> None:
    """Print the changes to a stream (default: standard output), the worst last, then the counts."""
    every = rows(comparison)
    with open_console(stream or sys.stdout, environment) as shown:
        if len(every) > _MAX_TERMINAL_ROWS:
            shown.print((f"{len(every) - _MAX_TERMINAL_ROWS} more changes are not shown", "dim"))
        for line in _table(every[:_MAX_TERMINAL_ROWS][::-1]).lines(shown):
            shown.print(*line)
        bad = comparison.failures or comparison.is_empty
        style = STATUS_DISPLAYS["failed" if bad else "warned" if comparison.warnings else "passed"].style
        if comparison.is_empty:
            shown.print((NOTHING_COMPARED, style))
        shown.print((headline(comparison), style))


MAX_CHARACTERS: Final = 60_000  # the largest size of the Markdown; GitHub accepts 65,536 characters in a comment
_FRAME_CHARACTERS: Final = 2_000


def comparison_markdown(comparison: Comparison) -> str:
    """Return a headline and a table of the changes, the worst first, as GitHub-flavoured Markdown for a comment."""
    every = rows(comparison)
    table = _table(every)
    written = fitting((markdown_row(table, row) for row in every), MAX_CHARACTERS - _FRAME_CHARACTERS)
    parts = [
        f"## {_title(comparison)}",
        f"**{headline(comparison)}**, {COMPARED}",
        f"{NOTHING_COMPARED[0].upper()}{NOTHING_COMPARED[1:]}." if comparison.is_empty else "",
        markdown_rows(table, written),
        f"_{len(every) - len(written)} more changes are not shown._" if len(every) > len(written) else "",
    ]
    return paragraphs(*parts) + "\n"


def _title(comparison: Comparison) -> str:
    flaky = comparison.count("flaky")
    failing = comparison.count("newly fails")
    fell = _rates(comparison, "fell")
    if failing or fell:
        parts = [f"{failing} {'scenario newly fails' if failing == 1 else 'scenarios newly fail'}"] if failing else []
        parts += [f"{fell} pass {'rate' if fell == 1 else 'rates'} fell"] if fell else []
        parts += [f"{flaky} flaky"] if flaky else []
        return f"❌ {', '.join(parts)}"
    if comparison.is_empty:
        return "❌ Every scenario was removed"
    if flaky:
        return f"🎲 {flaky} {'scenario is' if flaky == 1 else 'scenarios are'} flaky"
    if count := comparison.warnings:
        return f"⚠️ Nothing newly fails, {count} {'warning' if count == 1 else 'warnings'}"
    return "✅ Nothing newly fails"


_SMALLEST_P: Final = 0.0001  # a smaller p-value is shown as a bound


def rate_change_text(rate: RateChange) -> str:
    """Return a text such as "the pass rate fell by 15 points (from 95 % to 80 % of 100 runs; ...; p = 0.0003)"."""
    change, bounds = rate.new.share - rate.old.share, rate.interval
    ends = (bounds.low, bounds.high) if change > 0 else (-bounds.high, -bounds.low)
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


def claim_text(claim: weaker_checks.ClaimChange) -> str:
    """Return a text such as "passes: at least 80 %, was at least 90 %"."""
    if claim.kind == "removed":
        return f"{claim.claim}: removed from the gate, was {claim.old}"
    key = "confidence " if claim.kind == "confidence" else ""
    return f"{claim.claim}: {key}{claim.new}, was {claim.old}"
