"""The article of one scenario in report.html."""

from __future__ import annotations

import pytest

from sim_action.reports import ReportOptions
from sim_action.reports.html.scenario_article import reasons
from sim_action.results.outcome import Failure, Outcome


@pytest.mark.parametrize(("count", "shown", "left"), [(20, 20, ""), (23, 20, "3 more errors are in results.json.")])
def test_the_first_twenty_errors_are_shown(count: int, shown: int, left: str, options: ReportOptions) -> None:
    failures = tuple(Failure(kind="invalid", title="invalid", message=f"problem-{index};") for index in range(count))
    html = str(reasons(Outcome(name="a", file="a.sim.yml", status="error", failures=failures), options))
    assert [index for index in range(count) if f"problem-{index};" in html] == list(range(shown))
    assert ("more errors" in html) == bool(left)
    assert left in html
