"""How a scenario ran: the command that repeats it, versions, notes, what the engine and the user's code said."""

from __future__ import annotations

from collections.abc import Sequence

from sim_action.reports import ReportOptions
from sim_action.reports.page.markup import Html, element, joined
from sim_action.reports.reproduction import command
from sim_action.reports.wording import factor, made_with, own_output, quantity, repeated
from sim_action.results.file import Results
from sim_action.results.outcome import Outcome

_MOST_LINES = 200


def details(outcome: Outcome, results: Results, options: ReportOptions) -> Html:
    """The command that runs it again, what it ran on, and what was said meanwhile."""
    said = [(diagnostic.level, diagnostic.message) for diagnostic in outcome.diagnostics]
    return joined(
        _again(outcome, options),
        _said("Engine", said),
        _said("Notes", [("note", note) for note in outcome.notes]),
        _printed(own_output(outcome)),
        _facts(outcome, results),
    )


def _again(outcome: Outcome, options: ReportOptions) -> Html:
    told = command(outcome, options)
    if not told:
        return Html("")
    shown = element("pre", element("code", told))
    return joined(element("h3", "Run it again"), element("div", shown, class_="command"))


def _said(title: str, remarks: Sequence[tuple[str, str]]) -> Html:
    if not remarks:
        return Html("")
    items = [
        element("li", element("b", level, " ") if level != "note" else "", message)
        for level, message in remarks[:_MOST_LINES]
    ]
    left = len(remarks) - _MOST_LINES
    more = [element("li", f"{left} more are in results.json")] if left > 0 else []
    return joined(element("h3", title), element("ul", *items, *more, class_="remarks"))


def _printed(output: str) -> Html:
    if not output.strip():
        return Html("")
    return joined(element("h3", "Printed by your code"), element("pre", output, tabindex="0"))


def _wall_time(outcome: Outcome) -> str:
    """Its speed is that of the loop alone: nobody is to multiply the two."""
    if not outcome.wall_time:
        return ""
    runs = f", of all {outcome.repeats.count} runs" if outcome.repeats else ""
    return f"{quantity(outcome.wall_time, 's')} from start to end{runs}"


def _facts(outcome: Outcome, results: Results) -> Html:
    named = {
        "variation": ", ".join(f"{varied.key} = {varied.value}" for varied in outcome.variation),
        "ended by": outcome.end or "",
        "sim time": quantity(outcome.sim_time, "s"),
        "speed": factor(outcome.real_time_factor),
        "wall time": _wall_time(outcome),
        "travelled": quantity(outcome.travelled, "m"),
        "engine": outcome.engine or "",
        "seed": "" if outcome.seed is None else str(outcome.seed),
        "digest": outcome.digest or "",
        "repeated": repeated(outcome),
        **(made_with(outcome.provenance) or {"made by": f"sim-action {results.sim_action}, Python {results.python}"}),
        "trace": outcome.trace or "",
        "recordings": ", ".join(outcome.recordings),
    }
    told = [element("div", element("dt", name), element("dd", value)) for name, value in named.items() if value]
    return joined(element("h3", "How it ran"), element("dl", *told, class_="facts"))
