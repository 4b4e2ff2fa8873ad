"""Models of the world: spawned, moved, reset, deleted; changes from threads; efforts on joints."""

from __future__ import annotations

import math
import threading
from dataclasses import replace
from xml.etree.ElementTree import Element

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.field_types import Placement
from sim_action.core.geometry import Pose, Twist, quaternion_from_rpy, rotate
from sim_action.ros.ros1.node import world_models
from sim_action.state.command import Answer, JointTargets, commands_of
from sim_action.world import Body, Disturbance, World

HERE, THERE, AWAY = Pose((1.0, 2.0, 0.5)), Pose((3.0, 0.0, 0.5)), Pose((-4.0, 0.0, 0.1))
ROBOT = world_models.SpawnedRobot("rover", Element("robot"), Pose())


def box(name: str, pose: Pose = HERE) -> Body:
    return Body(name=name, box=(1.0, 1.0, 1.0), pose=Placement.of(pose))


def places(models: world_models.WorldModels) -> dict[str, tuple[float, float, float | None]]:
    return {body.name: (body.pose.x, body.pose.y, body.pose.z) for body in models.world.objects}


def test_what_comes_and_goes_after_the_ground() -> None:
    one = world_models.WorldModels(World()).with_body(box("a")).with_body(box("b"))
    assert replace(one, robot=ROBOT).names == ("ground_plane", "a", "b", "rover")
    assert places(one).keys() == {"a", "b"}
    assert places(one.with_body(box("a", THERE)))["a"] == THERE.position_xyz
    assert places(one.without("a")).keys() == {"b"}
    assert world_models.WorldModels(World(), ROBOT).without("rover").robot is None


def test_all_are_at_home_again_however_often_they_were_moved() -> None:
    first = world_models.WorldModels(World(objects=(box("wall"),)), ROBOT)
    moved = first.moved({"wall": THERE, "rover": THERE}, {"wheel": 2.0}).moved({"wall": AWAY, "rover": HERE})
    back = moved.at_spawn_poses()
    assert places(moved) == {"wall": AWAY.position_xyz}
    assert moved.robot is not None
    assert (moved.robot.pose, moved.robot.joints) == (HERE, {"wheel": 2.0})
    assert places(back) == places(first)
    assert back.robot is not None
    assert (back.robot.pose, back.robot.joints) == (Pose(), {})
    # What comes in the place of another has a home of its own.
    again = moved.without("wall").with_body(box("wall", AWAY)).without("rover")
    after = again.moved({"wall": HERE})
    assert places(after.at_spawn_poses()) == {"wall": AWAY.position_xyz}


def test_pushes_go_on_where_they_were_and_end_when_they_did() -> None:
    pushes = (Disturbance.model_validate({"at": at, "for": lasts, "force": (1.0, 0.0, 0.0)}) for at, lasts in TIMES)
    after = world_models.WorldModels(World(disturbances=tuple(pushes)), ROBOT).after(2.0)
    left = [(push.at, push.duration) for push in after.world.disturbances]
    assert left == [(0.0, 1.0), (1.0, 1.0)]
    assert after.at_spawn_poses().world.disturbances == ()


TIMES = ((0.0, 1.5), (1.0, 2.0), (3.0, 1.0))  # one that is over, one that acts, one that is to come
ANGLES = st.floats(-math.pi, math.pi)


@given(ANGLES, ANGLES, ANGLES)
def test_a_placement_is_where_the_pose_is(roll: float, pitch: float, yaw: float) -> None:
    pose = Pose((1.0, 2.0, 3.0), quaternion_from_rpy(roll, pitch, yaw))
    placed: Placement = Placement.of(pose)
    assert (placed.x, placed.y, placed.z) == (1.0, 2.0, 3.0)
    for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)):
        assert rotate(placed.orientation_xyzw, axis) == pytest.approx(rotate(pose.orientation_xyzw, axis), abs=1e-6)


EMPTY = world_models.WorldModels(World())


def refusing(_: world_models.WorldModels) -> world_models.WorldModels:
    raise ValueError("not here")


class Asking(threading.Thread):
    """A service's thread, which waits for its answer."""

    def __init__(self, changes: world_models.ChangeQueue, alter: world_models.Alter, *, restarts: bool = False) -> None:
        super().__init__()
        self._asked = changes, alter, restarts
        self.answer: str | None = "none yet"
        self.start()

    def run(self) -> None:
        changes, alter, restarts = self._asked
        self.answer = changes.request(alter, restarts_time=restarts)


