"""Events: what they may say, when they happen, and that they act as the same thing stated with that time."""

from __future__ import annotations

import math
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.errors import RunError
from sim_action.core.field_types import Placement
from sim_action.simulation.loop import SimulationRun
from sim_action.state.verdict import Judged
from sim_action.world import PathPoint
from sim_action.world.body import Pace, PosePath
from tests.scenarios import LEAST, told
from tests.simulated import simulated

ENGINES = ("pybullet", "mujoco")

BASE: dict[str, Any] = {
    "name": "burger drives",
    "robot": {"model": "turtlebot3_burger"},
    "commands": [{"twist": [{"linear": 0.4}]}],
    "expect": [{"travel": {"at_least": "0.1 m"}}],
    "duration": "2 s",
    "time_limit": "3 s",
}
CRATE = {"name": "crate", "box": [0.1, 0.1, 0.1], "pose": {"x": 0.8, "y": 0.02}, "mass": 0.2}
CART = {"name": "cart", "box": [0.2, 0.2, 0.2], "path": [{"at": 0, "x": 2, "y": -1}, {"at": 2, "y": 1}]}
SLOW = {**CART, "path": [{"at": 0, "x": 0.5, "y": -0.6}, {"at": 4, "y": 0.6}]}
QUICK = {**CART, "path": [{"at": 0, "x": 0.5, "y": -0.6}, {"at": 1, "y": 0.6}]}
BLOCK = {**CRATE, "mass": 50, "pose": {"x": 0.5}}
ICE = {"x": 1, "size": [3, 2], "friction": 0.01}
PASSES = {"name": "passes", "when": {"stl": "x > 0.15 m"}}


def run(folder: Path, **keys: Any) -> SimulationRun:
    return simulated(folder, BASE | keys)


def with_event(folder: Path, do: list[Any], **keys: Any) -> tuple[SimulationRun, float]:
    """The run in which `do` is done as the robot passes a line, and the time at which it did."""
    found = run(folder, events=[{**PASSES, "do": do}], **keys)
    (time,) = found.events["passes"]
    return found, time


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    ("do", "world", "stated"),
    [
        (
            {"disturb": {"force": [0, 3, 0], "for": 0.2}},
            {},
            lambda time: {"disturbances": [{"at": time, "force": [0, 3, 0], "for": 0.2}]},
        ),
        ({"disturb": {"payload": 1, "at": 0.1}}, {}, lambda time: {"disturbances": [{"at": time + 0.1, "payload": 1}]}),
        ({"appear": "crate"}, {"objects": [CRATE]}, lambda time: {"objects": [{**CRATE, "appears": time}]}),
        ({"remove": "crate"}, {"objects": [BLOCK]}, lambda time: {"objects": [{**BLOCK, "disappears": time}]}),
        (
            {"appear": "ice"},
            {"patches": [{"name": "ice", **ICE}]},
            lambda time: {"patches": [{**ICE, "appears": time}]},
        ),
        (
            {"speed": {"object": "cart", "factor": 3}},
            {"objects": [SLOW]},
            lambda time: {"objects": [{**SLOW, "pace": [{"at": time, "speed": 3}]}]},
        ),
        (
            {"start": "cart"},
            {"objects": [QUICK]},
            lambda time: {"objects": [{**QUICK, "pace": [{"at": 0, "speed": 0}, {"at": time, "speed": 1}]}]},
        ),
    ],
    ids=["push", "load", "appear", "remove", "friction", "speed", "path"],
)
def test_an_action_is_the_same_thing_stated_with_its_time(
    tmp_path: Path, engine: str, do: Any, world: Any, stated: Any
) -> None:
    least = [{"travel": {"at_least": "0.01 m"}}]
    found, time = with_event(tmp_path, [do], world=world, backend=engine, expect=least)
    again = run(tmp_path, world={**world, **stated(time)}, backend=engine, expect=least)
    without = run(tmp_path, world=stated(2.7), backend=engine, expect=least)
    assert 0.4 < time < 1.2
    assert found.digest == again.digest
    assert found.digest != without.digest
    assert found.end == again.end == "duration" or found.end == again.end == "goals met"


