"""Assertions that consist of others: their specs, and the fold of several at once."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final, Self

from sim_action.assertions import Assertion, Monitor, State, is_decisive, is_follower
from sim_action.assertions.fold import joined, joined_by_any
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_errors import SpecProblems
from sim_action.state.trace_channels import Channels
from sim_action.state.verdict import Mark, Signal
from sim_action.world.scene import Scene

if TYPE_CHECKING:
    from sim_action.state.observation import Observation
    from sim_action.state.trace import Trace
    from sim_action.state.verdict import Verdict

_LONGEST_TITLE: Final = 100
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


def short(title: str) -> str:
    """A title that is made of others, with an end."""
    return title if len(title) <= _LONGEST_TITLE else f"{title[: _LONGEST_TITLE - 3]}..."


def is_decided(monitor: Monitor, began: State) -> bool:
    """Whether no later moment can change what a monitor says that began in a state."""
    if is_decisive(monitor):
        return monitor.is_decided
    return monitor.state is State.BROKEN or (began is State.PENDING and monitor.state is State.HOLDS)


def begun(monitor: Monitor, trace: Trace) -> Monitor:
    """A monitor after the moments before its window, if it wants to see them."""
    return monitor.begin(trace) if is_follower(monitor) else monitor


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
        """See Decisive.is_decided."""
        alone = State.BROKEN if self.every else State.HOLDS
        pairs = zip(self.monitors, self._decided, strict=True)
        return all(self._decided) or any(decided and monitor.state is alone for monitor, decided in pairs)

    @cached_property
    def _decided(self) -> list[bool]:
        return [is_decided(monitor, began) for monitor, began in zip(self.monitors, self.began, strict=True)]

    def begin(self, trace: Trace) -> Self:
        """See Follower.begin."""
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
