"""`settled: {speed: 1 cm/s, for: 1 s}`: the robot comes to rest."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar

from pydantic import Field

from sim_action.assertions import Monitor
from sim_action.assertions.at_rest import AtRest
from sim_action.core import units
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation


class Settled(AtRest):
    """A goal: the robot comes to rest, and stays at rest for some time.

    At rest is what moves and turns no faster than two limits: the base, and the joints where they count. The time is
    one stretch without a break; what the robot does after it is not asked. Before its first command the robot is at
    rest, too: where it has to wait for one, say with `after` from when on this counts.
    """

    key: ClassVar[str] = "settled"

    joints: Annotated[bool | None, Field(description="whether they count; left out: if the base is fixed")] = None

    @property
    def title(self) -> str:
        """See Assertion.title."""
        return f"settled for {units.display(self.span, 's')}"

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        from sim_action.assertions.settled_monitor import SettledMonitor
        from sim_action.assertions.stretch import Stretch

        counting = scene.bolted if self.joints is None else self.joints
        joints = {joint.name: joint.dimension("velocity").si for joint in scene.model.moving_joints if counting}
        return SettledMonitor(self, tuple(joints.items()), Stretch(self.span))
