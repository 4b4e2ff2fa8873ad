"""`not: {reach: ...}`: an assertion must not hold."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

from pydantic import Field

from sim_action.assertions import Assertion, Monitor, State
from sim_action.assertions.combined import Combined, Place, begun, is_decided, short
from sim_action.state.verdict import Signal
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation
    from sim_action.state.trace import Trace
    from sim_action.state.verdict import Verdict


class Negation(Combined):
    """An assertion must not hold.

    The contrary of a goal is an invariant, which is broken when the goal comes true: `not: {reach: ...}` keeps
    the robot away. The contrary of an invariant is a goal, which comes true when that is broken: `not:
    no_collision` asks for one. What is goal and invariant at once is judged at the end of the run. The margin is
    that of the assertion with the other sign.
    """

    key: ClassVar[str] = "not"

    part: Annotated[Assertion, Field(description="the assertion itself, which is the value")]

    @classmethod
    def entries(cls, data: Any) -> Sequence[tuple[Place, Any]]:
        """See Combined.entries."""
        return [((), data)]

    @classmethod
    def made_of(cls, parts: tuple[Assertion, ...]) -> Self:
        """See Combined.made_of."""
        (part,) = parts
        return cls(part=part)

    @classmethod
    def value_schema(cls, part: dict[str, Any]) -> dict[str, Any]:
        """See Combined.value_schema."""
        return part

    @property
    def placed_parts(self) -> Sequence[tuple[Place, Assertion]]:
        """See Combined.placed_parts."""
        return [((), self.part)]

    @property
    def title(self) -> str:
        """See Assertion.title."""
        part = self.part
        return short(f"not ({part.title})" if isinstance(part, Negation) else f"not {part.inner_title}")

    def signals(
        self, scene: Scene, start: Observation, trace: Trace, after: float = 0.0, before: float = math.inf
    ) -> tuple[Signal, ...]:
        """Those of its part, with the limits the other way round."""
        return tuple(signal.contrary() for signal in super().signals(scene, start, trace, after, before))

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor; the contrary of a contrary is told in the words of what that is of."""
        if isinstance(self.part, Negation):
            return self.part.part.monitor(scene, start)
        monitor = self.part.monitor(scene, start)
        return NegationMonitor(monitor, monitor.state)


@dataclass(frozen=True)
class NegationMonitor:
    """The fold of the assertion itself, read the other way round; its state is worked out once, as of a Combination.

    Attributes:
        began: its state before the first moment.
        seen: whether there was a moment.
    """

    monitor: Monitor
    began: State
    seen: bool = False

    @cached_property
    def state(self) -> State:
        """See Monitor.state."""
        if self.monitor.state is State.BROKEN:
            return State.HOLDS
        if self.monitor.state is State.HOLDS and self.is_decided:
            return State.BROKEN
        return State.HOLDS if self.began is State.PENDING else State.PENDING

    @cached_property
    def is_decided(self) -> bool:
        """See Decisive.is_decided."""
        return is_decided(self.monitor, self.began)

    def begin(self, trace: Trace) -> Self:
        """See Follower.begin."""
        return replace(self, monitor=begun(self.monitor, trace))

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        return replace(self, monitor=self.monitor.observe(trace), seen=self.seen or len(trace) > 0)

    def verdict(self) -> Verdict:
        """That of the assertion, the other way round: what it has found is the same, and right or wrong."""
        verdict = self.monitor.verdict()
        if not self.seen:
            return replace(verdict, passed=False, message="no moment to measure")
        margin = None if verdict.margin is None else 0.0 - verdict.margin
        message = f"{verdict.message}, which must not be so" if verdict.passed else verdict.message
        return replace(verdict, passed=not verdict.passed, margin=margin, message=message)
