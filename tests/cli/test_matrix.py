"""The matrix of a job: what GitHub and the action make of it is what was meant."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.cli.matrix import FileOfScenarios, Unit, known_durations, matrix_text
from sim_action.core.errors import UsageError
from sim_action.core.workspace import compared_name
from sim_action.scenario.selection import split
from tests.outcomes import outcome, results


def of(name: str, *numbers: int) -> FileOfScenarios:
    return FileOfScenarios(Path(name), numbers or (1,))


def names_of_files(known: dict[Unit, float]) -> dict[str, float]:
    return {name: duration for (name, _), duration in known.items()}


def dealt(names: list[str], count: int, known: dict[str, float] | None = None, empty: tuple[str, ...] = ()) -> Any:
    earlier = results(*(outcome(name, wall_time=duration, number=1) for name, duration in (known or {}).items()))
    text = matrix_text([of(name) for name in names], empty, count, known_durations(earlier))
    assert text.isascii()
    assert len(text.splitlines()) == 1
    return json.loads(text)["include"]


def scenarios(names: list[str], count: int, known: dict[str, float] | None = None) -> list[list[str]]:
    return [entry["scenario"].split("\n") for entry in dealt(names, count, known)]


def test_entries_have_an_index_how_many_there_are_and_a_scenario_on_each_line() -> None:
    assert dealt(["a.sim.yml", "b.sim.yml", "ü c.sim.yml"], 2) == [
        {"index": 1, "shards": 2, "scenario": "a.sim.yml\nü c.sim.yml"},
        {"index": 2, "shards": 2, "scenario": "b.sim.yml"},
    ]


def test_scenarios_are_dealt_by_what_they_take() -> None:
    assert [entry["shards"] for entry in dealt(["a", "b"], 5)] == [2, 2]
    known = {"a": 1.0, "b": 1.0, "c": 10.0, "d": 1.0}
    assert scenarios(["a", "b", "c", "d"], 2, known) == [["c"], ["a", "b", "d"]]
    # 4, 2 and, as their mean, 3 and 3: equal halves.
    assert scenarios(["a", "b", "new", "newer"], 2, {"a": 4.0, "b": 2.0}) == [["a", "b"], ["new", "newer"]]
    # What holds no scenario is told by the first shard alone.
    entries = dealt(["a", "b"], 2, empty=("nope*", "empty/"))
    assert [entry["scenario"] for entry in entries] == ["a\nnope*\nempty/", "b"]


@given(
    names=st.lists(st.from_regex(r"[a-z]{1,3}(/[a-z]{1,3})?", fullmatch=True), min_size=1, max_size=20, unique=True),
    count=st.integers(1, 8),
    data=st.data(),
)
def test_everything_is_there_once_and_in_order(names: list[str], count: int, data: st.DataObject) -> None:
    known = data.draw(st.dictionaries(st.sampled_from(names), st.floats(0.01, 100.0)))
    shards = scenarios(names, count, known)
    assert sorted(name for shard in shards for name in shard) == sorted(names)
    assert all(shard == [name for name in names if name in shard] for shard in shards)
    assert 1 <= len(shards) <= count


def test_durations_are_those_of_what_ran_by_the_names_of_files() -> None:
    earlier = results(
        outcome("./a.sim.yml", wall_time=2.0, number=1),
        outcome("b//c.sim.yml", wall_time=3.0, number=1),
        outcome("never-ran.sim.yml", wall_time=0.0),
        outcome("nonsense.sim.yml", wall_time=1e300),
    )
    assert list(known_durations(earlier).values()) == [2.0, 3.0]
    assert scenarios(["d.sim.yml", "a.sim.yml", "b/c.sim.yml"], 2, names_of_files(known_durations(earlier))) == [
        ["b/c.sim.yml"],
        ["d.sim.yml", "a.sim.yml"],
    ]
    # A scenario takes what all of its engines take.
    earlier = results(outcome("a", wall_time=2.0, number=1), outcome("a", wall_time=3.0, number=1))
    assert list(known_durations(earlier).values()) == [5.0]


@given(st.permutations([("a", 3.0), ("b", 3.0), ("c", 2.0), ("d", 2.0), ("e", 2.0), ("a", 1.0), ("x", 9.0)]))
def test_the_order_of_earlier_results_does_not_matter(order: list[tuple[str, float]]) -> None:
    known = names_of_files(
        known_durations(results(*(outcome(name, wall_time=duration, number=1) for name, duration in order)))
    )
    assert scenarios(["a", "b", "c", "d", "e"], 2, known) == [["a", "d"], ["b", "c", "e"]]


def passed_on(scenario: str) -> None:
    """As a runner hands it to the action."""
    subprocess.run(["true"], env={"INPUT_SCENARIO": scenario}, check=True)


def names_of(size: int, each: int = 1000) -> list[str]:
    """So many bytes with the line ends between them, in names of that length and a last one."""
    names = [f"{place:0{each}}" for place in range(size // (each + 1))]
    return [*names, "x" * (size - len(names) * (each + 1))]


MAX_BYTES = 128 * 1024 - len("INPUT_SCENARIO=") - 1


@pytest.mark.process
def test_the_scenarios_of_a_shard_are_as_many_as_can_be_passed_on() -> None:
    (entry,) = dealt(names_of(MAX_BYTES), 1)
    passed_on(entry["scenario"])
    with pytest.raises(OSError, match="Argument list too long"):
        passed_on(entry["scenario"] + "x")
    with pytest.raises(UsageError) as raised:
        dealt(names_of(MAX_BYTES + 1), 1)
    assert str(raised.value) == (
        "shard 1 of 1 would be 131 names of 131.1 kB, but a variable of a runner holds 128 KiB at most; "
        "use more shards, or use a matrix of folders or of `shard: I/N`, which needs no names"
    )
    assert len(dealt(names_of(MAX_BYTES + 1), 2)) == 2


def test_bytes_are_counted_and_limited() -> None:
    with pytest.raises(UsageError, match=r"shard 1 of 2 would be 50 names of 150\.1 kB"):
        dealt([f"{place:02}" + "\u20ac" * 998 + "x" * 5 for place in range(100)], 2)
    names = names_of(499_000)
    assert len(matrix_text([of(name) for name in names], [], 8, {})) <= 500_000
    with pytest.raises(UsageError, match=r"would be 501\.\d kB long, but GitHub accepts 500 kB.*`shard: I/N`"):
        dealt(names_of(501_000), 8)
    entries = json.loads(matrix_text([of("push.sim.yml", *range(1, 10_001))], [], 4, {}))["include"]
    assert max(len(entry["scenario"]) for entry in entries) < MAX_BYTES


@pytest.mark.parametrize("name", ["a\nb", "a\rb", "a\u2028b", " a", "a ", "a\u00a0", os.fsdecode(b"a\xff")])
def test_a_name_that_cannot_be_a_line_is_refused(name: str) -> None:
    for names, empty in (["fine", name], []), (["fine"], [name]):
        with pytest.raises(UsageError, match="a matrix cannot contain a name") as raised:
            matrix_text([of(name) for name in names], empty, 2, {})
        told = str(raised.value)
        assert told.isprintable()
        assert repr(name) in told
        assert "fine" not in told


def test_a_file_is_dealt_by_its_scenarios_and_named_alone_where_a_shard_has_all_of_it() -> None:
    files = [of("many", 1, 2, 3, 4), of("lone"), FileOfScenarios(Path("some"), (7, 9), alone=False)]
    entries = json.loads(matrix_text(files, [], 3, {}))["include"]
    assert [entry["scenario"] for entry in entries] == ["many::1,4\nsome::9", "many::2\nlone", "many::3\nsome::7"]
    (entry,) = json.loads(matrix_text(files, [], 1, {}))["include"]
    assert entry["scenario"] == "many\nlone\nsome::7,9"
    # A scenario that nobody knows counts as the mean of its file.
    known: dict[Unit, float] = {(compared_name("many"), 1): 9.0, (compared_name("lone"), 1): 1.0}
    files = [of("many", 1, 2), of("lone"), of("new")]
    # 9 and 9, 1, and the mean of all that are known, 5.
    entries = json.loads(matrix_text(files, [], 2, known))["include"]
    assert [entry["scenario"] for entry in entries] == ["many::1\nnew", "many::2\nlone"]


@given(sizes=st.lists(st.integers(1, 30), min_size=1, max_size=6), count=st.integers(1, 8))
def test_every_scenario_of_a_file_is_there_once(sizes: list[int], count: int) -> None:
    files = [of(f"f{place}", *range(1, size + 1)) for place, size in enumerate(sizes)]
    entries = json.loads(matrix_text(files, [], count, {}))["include"]
    assert len(entries) == min(count, sum(sizes))
    found = [split(line) for entry in entries for line in entry["scenario"].split("\n")]
    every = {file.path.name: set(file.numbers) for file in files}
    dealt = [(name, number) for name, numbers in found for number in numbers or every[name]]
    assert sorted(dealt) == [(name, number) for name, numbers in every.items() for number in sorted(numbers)]
