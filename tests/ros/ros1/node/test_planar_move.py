"""A base with planar_move on each engine: sideways and turning, from the first steps on."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import pytest

from sim_action.commands import ClosedLoop, CommandSource, Controller
from sim_action.core.geometry import Twist
from sim_action.core.workspace import Workspace
from sim_action.robot.model.robot_model import Plugin, RobotModel
from sim_action.robot.reading.loading import load_model
from sim_action.ros.ros1.node.planar_move import PlanarMove
from sim_action.scenario.model import DrivenRobot, Scenario
from sim_action.simulation.loop import simulate
from sim_action.world import Physics, World
from sim_action.world.scene import Scene
from tests.integration.engines import on_every_engine
from tests.ros.ros1.machine import MACHINE


class Sideways(CommandSource):
    def open(self, scene: Scene) -> Controller:
        return ClosedLoop(lambda _: Twist((0.3, 0.4, 0.0), (0.0, 0.0, 0.0)))


@on_every_engine
def test_it_reaches_its_velocity_at_once(engine: Literal["pybullet", "mujoco"], tmp_path: Path) -> None:
    (tmp_path / "machine.urdf").write_text(MACHINE)
    workspace = Workspace(tmp_path, tmp_path, allow_outside=True)
    robot = DrivenRobot(model="machine.urdf").model_copy(update={"drive": PlanarMove()})
    model = load_model(robot, workspace)
    scenario = Scenario.model_construct(
        name="sideways",
        robot=robot,
        world=World(),
        physics=Physics(rate=200),
        commands=(Sideways(rate=100.0),),
        sensors=(),
        expect=(),
        time_limit=2.0,
        backend=engine,
    )

    run = simulate(scenario, Scene(robot, model, World(), scenario.physics, workspace, 0), lambda _: None)

    way = run.trace.base_position_xyz[-1, :2] - run.trace.base_position_xyz[0, :2]
    assert way == pytest.approx([0.6, 0.8], abs=0.015)


def test_it_is_recognised_by_its_plugin() -> None:
    model = RobotModel("m", "", (), (), "")
    assert PlanarMove.recognise(model) is None
    with_plugin = RobotModel("m", "", (), (), "", plugins=(Plugin("gazebo_ros_planar_move", ()),))
    assert PlanarMove.recognise(with_plugin) == PlanarMove()
