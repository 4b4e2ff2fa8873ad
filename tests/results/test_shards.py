"""Joining loses nothing, counts nothing twice, and says what is not there."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from itertools import chain, product
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.errors import ExitCode, InvalidPart, InvalidScenario, UsageError
from sim_action.results.outcome import Failure, Outcome
from sim_action.results.results_json import Results, ResultsFile, Shard, balanced, shards_text
from sim_action.results.shard_results import Listing, gates_of, merge_shards, read_run
from sim_action.scenario.selection import Unmatched
from tests.outcomes import gate_results, outcome, planned_gate, results, runs_of_gate, source, stored

COUNTS = st.integers(1, 20)
DURATIONS = st.lists(st.floats(0.001, 1000.0), max_size=40)


def test_shards_as_they_are_typed_and_dealt() -> None:
    # A shard is read as it is typed.
    assert Shard.parse("2/3", 7) == Shard(index=2, count=3, total=7)
    assert Shard.parse(" 256 / 256\n", 0) == Shard(index=256, count=256, total=0)
    assert str(Shard.parse("2/3", 7)) == "shard 2 of 3"
    # Results of a shard that cannot be are refused.
    with pytest.raises(InvalidPart, match="there is no shard 3 of 2"):
        Shard(index=3, count=2, total=9)
    # Every n th beginning with the i th.
    dealt = [Shard(index=i, count=3, total=7).dealt("abcdefg") for i in (1, 2, 3)]
    assert dealt == [list("adg"), list("be"), list("cf")]
    assert Shard(index=3, count=3, total=2).dealt("ab") == []


@pytest.mark.parametrize(
    "text",
    ["4/3", "0/3", "1/0", "1/257", "-1/3", "1", "1/", "/3", "1/3/5", "1.5/3", "a/b", "", "1/9999", "\uff11/\uff13"],
)
def test_what_is_no_shard_is_told_with_what_is_one(text: str) -> None:
    with pytest.raises(UsageError) as raised:
        Shard.parse(text, 7)
    assert str(raised.value).endswith("must be I/N with 1 <= I <= N <= 256, such as 1/3")
    assert str(raised.value).isprintable()


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


def files(*parts: Results) -> list[ResultsFile]:
    """In the folders 1, 2, ..."""
    return [ResultsFile(Path(str(place), "results.json"), part) for place, part in enumerate(parts, start=1)]


def names(parts: list[ResultsFile], listing: Listing | None = None) -> list[str]:
    return [entry.outcome.file or entry.outcome.name for entry in merge_shards(parts, listing)]


def listed(*names: str, empty: tuple[str, ...] = ()) -> Listing:
    return Listing([source(name) for name in names], empty)


def sharded(names: list[str], count: int, empty: tuple[str, ...] = ()) -> list[ResultsFile]:
    """What `run --shard 1/count` and its siblings leave behind."""
    total = len(names) + len(empty)
    parts = []
    for index in range(1, count + 1):
        outcomes = [outcome(name) for name in Shard(index=index, count=count, total=total).dealt(names)]
        outcomes += [Outcome.of_nothing(pattern) for pattern in empty if index == 1]
        parts.append(results(*outcomes, shard=(index, count, total)))
    return files(*parts)


def refused(parts: list[ResultsFile]) -> str:
    with pytest.raises(UsageError) as raised:
        merge_shards(parts, None)
    assert str(raised.value).isprintable()
    return str(raised.value)


LISTS = st.lists(st.from_regex(r"[a-z]{1,3}(/[a-z]{1,3})?", fullmatch=True), max_size=20, unique=True)
PATTERNS = st.lists(st.sampled_from(["nope*", "empty", "no/thing"]), unique=True)


@given(names_of_run=LISTS, patterns=PATTERNS, count=st.integers(1, 8), data=st.data())
def test_the_shards_of_a_list_become_that_list_again(
    names_of_run: list[str], patterns: list[str], count: int, data: st.DataObject
) -> None:
    patterns = patterns if names_of_run else []
    parts = data.draw(st.permutations(sharded(names_of_run, count, tuple(patterns))))
    assert names(parts) == [*names_of_run, *patterns]
    assert names(parts, listed(*names_of_run, empty=tuple(patterns))) == [*names_of_run, *patterns]


@given(names_of_run=LISTS.filter(bool), count=st.integers(2, 8), data=st.data())
def test_no_scenario_of_a_missing_shard_goes_unnoticed(
    names_of_run: list[str], count: int, data: st.DataObject
) -> None:
    complete = sharded(names_of_run, count)
    parts = data.draw(st.lists(st.sampled_from(complete), min_size=1, unique_by=id))
    lost = [made.file for part in complete if part not in parts for made in part.results.outcomes]
    by_shard = [entry.outcome for entry in merge_shards(parts, None) if entry.origin is None]
    absent = [part.results.shard.index for part in complete if part not in parts and part.results.shard]
    assert [list(indices(made.name)) for made in by_shard] == ([absent] if lost else [])
    by_name = [entry.outcome for entry in merge_shards(parts, listed(*names_of_run)) if entry.origin is None]
    assert sorted(made.file for made in by_name) == sorted(lost)
    assert all(made.exit_code is ExitCode.INVALID for made in [*by_shard, *by_name])
    assert names(parts, listed(*names_of_run)) == names_of_run


def indices(name: str) -> Iterator[int]:
    """Of shards, from how they are called, such as "shards 1-3, 5 of 9"."""
    for part in name.removeprefix("shards").removeprefix("shard").partition(" of ")[0].split(","):
        first, _, last = part.partition("-")
        yield from range(int(first), int(last or first) + 1)


def test_missing_shards_are_errors() -> None:
    # Many missing shards are one error.
    lone = files(results(shard=(8, 9, 5)))
    (entry,) = merge_shards(lone, None)
    (failure,) = entry.outcome.failures
    assert entry.outcome.name == "shards 1-7, 9 of 9"
    told = "shards 1-7, 9 of 9 returned no results; 5 of 5 scenarios have none; check their jobs"
    assert failure.message == told
    # A missing shard says how much is lost.
    parts = sharded(["a", "b", "c", "d", "e"], 3)
    missing = merge_shards([parts[0], parts[2]], None)[-1]
    (failure,) = missing.outcome.failures
    assert failure.message == "shard 2 of 3 returned no results; 2 of 5 scenarios have none; check its job"
    assert (missing.outcome.file, missing.outcome.location, failure.kind) == ("", None, "missing")
    # A listing that does not name all that is lost does not hide the missing shard.
    parts = sharded(["a", "b", "c", "d", "e"], 3)
    assert names([parts[0], parts[2]], listed("a", "b")) == ["a", "b", "c", "d", "shard 2 of 3"]


def test_the_order_of_results() -> None:
    # Results that are not of shard are in the order of their files.
    parts = files(results(outcome("b/c"), outcome("b")), results(outcome("c"), outcome("a")))
    assert names(parts) == ["a", "b", "b/c", "c"]
    assert names(parts[:1]) == ["b/c", "b"], "of one run alone, its own order"
    # With a listing they are in its order and what is not in it comes last.
    parts = files(results(outcome("b/c"), outcome("b")), results(outcome("c"), outcome("a")))
    assert names(parts, listed("c", "new", "b", "a")) == ["c", "new", "b", "a", "b/c"]


def test_scenarios_without_results() -> None:
    # What was named and holds nothing is an error unless it is one already.
    known = results(outcome("a"), Outcome.of_nothing("nope*"))
    entries = merge_shards(files(known), listed("a", empty=("nope*", "new*")))
    lost = [(entry.outcome.file, entry.origin is None) for entry in entries]
    assert lost == [("a", False), ("nope*", False), ("new*", True)]
    assert entries[-1].outcome.exit_code is ExitCode.INVALID
    # If no shard has left anything all that is listed is an error that says so.
    entries = merge_shards([], listed("b", "a", empty=("nope*",)))
    statuses = [(entry.outcome.file, entry.outcome.status) for entry in entries]
    assert statuses == [(name, "error") for name in ("b", "a", "nope*")]
    assert [failure.message for failure in entries[0].outcome.failures] == [
        "no shard returned any results; check the jobs that should have run the scenarios"
    ]
    # An outcome that is of no file is not taken for the current folder.
    missing = merge_shards(sharded(["a", "b"], 2)[:1], None)[-1].outcome
    entries = merge_shards(files(results(outcome("a"), missing)), listed("a", empty=(".",)))
    assert [entry.outcome.file for entry in entries] == ["a", ".", ""]


ABSENT = [Unmatched("--only", name, f"no scenario is named '{name}'") for name in ("b", "nope*")]


def test_what_selects_nothing_is_one_result_of_the_first_shard() -> None:
    unmatched = list(map(Outcome.of_unmatched, ABSENT))
    first, second = results(outcome("a"), *unmatched, shard=(1, 2, 4)), results(outcome("b"), shard=(2, 2, 4))
    assert names(files(first, second)) == ["a", "b", "--only b", "--only nope*"]
    listing = Listing([source("a"), source("b")], (), ABSENT)
    assert names(files(first, second), listing) == ["a", "b", "--only b", "--only nope*"]
    # Without the shard that reports it, the list does.
    entries = merge_shards(files(results(), second)[1:], listing)
    assert [entry.outcome.file or entry.outcome.name for entry in entries] == ["a", "b", "--only b", "--only nope*"]
    assert {entry.outcome.exit_code for entry in entries[2:]} == {ExitCode.INVALID}


SPELLINGS = [
    *("sim dir/s 1.sim.yml", "sim dir/../sim dir/s 1.sim.yml", "./sim dir//s 1.sim.yml"),
    str(Path.cwd() / "sim dir/s 1.sim.yml"),
]


@pytest.mark.parametrize("second", SPELLINGS)
@pytest.mark.parametrize("first", SPELLINGS)
def test_the_same_scenario_is_the_same_however_it_is_spelled(first: str, second: str) -> None:
    once = "each scenario may occur only once"
    message = refused(files(results(outcome(first)), results(outcome(second))))
    assert message == f"both 1/results.json and 2/results.json contain results of {second}; {once}"
    message = refused(files(results(outcome("a"), outcome(first), outcome(second))))
    assert message == f"1/results.json contains results of {second} twice; {once}"
    assert names(files(results(outcome(first))), listed(second)) == [first]


def test_a_link_is_what_it_leads_to_where_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    parts = files(results(outcome("real/a")), results(outcome("link/a")))
    assert names(parts) == ["link/a", "real/a"]
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to("real")
    assert "both 1/results.json and 2/results.json" in refused(parts)


@pytest.mark.parametrize("name", ["a\0b", "x" * 5000, "loop", "\ud800"])
def test_a_name_that_no_file_can_have_is_but_a_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "loop").symlink_to("loop")
    assert names(files(results(outcome(name), outcome("z"))), listed("z")) == ["z", name]


def test_shards_of_different_lists_are_refused() -> None:
    # Outcomes that are of no file are not the same.
    parts = sharded(["a", "b", "c"], 3)
    missing = merge_shards(parts[:1], None)[-1]
    again = files(results(outcome("x"), missing.outcome), results(outcome("y"), missing.outcome))
    assert len(merge_shards(again, None)) == 4
    # Shards of different counts are refused.
    told = refused(files(results(outcome("a"), shard=(1, 2, 2)), results(outcome("b"), shard=(2, 3, 2))))
    assert told == "1/results.json is shard 1 of 2, and 2/results.json is shard 2 of 3: they do not belong to one run"
    # The same shard twice is refused.
    told = refused(files(results(outcome("a"), shard=(1, 2, 2)), results(outcome("b"), shard=(1, 2, 2))))
    assert told == "both 1/results.json and 2/results.json are shard 1 of 2"
    # Shards of lists of different lengths are refused.
    told = refused(files(results(outcome("a"), shard=(1, 2, 2)), results(outcome("b"), shard=(2, 2, 3))))
    assert told == (
        "the shards belong to different lists: 1/results.json is shard 1 of 2 with 2 scenarios, "
        "and 2/results.json is shard 2 of 2 with 3"
    )
    # Results of different commits are refused; some state none.
    plain = results(outcome("a"))
    one, two = (results(outcome(sign)).model_copy(update={"commit": sign * 40}) for sign in "12")
    told = refused(files(plain, one, two))
    assert told.startswith("2/results.json is of commit 111111111111, and 3/results.json of 222222222222: run all")
    assert len(merge_shards(files(plain, one), None)) == 2


@pytest.mark.parametrize("second", [["b"], ["b", "c", "d"]])
def test_shards_that_do_not_add_up_are_refused(second: list[str]) -> None:
    told = refused(files(results(outcome("a"), shard=(1, 2, 3)), results(*map(outcome, second), shard=(2, 2, 3))))
    assert told == (
        "the shards belong to different lists: each states a total of 3, "
        f"but together they contain {1 + len(second)} scenarios"
    )


def test_more_outcomes_than_the_list_had_are_refused_before_the_shards_are_complete() -> None:
    assert "together they contain 2 scenarios" in refused(files(results(outcome("a"), outcome("b"), shard=(1, 2, 1))))


def spread(name: str, *numbers: int) -> list[Outcome]:
    return [outcome(name, number=number) for number in numbers]


def units(parts: list[ResultsFile], listing: Listing | None = None) -> list[tuple[str, int | None]]:
    return [(entry.outcome.file, entry.outcome.number) for entry in merge_shards(parts, listing)]


@given(sizes=st.lists(st.integers(1, 5), max_size=6), count=st.integers(1, 5), data=st.data())
def test_files_of_several_scenarios_become_what_they_were(sizes: list[int], count: int, data: st.DataObject) -> None:
    every = [(f"f{place}", number) for place, size in enumerate(sizes) for number in range(1, size + 1)]
    hands = [Shard(index=index, count=count, total=len(every)).dealt(every) for index in range(1, count + 1)]
    by_shard = [
        results(*(outcome(name, number=number) for name, number in hand), shard=(index, count, len(every)))
        for index, hand in enumerate(hands, start=1)
    ]
    assert units(files(*data.draw(st.permutations(by_shard)))) == every
    without = [part.model_copy(update={"shard": None}) for part in by_shard]
    assert units(files(*data.draw(st.permutations(without)))) == every


def test_scenarios_of_one_file() -> None:
    # Scenarios of one file may be in several results each in one.
    parts = files(results(*spread("a", 1, 3), outcome("b")), results(*spread("a", 2)))
    assert units(parts) == [("a", 1), ("a", 2), ("a", 3), ("b", None)]
    message = refused(files(results(*spread("a", 1, 3)), results(*spread("./a", 3))))
    assert message.startswith("both 1/results.json and 2/results.json contain results of 'a' in ./a; each scenario ")
    message = refused(files(results(*spread("a", 1, 1))))
    assert message == "1/results.json contains results of 'a' in a twice; each scenario may occur only once"
    # Of a file what has no result is missing by its own name.
    sweep = [source("a", number, f"push[x={number}]", group="push") for number in (1, 2, 3)]
    listing = Listing([*sweep, source("a", 4, "stand")], [])
    entries = merge_shards(files(results(*spread("a", 2))), listing)
    assert [(entry.outcome.name, entry.outcome.group, entry.origin is None) for entry in entries] == [
        ("push[x=1]", "push", True),
        ("a", None, False),
        ("push[x=3]", "push", True),
        ("stand", None, True),
    ]


def test_runs_on_engines_and_variations() -> None:
    # Runs of one scenario on several engines are dealt as one.
    def runs(number: int) -> list[Outcome]:
        made = outcome("a", number=number)
        return [made.model_copy(update={"name": f"a {number} [{engine}]"}) for engine in ("mujoco", "pybullet")]

    parts = files(results(*runs(1), *runs(3), shard=(1, 2, 3)), results(*runs(2), shard=(2, 2, 3)))
    assert units(parts) == [("a", 1), ("a", 1), ("a", 2), ("a", 2), ("a", 3), ("a", 3)]
    # Variations that cannot be run are told by the first and not missing.
    sweep = [source("a", number, f"push[x={number}]", group="push") for number in (1, 2, 3)]
    broken = Outcome.of_refused(replace(sweep[0], line=4).refused(InvalidScenario([])))
    assert (broken.name, broken.number, broken.line) == ("push", 1, 4)
    failure = Failure(kind="invalid", title="invalid scenario", message="no robot")
    failed = files(results(broken.model_copy(update={"failures": (failure,)})))
    entries = merge_shards(failed, Listing([*sweep, source("a", 4)], []))
    assert [entry.origin is None for entry in entries] == [False, True]


def test_a_gate_is_that_of_its_scenario() -> None:
    """Results from elsewhere must not claim less."""
    stated, lenient = planned_gate(61), planned_gate(61, passes={"at_least": "1 %"})
    listing = Listing([replace(source("slip"), gate=stated)], [])
    (part,) = files(results().model_copy(update={"gates": (lenient,)}))
    assert gates_of([part]) == (lenient,)
    with pytest.raises(UsageError, match=r"the gate of 'slip' in \S+ is not that of scenarios/slip.sim.yml"):
        gates_of([part], listing)


def test_each_outcome_has_the_folder_of_its_files(tmp_path: Path) -> None:
    for index in (1, 2):
        stored(tmp_path / "shards" / f"{index}", results(outcome(f"{index}.sim.yml"), shard=(index, 2, 2)))
    whole = read_run(str(tmp_path / "shards"))
    assert [run.file for run in whole.outcomes] == ["1.sim.yml", "2.sim.yml"]
    assert [whole.folders[id(run)] for run in whole.outcomes] == [tmp_path / "shards/1", tmp_path / "shards/2"]
    # A gate is judged, and has no files.
    planned = planned_gate(runs=3)
    stored(tmp_path / "old", gate_results(planned, *runs_of_gate(planned, passed=3)))
    whole = read_run(str(tmp_path / "old"))
    assert [run.statistics is not None for run in whole.outcomes] == [True, False, False, False]
    assert [id(run) in whole.folders for run in whole.outcomes] == [False, True, True, True]


def test_what_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"no results\.json found at .*; name a results file or its folder"):
        read_run(str(tmp_path / "none"))
    (tmp_path / "results.json").write_text("{}")
    with pytest.raises(UsageError, match="is not a valid results file"):
        read_run(str(tmp_path))
    # So is a gate without a place.
    planned = planned_gate(runs=3)
    path = gate_results(planned, *runs_of_gate(planned, passed=3)).write(tmp_path)
    written = json.loads(path.read_text())
    written["gates"][0]["line"] = 0
    path.write_text(json.dumps(written))
    with pytest.raises(UsageError, match=r"is not a valid results file: gates\.0\.line: "):
        read_run(str(tmp_path))
