"""The controller of a scenario that nodes of ROS 2 drive: it starts them, and exchanges messages with them in ticks."""

from __future__ import annotations

import json
import os
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final

from sim_action.commands import ClosedLoop
from sim_action.core.errors import ScriptError, SourceProblem, UsageError
from sim_action.core.records import dataclass, field
from sim_action.core.wording import escaped_line, shortened
from sim_action.core.workspace import Workspace
from sim_action.ros import node_start
from sim_action.ros.messages import Message
from sim_action.ros.program_failures import ending_of, exit_text, last_location
from sim_action.ros.ros2.bridge_link import Bridge, BridgeEnded, Endpoint
from sim_action.ros.ros2.graph import Qos, TopicEnd, large_message_problem, order_notes, subscriber_problems, unheard
from sim_action.ros.ros2.installation import RMW, Ros2, find_ros
from sim_action.ros.ros2.launch.launched_nodes import LaunchedNodes, LaunchSpec
from sim_action.ros.ros2.lockstep import Lockstep, Readiness
from sim_action.ros.ros2.node_processes import Node, NodeGroup
from sim_action.ros.ros2.received_commands import ReceivedCommands, unsent
from sim_action.ros.ros2.started_nodes import Domain, ListedNodes, scratch_of, set_up_packages
from sim_action.ros.ros2.topics import DESCRIPTION, TRANSFORM_TOPICS, Channels, channels, topics_of
from sim_action.state.command import Answer
from sim_action.state.observation import Observation
from sim_action.state.trace import Transcript
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.ros.ros2.node_processes import ProcessFolder
    from sim_action.ros.ros2.packages import Packages
    from sim_action.ros.ros2.spec import Ros2Nodes

ROSOUT: Final = "/rosout"
_LOG_TYPE: Final = "rcl_interfaces/msg/Log"
# As publishers of logs have it: late subscribers get what was logged before.
_LOG_DEPTH: Final = 1000
_ERROR: Final = 40
_FATAL: Final = 50
_MAX_CHARS: Final = 300
_MAX_ERRORS: Final = 10
_KEY: Final = "ros2"
_EPSILON_S: Final = 1e-6  # ticks at the same time differ by less
_MAX_LEAVE_S: Final = 10.0  # the wall time that a node may take to end after it has left the graph
_MORE_CALMS: Final = 2  # the calms after the first one, in which nodes of a launch get to know all others
# Every system buffers as much.
_SMALL_BYTES: Final = 100_000
_REALTIME: Final = "with pace: realtime, nodes run by the wall clock"


def errors_endpoint(publishers: Sequence[TopicEnd]) -> Endpoint:
    """Return the subscription to errors, with the durability that its publishers have."""
    keeps = all(end.durability == "transient_local" for end in publishers)
    qos = Qos(durability="transient_local" if keeps else "volatile", depth=_LOG_DEPTH)
    return Endpoint(ROSOUT, _LOG_TYPE, qos, least=("level", _ERROR))


_Source = tuple[str, int, str, int]  # node, level, and the file and the line of code that log errors


class LoggedErrors:
    """The errors of a run: one message for each line of code that logs them, in the order of their first errors."""

    def __init__(self, directory: Path) -> None:
        """Begin without errors; `directory`: the folder of the user's code."""
        self._directory = directory
        self._first: dict[_Source, tuple[int, str]] = {}
        self._times: Counter[_Source] = Counter()
        self.messages: list[str] = []

    def take(self, message: Message, seconds: float | None) -> None:
        """Take a message of the topic, at a sim time in s; None: sim time has not begun."""
        source = message["name"], message["level"], message["file"], message["line"]
        when = "before sim time began" if seconds is None else f"at {seconds:g} s of sim time"
        said = shortened(escaped_line(message["msg"].strip()), _MAX_CHARS)
        place, _ = self._first.setdefault(source, (len(self._first), f"{when}: {said}"))
        self._times[source] += 1
        if place > _MAX_ERRORS:
            return
        text = self._text(source) if place < _MAX_ERRORS else "nodes logged errors in more places"
        self.messages[place : place + 1] = [text]

    def _text(self, source: _Source) -> str:
        node, level, file, line = source
        times = self._times[source]
        kind = "a fatal error" if level >= _FATAL else "an error"
        often = f" {times} times, first" if times > 1 else ""
        place = last_location([(file, line)], self._directory) if Path(file).is_absolute() else None
        where = f" ({place})" if place else ""
        return escaped_line(f"the node '{node}' logged {kind}{often} {self._first[source][1]}{where}")


