"""The job summary of GitHub Actions: failures and their reasons first, passed scenarios folded, limited in size."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Final

from sim_action.core.files import append_whole
from sim_action.core.records import replace
from sim_action.core.wording import counted, shortened
from sim_action.recording.replay.replay_data import Replay
from sim_action.reports import ReportOptions, formatting
from sim_action.reports.display import INFORMATION, STATUS_DISPLAYS, RowStatus, display_of
from sim_action.reports.escaping import markdown_block, markdown_text
from sim_action.reports.gate_chances import chance_tables
from sim_action.reports.github.markdown import (
    MAX_IN_MESSAGE,
    code_of_link,
    dotted,
    fitting,
    folded,
    left_out_note,
    markdown_row,
    markdown_rows,
    markdown_table,
    message_text,
    paragraphs,
    size_of,
    source_link,
)
from sim_action.reports.github.mermaid_chart import chart, load_replay, signal_of_verdict
from sim_action.reports.links import reason_time, replay_link, rerun_command
from sim_action.reports.scenario_groups import ScenarioGroup, grouped_scenarios, worst_first
from sim_action.reports.table import NUMBERS, Row, Table, expectation_rows
from sim_action.results.outcome import ExpectationOutcome, Failure, Outcome
from sim_action.results.results_json import Results

MAX_BYTES: Final = 1 << 20  # the largest size of a summary; GitHub discards a larger one
_FRAME: Final = 4_000  # an upper bound for the size of headings, table heads, folds and remarks
# The share of all bytes that the overview may take; the rest is for the sections.
_OVERVIEW_SHARE: Final = 0.4
_MAX_UNFOLDED: Final = 20
_MAX_DRAWN: Final = 8  # the number of scenarios with charts of their failures; a page with many charts is slow


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
    groups = worst_first(grouped_scenarios(results.outcomes, results.gates))
    room = most_bytes - _FRAME
    if room < 0:
        return ""
    overview = (markdown_row(_OVERVIEW, _overview_row(group), options) for group in groups)
    rows = fitting(overview, int(room * _OVERVIEW_SHARE))
    written = (_scenario_section(group, options, drawn=number < _MAX_DRAWN) for number, group in enumerate(groups))
    sections = fitting(written, room - size_of(rows))
    unfolded = sum(group.status != "passed" for group in groups[: len(sections)])
    measured = "gates and scenarios" if results.gates else "scenarios"
    parts = [
        f"## {' '.join(formatting.run_headline(results))}",
        _counts(results, options.taken_over),
        *_overview(groups, rows),
        *sections[:unfolded],
        folded(f"Measurements of passed {measured} ({len(sections) - unfolded})", "\n\n".join(sections[unfolded:]))
        if len(sections) > unfolded
        else "",
        left_out_note(len(groups), len(sections), "scenario", _SIZE),
    ]
    return paragraphs(*parts) + "\n\n"


def _counts(results: Results, taken_over: int | None) -> str:
    versions = (f"sim-action {results.sim_action}", f"Python {results.python}", results.platform)
    version = " · ".join(map(markdown_text, versions))
    part = f" · {formatting.shard_text(results.shard)}" if results.shard else ""
    took = formatting.took_text(results, taken_over)
    earlier = "" if taken_over is None else f" · {formatting.taken_over_text(taken_over, results)}"
    return f"**{formatting.counts_text(results)}** in {took}{part}{earlier} · {version}"


def _overview(groups: list[ScenarioGroup], rows: list[str]) -> Iterable[str]:
    """Yield a table of all scenarios; if there are many, the passed ones are folded."""
    unfolded = len(rows)
    if unfolded > _MAX_UNFOLDED:
        unfolded = sum(group.status != "passed" for group in groups[:unfolded])
    yield markdown_rows(_OVERVIEW, rows[:unfolded])
    if rows[unfolded:]:
        yield folded(f"{counted(len(rows) - unfolded, 'scenario')} passed", markdown_rows(_OVERVIEW, rows[unfolded:]))
    yield left_out_note(len(groups), len(rows), "scenario", " in this table")


_OVERVIEW: Final = Table("Scenario", (), (" Sim time", " Speed"), message="Result")


def _overview_row(group: ScenarioGroup) -> Row:
    speed = "" if group.varies else formatting.speed_text(group.worst.real_time_factor).removesuffix(" real time")
    values = (formatting.moment(_total_sim_time(group)), speed)
    return Row(group.row_status, group.name, _group_gist(group), values, location=group.location, stands_out=True)


_SIZE: Final = " because GitHub limits the size; `results.json` contains all of them"
_MAX_ROWS: Final = 100
_MAX_FAILURES: Final = 20
_MAX_IN_BLOCK: Final = 4_000
_MAX_REMARKS: Final = 50
_MAX_CHARTS: Final = 2


def _scenario_section(group: ScenarioGroup, options: ReportOptions, *, drawn: bool = False) -> str:
    """Return the section of one scenario with folded details; `drawn`: with charts of failed expectations."""
    if group.is_gate:
        worst = [_outcome_section(run, options, drawn=drawn) for run in group.not_passed[:1]]
        return paragraphs(gate_section(group, options), *(folded("The worst run", section) for section in worst))
    return _varied(group, options, drawn=drawn) if group.varies else _outcome_section(group.worst, options, drawn=drawn)


def _group_gist(group: ScenarioGroup) -> str:
    """Return the most important fact about a scenario."""
    if group.is_gate:
        return group.ending
    if not group.varies:
        return _gist(group.worst)
    if group.status == "passed":
        return group.variations_text
    return f"{group.passed}; worst: {group.values(group.worst)} {_gist(group.worst)}"


def _total_sim_time(group: ScenarioGroup) -> float | None:
    times = [outcome.sim_time for outcome in group.outcomes if outcome.sim_time is not None]
    return sum(times) if times else None


def _varied(group: ScenarioGroup, options: ReportOptions, *, drawn: bool) -> str:
    """Return a table of the variations, with the passed ones folded, and the section of the worst variation."""
    ordered = group.worst_first()
    unhappy = [outcome for outcome in ordered if outcome.display_status != "passed"]
    rows = tuple(
        Row(outcome.display_status, group.values(outcome), _gist(outcome), (formatting.moment(outcome.sim_time),))
        for outcome in ordered[: max(len(unhappy), _MAX_ROWS)]
    )
    passed = f"{counted(len(ordered) - len(unhappy), 'variation')} that passed"
    bad, good = rows[: len(unhappy)][:_MAX_ROWS], rows[len(unhappy) :]
    table = Table("Variation", bad, (" Sim time",), message="Result", rest=good, rest_title=passed)
    parts = [
        f"### {STATUS_DISPLAYS[group.status].icon} {markdown_text(f'{group.name}: {group.variations_text}')}",
        dotted(source_link(options, group.location), markdown_text(group.engines)),
        markdown_table(table),
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
        f"**Timeline**: {message_text(happened)}" if (happened := formatting.timeline_text(outcome)) else "",
        _warnings(outcome, options),
        _expectations(outcome, options),
        _measurements(outcome, options),
        *(_charts(outcome, options) if drawn else ()),
        _reproduction(outcome, options),
        _run_details(outcome),
    ]
    return paragraphs(*parts)


def _charts(outcome: Outcome, options: ReportOptions) -> Iterator[str]:
    """Yield charts of expectations that did not hold; expectations that make the scenario fail come first."""
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
    return f"Run it again:\n\n{markdown_block(typed, 'sh')}"


def _gist(outcome: Outcome) -> str:
    if outcome.status == "skipped":
        return " ".join(outcome.notes)
    reasons = outcome.reasons or tuple(expected.message for expected in outcome.causes_first if expected.warned)
    reasons = reasons or tuple(map(str, outcome.warnings))
    if reasons:
        more = f" (and {len(reasons) - 1} more)" if len(reasons) > 1 else ""
        return shortened(reasons[0], MAX_IN_MESSAGE - len(more)) + more
    if len(outcome.expectations) == 1:
        return outcome.expectations[0].message
    return f"{len(outcome.expectations)} expectations held"


def _subtitle(outcome: Outcome, options: ReportOptions) -> str:
    simulated = formatting.simulated_text(outcome)
    ended = markdown_text(f"ended by: {outcome.end}") if outcome.end else ""
    engine = markdown_text(outcome.engine or "")
    speed = formatting.speed_text(outcome.real_time_factor)
    return dotted(
        source_link(options, outcome.location), simulated, ended, speed, engine, formatting.repeats_text(outcome)
    )


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
    first, rest = (expectation_rows(outcome, part[:_MAX_ROWS], options) for part in (missed, held))
    table = Table("Expectation", first or rest, NUMBERS, rest=rest if first else ())
    notes = (left_out_note(len(part), _MAX_ROWS, "expectation") for part in (missed, held))
    return paragraphs(
        markdown_table(replace(table, rest_title=f"{counted(len(held), 'expectation')} held"), options), *notes
    )


def _measurements(outcome: Outcome, options: ReportOptions) -> str:
    """Return a list of the values that were measured without a limit."""
    lines = [
        f"- {INFORMATION.icon} {f'`{bar}`' if bar else f'{markdown_text(measured.name)}:'} {message_text(message)}"
        f"{_replay_note(outcome, options, measured.time)}"
        for measured in outcome.measurements[:_MAX_ROWS]
        for bar, message in [formatting.measured_text(measured)]
    ]
    return paragraphs("\n".join(lines), left_out_note(len(outcome.measurements), _MAX_ROWS, "measurement"))


def _replay_note(outcome: Outcome, options: ReportOptions, time: float | None) -> str:
    link = replay_link(outcome, options, time)
    return f"<br>replay: {code_of_link(link)}" if link else ""


def _run_details(outcome: Outcome) -> str:
    items = [f"- {remark}" for remark in _remarks(outcome)]
    if output := formatting.user_output(outcome):
        items.append(f"\nOutput:\n\n{_ending_block(output)}")
    if not items:
        return ""
    return folded("Run details", "\n".join(items))


def _remarks(outcome: Outcome) -> Iterator[str]:
    for name, value in formatting.run_facts(outcome).items():
        yield f"{name}: {message_text(value)}"
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
    rows = tuple(
        Row(
            run.display_status,
            group.values(run),
            run.ending,
            (formatting.moment(run.sim_time),),
            replay=replay_link(run, options, reason_time(run)),
        )
        for run in bad[:_MAX_RUNS]
    )
    warnings, icon = list(_gate_warnings(group, options)), display_of(group.row_status).icon
    parts = [
        f"### {icon} {markdown_text(f'{group.name}: {group.rate_text or group.gate_text}')}",
        dotted(*_gate_subtitle(group, options)),
        *_gate_claims(group, options),
        f"{markdown_text(group.not_passed_text)}; the worst first:" if bad else "",
        markdown_table(Table("Run", rows, (" Sim time",), message="Result")),
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
    claims = expectation_rows(group.gate, group.gate.expectations)
    yield markdown_table(Table("Claim", claims, message="Found"), options)


# The statuses of the rows of a table of chances; a test that stops early also has the mean number of runs.
_OF_CHANCES: Final[tuple[RowStatus, ...]] = ("passed", "inconclusive", "failed", "information")


def _gate_chances(group: ScenarioGroup) -> str:
    """Return the verdicts that robots of known rates get from the gate, folded."""
    if group.planned is None:
        return ""
    (chances,) = chance_tables([group.planned])
    rows = (Row(status, row[0], values=row[1:]) for status, row in zip(_OF_CHANCES, chances.rows, strict=False))
    table = Table("A robot that is ... good", tuple(rows), tuple(f" {rate}" for rate in chances.columns))
    parts = [markdown_table(table), *map(markdown_text, chances.remarks)]
    return folded("The chances of robots with known rates", paragraphs(*parts))


def _gate_warnings(group: ScenarioGroup, options: ReportOptions) -> Iterator[str]:
    """Yield the entries of a list: each warning once for all runs."""
    icon = STATUS_DISPLAYS["warned"].icon
    for expected, share in group.warned:
        yield f"- {icon} {message_text(f'{expected.name}: {share}')}<br>{source_link(options, expected.location)}"
    for warning, runs in group.warnings:
        yield f"- {icon} {message_text(group.warning_text(warning, runs))}<br>{source_link(options, warning.location)}"
