"""Assertions that consist of others: their specs, and the fold of several at once."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Self

from pydantic import Field

from sim_action.assertions import Assertion, shortened_title
from sim_action.assertions.monitors import Monitor, State, is_cumulative, is_deciding
from sim_action.assertions.monitors.goals import joined, joined_by_any
from sim_action.core.messages import shown
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_errors import SpecProblems
from sim_action.state.trace_channels import Channels
from sim_action.state.verdict import Mark, Signal
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation
    from sim_action.state.trace import Trace
    from sim_action.state.verdict import Verdict


Place = tuple[str | int, ...]


class Combined(Assertion):
    """An assertion whose value in YAML is one assertion or more."""

    @classmethod
    @abstractmethod
    def entries(cls, data: Any) -> Sequence[tuple[Place, Any]]:
        """Each assertion in the value, with the keys that lead to it. Raises ValueError for what is no such value."""

    @classmethod
    @abstractmethod
    def made_of(cls, parts: tuple[Assertion, ...]) -> Self:
        """The spec, of what the entries were read as."""

    @classmethod
    @abstractmethod
    def value_schema(cls, part: dict[str, Any]) -> dict[str, Any]:
        """The JSON Schema of the value, from that of a part."""

    @property
    @abstractmethod
    def placed_parts(self) -> Sequence[tuple[Place, Assertion]]:
        """Its parts, with the keys that lead to each."""

    def leaves(self) -> Iterator[Assertion]:
        """See Assertion.leaves."""
        for _, part in self.placed_parts:
            yield from part.leaves()

    @property
    def channels(self) -> Channels:
        """See Assertion.channels."""
        return Channels.all_of(part.channels for _, part in self.placed_parts)

    def signals(
        self, scene: Scene, start: Observation, trace: Trace, after: float = 0.0, before: float = math.inf
    ) -> tuple[Signal, ...]:
        """Those of its parts."""
        parts = (part for _, part in self.placed_parts)
        return tuple(signal for part in parts for signal in part.signals(scene, start, trace, after, before))

    def marks(self, scene: Scene, start: Observation) -> tuple[Mark, ...]:
        """Those of its parts."""
        return tuple(mark for _, part in self.placed_parts for mark in part.marks(scene, start))

    def problems(self, scene: Scene) -> SpecProblems:
        """Those of its parts."""
        for place, part in self.placed_parts:
            for path, message in part.problems(scene):
                yield (*place, part.key, *path), message

    def sensor_problems(self, kinds: Mapping[str, str]) -> SpecProblems:
        """Those of its parts."""
        for place, part in self.placed_parts:
            for path, message in part.sensor_problems(kinds):
                yield (*place, part.key, *path), message

    def file_problems(self, workspace: Workspace) -> SpecProblems:
        """Those of its parts."""
        for place, part in self.placed_parts:
            for path, message in part.file_problems(workspace):
                yield (*place, part.key, *path), message


def is_decided(monitor: Monitor, began: State) -> bool:
    """Whether no later moment can change what a monitor says that began in a state."""
    if is_deciding(monitor):
        return monitor.is_decided
    return monitor.state is State.BROKEN or (began is State.PENDING and monitor.state is State.HOLDS)


def begun(monitor: Monitor, trace: Trace) -> Monitor:
    """A monitor after the moments before its window, if it wants to see them."""
    return monitor.begin(trace) if is_cumulative(monitor) else monitor


@dataclass(frozen=True)
class Combination:
    """All of several folds (`every`), or any of them.

    Its state is worked out once, however often those around it ask: anew, each layer would double the work.

    Attributes:
        began: the state of each before the first moment.
    """

    titles: tuple[str, ...]
    monitors: tuple[Monitor, ...]
    began: tuple[State, ...]
    every: bool

    @classmethod
    def of(cls, parts: tuple[Assertion, ...], scene: Scene, start: Observation, *, every: bool) -> Self:
        """The fold before the first moment."""
        monitors = tuple(part.monitor(scene, start) for part in parts)
        return cls(tuple(part.inner_title for part in parts), monitors, tuple(m.state for m in monitors), every)

    @cached_property
    def state(self) -> State:
        """See Monitor.state."""
        states = [monitor.state for monitor in self.monitors]
        return joined(*states) if self.every else joined_by_any(zip(states, self._decided, strict=True))

    @cached_property
    def is_decided(self) -> bool:
        """See DecidingMonitor.is_decided."""
        alone = State.BROKEN if self.every else State.HOLDS
        pairs = zip(self.monitors, self._decided, strict=True)
        return all(self._decided) or any(decided and monitor.state is alone for monitor, decided in pairs)

    @cached_property
    def _decided(self) -> list[bool]:
        return [is_decided(monitor, began) for monitor, began in zip(self.monitors, self.began, strict=True)]

    def begin(self, trace: Trace) -> Self:
        """See CumulativeMonitor.begin."""
        return replace(self, monitors=tuple(begun(monitor, trace) for monitor in self.monitors))

    def observe(self, trace: Trace) -> Self:
        """See Monitor.observe."""
        return replace(self, monitors=tuple(monitor.observe(trace) for monitor in self.monitors))

    def verdict(self) -> Verdict:
        """That of the part which decides, said of all of them."""
        verdicts = [monitor.verdict() for monitor in self.monitors]
        good = [verdict.passed for verdict in verdicts]
        passed = all(good) if self.every else any(good)
        candidates = [n for n, one in enumerate(good) if one == passed]
        index = _decisive(verdicts, candidates, least=self.every, last=self.every == passed)
        message = f"{self._count(sum(good))}; {self.titles[index]}: {verdicts[index].message}"
        return replace(verdicts[index], passed=passed, message=message)

    def _count(self, holding: int) -> str:
        total = len(self.monitors)
        return f"all {total} hold" if holding == total else f"{holding or 'none'} of {total} hold"


def _decisive(verdicts: Sequence[Verdict], candidates: Sequence[int], *, least: bool, last: bool) -> int:
    """By the margins, if all of them are of one unit; else the one that was decided last, or first."""
    margins = {n: margin for n in candidates if (margin := verdicts[n].margin) is not None}
    if len(margins) == len(candidates) and len({verdicts[n].unit for n in candidates}) == 1:
        return (min if least else max)(margins, key=margins.__getitem__)
    times = {n: time for n in candidates if (time := verdicts[n].time) is not None}
    return (max if last else min)(times, key=times.__getitem__) if times else candidates[0]


class Several(Combined):
    """What `any_of` and `all_of` have in common."""

    parts: Annotated[tuple[Assertion, ...], Field(min_length=1, description="the list itself, which is the value")]

    @classmethod
    def entries(cls, data: Any) -> Sequence[tuple[Place, Any]]:
        """See Combined.entries."""
        if not isinstance(data, tuple) or not data:
            raise ValueError(f"expected a list of assertions, each of which begins with '- ', found {shown(data)}")
        return [((index,), entry) for index, entry in enumerate(data)]

    @classmethod
    def made_of(cls, parts: tuple[Assertion, ...]) -> Self:
        """See Combined.made_of."""
        return cls(parts=parts)

    @classmethod
    def value_schema(cls, part: dict[str, Any]) -> dict[str, Any]:
        """See Combined.value_schema."""
        return {"type": "array", "minItems": 1, "items": part}

    @property
    def placed_parts(self) -> Sequence[tuple[Place, Assertion]]:
        """See Combined.placed_parts."""
        return [((index,), part) for index, part in enumerate(self.parts)]

    @property
    def title(self) -> str:
        """See Assertion.title."""
        return shortened_title(f"{self.key}: {'; '.join(part.inner_title for part in self.parts)}")

    @property
    def inner_title(self) -> str:
        """In parentheses: else what follows would read as one part more."""
        return f"({self.title})"


class AllOf(Several):
    """Several assertions must hold, all of them.

    Beside `expect` itself, which asks the same of its entries, it is of use inside of `any_of` and `not`, and
    where several have one `name`, `after`, `before` and `severity`. It is a goal if one of them is; it is broken
    as soon as one of them is. Margin, limit and time are those of the assertion that decides, which the message
    names: the one with the least margin, if all are measured in the same unit; else the last that came true, or
    the first that does not hold.
    """

    key: ClassVar[str] = "all_of"

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        return Combination.of(self.parts, scene, start, every=True)


class AnyOf(Several):
    """One assertion of several must hold, whichever it is.

    It is a goal if one of them is: the run waits for the first that comes true, or else for its end, and what is
    then not broken holds. Of invariants alone it is an invariant, broken when the last of them is. Margin, limit
    and time are those of the assertion that decides, which the message names: of those that hold, or of all if
    none does, the one with the greatest margin, if all are measured in the same unit; else, of those that hold,
    the first. `after`, `before`, `name` and `severity` stand beside `any_of`.
    """

    key: ClassVar[str] = "any_of"

    def monitor(self, scene: Scene, start: Observation) -> Monitor:
        """See Assertion.monitor."""
        return Combination.of(self.parts, scene, start, every=False)


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
        return shortened_title(f"not ({part.title})" if isinstance(part, Negation) else f"not {part.inner_title}")

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
        """See DecidingMonitor.is_decided."""
        return is_decided(self.monitor, self.began)

    def begin(self, trace: Trace) -> Self:
        """See CumulativeMonitor.begin."""
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
