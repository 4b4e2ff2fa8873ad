"""`effort: {joints: [elbow], at_most: 5 N m}`: what the motors exert."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, ClassVar, Self

from pydantic import Field, model_validator

from sim_action.assertions import Assertion, Monitor
from sim_action.assertions.bounds import Bounds, SignalMonitor
from sim_action.assertions.combined import short
from sim_action.assertions.every import Every
from sim_action.assertions.joint_choice import as_written, choice_problems, chosen, reading_of, unit_problem
from sim_action.core import units
from sim_action.core.field_types import JointEffort
from sim_action.core.yaml_errors import SpecProblems
from sim_action.robot.robot_model import READINGS
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation


class Effort(Assertion):
    """Each motor exerts no more than a limit, either way: at any moment, or as root mean square over the run.

    The root mean square is what heats a motor; it is judged when the run is over, or at `before`. Efforts are what the
    engine's motors exert, within the limits of the model. At each tick of its commands a joint is told another speed,
    and jumps to it: where peaks matter, let joints be told at every physics step (`rate` of the command).
    """

    key: ClassVar[str] = "effort"

    joints: Annotated[
        tuple[str, ...], Field(description="names, or patterns such as '*_wheel_joint'; left out: all that move")
    ] = ()
    at_most: Annotated[JointEffort | None, Field(description="an invariant: must not be exceeded")] = None
    rms_at_most: Annotated[
        JointEffort | None, Field(description="must not be exceeded by the root mean square over the run")
    ] = None

    @model_validator(mode="after")
    def _has_a_limit(self) -> Self:
        if not self._limits():
            raise ValueError("give 'at_most', 'rms_at_most' or both")
        for key, written in self._limits().items():
            if units.parse(written, *READINGS["effort"]) < 0:
                raise ValueError(f"'{key}' must not be less than 0: it limits both directions")
        return self

    def _limits(self) -> dict[str, float | str]:
        given = {"at_most": self.at_most, "rms_at_most": self.rms_at_most}
        return {key: written for key, written in given.items() if written is not None}

    @property
    def title(self) -> str:
        """See Assertion.title."""
        of = f" of {', '.join(self.joints)}" if self.joints else ""
        limits = (
            f"{key.replace('rms', 'RMS').replace('_', ' ')} {as_written(value)}"
            for key, value in self._limits().items()
        )
        return short(f"{self.key}{of} {', '.join(limits)}")

    def problems(self, scene: Scene) -> SpecProblems:
        """Joints that are not there, and limits in the unit of another kind of joint."""
        yield from choice_problems(scene.model, self.joints)
        for key, written in self._limits().items():
            for joint in chosen(scene.model, self.joints):
                if (misfit := unit_problem(joint, "effort", written)) is not None:
                    hint = "" if self.joints else "; name in 'joints' those that are meant"
                    yield (key,), f"{misfit}{hint}"
                    break

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        from sim_action.assertions.effort_monitor import RootMeanSquareMonitor, magnitude

        monitors: list[Monitor] = []
        for joint in chosen(scene.model, self.joints):
            dimension, effort = joint.dimension("effort"), reading_of(joint.name, "effort")
            limits = {key: units.parse(written, dimension) for key, written in self._limits().items()}
            who = f"{joint.name} exerted"
            if (at_most := limits.get("at_most")) is not None:
                monitors.append(
                    SignalMonitor(f"{joint.name} effort", magnitude(effort), Bounds(who, dimension.si, None, at_most))
                )
            if (rms_at_most := limits.get("rms_at_most")) is not None:
                monitors.append(
                    RootMeanSquareMonitor(f"{joint.name} RMS effort", effort, who, dimension.si, rms_at_most)
                )
        return Every(tuple(monitors))
