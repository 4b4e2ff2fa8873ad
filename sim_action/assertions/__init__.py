"""Assertions: what must come true (goals) and what must hold throughout (invariants).

An assertion is a frozen spec whose fields are the YAML keys. Its monitor is a value too: a fold over traces, which
the simulation loop feeds block by block and a stored trace in one piece, with the same result.
"""

from __future__ import annotations

from abc import abstractmethod
from enum import Enum
from typing import TYPE_CHECKING, ClassVar, Final, Protocol, Self, runtime_checkable

from sim_action.observation import Observation
from sim_action.quantities import FrozenModel
from sim_action.registry import Table
from sim_action.scene import Scene, SpecProblems
from sim_action.verdict import Verdict

if TYPE_CHECKING:
    from sim_action.trace import Trace


class State(Enum):
    """What a monitor can say before the run is over."""

    PENDING = "a goal that has not come true yet"
    HOLDS = "a goal that came true, or an invariant that was not broken so far"
    BROKEN = "no later moment can mend it"


class Monitor(Protocol):
    """The fold: frozen, and replaced by `observe`."""

    @property
    def state(self) -> State:
        """What is known so far."""

    def observe(self, trace: Trace) -> Self:
        """The monitor after the moments that follow; `trace` has every physics step."""

    def verdict(self) -> Verdict:
        """The judgement, if nothing more came."""


@runtime_checkable
class Follower(Monitor, Protocol):
    """A monitor that goes on from the moment before: it has to know where its time window begins."""

    def begin(self, trace: Trace) -> Self:
        """The monitor after moments up to the one that its window opens at; that one is observed too."""


class Assertion(FrozenModel):
    """What all assertions are."""

    key: ClassVar[str]
    """Its name in YAML."""

    watches_contacts: ClassVar[bool] = False
    """Whether its monitor reads `Trace.contacts`; they are computed only when asked for."""

    @property
    @abstractmethod
    def title(self) -> str:
        """What is asked, in a few words: "travel at least 1.5 m"."""

    @abstractmethod
    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """The fold's beginning; `start` is the settled state at t = 0."""

    def problems(self, scene: Scene) -> SpecProblems:
        """What does not fit the scene."""
        yield from ()


ASSERTIONS: Final = Table[type[Assertion]](
    "assertion",
    {
        "travel": "sim_action.assertions.travel:Travel",
        "path_length": "sim_action.assertions.path_length:PathLength",
        "reach": "sim_action.assertions.reach:Reach",
        "no_collision": "sim_action.assertions.no_collision:NoCollision",
        "upright": "sim_action.assertions.upright:Upright",
        "max_speed": "sim_action.assertions.max_speed:MaxSpeed",
        "stay_within": "sim_action.assertions.stay_within:StayWithin",
        "joint": "sim_action.assertions.joint:JointReading",
    },
)
