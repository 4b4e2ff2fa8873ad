"""The controller of a scenario that nodes of ROS 2 drive: it starts them, and exchanges messages with them in ticks."""

from __future__ import annotations

import json
import time
from contextlib import ExitStack
from typing import TYPE_CHECKING, Final

from sim_action.commands import ClosedLoop
from sim_action.core.errors import ScriptError, SourceProblem, UsageError
from sim_action.ros.ros2.bridge_link import Bridge, BridgeEnded, Endpoint
from sim_action.ros.ros2.domain import Domain
from sim_action.ros.ros2.installation import RMW, Ros2, find_ros
from sim_action.ros.ros2.lockstep import Lockstep
from sim_action.ros.ros2.messages import Message
from sim_action.ros.ros2.quality import subscriber_problems
from sim_action.ros.ros2.readiness import Readiness
from sim_action.ros.ros2.received_commands import ReceivedCommands
from sim_action.ros.ros2.started_nodes import node_error, scratch_of, set_up_packages, start_node
from sim_action.ros.ros2.topics import channels
from sim_action.state.command import Answer
from sim_action.state.observation import Observation
from sim_action.state.reproducibility import Transcript

if TYPE_CHECKING:
    from sim_action.ros.ros2.spec import Ros2Commands
    from sim_action.world.scene import Scene

_KEY: Final = "ros2"
_DESCRIPTION: Final = "/robot_description"
# The wall time that a node may take to end after it has left the graph.
_MAX_LEAVE_S: Final = 5.0
_REALTIME: Final = "with pace: realtime, nodes run by the wall clock"


def open_nodes(source: Ros2Commands, scene: Scene) -> ClosedLoop:
    """Start the nodes of a source, and return its controller. Raise SourceProblem, ScriptError."""
    try:
        ros = find_ros()
    except UsageError as error:
        raise SourceProblem(str(error), _KEY) from None
    nodes = DrivenNodes(source, scene, ros)
    return ClosedLoop(
        nodes.tick,
        close=nodes.close,
        notes=nodes.notes,
        repeats=True,
        transcript=nodes.transcript,
        not_reproducible=nodes.not_reproducible,
    )


