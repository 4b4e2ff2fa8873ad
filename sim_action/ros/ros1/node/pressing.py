"""Services of Gazebo's ROS interface by which nodes press on models and turn joints, each for a time."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final

import rospy
from gazebo_msgs.srv import ApplyBodyWrench, ApplyJointEffort, BodyRequest, JointRequest

from sim_action.ros.ros1.node.changes import Changes
from sim_action.ros.ros1.node.efforts import Efforts
from sim_action.ros.ros1.node.inquiries import robot_joint, robot_model
from sim_action.ros.ros1.node.population import Population, refuse_unknown
from sim_action.ros.ros1.node.present import Present
from sim_action.world import Disturbance

_FOR_EVER: Final = 1e5


class Pressing:
    """Offers them, for as long as the node lives."""

    def __init__(self, present: Present, changes: Changes, efforts: Efforts) -> None:
        self._present, self._changes, self._efforts = present, changes, efforts
        for name, kind, answer in (
            ("apply_body_wrench", ApplyBodyWrench, self._press),
            ("clear_body_wrenches", BodyRequest, self._release),
            ("apply_joint_effort", ApplyJointEffort, self._turn),
            ("clear_joint_forces", JointRequest, self._let_go),
        ):
            rospy.Service(f"/gazebo/{name}", kind, answer)

    def _press(self, request: Any) -> tuple[bool, str]:
        model, _, link = request.body_name.partition("::")
        force, torque, point = request.wrench.force, request.wrench.torque, request.reference_point
        seconds = request.duration.to_sec()

        def alter(population: Population) -> Population:
            refuse_unknown(model, population)
            robot = population.robot
            is_robot = robot is not None and robot.name == model
            if is_robot and link and link not in self._link_names():
                raise ValueError(f"there is no link '{link}' in '{model}'")
            if seconds == 0:
                raise ValueError("a wrench needs a duration; a negative one is for ever")
            begins = max(0.0, request.start_time.to_sec() - self._present.time)
            disturbance = Disturbance.model_validate(
                {
                    "at": begins,
                    "for": seconds if seconds > 0 else _FOR_EVER,
                    **({"link": link or None} if is_robot else {"body": model}),
                    "force": (force.x, force.y, force.z),
                    "torque": (torque.x, torque.y, torque.z),
                    **({"point": (point.x, point.y, point.z)} if any((point.x, point.y, point.z)) else {}),
                }
            )
            world = population.world
            changed = world.model_copy(update={"disturbances": (*world.disturbances, disturbance)})
            return replace(population, world=changed)

        refused = self._changes.ask(alter)
        return refused is None, refused or "the wrench acts"

    def _release(self, request: Any) -> tuple[()]:
        model, _, link = request.body_name.partition("::")

        def alter(population: Population) -> Population:
            robot = population.robot
            of_robot = robot is not None and robot.name == model
            return population.unpressed(None if of_robot else model, link if of_robot else "")

        self._changes.ask(alter)
        return ()

    def _turn(self, request: Any) -> tuple[bool, str]:
        seconds = request.duration.to_sec()
        try:
            joint = robot_joint(robot_model(self._present), request.joint_name)
        except LookupError as error:
            return False, str(error.args[0])
        if seconds == 0:
            return False, "an effort needs a duration; a negative one is for ever"
        begins = max(self._present.time, request.start_time.to_sec())
        self._efforts.apply(joint, request.effort, begins, seconds)
        return True, "the effort acts"

    def _let_go(self, request: Any) -> tuple[()]:
        self._efforts.clear(request.joint_name.rpartition("::")[2])
        return ()

    def _link_names(self) -> frozenset[str]:
        model = self._present.model
        return frozenset(model.links_by_name) if model else frozenset()
