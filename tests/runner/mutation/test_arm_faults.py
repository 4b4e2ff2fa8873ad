"""The faults of the world around a robot whose base is fixed: they follow the link that moved furthest."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from sim_action.results.outcome import Outcome
from sim_action.runner.mutation.mutant import Mutant, Original
from sim_action.runner.mutation.planning import TABLE
from sim_action.runner.mutation.world_faults import WALL, body_box, robot_boxes, touches
from sim_action.state.trace import Trace
from sim_action.world import Body
from tests.scenarios import load
from tests.traces import trace

TEXT = """\
name: arm swings
robot: {{model: ur5e_gripper}}
world:
  objects:
    - {{name: crate, box: [0.1, 0.1, 0.1], pose: {{x: {x}, y: {y}}}{mass}}}
commands: {{joints: [{{at: 2 s, position: {{shoulder_pan_joint: 90 deg}}}}]}}
expect: [{{joint: {{name: shoulder_pan_joint, near: 90 deg, tolerance: 1 deg}}}}]
time_limit: 5 s
"""


def swinging(folder: Path, angle: float = math.pi / 2, *, x: float = 0.6, y: float = 0.9, mass: str = "") -> Original:
    """An arm that is stretched out along x and turns to y, at the height of its shoulder."""
    loaded = load(folder, TEXT.format(x=x, y=y, mass=mass))
    assert loaded.model is not None
    names = tuple(joint.name for joint in loaded.model.moving_joints)
    time = [step / 10 for step in range(21)]
    still = trace(time)
    positions = np.zeros((len(time), len(names)))
    positions[:, names.index("shoulder_pan_joint")] = np.linspace(0, angle, len(time))
    seen = Trace.of_columns(
        joint_names=names,
        time=still.time,
        base_position_xyz=still.base_position_xyz,
        base_orientation_xyzw=still.base_orientation_xyzw,
        base_linear_xyz=still.base_linear_xyz,
        base_angular_xyz=still.base_angular_xyz,
        joint_position=positions,
        joint_velocity=np.zeros_like(positions),
        joint_effort=np.zeros_like(positions),
        contacts=(),
    )
    return Original(loaded, Outcome(name="arm swings", file=loaded.file, status="passed", digest="ours"), seen)


def of_kind(run: Original, kind: str) -> list[Mutant]:
    return list(next(row for row in TABLE if row.kind == kind).mutants(run))


def added(mutant: Mutant) -> Body:
    body = mutant.loaded.scenario.world.objects[-1]
    assert body.name == WALL
    return body


def test_the_box_in_the_way_of_a_hand(tmp_path: Path) -> None:
    # A box stands in the way of the hand and touches nothing at the start.
    run = swinging(tmp_path)
    assert run.moving_link is not None
    link, way = run.moving_link
    reach, angle = math.hypot(*way[0, :2]), math.atan2(way[0, 1], way[0, 0]) + 0.6 * math.pi / 2
    (mutant,) = of_kind(run, "wall")
    box = added(mutant)
    assert (box.pose.x, box.pose.y) == pytest.approx((reach * math.cos(angle), reach * math.sin(angle)), abs=0.05)
    assert mutant.words.startswith(f"a box of 0.3 m stands in the way of link '{link}', after 0.")
    assert not touches(body_box(run, box), robot_boxes(run))
    # A hand that hardly moves has a small box or none.
    (mutant,) = of_kind(swinging(tmp_path, 0.35), "wall")
    assert added(mutant).box is not None
    assert max(added(mutant).box or ()) < 0.3
    assert not of_kind(swinging(tmp_path, 0.05), "wall")
    # The box is not inside an object that can move.
    (free,) = of_kind(swinging(tmp_path), "wall")
    at = added(free).pose
    run = swinging(tmp_path, x=at.x + 0.15, y=at.y + 0.15, mass=", mass: 1")
    for mutant in of_kind(run, "wall"):
        assert not touches(body_box(run, added(mutant)), [body_box(run, run.scenario.world.objects[0])])


def test_objects_near_the_way_of_a_hand(tmp_path: Path) -> None:
    # An object moves towards the way of the hand and not into the arm.
    (mutant,) = of_kind(swinging(tmp_path, x=0.8, y=0.8), "moved")
    moved = mutant.loaded.scenario.world.objects[0].pose
    assert 0.1 < math.dist((moved.x, moved.y), (0.8, 0.8)) < 0.15
    assert moved.x == pytest.approx(moved.y, abs=0.03)
    assert moved.x < 0.8
    run = swinging(tmp_path, x=0.4, y=0.4)
    assert not touches(body_box(run, of_kind(run, "moved")[0].loaded.scenario.world.objects[0]), robot_boxes(run))
    # An object on the way of the hand moves away from the arm.
    link = swinging(tmp_path).moving_link
    assert link is not None
    x, y = link[1][10, :2].tolist()
    (mutant,) = of_kind(swinging(tmp_path, x=x, y=y), "moved")
    moved = mutant.loaded.scenario.world.objects[0].pose
    assert 0.1 < math.hypot(moved.x, moved.y) - math.hypot(x, y) < 0.15
    assert mutant.words.endswith(" m farther from the robot")


def test_an_arm_has_no_faults_of_robots_that_drive(tmp_path: Path) -> None:
    run = swinging(tmp_path)
    assert run.is_fixed
    assert not of_kind(run, "slippery")
    assert not of_kind(run, "shoved")
