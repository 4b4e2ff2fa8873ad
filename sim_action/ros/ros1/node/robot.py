"""A robot of a scenario among nodes: at each tick it tells them what there is to know, and takes what they command."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import rospy
from geometry_msgs.msg import Twist

from sim_action.commands.answers import problem_with
from sim_action.core import geometry
from sim_action.core.errors import ScriptError
from sim_action.robot.robot_model import RobotModel
from sim_action.ros.ros1.driving.launched import Nodes
from sim_action.ros.ros1.driving.robot_topics import COMMANDS
from sim_action.ros.ros1.graph import Master
from sim_action.ros.ros1.node.ears import Ear
from sim_action.ros.ros1.node.lockstep import Lockstep
from sim_action.ros.ros1.node.messages import twist_of
from sim_action.ros.ros1.node.readings import open_topics
from sim_action.ros.ros1.node.topics import Topics
from sim_action.ros.ros1.node.world_states import states_in, states_sensor
from sim_action.state.command import Answer
from sim_action.state.observation import Observation
from sim_action.world.scene import Fitting

NAME: Final = "/gazebo"
"""As what it stands in for is called."""

_TWIST: Final = "geometry_msgs/Twist"


@dataclass(frozen=True, slots=True)
class RobotSpec:
    """What is told of, and how.

    Attributes:
        rate: ticks in a second of sim time.
        topics: what they are of -> topic.
    """

    model: RobotModel
    rate: float
    sensors: Sequence[Fitting]
    topics: dict[str, str]


class RobotNode:
    """The live half of a source whose commands are given by nodes."""

    def __init__(self, nodes: Nodes, robot: RobotSpec, start_within: float) -> None:
        """Becomes a node of theirs. Raises ScriptError."""
        self._nodes, self._robot = nodes, robot
        rospy.init_node(NAME.strip("/"), disable_signals=True)
        self._master = Master(os.environ["ROS_MASTER_URI"], NAME)
        self._lockstep = Lockstep(self._master, NAME, nodes.launcher, nodes.note_gone, start_within)
        traffic = Counter[str]()
        self._states = Topics(traffic)
        self._others = open_topics(robot.model, robot.sensors, robot.topics, robot.rate, traffic)
        self._ear = Ear(robot.topics[COMMANDS], Twist, twist_of, traffic)
        self._has_begun = False
        self._listeners = self._deaths = 0
        self._is_driven = False
        self.notes: list[str] = []
        self.sensors = (states_sensor(robot.rate, lambda: not self._has_begun or self._states.are_links_heard),)

    def tick(self, seen: Observation) -> Answer:
        """Tells nodes of a moment, waits until they have dealt with it, and returns what they say to it.

        Raises ScriptError if one of them has ended as it should not.
        """
        try:
            if not self._has_begun:
                self._begin()
            if self._tell(seen):
                self._lockstep.settle(seen.time)
            self._states.tell_time(seen.time)
            self._lockstep.settle(seen.time)
            self._look_after_leavers()
        except OSError:
            raise self._nodes.why_over() from None
        twist: geometry.Twist | None = self._ear.heard
        self._is_driven = self._is_driven or twist is not None
        if problem := problem_with(twist, self._robot.model):
            raise ScriptError(f"a node said on {self._ear.topic}: {problem}")
        return twist

    def close(self) -> None:
        """Ends the nodes, and notes what there is to say of them."""
        why = () if self._is_driven else self._why_not_driven()
        self._nodes.close()
        self.notes += [*self._nodes.notes, *self._lockstep.notes, *why]

    def _begin(self) -> None:
        """The clock does not start before everybody is there."""
        self._lockstep.begin(lambda: frozenset({self._ear.topic}), lambda: False)
        # Whether something was heard depends on who came up first.
        self._ear.begin()
        self._listeners, self._deaths = self._states.listeners, self._nodes.deaths
        self._has_begun = True

    def _look_after_leavers(self) -> None:
        """A node that is about to end hangs up, and then takes its time by the wall's clock: sim time waits for it.

        Raises ScriptError if one has ended as it should not.
        """
        listeners, deaths = self._states.listeners, self._nodes.deaths
        # Which of the two is known first of one that has ended is not said.
        leaving = (self._listeners - listeners) - (deaths - self._deaths)
        self._nodes.await_deaths(deaths + leaving)
        if leaving > 0 or listeners > self._listeners:
            self._listeners, self._deaths = listeners, self._nodes.deaths

    def _tell(self, seen: Observation) -> bool:
        """Returns whether somebody listens."""
        name, states = self._robot.model.name, states_in(seen)
        heard = [topic.tell(round(seen.time * self._robot.rate), seen) for topic in self._others]
        heard.append(self._states.tell_models({**states.bodies, name: (seen.pose, seen.twist)}))
        if states.links:
            bodies = {f"{body}::link": state for body, state in states.bodies.items()}
            links = {f"{name}::{link}": state for link, state in states.links.items()}
            heard.append(self._states.tell_links({**bodies, **links}))
        return any(heard)

    def _why_not_driven(self) -> tuple[str, ...]:
        """What to say of a robot that nobody has told anything; topics on which nodes talk of twists may be meant."""
        topic = self._ear.topic
        try:
            twists = self._master.published(_TWIST)
        except (OSError, LookupError):
            twists = {}
        others = sorted(name for name, by in twists.items() if name != topic and by - {NAME})
        hint = f"; {_TWIST} is published on {', '.join(others)}" if others else ""
        advice = f": if that is meant, say topics: {{{COMMANDS}: {others[0]}}}" if others else ""
        return (f"no node has driven the robot: nothing came on {topic}{hint}{advice}",)
