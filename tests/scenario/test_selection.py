"""Which scenarios are meant by names and tags, and what is said when none is."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_action.core.errors import InvalidScenario, Location, Problem, UsageError
from sim_action.core.workspace import Workspace
from sim_action.core.yaml_document import Document
from sim_action.scenario.selection import Scenarios, Selection, listing, selected
from sim_action.scenario.source import Refused, Source

HERE = Workspace(Path(), Path())


def source(name: str, *tags: str, group: str | None = None) -> Source:
    return Source(Path("a.sim.yml"), HERE, Document("a.sim.yml", {"tags": tags}), name, 4, group)


PUSH = (source("push[friction=0.4]", "arm", group="push"), source("push[friction=0.8]", "arm", group="push"))
FILES: list[Scenarios] = [(source("drive", "nightly"), source("drive far")), PUSH]
BROKEN = Refused("b.sim.yml", "b.sim.yml", None, InvalidScenario([Problem(Location("b.sim.yml", 2, 1), "no YAML")]))


def names(files: list[Scenarios] | None = None, **asked: tuple[str, ...]) -> list[str]:
    return meant(FILES if files is None else files, Selection(**asked))


def meant(files: list[Scenarios], selection: Selection) -> list[str]:
    return [scenario.name for scenarios in selected(files, selection) for scenario in scenarios]


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
    assert meant(FILES, Selection(**asked)) == found


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
        (
            {"only": ("psh",)},
            "--only: no scenario is called 'psh'; did you mean 'push'? (allowed: drive, drive far, push)",
        ),
        ({"only": ("push[friction=0.5]",)}, "did you mean 'push[friction=0.8]'?"),
        (
            {"tags": ("nigtly",)},
            "--tag: no scenario has the tag 'nigtly'; did you mean 'nightly'? (allowed: arm, nightly)",
        ),
        ({"exclude": ("*",)}, "of 4 scenarios, none is selected"),
    ],
)
def test_nothing_is_an_error_with_the_nearest_names(asked: dict[str, tuple[str, ...]], told: str) -> None:
    with pytest.raises(UsageError) as refused:
        meant(FILES, Selection(**asked))
    assert told in str(refused.value)


def test_nothing_may_be_for_a_file_that_cannot_be_read() -> None:
    with pytest.raises(UsageError, match=r"(?s)none is selected.*b\.sim\.yml:2:1: no YAML"):
        names([*FILES, (BROKEN,)], only=("circle",))


def test_no_file_at_all_is_not_about_the_selection() -> None:
    assert selected([], Selection(only=("push",))) == []


def test_a_listing_has_names_places_and_tags() -> None:
    assert list(listing([*FILES[0], BROKEN])) == ["drive\ta.sim.yml:4\tnightly", "drive far\ta.sim.yml:4"]
