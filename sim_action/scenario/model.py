"""A scenario: a world, what drives the robot in it, what must come true, and how long it may take."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, Self

from pydantic import Field, JsonValue, model_validator

from sim_action.assertions import Assertion
from sim_action.commands import CommandSource
from sim_action.core.errors import Location
from sim_action.core.field_types import (
    FrozenModel,
    Name,
    NonNegativeSeconds,
    PositiveBytes,
    PositiveHertz,
    PositiveMetres,
    PositiveRadians,
    PositiveSeconds,
    Tag,
)
from sim_action.core.units import STEP_EPSILON, first_step
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_document import Document
from sim_action.drives import Drive
from sim_action.robot.robot_model import RobotModel
from sim_action.robot.spec import Robot
from sim_action.scenario.source import Source
from sim_action.scenario.variation_values import Normal, Uniform
from sim_action.sensors import MountedSensor
from sim_action.state.trace_channels import Channels
from sim_action.world import Physics, World
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation
    from sim_action.state.trace import Trace
    from sim_action.state.verdict import Mark, Signal
    from sim_action.world.parts import Part

# Of address space: the interpreter, the engine and numpy take 250 MB before anything is simulated.
_MIN_MEMORY: Final = 512 << 20
_MAX_MEMORY: Final = 1 << 50
MEMORY: Final = 4 << 30
"""Bytes of address space that a process may take, if nobody says otherwise."""

WALL_SECONDS: Final = 60.0
"""Of wall time that anything may take, if nobody says otherwise."""

_OUTPUT: Final = 100_000_000


Severity = Literal["error", "warning"]


class ExpectationOptions(FrozenModel):
    """What can be said of any assertion, beside its own key."""

    name: Annotated[Name | None, Field(description="how reports call it; left out: what it asks")] = None
    after: Annotated[NonNegativeSeconds, Field(description="sim time from which it counts")] = 0.0
    before: Annotated[
        PositiveSeconds | None,
        Field(description="sim time by which a goal must have come true, and until which an invariant counts"),
    ] = None
    severity: Annotated[Severity, Field(description="warning: reported, does not fail")] = "error"


@dataclass(frozen=True, slots=True)
class Expectation:
    """An assertion with its place in the file, its name, its time window and its severity."""

    assertion: Assertion
    location: Location
    name: str
    after: float = 0.0
    before: float = math.inf
    severity: Severity = "error"

    @property
    def channels(self) -> Channels:
        """What its assertion reads, from `after` on."""
        return self.assertion.channels.opening_at(self.after)

    def signals(self, scene: Scene, start: Observation, trace: Trace) -> tuple[Signal, ...]:
        """What its assertion looked at over a whole run, which may be decimated; what is measured first."""
        return self.assertion.signals(scene, start, trace, self.after, self.before)

    def marks(self, scene: Scene, start: Observation) -> tuple[Mark, ...]:
        """Where in the world that is."""
        return self.assertion.marks(scene, start)


class DrivenRobot(Robot):
    """The robot under test, and how twists turn its wheels."""

    drive: Annotated[Drive | None, Field(description="left out: recognised from the model")] = None


class TraceSettings(FrozenModel):
    """What is kept of the run."""

    rate: Annotated[
        PositiveHertz | None, Field(description="rows in a second; left out: the fastest rate of a command")
    ] = None


class Agreement(FrozenModel):
    """How far the robot may be in one engine from where it is in another at the same time."""

    position: Annotated[PositiveMetres | None, Field(description="of the base link, in space")] = None
    yaw: Annotated[PositiveRadians | None, Field(description="of the base link")] = None

    @model_validator(mode="after")
    def _asks_something(self) -> Self:
        if self.position is None and self.yaw is None:
            raise ValueError("says how far they may be apart in 'position', in 'yaw', or in both")
        return self


class Scenario(FrozenModel):
    """One scenario; the fields are the keys of its file.

    What makes several of one (`scenarios`, `variations`), or one of several (`extends`), is gone when it is read.
    """

    extends: Annotated[
        str | None, Field(description="path of a file whose keys are this one's, unless it says otherwise")
    ] = None
    scenarios: Annotated[
        tuple[dict[str, Any], ...] | None,
        Field(min_length=1, description="several scenarios, each on top of the keys that stand beside this one"),
    ] = None
    name: Name
    tags: Annotated[tuple[Tag, ...], Field(description="words by which --tag and --exclude-tag find it")] = ()
    version: Annotated[Literal[1], Field(description="of the format")] = 1
    robot: DrivenRobot
    world: World = World.model_construct()
    physics: Physics = Physics.model_construct()
    commands: Annotated[tuple[CommandSource, ...], Field(description="what drives the robot")] = ()
    sensors: Annotated[tuple[MountedSensor, ...], Field(description="what controllers see it by")] = ()
    expect: Annotated[tuple[Expectation, ...], Field(min_length=1, description="what must come true")]
    duration: Annotated[
        PositiveSeconds | None, Field(description="sim time that the run lasts even if all goals are met")
    ] = None
    time_limit: Annotated[PositiveSeconds, Field(le=86_400, description="sim time at which a pending goal has failed")]
    wall_limit: Annotated[
        PositiveSeconds | None, Field(description="guards against a stuck run; left out: max(60 s, 10 x time_limit)")
    ] = None
    memory_limit: Annotated[
        PositiveBytes | None,
        Field(ge=_MIN_MEMORY, le=_MAX_MEMORY, description="address space of each process; left out: 4 GiB"),
    ] = None
    output_limit: Annotated[PositiveBytes | None, Field(description="how much it may print; left out: 100 MB")] = None
    backend: Annotated[
        Literal["auto", "pybullet", "mujoco"],
        Field(description="engine that it runs on; auto: pybullet where it is installed, else mujoco"),
    ] = "auto"
    variations: Annotated[
        dict[str, tuple[JsonValue, ...] | Uniform | Normal] | None,
        Field(description="what it is run with: keys, and the values that each takes"),
    ] = None
    agreement: Annotated[
        Agreement | None, Field(description="runs it on both engines, and judges how far they are apart")
    ] = None
    seed: Annotated[
        int, Field(ge=0, le=2**63 - 1, description="of everything that is drawn at random; the same seed, the same run")
    ] = 0
    trace: TraceSettings = TraceSettings.model_construct()

    @property
    def wall_seconds(self) -> float:
        """After how many seconds of wall time a run is given up."""
        return self.wall_limit or max(WALL_SECONDS, 10 * self.time_limit)

    @property
    def memory_bytes(self) -> int:
        """How much address space a process of it may take."""
        return int(self.memory_limit or MEMORY)

    @property
    def output_bytes(self) -> int:
        """How much it may print."""
        return int(self.output_limit or _OUTPUT)

    @property
    def trace_rate(self) -> float:
        """Rows of the stored trace in a second of sim time."""
        return self.trace.rate or max((source.rate for source in self.commands), default=10.0)

    @property
    def runs_user_code(self) -> bool:
        """Whether it needs an interpreter of its own."""
        of_sources = any(source.runs_user_code for source in self.commands)
        return self.robot.is_xacro or of_sources or any(assertion.runs_user_code for assertion in self.assertions)

    @property
    def python_files(self) -> tuple[str, ...]:
        """Paths of the user's code that runs in its process, from the scenario."""
        named = [source.python_file for source in self.commands] + [leaf.python_file for leaf in self.assertions]
        return tuple(dict.fromkeys(name for name in named if name is not None))

    @property
    def assertions(self) -> tuple[Assertion, ...]:
        """All that look at the robot, also inside of others."""
        return tuple(leaf for expected in self.expect for leaf in expected.assertion.leaves())

    def steps(self, seconds: float) -> int:
        """The first physics step at or after a sim time."""
        return first_step(seconds, self.physics.rate)

    def steps_between_ticks(self, rate: float) -> int:
        """Physics steps from one tick to the next; loading has checked that they are whole."""
        return round(self.physics.rate / rate)