@pytest.mark.parametrize("engine", ENGINES)
def test_a_fault_of_a_motor_begins_with_an_event(tmp_path: Path, engine: str) -> None:
    fault = {"motor": "wheel_left_joint", "stuck": True}
    found, time = with_event(tmp_path, [{"fault": {**fault, "for": 0.5}}], backend=engine)
    assert found.digest == run(tmp_path, faults=[{**fault, "for": 0.5, "at": time}], backend=engine).digest
    assert abs(found.trace.yaw[-1]) > 0.1


def test_a_fault_ends_with_an_event(tmp_path: Path) -> None:
    fault = {"motor": "wheel_left_joint", "off": True, "at": 0.3}
    found, time = with_event(tmp_path, [{"repair": "wheel_left_joint"}], faults=[fault])
    assert found.digest == run(tmp_path, faults=[{**fault, "for": time - 0.3}]).digest


def test_a_motor_dies_half_way_and_two_carts_meet(tmp_path: Path) -> None:
    """A motor dies where the robot is, not at a time; a robot and a cart stop before they touch each other."""
    fault = {"motor": "wheel_left_joint", "off": None}
    dies = {"name": "half way", "when": {"stl": "x > 0.4 m"}, "do": [{"fault": fault}]}
    half = {"expect": [{"max_speed": {"linear": 0.5}, "since": "half way"}], "duration": "3 s"}
    found = run(tmp_path, events=[dies], **half)
    (time,) = found.events["half way"]
    assert found.verdicts[0].status == "passed"
    assert time == pytest.approx(1.2, abs=0.05)
    cart = {**CART, "path": [{"at": 0, "x": 1.5, "y": 0}, {"at": 5, "x": 0}]}
    near = {"name": "meet", "when": {"clearance": {"at_most": 0.3}}, "do": [{"stop": "cart"}, {"stop": "twist"}]}
    keys: dict[str, Any] = {"world": {"objects": [cart]}, "expect": ["no_collision"], "duration": "3 s"}
    stopped, on = run(tmp_path, events=[near], **keys), run(tmp_path, **keys)
    assert (stopped.verdicts[0].status, on.verdicts[0].status) == ("passed", "failed")


@pytest.mark.parametrize("engine", ENGINES)
def test_a_run_ends_with_an_event_as_with_its_time_limit(tmp_path: Path, engine: str) -> None:
    found, time = with_event(tmp_path, ["end"], expect=["upright"], backend=engine, trace={"rate": 240})
    # A condition holds at the step before its event.
    x = found.trace.base_position_xyz[:, 0]
    assert x[-2] >= 0.15 > x[-3]
    assert time == pytest.approx(found.trace.time[-1])
    short = run(tmp_path, expect=["upright"], duration=time, time_limit=time, backend=engine)
    assert (found.end, found.sim_time, found.digest) == ("event", time, short.digest)


def test_a_run_that_an_event_ends_says_what_it_watched_for_a_shorter_time(tmp_path: Path) -> None:
    """Not what a deadline, a goal, or the interval of a formula had decided before."""
    names = ["level", "calm", "there", "near"]
    several: list[dict[str, Any]] = [
        {"upright": {}},
        {"max_speed": {"linear": 1}, "after": "0.2 s"},
        {"final_pose": {"x": 0.15, "y": 0}},
        {"stl": "always (x < 1 m)"},
    ]
    shorter = [{**each, "name": name} for each, name in zip(several, names, strict=True)]
    others = [
        {"max_speed": {"linear": 1}, "before": "0.3 s"},
        {"travel": {"at_least": "0.01 m"}},
        {"stl": "always[0 s, 0.3 s] (x < 1 m)"},
        {"stl": "eventually (x > 0.1 m)"},
    ]
    events = [{**PASSES, "do": ["end"]}]
    found = run(tmp_path, events=events, expect=[*shorter, *others], duration="2 s")
    assert {verdict.status for verdict in found.verdicts} == {"passed"}
    (note,) = (note for note in found.notes if "event" in note)
    end = f"{found.sim_time:.4g} s"
    shown = ", ".join(f"'{name}'" for name in names)
    assert note == f"event 'passes' ended the run at {end}, so these were judged until then and not until 2 s: {shown}"
    deadline = run(tmp_path, events=events, expect=[{"upright": {}, "before": "1.5 s", "name": "level"}])
    assert any(note.endswith("not until 1.5 s: 'level'") for note in deadline.notes)
    failed = run(tmp_path, events=events, expect=[{"max_speed": {"linear": 0.01}}])
    assert not [note for note in failed.notes if "ended the run" in note]