def open_nodes(spec: Ros2Nodes, rate: float, scene: Scene) -> ClosedLoop:
    """Start nodes, and return their controller; `rate`: ticks per second. Raise SourceProblem, ScriptError."""
    try:
        ros = find_ros()
    except UsageError as error:
        raise SourceProblem(str(error), _KEY) from None
    with ExitStack() as undo:
        session: Session | None = scene.shared.get(_KEY)
        if session is None or any(robot.space == spec.space for robot in session.robots):
            inherited = {**os.environ, **node_start.variables(scene.seed)}
            session = Session.open(spec, ros, scene.workspace, inherited, undo)
            if _KEY not in scene.shared:
                scene.shared[_KEY] = session
                undo.callback(scene.shared.pop, _KEY)
        group = _started(spec, rate, scene, session)
        undo.callback(group.close)
        nodes = DrivenNodes(spec, rate, scene, session, group)
        nodes.closing = undo.pop_all()
        if session.robots[0] is nodes:
            nodes.notes += [*ros.notes, *session.packages.notes]
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
        logged_errors=nodes.errors.messages,
        why_silent=nodes.why_silent,
    )


def _started(spec: Ros2Nodes, rate: float, scene: Scene, session: Session) -> NodeGroup:
    """Start the nodes that the scenario lists, or its launch file. Raise SourceProblem, ScriptError."""
    if spec.launch is None:
        return ListedNodes(spec, session.packages, scene.workspace, session.folder)
    package, name, *arguments = spec.launch
    packages, topics = session.packages, robot_channels(spec, rate, scene)
    if packages.ros is None or (file := packages.launch_files(package).get(name)) is None:
        raise SourceProblem(f"'{package}/{name}' does not exist any more", _KEY)
    root = scene.workspace.root
    launched = LaunchSpec(file, packages.ros.python, arguments, root, topics, spec.allow_losses)
    return LaunchedNodes(launched, session.folder)


def robot_channels(spec: Ros2Nodes, rate: float, scene: Scene, *, described: bool = False) -> Channels:
    """Return the topics of the robot; `described`: another node publishes its description."""
    return channels(scene, spec.topics, rate, spec.controllers, described=described, space=spec.space)


@dataclass(frozen=True, slots=True)
class Session:
    """The folder of the processes of a run, its packages, its bridge, and the robots whose nodes share them."""

    folder: ProcessFolder
    packages: Packages
    bridge: Bridge
    robots: list[DrivenNodes] = field(default_factory=list)
    graph_notes: list[str] = field(default_factory=list)

    @classmethod
    def open(
        cls, spec: Ros2Nodes, ros: Ros2, workspace: Workspace, inherited: Mapping[str, str], undo: ExitStack
    ) -> Session:
        """Start the bridge; all processes see `inherited`, and `undo` gets what ends it. Raise SourceProblem."""
        domain = Domain.free()
        undo.callback(domain.close)
        folder = scratch_of(domain, workspace, inherited)
        undo.callback(folder.close)
        packages = set_up_packages(spec, ros, workspace, folder)
        bridge = Bridge(ros.python, folder)
        undo.callback(bridge.close)
        return cls(folder, packages, bridge)


