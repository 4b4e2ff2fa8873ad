"""The article of a gate, or of a scenario's variations: rate, conditions, counts, runs, and plots of the parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from math import isfinite
from typing import Final

from pydantic import JsonValue

from sim_action.core import units
from sim_action.core.records import dataclass
from sim_action.core.wording import counted, shortened
from sim_action.reports import ReportOptions
from sim_action.reports.display import STATUS_DISPLAYS
from sim_action.reports.escaping import one_line
from sim_action.reports.formatting import first_reason, moment, quantity
from sim_action.reports.html.document import (
    Html,
    article,
    dotted,
    element,
    faint,
    heading,
    html_table,
    joined,
    reasons,
    source,
    titled,
    values,
)
from sim_action.reports.html.scenario_article import failure_sections, status_line
from sim_action.reports.scenario_groups import ScenarioGroup, nearest_expectation, relative_margin
from sim_action.reports.table import Bar, Row, Table, Value, expectation_rows
from sim_action.results.outcome import ExpectationOutcome, GateStatistics, Outcome
from sim_action.scenario.variations.expansion import labels
from sim_action.scenario.variations.gate import PlannedGate, percent

SHOWN_RUNS: Final = 20  # the number of runs that a reader sees at once; the others are in a fold


@dataclass(frozen=True, slots=True)
class GroupPlace:
    """The place of a group in the page."""

    identity: str  # the element id of its article
    ids: Mapping[int, str]  # `id()` of an outcome -> the element id of its article; only of runs that the page has
    replayed: frozenset[str]  # the element ids of the articles with a replay
    is_plotted: bool  # True if the page has a plot of its parameters


def gate_article(
    group: ScenarioGroup, gate: Outcome, place: GroupPlace, options: ReportOptions, since: str = ""
) -> Html:
    """Return the article of a gate; `gate` is its outcome, `since` what changed since an earlier run."""
    kind = gate.display_status
    statistics = gate.statistics
    header = (
        status_line(kind, f"Gate: {STATUS_DISPLAYS[kind].headline[0].lower()}{STATUS_DISPLAYS[kind].headline[1:]}"),
        heading(place.identity, one_line(gate.name)),
        _origin_line(group, options),
        element("p", since, class_="since") if since else "",
    )
    conditions = Table("Condition", expectation_rows(gate, gate.expectations), message="Found")
    body = joined(
        rate_figure(statistics, group.planned, kind) if statistics is not None and statistics.runs else "",
        reasons(failure_sections(gate, options)),
        titled("Conditions", html_table(conditions, options)),
        _counts(statistics) if statistics is not None else "",
        _plot_place(place),
        _runs(group, place, options),
    )
    return article(place.identity, f"group {kind}", header, body)


def variations_article(group: ScenarioGroup, place: GroupPlace, options: ReportOptions) -> Html:
    """Return the article that shows all variations of a scenario together, or the runs of a part of a gate."""
    kind = group.status
    header = (
        status_line(kind, group.gate_text if group.is_part else f"Variations: {group.passed}"),
        heading(place.identity, one_line(group.name)),
        _origin_line(group, options),
    )
    return article(place.identity, f"group {kind}", header, joined(_plot_place(place), _runs(group, place, options)))


def _origin_line(group: ScenarioGroup, options: ReportOptions) -> Html:
    parts = [source(group.location, options), counted(len(group.outcomes), "run"), group.engines]
    return faint(dotted(parts))


def _counts(statistics: GateStatistics) -> Html:
    stopped = statistics.decision is not None and statistics.runs < statistics.planned
    runs = f"{statistics.runs} of {statistics.planned}{', stopped early' if stopped else ''}"
    decision = "" if statistics.decision is None else f"{statistics.decision} after {counted(statistics.runs, 'run')}"
    named = {
        "runs": runs,
        "passed": str(statistics.passed),
        "failed": str(statistics.failed),
        "errors": str(statistics.errors),
        "not exercised": str(statistics.not_exercised),
        "decision": decision,
    }
    return titled("Counts", values(named.items(), "figures"))


def _plot_place(place: GroupPlace) -> Html:
    return element("div", class_="sweep", hidden=True) if place.is_plotted else Html("")


# The drawing of a rate, in its own units: the scale from 0 to 100 % begins and ends here.
_LEFT: Final = 40.0
_RIGHT: Final = 320.0
_WIDTH: Final = 360
_HEIGHT: Final = 62
_BAR: Final = 30
_LABEL_GAP: Final = 0.2  # labels nearer than this overlap; a share of the scale


def rate_figure(statistics: GateStatistics, planned: PlannedGate | None, kind: str) -> Html:
    """Return the rate of passed runs with its interval and the claimed rates on a scale from 0 to 100 %."""
    lower, upper, claims = statistics.lower, statistics.upper, _claims(planned)
    interval = ""
    if lower is not None and upper is not None:
        interval = f"between {percent(lower)} and {percent(upper)}, each side with {percent(statistics.confidence)}"
    descriptions = [f"{statistics.passed} of {statistics.runs} runs passed: {percent(statistics.rate)}"]
    descriptions += [f"{interval} confidence"] if interval else []
    descriptions += [f"{words} {percent(rate)}" for words, rate in claims]
    marks = [element("line", x1=_LEFT, x2=_RIGHT, y1=_BAR, y2=_BAR, class_="scale")]
    marks += [_label(_LEFT - 6, _BAR + 4, "end", "0 %"), _label(_RIGHT + 6, _BAR + 4, "start", "100 %")]
    if lower is not None and upper is not None:
        width = max(1.0, _at(upper) - _at(lower))
        marks += [element("rect", x=_at(lower), width=round(width, 1), y=_BAR - 6, height=12, class_="interval")]
        marks += _bound_labels(lower, upper)
    for number, (words, rate) in enumerate(claims):
        marks += [element("line", x1=_at(rate), x2=_at(rate), y1=_BAR - 11, y2=_BAR + 11, class_="claim")]
        anchor = "end" if rate > _MIDDLE else "start"
        # A test between two rates has no bounds, whose labels are below.
        y = 12 if number == 0 else _BAR + 24
        marks += [_label(_at(rate) + (3 if anchor == "start" else -3), y, anchor, f"{words} {percent(rate)}")]
    marks += [element("circle", cx=_at(statistics.rate), cy=_BAR, r=4.5, class_="rate")]
    drawn = element(
        "svg", *marks, viewBox=f"0 0 {_WIDTH} {_HEIGHT}", role="img", aria_label="; ".join(descriptions), class_="bar"
    )
    words = element("p", element("b", percent(statistics.rate)), " of the runs passed", class_="share")
    note = element("figcaption", f"True rate: {interval} confidence.", class_="faint") if interval else ""
    return element("figure", words, drawn, note, class_=f"interval-of-rate {kind}")


_MIDDLE: Final = 0.5


def _claims(planned: PlannedGate | None) -> list[tuple[str, float]]:
    """Return the words and the rate of each claim about the rate."""
    if planned is None:
        return []
    if planned.gate.passes is not None:
        return [("claimed: at least", planned.gate.passes.at_least)]
    test = planned.gate.stop_early
    return [] if test is None else [("reject", test.reject), ("accept", test.accept)]


def _bound_labels(lower: float, upper: float) -> list[Html]:
    """Return the labels of the bounds, which stand apart from each other and inside the drawing."""
    y = _BAR + 24
    if upper - lower >= _LABEL_GAP:
        return [_label(_at(bound), y, "middle", percent(bound)) for bound in (lower, upper)]
    middle = (lower + upper) / 2
    return [_label(_at(middle) - 4, y, "end", percent(lower)), _label(_at(middle) + 4, y, "start", percent(upper))]


def _at(share: float) -> float:
    return round(_LEFT + share * (_RIGHT - _LEFT), 1)


def _label(x: float, y: float, anchor: str, words: str) -> Html:
    return element("text", words, x=round(x, 1), y=y, text_anchor=anchor)


_MAX_TEXT: Final = 40
_MAX_REASON: Final = 300


def _runs(group: ScenarioGroup, place: GroupPlace, options: ReportOptions) -> Html:
    """Return the runs, the worst first; those after the first ones are in a fold."""
    shown = runs_table(group, place.ids, ("Replay",), lambda run: (_replay_text(run, place),), SHOWN_RUNS)
    left = len(group.outcomes) - len(shown.rows) - len(shown.rest)
    more = faint(f"{counted(left, 'more run')} in results.json.") if left else ""
    return titled("Runs, the worst first", html_table(shown, options, around="wide runs"), more)


def _replay_text(run: Outcome, place: GroupPlace) -> str:
    """Return whether the page has the replay of a run; empty if it was not run."""
    return "" if run.status == "skipped" else "yes" if place.ids[id(run)] in place.replayed else "not in this report"


def runs_table(
    group: ScenarioGroup,
    ids: Mapping[int, str],
    titles: tuple[str, ...],
    values_of: Callable[[Outcome], tuple[Value, ...]],
    unfolded: int = 0,
) -> Table:
    """Return the runs of a group that have an article, the worst first, with their parameters as columns.

    `ids`: `id()` of an outcome -> the element id of its article; `titles`, `values_of`: further columns, and
    their values; `unfolded`: the number of runs that are in no fold.
    """
    columns = parameters(group.outcomes)
    numbers = {id(run): number for number, run in enumerate(group.outcomes)}
    rows = tuple(
        Row(
            run.display_status,
            f"run {numbers[id(run)] + 1}",
            values=(
                *(shortened(column.texts[numbers[id(run)]], _MAX_TEXT) for column in columns),
                *nearest_limit(run),
                *values_of(run),
            ),
            link=ids[id(run)],
            is_neutral=run.is_sample,
        )
        for run in group.worst_first()
        if id(run) in ids
    )
    titles = (*(column.label for column in columns), "Nearest limit", "Margin", *titles)
    noun = "run" if group.is_gate else "variation"
    title = counted(len(rows) - unfolded, "more run") if unfolded else counted(len(group.outcomes), noun)
    return Table("Run", rows[:unfolded], titles, rest=rows[unfolded:], rest_title=title)


def nearest_limit(run: Outcome) -> tuple[str, str | Bar]:
    """Return the expectation nearest to its limit, or the reason why a run did not pass, and the margin.

    A goal that was reached has the time of this in place of its margin.
    """
    expected = nearest_expectation(run)
    if expected is None or run.failures:
        words = first_reason(run)
    else:
        words = expected.name if expected.status == "passed" else expected.verdict.message
    return "" if run.status == "skipped" else shortened(one_line(words), _MAX_REASON), _margin(expected)


def _margin(expected: ExpectationOutcome | None) -> str | Bar:
    if expected is None:
        return ""
    verdict = expected.verdict
    if verdict.status == "passed" and verdict.goal and verdict.time is not None:
        return f"reached at {moment(verdict.time)}"
    if verdict.margin is None or verdict.cut_off:
        return ""
    # A count of contacts is 0 or 1: its margin says nothing.
    words = "" if verdict.unit == "contacts" else quantity(verdict.margin, verdict.unit)
    return Bar(words, relative_margin(expected), is_margin=True)


MIN_PLOTTED_RUNS: Final = 3
_MAX_CATEGORIES: Final = 20
_MAX_EXPECTATIONS: Final = 20
_DIGITS: Final = 6


@dataclass(frozen=True, slots=True)
class Parameter:
    """A varied key and its value in each run of a group."""

    label: str  # the shortest ending of the key that is unique in the group
    unit: str  # the SI unit of numbers
    # the values in SI; empty unless every value is a number of one unit. None: the run lacks the key.
    numbers: tuple[float | None, ...]
    texts: tuple[str, ...]  # the values as people read them

    @property
    def varies(self) -> bool:
        """Return True if two runs differ in it."""
        return len(set(self.texts)) > 1

    @property
    def categories(self) -> list[str]:
        """The different texts in call order; empty for numbers."""
        return [] if self.numbers else list(dict.fromkeys(text for text in self.texts if text))

    @property
    def is_plotted(self) -> bool:
        """Return True if it makes an axis of a plot."""
        return self.varies and len(self.categories) <= _MAX_CATEGORIES

    def packed(self) -> dict[str, JsonValue]:
        """Return the data of an axis; values of categories are their indices."""
        categories = self.categories
        indices = {text: float(index) for index, text in enumerate(categories)}
        values = self.numbers or tuple(indices.get(text) for text in self.texts)
        return {
            "name": self.label,
            "unit": self.unit,
            "categories": [shortened(text, _MAX_TEXT) for text in categories],
            "values": _rounded(values),
        }


def parameters(runs: Sequence[Outcome]) -> list[Parameter]:
    """Return the varied keys of runs, in the order of the scenario file."""
    named: list[Mapping[str, JsonValue]] = [{varied.key: varied.value for varied in run.variation} for run in runs]
    keys = list(dict.fromkeys(key for values in named for key in values))
    called = labels(keys)
    return [_parameter(one_line(called[key]), [(key in values, values.get(key)) for values in named]) for key in keys]


def _parameter(label: str, stated: Sequence[tuple[bool, JsonValue]]) -> Parameter:
    quantities = [_quantity(value) if is_stated else None for is_stated, value in stated]
    unit_names = {unit for amount in quantities if amount is not None for unit in (amount[1],) if unit}
    is_numeric = all(amount is not None for amount, (is_stated, _) in zip(quantities, stated, strict=True) if is_stated)
    if not is_numeric or len(unit_names) > 1:
        return Parameter(label, "", (), tuple(_text(value) if is_stated else "" for is_stated, value in stated))
    unit = next(iter(unit_names), "")
    numbers = tuple(None if amount is None else amount[0] for amount in quantities)
    return Parameter(label, unit, numbers, tuple("" if n is None else units.display(n, unit) for n in numbers))


def _quantity(value: JsonValue) -> tuple[float, str] | None:
    """Return a number with its SI unit; None for anything else."""
    try:
        return units.with_si_unit(value)
    except units.UnitError:
        return None


def _text(value: JsonValue) -> str:
    return one_line(value if isinstance(value, str) else str(value))


def has_plot(runs: Sequence[Outcome]) -> bool:
    """Return True if a plot of the parameters shows more than the list of runs: there are numbers that vary."""
    return bool(_axes(runs))


def _axes(runs: Sequence[Outcome]) -> list[Parameter]:
    if len(runs) < MIN_PLOTTED_RUNS:
        return []
    axes = [parameter for parameter in parameters(runs) if parameter.is_plotted]
    return axes if any(parameter.numbers for parameter in axes) else []


def sweep(runs: Sequence[Outcome], ids: Mapping[int, str], claim: float | None) -> dict[str, JsonValue] | None:
    """Return the data of the plots of a group; None if there is nothing to plot.

    `runs`: the runs of the group, in the order of the page; `ids`: `id()` of an outcome -> the element id of its
    article; `claim`: the rate that a gate claims, the middle of the colours of a share.
    """
    axes = _axes(runs)
    if not axes:
        return None
    return {
        "parameters": [parameter.packed() for parameter in axes],
        "series": [*_series(runs)],
        "statuses": [run.display_status for run in runs],
        "entries": [ids.get(id(run)) for run in runs],
        "claim": claim,
    }


def _series(runs: Sequence[Outcome]) -> Iterator[dict[str, JsonValue]]:
    """Yield the margin of the nearest expectation in per cent, then margin, value and time of each expectation."""
    yield {"name": "smallest margin", "unit": "%", "signed": True, "values": _rounded([_tightest(run) for run in runs])}
    places = max((len(run.expectations) for run in runs), default=0)
    for place in range(min(places, _MAX_EXPECTATIONS)):
        expected = [run.expectations[place] if place < len(run.expectations) else None for run in runs]
        first = next(expectation for expectation in expected if expectation is not None)
        name, unit = one_line(first.name), one_line(first.verdict.unit)
        for what, in_unit, value in _QUANTITIES:
            values = [
                None if expectation is None or expectation.verdict.cut_off else value(expectation)
                for expectation in expected
            ]
            if len(set(values) - {None}) > 1:
                yield {
                    "name": f"{what}: {name}",
                    "unit": in_unit if in_unit is not None else unit,
                    "signed": what == "margin",
                    "values": _rounded(values),
                }


_QUANTITIES: Final[tuple[tuple[str, str | None, Callable[[ExpectationOutcome], float | None]], ...]] = (
    ("margin", None, lambda expected: expected.verdict.margin),
    ("measured", None, lambda expected: expected.verdict.measured),
    ("time", "s", lambda expected: expected.verdict.time),
)
"""The name of a quantity of an expectation, its unit (None: the expectation's unit), and its value."""


def _tightest(run: Outcome) -> float | None:
    """Return the relative margin of the nearest expectation in per cent, 0 for a met goal; None without any."""
    expected = nearest_expectation(run)
    if expected is None:
        return None
    is_met = expected.verdict.goal and expected.verdict.status == "passed"
    return 0.0 if is_met else 100.0 * relative_margin(expected)


def _rounded(values: Sequence[float | None]) -> list[JsonValue]:
    return [None if value is None or not isfinite(value) else float(f"{value:.{_DIGITS}g}") for value in values]