@pytest.mark.parametrize("engine", ENGINES)
def test_a_body_that_is_gone_is_no_evidence(tmp_path: Path, engine: str) -> None:
    """A distance is judged as long as one of its bodies is there, whether a time or an event removes it."""
    clear: dict[str, Any] = {"clearance": {"to": ["crate"], "at_least": "0.1 m"}}
    several = {"clearance": {"to": ["crate", "cart"], "at_least": "0.1 m"}}
    never = {"not": {"clearance": {"to": ["crate"], "at_most": "0.1 m"}}}
    keys: dict[str, Any] = {"expect": [clear, several, never, clear | {"after": "1 s"}], "backend": engine}
    events = [{"when": {"at": "0.5 s"}, "do": [{"remove": "crate"}]}]
    by_event = run(tmp_path, world={"objects": [CRATE, CART]}, events=events, **keys)
    stated = run(tmp_path, world={"objects": [{**CRATE, "disappears": "0.5 s"}, CART]}, **keys)
    assert by_event.verdicts == stated.verdicts
    least, either, lasting, late = by_event.verdicts
    assert [verdict.status for verdict in by_event.verdicts] == ["passed", "passed", "passed", "not_exercised"]
    assert least.judged == Judged(119, 1 / 240, 119 / 240)
    assert (either.judged, lasting.judged) == (Judged(480, 1 / 240, 2.0), Judged(119, 1 / 240, 119 / 240))
    assert "it was not there" in late.message


@pytest.mark.parametrize("engine", ENGINES)
def test_a_run_does_not_wait_for_a_body_that_an_event_lets_appear(tmp_path: Path, engine: str) -> None:
    events = [{**PASSES, "do": [{"appear": "crate"}]}]
    expect = [{"travel": {"at_least": "0.3 m"}}, {"object": {"name": "crate", "moved": {"at_most": "1 m"}}}]
    keys: dict[str, Any] = {"expect": expect, "duration": None, "world": {"objects": [CRATE]}, "backend": engine}
    found = run(tmp_path, events=events, **keys)
    assert (found.end, [verdict.status for verdict in found.verdicts]) == ("goals met", ["passed"] * 2)
    never = run(tmp_path, events=[{**events[0], "when": {"stl": "x > 9 m"}}], **keys)
    message = "crate never appeared: it waits for an event, but the run ended at "
    assert (never.end, never.verdicts[1].status) == ("goals met", "not_exercised")
    assert never.verdicts[1].message.startswith(message)


@pytest.mark.parametrize("engine", ENGINES)
def test_command_sources_start_and_stop(tmp_path: Path, engine: str) -> None:
    """A robot that stops for an event, and goes back with another, does what one source says that has both times."""
    sources = [
        {"twist": [{"linear": 0.4}], "name": "go", "rate": 240},
        {"twist": [{"linear": -0.2}], "name": "back", "rate": 240},
    ]
    events = [
        {**PASSES, "do": [{"stop": "go"}]},
        {"when": {"event": "passes", "for": "0.5 s"}, "do": [{"start": "back"}], "name": "later"},
    ]
    found = run(tmp_path, commands=sources, events=events, backend=engine)
    (stop,), (back,) = found.events["passes"], found.events["later"]
    twist = [{"linear": 0.4, "for": stop}, {"linear": 0, "for": back - stop}, {"linear": -0.2}]
    stated = run(tmp_path, commands=[{"twist": twist, "rate": 240}], backend=engine)
    assert back == pytest.approx(stop + 0.5)
    assert found.digest == stated.digest


