"""Shards: the parts of a list of scenarios that several machines run at the same time."""

from __future__ import annotations

import heapq
import re
from collections.abc import Iterable, Sequence
from typing import Annotated, Final, Self, TypeVar

from pydantic import Field, model_validator

from sim_action.core.errors import UsageError
from sim_action.core.field_types import FrozenModel
from sim_action.core.wording import escaped_line
from sim_action.scenario.selection import ranges_text

MAX_SHARDS: Final = 256
"""The largest number of jobs that GitHub creates from one matrix."""

T = TypeVar("T")

_Number = Annotated[int, Field(ge=1, le=MAX_SHARDS)]


class Shard(FrozenModel):
    """One part of a list of scenarios: every `count`-th scenario, beginning with number `index`.

    Attributes:
        index: the number of this part, counted from 1.
        count: the number of parts.
        total: the number of scenarios in all parts together; each variation is one.
    """

    index: _Number
    count: _Number
    total: Annotated[int, Field(ge=0)]

    @classmethod
    def parse(cls, text: str, total: int) -> Self:
        """Parse "I/N" for a list of `total` scenarios. Raises UsageError."""
        found = re.fullmatch(r"\s*([0-9]{1,3})\s*/\s*([0-9]{1,3})\s*", text)
        index, count = map(int, found.groups()) if found else (0, 0)
        if not 1 <= index <= count <= MAX_SHARDS:
            allowed = f"I/N with 1 <= I <= N <= {MAX_SHARDS}, such as 1/3"
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
        """Return the elements of a list that belong to this part, in the order of the list."""
        return list(scenarios[self.index - 1 :: self.count])


def shards_text(indices: Iterable[int], count: int) -> str:
    """Return the name of some shards, such as "shard 2 of 3" or "shards 1-3, 5 of 9"."""
    ordered = sorted(indices)
    return f"{'shard' if len(ordered) == 1 else 'shards'} {ranges_text(ordered, ', ')} of {count}"


def balanced(scenarios: Sequence[T], durations: Sequence[float], count: int) -> list[list[T]]:
    """Divide a list into at most `count` parts of similar duration; no part is empty, each keeps the list's order.

    Elements are assigned in descending order of duration, each to the part with the smallest load so far. The
    longest part then takes at most 4/3 of the optimum (R. L. Graham, Bounds on Multiprocessing Timing Anomalies,
    1969). `durations` are in s and greater than zero.
    """
    loads = [(0.0, 0, part) for part in range(min(count, len(scenarios)))]
    parts: list[list[int]] = [[] for _ in loads]
    for place in sorted(range(len(scenarios)), key=lambda place: (-durations[place], place)):
        load, size, part = heapq.heappop(loads)
        parts[part].append(place)
        heapq.heappush(loads, (load + durations[place], size + 1, part))
    return [[scenarios[place] for place in sorted(part)] for part in parts]
