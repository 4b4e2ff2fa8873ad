"""No link of the robot touches another one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from sim_action.assertions.self_collision import SelfCollision
from sim_action.state.observation import SelfContact
from sim_action.state.trace import Trace
from sim_action.state.verdict import Verdict
from tests.robot.reading.test_srdf import model_with
from tests.scenarios import told
from tests.traces import START, judged, scene, trace


def touch(time: float, other: str = "wheel_right_link", force: float = 0.0, depth: float = 0.002) -> SelfContact:
    return SelfContact(time, "wheel_left_link", other, (1.0, 0.25, 0.1), force, depth)


def touched(*touches: SelfContact) -> Trace:
    return replace(trace([1.0, 2.0, 3.0]), self_contacts=touches)


def test_links_that_do_not_touch_pass() -> None:
    message = "its links did not touch each other"
    assert judged(SelfCollision(), touched()) == Verdict(True, 0.0, 0.0, 0.0, "contacts", 3.0, message)


def test_the_first_touch_is_named_with_the_depth_of_what_only_passes_through() -> None:
    assert judged(SelfCollision(), touched(touch(2.0), touch(2.0, depth=0.003), touch(3.0))) == Verdict(
        False,
        1.0,
        0.0,
        -1.0,
        "contacts",
        2.0,
        "wheel_left_link touched wheel_right_link at 2.00 s, at (1.00, 0.25, 0.10) m, 0.003 m deep (links pass through "
        "each other: robot.self_collision is off)",
    )


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
