"""What each shard gets: everything once, in order, and about equally much."""

from __future__ import annotations

from itertools import chain, product

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from sim_action.core.errors import UsageError
from sim_action.scenario.sharding import Shard, balanced, shards_text

COUNTS = st.integers(1, 20)
DURATIONS = st.lists(st.floats(0.001, 1000.0), max_size=40)


def test_a_shard_is_read_as_it_is_typed() -> None:
    assert Shard.parse("2/3", 7) == Shard(index=2, count=3, total=7)
    assert Shard.parse(" 256 / 256\n", 0) == Shard(index=256, count=256, total=0)
    assert str(Shard.parse("2/3", 7)) == "shard 2 of 3"


@pytest.mark.parametrize(
    "text",
    ["4/3", "0/3", "1/0", "1/257", "-1/3", "1", "1/", "/3", "1/3/5", "1.5/3", "a/b", "", "1/9999", "\uff11/\uff13"],
)
def test_what_is_no_shard_is_told_with_what_is_one(text: str) -> None:
    with pytest.raises(UsageError) as raised:
        Shard.parse(text, 7)
    assert str(raised.value).endswith("must be I/N with 1 <= I <= N <= 256, such as 1/3")
    assert str(raised.value).isprintable()


def test_results_of_a_shard_that_cannot_be_are_refused() -> None:
    with pytest.raises(ValidationError, match="there is no shard 3 of 2"):
        Shard(index=3, count=2, total=9)


@pytest.mark.parametrize(
    ("indices", "text"),
    [
        ([2], "shard 2 of 9"),
        ([1, 2], "shards 1-2 of 9"),
        ([9, 3, 2, 1, 5], "shards 1-3, 5, 9 of 9"),
        (range(1, 10), "shards 1-9 of 9"),
    ],
)
def test_some_shards_have_one_name(indices: list[int], text: str) -> None:
    assert shards_text(indices, 9) == text


def test_every_n_th_beginning_with_the_i_th() -> None:
    assert [Shard(index=i, count=3, total=7).dealt("abcdefg") for i in (1, 2, 3)] == [
        list("adg"),
        list("be"),
        list("cf"),
    ]
    assert Shard(index=3, count=3, total=2).dealt("ab") == []


@given(total=st.integers(0, 60), count=COUNTS)
def test_shards_have_everything_once_and_in_order(total: int, count: int) -> None:
    shards = [Shard(index=index, count=count, total=total).dealt(range(total)) for index in range(1, count + 1)]
    assert sorted(chain(*shards)) == list(range(total))
    assert all(shard == sorted(shard) for shard in shards)
    assert max(map(len, shards)) - min(map(len, shards)) <= 1


@given(durations=DURATIONS, count=COUNTS)
def test_balanced_parts_have_everything_once_and_in_order_and_none_is_empty(durations: list[float], count: int) -> None:
    parts = balanced(range(len(durations)), durations, count)
    assert sorted(chain(*parts)) == list(range(len(durations)))
    assert all(part and part == sorted(part) for part in parts)
    assert len(parts) == min(count, len(durations))


@given(durations=DURATIONS.filter(bool), count=COUNTS)
def test_no_part_takes_longer_than_the_mean_and_one_more(durations: list[float], count: int) -> None:
    loads = [sum(part) for part in balanced(durations, durations, count)]
    assert max(loads) <= (sum(durations) / len(loads) + max(durations)) * (1 + 1e-9)


@given(durations=st.lists(st.floats(0.001, 1000.0), min_size=1, max_size=6), count=st.integers(1, 3))
def test_the_longest_part_is_within_a_third_of_the_best_there_can_be(durations: list[float], count: int) -> None:
    def longest(choice: tuple[int, ...]) -> float:
        return max(
            sum(duration for duration, part in zip(durations, choice, strict=True) if part == wanted)
            for wanted in range(count)
        )

    best = min(map(longest, product(range(count), repeat=len(durations))))
    bound = (4 / 3 - 1 / (3 * count)) * best
    assert max(sum(part) for part in balanced(durations, durations, count)) <= bound * (1 + 1e-9)


def test_what_takes_equally_long_is_dealt_by_count() -> None:
    assert balanced("abcdefg", [2.5] * 7, 3) == [list("adg"), list("be"), list("cf")]
