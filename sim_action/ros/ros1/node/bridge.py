"""The bridge between the simulation loop and the nodes: publishes at each tick, and takes commands."""

from __future__ import annotations

import time
from collections.abc import Iterable
from threading import Event
from typing import Final

from sim_action.core.errors import ControllersFinished
from sim_action.core.geometry import Pose, Twist
from sim_action.core.records import dataclass
from sim_action.ros.lockstep import Lockstep
from sim_action.ros.ros1.node.current_state import CurrentState, ModelFrame
from sim_action.ros.ros1.node.internal_sensors import states_in
from sim_action.ros.ros1.node.plugins import TICKS, Device, RobotCommands
from sim_action.ros.ros1.node.topics import GazeboTopics, Traffic
from sim_action.ros.ros1.node.wall_clock import WallClockWatch
from sim_action.ros.ros1.node.world_models import ChangeQueue, JointEfforts, WorldChanged
from sim_action.state.command import Answer
from sim_action.state.observation import Observation
from sim_action.state.reproducibility import Transcript

# The interval of checks whether a paused world may go on.
_POLL_S: Final = 0.01


class Pace:
    """Holds a run back to a real-time factor."""

    def __init__(self, factor: float | None) -> None:
        self._factor = factor
        self._began: float | None = None

    def keep(self, seconds: float) -> None:
        """Sleep until wall time has reached the sim time, scaled by the factor."""
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
        """Publish a moment, wait until the nodes have handled it, and return their commands.

        Raises ControllersFinished if no node is left, WorldChanged if a node changes the world.
        """
        try:
            return self._answer(seen)
        except ControllersFinished as over:
            self.over = over
            raise

    def _answer(self, seen: Observation) -> Answer:
        session, seconds, tick = self._session, self._start + seen.time, round(seen.time * TICKS)
        self._note(seconds, seen)
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
        if current.link_states:
            topics.publish_links(current.link_states)
        topics.publish_time(seconds)

    def _note(self, seconds: float, seen: Observation) -> None:
        states, current = states_in(seen), self._session.current
        bodies = {f"{name}::link": state for name, state in states.bodies.items()}
        links = {f"{self._robot}::{name}": state for name, state in states.links.items()}
        current.time = seconds
        current.model_states = {**states.bodies, self._robot: self._model_state(seen)}
        current.base = seen.pose, seen.twist
        # A node may have subscribed after the links were read.
        current.link_states = {**bodies, **links} if links else {}
        current.joints = dict(seen.joints)

    def _model_state(self, seen: Observation) -> tuple[Pose, Twist]:
        return self._frame.pose(seen.pose), self._frame.twist(seen.pose, seen.twist)

    def _stand_still(self, seconds: float) -> None:
        session = self._session
        while session.paused.is_set() and not session.changes.has_pending():
            time.sleep(_POLL_S)
            session.lockstep.settle(seconds)
