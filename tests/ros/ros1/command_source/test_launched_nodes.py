"""Events of a launcher, as they arrive."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sim_action.ros.launches import EventFile
from sim_action.ros.ros1.command_source.launched_nodes import REPLACED_CONTROLLERS, Event, ReplacedNode, lost_nodes

ROBOT = ("gazebo_ros/spawn_model", "-urdf -model r -param robot_description -x 1")
BOX = ("gazebo_ros/spawn_model", "-sdf -model box -file /a/box.sdf")
SPAWNER = ("controller_manager/spawner", "--namespace /r arm joints --shutdown-timeout=3")
SERVER = ("gazebo_ros/gzserver", "-e ode /a/yard.world")


def told(path: Path, text: str) -> None:
    with path.open("a") as file:
        file.write(text)


def test_events_are_read_once_and_when_they_are_whole(tmp_path: Path) -> None:
    events = EventFile(tmp_path / "events", Event)
    line = json.dumps({"event": "started", "pid": 7}) + "\n"

    assert events.new() == []
    told(tmp_path / "events", line + line[:10])
    assert [event.pid for event in events.new()] == [7]
    told(tmp_path / "events", line[10:])
    assert [event.event for event in events.new()] == ["started"]
    assert events.new() == []
    events.close()


def test_who_has_ended_well_is_told_from_who_has_not(tmp_path: Path) -> None:
    events = EventFile(tmp_path / "events", Event)
    for code, required in ((0, False), (0, True), (1, False), (-11, False), (None, False)):
        told(tmp_path / "events", json.dumps({"event": "died", "exit_code": code, "required": required}) + "\n")

    assert [event.is_failure for event in events.new()] == [False, True, True, True, True]
    events.close()


def lost(*nodes: tuple[str, str], world: str = "", **types: str) -> list[str]:
    found = [ReplacedNode(program=program, args=args) for program, args in nodes]
    return list(lost_nodes(found, world, types))


def test_a_robot_in_an_empty_world_is_replaced() -> None:
    nodes = [("gazebo_ros/gzserver", ""), ("gazebo_ros/gzclient", ""), ROBOT]
    assert lost(*nodes, world="worlds/empty.world") == []
    assert lost(*nodes, world="/opt/ros/share/turtlebot3_gazebo/worlds/empty.world") == []
    assert lost(("gazebo_ros/spawn_model", "-sdf -model rover -database rover")) == []


@pytest.mark.parametrize(("world", "nodes"), [("/a/yard.world", []), ("", [SERVER]), ("/a/yard.world", [SERVER])])
def test_another_world_is_lost_once_for_each_name(world: str, nodes: list[tuple[str, str]]) -> None:
    (message,) = set(lost(*nodes, world=world))
    assert message.startswith("the world 'yard.world' of the launch file is not simulated")


@pytest.mark.parametrize("nodes", [(ROBOT, BOX), (BOX, ROBOT)])
def test_models_besides_the_robot_are_lost(nodes: tuple[tuple[str, str], ...]) -> None:
    (message,) = lost(*nodes)
    assert message.startswith("the model 'box' is not spawned")


def test_controllers_other_than_those_of_the_base_are_lost() -> None:
    arm = "position_controllers/JointTrajectoryController"
    (message,) = lost(SPAWNER, arm=arm, joints="joint_state_controller/JointStateController")
    assert message.startswith(f"the controller 'arm' ({arm}) does not run")

    assert [text.split("'")[1] for text in lost(SPAWNER)] == ["arm", "joints"]
    assert [text.split("'")[1] for text in lost(("controller_manager/controller_manager", "spawn arm"))] == ["arm"]
    assert lost(("controller_manager/controller_manager", "list")) == []


def test_every_replaced_controller_has_a_reason() -> None:
    assert all(REPLACED_CONTROLLERS.values())


def test_arguments_with_an_open_quote_are_words() -> None:
    assert lost(("gazebo_ros/spawn_model", "-model 'r -param robot_description")) == []
