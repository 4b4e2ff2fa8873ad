"""The scenario: a robot in a world, its command sources, expectations and time limit."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from itertools import takewhile
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final, Literal, Self

from pydantic import AfterValidator, Field, JsonValue, model_validator

from sim_action.assertions import Assertion
from sim_action.commands import CommandSource
from sim_action.core import units
from sim_action.core.errors import Location
from sim_action.core.field_types import (
    FrozenModel,
    JointPosition,
    NonNegativeSeconds,
    PositiveBytes,
    PositiveHertz,
    PositiveMetres,
    PositiveRadians,
    PositiveSeconds,
    Tag,
    Title,
)
from sim_action.core.records import dataclass, field, replace
from sim_action.core.units import STEP_EPSILON, first_step, rate_divides
from sim_action.core.wording import shown
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_document import Document
from sim_action.drives import Drive
from sim_action.engines import ENGINES, AutoOrEngine, EngineName
from sim_action.robot.model.robot_model import WORLD, RobotModel
from sim_action.robot.model.robot_spec import Robot
from sim_action.scenario.child_environment import MAX_SET, problem_of
from sim_action.scenario.faults import Fault
from sim_action.scenario.mutation import Mutation
from sim_action.scenario.source import MAX_SEED, Source
from sim_action.scenario.variations import Choice, CsvColumn, Integers, LogUniform, Normal, Sobol, Uniform
from sim_action.scenario.variations.gate import Gate
from sim_action.sensors import MountedSensor
from sim_action.state.timeline import TimeMark
from sim_action.state.trace_records import Channels
from sim_action.world import MAX_ACTORS, Actor, Physics, World
from sim_action.world.claims import AuditWarning, ClaimFinding
from sim_action.world.scene import Scene, WorldPlaces

if TYPE_CHECKING:
    from sim_action.scenario.events import Event
    from sim_action.state.observation import Observation
    from sim_action.state.trace import Trace
    from sim_action.state.verdict import Mark, Signal
    from sim_action.world.parts import Part
else:
    # Few scenarios have events, and their classes take time to make.
    Event = Any

# Address space. The interpreter, the engine and numpy need 250 MB before the first step.
_MIN_MEMORY: Final = 512 << 20
_MAX_MEMORY: Final = 1 << 50
MEMORY: Final = 4 << 30  # the default limit of a process's address space in bytes
WALL_SECONDS: Final = 60.0  # the default wall limit in s
_OUTPUT: Final = 100_000_000

MAX_COMPARED_STEPS: Final = 2_000_000
"""The largest number of physics steps that two engines are compared at; each takes 64 bytes and 8 for each joint."""


Severity = Literal["error", "warning"]
Unexercised = Literal["error", "warn"]

ConfidenceKind = Literal["numerical", "full"]
"""The repetitions for the numerical confidence of a verdict; full: with a quarter of the step, too."""


class ExpectationOptions(FrozenModel):
    """The keys that every assertion can have besides its own."""

    name: Annotated[Title | None, Field(description="the name in reports; default: the assertion in words")] = None
    after: Annotated[
        NonNegativeSeconds, Field(description="sim time from which it is checked; the run goes on until then")
    ] = 0.0
    since: Annotated[Title | None, Field(description="name of the event from which it is checked")] = None
    before: Annotated[
        PositiveSeconds | None,
        Field(description="deadline in sim time: a goal must become true by then, an invariant is checked until then"),
    ] = None
    span: Annotated[
        PositiveSeconds | None,
        Field(alias="for", description="only for goals: time for which it must be true without interruption"),
    ] = None
    severity: Annotated[
        Severity, Field(description="error: if it fails, the scenario fails; warning: if it fails, it is only reported")
    ] = "error"
    allow: Annotated[
        tuple[str, ...], Field(description="rules of the audit of claims whose findings on it are accepted")
    ] = ()


@dataclass(frozen=True, slots=True)
class Expectation:
    """An assertion with its place in the file, its name, its time window and its severity."""

    assertion: Assertion
    location: Location
    name: str
    after: float = 0.0  # after, before: the time window in s of sim time
    before: float = math.inf
    severity: Severity = "error"
    # the time in s for which a goal must hold; None if one moment is enough, or if the assertion checks it
    span: float | None = None
    allow: tuple[str, ...] = ()  # rules of the audit of claims whose findings on it are accepted
    since: str = ""  # the name of the event from which it is checked; empty: from `after` on

    @property
    def channels(self) -> Channels:
        """Return the channels that the assertion reads from `after` on."""
        return self.assertion.channels.opening_at(self.after)

    def signals(self, scene: Scene, start: Observation, trace: Trace) -> tuple[Signal, ...]:
        """Return the signals that the assertion judged over a run, maybe decimated, the measured one first."""
        held = self.assertion.held(scene, start, trace, (self.after, self.before), self.span)
        return (*held, *self.assertion.signals(scene, start, trace, self.after, self.before))

    def marks(self, scene: Scene, start: Observation) -> tuple[Mark, ...]:
        """Return the places in the world that the assertion is about."""
        return self.assertion.marks(scene, start)


class DrivenRobot(Robot):
    """The robot under test, and the drive that turns twists into wheel speeds."""

    drive: Annotated[Drive | None, Field(description="default: recognised from the model")] = None


class DrivenActor(Actor, DrivenRobot):
    """Another robot: its keys, its commands, and the sensors of its own controllers."""

    commands: Annotated[tuple[CommandSource, ...], Field(description="as those of the scenario")] = ()
    sensors: Annotated[
        tuple[MountedSensor, ...], Field(description="as those of the scenario, for its own controllers; or `standard`")
    ] = ()  # type: ignore[assignment]  # the standard ones are listed when they are read

    @model_validator(mode="after")
    def _has_standard_sensors(self) -> Self:
        return self


class Stage(World):
    """The surroundings of the robot, with the other robots in it."""

    actors: Annotated[
        tuple[DrivenActor, ...],
        Field(max_length=MAX_ACTORS, description="other robots, which expectations name like objects"),
    ] = ()

    @staticmethod
    def of(world: World) -> Stage:
        """Return a world without other robots."""
        return Stage.model_construct(**{**dict(world), "actors": ()})


class TraceSettings(FrozenModel):
    """The part of a run that is stored."""

    rate: Annotated[
        PositiveHertz | None, Field(description="rows per second; default: the highest rate of a command source")
    ] = None
    links: Annotated[
        tuple[str, ...],
        Field(description="links whose motion recordings as CSV have; the first one is also that of TUM recordings"),
    ] = ()


class PoseAgreement(FrozenModel):
    """The largest allowed distance between the poses of one link or body in two engines at the same time."""

    position: Annotated[PositiveMetres | None, Field(description="allowed distance between its origins")] = None
    orientation: Annotated[PositiveRadians | None, Field(description="allowed angle between its orientations")] = None

    @model_validator(mode="after")
    def _asks_something(self) -> Self:
        if self.position is None and self.orientation is None:
            raise ValueError("must have 'position', 'orientation' or both")
        return self


class Agreement(FrozenModel):
    """The largest allowed differences between two engines at the same time, at every physics step."""

    position: Annotated[PositiveMetres | None, Field(description="allowed distance between the base links")] = None
    yaw: Annotated[PositiveRadians | None, Field(description="allowed difference of the base links' yaw")] = None
    joints: Annotated[
        dict[str, JointPosition],
        Field(description="joint name, or pattern such as '*', to the allowed difference of its positions"),
    ] = Field(default_factory=dict)
    links: Annotated[
        dict[str, PoseAgreement],
        Field(description="link name to the allowed difference of its poses in the world frame"),
    ] = Field(default_factory=dict)
    bodies: Annotated[
        dict[str, PoseAgreement], Field(description="name of a body with a mass to the allowed difference of its poses")
    ] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _asks_something(self) -> Self:
        if self.position is None and self.yaw is None and not (self.joints or self.links or self.bodies):
            raise ValueError("must have 'position', 'yaw', 'joints', 'links', 'bodies' or several of them")
        for name, written in self.joints.items():
            if units.parse(written, units.ANGLE, units.LENGTH) <= 0:
                raise ValueError(f"the allowed difference of '{name}' must be greater than 0, found {shown(written)}")
        return self


def _checked_environment(variables: dict[str, str]) -> dict[str, str]:
    """Return the variables. Raise ValueError for one that a scenario cannot set."""
    for name, value in variables.items():
        if (problem := problem_of(name, value)) is not None:
            raise ValueError(f"{shown(name)} {problem}")
    return variables


class Scenario(FrozenModel):
    """One scenario; the fields are the keys of its file.

    The loader has already resolved `scenarios`, `variations` and `extends`.
    """

    # Keys of other tools -> the advice for those who write them here. In the base class of all models, pydantic would
    # read the annotation once for each of them.
    foreign_keys: ClassVar[Mapping[str, str]] = {
        "robots": "the robot under test is 'robot', and 'world.actors' has the others"
    }

    extends: Annotated[
        str | None, Field(description="path of a file whose keys count for this one unless it overrides them")
    ] = None
    scenarios: Annotated[
        tuple[dict[str, Any], ...] | None,
        Field(min_length=1, description="several scenarios; each adds to the keys of the file"),
    ] = None
    ego: Annotated[
        str | None,
        Field(description="name of the actor that is under test instead of `robot`, which takes its place and name"),
    ] = None
    name: Annotated[Title, Field(description="the name in reports")]
    tags: Annotated[tuple[Tag, ...], Field(description="words for --tag and --exclude-tag")] = ()
    version: Annotated[Literal[1], Field(description="version of the format")] = 1
    robot: DrivenRobot
    world: Stage = Stage.model_construct()
    physics: Physics = Physics.model_construct()
    commands: Annotated[tuple[CommandSource, ...], Field(description="command sources that drive the robot")] = ()
    sensors: Annotated[tuple[MountedSensor, ...], Field(description="sensors that controllers can read")] = ()
    faults: Annotated[tuple[Fault, ...], Field(description="motors and sensors that fail during the run")] = ()
    events: Annotated[
        tuple[Event, ...], Field(description="what happens when a condition comes true, instead of at a time")
    ] = ()
    expect: Annotated[
        tuple[Expectation, ...], Field(min_length=1, description="the expectations that decide the verdict")
    ]
    unexercised: Annotated[
        Unexercised | None,
        Field(
            description="an expectation that is never judged, for example because its sensor has no reading: error: "
            "the scenario does not pass; warn: it is only reported; default: error"
        ),
    ] = None
    confidence: Annotated[
        ConfidenceKind | None,
        Field(
            description="repetitions that show the numerical confidence of verdicts; full: also with a quarter "
            "of the step"
        ),
    ] = None
    engines: Annotated[tuple[EngineName, ...], Field(description="engines of these repetitions")] = ()
    inconclusive: Annotated[Unexercised, Field(description="effect of a verdict that a repetition could change")] = (
        "error"
    )
    duration: Annotated[
        PositiveSeconds | None, Field(description="simulate at least so long, even if all goals are met earlier")
    ] = None
    time_limit: Annotated[
        PositiveSeconds, Field(le=86_400, description="sim time at which the scenario fails if a goal is not met")
    ]
    wall_limit: Annotated[
        PositiveSeconds | None,
        Field(description="real time after which a stuck run is stopped; default: max(60 s, 10 x time_limit)"),
    ] = None
    environment: Annotated[
        dict[str, str],
        Field(
            max_length=MAX_SET,
            description="names and values of environment variables for its code: scripts, processes, xacro, ROS nodes",
        ),
        AfterValidator(_checked_environment),
    ] = Field(default_factory=dict)
    memory_limit: Annotated[
        PositiveBytes | None,
        Field(ge=_MIN_MEMORY, le=_MAX_MEMORY, description="address space of each process; default: 4 GiB"),
    ] = None
    output_limit: Annotated[
        PositiveBytes | None, Field(description="largest amount of printed text; default: 100 MB")
    ] = None
    backend: Annotated[
        AutoOrEngine, Field(description=f"physics engine; auto: {' if installed, else '.join(ENGINES)}")
    ] = "auto"
    variations: Annotated[
        dict[str, tuple[JsonValue, ...] | Uniform | Normal | LogUniform | Integers | Choice | Sobol | CsvColumn] | None,
        Field(description="keys of the scenario and the values that each one takes; one run for each combination"),
    ] = None
    gate: Annotated[
        Gate | None,
        Field(description="how often the samples of the draws have to pass; the gate has the verdict, not each run"),
    ] = None
    agreement: Annotated[
        Agreement | None, Field(description="runs the scenario on both engines and limits their difference")
    ] = None
    allow: Annotated[
        tuple[str, ...], Field(description="rules of the audit of claims whose findings are accepted")
    ] = ()
    seed: Annotated[int, Field(ge=0, le=MAX_SEED, description="random seed; the same seed gives the same run")] = 0
    trace: TraceSettings = TraceSettings.model_construct()

    @model_validator(mode="after")
    def _with_fitting_rates(self) -> Self:
        """Choose the rate of the physics if it is not stated, and then the rates that follow it."""
        if "rate" not in self.physics.model_fields_set:
            rate = common_rate(self.needed_rates, self.physics.rate, MAX_CHOSEN_PHYSICS_RATE_HZ)
            if rate is not None and rate != self.physics.rate:
                self.__dict__["physics"] = self.physics.model_copy(update={"rate": rate})
        self.__dict__["commands"] = self._fitted(self.commands)
        if self.world.actors:
            several = (
                actor.model_copy(update={"commands": self._fitted(actor.commands)}) for actor in self.world.actors
            )
            self.__dict__["world"] = self.world.model_copy(update={"actors": tuple(several)})
        return self

    def _fitted(self, commands: tuple[CommandSource, ...]) -> tuple[CommandSource, ...]:
        fitted = tuple(source.fitted(self.physics.rate) for source in commands)
        return tuple(source.among(fitted) for source in fitted)

    def as_seen_by(self, actor: DrivenActor) -> Scenario:
        """Return the scenario in which another robot takes the place of the one under test."""
        own: dict[str, Any] = {"robot": actor, "commands": actor.commands, "sensors": actor.sensors}
        if self.events:
            from sim_action.scenario.events import events_of  # few scenarios have events

            own["events"] = events_of(self, actor)
        return self.model_copy(update={**own, "faults": (), "expect": ()})

    @property
    def all_commands(self) -> tuple[CommandSource, ...]:
        """The command sources of all robots."""
        return (*self.commands, *(source for actor in self.world.actors for source in actor.commands))

    @property
    def all_sensors(self) -> tuple[MountedSensor, ...]:
        """The sensors of all robots."""
        return (*self.sensors, *(mounted for actor in self.world.actors for mounted in actor.sensors))

    @property
    def needed_rates(self) -> list[float]:
        """The rates in Hz that have to divide the physics rate."""
        of_sources = [source.needed_rate for source in self.all_commands]
        rates = [*of_sources, *(sensor.rate for sensor in self.all_sensors), self.trace.rate]
        return [rate for rate in rates if rate is not None]

    @property
    def wall_seconds(self) -> float:
        """The wall time in s after which a run is stopped."""
        return self.wall_limit or max(WALL_SECONDS, 10 * self.time_limit)

    @property
    def memory_bytes(self) -> int:
        """The address space in bytes that each process of the scenario may use."""
        return int(self.memory_limit or MEMORY)

    @property
    def output_bytes(self) -> int:
        """The number of bytes that the scenario may print."""
        return int(self.output_limit or _OUTPUT)

    @property
    def trace_rate(self) -> float:
        """The rows of the stored trace per second of sim time."""
        return self.trace.rate or max((source.rate for source in self.commands), default=10.0)

    @property
    def runs_user_code(self) -> bool:
        """Return True if the scenario needs an interpreter of its own."""
        of_sources = any(source.runs_user_code for source in self.all_commands)
        of_sensors = any(mounted.sensor.runs_user_code for mounted in self.all_sensors)
        of_assertions = any(assertion.runs_user_code for assertion in (*self.assertions, *self.conditions))
        return (
            any(robot.is_xacro for robot in (self.robot, *self.world.actors))
            or of_sources
            or of_sensors
            or of_assertions
        )

    @property
    def is_random(self) -> bool:
        """Return True if a run depends on the seed, or may do so."""
        of_commands = any(source.is_random or source.runs_user_code for source in self.all_commands)
        of_sensors = any(mounted.transmission.is_random or mounted.sensor.is_random for mounted in self.all_sensors)
        return of_commands or of_sensors or any(assertion.runs_user_code for assertion in self.assertions)

    @property
    def python_files(self) -> tuple[str, ...]:
        """The paths of the user's Python files that run in its process, relative to the scenario."""
        named = [source.python_file for source in self.all_commands] + [leaf.python_file for leaf in self.assertions]
        return tuple(dict.fromkeys(name for name in named if name is not None))

    @property
    def assertions(self) -> tuple[Assertion, ...]:
        """All assertions that look at the robot, including nested ones."""
        return tuple(leaf for expected in self.expect for leaf in expected.assertion.leaves())

    @property
    def conditions(self) -> tuple[Assertion, ...]:
        """The assertions that are conditions of events."""
        return tuple(event.when.assertion for event in self.events if event.when.assertion is not None)

    def time_marks(self) -> Iterator[TimeMark]:
        """Yield the marks of the timeline that neither the run nor a command changes, in no order."""
        yield from self.world.time_marks()
        yield from (fault.time_mark for fault in self.faults)
        for mounted in self.sensors:
            yield from mounted.transmission.time_marks(f"sensor '{mounted.name}'")

    def accepts(self, finding: ClaimFinding) -> bool:
        """Return True if `allow` of the scenario, or of the expectation that a finding is about, has its rule."""
        key, index, *_ = (*finding.path, "", "")
        own = self.expect[index].allow if key == "expect" and isinstance(index, int) else ()
        return finding.rule in (*self.allow, *own)

    def steps(self, seconds: float) -> int:
        """Return the first physics step at or after a sim time in s."""
        return first_step(seconds, self.physics.rate)

    @property
    def is_comparable(self) -> bool:
        """Return True if the motion of its longest run fits into memory at every step."""
        return self.steps(self.time_limit) <= MAX_COMPARED_STEPS

    def steps_between_ticks(self, rate: float) -> int:
        """Return the number of physics steps between two ticks. Loading has checked that it is whole."""
        return round(self.physics.rate / rate)