@pytest.mark.parametrize("engine", ENGINES)
def test_another_robot_starts_and_stops(tmp_path: Path, engine: str) -> None:
    """A robot that comes from the side, where the other one is; all of its sources have its name."""
    robot = {"name": "other", "model": "turtlebot3_burger", "pose": {"x": 0.6, "y": -0.3, "yaw": "90 deg"}}
    events = [
        {**PASSES, "do": [{"start": "other"}]},
        {"name": "later", "when": {"event": "passes", "for": "0.5 s"}, "do": [{"stop": "other/twist"}]},
    ]

    def other(*twist: dict[str, float]) -> dict[str, Any]:
        return {"world": {"actors": [{**robot, "commands": {"twist": [*twist], "rate": 240}}]}, "backend": engine}

    keys: dict[str, Any] = {"expect": [{"object": {"name": "other", "moved": {"at_least": 0.05}}}]}
    found = run(tmp_path, events=events, **keys, **other({"linear": 0.3}))
    (start,), (stop,) = found.events.values()
    twist = [{"linear": 0.0, "for": start}, {"linear": 0.3, "for": stop - start}, {"linear": 0.0}]
    stated = run(tmp_path, **keys, **other(*twist))
    assert [verdict.status for verdict in found.verdicts] == ["passed"]
    assert (found.digest, found.verdicts) == (stated.digest, stated.verdicts)


def wheels(value: float) -> dict[str, float]:
    return {"wheel_left_joint": value, "wheel_right_joint": value}


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    ("source", "stays"),
    [
        ({"joints": [{"at": 0, "velocity": wheels(9)}]}, True),
        ({"joints": [{"at": 0.1, "position": wheels(0)}, {"at": 2, "position": wheels(16)}]}, True),
        ({"joints": [{"at": 0, "effort": wheels(0.02)}]}, False),
    ],
    ids=["velocity", "position", "effort"],
)
def test_what_a_stopped_source_commanded_ends(tmp_path: Path, engine: str, source: Any, stays: bool) -> None:
    """Targets of positions and velocities hold the joints where they are; without efforts and forces they roll on."""
    end = {"when": {"event": "passes", "for": "0.4 s"}, "do": ["end"]}
    events = [{**PASSES, "do": [{"stop": next(iter(source))}]}, end]
    keys: dict[str, Any] = {"commands": [source], "backend": engine, "trace": {"rate": 240}, "time_limit": "6 s"}
    found = run(tmp_path, events=events, **keys)
    (stop,), _ = found.events.values()
    before, last = float(found.trace.speed[found.trace.time <= stop][-1]), float(found.trace.speed[-1])
    assert before > 0.1
    assert last == pytest.approx(0.0 if stays else before, abs=0.03)


def test_late_commands_of_a_stopped_source_do_not_arrive_when_it_starts_again(tmp_path: Path) -> None:
    twist = {"twist": [{"linear": 0.3, "for": 0.8}, {"linear": 0.2}], "rate": 10, "latency": 0.2}
    does = {0.1: "start", 1.0: "stop", 2.0: "start"}
    events = [{"when": {"at": at}, "do": [{do: "twist"}]} for at, do in does.items()]
    keys: dict[str, Any] = {"expect": ["upright"], "trace": {"rate": 240}, "duration": 2.4, "time_limit": 2.4}
    seen = run(tmp_path, commands=[twist], events=events, **keys).trace
    speeds = seen.speed[np.searchsorted(seen.time, (0.9, 1.9, 2.18, 2.35))]
    assert (speeds > 0.1).tolist() == [True, False, False, True]


@pytest.mark.parametrize("engine", ENGINES)
def test_the_force_of_a_stopped_source_ends(tmp_path: Path, engine: str) -> None:
    lifts = {"name": "lifts", "wrench": {"link": "base_footprint", "force": [0, 0, 20], "point": [-0.03, 0, 0.07]}}
    events = [
        {"name": "up", "when": {"stl": "z > 0.1 m"}, "do": [{"stop": "lifts"}]},
        {"when": {"event": "up", "for": "50 ms"}, "do": ["end"]},
    ]
    keys: dict[str, Any] = {"expect": [{"max_speed": {"linear": 5}}], "trace": {"rate": 240}, "backend": engine}
    found = run(tmp_path, commands=[lifts], events=events, **keys)
    time, height = found.trace.time, found.trace.base_position_xyz[:, 2]
    assert found.end == "event"
    assert np.polyfit(time[2:12], height[2:12], 2)[0] > 2
    assert 2 * np.polyfit(time[-12:], height[-12:], 2)[0] == pytest.approx(-9.8, abs=2)