class DrivenNodes:
    """The nodes that drive a robot, and the bridge to them.

    If several robots have nodes, all have published a moment before sim time advances. The first robots in a tick
    obey at the next tick what nodes then send. `seconds`: sim time of the last tick. `lockstep`: shared by the nodes of
    all robots. `listeners`: the number of subscriptions of each of its clocks; of the first robot. `transcript`: all
    messages that command the robot; `has_heard`: there was one. `notes` are complete after `close`.
    """

    def __init__(self, spec: Ros2Nodes, rate: float, scene: Scene, session: Session, group: NodeGroup) -> None:
        """Wait until the nodes are ready. Raise SourceProblem, ScriptError."""
        self._spec, self._rate, self._scene = spec, rate, scene
        self._is_realtime = spec.pace == "realtime"
        self.transcript = Transcript()
        self.notes = list[str]()
        self._started_at: float | None = None
        self.space, self.seconds, self.topics = spec.space, -1 / rate, frozenset[str]()
        self.listeners = list[int]()
        self._inbox = list[tuple[int, Message]]()
        self._largest: dict[str, int] = {}
        self.errors = LoggedErrors(scene.workspace.root)
        self.has_heard = False
        self._finished = dict[int | str, str]()
        self._misfits = list[str]()
        self._session, self._bridge, self._group = session, session.bridge, group
        self._forward = session.folder.forward
        self.losses = group.losses
        self.closing = ExitStack()
        session.robots.append(self)
        self._first = session.robots[0]
        try:
            self._begin()
        except BridgeEnded as error:
            raise self._bridge_error(error) from None

    def tick(self, seen: Observation) -> Answer:
        """Publish a moment, let the nodes handle it, and return the last command. Raise ScriptError."""
        self.seconds = seen.time
        try:
            self._group.tell_time(seen.time)
            self._admit_new_nodes()
            self._publish(seen)
            if not any(map(self._waits_for, self._session.robots)):
                self._first.advance(seen.time)
            self._group.refuse_ended()
            self._first.note_finished(seen.time)
            self._admit_new_nodes()
        except BridgeEnded as error:
            self._group.refuse_ended()
            raise self._bridge_error(error) from None
        received, self._inbox = self._inbox, []
        for number, message in received:
            topic, node = self._senders[number]
            self.has_heard = True
            self.transcript.add(seen.time, topic, json.dumps(message, default=list).encode())
            self._commands.take(topic, message, node, seen)
        if round(seen.time * self._rate) % round(self._rate) == 0:
            self._forward()
        return self._commands.answer(seen)

    def _waits_for(self, other: DrivenNodes) -> bool:
        """Return True if another robot, which ticked one period ago, is still to publish this moment."""
        return abs(self.seconds - other.seconds - 1 / self._rate) < _EPSILON_S

    def advance(self, seconds: float) -> None:
        """Let the nodes of all robots hear of a sim time in s, and pass on what they send. Raise BridgeEnded."""
        if self._is_realtime:
            self.lockstep.tell_time(seconds)
            now = time.monotonic()
            if self._started_at is None:
                self._started_at = now - seconds
            time.sleep(max(0.0, self._started_at + seconds - now))
        else:
            self.lockstep.advance(seconds)
        received, listeners = self._bridge.take(self.lockstep.clocks)
        self.hear_errors(received, seconds)
        for robot in self._session.robots:
            robot.receive(received)
        # Hold sim time while a node ends: it leaves the graph first, and then ends by the wall clock.
        if listeners != self.listeners:
            for node, before, after in zip(self.lockstep.nodes, self.listeners, listeners, strict=True):
                if after < before:
                    node.process.await_end(_MAX_LEAVE_S)
            self.listeners = listeners

    def receive(self, received: Sequence[tuple[int, Message]]) -> None:
        """Keep the commands of this robot until its next answer."""
        numbered = ((place - self._first_heard, message) for place, message in received)
        self._inbox += ((number, message) for number, message in numbered if 0 <= number < len(self._senders))

    def why_silent(self) -> str:
        """Return why nodes do not move the robot, as far as the topics show."""
        reasons = list[str]()
        with suppress(BridgeEnded):
            graph = self._bridge.whole_graph()
            if not self.has_heard:
                reasons += unsent(graph, self._subscriptions)
            reasons += [*self._finished.values(), *self._misfits, *unheard(graph, self._published)]
        return "; ".join(reasons)

    @property
    def _published(self) -> frozenset[str]:
        return frozenset(endpoint.topic for endpoint in self._bridge.published)

    def close(self) -> None:
        """End the nodes, and collect notes."""
        self._forward()
        self.closing.close()
        if self._first is self:
            self.notes += self._session.graph_notes
        self.notes += self._group.notes

    def _begin(self) -> None:
        """Hold the clock until all nodes are up, know each other, and are connected to the robot."""
        if (rmw := self._bridge.await_start()) != RMW:
            raise SourceProblem(f"the bridge runs on {rmw}; set RMW_IMPLEMENTATION={RMW}", _KEY)
        self._group.await_start()
        if self._first is self:
            self.lockstep = Lockstep(self._bridge, self._group.roots)
            self.not_reproducible = self.lockstep.losses
        else:
            self.lockstep, self.not_reproducible = self._first.lockstep, []
            self.lockstep.watch_more(self._group.roots)
        self._admit_new_nodes()
        # The types and the nodes of commands are known only when all nodes are.
        self._open_topics()
        self._admit(())
        notes = self._session.graph_notes
        notes.clear()
        if self._is_realtime:
            self.not_reproducible += [_REALTIME] if self._first is self else []
        else:
            notes += order_notes(self._bridge.whole_graph())
            self.lockstep.hold()
            self.lockstep.settle(0.0)
        # Commands from before the start arrive or not, depending on which node came up first.
        received, _ = self._bridge.take(())
        self._first.hear_errors(received, None)
        notes += unheard(self._bridge.whole_graph(), self._published)

    def hear_errors(self, received: Sequence[tuple[int, Message]], seconds: float | None) -> None:
        """Take the errors that nodes of any robot logged until a sim time in s; None: it has not begun."""
        for number, message in received:
            if number == self._log:
                # The logger of the node /robot2/driver is robot2.driver.
                node = f"/{message['name']}/".replace(".", "/")
                spaces = [len(robot.space) * node.startswith(f"{robot.space}/") for robot in self._session.robots]
                self._session.robots[spaces.index(max(spaces))].errors.take(message, seconds)

    def _admit_new_nodes(self) -> None:
        while new := self._group.new_nodes():
            self._admit(new)

    def _admit(self, new: Sequence[Node]) -> None:
        """Wait until new nodes are up, and all know each other. Raise ScriptError, BridgeEnded."""
        self.lockstep.add(new)
        readiness = Readiness(self._bridge, new, self._group.refuse_ended, self._spec.start_within)
        readiness.await_clocks()
        readiness.await_answers()
        commands = topics_of(self._scene, self._spec.topics, self._spec.controllers, self.space)
        watched = {self.space + DESCRIPTION, *commands.values()}
        readiness.await_connections(watched)
        # On a busy machine, nodes of a launch may not have been able to announce themselves during one calm.
        for _ in range(_MORE_CALMS if self._spec.launch and not self._is_realtime else 0):
            self.lockstep.settle(max(0.0, self.seconds))
            readiness.await_connections(watched)
        self.lockstep.losses += (loss for loss in readiness.losses if loss not in self.lockstep.losses)
        self._first.listeners = self.lockstep.listeners()

    def _open_topics(self) -> None:
        """Open the topics of the robot."""
        description = self.space + DESCRIPTION
        described = bool(self._bridge.graph([description]).publishers[description])
        robot = robot_channels(self._spec, self._rate, self._scene, described=described)
        self.topics = robot.published | robot.commands
        for other in self._session.robots[:-1]:
            if both := sorted(self.topics & other.topics - TRANSFORM_TOPICS):
                raise SourceProblem(f"'{both[0]}' is already a topic of another robot; change 'topics' of one", _KEY)
        types = {publisher.type for publisher in robot.publishers}
        types.update(kind for subscription in robot.subscriptions for kind in subscription.types)
        available = self._bridge.known_types(types)
        for kind in sorted(types - available):
            if topics := [publisher.topic for publisher in robot.publishers if publisher.type == kind]:
                self.notes.append(f"not published, because ROS 2 has no {kind}: {', '.join(topics)}")
        publishers = [publisher for publisher in robot.publishers if publisher.type in available]
        graph = self._bridge.graph({ROSOUT, *self.topics})
        heard = [subscription for subscription in robot.subscriptions if available.intersection(subscription.types)]
        subscriptions = [subscription.matched(graph.publishers[subscription.topic]) for subscription in heard]
        for publisher in publishers:
            self._misfits += subscriber_problems(
                publisher.topic, publisher.type, publisher.qos, graph.subscriptions[publisher.topic]
            )
        self.notes += self._misfits
        self._senders = [
            (subscription.topic, next((end.node for end in graph.publishers[subscription.topic]), "a node"))
            for subscription in subscriptions
        ]
        self._subscriptions = subscriptions
        self._commands = ReceivedCommands(subscriptions)
        self._first_heard = len(self._bridge.heard)
        self._log = self._first_heard + len(subscriptions)
        first = self._bridge.open(
            [Endpoint(publisher.topic, publisher.type, publisher.qos) for publisher in publishers],
            [
                *(Endpoint(subscription.topic, subscription.type, subscription.qos) for subscription in subscriptions),
                *([errors_endpoint(graph.publishers[ROSOUT])] if self._first is self else ()),
            ],
        )
        self._publishers = list(enumerate(publishers, first))

    def _publish(self, seen: Observation) -> None:
        tick = round(seen.time * self._rate)
        if tick and not self._is_realtime:
            self.lockstep.notice_wakes()
        for number, publisher in self._publishers:
            message = publisher.message(tick, seen)
            if message is not None:
                self._notice_size(number, publisher.topic, self._bridge.publish(number, message))
                # One message after the other, and then the time: else two callbacks of a node race.
                if not self._is_realtime:
                    self.lockstep.settle(seen.time)

    def _notice_size(self, number: int, topic: str, size: int) -> None:
        """Notice messages that are too large, once for each topic that a node hears."""
        if size <= self._largest.get(topic, _SMALL_BYTES):
            return
        self._largest[topic] = size
        problem = large_message_problem(topic, size)
        if problem and self._bridge.matched()[0][number]:
            self.not_reproducible.append(problem)

    def note_finished(self, seconds: float) -> None:
        """Note the nodes of all robots that have ended until a sim time in s."""
        for node in self.lockstep.nodes:
            if node.number not in self._finished and node.process.exit_code() is not None:
                self._finished[node.number] = f"the node '{node.process.label}' finished at {seconds:g} s of sim time"
                self.notes.append(f"{self._finished[node.number]}; its last command holds")

    def _bridge_error(self, error: BridgeEnded) -> ScriptError:
        process = self._bridge.process
        process.await_end(_MAX_LEAVE_S)
        code = process.exit_code()
        text = process.text()
        how = f"failed: {error}" if code is None else f"ended with {exit_text(code)}"
        said = ending_of(text, self._scene.workspace.root).said
        return ScriptError(escaped_line(f"the bridge to ROS 2, a process of sim-action, {how}{said}"), details=text)
