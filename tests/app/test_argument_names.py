from __future__ import annotations

import pytest

from sim_action.app.library import naming_arguments
from sim_action.core.errors import InvalidScenario, Location, Problem, UsageError


def test_an_error_of_use_names_arguments() -> None:
    with pytest.raises(UsageError) as raised, naming_arguments():
        raise UsageError("--exclude-tag: no tag; --cluster cannot be combined with --allow-outside")
    assert str(raised.value) == "exclude_tags: no tag; cluster cannot be combined with allow_outside"


@pytest.mark.parametrize("text", ["a--only", "---only", "--only-one", "--no-deps", "git ls-files --others"])
def test_other_words_stay(text: str) -> None:
    with pytest.raises(UsageError) as raised, naming_arguments():
        raise UsageError(text)
    assert str(raised.value) == text


def test_problems_keep_their_places() -> None:
    place = Location("a.sim.yml", 3, 1)
    with pytest.raises(InvalidScenario) as raised, naming_arguments():
        raise InvalidScenario([Problem(place, "allow it with --allow-outside")])
    assert raised.value.problems == (Problem(place, "allow it with allow_outside"),)
    assert str(raised.value) == "a.sim.yml:3:1: allow it with allow_outside"