@pytest.mark.parametrize(
    "when",
    [
        {"reach": {"x": 0.2, "y": 0, "tolerance": "5 cm"}},
        {"stl": "base_footprint.x > 0.15 m and distance(base_scan, ball) > 0"},
        {"stl": "eventually (x > 0.15 m)"},
        {"at_once": [{"reach": {"x": 0.2, "y": 0}}, "upright"]},
        {"not": {"stay_within": {"x": [-1, 0.15]}}},
    ],
)
def test_conditions_of_all_kinds_see_the_same_moment(tmp_path: Path, when: Any) -> None:
    world = {"objects": [{"name": "ball", "sphere": {"radius": 0.1}, "mass": 1, "pose": {"y": 2}}]}
    found = run(tmp_path, events=[{"name": "there", "when": when, "do": ["end"]}], expect=["upright"], world=world)
    assert found.trace.base_position_xyz[-1, 0] == pytest.approx(0.15, abs=0.003)


def test_contact_and_events_before_are_conditions(tmp_path: Path) -> None:
    wall = {"name": "wall", "box": [0.1, 2, 0.5], "pose": {"x": 0.5}}
    events = [
        {"name": "bumps", "when": {"contact": {"with": "wall"}}, "do": [{"stop": "twist"}]},
        {"when": {"event": "bumps", "for": "0.3 s"}, "do": ["end"]},
    ]
    found = run(tmp_path, world={"objects": [wall]}, events=events, expect=["upright"])
    (bump,), (over,) = found.events.values()
    assert found.end == "event"
    assert over == found.sim_time == pytest.approx(bump + 0.3)
    assert found.trace.speed[-1] < 0.01


def test_an_event_happens_once_or_each_time(tmp_path: Path) -> None:
    """A robot that drives to and fro passes a line several times; it must leave before it can pass it again."""
    commands = [{"twist": [{"linear": 0.4, "for": 0.8}, {"linear": -0.4, "for": 1.4}, {"linear": 0.4}]}]
    for when in ({"stl": "x > 0.15 m"}, {"not": {"stay_within": {"x": [-1, 0.15]}}}):
        event = {"name": "passes", "when": when, "do": [{"disturb": {"velocity": [0, 0.05, 0]}}]}
        once = run(tmp_path, commands=commands, events=[event])
        often = run(tmp_path, commands=commands, events=[{**event, "every": True}], duration="4 s", time_limit="4 s")
        assert len(once.events["passes"]) == 1
        assert len(often.events["passes"]) == 2
        assert often.events["passes"][0] == once.events["passes"][0]


def test_an_event_that_never_came_is_told_and_its_expectation_not_exercised(tmp_path: Path) -> None:
    found = run(
        tmp_path,
        events=[{"name": "far", "when": {"reach": {"x": 3, "y": 0}}, "do": [{"disturb": {"velocity": [0, 1, 0]}}]}],
        expect=[{"travel": {"at_least": "0.1 m"}}, {"upright": {}, "since": "far"}],
    )
    travel, upright = found.verdicts
    (finding,) = (finding for finding in found.findings if finding.rule == "event-never-began")
    assert (travel.status, upright.status) == ("passed", "not_exercised")
    assert upright.message == "never checked: event 'far' never happened"
    assert finding.path == ("events", 0, "when")
    assert "event 'far' never happened: came no closer than 2." in finding.message
    assert "so not: pushed by 1 m/s" in finding.message


