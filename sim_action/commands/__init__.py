"""Command sources: what tells the robot, at a rate of its own, where to go."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, ClassVar, Final

from pydantic import Field

from sim_action.core.field_types import FrozenModel, PositiveHertz
from sim_action.core.registry import Table
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_errors import SpecProblems
from sim_action.state.command import Answer, JointTargets
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.sensors import MountedSensor
    from sim_action.state.observation import Observation


def _nothing() -> None:
    """What there is to be done after a run by a source that holds nothing."""


@dataclass(frozen=True, slots=True)
class OpenLoop:
    """The live half of a source that looks at the clock alone.

    Attributes:
        command: from sim time in s to a command.
        holding: what it holds still while the robot comes to rest before t = 0; what has limits is held anyway.
        notes: what it has to tell people after the run.
    """

    command: Callable[[float], Answer]
    holding: JointTargets = field(default_factory=JointTargets)
    notes: Sequence[str] = ()


@dataclass(frozen=True, slots=True)
class ClosedLoop:
    """The live half of a source that looks at the robot.

    Attributes:
        senses: whether it looks at sensors as well; those that nobody looks at are not read.
        sensors: what it looks at beside those of the scenario.
        close: called once, after the run.
        notes: what it has to tell people after the run, when it is closed.
    """

    command: Callable[[Observation], Answer]
    senses: bool = True
    sensors: tuple[MountedSensor, ...] = ()
    close: Callable[[], None] = _nothing
    notes: Sequence[str] = ()


Controller = OpenLoop | ClosedLoop
"""Asked at every tick; None leaves the last command standing."""


class CommandSource(FrozenModel):
    """What all command sources are: a frozen spec whose fields are the YAML keys."""

    runs_user_code: ClassVar[bool] = False
    """Whether `open` or its controller runs code of the user's: such a scenario gets an interpreter of its own."""

    needs_drive: ClassVar[bool] = False
    """Whether all its commands are twists, whatever its files say."""

    rate: Annotated[PositiveHertz, Field(description="of the ticks at which a command is given")] = 10.0

    @property
    def code(self) -> str:
        """What of the user's it runs: sources that run the same draw random numbers of their own."""
        return ""

    @property
    def python_file(self) -> str | None:
        """Path of the user's code that runs in the process of the scenario, from the scenario."""
        return None

    def problems(self, workspace: Workspace) -> SpecProblems:
        """What is wrong with the files it names; nothing of the user's is run."""
        yield from ()

    @property
    def unchecked(self) -> tuple[str, ...]:
        """What only the process that runs it can know of its files."""
        return ()

    def model_problems(self, scene: Scene) -> SpecProblems:
        """What does not fit the robot: joints that it has not, what they cannot do."""
        yield from ()

    def gives_twists(self, scene: Scene) -> bool:
        """Whether all its commands are known to be twists before it runs."""
        return self.needs_drive

    def joints(self, scene: Scene) -> frozenset[str]:
        """What it is known to move before it runs; wheels that a drive turns for it are not among them."""
        return frozenset()

    @abstractmethod
    def open(self, scene: Scene) -> Controller:
        """The live half. Raises SourceProblem for what nobody could know before, such as of a log; RunError."""


COMMANDS: Final = Table[type[CommandSource]](
    "command",
    {
        "twist": "sim_action.commands.twist:TwistCommands",
        "waypoints": "sim_action.commands.waypoints:WaypointCommands",
        "joints": "sim_action.commands.joints:JointCommands",
        "script": "sim_action.commands.script:ScriptCommands",
        "process": "sim_action.commands.process:ProcessCommands",
        "replay": "sim_action.commands.replay:ReplayCommands",
        "ros1": "sim_action.ros.ros1.driving.spec:RosCommands",
    },
)
"""The key that tells a command source from the others -> its class."""
