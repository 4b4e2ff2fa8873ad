"""Assertions: goals, which must come true, and invariants, which must hold throughout.

An assertion is a frozen spec whose fields are the YAML keys. `Assertion.monitor` opens its monitor, which watches the
run.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, ClassVar, Final, NamedTuple, Self

from sim_action.assertions.monitors import AdaptedMonitor, Monitor
from sim_action.assertions.monitors.windows import BecomingTrue, Window, becoming_true
from sim_action.core.field_types import FrozenModel
from sim_action.core.registry import Table
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_document import KeyPath, SpecProblems
from sim_action.state.observation import Observation
from sim_action.state.trace import Trace
from sim_action.state.trace_records import Channels
from sim_action.state.verdict import Mark, Signal
from sim_action.world.claims import Ceiling, ClaimFinding, Findings, JudgedRun, Setting
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.assertions.temporal_logic.formula import Formula

_MAX_TITLE: Final = 100
CREEP_M: Final = 0.1  # in m: a robot that drives goes farther than this; a smaller limit asks for a robot at rest
CREEP_M_S: Final = 0.05  # in m/s and rad/s: a robot that drives is faster than this
NO_READING: Final = "The sensor had no reading between `after` and `before`, or the run ended before `after`."
"""When an assertion on the readings of a sensor is not exercised."""


class Reference(NamedTuple):
    """The facts about an assertion for the documents, besides its docstring and its fields."""

    page: str  # the page of docs/scenario, which is `assertions-PAGE.md`: motion, contact, joints or logic
    kind: str  # a goal, an invariant, or judged at the end of the run; by key if its keys differ
    passed: str  # passed, failed, not_exercised: when it has this verdict, in one or two sentences
    failed: str
    not_exercised: str = "The run ended before `after`."


class Assertion(FrozenModel):
    """The base class of all assertions."""

    key: ClassVar[str]  # the name in YAML
    reference: ClassVar[Reference]  # the facts for the documents; assertions of installed packages need none
    bare_value: ClassVar[str | None] = None
    """The key whose text may replace the whole map in YAML; None if there is none."""

    runs_user_code: ClassVar[bool] = False
    """True if the monitor runs user code. Such a scenario gets an interpreter of its own."""

    measured_unit: ClassVar[str | None] = None
    """The SI symbol of the measured unit; None if the scenario or the run decides it."""

    ceilings: ClassVar[tuple[Ceiling, ...]] = ()  # the greatest values that its limits can have in any run
    sees_shapes: ClassVar[bool] = False
    """True if it judges contacts or distances, which only links with a collision shape have."""

    word: ClassVar[str] = "and"  # joins its parts if they are written as a formula
    has_golden: ClassVar[bool] = False  # True if it compares the run with a golden trajectory
    more_moments: ClassVar[str] = "run for longer"  # the advice for a run in which it was judged at one moment only

    @classmethod
    def __pydantic_init_subclass__(cls, **_: object) -> None:
        """Let the assertions of installed packages count as user code."""
        if not cls.__module__.startswith("sim_action."):
            cls.runs_user_code = True

    @property
    def channels(self) -> Channels:
        """The data that the monitor reads in addition to the robot's state. Only these channels are computed."""
        return Channels()

    @property
    def truth_channels(self) -> Channels:
        """The channels that `Monitor.truth` reads."""
        return self.channels

    @property
    def is_goal(self) -> bool:
        """True if it must come true once. Else it must hold throughout, or it is judged at the end."""
        return False

    @property
    def has_truth(self) -> bool:
        """True if it is true or false at each moment; its monitor has then `truth`."""
        return False

    @property
    def awaited(self) -> Formula | None:
        """The formula that an event waits for; None: it waits for `Monitor.truth`."""
        return None

    def waiting(self, span: float = 0.0, *, negated: bool = False) -> Assertion:
        """Return the assertion that passes once `awaited` is true for `span` in s, or is false if `negated`."""
        return self

    @property
    def moment_problem(self) -> str:
        """The reason why it cannot be the condition of an event; empty if it can."""
        leaves = [*self.leaves()]
        use = "use an stl formula, or an assertion such as reach, contact or upright"
        if any(leaf.awaited for leaf in leaves):
            use = f"write all of it as one formula, such as stl: x > 1 m {self.word} clearance(box) < 0.5 m"
        elif all(leaf.has_truth for leaf in leaves):
            use = "" if self.has_truth else "use at_once for what must be true at one moment"
        return f"'{self.key}' is not true or false at a moment, so nothing can happen then; {use}" if use else ""

    @property
    @abstractmethod
    def title(self) -> str:
        """The requirement in a few words, such as "travel at least 1.5 m"."""

    @property
    def inner_title(self) -> str:
        """The title as it appears inside the title of another assertion."""
        return self.title

    @property
    def hold_time(self) -> float | None:
        """The time in s for which it must hold, if the assertion has a key `for` of its own."""
        return None

    @property
    def states_span(self) -> bool:
        """True if the user gave a key `for` of its own."""
        return "span" in self.model_fields_set

    @property
    def is_explicit(self) -> bool:
        """True if the user's key `for` is enough for a goal that is true from t = 0 on, once the robot has moved."""
        return self.states_span

    def lasting(self, span: float) -> Self:
        """Return the assertion with `span` in s as its key `for`."""
        return self.model_copy(update={"span": span})

    @property
    def horizon(self) -> float:
        """The time in s, from the opening of its window, that a verdict on the whole assertion needs at least."""
        return self.hold_time or 0.0

    @abstractmethod
    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """Open the monitor. `start` is the settled state at t = 0."""

    def started(self, scene: Scene, start: Observation) -> Monitor:
        """Open the monitor; adapt one of an installed package that does not derive from Monitor."""
        return AdaptedMonitor.of(self.monitor(scene, start))

    def opened(self, scene: Scene, start: Observation, span: float | None = None) -> Monitor:
        """Open the monitor as an expectation uses it: a goal must become true, and hold for `span` in s."""
        if not (self.is_goal and self.has_truth):
            return self.started(scene, start)
        return self._becoming(scene, start, span)

    def _becoming(self, scene: Scene, start: Observation, span: float | None) -> BecomingTrue:
        explicit = span is not None or self.is_explicit
        return becoming_true(self.started(scene, start), scene, start, span, self.hold_time, explicit=explicit)

    def signals(
        self, scene: Scene, start: Observation, trace: Trace, after: float = 0.0, before: float = math.inf
    ) -> tuple[Signal, ...]:
        """Return the curves that the assertion judges, with their limits. The measured quantity comes first.

        `trace` is the whole run and may be decimated. `after` and `before`, in s of sim time, bound the time window.
        """
        return Window(self.started(scene, start), after, before).signals(trace)

    def held(
        self, scene: Scene, start: Observation, trace: Trace, window: tuple[float, float], span: float | None
    ) -> tuple[Signal, ...]:
        """Return the time for which a goal holds, if it must for `span` or from t = 0 on; `window`: begin, end in s."""
        if not (self.is_goal and self.has_truth):
            return ()
        return Window(self._becoming(scene, start, span), *window).signals(trace)

    def marks(self, scene: Scene, start: Observation) -> tuple[Mark, ...]:
        """Return the places in the world that belong to the assertion, for the 3-D view."""
        return ()

    @property
    def python_file(self) -> str | None:
        """Path of a Python file by the user that runs next to the robot, relative to the scenario."""
        return None

    @property
    def reads_file(self) -> bool:
        """True if the assertion names a file that must be read."""
        return False

    def file_problems(self, workspace: Workspace) -> SpecProblems:
        """Yield problems with the files that the assertion names. No user code runs."""
        yield from ()

    def problems(self, scene: Scene) -> SpecProblems:
        """Yield everything that does not fit the scene."""
        yield from ()

    def sensor_problems(self, kinds: Mapping[str, str]) -> SpecProblems:
        """Yield everything that does not fit the sensors of the scenario. `kinds` maps sensor name to kind."""
        yield from ()

    @property
    def names_links(self) -> bool:
        """True if it judges only the links of the robot that the user names."""
        return False

    @property
    def step_memory_s(self) -> float:
        """The time in s for which a step of a target may decide it; 0: never."""
        return 0.0

    @property
    def is_over_time(self) -> bool:
        """True if an invariant is judged at many moments, so that one moment is a remark."""
        return True

    def meaning(self, scene: Scene) -> str:
        """Return the assertion as text of a formula of `stl`; empty if it cannot be written as one.

        A quantity that formulas lack is written like the x of an object, such as `'path_length'.x`.
        """
        return ""

    def claims(self, setting: Setting) -> Findings:
        """Yield the findings of the audit of claims that are visible without the robot model."""
        yield from self.limits_beyond(setting)

    def limits_beyond(self, setting: Setting, *, of_base: bool = True) -> Findings:
        """Yield the limits that no run exceeds; without `of_base`, only limits that hold for any link or body."""
        for ceiling in self.ceilings:
            if (of_base or not ceiling.is_of_base) and (finding := ceiling.finding(self, setting)) is not None:
                yield finding

    def robot_claims(self, scene: Scene) -> Findings:
        """Yield the findings of the audit of claims that need the robot model or other files."""
        yield from ()

    def combined_claims(self, scene: Scene) -> Findings:
        """Yield the findings about a combination of assertions that its parts do not have."""
        yield from ()

    def limits_motion(self, scene: Scene) -> bool:
        """Return True if a robot that drives a few centimetres breaks it, so that it asks for a robot at rest."""
        return False

    def judges_rest(self, scene: Scene) -> bool:
        """Return True if it says something about a robot that nothing moves, such as that it stands upright."""
        return True

    def run_claims(self, run: JudgedRun) -> Findings:
        """Yield the findings of the audit of claims after a run; only an entry of `expect` itself is asked."""
        yield from ()

    def standstill(self, run: JudgedRun) -> ClaimFinding | None:
        """Return the finding that what it judges never moved in a run that passed, else None."""
        return None

    def placed_leaves(self) -> Iterator[tuple[KeyPath, Assertion]]:
        """Yield the assertion, or its parts if it is combined, each with the keys that lead to its value."""
        yield (self.key,), self

    def negated_leaves(self) -> Iterator[Assertion]:
        """Yield the parts of a combined assertion that must not hold."""
        yield from ()

    def leaves(self) -> Iterator[Assertion]:
        """Yield the assertions that judge the robot: the parts of a combined assertion, or the assertion itself."""
        for _, leaf in self.placed_leaves():
            yield leaf


