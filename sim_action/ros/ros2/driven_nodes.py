"""The controller of a scenario that nodes of ROS 2 drive: it starts them, and exchanges messages with them in ticks."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING, Final

from sim_action.commands import ClosedLoop
from sim_action.core.errors import ScriptError, SourceProblem, UsageError
from sim_action.core.records import dataclass
from sim_action.core.wording import escaped_line
from sim_action.ros.program_failures import exit_text
from sim_action.ros.ros2.bridge_link import Bridge, BridgeEnded, Endpoint
from sim_action.ros.ros2.diagnosis.logged_errors import ROSOUT, LoggedErrors, errors_endpoint
from sim_action.ros.ros2.diagnosis.message_order import order_notes
from sim_action.ros.ros2.diagnosis.node_endings import ending_of
from sim_action.ros.ros2.diagnosis.unconnected_topics import unheard, unsent, whole_graph
from sim_action.ros.ros2.domain import Domain
from sim_action.ros.ros2.installation import RMW, Ros2, find_ros
from sim_action.ros.ros2.launch.launched_nodes import LaunchedNodes, LaunchSpec, RobotTopics
from sim_action.ros.ros2.lockstep import CLOCK, Lockstep
from sim_action.ros.ros2.messages import Message
from sim_action.ros.ros2.node_group import Node, NodeGroup
from sim_action.ros.ros2.quality import large_message_problem, subscriber_problems
from sim_action.ros.ros2.readiness import Readiness
from sim_action.ros.ros2.received_commands import ReceivedCommands
from sim_action.ros.ros2.started_nodes import ListedNodes, scratch_of, set_up_packages
from sim_action.ros.ros2.topics import channels, topics_of
from sim_action.state.command import Answer
from sim_action.state.observation import Observation
from sim_action.state.reproducibility import Transcript

if TYPE_CHECKING:
    from sim_action.core.workspace import Workspace
    from sim_action.ros.ros2.node_processes import ProcessFolder
    from sim_action.ros.ros2.packages import Packages
    from sim_action.ros.ros2.spec import Ros2Commands, Ros2Nodes
    from sim_action.world.scene import Scene

_KEY: Final = "ros2"
_DESCRIPTION: Final = "/robot_description"
# The wall time that a node may take to end after it has left the graph.
_MAX_LEAVE_S: Final = 5.0
# The calms after the first one, in which nodes of a launch get to know all others.
_MORE_CALMS: Final = 2
# Every system buffers as much.
_SMALL_BYTES: Final = 100_000
_REALTIME: Final = "with pace: realtime, nodes run by the wall clock"


def open_nodes(source: Ros2Commands, scene: Scene) -> ClosedLoop:
    """Start the nodes of a source, and return its controller. Raise SourceProblem, ScriptError."""
    try:
        ros = find_ros()
    except UsageError as error:
        raise SourceProblem(str(error), _KEY) from None
    with ExitStack() as undo:
        session = Session.open(source.ros2, ros, scene.workspace, os.environ, undo)
        group = _started(source, scene, session)
        undo.callback(group.close)
        nodes = DrivenNodes(source, scene, session, group)
        nodes.closing = undo.pop_all()
        nodes.notes += ros.notes
    return controller_of(nodes)


def controller_of(nodes: DrivenNodes) -> ClosedLoop:
    """Return the controller by which nodes drive a robot."""
    return ClosedLoop(
        nodes.tick,
        close=nodes.close,
        notes=nodes.notes,
        losses=nodes.losses,
        repeats=True,
        transcript=nodes.transcript,
        not_reproducible=nodes.not_reproducible,
        logged_errors=nodes.logged_errors,
        why_silent=nodes.why_silent,
    )


def _started(source: Ros2Commands, scene: Scene, session: Session) -> NodeGroup:
    """Start the nodes that the scenario lists, or its launch file. Raise SourceProblem, ScriptError."""
    spec = source.ros2
    if spec.launch is None:
        return ListedNodes(spec.nodes or (), session.packages, scene.workspace, session.folder)
    launched = LaunchSpec.of(spec, session.packages, scene.workspace, robot_topics(source, scene))
    return LaunchedNodes(launched, session.folder)


def robot_topics(source: Ros2Commands, scene: Scene) -> RobotTopics:
    """Return the names of the topics of the robot."""
    found = channels(scene, source.ros2.topics, source.rate, source.ros2.controllers, described=False)
    published = {each.topic for each in found.publishers} | {CLOCK}
    return RobotTopics(frozenset(each.topic for each in found.subscriptions), frozenset(published))


@dataclass(frozen=True, slots=True)
class Session:
    """The folder of the processes of a run, its packages, and its bridge."""

    folder: ProcessFolder
    packages: Packages
    bridge: Bridge

    @classmethod
    def open(
        cls, spec: Ros2Nodes, ros: Ros2, workspace: Workspace, inherited: Mapping[str, str], undo: ExitStack
    ) -> Session:
        """Start the bridge, and return at once. Raise SourceProblem.

        `inherited`: variables that all processes see; `undo`: gets what ends the session.
        """
        domain = Domain.free()
        undo.callback(domain.close)
        folder = scratch_of(domain, workspace, inherited)
        undo.callback(folder.close)
        packages = set_up_packages(spec, ros, workspace, folder)
        bridge = Bridge(ros.python, folder)
        undo.callback(bridge.close)
        return cls(folder, packages, bridge)


class DrivenNodes:
    """The nodes of a scenario, and the bridge to them.

    Attributes:
        closing: what ends the nodes.
        transcript: all messages of nodes that command the robot.
        not_reproducible: reasons why another run may differ.
        logged_errors: errors that nodes logged.
        notes: notes for the user, complete after `close`.
        losses: parts of a launch file that are not simulated, if they are allowed.
    """

    def __init__(self, source: Ros2Commands, scene: Scene, session: Session, group: NodeGroup) -> None:
        """Wait until the nodes are ready. Raise SourceProblem, ScriptError."""
        self._source, self._scene, self._rate = source, scene, source.rate
        self._is_realtime = source.ros2.pace == "realtime"
        self.transcript, self.notes = Transcript(), list[str]()
        self._started_at: float | None = None
        self._seconds = 0.0
        self._largest: dict[str, int] = {}
        self._errors = LoggedErrors(scene.workspace.root)
        self.logged_errors = self._errors.messages
        self._has_heard, self._finished = False, dict[int, str]()
        self._misfits = list[str]()
        self._bridge, self._group = session.bridge, group
        self._forward = session.folder.forward
        self.losses = group.losses
        self.closing = ExitStack()
        try:
            self._begin()
        except BridgeEnded as error:
            raise self._bridge_error(error) from None

    def tick(self, seen: Observation) -> Answer:
        """Publish a moment, let the nodes handle it, and return the last command. Raise ScriptError."""
        self._seconds = seen.time
        try:
            self._group.tell_time(seen.time)
            self._admit_new_nodes()
            self._publish(seen)
            received, listeners = self._bridge.take(self._lockstep.clocks)
            self._hear_errors(received, seen.time)
            self._await_leaving(listeners, seen.time)
            self._admit_new_nodes()
        except BridgeEnded as error:
            self._group.refuse_ended()
            raise self._bridge_error(error) from None
        for place, message in received:
            if place == self._log:
                continue
            number = place - self._first_heard
            topic, node = self._senders[number]
            self._has_heard = True
            self.transcript.add(seen.time, topic, _bytes_of(message))
            self._commands.take(topic, message, node, seen)
        if round(seen.time * self._rate) % round(self._rate) == 0:
            self._forward()
        return self._commands.answer(seen)

    def why_silent(self) -> str:
        """Return why nodes do not move the robot, as far as the topics show."""
        reasons = list[str]()
        with suppress(BridgeEnded):
            graph = whole_graph(self._bridge)
            if not self._has_heard:
                reasons += unsent(graph, self._subscriptions)
            reasons += [*self._finished.values(), *self._misfits, *unheard(graph, self._published)]
        return "; ".join(reasons)

    @property
    def _published(self) -> frozenset[str]:
        return frozenset(each.topic for each in self._bridge.published)

    def close(self) -> None:
        """End the nodes, and collect notes."""
        self._forward()
        self.closing.close()
        self.notes += self._group.notes

    def _begin(self) -> None:
        """Hold the clock until all nodes are up, know each other, and are connected to the robot."""
        if (rmw := self._bridge.await_start()) != RMW:
            raise SourceProblem(f"the bridge runs on {rmw}; set RMW_IMPLEMENTATION={RMW}", _KEY)
        self._group.await_start()
        self._lockstep = Lockstep(self._bridge, self._group.roots)
        self.not_reproducible = self._lockstep.losses
        self._admit_new_nodes()
        # The types and the nodes of commands are known only when all nodes are.
        self._open_topics()
        self._admit(())
        if self._is_realtime:
            self._lockstep.losses.append(_REALTIME)
        else:
            self.notes += order_notes(whole_graph(self._bridge))
            self._lockstep.hold()
            self._lockstep.settle(0.0)
        # Commands from before the start arrive or not, depending on which node came up first.
        received, _ = self._bridge.take(())
        self._hear_errors(received, None)
        self.notes += unheard(whole_graph(self._bridge), self._published)

    def _hear_errors(self, received: list[tuple[int, Message]], seconds: float | None) -> None:
        for number, message in received:
            if number == self._log:
                self._errors.take(message, seconds)

    def _admit_new_nodes(self) -> None:
        while new := self._group.new_nodes():
            self._admit(new)

    def _admit(self, new: Sequence[Node]) -> None:
        """Wait until new nodes are up, and all know each other. Raise ScriptError, BridgeEnded."""
        self._lockstep.add(new)
        readiness = Readiness(self._bridge, new, self._group.refuse_ended, self._source.ros2.start_within)
        readiness.await_clocks()
        readiness.await_answers()
        ros2 = self._source.ros2
        commands = topics_of(self._scene, ros2.topics, ros2.controllers)
        readiness.await_connections({_DESCRIPTION, *commands.values()})
        # On a busy machine, nodes of a launch may not have been able to announce themselves during one calm.
        for _ in range(_MORE_CALMS if ros2.launch and not self._is_realtime else 0):
            self._lockstep.settle(self._seconds)
            readiness.await_connections({_DESCRIPTION, *commands.values()})
        self._lockstep.losses += (each for each in readiness.losses if each not in self._lockstep.losses)
        self._listeners = self._lockstep.listeners()

    def _open_topics(self) -> None:
        """Open the topics of the robot."""
        stated, scene = self._source.ros2.topics, self._scene
        described = bool(self._bridge.graph([_DESCRIPTION]).publishers[_DESCRIPTION])
        found = channels(scene, stated, self._rate, self._source.ros2.controllers, described=described)
        wanted = {each.type for each in found.publishers} | {
            kind for each in found.subscriptions for kind in each.types
        }
        known = self._bridge.known_types(wanted)
        for kind in sorted(wanted - known):
            topics = [each.topic for each in found.publishers if each.type == kind]
            if topics:
                self.notes.append(f"not published, because ROS 2 has no {kind}: {', '.join(topics)}")
        publishers = [each for each in found.publishers if each.type in known]
        graph = self._bridge.graph(
            [ROSOUT, *(each.topic for each in found.publishers), *(each.topic for each in found.subscriptions)]
        )
        subscriptions = [each.matched(graph.publishers[each.topic]) for each in found.subscriptions]
        for each in publishers:
            self._misfits += subscriber_problems(each.topic, each.type, each.qos, graph.subscriptions[each.topic])
        self.notes += self._misfits
        self._senders = [
            (each.topic, next((end.node for end in graph.publishers[each.topic]), "a node")) for each in subscriptions
        ]
        self._subscriptions = subscriptions
        self._commands = ReceivedCommands(subscriptions)
        self._first_heard = len(self._bridge.heard)
        self._log = self._first_heard + len(subscriptions)
        first = self._bridge.open(
            [Endpoint(each.topic, each.type, each.qos) for each in publishers],
            [
                *(Endpoint(each.topic, each.type, each.qos) for each in subscriptions),
                errors_endpoint(graph.publishers[ROSOUT]),
            ],
        )
        self._publishers = list(enumerate(publishers, first))

    def _publish(self, seen: Observation) -> None:
        tick = round(seen.time * self._rate)
        if tick and not self._is_realtime:
            self._lockstep.notice_wakes()
        for number, publisher in self._publishers:
            message = publisher.message(tick, seen)
            if message is not None:
                self._notice_size(number, publisher.topic, self._bridge.publish(number, message))
                # One message after the other, and then the time: else two callbacks of a node race.
                if not self._is_realtime:
                    self._lockstep.settle(seen.time)
        if self._is_realtime:
            self._lockstep.tell_time(seen.time)
            self._sleep_until(seen.time)
            return
        self._lockstep.advance(seen.time)

    def _notice_size(self, number: int, topic: str, size: int) -> None:
        """Notice messages that are too large, once for each topic that a node hears."""
        if size <= self._largest.get(topic, _SMALL_BYTES):
            return
        self._largest[topic] = size
        problem = large_message_problem(topic, size)
        if problem and self._bridge.matched()[0][number]:
            self.not_reproducible.append(problem)

    def _sleep_until(self, seconds: float) -> None:
        now = time.monotonic()
        if self._started_at is None:
            self._started_at = now - seconds
        time.sleep(max(0.0, self._started_at + seconds - now))

    def _await_leaving(self, listeners: list[int], seconds: float) -> None:
        """Hold sim time while a node ends: it leaves the graph first, and then ends by the wall clock.

        Raise ScriptError if a node has failed.
        """
        if listeners != self._listeners:
            for node, before, now in zip(self._lockstep.nodes, self._listeners, listeners, strict=True):
                if now < before:
                    node.process.await_end(_MAX_LEAVE_S)
            self._listeners = listeners
        self._group.refuse_ended()
        self._note_finished(seconds)

    def _note_finished(self, seconds: float) -> None:
        for node in self._lockstep.nodes:
            if node.number not in self._finished and node.process.exit_code() is not None:
                self._finished[node.number] = f"the node '{node.process.label}' finished at {seconds:g} s of sim time"
                self.notes.append(f"{self._finished[node.number]}; its last command holds")

    def _bridge_error(self, error: BridgeEnded) -> ScriptError:
        process = self._bridge.process
        process.await_end(_MAX_LEAVE_S)
        code, text = process.exit_code(), process.text()
        how = f"failed: {error}" if code is None else f"ended with {exit_text(code)}"
        said = ending_of(text, self._scene.workspace.root).said
        return ScriptError(escaped_line(f"the bridge to ROS 2, a process of sim-action, {how}{said}"), details=text)


def _bytes_of(message: Message) -> bytes:
    return json.dumps(message, default=list).encode()