def test_events_that_did_not_happen_say_what_was_missing(tmp_path: Path) -> None:
    """The run ends before a wait is over, or a formula is true."""
    events = [
        {**PASSES, "do": [{"disturb": {"velocity": [0, 0, 0.01]}}]},
        {"name": "later", "when": {"event": "passes", "for": "5 s"}, "do": ["end"]},
        {"name": "latest", "when": {"event": "later"}, "do": ["end"]},
        {"name": "far", "when": {"stl": "x > 50 m"}, "do": ["end"]},
    ]
    found = run(tmp_path, events=events, expect=["upright"])
    messages = [finding.message for finding in found.findings if finding.rule == "event-never-began"]
    nearest = "it waits for x > 50 m, which was nearest at 2.00 s"
    missing = 50 - found.trace.base_position_xyz[-1, 0]
    due = found.events["passes"][0] + 5
    assert messages == [
        f"event 'later' never happened: it is due at {due:.4g} s, but the run ended at 2 s (so not: the run ends)",
        "event 'latest' never happened: it waits for event 'later', and the run ended at 2 s (so not: the run ends)",
        f"event 'far' never happened: {nearest} and missed by {missing:.4g} m (so not: the run ends)",
    ]


def test_a_body_that_is_not_there_cannot_be_pushed(tmp_path: Path) -> None:
    """Which of two events comes first, only the run shows."""
    events = [
        {"name": "gone", "when": {"at": "0.5 s"}, "do": [{"remove": "crate"}]},
        {**PASSES, "do": [{"disturb": {"velocity": [1, 0, 0], "body": "crate"}}]},
    ]
    with pytest.raises(RunError, match=r"event 'passes' disturbs body 'crate' at .* s, but it was removed before"):
        run(tmp_path, world={"objects": [CRATE]}, events=events)


def test_a_condition_may_wait_for_an_event(tmp_path: Path) -> None:
    """A robot that is slow before it starts does not count as one that has stopped."""
    events = [
        {**PASSES, "do": [{"stop": "twist"}]},
        {"name": "rests", "when": {"max_speed": {"linear": 0.01}, "since": "passes"}, "do": ["end"]},
    ]
    found = run(tmp_path, events=events, expect=["upright"])
    (passes,), (rests,) = found.events.values()
    assert passes + 0.2 < rests == found.sim_time


def test_an_expectation_is_judged_from_its_event_on(tmp_path: Path) -> None:
    found = run(
        tmp_path,
        events=[{**PASSES, "do": [{"stop": "twist"}]}],
        expect=[{"max_speed": {"linear": "0.3 m/s"}, "since": "passes"}, {"travel": {"at_least": "0.1 m"}}],
    )
    assert found.verdicts[0].status == "failed"
    assert found.verdicts[0].time == pytest.approx(found.events["passes"][0], abs=0.01)


@given(st.lists(st.tuples(st.floats(0.1, 2), st.floats(0, 5)), max_size=5), st.floats(0, 12))
def test_a_path_goes_as_far_as_its_paces_say(changes: list[tuple[float, float]], time: float) -> None:
    ends = list(accumulate(wait for wait, _ in changes))
    pace = tuple(Pace(at=at, speed=speed) for at, (_, speed) in zip(ends, changes, strict=True))
    points = (PathPoint(at=0.0, x=0.0), PathPoint(at=100.0, x=100.0))
    path = PosePath.of(Placement(), points, pace=pace)
    spans = zip([0.0, *ends], [*ends, math.inf], [1.0, *(speed for _, speed in changes)], strict=True)
    way = sum(speed * max(0.0, min(end, time) - begin) for begin, end, speed in spans)
    assert path.pose(time).position_xyz[0] == pytest.approx(way)
    assert path.fastest(0.0)[0] == pytest.approx(max([1.0, *(speed for _, speed in changes)]))


