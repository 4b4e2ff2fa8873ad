"""Assertions: what must come true (goals) and what must hold throughout (invariants).

An assertion is a frozen spec whose fields are the YAML keys. Its monitor is a value too: a fold over traces, which
the simulation loop feeds block by block and a stored trace in one piece, with the same result.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, ClassVar, Final

from sim_action.assertions.monitors import Monitor
from sim_action.core.field_types import FrozenModel
from sim_action.core.registry import Table
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_errors import SpecProblems
from sim_action.state.trace_channels import Channels
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation
    from sim_action.state.trace import Trace
    from sim_action.state.verdict import Mark, Signal


_MAX_TITLE: Final = 100


class Assertion(FrozenModel):
    """What all assertions are."""

    key: ClassVar[str]
    """Its name in YAML."""

    bare_value: ClassVar[str | None] = None
    """The key whose value, a text, may stand alone in the place of all keys."""

    runs_user_code: ClassVar[bool] = False
    """Whether its monitor runs code of the user's: such a scenario gets an interpreter of its own."""

    @property
    def channels(self) -> Channels:
        """What its monitor reads beside the state of the robot; it is computed only when asked for."""
        return Channels()

    @property
    @abstractmethod
    def title(self) -> str:
        """What is asked, in a few words: "travel at least 1.5 m"."""

    @property
    def inner_title(self) -> str:
        """Its title where it stands in that of another."""
        return self.title

    @abstractmethod
    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """The fold's beginning; `start` is the settled state at t = 0."""

    def signals(
        self, scene: Scene, start: Observation, trace: Trace, after: float = 0.0, before: float = math.inf
    ) -> tuple[Signal, ...]:
        """What it looked at over time, with its limits: the curve of what is measured first.

        `trace` is the whole run, and may be decimated; `after` and `before`, in s of sim time, are the expectation's.
        """
        from sim_action.assertions.monitors.window import signals_of

        return signals_of(self.monitor(scene, start), trace, after, before)

    def marks(self, scene: Scene, start: Observation) -> tuple[Mark, ...]:
        """Where in the world that is, if it is somewhere."""
        return ()

    @property
    def python_file(self) -> str | None:
        """Path of the user's code that runs beside the robot, from the scenario."""
        return None

    @property
    def reads_file(self) -> bool:
        """Whether it names a file of the user's, which takes time to read."""
        return False

    def file_problems(self, workspace: Workspace) -> SpecProblems:
        """What is wrong with the files it names; nothing of the user's is run."""
        yield from ()

    def problems(self, scene: Scene) -> SpecProblems:
        """What does not fit the scene."""
        yield from ()

    def sensor_problems(self, kinds: Mapping[str, str]) -> SpecProblems:
        """What does not fit the scenario's sensors: name -> kind of each."""
        yield from ()

    def leaves(self) -> Iterator[Assertion]:
        """The assertions that it consists of, which look at the robot: itself, if it is not made of others."""
        yield self


def shortened_title(title: str) -> str:
    """Return a title that is made of other titles, cut to 100 characters."""
    return title if len(title) <= _MAX_TITLE else f"{title[: _MAX_TITLE - 3]}..."


ASSERTIONS: Final = Table[type[Assertion]](
    "assertion",
    {
        "travel": "sim_action.assertions.travel:Travel",
        "path_length": "sim_action.assertions.path_length:PathLength",
        "reach": "sim_action.assertions.reach:Reach",
        "settled": "sim_action.assertions.settled:Settled",
        "final_pose": "sim_action.assertions.final_pose:FinalPose",
        "no_collision": "sim_action.assertions.no_collision:NoCollision",
        "contact": "sim_action.assertions.contact:Touch",
        "stops_before": "sim_action.assertions.stops_before:StopsBefore",
        "upright": "sim_action.assertions.upright:Upright",
        "max_speed": "sim_action.assertions.max_speed:MaxSpeed",
        "stay_within": "sim_action.assertions.stay_within:StayWithin",
        "clearance": "sim_action.assertions.clearance:Clearance",
        "follow_path": "sim_action.assertions.follow_path:FollowPath",
        "matches": "sim_action.assertions.matches:Matches",
        "odometry_error": "sim_action.assertions.odometry_error:OdometryError",
        "sensor": "sim_action.assertions.sensor:SensorReading",
        "joint": "sim_action.assertions.joint:JointReading",
        "joint_within": "sim_action.assertions.joint:JointWithin",
        "effort": "sim_action.assertions.effort:Effort",
        "energy": "sim_action.assertions.energy:Energy",
        "stl": "sim_action.assertions.stl:Stl",
        "any_of": "sim_action.assertions.combined:AnyOf",
        "all_of": "sim_action.assertions.combined:AllOf",
        "not": "sim_action.assertions.combined:Negation",
        "assertion": "sim_action.assertions.user_assertion:UserAssertion",
    },
)
