"""Links of one robot that touch each other: first contact and forces by geometry and statics, on every engine."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from sim_action.core.errors import BadStart, EngineError
from sim_action.robot.model.robot_spec import Robot
from sim_action.state.command import JointTargets
from sim_action.state.observation import SelfContact
from sim_action.state.trace import Trace
from sim_action.world import World
from sim_action.world.scene import Scene
from tests.integration.engines import advance, inertia, on_every_engine, running, scene_of, scene_of_file
from tests.simulated import simulated

RATE = 240
UPPER, FOREARM, BALL, TIP = 0.3, 0.25, 0.1, 0.05
MASSES = f'<inertial><mass value="1"/>{inertia(0.01)}</inertial>'
WEIGHTLESS = World(gravity=(0.0, 0.0, 0.0))
ARM = """
<robot name="arm">
  <link name="base">{masses}<collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <link name="upper">{masses}
    <collision><origin xyz="0.2 0 0"/><geometry><box size="0.1 0.02 0.02"/></geometry></collision></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="50" velocity="9"/></joint>
  <link name="forearm">{masses}
    <collision><origin xyz="0.25 0 0"/><geometry><sphere radius="0.05"/></geometry></collision></link>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="forearm"/><origin xyz="0.3 0 0"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="50" velocity="9"/></joint>
  <gazebo reference="forearm"><mu1>0</mu1></gazebo>
</robot>
"""
# The elbow's angle at which the tip touches the base, by the law of cosines.
TOUCH = math.acos(((BALL + TIP) ** 2 - UPPER**2 - FOREARM**2) / (2 * UPPER * FOREARM))


def arm(folder: Path, *, urdf: str = ARM, joints: dict[str, float] | None = None, **robot: Any) -> Scene:
    spec = Robot(model="robot.urdf", base="fixed", joints={**(joints or {})}, **robot)
    return scene_of(folder, urdf.format(masses=MASSES), spec, WEIGHTLESS)


def folded(engine: str, scene: Scene, targets: Sequence[JointTargets]) -> Trace:
    with running(engine, scene, self_contacts=True) as backend:
        return advance(backend, 0, len(targets), *targets)


def slowly(end: float, seconds: float = 1.0) -> list[JointTargets]:
    steps = round(seconds * RATE)
    return [JointTargets(position={"shoulder": 0.0, "elbow": end * step / steps}) for step in range(1, steps + 1)]


def angle_at(trace: Trace, touch: SelfContact) -> float:
    row = round(touch.time * RATE) - 1
    return float(trace.joint_position[row, trace.joint_names.index("elbow")])


@on_every_engine
@pytest.mark.parametrize("collides", [True, False])
def test_the_first_touch_is_at_the_angle_of_the_geometry(engine: str, collides: bool, tmp_path: Path) -> None:
    trace = folded(engine, arm(tmp_path, self_collision=collides), slowly(1.1 * TOUCH))
    first = trace.self_contacts[0]
    assert (first.link, first.other) == ("base", "forearm")
    # Within the angle of one step; the watch needs an overlap of 0.1 mm.
    assert angle_at(trace, first) == pytest.approx(TOUCH, abs=1.5 * 1.1 * TOUCH / RATE)
    # The base stands on the ground.
    x, y, z = first.position_xyz
    assert math.hypot(x, y, z - BALL) == pytest.approx(BALL, abs=0.01)
    last = float(trace.joint_position[-1, trace.joint_names.index("elbow")])
    assert (last < TOUCH + 0.01) == collides


@on_every_engine
def test_a_pressed_link_is_in_balance(engine: str, tmp_path: Path) -> None:
    """Without friction, the normal force on its lever about the elbow is the motor's effort."""
    effort = 5.0
    scene = arm(tmp_path, self_collision=True, joints={"elbow": 0.98 * TOUCH})
    targets = [JointTargets(position={"shoulder": 0.0}, effort={"elbow": effort})] * RATE
    trace = folded(engine, scene, targets)
    last = [touch for touch in trace.self_contacts if touch.time == trace.time[-1]]
    lever = UPPER * FOREARM * math.sin(TOUCH) / (BALL + TIP)
    assert sum(touch.force for touch in last) == pytest.approx(effort / lever, rel=0.01)


@on_every_engine
@pytest.mark.parametrize("collides", [True, False])
def test_an_arm_that_stops_before_the_touch_has_none(engine: str, collides: bool, tmp_path: Path) -> None:
    trace = folded(engine, arm(tmp_path, self_collision=collides), slowly(TOUCH - 0.01))
    assert trace.self_contacts == ()
    assert trace.contacts == ()


