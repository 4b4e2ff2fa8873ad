"""Episodes: simulations of the spawned models, each from a spawn or a change to the next change or the end.

A bridge between the loop of the simulation and the nodes publishes at each tick, and takes commands.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from pathlib import Path
from threading import Event
from typing import Final, cast

from sim_action.commands import ClosedLoop
from sim_action.core.errors import ControllersFinished, Location
from sim_action.core.field_types import Placement
from sim_action.core.records import dataclass
from sim_action.core.workspace import Workspace
from sim_action.drives import recognise
from sim_action.engines import AutoOrEngine
from sim_action.robot.model.robot_model import RobotModel
from sim_action.robot.reading.loading import load_model
from sim_action.ros.launches import OpenCommands
from sim_action.ros.ros1.gazebo_plugins import (
    LOST_FINDINGS,
    PLUGINS,
    base_in_model,
    lost_plugin_tags,
    lost_robot_tags,
    plugin_remarks,
    plugins_of,
)
from sim_action.ros.ros1.launch_request import SimulationRequest
from sim_action.ros.ros1.lockstep import Lockstep
from sim_action.ros.ros1.node.internal_parts import PlanarMove, states_in, states_sensor
from sim_action.ros.ros1.node.plugins import TICKS, Device, RobotCommands, Wiring
from sim_action.ros.ros1.node.topics import GazeboTopics, Traffic, WallClockWatch
from sim_action.ros.ros1.node.world_models import (
    ChangeQueue,
    CurrentState,
    JointEfforts,
    ModelFrame,
    SpawnedRobot,
    WorldChanged,
)
from sim_action.scenario.model import DrivenRobot, Scenario, Stage
from sim_action.simulation.loop import SimulationRun, simulate
from sim_action.simulation.recorder import RunRecorder
from sim_action.state.command import Answer
from sim_action.state.observation import Observation
from sim_action.state.trace import Transcript
from sim_action.world import Physics
from sim_action.world.scene import Scene
from sim_action.world.shape_files import ShapeLibrary, read_surroundings
from sim_action.world.world_files.losses import Loss

# The interval of checks whether a paused world may go on.
_POLL_S: Final = 0.01
_TOUCH_S: Final = 0.25
_DESCRIPTION_FILE: Final = "robot.urdf"
_REPORTED: Final = ("restitution",)  # such findings are losses of the launch, not errors of the model
# Sim time without a stated limit; a replay of more would have less than 30 frames per second.
_MAX_SIM_TIME_S: Final = 6_600.0


class Pace:
    """Holds a run back to a real-time factor, and touches a file while sim time moves on."""

    def __init__(self, factor: float | None, progress: Path) -> None:
        self._factor, self._progress = factor, progress
        self._began: float | None = None
        self._next_touch = 0.0

    def keep(self, seconds: float) -> None:
        """Sleep until wall time has reached the sim time, scaled by the factor."""
        if (now := time.monotonic()) >= self._next_touch:
            self._progress.touch()
            self._next_touch = now + _TOUCH_S
        if self._factor is None:
            return
        began = self._began = self._began or time.monotonic() - seconds / self._factor
        time.sleep(max(0.0, began + seconds / self._factor - time.monotonic()))


@dataclass(frozen=True, slots=True)
class Session:
    """The parts that live as long as the node does, through all changes of the world."""

    current: CurrentState
    traffic: Traffic
    topics: GazeboTopics
    lockstep: Lockstep
    changes: ChangeQueue
    paused: Event
    pace: Pace
    efforts: JointEfforts


class Bridge:
    """One robot among nodes, until the world changes or the nodes have ended."""

    def __init__(
        self, session: Session, robot: str, frame: ModelFrame, devices: Iterable[Device], commands: RobotCommands
    ) -> None:
        self._session, self._robot, self._frame = session, robot, frame
        self._devices, self.commands = tuple(devices), commands
        self._start = session.current.time
        self._wall_clock = WallClockWatch(session.traffic, session.lockstep)
        self.transcript = Transcript()
        self.first_command: float | None = None
        self.over: ControllersFinished | None = None

    def tick(self, seen: Observation) -> Answer:
        """Publish a moment, and return the commands that follow. Raises ControllersFinished, WorldChanged."""
        try:
            return self._answer(seen)
        except ControllersFinished as over:
            self.over = over
            raise

    def _answer(self, seen: Observation) -> Answer:
        session, seconds, tick = self._session, self._start + seen.time, round(seen.time * TICKS)
        states, current = states_in(seen), self._session.current
        current.time = seconds
        current.model_states = {
            **states.bodies,
            self._robot: (self._frame.pose(seen.pose), self._frame.twist(seen.pose, seen.twist)),
        }
        current.base = seen.pose, seen.twist
        current.joints = dict(seen.joints)
        self._hold()
        self._wall_clock.look()
        self._publish(seconds, tick, seen)
        session.lockstep.deliver(seconds, session.traffic.undelivered())
        self._stand_still(seconds)
        session.traffic.move_to(self.transcript, seen.time)
        if session.changes.has_pending():
            raise WorldChanged("the world changed")
        session.pace.keep(seconds)
        if self.first_command is None and self.commands.is_commanded:
            self.first_command = seconds
        return session.efforts.added_to(self.commands.answer(seconds, seen), seconds, self.commands.wheels)

    def _hold(self) -> None:
        """Hold the clock until all nodes are up. The engine has started before, which takes as long."""
        session = self._session
        if session.current.started is not None:
            return
        session.lockstep.begin(lambda: self.commands.topics, session.changes.has_pending)
        if session.changes.has_pending():
            raise WorldChanged("the world changed")
        self.commands.begin()
        session.traffic.begin()
        session.current.started = time.monotonic()

    def _publish(self, seconds: float, tick: int, seen: Observation) -> None:
        """Publish a moment, the clock last."""
        topics, current = self._session.topics, self._session.current
        for device in self._devices:
            device.publish_if_due(tick, seconds, seen)
        topics.publish_models(current.model_states)
        # A node may have subscribed after the links were read.
        if links := states_in(seen).links_of_models(self._robot):
            topics.publish_links(links)
        topics.publish_time(seconds)

    def _stand_still(self, seconds: float) -> None:
        session = self._session
        while session.paused.is_set() and not session.changes.has_pending():
            time.sleep(_POLL_S)
            session.lockstep.settle(seconds)


@dataclass(eq=False)
class Episode:
    """A scenario made of spawned models; `footage`: the recorded part, also if the episode was cut short."""

    scenario: Scenario
    scene: Scene
    footage: RunRecorder
    bridge: Bridge

    def run(self) -> SimulationRun:
        """Run the simulation. Raises RunError."""
        return simulate(self.scenario, self.scene, lambda _: None, self.footage)


class EpisodeFactory:
    """Makes episodes. The topics of the robot's plugins stay open as long as the robot is the same."""

    def __init__(self, session: Session, request: SimulationRequest, folder: Path) -> None:
        self._session, self._request, self._folder = session, request, folder
        self._opened: tuple[SpawnedRobot, list[Device], RobotCommands] | None = None
        self._closing = ExitStack()
        self._shapes = ShapeLibrary()
        self.notes: list[str] = []
        self.losses: list[Loss] = []

    def episode(self, *, left: float | None) -> Episode:
        """Return an episode of the current models; `left`: s of sim time that it may take. Raises ModelError."""
        models = self._session.current.world_models
        assert models.robot is not None
        spawned = models.robot
        workspace = Workspace(self._folder, self._folder, allow_outside=True)
        model = load_model(self._described(spawned), workspace)
        frame = ModelFrame(base_in_model(spawned.root, model.root))
        robot = _driven(self._described(spawned), spawned, model, frame)
        devices, commands = self._devices(spawned, model, frame)
        drive = robot.drive or recognise(model)
        commands.wheels = drive.open(model, self._request.physics_rate).joints if drive else frozenset()
        self._session.current.model = model
        bridge = Bridge(self._session, spawned.name, frame, devices, commands)
        controller = ClosedLoop(bridge.tick, transcript=bridge.transcript)
        scenario = Scenario.model_construct(
            name=models.robot.name,
            robot=robot,
            world=Stage.of(models.world),
            physics=Physics(rate=self._request.physics_rate),
            commands=(OpenCommands.of(controller, float(TICKS)),),
            sensors=(
                states_sensor(TICKS, lambda: self._wants_links(devices)),
                *(device.sensor for device in devices if device.sensor is not None),
            ),
            expect=(),
            time_limit=left or _MAX_SIM_TIME_S,
            backend=cast(AutoOrEngine, self._request.backend),
            seed=self._request.seed,
        )
        parts = read_surroundings(models.world, workspace, self._shapes).parts
        scene = Scene(robot, model, models.world, scenario.physics, workspace, scenario.seed, parts=parts)
        return Episode(scenario, scene, RunRecorder(scenario, filmed=self._request.replay), bridge)

    def _wants_links(self, devices: list[Device]) -> bool:
        session = self._session
        # The subscribers are not known before the clock starts.
        is_clock_held = session.current.started is None
        return is_clock_held or session.topics.has_link_subscribers or any(device.reads_links for device in devices)

    def _described(self, robot: SpawnedRobot) -> DrivenRobot:
        """Return the robot, with only its description."""
        if robot.file is not None:
            return DrivenRobot(model=robot.file, allow=_REPORTED)
        (self._folder / _DESCRIPTION_FILE).write_text(robot.text, encoding="utf-8")
        return DrivenRobot(model=_DESCRIPTION_FILE, allow=_REPORTED)

    def _devices(self, robot: SpawnedRobot, model: RobotModel, frame: ModelFrame) -> tuple[list[Device], RobotCommands]:
        if self._opened is None or robot.number != self._opened[0].number:
            self._closing.close()
            self._session.efforts.clear_all()
            commands = RobotCommands()
            self._opened = robot, list(self._open(robot, model, frame, commands)), commands
        return self._opened[1], self._opened[2]

    def _open(
        self, robot: SpawnedRobot, model: RobotModel, frame: ModelFrame, commands: RobotCommands
    ) -> Iterator[Device]:
        session, root = self._session, robot.root
        wiring = Wiring(
            model,
            root,
            frame,
            commands,
            session.traffic,
            lambda: session.current.started is None,
            self.notes.append,
            self._lose,
            self._closing,
        )
        for message in lost_robot_tags(root) if root.tag == "robot" else ():
            self._lose(message)
        for finding in model.findings:
            # The parts of <gazebo> tags have a table of their own, above.
            if finding.rule in LOST_FINDINGS and not (root.tag == "robot" and finding.rule == "passed-over"):
                # Other descriptions are copies.
                self._lose(finding.message, finding.location if robot.file else None)
        for plugin in plugins_of(root, robot.space):
            if plugin.name in PLUGINS:
                for message in lost_plugin_tags(plugin):
                    self._lose(message)
                self.losses += (Loss(message=message, is_remark=True) for message in plugin_remarks(plugin))
                yield from PLUGINS.load(plugin.name)(plugin, wiring)
            else:
                self._lose(f"the plugin {plugin.name} of the robot is not supported and has no effect")

    def _lose(self, message: str, location: Location | None = None) -> None:
        self.losses.append(Loss(message=message, location=location))


def _driven(described: DrivenRobot, robot: SpawnedRobot, model: RobotModel, frame: ModelFrame) -> DrivenRobot:
    """Return the robot as in a scenario. A robot that is spawned at a height of 0 or less is placed on the ground."""
    stands = robot.pose.position_xyz[2] <= 0
    pose = Placement.of(frame.base_pose(robot.pose)).model_copy(update={"z": None} if stands else {})
    drive = PlanarMove.recognise(model)
    return described.model_copy(update={"pose": pose, "joints": dict(robot.joints), "drive": drive})
