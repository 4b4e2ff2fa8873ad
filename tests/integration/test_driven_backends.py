"""What drives ask of a backend, on every engine, against analytic results: pushing a base, and rotors of motors."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim_action.core.field_types import Placement
from sim_action.robot.model.robot_spec import Robot
from sim_action.state.command import NO_PUSH, BasePush, JointTargets
from sim_action.state.trace import Trace
from tests.integration.engines import advance, at, on_every_engine, running, scene_of, travelled
from tests.physics.robots import collision, diagonal, inertial, link, robot

pytestmark = on_every_engine

# On ice; its centre of mass is not where its link is.
PUCK = robot(
    link(
        "puck",
        inertial(4.0, (0.5, 0.5, 0.8), (0.3, 0.1, 0.0)) + collision('<box size="1 1 0.1"/>', (0.3, 0.1, 0.0)),
        friction=0.0,
    )
)


def pushed(engine: str, folder: Path, push: BasePush, steps: int, **pose: float) -> Trace:
    return travelled(engine, scene_of(folder, PUCK, at(**pose)), steps, JointTargets(base=push))


def test_a_push_is_force_over_mass_until_it_is_as_fast_as_wanted(engine: str, tmp_path: Path) -> None:
    push = BasePush((1.5, 2.0), 0.0, (0.3, 0.1, 0.0), max_force=10.0, max_torque=100.0)
    trace = pushed(engine, tmp_path, push, 360)
    # 2.5 m/s^2 along (0.6, 0.8): 2.5 m/s are reached after a second.
    assert trace.base_linear_xyz[119, :2] == pytest.approx([0.75, 1.0], rel=1e-3)
    assert trace.base_linear_xyz[239:, :2] == pytest.approx(np.tile([1.5, 2.0], (121, 1)), rel=1e-3)
    assert trace.base_position_xyz[239, :2] - trace.base_position_xyz[0, :2] == pytest.approx([0.75, 1.0], rel=0.01)
    assert np.abs(np.unwrap(trace.yaw)).max() < 1e-3


def test_a_push_turns_by_torque_over_inertia_until_it_is_as_fast_as_wanted(engine: str, tmp_path: Path) -> None:
    push = BasePush((0.0, 0.0), 1.0, (0.3, 0.1, 0.0), max_force=0.0, max_torque=0.4)
    trace = pushed(engine, tmp_path, push, 720)
    # 0.4 N m on 0.8 kg m^2.
    assert trace.base_angular_xyz[239, 2] == pytest.approx(0.5, rel=1e-3)
    assert trace.base_angular_xyz[599:, 2] == pytest.approx(np.ones(121), rel=0.01)


def test_a_push_is_along_the_bases_own_axes_and_of_its_links_origin(engine: str, tmp_path: Path) -> None:
    push = BasePush((1.0, 0.0), 1.0, (0.3, 0.1, 0.0), max_force=1e6, max_torque=1e6)
    trace = pushed(engine, tmp_path, push, 480, yaw=0.5)
    # From t = 1 s on, its origin goes round a circle of 1 m, whose middle is to its left.
    end, yaw = trace.base_position_xyz[240:, :2], trace.yaw[240:]
    middles = end + np.column_stack((-np.sin(yaw), np.cos(yaw)))
    assert np.ptp(middles, axis=0).max() < 0.01
    assert np.abs(trace.speed[240:] - 1.0).max() < 0.01


FAST, HALT = (BasePush((speed, 0.0), 0.0, (0.3, 0.1, 0.0), 40.0, 10.0) for speed in (1.0, 0.0))


@pytest.mark.parametrize(("friction", "reached", "then"), [("0", 0.999, HALT), ("0.5", 0.8, NO_PUSH)])
def test_a_push_lasts_until_another_or_until_the_base_is_let_go(
    engine: str, friction: str, reached: float, then: BasePush, tmp_path: Path
) -> None:
    urdf = PUCK.replace('friction value="0"', f'friction value="{friction}"')
    with running(engine, scene_of(tmp_path, urdf, at())) as backend:
        there = advance(backend, 0, 240, JointTargets(base=FAST))
        still = advance(backend, 240, 240, JointTargets(base=then))
    assert reached < there.speed[-1] < 1.001
    assert still.speed[-1] == pytest.approx(0.0, abs=1e-3)


# The wheel's axle is its link's z, which lies along y; its inertia stands in a frame of its own, where the axle is x.
WHEEL = f"""<robot name="wheel"><link name="base">{inertial(1.0, (1.0, 1.0, 1.0))}</link>
  <joint name="axle" type="continuous"><parent link="base"/><child link="wheel"/>
    <origin rpy="-1.5707963267948966 0 0"/><axis xyz="0 0 1"/></joint>
  <link name="wheel"><inertial><origin rpy="0 -1.5707963267948966 0"/><mass value="1"/>
  {diagonal((0.1, 0.05, 0.05))}</inertial></link></robot>"""


@pytest.mark.parametrize(("rotors", "inertia"), [({}, 0.1), ({"axle": 0.4}, 0.5)])
def test_a_torque_turns_a_wheel_together_with_the_rotor_of_its_motor(
    engine: str, rotors: dict[str, float], inertia: float, tmp_path: Path
) -> None:
    scene = scene_of(tmp_path, WHEEL, Robot(model="robot.urdf", base="fixed", pose=Placement(z=1.0)))
    trace = travelled(engine, replace(scene, rotors=rotors), 240, JointTargets(effort={"axle": 2.0}))
    assert trace.joint_velocity[-1, 0] == pytest.approx(2.0 / inertia, rel=1e-6)