class DrivenNodes:
    """The nodes of a scenario, and the bridge to them.

    Attributes:
        transcript: all messages of nodes that command the robot.
        not_reproducible: reasons why another run may differ.
        notes: notes for the user, complete after `close`.
    """

    def __init__(self, source: Ros2Commands, scene: Scene, ros: Ros2) -> None:
        """Start the nodes, and wait until they are ready. Raise SourceProblem, ScriptError."""
        self._source, self._scene, self._rate = source, scene, source.rate
        self._is_realtime = source.ros2.pace == "realtime"
        self.transcript, self.notes = Transcript(), list[str]()
        self._started_at: float | None = None
        with ExitStack() as undo:
            domain = Domain.free()
            undo.callback(domain.close)
            folder = scratch_of(domain, scene.workspace)
            undo.callback(folder.close)
            packages = set_up_packages(source.ros2, ros, scene.workspace, folder)
            self._bridge = Bridge(ros.python, folder)
            undo.callback(self._bridge.close)
            self._nodes = [
                start_node(node, number, packages, scene.workspace, folder)
                for number, node in enumerate(source.ros2.nodes or ())
            ]
            self._lockstep = Lockstep(self._bridge, self._nodes)
            self.not_reproducible = self._lockstep.losses
            try:
                self._begin()
            except BridgeEnded as error:
                raise self._bridge_error(error) from None
            self._closing = undo.pop_all()

    def tick(self, seen: Observation) -> Answer:
        """Publish a moment, let the nodes handle it, and return the last command. Raise ScriptError."""
        try:
            self._publish(seen)
            received, listeners = self._bridge.take(len(self._nodes))
        except BridgeEnded as error:
            self._refuse_ended()
            raise self._bridge_error(error) from None
        self._await_leaving(listeners)
        for number, message in received:
            topic, node = self._senders[number]
            self.transcript.add(seen.time, topic, _bytes_of(message))
            self._commands.take(topic, message, node, seen)
        return self._commands.answer(seen)

    def close(self) -> None:
        """End the nodes, and collect notes."""
        self._closing.close()

    def _begin(self) -> None:
        """Hold the clock until all nodes are up, know each other, and are connected to the robot."""
        if (rmw := self._bridge.await_start()) != RMW:
            raise SourceProblem(f"the bridge runs on {rmw}; set RMW_IMPLEMENTATION={RMW}", _KEY)
        clocks = Lockstep.clocks(self._nodes)
        self._bridge.open(clocks, ())
        readiness = Readiness(self._bridge, self._nodes, self._refuse_ended, self._source.ros2.start_within)
        readiness.await_clocks()
        self._open_topics(len(clocks))
        readiness.await_answers()
        readiness.await_connections([*clocks, *self._endpoints], self._heard)
        self._lockstep.losses += readiness.ignoring
        if self._is_realtime:
            self._lockstep.losses.append(_REALTIME)
        else:
            self._lockstep.settle(0.0)
        # Commands from before the start arrive or not, depending on which node came up first.
        _, self._listeners = self._bridge.take(len(self._nodes))

    def _open_topics(self, first: int) -> None:
        """Open the topics of the robot; `first`: number of the first publisher."""
        stated, scene = self._source.ros2.topics, self._scene
        described = bool(self._bridge.graph([_DESCRIPTION]).publishers[_DESCRIPTION])
        found = channels(scene, stated, self._rate, described=described)
        wanted = {each.type for each in found.publishers} | {
            kind for each in found.subscriptions for kind in each.types
        }
        known = self._bridge.known_types(wanted)
        for kind in sorted(wanted - known):
            topics = [each.topic for each in found.publishers if each.type == kind]
            if topics:
                self.notes.append(f"not published, because ROS 2 has no {kind}: {', '.join(topics)}")
        self._publishers = [(first + k, each) for k, each in enumerate(p for p in found.publishers if p.type in known)]
        graph = self._bridge.graph(
            [*(each.topic for each in found.publishers), *(each.topic for each in found.subscriptions)]
        )
        subscriptions = [each.matched(graph.publishers[each.topic]) for each in found.subscriptions]
        for _, each in self._publishers:
            self.notes += subscriber_problems(each.topic, each.type, each.qos, graph.subscriptions[each.topic])
        self._senders = [
            (each.topic, next((end.node for end in graph.publishers[each.topic]), "a node")) for each in subscriptions
        ]
        self._endpoints = [Endpoint(each.topic, each.type, each.qos) for _, each in self._publishers]
        self._heard = [Endpoint(each.topic, each.type, each.qos) for each in subscriptions]
        self._commands = ReceivedCommands(subscriptions)
        self._bridge.open(self._endpoints, self._heard)

    def _publish(self, seen: Observation) -> None:
        tick = round(seen.time * self._rate)
        is_due = False
        for number, publisher in self._publishers:
            message = publisher.message(tick, seen)
            if message is not None:
                self._bridge.publish(number, message)
                is_due = True
        if self._is_realtime:
            self._lockstep.tell_time(seen.time)
            self._sleep_until(seen.time)
            return
        # What is known comes first, and then the time: else a timer and a message of the same tick race.
        if is_due:
            self._lockstep.settle(seen.time)
        self._lockstep.advance(seen.time)

    def _sleep_until(self, seconds: float) -> None:
        now = time.monotonic()
        if self._started_at is None:
            self._started_at = now - seconds
        time.sleep(max(0.0, self._started_at + seconds - now))

    def _await_leaving(self, listeners: list[int]) -> None:
        """Hold sim time while a node ends: it leaves the graph first, and then ends by the wall clock.

        Raise ScriptError if a node has failed.
        """
        if listeners != self._listeners:
            for node, before, now in zip(self._nodes, self._listeners, listeners, strict=True):
                if now < before:
                    node.process.await_end(_MAX_LEAVE_S)
            self._listeners = listeners
        self._refuse_ended()

    def _refuse_ended(self) -> None:
        """Raise ScriptError if a node has failed, or a required one has finished."""
        for node in self._nodes:
            code = node.process.exit_code()
            if code or (code == 0 and node.required):
                raise node_error(node.process, code, self._scene.workspace.root)

    def _bridge_error(self, error: BridgeEnded) -> ScriptError:
        return ScriptError(f"the bridge to ROS 2 failed: {error}", details=self._bridge.process.text())


def _bytes_of(message: Message) -> bytes:
    return json.dumps(message, default=list).encode()