@pytest.mark.parametrize(
    ("events", "message"),
    [
        ("[{when: {stl: x > 1}, do: [{remove: wal}]}]", "there is no object 'wal'; did you mean 'wall'?"),
        ("[{when: {event: passd}, do: [end]}, {name: passed, when: {at: 1 s}, do: [end]}]", "did you mean 'passed'?"),
        ("[{when: {at: 9 s}, do: [end]}]", "9 s is not earlier than time_limit (8 s)"),
        ("[{when: {evnt: a}, do: [end]}]", "has no condition: 'evnt'; did you mean 'event'?"),
        ("[{when: {at: 1 s}, do: []}]", "must not be empty"),
        ("[{when: {at: 1 s}, do: [{start: wall}]}]", "object 'wall' has no 'path'"),
        ("[{when: {at: 1 s}, do: [{start: twst}]}]", "robot or object with a path named 'twst'; did you mean 'twist'?"),
        ("[{when: {stl: always (x < 1)}, do: [end]}]", "looks ahead by more than 60 s"),
        ("[{when: {all_of: [upright]}, do: [end]}]", "nothing can happen then; use at_once"),
        ("[{when: {at_once: [upright, {stl: x > 1}]}, do: [end]}]", "one formula, such as stl: x > 1 m and clearance"),
        ("[{when: {any_of: [upright, {stl: x > 1}]}, do: [end]}]", "one formula, such as stl: x > 1 m or clearance"),
        ("[{when: {final_pose: {x: 1}}, do: [end]}]", "nothing can happen then; use an stl formula"),
        (
            "[{name: a, when: {event: b}, do: [end]}, {name: b, when: {event: a}, do: [end]}]",
            "these events wait for each other, so none of them can happen: a -> b -> a",
        ),
        ("[{name: a, when: {at: 1 s}, do: [end]}, {name: a, when: {at: 2 s}, do: [end]}]", "a second event named 'a'"),
        (
            """[{name: a, when: {at: 1 s}, do: [{remove: crate}]},
            {when: {event: a}, do: [{disturb: {velocity: [1, 0, 0], body: crate}}]}]""",
            "event 'a', which comes before, removes 'crate'",
        ),
        ("[{when: {at: 1 s}, do: [{disturb: {force: [1, 0, 0], for: 1 s, link: nose}}]}]", "no link 'nose'"),
        ("[{when: {at: 1 s}, do: [{fault: {motor: wheel, off: true}}]}]", "wheel"),
        ("[{when: {at: 1 s, event: a}, do: [end]}]", "a condition is an assertion, 'at' or 'event'"),
        ("[{when: {at: 1 s}, do: [{end: true, remove: crate}]}]", "an action has exactly one of"),
        ("[{when: {stl: x > 1}, every: true, do: [{remove: crate}]}]", "would remove each time"),
        ("[{when: {at: 1 s}, every: true, do: [end]}]", "1 s comes once; remove 'every'"),
        ("[{when: {at: 1 s}, do: [{stop: idle}]}]", "robot 'idle' has no 'commands', so there is nothing to stop"),
        ("[{when: {at: 1 s}, do: [{appear: late}]}]", "'late' states 2 s for that; remove one of the two"),
        ("[{when: {at: 1 s}, do: [{repair: arm}]}]", "there is no fault of a motor or sensor 'arm'"),
        ("[{when: {object: {name: crat, upright: {}}}, do: [end]}]", "did you mean 'crate'?"),
    ],
)
def test_what_is_wrong_is_named_with_its_remedy(tmp_path: Path, events: str, message: str) -> None:
    wall = "{name: wall, box: [0.1, 1, 1], pose: {x: 3}}"
    crate = "{name: crate, box: [0.1, 0.1, 0.1], mass: 1, pose: {x: 2}}"
    late = "{name: late, sphere: {radius: 0.1}, pose: {y: 3}, appears: 2 s}"
    text = f"""
name: burger
robot: {{model: turtlebot3_burger}}
world:
  objects: [{wall}, {crate}, {late}]
  actors: [{{name: idle, model: turtlebot3_burger, pose: {{y: -2}}}}]
  disturbances: [{{at: 1 s, velocity: [0.5, 0, 0]}}]
commands: {{twist: [{{linear: 0.2}}]}}
events: {events}
expect: [{{travel: {{at_least: 1}}}}]
time_limit: 8 s
"""
    problems = told(tmp_path, text)
    assert any(message in problem for problem in problems), problems


def test_a_refused_event_shifts_no_other(tmp_path: Path) -> None:
    events = "[{when: {at: 1 s}, do: []}, {name: a, when: {event: b}, do: [{remove: box}]}]"
    text = LEAST.replace("name: burger drives straight\n", f"name: a\nevents: {events}\n")
    [problem] = told(tmp_path, text)
    assert problem.endswith("events.0.do: must not be empty")