def deep_arm() -> str:
    """Return an arm whose forearm reaches into the base, with a hand that does not."""
    deep = ARM.replace('<sphere radius="0.05"/>', '<sphere radius="0.46"/>')
    hand = '<link name="hand">{masses}<collision><geometry><sphere radius="0.01"/></geometry></collision></link>'
    joint = '<joint name="wrist" type="revolute"><parent link="forearm"/><child link="hand"/><origin xyz="0.25 0 0"/>'
    limit = '<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="50" velocity="9"/></joint></robot>'
    return deep.replace("</robot>", f"{hand}{joint}{limit}")


@on_every_engine
@pytest.mark.parametrize("collides", [True, False])
def test_links_that_touch_where_the_model_puts_them_are_left_out_with_a_note(
    engine: str, collides: bool, tmp_path: Path
) -> None:
    """The forearm is drawn through the base. The hand is not, and counts."""
    scene = arm(tmp_path, urdf=deep_arm(), self_collision=collides)
    with running(engine, scene, self_contacts=True) as backend:
        trace = advance(backend, 0, 24)
        (note,) = backend.model_notes
    assert "'base' and 'forearm' (0.01 m deep)" in note
    assert trace.self_contacts == ()
    assert abs(trace.joint_velocity).max() < 0.01


@on_every_engine
def test_a_start_inside_itself_is_refused_where_links_collide(engine: str, tmp_path: Path) -> None:
    scene = arm(tmp_path, self_collision=True, joints={"elbow": TOUCH + 0.1})
    inside = r"links inside each other: 'base' and 'forearm' \(0\.0\d+ m deep\)"
    with pytest.raises(BadStart, match=inside), running(engine, scene):
        pass
    seen = folded(engine, replace(scene, robot=scene.robot.model_copy(update={"self_collision": False})), HELD)
    assert seen.self_contacts[0].time == seen.time[0]


HELD = [JointTargets(position={"shoulder": 0.0})] * 3


@on_every_engine
def test_a_robot_whose_links_cannot_be_judged_is_refused(engine: str, tmp_path: Path) -> None:
    deep = ARM.replace('<sphere radius="0.05"/>', '<sphere radius="0.46"/>')
    with pytest.raises(EngineError, match="self-collision cannot be judged: all of them touch at the model's own"):
        folded(engine, arm(tmp_path, urdf=deep), HELD)


@pytest.mark.parametrize(
    ("bits", "contact", "touches"),
    [
        ("", "", True),
        ('contype="2" conaffinity="2"', "", False),
        ('contype="2" conaffinity="1"', "", True),
        ('contype="2" conaffinity="2"', '<pair geom1="ball" geom2="tip"/>', True),
    ],
)
def test_geoms_of_mjcf_touch_as_their_bits_and_pairs_say(
    bits: str, contact: str, touches: bool, tmp_path: Path
) -> None:
    pytest.importorskip("mujoco")
    joint = '<joint type="hinge" axis="0 0 1" range="-170 170" name="{}"/>'
    text = (
        '<mujoco model="arm"><worldbody><body name="base" pos="0 0 0.1"><geom name="ball" size="0.1"/>'
        f'<body name="upper">{joint.format("shoulder")}<geom type="box" pos="0.2 0 0" size="0.05 0.01 0.01"/>'
        f'<body name="forearm" pos="0.3 0 0">{joint.format("elbow")}'
        f'<geom name="tip" size="0.05" pos="0.25 0 0" {bits}/></body></body></body></worldbody>'
        f"<contact>{contact}</contact></mujoco>"
    )
    scene = scene_of_file(tmp_path, "arm.xml", text, WEIGHTLESS, base="fixed", self_collision=True)
    if not touches:
        with pytest.raises(EngineError, match="no two links of the robot can touch"):
            folded("mujoco", scene, slowly(0.1))
        return
    first = folded("mujoco", scene, slowly(1.1 * TOUCH)).self_contacts[0]
    assert (first.link, first.other) == ("base", "forearm")


@on_every_engine
@pytest.mark.parametrize(("margin", "status"), [(0.01, "passed"), (-0.02, "failed")])
def test_a_scenario_passes_and_fails_by_a_hair(engine: str, margin: float, status: str, tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(ARM.format(masses=MASSES))
    points = [{"at": 1, "position": {"elbow": TOUCH - margin}}]
    keys = {"world": {"gravity": 0}, "commands": {"joints": points, "rate": 240}, "duration": 1.2, "time_limit": 2}
    run = simulated(tmp_path, {**SCENARIO, "backend": engine, **keys})
    assert [verdict.status for verdict in run.verdicts] == [status]
    assert not any("pass through each other" in note for note in run.model_notes)


SCENARIO = {"name": "a", "robot": {"model": "arm.urdf", "base": "fixed"}, "expect": ["self_collision"]}


@on_every_engine
def test_every_report_shows_the_pairs_that_are_left_out(engine: str, tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(deep_arm().format(masses=MASSES))
    run = simulated(tmp_path, {**SCENARIO, "backend": engine, "time_limit": 0.05})
    assert any("links that touch at the model's own position do not count" in note for note in run.model_notes)
