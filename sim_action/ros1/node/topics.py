"""The topics on which Gazebo tells of the world, whatever plugins there are."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from gazebo_msgs.msg import LinkStates, ModelStates
from rosgraph_msgs.msg import Clock

from sim_action.geometry import Pose, Twist
from sim_action.ros1.node.messages import pose_message, time_of, twist_message
from sim_action.ros1.node.publishing import publisher

GROUND: Final = "ground_plane"
"""What Gazebo calls the ground."""

States = Mapping[str, tuple[Pose, Twist]]
"""Name -> pose and twist, world frame."""

_STILL: Final = Pose(), Twist()


class Topics:
    """Tells, if somebody listens."""

    def __init__(self) -> None:
        self._clock = publisher("/clock", Clock)
        self._models = publisher("/gazebo/model_states", ModelStates)
        self._links = publisher("/gazebo/link_states", LinkStates)

    def tell_time(self, seconds: float) -> None:
        """Publishes the clock."""
        self._clock.publish(Clock(time_of(seconds)))

    def tell_models(self, models: States) -> bool:
        """Publishes where models are; returns whether somebody listens."""
        return _tell(self._models, {GROUND: _STILL, **models})

    def tell_links(self, links: States) -> bool:
        """Publishes where links are, each called after its model and itself; returns whether somebody listens."""
        return _tell(self._links, {f"{GROUND}::link": _STILL, **links})


def _tell(topic: Any, states: States) -> bool:
    if not topic.get_num_connections():
        return False
    poses, twists = zip(*states.values(), strict=True)
    topic.publish(list(states), list(map(pose_message, poses)), list(map(twist_message, twists)))
    return True
