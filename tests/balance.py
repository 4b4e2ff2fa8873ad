"""The order of tests: each worker of pytest-xdist begins with its share of the slow ones.

A worker that is done takes tests from the end of another's queue. As the quick ones stand there, all workers end at
about the same time. Tests of one file stay together: they share fixtures.
"""

from __future__ import annotations

from itertools import islice
from typing import TypeVar

import pytest

from tests.child_processes import may_start_processes

Item = TypeVar("Item")


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    workerinput = getattr(config, "workerinput", None)
    if workerinput is not None:
        slow = [item for item in items if may_start_processes(item)]
        quick = [item for item in items if not may_start_processes(item)]
        items[:] = dealt(slow, quick, workerinput["workercount"])


def dealt(slow: list[Item], quick: list[Item], workers: int) -> list[Item]:
    """Return all items so that each of `workers` equal parts begins with slow ones and ends with quick ones."""
    order: list[Item] = []
    total = len(slow) + len(quick)
    slow_left, quick_left = iter(slow), iter(quick)
    for worker in range(workers):
        size = (total * (worker + 1)) // workers - len(order)
        part = list(islice(slow_left, share(len(slow), worker, workers)))
        order += part
        order += islice(quick_left, size - len(part))
    return order


def share(count: int, worker: int, workers: int) -> int:
    """Return how many of `count` items are one worker's."""
    return count * (worker + 1) // workers - count * worker // workers
