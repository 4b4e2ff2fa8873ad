"""The order of tests: each worker of pytest-xdist has its share of the slow ones, with quick ones between them.

Slow tests wait for processes, quick ones compute: mixed, they keep the processors busy. A queue ends with quick ones,
and a worker that is done takes tests from the end of another's queue. So all workers end at about the same time. Tests
of one file stay together: they share fixtures.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import groupby, islice

import pytest

from tests.child_processes import may_start_processes

_BETWEEN = 0.75  # the part of the quick tests that stands between slow ones


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    workerinput = getattr(config, "workerinput", None)
    if workerinput is not None:
        slow, quick = list[pytest.Item](), list[pytest.Item]()
        for item in items:
            (slow if may_start_processes(item) else quick).append(item)
        items[:] = dealt(slow, quick, workerinput["workercount"])


def dealt(slow: Iterable[pytest.Item], quick: list[pytest.Item], workers: int) -> list[pytest.Item]:
    """Return all items so that each of `workers` equal parts has whole files of slow ones, about as many as another."""
    shares = [list[list[pytest.Item]]() for _ in range(workers)]
    for file in sorted(_files(slow), key=len, reverse=True):
        min(shares, key=_count).append(file)
    total = sum(map(_count, shares)) + len(quick)
    order, quick_left = list[pytest.Item](), iter(quick)
    for worker, share in enumerate(shares, 1):
        size = total * worker // workers - len(order)
        # The small files first: their tests are the longest.
        order += _mixed(share[::-1], list(islice(quick_left, max(0, size - _count(share)))))
    return [*order, *quick_left]


def _files(items: Iterable[pytest.Item]) -> Iterator[list[pytest.Item]]:
    return (list(file) for _, file in groupby(items, key=lambda item: item.path))


def _count(files: list[list[pytest.Item]]) -> int:
    return sum(map(len, files))


def _mixed(slow_files: list[list[pytest.Item]], quick: list[pytest.Item]) -> Iterator[pytest.Item]:
    """Yield files of quick items after each slow file, by its share of the slow items, and the others at the end."""
    quick_files = _files(quick)
    per_slow_item = _BETWEEN * len(quick) / max(1, _count(slow_files))
    due = 0.0
    for file in slow_files:
        yield from file
        due += per_slow_item * len(file)
        while due > 0 and (between := next(quick_files, None)):
            yield from between
            due -= len(between)
    for rest in quick_files:
        yield from rest
