"""`energy: {at_most: 5 J}`: how much work the motors do."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import Field

from sim_action.assertions import Assertion, Monitor
from sim_action.assertions.bounds import Bounds
from sim_action.assertions.combined import short
from sim_action.assertions.joint_choice import choice_problems, chosen
from sim_action.core import units
from sim_action.core.field_types import NonNegativeJoules
from sim_action.core.yaml_errors import SpecProblems
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation

Braking = Literal["free", "costs", "regained"]


class Energy(Assertion):
    """Mechanical work of the motors since `after`, added up over joints and physics steps, stays below a limit.

    A motor does work when it pushes the way its joint moves; when it pushes against it, it brakes. `braking` says what
    that is: free (only work counts), as dear as driving (the magnitude of each motor's power counts), or regained (it
    is taken off). Heat, and what holding still takes, is not in it: see `effort`.
    """

    key: ClassVar[str] = "energy"

    at_most: Annotated[NonNegativeJoules, Field(description="an invariant: must not be exceeded")]
    joints: Annotated[
        tuple[str, ...], Field(description="names, or patterns such as '*_wheel_joint'; left out: all that move")
    ] = ()
    braking: Annotated[Braking, Field(description="what it takes to slow down, or to let a load down")] = "free"

    @property
    def title(self) -> str:
        """See Assertion.title."""
        of = f" of {', '.join(self.joints)}" if self.joints else ""
        return short(f"{self.key}{of} at most {units.display(self.at_most, 'J')}")

    def problems(self, scene: Scene) -> SpecProblems:
        """Joints that are not there."""
        yield from choice_problems(scene.model, self.joints)

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        from sim_action.assertions.energy_monitor import EnergyMonitor

        names = tuple(joint.name for joint in chosen(scene.model, self.joints))
        moving = tuple(start.joints[name].velocity if name in start.joints else 0.0 for name in names)
        return EnergyMonitor(names, self.braking, Bounds("used", "J", None, self.at_most), start.time, moving)
