"""Some scenarios of a file, as they are written and read."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.scenario.numbering import numbered, ranges_text, split


@pytest.mark.parametrize(
    ("numbers", "text"), [([1], "1"), ([2, 1, 3], "1-3"), ([9, 1, 2, 5], "1-2,5,9"), (range(1, 10_001), "1-10000")]
)
def test_those_that_follow_each_other_are_one(numbers: list[int], text: str) -> None:
    assert ranges_text(numbers) == text


@given(st.sets(st.integers(1, 99_999), min_size=1, max_size=30))
def test_what_is_written_is_read(numbers: set[int]) -> None:
    assert split(numbered("deep/a b.sim.yml", numbers)) == ("deep/a b.sim.yml", frozenset(numbers))


@pytest.mark.parametrize(
    "name", ["a.sim.yml", "a::b", "a::", "::1", "a::1-", "a::1,,2", "a::-1", "a::123456", "a:1", ""]
)
def test_what_has_no_numbers_is_a_name(name: str) -> None:
    assert split(name) == (name, None)


def test_a_file_that_is_called_so_is_that_file(tmp_path: Path) -> None:
    name = str(tmp_path / "a::1")
    assert split(name) == (str(tmp_path / "a"), frozenset({1}))
    Path(name).touch()
    assert split(name) == (name, None)