MAX_CHOSEN_PHYSICS_RATE_HZ: Final = 1000.0
"""The greatest rate in Hz of the physics that follows from the rates of a scenario."""

_MAX_CANDIDATES: Final = 10_000  # the candidates that are tried for rates without a round common multiple


def common_rate(rates: Collection[float], least: float, most: float) -> float | None:
    """Return the least rate in Hz from `least` to `most` that all rates divide; None if there is none."""
    if all(rate_divides(least, rate) for rate in rates):
        return least
    fastest = max(rates)
    first = math.ceil(min(least / fastest - STEP_EPSILON, _MAX_CANDIDATES))
    multiples = (round(count * fastest, 9) for count in range(first, first + _MAX_CANDIDATES))
    within = takewhile(lambda rate: rate <= most, multiples)
    return next((candidate for candidate in within if all(rate_divides(candidate, rate) for rate in rates)), None)


@dataclass(frozen=True, slots=True)
class LoadedScenario:
    """A valid scenario."""

    scenario: Scenario
    source: Source  # the document that it was read from
    model: RobotModel | None = None  # the checked robot model; None if only the scenario's own process may read it
    unchecked: tuple[str, ...] = ()  # remarks on parts that can only be checked during a run
    # name of a world body -> its parts, for bodies that are read from files
    parts: Mapping[str, tuple[Part, ...]] = field(default_factory=dict)
    warnings: tuple[AuditWarning, ...] = ()  # the findings of the audit of claims that do not refuse it
    compared: bool = False  # True if the run is compared with a run of another engine
    strict: bool = False  # True if warnings of the audit of claims make it fail
    places: WorldPlaces = field(default_factory=WorldPlaces)  # of the models in the world file
    # the injected fault; None except in runs of `sim-action prove`, and in runs whose confidence is found: these have a
    # mutation without a fault, and continue after a failure
    mutation: Mutation | None = None
    # the change of a repetition that shows the confidence of a verdict; empty: it is no repetition
    repetition: str = ""
    # name of another robot -> its checked model; empty if only the scenario's own process may read one
    actor_models: Mapping[str, RobotModel] = field(default_factory=dict)

    @property
    def is_fixed(self) -> bool:
        """True if the base of the robot cannot move, as far as the model is read."""
        return self.scenario.robot.base == "fixed" or (self.model is not None and self.model.root == WORLD)

    @property
    def document(self) -> Document:
        """The document that it was read from, with the place of each key."""
        return self.source.document

    @property
    def workspace(self) -> Workspace:
        """The workspace in which its files are found."""
        return self.source.workspace

    @property
    def file(self) -> str:
        """Its path, as shown in reports."""
        return self.document.file

    def traced_at_every_step(self) -> LoadedScenario:
        """Return the same scenario with every physics step in its trace."""
        trace = self.scenario.trace.model_copy(update={"rate": self.scenario.physics.rate})
        return replace(self, scenario=self.scenario.model_copy(update={"trace": trace}))
