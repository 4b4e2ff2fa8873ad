"""The job summary of GitHub Actions: failures and their reasons first, passed scenarios folded, limited in size."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Final

from sim_action.core.errors import ExitCode
from sim_action.core.files import append_whole
from sim_action.core.wording import counted, shortened
from sim_action.recording.replay.replay_data import Replay
from sim_action.reports import ReportOptions
from sim_action.reports.escaping import markdown_block, markdown_text
from sim_action.reports.formatting import (
    counts_text,
    moment,
    provenance_rows,
    quantity,
    repeats_text,
    shard_text,
    speed_text,
    taken_over_text,
    user_output,
)
from sim_action.reports.gate_chances import chance_tables
from sim_action.reports.github.markdown import (
    MAX_IN_MESSAGE,
    code,
    code_of_link,
    dotted,
    fitting,
    folded,
    left_out_note,
    message_text,
    paragraphs,
    row,
    shell_block,
    size_of,
    source_link,
    table,
    unwrapped,
)
from sim_action.reports.github.mermaid_chart import chart, load_replay, signal_of_verdict
from sim_action.reports.links import reason_time, replay_link, rerun_command
from sim_action.reports.scenario_groups import ScenarioGroup, grouped_scenarios, worst_first
from sim_action.reports.statuses import INFORMATION, STATUS_DISPLAYS
from sim_action.results.outcome import ExpectationOutcome, Failure, Outcome
from sim_action.results.results_json import Results

MAX_BYTES: Final = 1 << 20
"""The largest size of a summary; GitHub discards a larger one."""

# An upper bound for the size of headings, table heads, folds and remarks.
_FRAME: Final = 4_000
# The share of all bytes that the overview may take; the rest is for the sections.
_OVERVIEW_SHARE: Final = 0.4
_MAX_UNFOLDED: Final = 20
# The number of scenarios with charts of their failures; a page with many charts is slow.
_MAX_DRAWN: Final = 8


def write_summary(results: Results, options: ReportOptions) -> None:
    """Append the summary to the file named by `GITHUB_STEP_SUMMARY`, if it is set."""
    append_summary(lambda most_bytes: summary(results, options, most_bytes), options.environment)


def append_summary(text: Callable[[int], str], environment: Mapping[str, str]) -> None:
    """Append a text to the file named by `GITHUB_STEP_SUMMARY`, if it is set; `text` gets its largest size in bytes."""
    name = environment.get("GITHUB_STEP_SUMMARY")
    if not name:
        return
    file = Path(name)
    written = file.stat().st_size if file.exists() else 0
    append_whole(file, text(MAX_BYTES - written).encode("utf-8", errors="replace"))


def summary(results: Results, options: ReportOptions, most_bytes: int = MAX_BYTES) -> str:
    """Return the summary in at most `most_bytes`; the least important sections are omitted if they do not fit."""
    found = worst_first(grouped_scenarios(results.outcomes, results.gates))
    room = most_bytes - _FRAME
    if room < 0:
        return ""
    rows = fitting((_overview_row(group, options) for group in found), int(room * _OVERVIEW_SHARE))
    written = (_scenario_section(group, options, drawn=number < _MAX_DRAWN) for number, group in enumerate(found))
    sections = fitting(written, room - size_of(rows))
    unfolded = sum(group.status != "passed" for group in found[: len(sections)])
    measured = "gates and scenarios" if results.gates else "scenarios"
    parts = [
        f"## {_run_headline(results)}",
        _counts(results, options.taken_over),
        *_overview(found, rows),
        *sections[:unfolded],
        folded(f"Measurements of passed {measured} ({len(sections) - unfolded})", "\n\n".join(sections[unfolded:]))
        if len(sections) > unfolded
        else "",
        _unshown_scenarios(len(found) - len(sections)),
    ]
    return paragraphs(*parts) + "\n\n"


def _run_headline(results: Results) -> str:
    left = results.count("skipped")
    bad = results.total - results.count("passed") - left
    several, one = _nouns(results)
    if not results.total:
        return _headline_without_verdicts(results)
    if results.conclusion == "cancelled":
        return f"🛑 Interrupted: {results.count('passed')} of {results.total} {several} had passed"
    if left:
        return f"❌ {bad} of {results.total} {several} did not pass, and {left} were not run"
    if not bad:
        return f"✅ The {one} passed" if results.total == 1 else f"✅ All {results.total} {several} passed"
    return f"❌ The {one} did not pass" if results.total == 1 else f"❌ {bad} of {results.total} {several} did not pass"


def _headline_without_verdicts(results: Results) -> str:
    good = results.exit_code is ExitCode.PASSED
    if results.outcomes:
        runs = f"{counted(len(results.outcomes), 'run')} for sim-action merge"
        icon = INFORMATION.icon if good else "❌"
        return f"{icon} No verdicts here: {runs}" + ("" if good else ", and not all of them could run")
    return f"✅ No scenarios for {results.shard or 'this part'}" if good else "⚠️ No scenarios were run"


def _nouns(results: Results) -> tuple[str, str]:
    """Return the noun for the judged items, in the plural and in the singular."""
    gates = sum(outcome.statistics is not None for outcome in results.verdicts)
    if not gates:
        return "scenarios", "scenario"
    return ("gates", "gate") if gates == results.total else ("scenarios and gates", "gate")


def _counts(results: Results, taken_over: int | None) -> str:
    # The simulations of the earlier call took time, too.
    speed = f" ({speed_text(results.real_time_factor)})" if results.real_time_factor and not taken_over else ""
    versions = (f"sim-action {results.sim_action}", f"Python {results.python}", results.platform)
    version = " · ".join(map(markdown_text, versions))
    part = f" · {shard_text(results.shard)}" if results.shard else ""
    earlier = "" if taken_over is None else f" · {taken_over_text(taken_over, results)}"
    return f"**{counts_text(results)}** in {results.wall_time:.1f} s{speed}{part}{earlier} · {version}"


def _overview(found: list[ScenarioGroup], rows: list[str]) -> Iterable[str]:
    """Yield a table of all scenarios; if there are many, the passed ones are folded."""
    unfolded = len(rows)
    if unfolded > _MAX_UNFOLDED:
        unfolded = sum(group.status != "passed" for group in found[:unfolded])
    columns = ("", "Scenario", "Result", " Sim time", " Speed")
    if rows[:unfolded]:
        yield table(columns, rows[:unfolded])
    if rows[unfolded:]:
        yield folded(f"{counted(len(rows) - unfolded, 'scenario')} passed", table(columns, rows[unfolded:]))
    if len(found) > len(rows):
        left = len(found) - len(rows)
        yield f"_{counted(left, 'more scenario')} {'is' if left == 1 else 'are'} not shown in this table._"


def _overview_row(group: ScenarioGroup, options: ReportOptions) -> str:
    file = source_link(options, group.location)
    name = f"**{markdown_text(group.name)}**" + (f"<br><sub>{file}</sub>" if file else "")
    speed = "" if group.varies else speed_text(group.worst.real_time_factor).removesuffix(" real time")
    return row(group.display.icon, name, _group_gist(group), unwrapped(moment(_total_sim_time(group))), speed)


def _unshown_scenarios(count: int) -> str:
    if not count:
        return ""
    left = f"{counted(count, 'more scenario')} {'is' if count == 1 else 'are'} not shown"
    return f"_{left} because GitHub limits the size; `results.json` contains all of them._"


_MAX_ROWS: Final = 100
_MAX_FAILURES: Final = 20
_MAX_IN_BLOCK: Final = 4_000
_MAX_REMARKS: Final = 50
_MAX_CHARTS: Final = 2
_DIGEST_DIGITS: Final = 12


def _scenario_section(group: ScenarioGroup, options: ReportOptions, *, drawn: bool = False) -> str:
    """Return the section of one scenario: heading, failures, expectations, and folded details of the run.

    With `drawn`, failed expectations are also shown as charts if the run has stored their signals.
    """
    if group.gate is not None or group.is_part:
        worst = [_outcome_section(run, options, drawn=drawn) for run in group.not_passed[:1]]
        return paragraphs(gate_section(group, options), *(folded("The worst run", section) for section in worst))
    return _varied(group, options, drawn=drawn) if group.varies else _outcome_section(group.worst, options, drawn=drawn)


def _group_gist(group: ScenarioGroup) -> str:
    """Return the most important fact about a scenario as Markdown."""
    if group.gate is not None or group.is_part:
        return message_text(group.ending)
    if not group.varies:
        return _gist(group.worst)
    if group.status == "passed":
        return _variations_headline(group)
    return f"{group.passed}; worst: {markdown_text(group.values(group.worst))} {_gist(group.worst)}"


def _variations_headline(group: ScenarioGroup) -> str:
    worst = f"; worst: {markdown_text(group.worst_text)}" if group.status != "skipped" else ""
    return f"{group.passed}{worst}"


def _total_sim_time(group: ScenarioGroup) -> float | None:
    times = [outcome.sim_time for outcome in group.outcomes if outcome.sim_time is not None]
    return sum(times) if times else None


def _varied(group: ScenarioGroup, options: ReportOptions, *, drawn: bool) -> str:
    """Return a table of the variations, with the passed ones folded, and the section of the worst variation."""
    ordered = group.worst_first()
    unhappy = [outcome for outcome in ordered if outcome.display_status != "passed"]
    rows = [
        row(
            STATUS_DISPLAYS[outcome.display_status].icon,
            markdown_text(group.values(outcome)),
            _gist(outcome),
            unwrapped(moment(outcome.sim_time)),
        )
        for outcome in ordered[: max(len(unhappy), _MAX_ROWS)]
    ]
    columns = ("", "Variation", "Result", " Sim time")
    passed = f"{counted(len(ordered) - len(unhappy), 'variation')} that passed"
    bad, good = rows[: len(unhappy)][:_MAX_ROWS], rows[len(unhappy) :]
    parts = [
        f"### {STATUS_DISPLAYS[group.status].icon} {markdown_text(group.name)}: {_variations_headline(group)}",
        dotted(source_link(options, group.location), markdown_text(group.engines)),
        table(columns, bad) if bad else "",
        folded(passed, table(columns, good)) if good else "",
        left_out_note(len(ordered), len(bad) + len(good), "variation"),
        _outcome_section(group.worst, options, drawn=drawn) if group.status not in ("passed", "skipped") else "",
    ]
    return paragraphs(*parts)


def _outcome_section(outcome: Outcome, options: ReportOptions, *, drawn: bool) -> str:
    parts = [
        f"### {STATUS_DISPLAYS[outcome.display_status].icon} {markdown_text(outcome.name)}",
        _subtitle(outcome, options),
        *(_failure_text(failure, options) for failure in outcome.failures[:_MAX_FAILURES]),
        left_out_note(len(outcome.failures), _MAX_FAILURES, "error"),
        _warnings(outcome, options),
        _expectations(outcome, options),
        _measurements(outcome, options),
        *(_charts(outcome, options) if drawn else ()),
        _reproduction(outcome, options),
        _run_details(outcome),
    ]
    return paragraphs(*parts)


def _charts(outcome: Outcome, options: ReportOptions) -> Iterator[str]:
    """Yield charts of expectations that did not hold, beginning with those that make the scenario fail."""
    numbered = sorted(enumerate(outcome.expectations), key=lambda pair: (pair[1].verdict.cut_off, not pair[1].failed))
    missed = [(number, expected) for number, expected in numbered if expected.status != "passed"]
    replay = load_replay(outcome, options) if missed else None
    drawings = (_chart(replay, number, expected) for number, expected in missed) if replay else ()
    yield from islice((drawing for drawing in drawings if drawing), _MAX_CHARTS)


def _chart(replay: Replay, number: int, expected: ExpectationOutcome) -> str:
    signal = signal_of_verdict(replay, number, expected.verdict)
    drawing = "" if signal is None else chart(signal, expected.verdict.time)
    return f"**{markdown_text(expected.name)}** over time:\n\n{drawing}" if drawing else ""


def _reproduction(outcome: Outcome, options: ReportOptions) -> str:
    if outcome.display_status in ("passed", "skipped") or not (typed := rerun_command(outcome, options)):
        return ""
    return f"Run it again:\n\n{shell_block(typed)}"


def _gist(outcome: Outcome) -> str:
    if outcome.status == "skipped":
        return message_text(" ".join(outcome.notes))
    reasons = [f"{failure.title}: {failure.message}" for failure in outcome.failures]
    reasons += [expected.verdict.message for expected in outcome.causes]
    reasons += map(str, outcome.failing_warnings)
    reasons = reasons or [expected.verdict.message for expected in outcome.causes_first if expected.warned]
    reasons = reasons or [str(warning) for warning in outcome.warnings]
    if reasons:
        more = f" <sub>(and {len(reasons) - 1} more)</sub>" if len(reasons) > 1 else ""
        return message_text(reasons[0]) + more
    if len(outcome.expectations) == 1:
        return message_text(outcome.expectations[0].verdict.message)
    return f"{len(outcome.expectations)} expectations held"


def _subtitle(outcome: Outcome, options: ReportOptions) -> str:
    simulated = f"{moment(outcome.sim_time)} simulated" if outcome.sim_time is not None else ""
    ended = markdown_text(f"ended by: {outcome.end}") if outcome.end else ""
    engine, speed = markdown_text(outcome.engine or ""), speed_text(outcome.real_time_factor)
    return dotted(source_link(options, outcome.location), simulated, ended, speed, engine, repeats_text(outcome))


def _failure_text(failure: Failure, options: ReportOptions) -> str:
    said = f"**{markdown_text(shortened(failure.title, MAX_IN_MESSAGE))}**: {message_text(failure.message)}"
    if failure.location is not None:
        said += f"<br>\n{source_link(options, failure.location)}"
    if failure.details.strip():
        said += f"\n\nDetails:\n\n{_ending_block(failure.details)}"
    return said


def _warnings(outcome: Outcome, options: ReportOptions) -> str:
    """Return a list of the warnings of the audit."""
    icon = STATUS_DISPLAYS["failed" if outcome.strict else "warned"].icon
    lines = [
        f"- {icon} {message_text(str(warning))}<br>{source_link(options, warning.location)}"
        for warning in outcome.warnings[:_MAX_ROWS]
    ]
    return paragraphs("\n".join(lines), left_out_note(len(outcome.warnings), _MAX_ROWS, "warning"))


def _expectations(outcome: Outcome, options: ReportOptions) -> str:
    """Return a table of the expectations that did not hold; the others are folded, or shown if all held."""
    missed = outcome.not_passed
    held = [expected for expected in outcome.expectations if expected.status == "passed"]
    if not missed or not held:
        return _table(outcome, missed or held, options)
    fold = folded(f"{counted(len(held), 'expectation')} held", _table(outcome, held, options))
    return paragraphs(_table(outcome, missed, options), fold)


def _measurements(outcome: Outcome, options: ReportOptions) -> str:
    """Return a list of the values that were measured without a limit."""
    lines = [
        f"- {INFORMATION.icon} {markdown_text(measured.name)}: {message_text(measured.message)}"
        f"{_replay_note(outcome, options, measured.time)}"
        for measured in outcome.measurements[:_MAX_ROWS]
    ]
    return paragraphs("\n".join(lines), left_out_note(len(outcome.measurements), _MAX_ROWS, "measurement"))


def _replay_note(outcome: Outcome, options: ReportOptions, time: float | None) -> str:
    link = replay_link(outcome, options, time)
    return f"<br>replay: {code_of_link(link)}" if link else ""


def _table(outcome: Outcome, expectations: Sequence[ExpectationOutcome], options: ReportOptions) -> str:
    if not expectations:
        return ""
    rows = (_row(outcome, expected, options) for expected in expectations[:_MAX_ROWS])
    columns = ("", "Expectation", " Measured", " Limit", " Margin", " At")
    return paragraphs(table(columns, rows), left_out_note(len(expectations), _MAX_ROWS, "expectation"))


def _row(outcome: Outcome, expected: ExpectationOutcome, options: ReportOptions) -> str:
    verdict = expected.verdict
    icon = STATUS_DISPLAYS[expected.display_status].icon
    what = f"**{markdown_text(expected.name)}**<br>{message_text(outcome.message_of(expected))}"
    if expected.status != "passed":
        what += f"<br>{source_link(options, expected.location)}{_replay_note(outcome, options, verdict.time)}"
    numbers = (quantity(value, verdict.unit) for value in (verdict.measured, verdict.limit, verdict.margin))
    return row(icon, what, *map(unwrapped, numbers), unwrapped(moment(verdict.time)))


def _run_details(outcome: Outcome) -> str:
    items = [f"- {remark}" for remark in _remarks(outcome)]
    if output := user_output(outcome):
        items.append(f"\nOutput:\n\n{_ending_block(output)}")
    if not items:
        return ""
    return folded("Run details", "\n".join(items))


def _remarks(outcome: Outcome) -> Iterator[str]:
    for name, told in provenance_rows(outcome.provenance).items():
        yield f"{name}: {markdown_text(told)}"
    if outcome.seed is not None:
        yield f"seed: {outcome.seed}"
    if outcome.digest:
        yield f"digest: {code(outcome.digest[:_DIGEST_DIGITS])}"
    for varied in outcome.variation:
        yield f"{code(varied.key)}: {code(json.dumps(varied.value))}"
    if outcome.trace:
        yield f"trace: {code(outcome.trace)}"
    for note in (*outcome.model_notes, *outcome.notes)[:_MAX_REMARKS]:
        yield f"note: {message_text(note)}"
    for diagnostic in outcome.diagnostics[:_MAX_REMARKS]:
        yield f"engine {diagnostic.level}: {message_text(diagnostic.message)}"


def _ending_block(text: str) -> str:
    return markdown_block(text if len(text) <= _MAX_IN_BLOCK else f"…{text[-_MAX_IN_BLOCK:]}")


_MAX_RUNS: Final = 10
_MAX_WARNINGS: Final = 20


def gate_section(group: ScenarioGroup, options: ReportOptions) -> str:
    """Return the section of a gate, or of runs that another call judges, without the details of any run."""
    bad = group.not_passed
    rows = [_gate_run_row(group, run, options) for run in bad[:_MAX_RUNS]]
    warnings = list(_gate_warnings(group, options))
    parts = [
        f"### {group.display.icon} {markdown_text(group.name)}: {markdown_text(group.rate_text or group.gate_text)}",
        dotted(*_gate_subtitle(group, options)),
        *_gate_claims(group, options),
        f"{markdown_text(group.not_passed_text)}; the worst first:" if bad else "",
        table(("Run", "Result", " Sim time"), rows) if rows else "",
        left_out_note(len(bad), _MAX_RUNS, "run"),
        "\n".join(warnings[:_MAX_WARNINGS]),
        left_out_note(len(warnings), _MAX_WARNINGS, "warning"),
        _gate_chances(group),
    ]
    return paragraphs(*parts)


def _gate_subtitle(group: ScenarioGroup, options: ReportOptions) -> Iterator[str]:
    yield source_link(options, group.location)
    yield markdown_text(group.engines)
    if group.rate_text:
        yield markdown_text(group.gate_text)


def _gate_claims(group: ScenarioGroup, options: ReportOptions) -> Iterator[str]:
    """Yield the reasons why the gate has no verdict, and a table of its claims."""
    if group.gate is None:
        if group.could_not_run:
            yield message_text(group.ending)
        return
    for failure in group.gate.failures:
        place = "" if failure.location is None else f"<br>\n{source_link(options, failure.location)}"
        yield f"**{message_text(failure.title)}**: {message_text(failure.message)}{place}"
    if group.gate.expectations:
        found = (
            row(
                STATUS_DISPLAYS[expected.status].icon,
                f"**{markdown_text(expected.name)}**<br>{source_link(options, expected.location)}",
                message_text(expected.verdict.message),
            )
            for expected in group.gate.expectations
        )
        yield table(("", "Claim", "Found"), found)


def _gate_chances(group: ScenarioGroup) -> str:
    """Return the verdicts that robots of known rates get from the gate, folded."""
    if group.planned is None:
        return ""
    (told,) = chance_tables([group.planned])
    rows = (row(*map(markdown_text, each)) for each in told.rows)
    columns = ("A robot that is ... good", *(f" {rate}" for rate in told.columns))
    parts = [table(columns, rows) if told.rows else "", *map(markdown_text, told.remarks)]
    return folded("The chances of robots with known rates", paragraphs(*parts))


def _gate_run_row(group: ScenarioGroup, run: Outcome, options: ReportOptions) -> str:
    seen = _replay_note(run, options, reason_time(run))
    return row(markdown_text(group.values(run)), f"{message_text(run.ending)}{seen}", unwrapped(moment(run.sim_time)))


def _gate_warnings(group: ScenarioGroup, options: ReportOptions) -> Iterator[str]:
    """Yield the entries of a list: each warning once for all runs."""
    icon = STATUS_DISPLAYS["warned"].icon
    for expected, run, runs in group.warned:
        seen = message_text(f"{expected.name}: {group.share_text(run, expected, runs)}")
        yield f"- {icon} {seen}<br>{source_link(options, expected.location)}"
    for warning, runs in group.warnings:
        yield f"- {icon} {message_text(group.warning_text(warning, runs))}<br>{source_link(options, warning.location)}"
