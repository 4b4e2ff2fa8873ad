"""Devices: what a plugin of Gazebo does for a robot, done here. One file a plugin, or a few that are alike."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, Final, Protocol
from xml.etree.ElementTree import Element

from sim_action.robot.robot_model import RobotModel
from sim_action.ros.ros1.gazebo_plugins import Plugin
from sim_action.ros.ros1.node.current_state import ModelFrame
from sim_action.ros.ros1.node.internal_sensors import OnDemandSensor
from sim_action.ros.ros1.node.topics import Publisher, Subscription, Traffic
from sim_action.sensors import Sensor
from sim_action.sensors.mounting import MountedSensor
from sim_action.state.command import Answer, commands_of
from sim_action.state.observation import Observation

TICKS: Final = 100
"""In a second of sim time: so often the clock is told and commands are taken. On slower ones rospy.Rate(10) errs."""

Mover = Callable[[float, Observation], Answer]
"""From a sim time in s and what the robot is like to what it is to do."""


@dataclass(slots=True)
class RobotCommands:
    """What nodes have told the robot, and what comes of it.

    Attributes:
        ears: one for each topic on which they tell it.
        movers: what each of them makes of it.
        wheels: joints that a twist turns.
    """

    subscriptions: tuple[Subscription, ...] = ()
    movers: tuple[Mover, ...] = ()
    wheels: frozenset[str] = frozenset()

    @property
    def topics(self) -> frozenset[str]:
        """By which the robot is driven."""
        return frozenset(subscription.topic for subscription in self.subscriptions)

    @property
    def is_commanded(self) -> bool:
        """Whether a node has said anything that stands."""
        return any(subscription.value is not None for subscription in self.subscriptions)

    def begin(self) -> None:
        """Forgets what was said before the clock started: whether it was heard depends on who came up first."""
        for subscription in self.subscriptions:
            subscription.begin()

    def answer(self, seconds: float, seen: Observation) -> Answer:
        """What the robot is to do, at a sim time in s."""
        answers = (mover(seconds, seen) for mover in self.movers)
        return tuple(command for answer in answers for command in commands_of(answer))


@dataclass(frozen=True, slots=True)
class Wiring:
    """What plugins are opened with.

    Attributes:
        model: of the robot that they are of.
        description: of the same, as it was spawned.
        frame: of the same, which plugins of drives tell of.
        told: where what nodes say to the robot goes to.
        traffic: counts messages.
        is_held: whether the clock is: who will listen is not known before it starts.
        warn: takes what people are to know.
        closing: what is to be done when the robot is gone.
    """

    model: RobotModel
    description: Element
    frame: ModelFrame
    commands: RobotCommands
    traffic: Traffic
    is_clock_held: Callable[[], bool]
    warn: Callable[[str], None]
    closing: ExitStack

    def publisher(self, topic: str, kind: type[Any]) -> Publisher:
        """A topic for what a plugin tells."""
        return Publisher(topic, kind, self.traffic)

    def subscription(self, topic: str, kind: type[Any], read: Callable[[Any], Any]) -> Subscription:
        """A topic for what a plugin is told; `read`: makes of a message what is kept of it."""
        subscription = Subscription(topic, kind, read, self.traffic)
        self.commands.subscriptions = (*self.commands.subscriptions, subscription)
        self.closing.callback(subscription.close)
        return subscription

    def forget(self, subscription: Subscription) -> None:
        """It listens no more."""
        self.commands.subscriptions = tuple(each for each in self.commands.subscriptions if each is not subscription)
        subscription.close()

    def add_mover(self, mover: Mover) -> None:
        """From now on it is asked at every tick."""
        self.commands.movers = (*self.commands.movers, mover)

    def on_demand(self, sensor: Sensor, publisher: Publisher) -> Sensor:
        """A sensor that is read for those who listen to a topic."""
        return OnDemandSensor.of(sensor, lambda: publisher.has_subscribers or self.is_clock_held())


@dataclass(frozen=True, slots=True)
class Device:
    """The live half of a plugin, or of a part of it.

    Attributes:
        period: ticks from one call of `publish` to the next.
        senders: its topics.
        publish: tells nodes what there is to tell of a moment, at a sim time in s; called if a node listens.
        sensor: what it reads; its reading is in the observation.
        reads_links: whether it asks `world_states` about them.
    """

    period: int
    publishers: tuple[Publisher, ...]
    publish: Callable[[float, Observation], None]
    sensor: MountedSensor | None = None
    reads_links: bool = False

    def tell(self, tick: int, seconds: float, seen: Observation) -> bool:
        """Publishes, if it is time to; returns whether somebody listens."""
        if tick % self.period or not any(publisher.has_subscribers for publisher in self.publishers):
            return False
        self.publish(seconds, seen)
        return True


class Opener(Protocol):
    """What the table's entries are."""

    def __call__(self, plugin: Plugin, wiring: Wiring) -> Iterable[Device]:
        """Opens a plugin's topics."""


def period_of(rate: float) -> int:
    """Ticks from one message to the next, for a rate in Hz; 0 asks for as many as there can be."""
    return max(1, round(TICKS / rate)) if rate > 0 else 1