def wait_for(changes: world_models.ChangeQueue) -> None:
    while not changes.has_pending():
        threading.Event().wait(0.001)


def test_who_asks_waits_until_the_change_is_made() -> None:
    changes = world_models.ChangeQueue()
    assert not changes.has_pending()
    asking = Asking(changes, lambda models: replace(models, robot=ROBOT))
    wait_for(changes)
    assert asking.is_alive()
    models, restarts = changes.apply(EMPTY)
    asking.join()
    assert models.names == ("ground_plane", "rover")
    assert (asking.answer, restarts, changes.has_pending()) == (None, False, False)


def test_what_is_refused_changes_nothing_and_a_change_may_begin_sim_time_anew() -> None:
    changes = world_models.ChangeQueue()
    for alter, answer in ((refusing, "not here"), (world_models.WorldModels.at_spawn_poses, None)):
        asking = Asking(changes, alter, restarts=True)
        wait_for(changes)
        models, restarts = changes.apply(EMPTY)
        asking.join()
        assert (models, restarts, asking.answer) == (EMPTY, answer is None, answer)


NONE: frozenset[str] = frozenset()


def efforts_in(answer: Answer) -> dict[str, float]:
    found: dict[str, float] = {}
    for command in commands_of(answer):
        if isinstance(command, JointTargets):
            found.update(command.effort)
    return found


def test_they_act_for_their_time_and_the_joint_is_let_go_once() -> None:
    efforts = world_models.JointEfforts()
    efforts.apply("a", 2.0, 1.0, 0.5)
    times = [0.99, 1.0, 1.49, 1.5, 1.6]
    told = [efforts_in(efforts.added_to(None, time, NONE)) for time in times]
    assert told == [{}, {"a": 2.0}, {"a": 2.0}, {"a": 0.0}, {}]


def test_those_of_one_joint_add_up_and_last_until_they_are_cleared() -> None:
    efforts = world_models.JointEfforts()
    efforts.apply("a", 2.0, 0.0, -1.0)
    efforts.apply("a", 3.0, 0.0, 1.0)
    efforts.apply("b", 1.0, 0.0, -1.0)
    assert efforts_in(efforts.added_to(None, 0.5, NONE)) == {"a": 5.0, "b": 1.0}
    assert efforts_in(efforts.added_to(None, 1e6, NONE)) == {"a": 2.0, "b": 1.0}
    efforts.clear("a")
    assert efforts_in(efforts.added_to(None, 1e6, NONE)) == {"a": 0.0, "b": 1.0}
    efforts.clear_all()
    assert efforts.added_to(Twist(), 1e6, NONE) == Twist()


def test_they_come_after_what_moves_the_joint_otherwise() -> None:
    efforts = world_models.JointEfforts()
    efforts.apply("a", 2.0, 0.0, 1.0)
    held = JointTargets(position={"a": 1.0})
    *_, last = commands_of(efforts.added_to(held, 0.5, NONE))
    assert last == JointTargets(effort={"a": 2.0})
    # What holds it holds it again.
    *_, last = commands_of(efforts.added_to(held, 1.0, NONE))
    assert last in (held, JointTargets())


def test_wheels_that_a_twist_turns_are_the_drives() -> None:
    efforts = world_models.JointEfforts()
    efforts.apply("wheel", 2.0, 0.0, -1.0)
    assert efforts_in(efforts.added_to(None, 0.0, frozenset({"wheel"}))) == {"wheel": 2.0}
    assert efforts_in(efforts.added_to(Twist(), 0.1, frozenset({"wheel"}))) == {}


def test_a_model_whose_base_link_is_not_at_its_origin() -> None:
    frame = world_models.ModelFrame(Pose((1.0, 0.0, 0.2)))
    turned = Pose((0.0, 0.0, 0.2), quaternion_from_rpy(0, 0, math.pi / 2))
    assert frame.pose(turned).position_xyz == pytest.approx((0, -1, 0))
    assert frame.base_pose(frame.pose(turned)).position_xyz == pytest.approx(turned.position_xyz)
    # The origin goes around the base link at a radius of 1 m.
    assert frame.twist(turned, Twist((0.0, 0.0, 0.0), (0.0, 0.0, 2.0))).linear_xyz == pytest.approx((2, 0, 0))
