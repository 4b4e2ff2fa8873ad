"""The robot touches nothing but the ground, and no link of it another one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from sim_action.assertions.monitors.contacts import nearest_of
from sim_action.assertions.no_collision import NoCollision, SelfCollision
from sim_action.state.observation import SelfContact
from sim_action.state.trace import Trace
from sim_action.state.trace_records import ClearanceRecord, ClearanceWatch, Nearness
from sim_action.state.verdict import Verdict
from tests.robot.reading.test_srdf import model_with
from tests.scenarios import told
from tests.traces import START, contact, judged, scene, trace

TOUCHED = trace([1.0, 2.0, 3.0], contacts=[contact(2.0), contact(2.0, link="base_scan"), contact(3.0)])


def test_a_robot_that_touches_nothing_passes() -> None:
    assert judged(NoCollision(), trace([1.0, 2.0])) == Verdict(True, 0.0, 0.0, 0.0, "contacts", 2.0, "touched nothing")


def test_the_first_contact_is_named() -> None:
    message = "base_footprint touched wall at 2.00 s, at (1.00, 0.25, 0.10) m, with 12.5 N in that physics step"
    assert judged(NoCollision(), TOUCHED) == Verdict(False, 1.0, 0.0, -1.0, "contacts", 2.0, message, body="wall")
    standing = judged(NoCollision(), trace([0.0, 1.0], contacts=[contact(0.0, body="floor")]))
    assert standing.message.endswith("in that physics step; if the robot stands on it, add allow: [floor]")


def test_the_force_is_that_of_all_points_of_the_step() -> None:
    points = [contact(2.0, force=30.0), contact(2.0, force=40.0), contact(2.0, body="ball"), contact(2.1, force=9.0)]
    assert judged(NoCollision(), trace([2.0], contacts=points)).message.endswith("with 70 N in that physics step")
    hard = trace([2.0], contacts=[contact(2.0, force=1234.5)])
    assert judged(NoCollision(), hard).message.endswith("with 1234 N in that physics step")


def test_the_ground_never_counts_but_a_link_called_ground_is_none() -> None:
    grounded = trace([1.0], contacts=[contact(1.0, body="ground")])
    assert judged(NoCollision(), grounded).passed
    assert judged(NoCollision(allow=("ground",)), grounded).passed
    assert not judged(NoCollision(), trace([1.0], contacts=[contact(1.0, link="ground")])).passed


@pytest.mark.parametrize(
    ("allow", "first"),
    [
        ((), "base_footprint"),
        (("base_footprint",), "base_scan"),
        (("base_footprint", "base_scan"), None),
        (("wall",), None),
        (("ball",), "base_footprint"),
    ],
)
def test_what_is_allowed_does_not_count(allow: tuple[str, ...], first: str | None) -> None:
    verdict = judged(NoCollision(allow=allow), TOUCHED)
    assert verdict.passed is (first is None)
    assert verdict.message.startswith(f"{first} touched" if first else "touched nothing")


def test_names_that_are_not_there_are_problems() -> None:
    spec = NoCollision(allow=("wall", "wal", "base_scan", "ground"))
    assert [(path, message.partition(" (")[0]) for path, message in spec.problems(scene())] == [
        (("allow", 1), "'wal' is neither an object nor a link; did you mean 'wall'?")
    ]
    # Only the first unknown names are told what there is.
    told = [message for _, message in NoCollision(allow=("wal",) * 20).problems(scene())]
    assert ["(allowed: " in message for message in told] == [True] * 10 + [False] * 10


def test_a_contact_without_a_force_is_told_as_such() -> None:
    stuck = contact(0.3, force=0.0)._replace(has_force=False)
    seen = trace([0.1, 0.2, 0.3], contacts=[stuck])
    verdict = judged(NoCollision(), seen)
    assert not verdict.passed
    assert verdict.message.endswith("at (1.00, 0.25, 0.10) m, with no computed force (neither gives way)")
    assert [signal.name for signal in NoCollision().signals(scene(), START, seen)] == ["touching something"]
    hard = trace([0.1, 0.2, 0.3], contacts=[stuck, contact(0.3)])
    assert len(NoCollision().signals(scene(), START, hard)) == 2


WALL = ClearanceWatch(bodies=("wall",))
FAR, NEAR = Nearness(1.0, 2.0, "base_scan", "wall"), Nearness(2.0, 0.5, "base_scan", "wall")


def test_the_least_of_what_was_and_what_comes_is_kept() -> None:
    told = replace(trace([1.0, 2.0]), clearances={WALL: ClearanceRecord.of([FAR, NEAR])})
    assert nearest_of(told, WALL, None) == NEAR
    nearer = Nearness(0.5, 0.25, "base_scan", "wall")
    assert nearest_of(told, WALL, nearer) == nearer


def test_what_is_not_told_changes_nothing() -> None:
    nothing = replace(trace([1.0]), clearances={WALL: ClearanceRecord.of([])})
    assert nearest_of(nothing, WALL, FAR) == FAR
    assert nearest_of(trace([1.0]), WALL, FAR) == FAR
    assert nearest_of(nothing, None, None) is None


def touch(time: float, other: str = "wheel_right_link", force: float = 0.0, depth: float = 0.002) -> SelfContact:
    return SelfContact(time, "wheel_left_link", other, (1.0, 0.25, 0.1), force, depth)


def touched(*touches: SelfContact) -> Trace:
    return replace(trace([1.0, 2.0, 3.0]), self_contacts=touches)


def test_links_that_do_not_touch_pass() -> None:
    message = "its links did not touch each other"
    assert judged(SelfCollision(), touched()) == Verdict(True, 0.0, 0.0, 0.0, "contacts", 3.0, message)


def test_the_first_touch_is_named_with_the_depth_of_what_only_passes_through() -> None:
    message = (
        "wheel_left_link touched wheel_right_link at 2.00 s, at (1.00, 0.25, 0.10) m, 0.003 m deep (links pass through "
        "each other: robot.self_collision is off)"
    )
    verdict = judged(SelfCollision(), touched(touch(2.0), touch(2.0, depth=0.003), touch(3.0)))
    assert verdict == Verdict(False, 1.0, 0.0, -1.0, "contacts", 2.0, message)


def test_links_that_collide_touch_with_the_force_of_all_points() -> None:
    at = scene()
    at = replace(at, robot=at.robot.model_copy(update={"self_collision": True}))
    seen = touched(touch(2.0, force=30.0), touch(2.0, force=40.0), touch(2.0, "base_link", 9.0))
    verdict = SelfCollision().monitor(at, START).observe(seen).verdict()
    assert verdict.message.endswith("with 70 N in that physics step")
    # At the first step of a touch, an engine may have no force yet.
    assert SelfCollision().monitor(at, START).observe(touched(touch(2.0))).verdict().message.endswith("m, 0.002 m deep")


@pytest.mark.parametrize(
    ("allow", "passed"),
    [
        ((), False),
        ((("wheel_left_link", "wheel_right_link"),), True),
        ((("wheel_right_link", "wheel_left_link"),), True),
        ((("wheel_*", "wheel_*"),), True),
        ((("wheel_left_link", "base_link"),), False),
    ],
)
def test_allowed_pairs_may_touch_in_either_order(allow: tuple[tuple[str, str], ...], passed: bool) -> None:
    assert judged(SelfCollision(allow=allow), touched(touch(2.0))).passed is passed


SCENARIO = "name: arm\nrobot: {{model: arm.urdf, base: fixed{robot}}}\nexpect: [{expect}]\ntime_limit: 1 s\n"


@pytest.mark.parametrize(
    ("srdf", "robot", "expect", "problem"),
    [
        ("", "", "{self_collision: {allow: [[one, thre]]}}", "the robot has no link 'thre'; did you mean 'three'?"),
        ("", "", "{self_collision: {allow: [['*', '*']]}}", "it names every pair of links that can touch"),
        ("", "", "{self_collision: {allow: [one, three]}}", "allow: expected a list of pairs; write [[one, three]]"),
        ("", "", "{self_collision: {allow: one}}", "allow: expected a list of pairs, such as [[one, ANOTHER_LINK]]"),
        (
            "",
            "",
            "{self_collision: {allow: ['left hand', b, c]}}",
            "allow: expected a list of pairs, such as [[left hand, ANOTHER_LINK]]",
        ),
        ("", "", "{self_collision: {allow: [[base, one]]}}", "allow.0: base and one are not judged: they are neighbou"),
        (
            '<disable_default_collisions link="base"/><disable_default_collisions link="one"/>',
            ", srdf: arm.srdf",
            "self_collision",
            "it would check nothing: no two links of the robot can touch each other",
        ),
        (
            '<disable_default_collisions link="base"/><disable_default_collisions link="one"/>',
            ", srdf: arm.srdf, self_collision: true",
            "settled",
            "robot.self_collision: it has no effect: no two links of the robot can touch each other",
        ),
    ],
)
def test_what_could_check_nothing_is_refused(srdf: str, robot: str, expect: str, problem: str, tmp_path: Path) -> None:
    model_with(tmp_path, srdf)
    (found,) = told(tmp_path, SCENARIO.format(robot=robot, expect=expect))
    assert problem in found
