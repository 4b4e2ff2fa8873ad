"""Scalars against `at_least` and `at_most`."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from sim_action.assertions.path_length import PathLength
from sim_action.assertions.travel import Travel

both = pytest.mark.parametrize("kind", [Travel, PathLength])


@both
@pytest.mark.parametrize(
    ("bounds", "message"),
    [
        ({}, "give 'at_least', 'at_most' or both"),
        ({"at_least": 2, "at_most": 1}, "nothing is at least 2 m and at most 1 m; exchange the two?"),
        ({"at_least": 0}, "greater than 0"),
        ({"at_least": "-1 m"}, "greater than 0"),
        ({"at_most": "-1 m"}, "greater than or equal to 0"),
        ({"at_least": "1 s"}, "'s' is not a unit of length"),
        ({"at_leest": 1}, "Extra inputs"),
    ],
)
def test_bounds_that_ask_for_nothing_or_the_impossible_are_refused(
    kind: type[Travel | PathLength], bounds: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValidationError, match=message):
        kind.model_validate(bounds)


@pytest.mark.parametrize(
    ("bounds", "title"),
    [
        ({"at_least": 1.5}, "travel at least 1.5 m"),
        ({"at_most": 0}, "travel at most 0 m"),
        ({"at_least": "150 cm", "at_most": "2 m"}, "travel at least 1.5 m, at most 2 m"),
    ],
)
def test_the_title_says_what_is_asked(bounds: dict[str, Any], title: str) -> None:
    assert Travel.model_validate(bounds).title == title
