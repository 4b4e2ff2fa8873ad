"""Annotations: workflow commands that show a failure at its line of a file."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

from sim_action.core.errors import Location
from sim_action.core.records import dataclass, replace
from sim_action.core.wording import log_line, shortened
from sim_action.reports import ReportOptions
from sim_action.reports.display import STATUS_DISPLAYS, Level
from sim_action.reports.escaping import command_data, command_property, log_text, one_line, shortened_command
from sim_action.reports.formatting import moment
from sim_action.reports.links import reason_time, relative_path, replay_link
from sim_action.reports.scenario_groups import ScenarioGroup, grouped_scenarios, relative_margin, worst_first
from sim_action.results.outcome import Outcome
from sim_action.results.results_json import Results

_MAX_ANNOTATIONS: Final = 10  # the number of annotations that GitHub shows for each level and step
MAX_CHARACTERS: Final = 4096
_MAX_IN_TITLE: Final = 200


@dataclass(frozen=True, slots=True)
class Annotation:
    """One annotation with unescaped texts."""

    level: Level
    title: str
    message: str
    location: Location | None = None

    def command(self, workspace: Path) -> str:
        """Return the workflow command on one line; paths are relative to the workspace."""
        properties = {"title": shortened(one_line(self.title), _MAX_IN_TITLE)}
        if self.location is not None:
            line, column = self.location.line, self.location.column
            place = {"file": relative_path(workspace, self.location.file), "line": line, "col": column}
            properties = {name: str(value) for name, value in place.items() if value is not None} | properties
        start = f"::{self.level} {','.join(f'{name}={command_property(text)}' for name, text in properties.items())}::"
        return start + shortened_command(command_data(self.message), max(1, MAX_CHARACTERS - len(start)))


def complaint(message: str, environment: Mapping[str, str]) -> str:
    """Return the error line of a call that ran nothing; on GitHub it is an annotation, as there is no other report."""
    if environment.get("GITHUB_ACTIONS") == "true":
        return log_text(Annotation("error", "sim-action", message).command(Path()), "utf-8")
    return log_line(f"sim-action: {message}")


def write_annotations(results: Results, options: ReportOptions) -> None:
    """Print the annotations, the worst first, if this is GitHub Actions."""
    if options.environment.get("GITHUB_ACTIONS") != "true":
        return
    ordered = worst_first(grouped_scenarios(results.outcomes, results.gates))
    all_annotations = [annotation for group in ordered for annotation in _of_group(group, options)]
    print_annotations(all_annotations, options)


def print_annotations(all_annotations: Sequence[Annotation], options: ReportOptions) -> None:
    """Print errors, then warnings: as many as GitHub shows. The last one of each counts the rest."""
    encoding = sys.stdout.encoding or "utf-8"
    for annotation in (*_limited(all_annotations, "error"), *_limited(all_annotations, "warning")):
        sys.stdout.write(log_text(annotation.command(options.workspace), encoding) + "\n")
    sys.stdout.flush()


def _of_group(group: ScenarioGroup, options: ReportOptions) -> Iterator[Annotation]:
    if group.is_gate:
        return _of_gate(group, options)
    if group.varies:
        return _of_variations(group, options)
    return (annotation for annotation, _ in _annotations(group.name, group.worst, options))


def _of_gate(group: ScenarioGroup, options: ReportOptions) -> Iterator[Annotation]:
    """Yield one annotation for a gate that did not pass, and one for each warning of its runs."""
    level = STATUS_DISPLAYS[group.status].level
    if level == "error":
        stopped = next(iter(group.could_not_run), group.outcomes[0]) if group.gate is None else group.gate
        places = [failure.location for failure in stopped.failures] + [claim.location for claim in stopped.causes]
        message = group.ending
        for run in group.not_passed[:1] if group.gate is not None else ():
            replayed = _replayed(run, options, reason_time(run))
            message += f"; the worst run, {group.values(run)}: {run.ending}{replayed}"
        place = next(filter(None, places), stopped.location if group.planned is None else group.planned.location)
        yield Annotation(level, f"{group.name}: {STATUS_DISPLAYS[group.status].word}", message, place)
    for expected, message in group.warned:
        yield Annotation("warning", f"{group.name}: {expected.name}", message, expected.location)
    for warning, runs in group.warnings:
        message = group.warning_text(warning, runs)
        yield Annotation("warning", f"{group.name}: {warning.rule}", message, warning.location)


def _of_variations(group: ScenarioGroup, options: ReportOptions) -> Iterator[Annotation]:
    """Yield one annotation for all variations with the same failure, with the message of the worst one."""
    same: dict[tuple[str, str, Location | None], list[tuple[float, str, Annotation]]] = {}
    for outcome in group.worst_first():
        for annotation, margin in _annotations(group.name, outcome, options):
            alike = same.setdefault((annotation.level, annotation.title, annotation.location), [])
            alike.append((margin, group.values(outcome), annotation))
    for alike in same.values():
        _, values, worst = min(alike, key=lambda run: run[0])
        count = f"{len(alike)} of {len(group.outcomes)} variations"
        message = f"{count}; the worst, {values}: {worst.message}" if len(alike) > 1 else f"{values}: {worst.message}"
        yield replace(worst, message=message)


def _annotations(name: str, outcome: Outcome, options: ReportOptions) -> Iterator[tuple[Annotation, float]]:
    """Yield an annotation and its relative margin for each failure, expectation that did not hold, and warning."""
    for failure in outcome.failures:
        where = failure.location or outcome.location
        message = failure.message + _replayed(outcome, options, failure.time)
        yield Annotation("error", f"{name}: {failure.title}", message, where), 0.0
    for expected in outcome.causes_first:
        level = STATUS_DISPLAYS[expected.display_status].level
        if level is None:
            continue
        message = expected.verdict.message + _replayed(outcome, options, expected.verdict.time)
        annotation = Annotation(level, f"{name}: {expected.name}", message, expected.location)
        yield annotation, relative_margin(expected)
    for warning in outcome.warnings:
        level = "error" if outcome.strict else "warning"
        yield Annotation(level, f"{name}: {warning.rule}", warning.message, warning.location), 0.0


def _replayed(outcome: Outcome, options: ReportOptions, time: float | None) -> str:
    link = replay_link(outcome, options, time)
    return f" (replay{'' if time is None else f' at {moment(time)}'}: {link})" if link else ""


def _limited(all_annotations: Sequence[Annotation], level: Level) -> list[Annotation]:
    """Return at most as many annotations as GitHub shows; the last one counts the rest."""
    chosen = [annotation for annotation in all_annotations if annotation.level == level]
    if len(chosen) <= _MAX_ANNOTATIONS:
        return chosen
    shown = chosen[: _MAX_ANNOTATIONS - 1]
    more = f"{len(chosen) - len(shown)} more {level}s: see the job summary"
    return [*shown, Annotation(level, "sim-action", more)]
