"""Services of Gazebo's ROS interface (gazebo_ros_api_plugin), by which nodes look at the world and change it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from threading import Event
from typing import Any, Final
from xml.etree import ElementTree as ET

import rospy
from gazebo_msgs.srv import (
    ApplyBodyWrench,
    DeleteModel,
    GetModelState,
    GetWorldProperties,
    SetModelConfiguration,
    SetModelState,
    SpawnModel,
)
from std_srvs.srv import Empty

from sim_action import geometry
from sim_action.geometry import Pose
from sim_action.ros1.node.changes import Alter, Changes
from sim_action.ros1.node.messages import header, pose_message, pose_of, twist_message
from sim_action.ros1.node.population import Population, SpawnedRobot
from sim_action.ros1.node.present import Present
from sim_action.ros1.worlds import BadWorld, body_of
from sim_action.world import Disturbance

_FOR_EVER: Final = 1e5
_WORLD_FRAMES: Final = frozenset({"", "world", "map", "/map", "ground_plane"})


class Services:
    """Offers them, for as long as the node lives."""

    def __init__(self, present: Present, changes: Changes, paused: Event) -> None:
        self._present, self._changes, self._paused = present, changes, paused
        for name, kind, answer in (
            ("spawn_urdf_model", SpawnModel, self._spawn),
            ("spawn_sdf_model", SpawnModel, self._spawn),
            ("delete_model", DeleteModel, self._delete),
            ("set_model_state", SetModelState, self._set_state),
            ("set_model_configuration", SetModelConfiguration, self._set_joints),
            ("get_model_state", GetModelState, self._get_state),
            ("get_world_properties", GetWorldProperties, self._properties),
            ("apply_body_wrench", ApplyBodyWrench, self._press),
            ("reset_world", Empty, lambda _: self._reset(restarts=False)),
            ("reset_simulation", Empty, lambda _: self._reset(restarts=True)),
            ("pause_physics", Empty, lambda _: self._pause(self._paused.set)),
            ("unpause_physics", Empty, lambda _: self._pause(self._paused.clear)),
        ):
            rospy.Service(f"/gazebo/{name}", kind, answer)

    def _pause(self, change: Callable[[], None]) -> tuple[()]:
        change()
        return ()

    def _spawn(self, request: Any) -> tuple[bool, str]:
        name, pose = request.model_name, pose_of(request.initial_pose)

        def alter(population: Population) -> Population:
            if name in population.names:
                raise ValueError(f"a model '{name}' is there already")
            if is_robot(request.model_xml):
                if population.robot is not None:
                    raise ValueError(f"one robot at a time: '{population.robot.name}' is there already")
                return replace(population, robot=SpawnedRobot(name, request.model_xml, pose))
            try:
                return population.with_body(body_of(name, request.model_xml, pose))
            except BadWorld as error:
                raise ValueError(f"'{name}' cannot be spawned: {error}") from None

        return self._answer(alter, f"'{name}' is spawned")

    def _delete(self, request: Any) -> tuple[bool, str]:
        name = request.model_name

        def alter(population: Population) -> Population:
            _refuse_unknown(name, population)
            return population.without(name)

        return self._answer(alter, f"'{name}' is deleted")

    def _set_state(self, request: Any) -> tuple[bool, str]:
        state = request.model_state
        name = state.model_name

        def alter(population: Population) -> Population:
            _refuse_unknown(name, population)
            return population.moved({name: self._in_world(pose_of(state.pose), state.reference_frame)})

        return self._answer(alter, f"'{name}' is where it was to be")

    def _set_joints(self, request: Any) -> tuple[bool, str]:
        positions = dict(zip(request.joint_names, request.joint_positions, strict=False))

        def alter(population: Population) -> Population:
            robot = population.robot
            if robot is None or robot.name != request.model_name:
                raise ValueError(f"there is no robot '{request.model_name}'")
            return replace(population, robot=replace(robot, joints={**robot.joints, **positions}))

        return self._answer(alter, f"joints of '{request.model_name}' are where they were to be")

    def _press(self, request: Any) -> tuple[bool, str]:
        model, _, link = request.body_name.partition("::")
        force, torque, point = request.wrench.force, request.wrench.torque, request.reference_point
        seconds = request.duration.to_sec()

        def alter(population: Population) -> Population:
            _refuse_unknown(model, population)
            robot = population.robot
            is_robot = robot is not None and robot.name == model
            if is_robot and link and link not in self._present.link_names:
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

        return self._answer(alter, "the wrench acts")

    def _reset(self, *, restarts: bool) -> tuple[()]:
        self._changes.ask(Population.at_home, restarts=restarts)
        return ()

    def _get_state(self, request: Any) -> Any:
        found = self._present.models.get(request.model_name)
        if found is None:
            return {"success": False, "status_message": _unknown(request.model_name, self._present.population)}
        pose, twist = found
        other = request.relative_entity_name.partition("::")[0]
        if other not in _WORLD_FRAMES and other in self._present.models:
            pose = geometry.compose(geometry.inverse(self._present.models[other][0]), pose)
        return {
            "header": header(self._present.time, other or "world"),
            "pose": pose_message(pose),
            "twist": twist_message(twist),
            "success": True,
            "status_message": "",
        }

    def _properties(self, _: Any) -> Any:
        present = self._present
        return {"sim_time": present.time, "model_names": list(present.population.names), "success": True}

    def _in_world(self, pose: Pose, frame: str) -> Pose:
        name = frame.partition("::")[0]
        return pose if name in _WORLD_FRAMES else geometry.compose(self._present.models[name][0], pose)

    def _answer(self, alter: Alter, done: str) -> tuple[bool, str]:
        refused = self._changes.ask(alter)
        return refused is None, refused or done


def is_robot(description: str) -> bool:
    """Whether it has joints or plugins: what has neither is a body of the world."""
    try:
        root = ET.fromstring(description)  # noqa: S314 - of what is simulated
    except ET.ParseError:
        return True  # Whoever reads models says best what is wrong.
    return root.tag == "robot" or any(True for _ in root.iter("joint")) or any(True for _ in root.iter("plugin"))


def _refuse_unknown(name: str, population: Population) -> None:
    if name not in population.names[1:]:
        raise ValueError(_unknown(name, population))


def _unknown(name: str, population: Population) -> str:
    return f"there is no model '{name}'; there are {', '.join(population.names)}"
