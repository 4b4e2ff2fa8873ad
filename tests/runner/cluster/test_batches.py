"""The runs that a worker gets at a time: many short ones, few long ones, and one that may be the reason of a death."""

from __future__ import annotations

from sim_action.runner.cluster.batches import Batches


def taken(batches: Batches, threads: int) -> list[int]:
    sizes = []
    while batches:
        sizes.append(len(batches.take(threads)))
    return sizes


def of(count: int) -> Batches:
    return Batches(range(count), ["one workspace"] * count)


def test_the_first_runs_are_alone_because_nothing_is_known_of_them() -> None:
    assert of(100).take(2) == (0,)


def test_short_runs_come_together_and_fewer_at_the_end() -> None:
    batches = of(100)
    batches.took([0.0625, 0.125])
    assert taken(batches, 2) == [16, 16, 16, 13, 9, 7, 5, 4, 3, 3, 3, 3, 2]


def test_a_batch_takes_no_longer_than_a_few_seconds() -> None:
    batches = of(1000)
    batches.took([1.0])
    assert batches.take(2) == (0, 1, 2)
    batches.took([60.0, 1.0])
    assert batches.take(2) == (3,)


def test_runs_of_no_time_are_bounded_too() -> None:
    batches = of(1000)
    batches.took([0.0])
    assert len(batches.take(2)) == 16


def test_runs_of_other_kinds_are_not_mixed() -> None:
    batches = Batches(range(8), ["a", "a", "b", "b", "b", None, None, "b"])
    batches.took([0.01])
    assert [batches.take(1) for _ in range(5)] == [(0, 1), (2, 3, 4), (5,), (6,), (7,)]


def test_runs_of_a_batch_without_result_are_alone_the_next_time() -> None:
    batches = of(9)
    batches.took([0.1])
    first = batches.take(1)
    assert len(first) > 1
    batches.put_back_alone(first)
    assert [batches.take(1) for _ in first] == [(index,) for index in first]
    assert len(batches.take(1)) > 1


def test_runs_that_are_put_back_come_first_and_last() -> None:
    batches = of(3)
    first = batches.take(1)
    batches.put_last(first[0])
    second = batches.take(1)
    batches.put_back(second)
    assert len(batches) == 3
    assert batches.clear() == (1, 2, 0)
    assert not batches
