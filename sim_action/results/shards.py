"""Shards: the parts of a list of scenarios that several machines run at the same time."""

from __future__ import annotations

import heapq
import re
from collections.abc import Iterable, Sequence
from typing import Annotated, Final, Self, TypeVar

from pydantic import Field, model_validator

from sim_action.core.errors import UsageError
from sim_action.core.field_types import FrozenModel
from sim_action.core.messages import escaped_line
from sim_action.scenario.selection import ranges_text

MOST_SHARDS: Final = 256
"""GitHub makes no more jobs out of one matrix."""

T = TypeVar("T")

_Number = Annotated[int, Field(ge=1, le=MOST_SHARDS)]


class Shard(FrozenModel):
    """One part of a list of scenarios: every `count`-th of it.

    Attributes:
        index: which part it is, from 1; it begins with the scenario of that place.
        count: how many parts there are.
        total: how many scenarios all parts have together.
    """

    index: _Number
    count: _Number
    total: Annotated[int, Field(ge=0)]

    @classmethod
    def parse(cls, text: str, total: int) -> Self:
        """Reads I/N, of a list of so many scenarios. Raises UsageError."""
        found = re.fullmatch(r"\s*([0-9]{1,3})\s*/\s*([0-9]{1,3})\s*", text)
        index, count = map(int, found.groups()) if found else (0, 0)
        if not 1 <= index <= count <= MOST_SHARDS:
            allowed = f"I/N with 1 <= I <= N <= {MOST_SHARDS}, such as 1/3"
            raise UsageError(escaped_line(f"--shard {text}: must be {allowed}"))
        return cls(index=index, count=count, total=total)

    @model_validator(mode="after")
    def _is_one_of_all(self) -> Self:
        if self.index > self.count:
            raise ValueError(f"there is no shard {self.index} of {self.count}")
        return self

    def __str__(self) -> str:
        return f"shard {self.index} of {self.count}"

    def dealt(self, scenarios: Sequence[T]) -> list[T]:
        """What of a list is in this part, in the order of the list."""
        return list(scenarios[self.index - 1 :: self.count])


def shards_text(indices: Iterable[int], count: int) -> str:
    """Some of so many shards, such as "shard 2 of 3" or "shards 1-3, 5 of 9"."""
    ordered = sorted(indices)
    return f"{'shard' if len(ordered) == 1 else 'shards'} {ranges_text(ordered, ', ')} of {count}"


def balanced(scenarios: Sequence[T], durations: Sequence[float], count: int) -> list[list[T]]:
    """Deals a list to at most so many parts that take about equally long; none is empty, each keeps the list's order.

    The longest goes first, each to the part that has the least so far: the longest part then takes at most 4/3 of
    what it would if they were dealt as well as can be (R. L. Graham, Bounds on Multiprocessing Timing Anomalies,
    1969). `durations` are in s, and above zero.
    """
    loads = [(0.0, 0, part) for part in range(min(count, len(scenarios)))]
    parts: list[list[int]] = [[] for _ in loads]
    for place in sorted(range(len(scenarios)), key=lambda place: (-durations[place], place)):
        load, size, part = heapq.heappop(loads)
        parts[part].append(place)
        heapq.heappush(loads, (load + durations[place], size + 1, part))
    return [[scenarios[place] for place in sorted(part)] for part in parts]
