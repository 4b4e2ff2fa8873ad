"""Sensors that measure only for subscribers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal, cast

import pytest
from numpy.typing import ArrayLike

from sim_action.commands import ClosedLoop, CommandSource, Controller
from sim_action.core.geometry import Twist
from sim_action.core.workspace import Workspace
from sim_action.robot.model.robot_model import Plugin, RobotModel
from sim_action.robot.reading.loading import load_model
from sim_action.ros.ros1.node.internal_parts import NotMeasured, OnDemandSensor, PlanarMove
from sim_action.scenario.model import DrivenRobot, Scenario, Stage
from sim_action.sensors import Measure, Mount, Sensor, Sight
from sim_action.simulation.loop import simulate
from sim_action.world import Physics, World
from sim_action.world.scene import Scene
from tests.integration.engines import on_every_engine
from tests.ros.ros1.machine import MACHINE


@dataclass(frozen=True)
class Since:
    """How long ago the sensor was read last."""

    time: float
    since: float

    def columns(self) -> Mapping[str, ArrayLike]:
        return {}


class Stopwatch(Sensor):
    """What it tells depends on when it was asked last, as an IMU's acceleration does."""

    key: ClassVar[str] = "stopwatch"

    def open(self, mount: Mount) -> Measure:
        last = 0.0

        def measure(sight: Sight) -> Since:
            nonlocal last
            since, last = sight.time - last, sight.time
            return Since(sight.time, since)

        return measure


def read(is_wanted: Callable[[float], bool], times: list[float], *, keeps_first: bool = False) -> list[float | None]:
    """What was told at some times; None: silence."""
    measure = OnDemandSensor.of(Stopwatch(), is_wanted, keeps_first=keeps_first).open(cast(Mount, None))
    told: list[float | None] = []
    for now in times:
        reading: Any = measure(Sight(now, cast(Any, None), cast(Any, None)))
        assert reading.time == now
        told.append(None if isinstance(reading, NotMeasured) else reading.since)
    return told


def test_a_sensor_is_read_only_while_it_is_heard() -> None:
    assert read(lambda _: True, [0.0, 1.0, 2.0]) == [0.0, 1.0, 1.0]
    assert read(lambda _: False, [0.0, 1.0, 2.0]) == [None, None, None]
    # The reading at 4 s would be about 3 s of silence.
    assert read(lambda now: now < 2 or now >= 4, [0, 1, 2, 3, 4, 5, 6]) == [0, 1, None, None, None, 1, 1]
    # A reading that does not depend on the one before is kept after a pause.
    assert read(lambda now: now in (0, 2), [0, 1, 2, 3], keeps_first=True) == [0, None, 2, None]


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
        world=Stage(),
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
