"""Which scenarios are meant by names and tags, and what is said when none is."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.errors import InvalidScenario, Location, Problem, UsageError
from sim_action.core.permissions import Permissions
from sim_action.core.workspace import Workspace, file_name
from sim_action.core.yaml_document import Document
from sim_action.scenario.selection import (
    Scenarios,
    Selected,
    Selection,
    Suite,
    listing,
    numbered,
    ranges_text,
    selected,
    split,
    unmatched_exclusions,
)
from sim_action.scenario.source import Refused, Source
from tests.scenarios import LEAST


@pytest.mark.parametrize(
    ("numbers", "text"), [([1], "1"), ([2, 1, 3], "1-3"), ([9, 1, 2, 5], "1-2,5,9"), (range(1, 10_001), "1-10000")]
)
def test_those_that_follow_each_other_are_one(numbers: list[int], text: str) -> None:
    assert ranges_text(numbers) == text


@given(st.sets(st.integers(1, 99_999), min_size=1, max_size=30))
def test_what_is_written_is_read(numbers: set[int]) -> None:
    assert split(numbered("deep/a b.sim.yml", numbers)) == ("deep/a b.sim.yml", frozenset(numbers))


@pytest.mark.parametrize("name", ["a.yml", "a::b", "a::", "::1", "a::1-", "a::1,,2", "a::-1", "a::123456", "a:1", ""])
def test_what_has_no_numbers_is_a_name(name: str) -> None:
    assert split(name) == (name, None)


def test_a_file_that_is_called_so_is_that_file(tmp_path: Path) -> None:
    name = str(tmp_path / "a::1")
    assert split(name) == (str(tmp_path / "a"), frozenset({1}))
    Path(name).touch()
    assert split(name) == (name, None)


SHARED = LEAST.partition("\n")[2]


@pytest.fixture
def many(tmp_path: Path) -> Path:
    path = tmp_path / "many.sim.yml"
    entries = "  - {name: one}\n  - {name: push, variations: {robot.pose.x: [0, 1, 2]}}\n  - {name: two}\n"
    path.write_text(f"scenarios:\n{entries}{SHARED}")
    return path


def found(suite: Suite) -> list[tuple[str, int]]:
    return [(scenario.name, scenario.number) for scenario in suite.scenarios(Permissions())]


def test_scenarios_have_numbers_variations_counted(many: Path) -> None:
    every = [("one", 1), ("push[x=0]", 2), ("push[x=1]", 3), ("push[x=2]", 4), ("two", 5)]
    assert found(Suite([many])) == every
    assert found(Suite([many], selection=Selection(only=("push", "two")))) == every[1:]
    assert found(Suite([many], numbers={file_name(many): frozenset({1, 4})})) == [every[0], every[3]]


def test_a_file_of_which_nothing_is_selected_is_no_file(many: Path, tmp_path: Path) -> None:
    other = tmp_path / "other.sim.yml"
    other.write_text(LEAST)
    suite = Suite([many, other], selection=Selection(only=("one",)))
    assert list(suite.read(Permissions()).files) == [many]
    # One that cannot be read is one.
    (tmp_path / "b.sim.yml").write_text("name: [")
    assert found(Suite([tmp_path / "b.sim.yml"])) == [("b.sim.yml", 1)]


@pytest.mark.parametrize("number", [0, 6])
def test_a_number_that_no_scenario_has_is_told(many: Path, number: int) -> None:
    with pytest.raises(UsageError, match=rf"many\.sim\.yml::{number}: the file has 5 scenarios, counted from 1"):
        found(Suite([many], numbers={file_name(many): frozenset({1, number})}))


HERE = Workspace(Path(), Path())


def source(name: str, *tags: str, group: str | None = None) -> Source:
    return Source(Path("a.sim.yml"), HERE, Document("a.sim.yml", {"tags": tags}), name, 4, group)


PUSH = (source("push[friction=0.4]", "arm", group="push"), source("push[friction=0.8]", "arm", group="push"))
FILES: list[Scenarios] = [(source("drive", "nightly"), source("drive far")), PUSH]
BROKEN = Refused("b.sim.yml", "b.sim.yml", None, InvalidScenario([Problem(Location("b.sim.yml", 2, 1), "no YAML")]))


def names(files: list[Scenarios] = FILES, /, **asked: tuple[str, ...]) -> list[str]:
    return [scenario.name for scenarios in selected(files, Selection(**asked)).scenarios for scenario in scenarios]


@pytest.mark.parametrize(
    ("asked", "found"),
    [
        ({}, ["drive", "drive far", "push[friction=0.4]", "push[friction=0.8]"]),
        ({"only": ("drive",)}, ["drive"]),
        ({"only": ("drive*",)}, ["drive", "drive far"]),
        ({"only": ("driv?", "*0.8]")}, ["drive", "push[friction=0.8]"]),
        ({"only": ("push",)}, ["push[friction=0.4]", "push[friction=0.8]"]),
        ({"only": ("push[friction=0.8]",)}, ["push[friction=0.8]"]),
        ({"only": ("push[*]",)}, ["push[friction=0.4]", "push[friction=0.8]"]),
        ({"only": ("push[friction=0.4] [mujoco]",)}, ["push[friction=0.4]"]),
        ({"exclude": ("push",)}, ["drive", "drive far"]),
        ({"only": ("drive*",), "exclude": ("*far",)}, ["drive"]),
        ({"tags": ("nightly",)}, ["drive"]),
        ({"tags": ("nightly", "arm")}, ["drive", "push[friction=0.4]", "push[friction=0.8]"]),
        ({"exclude_tags": ("arm",)}, ["drive", "drive far"]),
        ({"tags": ("arm",), "only": ("*0.4]",)}, ["push[friction=0.4]"]),
        ({"tags": ("arm",), "exclude_tags": ("nightly",)}, ["push[friction=0.4]", "push[friction=0.8]"]),
    ],
)
def test_what_is_meant(asked: dict[str, tuple[str, ...]], found: list[str]) -> None:
    assert names(**asked) == found


def test_a_name_with_wildcards_in_it_means_itself() -> None:
    """Whatever is printed runs that again, and nothing else."""
    odd = ["what?", "whats", "a*", "a*[x=1]", "a*[x=2]", "ab", "ab[x=1]", "[a]", "a", "br[x=1]", "br"]
    files: list[Scenarios] = [tuple(source(name, group=name.partition("[x")[0]) for name in odd)]
    for name in ("what?", "whats", "a*[x=1]", "ab[x=1]", "[a]", "br[x=1]", "a*[x=1] [mujoco]"):
        assert names(files, only=(name,)) == [name.removesuffix(" [mujoco]")]
        assert names(files, exclude=(name,)) == [other for other in odd if other != name.removesuffix(" [mujoco]")]
    assert names(files, only=("a*",)) == ["a*", "a*[x=1]", "a*[x=2]"]
    assert names(files, only=("what*",)) == ["what?", "whats"]


@given(st.lists(st.text("ab*?[]=,", min_size=1, max_size=5), min_size=1, max_size=8, unique=True))
def test_every_name_selects_exactly_itself(every: list[str]) -> None:
    files: list[Scenarios] = [(source(name),) for name in every]
    for name in every:
        assert names(files, only=(name,)) == [name]


def test_what_cannot_be_read_may_have_any_tag_and_no_other_name() -> None:
    files = [*FILES, (BROKEN,)]
    assert names(files, tags=("nightly",)) == ["drive", "b.sim.yml"]
    assert names(files, exclude_tags=("nightly",))[-1] == "b.sim.yml"
    assert names(files, only=("drive",)) == ["drive"]
    assert names(files, exclude=("b.sim.yml",))[-1] == "push[friction=0.8]"


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ({"only": ("psh",)}, "no scenario is named 'psh'; did you mean 'push'? (allowed: drive, drive far, push)"),
        ({"only": ("push[friction=0.5]",)}, "did you mean 'push[friction=0.8]'?"),
        ({"tags": ("nigtly",)}, "no scenario has the tag 'nigtly'; did you mean 'nightly'? (allowed: arm, nightly)"),
        ({"exclude": ("*",)}, "of 4 scenarios, none is selected"),
    ],
)
def test_nothing_is_an_error_with_the_nearest_names(asked: dict[str, tuple[str, ...]], told: str) -> None:
    with pytest.raises(UsageError) as refused:
        names(**asked)
    assert told in str(refused.value)


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ({"only": ("drive", "psh", "psh")}, ["--only: no scenario is named 'psh'; did you mean 'push'?"]),
        ({"only": ("psh", "drive*", "dri")}, ["named 'psh'; did you mean 'push'?", "named 'dri'; did you mean"]),
        ({"only": ("drive", "push[friction=0.5]")}, ["named 'push[friction=0.5]'; did you mean 'push[friction="]),
        ({"only": ("drive", "q*")}, ["--only: no scenario is named 'q*'"]),
        ({"tags": ("nightly", "am")}, ["--tag: no scenario has the tag 'am'; did you mean 'arm'?"]),
        ({"only": ("drive", "psh"), "tags": ("nightly", "am")}, ["named 'psh'", "tag 'am'"]),
    ],
)
def test_each_pattern_must_match_something(asked: dict[str, tuple[str, ...]], told: list[str]) -> None:
    found = selected(FILES, Selection(**asked))
    lines = list(map(str, found.unmatched))
    assert len(lines) == len(told)
    assert all(part in line for part, line in zip(told, lines, strict=True))
    some = selected(FILES, Selection(**asked), complete=False)
    assert some.unmatched == ()
    for each in (found, some):
        assert next(scenario.name for scenarios in each.scenarios for scenario in scenarios) == "drive"


def test_a_pattern_that_another_option_leaves_nothing_of_has_matched() -> None:
    assert names(only=("drive", "push"), exclude=("push",)) == ["drive"]
    assert names(only=("drive", "push"), tags=("nightly",)) == ["drive"]
    assert names(tags=("nightly", "arm"), only=("drive",)) == ["drive"]
    # An unknown one may be for a file that cannot be read.
    (unmatched,) = selected([*FILES, (BROKEN,)], Selection(only=("drive", "circle"))).unmatched
    assert "named 'circle'" in str(unmatched)
    assert list(map(str, unmatched.unreadable)) == ["b.sim.yml:2:1: no YAML"]
    assert names([*FILES, (BROKEN,)], tags=("nightly", "round")) == ["drive", "b.sim.yml"]


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ({"exclude": ("drive", "drive *", "push")}, []),
        ({"exclude": ("psh", "drive")}, ["--exclude: no scenario is named 'psh'; did you mean 'push'?"]),
        ({"exclude_tags": ("arm", "nigtly")}, ["--exclude-tag: no scenario has the tag 'nigtly'; did you mean"]),
        ({"exclude": ("\x1b",)}, [r"named '\x1b'"]),
    ],
)
def test_exclusions_that_match_nothing_are_told(asked: dict[str, tuple[str, ...]], told: list[str]) -> None:
    lines = list(unmatched_exclusions(FILES, Selection(**asked)))
    assert len(lines) == len(told)
    assert all(part in line for part, line in zip(told, lines, strict=True))
    # What cannot be read may have the excluded tag.
    assert not list(unmatched_exclusions([*FILES, (BROKEN,)], Selection(exclude_tags=("round",))))


def test_an_exclusion_that_matches_nothing_is_a_warning(many: Path) -> None:
    told: list[str] = []
    suite = Suite([many], selection=Selection(exclude=("too", "one")), warn=told.append)
    assert [name for name, _ in found(suite)] == ["push[x=0]", "push[x=1]", "push[x=2]", "two"]
    assert told == ["--exclude: no scenario is named 'too'; did you mean 'two'? (allowed: one, push, two)"]


def test_a_part_of_the_list_may_lack_what_a_pattern_names(many: Path) -> None:
    """A shard of `matrix` names its scenarios by number; `--watch` runs the changed files again."""
    asked = Selection(only=("one", "elsewhere"), exclude=("far away",))
    told: list[str] = []
    some = {file_name(many): frozenset({1})}
    assert found(Suite([many], numbers=some, selection=asked, warn=told.append)) == [("one", 1)]
    assert found(Suite([many], selection=asked, complete=False, warn=told.append)) == [("one", 1)]
    assert told == []
    (unmatched,) = Suite([many], selection=asked).read(Permissions()).unmatched
    assert (unmatched.name, unmatched.pattern) == ("--only elsewhere", "elsewhere")
    assert "no scenario is named 'elsewhere'" in unmatched.message
    with pytest.raises(UsageError, match="of 5 scenarios, none is selected"):
        found(Suite([many], numbers=some, selection=Selection(only=("elsewhere",))))


def test_nothing_may_be_for_a_file_that_cannot_be_read() -> None:
    with pytest.raises(UsageError, match=r"(?s)none is selected.*b\.sim\.yml:2:1: no YAML"):
        names([*FILES, (BROKEN,)], only=("circle",))
    # No file at all is not about the selection.
    assert selected([], Selection(only=("push",))) == Selected([])


def test_a_listing_has_names_places_and_tags() -> None:
    assert list(listing([*FILES[0], BROKEN])) == ["drive\ta.sim.yml:4\tnightly", "drive far\ta.sim.yml:4"]
