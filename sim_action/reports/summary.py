"""The job summary of GitHub Actions: what failed and why at first sight, the rest folded; never over the size limit."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Final

from sim_action.core.errors import ExitCode
from sim_action.core.messages import counted
from sim_action.reports import ReportOptions
from sim_action.reports.escaping import markdown_text
from sim_action.reports.groups import Group, groups, worst_first
from sim_action.reports.markdown import folded, row, source_link, table
from sim_action.reports.summary_section import ICONS, gist, section, sim_time
from sim_action.reports.wording import counts, factor, moment, share
from sim_action.results.file import Results

MOST_BYTES: Final = 1 << 20
"""GitHub drops a larger summary whole."""

# What headings, table heads, folds and remarks on what is left out take at most.
_FRAME: Final = 4_000
# Of all bytes, how many the overview may take; what it leaves is for the sections.
_OVERVIEW_SHARE: Final = 0.4
_MOST_UNFOLDED: Final = 20
# Scenarios whose failures are drawn: a page of charts is slow, and nobody looks at all of them.
_MOST_DRAWN: Final = 8


def write_summary(results: Results, options: ReportOptions) -> None:
    """Appends the summary to the file behind `GITHUB_STEP_SUMMARY`, if there is one."""
    name = options.environment.get("GITHUB_STEP_SUMMARY")
    if not name:
        return
    file = Path(name)
    written = file.stat().st_size if file.exists() else 0
    text = summary(results, options, MOST_BYTES - written)
    with file.open("ab") as stream:
        stream.write(text.encode("utf-8", errors="replace"))


def summary(results: Results, options: ReportOptions, most_bytes: int = MOST_BYTES) -> str:
    """The summary, in at most so many bytes; what does not fit is left out from the end, where the harmless stands."""
    found, room = worst_first(groups(results.outcomes)), most_bytes - _FRAME
    if room < 0:
        return ""
    rows = _fitting((_overview_row(group, options) for group in found), int(room * _OVERVIEW_SHARE))
    written = (section(group, options, drawn=number < _MOST_DRAWN) for number, group in enumerate(found))
    sections = _fitting(written, room - _size(rows))
    unfolded = sum(group.mood != "passed" for group in found[: len(sections)])
    parts = [
        f"## {_headline(results)}",
        _counts(results),
        *_overview(found, rows),
        *sections[:unfolded],
        folded(f"Measurements of what passed ({len(sections) - unfolded})", "\n\n".join(sections[unfolded:]))
        if len(sections) > unfolded
        else "",
        _left_out(len(found) - len(sections)),
    ]
    return "\n\n".join(part for part in parts if part) + "\n\n"


def _headline(results: Results) -> str:
    left = results.count("skipped")
    bad = results.total - results.count("passed") - left
    if not results.total:
        if results.exit_code is ExitCode.PASSED:
            return f"✅ No scenario is left for {results.shard or 'this part'}"
        return "⚠️ No scenario was run"
    if results.conclusion == "cancelled":
        return f"🛑 Interrupted: {results.count('passed')} of {results.total} scenarios had passed"
    if left:
        return f"❌ {bad} of {results.total} scenarios did not pass, and {left} were not run"
    if not bad:
        return "✅ The scenario passed" if results.total == 1 else f"✅ All {results.total} scenarios passed"
    return (
        "❌ The scenario did not pass" if results.total == 1 else f"❌ {bad} of {results.total} scenarios did not pass"
    )


def _counts(results: Results) -> str:
    speed = f" ({factor(results.real_time_factor)})" if results.real_time_factor else ""
    versions = (f"sim-action {results.sim_action}", f"Python {results.python}", results.platform)
    version = " · ".join(map(markdown_text, versions))
    part = f" · {share(results.shard)}" if results.shard else ""
    return f"**{counts(results)}** in {results.wall_time:.1f} s{speed}{part} · {version}"


def _overview(found: list[Group], rows: list[str]) -> Iterable[str]:
    """One table of all; of many scenarios, those that passed are folded."""
    unfolded = len(rows)
    if unfolded > _MOST_UNFOLDED:
        unfolded = sum(group.mood != "passed" for group in found[:unfolded])
    columns = ("", "Scenario", "What happened", " Sim time", " Speed")
    if rows[:unfolded]:
        yield table(columns, rows[:unfolded])
    if rows[unfolded:]:
        yield folded(f"{counted(len(rows) - unfolded, 'scenario')} passed", table(columns, rows[unfolded:]))
    if len(found) > len(rows):
        left = len(found) - len(rows)
        yield f"_{counted(left, 'more scenario')} {'is' if left == 1 else 'are'} left out of this table._"


def _overview_row(group: Group, options: ReportOptions) -> str:
    file = source_link(options, group.location)
    name = f"**{markdown_text(group.name)}**" + (f"<br><sub>{file}</sub>" if file else "")
    speed = "" if group.varies else factor(group.worst.real_time_factor).removesuffix(" real time")
    return row(ICONS[group.mood], name, gist(group), moment(sim_time(group)), speed)


def _fitting(written: Iterable[str], most_bytes: int) -> list[str]:
    """What is written of the first scenarios, as many as there is room for."""
    texts: list[str] = []
    for text in written:
        most_bytes -= _size([text])
        if most_bytes < 0:
            break
        texts.append(text)
    return texts


def _size(texts: list[str]) -> int:
    """In bytes, with the line ends that come between."""
    return sum(len(text.encode("utf-8", errors="replace")) + 2 for text in texts)


def _left_out(count: int) -> str:
    if not count:
        return ""
    left = f"{counted(count, 'more scenario')} {'is' if count == 1 else 'are'} left out here"
    return f"_{left}, as GitHub shows no more; `results.json` has them all._"
