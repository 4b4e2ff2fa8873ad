"""Tables of the names that a scenario can use, of audit rules, recordings and exit codes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import get_args

from sim_action.app import catalogue
from sim_action.app.catalogue import Entry, FieldEntry
from sim_action.cli.pyproject_keys import Defaults
from sim_action.core.errors import ExitCode
from sim_action.core.permissions import PRIVILEGED_BY_REASON
from sim_action.recording.export import EXPORTS
from sim_action.reports.display import STATUS_DISPLAYS, StatusDisplay
from sim_action.results.outcome import WORST_FIRST, DisplayStatus, Failure, FailureKind, Outcome, Status
from sim_action.robot.documents.part_table import ALL, Format, PartRow, part_table
from sim_action.robot.model.findings import RULES
from sim_action.runner.mutation.planning import TABLE as MUTANTS
from sim_action.scenario.child_environment import PASSED
from sim_action.state.readings import READING_COLUMNS, ReadingColumn
from sim_action.world.claims import RULES as CLAIM_RULES
from tools.docs.generators.markdown import bullets, escaped, table

EXIT_CODES = {
    ExitCode.PASSED: "all scenarios passed",
    ExitCode.FAILED: "a scenario failed, is flaky, was not exercised, or has no verdict (crash, limit or "
    "script error); a gate failed or is inconclusive",
    ExitCode.INVALID: "a scenario or the command line is invalid, or a result is missing",
    ExitCode.INTERNAL: "an internal error of sim-action",
    ExitCode.NO_SCENARIO: "no scenario found",
    ExitCode.INTERRUPTED: "interrupted",
}
_SETTABLE, _COMPARED = " (s)", " (r)"
LEVELS = {
    "fatal": "refused",
    "error": "refused, unless allowed",
    "warning": "a note",
    "harmless": "listed by `inspect --losses`",
}


def entries(family: Iterable[Entry], kind: str) -> str:
    """Return a table of names and summaries."""
    return table((kind, "meaning"), ((f"`{entry.name}`", entry.summary) for entry in family))


def passed_variables() -> str:
    """Return the table of environment variables that code of the repository sees."""
    return bullets(
        (f"{group.purpose}{_SETTABLE * group.may_be_set}{_COMPARED * group.is_compared}", _listed(group.names))
        for group in PASSED
    )


def privileged_events() -> str:
    """Return the table of events on which code of the repository is not run."""
    return table(("events", "reason"), ((_listed(names), reason) for reason, names in PRIVILEGED_BY_REASON.items()))


def _listed(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


def rules() -> str:
    """Return the lists of audit rules."""
    return _by_level({name: (rule.summary, LEVELS[rule.level]) for name, rule in RULES.items()})


def parts(name: Format) -> str:
    """Return the parts of a format that are refused or reported, by the reason."""
    # The rows of worlds are those in which they differ from SDF.
    shared = part_table("sdf").places if name == "world" else {}
    places: dict[PartRow, list[str]] = {}
    for place, by_name in part_table(name).places.items():
        for row in dict.fromkeys(by_name.values()):
            if row.effect != "read" and row not in shared.get(place, {}).values():
                at = "" if place == ALL else f"{place}/"
                places.setdefault(row, []).append(", ".join(f"`{at}{part}`" for part in row.names))
    by_effect: dict[str, dict[str, list[str]]] = {"refused": {}, "reported": {}, "moving": {}}
    for row, names in places.items():
        if row.effect in by_effect:  # harmless parts are listed by `inspect --losses`
            by_effect[row.effect].setdefault(escaped(row.text.replace("{} of ", "")), []).extend(names)
    return "\n".join(
        f"**{effect}**\n\n" + bullets((", ".join(dict.fromkeys(names)), text) for text, names in rows.items())
        for effect, rows in by_effect.items()
        if rows
    )


def claim_rules() -> str:
    """Return the lists of the rules of claims."""
    effects = {"error": "refused, unless allowed", "warning": "a warning"}
    return _by_level({name: (rule.summary, effects[rule.level]) for name, rule in CLAIM_RULES.items()})


def _by_level(rules: Mapping[str, tuple[str, str]]) -> str:
    """Return the lists of rules with one effect each; the message of a refusal explains its rule."""
    by_effect: dict[str, list[tuple[str, str]]] = {}
    for name, (summary, effect) in rules.items():
        by_effect.setdefault(effect, []).append((f"`{name}`", summary))
    return "\n".join(
        f"{effect[:1].upper()}{effect[1:]}"
        + (f": {', '.join(name for name, _ in listed)}.\n" if effect == "refused" else f":\n\n{bullets(listed)}")
        for effect, listed in by_effect.items()
    )


def recordings() -> str:
    """Return the table of recording formats: the first sentence of each, and the extra that it needs."""
    rows = []
    for name in EXPORTS:
        export = EXPORTS.load(name)
        summary = " ".join((export.__doc__ or "").split("\n\n")[0].split())
        rows.append((f"`{name}`", summary, f"`{export.extra}`" if export.extra else ""))
    return table(("format", "content", "extra"), rows)


def exit_codes() -> str:
    """Return the table of exit codes."""
    return table(("code", "meaning"), ((str(code.value), text) for code, text in EXIT_CODES.items()))


def mutants() -> str:
    """Return the table of mutants of `sim-action prove`, the most telling first."""
    return bullets((f"`{row.kind}`", row.words) for row in MUTANTS)


def statuses() -> str:
    """Return the table of statuses, the worst first, with their display in each report."""
    ranked = sorted(WORST_FIRST, key=lambda status: status == "skipped")
    rows = (_status_row(status, STATUS_DISPLAYS[status]) for status in ranked)
    return table(("status", "symbol", "meaning", "exit code", "JUnit element", "annotation"), rows)


def _status_row(status: DisplayStatus, display: StatusDisplay) -> tuple[str, ...]:
    # "warned" is a display of "passed": results.json and JUnit have no such status.
    in_results: Status = "passed" if status == "warned" else status
    kinds = get_args(FailureKind) if status == "error" else ()
    outcome = Outcome(name="a", file="a", status=in_results)
    failures = (Failure(kind=kind, title=kind, message=kind) for kind in kinds)
    failed = [outcome.model_copy(update={"failures": (failure,)}) for failure in failures]
    codes = {failure.exit_code for failure in failed or [outcome]}
    shown = f"`{in_results}`" if status == in_results else f"`{in_results}` with a warning"
    element = f"`{display.junit}`" if display.junit else ""
    symbols = f"`{display.symbol}` {display.icon}"
    return shown, symbols, display.meaning, _any_of(sorted(codes)), element, display.level or ""


def _any_of(codes: Sequence[ExitCode]) -> str:
    *first, last = (str(code.value) for code in codes)
    return f"{', '.join(first)} or {last}" if first else last


def defaults() -> str:
    """Return the table of the keys below [tool.sim-action]."""
    fields: Iterable[FieldEntry] = catalogue.fields(Defaults)
    return bullets((f"`{f.name}`", f"{f.takes}; {f.description}") for f in fields)


def models() -> str:
    """Return the table of built-in robots."""
    return table(("robot", "description"), ((f"`{e.name}`", e.summary) for e in catalogue.models()))


def reading_columns() -> str:
    """Return the table of the columns that a trace keeps for each kind of sensor."""
    rows = []
    for kind, columns in READING_COLUMNS.items():
        shown = (f"`{name}` ({_shape(column)})" for name, column in columns.items())
        rows.append((f"`{kind}`", ", ".join(shown)))
    return table(("sensor", "columns of n readings"), rows)


def _shape(column: ReadingColumn) -> str:
    shape = "n, ..." if column.many else f"n, {len(column.axes)}" if column.axes else "n"
    return f"{shape}; {column.dimension.si}" if column.dimension.si else shape