def rate_divides(physics_rate: float, rate: float) -> bool:
    """Whether ticks at `rate` fall on physics steps."""
    steps = physics_rate / rate
    return math.isfinite(steps) and round(steps) >= 1 and abs(steps - round(steps)) < STEP_EPSILON


@dataclass(frozen=True, slots=True)
class LoadedScenario:
    """A valid scenario.

    Attributes:
        source: what it was read from.
        model: of the robot, as it was read and checked; None if only the process that runs it may do so.
        unchecked: what nobody can know before it runs.
        parts: name of a body of the world -> what it is made of, as its file was read and checked.
    """

    scenario: Scenario
    source: Source
    model: RobotModel | None = None
    unchecked: tuple[str, ...] = ()
    parts: Mapping[str, tuple[Part, ...]] = field(default_factory=dict)

    @property
    def document(self) -> Document:
        """What it was read from, with the place of each key."""
        return self.source.document

    @property
    def workspace(self) -> Workspace:
        """Where its own files are found."""
        return self.source.workspace

    @property
    def file(self) -> str:
        """Its path, as reports show it."""
        return self.document.file

    def traced_at_every_step(self) -> LoadedScenario:
        """The same, with each physics step in its trace."""
        trace = TraceSettings(rate=self.scenario.physics.rate)
        return replace(self, scenario=self.scenario.model_copy(update={"trace": trace}))
