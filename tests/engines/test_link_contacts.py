"""The bound on the motion of two links against each other, by which a pair is measured again in time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core import geometry
from sim_action.core.geometry import Pose
from sim_action.core.lazy_numpy import FloatArray
from sim_action.core.workspace import Workspace
from sim_action.engines.link_contacts import SelfWatch, reaches
from sim_action.engines.observers import Nearest
from sim_action.robot.model.kinematics import link_poses
from sim_action.robot.model.robot_model import RobotModel, touchable_pairs
from sim_action.robot.model.robot_spec import Robot
from sim_action.robot.reading.loading import load_model
from tests.soak import examples

ARM = load_model(Robot(model="ur5e_gripper"), Workspace(Path("/"), Path("/")))
JOINTS = [joint.name for joint in ARM.moving_joints]
PAIRS = tuple(touchable_pairs(ARM))


def corners(model: RobotModel, pose: Pose, link: str) -> FloatArray:
    """The corners (P, 3) of the boxes around the shapes of a link."""
    return np.array(
        [
            geometry.compose(geometry.compose(pose, shape.pose), Pose((x, y, z))).position_xyz
            for shape in model.links_by_name[link].collisions
            for x in (shape.lower_xyz[0], shape.upper_xyz[0])
            for y in (shape.lower_xyz[1], shape.upper_xyz[1])
            for z in (shape.lower_xyz[2], shape.upper_xyz[2])
        ]
    )


def distances(positions: FloatArray) -> FloatArray:
    """The least distance between the corners of each pair, (P,) m."""
    poses = link_poses(ARM, dict(zip(JOINTS, positions.tolist(), strict=True)))
    clouds = {link: corners(ARM, poses[link], link) for pair in PAIRS for link in pair}
    return np.array([np.linalg.norm(clouds[one][:, None] - clouds[other], axis=2).min() for one, other in PAIRS])


@examples(15)
@given(st.integers(0, 2**32 - 1), st.sampled_from([1e-3, 0.1, 1.0]))
def test_no_distance_changes_by_more_than_the_bound(seed: int, largest: float) -> None:
    rng = np.random.default_rng(seed)
    limits = [(joint.lower or 0.0, joint.upper or 0.0) for joint in ARM.moving_joints]
    start = np.array([rng.uniform(low, high) for low, high in limits])
    lower, upper = (np.array(side) for side in zip(*limits, strict=True))
    end = np.clip(start + rng.uniform(-largest, largest, len(start)), lower, upper)
    bounds = reaches(ARM, PAIRS, JOINTS) @ np.abs(end - start)
    changes = np.abs(distances(end) - distances(start))
    assert (changes <= bounds + 1e-9).all()


def test_a_pair_is_measured_when_its_joints_can_have_closed_the_gap() -> None:
    asked = list[tuple[str, str]]()

    def nearest(link: str, other: str) -> Nearest:
        asked.append((link, other))
        return Nearest(0.5, (0.0, 0.0, 0.0))

    pair = ("base_link", "wrist_3_link")
    watch = SelfWatch(ARM, [pair], JOINTS, 100.0, nearest)
    reach = float(reaches(ARM, [pair], JOINTS)[0, JOINTS.index("elbow_joint")])
    for step, elbow in enumerate([0.0, 0.2 / reach, 0.4 / reach, 0.49 / reach, 0.51 / reach, 0.52 / reach], start=1):
        watch.record(step, [elbow if name == "elbow_joint" else 0.0 for name in JOINTS])
    assert asked == [pair] * 2
    assert watch.collect() == ()


@pytest.mark.parametrize(("depth", "touches"), [(0.00009, 0), (0.00011, 1)])
def test_an_overlap_of_a_tenth_of_a_millimetre_is_a_touch(depth: float, touches: int) -> None:
    pair = ("base_link", "wrist_3_link")
    watch = SelfWatch(ARM, [pair], JOINTS, 100.0, lambda *_: Nearest(-depth, (0.0, 0.0, 0.0)))
    watch.record(1, [0.0] * len(JOINTS))
    assert len(watch.collect()) == touches


def test_a_hinge_beside_the_origin_of_its_link_swings_that_origin(tmp_path: Path) -> None:
    """In MJCF a hinge may be anywhere; it then moves the link's origin by up to twice that distance."""
    box = '<geom type="box" size="0.01 0.01 0.01"/>'
    (tmp_path / "arm.xml").write_text(
        f'<mujoco><worldbody><body name="base">{box}<body name="one" pos="0.5 0 0"><joint name="first" axis="0 0 1"/>'
        f'{box}<body name="two" pos="0.4 0 0"><joint name="second" axis="0 0 1" pos="1 0 0"/>{box}'
        "</body></body></body></worldbody></mujoco>"
    )
    model = load_model(Robot(model="arm.xml", base="fixed"), Workspace(tmp_path, tmp_path))
    (row,) = reaches(model, [("base", "two")], ["first", "second"])
    # Turned by 180 deg about its anchor, the link is 2.4 m from the first joint.
    swung = link_poses(model, {"first": 0.0, "second": np.pi})["two"].position_xyz
    ahead = link_poses(model, {"first": 0.01, "second": np.pi})["two"].position_xyz
    assert np.linalg.norm(np.subtract(ahead, swung)) > 0.0239
    assert row[0] * 0.01 >= np.linalg.norm(np.subtract(ahead, swung))
