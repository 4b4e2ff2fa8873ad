"""The links of a robot, each on its parent, moved by one joint at the most."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from sim_action.core import geometry
from sim_action.core.geometry import ZERO, Pose, Vector3
from sim_action.recording.replay.models import MOST_LETTERS, JointMotion, LinkData
from sim_action.recording.replay.pieces import pose_numbers
from sim_action.robot.robot_model import Joint, RobotModel


def skeleton(model: RobotModel) -> tuple[list[LinkData], dict[str, int]]:
    """Parents before their children, without what they look like; and link name -> the number of its frame.

    A link of MJCF may hang on several joints, one after the other, and turn about points beside its origin: what is
    between is a link that cannot be seen.
    """
    hanging: dict[str, dict[str, list[Joint]]] = {}
    for joint in model.joints:
        hanging.setdefault(joint.parent, {}).setdefault(joint.child, []).append(joint)
    columns = {joint.name: column for column, joint in enumerate(model.moving_joints)}
    links = [LinkData(name=model.root[:MOST_LETTERS])]
    numbers = {model.root: 0}
    waiting = [model.root]
    for parent in waiting:
        for child, joints in hanging.get(parent, {}).items():
            if child not in numbers:
                links += _chain(child, joints, numbers[parent], len(links), columns)
                numbers[child] = len(links) - 1
                waiting.append(child)
    return links, numbers


def _chain(child: str, joints: Sequence[Joint], parent: int, number: int, columns: Mapping[str, int]) -> list[LinkData]:
    """The links from a parent to a child; `number`: of the first of them."""
    links: list[LinkData] = []
    origin, before = joints[0].origin, ZERO
    for joint in joints:
        at = geometry.compose(origin, Pose(_between(before, joint.anchor_xyz)))
        motion = _motion(joint, columns[joint.name]) if joint.name in columns else None
        links.append(_link(child, parent if not links else number + len(links) - 1, at, motion))
        origin, before = Pose(), joint.anchor_xyz
    if before != ZERO:
        links.append(_link(child, number + len(links) - 1, Pose(_between(before, ZERO)), None))
    return links


def _link(name: str, parent: int, origin: Pose, motion: JointMotion | None) -> LinkData:
    return LinkData(name=name[:MOST_LETTERS], parent=parent, origin=pose_numbers(origin), joint=motion)


def _motion(joint: Joint, column: int) -> JointMotion:
    if joint.type == "prismatic":
        return JointMotion(type="prismatic", axis=joint.axis_xyz, column=column)
    return JointMotion(type="revolute", axis=joint.axis_xyz, column=column)


def _between(start: Vector3, end: Vector3) -> Vector3:
    (ax, ay, az), (bx, by, bz) = start, end
    return (bx - ax, by - ay, bz - az)
