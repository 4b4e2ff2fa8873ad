"""The head of the page, and its list of scenarios: failures first, variations of one together."""

from __future__ import annotations

from collections.abc import Mapping

from sim_action.reports.escaping import one_line, shortened
from sim_action.reports.groups import Group
from sim_action.reports.page.markup import Html, element, joined
from sim_action.reports.page.verdicts import MARKS
from sim_action.reports.wording import counts, factor, mood, share
from sim_action.results.file import Results
from sim_action.results.outcome import Outcome

_MOST_IN_GIST = 110


def headline(results: Results) -> str:
    """The one thing to know about all of it."""
    bad = results.total - results.count("passed") - results.count("skipped")
    if not results.total:
        return "No scenario was run"
    if results.conclusion == "cancelled":
        return f"Interrupted: {results.count('passed')} of {results.total} scenarios had passed"
    if not bad:
        return "The scenario passed" if results.total == 1 else f"All {results.total} scenarios passed"
    return "The scenario did not pass" if results.total == 1 else f"{bad} of {results.total} scenarios did not pass"


def head(results: Results) -> Html:
    """What came of all scenarios, and what ran them."""
    speed = f" ({factor(results.real_time_factor)})" if results.real_time_factor else ""
    told = [f"{counts(results)} in {results.wall_time:.1f} s{speed}"]
    told += [share(results.shard)] if results.shard else []
    told += [f"sim-action {results.sim_action}"]
    kind = "failed" if results.conclusion != "success" else "passed"
    return element(
        "header",
        element("h1", headline(results), class_=kind),
        element("p", " · ".join(told), class_="faint"),
        class_="run",
    )


def listing(found: list[Group], ids: Mapping[int, str]) -> Html:
    """The list; empty where there is nothing to choose from.

    `ids`: `id()` of an outcome -> its id on the page, of those that the page has.
    """
    total = sum(len(group.outcomes) for group in found)
    if total < 2:
        return Html("")
    left = total - len(ids)
    more = element("p", f"{left} more are in results.json: a page has the worst {len(ids)}.", class_="faint none")
    return element(
        "nav",
        element(
            "details",
            element("summary", f"{total} scenarios"),
            element("ol", *(_entry(group, ids) for group in found)),
            more if left else "",
            open=True,
        ),
        aria_label="Scenarios",
        class_="scenarios",
    )


def gist(outcome: Outcome) -> str:
    """Why a scenario did not pass, shortly; empty if it did."""
    told = [failure.message for failure in outcome.failures]
    told += [expected.verdict.message for expected in outcome.causes_first if not expected.verdict.passed]
    return shortened(one_line(told[0]), _MOST_IN_GIST) if told else ""


def _entry(group: Group, ids: Mapping[int, str]) -> Html:
    there = [outcome for outcome in group.worst_first() if id(outcome) in ids]
    if not there:
        return Html("")
    if not group.varies:
        return _item(there[0], there[0].name, ids)
    title = joined(
        element("span", MARKS[group.mood], class_=f"mark {group.mood}", role="img", aria_label=group.mood),
        element("span", one_line(group.name), element("small", group.passed, class_="faint"), class_="name"),
    )
    items = [_item(outcome, group.values(outcome), ids) for outcome in there]
    fold = element("details", element("summary", title), element("ol", *items), open=group.mood != "passed")
    return element("li", fold, class_="group")


def _item(outcome: Outcome, name: str, ids: Mapping[int, str]) -> Html:
    kind, why = mood(outcome), gist(outcome)
    return element(
        "li",
        element(
            "a",
            element("span", MARKS[kind], class_=f"mark {kind}", role="img", aria_label=kind),
            element("span", one_line(name), element("small", why, class_="faint") if why else "", class_="name"),
            href=f"#{ids[id(outcome)]}",
        ),
    )
