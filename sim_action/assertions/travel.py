"""`travel: {at_least: 1.5 m}`: how far the robot is from where it stood."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from sim_action.assertions import Monitor
from sim_action.assertions.bounds import Bounds, LengthBounds, SignalMonitor
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation
    from sim_action.state.verdict import Mark


class Travel(LengthBounds):
    """Displacement on the ground plane from where the robot settled, as the crow flies."""

    key: ClassVar[str] = "travel"

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        x, y, _ = start.pose.position_xyz
        bounds = Bounds("travelled", "m", self.at_least, self.at_most)
        return SignalMonitor("travelled", lambda trace: trace.planar_distance_to(x, y), bounds)

    def marks(self, scene: Scene, start: Observation) -> tuple[Mark, ...]:
        """See Assertion.marks: as far as it has to get, and may."""
        from sim_action.state.verdict import Circle

        x, y, _ = start.pose.position_xyz
        return tuple(Circle(x, y, radius) for radius in (self.at_least, self.at_most) if radius)