def shortened_title(title: str) -> str:
    """Return a title that is made of other titles, cut to 100 characters."""
    return title if len(title) <= _MAX_TITLE else f"{title[: _MAX_TITLE - 3]}..."


ASSERTIONS: Final = Table[type[Assertion]](
    "assertion",
    {
        "travel": "sim_action.assertions.distance:Travel",
        "path_length": "sim_action.assertions.distance:PathLength",
        "reach": "sim_action.assertions.reach:Reach",
        "settled": "sim_action.assertions.settled:Settled",
        "final_pose": "sim_action.assertions.reach:FinalPose",
        "no_collision": "sim_action.assertions.no_collision:NoCollision",
        "self_collision": "sim_action.assertions.no_collision:SelfCollision",
        "contact": "sim_action.assertions.contact:Touch",
        "stops_before": "sim_action.assertions.settled:StopsBefore",
        "upright": "sim_action.assertions.upright:Upright",
        "max_speed": "sim_action.assertions.max_speed:MaxSpeed",
        "stay_within": "sim_action.assertions.stay_within:StayWithin",
        "clearance": "sim_action.assertions.clearance:Clearance",
        "object": "sim_action.assertions.object:ObjectAssertion",
        "grasped": "sim_action.assertions.grasped:Grasped",
        "feet_on_ground": "sim_action.assertions.legs:FeetOnGround",
        "support_margin": "sim_action.assertions.legs:SupportMargin",
        "follow_path": "sim_action.assertions.follow_path:FollowPath",
        "matches": "sim_action.assertions.matches:Matches",
        "odometry_error": "sim_action.assertions.odometry_error:OdometryError",
        "sensor": "sim_action.assertions.sensor:SensorReading",
        "joint": "sim_action.assertions.joint:JointReading",
        "joint_within": "sim_action.assertions.joint:JointWithin",
        "effort": "sim_action.assertions.effort:Effort",
        "energy": "sim_action.assertions.effort:Energy",
        "stl": "sim_action.assertions.temporal_logic.stl_assertion:Stl",
        "any_of": "sim_action.assertions.combined:AnyOf",
        "all_of": "sim_action.assertions.combined:AllOf",
        "at_once": "sim_action.assertions.combined:AtOnce",
        "not": "sim_action.assertions.combined:Negation",
        "assertion": "sim_action.assertions.user_assertion:UserAssertion",
    },
    group="sim_action.assertions",
    base=Assertion,
)
