"""The topics on which Gazebo tells of the world, whatever plugins there are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from gazebo_msgs.msg import LinkStates, ModelStates
from rosgraph_msgs.msg import Clock

from sim_action.core.geometry import Pose, Twist
from sim_action.ros.ros1.node.messages import pose_message, time_of, twist_message
from sim_action.ros.ros1.node.publishing import Sender, Traffic

GROUND: Final = "ground_plane"
"""What Gazebo calls the ground."""

States = Mapping[str, tuple[Pose, Twist]]
"""Name -> pose and twist, world frame."""

_STILL: Final = Pose(), Twist()


class Topics:
    """Tells, if somebody listens."""

    def __init__(self, traffic: Traffic) -> None:
        self._clock = Sender("/clock", Clock, traffic)
        self._models = Sender("/gazebo/model_states", ModelStates, traffic)
        self._links = Sender("/gazebo/link_states", LinkStates, traffic)

    @property
    def listeners(self) -> int:
        """How many nodes are told the time."""
        return self._clock.listeners

    @property
    def are_links_heard(self) -> bool:
        """Whether a node wants to know of links."""
        return self._links.is_heard

    def tell_time(self, seconds: float) -> None:
        """Publishes the clock."""
        self._clock.send(Clock(time_of(seconds)))

    def tell_models(self, models: States) -> bool:
        """Publishes where models are; returns whether somebody listens."""
        if not self._models.is_heard:
            return False
        self._models.send(ModelStates(*_columns({GROUND: _STILL, **models})))
        return True

    def tell_links(self, links: States) -> bool:
        """Publishes where links are, each called after its model and itself; returns whether somebody listens."""
        if not self._links.is_heard:
            return False
        self._links.send(LinkStates(*_columns({f"{GROUND}::link": _STILL, **links})))
        return True


def _columns(states: States) -> tuple[list[str], list[object], list[object]]:
    poses, twists = zip(*states.values(), strict=True)
    return list(states), list(map(pose_message, poses)), list(map(twist_message, twists))
