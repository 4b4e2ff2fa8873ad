"""The seams of a run: the points at which a mutation can act on it. Without a mutation, nothing happens there."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Final

if TYPE_CHECKING:
    from sim_action.commands import Controller
    from sim_action.drives import DriveMotion
    from sim_action.sensors import Measure
    from sim_action.state.command import JointTargets
    from sim_action.world.scene import Scene


class Seams:
    """The seams of a run without a mutation. They are the same for all command sources, sensors and engines."""

    runs_on: ClassVar[bool] = False
    """True if the run goes on after an expectation has failed."""

    def scene(self, scene: Scene) -> Scene:
        """Return the scene that is simulated."""
        return scene

    def controller(self, controller: Controller) -> Controller:
        """Return the controller of an open command source."""
        return controller

    def motion(self, motion: DriveMotion | None) -> DriveMotion | None:
        """Return the open drive."""
        return motion

    def at_rest(self, targets: JointTargets) -> JointTargets:
        """Return the targets that hold the robot while it settles before t = 0; joints keep them until a command."""
        return targets

    def measure(self, sensor: str, measure: Measure) -> Measure:
        """Return the function that measures, of the sensor with this name."""
        return measure


UNTOUCHED: Final = Seams()
"""The seams of every run that has no mutation."""
