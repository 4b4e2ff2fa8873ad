"""The mutation of a run, an injected fault that shows which expectations notice it; and the seams at which it acts."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, Literal

from sim_action.core.records import dataclass

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from sim_action.commands import Controller
    from sim_action.drives import DriveMotion
    from sim_action.scenario.faults import Fault
    from sim_action.sensors import Measure
    from sim_action.state.command import JointTargets
    from sim_action.state.observation import Observation
    from sim_action.world.scene import Scene


SensorFault = Literal["frozen", "stale", "biased", "drifting"]


@dataclass(frozen=True, slots=True)
class Mutation:
    """A fault of the system under test; the world, and what expectations measure, stay as they are.

    A run with a mutation goes on after an expectation has failed, so that each expectation is judged. Without a fault,
    that is its only effect.
    """

    silent: bool = False  # True if no command takes effect
    speed: float = 1.0  # factor of all commanded speeds, efforts and forces, and of the way of joints from their start
    # the part of commanded twists and wrenches that has the other sign; or empty
    reversed: Literal["", "linear", "angular"] = ""
    mirrored: bool = False  # True if left and right are swapped in commands
    crossed_wheels: bool = False  # True if left and right are swapped behind the drive
    dead_joint: str = ""  # name of a joint whose motor is off; or empty
    reversed_joint: str = ""  # name of a joint whose motor turns the other way; or empty
    sensor: str = ""  # name of a sensor that has the fault `reading`; or empty
    reading: SensorFault = "frozen"
    mass: float = 1.0  # factor of the masses of all links of the robot
    # True if the run goes on for a while after its goals are met, see `Verdict.extreme`; no fault
    looks_ahead: bool = False


class Seams:
    """The points at which a mutation or a fault can act on a run. Without one, nothing happens there.

    They are the same for all command sources, sensors and engines.
    """

    runs_on: bool = False  # True if the run goes on after an expectation has failed

    looks_ahead: bool = False
    """True if the run goes on for a while after its goals are met, to see by how much they are."""

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

    def follow(self, faults: Sequence[Fault]) -> None:
        """Take the times of the same faults after an event has happened."""

    def until(self, step: int, until: int) -> int:
        """Return the step until which targets can be planned: the step of the next fault, or `until` if earlier."""
        return until

    def targets(
        self, step: int, planned: list[JointTargets | None], look: Callable[[int], Observation]
    ) -> list[JointTargets | None]:
        """Return the targets that motors get in the next steps; `look` returns the present state."""
        return planned

    def delivers(self, sensor: str, time: float) -> bool:
        """Return True if a sensor gives a reading at a sim time in s."""
        return True

    @property
    def notes(self) -> tuple[str, ...]:
        """The notes on the faults of the run, for people."""
        return ()


UNTOUCHED: Final = Seams()  # the seams of every run that has no mutation
