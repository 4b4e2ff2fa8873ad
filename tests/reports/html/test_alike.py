"""What the page of all scenarios says about failures that look alike."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from html import unescape
from typing import Any

import pytest

from sim_action.recording.replay.sightings import SightingData
from sim_action.reports.html.base_run import ScenarioChange
from sim_action.reports.html.document import Html
from sim_action.reports.html.suite import alike
from sim_action.reports.html.top_view import RunLook
from sim_action.reports.scenario_groups import grouped_scenarios
from sim_action.results.outcome import Outcome
from tests.outcomes import like, outcome
from tests.reports.html.gates import failed_gate, run


def failed(file: str, body: str = "", time: float | None = 1.5, **changes: Any) -> Outcome:
    made = outcome(file, holds=False)
    [expected] = made.expectations
    verdict = replace(expected.verdict, body=body, time=time, **changes)
    return like(made, expectations=(like(expected, verdict=verdict),))


def said(*outcomes: Outcome, seen: Sequence[RunLook] = (), worlds: Sequence[str] = ()) -> list[str]:
    ids = {id(each): f"s{number}" for number, each in enumerate(outcomes)}
    looks = dict(zip(ids, seen, strict=False))
    changes = {
        number: ScenarioChange("newly fails", "", world=world) for number, world in zip(ids, worlds, strict=False)
    }
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


def test_the_sensor_that_saw_the_body_first_is_named_for_each_run() -> None:
    three = [failed(f"{name}.sim.yml", "box", unit="contacts") for name in "abc"]
    [told] = said(*three, seen=[look("skirt", 1.4), RunLook(Html(""), {}), look("mast", 0.0)])
    assertion = three[0].expectations[0].assertion
    assert told.endswith(
        f"a at 1.50 s ({assertion}, first seen by skirt (lidar) at 1.40 s); b at 1.50 s ({assertion}); "
        f"c at 1.50 s ({assertion}, first seen by mast (lidar) at 0.00 s)"
    )


def test_scenarios_that_missed_the_same_expectation_stand_together() -> None:
    several = [failed(f"{number}.sim.yml", time=None) for number in range(14)]
    [words] = said(*several, failed("cut.sim.yml", cut_off=True))
    assert words.startswith(f"14 scenarios failed {several[0].expectations[0].name}: 0; 1; 2")
    assert words.endswith("11 and 2 more")


def test_the_expectation_that_failed_first_is_the_cause() -> None:
    late, early = failed("a.sim.yml", "wall", 9.0), failed("a.sim.yml", time=2.0)
    both = like(late, expectations=(*late.expectations, *early.expectations))
    [words] = said(both, failed("b.sim.yml", time=2.5))
    assert words.endswith("a at 2.00 s; b at 2.50 s")


def test_runs_of_a_gate_and_single_failures_are_not_listed() -> None:
    assert not alike(grouped_scenarios(failed_gate().outcomes), {}, {}, {})
    assert not said(failed("a.sim.yml", "wall", 9.0), failed("b.sim.yml"), outcome("c.sim.yml"))


def test_variations_of_one_scenario_are_not_listed_but_count() -> None:
    varied = [run(number, -0.1, gate=None, file="a.sim.yml") for number in range(3)]
    assert not said(*varied)
    other = run(1, -0.2, gate=None, group=None, name="b", file="b.sim.yml")
    [words] = said(*varied, other)
    assert words.startswith(f"4 runs failed {other.expectations[0].name}: ")


def test_names_are_text() -> None:
    hostile = [failed(f"{number}.sim.yml", "<b>box</b>") for number in range(2)]
    assert "<b>box" not in alike(grouped_scenarios(hostile), {}, {}, {})
