"""The stops of joints in every engine: no motor moves a joint past its limits, and a joint stays at a stop."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from sim_action.robot.model.robot_spec import Robot
from sim_action.state.command import JointTargets
from sim_action.state.trace import Trace
from sim_action.world import World
from tests.integration.engines import at, inertia, on_every_engine, scene_of, travelled
from tests.physics.robots import followers

pytestmark = on_every_engine

# What the product promises.
MOST_RAD = math.radians(0.2)
MOST_M = 0.001


def link(name: str, moment: float = 1e-3) -> str:
    return f'<link name="{name}"><inertial><mass value="0.5"/>{inertia(moment)}</inertial></link>'


def joint(name: str, kind: str, lower: float, upper: float, mimic: str = "", *, effort: float = 10) -> str:
    limit = f'<limit lower="{lower}" upper="{upper}" effort="{effort}" velocity="50"/>'
    ends = f'<parent link="base"/><child link="{name}_part"/><axis xyz="0 0 1"/>'
    follows = f"<mimic {mimic}/>" if mimic else ""
    return f'<joint name="{name}" type="{kind}">{ends}{limit}{follows}</joint>{link(f"{name}_part")}'


def trace_of(
    engine: str, folder: Path, joints: str, targets: JointTargets, *, base: str = "fixed", rate: float = 240.0
) -> Trace:
    robot = Robot(model="robot.urdf", base="fixed") if base == "fixed" else at(1.0)
    urdf = f'<robot name="it">{link("base", 0.01)}{joints}</robot>'
    scene = scene_of(folder, urdf, robot, World(gravity=0), rate=rate, allow=["follower-limits"])
    return travelled(engine, scene, round(1.5 * rate), targets)


COMMANDS = {
    "gentle effort": JointTargets(effort={"j": 0.5}),
    "effort beyond its limit": JointTargets(effort={"j": 50.0}),
    "effort to the lower limit": JointTargets(effort={"j": -5.0}),
    "speed": JointTargets(velocity={"j": 20.0}),
    "speed without a limit of effort": JointTargets(velocity={"j": 20.0}, max_effort={"j": 1e6}),
    "position beyond the limit": JointTargets(position={"j": 3.0}),
    "position far below": JointTargets(position={"j": -9.0}),
}


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(("base", "rate"), [("fixed", 240.0), ("free", 1000.0)])
@pytest.mark.parametrize("stated", [("revolute", 0.0, 0.5), ("prismatic", -0.01, 0.03), ("revolute", -2.0, -0.2)])
def test_no_motor_moves_a_joint_past_its_limits(  # noqa: PLR0917 - pytest passes them by name
    engine: str, command: str, base: str, rate: float, stated: tuple[str, float, float], tmp_path: Path
) -> None:
    kind, lower, upper = stated
    targets = COMMANDS[command]
    trace = trace_of(engine, tmp_path, joint("j", kind, lower, upper), targets, base=base, rate=rate)
    position, most = trace.joint_position[:, 0], MOST_M if kind == "prismatic" else MOST_RAD
    assert position.max() <= upper + most
    assert position.min() >= lower - most
    goes_down = min([*targets.effort.values(), *targets.velocity.values(), *targets.position.values()]) < 0
    assert position[-1] == pytest.approx(lower if goes_down else upper, abs=most)
    # It rests: what a motor presses against a stop has no speed.
    assert trace.joint_velocity[-1, 0] == pytest.approx(0.0, abs=0.05)
    if "effort" in command and targets.effort:
        assert trace.joint_effort[-1, 0] == pytest.approx(targets.effort["j"])


def test_a_stop_takes_the_speed_with_an_impulse_on_both_links(engine: str, tmp_path: Path) -> None:
    trace = trace_of(engine, tmp_path, joint("j", "revolute", 0.0, 0.5), JointTargets(effort={"j": 0.5}), base="free")
    spin = trace.base_angular_xyz[:, 2]
    # Motors and stops are inside of the robot: with no gravity, its angular momentum stays 0.
    momentum = (0.01 + 1e-3) * spin + 1e-3 * trace.joint_velocity[:, 0]
    after = np.flatnonzero(trace.joint_position[:, 0] > 0.499)[0] + 2
    assert abs(momentum[after:]).max() < 1e-4
    assert abs(spin[after:]).max() < 0.01


@pytest.mark.parametrize(("multiplier", "offset"), [(1.0, 0.0), (-1.0, 0.0), (2.0, 0.1)])
def test_followers_stop_with_their_leader(engine: str, multiplier: float, offset: float, tmp_path: Path) -> None:
    mimic = f'joint="j" multiplier="{multiplier}" offset="{offset}"'
    joints = joint("j", "prismatic", 0.0, 0.04) + joint("k", "prismatic", -0.2, 0.2, mimic)
    trace = trace_of(engine, tmp_path, joints, JointTargets(effort={"j": 20.0}))
    leader, follower = trace.joint_position.T
    assert leader.max() <= 0.04 + MOST_M
    assert leader[-1] == pytest.approx(0.04, abs=MOST_M)
    assert abs(follower - multiplier * leader - offset).max() < MOST_M


def test_the_stop_of_a_follower_stops_its_leader(engine: str, tmp_path: Path) -> None:
    joints = joint("j", "revolute", 0.0, 1.0) + joint("k", "revolute", 0.0, 0.6, 'joint="j" multiplier="2"')
    trace = trace_of(engine, tmp_path, joints, JointTargets(velocity={"j": 2.0}))
    leader, follower = trace.joint_position.T
    assert follower.max() <= 0.6 + MOST_RAD
    assert leader[-1] == pytest.approx(0.3, abs=MOST_RAD)


@pytest.mark.parametrize("multiplier", [2.0, -1.0, 0.5])
def test_a_leader_has_the_limit_of_effort_that_its_model_states(engine: str, multiplier: float, tmp_path: Path) -> None:
    """A motor of 2 N m accelerates itself and the follower, whose inertia counts with the square of its ratio."""
    mimic = f'joint="j" multiplier="{multiplier}"'
    follower = joint("k", "revolute", -60.0, 60.0, mimic).replace(inertia(1e-3), inertia(0.05))
    joints = joint("j", "revolute", -30.0, 30.0, effort=2) + follower
    trace = trace_of(engine, tmp_path, joints, JointTargets(velocity={"j": 40.0}))
    moment, step = 1e-3 + 0.05 * multiplier**2, 24
    assert trace.joint_velocity[step - 1, 0] == pytest.approx(2 / moment * step / 240, rel=0.02)
    assert trace.joint_effort[step - 1, 0] == pytest.approx(2.0, rel=0.01)


@pytest.mark.parametrize(("multiplier", "mass"), [(2.0, 20.0), (1.0, 20.0), (-2.0, 0.1)])
def test_a_follower_that_its_leader_carries_stays_with_it(
    engine: str, multiplier: float, mass: float, tmp_path: Path
) -> None:
    """From the moment on at which both are released under their weight."""
    robot = at(3.0).model_copy(update={"base": "fixed"})
    scene = scene_of(tmp_path, followers(((multiplier, mass),), in_series=True), robot)
    trace = travelled(engine, scene, 60, JointTargets(position={"leader": 0.0}))
    leader, follower = trace.joint_position.T
    assert np.degrees(abs(follower - multiplier * leader)).max() < 0.05
