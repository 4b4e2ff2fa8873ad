"""The state that the progress page shows, and the pages themselves."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import pytest

from sim_action.core.records import replace
from sim_action.reports.html import live_page
from sim_action.reports.html.document import Page
from sim_action.reports.html.live_page import live_report, live_state, progress_page
from sim_action.results.journal import Finished, Journal, JournalFollower, Planned, RunEnded, Started
from tests.outcomes import like, report_options
from tests.reports.html.gates import gated, run
from tests.results.test_journal import FAILED, header, outcome, unheard


def begun(folder: Path, names: tuple[str, ...] = ("a", "b", "c")) -> Journal:
    return Journal(folder, header(names), unheard, time.monotonic())


def looked(folder: Path) -> JournalFollower:
    follower = JournalFollower(folder)
    follower.look()
    return follower


def state(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(json.dumps(live_state(looked(folder)), allow_nan=False))
    return found


def reported(folder: Path) -> Page:
    follower = looked(folder)
    assert follower.recorded is not None
    results = follower.recorded.results() if follower.is_over else follower.recorded.results_so_far()
    return live_report(results, live_page.Finished.of(follower), report_options(folder))


def names(shown: dict[str, Any]) -> dict[str, list[str]]:
    return {each["title"]: [row["name"] for row in each["rows"]] for each in shown["lists"]}


def test_each_scenario_is_in_one_list(tmp_path: Path) -> None:
    journal = begun(tmp_path, ("a", "b", "c", "d"))
    for place, name in enumerate("abc"):
        journal(Started(place, 1, name))
    journal(Finished(0, outcome("a", FAILED)))
    journal(Finished(1, outcome("b")))
    shown = state(tmp_path)
    assert names(shown) == {"Running": ["c"], "Did not pass": ["a"], "Passed": ["b"], "Waiting": ["d"]}
    assert (shown["finished"], shown["total"], shown["isOver"]) == (2, 4, False)
    assert [words for _, _, words in shown["counts"]] == ["1 error", "1 passed"]
    assert shown["lists"][1]["rows"][0]["why"] == FAILED.message
    assert shown["lists"][2]["rows"][0]["link"] == "report#scenario=b"


def test_a_gate_counts_in_place_of_its_runs(tmp_path: Path) -> None:
    made = [run(number, -0.1 if number == 1 else 0.5) for number in range(3)]
    results = gated({"passes": {"at_least": 0.2, "confidence": 0.5}}, *made)
    planned = tuple(Planned.of(each) for each in (*made, outcome("a")))
    begin = Journal(tmp_path, like(header(), gates=results.gates, planned=planned), unheard, 0.0)
    for place, each in enumerate(made[:2]):
        begin(Finished(place, each))
    shown = state(tmp_path)
    assert (shown["noun"], shown["finished"], shown["total"], shown["counts"]) == ("run", 2, 4, [])
    assert {title: len(rows) for title, rows in names(shown).items() if rows} == {"Runs of gates": 2, "Waiting": 2}
    assert "This report has 2 of 4 runs so far." in reported(tmp_path).text()
    begin(Finished(2, made[2]))
    shown = state(tmp_path)
    assert (names(shown)["Passed"], names(shown)["Did not pass"]) == (["push"], [])
    assert [words for _, _, words in shown["counts"]] == ["1 passed"]


def test_scenarios_of_a_call_that_ran_or_has_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # Runs of a repeated scenario are counted.
    journal = begun(tmp_path)
    for turn in (1, 2):
        journal(Started(0, turn, "a"))
        journal(RunEnded(0, turn, outcome("a"), is_one_of_several=True))
    [running] = state(tmp_path)["lists"][0]["rows"]
    assert running["why"] == "2 runs have ended"
    # Without a journal there is only the fact.
    shown = state(tmp_path / "nothing")
    assert shown["call"] == 0
    assert "lists" not in shown
    # What a call has left is not waiting.
    journal = begun(tmp_path)
    journal(Started(0, 1, "a"))
    journal(Finished(1, outcome("b")))
    journal.close()
    shown = state(tmp_path)
    assert names(shown) == {"Not finished": ["a"], "Did not pass": [], "Passed": ["b"], "Not started": ["c"]}
    assert shown["left"] is None
    # Names of strangers are one clean line.
    begun(tmp_path, ("</script>\u202e\n<b>",))
    [row] = state(tmp_path)["lists"][-1]["rows"]
    assert row["name"] == "</script> <b>"
    # Long lists are cut and counted.
    monkeypatch.setattr(live_page, "MAX_ROWS", 2)
    begun(tmp_path)
    waiting = state(tmp_path)["lists"][-1]
    assert (waiting["count"], len(waiting["rows"])) == (3, 2)


def test_the_time_left_counts_no_outcome_of_an_earlier_call(tmp_path: Path) -> None:
    begun(tmp_path)(Finished(0, outcome("a")))
    recorded = looked(tmp_path).recorded
    assert recorded is not None
    assert live_page._time_left(recorded, 3.0) == 6.0
    journal = begun(tmp_path)
    journal(Finished(1, outcome("b")))
    taken = looked(tmp_path).recorded
    assert taken is not None
    again = Journal(tmp_path, header(), unheard, time.monotonic(), taken.records)
    again(Finished(0, outcome("a")))
    resumed = looked(tmp_path).recorded
    assert resumed is not None
    assert live_page._time_left(resumed, 3.0) == 3.0


def test_a_time_beyond_all_clocks_leaves_the_time_left_open(tmp_path: Path) -> None:
    begun(tmp_path)(Finished(0, outcome("a")))
    follower = looked(tmp_path)
    assert follower.recorded is not None
    follower.recorded.records[:] = [replace(record, at=1e308) for record in follower.recorded.records]
    shown = json.loads(json.dumps(live_state(follower), allow_nan=False))
    assert (shown["finished"], shown["left"]) == (1, None)


def test_only_live_pages_may_connect(tmp_path: Path) -> None:
    journal = begun(tmp_path)
    assert "connect-src 'self'" in progress_page().policy
    journal(Finished(0, outcome("a")))
    report = reported(tmp_path)
    assert "connect-src 'self'" in report.policy
    assert report.policy in report.text().replace("&#x27;", "'")
    text = report.text()
    assert "This report has 1 of 3 scenarios so far." in text
    assert "not finished" not in text
    journal.close()
    text = reported(tmp_path).text()
    assert "so far" not in text
    assert "not finished" in text
