"""The current state of the simulation, for services in threads of their own; frames of models and links."""

from __future__ import annotations

from collections.abc import Mapping

from sim_action.core import geometry
from sim_action.core.geometry import Pose, Twist, Vector3
from sim_action.core.records import dataclass, field
from sim_action.robot.model.link_motion import LinkStates
from sim_action.robot.model.robot_model import RobotModel
from sim_action.ros.ros1.node.world_models import WorldModels
from sim_action.state.observation import JointState

States = Mapping[str, tuple[Pose, Twist]]
"""Name of a model or a link -> pose and twist, world frame."""


@dataclass()
class CurrentState:
    """The current state. Only the loop changes it, while all nodes wait.

    Attributes:
        world_models: the models that are simulated.
        time: s of sim time.
        began: s of sim time at the start of the current episode.
        started: s of wall time at the start of the clock; None: not started yet.
        model_states: name of a model, without the ground -> pose and twist, world frame.
        link_states: `model::link` -> pose and twist, world frame; empty if no node subscribes to them.
        model: model of the robot, once there is one.
        base: pose and twist of its base link, world frame.
        joints: states of its joints, by name.
    """

    world_models: WorldModels
    time: float = 0.0
    began: float = 0.0
    started: float | None = None
    model_states: States = field(default_factory=dict)
    link_states: States = field(default_factory=dict)
    model: RobotModel | None = None
    base: tuple[Pose, Twist] = (Pose(), Twist())
    joints: dict[str, JointState] = field(default_factory=dict)

    def models_now(self) -> WorldModels:
        """Return the models where they are now."""
        positions = {name: joint.position for name, joint in self.joints.items()}
        moved = self.world_models.moved({name: pose for name, (pose, _) in self.model_states.items()}, positions)
        return moved.after(self.time - self.began)


@dataclass(frozen=True, slots=True)
class ModelFrame:
    """The frame of a robot's model, which Gazebo reports; `base`: pose of the base link in it."""

    base: Pose

    def pose(self, base: Pose) -> Pose:
        """Return the pose of the model, from the pose of its base link."""
        return geometry.compose(base, geometry.inverse(self.base))

    def twist(self, base: Pose, twist: Twist) -> Twist:
        """Return the twist of the model's origin, from the twist of its base link; world frame."""
        return twist_at(twist, _between(base, self.pose(base)))

    def base_pose(self, pose: Pose) -> Pose:
        """Return the pose of the base link, from the pose of the model."""
        return geometry.compose(pose, self.base)


def twist_at(twist: Twist, way_xyz: Vector3) -> Twist:
    """Return the twist of another point of a rigid body, `way_xyz` m from the first point; world frame."""
    x, y, z = geometry.cross(twist.angular_xyz, way_xyz)
    linear = twist.linear_xyz
    return Twist((linear[0] + x, linear[1] + y, linear[2] + z), twist.angular_xyz)


def link_state(
    model: RobotModel, base: tuple[Pose, Twist], joints: Mapping[str, JointState], link: str
) -> tuple[Pose, Twist]:
    """Return pose and twist of a link, world frame; `base`: pose and twist of the base link. Raises KeyError."""
    return LinkStates(model, *base, joints)[link]


def _between(first: Pose, second: Pose) -> Vector3:
    (ax, ay, az), (bx, by, bz) = first.position_xyz, second.position_xyz
    return (bx - ax, by - ay, bz - az)
