"""The moment that a simulation has come to, for services that are asked about it in threads of their own."""

from __future__ import annotations

from dataclasses import dataclass, field

from sim_action.core.geometry import Pose, Twist
from sim_action.robot.robot_model import RobotModel
from sim_action.ros.ros1.node.population import Population
from sim_action.ros.ros1.node.topics import States
from sim_action.state.observation import JointState


@dataclass
class Present:
    """What is known of it; changed by the loop alone, while all nodes wait.

    Attributes:
        time: s of sim time.
        began: s of sim time at which what is simulated began.
        started: s of wall time at which the clock started; None: it is held.
        models: name of a model, without the ground -> pose and twist, world frame.
        links: the same of links, each as `model::link`; none if nobody wants to know.
        model: of the robot, once there is one.
        base: pose and twist of its base link, world frame.
        joints: of the robot, by their names.
    """

    population: Population
    time: float = 0.0
    began: float = 0.0
    started: float | None = None
    models: States = field(default_factory=dict)
    links: States = field(default_factory=dict)
    model: RobotModel | None = None
    base: tuple[Pose, Twist] = (Pose(), Twist())
    joints: dict[str, JointState] = field(default_factory=dict)

    def carried_on(self) -> Population:
        """The population, where everything is now."""
        positions = {name: joint.position for name, joint in self.joints.items()}
        moved = self.population.moved({name: pose for name, (pose, _) in self.models.items()}, positions)
        return moved.later(self.time - self.began)
