"""Command sources: the parts of a scenario that command the robot, each at a rate of its own."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TYPE_CHECKING, Annotated, ClassVar, Final, Self

from pydantic import Field
from typing_extensions import override

from sim_action.core.field_types import Name, PositiveHertz
from sim_action.core.records import dataclass, field, replace
from sim_action.core.registry import Table
from sim_action.core.units import rate_divides
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_document import KeyPath, SpecProblems
from sim_action.state.command import Answer, JointTargets
from sim_action.state.observation import Observation
from sim_action.state.timeline import TimeMark
from sim_action.state.trace import Transcript
from sim_action.state.transmission import Transmission
from sim_action.world.claims import Findings, Setting
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.sensors import MountedSensor


_MAX_PLANNED_MARKS: Final = 12  # the marks of the commands of one source that a timeline has room for


def _nothing() -> None:
    """Do nothing: the `close` of a source without resources."""


@dataclass(frozen=True, slots=True)
class OpenLoop:
    """The controller of a source that depends only on the time."""

    command: Callable[[float], Answer]  # sim time in s -> command
    # targets that hold joints before t = 0, while the robot comes to rest; limited joints are held anyway
    holding: JointTargets = field(default_factory=JointTargets)
    notes: Callable[[float], Iterable[str]] = lambda _: ()  # the end of the run, as sim time in s -> notes for the user
    # the rising physics steps at which it is called, and no other; None: at every tick
    due: Sequence[int] | None = None
    marks: Sequence[TimeMark] = ()  # its marks of the timeline, with times like the time of `command`


@dataclass(frozen=True, slots=True)
class ClosedLoop:
    """The controller of a source that depends on observations of the robot."""

    command: Callable[[Observation], Answer]  # observation -> command
    senses: bool = True  # True if it reads sensors; a sensor without a reader is not simulated
    sensors: tuple[MountedSensor, ...] = ()  # sensors that it adds to the scenario
    begin: Callable[[], None] = _nothing  # called when an event starts it, also again
    close: Callable[[], None] = _nothing  # called once, after the run
    notes: Sequence[str] = ()  # notes for the user, complete after `close`
    losses: Sequence[str] = ()  # parts of its files that were not run, as the scenario allows
    repeats: bool = False  # True if its answer is the same object until there is a new command
    # the messages that it received, which the digest of the run covers; complete during the run
    transcript: Transcript | None = None
    not_reproducible: Sequence[str] = ()  # reasons why another run may differ, complete during the run
    logged_errors: Sequence[str] = ()  # errors that programs of the user logged, complete during the run
    # returns why it has given no command, called before `close`; empty if that is not known
    why_silent: Callable[[], str] = str
    # its marks of the timeline, complete during the run, with times like the times of its observations
    marks: Sequence[TimeMark] = ()
    is_timed: bool = False  # True if its observations, motions and marks have times since its start, not sim times


Controller = OpenLoop | ClosedLoop  # a controller is called at every tick; None as its answer keeps the last command


class CommandSource(Transmission):
    """The base class of command sources: a frozen spec whose fields are the YAML keys."""

    key: ClassVar[str]  # the YAML key that names the source, which is also one of its fields
    runs_user_code: ClassVar[bool] = False
    """True if `open` or the controller runs code of the user; the scenario then gets an interpreter of its own.

    Sources of installed packages do.
    """

    @classmethod
    def __pydantic_init_subclass__(cls, **_: object) -> None:
        """Let the sources of installed packages count as user code, and refuse one without its own key."""
        if not cls.__module__.startswith("sim_action."):
            cls.runs_user_code = True
            key = getattr(cls, "key", None)
            if key is not None and key not in cls.model_fields:
                raise TypeError(f"{cls.__name__} has no field '{key}', which holds the value of its key in a scenario")

    needs_drive: ClassVar[bool] = False  # True if all its commands are twists, independent of its files
    is_for_actors: ClassVar[bool] = True  # True if the other robots of a world can have it, too
    is_written: ClassVar[bool] = False  # True if its commands are written in the scenario; else a controller gives them
    package: ClassVar[str | None] = None  # the package that computes its commands; its version is part of the result
    map_key: ClassVar[str | None] = None
    """The name of its own key in a map of all keys: `script: {file: a.py, class: A}` is `script: a.py` with `class`."""

    name: Annotated[Name | None, Field(description="for events; default: its key")] = None
    rate: Annotated[PositiveHertz, Field(description="rate of the ticks at which commands are given")] = 10.0

    @property
    def code(self) -> str:
        """The name of the user's code that it runs; it selects the stream of random numbers of a source."""
        return ""

    def tick_rate(self, physics_rate: float) -> float:
        """Return the rate in Hz at which its controller is called; it divides the rate of the physics."""
        return self.rate

    @property
    def needed_rate(self) -> float | None:
        """The rate in Hz that has to divide the rate of the physics; None if another rate will do, see `fitted`."""
        return self.rate

    def fitted(self, physics_rate: float) -> Self:
        """Return this source with a rate that divides the rate of the physics in Hz, if it needs no other one."""
        if self.needed_rate is not None or rate_divides(physics_rate, self.rate):
            return self
        # The lowest rate in Hz that is not below `rate` and divides the rate of the physics.
        most = max(1, int(physics_rate / self.rate))
        # A rate in whole Hz has its ticks at round times.
        whole = (steps for steps in range(most, most // 2, -1) if physics_rate % steps == 0)
        fitting = self.model_copy(update={"rate": physics_rate / next(whole, most)})
        fitting.model_fields_set.discard("rate")
        return fitting

    def among(self, sources: Sequence[CommandSource]) -> Self:
        """Return this source as one of all sources of a scenario."""
        return self

    def completed(self, workspace: Workspace) -> Self:
        """Return this source with keys that its files state and the scenario does not. No code of the user is run."""
        return self

    @property
    def python_file(self) -> str | None:
        """The path, relative to the scenario, of the user's code that runs in the process of the scenario."""
        return None

    def problems(self, workspace: Workspace) -> SpecProblems:
        """Yield problems with the files that it names. No code of the user is run."""
        yield from ()

    def actor_problems(self, others: Sequence[CommandSource]) -> SpecProblems:
        """Yield problems with driving another robot of the world; `others`: sources of the robots before it."""
        yield from ()

    def claims(self, setting: Setting) -> Findings:
        """Yield the findings of the audit of claims that are visible without the robot model."""
        yield from ()

    def robot_claims(self, scene: Scene, setting: Setting) -> Findings:
        """Yield the findings of the audit of claims that need the robot model."""
        yield from ()

    @property
    def begins(self) -> tuple[KeyPath, float]:
        """The sim time in s of its first command, as far as known before the run, and the key that states it."""
        return (), 0.0

    @property
    def stated_path(self) -> tuple[tuple[float, float], ...]:
        """The points (x, y) in m, world frame, that it leads the base through; empty if it states none."""
        return ()

    @property
    def unchecked(self) -> tuple[str, ...]:
        """Notes on parts of its files that can be checked only when the scenario runs."""
        return ()

    def model_problems(self, scene: Scene) -> SpecProblems:
        """Yield commands that do not fit the robot: unknown joints, values beyond their limits."""
        yield from ()

    def gives_twists(self, scene: Scene) -> bool:
        """Return True if it is known before the run that all its commands are twists."""
        return self.needs_drive

    def joints(self, scene: Scene) -> frozenset[str]:
        """Return the joints that are known before the run to be commanded, without the wheels of a drive."""
        return frozenset()

    def marks_between(self, controller: Controller, sender: str, begin: float, end: float) -> Iterator[TimeMark]:
        """Yield its marks, of commands the last, from its time 0, `begin`, to `end` in s; `sender`: in words."""
        is_timed = isinstance(controller, OpenLoop) or controller.is_timed
        stated = [*self.time_marks(sender), *(controller.marks if is_timed else ())]
        marks = [replace(mark, time=mark.time + begin, until=_later(mark.until, begin)) for mark in stated]
        marks += () if is_timed else controller.marks
        past = sorted((mark for mark in marks if begin <= mark.time <= end), key=lambda mark: mark.time)
        yield from (mark for mark in past if not mark.is_planned)
        yield from [mark for mark in past if mark.is_planned][-_MAX_PLANNED_MARKS:]

    @abstractmethod
    def open(self, scene: Scene) -> Controller:
        """Return the controller. Raises RunError, or SourceProblem for problems that only running can show."""


def _later(time: float | None, by: float) -> float | None:
    return None if time is None else time + by


class LinkCommands(CommandSource):
    """The base class of sources that command a link at a higher rate: its commands change smoothly.

    Without a `rate`, they have 40 Hz if this divides the rate of the physics, else a rate above it that does.
    """

    rate: Annotated[
        PositiveHertz,
        Field(
            description="rate of the ticks at which commands are given; if 40 Hz does not divide `physics.rate`, the "
            "default is the next higher rate that does, such as 50 Hz at 500 Hz"
        ),
    ] = 40.0

    @property
    @override
    def needed_rate(self) -> float | None:
        return self.rate if "rate" in self.model_fields_set else None


COMMANDS: Final = Table[type[CommandSource]](
    "command",
    {
        "twist": "sim_action.commands.twist:TwistCommands",
        "waypoints": "sim_action.commands.waypoints:WaypointCommands",
        "joints": "sim_action.commands.joints:JointCommands",
        "pose": "sim_action.commands.pose:PoseCommands",
        "wrench": "sim_action.commands.wrench:WrenchCommands",
        "script": "sim_action.commands.script:ScriptCommands",
        "process": "sim_action.commands.external_program:ProcessCommands",
        "policy": "sim_action.commands.policy:PolicyCommands",
        "replay": "sim_action.commands.replay:ReplayCommands",
        "ros1": "sim_action.ros.ros1.command_source.spec:RosCommands",
        "ros2": "sim_action.ros.ros2.spec:Ros2Commands",
    },
    group="sim_action.commands",
    base=CommandSource,
)
"""The YAML key of each command source -> its class."""
