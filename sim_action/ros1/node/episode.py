"""One simulation of the population as it is, from its spawning, or a change, to the next change or the end."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal, cast
from xml.etree import ElementTree as ET

from pydantic import PrivateAttr

from sim_action.commands import ClosedLoop, CommandSource, Controller
from sim_action.footage import Footage
from sim_action.models import load_model
from sim_action.robot_model import RobotModel
from sim_action.ros1.exchange import Request
from sim_action.ros1.gazebo_tags import plugins_of
from sim_action.ros1.node.bridge import Bridge, Session
from sim_action.ros1.node.devices import DEVICES, TICKS, Device, Told, Wiring
from sim_action.ros1.node.population import SpawnedRobot, placement_of
from sim_action.ros1.node.world_states import states_sensor
from sim_action.scenario import DrivenRobot, Scenario
from sim_action.scene import Scene
from sim_action.simulation import SimulationRun, simulate
from sim_action.workspace import Workspace
from sim_action.world import Physics

_DESCRIPTION: Final = "robot.urdf"
# Of sim time, in s, if nobody says how long: a replay of more would have less than 30 moments a second.
_LONGEST: Final = 6_600.0


class NodeCommands(CommandSource):
    """What nodes say; no key of a scenario leads here."""

    _bridge: Bridge = PrivateAttr()

    @classmethod
    def through(cls, bridge: Bridge) -> NodeCommands:
        """Those that a bridge takes."""
        source = cls(rate=float(TICKS))
        source._bridge = bridge
        return source

    def open(self, scene: Scene) -> Controller:
        """See CommandSource.open."""
        return ClosedLoop(self._bridge.tick)


@dataclass(eq=False)
class Episode:
    """A scenario, made of what nodes have spawned.

    Attributes:
        footage: what there is of it, also when it was cut short.
    """

    scenario: Scenario
    scene: Scene
    footage: Footage
    bridge: Bridge

    def run(self) -> SimulationRun:
        """Raises RunError."""
        return simulate(self.scenario, self.scene, lambda _: None, self.footage)


class Stage:
    """Where robots are opened: their plugins' topics stay open as long as the robot is the same."""

    def __init__(self, session: Session, request: Request, folder: Path) -> None:
        self._session, self._request, self._folder = session, request, folder
        self._opened: tuple[str, list[Device], Told] | None = None
        self.notes: list[str] = []

    def episode(self, *, left: float | None) -> Episode:
        """Of the population as it is; `left`: s of sim time that it may take. Raises ModelError."""
        population = self._session.present.population
        assert population.robot is not None
        robot = self._driven(population.robot)
        workspace = Workspace(self._folder, self._folder, allow_outside=True)
        model = load_model(robot, workspace)
        devices, told = self._devices(population.robot, model)
        self._session.present.link_names = frozenset(model.links_by_name)
        bridge = Bridge(self._session, population.robot.name, devices, told)
        scenario = Scenario.model_construct(
            name=population.robot.name,
            robot=robot,
            world=population.world,
            physics=Physics(rate=self._request.physics_rate),
            commands=(NodeCommands.through(bridge),),
            sensors=(
                states_sensor(TICKS, lambda: self._wants_links(devices)),
                *(device.sensor for device in devices if device.sensor is not None),
            ),
            expect=(),
            time_limit=left or _LONGEST,
            backend=cast(Literal["auto", "pybullet", "mujoco"], self._request.backend),
            seed=self._request.seed,
        )
        scene = Scene(robot, model, population.world, scenario.physics, workspace, scenario.seed)
        return Episode(scenario, scene, Footage(scenario, filmed=self._request.replay), bridge)

    def _wants_links(self, devices: list[Device]) -> bool:
        session = self._session
        # Who will listen is not known before the clock starts.
        is_held = session.present.started is None
        return is_held or session.topics.are_links_heard or any(device.reads_links for device in devices)

    def _driven(self, robot: SpawnedRobot) -> DrivenRobot:
        """As a scenario has it. Robots are spawned at a height of 0, or dropped from one: here they stand."""
        (self._folder / _DESCRIPTION).write_text(robot.description, encoding="utf-8")
        pose = placement_of(robot.pose).model_copy(update={"z": None} if robot.pose.position_xyz[2] <= 0 else {})
        return DrivenRobot(model=_DESCRIPTION, pose=pose, joints=dict(robot.joints))

    def _devices(self, robot: SpawnedRobot, model: RobotModel) -> tuple[list[Device], Told]:
        if self._opened is None or self._opened[0] != robot.description:
            told = Told()
            self._opened = robot.description, list(self._open(robot.description, model, told)), told
        return self._opened[1], self._opened[2]

    def _open(self, description: str, model: RobotModel, told: Told) -> Iterator[Device]:
        session = self._session
        for plugin in plugins_of(ET.fromstring(description)):  # noqa: S314 - of the robot that is simulated
            if plugin.name in DEVICES:
                yield from DEVICES.load(plugin.name)(
                    plugin, Wiring(model, told, session.traffic, lambda: session.present.started is None)
                )
            else:
                self.notes.append(f"the plugin {plugin.name} of the robot is not known here and does nothing")
