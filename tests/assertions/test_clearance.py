"""How near the robot comes to bodies, against hand-written records."""

from __future__ import annotations

from dataclasses import replace

from sim_action.assertions.clearance import Clearance
from sim_action.assertions.monitors import State
from sim_action.state.trace import Trace
from sim_action.state.trace_records import Channels, ClearanceRecord, ClearanceWatch, Nearness
from sim_action.state.verdict import Judged, Verdict
from sim_action.world import World
from tests.traces import judged, monitor, scene, trace

NEARER = [
    Nearness(1.0, 1.0, "base_scan", "ball"),
    Nearness(2.0, 0.5, "base_footprint", "wall"),
    Nearness(3.0, 0.125, "base_scan", "wall"),
    Nearness(4.0, -0.01, "base_scan", "ball"),
]


def seen(count: int = len(NEARER), watch: ClearanceWatch | None = None) -> Trace:
    record = ClearanceRecord.of(NEARER[:count])
    return replace(trace([1.0, 2.0, 3.0, 4.0, 5.0]), clearances={watch or ClearanceWatch(): record})


def test_the_nearest_moment_speaks_if_all_keep_clear() -> None:
    assert judged(Clearance(at_least=0.0625), seen(3)) == Verdict(
        True, 0.125, 0.0625, 0.0625, "m", 3.0, "closest approach: base_scan was 0.125 m from wall at 3.00 s"
    )


def test_the_first_that_is_too_near_speaks_though_another_comes_nearer() -> None:
    assert judged(Clearance(at_least=0.75), seen()) == Verdict(
        False, 0.5, 0.75, -0.25, "m", 2.0, "base_footprint was 0.5 m from wall at 2.00 s, less than 0.75 m", body="wall"
    )
    # What is inside is told so.
    verdict = judged(Clearance(at_least=0.05), seen())
    assert not verdict.passed
    assert verdict.measured == -0.01
    assert verdict.message == "base_scan was inside ball by 0.01 m at 4.00 s, less than 0.05 m"


def test_a_bound_may_be_met_to_the_last_bit() -> None:
    assert judged(Clearance(at_least=0.125), seen(3)).margin == 0.0
    assert judged(Clearance(at_most=0.125), seen(3)).margin == 0.0


def test_a_goal_comes_true_when_something_is_near_enough_or_says_how_near_it_came() -> None:
    assert judged(Clearance(at_most=0.25), seen()) == Verdict(
        True, 0.125, 0.25, 0.125, "m", 3.0, "base_scan was 0.125 m from wall at 3.00 s", body="wall"
    )
    assert judged(Clearance(at_most=0.25), seen(2)) == Verdict(
        False, 0.5, 0.25, -0.25, "m", 2.0, "closest approach in 5.0 s: base_footprint was 0.5 m from wall at 2.00 s"
    )


def test_near_but_not_too_near() -> None:
    spec = Clearance(at_least=0.1, at_most=0.25)
    assert judged(spec, seen(3)).passed
    assert judged(spec, seen(3)).limit == 0.25
    assert monitor(spec).observe(seen(2)).state is State.PENDING
    broken = judged(spec, seen())
    assert (broken.passed, broken.limit, broken.time) == (False, 0.1, 4.0)


def test_it_reads_its_own_channel_alone() -> None:
    spec = Clearance(at_least=0.5, to=("wall", "ball"), links=("base_scan",))
    watch = ClearanceWatch(("base_scan",), ("wall", "ball"))
    assert spec.channels == Channels(clearances=frozenset({watch}))
    never = monitor(spec).observe(seen()).verdict()
    assert never.judged == Judged()
    assert never.message == (
        "no distance to wall, ball was measured: it was not there, or no link of the robot has a collision shape"
    )
    assert not judged(spec, seen(watch=watch)).passed


def test_names_that_are_not_there_are_told_with_the_nearest() -> None:
    spec = Clearance(at_least=0.5, to=("wal", "ground"), links=("base_scan", "base_link"))
    (body, link) = spec.problems(scene())
    assert body[0] == ("to", 0)
    assert body[1].startswith("the world has no body 'wal'; did you mean 'wall'? (allowed: ball, cube, ground, wall")
    # The burger's base_link has no shape: nothing is ever near it.
    assert link[0] == ("links", 1)
    assert link[1].startswith("the robot has no link 'base_link' with a collision shape; did you mean 'base_scan'?")


def test_one_link_is_a_list_of_one() -> None:
    one, several = Clearance(at_least=0.5, link="base_scan"), Clearance(at_least=0.5, links=("base_scan",))
    assert (one.title, one.channels, one.close) == (several.title, several.channels, several.close)
    assert judged(one, seen(watch=one.watch)) == judged(several, seen(watch=several.watch))
    ((path, message),) = Clearance(at_least=0.5, link="base_scam").problems(scene())
    assert path == ("link",)
    assert "did you mean 'base_scan'?" in message


def test_a_world_without_objects_has_nothing_to_be_clear_of() -> None:
    empty = replace(scene(), world=World())
    ((path, message),) = Clearance(at_least=0.5).problems(empty)
    assert (path, message[:41]) == ((), "the world has no objects to keep clear of")
    assert list(Clearance(at_least=0.5, to=("ground",)).problems(empty)) == []
