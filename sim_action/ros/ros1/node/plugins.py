"""The devices that replace Gazebo plugins: their topics, and the commands that they receive."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from typing import Any, Final
from xml.etree.ElementTree import Element

from sim_action.core.records import dataclass
from sim_action.robot.model.robot_model import RobotModel
from sim_action.ros.robot_topics import Schedule
from sim_action.ros.ros1.node.internal_parts import OnDemandSensor
from sim_action.ros.ros1.node.topics import Publisher, Subscription, Traffic
from sim_action.ros.ros1.node.world_models import ModelFrame
from sim_action.sensors import MountedSensor, Sensor
from sim_action.state.command import Answer, commands_of
from sim_action.state.observation import Observation

TICKS: Final = 100
"""Ticks per second of sim time: publications of the clock, and reads of commands. rospy.Rate(10) errs at fewer."""

Mover = Callable[[float, Observation], Answer]  # function from a sim time in s and an observation to commands


@dataclass(slots=True)
class RobotCommands:
    """The commands of nodes to the robot; `wheels`: joints that a twist turns."""

    subscriptions: tuple[Subscription, ...] = ()
    movers: tuple[Mover, ...] = ()
    wheels: frozenset[str] = frozenset()

    @property
    def topics(self) -> frozenset[str]:
        """The topics that drive the robot."""
        return frozenset(subscription.topic for subscription in self.subscriptions)

    @property
    def is_commanded(self) -> bool:
        """True if a node has sent a command that still holds."""
        return any(subscription.value is not None for subscription in self.subscriptions)

    def begin(self) -> None:
        """Drop commands from before the start of the clock: their arrival depends on which node came up first."""
        for subscription in self.subscriptions:
            subscription.begin()

    def answer(self, seconds: float, seen: Observation) -> Answer:
        """Return the commands at a sim time in s."""
        answers = (mover(seconds, seen) for mover in self.movers)
        return tuple(command for answer in answers for command in commands_of(answer))


@dataclass(frozen=True, slots=True)
class Wiring:
    """The input of a plugin when it is opened; `description`: of the robot, as it was spawned.

    `commands` receives subscriptions and movers. `is_clock_held`: True before the clock starts; subscribers are not
    known then. `warn` takes notes, and `lose` parts that are not simulated. `closing` closes topics when the robot is
    deleted.
    """

    model: RobotModel
    description: Element
    frame: ModelFrame
    commands: RobotCommands
    traffic: Traffic
    is_clock_held: Callable[[], bool]
    warn: Callable[[str], None]
    lose: Callable[[str], None]
    closing: ExitStack

    def publisher(self, topic: str, kind: type[Any]) -> Publisher:
        """Return a publisher of a topic."""
        return Publisher(topic, kind, self.traffic)

    def subscribe(self, topic: str, kind: type[Any], read: Callable[[Any], Any]) -> Subscription:
        """Subscribe to a command topic; `read`: turns a message into the value that is kept."""
        subscription = Subscription(topic, kind, read, self.traffic)
        self.commands.subscriptions = (*self.commands.subscriptions, subscription)
        self.closing.callback(subscription.close)
        return subscription

    def unsubscribe(self, subscription: Subscription) -> None:
        """Close a subscription."""
        self.commands.subscriptions = tuple(other for other in self.commands.subscriptions if other is not subscription)
        subscription.close()

    def add_mover(self, mover: Mover) -> None:
        """Call a mover at every tick from now on."""
        self.commands.movers = (*self.commands.movers, mover)

    def on_demand(self, sensor: Sensor, publisher: Publisher) -> Sensor:
        """Return a sensor that measures only for the subscribers of a publisher."""
        return OnDemandSensor.of(sensor, lambda _: publisher.has_subscribers or self.is_clock_held())

    def on_schedule(self, sensor: Sensor, schedule: Schedule, *publishers: Publisher) -> Sensor:
        """Return a sensor without memory that measures only for subscribers, and at each tick only if it is due."""

        def has_subscribers() -> bool:
            return any(publisher.has_subscribers for publisher in publishers) or self.is_clock_held()

        return OnDemandSensor.of(
            sensor, lambda seconds: schedule.is_due(round(seconds * TICKS)) and has_subscribers(), keeps_first=True
        )

    def controller_schedule(self, name: str, rate: float) -> Schedule:
        """Return the ticks of messages of a controller, and note a rate that is not reached."""
        if rate > TICKS:
            self.warn(f"{name}/publish_rate is {rate:g}: messages are published {TICKS} times per second")
        return schedule_of(rate)


@dataclass(frozen=True, slots=True)
class Device:
    """A plugin, or a part of it, that publishes by a schedule; `reads_links`: it reads the states of links."""

    schedule: Schedule
    publishers: tuple[Publisher, ...]
    publish: Callable[[float, Observation], None]
    sensor: MountedSensor | None = None
    reads_links: bool = False

    def publish_if_due(self, tick: int, seconds: float, seen: Observation) -> None:
        """Publish if it is due and a node subscribes."""
        if self.schedule.is_due(tick) and any(publisher.has_subscribers for publisher in self.publishers):
            self.publish(seconds, seen)


def schedule_of(rate: float) -> Schedule:
    """Return the ticks of messages, for a rate in Hz; a rate of 0 means every tick."""
    return Schedule.of(rate, TICKS)
