"""The article of all scenarios."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from html import unescape
from typing import Any

import pytest

from sim_action.recording.replay.sightings import SightingData
from sim_action.reports.html.base_run import ScenarioChange
from sim_action.reports.html.document import Html, bar
from sim_action.reports.html.gate_article import nearest_limit
from sim_action.reports.html.navigation import planned_page
from sim_action.reports.html.suite import alike, sort_margin, suite_article
from sim_action.reports.html.top_view import RunLook, small_path
from sim_action.reports.scenario_groups import grouped_scenarios
from sim_action.reports.table import Bar
from sim_action.results.outcome import Failure, Outcome
from tests.outcomes import like, outcome, unjudged
from tests.replays import drive
from tests.reports.html.gates import failed_gate, run


def article(*outcomes: Outcome, changes: dict[int, ScenarioChange] | None = None) -> str:
    plan = planned_page(grouped_scenarios(outcomes), 2000)
    return suite_article(plan, {id(each): RunLook(Html("<svg></svg>"), {}) for each in outcomes}, changes or {})


def crashed(file: str) -> Outcome:
    failure = Failure(kind="crash", title="SIGSEGV", message="the process ended")
    return like(outcome(file), status="error", expectations=(), failures=(failure,))


def judged(file: str, *, holds: bool = False, **changes: Any) -> Outcome:
    made = outcome(file, holds=holds)
    [expected] = made.expectations
    return like(made, expectations=(like(expected, verdict=replace(expected.verdict, **changes)),))


def with_margin(margin: float, *, goal: bool = False) -> Outcome:
    return judged("a.sim.yml", holds=margin >= 0, margin=margin, limit=2.0, goal=goal)


def test_the_rows_of_the_table() -> None:
    # There is a row for each scenario the worst first.
    text = article(outcome("a.sim.yml"), outcome("b.sim.yml", holds=False), crashed("c.sim.yml"), unjudged("d.sim.yml"))
    rows = re.findall(r'<th scope="row"><a href="#(s\d)">(\w)</a>', text)
    assert rows == [("s0", "c"), ("s1", "b"), ("s2", "d"), ("s3", "a")]
    assert re.findall(r'<tbody data-status="(\w+)"', text) == ["error", "failed", "not_exercised", "passed"]
    # Rows name the tags of their scenarios.
    tagged = like(outcome("a.sim.yml"), tags=("nightly", "slow"))
    assert re.findall(r'data-tags="([^"]*)"', article(tagged, outcome("b.sim.yml"))) == ["nightly slow"]
    # Statuses are counted as the call counts them.
    varied = [run(number, 0.1 if number else -0.1, gate=None, file="a.sim.yml") for number in range(3)]
    text = article(*failed_gate().outcomes, *varied, crashed("b.sim.yml"), crashed("c.sim.yml"))
    chips = re.findall(r'<li data-status="(\w+)">.*?</span> ([\w ]+)</li>', text)
    assert chips == [("error", "2 errors"), ("failed", "2 failed"), ("passed", "2 passed")]


def test_rows_of_variations_gates_and_failures() -> None:
    # Variations are folded below their scenario with their parameters.
    text = article(*(run(number, 0.1 - number / 20, gate=None) for number in range(4)), outcome("b.sim.yml"))
    assert "<summary>4 variations</summary>" in text
    assert '<th scope="col">friction</th><th scope="col">yaw</th>' in text
    assert '<td data-title="friction">0.13</td>' in text
    assert '<th scope="row"><a href="#s0">push</a>' in text
    # Each variation has a status of its own to filter by.
    assert len(re.findall(r"<tbody data-status", text)) == 1
    # A gate has its status its rate and its runs.
    text = article(*failed_gate().outcomes, outcome("b.sim.yml"))
    assert "gate: 15 of 30 runs passed (50 %)" in text
    assert "<summary>30 runs</summary>" in text
    assert '<tbody data-status="failed"' in text
    # A reason stands where a scenario did not pass.
    assert nearest_limit(crashed("a.sim.yml")) == ("SIGSEGV: the process ended", "")
    assert "never checked: sensor 'lidar' had no reading" in nearest_limit(unjudged("a.sim.yml"))[0]
    assert "travelled 1.5 m" in nearest_limit(outcome("a.sim.yml", holds=False))[0]
    assert nearest_limit(outcome("a.sim.yml"))[0] == "travel"


@pytest.mark.parametrize(
    ("relative", "drawn"),
    [
        (0.25, '<rect width="12.5" height="1">'),
        (7.0, '<rect width="50.0" height="1">'),
        (-0.5, '<rect x="-25.0" width="25.0" height="1" class="missed">'),
        (-1e-9, '<rect x="-1.5" width="1.5" height="1" class="missed">'),
    ],
)
def test_a_bar_shows_a_margin_relative_to_its_limit(relative: float, drawn: str) -> None:
    assert drawn in bar(Bar("", relative, is_margin=True))


def test_margins_and_times_of_rows() -> None:
    assert not bar(Bar("", float("nan"), is_margin=True))
    # Scenarios are sorted by the relative margin and those without a verdict come first.
    assert sort_margin(with_margin(0.5)) == "0.25"
    assert sort_margin(with_margin(-0.5)) == "-0.25"
    assert sort_margin(crashed("a.sim.yml")) == "-2"
    # A goal is always reached exactly at its limit.
    assert sort_margin(with_margin(0.0, goal=True)) is None
    assert nearest_limit(with_margin(0.0, goal=True))[1] == "reached at 2.00 s"
    # Wall times are drawn relative to the longest.
    text = article(outcome("a.sim.yml", wall_time=4.0), outcome("b.sim.yml", wall_time=1.0))
    assert re.findall(r'"share-bar"><rect width="([\d.]+)" height="1">', text) == ["100.0", "25.0"]


def test_changes_of_rows() -> None:
    # Changes have a column only if there are some.
    several = outcome("a.sim.yml"), outcome("b.sim.yml")
    assert "Change" not in article(*several)
    fixed, same = ScenarioChange("fixed", "failed before", "pallet is gone"), ScenarioChange("unchanged", "none")
    text = article(*several, changes={id(several[0]): fixed, id(several[1]): same})
    assert re.findall(r'<td data-title="Change">(.*?)</td>', text) == ["fixed; pallet is gone", ""]
    assert re.findall(r'data-change="(\d+)"', text) == ["9", "14"]
    # A group has its most important change.
    varied = [run(number, 0.1, gate=None) for number in range(3)]
    new, fails = ScenarioChange("new", "was not there"), ScenarioChange("newly fails", "passed before")
    text = article(*varied, outcome("b.sim.yml"), changes={id(varied[0]): new, id(varied[1]): fails})
    assert '<td data-title="Change">newly fails</td>' in text
    assert 'data-change="0"' in text


def test_small_paths() -> None:
    # A small path fits its frame whatever the robot did.
    for distance in (0.0, 0.01, 1000.0):
        drawn = small_path(drive(distance=distance), "passed")
        numbers = [int(number) for number in re.findall(r'c[xy]="(-?\d+)"', drawn)]
        assert len(numbers) == 4
        assert all(0 <= number <= 640 for number in numbers)
    assert drawn.count(",") == 40
    assert "polyline" not in small_path(drive(distance=0.0), "passed")
    # A small path runs from its start to its end.
    ends = re.findall(r'cx="(\d+)" cy="(\d+)" r="30" class="(\w+)"', small_path(drive(distance=2.0), "passed"))
    assert ends == [("50", "200", "start"), ("590", "200", "end")]
    ahead = drive(distance=2.0)
    x, y, *rest = ahead.frames.base
    left = like(ahead, frames=like(ahead.frames, base=(y, x, *rest)))
    # Upwards: the end is higher on the page.
    assert re.findall(r'cy="(\d+)"', small_path(left, "passed")) == ["350", "50"]


def failed(file: str, body: str = "", time: float | None = 1.5, **changes: Any) -> Outcome:
    return judged(file, body=body, time=time, **changes)


def said(*outcomes: Outcome, seen: Sequence[RunLook] = (), worlds: Sequence[str] = ()) -> list[str]:
    ids = {id(each): f"s{number}" for number, each in enumerate(outcomes)}
    looks = dict(zip(ids, seen, strict=False))
    fails = [ScenarioChange("newly fails", "", world=world) for world in worlds]
    changes = dict(zip(ids, fails, strict=False))
    html = alike(grouped_scenarios(outcomes), ids, looks, changes)
    return [unescape(re.sub("<[^>]*>", "", item)) for item in re.findall("<li>.*?</li>", html)]


def test_scenarios_that_touched_the_same_body_stand_together() -> None:
    one, two = failed("a.sim.yml", "the pallet", unit="contacts"), failed("b.sim.yml", "the pallet", 3.78, unit="N")
    other = failed("c.sim.yml", "wall")
    [words] = said(one, outcome("d.sim.yml"), two, other)
    assertion = one.expectations[0].assertion
    assert words == f"2 scenarios touched the pallet: a at 1.50 s ({assertion}); b at 3.78 s ({assertion})"


@pytest.mark.parametrize(
    ("distances", "words"),
    [
        ((0.04, 0.03), "came too near to box"),
        ((0.04, 0.0), "touched box, or came too near"),
        ((0.0, -0.01), "touched box"),
    ],
)
def test_a_distance_to_a_body_is_not_a_touch(distances: tuple[float, float], words: str) -> None:
    both = [failed(f"{measured}.sim.yml", "box", measured=measured, unit="m") for measured in distances]
    [told] = said(*both)
    assert told.startswith(f"2 scenarios {words}: ")


def look(sensor: str, time: float) -> RunLook:
    return RunLook(Html(""), {"box": SightingData(sensor=sensor, kind="lidar", time=time, distance=1.0, angle=0.0)})


@pytest.mark.parametrize(
    ("worlds", "words"),
    [(["box is new"] * 2, ". Since the base run, box is new: a at"), (["box is new", ""], ": a at"), ([], ": a at")],
)
def test_a_change_of_all_worlds_is_said(worlds: list[str], words: str) -> None:
    both = [failed(f"{name}.sim.yml", "box", unit="contacts") for name in "ab"]
    [told] = said(*both, worlds=worlds)
    assert told.startswith(f"2 scenarios touched box{words}")


def test_failures_that_look_alike() -> None:
    # The sensor that saw the body first is named for each run.
    three = [failed(f"{name}.sim.yml", "box", unit="contacts") for name in "abc"]
    [told] = said(*three, seen=[look("skirt", 1.4), RunLook(Html(""), {}), look("mast", 0.0)])
    assertion = three[0].expectations[0].assertion
    assert told.endswith(
        f"a at 1.50 s ({assertion}, first seen by skirt (lidar) at 1.40 s); b at 1.50 s ({assertion}); "
        f"c at 1.50 s ({assertion}, first seen by mast (lidar) at 0.00 s)"
    )
    # Scenarios that missed the same expectation stand together.
    several = [failed(f"{number}.sim.yml", time=None) for number in range(14)]
    [words] = said(*several, failed("cut.sim.yml", cut_off=True))
    assert words.startswith(f"14 scenarios failed {several[0].expectations[0].name}: 0; 1; 2")
    assert words.endswith("11 and 2 more")
    # The expectation that failed first is the cause.
    late, early = failed("a.sim.yml", "wall", 9.0), failed("a.sim.yml", time=2.0)
    both = like(late, expectations=(*late.expectations, *early.expectations))
    [words] = said(both, failed("b.sim.yml", time=2.5))
    assert words.endswith("a at 2.00 s; b at 2.50 s")


def test_failures_that_are_not_listed_or_counted() -> None:
    # Runs of a gate and single failures are not listed.
    assert not alike(grouped_scenarios(failed_gate().outcomes), {}, {}, {})
    assert not said(failed("a.sim.yml", "wall", 9.0), failed("b.sim.yml"), outcome("c.sim.yml"))
    # Variations of one scenario are not listed but count.
    varied = [run(number, -0.1, gate=None, file="a.sim.yml") for number in range(3)]
    assert not said(*varied)
    other = run(1, -0.2, gate=None, group=None, name="b", file="b.sim.yml")
    [words] = said(*varied, other)
    assert words.startswith(f"4 runs failed {other.expectations[0].name}: ")
    # Names are text.
    hostile = [failed(f"{number}.sim.yml", "<b>box</b>") for number in range(2)]
    assert "<b>box" not in alike(grouped_scenarios(hostile), {}, {}, {})
